"""The picture of a page: order spectrum with predicted lines, and deviations from healthy."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from emacm.displays import _drawing
from emacm.displays._tables import as_envelope
from emacm.machine.fault_orders import fault_series
from emacm.reports.facts import channel_name
from emacm.reports.pages import Page
from emacm.reports.raised import HARMONICS, LEAST, SLIP, is_raised


def drawn(page: Page) -> tuple[Any, str]:
    """Draw the order spectrum and the deviations of the channel that deviates most.

    Parameters
    ----------
    page : Page
        What is drawn.

    Returns
    -------
    figure : Figure, or None
        None if the page has neither.
    description : str
        The picture in words.
    """
    panels: list[tuple[str, Callable[[Any], None]]] = []
    worst = _channel(page).rpartition("__")[2]
    channel = worst if worst in page.spectra else next(iter(page.spectra), None)
    if channel is not None:
        lines = "" if page.parts is None else " with predicted lines"
        title = f"order spectrum of {channel_name(channel)}{lines}"
        panels.append((title, partial(_draw_spectrum, page, channel)))
    bars = _bars(page)
    if bars is not None:
        title = f"deviations from {page.reference}"
        panels.append((title, partial(_draw_bars, page.reference, bars)))
    if not panels:
        return None, ""
    height = 5.0 if len(panels) > 1 else 2.8  # inches
    figure, axes = _drawing.offscreen_panels(len(panels), height=height)
    for ax, (_, draw) in zip(axes[:, 0], panels, strict=True):
        draw(ax)
        ax.tick_params(labelsize=_drawing.SMALL)
        ax.xaxis.label.set_size(_drawing.SMALL)
        ax.yaxis.label.set_size(_drawing.SMALL)
    return figure, " and ".join(title for title, _ in panels)


def _channel(page: Page) -> str:
    return "" if page.findings is None else page.findings.channel


def _bars(page: Page, most_named: int = 12) -> pd.DataFrame | None:
    """Return the deviations that are drawn: those of a channel in dB, or the largest ones."""
    if page.deviations is None:
        return None
    table = page.deviations[page.deviations["deviation"].notna()]
    table = table.assign(raised=is_raised(table))
    own = table[table["unit"] == "dB"]
    if own.empty:
        own = table.assign(deviation=table["sigmas"], unit="standard deviations")
    else:
        channels = own["channel"].tolist()
        worst = _channel(page)
        own = own[own["channel"] == (worst if worst in channels else channels[0])]
    if own.empty:
        return None
    if own["low"].notna().all():
        return own.sort_values("low")
    largest = own["deviation"].abs().sort_values(ascending=False).index[:most_named]
    return own.loc[largest]


def _draw_spectrum(page: Page, channel: str, ax: Any) -> None:
    orders, power = page.spectra[channel]
    drawn = orders > 0  # detrending changes the line at order 0
    style = {"color": _drawing.PLAIN, "linewidth": 0.9, "label": "this recording"}
    ax.plot(orders[drawn], _drawing.decibels(power[drawn]), **style)
    _draw_reference(ax, page, channel)
    ax.set_xlim(0, orders[-1])
    gap = _drawing.mark_orders(ax, _predicted(page, float(orders[-1])))
    name = channel_name(channel)
    plain = name.partition(" (")[0]
    kind = page.envelopes.get(plain)
    measured = plain if kind is None else plain.removesuffix("_envelope")
    quantity, unit = as_envelope("PSD", page.units.get(measured, "unit"), kind)
    level = f"dB re 1 {_drawing.squared(unit)}/order" if measured in page.units else "dB"
    ax.set_ylabel(f"{quantity}\nof {name}\n[{level}]")
    ax.set_xlabel(_drawing.ORDER_LABEL)
    _drawing.legend_above(ax, gap=gap)


def _draw_reference(ax: Any, page: Page, channel: str) -> None:
    """Draw the mean level of the reference in each bin as a density."""
    table = page.deviations
    if table is None:
        return
    names = table["channel"].str.rpartition("__")[2]
    own = table[(names == channel) & (table["high"] > table["low"])]
    own = own[own["reference_level"].notna()].sort_values("low")
    width = 10 * np.log10(own["high"] - own["low"])
    style = {"color": _drawing.COLOURS[0], "linewidth": 1.4, "label": f"mean of {page.reference}"}
    for row, size in zip(own.itertuples(), width, strict=True):
        ax.plot([row.low, row.high], [row.reference_level - size] * 2, **style)
        style.pop("label", None)


def _predicted(page: Page, top: float, most: int = 12) -> pd.DataFrame:
    """Return the predicted lines that are marked: those of raised components, or first ones."""
    series = () if page.parts is None else fault_series(page.parts, HARMONICS)
    raised = page.findings.components if page.findings is not None else []
    one_part = len({fault.name.rpartition(" ")[0] for fault in series}) == 1
    rows = {}
    for fault in series:
        name = fault.name.rpartition(" ")[2] if one_part else fault.name
        chosen = fault.orders if fault.name in raised else fault.orders[: not raised]
        reach = SLIP if fault.slips else 0.0
        for k, order in enumerate(chosen, 1):
            if order <= top:
                limits = (order * (1 - reach), order * (1 + reach))
                rows[name if k == 1 else f"{k}x{name}"] = (order, *limits)
    table = pd.DataFrame.from_dict(rows, orient="index", columns=["order", "low", "high"])
    return table.astype(float).head(most)


def _draw_bars(reference: str, bars: pd.DataFrame, ax: Any) -> None:
    """Draw a bar for each order band, or a horizontal one for each named feature."""
    unit = bars["unit"].iloc[0]
    colours = [_drawing.COLOURS[1] if raised else "0.6" for raised in bars["raised"]]
    if bars["low"].isna().any():  # the largest on top
        labels = [str(column).rpartition("__")[2] for column in bars["column"][::-1]]
        ax.barh(range(len(bars)), bars["deviation"][::-1], color=colours[::-1], height=0.7)
        ax.set_yticks(range(len(bars)), labels, fontsize=_drawing.SMALL)
        ax.axvline(0, color="black", linewidth=0.6)
        ax.set_xlabel(f"deviation from {reference} [{unit}]")
        return
    width = (bars["high"] - bars["low"]).to_numpy()
    step = np.median(np.diff(bars["low"])) if len(bars) > 1 else 1.0
    width = np.where(width > 0, width, step)  # spectral lines have no width
    centre = (bars["low"] + bars["high"]).to_numpy() / 2
    look = {"color": colours, "edgecolor": "white", "linewidth": 0.3}
    ax.bar(centre, bars["deviation"], width, **look)
    ax.axhline(0, color="black", linewidth=0.6)
    for limit in (-LEAST, LEAST):
        ax.axhline(limit, color="0.4", linewidth=0.7, linestyle=":")
    ax.set_xlim(0, float((centre + width / 2).max()))
    ax.set(xlabel=_drawing.ORDER_LABEL, ylabel=f"deviation [{unit}]")
