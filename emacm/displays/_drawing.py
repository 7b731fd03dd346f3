"""How pictures look here: colours and hatches, axes, legends, and marks of orders."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

# Okabe and Ito's colours, told apart by colour-blind readers; line styles, marks and hatches
# tell the same things apart in print.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999933")
STYLES = (
    "-",
    "--",
    "-.",
    ":",
    (0, (8, 2)),
    (0, (4, 1, 1, 1, 1, 1)),
    (0, (1, 3)),
    (0, (10, 2, 2, 2)),
)
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<")
HATCHES = ("", "///", "...", "\\\\\\", "xxx", "---", "+++", "ooo")
SMALL = 8  # points, of all text but the names of the axes
ORDER_LABEL = "order [cycles per revolution]"
MISSING = "0.85"  # grey of what was not measured or was taken out

_LONGEST = 20  # letters of a word that is not broken
LETTER = 0.58 * SMALL  # points, mean width of a letter
_WRAP = 34  # letters of a line in a legend


def line_style(number: int) -> dict[str, Any]:
    """Return colour and line style of the class of this number."""
    return {"color": colour_of(number), "linestyle": one_of(STYLES, number)}


def colour_of(number: int) -> str:
    """Return the colour of the class of this number."""
    return COLOURS[number % len(COLOURS)]


def one_of(kinds: Sequence[Any], number: int) -> Any:
    """Return the style, mark or hatch of the class of this number.

    Where colours begin again, kinds go one further, so that no two of 64 classes look alike.
    """
    return kinds[(number + number // len(COLOURS)) % len(kinds)]


def tint(colour: str, share: float) -> str:
    """Mix a colour, ``#rrggbb``, with white; `share` is what is left of it.

    Examples
    --------
    >>> tint("#0000ff", 0.2)
    '#ccccff'
    """
    parts = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return "#" + "".join(f"{round(255 - share * (255 - part)):02x}" for part in parts)


def wrapped(label: Any) -> str:
    """Break a long name, so that a legend stays narrow."""
    return fill(str(label), _WRAP, break_on_hyphens=False)


def one_axes(ax: Any) -> Any:
    """Return the axes, or those of a new figure."""
    if ax is not None:
        if np.ndim(np.asarray(ax, dtype=object)):
            raise TypeError(f"one picture needs one Axes, got {len(ax)} of them.")
        return ax
    return _pyplot().subplots(figsize=(7.2, 4.8), layout="constrained")[1]


def offscreen_panels(
    n_rows: int = 1, n_columns: int = 1, *, size: tuple[float, float] = (7.2, 4.8), **options: Any
) -> tuple[Any, Any]:
    """Return a figure for a file, which no screen and no list of open figures knows, and its axes.

    Raises
    ------
    ImportError
        If matplotlib is not there.
    """
    _pyplot()
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    return figure, figure.subplots(n_rows, n_columns, squeeze=False, **options)


def label_axes(ax: Any, x: str, y: str) -> None:
    """Write what runs along each axis."""
    ax.set_xlabel(x)
    ax.set_ylabel(y)


def panel_axes(
    ax: Any, n_panels: int, *, height: float = 1.7, shared: str = "x"
) -> NDArray[np.object_]:
    """Return one axes a panel: those given, or new ones below each other.

    Parameters
    ----------
    ax : None, Axes or sequence of Axes
        Where to draw.
    n_panels : int
        How many are needed.
    height : float
        Of a new panel [inches].
    shared : {"x", "xy"}
        Which axes new panels have in common.

    Returns
    -------
    ndarray of Axes, shape (n_panels,)

    Raises
    ------
    ImportError
        If matplotlib is not there.
    ValueError
        If others than `n_panels` were given.
    """
    if ax is not None:
        given = np.asarray(ax, dtype=object).reshape(-1)
        if len(given) != n_panels:
            raise ValueError(
                f"this picture has {n_panels} panels and needs as many Axes, got {len(given)}. "
                f"Leave ax out, or pass figure.subplots({n_panels})."
            )
        return given
    size = (7.0, max(3.2, 1.0 + height * n_panels))
    _, axes = _pyplot().subplots(
        n_panels,
        squeeze=False,
        sharex="x" in shared,
        sharey="y" in shared,
        figsize=size,
        layout="constrained",
    )
    return axes.reshape(-1)


def panels_beside(ax: Any, widths: Sequence[float], *, height: float) -> NDArray[np.object_]:
    """Return one axes a panel: those given, or new ones beside each other.

    Parameters
    ----------
    ax : None, Axes or sequence of Axes
        Where to draw.
    widths : sequence of float
        Of new panels [inches].
    height : float
        Of new panels [inches].

    Returns
    -------
    ndarray of Axes, shape (n_panels,)

    Raises
    ------
    ImportError
        If matplotlib is not there.
    ValueError
        If others than `n_panels` were given.
    """
    if ax is not None:
        return panel_axes(ax, len(widths))
    _, axes = _pyplot().subplots(
        1,
        len(widths),
        squeeze=False,
        width_ratios=widths,
        figsize=(sum(widths), height),
        layout="constrained",
    )
    return axes.reshape(-1)


def name_panels_below(axes: NDArray[np.object_], name: str) -> None:
    """Write what runs along x below each panel, or below the last of those that share it."""
    for ax in axes:
        if ax is axes[-1] or not ax.get_shared_x_axes().joined(ax, axes[-1]):
            ax.set_xlabel(name)


def legend_beside(ax: Any, **options: Any) -> None:
    """Put a legend to the right of the axes, where it covers nothing."""
    if ax.get_legend_handles_labels()[1]:
        place = {"loc": "upper left", "bbox_to_anchor": (1.02, 1), "borderaxespad": 0}
        look = {"fontsize": SMALL, "title_fontsize": SMALL, "handlelength": 3.2}
        ax.legend(labelspacing=0.35, **look, **place, **options)


def name_side(ax: Any, name: str, unit: str) -> None:
    """Write quantity and unit along the y axis, in as many lines as its height asks for."""
    height = 72 / ax.figure.dpi * ax.get_window_extent().height  # grows when laid out
    room = int(1.2 * height / (LETTER * 10 / SMALL))
    whole = f"{name} [{unit}]"
    if len(whole) > room:
        longest = max(map(len, name.split()), default=1)
        whole = fill(name, max(room, min(longest, _LONGEST))) + f"\n[{unit}]"
    ax.set_ylabel(whole)


def mark_orders(ax: Any, fault_orders: Mapping[str, float], *, named: bool = True) -> None:
    """Mark orders on the x axis by lines; those beyond its limits are passed over.

    Names stand above the axes; upright and drawn apart where they would meet.
    """
    inside, places = _orders_within(fault_orders, ax.get_xlim(), ax, "width")
    for _, order in inside:
        ax.axvline(order, color="0.5", linewidth=0.9, linestyle=(0, (1, 1.5)), zorder=0.5)
    if not named or not inside:
        return
    halves = np.array([LETTER * len(name) / 2 for name, _ in inside])
    upright = bool(np.any(np.diff(places) < halves[1:] + halves[:-1] + 4))
    shifts = spread(places, SMALL + 3) - places if upright else np.zeros(len(places))
    style = {"xycoords": ax.get_xaxis_transform(), "ha": "center", "va": "bottom"}
    for (name, order), shift in zip(inside, shifts, strict=True):
        offset = (shift, 12 if abs(shift) > 1 else 3)
        _point_at(ax, name, (order, 1), offset, rotation=90 if upright else 0, **style)


def mark_orders_beside(ax: Any, fault_orders: Mapping[str, float]) -> None:
    """Name orders of the y axis at its right edge; those beyond its limits are passed over."""
    inside, places = _orders_within(fault_orders, ax.get_ylim(), ax, "height")
    style = {"xycoords": ax.get_yaxis_transform(), "ha": "left", "va": "center"}
    for (name, order), shift in zip(inside, spread(places, SMALL + 3) - places, strict=True):
        _point_at(ax, name, (1, order), (10, shift), always=True, **style)


def spread(places: NDArray[np.floating], gap: float) -> NDArray[np.floating]:
    """Move rising places apart to at least `gap`, by the least sum of squares.

    Examples
    --------
    >>> spread(np.array([0.0, 1.0, 9.0]), 3)
    array([-1.,  2.,  9.])
    """
    steps = gap * np.arange(len(places))
    return isotonic_regression(places - steps).x + steps


def decibels(power: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return 10 log10 of a power; NaN, of which nothing is drawn, where it is 0."""
    return 10 * np.log10(np.where(power > 0, power, np.nan))


def squared(unit: str) -> str:
    """Write the square of a unit.

    Examples
    --------
    >>> squared("A"), squared("m/s²")
    ('A²', '(m/s²)²')
    """
    return f"({unit})²" if any(sign in unit for sign in "/² ") else f"{unit}²"


def _orders_within(
    fault_orders: Mapping[str, float], limits: tuple[float, float], ax: Any, side: str
) -> tuple[list[tuple[str, float]], NDArray[np.floating]]:
    """Return the orders within the limits, rising, and where they lie along a side [points]."""
    low, high = limits
    known = sorted(fault_orders.items(), key=lambda entry: entry[1])
    inside = [(name, order) for name, order in known if low <= order <= high]
    length = 72 / ax.figure.dpi * getattr(ax.get_window_extent(), side)
    places = np.array([order for _, order in inside]) * length / (high - low)
    return inside, places


def _point_at(
    ax: Any,
    name: str,
    place: tuple[float, float],
    offset: tuple[float, float],
    *,
    always: bool = False,
    **style: Any,
) -> None:
    """Write a name outside of the axes, with a line to its place if it was moved."""
    line = {"arrowstyle": "-", "color": "0.5", "shrinkA": 0, "shrinkB": 0}
    if always or abs(offset[0]) > 1:
        style["arrowprops"] = line
    style |= {"textcoords": "offset points", "fontsize": SMALL, "annotation_clip": False}
    ax.annotate(name, place, offset, **style)


def _pyplot() -> Any:
    """Return pyplot; matplotlib is imported only where a figure is made."""
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("pictures need matplotlib; install emacm[plot].") from error
    return pyplot
