"""The picture of a page: order spectrum with predicted lines, and deviations from healthy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from emacm.displays import _drawing
from emacm.displays._tables import as_envelope
from emacm.machine.fault_lines import fault_series
from emacm.orders.columns import OrderBlock, parse_order_columns
from emacm.reports.facts import channel_name
from emacm.reports.pages import Page
from emacm.reports.raised import HARMONICS, LEAST, SLIP, is_raised

HEIGHT = 5.0  # inches, of two panels
_NORMAL, _RAISED = "0.6", _drawing.COLOURS[1]
_MOST = 12  # bars with names
_MARKED = 12  # predicted lines


def n_panels(page: Page) -> int:
    """Return the number of Axes that the picture of a page needs: 0, 1 or 2."""
    return (_spectrum_block(page) is not None) + (_bars(page) is not None)


def draw(page: Page, axes: list[Any]) -> None:
    """Draw the order spectrum and the deviations of the channel that deviates most.

    Parameters
    ----------
    page : Page
        What is drawn.
    axes : list of Axes
        `n_panels` of them.
    """
    block, bars = _spectrum_block(page), _bars(page)
    panels = list(axes)
    if block is not None:
        _draw_spectrum(panels.pop(0), page, block)
    if bars is not None:
        unit = str(bars["unit"].iloc[0])
        if bars["low"].notna().all():
            _draw_bins(panels[0], bars)
            panels[0].set_ylabel(f"deviation [{unit}]")
        else:
            _draw_names(panels[0], page, bars)
            panels[0].set_xlabel(f"deviation from {page.reference} [{unit}]")
    for ax in axes:
        ax.tick_params(labelsize=_drawing.SMALL)
        for axis in (ax.xaxis, ax.yaxis):
            axis.label.set_size(_drawing.SMALL)


def description(page: Page) -> str:
    """Return the picture in words."""
    block, parts = _spectrum_block(page), []
    if block is not None:
        lines = "" if page.parts is None else " with predicted lines"
        parts.append(f"order spectrum of {channel_name(block.channel)}{lines}")
    if _bars(page) is not None:
        parts.append(f"deviations from {page.reference}")
    return " and ".join(parts)


def bar_labels(page: Page) -> list[str]:
    """Return the names of the features that are drawn; none where bars are over the order."""
    bars = _bars(page)
    if bars is None or bars["low"].notna().all():
        return []
    return [str(column).rpartition("__")[2] for column in bars["column"]]


def _channel(page: Page) -> str:
    return page.findings.channel if page.findings is not None else ""


def _spectrum_block(page: Page) -> OrderBlock | None:
    """Return the columns of the spectrum that is drawn; None if there is none."""
    names = None if page.spectra is None else [str(name) for name in page.spectra.columns]
    blocks = parse_order_columns(names or ()) or ()
    wanted = _channel(page).rpartition("__")[2]
    chosen = [block for block in blocks if block.channel == wanted]
    return next(iter([*chosen, *blocks]), None)


def _bars(page: Page) -> pd.DataFrame | None:
    """Return the deviations that are drawn: those of a channel in dB, or the largest ones."""
    table = page.deviations
    if table is None:
        return None
    table = table[table["deviation"].notna()].assign(raised=lambda t: is_raised(t))
    own = table[(table["channel"] == _channel(page)) & (table["unit"] == "dB")]
    if own.empty:
        own = table[table["unit"] == "dB"]
        own = own[own["channel"] == own["channel"].iloc[0]] if len(own) else own
    if own.empty:
        own = table.assign(deviation=table["sigmas"], unit="standard deviations")
    if own.empty:
        return None
    if own["low"].notna().all():
        return own.sort_values("low")
    largest = own["deviation"].abs().sort_values(ascending=False).index[:_MOST]
    return own.loc[largest]


def _draw_spectrum(ax: Any, page: Page, block: OrderBlock) -> None:
    assert page.spectra is not None
    orders, power = block.orders, page.spectra.to_numpy()[0, block.columns]
    drawn = orders > 0  # detrending changes the line at order 0
    style = {"color": _drawing.PLAIN, "linewidth": 0.9, "label": "this recording"}
    ax.plot(orders[drawn], _drawing.decibels(power[drawn]), **style)
    _draw_reference(ax, page, block)
    ax.set_xlim(0, orders[-1])
    gap = _drawing.mark_orders(ax, _predicted(page, float(orders[-1])))
    name = channel_name(block.channel)
    channel = name.partition(" (")[0]
    kind = page.envelopes.get(channel)
    measured = channel if kind is None else channel.removesuffix("_envelope")
    quantity, unit = as_envelope("PSD", page.units.get(measured, "unit"), kind)
    ax.set_ylabel(f"{quantity}\nof {name}\n[dB re 1 {_drawing.squared(unit)}/order]")
    ax.set_xlabel(_drawing.ORDER_LABEL)
    _drawing.legend_above(ax, gap=gap)


def _draw_reference(ax: Any, page: Page, block: OrderBlock) -> None:
    """Draw the mean level of the reference in each bin as a density."""
    table = page.deviations
    if table is None:
        return
    names = table["channel"].str.rpartition("__")[2]
    own = table[(names == block.channel) & (table["high"] > table["low"])]
    own = own[own["reference_level"].notna()].sort_values("low")
    width = 10 * np.log10(own["high"] - own["low"])
    style = {"color": _drawing.COLOURS[0], "linewidth": 1.4, "label": f"mean of {page.reference}"}
    for row, size in zip(own.itertuples(), width, strict=True):
        ax.plot([row.low, row.high], [row.reference_level - size] * 2, **style)
        style.pop("label", None)


def _predicted(page: Page, top: float) -> pd.DataFrame:
    """Return the predicted lines that are marked: those of raised components, or first ones."""
    if page.parts is None:
        return pd.DataFrame(columns=["order", "low", "high"])
    series = fault_series(page.parts, HARMONICS)
    raised = page.findings.components if page.findings is not None else []
    prefixes = {fault.name.rpartition(" ")[0] for fault in series}
    rows = {}
    for fault in series:
        reach = SLIP if fault.slips else 0.0
        for k, order in enumerate(fault.orders, 1):
            if order <= top and (fault.name in raised or (k == 1 and not raised)):
                short = fault.name.rpartition(" ")[2] if len(prefixes) == 1 else fault.name
                name = short if k == 1 else f"{k}x{short}"
                rows[name] = (order, order * (1 - reach), order * (1 + reach))
    table = pd.DataFrame.from_dict(rows, orient="index", columns=["order", "low", "high"])
    return table.astype(float).head(_MARKED)


def _draw_bins(ax: Any, bars: pd.DataFrame) -> None:
    """Draw a bar for each order band."""
    width = (bars["high"] - bars["low"]).to_numpy()
    step = np.median(np.diff(bars["low"])) if len(bars) > 1 else 1.0
    width = np.where(width > 0, width, step)  # spectral lines have no width
    centre = (bars["low"] + bars["high"]).to_numpy() / 2
    colours = [_RAISED if raised else _NORMAL for raised in bars["raised"]]
    look = {"color": colours, "edgecolor": "white", "linewidth": 0.3}
    ax.bar(centre, bars["deviation"], width, **look)
    ax.axhline(0, color="black", linewidth=0.6)
    for limit in (-LEAST, LEAST):
        ax.axhline(limit, color="0.4", linewidth=0.7, linestyle=":")
    ax.set_xlim(0, float((centre + width / 2).max()))
    ax.set_xlabel(_drawing.ORDER_LABEL)


def _draw_names(ax: Any, page: Page, bars: pd.DataFrame) -> None:
    """Draw a horizontal bar for each named feature, the largest on top."""
    labels = bar_labels(page)[::-1]
    colours = [_RAISED if raised else _NORMAL for raised in bars["raised"]][::-1]
    ax.barh(range(len(bars)), bars["deviation"][::-1], color=colours, height=0.7)
    ax.set_yticks(range(len(bars)), labels, fontsize=_drawing.SMALL)
    ax.axvline(0, color="black", linewidth=0.6)
