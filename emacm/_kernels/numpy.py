"""The inner loops in NumPy and SciPy: the reference, used where numba is not installed.

Each function has a twin in `emacm._kernels.numba`, with the same arguments and results. All
compute in float64.
"""

from __future__ import annotations

import numpy as np
import scipy  # scipy.signal takes a tenth of a second to import, so it is imported on first use
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

Array = NDArray[np.floating]
Place = tuple[float, float]
Parts = tuple[int, NDArray[np.integer], NDArray[np.integer]]
Filter = tuple[int, Array]
Made = tuple[Array, int]

# Several arrays are held besides the input, so less is processed at a time.
SPREAD_AT_ONCE = INTERPOLATED_AT_ONCE = 1 << 15  # samples
SEGMENT_BYTES = 1 << 19  # of segments that are transformed


def integrate(velocity: Array, half_step: float, start: float) -> Array:
    """Integrate a velocity by the trapezoidal rule, in float64.

    Parameters
    ----------
    velocity : ndarray of shape (n_times,)
        Velocity [rad/s]; contiguous and read-only, so that one kind of array is compiled for.
    half_step : float
        Half a sampling interval [s].
    start : float
        Angle at the first sample [rad].

    Returns
    -------
    ndarray of shape (n_times,)
        Angle [rad], accumulated sample by sample, so that a part of it equals a cumulative sum over
        the whole velocity bit for bit.
    """
    speed = velocity.astype(np.float64)
    return np.cumsum(np.append(start, (speed[1:] + speed[:-1]) * half_step))


def resample(
    near: Array,
    place: Place,
    kernel: Array,
    signals: list[Array],
    means: Array,
    grid: Array,
    parts: Parts,
    lowpass: Filter,
    made: Made,
) -> None:
    """Spread samples part by part, and decimate the grid as far as it is complete after each.

    Each sample, less the mean of its signal, is added to the grid points around it.

    Parameters
    ----------
    near : ndarray of shape (n_times + 2,)
        Angle travelled at the samples, and at one more on either side [rad]. A sample is weighted
        by half the distance between its neighbours.
    place : scale, offset
        A sample lies at ``scale * angle + offset`` on the grid, before this is decimated; where
        `scale` is negative it is a mirror image.
    kernel : ndarray of shape (2, 6)
        Weights of the outer and the inner grid point below the sample, as polynomials in its
        position within the cell, -1/2..1/2; those of the points above are their mirror images.
    signals : list of ndarray of shape (n_times,)
        One for each row of the grid.
    means : ndarray of shape (n_signals,)
        Subtracted first.
    grid : ndarray of shape (n_signals, n_held)
        Changed in place. Samples any of whose points would lie outside are skipped.
    parts : part, n_points, ready
        Samples of a part, the last of which may be shorter; columns of the grid in use when each
        part is spread, and outputs that are complete after it, arrays of shape (n_parts,).
    lowpass, made
        As for `decimate`.
    """
    (scale, offset), (part, n_points, ready), (outputs, done) = place, parts, made
    n_times = len(near) - 2
    for start, used, n_outputs in zip(range(0, n_times, part), n_points, ready, strict=True):
        stop = min(start + part, n_times)
        weights, cells = _weights(near[start : stop + 2], scale, offset, kernel, used)
        for signal, mean, line in zip(signals, means, grid, strict=True):
            values = np.subtract(signal[start:stop], mean, dtype=np.float64)
            for k in range(4):
                line += np.bincount(cells + k, weights[k] * values, len(line))
        if n_outputs:
            decimate(grid, used, lowpass, means, (outputs, done), n_outputs)
            done += n_outputs
            offset -= 2.0 * n_outputs


def _weights(
    near: Array, scale: float, offset: float, kernel: Array, n_points: int
) -> tuple[Array, NDArray[np.intp]]:
    """Return the weights of four grid points, shape (4, n_times), and the lowest of the points.

    `near` is the angle travelled at the samples and at one more on either side.
    """
    position = scale * near[1:-1] + offset
    width = (near[2:] - near[:-2]) * (0.5 * abs(scale))
    cell = np.floor(position)
    outside = (cell < 1) | (cell >= n_points - 2)
    width[outside] = 0.0
    cell[outside] = position[outside] = 1.0
    place = position - cell - 0.5
    square = place * place
    weights = np.empty((4, len(place)))
    for k, (c0, c1, c2, c3, c4, c5) in enumerate(kernel):
        even = ((c4 * square + c2) * square + c0) * width
        odd = ((c5 * square + c3) * square + c1) * place * width
        weights[k], weights[3 - k] = even + odd, even - odd
    return weights, cell.astype(np.intp) - 1


def upsample(signal: Array, taps: Array, factor: int, first: int, n_outputs: int) -> Array:
    """Raise the sampling rate of a signal over time.

    Parameters
    ----------
    signal : ndarray of shape (n_times,)
        With 16 more samples on either side of what is wanted.
    taps : ndarray of shape (32 * factor + 1,)
        A symmetric filter.
    factor : int
        New samples for each old one.
    first : int
        First new sample wanted, counted from sample 0 of `signal`.
    n_outputs : int
        Number of new samples wanted.

    Returns
    -------
    ndarray of shape (n_outputs,)
    """
    made = scipy.signal.upfirdn(taps, signal.astype(np.float64, copy=False), up=factor)
    offset = first + len(taps) // 2
    return made[offset : offset + n_outputs]


def decimate(
    grid: Array, used: int, lowpass: Filter, means: Array, made: Made, n_outputs: int
) -> None:
    """Filter a grid and keep every other point; move what is still needed to its start.

    Parameters
    ----------
    grid : ndarray of shape (n_signals, n_held)
        Its first `used` points are in use. Changed in place: the points from ``2 * n_outputs``
        upwards are moved to its start, followed by zeros.
    used : int
        At least ``first + 2 * (n_outputs - 1) + len(taps)``.
    lowpass : first, taps
        First point that the first output depends on (that of the next output is two points on), and
        a symmetric filter of 41 taps.
    means : ndarray of shape (n_signals,)
        Added to the outputs.
    made : outputs, done
        Array of shape (n_signals, done + n_outputs) or longer that is filled with the points that
        are kept, and the first output that is filled.
    n_outputs : int
        How many are filled.
    """
    (first, taps), (outputs, done) = lowpass, made
    part = grid[:, first : first + 2 * (n_outputs - 1) + len(taps)]
    filtered = scipy.signal.upfirdn(taps, part, down=2)
    half = len(taps) // 2
    kept_points = filtered[:, half : half + n_outputs]
    np.add(kept_points, means[:, np.newaxis], out=outputs[:, done : done + n_outputs])
    kept = used - 2 * n_outputs
    grid[:, :kept] = grid[:, 2 * n_outputs : used].copy()
    grid[:, kept:used] = 0


def interpolate_linear(
    reached: Array, first: int, theta_s: float, signals: list[Array], values: Array
) -> None:
    """Interpolate signals linearly at uniform angles, Eq. (2.13) of Chirico.

    Parameters
    ----------
    reached : ndarray of shape (n_times,)
        Largest angle travelled so far, never falling [rad].
    first : int
        Index of the first grid angle wanted; all are passed within `reached`.
    theta_s : float
        Angle between grid angles [rad].
    signals : list of ndarray of shape (n_times,)
    values : ndarray of shape (n_signals, n_angles)
        The result.
    """
    angles = theta_s * np.arange(first, first + values.shape[1])
    # Of a plateau, its end.
    left = np.interp(angles, reached, np.arange(len(reached))).astype(np.intp)
    left = np.minimum(left, len(reached) - 2)
    low = reached[left]
    # From the angles again: the index has lost the digits taken by its integer part.
    with np.errstate(invalid="ignore", divide="ignore"):
        weights = (angles - low) / (reached[left + 1] - low)
    weights = np.where(weights > 0, np.minimum(weights, 1), 0)
    for signal, value in zip(signals, values, strict=True):
        before = signal[left].astype(np.float64, copy=False)
        value[:] = before + weights * (signal[1:][left] - before)


def set_segments(
    signals: Array, first: int, step: int, window: Array, remove_mean: bool, segments: Array
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
    segments : ndarray of shape (n_signals, n_segments, n_per_segment)
        What is set.
    """
    part = signals[:, first : first + (segments.shape[1] - 1) * step + len(window)]
    cut = sliding_window_view(part, len(window), axis=1)[:, ::step]
    mean = cut.mean(axis=-1, keepdims=True) if remove_mean else 0.0
    np.multiply(cut - mean, window, out=segments)


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
