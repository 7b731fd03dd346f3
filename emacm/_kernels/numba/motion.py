"""Loops over the motion of the shaft, compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from emacm._kernels.numba.compilation import compiled_exactly, read_only

Array = NDArray[np.floating]


def cumulative_angle_checkpoints(
    velocity: Array, half_step: float, stride: int
) -> tuple[Array, Array, Array]:
    """Integrate a velocity once, and keep the angle at every `stride`-th sample."""
    angles, lowest, highest = np.empty((3, -(-len(velocity) // stride)))
    _checkpoints(read_only(velocity), half_step, stride, angles, lowest, highest)
    return angles, lowest, highest


def integrate(velocity: Array, half_step: float, starts: Array, stride: int) -> Array:
    """Integrate a velocity by the trapezoidal rule, section by section, in float64."""
    angle = np.empty(len(velocity))
    _integrate(read_only(velocity), half_step, starts, stride, angle)
    return angle


@compiled_exactly
def _checkpoints(velocity, half_step, stride, angles, lowest, highest):
    total = 0.0
    before = np.float64(velocity[0])
    for k in range(len(angles)):
        section = velocity[k * stride : (k + 1) * stride]
        low = high = np.float64(section[0])
        for i in range(len(section)):
            now = np.float64(section[i])
            if i or k:
                total += (before + now) * half_step
            if not i:
                angles[k] = total
            before = now
            low = now if now < low else low
            high = now if now > high else high
        lowest[k], highest[k] = low, high


@compiled_exactly
def _integrate(velocity, half_step, starts, stride, angle):
    in_fours = len(velocity) // stride // 4 * 4
    for k in range(
        0, in_fours, 4
    ):  # four sums at a time, as an addition has to wait for the one before it
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


@compiled_exactly
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
