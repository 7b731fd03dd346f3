"""Control loop and resonances of the simulated bench, compiled."""

from __future__ import annotations

import numpy as np
from numba.extending import register_jitable

from emacm._kernels.numba.compilation import compiled_exactly
from emacm._kernels.numpy import control

register_jitable(control.limited_torque)  # which the loop calls
_step_through = compiled_exactly(control.step_through)
limited_torque = compiled_exactly(control.limited_torque)


def follow(targets, dt, *constants):
    velocities = np.empty(len(targets))
    floats = [tuple(map(float, part)) for part in constants]  # one kind is compiled
    _step_through(targets, dt, *floats, velocities)
    return velocities


def resonate(b, a, signal):
    filters = np.zeros((2, 3, 3))  # one that is missing has no output
    filters[0, : len(b)], filters[1, : len(a)] = b, a
    found = np.empty((3, len(signal)))
    _resonate(*filters, signal, found)
    return found[: len(b)]


@compiled_exactly
def _resonate(b, a, signal, found):
    # Three at a time: a sample of a filter waits for the one before it.
    p0 = p1 = q0 = q1 = r0 = r1 = 0.0
    for i in range(len(signal)):
        x = signal[i]
        p, q, r = p0 + b[0, 0] * x, q0 + b[1, 0] * x, r0 + b[2, 0] * x
        p0, p1 = p1 + b[0, 1] * x - a[0, 1] * p, b[0, 2] * x - a[0, 2] * p
        q0, q1 = q1 + b[1, 1] * x - a[1, 1] * q, b[1, 2] * x - a[1, 2] * q
        r0, r1 = r1 + b[2, 1] * x - a[2, 1] * r, b[2, 2] * x - a[2, 2] * r
        found[0, i], found[1, i], found[2, i] = p, q, r
