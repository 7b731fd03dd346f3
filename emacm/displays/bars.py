"""Bars and steps over order bins between their exact edges, and over bins with names."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.displays import drawing
from emacm.orders.bins import Band
from emacm.orders.columns import BinBlock, parse_bin_columns


def bin_blocks(columns: Sequence[Any]) -> list[BinBlock]:
    """Return the bins of each channel; names of another form are the bins of one channel."""
    names = tuple(map(str, columns))
    one = [BinBlock("signal", names, None, np.arange(len(names)))]
    return list(parse_bin_columns(names) or one)


def has_order_axis(block: BinBlock) -> bool:
    """Return whether bins are drawn over the order: they have edges and do not overlap."""
    if block.bands is None:
        return False
    low, high = block.bands[np.lexsort(block.bands.T[::-1])].T
    return bool(np.all(high[:-1] <= low[1:] + 1e-9 * high[:-1]))


def bin_places(block: BinBlock) -> NDArray[np.floating]:
    """Return start and end of each bin on the x axis, shape (n_bins, 2)."""
    if block.bands is not None and has_order_axis(block):
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
    same_bins = len({() if has_order_axis(block) else block.names for block in blocks}) == 1
    axes = drawing.panel_axes(ax, len(blocks), shared="x" if same_bins else "")
    over_order = [block for block in blocks if has_order_axis(block)]
    edges = np.concatenate([bin_places(block) for block in over_order or blocks])
    for panel, block in zip(axes, blocks, strict=True):
        if has_order_axis(block):
            panel.set_xlim(edges.min(), edges.max())
        else:
            name_bins(panel, block.names)
    label = drawing.ORDER_LABEL
    named = "order bin" if any(block.bands is None for block in blocks) else f"bin, {label}"
    drawing.label_x(axes, label if len(over_order) == len(blocks) else named)
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
        if has_order_axis(block)
    ]
    return max(heights, default=0.0)
