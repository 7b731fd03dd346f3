"""Range of the recordings of a training, and statements about recordings outside of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from numbers import Real
from typing import Any

import numpy as np

from emacm._statements import Statement
from emacm.findings.quality import Quality
from emacm.recordings.names import unit_ratio

Range = tuple[float, float]

# Keys of `meta` that are operating conditions, unlike numbers of units and of runs.
CONDITIONS = ("load", "speed", "torque", "temperature", "pressure")
# Keys that identify the machine or the sensor.
UNITS = ("unit", "machine", "asset", "sensor", "device", "microphone")
_NEAR = 1.1  # factor by which speeds, lengths, orders and conditions may differ: a convention
_LEVEL = 3.0  # dB beyond the range from which a level is stated: a convention


@dataclass(frozen=True)
class TrainingRange:
    """What the recordings of a training have in common.

    Attributes
    ----------
    ranges : dict of str to (float, float)
        Smallest and largest value of "revolutions", "longest_stroke", "slowest", "fastest" and
        "max_order" as the columns of `OrderResampler.quality`; "forward" (fraction of the
        revolutions); "fs of <channel>" [Hz] and "level of <channel>" (root mean square about the
        mean, in the unit of the channel).
    units : dict of str to tuple of str
        Units of each channel, where they are stated.
    conditions : dict of str to tuple of float
        Values of load, speed, torque, temperature and pressure, of those that all `meta` have.
    defects : tuple of str
        Kinds of the defects that occur in the training: these are usual.
    machines : dict of str to tuple of str
        Values of "unit", "machine", "asset", "sensor", "device" and "microphone", as texts.
    """

    ranges: dict[str, Range]
    units: dict[str, tuple[str, ...]]
    conditions: dict[str, tuple[float, ...]]
    defects: tuple[str, ...]
    machines: dict[str, tuple[str, ...]] = field(default_factory=dict)

    @classmethod
    def of(cls, qualities: Sequence[Quality], metas: Iterable[Mapping[Any, Any]]) -> TrainingRange:
        """Return that of recordings, of which quality and `meta` are given."""
        names = ("revolutions", "longest_stroke", "slowest", "fastest", "max_order")
        values = {name: [q.row[name] for q in qualities] for name in names}
        values["forward"] = [q.forward for q in qualities]
        for channel in qualities[0].levels:
            values[f"fs of {channel}"] = [q.rates[channel] for q in qualities]
            values[f"level of {channel}"] = [q.levels[channel] for q in qualities]
        ranges = {name: (float(min(column)), float(max(column))) for name, column in values.items()}
        stated = dict.fromkeys(pair for quality in qualities for pair in quality.units.items())
        units = {name: tuple(u for other, u in stated if other == name) for name, _ in stated}
        kinds = {defect.kind for quality in qualities for defect in quality.defects}
        metas = list(metas)
        named = {key: {str(meta[key]) for meta in metas if key in meta} for key in UNITS}
        machines = {key: tuple(sorted(names)) for key, names in named.items() if names}
        conditions = {
            name: tuple(sorted({float(meta[name]) for meta in metas}))
            for name in CONDITIONS
            if all(isinstance(meta.get(name), Real) for meta in metas)
        }
        return cls(ranges, units, conditions, tuple(sorted(kinds)), machines)

    def joined(self, other: TrainingRange) -> TrainingRange:
        """Return the range of the recordings of both."""

        def values(name: str) -> Any:
            own, more = getattr(self, name), getattr(other, name)
            return {key: tuple(sorted({*own[key], *more.get(key, ())})) for key in own}

        ranges = {name: (ends[0], ends[-1]) for name, ends in values("ranges").items()}
        defects = tuple(sorted({*self.defects, *other.defects}))
        units, conditions = values("units"), values("conditions")
        return TrainingRange(ranges, units, conditions, defects, values("machines"))

    def outside(self, quality: Quality, meta: Mapping[Any, Any]) -> list[Statement]:
        """State which properties of a recording are outside the range.

        Levels are stated from 3 dB beyond the range, speeds from 10 %, shorter recordings and lower
        valid orders from 10 %, other sampling rates from 0.1 %, a direction of rotation that the
        training does not have from 10 % of the revolutions, a condition that differs by more than
        10 % from each of the training; a unit or sensor that is not in a training of fewer than
        four, of which it is not known how they differ.

        Parameters
        ----------
        quality : Quality
            Of the recording.
        meta : mapping
            Of the recording.

        Returns
        -------
        list of Statement
        """
        return [
            *_new_units(meta, self.machines),
            *_other_conditions(meta, self.conditions),
            *_units(quality.units, self.units),
            *([] if quality.has_jump else _speed(quality.row, self.ranges)),
            *direction_statements(quality.forward, self.ranges["forward"]),
            *_rates(quality.rates, self.ranges),
            *_too_short(quality.row, self.ranges),
            *_levels(quality.levels, self.ranges),
        ]

    def unusual(self, quality: Quality) -> list[Statement]:
        """Return the defects of a recording of kinds that the training does not have."""
        return [defect for defect in quality.defects if defect.kind not in self.defects]


def _new_units(meta: Mapping[Any, Any], known: Mapping[str, Sequence[str]]) -> Iterator[Statement]:
    """State that a unit or sensor was not in the training, if few were."""
    least = 4  # so many show how they differ: a convention
    for key, names in known.items():
        if key in meta and str(meta[key]) not in names and len(names) < least:
            text = (
                f"{key} {str(meta[key])!r} was not in the training, which has "
                f"{', '.join(map(repr, names))}: give healthy recordings of this {key} "
                f"(add_baseline, emacm score --healthy), or treat its decisions with caution"
            )
            yield Statement("new unit", "", text, value=float(len(names)), limit=float(least))


def _other_conditions(
    meta: Mapping[Any, Any], known: Mapping[str, Sequence[float]]
) -> Iterator[Statement]:
    """State the conditions that differ by more than 10 % from each of those in the training."""
    for name, values in known.items():
        value = meta.get(name)
        if isinstance(value, Real) and not np.isclose(float(value), values, _NEAR - 1).any():
            listed = ", ".join(f"{v:.4g}" for v in values[:5])
            more = f" to {values[-1]:.4g}" if len(values) > 5 else ""
            text = f"{name} {value:.4g}, in the training {listed}{more}"
            yield Statement("condition", "", text, value=float(value))


def _speed(row: Mapping[str, float], known: Mapping[str, Range]) -> list[Statement]:
    (low, high), fastest = known["fastest"], row["fastest"]
    if low / _NEAR <= fastest <= high * _NEAR:
        return []
    limit = high if fastest > high else low
    units = {  # and the speed in this unit over that in rad/s
        "rpm": 60 / (2 * np.pi),
        "degrees per second": 180 / np.pi,
        "revolutions per second": 1 / (2 * np.pi),
    }
    likely = [
        unit
        for unit, size in units.items()
        if fastest > 0 and abs(np.log(fastest / limit / size)) < np.log(_NEAR)
    ]
    hint = f": is it in {likely[0]}?" if likely else ""
    way = "above" if fastest > high else "below"
    rpm = units["rpm"]
    text = f"highest speed {rpm * fastest:.4g} rpm is {way} that of the training"
    text = f"{text}, {_span(rpm * low, rpm * high)} rpm{hint}"
    return [Statement("speed", "", text, bool(likely), fastest, limit)]  # may be intended


def direction_statements(forward: float, known: Range) -> list[Statement]:
    """State that a recording turns in a direction in which no recording of the training turns.

    Parameters
    ----------
    forward : float
        Fraction of the revolutions that are forward; NaN without strokes.
    known : (float, float)
        Its range in the training.

    Returns
    -------
    list of Statement

    Examples
    --------
    >>> direction_statements(0.0, (1.0, 1.0))[0].text[:67]
    '100 % of the revolutions are in reverse, in the training only forwa'
    """
    noise, least = 0.01, 0.1  # fractions of the revolutions: what is noise, and what is stated
    way, usual, new, share = "in reverse", "forward", 1 - forward, 1 - known[0]
    if known[1] <= noise:
        way, usual, new, share = "forward", "in reverse", forward, known[1]
    if share > noise or not new >= least:  # it may be NaN
        return []
    kept = usual.removeprefix("in ")
    text = (
        f"{100 * new:.0f} % of the revolutions are {way}, in the training only {usual}: check the "
        f"sign of the shaft reference, set direction={kept!r} of OrderResampler, or train on both"
    )
    return [Statement("direction", "", text, True, new, least)]


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
    clocks = 1e-3  # relative difference, more than that of two clocks
    others: dict[tuple[float, float, float], list[str]] = {}
    for channel, rate in rates.items():
        low, high = known[f"fs of {channel}"]
        if not low * (1 - clocks) <= rate <= high * (1 + clocks):
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
        if value < least / _NEAR
    ]


def _levels(levels: Mapping[str, float], known: Mapping[str, Range]) -> list[Statement]:
    ranges = {channel: known[f"level of {channel}"] for channel in levels}
    beyond = {name: _decibels(levels[name], *ranges[name]) for name in levels}
    found = {name: value for name, value in beyond.items() if abs(value) >= _LEVEL}
    far = 20.0  # dB beyond the range, where a decision should not be relied on
    severe = any(abs(value) >= far for value in found.values())
    for one, other in combinations(found, 2):
        crossed = _decibels(levels[one], *ranges[other]), _decibels(levels[other], *ranges[one])
        if max(map(abs, crossed)) < _LEVEL:
            text = f"levels of {_channels((one, other))} as if exchanged: are they swapped?"
            return [Statement("channels", "", text, True)]
    gain = _common_gain(levels, ranges) if len(found) == len(levels) > 1 else None
    if gain is not None:
        text = f"all channels {in_decibels(gain)}: gain or unit?"
        return [Statement("level", "", text, severe, gain, _LEVEL)]
    return [
        Statement(
            "level",
            name,
            f"channel {name!r} {in_decibels(value)}, {_span(*ranges[name])} (root mean square)",
            abs(value) >= far,
            value,
            _LEVEL,
        )
        for name, value in found.items()
    ]


def _common_gain(levels: Mapping[str, float], ranges: Mapping[str, Range]) -> float | None:
    """Return a gain [dB] without which all levels are in their ranges; None if there is none."""
    level, (low, high) = np.array([*levels.values()]), np.array([*ranges.values()]).T
    if not (level.all() and low.all()):
        return None
    least, most = 20 * np.log10((level / high).max()), 20 * np.log10((level / low).min())
    return float((least + most) / 2) if least <= most + _LEVEL else None


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
