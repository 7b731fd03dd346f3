"""Loops over the segments of Welch's method, in NumPy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SEGMENT_BYTES = 1 << 19  # of the segments transformed at a time: they should stay in cache

Array = NDArray[np.floating]


def low_pass(length: int, n_lines: int) -> None:
    """Return what segments are filtered by before they are decimated: nothing, as it is slower.

    Parameters
    ----------
    length : int
        Samples of a segment.
    n_lines : int
        Lowest spectral lines that are wanted.

    Returns
    -------
    (ndarray of shape (n_taps,), ndarray of shape (n_lines,), int) or None
        Taps, factors of the powers of the lines, and samples that are kept of a segment.
    """


def set_segments(
    signals: Array,
    first: int,
    step: int,
    window: Array,
    remove_mean: bool,
    taps: Array | None,
    segments: Array,
) -> None:
    """Cut signals into segments and multiply them by a window.

    Parameters
    ----------
    signals : ndarray of shape (n_signals, n_angles)
    first : int
        Start of the first segment.
    step : int
        Samples from one segment to the next; the last one ends within the signals.
    window : ndarray of shape (n_per_segment,)
    remove_mean : bool
        Subtract the mean of each segment first.
    taps : ndarray or None
        What `low_pass` returns: each segment is filtered by them, and decimated.
    segments : ndarray of shape (n_signals, n_segments, n_per_segment)
        What is set; of decimated segments, the last axis is shorter.
    """
    part = signals[:, first : first + (segments.shape[1] - 1) * step + len(window)]
    row, sample = part.strides
    cut = np.lib.stride_tricks.as_strided(
        part, segments.shape, (row, step * sample, sample), writeable=False
    )
    if remove_mean:
        np.subtract(cut, cut.mean(axis=-1, keepdims=True), out=segments)
        segments *= window
    else:
        np.multiply(cut, window, out=segments)


def add_powers(transforms: NDArray[np.complexfloating], total: Array) -> None:
    """Add the squared magnitude of the lowest spectral lines of all segments.

    Parameters
    ----------
    transforms : ndarray of shape (n_signals, n_segments, n_all_lines)
        Fourier transforms.
    total : ndarray of shape (n_signals, n_lines)
        Changed in place.
    """
    lines = transforms[..., : total.shape[1]]
    total += (lines.real**2 + lines.imag**2).sum(axis=1)
