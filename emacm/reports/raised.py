"""Which orders of which component are raised above those of healthy recordings, by how many dB."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.machine.fault_lines import LineLevels
from emacm.machine.fault_orders import FaultSeries, fault_series
from emacm.reports.facts import channel_name, decibels, listed

LEAST = 3.0  # dB above the mean of the healthy recordings
SIGMAS = 4.0  # standard deviations of the healthy recordings: hundreds of bins are looked at
HARMONICS = 3
SLIP = 0.02

Spectrum = tuple[NDArray[np.floating], NDArray[np.floating]]  # orders and power
Spectra = Mapping[str, Spectrum]


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
    """The lines of a fault in one channel, as rows of the table of deviations."""

    fault: FaultSeries
    channel: str
    orders: tuple[float, ...]
    lines: pd.DataFrame
    is_raised: bool

    @property
    def row(self) -> Row:
        """The line of the table of a report."""
        orders = ", ".join(f"{order:.4g}" for order in self.orders)
        sizes = ", ".join(decibels(size).removesuffix(" dB") for size in self.lines["deviation"])
        return Row(_label(self.fault), channel_name(self.channel), orders, f"{sizes} dB")


def find_raised(
    table: pd.DataFrame,
    reference: str,
    parts: Any = None,
    spectra: Spectra | None = None,
    *,
    judged: Collection[str] = (),
    most: int = 8,
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
    spectra : mapping of channels to (orders, power), optional
        Order spectra of the recording. A component is named only if its lines are above the local
        background there, which separates faults whose orders are in the same bin.
    judged : collection of str
        Names of faults of which more is known: they are not called normal.
    most : int
        Most rows.

    Returns
    -------
    Findings
    """
    table, common, notes = _without_gain(table.reset_index(drop=True))
    series = () if parts is None else fault_series(parts, HARMONICS)
    places = product(series, table["channel"].unique())
    known = list(filter(None, [_component(*place, table, spectra or {}) for place in places]))
    hit = [component for component in known if component.is_raised]
    hit.sort(key=lambda component: -component.lines["deviation"].mean())
    # Beside a raised component, a raised column of another fault may be a line of the first one.
    few = [c for c in known if hit and not c.is_raised and c.lines["low"].isna().all()]
    rest = table.drop(index=[column for c in few for column in c.lines.index])
    rows = [*common, *(component.row for component in hit), *_other_rows(rest, hit, bool(series))]
    names = list(dict.fromkeys(component.fault.name for component in hit))
    covered = {component.fault.name for component in known}
    missing = [_label(fault) for fault in series if fault.name not in covered]
    silent = covered.difference(names, judged)
    quiet = [_label(fault) for fault in series if fault.name in silent]
    normal = [f"no series of raised lines of {listed(quiet, 'or')}"] if quiet else []
    gained = [row.channel for row in common]
    normal += _normal_channels(table, reference, gained)
    if gained:
        relative = "are relative to that of all its orders."
        notes.append(f"Other deviations in {listed(gained)} {relative}")
    for one, other in combinations(hit, 2):
        if one.fault != other.fault and set(one.lines.index) == set(other.lines.index):
            both = listed([_label(one.fault), _label(other.fault)])
            notes.append(f"The order bins of the model do not separate {both}.")
    single = list(dict.fromkeys(_label(c.fault) for c in few if c.lines["raised"].any()))
    if single:
        notes.append(f"Of {listed(single)}, single lines are raised: too few for a fault.")
    if missing:
        notes.append(f"The model has no order bands at the orders of {listed(missing)}.")
    if len(rows) > most:
        notes.append(f"{len(rows) - most} more deviations are not listed.")
    sigmas = table["sigmas"].abs()[table["channel"] != ""].dropna()
    worst = "" if sigmas.empty else str(table["channel"][sigmas.idxmax()])
    return Findings(rows[:most], normal, notes, worst, names)


def is_raised(table: pd.DataFrame) -> NDArray[np.bool_]:
    """Return which columns are far from the healthy recordings, above or below."""
    sigmas = np.abs(table["sigmas"].to_numpy()) >= SIGMAS
    large = np.abs(table["deviation"].to_numpy()) >= LEAST
    return sigmas & (large | (table["unit"] != "dB").to_numpy())


def _without_gain(
    table: pd.DataFrame, *, least: float = 1.0, share: float = 0.8
) -> tuple[pd.DataFrame, list[Row], list[str]]:
    """Subtract the deviation that the order bands of a channel have in common, and state it.

    It is their median, if it is at least `least` [dB] and at least a `share` of the bands deviate
    to the same side; a row if it is large itself, else a sentence. Adds the column "raised".
    """
    rows, notes, table = [], [], table.copy()
    bands = table[(table["unit"] == "dB") & table[["low", "deviation"]].notna().all(axis=1)]
    for channel, own in bands.groupby("channel", sort=False):
        name, gain = channel_name(str(channel)), float(own["deviation"].median())
        same = own["deviation"] * gain > 0
        if abs(gain) >= LEAST and (same & is_raised(own)).mean() > 0.5:
            rows.append(Row("all orders together", name, "all", decibels(gain)))
        elif abs(gain) >= least and same.mean() >= share:
            size = f"All orders of {name} together are {decibels(gain)}"
            notes.append(f"{size}; listed deviations are beyond that.")
        else:
            continue
        table.loc[own.index, "sigmas"] *= 1 - gain / own["deviation"]
        table.loc[own.index, "deviation"] -= gain
    return table.assign(raised=is_raised(table)), rows, notes


def _label(fault: FaultSeries) -> str:
    """Return a fault in words: the component and the name of its order."""
    return fault.name if fault.kind in ("", "given") else f"{fault.kind} ({fault.name})"


def _component(
    fault: FaultSeries, channel: str, table: pd.DataFrame, spectra: Spectra
) -> _Component | None:
    """Return the lines of a fault among the columns of a channel; None if it has none there."""
    own = table[(table["channel"] == channel) & (table["unit"] == "dB")]
    names = [fault.name, *(f"{k}x{fault.name}" for k in range(2, HARMONICS + 1))]
    # Columns of FaultLines, and bands that have the name of the fault, need no orders.
    orders, lines = fault.orders, own[own["column"].astype(str).str.split("@").str[-1].isin(names)]
    if lines.empty:
        at = {order: _column_at(order, fault.slips, own) for order in fault.orders}
        orders = tuple(order for order, column in at.items() if column is not None)
        lines = own.loc[[at[order] for order in orders]]
    if lines.empty:
        return None
    above = lines["raised"] & (lines["deviation"] > 0)
    spectrum = spectra.get(channel.rpartition("__")[2])  # without the name in a FeatureUnion
    hit = above.mean() >= 0.5 and _above_background(fault, orders, spectrum)
    return _Component(fault, channel, orders, lines, bool(hit))


def _column_at(order: float, slips: bool, own: pd.DataFrame) -> Any:
    """Return the column of the largest deviation where a line may be; None if there is none."""
    reach = SLIP * order if slips else 0.0
    inside = own[(own["low"] <= order + reach) & (own["high"] >= order - reach)]
    if inside["deviation"].isna().all() or order > own["high"].max():
        return None
    return inside["deviation"].idxmax()


def _above_background(
    fault: FaultSeries, orders: Sequence[float], spectrum: Spectrum | None
) -> bool:
    """Return whether most lines are above the local background; True if that is not known.

    The median over the lines is compared, so that one line of another fault is not enough. Noise
    alone is 1 to 3 dB above the background within 0.5 orders, see FaultLines.
    """
    if spectrum is None:
        return True
    axis, power = spectrum
    fault = replace(fault, orders=tuple(order for order in orders if order < (1 - SLIP) * axis[-1]))
    try:
        lines = LineLevels(axis, [fault], SLIP, 0.5, without_shaft=True)
    except (ValueError, IndexError):  # too coarse, or no line inside
        return True
    _, _, (heights,) = lines.measure(power[np.newaxis].astype(np.float64))
    return bool(np.median(heights) >= 6.0)  # dB


def _other_rows(
    table: pd.DataFrame, hit: Sequence[_Component], with_parts: bool, *, leakage: float = 6.0
) -> list[Row]:
    """Return a row for each range of adjacent raised columns that no component predicts.

    Leakage of a line into the next column is lower by at least `leakage` [dB].
    """
    taken = {column for component in hit for column in component.lines.index}
    chosen = table[table["raised"] & ~table.index.isin(taken)]
    for line in table.loc[list(taken)].itertuples():
        beside = (chosen["low"] <= line.high) & (line.low <= chosen["high"])
        leaks = chosen["deviation"] <= line.deviation - leakage
        chosen = chosen[~(beside & leaks & (chosen["channel"] == line.channel))]
    chosen = chosen.sort_values(["channel", "low"], kind="stable")
    before = chosen.shift()
    joined = (
        (chosen["channel"] == before["channel"])
        & (chosen["low"] <= before["high"] + 1e-9)
        & (chosen["deviation"] * before["deviation"] > 0)
    )
    rows = []
    for _, part in chosen.groupby((~joined).cumsum()):
        peak = part.loc[part["deviation"].abs().idxmax()]
        low, high = part["low"].min(), part["high"].max()
        component, orders = "–", re.split("@|__|:", str(peak["column"]))[-1]
        if np.isfinite(low):
            component = "no known part" if with_parts else "–"
            orders = f"{low:g} to {high:g}" if high > low else f"{low:g}"
        size = decibels(peak["deviation"], peak["unit"])
        row = Row(component, channel_name(peak["channel"]) or "–", orders, size)
        rows.append((abs(peak["sigmas"]), row))
    return [row for _, row in sorted(rows, key=lambda pair: -pair[0])]


def _normal_channels(table: pd.DataFrame, reference: str, others: Sequence[str]) -> list[str]:
    """State how many columns of each channel, but of `others`, are as in the reference."""
    texts = []
    for channel, own in table[table["deviation"].notna()].groupby("channel", sort=False):
        name, normal = channel_name(str(channel)), int((~own["raised"]).sum())
        if normal and name and name not in others:
            count = f"all {normal}" if normal == len(own) else f"{normal} of {len(own)}"
            kind = "order bands" if own["low"].notna().all() else "features"
            texts.append(f"{count} {kind} of {name} as in {reference!r}")
    return texts
