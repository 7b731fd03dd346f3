"""Faults of the laboratory bench: names, fault orders, sizes, and rolling element passages."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emacm._checks import check_choice, check_number
from emacm.machine.fault_orders import fault_orders
from emacm.machine.rolling import Bearing
from emacm.simulation.constants import SLIP

# Assumed: geometry of an angular contact bearing that gives the order 6.123 of chapter 4.
BEARING = Bearing(10, 0.2478, 1.0, math.radians(25))
# Assumed: 20 balls of 1/8 in per turn, on a pitch circle of 24 mm at 45 degrees. The nut is fixed
# like an outer ring; the lead, which changes the order by 0.05 %, is neglected.
SCREW = Bearing(20, 0.1323, 1.0, math.radians(45))
POLE_PAIRS = 6  # Table 4.1: 12 poles
_LINES = fault_orders(BEARING)["order"]
CAGE_ORDER = float(_LINES["FTF"])
_LOAD_ZONE = 1.2  # assumed: Stribeck's epsilon; above 1 the whole ring is loaded, as under thrust
_IMPACT_SCATTER = 0.2  # assumed: standard deviation of the logarithm of the size of an impact
# Orders of the rolling elements of a healthy unit, by part.
HEALTHY_ORDERS: Mapping[str, float] = MappingProxyType(
    {
        **{name: float(_LINES[name]) for name in ("FTF", "BPFO", "BPFI", "2xBSF")},
        "screw": float(fault_orders(SCREW)["order"]["BPFO"]),
    }
)


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


FAULTS: Mapping[str, Fault] = MappingProxyType(
    {
        "inner ring": Fault(
            orders=(float(_LINES["BPFI"]),), rolls=True, turns_with=1.0, torque=0.3, impact=0.04
        ),
        "outer ring": Fault(orders=(float(_LINES["BPFO"]),), rolls=True, torque=0.3, impact=0.05),
        "ball": Fault(
            orders=(float(_LINES["2xBSF"]),),
            rolls=True,
            turns_with=CAGE_ORDER,
            torque=0.3,
            impact=0.03,
        ),
        "cage": Fault(orders=(CAGE_ORDER,), torque=0.15, rolling_noise=0.8),
        # A spall in the groove of the nut.
        "screw": Fault(
            orders=(HEALTHY_ORDERS["screw"],),
            rolls=True,
            torque=0.3,
            impact=0.04,
        ),
        "eccentricity": Fault(orders=(1.0,), torque=0.3, force=40.0),
        # An impact where the load changes its sign; 0.01 in is a worn-out screw.
        "backlash": Fault(backlash=0.01, impact=0.3),
        "phase imbalance": Fault(orders=(2.0 * POLE_PAIRS,), imbalance=0.3),
        # 1x, random friction, and sidebands of order 6 of the current.
        "lubrication": Fault(
            orders=(1.0,), torque=0.15, friction=1.5, friction_noise=0.35, rolling_noise=2.0
        ),
        "jam": Fault(friction=0.6, place=1.9, width=0.15),  # all conditions pass 1.9 in
    }
)
FAULT_ORDERS: Mapping[str, tuple[float, ...]] = MappingProxyType(
    {name: fault.orders for name, fault in FAULTS.items()}
)


def check_faults(faults: Any) -> dict[str, float]:
    """Return severities by fault, in the order of `FAULTS`.

    Parameters
    ----------
    faults : None, str or mapping of str to float
        No fault, a fault of severity 1, or severities in [0, 1].

    Returns
    -------
    dict of str to float

    Raises
    ------
    TypeError, ValueError
        If a fault is unknown or a severity is not in [0, 1].

    Examples
    --------
    >>> check_faults({"jam": 0.5, "ball": 1})
    {'ball': 1.0, 'jam': 0.5}
    """
    if faults is None:
        return {}
    if isinstance(faults, str):
        faults = {faults: 1.0}
    if not isinstance(faults, Mapping):
        raise TypeError(
            f"faults must be None, a name or a mapping such as {{'inner ring': 0.5}}, "
            f"got {faults!r}."
        )
    for name, severity in faults.items():
        check_choice(name, "a fault", tuple(FAULTS))
        check_number(severity, f"severity of {name!r}", at_least=0, at_most=1)
    return {name: float(faults[name]) for name in FAULTS if name in faults}


class Passage(NamedTuple):
    """Passage of the rolling elements over a defect.

    Attributes
    ----------
    phase : ndarray of shape (n_times,)
        Number of rolling elements that have passed; an impact occurs at each whole number.
    weight : ndarray of shape (n_times,)
        Fraction of the load that the contact at the defect carries, in [0, 1].
    impacts : ndarray of shape (n_impacts,), of int
        Samples of the impacts.
    sizes : ndarray of shape (n_impacts,)
        Random size of each impact, relative to the median.
    """

    phase: NDArray[np.floating]
    weight: NDArray[np.floating]
    impacts: NDArray[np.intp]
    sizes: NDArray[np.floating]

    @property
    def pulses(self) -> NDArray[np.floating]:
        """One pulse per rolling element, with mean 0 and a width of a fifth of their distance."""
        shape = np.cos(np.pi * self.phase)
        for _ in range(4):  # to the power 16; a power function is several times slower
            shape *= shape
        return self.weight * (shape - 6435 / 32768)  # the mean of cos^16


def ball_passage(
    fault: str, angle: NDArray[np.floating], rng: np.random.Generator, *, mark: float = 0.0
) -> Passage:
    """Return when rolling elements pass a defect, with slip, and under which load.

    The intervals between impacts are independent random numbers, so that the phase is lost over
    many impacts, as measured on machines [1]_. The load is distributed over the ring by
    Stribeck's formula [2]_: impacts on a defect that turns through the load zone are modulated.

    Parameters
    ----------
    fault : {"inner ring", "outer ring", "ball", "screw"}
        Location of the defect.
    angle : ndarray of shape (n_times,)
        Shaft angle [rad].
    rng : Generator
        Random numbers of the slip, of the initial position and of the size of impacts.
    mark : float
        Angular position of the defect relative to the shaft [rad].

    Returns
    -------
    Passage

    Raises
    ------
    ValueError
        If no rolling element passes over this fault.

    References
    ----------
    .. [1] J. Antoni and R. B. Randall, A stochastic model for simulation and diagnostics of rolling
       element bearings with localized faults, J. Vib. Acoust. 125 (2003).
    .. [2] T. A. Harris, Rolling Bearing Analysis: load over a ring is
       ``(1 - (1 - cos(psi)) / (2 epsilon)) ** 1.5``; epsilon 1.2 is assumed.

    Examples
    --------
    >>> angle = np.linspace(0, 2 * np.pi * 100, 100_000)
    >>> len(ball_passage("inner ring", angle, np.random.default_rng(0)).impacts)
    612
    """
    check_choice(fault, "fault", tuple(name for name, known in FAULTS.items() if known.rolls))
    (order,) = FAULTS[fault].orders
    steps = np.diff(angle, prepend=angle[0]) * (order / (2 * np.pi))
    start = rng.uniform()
    slip = np.cumsum(SLIP * np.sqrt(np.abs(steps)) * rng.standard_normal(len(angle)))
    phase = start + order / (2 * np.pi) * (angle - angle[0]) + slip
    impacts = np.flatnonzero(np.diff(np.floor(phase))) + 1
    sizes = np.exp(_IMPACT_SCATTER * rng.standard_normal(len(impacts)))
    weight, turns_with = np.ones_like(phase), FAULTS[fault].turns_with
    if turns_with:
        psi = turns_with * angle + mark
        weight = (1 - (1 - np.cos(psi)) / (2 * _LOAD_ZONE)) ** 1.5
    return Passage(phase, weight, impacts, sizes)
