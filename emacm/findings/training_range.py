"""What the recordings of a training have in common, and statements about others outside of it.

Ranges of properties (`TrainingRange`), and spectral lines (`KnownLines`). A line is compared by its
height over the local background, which depends neither on load, speed, gain nor state.
``benchmarks/unknown.py`` chose the numbers for lines, on simulated units.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import ndimage

from emacm._statements import Statement
from emacm.findings.quality import Quality
from emacm.recordings.names import unit_ratio

Array = NDArray[np.float64]
Range = tuple[float, float]
Spectra = NDArray[np.floating]  # shape (n_recordings, n_columns), in U² per order
Axis = tuple[str, NDArray[np.floating], slice]  # channel, its orders, its columns

# Keys of `meta` that are operating conditions, unlike numbers of units and of runs.
CONDITIONS = ("load", "speed", "torque", "temperature", "pressure")
# Keys that identify the machine or the sensor.
UNITS = ("unit", "machine", "asset", "sensor", "device", "microphone")
_NEAR = 1.1  # factor by which speeds, lengths, orders and conditions may differ: a convention
_LEVEL = 3.0  # dB beyond the range from which a level is stated: a convention
# dB above the maximum of the training, which a recording with less noise may also have.
_LEAST_EXCESS = 4.0
_FLOOR = 1e-12  # of the largest line of a channel, below which lines are rounding errors
_PRIOR = 5  # groups that the spread which is common to the lines of a channel counts as
_LEAST_SPREAD = 0.8  # dB: about the scatter of heights in spectra of thirty segments


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


@dataclass(frozen=True)
class KnownLines:
    """The lines of a training, and the excess over them that two groups in a hundred have.

    The excess of a group is that of its largest line over the maximum of all other groups at the
    same order, in standard deviations of the maxima of those groups at that order. Orders at which
    units differ, such as those of faults and of strong lines, thus have higher limits than the
    background. As groups are few, the variance is averaged with the median of the channel, which
    counts as five groups. Excesses above their median are treated as exponential (peaks over
    a threshold [1]_) with a mean that is known from so many values only, so that the predictive
    distribution of the next one is that of Lomax [2]_: with fewer groups the limit is higher.

    Attributes
    ----------
    maxima : ndarray of shape (n_columns,)
        Largest height over the local background at each order [dB], at least -20; inf where lines
        are not compared: outside of the bins, and in channels without power or with negative
        values, which are no power spectra.
    limits : ndarray of shape (n_columns,)
        Excess over it from which a line is new [dB], at least 4; inf with fewer than five groups.
    largest : ndarray of shape (n_channels,)
        Largest line of each channel, in the unit of the spectra.

    References
    ----------
    .. [1] Pickands, Statistical inference using extreme order statistics, Annals of Statistics
       3 (1975).
    .. [2] Geisser, Predictive Inference (1993), section 3.1.
    """

    maxima: Array
    limits: Array
    largest: Array

    @classmethod
    def of(
        cls, psd: Spectra, axes: Sequence[Axis], compared: NDArray[np.bool_], groups: Any
    ) -> KnownLines:
        """Learn the lines of spectra.

        Parameters
        ----------
        psd : ndarray of shape (n_recordings, n_columns)
            Power spectral densities of the training.
        axes : sequence of (str, ndarray, slice)
            Channels with their orders and columns.
        compared : ndarray of shape (n_columns,)
            Whether a column is within the bins.
        groups : ndarray of int, shape (n_recordings,), or None
            Numbers of recordings that were measured together. None: single recordings.
        """
        largest = np.array([psd[:, columns].max() for *_, columns in axes], dtype=np.float64)
        maxima, limits = np.full((2, psd.shape[1]), np.inf)
        excess: Any = -np.inf
        for _, orders, columns in axes:
            spectra, used = psd[:, columns], compared[columns]
            if not used.any() or spectra.max() <= 0 or spectra.min() < 0:
                continue
            highest = _heights(spectra, orders)
            if groups is not None:
                highest = pd.DataFrame(highest).groupby(groups).max().to_numpy()
            maxima[columns] = np.where(used, highest.max(axis=0), np.inf)
            if len(highest) >= 5:
                spread, left_out = _left_out(highest)
                limits[columns] = np.where(used, spread, np.inf)
                excess = np.maximum(excess, left_out[:, used].max(axis=1))
        if np.ndim(excess):
            learned = np.isfinite(limits)
            limits[learned] = np.maximum(_limit(excess) * limits[learned], _LEAST_EXCESS)
        return cls(maxima, limits, largest)

    def new_lines(self, psd: Spectra, axes: Sequence[Axis]) -> list[list[Statement]]:
        """State at which orders recordings have lines that the training does not have.

        Parameters
        ----------
        psd : ndarray of shape (n_recordings, n_columns)
            Power spectral densities.
        axes : sequence of (str, ndarray, slice)
            As for `of`.

        Returns
        -------
        list of list of Statement
            Of each recording, the line that is farthest above the maximum first; of more than five,
            the number is stated.
        """
        found: list[list[Statement]] = [[] for _ in psd]
        for axis, largest in zip(axes, self.largest, strict=True):
            columns = axis[2]
            maxima, limits = self.maxima[columns], self.limits[columns]
            if np.isinf(limits).all():
                continue
            heights = _heights(psd[:, columns], axis[1])
            # What is not above the background is no line; a dead channel has only rounding errors.
            is_alive = psd[:, columns].max(axis=1, keepdims=True) > _FLOOR * largest
            above = (heights > np.maximum(maxima + limits, _LEAST_EXCESS)) & is_alive
            for row in np.flatnonzero(above.any(axis=1)):
                found[row] += _of_channel(axis, heights[row], maxima, limits, above[row])
        stated = []
        for lines in found:
            ranked = sorted(lines, key=lambda line: -(line.value or 0.0))
            if len(ranked) > 5:
                text = f"and at {len(ranked) - 5} more orders"
                ranked[5:] = [Statement("new line", "", text)]
            stated.append(ranked)
        return stated


def _heights(psd: Spectra, orders: NDArray[np.floating]) -> Array:
    """Return the height of each line of a channel over its background [dB], at least -20.

    The background is the lower quartile, which is the floor between dense lines, of half an order
    and at least eight lines on either side; wider structures fill bins, which show them. Valleys
    between lines, and order 0 without the mean, are deeper than -20 dB.
    """
    step = (orders[-1] - orders[0]) / max(len(orders) - 1, 1)
    side = max(round(0.5 / step), 8) if step > 0 else 8
    floor = np.maximum(_FLOOR * psd.max(axis=1, keepdims=True), 0.0)
    return np.maximum(line_heights(np.maximum(psd, floor), 2 * side + 1, 0.25), -20.0)


def _left_out(highest: Array) -> tuple[Array, Array]:
    """Return the spread in each column, and the excess of each group over the others, in spreads.

    Parameters
    ----------
    highest : ndarray of shape (n_groups, n_columns)
        Maxima of groups [dB].

    Returns
    -------
    spread : ndarray of shape (n_columns,)
        In dB.
    excess : ndarray of shape (n_groups, n_columns)
        In spreads of the other groups.
    """
    n_groups, n_columns = highest.shape
    squares = (highest - highest.mean(axis=0)) ** 2
    total = squares.sum(axis=0)
    common = _PRIOR * float(np.median(total)) / (n_groups - 1)
    # The sum of squares about the mean of the others, without each group.
    others = np.maximum(total - squares * (n_groups / (n_groups - 1)), 0.0)
    columns, top = np.arange(n_columns), highest.argmax(axis=0)
    second = np.partition(highest, -2, axis=0)[-2]
    excess = highest - highest.max(axis=0)
    excess[top, columns] = highest[top, columns] - second
    spreads_of_others = np.sqrt((others + common) / (n_groups - 2 + _PRIOR))
    excess /= np.maximum(spreads_of_others, _LEAST_SPREAD)
    spread = np.sqrt((total + common) / (n_groups - 1 + _PRIOR))
    return np.maximum(spread, _LEAST_SPREAD), excess


def _limit(excess: Array) -> float:
    """Return the excess that two groups in a hundred have, from those of left-out groups.

    Examples
    --------
    >>> round(_limit(np.array([0.0, 0.0, 0.0, 1.0, 2.0, 2.0])), 2)
    7.23
    """
    level = 0.02
    median = float(np.median(excess))
    peaks = excess[excess > median] - median
    if not len(peaks):
        return max(median, 0.0)
    tail = len(peaks) * peaks.mean() * ((2 * level) ** (-1 / len(peaks)) - 1)
    return max(median + float(tail), 0.0)


def _of_channel(
    axis: Axis, heights: Array, maxima: Array, limits: Array, above: NDArray[np.bool_]
) -> list[Statement]:
    """Return a statement for each range of adjacent orders above the limit."""
    channel, orders, _ = axis
    edges = np.flatnonzero(np.diff(np.concatenate([[False], above, [False]])))
    found = []
    for start, stop in edges.reshape(-1, 2):
        peak = start + int(heights[start:stop].argmax())
        where, up_to = f"line at order {orders[peak]:.4g}", ""
        # With a Hann window a line fills four adjacent orders, down to 10 dB below its peak.
        if np.count_nonzero(heights[start:stop] > heights[peak] - 10) > 4:
            where = f"orders {orders[start]:.4g} to {orders[stop - 1]:.4g}"
            up_to = "up to "
        excess = float(heights[peak] - maxima[peak])
        text = (
            f"{where} of {channel!r}, {up_to}{heights[peak]:.0f} dB above the background and "
            f"{excess:.0f} dB above the training maximum"
        )
        found.append(Statement("new line", channel, text, value=excess, limit=float(limits[peak])))
    return found


def line_heights(psd: Spectra, width: int, quantile: float = 0.5) -> Array:
    """Return each spectral line over the median of the lines around it, or another quantile.

    The height of a line does not depend on the gain of a channel, nor on the level of its noise. A
    structure that is wider than half of `width` is a background and has no height. With a lower
    quantile, it is the floor between dense lines that is the background.

    Parameters
    ----------
    psd : ndarray of shape (n_rows, n_orders)
        Order spectra [U²/order] in any unit U; they are mirrored at their ends.
    width : int
        Odd number of lines of which the quantile is taken.
    quantile : float
        In [0, 1).

    Returns
    -------
    ndarray of shape (n_rows, n_orders)
        Heights [dB]; 0 where line and background are both 0.

    Examples
    --------
    >>> line_heights(np.array([[1.0, 1.0, 100.0, 1.0, 1.0]]), 5)
    array([[ 0.,  0., 20.,  0.,  0.]])
    """
    psd, half = np.asarray(psd, dtype=np.float64), width // 2
    padded = np.pad(psd, ((0, 0), (half, half)), mode="reflect")
    # As one row, for which SciPy has a fast algorithm; the padding keeps the rows apart.
    floor = ndimage.rank_filter(padded.ravel(), int(quantile * width), size=width)
    tiny = np.finfo(np.float64).tiny
    around = floor.reshape(padded.shape)[:, half : half + psd.shape[1]]
    return 10 * np.log10(np.maximum(psd, tiny) / np.maximum(around, tiny))
