"""Bars and steps over order bins between their exact edges, and over bins with names.

`ContributionsDisplay`: contributions of the bins to a decision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import InitVar, dataclass, field
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.displays import drawing, drawn_values
from emacm.orders.bins import Band
from emacm.orders.columns import BinBlock, parse_bin_columns


def bin_blocks(columns: Sequence[Any]) -> list[BinBlock]:
    """Return the bins of each channel; names of another form are the bins of one channel."""
    names = tuple(map(str, columns))
    one = [BinBlock("signal", names, None, np.arange(len(names)))]
    return list(parse_bin_columns(names) or one)


def bin_places(block: BinBlock) -> NDArray[np.floating]:
    """Return start and end of each bin on the x axis, shape (n_bins, 2): orders, or numbers."""
    if block.bands is not None:
        return block.bands
    centres = np.arange(len(block.names))[:, np.newaxis]
    return centres + np.array([-0.4, 0.4])  # names are 1 apart


def bin_frame(blocks: Sequence[BinBlock], values: dict[str, NDArray[np.floating]]) -> pd.DataFrame:
    """Return values as a table: one row per channel and bin, one column per label."""
    rows = [(block.channel, name) for block in blocks for name in block.names]
    places = np.concatenate([block.columns for block in blocks])
    index = pd.MultiIndex.from_tuples(rows, names=["channel", "bin"])
    return pd.DataFrame({label: numbers[places] for label, numbers in values.items()}, index=index)


def bin_panels(ax: Any, blocks: Sequence[BinBlock]) -> NDArray[np.object_]:
    """Return one Axes for each block, with limits and names along x."""
    bands = [block.bands for block in blocks if block.bands is not None]
    over_order = len(bands) == len(blocks)
    axes = drawing.panel_axes(ax, len(blocks), share_x=over_order)
    for panel, block in zip(axes, blocks, strict=True):
        if block.bands is None:
            name_bins(panel, block.names)
        else:
            edges = np.concatenate(bands)
            panel.set_xlim(edges.min(), edges.max())
    drawing.label_x(axes, drawing.ORDER_LABEL if over_order else "order bin")
    return axes


def name_bins(panel: Any, names: Sequence[str]) -> None:
    """Write names below their bins; upright where the panel is too narrow."""
    panel.set_xlim(-0.6, len(names) - 0.4)
    step = 1 + len(names) // 40
    width = 72 / panel.figure.dpi * panel.get_window_extent().width
    room = int(width / len(names) / drawing.LETTER) - 1
    upright = max(len(word) for name in names for word in name.split(" ")) > room
    shown = [drawing.wrapped(name) if upright else fill(name, room) for name in names[::step]]
    style = {"rotation": 90 if upright else 0, "fontsize": drawing.SMALL}
    panel.set_xticks(np.arange(len(names))[::step], shown, **style)


def draw_steps(
    ax: Any, places: NDArray[Any], values: NDArray[Any], label: str, number: int, **style: Any
) -> None:
    """Draw a line at each value from edge to edge, connected where bins are adjacent.

    `number` is that of its state, see `colour_of`.
    """
    gaps = 2 * np.flatnonzero(places[1:, 0] != places[:-1, 1]) + 2
    x = np.insert(places.ravel(), gaps, places.ravel()[gaps])
    y = np.insert(np.repeat(values, 2), gaps, np.nan)
    style = {"linewidth": 1.3, "solid_joinstyle": "miter", **drawing.line_style(number), **style}
    ax.plot(x, y, label=drawing.wrapped(label), **style)


def draw_stop_bands(ax: Any, stop_bands: Sequence[Band]) -> None:
    """Hatch the orders that a filter removed."""
    style = {"facecolor": "white", "edgecolor": drawing.MISSING, "hatch": "////", "zorder": 0}
    for number, (low, high) in enumerate(stop_bands):
        ax.axvspan(low, high, label="" if number else "stop band", **style)


def mark_panels(
    axes: NDArray[np.object_], blocks: Sequence[BinBlock], lines: pd.DataFrame
) -> float:
    """Mark fault orders in the panels with an order axis; return the height of their names.

    They are named in the first panel [points].
    """
    heights = [
        drawing.mark_orders(panel, lines, named=i == 0)
        for i, (panel, block) in enumerate(zip(axes, blocks, strict=True))
        if block.bands is not None
    ]
    return max(heights, default=0.0)


@dataclass(eq=False, repr=False)
class ContributionsDisplay(drawn_values.OrderDisplay):
    """Contribution of each order bin to a decision, one panel for each channel.

    Parameters
    ----------
    columns : sequence of str
        Names ``channel@low-high`` or ``channel@name``, as written by `BinTransformer`.
    contributions : array-like of shape (n_columns,)
        Contribution of each bin [nats], signed: positive values are evidence for the decision.
    fault_orders : DataFrame of `emacm.fault_orders`, or mapping of str to float, optional
        Predicted fault orders, which are marked. Those outside of the bins are not drawn.
    slip : float
        Largest relative slip: a line that slips may be lower or higher by this fraction of its
        order, and this range is shaded. In a mapping every order may slip.
    decision : str
        The decision that is explained.

    Attributes
    ----------
    ax_ : ndarray of Axes, shape (n_channels,)
        Set when the display is drawn.
    figure_ : Figure
        Figure of these Axes.

    Raises
    ------
    TypeError, ValueError
        If contributions do not fit the columns or are not finite, or an option is invalid.

    Examples
    --------
    >>> names = ["torque@0-1", "torque@3-4"]
    >>> display = ContributionsDisplay(names, [-0.5, 2.0], fault_orders={"screw": 3.125})
    >>> display.frame()["contribution"].to_dict()
    {('torque', '0-1'): -0.5, ('torque', '3-4'): 2.0}
    """

    columns: InitVar[Sequence[Any]]
    contributions: Any
    decision: str = field(default="the decision", kw_only=True)

    def __post_init__(self, columns: Sequence[Any]) -> None:
        super().__post_init__()
        self.blocks = bin_blocks(columns)
        shape = (sum(len(block.names) for block in self.blocks),)
        self.contributions = drawn_values.check_values(self.contributions, "contributions", shape)

    @classmethod
    def from_table(
        cls, table: pd.DataFrame, *, ax: Any = None, **options: Any
    ) -> ContributionsDisplay:
        """Draw a table of contributions.

        Parameters
        ----------
        table : DataFrame
            Result of `explain_decision` or `explain_model`: one row per bin, with columns
            "column" (its name) and "contribution".
        ax : matplotlib Axes or sequence of Axes, optional
            Where to draw: one Axes for each channel.
        **options
            As for the class: fault_orders, slip, decision.

        Returns
        -------
        ContributionsDisplay

        Raises
        ------
        TypeError, ValueError
            If a value or an option is invalid.
        """
        return cls(table["column"], table["contribution"], **options).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return the contributions, one row per channel and bin."""
        return bin_frame(self.blocks, {"contribution": self.contributions})

    def _draw(self, ax: Any) -> Any:
        axes = bin_panels(ax, self.blocks)
        low, high = min(0, self.contributions.min()), max(0, self.contributions.max())
        margin = 0.08 * (high - low)
        limits = (low - margin, high + margin) if margin else (-1, 1)
        for panel, block in zip(axes, self.blocks, strict=True):
            values = self.contributions[block.columns]
            for colour, hatch, word, shown in (
                (drawing.COLOURS[2], "", "for", values >= 0),
                (drawing.COLOURS[4], "////", "against", values < 0),
            ):
                low, high = bin_places(block)[shown].T
                style = {"color": drawing.tint(colour, 0.6), "edgecolor": "black", "hatch": hatch}
                panel.bar(low, values[shown], high - low, align="edge", linewidth=0.5, **style)
                if panel is axes[0]:
                    label = drawing.wrapped(f"evidence {word} {self.decision}")
                    panel.fill_between([], [], label=label, linewidth=0.5, **style)
            panel.axhline(0, color="black", linewidth=0.6)
            panel.set_ylim(limits)  # equal in all channels, for comparison
            drawing.label_y(panel, f"contribution of {block.channel}", "nats")
        drawing.legend_above(axes[0], gap=mark_panels(axes, self.blocks, self.fault_orders))
        return axes
