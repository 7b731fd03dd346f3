"""Torque required by a motion, phase currents, and vibration of the housing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters
from scipy.constants import g, lbf

from emacm.simulation.faults import CAGE_ORDER, FAULTS, POLE_PAIRS, Passage, drift
from emacm.simulation.laboratory import (
    ASSUMED,
    PEAK_SPEED,
    RATED_CURRENT,
    RATED_FORCE,
    Actuator,
)
from emacm.simulation.mechanics import Motion, jam_torque, responses
from emacm.simulation.waves import PHASES, OrderWaves, of_phases


class Torques(NamedTuple):
    """Torques on the shaft, and its motion including torque ripple.

    At every instant ``inertia * acceleration = motor - load - friction + ripple``.

    Attributes
    ----------
    motor, load, friction, ripple : ndarray of shape (n_times,)
        Torque of the motor, the load and friction, and angle-dependent ripple [N m].
    angle, velocity, acceleration : ndarray of shape (n_times,)
        Motion of the shaft including ripple [rad], [rad/s], [rad/s²].
    """

    motor: NDArray[np.floating]
    load: NDArray[np.floating]
    friction: NDArray[np.floating]
    ripple: NDArray[np.floating]
    angle: NDArray[np.floating]
    velocity: NDArray[np.floating]
    acceleration: NDArray[np.floating]


def shaft_torques(
    motion: Motion,
    force: NDArray[np.floating],
    actuator: Actuator,
    faults: Mapping[str, float],
    passages: Mapping[str, Passage],
    rng: np.random.Generator,
    lines: NDArray[np.floating] | float = 0.0,
    run_spread: float = 0.0,
) -> Torques:
    """Return the torques that a motion requires, and the motion including their ripple.

    Parameters
    ----------
    motion : Motion
        Motion without ripple.
    force : ndarray of shape (n_times,)
        Load force [lbf].
    actuator : Actuator
        Constants.
    faults : mapping of str to float
        Severities in [0, 1].
    passages : mapping of str to Passage
        Passages of rolling elements over the defects.
    rng : Generator
        Random numbers of the friction.
    lines : ndarray of shape (n_times,) or float
        `HealthyLines.torque`.
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
    load = force * lbf * actuator.torque_per_force
    direction = np.tanh(motion.velocity / ASSUMED.stiction_speed)
    dry = faults.get("lubrication", 0.0)
    dry_friction = actuator.coulomb * (1 + FAULTS["lubrication"].friction * dry)
    friction = drift("coulomb", motion.times, run_spread) * dry_friction
    friction += (1 / actuator.efficiency - 1) * np.abs(load)
    if jam := faults.get("jam", 0.0):
        friction += jam_torque(motion.angle, actuator, jam)
    viscous = drift("viscous", motion.times, run_spread) * actuator.viscous
    friction = friction * direction + viscous * motion.velocity
    motor = actuator.inertia * motion.acceleration + load + friction
    if max(motor.max(), -motor.min()) > actuator.max_torque:
        # Where a jam stops the shaft, friction takes what exceeds the torque limit.
        limited = np.clip(motor, -actuator.max_torque, actuator.max_torque)
        friction += limited - motor
        motor = limited
    waves = OrderWaves(motion.angle)
    ripple = _ripple(waves, motor, actuator, faults)
    braking = _braking(motion.angle, waves, load, actuator, faults, passages, rng)
    loaded = np.abs(load) / (actuator.torque_constant * RATED_CURRENT) + ASSUMED.free_torque
    ripple -= (braking + loaded * actuator.recirculation * lines) * direction
    angle, velocity, acceleration = _loop_response(ripple, actuator, motion.times)
    return Torques(
        motor + actuator.inertia * acceleration - ripple,
        load,
        friction,
        ripple,
        angle + motion.angle,
        velocity + motion.velocity,
        acceleration + motion.acceleration,
    )


def phase_currents(
    torque: NDArray[np.floating],
    angle: NDArray[np.floating] | OrderWaves,
    actuator: Actuator,
    faults: Mapping[str, float],
    phases: str = PHASES,
) -> NDArray[np.floating]:
    """Return the currents of the phases, which sum to zero: the star point is not connected.

    Unequal phases add a current that passes the phases in the opposite order (negative sequence).
    The controller keeps the current vector perpendicular to the rotor flux (no d-current), so
    that torque is proportional to its length. Dead time of the inverter adds the 5th and 7th
    harmonic; their torque is included in the cogging torque.

    Parameters
    ----------
    torque : ndarray of shape (n_times,)
        Motor torque [N m].
    angle : ndarray of shape (n_times,) or OrderWaves
        Shaft angle [rad].
    actuator : Actuator
        Constants.
    faults : mapping of str to float
        Severities in [0, 1].
    phases : str
        Phases to compute.

    Returns
    -------
    ndarray of shape (n_phases, n_times)
        Currents [A]; orders around 6, Eqs. (2.2) to (2.4) of the thesis.

    Examples
    --------
    >>> quarter = np.array([np.pi / 2 / POLE_PAIRS])
    >>> phase_currents(np.array([5.28]), quarter, Actuator(), {}).round(1).ravel()
    array([-10.,   5.,   5.])
    """
    length = torque / actuator.torque_constant
    waves, mismatch = OrderWaves.of(angle), _mismatch(actuator, faults)
    # Fundamental and 7th harmonic pass the phases in the order a, b, c, the others a, c, b.
    positive = ((1, 1.0), (7, ASSUMED.dead_time[1]))
    negative = ((1, mismatch), (5, ASSUMED.dead_time[0]))

    def waves_of(side: int, phase: float) -> NDArray[np.floating]:
        sizes = [(n, size) for n, size in positive] + [(n, side * size) for n, size in negative]
        return waves.sines(*((n * POLE_PAIRS, size, phase) for n, size in sizes))

    a = -length * waves_of(1, 0.0)
    across = np.sqrt(3) / 2 * length * waves_of(-1, np.pi / 2) if phases != "a" else a
    return of_phases(a, across, phases)


def _mismatch(actuator: Actuator, faults: Mapping[str, float]) -> float:
    severity = faults.get("phase imbalance", 0.0)
    return actuator.phase_mismatch - FAULTS["phase imbalance"].imbalance * severity


def _ripple(
    waves: OrderWaves,
    mean: NDArray[np.floating],
    actuator: Actuator,
    faults: Mapping[str, float],
) -> NDArray[np.floating]:
    """Return torque ripple of mean 0: alignment, cogging, eccentricity and phase imbalance."""
    eccentric = FAULTS["eccentricity"].torque * faults.get("eccentricity", 0.0)
    ripple = waves.sines(
        (1, actuator.ripple, actuator.mark),
        (ASSUMED.cogging_order, actuator.cogging, actuator.mark),
        (1, eccentric, 2 * actuator.mark),
    )
    # The torque of the negative sequence pulsates at twice the supply order.
    share = -_mismatch(actuator, faults)
    if share:
        ripple += mean * waves.sines((2 * POLE_PAIRS, share, np.pi / 2))
    return ripple


def _braking(
    angle: NDArray[np.floating],
    waves: OrderWaves,
    load: NDArray[np.floating],
    actuator: Actuator,
    faults: Mapping[str, float],
    passages: Mapping[str, Passage],
    rng: np.random.Generator,
) -> NDArray[np.floating]:
    """Return the varying part of the friction torque, which opposes either direction."""
    braking = np.zeros_like(angle)
    rated = actuator.torque_constant * RATED_CURRENT
    for name, passage in passages.items():
        size = faults[name] * FAULTS[name].torque
        braking += size * (ASSUMED.free_torque + np.abs(load) / rated) * passage.pulses
    if cage := faults.get("cage", 0.0):
        braking += FAULTS["cage"].torque * cage * np.sin(CAGE_ORDER * angle + actuator.mark)
    if dry := faults.get("lubrication", 0.0):
        fault = FAULTS["lubrication"]
        braking += waves.sines((1, dry * fault.torque, 3 * actuator.mark))
        braking += dry * fault.friction_noise * actuator.coulomb * _noise_over_travel(angle, rng)
    return braking


def _noise_over_travel(
    angle: NDArray[np.floating], rng: np.random.Generator, order: float = 1.5, per_rev: int = 32
) -> NDArray[np.floating]:
    """Return noise of unit variance over the travel, low-passed at an order (assumed: 1.5)."""
    travel = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(angle))))) / (2 * np.pi)
    decay = np.exp(-2 * np.pi * order / per_rev)
    grid = np.arange(int(travel[-1] * per_rev) + 2) / per_rev
    white = rng.standard_normal(len(grid)) * np.sqrt(1 - decay**2)
    white[0] /= np.sqrt(1 - decay**2)
    return np.interp(travel, grid, filters.lfilter([1], [1, -decay], white))


def _loop_response(
    ripple: NDArray[np.floating], actuator: Actuator, times: NDArray[np.floating]
) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]:
    """Return the angle, velocity and acceleration that ripple causes under the velocity loop."""
    corner = 2 * np.pi * actuator.velocity_bandwidth
    below = (1.0, 2 * ASSUMED.damping * corner, corner**2)
    disturbed = ripple / actuator.inertia
    systems = [((0.0, 0.0, 1.0), below), ((0.0, 1.0, 0.0), below)]
    angle, velocity = responses(systems, disturbed, 1 / (times[1] - times[0]))
    # s² + 2 z w s + w² is the denominator, so the acceleration is what the loop leaves.
    return angle, velocity, disturbed - below[1] * velocity - below[2] * angle


def housing_force(
    torques: Torques,
    actuator: Actuator,
    faults: Mapping[str, float],
    passages: Mapping[str, Passage],
    knocks: NDArray[np.intp],
    rng: np.random.Generator,
    fs: float,
    lines: NDArray[np.floating] | float = 0.0,
    waves: OrderWaves | None = None,
) -> NDArray[np.floating]:
    """Return the force that excites the housing.

    Rolling noise and impacts are proportional to speed and to the square root of the load
    (assumed; measured exponents vary); unbalance is proportional to the square of speed. The
    force of waviness is displacement times contact stiffness, and does not depend on speed.

    Parameters
    ----------
    torques : Torques
        Torques and motion of the shaft.
    actuator : Actuator
        Constants.
    faults : mapping of str to float
        Severities in [0, 1].
    passages : mapping of str to Passage
        Passages of rolling elements over the defects.
    knocks : ndarray of shape (n_knocks,), of int
        Samples at which the nut hits its opposite flank.
    rng : Generator
        Random numbers of the rolling noise.
    fs : float
        Sampling rate [Hz].
    lines : ndarray of shape (n_times,) or float
        `HealthyLines.force`.
    waves : OrderWaves, optional
        Those of the shaft angle, if they exist already.

    Returns
    -------
    ndarray of shape (n_times,)
        Force [N].
    """
    waves = OrderWaves(torques.angle) if waves is None else waves
    speed = np.abs(torques.velocity) / PEAK_SPEED
    rated_torque = RATED_FORCE * actuator.torque_per_force
    pressed = np.sqrt(np.abs(torques.load) / rated_torque + ASSUMED.preload)
    current = np.abs(torques.motor) / (actuator.torque_constant * RATED_CURRENT)
    rolling = 1 + FAULTS["lubrication"].rolling_noise * faults.get("lubrication", 0.0)
    if cage := faults.get("cage", 0.0):
        rub = FAULTS["cage"].rolling_noise * cage
        rolling = rolling * (1 + rub * np.sin(CAGE_ORDER * torques.angle + actuator.mark))
    density = actuator.rolling_noise * np.sqrt(fs / ASSUMED.noise_rate)  # the same at any rate
    force = rng.standard_normal(len(speed)) * density * rolling * speed * pressed
    force += actuator.waviness * pressed * lines
    force += waves.sines((1, actuator.unbalance, 2 * actuator.mark)) * torques.velocity**2
    force += waves.sines((2 * POLE_PAIRS, ASSUMED.radial, actuator.mark)) * current
    if eccentric := faults.get("eccentricity", 0.0):
        # The narrow side of the air gap turns: lines at order 1, and as sidebands of order 12.
        strength = FAULTS["eccentricity"].force * eccentric
        pull = waves.sines((1, strength, 2 * actuator.mark)) * (0.3 + current)
        force += pull * (1 + waves.sines((2 * POLE_PAIRS, 0.5, np.pi / 2)))
    if not passages and not len(knocks):
        return force
    impulses = np.zeros_like(speed)
    for name, passage in passages.items():
        at = passage.impacts
        size = faults[name] * FAULTS[name].impact * passage.sizes
        impulses[at] += size * passage.weight[at] * speed[at] * pressed[at]
    impulses[knocks] += FAULTS["backlash"].impact * faults.get("backlash", 0.0)
    return force + _contact_force(impulses, fs)


def housing_acceleration(
    force: NDArray[np.floating], actuator: Actuator, fs: float
) -> NDArray[np.floating]:
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
    modes = []
    for ratio, share in ASSUMED.modes:
        if actuator.resonance * ratio > ASSUMED.highest_mode * fs:
            continue
        omega = 2 * np.pi * actuator.resonance * ratio
        # Prewarping: the bilinear transform shifts frequencies.
        omega = 2 * fs * np.tan(omega / (2 * fs))
        above = (share / actuator.housing_mass / g, 0.0, 0.0)
        modes.append((above, (1.0, 2 * actuator.damping * omega, omega**2)))
    if not modes:
        return np.zeros_like(force)
    return responses(modes, force, fs).sum(axis=0)


def _contact_force(impulses: NDArray[np.floating], fs: float) -> NDArray[np.floating]:
    """Convert impulses [N s] to half-sines of force [N] of the duration of the contact."""
    n_contact = max(1, round(ASSUMED.contact * fs))
    shape = np.sin(np.pi * (np.arange(n_contact) + 0.5) / n_contact)
    return filters.lfilter(shape * (fs / shape.sum()), [1.0], impulses)
