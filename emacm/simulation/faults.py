"""Faults of the laboratory bench: their names, their true orders, and when they strike."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emacm._checks import check_choice, check_number
from emacm.machine.fault_orders import fault_orders
from emacm.machine.parts import Bearing

# Assumed: a geometry of an angular contact bearing that gives the 6.123 of the thesis, chapter 4.
BEARING = Bearing(10, 0.2478, 1.0, math.radians(25))
# Assumed: 20 balls of 1/8 in to a turn, on a pitch circle of 24 mm at 45 degrees. The nut stands
# still like an outer ring; the lead, which moves its order by 0.05 %, is not taken into account.
SCREW = Bearing(20, 0.1323, 1.0, math.radians(45))
POLE_PAIRS = 6  # Table 4.1: 12 poles
_LINES = fault_orders(BEARING)["order"]
CAGE_ORDER = float(_LINES["FTF"])

# Orders in torque, motion and housing vibration; further lines lie at their multiples, and, of
# what turns through a load zone, beside them. In a phase current an order o stands at |6 +- o|,
# Eq. (2.4). Empty: the fault has no order of its own.
FAULT_ORDERS: Mapping[str, tuple[float, ...]] = MappingProxyType(
    {
        "inner ring": (float(_LINES["BPFI"]),),  # one per revolution beside it
        "outer ring": (float(_LINES["BPFO"]),),
        "ball": (float(_LINES["2xBSF"]),),  # the cage's order beside it
        "cage": (CAGE_ORDER,),
        "screw": (float(fault_orders(SCREW)["order"]["BPFO"]),),  # a spall in the nut's groove
        "eccentricity": (1.0,),
        "backlash": (),  # a knock where the load changes sides
        "phase imbalance": (2.0 * POLE_PAIRS,),
        "lubrication": (1.0,),  # and friction at random; sidebands of the current's order 6
        "jam": (),  # at a place of the stroke
    }
)
FAULTS = tuple(FAULT_ORDERS)
ROLLING = ("inner ring", "outer ring", "ball", "screw")  # what balls strike, or are struck by
_LOAD_SHARE = 1.2  # assumed: Stribeck's epsilon; above 1 the whole ring carries, as under thrust
_SLIP = 0.005  # assumed: standard deviation of the way between two strikes, as share of it


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
        check_choice(name, "a fault", FAULTS)
        check_number(severity, f"severity of {name!r}", at_least=0, at_most=1)
    return {name: float(faults[name]) for name in FAULTS if name in faults}


class Passage(NamedTuple):
    """How the balls pass a defect.

    Attributes
    ----------
    phase : ndarray of shape (n_times,)
        Balls that have passed; a strike is where it crosses a whole number.
    weight : ndarray of shape (n_times,)
        Share of the load that the struck contact carries, in [0, 1].
    """

    phase: NDArray[np.floating]
    weight: NDArray[np.floating]

    @property
    def strikes(self) -> NDArray[np.intp]:
        """Samples at which a ball strikes, shape (n_strikes,)."""
        return np.flatnonzero(np.diff(np.floor(self.phase))) + 1

    @property
    def pulses(self) -> NDArray[np.floating]:
        """A pulse of mean 0 for each ball, a fifth of their distance wide."""
        shape = np.cos(np.pi * self.phase) ** 16
        return self.weight * (shape - 6435 / 32768)  # the mean of cos^16


def ball_passage(
    fault: str, angle: NDArray[np.floating], rng: np.random.Generator, *, mark: float = 0.0
) -> Passage:
    """Return when balls pass a defect, with slip, and how loaded they are.

    The way between two strikes scatters independently (so that the phase of late strikes is
    lost, as it is in machines [1]_); the load is spread over the ring as Stribeck has it
    [2]_, so that a defect that turns through it is struck harder at one side.

    Parameters
    ----------
    fault : {"inner ring", "outer ring", "ball", "screw"}
        What is defective.
    angle : ndarray of shape (n_times,)
        Shaft angle [rad].
    rng : Generator
        Of slip, and of where the balls are at first.
    mark : float
        Place of the defect on what turns with the shaft [rad].

    Returns
    -------
    Passage

    Raises
    ------
    ValueError
        If nothing rolls over this fault.

    References
    ----------
    .. [1] J. Antoni and R. B. Randall, A stochastic model for simulation and diagnostics of rolling
       element bearings with localized faults, J. Vib. Acoust. 125 (2003).
    .. [2] T. A. Harris, Rolling Bearing Analysis: load over a ring is
       ``(1 - (1 - cos(psi)) / (2 epsilon)) ** 1.5``; epsilon 1.2 is assumed.

    Examples
    --------
    >>> turned = np.linspace(0, 2 * np.pi * 100, 100_000)
    >>> len(ball_passage("inner ring", turned, np.random.default_rng(0)).strikes)
    612
    """
    check_choice(fault, "fault", ROLLING)
    (order,) = FAULT_ORDERS[fault]
    steps = np.diff(angle, prepend=angle[0]) * (order / (2 * np.pi))
    start = rng.uniform()
    slip = np.cumsum(_SLIP * np.sqrt(np.abs(steps)) * rng.standard_normal(len(angle)))
    phase = start + order / (2 * np.pi) * (angle - angle[0]) + slip
    turning = {"inner ring": 1.0, "ball": CAGE_ORDER}.get(fault)
    if turning is None:  # the place of the defect stands still
        return Passage(phase, np.ones_like(phase))
    psi = turning * angle + mark
    return Passage(phase, (1 - (1 - np.cos(psi)) / (2 * _LOAD_SHARE)) ** 1.5)
