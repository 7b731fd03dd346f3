"""The inner loops in NumPy and SciPy: the reference, and what runs where numba is not installed.

Every function here has its twin in `_kernels_numba`, with the same arguments and results.
"""

from __future__ import annotations

import numpy as np
import scipy  # which imports scipy.signal, a tenth of a second, when it is used
from numpy.typing import NDArray
from scipy import sparse

COMPILED = False
BLOCK = READ_BLOCK = 1 << 15  # time samples in work at once, for which several arrays are held
SEGMENT_BYTES = 1 << 19  # of segments in work at once: they should stay in cache

Array = NDArray[np.floating]
Numbers = NDArray[np.int32]
Places = NDArray[np.uint32]
Pairs = NDArray[np.complexfloating]


def survey(velocity: Array, half_step: float, stride: int) -> tuple[Array, Array, Array]:
    """Look once through a velocity.

    Parameters
    ----------
    velocity : ndarray of shape (n_times,)
        Speed [rad/s].
    half_step : float
        Half a sampling interval [s].
    stride : int
        Samples in a piece; the last piece may be shorter.

    Returns
    -------
    angles : ndarray of shape (n_pieces,)
        Angle at the first sample of each piece [rad], summed from 0 sample by sample, so that it
        is the same to the last bit as a running sum over the whole.
    lowest, highest : ndarray of shape (n_pieces,)
        Speeds in each piece.
    """
    angles, total = [], 0.0
    at_once = max(1, BLOCK // stride) * stride
    for start in range(0, len(velocity), at_once):
        some = velocity[start : start + at_once + 1]
        angle = integrate(some, half_step, np.array([total]), len(some))
        angles.append(angle[: min(at_once, len(velocity) - start) : stride].copy())
        total = angle[-1]
    starts = np.arange(0, len(velocity), stride)
    return (
        np.concatenate(angles),
        np.minimum.reduceat(velocity, starts).astype(np.float64),
        np.maximum.reduceat(velocity, starts).astype(np.float64),
    )


def integrate(velocity: Array, half_step: float, starts: Array, stride: int) -> Array:
    """Sum trapezoids, piece by piece from known angles on; in float64.

    Parameters
    ----------
    velocity : ndarray of shape (n_times,)
        Speed [rad/s].
    half_step : float
        Half a sampling interval [s].
    starts : ndarray of shape (n_pieces,)
        Angle at the first sample of each piece [rad]: the sum itself comes to the same.
    stride : int
        Samples in a piece; the last piece may be shorter.

    Returns
    -------
    ndarray of shape (n_times,)
        Angle [rad].
    """
    speed = velocity.astype(np.float64)
    angle = np.empty_like(speed)
    angle[0] = starts[0]
    np.add(speed[1:], speed[:-1], out=angle[1:])
    angle[1:] *= half_step
    return np.cumsum(angle, out=angle)


def spread(
    travel: Array,
    ends: tuple[float, float],
    scale: float,
    offset: float,
    kernel: Array,
    signals: list[Array],
    means: Array,
    grid: Array,
    n_points: int,
) -> None:
    """Add each sample, less the mean of its signal, to the grid points around it.

    Parameters
    ----------
    travel : ndarray of shape (n_times,)
        Angle run; a sample stands for half the way between its neighbours.
    ends : (float, float)
        Angle run at the neighbours of the first and the last sample.
    scale, offset : float
        A sample lies at ``scale * travel + offset`` on the grid; where `scale` is negative it is a
        mirror image.
    kernel : ndarray of shape (2, 6)
        Shares of the outer and the inner grid point below the sample, as polynomials in its place
        within the cell, -1/2..1/2; those of the points above are their mirror images.
    signals : list of ndarray of shape (n_times,)
        One for each row of the grid.
    means : ndarray of shape (n_signals,)
        What is subtracted first.
    grid : ndarray of shape (n_signals, n_held)
        Changed in place, in its first `n_points` columns. Samples any of whose points would lie
        outside are passed over.
    """
    weights, cells = _shares(travel, ends, scale, offset, kernel, n_points)
    rows = cells + np.arange(4)[:, np.newaxis]
    low, high = int(cells.min()), int(cells.max()) + 4
    operator = sparse.csc_array(
        (weights.T.ravel(), (rows - low).T.ravel(), np.arange(0, rows.size + 1, 4)),
        shape=(high - low, len(cells)),
    )
    values = np.stack([row - mean for row, mean in zip(signals, means, strict=True)], axis=1)
    grid[:, low:high] += (operator @ values).T


def _shares(
    travel: Array,
    ends: tuple[float, float],
    scale: float,
    offset: float,
    kernel: Array,
    n_points: int,
) -> tuple[Array, NDArray[np.intp]]:
    """Return the shares of four grid points, shape (4, n_times), and the lowest of the points."""
    position = scale * travel + offset
    padded = np.concatenate([ends[:1], travel, ends[1:]])
    way = (padded[2:] - padded[:-2]) * (0.5 * abs(scale))
    cell = np.floor(position)
    outside = (cell < 1) | (cell >= n_points - 2)
    if outside.any():
        way[outside] = 0.0
        cell[outside] = position[outside] = 1.0
    place = position - cell - 0.5
    square = place * place
    weights = np.empty((4, len(place)))
    for k, share in enumerate(kernel):
        even = ((share[4] * square + share[2]) * square + share[0]) * way
        odd = ((share[5] * square + share[3]) * square + share[1]) * place * way
        weights[k], weights[3 - k] = even + odd, even - odd
    return weights, cell.astype(np.intp) - 1


def upsample(signal: Array, taps: Array, factor: int, first: int, n_outputs: int) -> Array:
    """Make a signal denser in time.

    Parameters
    ----------
    signal : ndarray of shape (n_times,)
        With 16 samples more on either side of what is wanted.
    taps : ndarray of shape (32 * factor + 1,)
        A symmetric filter.
    factor : int
        New samples for each old one.
    first : int
        New sample to begin with, counted from sample 0 of `signal`.
    n_outputs : int
        How many are wanted.

    Returns
    -------
    ndarray of shape (n_outputs,), of the dtype of `signal`
    """
    made = scipy.signal.upfirdn(taps.astype(signal.dtype), signal, up=factor)
    offset = first + len(taps) // 2
    return made[offset : offset + n_outputs]


def decimate(
    grid: Array, used: int, first: int, taps: Array, means: Array, outputs: Array, done: int
) -> None:
    """Filter a grid and keep every other point; move what is still needed to its start.

    Parameters
    ----------
    grid : ndarray of shape (n_signals, n_held)
        Of which the first `used` points are. Changed in place: the points from
        ``2 * n_outputs`` upwards come to its start, and zeros follow.
    used : int
        At least ``first + 2 * (n_outputs - 1) + len(taps)``.
    first : int
        First point that the first output reads; the next reads from two points on.
    taps : ndarray of shape (41,)
        A symmetric filter.
    means : ndarray of shape (n_signals,)
        What is added to the outputs.
    outputs : ndarray of shape (n_signals, done + n_outputs)
        Filled with the points that are kept.
    done : int
        Outputs that are left as they are.
    """
    n_outputs = outputs.shape[1] - done
    part = grid[:, first : first + 2 * (n_outputs - 1) + len(taps)]
    filtered = scipy.signal.upfirdn(taps.astype(grid.dtype), part, down=2)
    half = len(taps) // 2
    kept_points = filtered[:, half : half + n_outputs]
    np.add(kept_points, means.astype(grid.dtype)[:, np.newaxis], out=outputs[:, done:])
    kept = used - 2 * n_outputs
    grid[:, :kept] = grid[:, 2 * n_outputs : used].copy()
    grid[:, kept:used] = 0


def resample(
    travel: Array,
    ends: tuple[float, float],
    scale: float,
    offset: float,
    kernel: Array,
    signals: list[Array],
    means: Array,
    grid: Array,
    used: int,
    first: int,
    taps: Array,
    lag: float,
    outputs: Array,
) -> tuple[Array, int, int]:
    """Spread samples over a grid, and filter and thin out what of it is complete.

    Parameters
    ----------
    travel, ends, scale, offset, kernel, signals, means
        As for `spread`; `scale` is positive, and no sample lies below the grid.
    grid, used, first, taps
        As for `decimate`. Where the samples reach beyond it, the grid is made longer.
    lag : float
        Points between the farthest sample so far and what is complete: an output may read the
        points so far below it that samples to come, and mirror images, stay clear of them.
    outputs : ndarray of shape (n_signals, n_outputs)
        Filled from its start, at most to its end.

    Returns
    -------
    grid : ndarray of shape (n_signals, n_held)
        What is left of the grid: that of before, or a longer one.
    used : int
        Its points.
    n_done : int
        Outputs that were filled; the grid begins twice as many points later.
    """
    top = scale * float(travel.max()) + offset
    grid, used = reach(grid, used, int(top) + 3)
    spread(travel, ends, scale, offset, kernel, signals, means, grid, used)
    n_done = max(0, min(int((top - lag) // 2), outputs.shape[1]))
    if n_done:
        decimate(grid, used, first, taps, means, outputs[:, :n_done], 0)
    return grid, used - 2 * n_done, n_done


def reach(grid: Array, used: int, n_points: int) -> tuple[Array, int]:
    """Return the grid, made longer if it must be, and its points: `n_points` or more.

    Parameters
    ----------
    grid : ndarray of shape (n_signals, n_held)
        Of which the first `used` points are.
    used : int
    n_points : int
        Points that are needed.

    Returns
    -------
    grid : ndarray of shape (n_signals, n_held)
    used : int
    """
    if n_points > grid.shape[1]:
        longer = np.zeros((len(grid), n_points + n_points // 4), grid.dtype)
        longer[:, :used] = grid[:, :used]
        grid = longer
    return grid, max(used, n_points)


def places(
    reached: Array, first: int, n_angles: int, theta_s: float, dtype: type
) -> tuple[Numbers, Array]:
    """Say between which samples the angle grid is passed.

    Parameters
    ----------
    reached : ndarray of shape (n_times,)
        Farthest angle run so far, never falling [rad].
    first : int
        Number of the first grid angle wanted.
    n_angles : int
        How many are wanted; all are passed within `reached`.
    theta_s : float
        Angle between grid angles [rad].
    dtype : type
        Of `shares`.

    Returns
    -------
    left : ndarray of int32, shape (n_angles,)
        The last sample before, up to ``n_times - 2``; of a plateau, its end.
    shares : ndarray of shape (n_angles,)
        How far on the way to the next, 0..1.
    """
    angles = theta_s * np.arange(first, first + n_angles)
    indices = np.interp(angles, reached, np.arange(len(reached)))
    left = np.minimum(indices.astype(np.int32), np.int32(len(reached) - 2))
    low = reached[left]
    # From the angles once more: the index has lost the digits of its whole part.
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = (angles - low) / (reached[left + 1] - low)
    return left, np.where(shares > 0, np.minimum(shares, 1), 0).astype(dtype)


def read_off(
    reached: Array, first: int, theta_s: float, signals: list[Array], values: Array
) -> None:
    """Read signals off between their samples, by straight lines; Eq. (2.13) of Chirico.

    Parameters
    ----------
    reached, first, theta_s
        As for `places`.
    signals : list of ndarray of shape (n_times,)
    values : ndarray of shape (n_signals, n_angles)
        The result.
    """
    left, shares = places(reached, first, values.shape[1], theta_s, values.dtype.type)
    index = left.astype(np.intp)  # once, not for each signal
    for signal, value in zip(signals, values, strict=True):
        low = signal[index]
        np.subtract(signal[1:][index], low, out=value)
        value *= shares
        value += low


def windowed(
    signals: Array, first: int, step: int, window: Array, n_segments: int, remove_mean: bool
) -> Array:
    """Cut signals into segments and weight them.

    Parameters
    ----------
    signals : ndarray of shape (n_signals, n_angles)
    first : int
        Start of the first segment.
    step : int
        Samples from one segment to the next.
    window : ndarray of shape (n_per_segment,)
        Weights, of the dtype of the signals.
    n_segments : int
        How many.
    remove_mean : bool
        Subtract the mean of each segment first.

    Returns
    -------
    ndarray of shape (n_signals, n_segments, n_per_segment)
    """
    views = np.lib.stride_tricks.sliding_window_view(signals, len(window), axis=-1)
    segments = views[:, first : first + (n_segments - 1) * step + 1 : step]
    if remove_mean:  # in float64, as a mean may be far above what is on top of it
        means = segments.mean(axis=-1, keepdims=True, dtype=np.float64)
        segments = segments - means
        segments *= window
        return segments.astype(signals.dtype, copy=False)
    return segments * window


def paired(
    signals: Array, first: int, step: int, window: Array, n_segments: int, remove_mean: bool
) -> Pairs:
    """Cut signals into segments, weight them, and put two and two together.

    Parameters
    ----------
    signals, first, step, window, n_segments, remove_mean
        As for `windowed`.

    Returns
    -------
    complex ndarray of shape (n_signals, (n_segments + 1) // 2, n_per_segment)
        The first segment of each pair is the real part, the second the imaginary one. Where one is
        left over, its pair is 0.
    """
    segments = windowed(signals, first, step, window, n_segments, remove_mean)
    shape = len(segments), -(-n_segments // 2), segments.shape[2]
    pairs = np.zeros(shape, np.result_type(segments, np.complex64))
    pairs.real = segments[:, ::2]
    pairs.imag[:, : n_segments // 2] = segments[:, 1::2]
    return pairs


def thinned(
    signals: Array,
    first: int,
    step: int,
    window: Array,
    n_segments: int,
    remove_mean: bool,
    taps: Array,
) -> Pairs:
    """Cut segments, weight them, filter them as if they went round, keep every fourth sample.

    Parameters
    ----------
    signals, first, step, window, n_segments, remove_mean
        As for `windowed`; the window's length is a multiple of four, at least 32, and not less
        than the taps'.
    taps : ndarray of shape (n_taps,)
        Of the filter, of the dtype of the signals; the first one weights the sample that is kept,
        the others those after it.

    Returns
    -------
    complex ndarray of shape (n_signals, (n_segments + 1) // 2, n_per_segment / 4)
        In pairs, as `paired` has them.
    """
    pairs = paired(signals, first, step, window, n_segments, remove_mean)
    round_again = np.concatenate([pairs, pairs[..., : len(taps) - 4]], axis=-1)
    views = np.lib.stride_tricks.sliding_window_view(round_again, len(taps), axis=-1)
    return np.matmul(views[..., ::4, :], taps)


def powers(lines: NDArray[np.complexfloating]) -> Array:
    """Sum the squared size of lines over segments; in float64.

    Parameters
    ----------
    lines : ndarray of shape (n_signals, n_segments, n_lines)
        Fourier transforms.

    Returns
    -------
    ndarray of shape (n_signals, n_lines)
    """
    squared = lines.real.astype(np.float64) ** 2 + lines.imag.astype(np.float64) ** 2
    return squared.sum(axis=1)


def pair_powers(transforms: Pairs, n_lines: int) -> Array:
    """Sum the squared size of the first lines over segments transformed in pairs; in float64.

    Of a + i b, line k is A_k + i B_k and line -k its mirror image, conj(A_k) + i conj(B_k), so
    what the squares of both have in common is twice that of A_k and B_k, and the rest cancels.

    Parameters
    ----------
    transforms : ndarray of shape (n_signals, n_pairs, n_per_segment)
        Fourier transforms of pairs, whole.
    n_lines : int
        At most ``n_per_segment // 2 + 1``.

    Returns
    -------
    ndarray of shape (n_signals, n_lines)
    """
    total = powers(transforms[..., :n_lines])
    total[:, 1:] += powers(transforms[..., :-n_lines:-1])
    total[:, 1:] /= 2
    return total


def split_powers(
    signals: Array,
    first: int,
    step: int,
    window: Array,
    n_segments: int,
    remove_mean: bool,
    places: Places,
    mix: Array,
    cosines: Array,
    sines: Array,
    at_once: int,
) -> Array:
    """Sum the powers of segments whose length is split by a prime; see `emacm.orders.fourier`.

    Parameters
    ----------
    signals, first, step, window, n_segments, remove_mean
        As for `windowed`.
    places, mix, cosines, sines, at_once
        How the length is split.

    Returns
    -------
    ndarray of shape (n_signals, n_parts // 2 + 1, 2, prime // 2 + 1)
        By line of the parts, by sign and size of line of the prime. Without sign where
        the line of the parts is real: the second is 0.
    """
    segments = windowed(signals, first, step, window, n_segments, remove_mean)
    parts = np.einsum("rp,nspj->nsrj", mix, segments[..., places])
    half, n_parts = len(cosines) - 1, len(mix)
    even, odd = parts[..., : half + 1].copy(), parts[..., : half + 1].copy()
    even[..., 1:] += parts[..., :half:-1]
    odd[..., 1:] -= parts[..., :half:-1]
    odd[..., 0] = 0
    lines = np.stack([even @ cosines - 1j * (odd @ sines), even @ cosines + 1j * (odd @ sines)], 2)
    total = np.zeros((len(signals), n_parts // 2 + 1, 2, half + 1))
    total[:, 0, 0] = powers(lines[:, :, 0, 0])
    for pair in range(1, (n_parts + 1) // 2):
        joined = lines[..., 2 * pair - 1, :] + 1j * lines[..., 2 * pair, :]
        total[:, pair] = np.stack([powers(joined[:, :, sign]) for sign in (0, 1)], axis=1)
    if n_parts % 2 == 0:
        total[:, -1, 0] = powers(lines[:, :, 0, -1])
    return total
