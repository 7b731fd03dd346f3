"""Order spectra of a recording while it is measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm.orders.segment_plan import SectionCutter, SegmentPlan
from emacm.resampling.quality import Quality
from emacm.resampling.spreading import DESIGN, Spreading, upsampling
from emacm.shaft.motion import DIRECTIONS, ShaftPath
from emacm.streams.packed_state import Resumable
from emacm.streams.shaft_stream import GrowingStroke, HeldRows, HeldSeries, ShaftStream

Array = NDArray[np.floating]


class StreamQuality(Resumable):
    """What `emacm.resampling.training_range.outside_range` needs, without findings of defects.

    Parameters
    ----------
    groups : sequence of (float, sequence of int)
        Sampling rates [Hz], each with the channels that have it.
    """

    held = ("_sums", "_strokes")

    def __init__(self, groups: Sequence[tuple[float, Sequence[int]]]) -> None:
        self._groups = groups
        # Of each group: number of samples, sums and sums of squares of its channels.
        self._sums = [np.zeros((3, len(channels))) for _, channels in groups]
        # Number, revolutions, longest, lowest and highest speed, revolutions forward.
        self._strokes = np.zeros(6)
        self._strokes[3] = np.inf

    def add_samples(self, group: int, rows: Array) -> None:
        """Take up the next samples of a group, shape (n_channels, n_times)."""
        number = np.full(len(rows), rows.shape[1])
        self._sums[group] += [number, rows.sum(axis=1), np.einsum("ij,ij->i", rows, rows)]

    def add_stroke(self, turned: float, lowest: float, highest: float, direction: int) -> None:
        """Take up a stroke: angle [rad], speeds [rad/s] and direction of the shaft of interest."""
        revolutions = turned / (2 * np.pi)
        n, total, longest, low, high, forward = self._strokes
        speeds = min(low, lowest), max(high, highest)
        forward += revolutions if direction > 0 else 0.0
        self._strokes[:] = n + 1, total + revolutions, max(longest, revolutions), *speeds, forward

    def quality(self, names: Sequence[str]) -> Quality:
        """Return the properties of all that was taken up; `names` are those of the channels."""
        rates, levels = {}, {}
        for (fs, channels), (number, total, squares) in zip(self._groups, self._sums, strict=True):
            mean = total / np.maximum(number, 1)
            variance = squares / np.maximum(number, 1) - mean**2
            for k, channel in enumerate(channels):
                rates[names[channel]] = fs
                levels[names[channel]] = float(np.sqrt(max(variance[k], 0.0)))
        n_strokes, revolutions, longest, slowest, fastest, forward = self._strokes.tolist()
        row = {
            "revolutions": revolutions,
            "strokes": n_strokes,
            "longest_stroke": longest,
            "slowest": slowest if n_strokes else 0.0,
            "fastest": fastest,
            "max_order": np.pi * min(rates.values()) / fastest if fastest else np.inf,
        }
        ordered = {name: levels[name] for name in names}
        share = forward / revolutions if revolutions else np.nan
        ordered_rates = {name: rates[name] for name in names}
        return Quality(row, ordered_rates, ordered, {}, (), False, share)


Powers = NDArray[np.floating]


@dataclass(frozen=True)
class Settings:
    """What the spectra of a stream depend on.

    Attributes
    ----------
    reference : {"velocity", "angle"}
        What is measured of the shaft.
    shaft_fs : float
        Its sampling rate [Hz].
    groups : tuple of (float, tuple of int)
        Sampling rates [Hz], each with the channels that have it.
    theta_s, direction, min_speed, max_rest, ratio
        As for `OrderResampler`.
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
    """

    reference: str
    shaft_fs: float
    groups: tuple[tuple[float, tuple[int, ...]], ...]
    theta_s: float
    direction: str
    min_speed: float
    max_rest: float | None
    ratio: float
    max_speed: float
    plan: SegmentPlan
    waiting: int = 2 * 8192 + 64
    margin: int = 40
    most_held: int = 1 << 22

    @property
    def kinds(self) -> list[tuple[int, str]]:
        """Directions whose spectra are separate, 0 for both, and what to call their strokes."""
        both = [(1, "forward stroke"), (-1, "reverse stroke")]
        return both if self.plan.by_direction else [(0, "stroke")]


class PowerSum:
    """Sum of the powers of all segments of a signal over the shaft angle."""

    def __init__(self, plan: SegmentPlan) -> None:
        self._plan = plan
        self._cutter = SectionCutter(plan.n_per_segment, plan.step)
        self.total: Any = 0.0
        self.count = 0

    def add(self, block: NDArray[np.floating]) -> None:
        """Add the segments that are complete with the next samples."""
        for section, n_segments in self._cutter.add(block):
            self.total = self.total + self._plan.section_powers(section, n_segments)
            self.count += n_segments

    def state(self) -> dict[str, Any]:
        """Return all that `restore` needs."""
        return {"total": self.total, "count": self.count, "rest": self._cutter.rest}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state."""
        self.total, self.count, self._cutter.rest = state["total"], state["count"], state["rest"]


class StrokeStream:
    """Powers of one stroke, in channels of one sampling rate, while it is measured.

    How dense the time samples have to be depends on the highest speed of the whole stroke. As that
    is not known before its end, all densities that are still possible are processed.
    """

    def __init__(self, settings: Settings, fs: float) -> None:
        self._settings, self._fs = settings, fs
        self._started: dict[int, tuple[Spreading, PowerSum]] | None = None

    def advance(
        self, rows: Sequence[HeldSeries], path: ShaftPath, *, complete: bool, ended: bool
    ) -> PowerSum | None:
        """Process what is known; return the powers if that is the whole stroke.

        Parameters
        ----------
        rows : sequence of HeldSeries
            The channels.
        path : ShaftPath
            The stroke, as far as it is known.
        complete : bool
            Whether the stroke has ended.
        ended : bool
            Whether the recording has ended.
        """
        slowest = upsampling(self._fs, path.fastest, self._settings.theta_s)
        if self._started is None:
            self._started = self._start(slowest)
        for factor in [f for f in self._started if f < slowest]:
            del self._started[factor]
        if complete:
            spreading, powers = self._started[slowest]
            self._started = {slowest: (spreading, powers)}
            if not ended and len(rows[0]) < spreading.rows_needed(path):
                return None
        for spreading, powers in self._started.values():
            for block in spreading.outputs(rows, path, complete=complete):
                powers.add(block)
            if complete:
                return powers
        return None

    def needed_from(self, start_time: float) -> float:
        """Return the time of the first sample that is still needed [s]."""
        streams = (self._started or {}).values()
        return min((s.needed_from(start_time) for s, _ in streams), default=start_time)

    @property
    def n_held(self) -> int:
        """Samples that are held for the mirror image at the end of the stroke."""
        streams = (self._started or {}).values()
        return max((spreading.n_held for spreading, _ in streams), default=0)

    def _start(self, slowest: int) -> dict[int, tuple[Spreading, PowerSum]]:
        settings = self._settings
        highest = settings.ratio * settings.max_speed * (1 + 1e-9)
        fastest = max(slowest, upsampling(self._fs, highest, settings.theta_s))
        started = {}
        for factor in range(slowest, fastest + 1):
            spreading = Spreading(self._fs, factor, settings.theta_s)
            started[factor] = spreading, PowerSum(settings.plan)
        return started

    def state(self) -> dict[str, Any]:
        """Return all that `restore` needs."""
        if self._started is None:
            return {}
        streams = {str(f): [s.state(), p.state()] for f, (s, p) in self._started.items()}
        return {"streams": streams}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a state."""
        if "streams" not in state:
            return
        self._started = {}
        for factor, (spread, summed) in state["streams"].items():
            spreading = Spreading(self._fs, int(factor), self._settings.theta_s)
            spreading.restore(spread)
            powers = PowerSum(self._settings.plan)
            powers.restore(summed)
            self._started[int(factor)] = spreading, powers


class SpectrumStream:
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
    n_held : int
        Most samples of a channel that were held when some were last processed.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self.shaft = ShaftStream(
            settings.reference, settings.shaft_fs, settings.min_speed, settings.max_rest
        )
        self.signals = [HeldRows(len(group)) for _, group in settings.groups]
        self._streams: list[dict[int, StrokeStream]] = []  # of each stroke, by group
        self._sums = self._no_sums()
        self._longest = {kind: 0 for kind, _ in settings.kinds}
        self._fastest = max(settings.shaft_fs, *(fs for fs, _ in settings.groups))
        self.quality = StreamQuality(settings.groups)
        self._seen = [0] * len(settings.groups)  # samples of each group that were taken up by it
        self._due = settings.waiting  # samples at the fastest rate, at which some are processed
        self.n_held = 0

    def append(
        self, signals: Sequence[Sequence[NDArray[np.floating]]], shaft: NDArray[np.floating]
    ) -> None:
        """Add the next samples of the channels, by group, and of the shaft; process what is due."""
        self.shaft.append(shaft)
        for held, blocks in zip(self.signals, signals, strict=True):
            held.append(blocks)
        n_times = max(self.shaft.n_received, *(held.length for held in self.signals))
        if n_times >= self._due:
            self.shaft.advance()
            first = self._process(ended=False)
            # Where little could be processed, as in a rest, it is not tried again with every block.
            waiting = self._settings.waiting
            self._due = max(int(first * self._fastest), n_times - waiting // 2) + waiting

    def finish(self) -> Powers:
        """End the recording, and return its spectra, shape (n_channels, [n_directions,] n_orders).

        Raises
        ------
        ValueError
            If no stroke (of one direction) is as long as a segment, or powers overflow.
        """
        self.shaft.close()
        self._process(ended=True)
        plan = self._settings.plan
        n_channels = sum(len(group) for _, group in self._settings.groups)
        spectra = np.empty((n_channels, len(self._settings.kinds), plan.n_orders))
        for k, (kind, name) in enumerate(self._settings.kinds):
            if self._longest[kind] < plan.n_per_segment:
                longest = self._longest[kind] / plan.samples_per_rev
                raise ValueError(
                    f"no {name} holds a segment of {plan.revolutions:g} revolutions; the longest "
                    f"one has {longest:.4g}."
                )
            for (_, group), (total, count) in zip(
                self._settings.groups, self._sums[kind], strict=True
            ):
                spectra[list(group), k] = plan.spectrum_of(total, count)
        if not np.all(np.isfinite(spectra)):
            raise ValueError("a power exceeds the range of float64. State signals in other units.")
        return spectra if plan.by_direction else spectra[:, 0]

    def _no_sums(self) -> dict[int, list[tuple[Any, int]]]:
        return {kind: [(0.0, 0)] * len(self._settings.groups) for kind, _ in self._settings.kinds}

    def _process(self, *, ended: bool) -> float:
        """Advance all strokes, and forget those that are complete and samples of the past.

        Returns the time of the first sample that is still needed [s].
        """
        shaft, settings = self.shaft, self._settings
        groups = range(len(settings.groups))
        for k, held in enumerate(self.signals):
            self.quality.add_samples(k, held.since(self._seen[k]))
            self._seen[k] = held.length
        new = len(shaft.strokes) - len(self._streams)
        self._streams += [
            {k: StrokeStream(settings, settings.groups[k][0]) for k in groups} for _ in range(new)
        ]
        for growing, streams in zip(shaft.strokes, self._streams, strict=True):
            self._advance(growing, streams, ended=ended)
        done = [s.complete and not g for s, g in zip(shaft.strokes, self._streams, strict=True)]
        for stroke, gone in zip(shaft.strokes, done, strict=True):
            if (
                gone
                and stroke.length > 0
                and stroke.stroke.direction in DIRECTIONS[settings.direction]
            ):
                speeds = settings.ratio * stroke.lowest, settings.ratio * stroke.highest
                turned = settings.ratio * stroke.length
                self.quality.add_stroke(turned, *speeds, stroke.stroke.direction)
        shaft.strokes = [s for s, gone in zip(shaft.strokes, done, strict=True) if not gone]
        self._streams = [s for s, gone in zip(self._streams, done, strict=True) if not gone]
        return self._forget()

    def _advance(
        self, growing: GrowingStroke, streams: dict[int, StrokeStream], *, ended: bool
    ) -> None:
        settings, stroke = self._settings, growing.stroke
        if stroke.direction not in DIRECTIONS[settings.direction]:
            streams.clear()
            return
        if growing.complete:
            n_angles = self.shaft.count(growing, settings.theta_s / settings.ratio)
            kind = stroke.direction if settings.plan.by_direction else 0
            self._longest[kind] = max(self._longest[kind], n_angles)
            if n_angles < settings.plan.n_per_segment:
                streams.clear()  # no segment lies in it
        if not streams or stroke.stop - stroke.start < 2:
            return
        path = self.shaft.path(growing, settings.ratio)
        if path.max_reversal > DESIGN.least_reversal:
            raise ValueError(
                f"the shaft turned back by {path.max_reversal:.3g} rad in the stroke that began at "
                f"{path.start_time:.6g} s of the reading; at most "
                f"{DESIGN.least_reversal:g} rad can be followed. Raise min_speed or set max_rest "
                f"of OrderResampler, and reset."
            )
        for k, stream in list(streams.items()):
            rows = self.signals[k].series
            powers = stream.advance(rows, path, complete=growing.complete, ended=ended)
            if powers is not None:
                kind = stroke.direction if settings.plan.by_direction else 0
                total, count = self._sums[kind][k]
                self._sums[kind][k] = total + powers.total, count + powers.count
                del streams[k]

    def _forget(self) -> float:
        """Drop samples that are not needed any more."""
        shaft = self.shaft
        needed = [(shaft.n_examined - 1) / shaft.fs]
        for growing, streams in zip(shaft.strokes, self._streams, strict=True):
            start_time = growing.stroke.start / shaft.fs
            needed += [stream.needed_from(start_time) for stream in streams.values()]
        first = min(needed)
        margin = self._settings.margin
        shaft.drop(int(first * shaft.fs) - margin)
        for held, (fs, _) in zip(self.signals, self._settings.groups, strict=True):
            held.drop(int(first * fs) - margin)
        tails = (stream.n_held for streams in self._streams for stream in streams.values())
        self.n_held = max(
            shaft.n_held, *(held.length - held.first for held in self.signals), *tails
        )
        return first

    def state(self) -> dict[str, Any]:
        """Return all that `restore` needs."""
        streams = [{str(k): s.state() for k, s in each.items()} for each in self._streams]
        sums = {str(k): [list(s) for s in each] for k, each in self._sums.items()}
        return {
            "shaft": self.shaft.state(),
            "signals": [held.state() for held in self.signals],
            "streams": streams,
            "sums": sums,
            "longest": {str(k): n for k, n in self._longest.items()},
            "quality": self.quality.state(),
            "seen": self._seen,
            "due": self._due,
            "held": self.n_held,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a state."""
        self.shaft.restore(state["shaft"])
        for held, series in zip(self.signals, state["signals"], strict=True):
            held.restore(series)
        self._streams = []
        for each in state["streams"]:
            streams = {
                int(k): StrokeStream(self._settings, self._settings.groups[int(k)][0]) for k in each
            }
            for k, stream in streams.items():
                stream.restore(each[str(k)])
            self._streams.append(streams)
        self._sums = {
            int(k): [(total, count) for total, count in each] for k, each in state["sums"].items()
        }
        self._longest = {int(k): n for k, n in state["longest"].items()}
        self.quality.restore(state["quality"])
        self._seen, self._due, self.n_held = state["seen"], state["due"], state["held"]
