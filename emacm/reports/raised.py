"""Which orders of which component are raised above those of healthy recordings, by how many dB."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.machine.fault_lines import FaultSeries, LineLevels, fault_series
from emacm.orders.columns import parse_order_columns
from emacm.reports.facts import channel_name, decibels, listed

LEAST = 3.0  # dB above the mean of the healthy recordings
SIGMAS = 4.0  # standard deviations of the healthy recordings: hundreds of bins are looked at
HARMONICS = 3
SLIP = 0.02
_HEIGHT = 6.0  # dB above the local background; noise alone has 1 to 3 dB, see FaultLines
_BACKGROUND = 0.5  # orders
_LEAKAGE = 6.0  # dB by which leakage of a line into the next bin is lower
_MOST = 8  # rows of the table


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
        Components with raised lines, then other orders and features, the largest first.
    normal : list of str
        Components without raised lines, and channels within the healthy range.
    notes : list of str
        What could not be distinguished or was not covered.
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


class _Component(NamedTuple):
    """The lines of a fault in one channel."""

    fault: FaultSeries
    channel: str
    orders: tuple[float, ...]
    columns: tuple[int, ...]
    deviations: NDArray[np.float64]
    is_raised: bool


def find_raised(
    table: pd.DataFrame, reference: str, parts: Any = None, spectra: pd.DataFrame | None = None
) -> Findings:
    """Find raised orders, and the components that predict them.

    Parameters
    ----------
    table : DataFrame
        Of `class_deviations`.
    reference : str
        Name of its class.
    parts : part or sequence of parts, optional
        `Bearing` and so on, or mappings of fault names to orders.
    spectra : DataFrame of shape (1, n_columns), optional
        Order spectrum of the recording. A component is named only if its lines are above the local
        background there, which separates faults whose orders are in the same bin.

    Returns
    -------
    Findings
    """
    table, common = _without_gain(table.reset_index(drop=True))
    raised = is_raised(table)
    series = () if parts is None else fault_series(parts, HARMONICS)
    found = [
        component
        for fault in series
        for channel in dict.fromkeys(table["channel"])
        if (component := _component(fault, channel, table, raised, spectra)) is not None
    ]
    hit = sorted(
        (component for component in found if component.is_raised),
        key=lambda component: -component.deviations.mean(),
    )
    taken = {column for component in hit for column in component.columns}
    others = _other_columns(table, np.flatnonzero(raised), taken)
    rows = [*common, *map(_component_row, hit), *_other_rows(table, others, bool(series))]
    covered = {component.fault.name for component in found}
    names = list(dict.fromkeys(component.fault.name for component in hit))
    normal = [_label(fault) for fault in series if fault.name in covered - set(names)]
    texts = [f"no series of raised lines of {listed(normal, 'or')}"] if normal else []
    notes = _not_separated(hit)
    if common:
        gained = listed([row.channel for row in common])
        notes.append(f"Other deviations in {gained} are relative to that of all its orders.")
    missing = [_label(fault) for fault in series if fault.name not in covered]
    if missing:
        notes.append(f"The model has no order bands at the orders of {listed(missing)}.")
    more = len(rows) - _MOST
    if more > 0:
        notes.append(f"{more} more deviations are not listed.")
    texts += _normal_channels(table, reference, {row.channel for row in common})
    return Findings(rows[:_MOST], texts, notes, _worst(table), names)


def is_raised(table: pd.DataFrame) -> NDArray[np.bool_]:
    """Return which columns are far from the healthy recordings, above or below."""
    sigmas = np.abs(table["sigmas"].to_numpy()) >= SIGMAS
    large = np.abs(table["deviation"].to_numpy()) >= LEAST
    return sigmas & (large | (table["unit"] != "dB").to_numpy())


def _without_gain(table: pd.DataFrame) -> tuple[pd.DataFrame, list[Row]]:
    """Subtract the deviation that most order bands of a channel have in common, and state it."""
    rows, raised = [], is_raised(table)
    bands = ((table["unit"] == "dB") & table["low"].notna() & table["deviation"].notna()).to_numpy()
    for channel in dict.fromkeys(table["channel"][bands]):
        own = bands & (table["channel"] == channel).to_numpy()
        deviations = table["deviation"].to_numpy()[own]
        gain = float(np.median(deviations))
        same = raised[own] & (np.sign(deviations) == np.sign(gain))
        if abs(gain) < LEAST or 2 * same.sum() <= own.sum():
            continue
        sigmas = table["sigmas"].to_numpy()[own] * (1 - gain / deviations)
        table = table.copy()
        table.loc[own, ["deviation", "sigmas"]] = np.transpose([deviations - gain, sigmas])
        rows.append(Row("all orders together", channel_name(channel), "all", decibels(gain)))
    return table, rows


def _label(fault: FaultSeries) -> str:
    """Return a fault in words: the component and the name of its order."""
    return fault.name if fault.kind in ("", "given") else f"{fault.kind} ({fault.name})"


def _component(
    fault: FaultSeries,
    channel: str,
    table: pd.DataFrame,
    raised: NDArray[np.bool_],
    spectra: pd.DataFrame | None,
) -> _Component | None:
    """Return the lines of a fault among the columns of a channel; None if it has none there."""
    own = table[(table["channel"] == channel) & (table["unit"] == "dB")]
    lines = [line for order in fault.orders if (line := _columns_at(order, fault, own)) is not None]
    labels = [str(column).rpartition("@")[2] for column in own["column"]]
    names = {fault.name, *(f"{k}x{fault.name}" for k in range(2, HARMONICS + 1))}
    named = [k for k, label in zip(own.index, labels, strict=True) if label in names]
    if named:  # columns of FaultLines, and bands that have the name of the fault
        lines = [(np.nan, k) for k in named]
    if not lines:
        return None
    columns = tuple(int(column) for _, column in lines)
    orders = tuple(order for order, _ in lines) if not named else fault.orders
    deviations = table["deviation"].to_numpy()[list(columns)]
    above = raised[list(columns)] & (deviations > 0)
    hit = 2 * above.sum() >= len(columns) and _above_background(fault, orders, channel, spectra)
    return _Component(fault, channel, orders, columns, deviations, bool(hit))


def _columns_at(order: float, fault: FaultSeries, own: pd.DataFrame) -> tuple[float, int] | None:
    """Return the order of a line, and the column of the largest deviation where it may be."""
    reach = SLIP * order if fault.slips else 0.0
    inside = own[(own["low"] <= order + reach) & (own["high"] >= order - reach)]
    if inside["deviation"].isna().all() or order > own["high"].max():
        return None
    return order, int(inside["deviation"].idxmax())


def _above_background(
    fault: FaultSeries, orders: Sequence[float], channel: str, spectra: pd.DataFrame | None
) -> bool:
    """Return whether most lines are above the local background; True if that is not known.

    The median over the lines is compared, so that one line of another fault is not enough.
    """
    blocks = None if spectra is None else parse_order_columns([str(c) for c in spectra.columns])
    name = channel.rpartition("__")[2]  # without the name of a member of a FeatureUnion
    for block in blocks or ():
        if spectra is None or block.channel != name:
            continue
        inside = tuple(order for order in orders if order < (1 - SLIP) * block.orders[-1])
        try:
            lines = LineLevels(
                block.orders, [replace(fault, orders=inside)], SLIP, _BACKGROUND, without_shaft=True
            )
        except (ValueError, IndexError):  # too coarse, or no line inside
            return True
        heights = lines.measure(spectra.to_numpy()[:, block.columns])[2]
        return bool(np.median(heights[0]) >= _HEIGHT)
    return True


def _component_row(component: _Component) -> Row:
    orders = ", ".join(f"{order:.4g}" for order in component.orders)
    sizes = ", ".join(decibels(value).removesuffix(" dB") for value in component.deviations)
    return Row(_label(component.fault), channel_name(component.channel), orders, f"{sizes} dB")


def _other_columns(table: pd.DataFrame, raised: NDArray[np.intp], taken: set[int]) -> list[int]:
    """Return raised columns that belong to no component, nor are leakage of one beside them."""
    found = []
    for column in raised.tolist():
        own = table.loc[column]
        beside = [
            table.at[k, "deviation"]
            for k in taken
            if table.at[k, "channel"] == own["channel"]
            and (table.at[k, "low"] <= own["high"] and own["low"] <= table.at[k, "high"])
        ]
        if column not in taken and own["deviation"] > max(beside, default=-np.inf) - _LEAKAGE:
            found.append(column)
    return found


def _other_rows(table: pd.DataFrame, columns: list[Any], with_parts: bool) -> list[Row]:
    """Return a row for each range of adjacent columns that no component predicts."""
    rows: list[tuple[float, Row]] = []
    chosen = table.loc[columns].sort_values(["channel", "low"], kind="stable")
    for part in _adjacent(chosen):
        peak = part.loc[part["deviation"].abs().idxmax()]
        low, high = part["low"].min(), part["high"].max()
        label = str(peak["column"]).rpartition("@")[2].rpartition("__")[2]
        orders = label.partition(":")[2] or label
        if np.isfinite(low) and re.fullmatch(r"[0-9.e+-]+", label):
            orders = f"{low:g} to {high:g}" if high > low else f"{low:g}"
        component = "no predicted order" if with_parts and np.isfinite(low) else "–"
        size = decibels(peak["deviation"], peak["unit"])
        row = Row(component, channel_name(peak["channel"]) or "–", orders, size)
        rows.append((abs(peak["sigmas"]), row))
    return [row for _, row in sorted(rows, key=lambda pair: -pair[0])]


def _adjacent(chosen: pd.DataFrame) -> list[pd.DataFrame]:
    """Divide sorted columns into ranges of adjacent bins with deviations of one sign."""
    if chosen.empty:
        return []
    before = chosen.shift()
    joined = (
        (chosen["channel"] == before["channel"])
        & (chosen["low"] <= before["high"] + 1e-9)
        & (np.sign(chosen["deviation"]) == np.sign(before["deviation"]))
    )
    return [part for _, part in chosen.groupby((~joined).cumsum())]


def _not_separated(hit: Sequence[_Component]) -> list[str]:
    """Name components whose raised lines are in the same columns."""
    by_columns: dict[Any, list[str]] = {}
    for component in hit:
        key = frozenset(component.columns)
        by_columns.setdefault(key, []).append(_label(component.fault))
    pairs = [list(dict.fromkeys(names)) for names in by_columns.values()]
    return [
        f"The order bins of the model do not separate {listed(names)}."
        for names in pairs
        if len(names) > 1
    ]


def _normal_channels(table: pd.DataFrame, reference: str, others: set[str]) -> list[str]:
    """State how many columns of each channel, but of `others`, are as in the reference."""
    texts = []
    known = table[table["deviation"].notna()]
    for channel, own in known.groupby("channel", sort=False):
        normal = int((~is_raised(own)).sum())
        if normal and channel and channel_name(str(channel)) not in others:
            count = f"all {normal}" if normal == len(own) else f"{normal} of {len(own)}"
            kind = "order bands" if own["low"].notna().all() else "features"
            texts.append(f"{count} {kind} of {channel_name(str(channel))} as in {reference!r}")
    return texts


def _worst(table: pd.DataFrame) -> str:
    """Return the channel with the largest deviation."""
    known = table[table["sigmas"].notna() & (table["channel"] != "")]
    return "" if known.empty else str(known.loc[known["sigmas"].abs().idxmax(), "channel"])
