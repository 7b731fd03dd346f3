"""What a page states about raised lines, ranges of orders and features, and what is normal."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.explanations.deviations import deviating_ranges
from emacm.machine.fault_orders import fault_series
from emacm.machine.raised_lines import (
    LineSpectrum,
    PartLines,
    RaisedLine,
    raised_lines,
    rise_above_bins,
    rise_above_spectra,
)
from emacm.reports.facts import channel_name, decibels, listed

Array = NDArray[np.float64]
Spectra = Mapping[str, tuple[NDArray[np.floating], Array]]  # orders and power of each channel


class Row(NamedTuple):
    """One line of the table of a report."""

    component: str
    channel: str
    orders: str
    raised: str


class Findings(NamedTuple):
    """What is raised or lowered, and which components were found normal.

    Attributes
    ----------
    rows : list of Row
        Raised lines, the components with the largest rise first, then ranges of orders and
        features.
    normal : list of str
        Components without raised lines, and channels within the healthy range.
    notes : list of str
        What was not covered.
    channel : str
        The channel that deviates most, as in the names of the columns.
    components : list of str
        Names of the faults with raised lines.
    """

    rows: list[Row]
    normal: list[str]
    notes: list[str]
    channel: str
    components: list[str]


def find_raised(
    table: pd.DataFrame,
    reference: str,
    parts: Any = None,
    spectra: Spectra | None = None,
    healthy: Mapping[str, Array] | None = None,
    *,
    judged: Collection[str] = (),
) -> Findings:
    """Find raised lines, the components that have them, and what else deviates.

    Parameters
    ----------
    table : DataFrame
        Of `class_deviations`.
    reference : str
        Name of its class.
    parts : part or sequence of parts, optional
        `Bearing` and so on, or mappings of fault names to orders.
    spectra : mapping of channels to (orders, power), optional
        Order spectra of the recording, in which lines are looked for.
    healthy : mapping of channels to ndarray of shape (n_recordings, n_orders), optional
        Spectra of healthy recordings. Default: lines are compared with the bins of the table.
    judged : collection of str
        Names of faults of which more is known: they are not called normal.

    Returns
    -------
    Findings
    """
    series = () if parts is None else fault_series(parts, 3)
    words = {fault.name: f"{fault.kind} ({fault.name})" for fault in series}
    words |= {fault.name: fault.name for fault in series if fault.kind in ("given", fault.name)}
    table, rows = _without_gain(table)
    notes = [
        f"Other deviations in {row.channel} are beyond that of all its orders." for row in rows
    ]
    left = pd.concat([table[:0], *deviating_ranges(table[table["raised"]], "deviation")])
    raised: list[tuple[str, float, Row]] = []
    known: dict[str, PartLines] = {}
    for channel, own in (spectra or {}).items():
        spectrum = LineSpectrum(own[0].astype(np.float64), own[1])
        bins = table[table["low"].notna() & (table["measured"] == channel)]
        # Of several kinds of spectra, the first one is given.
        bins = bins[bins["channel"] == next(iter(bins["channel"]), "")]
        exact = healthy and rise_above_spectra(spectrum, healthy[channel])
        rise, limit = exact or rise_above_bins(spectrum, bins)
        if parts is not None:
            known[channel] = PartLines(spectrum, parts)
        lines = raised_lines(spectrum, rise, limit, known.get(channel))
        shown = known[channel].shown if channel in known else set()
        raised += _line_entries(channel, lines, shown, words, "" if healthy else "at least ")
        left = left.drop(index=_explained(bins, lines, 2 * spectrum.step), errors="ignore")
    of_faults = left["low"].isna() & left["feature"].isin(words) & (left["deviation"] > 0)
    for level in left[of_faults].itertuples():  # of FaultLines: a mean over the lines of a fault
        if level.measured not in known or level.feature in known[level.measured].shown:
            channel, size = channel_name(level.channel), decibels(level.deviation)
            row = Row(words[level.feature], channel, "mean of its lines", size)
            raised.append((level.feature, level.deviation, row))
    raised.sort(key=lambda entry: (not entry[0], -entry[1]))
    names = list(dict.fromkeys(fault for fault, *_ in raised if fault))
    rows += [*(row for *_, row in raised), *_other_rows(left[~of_faults])]
    resolved = {*table["feature"], *(fault.name for x in known.values() for fault in x.resolved)}
    quiet = [fault for fault in series if fault.name in resolved.difference(names, judged)]
    normal = _normal_statements(table, left, [(words[fault.name], fault.orders) for fault in quiet])
    if missing := [word for fault, word in words.items() if fault not in resolved]:
        notes.append(f"The order spectra do not resolve the lines of {listed(missing)}.")
    if len(rows) > 8:
        notes.append(f"{len(rows) - 8} more deviations are not listed.")
    worst = str(table["channel"][table["severity"].idxmax()])
    return Findings(rows[:8], [f"{text} {reference!r}" for text in normal], notes, worst, names)


def _line_entries(
    channel: str, lines: list[RaisedLine], shown: set[str], words: dict[str, str], before: str
) -> list[tuple[str, float, Row]]:
    """Return fault, largest rise and row for the raised lines of each fault in a channel."""
    entries = []
    for fault in dict.fromkeys(line.fault for line in lines):
        component = words.get(fault, "no known part" if words else "–")
        if fault and fault not in shown:
            component = f"single line at the order of {fault}"
        own = [line for line in lines if line.fault == fault]
        row = Row(component, channel_name(channel), *_cells(own, before))
        entries.append((fault, max(line.rise for line in own), row))
    return entries


def _normal_statements(
    table: pd.DataFrame, left: pd.DataFrame, quiet: list[tuple[str, tuple[float, ...]]]
) -> list[str]:
    """State which components have no raised lines, and which channels do not deviate.

    A component with a line in a range of orders that deviates, and in which no line is raised, may
    be the reason of that.
    """
    silent = [
        word
        for word, orders in quiet
        if not any((left["low"].le(k) & left["high"].ge(k)).any() for k in orders)
    ]
    by_channel = table[table["channel"] != ""].groupby("channel", sort=False)["raised"]
    usual = [channel_name(str(channel)) for channel, own in by_channel if not own.any()]
    texts = [f"no lines of {listed(silent, 'or')} above"] if silent else []
    if usual:
        texts.append(f"no order band and no feature of {listed(usual)} deviates from")
    return texts


def _without_gain(table: pd.DataFrame) -> tuple[pd.DataFrame, list[Row]]:
    """Subtract the deviation that the order bands of a channel have in common, and state it.

    It is their median, if it is at least 1 dB and four bands in five are within 2 dB of it. Adds
    the channel as "measured", without its name in a FeatureUnion; the name of the "feature"; the
    "severity", in parts of the limit; and whether it is "raised", or lowered, beyond the limit.
    """
    table, rows = table.reset_index(drop=True), []
    for channel, own in table[table["low"].notna()].groupby("channel", sort=False):
        deviation = own["deviation"][own["unit"] == "dB"].dropna()
        gain = float(deviation.median())
        if abs(gain) >= 1.0 and ((deviation - gain).abs() <= 2.0).mean() >= 0.8:
            name = channel_name(str(channel))
            rows.append(Row("all orders together", name, "all", decibels(gain)))
            table.loc[deviation.index, ["deviation", "level"]] -= gain
    severity = (table["deviation"].abs() / table["limit"]).fillna(0.0)
    return table.assign(
        measured=table["channel"].str.rpartition("__")[2],
        feature=table["column"].str.split("@|__|:").str[-1],
        severity=severity.where(table["channel"] != "", 0.0),
        raised=severity >= 1,
    ), rows


def _cells(lines: list[RaisedLine], before: str) -> tuple[str, str]:
    """Return orders and rises of six lines, harmonics before sidebands and the highest first."""
    highest = sorted(sorted(lines, key=lambda x: (not x.line.endswith("x"), -x.rise))[:6])
    orders = [f"{x.order:.4g} ({x.line})".removesuffix(" ()") for x in highest]
    rises = [decibels(line.rise).removesuffix(" dB") for line in highest]
    more = f" and {len(lines) - 6} more" if len(lines) > 6 else ""
    return ", ".join(orders) + more, f"{before}{', '.join(rises)} dB"


def _explained(bins: pd.DataFrame, lines: list[RaisedLine], reach: float) -> pd.Index:
    """Return the bins that raised lines within `reach` explain.

    The lines are at least half of the power, and at the edge of two bins the least rise is lower by
    up to 3 dB.
    """
    power = np.zeros(len(bins))
    for line in lines:
        touched = (bins["low"] <= line.order + reach) & (bins["high"] >= line.order - reach)
        power += touched.to_numpy() * 10 ** (line.rise / 10)
    return bins.index[power >= 10 ** ((bins["deviation"] - 6.0) / 10)]


def _other_rows(table: pd.DataFrame) -> list[Row]:
    """Return a row for each range of adjacent bins, and for each feature, the worst first."""
    rows = []
    parts = deviating_ranges(table, "deviation")
    for part in sorted(parts, key=lambda part: -part["severity"].max()):
        peak = part.loc[part["deviation"].abs().idxmax()]
        kind, place = "feature", peak["feature"]
        if not np.isnan(peak["low"]):
            kind, place = "range of orders", f"{part['low'].min():g} to {part['high'].max():g}"
        size = decibels(peak["deviation"], peak["unit"])
        rows.append(Row(kind, channel_name(peak["channel"]) or "–", place, size))
    return rows
