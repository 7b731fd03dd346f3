"""Ranges of training recordings, and statements about recordings outside of them."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from numbers import Real
from typing import Any

import numpy as np

from emacm._statements import Statement
from emacm.recordings.inputs import described
from emacm.recordings.names import unit_ratio
from emacm.resampling.quality import Quality

Range = tuple[float, float]


@dataclass(frozen=True)
class RangeLimits:
    """Limits beyond a training range.

    They are conventions, not fitted to data; `outside_range` states them.

    Attributes
    ----------
    level, far_level : float
        dB of a level beyond the range: what is stated, and what is severe.
    factor : float
        Factor of a speed, length or valid order beyond the range.
    other_way, aside : float
        Fractions of the revolutions in another direction: what is stated, and what is noise.
    rate : float
        Relative difference of sampling rates, more than that of two clocks.
    conditions : tuple of str
        Keys of `meta` that are operating conditions, unlike numbers of units and of runs.
    listed : int
        Recordings that a warning lists.
    speed_units : tuple of (str, float)
        Units of a speed, and the speed in this unit over that in rad/s.
    """

    level: float = 3.0
    far_level: float = 20.0
    factor: float = 1.1
    other_way: float = 0.1
    aside: float = 0.01
    rate: float = 1e-3
    conditions: tuple[str, ...] = ("load", "speed", "torque", "temperature", "pressure")
    listed: int = 5
    speed_units: tuple[tuple[str, float], ...] = (
        ("rpm", 60 / (2 * np.pi)),
        ("degrees per second", 180 / np.pi),
        ("revolutions per second", 1 / (2 * np.pi)),
    )


LIMITS = RangeLimits()


def training_range(qualities: Sequence[Quality]) -> dict[str, Range]:
    """Return the smallest and the largest value of each property of training recordings.

    Parameters
    ----------
    qualities : sequence of Quality
        Of the training recordings.

    Returns
    -------
    dict of str to (float, float)
        "revolutions", "longest_stroke", "slowest", "fastest", "max_order" as the columns of
        `OrderResampler.quality`; "forward" (fraction of the revolutions); "fs of <channel>" [Hz]
        and "level of <channel>" (root mean square about the mean, in the unit of the channel).
    """
    names = ("revolutions", "longest_stroke", "slowest", "fastest", "max_order")
    values = {name: [q.row[name] for q in qualities] for name in names}
    values["forward"] = [q.forward for q in qualities]
    for channel in qualities[0].levels:
        values[f"fs of {channel}"] = [q.rates[channel] for q in qualities]
        values[f"level of {channel}"] = [q.levels[channel] for q in qualities]
    return {name: (float(min(column)), float(max(column))) for name, column in values.items()}


def training_units(qualities: Sequence[Quality]) -> dict[str, tuple[str, ...]]:
    """Return the units of each channel in training recordings, where they are stated."""
    stated = dict.fromkeys(pair for quality in qualities for pair in quality.units.items())
    return {name: tuple(u for other, u in stated if other == name) for name, _ in stated}


def training_conditions(metas: Iterable[Mapping[Any, Any]]) -> dict[str, tuple[float, ...]]:
    """Return the values of each operating condition that is a number in all `meta`, sorted.

    Examples
    --------
    >>> training_conditions([{"load": 40, "run": 1}, {"load": 20, "run": 2}])
    {'load': (20.0, 40.0)}
    """
    listed = list(metas)
    return {
        name: tuple(sorted({float(meta[name]) for meta in listed}))
        for name in LIMITS.conditions
        if all(isinstance(meta.get(name), Real) for meta in listed)
    }


def other_conditions(
    meta: Mapping[Any, Any], known: Mapping[str, Sequence[float]]
) -> Iterator[Statement]:
    """State the conditions that differ by more than 10 % from each of those in the training.

    Examples
    --------
    >>> [each.text for each in other_conditions({"load": 30}, {"load": (20.0, 40.0)})]
    ['load 30, in the training 20, 40']
    """
    for name, values in known.items():
        value = meta.get(name)
        near = LIMITS.factor - 1
        if isinstance(value, Real) and not np.isclose(float(value), values, near).any():
            listed = ", ".join(f"{v:.4g}" for v in values[: LIMITS.listed])
            more = f" to {values[-1]:.4g}" if len(values) > LIMITS.listed else ""
            text = f"{name} {value:.4g}, in the training {listed}{more}"
            yield Statement("condition", "", text, value=float(value))


def outside_range(
    quality: Quality, known: Mapping[str, Range], units: Mapping[str, Sequence[str]]
) -> list[Statement]:
    """State which properties of a recording are outside the training range.

    Levels are stated from 3 dB beyond the range, speeds from 10 %, shorter recordings and lower
    valid orders from 10 %, other sampling rates from 0.1 %, a direction of rotation that the
    training does not have from 10 % of the revolutions.

    Parameters
    ----------
    quality : Quality
        Of the recording.
    known : mapping of str to (float, float)
        Of `training_range`.
    units : mapping of str to sequence of str
        Of `training_units`.

    Returns
    -------
    list of Statement
    """
    return [
        *_units(quality.units, units),
        *([] if quality.has_jump else _speed(quality.row, known)),
        *direction_statements(quality.forward, known.get("forward")),  # None in older models
        *_rates(quality.rates, known),
        *_too_short(quality.row, known),
        *_levels(quality.levels, known),
    ]


def warn_of_statements(
    recordings: Sequence[Any], stated: Sequence[Sequence[str]], *, stacklevel: int, note: str = ""
) -> None:
    """Warn once of all recordings of which something is stated.

    Parameters
    ----------
    recordings : sequence
        The recordings that are to be judged, or rows of features, which have no meta.
    stated : sequence of sequence of str
        Sentences about each.
    stacklevel : int
        Of the caller.
    note : str
        Last line of the warning.
    """
    lines = [
        f"{described(recording, index)}: {'; '.join(texts)}"
        for index, (recording, texts) in enumerate(zip(recordings, stated, strict=True))
        if texts
    ]
    if lines:
        n_more = len(lines) - LIMITS.listed
        more = f"and {n_more} more recordings" if n_more > 0 else ""
        text = "\n".join(filter(None, [*lines[: LIMITS.listed], more, note]))
        warnings.warn(text, UserWarning, stacklevel=stacklevel + 1)


def _speed(row: Mapping[str, float], known: Mapping[str, Range]) -> list[Statement]:
    (low, high), fastest = known["fastest"], row["fastest"]
    if low / LIMITS.factor <= fastest <= high * LIMITS.factor:
        return []
    factor = fastest / high if fastest > high else fastest / low
    near = np.log(LIMITS.factor)
    units = [
        unit
        for unit, size in LIMITS.speed_units
        if factor > 0 and abs(np.log(factor / size)) < near
    ]
    hint = f": is it in {units[0]}?" if units else ""
    way = "above" if fastest > high else "below"
    text = f"highest speed {fastest:.4g} rad/s is {way} that of the training, {_span(low, high)}"
    limit = high if fastest > high else low
    # other speeds may be intended
    return [Statement("speed", "", f"{text} rad/s{hint}", bool(units), fastest, limit)]


def direction_statements(forward: float, known: Range | None) -> list[Statement]:
    """State that a recording turns in a direction in which no recording of the training turns.

    Parameters
    ----------
    forward : float
        Fraction of the revolutions that are forward; NaN without strokes.
    known : (float, float) or None
        Its range in the training.

    Returns
    -------
    list of Statement

    Examples
    --------
    >>> direction_statements(0.0, (1.0, 1.0))[0].text[:67]
    '100 % of the revolutions are in reverse, in the training only forwa'
    """
    if known is None:
        return []
    way, usual, new, share = "in reverse", "forward", 1 - forward, 1 - known[0]
    if known[1] <= LIMITS.aside:
        way, usual, new, share = "forward", "in reverse", forward, known[1]
    if share > LIMITS.aside or not new >= LIMITS.other_way:  # it may be NaN
        return []
    kept = usual.removeprefix("in ")
    text = (
        f"{100 * new:.0f} % of the revolutions are {way}, in the training only {usual}: check the "
        f"sign of the shaft reference, keep one direction by OrderResampler(direction={kept!r}), "
        f"or train on both directions"
    )
    return [Statement("direction", "", text, True, new)]


def _units(units: Mapping[str, str], known: Mapping[str, Sequence[str]]) -> Iterator[Statement]:
    """State the channels in another unit than in the training; those without a unit are as there.

    This is also stated where the level does not show it.
    """
    for channel, unit in units.items():
        usual = known.get(channel, ())
        ratios = [unit_ratio(unit, other) for other in usual]
        if not usual or 1.0 in ratios:
            continue
        remedy = "convert it" if ratios[0] is None else f"multiply it by {ratios[0]:.6g}"
        text = (
            f"channel {channel!r} is in {unit}, in the training in {' or '.join(usual)}: {remedy}, "
            f"or correct the unit, if it is {usual[0]}"
        )
        yield Statement("unit", channel, text, True)


def _rates(rates: Mapping[str, float], known: Mapping[str, Range]) -> list[Statement]:
    others: dict[tuple[float, float, float], list[str]] = {}
    for channel, rate in rates.items():
        low, high = known[f"fs of {channel}"]
        if not low * (1 - LIMITS.rate) <= rate <= high * (1 + LIMITS.rate):
            others.setdefault((rate, low, high), []).append(channel)
    return [
        Statement(
            "sampling rate",
            names[0] if len(names) == 1 else "",
            f"{_channels(names)}: sampling rate {rate:.6g} Hz, in the training "
            f"{_span(low, high)} Hz",
            value=rate,
            limit=high if rate > high else low,
        )
        for (rate, low, high), names in others.items()
    ]


def _too_short(row: Mapping[str, float], known: Mapping[str, Range]) -> list[Statement]:
    texts = {
        "revolutions": "{:.4g} revolutions, in the training at least {:.4g}",
        "longest_stroke": "longest stroke {:.4g} revolutions, in the training at least {:.4g}",
        "max_order": "highest valid order {:.4g}, in the training at least {:.4g}",
    }
    if row["strokes"] == 1:  # the stroke is the whole
        del texts["longest_stroke"]
    found = [(text, row[name], known[name][0]) for name, text in texts.items()]
    return [
        Statement("length", "", text.format(value, least), value=value, limit=least)
        for text, value, least in found
        if value < least / LIMITS.factor
    ]


def _levels(levels: Mapping[str, float], known: Mapping[str, Range]) -> list[Statement]:
    ranges = {channel: known[f"level of {channel}"] for channel in levels}
    beyond = {name: _decibels(levels[name], *ranges[name]) for name in levels}
    found = {name: value for name, value in beyond.items() if abs(value) >= LIMITS.level}
    severe = any(abs(value) >= LIMITS.far_level for value in found.values())
    for one, other in combinations(found, 2):
        crossed = _decibels(levels[one], *ranges[other]), _decibels(levels[other], *ranges[one])
        if max(map(abs, crossed)) < LIMITS.level:
            text = f"levels of {_channels((one, other))} as if exchanged: are they swapped?"
            return [Statement("channels", "", text, True)]
    gain = _common_gain(levels, ranges) if len(found) == len(levels) > 1 else None
    if gain is not None:
        text = f"all channels {in_decibels(gain)}: gain or unit?"
        return [Statement("level", "", text, severe, gain, LIMITS.level)]
    return [
        Statement(
            "level",
            name,
            f"channel {name!r} {in_decibels(value)}, {_span(*ranges[name])} (root mean square)",
            abs(value) >= LIMITS.far_level,
            value,
            LIMITS.level,
        )
        for name, value in found.items()
    ]


def _common_gain(levels: Mapping[str, float], ranges: Mapping[str, Range]) -> float | None:
    """Return a gain [dB] without which all levels are in their ranges; None if there is none."""
    level, (low, high) = np.array([*levels.values()]), np.array([*ranges.values()]).T
    if not (level.all() and low.all()):
        return None
    least, most = 20 * np.log10((level / high).max()), 20 * np.log10((level / low).min())
    return float((least + most) / 2) if least <= most + LIMITS.level else None


def in_decibels(value: float) -> str:
    """Return a deviation of a level in words.

    Examples
    --------
    >>> in_decibels(-6.02), in_decibels(-np.inf)
    ('6 dB below training', 'without signal, unlike training')
    """
    if np.isneginf(value):
        return "without signal, unlike training"
    return f"{abs(value):.0f} dB {'above' if value > 0 else 'below'} training"


def _decibels(level: float, low: float, high: float) -> float:
    """Return how far a level is beyond a range [dB], 0 within."""
    end = high if level > high else low
    if low <= level <= high:
        return 0.0
    if level == 0 or end == 0:
        return -np.inf if level == 0 else np.inf
    return 20 * (np.log10(level) - np.log10(end))


def _channels(names: Sequence[str]) -> str:
    listed = ", ".join(map(repr, names))
    return f"channel {listed}" if len(names) == 1 else f"channels {listed}"


def _span(low: float, high: float) -> str:
    """Return a range in words.

    Examples
    --------
    >>> _span(140.0, 160.04), _span(20.001, 20.002)
    ('140 to 160', '20')
    """
    first, last = f"{low:.4g}", f"{high:.4g}"
    return first if first == last else f"{first} to {last}"
