"""The orders at which the faults of a machine show, and bands around them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from emacm._checks import check_choice, check_count, check_number
from emacm.machine.parts import BallScrew, Bearing, Gear, Line, Motor, Part, check_distinct
from emacm.orders.bins import Band, round_edge

_PARTS = (Bearing, Motor, Gear, BallScrew)
_COLUMNS = ("name", "order", "part", "kind", "harmonic", "sideband", "slips")


def fault_orders(
    *parts: Part | Mapping[str, float],
    harmonics: int = 1,
    sidebands: int = 0,
    max_order: float | None = None,
    signal: str = "vibration",
) -> pd.DataFrame:
    """Predict the orders at which the faults of a machine show.

    Parameters
    ----------
    *parts : Bearing, Motor, Gear, BallScrew or mapping of str to float
        Parts of the machine; a mapping states orders that are known already.
    harmonics : int
        Multiples of each order. The lines of a ball start at the second multiple of its
        spin, and are given up to twice as many.
    sidebands : int
        Sidebands on either side of each line, at multiples of what modulates it.
    max_order : float, optional
        Leave out what lies above [orders].
    signal : {"vibration", "current"}
        "vibration": the mechanical orders f (also those of torque, speed and position).
        "current": ``|supply ± f|``, Eqs. (2.2) and (2.4) of [1]_, and multiples of the
        supply; this needs the `Motor` among the parts.

    Returns
    -------
    DataFrame
        Index: name of the line, as "2xBPFI", "BPFI-shaft" or "supply+BPFI". Columns:
        "order" [cycles per revolution of the motor shaft], "part", "kind" (what it tells
        of), "harmonic", "sideband" (0, or number and side of it), "slips" (whether rolling
        elements make it, whose slip lets it depart by 1 to 2 %).

    Raises
    ------
    TypeError
        If a part is none of these.
    ValueError
        If two lines have one name, an order is not positive, or "current" finds not one
        Motor.

    Notes
    -----
    ``fault_orders(...)["order"].to_dict()`` is what `OrderSpectrumDisplay` marks;
    `order_bands` makes bands of it for `BinTransformer`.

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
    check_count(harmonics, "harmonics")
    check_count(sidebands, "sidebands", at_least=0)
    check_choice(signal, "signal", ("vibration", "current"))
    for number, part in enumerate(parts):
        if not isinstance(part, (*_PARTS, Mapping)):
            raise TypeError(
                f"part {number} must be a Bearing, Motor, Gear, BallScrew or a mapping of "
                f"names to orders, got {part!r}."
            )
    rows = [row for part in parts for row in _rows(part, harmonics, sidebands, signal)]
    if signal == "current":
        rows = list(_in_current(rows, [part for part in parts if isinstance(part, Motor)]))
    check_distinct([row[0] for row in rows])
    table = pd.DataFrame(rows, columns=list(_COLUMNS)).set_index("name")
    if max_order is None:
        return table
    return table[table["order"] <= check_number(max_order, "max_order", above=0, unit="orders")]


def order_bands(
    orders: pd.DataFrame | pd.Series | Mapping[str, float],
    *,
    slip: float = 0.02,
    min_width: float = 0.0,
    on_overlap: str = "raise",
) -> dict[str, Band]:
    """Make named bands around orders, for ``BinTransformer(edges=...)``.

    Parameters
    ----------
    orders : DataFrame of `fault_orders`, or mapping or Series of str to float
        Orders by name. In a mapping every order may slip.
    slip : float
        Share of its order by which a line that slips may lie lower or higher.
    min_width : float
        Least width of a band [orders]. A line of a Hann window over `revolutions` is
        ``4 / revolutions`` wide at its foot. Lines that do not slip need it above 0.
    on_overlap : {"raise", "join", "keep"}
        What to do with bands that overlap, and so hold power twice: an error that names
        them, one band "A/B" for all of them, or keep them as they are.

    Returns
    -------
    dict of str to (low, high)
        Bands [orders], by rising order; edges have 12 digits.

    Raises
    ------
    ValueError
        If bands overlap and `on_overlap` is "raise", a band has no width, or an order is
        not positive.

    Examples
    --------
    >>> from emacm import order_bands
    >>> order_bands({"BPFI": 6.0, "screw": 3.0}, slip=0.01)
    {'screw': (2.97, 3.03), 'BPFI': (5.94, 6.06)}
    """
    check_number(slip, "slip", at_least=0, below=1)
    check_number(min_width, "min_width", at_least=0, unit="orders")
    check_choice(on_overlap, "on_overlap", ("raise", "join", "keep"))
    names, low, high = slip_ranges(orders, slip=slip, min_width=min_width)
    for place in np.flatnonzero(low >= high)[:1]:
        raise ValueError(
            f"the band of {names[place]!r} at order {low[place]:g} has no width, because it does "
            f"not slip. Give min_width, such as 4 / revolutions of the order spectra."
        )
    bands: dict[str, Band] = {}
    for place in np.lexsort((high, low)):
        name, band = names[place], (round_edge(low[place]), round_edge(high[place]))
        last = next(reversed(bands), None)
        if on_overlap == "keep" or last is None or bands[last][1] <= band[0]:
            bands[name] = band
        elif on_overlap == "join":
            joined = bands.pop(last)
            bands[f"{last}/{name}"] = (joined[0], max(joined[1], band[1]))
        else:
            raise ValueError(
                f"the bands of {last!r} {bands[last]} and {name!r} {band} overlap: no power "
                f"spectrum tells them apart. Lower slip or min_width, leave one out, or set "
                f'on_overlap to "join" or "keep".'
            )
    return bands


def slip_ranges(
    orders: pd.DataFrame | pd.Series | Mapping[str, float], *, slip: float, min_width: float = 0.0
) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Return names of orders, and from where to where each may lie.

    Parameters
    ----------
    orders : DataFrame of `fault_orders`, or mapping of str to float
        Orders by name.
    slip : float
        Share by which those that slip may depart.
    min_width : float
        Least width of a range [orders].

    Returns
    -------
    names : list of str
    low, high : ndarray of shape (n_orders,)
        Ends of each range [orders].

    Raises
    ------
    TypeError, ValueError
        If it is no mapping of names to positive orders.

    Examples
    --------
    >>> slip_ranges({"BPFI": 6.0}, slip=0.01)
    (['BPFI'], array([5.94]), array([6.06]))
    """
    names, centres = named_orders(orders)
    slips = orders["slips"].to_numpy() if isinstance(orders, pd.DataFrame) else True
    half = np.maximum(np.where(slips, slip, 0.0) * centres, min_width / 2)
    return names, np.maximum(centres - half, 0.0), centres + half


def named_orders(
    orders: pd.DataFrame | pd.Series | Mapping[str, float],
) -> tuple[list[str], np.ndarray]:
    """Check orders by name; return names, and orders of shape (n_orders,).

    Examples
    --------
    >>> named_orders({"BPFI": 6.123})
    (['BPFI'], array([6.123]))
    """
    if isinstance(orders, pd.DataFrame):
        missing = [name for name in ("order", "slips") if name not in orders.columns]
        if missing:
            raise ValueError(
                f"orders must be a table of fault_orders; it has no column {missing[0]!r}."
            )
        named = dict(orders["order"].items())
    elif isinstance(orders, Mapping | pd.Series):
        named = dict(orders.items())
    else:
        raise TypeError(
            f"orders must be a table of fault_orders or a mapping of names to orders, "
            f"got {orders!r}."
        )
    values = [
        check_number(order, f"the order of {name!r}", above=0, unit="orders")
        for name, order in named.items()
    ]
    return [str(name) for name in named], np.array(values)


def _rows(
    part: Part | Mapping[str, float], harmonics: int, sidebands: int, signal: str
) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of one part: each line, its harmonics, their sidebands."""
    if isinstance(part, Mapping):
        owner, prefix = "given", ""
        pairs = zip(*named_orders(part), strict=True)
        lines = tuple(Line(name, "given", float(order), slips=True) for name, order in pairs)
    else:
        owner, prefix = part.name or type(part).__name__, f"{part.name} " if part.name else ""
        lines = part.lines()
    for line in lines:
        # In the current, the sidebands of the supply come from the line of the shaft.
        beside = () if line.name == "supply" and signal == "current" else line.sidebands
        for harmonic in range(1, harmonics * line.strikes + 1):
            name, order = prefix + _times(harmonic, line.name), harmonic * line.order
            yield name, order, owner, line.kind, harmonic, 0, line.slips
            for modulation, spacing in beside:
                for number in (k for n in range(1, sidebands + 1) for k in (-n, n)):
                    side = order + number * spacing
                    if side > 0:
                        sign = "+" if number > 0 else "-"
                        beside_name = f"{name}{sign}{_times(abs(number), modulation)}"
                        yield beside_name, side, owner, line.kind, harmonic, number, line.slips


def _in_current(rows: list[tuple[Any, ...]], motors: list[Motor]) -> Iterator[tuple[Any, ...]]:
    """Yield where each mechanical line shows in the current, Eqs. (2.2) and (2.4)."""
    if len(motors) != 1:
        raise ValueError(
            f'signal="current" needs one Motor among the parts, whose supply is modulated; '
            f"got {len(motors)}."
        )
    supply = float(motors[0].pole_pairs)
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
