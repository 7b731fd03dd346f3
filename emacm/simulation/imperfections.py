"""Imperfections of a healthy unit: resolver error, rolling elements, warm-up, drift."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from emacm.simulation.actuator import Actuator
from emacm.simulation.constants import (
    COLDEST,
    HEALTHY_LINES,
    HEATING,
    OF_LINES,
    RESOLVER_ERRORS,
    SLIP,
    WARM,
    WARM_UP,
)
from emacm.simulation.faults import HEALTHY_ORDERS
from emacm.simulation.waves import OrderWaves

_ARCMIN = np.pi / 180 / 60  # rad
_LINE_RATE = 12_000.0  # Hz
_WALK_STEPS = 20  # samples at that rate per step of the slip


class Imperfections(NamedTuple):
    """Sizes relative to the nominal actuator, and phases, of the imperfections of one unit.

    Attributes
    ----------
    resolver_shares, resolver_phases : ndarray of shape (3,)
        Error of the resolver at orders 1, 2 and 12, in the order of `RESOLVER_ERRORS`.
    line_shares : ndarray of shape (n_lines,)
        Lines of the rolling elements, in the order of `HEALTHY_LINES`.
    """

    resolver_shares: NDArray[np.floating]
    resolver_phases: NDArray[np.floating]
    line_shares: NDArray[np.floating]


def draw_imperfections(rng: np.random.Generator, *, spread: float = 1.0) -> Imperfections:
    """Draw the imperfections of one unit.

    Parameters
    ----------
    rng : Generator
        Random numbers of the unit.
    spread : float
        Unit-to-unit variation relative to the default; 0: all relative sizes are 1.

    Returns
    -------
    Imperfections

    Examples
    --------
    >>> draw_imperfections(np.random.default_rng(0), spread=0).resolver_shares
    array([1., 1., 1.])
    """
    n_errors, n_lines = len(RESOLVER_ERRORS), len(HEALTHY_LINES)
    shares = np.exp(spread * OF_LINES * rng.standard_normal(n_errors + n_lines))
    phases = min(spread, 1.0) * rng.uniform(0, 2 * np.pi, n_errors)
    return Imperfections(shares[:n_errors], phases, shares[n_errors:])


def resolver_error(
    angle: NDArray[np.floating] | OrderWaves, actuator: Actuator, imperfections: Imperfections
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return the error of the resolver, and its derivative by the angle.

    Parameters
    ----------
    angle : ndarray of shape (n_times,) or OrderWaves
        Shaft angle [rad].
    actuator : Actuator
        Constants.
    imperfections : Imperfections
        Imperfections of the unit.

    Returns
    -------
    error : ndarray of shape (n_times,)
        Indicated minus true angle [rad], at orders 1, 2 and 12.
    slope : ndarray of shape (n_times,)
        Error of the indicated velocity, relative to the velocity.

    Examples
    --------
    >>> unit = draw_imperfections(np.random.default_rng(0), spread=0)
    >>> error, _ = resolver_error(np.array([np.pi / 2]), Actuator(), unit)  # 3' at order 1
    >>> (error * 180 * 60 / np.pi).round(6)
    array([3.])
    """
    waves, size = OrderWaves.of(angle), actuator.resolver_error * _ARCMIN
    parts = [
        (order, size * relative * share, phase)
        for (order, relative), share, phase in zip(RESOLVER_ERRORS, *imperfections[:2], strict=True)
    ]
    slopes = [(order, order * size, phase + np.pi / 2) for order, size, phase in parts]
    return waves.sines(*parts), waves.sines(*slopes)


class HealthyLines(NamedTuple):
    """Lines that the rolling elements of a healthy unit cause.

    Attributes
    ----------
    force, torque : ndarray of shape (n_times,)
        Force on the housing relative to `Actuator.waviness`, and friction torque relative to
        `Actuator.recirculation`.
    """

    force: NDArray[np.floating]
    torque: NDArray[np.floating]


def healthy_lines(
    angle: NDArray[np.floating],
    imperfections: Imperfections,
    rng: np.random.Generator,
    fs: float,
) -> HealthyLines:
    """Return the lines of waviness and of the passage of balls in bearing and screw.

    Every part has its own slip: a random walk over the travel, as in `ball_passage`.

    Parameters
    ----------
    angle : ndarray of shape (n_times,)
        Shaft angle [rad].
    imperfections : Imperfections
        Imperfections of the unit.
    rng : Generator
        Random numbers of the run: positions of the balls at the start, and slip.
    fs : float
        Sampling rate [Hz]. Lines are at most at 1 kHz: above 12 kHz they are interpolated.

    Returns
    -------
    HealthyLines
    """
    step = max(1, int(fs / _LINE_RATE))
    fine = _every(len(angle), step)
    turned = angle[fine]
    force, torque = np.zeros_like(turned), np.zeros_like(turned)
    coarse = _every(len(turned), _WALK_STEPS)
    travel = np.abs(np.diff(turned[coarse])) / (2 * np.pi)
    waves = {}
    for part, order in HEALTHY_ORDERS.items():
        steps = SLIP * np.sqrt(order * travel) * rng.standard_normal(len(travel))
        walk = 2 * np.pi * np.concatenate(([rng.uniform()], steps)).cumsum()
        slipped = np.interp(np.arange(len(turned)), coarse, walk)
        waves[part] = OrderWaves(order * turned + slipped)
    for (part, harmonic, of_force, of_torque), share in zip(
        HEALTHY_LINES, imperfections.line_shares, strict=True
    ):
        wave = waves[part].sines((harmonic, share, 0.0))
        force += of_force * wave
        torque += of_torque * wave
    if step == 1:
        return HealthyLines(force, torque)
    samples = np.arange(len(angle))
    return HealthyLines(*(np.interp(samples, fine, wave) for wave in (force, torque)))


def _every(n_samples: int, step: int) -> NDArray[np.intp]:
    """Return every `step`-th sample and the last."""
    kept = np.arange(0, n_samples, step)
    return kept if kept[-1] == n_samples - 1 else np.append(kept, n_samples - 1)


def warmth(rng: np.random.Generator, run: int) -> float:
    """Return how warm a unit is in a run: 0 cold, 1 warm.

    Parameters
    ----------
    rng : Generator
        Random numbers of the unit in a condition: its temperature at the first run.
    run : int
        Number of the run, from 1.

    Returns
    -------
    float

    Examples
    --------
    >>> [round(warmth(np.random.default_rng(0), run), 2) for run in (1, 10, 100)]
    [0.32, 0.78, 1.0]
    """
    first = rng.uniform(*COLDEST)
    return float(1 - (1 - first) * np.exp(-(run - 1) / WARM_UP))


def drift(name: str, times: NDArray[np.floating], spread: float = 1.0) -> NDArray[np.floating]:
    """Return a constant during a recording, relative to its value at the start.

    Parameters
    ----------
    name : str
        One of the constants in `WARM`.
    times : ndarray of shape (n_times,)
        Times [s]; the recording starts at 0.
    spread : float
        Run-to-run variation relative to the default; 0: no drift.

    Returns
    -------
    ndarray of shape (n_times,)

    Examples
    --------
    >>> drift("viscous", np.array([0.0, 10.0]))
    array([1.  , 0.98])
    """
    return 1 + spread * HEATING * WARM[name] * times
