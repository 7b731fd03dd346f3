"""Loops that resample from time to shaft angle, compiled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from emacm._kernels.numba.compilation import compiled

# Large blocks: with small ones, threads wait for one another more often.
BLOCK = 1 << 18  # time samples that are spread
READ_BLOCK = 1 << 17  # time samples that are interpolated

_AT_ONCE = 8  # signals that are spread in one pass
_WEIGHTS = 2048  # of them, whose weights are held at a time
_RUN = 8192  # angles that are interpolated at a time

Array = NDArray[np.floating]
Indices = NDArray[np.integer]


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
    """Spread samples part by part, and decimate the grid as far as it is complete after each."""
    path = *_views([travel]), *ends, scale, offset, kernel
    parts = part, n_points, ready, first, taps
    for start in range(0, len(signals), _AT_ONCE):
        some = slice(start, start + _AT_ONCE)
        rows = _views(signals[some], _AT_ONCE), means[some], grid[some]
        _resample(*path, *rows, *parts, outputs[some], done)


def upsample(signal: Array, taps: Array, factor: int, first: int, n_outputs: int) -> Array:
    """Raise the sampling rate of a signal over time."""
    phases = np.zeros((factor, 33))
    for phase, row in enumerate(phases):
        part = taps[phase::factor]
        row[: len(part)] = part
    outputs = np.empty(n_outputs)
    _upsample(*_views([signal]), phases[:, ::-1].copy(), first, outputs)
    return outputs


def interpolation_weights(
    reached: Array, first: int, n_angles: int, theta_s: float
) -> tuple[Indices, Array]:
    """Find the samples between which the shaft passes each angle of a uniform grid."""
    left: Indices = np.empty(n_angles, np.int32)
    weights = np.empty(n_angles)
    _interpolation_weights(*_views([reached]), 0, first, theta_s, left, weights)
    return left, weights


def interpolate_linear(
    reached: Array, first: int, theta_s: float, signals: list[Array], values: Array
) -> None:
    """Interpolate signals linearly at uniform angles, Eq. (2.13) of Chirico."""
    (reached,) = _views([reached])
    for start in range(0, len(signals), _AT_ONCE):
        some = slice(start, start + _AT_ONCE)
        _interpolate_linear(reached, first, theta_s, _views(signals[some], _AT_ONCE), values[some])


def _views(signals: Sequence[Array], at_least: int = 1) -> tuple[Array, ...]:
    """Return contiguous read-only views in float64, so that one kind of array is compiled for.

    Where there are fewer than are compiled for, the first one is repeated, which has no effect.
    """
    rows = []
    for signal in signals:
        row = np.ascontiguousarray(signal, np.float64)[:]
        row.flags.writeable = False
        rows.append(row)
    return (*rows, *rows[:1] * (at_least - len(rows)))


@compiled
def _set_weights(near, scale, offset, kernel, n_points, weights, cells):
    w0, w1, w2, w3 = weights
    a0, a1, a2, a3, a4, a5 = kernel[0]
    b0, b1, b2, b3, b4, b5 = kernel[1]
    half_scale = 0.5 * abs(scale)
    for i in range(len(cells)):
        position = near[i + 1] * scale + offset
        width = (near[i + 2] - near[i]) * half_scale
        inside = (position >= 1.0) & (position < n_points - 2)
        position = position if inside else 1.0
        width = width if inside else 0.0
        cell = np.int32(position)
        place = position - cell - 0.5
        square = place * place
        outer_even = ((a4 * square + a2) * square + a0) * width
        outer_odd = ((a5 * square + a3) * square + a1) * place * width
        inner_even = ((b4 * square + b2) * square + b0) * width
        inner_odd = ((b5 * square + b3) * square + b1) * place * width
        cells[i] = cell - 1
        w0[i] = outer_even + outer_odd
        w1[i] = inner_even + inner_odd
        w2[i] = inner_even - inner_odd
        w3[i] = outer_even - outer_odd


@compiled
def _spread_two(signals, means, weights, cells, rows):
    x_s, x_t = signals
    mean_s, mean_t = means
    row_s, row_t = rows
    w0, w1, w2, w3 = weights
    s0 = s1 = s2 = s3 = 0.0
    t0 = t1 = t2 = t3 = 0.0
    cell = cells[0]
    for i in range(len(cells)):
        if cells[i] != cell:  # what is complete leaves the registers
            row_s[cell] += s0
            row_t[cell] += t0
            if cells[i] == cell + 1:
                s0, s1, s2, s3 = s1, s2, s3, 0.0
                t0, t1, t2, t3 = t1, t2, t3, 0.0
            else:
                _add_three(row_s, cell, s1, s2, s3)
                _add_three(row_t, cell, t1, t2, t3)
                s0 = s1 = s2 = s3 = 0.0
                t0 = t1 = t2 = t3 = 0.0
            cell = cells[i]
        value = x_s[i] - mean_s
        s0 += value * w0[i]
        s1 += value * w1[i]
        s2 += value * w2[i]
        s3 += value * w3[i]
        value = x_t[i] - mean_t
        t0 += value * w0[i]
        t1 += value * w1[i]
        t2 += value * w2[i]
        t3 += value * w3[i]
    row_s[cell] += s0
    _add_three(row_s, cell, s1, s2, s3)
    row_t[cell] += t0
    _add_three(row_t, cell, t1, t2, t3)


@compiled
def _spread_four(signals, means, weights, cells, rows):
    x_s, x_t, x_u, x_v = signals
    mean_s, mean_t, mean_u, mean_v = means
    row_s, row_t, row_u, row_v = rows
    w0, w1, w2, w3 = weights
    s0 = s1 = s2 = s3 = 0.0
    t0 = t1 = t2 = t3 = 0.0
    u0 = u1 = u2 = u3 = 0.0
    v0 = v1 = v2 = v3 = 0.0
    cell = cells[0]
    for i in range(len(cells)):
        if cells[i] != cell:  # what is complete leaves the registers
            row_s[cell] += s0
            row_t[cell] += t0
            row_u[cell] += u0
            row_v[cell] += v0
            if cells[i] == cell + 1:
                s0, s1, s2, s3 = s1, s2, s3, 0.0
                t0, t1, t2, t3 = t1, t2, t3, 0.0
                u0, u1, u2, u3 = u1, u2, u3, 0.0
                v0, v1, v2, v3 = v1, v2, v3, 0.0
            else:
                _add_three(row_s, cell, s1, s2, s3)
                _add_three(row_t, cell, t1, t2, t3)
                _add_three(row_u, cell, u1, u2, u3)
                _add_three(row_v, cell, v1, v2, v3)
                s0 = s1 = s2 = s3 = 0.0
                t0 = t1 = t2 = t3 = 0.0
                u0 = u1 = u2 = u3 = 0.0
                v0 = v1 = v2 = v3 = 0.0
            cell = cells[i]
        value = x_s[i] - mean_s
        s0 += value * w0[i]
        s1 += value * w1[i]
        s2 += value * w2[i]
        s3 += value * w3[i]
        value = x_t[i] - mean_t
        t0 += value * w0[i]
        t1 += value * w1[i]
        t2 += value * w2[i]
        t3 += value * w3[i]
        value = x_u[i] - mean_u
        u0 += value * w0[i]
        u1 += value * w1[i]
        u2 += value * w2[i]
        u3 += value * w3[i]
        value = x_v[i] - mean_v
        v0 += value * w0[i]
        v1 += value * w1[i]
        v2 += value * w2[i]
        v3 += value * w3[i]
    row_s[cell] += s0
    _add_three(row_s, cell, s1, s2, s3)
    row_t[cell] += t0
    _add_three(row_t, cell, t1, t2, t3)
    row_u[cell] += u0
    _add_three(row_u, cell, u1, u2, u3)
    row_v[cell] += v0
    _add_three(row_v, cell, v1, v2, v3)


@compiled
def _add_three(row, cell, one, two, three):
    row[cell + 1] += one
    row[cell + 2] += two
    row[cell + 3] += three


@compiled
def _resample(
    travel,
    before,
    after,
    scale,
    offset,
    kernel,
    x,
    means,
    grid,
    part,
    n_points,
    ready,
    first,
    taps,
    outputs,
    done,
):
    held, cells = np.empty((4, _WEIGHTS)), np.empty(_WEIGHTS, np.uint32)
    weights = held[0], held[1], held[2], held[3]
    near = np.empty(_WEIGHTS + 2)
    fours = len(grid) // 4 * 4
    spare = np.zeros(grid.shape[1] if len(grid) % 2 else 0)  # beside a row that is left over
    for number in range(len(n_points)):
        used, n_outputs = n_points[number], ready[number]
        stop = min((number + 1) * part, len(travel))
        for low in range(number * part, stop, _WEIGHTS):
            count = min(_WEIGHTS, stop - low)
            end, some = low + count, cells[:count]
            near[0] = travel[low - 1] if low else before
            for i in range(count):
                near[i + 1] = travel[low + i]
            near[count + 1] = travel[end] if end < len(travel) else after
            _set_weights(near, scale, offset, kernel, used, weights, some)
            for k in range(0, fours, 4):  # several at a time: an addition waits for the one before
                rows = x[k][low:end], x[k + 1][low:end], x[k + 2][low:end], x[k + 3][low:end]
                onto = grid[k], grid[k + 1], grid[k + 2], grid[k + 3]
                four_means = means[k], means[k + 1], means[k + 2], means[k + 3]
                _spread_four(rows, four_means, weights, some, onto)
            for k in range(fours, len(grid), 2):
                paired = k + 1 < len(grid)
                pair = grid[k], grid[k + 1] if paired else spare
                two_means = means[k], means[k + 1] if paired else 0.0
                _spread_two((x[k][low:end], x[k + 1][low:end]), two_means, weights, some, pair)
        if n_outputs:
            decimate(grid, used, first, taps, means, outputs, done, n_outputs)
            done += n_outputs
            offset -= 2.0 * n_outputs


@compiled
def _upsample(signal, phases, first, outputs):
    factor = len(phases)
    line = np.empty(len(outputs) // factor + 1)
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


@compiled
def decimate(grid, used, first, taps, means, outputs, done, n_outputs):
    if len(taps) != 41:
        raise ValueError("the decimating filter must have 41 taps")
    even = np.empty(n_outputs + 20)
    odd = np.empty(n_outputs + 20)
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


@compiled
def _interpolation_weights(reached, before, first, theta_s, left, weights):
    i, last = before, len(reached) - 2
    low, high = reached[i], reached[i + 1]
    for j in range(len(left)):
        angle = theta_s * (first + j)
        while i < last and high <= angle:
            i += 1
            low, high = high, reached[i + 1]
        left[j] = i
        weights[j] = 1.0 if angle >= high else max(0.0, (angle - low) / (high - low))
    return i


@compiled
def _blend(signal, left, weights, values):
    following = signal[1:]
    for j in range(len(left)):
        place = np.uint32(left[j])
        low = signal[place]
        values[j] = low + weights[j] * (following[place] - low)


@compiled
def _interpolate_linear(reached, first, theta_s, signals, values):
    n_signals, n_angles = values.shape
    left = np.empty(_RUN, np.int32)
    weights = np.empty(_RUN, np.float64)
    before = np.int64(0)
    for start in range(0, n_angles, _RUN):
        count = min(_RUN, n_angles - start)
        before = _interpolation_weights(
            reached, before, first + start, theta_s, left[:count], weights[:count]
        )
        for k in range(n_signals):
            _blend(signals[k], left[:count], weights[:count], values[k, start : start + count])
