"""Motion of the shaft under its controller and inverter, and of the rod."""

from __future__ import annotations

from math import copysign, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters
from scipy.constants import inch, lbf
from scipy.interpolate import BSpline

from laboratory.constants import (
    ASSUMED,
    PEAK_SPEED,
    SUPPLY_VOLTAGE,
    Actuator,
    Array,
    Condition,
)
from laboratory.faults import POLE_PAIRS, Fault

# V peak of a phase for the planned motion: 220 V between phases, less a reserve.
_ALLOWED = ASSUMED.voltage_reserve * (SUPPLY_VOLTAGE * sqrt(2 / 3))


def limited_torque(torque: float, velocity: float, actuator: Actuator) -> float:
    """Return the nearest torque [N m] for which current and voltage of the drive are allowed.

    Examples
    --------
    >>> actuator = Actuator()
    >>> limited = [limited_torque(30.0, speed, actuator) for speed in (0.0, 460.0)]
    >>> [round(torque / actuator.torque_constant, 1) for torque in limited]  # A
    [40.0, 10.9]
    """
    constant, resistance = actuator.torque_constant, actuator.winding_resistance
    torque = min(max(torque, -actuator.max_torque), actuator.max_torque)
    emf = actuator.emf_constant * abs(velocity)
    reactance = POLE_PAIRS * actuator.winding_inductance * abs(velocity)
    if (resistance + reactance) * abs(torque) <= constant * (_ALLOWED - emf):
        return torque  # even if the voltages were in phase
    impedance = resistance * resistance + reactance * reactance
    inner = emf * resistance * (emf * resistance) + impedance * (_ALLOWED * _ALLOWED - emf * emf)
    root = sqrt(max(inner, 0.0))
    side = copysign(constant / impedance, velocity)
    one, other = side * (-emf * resistance + root), side * (-emf * resistance - root)
    return min(max(torque, min(one, other)), max(one, other))


class Motion(NamedTuple):
    """Motion of the shaft without torque ripple.

    Attributes
    ----------
    times : ndarray of shape (n_times,)
        Times [s]; the recording starts at 0.
    angle, velocity, acceleration : ndarray of shape (n_times,)
        Shaft angle [rad], 0 at position 0, and its derivatives [rad/s], [rad/s²].
    """

    times: Array
    angle: Array
    velocity: Array
    acceleration: Array


def bench_motion(
    condition: Condition,
    actuator: Actuator,
    times: Array,
    phase: float,
    load_share: float,
    jam: Fault,
) -> Motion:
    """Return the motion with which the actuator follows its command.

    A proportional position controller commands a velocity of at most 99 % of 4572 RPM; the
    velocity loop follows with a first-order lag, unless the required torque exceeds the limits
    of current or voltage (thesis, section 4.2, names the loops; gains are assumed). The command of
    condition 3 exceeds the peak speed at leads below 0.23 in, and 220 V allow 0.168 in at most:
    Tables 4.1 and 4.3 cannot both hold, and the rod does not reach its commanded stroke.

    Parameters
    ----------
    condition : Condition
        A row of Table 4.3.
    actuator : Actuator
        Constants.
    times : ndarray of shape (n_times,)
        Evenly spaced times [s]. The simulation starts one period, and at least 1 s, earlier.
    phase : float
        Phase of the command at time 0 [rad].
    load_share : float
        Actual load relative to the commanded load.
    jam : Fault
        The jam of this unit.

    Returns
    -------
    Motion

    Examples
    --------
    >>> from laboratory.constants import CONDITIONS, RPM
    >>> times = np.arange(48_000) / 48_000
    >>> motion = bench_motion(CONDITIONS[3], Actuator(), times, 0.0, 1.0, Fault())
    >>> round(float(motion.velocity.max()) / RPM)
    4526
    """
    # The derivatives of the last interval need one more control step.
    before = max(1.0, 1 / condition.frequency) - float(times[0])
    n_before = int(np.ceil(before * ASSUMED.control_rate))
    n_after = int(np.ceil(float(times[-1]) * ASSUMED.control_rate)) + 2
    steps = np.arange(-n_before, n_after) / ASSUMED.control_rate
    targets = condition.position(steps, phase) * actuator.angle_per_inch
    velocities = _follow(targets, condition, actuator, load_share, jam)
    # A quadratic spline over the steps whose coefficients are their velocities: its acceleration
    # is their linear interpolation, so that neither speed nor torque overshoots its limit.
    knots = np.arange(len(steps) + 4) - 2.5
    velocity = BSpline(knots, np.append(velocities[:1], velocities), 2)
    places = (times - steps[0]) * ASSUMED.control_rate
    angle = targets[0] + velocity.antiderivative()(places) / ASSUMED.control_rate
    acceleration = velocity.derivative()(places) * ASSUMED.control_rate
    return Motion(times, angle, velocity(places), acceleration)


def _follow(
    targets: Array, condition: Condition, actuator: Actuator, load_share: float, jam: Fault
) -> Array:
    """Return the velocity at each control step; the shaft starts at the first target, at rest."""
    dt, limit = 1 / ASSUMED.control_rate, ASSUMED.headroom * PEAK_SPEED
    nearer = min(1.0, 2 * np.pi * actuator.velocity_bandwidth / ASSUMED.control_rate)
    inertia, lost = actuator.inertia, 1 / actuator.efficiency - 1
    at_0, at_1 = (
        load_share * condition.load(place) * lbf * actuator.torque_per_force for place in (0.0, 1.0)
    )
    per_rad = (at_1 - at_0) / actuator.angle_per_inch
    angle, velocity, velocities = float(targets[0]), 0.0, []
    for target in targets.tolist():  # nonlinear, so computed step by step: 1 us each
        velocities.append(velocity)
        wanted = min(max(actuator.position_gain * (target - angle), -limit), limit)
        change = nearer * (wanted - velocity)
        needed = at_0 + per_rad * angle
        braking = actuator.coulomb + actuator.viscous * abs(velocity) + lost * abs(needed)
        if jam.friction:
            braking += jam_torque(angle, actuator, jam)
        torque = inertia * change / dt + needed + copysign(braking, velocity)
        limited = limited_torque(torque, velocity, actuator)
        if limited != torque:  # the limited torque drives; friction can only brake
            driven = velocity + (limited - needed) * dt / inertia
            left = copysign(max(abs(driven) - braking * dt / inertia, 0.0), driven)
            change = min(max(left, -limit), limit) - velocity
        angle += dt * (velocity + change / 2)
        velocity += change
    return np.array(velocities)


def jam_torque(angle: Any, actuator: Actuator, jam: Fault) -> Any:
    """Return the friction torque of a jam [N m]: a Gaussian over the position (assumed).

    Examples
    --------
    >>> from laboratory.faults import FAULTS
    >>> actuator = Actuator()
    >>> angle = np.array([0.0, 1.9]) * actuator.angle_per_inch
    >>> torque = jam_torque(angle, actuator, FAULTS["jam"].scaled(0.5))
    >>> (torque / actuator.max_torque).round(6)
    array([0. , 0.3])
    """
    away = (angle / actuator.angle_per_inch - jam.place) / jam.width
    return jam.friction * actuator.max_torque * np.exp(-(away**2))


def rod_position(
    angle: Array, force: Array, actuator: Actuator, backlash: float, fs: float
) -> tuple[Array, NDArray[np.intp]]:
    """Return the position of the rod, and the impacts of the nut on its opposite flank.

    The rod is elastic. With backlash, the load presses the nut against one flank, and the nut
    crosses to the other when the load changes its sign: under a load of constant sign
    (conditions 1 to 3) backlash has no visible effect, as on real machines.

    Parameters
    ----------
    angle : ndarray of shape (n_times,)
        Shaft angle, 0 at position 0 [rad].
    force : ndarray of shape (n_times,)
        Load against positive motion [lbf].
    actuator : Actuator
        Constants.
    backlash : float
        Clearance of the nut [in].
    fs : float
        Sampling rate [Hz].

    Returns
    -------
    position : ndarray of shape (n_times,)
        Position of the rod [in].
    knocks : ndarray of shape (n_knocks,), of int
        Samples of the impacts; none without backlash.

    Examples
    --------
    >>> angle = np.full(9600, 2 * np.pi)
    >>> force = np.where(np.arange(9600) < 4800, 100.0, -100.0)
    >>> position, knocks = rod_position(angle, force, Actuator(), 0.01, 48_000)
    >>> position[[0, -1]].round(3), knocks
    (array([0.152, 0.163]), array([4800]))
    """
    position = angle / actuator.angle_per_inch - force * lbf / actuator.stiffness / inch
    if not backlash:
        return position, np.zeros(0, dtype=np.intp)
    side = _side(force)
    decay = np.exp(-1 / (ASSUMED.crossing_time * fs))
    eased, _ = filters.lfilter([1 - decay], [1, -decay], side, zi=[decay * side[0]])
    return position - backlash / 2 * eased, np.flatnonzero(np.diff(side)) + 1


def _side(force: Array) -> Array:
    """Return the sign of the force, unchanged while friction can hold the nut."""
    certain = np.flatnonzero(np.abs(force) > ASSUMED.holding_force)
    if not len(certain):
        return np.ones_like(force)
    last = np.searchsorted(certain, np.arange(len(force)), side="right") - 1
    return np.sign(force[certain[np.maximum(last, 0)]])
