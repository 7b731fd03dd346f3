"""How a layout makes a recording of the columns of a file: channels, rates, shaft, start."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import scipy  # scipy.interpolate is imported when it is used
from numpy.typing import NDArray

from emacm._checks import check_signal, located
from emacm._statements import warn
from emacm.files.file_columns import (
    FileColumns,
    is_rate_name,
    missing_codes,
    no_channel,
    without_signal,
)
from emacm.files.layout import Layout, constant_speed
from emacm.files.sample_times import EvenTimes, dates_of, even_times, seconds_of, unit_that_fits
from emacm.files.shaft_references import (
    angle_columns,
    angle_form,
    scale_of,
    stated_angle_of,
)
from emacm.recordings.names import (
    is_time_name,
    split_unit,
    time_unit_in_name,
    unit_factor,
    unit_in_name,
    unit_ratio,
    unit_word,
)
from emacm.shaft.angle import angle_from_wrapped, is_wrapped
from emacm.shaft.tacho import stated_angle


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
    shafts = _shaft_columns(content, layout) if of_second is None else []
    channels = _channel_columns(content, layout, times, shafts)
    used = [*channels.items(), *((name, name) for name in shafts)]
    signals = {name: _signal(content, c, f"channel {name!r}") for name, c in channels.items()}
    rates = rates_of_columns(content, layout, times, used)
    _check_starts(content, rates)
    fs = {name: _known_rate(rates, column, name).rate for name, column in channels.items()}
    highest = max(fs.values())
    for shaft in shafts:
        if len(content.columns.get(shaft, ())) in map(len, signals.values()):
            rates.setdefault(shaft, EvenTimes(highest))
    units: dict[str, str] = {}
    for name, column in channels.items():
        scale = layout.scale
        if isinstance(scale, Mapping):
            scale = scale.get(name, scale.get(column))
        unit = layout.unit_of(name, column)
        if scale is None or isinstance(scale, str):
            unit = _agreed_unit(name, unit, content.units.get(column, ""))
            if unit and content.is_relative:
                text = f"channel {name!r}: full scale of this WAV file is taken as 1 {unit}, as the"
                warn("scale", f"{text} file states no other. State scale in the layout.")
        if scale is not None:
            factor, unit = scale_of(scale, unit, name)
            signals[name] = signals[name] * factor
        if unit:
            units[name] = unit
        signals[name] = rates[column].resampled(signals[name], name)
    arguments: dict[str, Any] = {"signals": signals, "fs": fs, "units": units}
    if of_second is None or second is None:
        arguments |= _shaft(content, layout, shafts, rates, highest)
    else:
        with located("the second file"):
            shafts = _shaft_columns(second, of_second)
            times_of_second = _time_column(second, of_second)
            own = rates_of_columns(second, of_second, times_of_second, [(c, c) for c in shafts])
            motion = _shaft(second, of_second, shafts, own, highest)
            delay = _delay((content, layout), (second, of_second))
            longest = max(len(values) / fs[name] for name, values in signals.items())
            arguments |= _aligned(motion, delay, longest)
    if layout.ratio != 1:
        kind = "angle" if "angle" in arguments else "velocity"
        arguments[kind] = arguments[kind] * layout.ratio
    if layout.fs is None and layout.time is not False:
        speed = float(np.max(np.abs(arguments.get("velocity", 0.0)))) / (2 * np.pi)
        for clock in {times, *channels.values()} & {times, *content.times} - {None}:
            _check_unit_of_times(content, layout, str(clock), speed)
    return arguments


def _stated_unit(content: FileColumns, layout: Layout, times: str) -> str:
    """Return the unit of a column of times that the layout, the file or its name states, or ""."""
    return layout.unit_of(times) or content.units.get(times, "") or time_unit_in_name(times)


def _stated_times(content: FileColumns, layout: Layout, clock: str) -> tuple[NDArray[Any], str]:
    """Return the times of a column of times, or of a column that has its own, and their unit."""
    if clock in content.times:
        return content.times[clock], layout.unit_of("time")
    return content.columns[clock], _stated_unit(content, layout, clock)


def _check_unit_of_times(
    content: FileColumns, layout: Layout, clock: str, speed: float = 0.0
) -> None:
    """Refuse times without a stated unit if their rate is not credible in s."""
    values, stated = _stated_times(content, layout, clock)
    name = "time" if clock in content.times else clock
    unit = "" if stated else unit_that_fits(values, speed)
    if unit:
        rate = (len(values) - 1) / float(values[-1] - values[0])
        raise ValueError(
            f"time column {name!r} gives a rate of {rate:.6g} Hz if it is in s, which is not "
            f"credible; in {unit} it is {rate / unit_factor(unit, 'time'):.6g} Hz. Are these "
            f"{unit_word(unit)}? State the unit in the layout, also if it is s: units = "
            f"{{{name} = {unit!r}}}."
        )


def _check_starts(content: FileColumns, rates: Mapping[str, EvenTimes]) -> None:
    """Refuse columns that start more than a sample apart."""
    starts = {content.starts[name]: name for name in rates if name in content.starts}
    apart = max(starts, default=0.0) - min(starts, default=0.0)
    if starts and apart > 1e-3 + 1 / min(rates[name].rate for name in starts.values()):
        raise ValueError(
            f"{starts[max(starts)]!r} starts {apart:.6g} s later than {starts[min(starts)]!r}. "
            f"Cut both to one start."
        )


def _aligned(motion: dict[str, Any], delay: float, duration: float) -> dict[str, Any]:
    """Return the shaft reference of a second file from the start of the first one to its end."""
    (kind, values), (_, rate) = motion.items()
    if np.ndim(values) == 0:
        return motion
    place = np.arange(max(2, round(duration * rate))) - round(delay * rate, 3)
    if place[0] < -1 or place[-1] > len(values):
        raise ValueError(
            f"its times, {delay:.6g} to {delay + len(values) / rate:.6g} s after the start of the "
            f"recording, do not cover its {duration:.6g} s. Cut it, or correct the times."
        )
    line = scipy.interpolate.make_interp_spline(np.arange(len(values)), values, k=1)
    return {kind: line(place), "shaft_fs": rate}


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
    return float(value[0]) * unit_factor(_stated_unit(content, layout, name) or "s", "time")


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
    elif name is not None and 9e8 < (time_of_sample(content, layout, 0) or 0) < 4e9:  # since 1970
        start = pd.Timestamp(time_of_sample(content, layout, 0), unit="s")
    if start is None or start.year == 1970:  # of a time of day, or of a clock that was not set
        return None
    return start if start.tzinfo is None else start.tz_convert(None)


def _check_units(content: FileColumns, layout: Layout, second: FileColumns | None) -> None:
    """Refuse unit or scale of a name that occurs nowhere: mistyped, it would not be applied."""
    scale = layout.scale if isinstance(layout.scale, Mapping) else {}
    named = replace(layout, units=None, scale=None).key
    for name in (*layout.units, *scale):
        is_named = re.search(rf"(?<!\w){re.escape(name)}(?!\w)", named)
        may_lack = name in ("velocity", "speed", "angle") or is_time_name(name)
        is_known = content.has(name) or (second is not None and second.has(name))
        if not (is_named or may_lack or is_known):
            option = "units" if name in layout.units else "scale"
            raise ValueError(
                f"{option} names {name!r}, which is no column or channel; the columns are "
                f"{list(content.columns)}. Correct the name, or leave it out."
            )


def _time_column(content: FileColumns, layout: Layout) -> str | None:
    if layout.time:
        return content.find(layout.time)
    named = [] if layout.time is False else [*filter(is_time_name, content.columns)]
    if len(named) > 1:
        raise ValueError(f"it has several columns of times: {named}. Set time to one of them.")
    return named[0] if named else None


def _shaft_columns(content: FileColumns, layout: Layout) -> list[str]:
    """Return the columns (or the number) of the shaft; none for a constant speed."""
    velocity = layout.velocity
    if isinstance(velocity, str) and (
        content.has(velocity) or not constant_speed(content.chosen(velocity))
    ):
        return [content.find(velocity, numbers=True)]
    if velocity is not None:
        return []
    columns = [*angle_columns(layout.angle), *filter(None, [layout.tacho_column])]
    if columns:
        return [content.find(column) for column in columns]
    example = next(iter(content.like_shaft()), "speed")
    unit = unit_in_name(example) or "rpm"
    raise ValueError(
        f"the layout names no shaft reference. Set velocity = '{example} [{unit}]', or a "
        f"constant speed such as '1500 rpm', or angle, or tacho; its columns are "
        f"{list(content.columns)}."
    )


def _channel_columns(
    content: FileColumns, layout: Layout, times: str | None, shafts: Sequence[str]
) -> dict[str, str]:
    """Return the column of each channel; currents and vibrations that show the shaft are some."""
    chosen = layout.channels
    if isinstance(chosen, Mapping):
        return {name: content.find(column) for name, column in chosen.items()}
    if chosen is not None:
        return {split_unit(name.partition("|")[0])[0]: content.find(name) for name in chosen}
    are_channels = angle_form(layout.angle) in ("currents", "vibration")
    ignored = {times} if are_channels else {times, *shafts}  # nor is another clock a channel
    ignored |= {name for name in content.columns if is_time_name(re.split(r"[/.]", name)[-1])}
    rest = [name for name in content.columns if name not in ignored]
    motions = [name for name in content.like_shaft() if name in rest]
    if motions:
        raise ValueError(
            f"column {motions[0]!r} is named like the motion of the shaft. Name it in velocity, "
            f"angle or tacho, or set channels = {[n for n in rest if n not in motions]}."
        )
    reasons = {name: no_channel(name, content.columns[name]) for name in rest}
    others = {name: reason for name, reason in reasons.items() if reason}
    rest = [name for name in rest if name not in others]
    if not rest:
        raise ValueError(f"it has no channel besides {sorted({*others, *filter(None, ignored)})}.")
    for name, reason in others.items():
        text = f"column {name!r} {reason}, and is left out. Set channels to choose the columns"
        warn("columns", f"{text}; samples that a status marks as invalid are used.", channel=name)
    return {name: name for name in rest}


def rates_of_columns(
    content: FileColumns, layout: Layout, times: str | None, names: Iterable[tuple[str, str]]
) -> dict[str, EvenTimes]:
    """Return sampling rates by column, from layout, file, column of times, or own times.

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
    names : iterable of (str, str)
        Name for the layout, and column. Other columns are not judged.

    Returns
    -------
    dict of str to EvenTimes
        Without the columns of which nothing states a rate.

    Raises
    ------
    ValueError
        If the times are not even, or two rates contradict each other.

    Examples
    --------
    >>> content = FileColumns({"b": [0.0, 1.0]}, numbers={"fs": 25.0})
    >>> rates_of_columns(content, Layout(), None, [("b", "b")])
    {'b': EvenTimes(rate=25.0, uneven=None)}
    """
    of_groups, own = _stated_rates(content)
    found: dict[str, EvenTimes] = {}
    shared: dict[float | None, EvenTimes] = {}
    for name, column in names:
        if column not in content.columns:
            continue
        stated = _rate_of_layout(content, layout, name, column)
        known = own.get(column)
        if known is None and not (stated and isinstance(layout.fs, Mapping)):
            known = of_groups.get(column)
        if stated and known and abs(known / stated - 1) > 1e-6:
            raise ValueError(
                f"the layout states fs = {stated:g} Hz for {name!r}, but the file {known:.9g} Hz. "
                f"Correct fs, or leave it out."
            )
        rate = stated or known
        if column in content.times and layout.time is not False:
            found[column] = _rate_of_times(content, layout, column, rate)
        elif times and len(content.columns[column]) == len(content.columns[times]):
            if rate not in shared:
                shared[rate] = _rate_of_times(content, layout, times, rate)
            found[column] = shared[rate]
        elif rate:
            found[column] = EvenTimes(rate)
    return found


def _rate_of_layout(content: FileColumns, layout: Layout, name: str, column: str) -> float | None:
    """Return the rate that a layout states for a channel or column, if it states one."""
    stated = layout.fs
    if isinstance(stated, Mapping):
        by_name = {split_unit(key)[0]: rate for key, rate in stated.items()}
        stated = by_name.get(name, by_name.get(column))
    if isinstance(stated, str):
        number = content.find(stated, numbers=True)
        if number not in content.numbers:
            raise ValueError(f"fs = {stated!r} is not a single number of the file.")
        stated = content.numbers[number]
    return None if stated is None else float(stated)


def _rate_of_times(content: FileColumns, layout: Layout, clock: str, fs: float | None) -> EvenTimes:
    """Return the rate of a column of times, or of a column that has its own."""
    if clock in content.defects and clock not in content.times:
        raise ValueError(f"time column {clock!r} {content.defects[clock]}.")
    values, stated = _stated_times(content, layout, clock)
    seconds, resolution = seconds_of(values, stated or "s", clock)
    if fs is None:
        _check_unit_of_times(content, layout, clock)
    return even_times(seconds, resolution, clock, fs, resample=layout.resample)


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
        if is_rate_name(last):
            lengths = {c: len(v) for c, v in content.columns.items() if c.startswith(group)}
            longest = max(lengths.values(), default=0)
            of_groups |= {column: rate for column, n in lengths.items() if n + 1 >= longest}
        for column in content.columns:
            rests = name.removesuffix(f"_{column}"), name.removeprefix(f"{column}_")
            if any(rest != name and is_rate_name(rest) for rest in rests):
                own[column] = rate
    return of_groups, own | content.rates


def _known_rate(rates: Mapping[str, EvenTimes], column: str, name: str) -> EvenTimes:
    """Return the rate of a column."""
    if column not in rates:
        raise ValueError(
            f"the sampling rate of {name!r} is not known: neither the file nor the layout "
            f"states it. Set fs, or time to a column of times; fs may be a rate for each column."
        )
    return rates[column]


def _signal(
    content: FileColumns, column: str, name: str, *, is_tacho: bool = False
) -> NDArray[np.floating]:
    """Return a column that is finite, and without codes for missing values or other defects."""
    if column in content.defects:
        raise ValueError(
            f"{column!r} {content.defects[column]}. Repair the file, or set channels to others of "
            f"{list(content.columns)}."
        )
    values = check_signal(content.columns[column], name)
    is_code = missing_codes(values)
    if is_code.any() and not is_tacho:
        place = int(np.argmax(is_code))
        raise ValueError(
            f"{name} has {is_code.sum()} values of {values[place]:g}, first at sample {place}, far "
            "from all others: a code for missing values. Cut before it, or repair the gap."
        )
    return values


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
    columns: Sequence[str],
    rates: Mapping[str, EvenTimes],
    fs: float,
) -> dict[str, Any]:
    """Return the motion of the measured shaft, and its rate [Hz]; `fs` of a constant speed."""
    if not columns:
        speed, unit = layout.velocity, layout.unit_of("velocity", "speed") or "rad/s"
        if isinstance(speed, str):
            speed, unit = constant_speed(content.chosen(speed)) or (0.0, "")
        return {"velocity": float(speed) * unit_factor(unit, "velocity"), "shaft_fs": fs}
    kind, column = "angle" if layout.angle is not None else "velocity", columns[0]
    form = dict(layout.angle) if isinstance(layout.angle, Mapping) else {}
    if len(columns) > 1 or {"lead", "vibration"} & form.keys():
        evens = [_known_rate(rates, name, name) for name in columns]
        if len({one.rate for one in evens}) > 1:
            raise ValueError(f"{list(columns)} of the angle have several rates; name some of one.")
        signals = [_signal(content, name, f"the shaft column {name!r}") for name in columns]
        sampled = [one.resampled(signal) for one, signal in zip(evens, signals, strict=True)]
        angle, content.statements = stated_angle_of(form, sampled, evens[0].rate)
        return {"angle": angle, "shaft_fs": evens[0].rate}
    values: Any = content.numbers.get(column)
    even = EvenTimes(fs)
    if values is None:
        is_tacho = layout.tacho is not None  # whose pulses may be of full scale
        values = _signal(content, column, f"the shaft column {column!r}", is_tacho=is_tacho)
        even = _known_rate(rates, column, column)
    if layout.tacho is not None:
        options = dict(layout.tacho) if isinstance(layout.tacho, Mapping) else {}
        options.pop("column", None)
        if "pulses" in options:
            options["pulses_per_rev"] = options.pop("pulses")
        found = stated_angle(even.resampled(values), even.rate, **options)
        content.statements = found.statements
        return {"angle": found.angle, "shaft_fs": even.rate}
    factor = unit_factor(_shaft_unit(content, layout, column, kind), kind)
    values = values if factor == 1 else values * factor
    if form.get("wrapped") or (kind == "angle" and is_wrapped(values)):
        values = angle_from_wrapped(values)
    return {kind: even.resampled(values), "shaft_fs": even.rate}


def _shaft_unit(content: FileColumns, layout: Layout, column: str, kind: str) -> str:
    """Return the unit of the shaft column; rad or rad/s if nothing suggests another."""
    wanted = layout.velocity if kind == "velocity" else angle_columns(layout.angle)[0]
    form = layout.angle if isinstance(layout.angle, Mapping) else {}
    stated = (
        form.get("unit")
        or layout.unit_of(column, kind)
        or split_unit(content.chosen(str(wanted)))[1]
    )
    unit = _agreed_unit(column, stated.lower(), content.units.get(column, "").lower())
    default = "rad/s" if kind == "velocity" else "rad"
    if not unit and re.search(r"rpm|hz|deg|rev|turn|rps|count|min", column.lower()):
        usual = unit_in_name(column) or "rpm" if kind == "velocity" else "deg"
        raise ValueError(
            f"the unit of {column!r} is not stated, and its name suggests another one than "
            f"{default}. State it in the layout, under [units]: {column!r} = '{usual}'."
        )
    return unit or default
