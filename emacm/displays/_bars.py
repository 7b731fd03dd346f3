"""Bars and steps over order bins between their exact edges, and over bins that have names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm.displays._drawing import (
    LETTER,
    MISSING,
    ORDER_LABEL,
    SMALL,
    mark_orders,
    name_panels_below,
    panel_axes,
    wrapped,
)
from emacm.orders.bins import Band, check_stop_bands
from emacm.orders.columns import BinBlock, parse_bin_columns

_HALF = 0.4  # of a bar over a name; names stand 1 apart
_MOST_NAMES = 40  # under one picture


def bin_blocks(columns: Sequence[Any]) -> list[BinBlock]:
    """Return channels and bins of these columns; names of another form are one channel's bins.

    Parameters
    ----------
    columns : sequence of str or of (low, high)
        Names ``channel@low-high`` or ``channel@name``, as `BinTransformer` writes them, other
        names, or bands [orders] of one channel.

    Raises
    ------
    TypeError, ValueError
        If there is no column, or one comes twice, or a band is none.
    """
    entries = list(columns)
    if not entries:
        raise ValueError("columns must hold at least one name or band, got none.")
    if not any(isinstance(entry, str) for entry in entries):
        check_stop_bands(entries)  # complains of what is no band
        bands = np.array([[float(edge) for edge in band] for band in entries])
        names = tuple(f"{low:g}-{high:g}" for low, high in bands)
        return [BinBlock("signal", names, bands, np.arange(len(bands)))]
    for entry in entries:
        if not isinstance(entry, str):
            raise TypeError(f"columns must be names or bands throughout, got {entry!r} among them.")
    if len(set(entries)) < len(entries):
        double = next(entry for entry in entries if entries.count(entry) > 1)
        raise ValueError(f"columns must name each bin once, but {double!r} comes again.")
    blocks = parse_bin_columns(entries)
    if blocks is None:
        return [BinBlock("signal", tuple(entries), None, np.arange(len(entries)))]
    return list(blocks)


def bin_places(block: BinBlock) -> NDArray[np.floating]:
    """Return where each bin begins and ends on the x axis, shape (n_bins, 2)."""
    if block.bands is not None:
        return block.bands
    centres = np.arange(len(block.names))[:, np.newaxis]
    return centres + np.array([-_HALF, _HALF])


def share_an_axis(blocks: Sequence[BinBlock]) -> bool:
    """Tell whether all blocks have an order axis, or the same named bins."""
    if all(block.bands is not None for block in blocks):
        return True
    return len({(block.names, block.bands is None) for block in blocks}) == 1


def bin_panels(ax: Any, blocks: Sequence[BinBlock], n_rows: int = 1) -> NDArray[np.object_]:
    """Return an axes for each block, `n_rows` times, with limits and names along x."""
    axes = panel_axes(ax, n_rows * len(blocks), shared="x" if share_an_axis(blocks) else "")
    low = min(bin_places(block).min() for block in blocks)
    high = max(bin_places(block).max() for block in blocks)
    for panel, block in zip(axes, [*blocks] * n_rows, strict=True):
        if block.bands is not None:
            panel.set_xlim(low, high)
            continue
        _name_bins(panel, block.names)
    banded = all(block.bands is not None for block in blocks)
    name_panels_below(axes, ORDER_LABEL if banded else "order bin")
    return axes


def _name_bins(panel: Any, names: Sequence[str]) -> None:
    """Write names below their bins; upright where they have no room."""
    panel.set_xlim(-0.6, len(names) - 0.4)
    step = 1 + len(names) // _MOST_NAMES
    width = 72 / panel.figure.dpi * panel.get_window_extent().width
    room = int(width / len(names) / LETTER) - 1
    upright = max(len(word) for name in names for word in name.split(" ")) > room
    shown = [wrapped(name) if upright else fill(name, room) for name in names[::step]]
    rotation = 90 if upright else 0
    panel.set_xticks(np.arange(len(names))[::step], shown, rotation=rotation, fontsize=SMALL)


def draw_bars(
    ax: Any,
    places: NDArray[np.floating],
    values: NDArray[np.floating],
    *,
    bottom: float = 0.0,
    **style: Any,
) -> None:
    """Draw a bar from `bottom` to each value, between the edges of its bin."""
    widths = places[:, 1] - places[:, 0]
    style = {"edgecolor": "black", "linewidth": 0.5} | style
    ax.bar(places[:, 0], values - bottom, widths, bottom=bottom, align="edge", **style)


def draw_steps(
    ax: Any, places: NDArray[np.floating], values: NDArray[np.floating], **style: Any
) -> None:
    """Draw a line at each value from edge to edge, joined where bins adjoin."""
    x: list[float] = []
    y: list[float] = []
    for i, ((low, high), value) in enumerate(zip(places, values, strict=True)):
        if i and low != places[i - 1, 1]:
            x, y = [*x, low], [*y, np.nan]
        x, y = [*x, low, high], [*y, value, value]
    ax.plot(x, y, linewidth=1.3, solid_joinstyle="miter", **style)


def draw_stop_bands(ax: Any, stop_bands: Sequence[Band]) -> None:
    """Hatch the orders that were taken out."""
    for i, (low, high) in enumerate(stop_bands):
        label = "stop band" if i == 0 else None
        ax.axvspan(
            low, high, facecolor="white", edgecolor=MISSING, hatch="////", label=label, zorder=0
        )


def mark_panels(
    axes: NDArray[np.object_], blocks: Sequence[BinBlock], fault_orders: Mapping[str, float]
) -> None:
    """Mark fault orders in the panels that have an order axis, named in the first."""
    for i, (panel, block) in enumerate(zip(axes, blocks, strict=True)):
        if block.bands is not None:
            mark_orders(panel, fault_orders, named=i == 0)
