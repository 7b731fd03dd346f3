"""Orders of the faults of a machine, and bands around them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from emacm._checks import check_choice, check_count, check_number, located
from emacm.machine.gears import Gear
from emacm.machine.motors import InductionMotor, Motor
from emacm.machine.parts import Line, Part
from emacm.orders.bins import Band, round_edge

Orders: TypeAlias = pd.DataFrame | pd.Series | Mapping[str, float]

_COLUMNS = ("name", "order", "part", "kind", "harmonic", "sideband", "slips")


def fault_orders(
    *parts: Part | Mapping[str, float] | Sequence[Part | Mapping[str, float]],
    harmonics: int = 1,
    sidebands: int = 0,
    max_order: float | None = None,
    signal: str = "vibration",
) -> pd.DataFrame:
    """Predict the orders of the faults of a machine.

    Parameters
    ----------
    *parts : Bearing, BallScrew, Gear, PlanetaryGear, Motor, InductionMotor, or mapping
        Parts of the machine, at least one, or one list of them; a mapping of str to float gives
        known orders by name.
    harmonics : int
        Number of harmonics of each order, the order itself included. Twice as many are given for
        the spin of a ball, whose lines start at the second harmonic.
    sidebands : int
        Number of sidebands on either side of each line, at multiples of the modulating order.
    max_order : float, optional
        Highest order in the table; lines above it are left out.
    signal : {"vibration", "current"}
        "vibration": the mechanical orders f (also those of torque, speed and position).
        "current": ``|supply ± f|``, Eqs. (2.2) and (2.4) of [1]_, and multiples of the
        supply; this requires a `Motor` or `InductionMotor` among the parts.

    Returns
    -------
    DataFrame
        Index: name of the line, such as "2xBPFI", "BPFI-shaft" or "supply+BPFI". Columns:
        "order" [cycles per revolution of the motor shaft], "part", "kind" (component or
        phenomenon), "harmonic", "sideband" (0, or its signed number), "slips" (whether the slip
        of rolling elements changes the order by 1 to 2 %).

    Raises
    ------
    TypeError
        If there is no part, or one is of another type.
    ValueError
        If two lines have the same name, an order is not positive, or "current" is requested without
        exactly one motor.

    See Also
    --------
    emacm.order_bands : Bins around these orders.
    emacm.match_fault_orders : Parts whose orders explain a line.

    Notes
    -----
    `OrderSpectrumDisplay` marks ``fault_orders(...)["order"].to_dict()``; `order_bands` turns the
    table into bands for `BinTransformer`.

    References
    ----------
    .. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
       Condition Monitoring, section 2.1.

    Examples
    --------
    >>> from emacm import Motor, fault_orders
    >>> current = fault_orders({"BPFI": 6.123}, Motor(6), signal="current")
    >>> for name, order in current["order"].items():
    ...     print(name, round(order, 3))
    supply+BPFI 12.123
    supply-BPFI 0.123
    supply+shaft 7.0
    supply-shaft 5.0
    supply 6.0
    """
    check_count(harmonics, "harmonics", at_most=1000)
    check_count(sidebands, "sidebands", at_least=0, at_most=100)
    check_choice(signal, "signal", ("vibration", "current"))
    if max_order is not None:
        check_number(max_order, "max_order", above=0, unit="orders")
    listed = _listed(parts[0] if len(parts) == 1 else parts)
    rows: list[tuple[Any, ...]] = []
    for number, part in enumerate(listed):
        for prefix, owner, line in lines_of(part, number):
            rows += _rows(prefix, owner, line, harmonics, sidebands, signal)
    if signal == "current":
        motors = [part for part in listed if isinstance(part, Motor | InductionMotor)]
        rows = list(_in_current(rows, motors))
    check_distinct([row[0] for row in rows])
    table = pd.DataFrame(rows, columns=list(_COLUMNS)).set_index("name")
    return table if max_order is None else table[table["order"] <= max_order]


def order_bands(
    orders: Orders, *, slip: float = 0.02, min_width: float = 0.0, on_overlap: str = "raise"
) -> dict[str, Band]:
    """Return named bands around orders, for ``BinTransformer(edges=...)``.

    Parameters
    ----------
    orders : DataFrame from `fault_orders`, or mapping or Series of str to float
        Orders by name. In a mapping, every line may slip.
    slip : float
        Largest relative deviation of a line with slip from its order.
    min_width : float
        Smallest width of a band [orders]; must be above 0 for lines without slip. The main lobe of
        a Hann window of length `revolutions` is ``4 / revolutions`` wide.
    on_overlap : {"raise", "keep"}
        Overlapping bands contain the same power twice: raise an error that names them, or keep
        them.

    Returns
    -------
    dict of str to (low, high)
        Bands [orders] in ascending order; edges are rounded to 12 digits.

    Raises
    ------
    TypeError, ValueError
        If bands overlap and `on_overlap` is "raise", a band has no width, there is no order, or an
        order is not positive.

    See Also
    --------
    emacm.fault_orders : Orders of the faults.
    emacm.BinTransformer : Takes the bands as bins.

    Examples
    --------
    >>> from emacm import order_bands
    >>> order_bands({"BPFI": 6.0, "screw": 3.0}, slip=0.01)
    {'screw': (2.97, 3.03), 'BPFI': (5.94, 6.06)}
    """
    check_number(slip, "slip", at_least=0, below=1)
    check_number(min_width, "min_width", at_least=0, unit="orders")
    check_choice(on_overlap, "on_overlap", ("raise", "keep"))
    names, low, high = slip_ranges(orders, slip=slip, min_width=min_width)
    for place in np.flatnonzero(low >= high)[:1]:
        raise ValueError(
            f"the band of {names[place]!r} at order {low[place]:g} has no width, because the line "
            f"does not slip. Give min_width, such as 4 / revolutions of the order spectra."
        )
    ascending = np.lexsort((high, low))
    bands = {names[place]: (round_edge(low[place]), round_edge(high[place])) for place in ascending}
    for (last, below), (name, band) in pairwise(bands.items()):
        if on_overlap == "raise" and below[1] > band[0]:
            raise ValueError(
                f"the bands of {last!r} {below} and {name!r} {band} overlap: no spectrum separates "
                f"them. Reduce slip or min_width, leave one out, or set on_overlap='keep'."
            )
    return bands


def slip_ranges(
    orders: Orders, *, slip: float, min_width: float = 0.0
) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Return names of orders, and the range of each with slip.

    Parameters
    ----------
    orders : DataFrame from `fault_orders`, or mapping of str to float
        Orders by name.
    slip : float
        Largest relative deviation of a line with slip from its order.
    min_width : float
        Smallest width of a range [orders].

    Returns
    -------
    names : list of str
    low, high : ndarray of shape (n_orders,)
        Ends of each range [orders].

    Raises
    ------
    TypeError, ValueError
        As `named_orders`.

    Examples
    --------
    >>> slip_ranges({"BPFI": 6.0}, slip=0.01)
    (['BPFI'], array([5.94]), array([6.06]))
    """
    names, centres = named_orders(orders)
    slips: Any = True
    if isinstance(orders, pd.DataFrame):
        slips = orders["slips"].to_numpy()
        if slips.dtype != bool:
            raise TypeError(f"the column 'slips' must be boolean, got {slips.dtype}.")
    half = np.maximum(np.where(slips, slip, 0.0) * centres, min_width / 2)
    return names, np.maximum(centres - half, 0.0), centres + half


def named_orders(orders: Orders) -> tuple[list[str], np.ndarray]:
    """Return the names, and the orders as an array of shape (n_orders,).

    Raises
    ------
    TypeError, ValueError
        If `orders` is not a table or mapping, is empty, has a name twice, or an order is not
        positive.

    Examples
    --------
    >>> named_orders({"BPFI": 6.123})
    (['BPFI'], array([6.123]))
    """
    if isinstance(orders, pd.DataFrame):
        missing = [name for name in ("order", "slips") if name not in orders.columns]
        if missing:
            raise ValueError(f"orders must be a table of fault_orders; it has no {missing[0]!r}.")
        orders = orders["order"]
    if not isinstance(orders, Mapping | pd.Series) or not len(orders):
        raise TypeError(
            f"orders must be a table from fault_orders or a mapping of names to orders, with at "
            f"least one order; got {orders!r}."
        )
    names = [str(name) for name, _ in orders.items()]
    check_distinct(names)
    values = [
        check_number(order, f"the order of {name!r}", above=0, at_most=1e9, unit="orders")
        for name, order in orders.items()
    ]
    return names, np.array(values)


def lines_of(part: Any, number: int) -> list[tuple[str, str, Line]]:
    """Return prefix of the names, owner and line, for each line of a part.

    Raises
    ------
    TypeError, ValueError
        If it is neither a part nor a mapping of names to orders; the message gives `number`.

    Examples
    --------
    >>> lines_of({"screw": 3.0}, 0)[0][2].order
    3.0
    """
    if isinstance(part, Mapping):
        with located(f"part {number}"):
            names, orders = named_orders(part)
        pairs = zip(names, orders.tolist(), strict=True)
        return [("", "given", Line(name, "given", order, slips=True)) for name, order in pairs]
    if not isinstance(part, Part):
        raise TypeError(
            f"part {number} must be a Bearing, BallScrew, Gear, PlanetaryGear, Motor, "
            f"InductionMotor or a mapping of names to orders, got {part!r}."
        )
    prefix = f"{part.name} " if part.name else ""
    return [(prefix, part.name or type(part).__name__, line) for line in part.lines()]


def _rows(
    prefix: str, owner: str, line: Line, harmonics: int, sidebands: int, signal: str
) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of one line: its harmonics, and their sidebands."""
    # In the current, the sidebands of the supply are the lines of the shaft.
    modulations = () if line.name == "supply" and signal == "current" else line.sidebands
    for harmonic in range(1, harmonics * line.strikes + 1):
        name, order = prefix + _times(harmonic, line.name), harmonic * line.order
        yield name, order, owner, line.kind, harmonic, 0, line.slips
        for modulation, spacing in modulations:
            for number in (k for n in range(1, sidebands + 1) for k in (-n, n)):
                side = order + number * spacing
                if side > 0:
                    sign = "+" if number > 0 else "-"
                    full = f"{name}{sign}{_times(abs(number), modulation)}"
                    yield full, side, owner, line.kind, harmonic, number, line.slips


def _in_current(rows: list[tuple[Any, ...]], motors: list[Any]) -> Iterator[tuple[Any, ...]]:
    """Yield the lines in the current of each mechanical line, Eqs. (2.2) and (2.4)."""
    if len(motors) != 1:
        raise ValueError(
            f'signal="current" needs exactly one Motor or InductionMotor among the parts, whose '
            f"supply is modulated; got {len(motors)}."
        )
    supply = motors[0].supply_order
    for name, order, owner, kind, harmonic, sideband, slips in rows:
        if kind == "supply":
            yield name, order, owner, kind, harmonic, sideband, slips
            continue
        inner = f"({name})" if sideband else name
        for sign, shifted in (("+", supply + order), ("-", abs(supply - order))):
            if shifted > 0:
                yield f"supply{sign}{inner}", shifted, owner, kind, harmonic, sideband, slips


def _times(number: int, name: str) -> str:
    return name if number == 1 else f"{number}x{name}"


def check_distinct(names: Sequence[str]) -> None:
    """Raise a ValueError if two lines have the same name."""
    for name, count in Counter(names).items():
        if count > 1:
            raise ValueError(
                f"two lines have the name {name!r}. Distinguish parts by name=..., as in "
                f"Bearing(..., name='front')."
            )


Parts = Sequence[Part | Mapping[str, float]] | Part | Mapping[str, float]


def _listed(parts: Any) -> Sequence[Part | Mapping[str, float]]:
    """Return a list of parts; raise a TypeError if there is none."""
    listed = [parts] if isinstance(parts, Part | Mapping) else parts
    if isinstance(listed, str) or not isinstance(listed, Sequence) or not listed:
        raise TypeError(
            f"parts must be a part such as a Bearing, or a list of at least one part; got "
            f"{parts!r}."
        )
    return listed


def gears_and_orders(parts: Parts) -> tuple[list[Gear], dict[str, float]]:
    """Return the pairs of gears among parts, and the orders that mappings state, by name.

    Examples
    --------
    >>> from emacm import Gear
    >>> gears_and_orders([Gear(8, 42), {"fan": 7.0}])[1]
    {'fan': 7.0}
    """
    listed = _listed(parts)
    given = [part for part in listed if isinstance(part, Mapping)]
    orders = {str(name): float(order) for part in given for name, order in part.items()}
    return [part for part in listed if isinstance(part, Gear)], orders


@dataclass(frozen=True)
class FaultSeries:
    """The lines by which one fault is recognised.

    Attributes
    ----------
    name : str
        Name of the fault, such as "BPFI".
    orders : tuple of float
        Orders of the lines without slip [cycles per revolution].
    slips : bool
        Whether slip of rolling elements moves the lines.
    kind : str
        Component or phenomenon, such as "inner ring".
    sidebands : tuple of (str, float)
        Name and order of each modulation.
    strikes : int
        Strikes per period of the lowest order of the part; 2 for a ball, which meets both rings.
    of_damage : bool
        Whether an undamaged part has no such lines.
    """

    name: str
    orders: tuple[float, ...]
    slips: bool
    kind: str = ""
    sidebands: tuple[tuple[str, float], ...] = ()
    strikes: int = 1
    of_damage: bool = True

    def up_to(self, highest: float) -> FaultSeries:
        """Return the series with its lines up to an order."""
        return replace(self, orders=tuple(order for order in self.orders if order <= highest))


def fault_series(parts: Parts, harmonics: int) -> tuple[FaultSeries, ...]:
    """Return the series of lines of each fault of a machine.

    Parameters
    ----------
    parts : part, or sequence of parts
        `Bearing`, `Gear`, `Motor` and so on, or mappings of fault names to orders.
    harmonics : int
        Number of lines of each series. A defect of a ball strikes both rings in each turn, so its
        series has the multiples 2, 4, ... of BSF.

    Returns
    -------
    tuple of FaultSeries

    Raises
    ------
    TypeError
        If there is no part, or an entry is none.
    ValueError
        If two faults have the same name.

    Examples
    --------
    >>> from emacm import Bearing
    >>> for fault in fault_series(Bearing(9, 7.94, 39.04), 2):
    ...     print(fault.name, [round(order, 3) for order in fault.orders])
    BPFO [3.585, 7.17]
    BPFI [5.415, 10.83]
    BSF [4.713, 9.427]
    FTF [0.398, 0.797]
    """
    check_count(harmonics, "harmonics", at_most=100)
    found = []
    for number, part in enumerate(_listed(parts)):
        for prefix, _, line in lines_of(part, number):
            orders = line.strikes * np.arange(1, harmonics + 1) * line.order
            # Stated orders 1 and 2 are those of the shaft itself.
            slips = line.slips and not (line.kind == "given" and line.order in (1.0, 2.0))
            more = slips, line.kind, line.sidebands, line.strikes, line.of_damage
            found.append(FaultSeries(prefix + line.name, tuple(orders.tolist()), *more))
    check_distinct([fault.name for fault in found])
    return tuple(found)


def damage_series(parts: Parts, harmonics: int) -> tuple[FaultSeries, ...]:
    """Return the series of `fault_series` without the lines that undamaged parts have too.

    Examples
    --------
    >>> [fault.name for fault in damage_series(Gear(8, 42), 1)]
    ['pinion', 'wheel']
    """
    return tuple(fault for fault in fault_series(parts, harmonics) if fault.of_damage)
