"""Intervals of a stream, and order spectra of each while it is measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor
from typing import Any

import numpy as np

from emacm._saved import Resumable
from emacm._statements import Statement
from emacm.findings.quality import MOST_OFFSET, Quality, check_channel
from emacm.orders.segment_plan import SectionCutter, SegmentPlan
from emacm.resampling.order_resampler import OrderResampler
from emacm.resampling.spreading import DESIGN, Spreading, upsampling
from emacm.shaft.motion import DIRECTIONS, ShaftPath
from emacm.streams.shaft_stream import GrowingStroke, HeldRows, HeldSeries, Samples, ShaftStream


class StreamQuality(Resumable):
    """What `emacm.findings.training_range.TrainingRange.outside` needs, and defects of channels.

    A channel is checked whenever some of its samples are taken up; a constant one is not a defect,
    as the shaft may be at rest.

    Parameters
    ----------
    names : sequence of str
        Names of the channels.

    Attributes
    ----------
    strokes : list of tuple
        Direction, revolutions, and range of the speed of each stroke.
    """

    held = ("_sums", "strokes", "_defects")

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        # Number of samples of each channel, their sum and the sum of their squares.
        self._sums = np.zeros((3, len(names)))
        self._defects: list[tuple[int, str, str]] = []  # channel, kind and text, one of each
        self.strokes: list[tuple[int, float, float, float]] = []

    def add_samples(self, channels: Sequence[int], held: HeldRows) -> None:
        """Take up those samples of some channels that were not taken up yet."""
        rows = held.between(int(self._sums[0, channels[0]]), held.length)
        number = np.full(len(rows), rows.shape[1])
        self._sums[:, channels] += [number, rows.sum(axis=1), np.einsum("ij,ij->i", rows, rows)]
        known = {k for k, _, _ in self._defects}
        for k, row in zip(channels, rows if rows.size else (), strict=False):
            check = check_channel(row, self._names[k])
            if k not in known and check.defect is not None and check.defect.kind != "constant":
                self._defects.append((k, check.defect.kind, check.defect.text))

    def add_stroke(self, path: ShaftPath, slowest: float, fastest: float) -> None:
        """Take up a stroke of the shaft of interest and the range of its speed [rad/s]."""
        self.strokes.append((path.direction, path.length / (2 * np.pi), slowest, fastest))

    def quality(self, rates: Mapping[str, float]) -> Quality:
        """Return the properties of all that was taken up, for the rates of the channels [Hz]."""
        number = np.maximum(self._sums[0], 1)
        means = self._sums[1] / number
        levels = np.sqrt(np.maximum(self._sums[2] / number - means**2, 0.0))
        is_offset = np.abs(means) > MOST_OFFSET * levels  # at rest, a position may be so
        turned = [revolutions for _, revolutions, _, _ in self.strokes]
        fastest = max((most for *_, most in self.strokes), default=0.0)
        row = {
            "revolutions": sum(turned),
            "strokes": len(turned),
            "longest_stroke": max(turned, default=0.0),
            "slowest": min((least for _, _, least, _ in self.strokes), default=0.0),
            "fastest": fastest,
            "max_order": np.pi * min(rates.values()) / fastest if fastest else np.inf,
        }
        forward = sum(revolutions for sign, revolutions, _, _ in self.strokes if sign > 0)
        share = forward / row["revolutions"] if turned else np.nan
        named = dict(zip(rates, levels.tolist(), strict=True))
        seen = [found for found in self._defects if found[1] != "offset" or is_offset[found[0]]]
        defects = tuple(Statement(kind, self._names[k], text) for k, kind, text in seen)
        return Quality(row, dict(rates), named, {}, defects, False, share)


@dataclass(frozen=True)
class Settings:
    """What the spectra of a stream depend on.

    Attributes
    ----------
    reference : {"velocity", "angle"}
        What is measured of the shaft; empty before the first samples.
    shaft_fs : float
        Sampling rate of the shaft reference [Hz].
    groups : mapping of float to sequence of int
        Sampling rates [Hz], each with the channels that have it.
    names : sequence of str
        Names of the channels.
    resampler : OrderResampler
        Strokes, and the angles of the samples.
    max_speed : float
        Highest speed of the measured shaft [rad/s].
    plan : SegmentPlan
        Segments of Welch's method.
    waiting : int
        Samples of a channel or the shaft that are waited for before some are processed: two parts
        of `emacm.resampling.spreading`, and what it cannot use yet.
    margin : int
        Samples of a channel or the shaft before those that are processed next.
    most_held : int
        Samples of a channel that may be held.
    rounding : float
        Samples, by which a time in seconds may miss a sample.
    """

    reference: str
    shaft_fs: float
    groups: Mapping[float, Sequence[int]]
    names: Sequence[str]
    resampler: OrderResampler
    max_speed: float
    plan: SegmentPlan
    waiting: int = 2 * 8192 + 64
    margin: int = 40
    most_held: int = 1 << 22
    rounding: float = 1e-6

    @property
    def rates(self) -> list[float]:
        """Sampling rates of the groups, and of the shaft reference [Hz]."""
        return [*self.groups, self.shaft_fs]


class IntervalCutter(Resumable):
    """Divides streams of samples into intervals, as `Recording.cut` divides a recording.

    Parameters
    ----------
    settings : Settings
        Rates and channels, and motion of the shaft.
    slowest : float
        Lowest rate of a recording of these signals [Hz].
    every : float
        Length of an interval [s or revolutions]; inf for a single one.
    in_seconds : bool
        Which of the two.

    Attributes
    ----------
    start : float
        Start of the interval [s].
    stop : float
        Its end, exclusive [s]; inf until it is known.
    rows : list of HeldRows
        Samples that wait to be taken, of each group and of the shaft.
    """

    held = ("rows", "_given", "_examined", "_number", "_turned", "start", "stop")

    def __init__(self, settings: Settings, slowest: float, every: float, in_seconds: bool) -> None:
        self._settings, self._rates, self._slowest = settings, settings.rates, slowest
        self._every, self._in_seconds = every, in_seconds
        self.rows = [HeldRows(n) for n in [*map(len, settings.groups.values()), 1]]
        self._given = [0] * len(self.rows)  # samples that were given out, or belong to no interval
        self._examined = 0  # the last sample of the shaft up to which its angle is known
        self._number = 0
        self._turned = 0.0  # angle of the shaft in the interval [rad]
        self.start = 0.0
        self.stop = every if in_seconds else np.inf

    def append(self, streams: Sequence[Samples]) -> None:
        """Add the next samples of the channels of each group, and of the shaft."""
        for rows, block in zip(self.rows, streams, strict=True):
            rows.append(block)

    def take(self, *, all_of_them: bool = False) -> list[Samples]:
        """Return the samples that are known to belong to the interval."""
        by_angle = self._every < np.inf and not self._in_seconds
        if by_angle and self.stop == np.inf:
            self._look_for_stop()
        taken = []
        for i, rows in enumerate(self.rows):
            first, last = min(rows.length, self._given[i]), rows.length
            if not all_of_them or self.stop < np.inf:
                last = max(first, min(last, self._last(i)))
            taken.append(rows.between(first, last))
            self._given[i] = max(self._given[i], last)
            is_shaft = rows is self.rows[-1]
            kept = last - 2  # the next interval may begin with samples at the end of this one
            rows.drop(min(kept, self._examined) if is_shaft and by_angle else kept)
        return taken

    @property
    def complete(self) -> bool:
        """Whether all samples of the interval were given out."""
        return all(
            n >= self.stop * rate - self._settings.rounding
            for n, rate in zip(self._given, self._rates, strict=True)
        )

    def next(self) -> None:
        """Begin the next interval at the end of this one."""
        self._number += 1
        self.start, self._turned = self.stop, 0.0
        self.stop = (self._number + 1) * self._every if self._in_seconds else np.inf
        begin = ceil(self.start * self._slowest - self._settings.rounding) / self._slowest
        self._given = [round(begin * rate) for rate in self._rates]

    def _last(self, i: int) -> int:
        """Last + 1 sample that may be given out."""
        rate, shaft = self._rates[i], self.rows[-1]
        if self.stop < np.inf:
            return ceil(self.stop * rate - self._settings.rounding)
        if self._every == np.inf or self.rows[i] is shaft:
            return self.rows[i].length
        # The interval may end where the shaft has got to.
        return floor(shaft.length / self._rates[-1] * rate)

    def _look_for_stop(self) -> None:
        """Find the sample of the shaft at which the interval has its revolutions."""
        (shaft,) = self.rows[-1].between(self._examined, self.rows[-1].length)
        steps = self._steps(shaft)
        turn = 2 * np.pi / self._settings.resampler.ratio  # of the measured shaft
        limit = self._every * turn * (1 - 1e-12)  # beyond the rounding of the sum
        used, turned = len(steps), self._turned + float(steps.sum())
        if turned >= limit:
            before = int(np.searchsorted(self._turned + np.cumsum(steps), limit))
            used = min(before + 1, len(steps))
            self.stop = (self._examined + used + 1) / self._rates[-1]
        self._examined += used
        self._turned = turned

    def _steps(self, shaft: Samples) -> Samples:
        """Return the angles between successive samples, 0 at standstill [rad]."""
        if self._settings.reference == "angle":
            steps = np.abs(np.diff(shaft))
            return steps * (steps * self._rates[-1] > self._settings.resampler.min_speed)
        steps = np.abs(shaft[1:] + shaft[:-1]) * (0.5 / self._rates[-1])
        return steps * (np.abs(shaft[1:]) > self._settings.resampler.min_speed)


class StrokePowers(SectionCutter, Resumable):
    """Sum of the powers of all segments of a stroke, in channels of one sampling rate.

    Parameters
    ----------
    settings : Settings
        What the powers depend on.
    group : int
        The channels, as a place in `Settings.groups`.
    factor : int
        How much denser the samples are made.

    Attributes
    ----------
    spreading : Spreading
        Resampling of the stroke.
    total : ndarray of shape (n_channels, n_orders)
        The sum; 0 before the first segment.
    count : int
        Number of segments.
    """

    held = ("spreading", "rest", "total", "count")

    def __init__(self, settings: Settings, group: int, factor: int) -> None:
        super().__init__(settings.plan.n_per_segment, settings.plan.step)
        self._plan, self.group, self.factor = settings.plan, group, factor
        self.spreading = Spreading(settings.rates[group], factor, settings.resampler.theta_s)
        self.total: Any = 0.0
        self.count = 0

    def advance(self, rows: Sequence[HeldSeries], path: ShaftPath, *, complete: bool) -> None:
        """Add the segments that are complete in the channels along the stroke as it is known."""
        for block in self.spreading.outputs(rows, path, complete=complete):
            for section, n_segments in self.add(block):
                self.total = self.total + self._plan.section_powers(section, n_segments)
                self.count += n_segments


class SpectrumStream(Resumable):
    """Order spectra of one recording, of which only what is still needed is held.

    Parameters
    ----------
    settings : Settings
        What the spectra depend on.

    Attributes
    ----------
    shaft : ShaftStream
        Motion of the shaft.
    signals : list of HeldRows
        The channels, by sampling rate as in `Settings.groups`.
    quality : StreamQuality
        Speeds, revolutions and levels; complete after `finish`.
    """

    held = ("shaft", "signals", "quality", "_sums", "_counts", "_due")

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        motion = settings.shaft_fs, settings.resampler.min_speed, settings.resampler.max_rest
        self.shaft = ShaftStream(settings.reference, *motion, self._new_powers)
        self.signals = [HeldRows(len(group)) for group in settings.groups.values()]
        shape = len(settings.names), 1 + settings.plan.by_direction
        self._sums = np.zeros((*shape, settings.plan.n_orders))
        self._counts = np.zeros((*shape, 1))
        self.quality = StreamQuality(settings.names)
        self._due = settings.waiting  # samples at the fastest rate, at which some are processed

    @property
    def inputs(self) -> list[HeldRows]:
        """The samples of the channels, by group, and of the shaft reference."""
        return [*self.signals, self.shaft.measured]

    def append(self, streams: Sequence[Samples]) -> None:
        """Add the next samples of the channels, by group, and of the shaft; process what is due."""
        for held, block in zip(self.inputs, streams, strict=True):
            held.append(block)
        n_times = max(held.length for held in self.inputs)
        if n_times >= self._due:
            self._process(ended=False)
            self._due = n_times + self._settings.waiting

    def finish(self) -> Samples:
        """End the recording, and return its spectra, shape (n_channels, [n_directions,] n_orders).

        Raises
        ------
        ValueError
            If no stroke (of one direction) is as long as a segment.
        """
        self._process(ended=True)
        plan = self._settings.plan
        if not self._counts.all():
            one = "no stroke of one direction" if plan.by_direction else "no stroke"
            longest = max((turned for _, turned, *_ in self.quality.strokes), default=0.0)
            raise ValueError(
                f"{one} holds a segment of {plan.revolutions:g} revolutions; the longest stroke "
                f"has {longest:.4g}."
            )
        spectra = plan.spectrum_of(self._sums / self._counts, 1)
        return spectra if plan.by_direction else spectra[:, 0]

    def _new_powers(self, direction: int) -> dict[str, StrokePowers]:
        """Return the powers of a new stroke, of each group and for each density of the samples.

        How dense they have to be depends on the highest speed of the whole stroke. As that is not
        known before its end, all densities that are still possible are processed.
        """
        settings = self._settings
        if direction not in DIRECTIONS[settings.resampler.direction]:
            return {}
        highest = settings.resampler.ratio * settings.max_speed * (1 + 1e-9)
        return {
            f"group {k}, factor {factor}": StrokePowers(settings, k, factor)
            for k, fs in enumerate(settings.groups)
            for factor in range(1, upsampling(fs, highest, settings.resampler.theta_s) + 1)
        }

    def _process(self, *, ended: bool) -> None:
        """Advance all strokes, and forget those that are complete and samples of the past."""
        for group, held in zip(self._settings.groups.values(), self.signals, strict=True):
            self.quality.add_samples(group, held)
        self.shaft.advance(ended=ended)
        for growing in self.shaft.strokes:
            if growing.powers:
                self._advance(growing, ended=ended)
        self.shaft.strokes = [s for s in self.shaft.strokes if s.powers or not s.complete]
        self._forget()

    def _advance(self, growing: GrowingStroke, *, ended: bool) -> None:
        """Process what is known of a stroke, and take up its powers if that is all of it."""
        settings, powers, complete = self._settings, growing.powers, growing.complete
        theta_s = settings.resampler.theta_s
        path = self.shaft.path(growing, settings.resampler.ratio)
        if not complete and path.n_times < 2:
            return
        if complete and path.count(theta_s) < settings.plan.n_per_segment:
            powers.clear()  # no segment lies in it
        if powers:
            _check_reversal(path)
        needed = [upsampling(fs, path.fastest, theta_s) for fs in settings.groups]
        for name, each in list(powers.items()):
            if each.factor < needed[each.group] or (complete and each.factor > needed[each.group]):
                del powers[name]
        lacking = [
            each.spreading.rows_needed(path) > self.signals[each.group].length
            for each in powers.values()
        ]
        if complete and not ended and any(lacking):
            return
        for each in powers.values():
            each.advance(self.signals[each.group].series, path, complete=complete)
        if complete:
            self._take_up(growing, path)

    def _take_up(self, growing: GrowingStroke, path: ShaftPath) -> None:
        """Add the powers and the speeds of a stroke that is complete."""
        settings, groups = self._settings, list(self._settings.groups.values())
        kind = int(settings.plan.by_direction and path.direction < 0)
        for powers in growing.powers.values():
            place = groups[powers.group], kind
            self._sums[place] += powers.total
            self._counts[place] += powers.count
        growing.powers.clear()
        if path.length > 0:
            ratio = settings.resampler.ratio
            self.quality.add_stroke(path, ratio * growing.slowest, ratio * growing.fastest)

    def _forget(self) -> None:
        """Drop samples that are not needed any more."""
        shaft, margin = self.shaft, self._settings.margin
        needed = [(shaft.n_examined - 1) / shaft.fs]
        for growing in shaft.strokes:
            for powers in growing.powers.values():
                needed.append(powers.spreading.needed_from(growing.stroke.start / shaft.fs))
        first = min(needed)
        shaft.drop(int(first * shaft.fs) - margin)
        for held, fs in zip(self.signals, self._settings.groups, strict=True):
            held.drop(int(first * fs) - margin)


def _check_reversal(path: ShaftPath) -> None:
    """Raise a ValueError if the shaft turned back too far to be followed."""
    if path.max_reversal > DESIGN.least_reversal:
        raise ValueError(
            f"the shaft turned back by {path.max_reversal:.3g} rad in the stroke that began at "
            f"{path.start_time:.6g} s of the reading; at most {DESIGN.least_reversal:g} rad can be "
            f"followed. Raise min_speed or set max_rest of OrderResampler, and reset."
        )
