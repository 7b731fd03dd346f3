"""The picture of a page: order spectrum with predicted lines, and deviations from healthy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from emacm.displays import drawing
from emacm.displays.bars import name_bins
from emacm.displays.power import OrderSpectrumDisplay
from emacm.machine.fault_orders import fault_series
from emacm.reports.facts import channel_name
from emacm.reports.pages import Page


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
    worst = "" if page.findings is None else page.findings.channel.rpartition("__")[2]
    channel = worst if worst in page.spectra else next(iter(page.spectra), None)
    bars = _bars(page)
    titles = []
    if channel is not None:
        lines = "" if page.parts is None else " with predicted lines"
        titles.append(f"order spectrum of {channel_name(channel)}{lines}")
    if bars is not None:
        # Of a line, the table states its own power; a bar is all that is in its band.
        of = "of whole order bands " if bars["low"].notna().all() else ""
        titles.append(f"deviations {of}from {page.reference}")
    if not titles:
        return None, ""
    height = 5.0 if len(titles) > 1 else 2.8  # inches
    figure, axes = drawing.offscreen_panels(len(titles), height=height)
    if channel is not None:
        _draw_spectrum(page, channel, axes[0, 0])
    if bars is not None:
        _draw_bars(page.reference, bars, axes[-1, 0])
    for ax in axes[:, 0]:
        ax.tick_params(labelsize=drawing.SMALL)
        ax.xaxis.label.set_size(drawing.SMALL)
        ax.yaxis.label.set_size(drawing.SMALL)
    return figure, " and ".join(titles)


def _bars(page: Page) -> pd.DataFrame | None:
    """Return the deviations that are drawn: those of a channel in one unit, or the largest ones."""
    if page.deviations is None or page.findings is None:
        return None
    table = page.deviations.dropna(subset="deviation")
    own = table[table["channel"] == page.findings.channel]
    own = own[own["unit"].isin(own["unit"].head(1))]
    if own.empty:
        return None
    if own["low"].notna().all():
        return own.sort_values("low")
    return own.loc[own["deviation"].abs().nlargest(12).index]


def _draw_spectrum(page: Page, channel: str, ax: Any) -> None:
    """Draw the spectrum above that of the reference, whose bins are drawn if no more is known."""
    label = f"mean of {page.reference}"
    orders, power = page.spectra[channel]
    spectra: dict[str, Any] = {"this recording": power}
    if channel in page.healthy_spectra:
        spectra = {label: page.healthy_spectra[channel]} | spectra
    elif page.deviations is not None:
        names = page.deviations["channel"].str.rpartition("__")[2]
        own = page.deviations[(names == channel) & page.deviations["reference_level"].notna()]
        own = own[own["high"] > own["low"]].sort_values("low")
        density = own["reference_level"] - 10 * np.log10(own["high"] - own["low"])
        style = {"color": drawing.COLOURS[0], "linewidth": 1.4, "zorder": 3}
        ax.hlines(density, own["low"], own["high"], label=label if len(own) else None, **style)
    display = OrderSpectrumDisplay(
        orders,
        spectra,
        healthy=label,
        channel=channel,
        unit=page.units,
        envelopes=page.envelopes,
        fault_orders=_predicted(page, float(orders[-1])),
        slip=0.02,
    )
    display.plot(ax=ax)


def _predicted(page: Page, top: float) -> pd.DataFrame:
    """Return the predicted lines that are marked: those of raised components, or first ones."""
    series = () if page.parts is None else fault_series(page.parts, 3)
    raised = page.findings.components if page.findings is not None else []
    one_part = len({fault.name.rpartition(" ")[0] for fault in series}) == 1
    rows = {}
    for fault in series:
        is_short = one_part and fault.kind != "given"  # without the name of the part
        name = fault.name.rpartition(" ")[2] if is_short else fault.name
        chosen = fault.orders if fault.name in raised else fault.orders[: not raised]
        for k, order in enumerate(chosen, 1):
            if order <= top:
                rows[name if k == 1 else f"{k}x{name}"] = (order, fault.slips)
    return pd.DataFrame.from_dict(rows, orient="index", columns=["order", "slips"]).head(12)


def _draw_bars(reference: str, bars: pd.DataFrame, ax: Any) -> None:
    """Draw a bar for each order band, or for each named feature."""
    unit, centre, width = bars["unit"].iloc[0], np.arange(len(bars)), np.full(len(bars), 0.8)
    named = bars["low"].isna().any()
    if not named:
        centre = (bars["low"] + bars["high"]).to_numpy() / 2
        width = (bars["high"] - bars["low"]).to_numpy()
        step = np.median(np.diff(bars["low"])) if len(bars) > 1 else 1.0
        width = np.where(width > 0, width, step)  # spectral lines have no width
    is_far = bars["deviation"].abs() >= bars["limit"]
    colours = np.where(is_far, drawing.COLOURS[1], "0.6")
    look = {"color": colours, "edgecolor": "white", "linewidth": 0.3}
    ax.bar(centre, bars["deviation"], width, **look)
    ax.axhline(0, color="black", linewidth=0.6)
    if named:
        name_bins(ax, [str(column).rpartition("__")[2] for column in bars["column"]])
    else:
        ax.set(xlabel=drawing.ORDER_LABEL, xlim=(0, float((centre + width / 2).max())))
    quantity = f"deviation from {reference}" if named else f"deviation of bands from {reference}"
    drawing.label_y(ax, quantity, unit)
