"""Faults named from the geometry of a machine, without training."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.base import clone

from emacm._checks import check_count, check_number, located
from emacm.conditions.healthy import are_recordings, check_rates, common_rates
from emacm.machine.fault_lines import SETTINGS as LINES
from emacm.machine.fault_lines import FaultLines, LineLevels
from emacm.machine.fault_orders import FaultSeries, fault_series
from emacm.machine.parts import Part
from emacm.models.recipes import bearing_recipe, highest_order, longest_stroke
from emacm.orders.columns import column_names, parse_order_columns
from emacm.recordings.inputs import as_recordings, check_channel_names, described
from emacm.recordings.recording import Recording
from emacm.resampling.quality import CHANNEL_CHECKS, check_channel


@dataclass(frozen=True)
class NamingSettings:
    """When a fault is named or suspected.

    Chosen by ``python benchmarks/bearings.py`` on the drive end of CWRU and on MFPT, and, for
    several faults, on simulated bearings; `further` and `narrow` also after a look at UESTC. That
    `named` and `depth` also hold for a further fault follows two false balls of the drive end.

    Attributes
    ----------
    suspected : float
        Score from which on a fault is suspected; with healthy recordings, the distance from their
        highest score from which on it is named [dB].
    named : float
        Score from which on a fault is named without healthy recordings [dB].
    depth : float
        Depth of modulation from which on it is named without healthy recordings: amplitude of the
        lines over the mean of the envelope.
    single_line : float
        Height by which the highest line of a fault may exceed the second one [dB].
    further : float
        Height of two lines from which on a further fault is named, if those before it do not
        explain them [dB].
    weaker : float
        Largest difference of its mean height to that of the first one [dB].
    sidebands : float
        Height from which on a fault has sidebands [dB].
    speed_error : float
        Largest deviation of a speed or a geometry that is looked for, as a fraction.
    longest, shortest : int
        Length of a segment, and of the longest stroke of a recording at least [revolutions].
    fine : tuple of int
        Lengths of segments in which the lines of several faults are told apart [revolutions]: the
        first separates more lines; in the second those that slip has widened are higher.
    narrow : float
        Spectral lines on either side that are background, if they are within half an order:
        strong lines are widened by random slip, and their skirts are no lines of other faults.
    comb : float
        Height of the lines between those of a fault, in parts of theirs, from which on all are
        those of another source, as of a belt: below it are the damaged rings of the drive end and
        of UESTC, with at most 0.89, above it 33 simulated machines, with at least 0.93.
    """

    suspected: float = 3.0
    named: float = 6.0
    depth: float = 0.04
    single_line: float = 12.0
    further: float = 9.0
    weaker: float = 15.0
    sidebands: float = 3.0
    speed_error: float = 0.1
    longest: int = 25
    shortest: int = 10
    fine: tuple[int, ...] = (100, 50)
    narrow: float = 12.5
    comb: float = 0.9


SETTINGS = NamingSettings()
NONE, NOT_ASSESSED = "none", "not assessed"


class FaultTable(pd.DataFrame):
    """Result of `find_faults`: a DataFrame; notebooks show what was named, with its sentences.

    Whatever is selected or computed from it is a plain DataFrame.
    """

    @property
    def _constructor(self) -> type[pd.DataFrame]:
        return pd.DataFrame

    def _repr_html_(self) -> str:
        shown = ("recording", "channel", "named", "suspected", "explanation")
        return self[[name for name in shown if name in self]].to_html(index=False)


def find_faults(
    X: Any,
    parts: Part | Mapping[str, float] | Sequence[Part | Mapping[str, float]],
    *,
    harmonics: int = 3,
    slip: float = 0.02,
    false_alarm: float = 0.01,
    channels: Sequence[str] | None = None,
    healthy: Any = None,
) -> FaultTable:
    """Name the fault of each recording and channel from the geometry of the machine.

    No training is needed. A fault is named if its lines are significantly above the local
    background (p-value), far enough above it, and modulate the envelope deeply enough. Lines that
    healthy machines may also have are suspected. What carries no answer is not assessed.

    Parameters
    ----------
    X : list of Recording, or table
        Vibration as measured; prewhitening, envelope, resampling and spectra are those of
        `bearing_recipe`, with segments of 25 revolutions, or of as many whole revolutions as a
        shorter recording has, at least 10. Or a table of order spectra as `OrderPSD` returns it,
        for bearings those of the envelope.
    parts : part, or sequence of parts
        `Bearing`, `Gear` and so on, or mappings of fault names to orders.
    harmonics : int
        Number of lines of each fault.
    slip : float
        Largest deviation of rolling elements from the predicted orders, as a fraction.
    false_alarm : float
        Probability that a fault is named in a row that contains only background. At
        1, the fault with the highest score is always named, and no threshold applies.
    channels : sequence of str, optional
        Channels, in this order. Default: all.
    healthy : list of Recording, or table, or result of `healthy_scores`, optional
        The same machine without faults, measured in the same way. Healthy machines have lines
        too: a fault is then named if it is 3 dB above its highest healthy score, whatever it is.

    Returns
    -------
    DataFrame
        One row for each recording and channel; notebooks show "named", "suspected" and
        "explanation" as a table (`FaultTable`). Columns:

        - "recording" (number in X), "channel",
        - "named": name of the fault, or several joined by " + ", the strongest first; "none"; or
          "not assessed", with the reason in "explanation",
        - "suspected": in the same form, lines that healthy machines may also have at this level,
          or that another speed or geometry would explain; "none" if a fault is named,
        - the name of each fault: its score [dB], the mean level of its lines above the local
          background, minus that of background alone (1 to 3 dB, because the best slip is chosen),
        - "p(<fault>)": probability of a score at least as high in background alone, not
          smaller than 1/2001,
        - "slip": deviation of the lines from their predicted orders, of the fault named or, if
          there is none, of the one with the highest score,
        - "calibrated": whether `healthy` was given,
        - "explanation": a sentence.

    Raises
    ------
    TypeError, ValueError
        If an input is invalid, a recording is too short, its sampling rate is too low for the
        lines or differs from that of `healthy`; the message gives the recording.

    See Also
    --------
    emacm.fault_orders : Orders of the faults of several parts.
    emacm.bearing_recipe : A classifier that is trained on lines.
    emacm.angle_from_vibration : The shaft angle, if it was not measured.

    Notes
    -----
    Without `healthy`, a fault is suspected from a score of 3 dB on, and named from 6 dB on, if the
    amplitude of its lines is at least 4 % of the mean of the envelope (recordings only). These
    numbers are from the drive end of CWRU and from MFPT; healthy bearings of other machines have
    reached 9.5 dB, with which `healthy` or a trend decides. The p-value only excludes background:
    it says nothing about other sources of lines.

    If the strongest fault is rejected, no other one is named. A further fault is named by lines
    that those before it do not explain, in a spectrum of up to 100 or 50 revolutions: harmonics of
    those, and sidebands at three multiples of each order that modulates them: of their own, and of
    shaft and cage where most of these sidebands stand out by 3 dB. At least two such lines (and the
    lowest order, unless it is explained) must be 9 dB above a background of 12 spectral lines on
    either side, and their score and depth must reach the limits of a first fault without `healthy`.
    Lines that coincide name nothing: the faults of bearings with orders near whole
    numbers are often told apart incompletely.

    A channel that is constant, clipped or has drop-outs is not assessed. Nor is a recording in
    which lines within 10 % of the predicted orders, but outside of `slip`, would be named, and are
    higher by 3 dB than those within (by 6 dB if these would be named): then the speed, the rate or
    the geometry is wrong, and the explanation states which speed would fit.

    Rolling elements are not synchronous with the shaft, so whole orders count as background for
    their lines (a loose part or a blade has lines there) unless a line is predicted there. The
    second highest line of such a fault must be within 12 dB of the highest, or there must be
    sidebands: impacts have harmonics, while a noise modulated by another shaft or by the mains has
    a single line. In the recordings of the drive end and of MFPT it is within 8.2 dB.

    Impacts of another source, as of a belt or a loose part, have lines at all multiples of a lower
    order. If the lines between those of a fault of rolling elements (in the spectrum of up to 100
    revolutions, without sidebands) are at least 0.9 times as high in decibels, it is suspected.

    An order that modulates another fault of the machine (the cage FTF modulates the lines of a
    ball, the shaft those of the inner ring) is not named: the other one is suspected.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import Recording, find_faults
    >>> rng, fs = np.random.default_rng(0), 10_000
    >>> struck = np.zeros(8 * fs)
    >>> struck[(np.arange(0, 8, 1 / (30 * 5.43)) * fs).astype(int)] = 1.0
    >>> ring = np.exp(-np.arange(60) / 10) * np.sin(0.6 * np.pi * np.arange(60))
    >>> signal = np.convolve(struck, ring)[: 8 * fs] + 0.3 * rng.standard_normal(8 * fs)
    >>> run = Recording({"vibration": signal}, fs, velocity=2 * np.pi * 30)
    >>> find_faults([run], {"BPFI": 5.415, "BPFO": 3.585})["named"].tolist()
    ['BPFI']
    """
    check_count(harmonics, "harmonics", at_most=100)
    check_number(false_alarm, "false_alarm", above=0, at_most=1)
    series = fault_series(parts, harmonics)
    least = len(series) / (1 + LINES.draws)
    if false_alarm < least:
        raise ValueError(
            f"false_alarm = {false_alarm:g} is below {least:.2g}, the smallest that {LINES.draws} "
            f"simulated backgrounds resolve for {len(series)} faults. Raise it, or leave parts out."
        )
    options: dict[str, Any] = {"harmonics": harmonics, "slip": slip, "channels": channels}
    highest = healthy
    if healthy is not None and not isinstance(healthy, Mapping):
        if are_recordings(healthy):
            check_rates(X, common_rates(healthy))
        highest = healthy_scores(healthy, parts, **options)
    rows = []
    for measured in _measured(X, parts, series, **options):
        if highest is not None:
            check_channel_names(list(highest), [measured.channel], "healthy")
        limits = None if highest is None else highest[measured.channel]
        found = _Finding.of(measured, limits, false_alarm)
        row = {"recording": measured.number, "channel": measured.channel} | found.columns()
        rows.append(row | {"calibrated": healthy is not None, "explanation": found.text})
    return FaultTable(rows)


def healthy_scores(
    healthy: Any,
    parts: Any,
    *,
    harmonics: int = 3,
    slip: float = 0.02,
    channels: Sequence[str] | None = None,
) -> dict[str, list[float]]:
    """Return the highest score of each fault in healthy recordings, not below 0 dB, by channel.

    `find_faults` takes the result as `healthy`, so that many recordings can be judged one by one.
    """
    series, highest = fault_series(parts, harmonics), dict[str, list[float]]()
    options: dict[str, Any] = {"harmonics": harmonics, "slip": slip, "channels": channels}
    with located("healthy"):
        for measured in _measured(healthy, parts, series, **options):
            scores = [fault.score for fault in measured.spectrum.faults()]
            before = highest.get(measured.channel, [0.0] * len(scores))
            highest[measured.channel] = list(map(max, scores, before))
    return highest


class _Fault(NamedTuple):
    """A fault in one spectrum: its score [dB], its slip, and heights of lines [dB]."""

    series: FaultSeries
    score: float
    p: float
    slip: float
    heights: list[float]
    depth: float
    sidebands: dict[str, float]
    first: float

    @property
    def is_single(self) -> bool:
        """Whether a fault of rolling elements has one line only, as a modulation has.

        Impacts have harmonics of similar height, or sidebands.
        """
        *_, second, highest = [-np.inf, *sorted(self.heights)]
        several = self.series.slips and len(self.heights) > 1
        return several and highest - second > SETTINGS.single_line and not self.sides

    @property
    def sides(self) -> list[str]:
        """Names of the modulations whose sidebands are above the background."""
        return [name for name, level in self.sidebands.items() if level >= SETTINGS.sidebands]

    def modulated(self, faults: Sequence[_Fault]) -> list[_Fault]:
        """Return the faults that are modulated at the order of this one."""
        order = self.series.orders[0]
        return [f for f in faults if any(np.isclose(order, o) for _, o in f.series.sidebands)]


class _Spectrum(NamedTuple):
    """The envelope spectrum of one recording and channel, with the lines to look for.

    Attributes
    ----------
    lines : LineLevels
        On the axis of the spectrum.
    psd : ndarray of shape (1, n_orders)
        Order spectrum.
    mean : float
        Mean of the envelope; NaN for a table.
    """

    lines: LineLevels
    psd: NDArray[np.float64]
    mean: float = np.nan

    def faults(self, explained: NDArray[np.bool_] | None = None) -> list[_Fault]:
        """Measure all faults, without the lines that are explained."""
        levels, slips, heights = self.lines.measure(self.psd, explained)
        scores, p = self.lines.compare(self.psd, levels)
        own = [each[0][np.isfinite(each[0])].tolist() for each in heights]
        at = list(zip(self.lines.series, slips[0], strict=True))
        mean = self.mean or np.nan  # of a dead channel
        depths = [self.lines.amplitude(self.psd, *each) / mean for each in at]
        sides = [self.lines.sidebands(self.psd, *each) for each in at]
        first = [each[0][0] for each in heights]
        columns = self.lines.series, scores[0], p[0], slips[0], own, depths, sides, first
        return list(map(_Fault, *columns))

    def other_source(self, fault: _Fault) -> str:
        """Return why the lines of a rolling element fault may have another source, or ""."""
        turns = {1.0} | {order for series in self.lines.series for _, order in series.sidebands}
        found = self.psd, fault.series, fault.slip, [*turns]
        reach = 1 / SETTINGS.longest
        if fault.series.slips and self.lines.height_between(*found, reach=reach) >= SETTINGS.comb:
            return "; the lines between them are as high, as with impacts of another source"
        return ""

    def wide(self) -> _Spectrum | None:
        """Return it with lines within the largest error of a speed, as far as it reaches."""
        orders, widest = self.lines.orders, max(SETTINGS.speed_error, self.lines.slip)
        top = orders[-2] / (1 + widest) - orders[1]
        cut = [replace(s, orders=tuple(o for o in s.orders if o <= top)) for s in self.lines.series]
        series = tuple(fault for fault in cut if len(fault.orders) > 1)
        if not series:
            return None
        return self._replace(lines=_line_levels(tuple(orders.tolist()), series, widest))

    def _modulations(self, fault: _Fault, turns: set[float]) -> list[float]:
        """Return which orders modulate a fault: its own, and those whose sidebands stand out."""
        asked = replace(fault.series, sidebands=tuple((str(turn), turn) for turn in turns))
        heights = self.lines.sidebands(self.psd, asked, fault.slip)
        own = {order for _, order in fault.series.sidebands}
        stands_out = {t for t in turns if heights.get(str(t), 0.0) >= SETTINGS.sidebands}
        # The shaft, and the cage, which slips as well.
        return [turn * slowed for turn in own | stands_out for slowed in (1.0, 1 + fault.slip)]

    def further(self, named: Sequence[str], rate: float, finest: LineLevels) -> _Fault | None:
        """Return the strongest fault that has lines which those named do not explain."""
        faults = self.faults()
        known = [fault for fault in faults if fault.series.name in named]
        least = max(np.mean(fault.heights) for fault in known) - SETTINGS.weaker
        turns = {order for fault in faults for _, order in fault.series.sidebands} | {1.0}
        explained = [
            self.lines.explained(fault.series, fault.slip, self._modulations(fault, turns))
            for fault in known
        ]
        rest = [
            fault
            for fault in self.faults(np.logical_or.reduce(explained))
            if fault.series.name not in named
            and self.lines.separates(fault.series) == finest.separates(fault.series)  # from shaft
            and not fault.modulated(faults)
            and fault.p <= rate / len(faults)
            and fault.score >= SETTINGS.named
            and not fault.depth < SETTINGS.depth  # it is NaN in a table
            and sorted(fault.heights)[-2:][0] >= SETTINGS.further
            and not fault.first < SETTINGS.further  # it is NaN where it is explained
            and np.mean(fault.heights) >= least
            and not fault.is_single
            and not self.other_source(fault)
        ]
        return max(rest, key=lambda fault: fault.score, default=None)


class _Measured(NamedTuple):
    """What is measured of one recording and channel.

    Attributes
    ----------
    number, channel : int, str
        Row or recording, and channel.
    spectrum, fine : _Spectrum, and sequence of _Spectrum
        Of segments for the average, and of longer ones.
    rpm : float
        Speed [1/min]; NaN for a table.
    defect : str
        Why nothing can be found in it, or "".
    """

    number: int
    channel: str
    spectrum: _Spectrum
    fine: Sequence[_Spectrum]
    rpm: float = np.nan
    defect: str = ""


class _Finding(NamedTuple):
    """What is named and suspected in a spectrum, with the scores of all faults, and why."""

    faults: list[_Fault]
    named: str
    suspected: str
    best: _Fault
    text: str

    @classmethod
    def of(
        cls, measured: _Measured, healthy: Sequence[float] | None, false_alarm: float
    ) -> _Finding:
        """Decide on what is measured."""
        faults, fine = measured.spectrum.faults(), measured.fine
        own = [fault for fault in faults if not fault.modulated(faults)] or faults
        best = max(own, key=lambda fault: fault.score)
        if measured.defect:
            return cls(faults, NOT_ASSESSED, NONE, best, f"not assessed: {measured.defect}")
        if false_alarm == 1:
            return cls(faults, best.series.name, NONE, best, _sentence(best, faults))
        reason = _reason(best, faults, healthy, false_alarm)
        margin = SETTINGS.suspected if reason else SETTINGS.named
        error = None if healthy else _speed_error(measured.spectrum.wide(), faults, false_alarm)
        is_higher = error is not None and error.score >= best.score + margin
        if error is not None and is_higher and not fine[0].other_source(error):
            text = f"not assessed: {_speed_text(measured.rpm, error)}"
            return cls(faults, NOT_ASSESSED, error.series.name, error, text)
        reason = reason or ("" if healthy else fine[0].other_source(best))
        if not reason:
            names, text, finest = [best.series.name], _sentence(best, faults), fine[0].lines
            while found := [f for s in fine if (f := s.further(names, false_alarm, finest))]:
                names.append(found[0].series.name)
                text += f"; {_sentence(found[0], faults)}"
            return cls(faults, " + ".join(names), NONE, best, text)
        passed = [fault for fault in faults if not _unlikely(fault, faults, false_alarm)]
        best = best if best in passed or not passed else max(passed, key=lambda f: f.score)
        causes = best.modulated(faults) or [best]
        suspected = " + ".join(f.series.name for f in causes) if passed and not healthy else NONE
        sentence = _sentence(best, faults)
        text = f"{'no fault' if suspected == NONE else f'{suspected} is suspected'}: {sentence}"
        return cls(faults, NONE, suspected, best, f"{text}{reason}")

    def columns(self) -> dict[str, Any]:
        """Return the columns of the row."""
        return {
            "named": self.named,
            "suspected": self.suspected,
            **{fault.series.name: fault.score for fault in self.faults},
            **{f"p({fault.series.name})": fault.p for fault in self.faults},
            "slip": self.best.slip,
        }


def _unlikely(fault: _Fault, faults: Sequence[_Fault], false_alarm: float) -> bool:
    """Tell whether a fault is not even suspected."""
    likely = fault.score >= SETTINGS.suspected and fault.p <= false_alarm / len(faults)
    return not likely or fault.is_single


def _reason(
    fault: _Fault, faults: Sequence[_Fault], healthy: Sequence[float] | None, false_alarm: float
) -> str:
    """Return why a fault is not named, or ""."""
    limit = SETTINGS.named
    if healthy is not None:
        limit = SETTINGS.suspected + healthy[faults.index(fault)]
    if fault.p > false_alarm / len(faults):
        return f", which background alone may reach (p = {fault.p:.2g})"
    if fault.score < limit:
        remedy = "" if healthy else "; healthy recordings of the machine would decide"
        return f"; its score of {fault.score:.1f} dB is below {limit:.1f} dB{remedy}"
    if fault.is_single:
        return "; a single line is a modulation, impacts have harmonics"
    if healthy is None and fault.depth < SETTINGS.depth:
        return (
            f"; they modulate the envelope by {100 * fault.depth:.1f} %, as those of healthy "
            f"machines do, which would decide"
        )
    return ""


def _speed_error(
    wide: _Spectrum | None, faults: Sequence[_Fault], false_alarm: float
) -> _Fault | None:
    """Return the strongest fault that would be named with another speed."""
    found = [
        fault
        for fault in (wide.faults() if wide is not None else ())
        if fault.series.slips
        and not fault.modulated(faults)
        and not _reason(fault, faults, None, false_alarm)
    ]
    return max(found, key=lambda fault: fault.score, default=None)


def _speed_text(rpm: float, fault: _Fault) -> str:
    """State the speed or geometry that fits the lines of a fault."""
    order = fault.series.orders[0]
    side = "above" if fault.slip > 0 else "below"
    text = (
        f"lines at {order * (1 + fault.slip):.3f} and multiples of it are like those of "
        f"{fault.series.name}, but {100 * abs(fault.slip):.1f} % {side} {order:.3f}"
    )
    rpm = rpm * (1 + fault.slip)
    if np.isnan(rpm):
        return f"{text}. Correct the speed or the geometry, or raise slip."
    remedy = "Otherwise correct the geometry, or raise slip."
    return f"{text}: is the speed {rpm:.0f} rpm, or the sampling rate wrong? {remedy}"


def _measured(
    X: Any, parts: Any, series: tuple[FaultSeries, ...], **options: Any
) -> Iterator[_Measured]:
    """Measure each recording and channel of recordings or of a table."""
    slip, channels = options["slip"], options["channels"]
    if column_names(X) is not None:
        for number, channel, spectrum in _of_table(X, series, slip, channels):
            yield _Measured(number, channel, spectrum, [spectrum])
        return
    top = highest_order(parts, options["harmonics"], slip)
    for index, recording in enumerate(as_recordings(X, "find_faults")):
        with located(partial(described, recording, index)):
            longest = longest_stroke(recording, top, channels, shortest=SETTINGS.shortest)
            revolutions = min(SETTINGS.longest, longest)
            recipe = bearing_recipe(parts, revolutions=revolutions, **options)
            envelope = recipe[:2].fit_transform([recording])
            over_angle = recipe[2].fit_transform(envelope)
            lengths = (revolutions, *(min(length, longest) for length in SETTINGS.fine))
            psds = (clone(recipe[3]).set_params(revolutions=length) for length in lengths)
            tables = (psd.fit_transform(over_angle) for psd in psds)
            paths, signals = recording.paths(), envelope[0].signals
            speed = sum(path.length for path in paths) / sum(path.n_times for path in paths)
            rpm = speed * recording.shaft_fs * 30 / np.pi
            spectra = (_of_table(table, series, slip, channels) for table in tables)
            for found in zip(*spectra, strict=True):
                channel = found[0][1]
                mean = float(np.mean(signals[channel]))
                spectrum, *fine = (each._replace(mean=mean) for *_, each in found)
                yield _Measured(index, channel, spectrum, fine, rpm, _defect(recording, channel))


def _defect(recording: Recording, channel: str) -> str:
    """Return why a channel carries no answer, or "". A vibration is no switch."""
    last = len(recording.velocity)
    starts = [round(path.start_time * recording.shaft_fs) for path in recording.paths()]
    spans = zip(starts, recording.paths(), strict=True)
    turning = [(start / last, (start + path.n_times) / last) for start, path in spans]
    settings = replace(CHANNEL_CHECKS, digital=1.0)
    return check_channel(recording.series[channel], channel, turning, settings=settings).text


def _of_table(
    table: Any, series: tuple[FaultSeries, ...], slip: float, channels: Any
) -> Iterator[tuple[int, str, _Spectrum]]:
    """Return the spectrum of each row and channel of a table."""
    # FaultLines checks the table: its axis, its values, its channels.
    lowest = {fault.name: fault.orders[0] for fault in series}
    checked = FaultLines(lowest, harmonics=1, channels=channels).fit(table)
    blocks = parse_order_columns(column_names(table) or ()) or ()
    block_of = {block.channel: block for block in blocks}
    rows = np.asarray(table, np.float64)
    for number, channel in product(range(len(rows)), checked.channels_):
        block = block_of[channel]
        psd = rows[number : number + 1, block.columns]
        lines = _line_levels(tuple(block.orders.tolist()), series, slip)
        yield number, channel, _Spectrum(lines, psd)


@lru_cache(maxsize=32)
def _line_levels(
    orders: tuple[float, ...], series: tuple[FaultSeries, ...], slip: float
) -> LineLevels:
    """Return the measurement for an order axis, with the backgrounds it has simulated."""
    background = min(LINES.background, SETTINGS.narrow * (orders[1] - orders[0]))
    return LineLevels(np.array(orders), series, slip, background, without_shaft=True)


def _sentence(fault: _Fault, faults: Sequence[_Fault]) -> str:
    """Describe the lines of a fault."""
    name, (*others, last) = fault.series.name, [f"{height:z.0f}" for height in fault.heights]
    lines = f"{name} and its harmonics are {', '.join(others)} and" if others else f"{name} is"
    beside = f", with {' and '.join(fault.sides)} sidebands" if fault.sides else ""
    kind = "" if fault.series.kind in ("", "given") else f": {fault.series.kind}"
    causes = [other.series.name for other in fault.modulated(faults)]
    cause = f", or the modulation of {' or '.join(causes)}" if causes else ""
    return f"{lines} {last} dB above the local background{beside}{kind}{cause}"
