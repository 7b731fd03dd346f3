"""Loops that resample from time to shaft angle, in NumPy and SciPy; all in float64."""

from __future__ import annotations

import numpy as np
import scipy  # scipy.signal takes a tenth of a second to import, so it is imported on first use
from numpy.typing import NDArray

BLOCK = READ_BLOCK = 1 << 15  # time samples processed at a time, for which several arrays are held

Array = NDArray[np.floating]
Indices = NDArray[np.int32]


def resample(
    travel: Array,
    ends: tuple[float, float],
    scale: float,
    offset: float,
    kernel: Array,
    signals: list[Array],
    means: Array,
    grid: Array,
    part: int,
    n_points: Indices,
    ready: Indices,
    first: int,
    taps: Array,
    outputs: Array,
    done: int,
) -> None:
    """Spread samples part by part, and decimate the grid as far as it is complete after each.

    Each sample, less the mean of its signal, is added to the grid points around it.

    Parameters
    ----------
    travel : ndarray of shape (n_times,)
        Angle travelled [rad]; a sample is weighted by half the distance between its neighbours.
    ends : (float, float)
        Angle travelled at the neighbours of the first and the last sample [rad].
    scale, offset : float
        A sample lies at ``scale * travel + offset`` on the grid, before this is decimated; where
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
    part : int
        Samples of a part; the last one may be shorter.
    n_points : ndarray of shape (n_parts,)
        Columns of the grid in use when a part is spread.
    ready : ndarray of shape (n_parts,)
        Outputs that are complete after a part.
    first, taps, outputs, done
        As for `decimate`.
    """
    near = np.concatenate([ends[:1], travel, ends[1:]])
    for start, used, n_outputs in zip(range(0, len(travel), part), n_points, ready, strict=True):
        stop = min(start + part, len(travel))
        weights, cells = _weights(near[start : stop + 2], scale, offset, kernel, used)
        low, high = int(cells.min()), int(cells.max())
        cells -= low
        n_cells = high - low + 1
        for signal, mean, line in zip(signals, means, grid, strict=True):
            values = np.subtract(signal[start:stop], mean, dtype=np.float64)
            added = np.zeros(n_cells + 3)
            for k in range(4):
                added[k : k + n_cells] += np.bincount(cells, weights[k] * values, n_cells)
            line[low : high + 4] += added
        if n_outputs:
            decimate(grid, used, first, taps, means, outputs, done, n_outputs)
            done += n_outputs
            offset -= 2.0 * n_outputs


def _weights(
    near: Array, scale: float, offset: float, kernel: Array, n_points: int
) -> tuple[Array, NDArray[np.intp]]:
    """Return the weights of four grid points, shape (4, n_times), and the lowest of the points.

    `near` is the angle travelled at the samples and at one more on either side. Most of the time
    is spent on memory, so arrays are changed in place.
    """
    position = scale * near[1:-1]
    position += offset
    width = near[2:] - near[:-2]
    width *= 0.5 * abs(scale)
    cell = np.floor(position)
    outside = (cell < 1) | (cell >= n_points - 2)
    if outside.any():
        width[outside] = 0.0
        cell[outside] = position[outside] = 1.0
    position -= cell
    position -= 0.5
    square = position * position
    weights, even, odd = np.empty((4, len(square))), np.empty_like(square), np.empty_like(square)
    for k, part in enumerate(kernel):
        for share, powers in ((even, part[4::-2]), (odd, part[5::-2])):
            np.multiply(square, powers[0], out=share)
            share += powers[1]
            share *= square
            share += powers[2]
        odd *= position
        even *= width
        odd *= width
        np.add(even, odd, out=weights[k])
        np.subtract(even, odd, out=weights[3 - k])
    cell -= 1
    return weights, cell.astype(np.intp)


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
    grid: Array,
    used: int,
    first: int,
    taps: Array,
    means: Array,
    outputs: Array,
    done: int,
    n_outputs: int,
) -> None:
    """Filter a grid and keep every other point; move what is still needed to its start.

    Parameters
    ----------
    grid : ndarray of shape (n_signals, n_held)
        Its first `used` points are in use. Changed in place: the points from ``2 * n_outputs``
        upwards are moved to its start, followed by zeros.
    used : int
        At least ``first + 2 * (n_outputs - 1) + len(taps)``.
    first : int
        First point that the first output depends on; that of the next output is two points on.
    taps : ndarray of shape (41,)
        A symmetric filter.
    means : ndarray of shape (n_signals,)
        Added to the outputs.
    outputs : ndarray of shape (n_signals, done + n_outputs) or longer
        Filled with the points that are kept.
    done, n_outputs : int
        First output that is filled, and how many are.
    """
    part = grid[:, first : first + 2 * (n_outputs - 1) + len(taps)]
    filtered = scipy.signal.upfirdn(taps, part, down=2)
    half = len(taps) // 2
    kept_points = filtered[:, half : half + n_outputs]
    np.add(kept_points, means[:, np.newaxis], out=outputs[:, done : done + n_outputs])
    kept = used - 2 * n_outputs
    grid[:, :kept] = grid[:, 2 * n_outputs : used].copy()
    grid[:, kept:used] = 0


def interpolation_weights(
    reached: Array, first: int, n_angles: int, theta_s: float
) -> tuple[Indices, Array]:
    """Find the samples between which the shaft passes each angle of a uniform grid.

    Parameters
    ----------
    reached : ndarray of shape (n_times,)
        Largest angle travelled so far, never falling [rad].
    first : int
        Index of the first grid angle wanted.
    n_angles : int
        Number of grid angles wanted; all are passed within `reached`.
    theta_s : float
        Angle between grid angles [rad].

    Returns
    -------
    left : ndarray of int32, shape (n_angles,)
        The last sample before, up to ``n_times - 2``; of a plateau, its end.
    weights : ndarray of shape (n_angles,)
        Fraction of the distance to the next sample, 0..1.
    """
    angles = theta_s * np.arange(first, first + n_angles)
    indices = np.interp(angles, reached, np.arange(len(reached)))
    left = np.minimum(indices.astype(np.int32), np.int32(len(reached) - 2))
    low = reached[left]
    # From the angles again: the index has lost the digits taken by its integer part.
    with np.errstate(invalid="ignore", divide="ignore"):
        weights = (angles - low) / (reached[left + 1] - low)
    return left, np.where(weights > 0, np.minimum(weights, 1), 0)


def interpolate_linear(
    reached: Array, first: int, theta_s: float, signals: list[Array], values: Array
) -> None:
    """Interpolate signals linearly at uniform angles, Eq. (2.13) of Chirico.

    Parameters
    ----------
    reached, first, theta_s
        As for `interpolation_weights`.
    signals : list of ndarray of shape (n_times,)
    values : ndarray of shape (n_signals, n_angles)
        The result.
    """
    left, weights = interpolation_weights(reached, first, values.shape[1], theta_s)
    index = left.astype(np.intp)  # once, not for each signal
    for signal, value in zip(signals, values, strict=True):
        low = signal[index].astype(np.float64, copy=False)
        np.subtract(signal[1:][index], low, out=value)
        value *= weights
        value += low
