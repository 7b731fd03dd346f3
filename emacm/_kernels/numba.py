"""The inner loops compiled by numba; see `_kernels_numpy` for what each of them does.

None that takes time holds Python's lock, so recordings in threads run side by side. The loops are
written so that the compiler can use vector units: no branch and no variable offset inside.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from emacm._kernels.numpy import reach

COMPILED = True
# The more is done at once, the less do threads wait for each other.
BLOCK = 1 << 18  # time samples that are spread
READ_BLOCK = 3 << 16  # time samples that signals are read off between
SEGMENT_BYTES = 2 << 20  # of segments

_AT_ONCE = 8  # signals that are spread in one pass
_PART = 8192  # samples that are spread before their points are thinned out
_SHARES = 1024  # of them, whose shares are held meanwhile
_ANY_ORDER = {"reassoc", "contract", "nsz", "arcp"}  # of sums, which costs 1e-15

Array = NDArray[np.floating]
Numbers = NDArray[np.int32]
Places = NDArray[np.uint32]  # unsigned: no check for one counted from the end
Pairs = NDArray[np.complexfloating]


def _compiled(function: Any) -> Any:
    """Compile at the first call; sums may be taken in another order."""
    return _compile(function, fastmath=_ANY_ORDER)


def _compiled_exactly(function: Any) -> Any:
    """Compile at the first call; every sum is taken as it is written."""
    return _compile(function)


def _compiled_for_a_few(function: Any) -> Any:
    """Compile what is called for a few samples only: sooner done than the lock is had back."""
    return _compile(function, nogil=False, fastmath=_ANY_ORDER)


def _compile(function: Any, *, nogil: bool = True, **options: Any) -> Any:
    """Keep what was compiled on disk where that is possible."""
    try:
        return njit(cache=True, nogil=nogil, **options)(function)
    except RuntimeError:  # neither the package's folder nor the user's can be written to
        return njit(nogil=nogil, **options)(function)


def survey(velocity: Array, half_step: float, stride: int) -> tuple[Array, Array, Array]:
    """Look once through a velocity."""
    angles, lowest, highest = np.empty((3, -(-len(velocity) // stride)))
    _survey(_read_only(velocity), half_step, stride, angles, lowest, highest)
    return angles, lowest, highest


def integrate(velocity: Array, half_step: float, starts: Array, stride: int) -> Array:
    """Sum trapezoids, piece by piece from known angles on; in float64."""
    angle = np.empty(len(velocity))
    _integrate(_read_only(velocity), half_step, starts, stride, angle)
    return angle


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
    """Add each sample, less the mean of its signal, to the grid points around it."""
    travel, means = _read_only(travel), means.astype(grid.dtype)
    for first in range(0, len(signals), _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        rows = _eight(signals[some], grid.dtype)
        _spread(travel, ends, scale, offset, kernel, rows, means[some], grid[some], n_points)


def upsample(signal: Array, taps: Array, factor: int, first: int, n_outputs: int) -> Array:
    """Make a signal denser in time."""
    phases = np.zeros((factor, 33), signal.dtype)
    for phase, row in enumerate(phases):
        part = taps[phase::factor]
        row[: len(part)] = part
    outputs = np.empty(n_outputs, signal.dtype)
    _upsample(_read_only(signal), phases[:, ::-1].copy(), first, outputs)
    return outputs


def decimate(
    grid: Array, used: int, first: int, taps: Array, means: Array, outputs: Array, done: int
) -> None:
    """Filter a grid and keep every other point; move what is still needed to its start."""
    count, means = outputs.shape[1] - done, means.astype(grid.dtype)
    _decimate(grid, used, first, _decimating(taps, grid), means, outputs, done, count)


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
    """Spread samples over a grid, and filter and thin out what of it is complete."""
    travel, means, taps = _read_only(travel), means.astype(grid.dtype), _decimating(taps, grid)
    grids = []
    for start in range(0, len(signals), _AT_ONCE):
        some = slice(start, start + _AT_ONCE)
        rows = _eight(signals[some], grid.dtype)
        held, n_points, n_done = _resample(
            travel,
            ends,
            scale,
            offset,
            kernel,
            rows,
            means[some],
            grid[some],
            used,
            first,
            taps,
            lag,
            outputs[some],
        )
        grids.append(held)
    return grids[0] if len(grids) == 1 else np.concatenate(grids), n_points, n_done


def places(
    reached: Array, first: int, n_angles: int, theta_s: float, dtype: type
) -> tuple[Numbers, Array]:
    """Say between which samples the angle grid is passed."""
    left: Numbers = np.empty(n_angles, np.int32)
    shares: Array = np.empty(n_angles, dtype)
    _places(_read_only(reached), 0, first, theta_s, left, shares)
    return left, shares


def read_off(
    reached: Array, first: int, theta_s: float, signals: list[Array], values: Array
) -> None:
    """Read signals off between their samples, by straight lines; Eq. (2.13) of Chirico."""
    reached = _read_only(reached)
    for start in range(0, len(signals), _AT_ONCE):
        rows = _eight(signals[start : start + _AT_ONCE], values.dtype)
        _read_off(reached, first, theta_s, rows, values[start : start + _AT_ONCE])


def windowed(
    signals: Array, first: int, step: int, window: Array, n_segments: int, remove_mean: bool
) -> Array:
    """Cut signals into segments and weight them."""
    segments = np.empty((len(signals), n_segments, len(window)), signals.dtype)
    _windowed(_read_only(signals), first, step, _read_only(window), remove_mean, segments)
    return segments


def paired(
    signals: Array, first: int, step: int, window: Array, n_segments: int, remove_mean: bool
) -> Pairs:
    """Cut signals into segments, weight them, and put two and two together."""
    pairs = _pairs(len(signals), n_segments, len(window), signals.dtype)
    signals, window = _read_only(signals), _read_only(window)
    _paired(signals, first, step, window, n_segments, remove_mean, pairs)
    return pairs.view(np.result_type(pairs, np.complex64))[..., 0]


def thinned(
    signals: Array,
    first: int,
    step: int,
    window: Array,
    n_segments: int,
    remove_mean: bool,
    taps: Array,
) -> Pairs:
    """Cut segments, weight them, filter them as if they went round, keep every fourth sample."""
    pairs = _pairs(len(signals), n_segments, len(window) // 4, signals.dtype)
    signals, window, taps = _read_only(signals), _read_only(window), _read_only(taps)
    _thinned(signals, first, step, window, n_segments, remove_mean, taps, pairs)
    return pairs.view(np.result_type(pairs, np.complex64))[..., 0]


def powers(lines: NDArray[np.complexfloating]) -> Array:
    """Sum the squared size of lines over segments; in float64."""
    total = np.zeros((len(lines), lines.shape[2]))
    _powers(lines, total)
    return total


def pair_powers(transforms: Pairs, n_lines: int) -> Array:
    """Sum the squared size of the first lines over segments transformed in pairs; in float64."""
    total = np.zeros((len(transforms), n_lines))
    _pair_powers(transforms, total)
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
    *tables: Any,
) -> Array:
    """Sum the powers of segments whose length is split by a prime; see `emacm.orders.fourier`."""
    total = np.zeros((len(signals), len(mix) // 2 + 1, 2, places.shape[1] // 2 + 1))
    cut = _read_only(signals), first, step, _read_only(window), n_segments, remove_mean
    _split_powers(*cut, places, _four_columns(mix), *tables, total)
    return total


def _eight(signals: list[Array], dtype: np.dtype) -> tuple[Array, ...]:
    """Return as many rows of one type as are compiled for; the last ones are not looked at."""
    rows = [_read_only(signal.astype(dtype, copy=False)) for signal in signals]
    return tuple(rows + rows[:1] * (_AT_ONCE - len(rows)))


def _decimating(taps: Array, grid: Array) -> Array:
    if len(taps) != 41:
        raise ValueError(f"the decimating filter must have 41 taps, got {len(taps)}.")
    return taps.astype(grid.dtype)


def _four_columns(mix: Array) -> Array:
    if len(mix) > 4:
        raise ValueError(f"a segment is split into four parts at most, got {len(mix)}.")
    columns = np.zeros((len(mix), 4), mix.dtype)
    columns[:, : len(mix)] = mix
    return columns


def _pairs(n_signals: int, n_segments: int, length: int, dtype: np.dtype) -> Array:
    """Return room for pairs of segments: real and imaginary part side by side."""
    return np.empty((n_signals, -(-n_segments // 2), length, 2), dtype)


def _read_only(signal: Array) -> Array:
    """Return a contiguous view that cannot be written to, so that one kind is compiled."""
    view = np.ascontiguousarray(signal)[:]
    view.flags.writeable = False
    return view


@_compiled_exactly
def _survey(velocity, half_step, stride, angles, lowest, highest):
    total = 0.0
    before = np.float64(velocity[0])
    for k in range(len(angles)):
        piece = velocity[k * stride : (k + 1) * stride]
        low = high = np.float64(piece[0])
        for i in range(len(piece)):
            now = np.float64(piece[i])
            if i or k:
                total += (before + now) * half_step
            if not i:
                angles[k] = total
            before = now
            low = now if now < low else low
            high = now if now > high else high
        lowest[k], highest[k] = low, high


@_compiled_exactly
def _integrate(velocity, half_step, starts, stride, angle):
    in_fours = len(velocity) // stride // 4 * 4
    for k in range(0, in_fours, 4):  # four sums side by side, as each waits for its last addition
        _integrate_four(
            velocity[k * stride : (k + 4) * stride],
            half_step,
            starts[k : k + 4],
            stride,
            angle[k * stride : (k + 4) * stride],
        )
    for first in range(in_fours * stride, len(velocity), stride):
        total = starts[first // stride]
        before = np.float64(velocity[first])
        angle[first] = total
        for i in range(first + 1, min(first + stride, len(velocity))):
            now = np.float64(velocity[i])
            total += (before + now) * half_step
            angle[i] = total
            before = now


@_compiled_exactly
def _integrate_four(velocity, half_step, starts, stride, angle):
    v0, v1 = velocity[:stride], velocity[stride : 2 * stride]
    v2, v3 = velocity[2 * stride : 3 * stride], velocity[3 * stride :]
    a0, a1 = angle[:stride], angle[stride : 2 * stride]
    a2, a3 = angle[2 * stride : 3 * stride], angle[3 * stride :]
    t0, t1, t2, t3 = starts[0], starts[1], starts[2], starts[3]
    a0[0], a1[0], a2[0], a3[0] = t0, t1, t2, t3
    for i in range(1, stride):
        t0 += (np.float64(v0[i - 1]) + np.float64(v0[i])) * half_step
        t1 += (np.float64(v1[i - 1]) + np.float64(v1[i])) * half_step
        t2 += (np.float64(v2[i - 1]) + np.float64(v2[i])) * half_step
        t3 += (np.float64(v3[i - 1]) + np.float64(v3[i])) * half_step
        a0[i], a1[i], a2[i], a3[i] = t0, t1, t2, t3


@_compiled
def _copy_with_neighbours(travel, start, ends, near):
    stop = start + len(near) - 2
    near[0] = travel[start - 1] if start else ends[0]
    near[len(near) - 1] = travel[stop] if stop < len(travel) else ends[1]
    farthest = travel[start]
    for i in range(start, stop):
        near[i - start + 1] = travel[i]
        farthest = max(farthest, travel[i])
    return farthest


@_compiled
def _shares(near, scale, offset, kernel, n_points, weights, cells):
    a0, a1, a2, a3, a4, a5 = kernel[0]
    b0, b1, b2, b3, b4, b5 = kernel[1]
    half_scale = 0.5 * abs(scale)
    w0, w1, w2, w3 = weights
    for i in range(len(cells)):
        position = near[i + 1] * scale + offset
        way = (near[i + 2] - near[i]) * half_scale
        inside = (position >= 1.0) & (position < n_points - 2)
        position = position if inside else 1.0
        way = way if inside else 0.0
        cell = np.int32(position)
        place = position - cell - 0.5
        square = place * place
        outer_even = ((a4 * square + a2) * square + a0) * way
        outer_odd = ((a5 * square + a3) * square + a1) * place * way
        inner_even = ((b4 * square + b2) * square + b0) * way
        inner_odd = ((b5 * square + b3) * square + b1) * place * way
        cells[i] = cell - 1
        w0[i] = outer_even + outer_odd
        w1[i] = inner_even + inner_odd
        w2[i] = inner_even - inner_odd
        w3[i] = outer_even - outer_odd


@_compiled
def _spread_one(signal, mean, weights, cells, row):
    w0, w1, w2, w3 = weights
    zero = mean - mean
    s0 = s1 = s2 = s3 = zero
    cell = cells[0]
    for i in range(len(cells)):
        if cells[i] != cell:  # what is complete leaves the registers
            row[cell] += s0
            if cells[i] == cell + 1:
                s0, s1, s2, s3 = s1, s2, s3, zero
            else:
                row[cell + 1] += s1
                row[cell + 2] += s2
                row[cell + 3] += s3
                s0 = s1 = s2 = s3 = zero
            cell = cells[i]
        value = signal[i] - mean
        s0 += value * w0[i]
        s1 += value * w1[i]
        s2 += value * w2[i]
        s3 += value * w3[i]
    row[cell] += s0
    row[cell + 1] += s1
    row[cell + 2] += s2
    row[cell + 3] += s3


@_compiled
def _spread_two(first, second, first_mean, second_mean, weights, cells, first_row, second_row):
    w0, w1, w2, w3 = weights
    zero = first_mean - first_mean
    s0 = s1 = s2 = s3 = zero
    t0 = t1 = t2 = t3 = zero
    cell = cells[0]
    for i in range(len(cells)):
        if cells[i] != cell:
            first_row[cell] += s0
            second_row[cell] += t0
            if cells[i] == cell + 1:
                s0, s1, s2, s3 = s1, s2, s3, zero
                t0, t1, t2, t3 = t1, t2, t3, zero
            else:
                first_row[cell + 1] += s1
                first_row[cell + 2] += s2
                first_row[cell + 3] += s3
                second_row[cell + 1] += t1
                second_row[cell + 2] += t2
                second_row[cell + 3] += t3
                s0 = s1 = s2 = s3 = zero
                t0 = t1 = t2 = t3 = zero
            cell = cells[i]
        one = first[i] - first_mean
        two = second[i] - second_mean
        s0 += one * w0[i]
        s1 += one * w1[i]
        s2 += one * w2[i]
        s3 += one * w3[i]
        t0 += two * w0[i]
        t1 += two * w1[i]
        t2 += two * w2[i]
        t3 += two * w3[i]
    first_row[cell] += s0
    first_row[cell + 1] += s1
    first_row[cell + 2] += s2
    first_row[cell + 3] += s3
    second_row[cell] += t0
    second_row[cell + 1] += t1
    second_row[cell + 2] += t2
    second_row[cell + 3] += t3


@_compiled
def _spread_part(near, start, scale, offset, kernel, signals, means, grid, n_points):
    n_times = len(near) - 2
    at_once = min(_SHARES, n_times)
    weights, cells = np.empty((4, at_once), grid.dtype), np.empty(at_once, np.uint32)
    for low in range(0, n_times, at_once):
        count = min(at_once, n_times - low)
        begin, end = start + low, start + low + count
        w = weights[0, :count], weights[1, :count], weights[2, :count], weights[3, :count]
        c = cells[:count]
        _shares(near[low : low + count + 2], scale, offset, kernel, n_points, w, c)
        for k in range(0, len(grid) - 1, 2):
            one, two = signals[k][begin:end], signals[k + 1][begin:end]
            _spread_two(one, two, means[k], means[k + 1], w, c, grid[k], grid[k + 1])
        if len(grid) % 2:
            k = len(grid) - 1
            _spread_one(signals[k][begin:end], means[k], w, c, grid[k])


_reach = _compiled(reach)


@_compiled
def _resample(
    travel, ends, scale, offset, kernel, signals, means, grid, used, first, taps, lag, outputs
):
    n_times, done, top = len(travel), 0, offset
    at_once = min(_PART, n_times)
    span = abs(travel[n_times - 1] - travel[0]) * scale
    if span > n_times:  # their points should stay in the processor's cache
        at_once = max(1, int(at_once * (n_times / span)))
    near = np.empty(at_once + 2)
    for start in range(0, n_times, at_once):
        count = min(at_once, n_times - start)
        farthest = _copy_with_neighbours(travel, start, ends, near[: count + 2])
        top = max(top, farthest * scale + offset)
        grid, used = _reach(grid, used, int(top) - 2 * done + 3)
        _spread_part(
            near[: count + 2],
            start,
            scale,
            offset - 2 * done,
            kernel,
            signals,
            means,
            grid,
            used,
        )
        ready = min(int((top - lag) // 2), outputs.shape[1]) - done
        if ready > 0:
            _decimate(grid, used, first, taps, means, outputs, done, ready)
            done, used = done + ready, used - 2 * ready
    return grid, used, done


@_compiled_for_a_few
def _spread(travel, ends, scale, offset, kernel, signals, means, grid, n_points):
    for start in range(0, len(travel), _PART):
        near = np.empty(min(_PART, len(travel) - start) + 2)
        _copy_with_neighbours(travel, start, ends, near)
        _spread_part(near, start, scale, offset, kernel, signals, means, grid, n_points)


@_compiled
def _upsample(signal, phases, first, outputs):
    factor = len(phases)
    line = np.empty(len(outputs) // factor + 1, signal.dtype)
    for start in range(min(factor, len(outputs))):
        phase = (first + start) % factor
        taps = phases[phase]
        count = (len(outputs) - start - 1) // factor + 1
        part = signal[(first + start) // factor - 16 :]
        for i in range(count):
            total = taps[1] * part[i + 1]
            for k in range(2, 33):  # of constant length, so that the loop over i is vectorised
                total += taps[k] * part[i + k]
            line[i] = total
        if phase == 0:  # where new samples meet old ones, a tap more
            for i in range(count):
                line[i] += taps[0] * part[i]
        for i in range(count):
            outputs[start + i * factor] = line[i]


@_compiled_for_a_few
def _decimate(grid, used, first, taps, means, outputs, done, n_outputs):
    even = np.empty(n_outputs + 20, grid.dtype)
    odd = np.empty(n_outputs + 20, grid.dtype)
    for r in range(len(grid)):
        row, output = grid[r], outputs[r][done : done + n_outputs]
        for j in range(n_outputs + 19):
            even[j] = row[first + 2 * j]
            odd[j] = row[first + 2 * j + 1]
        even[n_outputs + 19] = row[first + 2 * (n_outputs + 19)]
        for j in range(n_outputs):
            total = means[r] + taps[20] * even[j + 10]
            for k in range(10):  # of constant length, so that the loop over j is vectorised
                total += taps[2 * k] * (even[j + k] + even[j + 20 - k])
            for k in range(10):
                total += taps[2 * k + 1] * (odd[j + k] + odd[j + 19 - k])
            output[j] = total
        kept = used - 2 * n_outputs
        for j in range(kept):
            row[j] = row[2 * n_outputs + j]
        row[kept:used] = 0


@_compiled
def _places(reached, before, first, theta_s, left, shares):
    i, last = before, len(reached) - 2
    low, high = reached[i], reached[i + 1]
    for j in range(len(left)):
        angle = theta_s * (first + j)
        while i < last and high <= angle:
            i += 1
            low, high = high, reached[i + 1]
        left[j] = i
        shares[j] = 1.0 if angle >= high else max(0.0, (angle - low) / (high - low))
    return i


@_compiled
def _blend(signal, left, shares, values):
    following = signal[1:]
    for j in range(len(left)):
        place = np.uint32(left[j])
        low = signal[place]
        values[j] = low + shares[j] * (following[place] - low)


@_compiled
def _read_off(reached, first, theta_s, signals, values):
    n_signals, n_angles = values.shape
    left = np.empty(_PART, np.int32)
    shares = np.empty(_PART, values.dtype)
    before = 0
    for start in range(0, n_angles, _PART):
        count = min(_PART, n_angles - start)
        before = _places(reached, before, first + start, theta_s, left[:count], shares[:count])
        for k in range(n_signals):
            _blend(signals[k], left[:count], shares[:count], values[k, start : start + count])


@_compiled
def _weighted(part, window, remove_mean, segment):
    mean = 0.0
    if remove_mean:
        for i in range(len(window)):
            mean += part[i]
        mean /= len(window)
    for i in range(len(window)):  # in float64, as a mean may be far above what is on top of it
        segment[i] = (np.float64(part[i]) - mean) * window[i]


@_compiled
def _windowed(signals, first, step, window, remove_mean, segments):
    n_signals, n_segments, length = segments.shape
    for c in range(n_signals):
        for s in range(n_segments):
            part = signals[c, first + s * step : first + s * step + length]
            _weighted(part, window, remove_mean, segments[c, s])


@_compiled
def _paired(signals, first, step, window, n_segments, remove_mean, pairs):
    length = len(window)
    both = np.zeros((2, length), signals.dtype)
    for c in range(len(signals)):
        for s in range(n_segments):
            part = signals[c, first + s * step : first + s * step + length]
            _weighted(part, window, remove_mean, both[s % 2])
            if s % 2 or s == n_segments - 1:
                _side_by_side(both, s % 2 == 1, pairs[c, s // 2])


@_compiled
def _thinned(signals, first, step, window, n_segments, remove_mean, taps, pairs):
    length, beyond = len(window), len(taps) - 4
    segment = np.empty(length + beyond, signals.dtype)
    both = np.empty((2, length // 4), signals.dtype)
    for c in range(len(signals)):
        for s in range(n_segments):
            part = signals[c, first + s * step : first + s * step + length]
            _weighted(part, window, remove_mean, segment[:length])
            segment[length:] = segment[:beyond]
            _keep_every_fourth(segment, taps, both[s % 2])
            if s % 2 or s == n_segments - 1:
                _side_by_side(both, s % 2 == 1, pairs[c, s // 2])


@_compiled
def _side_by_side(both, full, pair):
    if not full:
        both[1] = 0
    one, other = both[0], both[1]
    for i in range(len(one)):
        pair[i, 0] = one[i]
        pair[i, 1] = other[i]


@_compiled
def _keep_every_fourth(segment, taps, output):
    zero = taps[0] - taps[0]
    for j in range(0, len(output), 8):
        j = min(j, len(output) - 8)
        part, kept = segment[4 * j : 4 * j + len(taps) + 28], output[j : j + 8]
        s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = zero
        for k in range(len(taps)):  # eight sums, so that a tap and a sample are loaded once for all
            tap = taps[k]
            s0 += tap * part[k]
            s1 += tap * part[k + 4]
            s2 += tap * part[k + 8]
            s3 += tap * part[k + 12]
            s4 += tap * part[k + 16]
            s5 += tap * part[k + 20]
            s6 += tap * part[k + 24]
            s7 += tap * part[k + 28]
        kept[0], kept[1], kept[2], kept[3] = s0, s1, s2, s3
        kept[4], kept[5], kept[6], kept[7] = s4, s5, s6, s7


@_compiled
def _powers(lines, total):
    n_signals, n_segments, _ = lines.shape
    n_orders = total.shape[1]
    for c in range(n_signals):
        row = total[c]
        for s in range(n_segments):
            line = lines[c, s]
            for k in range(n_orders):
                row[k] += _power(line[k])


@_compiled
def _pair_powers(transforms, total):
    n_signals, n_pairs, length = transforms.shape
    n_lines = total.shape[1]
    for c in range(n_signals):
        row = total[c]
        for s in range(n_pairs):
            line = transforms[c, s]
            near, far = line[:n_lines], line[length - n_lines + 1 :]
            row[0] += 2 * _power(near[0])
            for k in range(1, n_lines):
                row[k] += _power(near[k]) + _power(far[n_lines - 1 - k])
        for k in range(n_lines):
            row[k] *= 0.5


@_compiled
def _power(line):
    real, imaginary = np.float64(line.real), np.float64(line.imag)
    return real * real + imaginary * imaginary


@_compiled
def _split_powers(
    signals,
    first,
    step,
    window,
    n_segments,
    remove_mean,
    places,
    mix,
    cosines,
    sines,
    at_once,
    total,
):
    n_parts, n_folded = len(places), len(cosines)
    length = len(window)
    segment = np.empty(length, signals.dtype)
    sums = np.zeros((mix.shape[1], n_folded), signals.dtype)
    differences = np.zeros_like(sums)
    even = np.empty((at_once * n_parts, n_folded), signals.dtype)
    odd, real, imaginary = np.empty_like(even), np.empty_like(even), np.empty_like(even)
    for c in range(len(signals)):
        for start in range(0, n_segments, at_once):
            count = min(at_once, n_segments - start)
            for s in range(count):
                begin = first + (start + s) * step
                _weighted(signals[c, begin : begin + length], window, remove_mean, segment)
                _fold(segment, places, sums, differences)
                _mix(mix, sums, even[s * n_parts : (s + 1) * n_parts])
                _mix(mix, differences, odd[s * n_parts : (s + 1) * n_parts])
            used = count * n_parts
            np.dot(even[:used], cosines, real[:used])
            np.dot(odd[:used], sines, imaginary[:used])
            for s in range(count):
                rows = slice(s * n_parts, (s + 1) * n_parts)
                _add_powers(real[rows], imaginary[rows], total[c])


@_compiled
def _fold(segment, places, sums, differences):
    n_parts, prime = places.shape
    for part in range(n_parts):
        place, together, apart = places[part], sums[part], differences[part]
        together[0] = segment[place[0]]
        apart[0] = 0
        for j in range(1, prime // 2 + 1):
            near, far = segment[place[j]], segment[place[prime - j]]
            together[j] = near + far
            apart[j] = near - far


@_compiled
def _mix(mix, parts, rows):
    p0, p1, p2, p3 = parts[0], parts[1], parts[2], parts[3]
    for r in range(len(rows)):
        row = rows[r]
        a, b, c, d = mix[r]
        for j in range(len(row)):
            row[j] = (a * p0[j] + b * p1[j]) + (c * p2[j] + d * p3[j])


@_compiled
def _add_powers(real, imaginary, total):
    n_parts, n_folded = real.shape
    _add_power(real[0], imaginary[0], total[0, 0])
    for pair in range(1, (n_parts + 1) // 2):
        a, b, x, y = (
            real[2 * pair - 1],
            real[2 * pair],
            imaginary[2 * pair - 1],
            imaginary[2 * pair],
        )
        up, down = total[pair, 0], total[pair, 1]
        for j in range(n_folded):
            p, q = np.float64(a[j]), np.float64(b[j])
            u, v = np.float64(x[j]), np.float64(y[j])
            up[j] += (p + v) * (p + v) + (q - u) * (q - u)
            down[j] += (p - v) * (p - v) + (q + u) * (q + u)
    if n_parts % 2 == 0:
        _add_power(real[n_parts - 1], imaginary[n_parts - 1], total[n_parts // 2, 0])


@_compiled
def _add_power(real, imaginary, total):
    for j in range(len(real)):
        p, u = np.float64(real[j]), np.float64(imaginary[j])
        total[j] += p * p + u * u
