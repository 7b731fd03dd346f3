"""From a position command to the motion of the shaft, within limits of speed and torque."""

from __future__ import annotations

from math import copysign, exp
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from emacm.simulation.actuator import PEAK_SPEED, Actuator
from emacm.simulation.conditions import POUND, Condition, load_force, position_command

_CONTROL_RATE = 2000.0  # Hz, assumed
_HEADROOM = 0.99  # of the peak speed is commanded: what ripple adds must not pass it
JAM_PLACE = 1.9  # in; assumed, because the motion of all five conditions passes it
_JAM_WIDTH = 0.15  # in
_JAM_TORQUE = 0.6  # of the controller's limit, at severity 1


class Motion(NamedTuple):
    """Motion of a shaft without the ripple of its torque.

    Attributes
    ----------
    times : ndarray of shape (n_times,)
        Times [s]; the recording starts at 0.
    angle, velocity, acceleration : ndarray of shape (n_times,)
        Of the shaft [rad], [rad/s], [rad/s²]. The angle is 0 at position 0.
    """

    times: NDArray[np.floating]
    angle: NDArray[np.floating]
    velocity: NDArray[np.floating]
    acceleration: NDArray[np.floating]


def bench_motion(
    condition: Condition,
    actuator: Actuator,
    times: NDArray[np.floating],
    *,
    phase: float = 0.0,
    load_share: float = 1.0,
    jam: float = 0.0,
) -> Motion:
    """Return the motion by which the actuator follows its command.

    A controller in proportion to the position error asks for a velocity, not above 99 % of 4572
    RPM; the velocity loop follows with a first-order lag, unless it wants more torque than there
    is (thesis, section 4.2, names the loops; gains are assumed). The command of condition 3 is
    faster than the peak speed at leads below 0.23 in: the rod then falls short of it.

    Parameters
    ----------
    condition : Condition
        A row of Table 4.3.
    actuator : Actuator
        Constants.
    times : ndarray of shape (n_times,)
        Evenly spaced times [s]. The command runs for a period, and at least 1 s, before.
    phase : float
        Of the command at time 0 [rad].
    load_share : float
        Part of the commanded load that is reached.
    jam : float
        Severity of a jam in [0, 1].

    Returns
    -------
    Motion

    Examples
    --------
    >>> from emacm.simulation.conditions import CONDITIONS, RPM
    >>> motion = bench_motion(CONDITIONS[3], Actuator(), np.arange(48_000) / 48_000)
    >>> round(float(motion.velocity.max()) / RPM)
    4526
    """
    # To the end of all times, and the derivatives of the last interval need one more step.
    before = max(1.0, 1 / condition.frequency) - float(times[0])
    n_before = int(np.ceil(before * _CONTROL_RATE))
    n_after = int(np.ceil(float(times[-1]) * _CONTROL_RATE)) + 2
    steps = np.arange(-n_before, n_after) / _CONTROL_RATE
    targets = position_command(condition, steps, phase) * actuator.angle_per_inch
    start, velocities = _follow(targets, condition, actuator, load_share, jam)
    velocity = PchipInterpolator(steps, velocities)  # no overshoot: the peak stays the peak
    return Motion(
        times,
        start + velocity.antiderivative()(times),
        velocity(times),
        velocity.derivative()(times),
    )


def _follow(
    targets: NDArray[np.floating],
    condition: Condition,
    actuator: Actuator,
    load_share: float,
    jam: float,
) -> tuple[float, list[float]]:
    """Return the first angle and the velocity at each step of the controller.

    Plain floats: the loop is not linear, and a step of it costs a microsecond so.
    """
    dt, inertia, limit = 1 / _CONTROL_RATE, actuator.inertia, _HEADROOM * PEAK_SPEED
    bandwidth = 2 * np.pi * actuator.velocity_bandwidth
    push, most = actuator.position_gain, actuator.max_torque
    resists = [
        float(load_force(condition, place, load_share)) * POUND * actuator.torque_per_force
        for place in (np.array(0.0), np.array(1.0))
    ]
    at_0, per_rad = resists[0], (resists[1] - resists[0]) / actuator.angle_per_inch
    lost, jammed = 1 / actuator.efficiency - 1, jam * _JAM_TORQUE * most
    jam_angle, jam_width = (
        JAM_PLACE * actuator.angle_per_inch,
        _JAM_WIDTH * actuator.angle_per_inch,
    )
    angle, velocity, velocities = float(targets[0]), 0.0, []
    first = angle
    for target in targets.tolist():
        velocities.append(velocity)
        wanted = min(max(push * (target - angle), -limit), limit)
        change = min(1.0, bandwidth * dt) * (wanted - velocity)
        load = at_0 + per_rad * angle
        friction = actuator.coulomb + actuator.viscous * abs(velocity) + lost * abs(load)
        if jammed:
            friction += jammed * exp(-(((angle - jam_angle) / jam_width) ** 2))
        torque = inertia * change / dt + load + copysign(friction, velocity)
        if abs(torque) > most:  # what is there drives, friction can only brake
            driven = velocity + (copysign(most, torque) - load) * dt / inertia
            left = copysign(max(abs(driven) - friction * dt / inertia, 0.0), driven)
            change = min(max(left, -limit), limit) - velocity
        angle += dt * (velocity + change / 2)
        velocity += change
    return first, velocities


def jam_torque(angle: NDArray[np.floating], actuator: Actuator, jam: float) -> NDArray[np.floating]:
    """Return the friction torque of a jam [N m], a bump at one place of the stroke (assumed).

    Parameters
    ----------
    angle : ndarray of shape (n_times,)
        Shaft angle, 0 at position 0 [rad].
    actuator : Actuator
        Constants.
    jam : float
        Severity in [0, 1]; at 1 it takes 0.6 of the torque that there is.

    Returns
    -------
    ndarray of shape (n_times,)

    Examples
    --------
    >>> actuator = Actuator()
    >>> at = JAM_PLACE * actuator.angle_per_inch
    >>> (jam_torque(np.array([0.0, at]), actuator, 0.5) / actuator.max_torque).round(6)
    array([0. , 0.3])
    """
    if not jam:
        return np.zeros_like(angle)
    away = (angle / actuator.angle_per_inch - JAM_PLACE) / _JAM_WIDTH
    return jam * _JAM_TORQUE * actuator.max_torque * np.exp(-(away**2))
