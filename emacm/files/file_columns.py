"""The columns of a file, and how a layout makes a recording of them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm._checks import check_signal, located
from emacm._statements import Statement
from emacm.files.layout import Layout, constant_speed
from emacm.files.sample_times import dates_of, rate_of_times, seconds_of, time_unit
from emacm.recordings.names import (
    is_shaft_name,
    is_time_name,
    split_unit,
    unit_factor,
    unit_in_name,
    unit_ratio,
)
from emacm.shaft.angle import angle_from_wrapped, is_wrapped
from emacm.shaft.tacho import stated_angle

_RATES = {"fs", "sfreq", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency"}
_RATES |= {"abtastrate"}


class RefusedFileError(ValueError):
    """A file that is read correctly, but holds nothing that can be used."""


@dataclass
class FileColumns:
    """What a file contains.

    Attributes
    ----------
    columns : dict of str to ndarray of shape (n_times,)
        Arrays by name.
    rates : dict of str to float
        Sampling rates that the file states [Hz], by column.
    units : dict of str to str
        Units that the file states, by column.
    numbers : dict of str to float
        Single numbers by name.
    ignored : dict of str to str
        What is in the file but no column, with the reason.
    start : Timestamp or None
        When the recording started, if the file states it other than by a column of times.
    starts : dict of str to float
        When columns start, where the file states it, from any common instant [s].
    statements : tuple of Statement
        What is known about the shaft, once a recording was made: repairs of a tachometer.
    """

    columns: dict[str, NDArray[Any]] = field(default_factory=dict)
    rates: dict[str, float] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)
    ignored: dict[str, str] = field(default_factory=dict)
    start: pd.Timestamp | None = None
    starts: dict[str, float] = field(default_factory=dict)
    statements: tuple[Statement, ...] = ()

    def take_units_from_names(self) -> None:
        """Take the units out of the names of columns, as in "speed [rpm]"."""
        parts = {name: split_unit(name) for name in (*self.columns, *self.numbers)}
        plain = {name: short for name, (short, _) in parts.items()}
        if len(set(plain.values())) < len(plain):
            return
        self.units = {short: unit for short, unit in parts.values() if unit} | self.units
        for kind in ("columns", "rates", "units", "numbers", "starts"):
            values = getattr(self, kind).items()
            setattr(self, kind, {plain.get(name, name): value for name, value in values})

    def take_units_from_groups(self) -> None:
        """Give the unit of a group or structure to the only array that it holds."""
        names = [*self.columns, *self.numbers]
        for place in self.units.keys() - set(names):
            group = re.escape(re.sub(r"[/.]$", "", place))
            within = [name for name in names if re.match(rf"{group}[/.]", name)]
            if len(within) == 1:
                self.units.setdefault(within[0], self.units[place])

    def like_shaft(self) -> list[str]:
        """Return the columns and numbers with name or unit of the motion of a shaft."""
        names = (*self.columns, *self.numbers)
        shafts = [name for name in names if is_shaft_name(name, self.units.get(name, ""))]
        return [name for name in shafts if not any(map(_is_rate, name.split("_")))]  # as fs_rpm

    def find(self, wanted: str, *, numbers: bool = False) -> str:
        """Return the full name of a column (or of a number) that a layout names.

        Raises
        ------
        ValueError
            If there is none, or several match.
        """
        known = [*self.columns, *(self.numbers if numbers else ())]
        wanted = self.chosen(wanted)
        found = _matching(wanted, known)
        if len(found) == 1:
            return found[0]
        if found:
            raise ValueError(f"{wanted!r} matches several columns: {found}. Name one.")
        plain = split_unit(wanted)[0]
        if plain in self.ignored:
            raise ValueError(
                f"{plain!r} {self.ignored[plain]}; store it as numbers, one for each time."
            )
        other = next((name for name in known if not is_time_name(name)), wanted)
        raise ValueError(
            f"it has no column {wanted!r}; its columns are {known}. Where files differ, a "
            f"layout may give several names: {f'{wanted}|{other}'!r}."
        )

    def has(self, wanted: str) -> bool:
        """Tell whether a name of a layout is that of one column or number."""
        return len(_matching(wanted, [*self.columns, *self.numbers])) == 1

    def chosen(self, wanted: str) -> str:
        """Return the first of alternative names that the file has, or that is a constant speed.

        Examples
        --------
        >>> FileColumns({"x0": [0.0, 1.0]}).chosen("vibration|x0")
        'x0'
        """
        names = (wanted, *map(str.strip, wanted.split("|")))
        return next((name for name in names if self.has(name) or constant_speed(name)), wanted)


def _matching(wanted: str, known: Sequence[str]) -> list[str]:
    """Return the names that a name of a layout means, which may have wildcards and a unit."""
    plain = split_unit(wanted)[0]
    exact = [name for name in (wanted, plain) if name in known]
    found = exact[:1] or [name for name in known if fnmatchcase(name, plain)]
    return found or [name for name in known if re.split(r"[/.]", name)[-1] == plain]


def recording_arguments(
    content: FileColumns, layout: Layout, second: FileColumns | None = None
) -> dict[str, Any]:
    """Return the arguments of the recording that a layout makes of the columns of a file.

    Parameters
    ----------
    content : FileColumns
        What the file contains.
    layout : Layout
        What is channel, time and shaft.
    second : FileColumns, optional
        What the second file contains, if the layout names one for the shaft.

    Returns
    -------
    dict of str to object
        As for `Recording`, without `meta`.

    Raises
    ------
    TypeError, ValueError
        If a column is missing or contradicts the layout, or something is not known: a rate, the
        shaft, a unit. The message states the remedy.
    """
    if not content.columns:
        raise ValueError(without_signal(content))
    _check_units(content, layout, second)
    times = _time_column(content, layout)
    of_second = layout.of_second_file()
    shaft = _shaft_column(content, layout) if of_second is None else None
    channels = _channel_columns(content, layout, times, shaft)
    rates = rates_of_columns(content, layout, times)
    _check_starts(content, [*channels.values(), *filter(None, [shaft])], rates)
    fs = {
        name: _column_rate(content, layout, rates, column, name)
        for name, column in channels.items()
    }
    columns = content.columns
    signals = {name: check_signal(columns[c], f"channel {name!r}") for name, c in channels.items()}
    units = {
        name: _agreed_unit(name, layout.unit_of(name, column), content.units.get(column, ""))
        for name, column in channels.items()
    }
    arguments = {
        "signals": signals,
        "fs": fs,
        "units": {name: unit for name, unit in units.items() if unit},
    }
    highest = max(fs.values())
    if of_second is None or second is None:
        n_times = {len(values) for values in signals.values()}
        return arguments | _shaft(content, layout, shaft, rates, highest, n_times)
    with located("the second file"):
        shaft = _shaft_column(second, of_second)
        rates = rates_of_columns(second, of_second, _time_column(second, of_second))
        motion = _shaft(second, of_second, shaft, rates, highest, set())
        delay = _delay((content, layout), (second, of_second))
        longest = max(len(values) / fs[name] for name, values in signals.items())
        return arguments | _aligned(motion, delay, longest)


def _check_starts(content: FileColumns, names: Sequence[str], rates: Mapping[str, float]) -> None:
    """Refuse columns that start more than a sample apart."""
    starts = {name: content.starts[name] for name in names if name in content.starts}
    if not starts:
        return
    latest, earliest = max(starts, key=starts.__getitem__), min(starts, key=starts.__getitem__)
    apart = starts[latest] - starts[earliest]
    if apart > 1e-3 + 1 / min(rates.get(name, 1000.0) for name in starts):
        raise ValueError(
            f"{latest!r} starts {apart:.6g} s later than {earliest!r}. Cut both to one start."
        )


def _aligned(motion: dict[str, Any], delay: float, duration: float) -> dict[str, Any]:
    """Return the shaft reference of a second file from the start of the first one to its end."""
    (kind, values), (_, rate) = motion.items()
    if np.ndim(values) == 0:
        return motion
    if kind == "angle" and is_wrapped(values):
        values = angle_from_wrapped(values)
    place = np.arange(max(2, round(duration * rate))) - round(delay * rate, 3)
    if place[0] < -1 or place[-1] > len(values):
        raise ValueError(
            f"its times, {delay:.6g} to {delay + len(values) / rate:.6g} s after the start of the "
            f"recording, do not cover its {duration:.6g} s. Cut it, or correct the times."
        )
    before = np.clip(np.floor(place).astype(int), 0, len(values) - 2)
    step = values[before + 1] - values[before]
    return {kind: values[before] + (place - before) * step, "shaft_fs": rate}


def time_of_sample(content: FileColumns, layout: Layout, number: int) -> float | None:
    """Return the time of a sample by the column of times, if there is one [s].

    That of dates is since 1970, in UTC where they state no time zone.
    """
    name = _time_column(content, layout)
    if name is None:
        return None
    value = content.columns[name][number : number + 1]
    if value.dtype.kind not in "iuf":
        return dates_of(value, name).iloc[0].timestamp()
    unit = time_unit(name, layout.unit_of(name) or content.units.get(name, ""))
    return float(value[0]) * unit_factor(unit, "time")


def _delay(first: tuple[FileColumns, Layout], second: tuple[FileColumns, Layout]) -> float:
    """Return by how much the second file starts later [s]; 0 if one of them states no times."""
    dates = start_of(*first), start_of(*second)
    if dates[0] is not None and dates[1] is not None:
        return (dates[1] - dates[0]).total_seconds()
    clocks = time_of_sample(*first, 0), time_of_sample(*second, 0)
    if clocks[0] is None or clocks[1] is None:
        return 0.0
    if dates != (None, None) and clocks[0 if dates[0] is None else 1]:
        raise ValueError(
            "its times cannot be compared with those of the first file: one of them are dates, the "
            "others do not begin at 0. State time = false for it if both files start together."
        )
    return clocks[1] - clocks[0] if dates == (None, None) else 0.0


def start_of(content: FileColumns, layout: Layout) -> pd.Timestamp | None:
    """Return when a recording started, as its dates or its file state it; None if they do not.

    In UTC if a time zone is stated. Times of day without a date are not known.
    """
    name = _time_column(content, layout)
    start = None if layout.time is False else content.start
    if name is not None and content.columns[name].dtype.kind not in "iuf":
        start = dates_of(content.columns[name][:1], name).iloc[0]
    if start is None or start.year == 1970:  # of a time of day, or of a clock that was not set
        return None
    return start if start.tzinfo is None else start.tz_convert(None)


def _check_units(content: FileColumns, layout: Layout, second: FileColumns | None) -> None:
    """Refuse the unit of a name that occurs nowhere: mistyped, it would not be applied."""
    parts = [layout.fs, layout.time, layout.channels, layout.velocity, layout.angle, layout.tacho]
    for name in layout.units:
        is_named = re.search(rf"(?<!\w){re.escape(name)}(?!\w)", str(parts))
        may_lack = name in ("velocity", "speed", "angle") or is_time_name(name)
        is_known = content.has(name) or (second is not None and second.has(name))
        if not (is_named or may_lack or is_known):
            raise ValueError(
                f"units names {name!r}, which is no column or channel; the columns are "
                f"{list(content.columns)}. Correct the name, or leave it out."
            )


def without_signal(content: FileColumns) -> str:
    """Say what a file without any column contains."""
    rest = f"only {list(content.numbers)}" if content.numbers else "no array of numbers"
    reasons = [f"{name!r} {reason}" for name, reason in list(content.ignored.items())[:3]]
    return f"it contains no signal, {'; '.join([rest, *reasons])}. Store an array for each channel."


def _time_column(content: FileColumns, layout: Layout) -> str | None:
    if layout.time:
        return content.find(layout.time)
    named = [] if layout.time is False else [*filter(is_time_name, content.columns)]
    if len(named) > 1:
        raise ValueError(f"it has several columns of times: {named}. Set time to one of them.")
    return named[0] if named else None


def _shaft_column(content: FileColumns, layout: Layout) -> str | None:
    """Return the column (or the number) of the shaft; None for a constant speed."""
    velocity = layout.velocity
    if isinstance(velocity, str) and (
        content.has(velocity) or not constant_speed(content.chosen(velocity))
    ):
        return content.find(velocity, numbers=True)
    if velocity is not None:
        return None
    column = layout.angle or layout.tacho_column
    if column:
        return content.find(column)
    similar = content.like_shaft()
    hint = f"; {similar[0]!r} looks like one" if similar else ""
    example = similar[0] if similar else "speed"
    unit = unit_in_name(example) or "rpm"
    raise ValueError(
        f"the layout names no shaft reference{hint}. Set velocity = '{example} [{unit}]', or a "
        f"number [rad/s], or angle, or tacho; its columns are {list(content.columns)}."
    )


def _channel_columns(
    content: FileColumns, layout: Layout, times: str | None, shaft: str | None
) -> dict[str, str]:
    """Return the column of each channel."""
    chosen = layout.channels
    if isinstance(chosen, Mapping):
        return {name: content.find(column) for name, column in chosen.items()}
    if chosen is not None:
        return {split_unit(name.partition("|")[0])[0]: content.find(name) for name in chosen}
    ignored = {times, shaft}
    if layout.time is False:
        ignored |= {name for name in content.columns if is_time_name(name)}
    rest = [name for name in content.columns if name not in ignored]
    motions = [name for name in content.like_shaft() if name in rest]
    if motions:
        raise ValueError(
            f"column {motions[0]!r} is named like the motion of the shaft. Name it in velocity, "
            f"angle or tacho, or set channels = {[n for n in rest if n not in motions]}."
        )
    if not rest:
        raise ValueError(f"it has no channel besides {sorted(filter(None, ignored))}.")
    return {name: name for name in rest}


def rates_of_columns(content: FileColumns, layout: Layout, times: str | None) -> dict[str, float]:
    """Return sampling rates by column [Hz], from the file and its column of times.

    The rate of a single column comes first, then that of its group, then that of the times. Where
    a layout states rates of single columns, that of a group is only their default.

    Parameters
    ----------
    content : FileColumns
        What the file contains.
    layout : Layout
        What it states of rates, times and units.
    times : str or None
        Column of times.

    Returns
    -------
    dict of str to float

    Raises
    ------
    ValueError
        If the times are not even.

    Examples
    --------
    >>> rates_of_columns(FileColumns({"b": [0.0, 1.0]}, numbers={"fs": 25.0}), Layout(), None)
    {'b': 25.0}
    """
    of_groups, own = _stated_rates(content)
    stated = own if isinstance(layout.fs, Mapping) else of_groups | own
    if times is None:
        return stated
    values = content.columns[times]
    unit = layout.unit_of(times) or content.units.get(times, "")
    fs = layout.fs if isinstance(layout.fs, float | int) else stated.get(times)
    rate = rate_of_times(seconds_of(values, unit, times), times, fs)
    same = [name for name, other in content.columns.items() if len(other) == len(values)]
    return dict.fromkeys(same, rate) | stated


def _stated_rates(content: FileColumns) -> tuple[dict[str, float], dict[str, float]]:
    """Return the rates that a file states for groups of columns, and for single ones [Hz].

    A number named fs (or samplerate and the like) holds for the columns of its group, but not for
    those that are shorter than the longest one: these have another rate. A number named fs_rpm or
    rpm_fs holds for the column rpm. If the file states a unit of it, this must be Hz or kHz.
    """
    of_groups: dict[str, float] = {}
    own: dict[str, float] = {}
    for name, number in content.numbers.items():
        rate = number * {"": 1, "hz": 1, "khz": 1000}.get(content.units.get(name, "").lower(), 0)
        if not rate > 0:
            continue
        last = re.split(r"[/.]", name)[-1]
        group = name.removesuffix(last)
        if _is_rate(last):
            lengths = {c: len(v) for c, v in content.columns.items() if c.startswith(group)}
            longest = max(lengths.values(), default=0)
            of_groups |= {column: rate for column, n in lengths.items() if n + 1 >= longest}
        for column in content.columns:
            rests = name.removesuffix(f"_{column}"), name.removeprefix(f"{column}_")
            if any(rest != name and _is_rate(rest) for rest in rests):
                own[column] = rate
    return of_groups, own | content.rates


def _is_rate(name: str) -> bool:
    return re.sub("[^a-z]", "", name.lower()) in _RATES


def _column_rate(
    content: FileColumns,
    layout: Layout,
    rates: Mapping[str, float],
    column: str,
    name: str,
    default: float | None = None,
) -> float:
    """Return the rate of a column [Hz], which layout and file may both state."""
    known, stated = rates.get(column), layout.fs
    if isinstance(stated, Mapping):
        by_name = {split_unit(key)[0]: rate for key, rate in stated.items()}
        stated = by_name.get(name, by_name.get(column))
        default = _stated_rates(content)[0].get(column, default)
    if isinstance(stated, str):
        number = content.find(stated, numbers=True)
        if number not in content.numbers:
            raise ValueError(f"fs = {stated!r} is not a single number of the file.")
        stated = content.numbers[number]
    if stated and known and abs(known / stated - 1) > 1e-6:
        raise ValueError(
            f"the layout states fs = {stated:g} Hz for {name!r}, but the file {known:.9g} Hz. "
            f"Correct fs, or leave it out."
        )
    rate = stated or known or default
    if rate is None:
        raise ValueError(
            f"the sampling rate of {name!r} is not known: neither the file nor the layout "
            f"states it. Set fs, or time to a column of times; fs may be a rate for each column."
        )
    return float(rate)


def _agreed_unit(name: str, stated: str, known: str) -> str:
    """Return the unit that the layout states, else that of the file."""
    if stated and known and unit_ratio(stated, known) != 1:
        raise ValueError(
            f"the layout states the unit {stated!r} for {name!r}, but the file {known!r}. Correct "
            f"units; nothing is converted."
        )
    return stated or known


def _shaft(
    content: FileColumns,
    layout: Layout,
    column: str | None,
    rates: Mapping[str, float],
    fs: float,
    n_times: Set[int],
) -> dict[str, Any]:
    """Return the shaft reference in rad or rad/s, and its rate [Hz].

    Of a column that is as long as a channel (`n_times`), it is `fs` if nothing states another.
    """
    if column is None:
        speed, unit = layout.velocity, layout.unit_of("velocity", "speed") or "rad/s"
        if isinstance(speed, str):
            speed, unit = constant_speed(content.chosen(speed)) or (0.0, "")
        return {"velocity": float(speed) * unit_factor(unit, "velocity"), "shaft_fs": fs}
    kind = "angle" if layout.angle is not None else "velocity"
    values: Any = content.numbers.get(column)
    rate = fs
    if values is None:
        values = check_signal(content.columns[column], f"the shaft column {column!r}")
        default = fs if len(values) in n_times else None
        rate = _column_rate(content, layout, rates, column, column, default)
    if layout.tacho is not None:
        options = dict(layout.tacho) if isinstance(layout.tacho, Mapping) else {}
        options.pop("column", None)
        found = stated_angle(values, rate, **options)
        content.statements = found.statements
        return {"angle": found.angle, "shaft_fs": rate}
    factor = unit_factor(_shaft_unit(content, layout, column, kind), kind)
    return {kind: values if factor == 1 else values * factor, "shaft_fs": rate}


def _shaft_unit(content: FileColumns, layout: Layout, column: str, kind: str) -> str:
    """Return the unit of the shaft column; rad or rad/s if nothing suggests another."""
    wanted = layout.velocity if kind == "velocity" else layout.angle
    stated = layout.unit_of(column, kind) or split_unit(content.chosen(str(wanted)))[1]
    unit = _agreed_unit(column, stated.lower(), content.units.get(column, "").lower())
    default = "rad/s" if kind == "velocity" else "rad"
    if not unit and re.search(r"rpm|hz|deg|rev|turn|rps|count|min", column.lower()):
        usual = unit_in_name(column) or "rpm" if kind == "velocity" else "deg"
        raise ValueError(
            f"the unit of {column!r} is not stated, and its name suggests another one than "
            f"{default}. State it in the layout, under [units]: {column!r} = '{usual}'."
        )
    return unit or default
