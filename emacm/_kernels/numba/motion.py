"""Loops over the motion of the shaft, compiled."""

from __future__ import annotations

import numpy as np

from emacm._kernels.numba.compilation import compiled_exactly


@compiled_exactly
def set_checkpoints(velocity, half_step, stride, angles, lowest, highest):
    total = 0.0
    for k in range(len(angles)):
        first = k * stride
        before = np.float64(velocity[first])
        if k:
            total += (np.float64(velocity[first - 1]) + before) * half_step
        angles[k] = total
        low = high = before
        for i in range(first + 1, min(first + stride, len(velocity))):
            now = np.float64(velocity[i])
            total += (before + now) * half_step
            before = now
            low = now if now < low else low
            high = now if now > high else high
        lowest[k], highest[k] = low, high


@compiled_exactly
def integrate(velocity, half_step, starts, stride, angle):
    for i in range(1, len(velocity)):
        angle[i] = (np.float64(velocity[i - 1]) + np.float64(velocity[i])) * half_step
    in_fours = len(velocity) // stride // 4 * 4
    for k in range(0, in_fours, 4):  # four sums at a time: an addition waits for the one before it
        p, q, r, s = k * stride, (k + 1) * stride, (k + 2) * stride, (k + 3) * stride
        one, two, three, four = angle[p:q], angle[q:r], angle[r:s], angle[s : s + stride]
        t0, t1, t2, t3 = starts[k], starts[k + 1], starts[k + 2], starts[k + 3]
        one[0], two[0], three[0], four[0] = t0, t1, t2, t3
        for i in range(1, stride):
            t0 += one[i]
            t1 += two[i]
            t2 += three[i]
            t3 += four[i]
            one[i], two[i], three[i], four[i] = t0, t1, t2, t3
    for first in range(in_fours * stride, len(velocity), stride):
        total = starts[first // stride]
        angle[first] = total
        for i in range(first + 1, min(first + stride, len(velocity))):
            total += angle[i]
            angle[i] = total
