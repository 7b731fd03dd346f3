"""The control loop of the simulated bench, compiled."""

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
