"""Drafts of layouts: what a file contains, and what a layout of such files must state."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm._checks import first_non_number
from emacm.files.column_roles import rates_of_columns
from emacm.files.file_columns import FileColumns, no_channel, without_signal
from emacm.files.layout import Layout, meta_from_name
from emacm.files.readers import read_columns
from emacm.files.sample_times import EvenTimes, dates_of, unit_that_fits
from emacm.recordings.names import (
    is_time_name,
    printable,
    time_unit_in_name,
    unit_factor,
    unit_in_name,
    unit_ratio,
    unit_word,
)


@dataclass
class FileContents:
    """What was found in a file.

    Attributes
    ----------
    columns : FileColumns
        Its columns.
    rates : dict of str to float
        Sampling rates that the file states, or its column of times [Hz].
    times, shaft : str or None
        Columns that are named like times and like the motion of the shaft, or is a tachometer.
    unused : dict of str to str
        Columns that are neither times, shaft nor channels, and why.
    remarks : list of str
        What must be stated in a layout, besides the shaft.
    time_unit : str
        Unit of the times, if it was found by their rate.
    n_pulses : int
        Number of whole pulses in the shaft column, if it was found by these.
    """

    columns: FileColumns
    rates: dict[str, float]
    times: str | None
    shaft: str | None
    unused: dict[str, str]
    remarks: list[str]
    time_unit: str = ""
    n_pulses: int = 0

    @property
    def kind(self) -> str:
        """What the shaft column is by its name, or its pulses: velocity, angle, tacho, position."""
        if self.shaft in self.positions:
            return "position"
        words, angles = (self.shaft or "").lower(), ("angle", "theta", "encoder", "winkel")
        if self.n_pulses or "tach" in words or "keyphasor" in words:
            return "tacho"
        return "angle" if any(word in words for word in angles) else "velocity"

    @property
    def positions(self) -> list[str]:
        """Columns that are named like the position of a nut, or have a unit of length."""
        words = ("position", "weg", "hub", "stroke", "extension")
        units = self.columns.units
        return [
            name
            for name in self.numbers
            if name.lower() in words
            or (name.lower().startswith(("pos", "weg")) and unit_ratio(units.get(name, ""), "mm"))
        ]

    @property
    def groups(self) -> list[str]:
        """Angles as TOML that several columns may give: phase currents, or a resolver."""
        known = {re.sub(r"[^a-z0-9]", "", name.lower()): name for name in self.numbers}
        phases = [[first + each for each in "abc"] for first in ("i", "current")]
        phases += [["iu", "iv", "iw"], ["i1", "i2", "i3"]]
        found = [[known[each] for each in names] for names in phases if {*names} <= known.keys()]
        lines = [f"{{currents = {json.dumps(names)}, pole_pairs = 1}}" for names in found]
        return lines + [f"{{resolver = {json.dumps(names)}}}" for names in [self.resolver] if names]

    @property
    def resolver(self) -> list[str]:
        """Columns that are named like sine and cosine."""
        named = {name.lower(): name for name in self.numbers}
        return [named["sin"], named["cos"]] if {"sin", "cos"} <= named.keys() else []

    @property
    def shaft_unit(self) -> str:
        """Unit of the shaft column, from the file or from its name; "" if it is not known."""
        for unit in (self.columns.units.get(self.shaft or "", ""), unit_in_name(self.shaft or "")):
            with suppress(KeyError, ValueError):  # a tachometer, or another unit
                unit_factor(unit, "angle" if self.kind == "position" else self.kind)
                return unit
        return ""

    @property
    def of_shaft(self) -> str:
        """What must be stated of the shaft; "" if nothing."""
        if self.kind == "tacho":
            counted = f" has {self.n_pulses} pulses" if self.n_pulses else ""
            return f"pulses_per_rev of tacho: {self.shaft!r}{counted}"
        if self.kind == "position":
            return f"lead of angle: {self.shaft!r} looks like the position of the nut of a screw"
        if self.shaft is None:
            return "velocity, angle or tacho: no column is named like the motion of the shaft"
        return "" if self.shaft_unit else f"the unit of {self.shaft!r}"

    @property
    def open(self) -> list[str]:
        """All that must be stated."""
        return [*filter(None, (self.of_shaft, *self.remarks))]

    @property
    def channels(self) -> list[str]:
        """The other columns."""
        others = {self.times, self.shaft, *self.unused}
        return [name for name in self.columns.columns if name not in others]

    @property
    def missing_rates(self) -> dict[str, float]:
        """Proposed rates of the columns without one, for which all columns last equally long."""
        columns = self.columns.columns.items()
        used = {*self.channels, self.shaft}
        lengths = {name: len(values) for name, values in columns if name in used}
        known = [n / self.rates[name] for name, n in lengths.items() if name in self.rates]
        duration = known[0] if known else max(lengths.values(), default=0) / 12_000
        missing = {name: n for name, n in lengths.items() if name not in self.rates}
        return {name: float(f"{n / duration:.6g}") for name, n in missing.items()}

    @property
    def numbers(self) -> dict[str, NDArray[Any]]:
        """The columns of numbers."""
        columns = self.columns.columns
        return {name: values for name, values in columns.items() if values.dtype.kind in "biuf"}


def contents_of(path: Path) -> FileContents:
    """Read a file, and find out which of its columns are times and shaft.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    FileContents

    Raises
    ------
    FileNotFoundError, ImportError, ValueError
        As `emacm.files.readers.read_columns`; also if there is no signal.
    """
    columns = read_columns(path)
    if not columns.columns:
        raise ValueError(without_signal(columns))
    times = _time_column(columns)
    remarks: list[str] = []
    time_unit = ""
    clock = times or "time"  # of columns with times of their own
    if not (columns.units.get(clock) or time_unit_in_name(clock)):
        clocks = [columns.columns[times]] if times else [*columns.times.values()]
        time_unit = next(filter(None, map(unit_that_fits, clocks)), "")
    if time_unit:
        remarks.append(f"the unit of {clock!r}: these look like {unit_word(time_unit)}, not s")
    layout = Layout(units={clock: time_unit} if time_unit else None)
    rates: dict[str, EvenTimes] = {}
    for name in columns.columns:
        try:
            rates |= rates_of_columns(columns, layout, times, [(name, name)])
        except ValueError as error:
            if name in columns.times:
                columns.defects[name] = f"cannot be used: {error}"
            elif str(error) not in remarks:
                remarks.append(str(error))
    shafts = columns.like_shaft()
    by_name = {name: even.rate for name, even in rates.items()}
    shaft = next(iter(shafts), None)
    contents = FileContents(columns, by_name, times, shaft, {}, remarks, time_unit)
    if shaft is None or contents.kind == "tacho":
        asked = contents.numbers if shaft is None else {shaft} & contents.numbers.keys()
        pulses = {name: count_pulses(contents.numbers[name]) for name in asked if name != times}
        found = shaft or next(filter(pulses.get, pulses), None)
        contents.shaft = found or next(iter(contents.positions), None)
        contents.n_pulses = pulses.get(found or "", 0)
    for name in (name for name in columns.columns if name not in (*contents.numbers, times)):
        first = first_non_number(columns.columns[name], columns.columns[name])
        contents.unused[name] = f"it does not consist of numbers, got {first}"
    contents.unused |= {name: f"it {defect}" for name, defect in columns.defects.items()}
    reasons = {n: no_channel(n, v) for n, v in contents.numbers.items() if n not in (times, shaft)}
    contents.unused |= {name: f"it {reason}" for name, reason in reasons.items() if reason}
    contents.unused |= dict.fromkeys(contents.resolver, "it is named like an output of a resolver")
    contents.unused |= dict.fromkeys(shafts[1:], "it is named like the motion of a shaft")
    if contents.missing_rates:
        names = ", ".join(contents.missing_rates)
        remarks.append(f"fs of {names}: neither the file nor a column of times states it")
    return contents


def _time_column(columns: FileColumns) -> str | None:
    """Return the column of times by its name, else that of dates, or that rises in s."""
    for name in columns.columns:
        if is_time_name(name):
            return name
    for name, values in columns.columns.items():
        if values.dtype.kind not in "biufc":
            with suppress(ValueError):
                dates = dates_of(values[[0, -1]], name)
                if 0 < (dates.iloc[1] - dates.iloc[0]).total_seconds() < 10 * len(values):
                    return name
        elif len(values) > 99 and (np.diff(values) > 0).all():
            with suppress(ValueError):
                unit_factor(columns.units.get(name, ""), "time")
                return name
    return None


def count_pulses(values: NDArray[Any]) -> int:
    """Return the number of pulses of a column that looks like a tachometer; 0 if it does not.

    Parameters
    ----------
    values : ndarray of shape (n_times,)
        The column.

    Returns
    -------
    int
        Pulses of two levels: of what is above 30 % of their difference, most is above 70 %, unlike
        in impulses that decay; and less is between these than 5 % of all. There are at least
        eight, and from one to the next the interval changes by at most 20 % (median).

    Examples
    --------
    >>> count_pulses(np.arange(1000) % 50 < 5), count_pulses(np.sin(np.arange(1000) / 8))
    (19, 0)
    """
    x = np.asarray(values, np.float64)
    lowest, span = x.min(), np.ptp(x)
    if not span > 0 or not np.isfinite(span):
        return 0
    x = (x - lowest) / span
    high, between = float(np.mean(x > 0.7)), float(np.mean((x > 0.3) & (x <= 0.7)))
    starts = np.flatnonzero(np.diff((x > 0.5).astype(int)) > 0)
    if between > min(0.05, high / 2, (1 - high) / 2) or len(starts) < 8:
        return 0
    intervals = np.diff(starts)
    change = np.median(np.abs(np.diff(intervals)) / intervals[1:])
    return len(starts) if change <= 0.2 else 0


def contents_table(contents: FileContents) -> pd.DataFrame:
    """Return a row for each column: unit, rate, samples, duration and range.

    Parameters
    ----------
    contents : FileContents
        What was found.

    Returns
    -------
    DataFrame
        Columns "as" (time, shaft, channel or not used), "unit", "rate [Hz]", "samples",
        "duration [s]", "lowest", "mean", "highest" and "not finite" (number of samples).
    """
    rows = {}
    roles = {contents.times: "time", contents.shaft: "shaft"}
    roles |= dict.fromkeys(contents.unused, "not used")
    for name, values in contents.columns.columns.items():
        rate = contents.rates.get(name, np.nan)
        rows[name] = {
            "as": roles.get(name, "channel"),
            "unit": contents.columns.units.get(name, ""),
            "rate [Hz]": rate,
            "samples": len(values),
            "duration [s]": len(values) / rate,
        }
        if name in contents.numbers:
            good = pd.Series(values[np.isfinite(values)])
            rows[name] |= {"lowest": good.min(), "mean": good.mean(), "highest": good.max()}
            rows[name]["not finite"] = len(values) - len(good)
    return pd.DataFrame.from_dict(rows, orient="index")


def files_table(paths: Sequence[Path]) -> pd.DataFrame:
    """Return a row for each file: channels, rates, duration, shaft, and what is not known.

    Returns
    -------
    DataFrame
        Columns "file", "channels", "rate [Hz]", "duration [s]" (empty if it cannot be read),
        "shaft" and "to be stated" (or why it cannot be read).
    """
    rows = []
    for path in paths:
        row: dict[str, Any] = {"file": printable(path)}
        try:
            contents = contents_of(path)
            durations = contents_table(contents)["duration [s]"]
            row["channels"], row["shaft"] = ", ".join(contents.channels), contents.shaft
            row["rate [Hz]"] = _rates(contents)
            row["duration [s]"] = f"{durations.max():.6g}"
            row["to be stated"] = "; ".join(contents.open)
        except (ImportError, OSError, TypeError, ValueError) as error:
            row["to be stated"] = f"cannot be read: {error}"
        rows.append(row)
    columns = ["file", "channels", "rate [Hz]", "duration [s]", "shaft", "to be stated"]
    return pd.DataFrame(rows, columns=columns).fillna("")


def draft_layout(contents: FileContents, path: Path, meta: str | None = None) -> str:
    """Return a layout as TOML; what the file does not state is a comment to be filled in.

    Parameters
    ----------
    contents : FileContents
        What was found in the file.
    path : Path
        The file.
    meta : str, optional
        Pattern of the names of the files.

    Returns
    -------
    str

    Raises
    ------
    ValueError
        If the name of the file does not match `meta`.
    """
    lines = [
        f"# Layout of files like {printable(path.name)}; see emacm.Layout for all options.",
        '# "FILL IN": the file does not state it. Correct the line, and remove its first #.',
    ]
    if contents.times is not None:
        lines.append(f"time = {_as_toml(contents.times)}")
    if contents.rates:
        lines.append(f"# fs: {_rates(contents)} Hz, found in the file")
    if missing := contents.missing_rates:
        by_name = ", ".join(f"{_as_toml(name)} = {rate:.9g}" for name, rate in missing.items())
        is_one = not contents.rates and len(set(missing.values())) == 1
        rates = f"{max(missing.values()):.9g}" if is_one else f"{{{by_name}}}"
        lines.append(f"# fs = {rates}  # FILL IN: sampling rate [Hz]")
    lines.append(f"channels = [{', '.join(map(_as_toml, contents.channels))}]")
    lines += [f"# {_as_toml(name)} is not used: {why}" for name, why in contents.unused.items()]
    if contents.columns.is_relative:
        lines.append("# scale = 1.0  # FILL IN: full scale, in the unit of the channels")
    shaft = _as_toml(contents.shaft or "")
    unit = contents.columns.units.get(contents.shaft or "", "") or "its unit"
    forms = {
        "position": f"# angle = {{column = {shaft}, lead = 5.0}}  # FILL IN: lead, the travel per "
        f"revolution [{unit}]",
        "tacho": f"# tacho = {{column = {shaft}, pulses_per_rev = 1}}  # FILL IN: pulses of a "
        f"revolution; the column has {contents.n_pulses}",
    }
    if contents.shaft is not None:
        lines.append(forms.get(contents.kind, f"{contents.kind} = {shaft}"))
    else:
        lines += [
            '# velocity = "1797 rpm"  # FILL IN: a constant speed, or a column, or one of a file',
            '# velocity = {file = "{stem}_speed.csv", column = "rpm"}  # or a file beside it',
        ]
        lines += [
            f"# angle = {{vibration = {_as_toml(name)}, speeds = [20, 30]}}  # or without "
            f"a sensor of the shaft: limits in rev/s"
            for name in contents.channels[:1]
        ]
    if contents.shaft is None or contents.kind == "position":
        lines += [f"# angle = {form}  # or by these columns" for form in contents.groups]
    fields = "_".join(f"{{field{n}}}" for n in range(1, path.stem.count("_") + 2))
    if meta is None:
        lines.append(f"# meta = {_as_toml(fields)}  # FILL IN: what parts of the file names mean")
    else:
        if not meta_from_name(path, meta):
            raise ValueError(f"its name does not match the pattern {meta!r} of meta. Correct it.")
        lines.append(f"meta = {_as_toml(meta)}")
    return "\n".join([*lines, "", "[units]", *_units(contents)]) + "\n"


def _units(contents: FileContents) -> Iterator[str]:
    """Yield the lines of a draft with the units of shaft and channels."""
    stated, shaft = contents.columns.units, contents.shaft
    if contents.time_unit:
        line = f"# {_as_toml(contents.times or 'time')} = {_as_toml(contents.time_unit)}"
        yield f"{line}  # FILL IN: its unit; it looks like this, not s"
    if shaft is not None and contents.shaft_unit:
        yield f"{_as_toml(shaft)} = {_as_toml(contents.shaft_unit)}"
    elif shaft is not None and contents.kind in ("velocity", "angle"):
        usual = "rpm" if contents.kind == "velocity" else "rad"
        others = "" if contents.kind == "velocity" else ", as deg, or rev/4096 of counts"
        yield f"# {_as_toml(shaft)} = {_as_toml(usual)}  # FILL IN: its unit{others}"
    for name in contents.channels:
        if stated.get(name):
            yield f"{_as_toml(name)} = {_as_toml(stated[name])}"
        else:
            yield f'# {_as_toml(name)} = "g"  # FILL IN: its unit, for labels of figures'


def _as_toml(value: str) -> str:
    """Return a text as TOML."""
    return json.dumps(value, ensure_ascii=False)


def _rates(contents: FileContents) -> str:
    return ", ".join(f"{rate:.9g}" for rate in sorted(set(contents.rates.values())))
