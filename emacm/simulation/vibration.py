"""Forces on the housing caused by motion and faults, and its acceleration."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

from emacm.simulation.actuator import PEAK_SPEED, RATED_CURRENT, RATED_FORCE, Actuator
from emacm.simulation.constants import CONTACT, MODES, NOISE_RATE, PRELOAD, RADIAL
from emacm.simulation.faults import CAGE_ORDER, FAULTS, POLE_PAIRS, Passage
from emacm.simulation.mechanics import responses
from emacm.simulation.motor import Torques
from emacm.simulation.waves import OrderWaves

GRAVITY = 9.80665  # m/s²
_HIGHEST = 0.45  # highest modal frequency, relative to the sampling rate


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
    speed = np.abs(torques.velocity)
    speed /= PEAK_SPEED
    pressed = np.abs(torques.load)
    pressed /= RATED_FORCE * actuator.torque_per_force
    pressed += PRELOAD
    np.sqrt(pressed, out=pressed)
    current = np.abs(torques.motor)
    current /= actuator.torque_constant * RATED_CURRENT
    rolling = 1 + FAULTS["lubrication"].rolling_noise * faults.get("lubrication", 0.0)
    if cage := faults.get("cage", 0.0):
        rub = FAULTS["cage"].rolling_noise * cage
        rolling = rolling * (1 + rub * np.sin(CAGE_ORDER * torques.angle + actuator.mark))
    force = rng.standard_normal(len(speed))
    force *= actuator.rolling_noise * np.sqrt(fs / NOISE_RATE)  # constant density
    force *= rolling
    force *= speed
    force *= pressed
    force += actuator.waviness * pressed * lines
    unbalance = waves.sines((1, actuator.unbalance, 2 * actuator.mark))
    unbalance *= torques.velocity**2
    force += unbalance
    radial = waves.sines((2 * POLE_PAIRS, RADIAL, actuator.mark))
    radial *= current
    force += radial
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
    for ratio, share in MODES:
        if actuator.resonance * ratio > _HIGHEST * fs:
            continue
        omega = 2 * np.pi * actuator.resonance * ratio
        # Prewarping: the bilinear transform shifts frequencies.
        omega = 2 * fs * np.tan(omega / (2 * fs))
        above = (share / actuator.housing_mass / GRAVITY, 0.0, 0.0)
        modes.append((above, (1.0, 2 * actuator.damping * omega, omega**2)))
    if not modes:
        return np.zeros_like(force)
    return responses(modes, force, fs).sum(axis=0)


def _contact_force(impulses: NDArray[np.floating], fs: float) -> NDArray[np.floating]:
    """Convert impulses [N s] to half-sines of force [N] of the duration of the contact."""
    n_contact = max(1, round(CONTACT * fs))
    shape = np.sin(np.pi * (np.arange(n_contact) + 0.5) / n_contact)
    return filters.lfilter(shape * (fs / shape.sum()), [1.0], impulses)
