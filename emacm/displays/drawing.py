"""Style of all displays: colours by state, axes, legends, labels with units, fault orders."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from textwrap import fill
from typing import Any, Self

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

# The palette of Okabe and Ito, which colour-blind readers can distinguish. The first colour is
# that of the healthy state, in every display. Line styles, markers and hatches repeat the
# distinction for print in grey.
COLOURS = ("#009E73", "#D55E00", "#0072B2", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999933")
STYLES = ("-", "--", "-.", ":", (0, (8, 2)), (0, (3, 1)), (0, (1, 3)), (0, (10, 2, 2, 2)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<")
HATCHES = ("", "///", "...", "\\\\\\", "xxx", "---", "+++", "ooo")
HEALTHY = "healthy"  # default label of the healthy state
PLAIN = COLOURS[2]  # of what is not a state
WIDTH = 6.3  # inches: 16 cm, the text width of a page, so that font sizes are those on paper
SMALL = 8  # points; font size of everything except axis labels
ORDER_LABEL = "order [cycles per revolution]"
MISSING = "0.85"  # grey hatch: not measured, or removed by a filter
LETTER = 0.58 * SMALL  # points; mean width of a letter


def state_numbers(labels: Iterable[Any], healthy: Any) -> dict[str, int]:
    """Return the number of each state for `colour_of`: healthy is 0 and first, then 1, 2, ...

    A single group that is not healthy has the colour `PLAIN`.

    Examples
    --------
    >>> state_numbers(["worn", "healthy", "broken"], "healthy")
    {'healthy': 0, 'worn': 1, 'broken': 2}
    """
    names = list(dict.fromkeys(map(str, labels)))
    others = [name for name in names if name != str(healthy)]
    if len(names) == len(others) == 1:
        return {names[0]: COLOURS.index(PLAIN)}
    first = {str(healthy): 0} if len(others) < len(names) else {}
    return first | {name: number for number, name in enumerate(others, 1)}


def colour_of(number: int) -> str:
    """Return the colour of a state; 0 is healthy, and no other state has its colour."""
    return COLOURS[number if number == 0 else 1 + (number - 1) % (len(COLOURS) - 1)]


def style_of(kinds: Sequence[Any], number: int) -> Any:
    """Return the line style, marker or hatch of a state.

    There are 8 kinds and 7 colours beside that of healthy, so that 57 states all differ.
    """
    return kinds[number % len(kinds)]


def line_style(number: int) -> dict[str, Any]:
    """Return colour and line style of a state."""
    return {"color": colour_of(number), "linestyle": style_of(STYLES, number)}


def tint(colour: str, share: float) -> str:
    """Mix a colour, ``#rrggbb``, with white; `share` is the fraction of the colour.

    Examples
    --------
    >>> tint("#0000ff", 0.2)
    '#ccccff'
    """
    parts = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return "#" + "".join(f"{round(255 - share * (255 - part)):02x}" for part in parts)


def wrapped(label: Any) -> str:
    """Break a long label into lines."""
    return fill(str(label), 34, break_on_hyphens=False)


def panel_axes(
    ax: Any, n_panels: int = 1, *, height: float = 1.7, share_x: bool = True, **options: Any
) -> NDArray[np.object_]:
    """Return one Axes for each panel: the given ones, or those of a new figure, in one column.

    Parameters
    ----------
    ax : None, Axes or sequence of Axes
        Where to draw.
    n_panels : int
        Number of Axes needed.
    height : float
        Height of each panel of a new figure [inches].
    share_x : bool
        Whether the panels of a new figure share their x axis.
    **options
        As for ``Figure.subplots``: subplot_kw.

    Returns
    -------
    ndarray of Axes, shape (n_panels,)

    Raises
    ------
    ImportError
        If matplotlib is not installed.
    ValueError
        If `ax` does not hold `n_panels` Axes.
    """
    if ax is None:
        size = (WIDTH, max(3.2, 1.0 + height * n_panels))
        figure = pyplot().figure(figsize=size, layout="constrained")
        return figure.subplots(n_panels, sharex=share_x, squeeze=False, **options).reshape(-1)
    given = np.asarray(ax, dtype=object).reshape(-1)
    if len(given) != n_panels:
        raise ValueError(
            f"this display has {n_panels} panels and needs as many Axes, got {len(given)}. "
            f"Leave ax out, or pass figure.subplots({n_panels})."
        )
    return given


def offscreen_panels(
    n_rows: int = 1, n_columns: int = 1, *, height: float = 4.8, **options: Any
) -> tuple[Any, Any]:
    """Return a figure 16 cm wide that pyplot does not keep, and its Axes in two dimensions.

    Raises
    ------
    ImportError
        If matplotlib is not installed.
    """
    pyplot()
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    return figure, figure.subplots(n_rows, n_columns, squeeze=False, **options)


def label_axes(ax: Any, x: str, y: str) -> None:
    """Label both axes."""
    ax.set(xlabel=x, ylabel=y)


def label_x(axes: NDArray[np.object_], label: str) -> None:
    """Label the x axis of each panel, or only of the last one if the panels share it."""
    for ax in axes:
        if ax is axes[-1] or not ax.get_shared_x_axes().joined(ax, axes[-1]):
            ax.set_xlabel(label)


def date_axis(ax: Any, times: pd.Series) -> None:
    """Mark the range of dates on the x axis as shortly as is unambiguous; of one date, a minute."""
    from matplotlib.dates import ConciseDateFormatter

    low, high = times.min(), times.max()
    margin = 0.05 * (high - low) or pd.Timedelta(seconds=30)
    ax.set_xlim(low - margin, high + margin)
    ax.xaxis.set_major_formatter(ConciseDateFormatter(ax.xaxis.get_major_locator()))


def label_y(ax: Any, quantity: str, unit: str) -> None:
    """Label the y axis with quantity and unit, in as many lines as its height requires."""
    room = int(1.2 * _extent(ax, "height") / (LETTER * 10 / SMALL))
    label = f"{quantity} [{unit}]"
    if len(label) > room:
        label = fill(quantity, room, break_long_words=False) + f"\n[{unit}]"
    ax.set_ylabel(label)


def legend_above(ax: Any, gap: float = 0.0, **options: Any) -> None:
    """Put the legend above the axes, in as many columns as fit; the axes keep their width.

    Parameters
    ----------
    ax : Axes
        Without labelled content it gets no legend.
    gap : float
        Space for other text between axes and legend [points].
    **options
        As for ``Axes.legend``: handles, labels, title.
    """
    if "labels" not in options:
        options["handles"], options["labels"] = ax.get_legend_handles_labels()
    if not options["labels"]:
        return
    place = {"loc": "lower left", "bbox_to_anchor": (0, 1), "bbox_transform": _above(ax, gap)}
    look = {"fontsize": SMALL, "title_fontsize": SMALL, "handlelength": 3, "frameon": False}
    spaces = {"labelspacing": 0.35, "columnspacing": 1.2, "borderpad": 0.2, "borderaxespad": 0.3}
    longest = max(len(line) for label in options["labels"] for line in label.split("\n"))
    # The line sample of an entry takes 42 points, with its margins.
    columns = int(max(1, _extent(ax, "width") // (42 + LETTER * longest)))
    ax.legend(ncols=columns, alignment="left", **place, **look, **spaces, **options)


def _above(ax: Any, gap: float) -> Any:
    """Return axes coordinates shifted up by `gap` [points], and by a title, whenever it is set."""
    from matplotlib import rcParams
    from matplotlib.transforms import Affine2D, Affine2DBase

    class Above(Affine2DBase):
        pass_through = True  # recomputed whenever the axes move

        def __init__(self) -> None:
            super().__init__()
            self.set_children(ax.transAxes)

        def get_matrix(self) -> Any:
            lines = max(len(ax.get_title(loc).splitlines()) for loc in ("left", "center", "right"))
            height = 1.2 * ax.title.get_fontsize() * lines + rcParams["axes.titlepad"]
            shift = gap + (height if lines else 0)
            up = Affine2D().translate(0, shift * ax.figure.dpi / 72)
            return (ax.transAxes + up).get_matrix()

    return Above()


def mark_orders(ax: Any, lines: pd.DataFrame, *, named: bool = True) -> float:
    """Mark predicted fault orders on the x axis: a line at the order, its slip range shaded.

    The names stand above the axes, upright and apart from each other where they would overlap.

    Parameters
    ----------
    ax : Axes
        Its limits are final.
    lines : DataFrame of shape (n_lines, 3)
        Columns "order", "low" and "high" [orders], index: names. Orders outside of the limits are
        not marked.
    named : bool
        Whether to write the names.

    Returns
    -------
    float
        Height of the names above the axes [points].
    """
    inside, places = _within(lines, ax.get_xlim(), _extent(ax, "width"))
    for row in inside.itertuples():
        ax.axvline(row.order, color="0.5", linewidth=0.9, linestyle=(0, (1, 1.5)), zorder=0.5)
        if row.high > row.low:
            ax.axvspan(row.low, row.high, color="0.5", alpha=0.15, linewidth=0, zorder=0.4)
    if not named or inside.empty:
        return 0.0
    widths = LETTER * np.array([len(name) for name in inside.index])
    upright = bool(np.any(np.diff(places) < (widths[1:] + widths[:-1]) / 2 + 4))
    shifts = spread(places, SMALL + 3) - places if upright else np.zeros(len(places))
    style = {"xycoords": ax.get_xaxis_transform(), "ha": "center", "va": "bottom"}
    style["rotation"] = 90 if upright else 0
    for name, order, shift in zip(inside.index, inside["order"], shifts, strict=True):
        moved = abs(shift) > 1
        _annotate(ax, name, (order, 1), (shift, 12 if moved else 3), leader=moved, **style)
    return float(16 + 1.1 * widths.max() if upright else SMALL + 6)


def mark_orders_beside(ax: Any, lines: pd.DataFrame) -> None:
    """Name predicted fault orders at the right end of the y axis, with a bar over the slip range.

    Parameters are those of `mark_orders`.
    """
    inside, places = _within(lines, ax.get_ylim(), _extent(ax, "height"))
    style = {"xycoords": ax.get_yaxis_transform(), "ha": "left", "va": "center"}
    shifts = spread(places, SMALL + 3) - places
    for row, shift in zip(inside.itertuples(), shifts, strict=True):
        look = {"transform": ax.get_yaxis_transform(), "clip_on": False, "color": "0.5"}
        ends = np.clip([row.low, row.high], *ax.get_ylim())
        ax.plot([1.008] * 2, ends, linewidth=2, solid_capstyle="butt", **look)
        _annotate(ax, row.Index, (1.01, row.order), (10, shift), leader=True, **style)


def spread(places: NDArray[np.floating], gap: float) -> NDArray[np.floating]:
    """Move ascending places apart to at least `gap`, with the least sum of squared shifts.

    Examples
    --------
    >>> spread(np.array([0.0, 1.0, 9.0]), 3)
    array([-1.,  2.,  9.])
    """
    steps = gap * np.arange(len(places))
    return isotonic_regression(places - steps).x + steps if len(places) else places


def decibels(power: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return 10 log10 of a power; NaN, which is not drawn, where it is 0."""
    return 10 * np.log10(np.where(power > 0, power, np.nan))


def squared(unit: str) -> str:
    """Write the square of a unit.

    Examples
    --------
    >>> squared("A"), squared("m/s²"), squared("(m/s²)²"), squared("V²"), squared("1")
    ('A²', '(m/s²)²', '(m/s²)⁴', 'V⁴', '1')
    """
    if unit.endswith("²") and (unit.endswith(")²") or not any(sign in unit for sign in "/ ")):
        return f"{unit[:-1]}⁴"
    square = f"({unit})²" if any(sign in unit for sign in "/ ") else f"{unit}²"
    return "1" if unit == "1" else square


def pyplot() -> Any:
    """Return pyplot; matplotlib is imported only where a figure is made."""
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("displays need matplotlib; install emacm[plot].") from error
    return pyplot


def _extent(ax: Any, side: str) -> float:
    """Return width or height of the axes before the layout, which is a lower bound [points]."""
    return float(72 / ax.figure.dpi * getattr(ax.get_window_extent(), side))


def _within(
    lines: pd.DataFrame, limits: tuple[float, float], length: float
) -> tuple[pd.DataFrame, NDArray[np.floating]]:
    """Return the lines within the limits of an axis, ascending, and their places [points]."""
    low, high = limits
    inside = lines[lines["order"].between(low, high)].sort_values("order")
    return inside, inside["order"].to_numpy() * length / (high - low)


def _annotate(ax: Any, name: str, place: Any, offset: Any, *, leader: bool, **style: Any) -> None:
    """Write a name outside of the axes, with a line to its place if it was moved."""
    if leader:
        # From the nearest end of the name, so that no line crosses another name.
        end = {"relpos": (0.0, 0.5) if style["ha"] == "left" else (0.5, 0.0)}
        line = {"arrowstyle": "-", "color": "0.5", "shrinkA": 0, "shrinkB": 0}
        style["arrowprops"] = line | end
    style |= {"textcoords": "offset points", "fontsize": SMALL, "annotation_clip": False}
    ax.annotate(name, place, offset, **style)


class Display:
    """Computed values, their table and their figure."""

    ax_: Any
    figure_: Any

    def plot(self, *, ax: Any = None) -> Self:
        """Draw the values.

        Parameters
        ----------
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one Axes for each panel. Default: a new figure, 16 cm wide.

        Returns
        -------
        Display
            Itself, with `ax_` and `figure_`.

        Raises
        ------
        ImportError
            If matplotlib is not installed.
        ValueError
            If the number of Axes differs from the number of panels.
        """
        self.ax_ = self._draw(ax)
        axes = np.ravel(self.ax_)
        self.figure_ = axes[0].figure
        self.figure_.align_ylabels(list(axes))
        return self

    def _draw(self, ax: Any) -> Any:
        """Draw, and return the Axes or an array of them."""
        raise NotImplementedError
