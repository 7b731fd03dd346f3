"""Loops over the segments of Welch's method, in NumPy and SciPy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

SEGMENT_BYTES = 1 << 19  # of the segments transformed at a time: they should stay in cache

Array = NDArray[np.floating]


def windowed(
    signals: Array, first: int, step: int, window: Array, n_segments: int, remove_mean: bool
) -> Array:
    """Cut signals into segments and multiply them by a window, in float64.

    Parameters
    ----------
    signals : ndarray of shape (n_signals, n_angles)
    first : int
        Start of the first segment.
    step : int
        Samples from one segment to the next.
    window : ndarray of shape (n_per_segment,)
    n_segments : int
        Number of segments; the last one ends within the signals.
    remove_mean : bool
        Subtract the mean of each segment first.

    Returns
    -------
    ndarray of shape (n_signals, n_segments, n_per_segment)
    """
    part = signals[:, first : first + (n_segments - 1) * step + len(window)]
    row, sample = part.strides
    segments = np.lib.stride_tricks.as_strided(
        part, (len(part), n_segments, len(window)), (row, step * sample, sample), writeable=False
    )
    if remove_mean:
        segments = segments - segments.mean(axis=-1, keepdims=True, dtype=np.float64)
        segments *= window
        return segments
    return segments * window


def powers(lines: NDArray[np.complexfloating]) -> Array:
    """Sum the squared magnitude of spectral lines over segments.

    Parameters
    ----------
    lines : ndarray of shape (n_signals, n_segments, n_lines)
        Fourier transforms.

    Returns
    -------
    ndarray of shape (n_signals, n_lines)
    """
    return (lines.real**2 + lines.imag**2).sum(axis=1)


def segment_powers(
    signals: Array,
    first: int,
    step: int,
    window: Array,
    n_segments: int,
    n_lines: int,
    remove_mean: bool,
) -> Array:
    """Sum the squared magnitude of the lowest spectral lines over segments, in float64.

    Parameters
    ----------
    signals, first, step, window, n_segments, remove_mean
        As for `windowed`.
    n_lines : int
        Lines wanted, at most ``n_per_segment // 2 + 1``.

    Returns
    -------
    ndarray of shape (n_signals, n_lines)
    """
    total = np.zeros((len(signals), n_lines))
    most = max(1, SEGMENT_BYTES // (8 * len(window)))  # segments of all rows
    n_rows = min(len(signals), most)
    for row in range(0, len(signals), n_rows):
        rows = slice(row, row + n_rows)
        for start in range(0, n_segments, most // n_rows):
            count = min(most // n_rows, n_segments - start)
            cut = signals[rows], first + start * step, step, window, count, remove_mean
            total[rows] += powers(fft.rfft(windowed(*cut), overwrite_x=True)[..., :n_lines])
    return total
