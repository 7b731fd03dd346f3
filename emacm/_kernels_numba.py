"""The inner loops compiled by numba; see `_kernels_numpy` for what each of them does.

None holds Python's lock, so recordings in threads run side by side. The loops are written so that
the compiler can use the processor's vector units: no branch and no variable offset inside.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

COMPILED = True
# The more is done at once, the less do threads wait for each other.
BLOCK = 1 << 17  # time samples
SEGMENT_BYTES = 3 << 20  # of segments

_AT_ONCE = 8  # signals that are spread in one pass
_PART = 8192  # samples whose shares are held meanwhile

Array = NDArray[np.floating]
Numbers = NDArray[np.int32]


def _compiled(function: Any) -> Any:
    """Compile at the first call; sums may be taken in another order, which costs 1e-15."""
    return _compile(function, fastmath={"reassoc", "contract", "nsz", "arcp"})


def _compiled_exactly(function: Any) -> Any:
    """Compile at the first call; every sum is taken as it is written."""
    return _compile(function)


def _compile(function: Any, **options: Any) -> Any:
    """Keep what was compiled on disk where that is possible."""
    try:
        return njit(cache=True, nogil=True, **options)(function)
    except RuntimeError:  # neither the package's folder nor the user's can be written to
        return njit(nogil=True, **options)(function)


def survey(velocity: Array, half_step: float, stride: int) -> tuple[Array, Array, Array]:
    """Look once through a velocity."""
    angles, lowest, highest = np.empty((3, -(-len(velocity) // stride)))
    _survey(_read_only(velocity), half_step, stride, angles, lowest, highest)
    return angles, lowest, highest


def integrate(velocity: Array, half_step: float, start: float) -> Array:
    """Sum trapezoids, from the angle `start` of the first sample on; in float64."""
    angle = np.empty(len(velocity))
    _integrate(_read_only(velocity), half_step, start, angle)
    return angle


def spread(
    travel: Array,
    scale: float,
    offset: float,
    kernel: Array,
    signals: list[Array],
    means: Array,
    grid: Array,
    n_points: int,
) -> None:
    """Add each sample, less the mean of its signal, to the grid points around it."""
    travel = _read_only(travel)
    for first in range(0, len(signals), _AT_ONCE):
        rows = _eight(signals[first : first + _AT_ONCE], grid.dtype)
        places = np.arange(first, min(first + _AT_ONCE, len(signals)))
        _spread(
            travel, scale, offset, kernel, *rows, places, means.astype(grid.dtype), grid, n_points
        )


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
    grid: Array, used: int, first: int, taps: Array, means: Array, n_outputs: int
) -> Array:
    """Filter a grid and keep every other point; move what is still needed to its start."""
    if len(taps) != 41:
        raise ValueError(f"the decimating filter must have 41 taps, got {len(taps)}.")
    outputs = np.empty((len(grid), n_outputs), grid.dtype)
    dtype = grid.dtype
    _decimate(grid, used, first, taps.astype(dtype), means.astype(dtype), outputs)
    return outputs


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
        _read_off(reached, first, theta_s, *rows, values[start : start + _AT_ONCE])


def windowed(
    signals: Array, first: int, step: int, window: Array, n_segments: int, remove_mean: bool
) -> Array:
    """Cut signals into segments and weight them."""
    segments = np.empty((len(signals), n_segments, len(window)), signals.dtype)
    _windowed(_read_only(signals), first, step, _read_only(window), remove_mean, segments)
    return segments


def thinned(
    signals: Array,
    first: int,
    step: int,
    window: Array,
    n_segments: int,
    remove_mean: bool,
    taps: Array,
) -> Array:
    """Cut segments, weight them, filter them as if they went round, keep every fourth sample."""
    outputs = np.empty((len(signals), n_segments, len(window) // 4), signals.dtype)
    signals, window, taps = _read_only(signals), _read_only(window), _read_only(taps)
    _thinned(signals, first, step, window, remove_mean, taps, outputs)
    return outputs


def powers(lines: NDArray[np.complexfloating]) -> Array:
    """Sum the squared size of lines over segments; in float64."""
    total = np.zeros((len(lines), lines.shape[2]))
    _powers(lines, total)
    return total


def split_powers(
    signals: Array,
    first: int,
    step: int,
    window: Array,
    n_segments: int,
    remove_mean: bool,
    *split: Any,
) -> Array:
    """Sum the powers of segments whose length is split by a prime; see `emacm.fourier`."""
    _, mix, cosines, _, _ = split
    total = np.zeros((len(signals), len(mix) // 2 + 1, 2, len(cosines)))
    signals, window = _read_only(signals), _read_only(window)
    _split_powers(signals, first, step, window, n_segments, remove_mean, *split, total)
    return total


def _eight(signals: list[Array], dtype: np.dtype) -> list[Array]:
    """Return as many rows of one type as are compiled for; the last ones are not looked at."""
    rows = [_read_only(signal.astype(dtype, copy=False)) for signal in signals]
    return rows + rows[:1] * (_AT_ONCE - len(rows))


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
def _integrate(velocity, half_step, start, angle):
    total = start
    before = np.float64(velocity[0])
    angle[0] = total
    for i in range(1, len(velocity)):
        now = np.float64(velocity[i])
        total += (before + now) * half_step
        angle[i] = total
        before = now


@_compiled
def _shares(travel, first, scale, offset, kernel, n_points, weights, cells):
    a0, a1, a2, a3, a4, a5 = kernel[0]
    b0, b1, b2, b3, b4, b5 = kernel[1]
    half_scale = 0.5 * abs(scale)
    w0, w1, w2, w3 = weights
    part = travel[first : first + len(cells) + 2]
    for i in range(len(cells)):
        position = part[i + 1] * scale + offset
        way = (part[i + 2] - part[i]) * half_scale
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
        if cells[i] != cell:  # the sums so far leave the registers
            row[cell] += s0
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
            first_row[cell + 1] += s1
            first_row[cell + 2] += s2
            first_row[cell + 3] += s3
            second_row[cell] += t0
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
def _spread(
    travel, scale, offset, kernel, x0, x1, x2, x3, x4, x5, x6, x7, places, means, grid, n_points
):
    signals = (x0, x1, x2, x3, x4, x5, x6, x7)
    n_signals = len(places)
    weights = np.empty((4, _PART), grid.dtype)
    cells = np.empty(_PART, np.int32)
    for start in range(0, len(travel) - 2, _PART):  # shares of so many samples stay in cache
        count = min(_PART, len(travel) - 2 - start)
        w = (weights[0, :count], weights[1, :count], weights[2, :count], weights[3, :count])
        c = cells[:count]
        _shares(travel, start, scale, offset, kernel, n_points, w, c)
        for k in range(0, n_signals - 1, 2):
            i, j = places[k], places[k + 1]
            one = signals[k][start : start + count]
            two = signals[k + 1][start : start + count]
            _spread_two(one, two, means[i], means[j], w, c, grid[i], grid[j])
        if n_signals % 2:
            i = places[n_signals - 1]
            last = signals[n_signals - 1][start : start + count]
            _spread_one(last, means[i], w, c, grid[i])


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


@_compiled
def _decimate(grid, used, first, taps, means, outputs):
    n_outputs = outputs.shape[1]
    even = np.empty(n_outputs + 20, grid.dtype)
    odd = np.empty(n_outputs + 20, grid.dtype)
    for r in range(len(grid)):
        row, output = grid[r], outputs[r]
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
        place = np.uint32(left[j])  # unsigned: no check for a place counted from the end
        low = signal[place]
        values[j] = low + shares[j] * (following[place] - low)


@_compiled
def _read_off(reached, first, theta_s, x0, x1, x2, x3, x4, x5, x6, x7, values):
    signals = (x0, x1, x2, x3, x4, x5, x6, x7)
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
def _thinned(signals, first, step, window, remove_mean, taps, outputs):
    n_signals, n_segments, _ = outputs.shape
    length, beyond = len(window), len(taps) - 4
    segment = np.empty(length + beyond, signals.dtype)
    for c in range(n_signals):
        for s in range(n_segments):
            part = signals[c, first + s * step : first + s * step + length]
            _weighted(part, window, remove_mean, segment[:length])
            segment[length:] = segment[:beyond]
            _keep_every_fourth(segment, taps, outputs[c, s])


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
                real, imaginary = np.float64(line[k].real), np.float64(line[k].imag)
                row[k] += real * real + imaginary * imaginary


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
    sums = np.empty((n_parts, n_folded), signals.dtype)
    differences = np.empty_like(sums)
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
    rows[:] = 0
    for r in range(len(mix)):
        row = rows[r]
        for part in range(len(mix)):
            weight, values = mix[r, part], parts[part]
            for j in range(len(row)):
                row[j] += weight * values[j]


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
