"""The inner loops compiled by numba; `emacm._kernels.numpy` documents each of them.

The loops release Python's lock where they take time, so threads process recordings in parallel.
They have no branch and no variable offset inside, so that the compiler can vectorise them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.floating]

# How much is processed at a time, chosen by ``python benchmarks/pipeline.py``.
SPREAD_AT_ONCE = 1 << 18  # samples; with fewer, threads wait for one another
INTERPOLATED_AT_ONCE = 1 << 17  # samples
WEIGHTS_AT_ONCE = 2048  # samples, whose weights stay in the first cache
SEGMENT_BYTES = 1 << 20  # of segments that are transformed, which stay in the second cache


def compiled(function: Any, *, reordered: bool = True) -> Any:
    """Compile at the first call, without Python's lock; sums may be reordered.

    The compiled code is cached on disk where that is possible.
    """
    order = {"reassoc", "contract", "nsz", "arcp"} if reordered else set()  # results to 1e-15
    try:
        return njit(cache=True, nogil=True, fastmath=order)(function)
    except RuntimeError:  # neither the folder of the package nor that of the user can be written to
        return njit(nogil=True, fastmath=order)(function)


@partial(compiled, reordered=False)
def integrate(velocity, half_step, start):
    angle = np.empty(len(velocity))
    angle[0] = total = start
    for i in range(1, len(velocity)):
        total += (np.float64(velocity[i - 1]) + np.float64(velocity[i])) * half_step
        angle[i] = total
    return angle


def resample(near, place, kernel, signals, means, grid, parts, lowpass, made):
    """Spread samples part by part, and decimate the grid as far as it is complete after each."""
    (near,), (outputs, done) = _views([near]), made
    for some, rows in _in_eights(signals):
        own = rows, means[some], grid[some], parts, lowpass, (outputs[some], done)
        _resample(near, place, kernel, *own)


def upsample(signal, taps, factor, first, n_outputs):
    """Raise the sampling rate of a signal over time."""
    phases = np.zeros((factor, 33))
    for phase, row in enumerate(phases):
        part = taps[phase::factor]
        row[: len(part)] = part
    outputs = np.empty(n_outputs)
    _upsample(*_views([signal]), phases[:, ::-1].copy(), first, outputs)
    return outputs


def interpolate_linear(reached, first, theta_s, signals, values):
    """Interpolate signals linearly at uniform angles, Eq. (2.13) of Chirico."""
    (reached,) = _views([reached])
    for some, rows in _in_eights(signals):
        _interpolate_linear(reached, first, theta_s, rows, values[some])


def _in_eights(signals: Sequence[Array]) -> Iterator[tuple[slice, tuple[Array, ...]]]:
    """Yield eight signals at a time, with their places, so that one number is compiled for.

    Where there are fewer, the first one is repeated, which has no effect.
    """
    for start in range(0, len(signals), 8):
        rows = _views(signals[start : start + 8])
        yield slice(start, start + 8), (*rows, *rows[:1] * (8 - len(rows)))


def _views(signals: Sequence[Array]) -> tuple[Array, ...]:
    """Return contiguous read-only views in float64, so that one kind of array is compiled for."""
    rows = [np.ascontiguousarray(signal, np.float64)[:] for signal in signals]
    for row in rows:
        row.flags.writeable = False
    return tuple(rows)


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
def _spread(signal, mean, weights, cells, row):
    w0, w1, w2, w3 = weights
    s0 = s1 = s2 = s3 = 0.0
    cell = cells[0]
    for i in range(len(cells)):
        if cells[i] != cell:  # what is complete leaves the registers
            row[cell] += s0
            if cells[i] == cell + 1:
                s0, s1, s2, s3 = s1, s2, s3, 0.0
            else:
                row[cell + 1] += s1
                row[cell + 2] += s2
                row[cell + 3] += s3
                s0 = s1 = s2 = s3 = 0.0
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


@compiled
def _resample(near, place, kernel, x, means, grid, parts, lowpass, made):
    (scale, offset), (part, n_points, ready), (outputs, done) = place, parts, made
    n_times = len(near) - 2
    weights = np.empty((4, WEIGHTS_AT_ONCE))
    w = weights[0], weights[1], weights[2], weights[3]
    cells = np.empty(WEIGHTS_AT_ONCE, np.uint32)
    for number in range(len(n_points)):
        used, n_outputs = n_points[number], ready[number]
        stop = min((number + 1) * part, n_times)
        for low in range(number * part, stop, WEIGHTS_AT_ONCE):
            end = min(low + WEIGHTS_AT_ONCE, stop)
            some = cells[: end - low]
            _set_weights(near[low : end + 2], scale, offset, kernel, used, w, some)
            for k in range(len(grid)):
                _spread(x[k][low:end], means[k], w, some, grid[k])
        if n_outputs:
            decimate(grid, used, lowpass, means, (outputs, done), n_outputs)
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
            total = taps[0] * part[i]
            for k in range(1, 33):  # of constant length, so that the loop over i is vectorised
                total += taps[k] * part[i + k]
            line[i] = total
        for i in range(count):
            outputs[start + i * factor] = line[i]


@compiled
def decimate(grid, used, lowpass, means, made, n_outputs):
    (first, taps), (outputs, done) = lowpass, made  # of 41 taps
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
def _interpolate_linear(reached, first, theta_s, signals, values):
    n_angles, i, last = values.shape[1], 0, len(reached) - 2
    left, weights = np.empty(n_angles, np.uint32), np.empty(n_angles)
    low, high = reached[0], reached[1]
    for j in range(n_angles):
        angle = theta_s * (first + j)
        while i < last and high <= angle:
            i += 1
            low, high = high, reached[i + 1]
        left[j] = i
        weights[j] = 1.0 if angle >= high else 0.0 if angle <= low else (angle - low) / (high - low)
    for k in range(len(values)):
        signal, following, row = signals[k], signals[k][1:], values[k]
        for j in range(n_angles):
            low = signal[left[j]]
            row[j] = low + weights[j] * (following[left[j]] - low)


@compiled
def set_segments(signals, first, step, window, remove_mean, segments):
    length = len(window)
    for c in range(len(signals)):
        for s in range(segments.shape[1]):
            part, segment = signals[c, first + s * step :][:length], segments[c, s]
            mean = part.mean() if remove_mean else 0.0
            for i in range(length):
                segment[i] = (part[i] - mean) * window[i]


@compiled
def add_powers(transforms, total):
    for c in range(len(total)):
        row = total[c]
        for s in range(transforms.shape[1]):
            lines = transforms[c, s]
            for k in range(len(row)):
                row[k] += lines[k].real * lines[k].real + lines[k].imag * lines[k].imag
