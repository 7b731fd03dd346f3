"""Faults of the bench, and imperfections of a healthy unit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm._checks import check_choice, check_number
from emacm.machine.fault_orders import fault_orders
from emacm.machine.rolling import Bearing
from laboratory.constants import ASSUMED, Array

# Assumed: geometry of an angular contact bearing that gives the order 6.123 of chapter 4.
BEARING = Bearing(10, 0.2478, 1.0, math.radians(25))
# Assumed: 20 balls of 1/8 in per turn, on a pitch circle of 24 mm at 45 degrees. The nut is fixed
# like an outer ring; the lead, which changes the order by 0.05 %, is neglected.
SCREW = Bearing(20, 0.1323, 1.0, math.radians(45))
POLE_PAIRS = 6  # Table 4.1: 12 poles
_LINES: Mapping[str, float] = fault_orders(BEARING)["order"].to_dict()
CAGE_ORDER = _LINES["FTF"]
# Orders of the rolling elements of a healthy unit, by part.
HEALTHY_ORDERS: Mapping[str, float] = {
    **{name: _LINES[name] for name in ("FTF", "BPFO", "BPFI", "2xBSF")},
    "screw": float(fault_orders(SCREW)["order"]["BPFO"]),
}


@dataclass(frozen=True, kw_only=True)
class Fault:
    """Orders of a fault, and its effects at severity 1. All sizes are assumed.

    Attributes
    ----------
    orders : tuple of float
        Orders in torque, motion and housing vibration; further lines appear at their multiples
        and, if the defect passes through a load zone, as sidebands. In a phase current an order o
        appears at ``|6 +- o|``, Eq. (2.4). Empty: the fault has no order of its own.
    rolls : bool
        Whether rolling elements pass over the defect.
    turns_with : float
        Order at which the defect turns through the load zone; 0: it does not move.
    torque : float
        Amplitude of the torque ripple [N m]; of a rolling element passage at rated load.
    impact : float
        Impulse of one impact [N s].
    force : float
        Amplitude of the force on the housing [N].
    rolling_noise : float
        Increase, or for a cage the modulation, of the rolling noise, relative to it.
    friction : float
        Increase of the Coulomb friction, relative to it; of a jam: friction torque relative to
        the torque limit.
    friction_noise : float
        RMS of the random part of the friction, relative to the Coulomb friction.
    imbalance : float
        Negative-sequence current relative to the positive sequence, in phase opposition in phase
        A: the fraction of its current that phase A lacks. The currents still sum to zero.
    backlash : float
        Clearance of the nut [in].
    place, width : float
        Position and width of a jam [in].
    """

    orders: tuple[float, ...] = ()
    rolls: bool = False
    turns_with: float = 0.0
    torque: float = 0.0
    impact: float = 0.0
    force: float = 0.0
    rolling_noise: float = 0.0
    friction: float = 0.0
    friction_noise: float = 0.0
    imbalance: float = 0.0
    backlash: float = 0.0
    place: float = 0.0
    width: float = 1.0

    def scaled(self, severity: float) -> Fault:
        """Return the fault with its sizes at a severity in [0, 1]."""
        sizes = (field.name for field in fields(self) if field.name not in _GEOMETRY)
        return replace(self, **{name: severity * getattr(self, name) for name in sizes})


_GEOMETRY = ("orders", "rolls", "turns_with", "place", "width")


FAULTS: Mapping[str, Fault] = {
    "inner ring": Fault(
        orders=(_LINES["BPFI"],), rolls=True, turns_with=1.0, torque=0.3, impact=0.04
    ),
    "outer ring": Fault(orders=(_LINES["BPFO"],), rolls=True, torque=0.3, impact=0.05),
    "ball": Fault(
        orders=(_LINES["2xBSF"],), rolls=True, turns_with=CAGE_ORDER, torque=0.3, impact=0.03
    ),
    "cage": Fault(orders=(CAGE_ORDER,), torque=0.15, rolling_noise=0.8),
    # A spall in the groove of the nut.
    "screw": Fault(orders=(HEALTHY_ORDERS["screw"],), rolls=True, torque=0.3, impact=0.04),
    "eccentricity": Fault(orders=(1.0,), torque=0.3, force=40.0),
    # An impact where the load changes its sign; 0.01 in is a worn-out screw.
    "backlash": Fault(backlash=0.01, impact=0.3),
    "phase imbalance": Fault(orders=(2.0 * POLE_PAIRS,), imbalance=0.3),
    # 1x, random friction, and sidebands of order 6 of the current.
    "lubrication": Fault(
        orders=(1.0,), torque=0.15, friction=1.5, friction_noise=0.35, rolling_noise=2.0
    ),
    # Condition 3 reaches its place only with a longer lead.
    "jam": Fault(friction=0.6, place=1.9, width=0.15),
}
FAULT_ORDERS: Mapping[str, tuple[float, ...]] = {
    name: fault.orders for name, fault in FAULTS.items()
}


def check_faults(faults: Any) -> dict[str, float]:
    """Return severities in [0, 1] by fault, in the order of `FAULTS`.

    Examples
    --------
    >>> check_faults({"jam": 0.5, "ball": 1})
    {'ball': 1.0, 'jam': 0.5}
    """
    if not isinstance(faults, Mapping):
        raise TypeError(f"faults must be a mapping such as {{'inner ring': 0.5}}, got {faults!r}.")
    for name, severity in faults.items():
        check_choice(name, "a fault", tuple(FAULTS))
        check_number(severity, f"severity of {name!r}", at_least=0, at_most=1)
    return {name: float(faults[name]) for name in FAULTS if name in faults}


def draw_imperfections(rng: np.random.Generator, spread: float = 1.0) -> tuple[Array, Array, Array]:
    """Draw the imperfections of one unit, relative to the nominal actuator.

    Parameters
    ----------
    rng : Generator
        Random numbers of the unit.
    spread : float
        Unit-to-unit variation relative to the default; with 0, all sizes are 1.

    Returns
    -------
    resolver_shares, resolver_phases : ndarray of shape (3,)
        Size and phase [rad] of the errors of the resolver, in the order of
        `ASSUMED.resolver_errors`.
    line_shares : ndarray of shape (n_lines,)
        Sizes of the lines of the rolling elements, in the order of `ASSUMED.healthy_lines`.

    Examples
    --------
    >>> draw_imperfections(np.random.default_rng(0), spread=0)[0]
    array([1., 1., 1.])
    """
    n_errors, n_lines = len(ASSUMED.resolver_errors), len(ASSUMED.healthy_lines)
    shares = np.exp(spread * ASSUMED.of_lines * rng.standard_normal(n_errors + n_lines))
    phases = min(spread, 1.0) * rng.uniform(0, 2 * np.pi, n_errors)
    return shares[:n_errors], phases, shares[n_errors:]


def healthy_lines(
    angle: Array, shares: Array, rng: np.random.Generator, fs: float
) -> tuple[Array, Array]:
    """Return the lines of waviness and of the passage of balls in bearing and screw.

    Every part has its own slip: a random walk over the travel, as in `ball_passage`.

    Parameters
    ----------
    angle : ndarray of shape (n_times,)
        Shaft angle [rad].
    shares : ndarray of shape (n_lines,)
        From `draw_imperfections`.
    rng : Generator
        Random numbers of the run: positions of the balls at the start, and slip.
    fs : float
        Sampling rate [Hz]. Lines are at most at 1 kHz: above 12 kHz they are interpolated.

    Returns
    -------
    force, torque : ndarray of shape (n_times,)
        Force on the housing relative to `Actuator.waviness`, and friction torque relative to
        `Actuator.recirculation`.
    """
    fine = _every(len(angle), max(1, int(fs / ASSUMED.line_rate)))
    turned = angle[fine]
    force, torque = np.zeros_like(turned), np.zeros_like(turned)
    coarse = _every(len(turned), ASSUMED.walk_steps)
    travel = np.abs(np.diff(turned[coarse])) / (2 * np.pi)
    angles = {}
    for part, order in HEALTHY_ORDERS.items():
        steps = ASSUMED.slip * np.sqrt(order * travel) * rng.standard_normal(len(travel))
        walk = 2 * np.pi * np.concatenate(([rng.uniform()], steps)).cumsum()
        slipped = np.interp(np.arange(len(turned)), coarse, walk)
        angles[part] = order * turned + slipped
    for (part, harmonic, of_force, of_torque), share in zip(
        ASSUMED.healthy_lines, shares, strict=True
    ):
        wave = share * np.sin(harmonic * angles[part])
        force += of_force * wave
        torque += of_torque * wave
    samples = np.arange(len(angle))
    return np.interp(samples, fine, force), np.interp(samples, fine, torque)


def _every(n_samples: int, step: int) -> NDArray[np.intp]:
    """Return every `step`-th sample and the last."""
    return np.append(np.arange(0, n_samples - 1, step), n_samples - 1)
