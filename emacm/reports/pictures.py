"""The picture of a page: order spectrum with predicted lines, and deviations from healthy."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from io import BytesIO
from typing import Any

import numpy as np
import pandas as pd

from emacm.displays import _drawing
from emacm.displays._tables import as_envelope
from emacm.machine.fault_lines import fault_series
from emacm.reports.facts import channel_name
from emacm.reports.pages import Page
from emacm.reports.raised import HARMONICS, LEAST, SLIP, is_raised

_MOST = 12  # bars with names
_MARKED = 12  # predicted lines


class Picture:
    """Order spectrum and deviations of the channel of a page that deviates most.

    Parameters
    ----------
    page : Page
        What is drawn.

    Attributes
    ----------
    n_panels : int
        Number of Axes needed: 0, 1 or 2.
    description : str
        The picture in words.
    """

    def __init__(self, page: Page) -> None:
        self._page, self._bars = page, _bars(page)
        worst = _channel(page).rpartition("__")[2]
        self._channel = worst if worst in page.spectra else next(iter(page.spectra), None)
        self.n_panels = (self._channel is not None) + (self._bars is not None)
        parts = []
        if self._channel is not None:
            lines = "" if page.parts is None else " with predicted lines"
            parts.append(f"order spectrum of {channel_name(self._channel)}{lines}")
        if self._bars is not None:
            parts.append(f"deviations from {page.reference}")
        self.description = " and ".join(parts)

    def draw(self, axes: Sequence[Any]) -> None:
        """Draw on `n_panels` Axes."""
        if self._channel is not None:
            _draw_spectrum(axes[0], self._page, self._channel)
        if self._bars is not None:
            _draw_bars(axes[-1], self._page.reference, self._bars)
        for ax in axes:
            ax.tick_params(labelsize=_drawing.SMALL)
            for axis in (ax.xaxis, ax.yaxis):
                axis.label.set_size(_drawing.SMALL)

    def svg(self) -> str:
        """Return the picture as SVG in base64; empty if nothing is drawn."""
        if not self.n_panels:
            return ""
        height = 5.0 if self.n_panels > 1 else 2.8  # inches
        figure, axes = _drawing.offscreen_panels(self.n_panels, height=height)
        self.draw(axes[:, 0])
        buffer = BytesIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None})
        return b64encode(buffer.getvalue()).decode()


def _channel(page: Page) -> str:
    return "" if page.findings is None else page.findings.channel


def _bars(page: Page) -> pd.DataFrame | None:
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
    largest = own["deviation"].abs().sort_values(ascending=False).index[:_MOST]
    return own.loc[largest]


def _draw_spectrum(ax: Any, page: Page, channel: str) -> None:
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
    ax.set_ylabel(f"{quantity}\nof {name}\n[dB re 1 {_drawing.squared(unit)}/order]")
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


def _predicted(page: Page, top: float) -> pd.DataFrame:
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
    return table.astype(float).head(_MARKED)


def _draw_bars(ax: Any, reference: str, bars: pd.DataFrame) -> None:
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
