"""Torque required by a motion, phase currents, and vibration of the housing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters
from scipy.constants import g, lbf

from emacm.simulation.impacts import Passage
from laboratory.constants import (
    ASSUMED,
    PEAK_SPEED,
    RATED_CURRENT,
    RATED_FORCE,
    SUPPLY_VOLTAGE,
    Actuator,
    Array,
    drift,
    sines,
)
from laboratory.faults import CAGE_ORDER, POLE_PAIRS, Fault
from laboratory.mechanics import Motion, jam_torque


class Unit(NamedTuple):
    """One unit in one run.

    Attributes
    ----------
    actuator : Actuator
        Its constants.
    faults : mapping of str to Fault
        All faults with their sizes in this unit; 0: absent.
    passages : mapping of str to Passage
        Passages of rolling elements over each defect that is present.
    """

    actuator: Actuator
    faults: Mapping[str, Fault]
    passages: Mapping[str, Passage]


class Torques(NamedTuple):
    """Torques on the shaft, and its motion including torque ripple.

    Attributes
    ----------
    motor, load : ndarray of shape (n_times,)
        Torque of the motor and the load [N m].
    angle, velocity : ndarray of shape (n_times,)
        Motion of the shaft including ripple [rad], [rad/s].
    """

    motor: Array
    load: Array
    angle: Array
    velocity: Array


def shaft_torques(
    unit: Unit,
    motion: Motion,
    force: Array,
    lines: Array,
    rng: np.random.Generator,
    run_spread: float,
) -> Torques:
    """Return the torques that a motion requires, and the motion including their ripple.

    Parameters
    ----------
    unit : Unit
        Constants and faults.
    motion : Motion
        Motion without ripple.
    force : ndarray of shape (n_times,)
        Load force [lbf].
    lines : ndarray of shape (n_times,)
        Relative torque of `healthy_lines`.
    rng : Generator
        Random numbers of the friction.
    run_spread : float
        Run-to-run variation relative to the default, with which friction drifts over the times.

    Returns
    -------
    Torques

    Notes
    -----
    Friction has a Coulomb part, a viscous part, and the loss of the screw in proportion to the
    load. Under the velocity loop (PI, damping ratio 0.8, assumed), ripple `d` moves the shaft by
    ``d / (J (s² + 2 z w s + w²))``, and the motor compensates the rest: below the bandwidth of the
    loop a defect is visible in the current, above it in the speed.
    """
    actuator, faults = unit.actuator, unit.faults
    load = force * lbf * actuator.torque_per_force
    direction = np.tanh(motion.velocity / ASSUMED.stiction_speed)
    dry_friction = actuator.coulomb * (1 + faults["lubrication"].friction)
    friction = drift("coulomb", motion.times, run_spread) * dry_friction
    friction += (1 / actuator.efficiency - 1) * np.abs(load)
    if faults["jam"].friction:
        friction += jam_torque(motion.angle, actuator, faults["jam"])
    viscous = drift("viscous", motion.times, run_spread) * actuator.viscous
    friction = friction * direction + viscous * motion.velocity
    motor = actuator.inertia * motion.acceleration + load + friction
    # Where a jam stops the shaft, friction takes what exceeds the torque limit.
    motor = np.clip(motor, -actuator.max_torque, actuator.max_torque)
    loaded = np.abs(load) / (actuator.torque_constant * RATED_CURRENT) + ASSUMED.free_torque
    braking = _braking(unit, motion.angle, loaded, rng)
    ripple = _ripple(unit, motion.angle, motor)
    ripple -= (braking + loaded * actuator.recirculation * lines) * direction
    angle, velocity, acceleration = _loop_response(ripple, actuator, motion.times)
    motor = motor + actuator.inertia * acceleration - ripple
    return Torques(motor, load, angle + motion.angle, velocity + motion.velocity)


def phase_currents(unit: Unit, torque: Array, angle: Array) -> Array:
    """Return the currents of the phases, which sum to zero: the star point is not connected.

    Unequal phases add a current that passes the phases in the opposite order (negative sequence).
    The controller keeps the current vector perpendicular to the rotor flux (no d-current), so
    that torque is proportional to its length. Dead time of the inverter adds the 5th and 7th
    harmonic; their torque is included in the cogging torque.

    Parameters
    ----------
    unit : Unit
        Constants and faults.
    torque : ndarray of shape (n_times,)
        Motor torque [N m].
    angle : ndarray of shape (n_times,)
        Shaft angle [rad].

    Returns
    -------
    ndarray of shape (3, n_times)
        Currents [A]; orders around 6, Eqs. (2.2) to (2.4) of the thesis.

    Examples
    --------
    >>> from laboratory.faults import FAULTS
    >>> unit = Unit(Actuator(), {name: fault.scaled(0) for name, fault in FAULTS.items()}, {})
    >>> quarter = np.array([np.pi / 2 / POLE_PAIRS])
    >>> phase_currents(unit, np.array([5.28]), quarter).round(1).ravel()
    array([-10.,   5.,   5.])
    """
    length = torque / unit.actuator.torque_constant
    # Fundamental and 7th harmonic pass the phases in the order a, b, c, the others a, c, b.
    fifth, seventh = ASSUMED.dead_time
    electrical, mismatch, quarter = POLE_PAIRS * angle, _mismatch(unit), np.pi / 2
    alpha = sines(electrical, (1, 1 + mismatch, 0), (7, seventh, 0), (5, fifth, 0))
    beta = sines(
        electrical, (1, mismatch - 1, quarter), (7, -seventh, quarter), (5, fifth, quarter)
    )
    return -length * _phases(alpha, beta)


def _phases(alpha: Array, beta: Array) -> Array:
    """Return the three phases of a vector with the given components along and across phase a."""
    turns = 2 * np.pi / 3 * np.arange(3)[:, np.newaxis]
    return np.cos(turns) * alpha + np.sin(turns) * beta


def carrier_ripple(torques: Torques, times: Array, phase: float, actuator: Actuator) -> Array:
    """Return the ripple of the phase currents at the switching frequency of the inverter.

    The lines at ``carrier +- 2 x`` the electrical frequency of a sine-triangle modulation have the
    voltage ``2 V_dc / pi J_2(pi M / 2)`` each [1]_, M being the voltage of a phase relative to half
    the DC link; the line at the carrier itself is equal in all phases and drives no current. They
    are fixed in time, and sum to zero over the phases. Lines at twice the carrier are above the
    conditioning filter.

    Parameters
    ----------
    torques : Torques
        Torque and motion of the shaft.
    times : ndarray of shape (n_times,)
        Times [s].
    phase : float
        Phase of the carrier [rad].
    actuator : Actuator
        Constants.

    Returns
    -------
    ndarray of shape (3, n_times)
        Currents [A].

    References
    ----------
    .. [1] D. G. Holmes and T. A. Lipo, Pulse Width Modulation for Power Converters, 2003.
    """
    link = SUPPLY_VOLTAGE * np.sqrt(2)  # V: rectified supply
    # With the current perpendicular to the rotor flux, v_q = k w + R i and v_d = -p w L i.
    current, velocity = torques.motor / actuator.torque_constant, torques.velocity
    across = actuator.emf_constant * velocity + actuator.winding_resistance * current
    along = POLE_PAIRS * actuator.winding_inductance * velocity * current
    x2 = (np.pi * np.sqrt(across**2 + along**2) / link) ** 2  # square of pi M / 2
    bessel = x2 / 8 * (1 - x2 / 12 * (1 - x2 / 32))  # J_2 within 1 % up to M = 1.15
    reactance = 2 * np.pi * ASSUMED.carrier * actuator.winding_inductance
    size = 4 * link / np.pi / reactance * bessel
    size *= np.sin(2 * np.pi * ASSUMED.carrier * times + phase)
    twice = 2 * POLE_PAIRS * torques.angle
    return _phases(size * np.cos(twice), -size * np.sin(twice))  # in the order a, c, b


def _mismatch(unit: Unit) -> float:
    return unit.actuator.phase_mismatch - unit.faults["phase imbalance"].imbalance


def _ripple(unit: Unit, angle: Array, mean: Array) -> Array:
    """Return torque ripple of mean 0: alignment, cogging, eccentricity and phase imbalance."""
    actuator = unit.actuator
    ripple = sines(
        angle,
        (1, actuator.ripple, actuator.mark),
        (ASSUMED.cogging_order, actuator.cogging, actuator.mark),
        (1, unit.faults["eccentricity"].torque, 2 * actuator.mark),
    )
    # The torque of the negative sequence pulsates at twice the supply order.
    return ripple - mean * _mismatch(unit) * np.cos(2 * POLE_PAIRS * angle)


def _braking(unit: Unit, angle: Array, loaded: Array, rng: np.random.Generator) -> Array:
    """Return the varying part of the friction torque, which opposes either direction."""
    mark, braking = unit.actuator.mark, np.zeros_like(angle)
    for name, passage in unit.passages.items():
        braking += unit.faults[name].torque * loaded * passage.pulses
    if cage := unit.faults["cage"].torque:
        braking += cage * np.sin(CAGE_ORDER * angle + mark)
    dry = unit.faults["lubrication"]
    if dry.torque:
        braking += dry.torque * np.sin(angle + 3 * mark)
        braking += dry.friction_noise * unit.actuator.coulomb * _noise_over_travel(angle, rng)
    return braking


def low_passed_noise(
    n_samples: int, corner: float, rate: float, rng: np.random.Generator, rms: float = 1.0
) -> Array:
    """Return stationary noise below a corner, in the unit of `rate`: 1/s or 1/revolution."""
    decay = np.exp(-2 * np.pi * corner / rate)
    white = rms * np.sqrt(1 - decay**2) * rng.standard_normal(n_samples)
    white[0] /= np.sqrt(1 - decay**2)  # stationary from the first sample
    return filters.lfilter([1.0], [1.0, -decay], white)


def _noise_over_travel(
    angle: Array, rng: np.random.Generator, order: float = 1.5, per_rev: int = 32
) -> Array:
    """Return noise of unit variance over the travel, low-passed at an order (assumed: 1.5)."""
    travel = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(angle))))) / (2 * np.pi)
    n_steps = int(travel[-1] * per_rev) + 2
    noise = low_passed_noise(n_steps, order, per_rev, rng)
    return np.interp(travel, np.arange(n_steps) / per_rev, noise)


def _loop_response(ripple: Array, actuator: Actuator, times: Array) -> tuple[Array, Array, Array]:
    """Return the angle, velocity and acceleration that ripple causes under the velocity loop."""
    corner = 2 * np.pi * actuator.velocity_bandwidth
    below = (1.0, 2 * ASSUMED.damping * corner, corner**2)
    disturbed, fs = ripple / actuator.inertia, 1 / (times[1] - times[0])
    angle, velocity = (
        filters.lfilter(*filters.bilinear(above, below, fs), disturbed)
        for above in ((1.0,), (1.0, 0.0))
    )
    # s² + 2 z w s + w² is the denominator, so the acceleration is what the loop leaves.
    return angle, velocity, disturbed - below[1] * velocity - below[2] * angle


def housing_force(
    unit: Unit,
    torques: Torques,
    knocks: NDArray[np.intp],
    lines: Array,
    rng: np.random.Generator,
    fs: float,
) -> Array:
    """Return the force that excites the housing.

    Rolling noise and impacts are proportional to speed and to the square root of the load
    (assumed; measured exponents vary); unbalance is proportional to the square of speed. The
    force of waviness is displacement times contact stiffness, and does not depend on speed.

    Parameters
    ----------
    unit : Unit
        Constants and faults.
    torques : Torques
        Torques and motion of the shaft.
    knocks : ndarray of shape (n_knocks,), of int
        Samples at which the nut hits its opposite flank.
    lines : ndarray of shape (n_times,)
        Relative force of `healthy_lines`.
    rng : Generator
        Random numbers of the rolling noise.
    fs : float
        Sampling rate [Hz].

    Returns
    -------
    ndarray of shape (n_times,)
        Force [N].
    """
    actuator, faults, angle = unit.actuator, unit.faults, torques.angle
    speed = np.abs(torques.velocity) / PEAK_SPEED
    rated_torque = RATED_FORCE * actuator.torque_per_force
    pressed = np.sqrt(np.abs(torques.load) / rated_torque + ASSUMED.preload)
    current = np.abs(torques.motor) / (actuator.torque_constant * RATED_CURRENT)
    rolling = 1 + faults["lubrication"].rolling_noise
    if rub := faults["cage"].rolling_noise:
        rolling = rolling * (1 + rub * np.sin(CAGE_ORDER * angle + actuator.mark))
    density = actuator.rolling_noise * np.sqrt(fs / ASSUMED.noise_rate)  # the same at any rate
    force = rng.standard_normal(len(speed)) * density * rolling * speed * pressed
    force += actuator.waviness * pressed * lines
    force += actuator.unbalance * np.sin(angle + 2 * actuator.mark) * torques.velocity**2
    force += ASSUMED.radial * np.sin(2 * POLE_PAIRS * angle + actuator.mark) * current
    if eccentric := faults["eccentricity"].force:
        # The narrow side of the air gap turns: lines at order 1, and as sidebands of order 12.
        pull = eccentric * np.sin(angle + 2 * actuator.mark) * (0.3 + current)
        force += pull * (1 + 0.5 * np.cos(2 * POLE_PAIRS * angle))
    impulses = np.zeros_like(speed)
    for name, passage in unit.passages.items():
        at = passage.impacts
        size = faults[name].impact * passage.sizes
        impulses[at] += size * passage.weight[at] * speed[at] * pressed[at]
    impulses[knocks] += faults["backlash"].impact
    return force + _contact_force(impulses, fs)


def housing_acceleration(force: Array, actuator: Actuator, fs: float) -> Array:
    """Return the acceleration of the housing under a force.

    A sum of three modes, each ``share / mass * s² / (s² + 2 z w s + w²)``. Modes above 0.45 of
    the sampling rate, which the conditioning filter removes, are left out.

    Parameters
    ----------
    force : ndarray of shape (n_times,)
        Force [N].
    actuator : Actuator
        Constants.
    fs : float
        Sampling rate [Hz].

    Returns
    -------
    ndarray of shape (n_times,)
        Acceleration [g].
    """
    acceleration = np.zeros_like(force)
    for ratio, share in ASSUMED.modes:
        omega = 2 * np.pi * actuator.resonance * ratio
        if omega > ASSUMED.highest_mode * 2 * np.pi * fs:
            continue
        omega = 2 * fs * np.tan(omega / (2 * fs))  # the bilinear transform shifts frequencies
        above = (share / actuator.housing_mass / g, 0.0, 0.0)
        below = (1.0, 2 * actuator.damping * omega, omega**2)
        acceleration += filters.lfilter(*filters.bilinear(above, below, fs), force)
    return acceleration


def _contact_force(impulses: Array, fs: float) -> Array:
    """Convert impulses [N s] to half-sines of force [N] of the duration of the contact."""
    n_contact = max(1, round(ASSUMED.contact * fs))
    shape = np.sin(np.pi * (np.arange(n_contact) + 0.5) / n_contact)
    return filters.lfilter(shape * (fs / shape.sum()), [1.0], impulses)
