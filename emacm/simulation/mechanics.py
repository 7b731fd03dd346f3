"""Motion of the shaft under its controller and inverter, and of the rod."""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, exp, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters
from scipy.constants import inch, lbf

from emacm.simulation.faults import FAULTS, POLE_PAIRS
from emacm.simulation.laboratory import (
    ASSUMED,
    PEAK_SPEED,
    SUPPLY_VOLTAGE,
    Actuator,
    Condition,
    load_force,
    position_command,
)
from emacm.simulation.waves import PHASES, OrderWaves, of_phases, sine_wave

Coefficients = tuple[float, float, float]

_JAM = FAULTS["jam"]


VOLTAGE_LIMIT = SUPPLY_VOLTAGE * sqrt(2 / 3)  # V peak of a phase, which 220 V between phases allow
_LINK = SUPPLY_VOLTAGE * sqrt(2)  # V: rectified supply


def phase_voltage(
    torque: NDArray[np.floating], velocity: NDArray[np.floating], actuator: Actuator
) -> NDArray[np.floating]:
    """Return the peak voltage of a phase that a torque requires at a speed.

    With the current perpendicular to the rotor flux, ``v_q = k w + R i`` and ``v_d = -p w L i``.

    Parameters
    ----------
    torque, velocity : ndarray of shape (n_times,)
        Motor torque [N m] and shaft speed [rad/s].
    actuator : Actuator
        Constants.

    Returns
    -------
    ndarray of shape (n_times,)
        Voltage [V].

    Examples
    --------
    >>> rated = phase_voltage(np.array([0.0]), np.array([4572 * np.pi / 30]), Actuator())
    >>> (rated * np.sqrt(3 / 2)).round(1)  # RMS between phases
    array([206.3])
    """
    current = torque / actuator.torque_constant
    across = actuator.emf_constant * velocity + actuator.winding_resistance * current
    along = POLE_PAIRS * actuator.winding_inductance * velocity * current
    return np.sqrt(across**2 + along**2)


def voltage_free_speed(actuator: Actuator, current: float) -> float:
    """Return a speed up to which the voltage allows a current of either sign [rad/s].

    Examples
    --------
    >>> round(voltage_free_speed(Actuator(), 10.0))
    381
    """
    left = ASSUMED.voltage_reserve * VOLTAGE_LIMIT - actuator.winding_resistance * current
    per_speed = actuator.emf_constant + POLE_PAIRS * actuator.winding_inductance * current
    return max(left, 0.0) / per_speed  # voltages added as if in phase: a lower bound


def limited_torque(torque: float, velocity: float, actuator: Actuator) -> float:
    """Return the nearest torque for which the drive's current and voltage are allowed [N m].

    Parameters
    ----------
    torque : float
        Motor torque [N m].
    velocity : float
        Shaft speed [rad/s].
    actuator : Actuator
        Constants.

    Returns
    -------
    float

    Examples
    --------
    >>> actuator = Actuator()
    >>> limited = [limited_torque(30.0, speed, actuator) for speed in (0.0, 460.0)]
    >>> [round(torque / actuator.torque_constant, 1) for torque in limited]  # A
    [40.0, 10.9]
    """
    constant, resistance = actuator.torque_constant, actuator.winding_resistance
    allowed = ASSUMED.voltage_reserve * VOLTAGE_LIMIT
    torque = min(max(torque, -actuator.max_torque), actuator.max_torque)
    emf = actuator.emf_constant * abs(velocity)
    reactance = POLE_PAIRS * actuator.winding_inductance * abs(velocity)
    if (resistance + reactance) * abs(torque) <= constant * (allowed - emf):
        return torque  # even if the voltages were in phase
    impedance = resistance * resistance + reactance * reactance
    inner = emf * resistance * (emf * resistance) + impedance * (allowed * allowed - emf * emf)
    root = sqrt(max(inner, 0.0))
    side = copysign(constant / impedance, velocity)
    one, other = side * (-emf * resistance + root), side * (-emf * resistance - root)
    return min(max(torque, min(one, other)), max(one, other))


def carrier_ripple(
    voltage: NDArray[np.floating],
    angle: NDArray[np.floating] | OrderWaves,
    times: NDArray[np.floating],
    phase: float,
    actuator: Actuator,
    phases: str = PHASES,
) -> NDArray[np.floating]:
    """Return the ripple of the phase currents at the switching frequency of the inverter.

    The lines at ``carrier +- 2 x`` the electrical frequency of a sine-triangle modulation have the
    voltage ``2 V_dc / pi J_2(pi M / 2)`` each [1]_, M being the voltage relative to half the
    DC link; the line at the carrier itself is equal in all phases and drives no current. They are
    fixed in time, and sum to zero over the phases. Lines at twice the carrier are above the
    conditioning filter.

    Parameters
    ----------
    voltage : ndarray of shape (n_times,)
        Peak voltage of a phase [V].
    angle : ndarray of shape (n_times,) or OrderWaves
        Shaft angle [rad].
    times : ndarray of shape (n_times,)
        Times [s].
    phase : float
        Phase of the carrier [rad].
    actuator : Actuator
        Constants; without inductance there is no ripple to compute, and 0 is returned.
    phases : str
        Phases to compute.

    Returns
    -------
    ndarray of shape (n_phases, n_times)
        Currents [A].

    References
    ----------
    .. [1] D. G. Holmes and T. A. Lipo, Pulse Width Modulation for Power Converters, 2003.
    """
    if not actuator.winding_inductance:
        return np.zeros((len(phases), len(times)))
    x2 = (np.pi * voltage / _LINK) ** 2  # square of pi M / 2
    bessel = x2 / 8 * (1 - x2 / 12 * (1 - x2 / 32))  # J_2 within 1 % up to M = 1.15
    reactance = 2 * np.pi * ASSUMED.carrier * actuator.winding_inductance
    size = bessel * sine_wave(ASSUMED.carrier, times, phase)
    size *= 2 * (2 * _LINK / np.pi) / reactance
    waves = OrderWaves.of(angle)
    a = size * waves.sines((2 * POLE_PAIRS, 1.0, np.pi / 2))
    across = size * waves.sines((2 * POLE_PAIRS, -np.sqrt(3) / 2, 0.0)) if phases != "a" else a
    return of_phases(a, across, phases)


class Motion(NamedTuple):
    """Motion of the shaft without torque ripple.

    Attributes
    ----------
    times : ndarray of shape (n_times,)
        Times [s]; the recording starts at 0.
    angle, velocity, acceleration : ndarray of shape (n_times,)
        Shaft angle [rad], 0 at position 0, and its derivatives [rad/s], [rad/s²].
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
    jam : float
        Severity of a jam in [0, 1].

    Returns
    -------
    Motion

    Examples
    --------
    >>> from emacm.simulation.laboratory import CONDITIONS, RPM
    >>> motion = bench_motion(CONDITIONS[3], Actuator(), np.arange(48_000) / 48_000)
    >>> round(float(motion.velocity.max()) / RPM)
    4526
    """
    # The derivatives of the last interval need one more control step.
    before = max(1.0, 1 / condition.frequency) - float(times[0])
    n_before = int(np.ceil(before * ASSUMED.control_rate))
    n_after = int(np.ceil(float(times[-1]) * ASSUMED.control_rate)) + 2
    steps = np.arange(-n_before, n_after) / ASSUMED.control_rate
    targets = position_command(condition, steps, phase) * actuator.angle_per_inch
    start, velocities = _follow(targets, condition, actuator, load_share, jam)
    angle, velocity, acceleration = _between_steps(
        velocities, (times - steps[0]) * ASSUMED.control_rate
    )
    angle /= ASSUMED.control_rate
    angle += start
    acceleration *= ASSUMED.control_rate
    return Motion(times, angle, velocity, acceleration)


def _between_steps(
    velocities: NDArray[np.floating], places: NDArray[np.floating]
) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]:
    """Return angle, velocity and acceleration between the steps of the control loop.

    A quadratic spline whose coefficients are the velocities of the steps: its acceleration is their
    linear interpolation, so that neither speed nor torque overshoots its limit. `places` are times
    in steps; the angle is 0 at the first step.
    """
    # Pieces of the spline join halfway between the steps.
    c = np.concatenate((velocities[:1], velocities))
    value, slope = (c[1:] + c[:-1]) / 2, np.diff(c)
    curve = np.diff(slope, append=slope[-1:]) / 2
    whole = value + slope / 2 + curve / 3
    turned = np.concatenate(([0.0], np.cumsum(whole)[:-1]))
    x = places + 0.5
    number = x.astype(np.intp)
    x -= number
    a, b, d = value[number], slope[number], curve[number]
    angle = turned[number] + x * (a + x * (b / 2 + x * d / 3))
    return angle, a + x * (b + x * d), b + 2 * x * d


def _follow(
    targets: NDArray[np.floating],
    condition: Condition,
    actuator: Actuator,
    load_share: float,
    jam: float,
) -> tuple[float, NDArray[np.floating]]:
    """Return the first angle and the velocity at each control step; the shaft starts at rest."""
    dt, limit = 1 / ASSUMED.control_rate, ASSUMED.headroom * PEAK_SPEED
    nearer = min(1.0, 2 * np.pi * actuator.velocity_bandwidth * dt)
    inertia, lost = actuator.inertia, 1 / actuator.efficiency - 1
    at_0, at_1 = (
        float(load_force(condition, np.array(place), load_share)) * lbf * actuator.torque_per_force
        for place in (0.0, 1.0)
    )
    per_rad = (at_1 - at_0) / actuator.angle_per_inch
    jammed = jam * _JAM.friction * actuator.max_torque
    jam_angle, jam_width = (x * actuator.angle_per_inch for x in (_JAM.place, _JAM.width))
    # Up to these, nothing is limited.
    part, slow = actuator.max_torque / 4, voltage_free_speed(actuator, actuator.max_current / 4)
    angle, velocity, velocities = float(targets[0]), 0.0, []
    for target in targets.tolist():  # nonlinear, so computed step by step: 1 us each
        velocities.append(velocity)
        wanted = min(max(actuator.position_gain * (target - angle), -limit), limit)
        change = nearer * (wanted - velocity)
        needed, speed = at_0 + per_rad * angle, abs(velocity)
        braking = actuator.coulomb + actuator.viscous * speed + lost * abs(needed)
        if jammed:
            braking += jammed * exp(-(((angle - jam_angle) / jam_width) ** 2))
        torque = inertia * change / dt + needed + copysign(braking, velocity)
        if speed > slow or not -part <= torque <= part:
            limited = limited_torque(torque, velocity, actuator)
            if limited != torque:  # the limited torque drives; friction can only brake
                driven = velocity + (limited - needed) * dt / inertia
                left = copysign(max(abs(driven) - braking * dt / inertia, 0.0), driven)
                change = min(max(left, -limit), limit) - velocity
        angle += dt * (velocity + change / 2)
        velocity += change
    return float(targets[0]), np.array(velocities)


def jam_torque(angle: NDArray[np.floating], actuator: Actuator, jam: float) -> NDArray[np.floating]:
    """Return the friction torque of a jam [N m]: a Gaussian over the position (assumed).

    Parameters
    ----------
    angle : ndarray of shape (n_times,)
        Shaft angle, 0 at position 0 [rad].
    actuator : Actuator
        Constants.
    jam : float
        Severity in [0, 1]; at 1 the peak is 0.6 of the torque limit.

    Returns
    -------
    ndarray of shape (n_times,)

    Examples
    --------
    >>> actuator = Actuator()
    >>> at_jam = 1.9 * actuator.angle_per_inch
    >>> (jam_torque(np.array([0.0, at_jam]), actuator, 0.5) / actuator.max_torque).round(6)
    array([0. , 0.3])
    """
    if not jam:
        return np.zeros_like(angle)
    away = (angle / actuator.angle_per_inch - _JAM.place) / _JAM.width
    return jam * _JAM.friction * actuator.max_torque * np.exp(-(away**2))


def rod_position(
    angle: NDArray[np.floating],
    force: NDArray[np.floating],
    actuator: Actuator,
    backlash: float,
    fs: float,
) -> tuple[NDArray[np.floating], NDArray[np.intp]]:
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
        Severity in [0, 1]; 1 is a clearance of 0.01 in.
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
    >>> position, knocks = rod_position(angle, force, Actuator(), 1.0, 48_000)
    >>> position[[0, -1]].round(3), knocks
    (array([0.152, 0.163]), array([4800]))
    """
    position = angle / actuator.angle_per_inch - force * lbf / actuator.stiffness / inch
    if not backlash:
        return position, np.zeros(0, dtype=np.intp)
    side = _side(force)
    decay = np.exp(-1 / (ASSUMED.crossing_time * fs))
    eased, _ = filters.lfilter([1 - decay], [1, -decay], side, zi=[decay * side[0]])
    position = position - FAULTS["backlash"].backlash / 2 * backlash * eased
    return position, np.flatnonzero(np.diff(side)) + 1


def _side(force: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the sign of the force, unchanged while friction can hold the nut."""
    certain = np.flatnonzero(np.abs(force) > ASSUMED.holding_force)
    if not len(certain):
        return np.ones_like(force)
    last = np.searchsorted(certain, np.arange(len(force)), side="right") - 1
    return np.sign(force[certain[np.maximum(last, 0)]])


def responses(
    systems: Sequence[tuple[Coefficients, Coefficients]], signal: NDArray[np.floating], fs: float
) -> NDArray[np.floating]:
    """Return the responses of linear systems of second order, at rest at the start.

    Parameters
    ----------
    systems : sequence of (above, below)
        Coefficients of s², s and 1 in the numerator and the denominator of each.
    signal : ndarray of shape (n_times,)
        Their input.
    fs : float
        Sampling rate [Hz]; the bilinear transform maps s to z.

    Returns
    -------
    ndarray of shape (n_systems, n_times)

    Examples
    --------
    >>> omega = 2 * np.pi * 5
    >>> step = responses([((0, 0, omega**2), (1, 2 * omega, omega**2))], np.ones(1000), 1000.0)
    >>> step[:, [0, 20, -1]].round(3)
    array([[0.   , 0.137, 1.   ]])
    """
    double = 2 * fs
    digital = [
        [(q * double + p) * double + r, 2 * (r - q * double**2), (q * double - p) * double + r]
        for system in systems
        for q, p, r in system
    ]
    b, a = np.array(digital[::2]), np.array(digital[1::2])
    return np.stack([filters.lfilter(*system, signal) for system in zip(b, a, strict=True)])
