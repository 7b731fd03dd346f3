"""From motion and faults to forces on the housing, and to its acceleration."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

from emacm.simulation.actuator import PEAK_SPEED, RATED_CURRENT, RATED_FORCE, Actuator
from emacm.simulation.faults import CAGE_ORDER, POLE_PAIRS, Passage
from emacm.simulation.motor import Torques

GRAVITY = 9.80665  # m/s²
# Modes of the housing: frequency over that of the first, share of the motion. Assumed: the
# fixture, the housing, the end shield, at 420, 1900 and 5200 Hz.
MODES = ((1.0, 0.3), (1900 / 420, 0.4), (5200 / 420, 0.3))
_NOISE_RATE = 48_000.0  # Hz, at which the rolling noise is stated
_HIGHEST = 0.45  # of the sampling rate
_CONTACT = 1e-4  # s that a strike lasts; assumed
# At severity 1 [N s], [N]; assumed.
_STRIKE = {"inner ring": 0.04, "outer ring": 0.05, "ball": 0.03, "screw": 0.04}
_KNOCK = 0.3  # N s, of backlash
_CAGE_RUB = 0.8  # modulation of the rolling noise
_PULL = 40.0  # N, of an eccentric rotor
_DRY_ROLLING = 2.0  # more rolling noise without grease, in shares of it
_RADIAL = 4.0  # N, of the motor at rated current, at twice its electrical order


def housing_force(
    torques: Torques,
    actuator: Actuator,
    faults: Mapping[str, float],
    passages: Mapping[str, Passage],
    knocks: NDArray[np.intp],
    rng: np.random.Generator,
    fs: float,
) -> NDArray[np.floating]:
    """Return the force that shakes the housing.

    Rolling noise and strikes grow with speed, and with the root of the load (assumed;
    measured exponents scatter); unbalance grows with the square of speed.

    Parameters
    ----------
    torques : Torques
        Torques and motion of the shaft.
    actuator : Actuator
        Constants.
    faults : mapping of str to float
        Severities in [0, 1].
    passages : mapping of str to Passage
        How balls pass the defects.
    knocks : ndarray of shape (n_knocks,), of int
        Samples at which the nut strikes its other flank.
    rng : Generator
        Of rolling noise and of the scatter of strikes.
    fs : float
        Sampling rate [Hz].

    Returns
    -------
    ndarray of shape (n_times,)
        Force [N].
    """
    angle = torques.angle
    speed = np.abs(torques.velocity) / PEAK_SPEED
    thrust = np.abs(torques.load) / (RATED_FORCE * actuator.torque_per_force)
    pressed = np.sqrt(0.2 + thrust)  # the preload is a fifth of the rated force
    current = np.abs(torques.motor) / (actuator.torque_constant * RATED_CURRENT)
    rolling = 1 + _DRY_ROLLING * faults.get("lubrication", 0.0)
    if cage := faults.get("cage", 0.0):
        rolling = rolling * (1 + _CAGE_RUB * cage * np.sin(CAGE_ORDER * angle + actuator.mark))
    white = np.sqrt(fs / _NOISE_RATE) * rng.standard_normal(len(angle))  # of one density
    force = actuator.rolling_noise * speed * pressed * rolling * white
    force += actuator.unbalance * torques.velocity**2 * np.sin(angle + 2 * actuator.mark)
    force += _RADIAL * current * np.sin(2 * POLE_PAIRS * angle + actuator.mark)
    if eccentric := faults.get("eccentricity", 0.0):
        # The narrow side of the gap turns: its pull shows at order 1 and beside order 12.
        pull = _PULL * eccentric * np.sin(angle + 2 * actuator.mark)
        force += pull * (0.3 + current) * (1 + 0.5 * np.cos(2 * POLE_PAIRS * angle))
    struck = np.zeros_like(angle)
    for name, passage in passages.items():
        at = passage.strikes
        size = faults[name] * _STRIKE[name] * np.exp(0.2 * rng.standard_normal(len(at)))
        struck[at] += size * passage.weight[at] * speed[at] * pressed[at]
    struck[knocks] += _KNOCK * faults.get("backlash", 0.0)
    return force + _lasting(struck, fs)


def housing_acceleration(
    force: NDArray[np.floating], actuator: Actuator, fs: float
) -> NDArray[np.floating]:
    """Return the acceleration of the housing under a force.

    A sum of three modes, each ``share / mass * s² / (s² + 2 z w s + w²)``. Modes above 0.45 of
    the sampling rate, which no filter would let through, are left out.

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
    for ratio, share in MODES:
        if actuator.resonance * ratio > _HIGHEST * fs:
            continue
        omega = 2 * np.pi * actuator.resonance * ratio
        # The bilinear transform bends the axis: put the mode where it belongs.
        omega = 2 * fs * np.tan(omega / (2 * fs))
        below = [1.0, 2 * actuator.damping * omega, omega**2]
        b, a = filters.bilinear([share / actuator.housing_mass / GRAVITY, 0, 0], below, fs=fs)
        acceleration += filters.lfilter(b, a, force)
    return acceleration


def _lasting(struck: NDArray[np.floating], fs: float) -> NDArray[np.floating]:
    """Spread impulses [N s] over the time of contact, as half-sines of force [N]."""
    if not struck.any():
        return struck
    n_contact = max(1, round(_CONTACT * fs))
    shape = np.sin(np.pi * (np.arange(n_contact) + 0.5) / n_contact)
    return filters.lfilter(shape * (fs / shape.sum()), [1.0], struck)
