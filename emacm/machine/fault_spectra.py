"""Envelope spectra of recordings with the lines of faults, and those of healthy recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emacm._checks import located
from emacm.envelopes.envelope_detector import EnvelopeDetector
from emacm.findings.quality import check_channel
from emacm.machine.bearing_recipe import envelope_spectra
from emacm.machine.fault_lines import FaultLines, LineLevels, resolved
from emacm.machine.fault_orders import FaultSeries, damage_series, gears_and_orders
from emacm.machine.plain_lines import PlainLines, measure_plain_lines
from emacm.orders.bins import Band
from emacm.orders.columns import column_names
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.inputs import as_recordings, check_channel_names, described, entry_name
from emacm.recordings.recording import Recording


class Fault(NamedTuple):
    """A fault in one spectrum.

    Attributes
    ----------
    series : FaultSeries
        Its lines.
    score, p, slip : float
        Level above that of background alone [dB], its p-value, and the slip of the lines.
    heights : list of float
        Height of each line that counts [dB].
    first : float
        Height of the lowest line [dB]; NaN where other faults explain it.
    depth : float
        Amplitude of the lines over the mean of the envelope; NaN in a table.
    sides : list of str
        Names of the modulations whose sidebands are above the background.
    healthy : float
        Highest score of healthy recordings [dB].
    """

    series: FaultSeries
    score: float
    p: float
    slip: float
    heights: list[float]
    first: float
    depth: float
    sides: list[str]
    healthy: float = 0.0

    @property
    def name(self) -> str:
        """Name of the fault."""
        return self.series.name

    @property
    def excess(self) -> float:
        """Score above that of healthy recordings [dB]."""
        return self.score - self.healthy

    @property
    def is_of_shaft(self) -> bool:
        """Whether it is a stated order 1 or 2: the shaft itself, which has no impacts."""
        return self.series.kind == "given" and not self.series.slips

    @property
    def is_single(self) -> bool:
        """Whether a fault of rolling elements has one line only, as a modulation has.

        Impacts have harmonics, of which the second highest is within 12 dB, or sidebands.
        """
        *_, second, highest = [-np.inf, *sorted(self.heights)]
        several = self.series.slips and len(self.heights) > 1
        return several and highest - second > 12.0 and not self.sides

    def modulated(self, faults: Sequence[Fault]) -> list[Fault]:
        """Return the faults that are modulated at the order of this one.

        A shaft has lines without any fault: it modulates only what has a score of 3 dB.
        """
        order, least = self.series.orders[0], -np.inf if self.series.slips else 3.0
        likely = [fault for fault in faults if fault.score >= least]
        return [f for f in likely if any(np.isclose(order, o) for _, o in f.series.sidebands)]


class Spectrum(NamedTuple):
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

    def faults(self, explained: NDArray[np.bool_] | None = None) -> list[Fault]:
        """Measure all faults, without the lines that are explained."""
        levels, slips, heights = self.lines.measure(self.psd, explained)
        scores, p_values = self.lines.compare(self.psd, levels)
        faults = []
        for number, series in enumerate(self.lines.series):
            slip, lines = slips[0, number], heights[number][0]
            sidebands = self.lines.sidebands(self.psd, series, slip)
            faults.append(
                Fault(
                    series,
                    scores[0, number],
                    p_values[0, number],
                    slip,
                    lines[np.isfinite(lines)].tolist(),
                    lines[0],
                    # The envelope of a dead channel is 0.
                    self.lines.amplitude(self.psd, series, slip) / (self.mean or np.nan),
                    [name for name, height in sidebands.items() if height >= 3.0],
                )
            )
        return faults

    def faults_at_other_speeds(self) -> list[Fault]:
        """Measure the faults within the largest error of a speed, as far as the spectrum reaches.

        A single line is no evidence of another speed.
        """
        orders, widest = self.lines.orders, max(0.1, self.lines.slip)
        top = orders[-2] / (1 + widest) - orders[1]
        cut = [fault.up_to(top) for fault in self.lines.series]
        series = tuple(fault for fault in cut if len(fault.orders) > 1)
        if not series:
            return []
        return self._replace(lines=_line_levels(tuple(orders.tolist()), series, widest)).faults()

    def has_other_source(self, fault: Fault) -> bool:
        """Return whether the lines of a rolling element fault may have another source.

        The lines between them are then at least 0.9 times as high, as with impacts of a belt: they
        are in 33 simulated machines (at least 0.93), not in the damaged rings of the drive end and
        of UESTC (at most 0.89).
        """
        turns = {1.0} | {order for series in self.lines.series for _, order in series.sidebands}
        lines = self.psd, fault.series, fault.slip, [*turns]
        # The slip is that of a spectrum of 25 revolutions.
        return fault.series.slips and self.lines.height_between(*lines, reach=1 / 25) >= 0.9

    def _modulations(self, fault: Fault, turns: set[float]) -> list[float]:
        """Return which orders modulate a fault: its own, and those whose sidebands stand out."""
        modulated = replace(fault.series, sidebands=tuple((str(turn), turn) for turn in turns))
        heights = self.lines.sidebands(self.psd, modulated, fault.slip)
        modulating = {order for _, order in fault.series.sidebands}
        modulating |= {turn for turn in turns if heights.get(str(turn), 0.0) >= 3.0}
        # The shaft, and the cage, which slips as well.
        return [turn * slowed for turn in modulating for slowed in (1.0, 1 + fault.slip)]

    def unexplained(self, named: Sequence[str]) -> list[Fault]:
        """Return the faults that have lines which those named do not explain.

        At least two of these lines (and the lowest one, unless it is explained) are 9 dB high, and
        their mean is at most 15 dB below that of the highest fault named: chosen on simulated
        bearings, also after a look at UESTC.
        """
        faults = self.faults()
        explaining = [fault for fault in faults if fault.name in named]
        least = max(np.mean(fault.heights) for fault in explaining) - 15.0
        turns = {order for fault in faults for _, order in fault.series.sidebands} | {1.0}
        explained = [
            self.lines.explained(fault.series, fault.slip, self._modulations(fault, turns))
            for fault in explaining
        ]
        return [
            fault
            for fault in self.faults(np.logical_or.reduce(explained))
            if fault.name not in named
            and not fault.modulated(faults)
            and sum(height >= 9.0 for height in fault.heights) >= min(2, len(fault.series.orders))
            and not fault.first < 9.0  # it is NaN where it is explained
            and np.mean(fault.heights) >= least
            and not fault.is_single
            and not self.has_other_source(fault)
        ]


class Measured(NamedTuple):
    """What is measured of one recording and channel.

    Attributes
    ----------
    number, channel : int, str
        Row or recording, and channel.
    spectrum, finer : Spectrum, and sequence of Spectrum
        Of segments for the average, and of longer ones.
    shift : float
        Fraction by which the harmonics of the shaft are shifted: not 0 if the speed is wrong.
        Within the slip, speed and spectra are corrected by it.
    rpm, fs : float
        Speed [1/min] and sampling rate [Hz]; NaN for a table.
    defect : str
        Why nothing can be found in it, or "".
    plain : PlainLines or None
        Lines of the signal itself; None for a table.
    bands : callable
        Returns bands [Hz] and the spectra of the envelope in each, without prewhitening: of
        segments of 25 and of 100 revolutions. None of a table.
    """

    number: int
    channel: str
    spectrum: Spectrum
    finer: Sequence[Spectrum]
    shift: float = 0.0
    rpm: float = np.nan
    fs: float = np.nan
    defect: str = ""
    plain: PlainLines | None = None
    bands: Callable[[], list[tuple[Band, Spectrum, Spectrum]]] = list

    @property
    def is_shifted(self) -> bool:
        """Whether the harmonics of the shaft show a wrong speed."""
        return abs(self.shift) > self.spectrum.lines.slip

    @property
    def correction(self) -> str:
        """At which speed it was measured, if not at the stated one."""
        if self.defect or self.shift == 0 or self.is_shifted:
            return ""
        return f" (speed corrected to {self.rpm:.0f} rpm by the harmonics of the shaft)"

    def of_mains(self, fault: Fault) -> str:
        """State that lines may be those of the mains, which are as periodic as impacts, or ""."""
        hertz = fault.series.orders[0] * (1 + fault.slip) * self.rpm / 60
        for mains in (50.0, 60.0):
            line = mains * max(round(hertz / mains), 1)
            if abs(hertz - line) <= 0.003 * hertz:
                return f"the mains may have lines at {line:.0f} Hz and multiples of it too"
        return ""

    def of_no_part(self) -> str:
        """State lines of impacts of no part, as of a bearing of another size than stated, or "".

        Not beside gears and other shafts, which have lines without impacts.
        """
        series = self.spectrum.lines.series
        if np.isnan(self.rpm) or not all(one.slips or one.orders[0] % 1 == 0 for one in series):
            return ""
        spectrum = self.finer[-1]
        order, heights = spectrum.lines.of_no_fault(spectrum.psd)
        if not heights:
            return ""
        first, second, third = (f"{height:.0f}" for height in heights)
        return (
            f"; lines near {order:.2f} and multiples of it, {first}, {second} and {third} dB high, "
            f"belong to no part that is stated: is the geometry right?"
        )

    def speed_text(self, fault: Fault | None) -> str:
        """State the speed or geometry that fits the lines of a fault, or those of the shaft."""
        factor = 1 + (self.shift if fault is None else fault.slip)
        text = f"harmonics of the shaft are at {factor:.3f} and multiples of it"
        if fault is not None:
            order, side = fault.series.orders[0], "above" if fault.slip > 0 else "below"
            text = (
                f"lines at {order * factor:.3f} and multiples of it are like those of "
                f"{fault.name}, but {100 * abs(fault.slip):.1f} % {side} {order:.3f}"
            )
        if np.isnan(self.rpm):
            return f"{text}. Correct the speed or the geometry, or raise slip."
        question = f"is the speed {self.rpm * factor:.0f} rpm, or the sampling rate wrong?"
        return f"{text}: {question} Otherwise correct the geometry, or raise slip."


def measured_spectra(X: Any, levels: FaultLines) -> Iterator[Measured]:
    """Measure the lines of some parts in each recording and channel of recordings or of a table.

    Parameters
    ----------
    X : list of Recording, or table
        As of `find_faults`.
    levels : FaultLines
        States parts, harmonics, slip and channels; it need not be fitted.

    Yields
    ------
    Measured
    """
    series = damage_series(levels.parts, levels.harmonics)
    if column_names(X) is not None:
        by_channel = _spectra(X, series, levels.slip, levels.channels)
        for number in range(len(np.asarray(X))):
            for channel, spectra in by_channel.items():
                yield Measured(number, channel, spectra[number], [spectra[number]])
        return
    for number, recording in enumerate(as_recordings(X, "find_faults")):
        with located(partial(described, recording, number)):
            yield from _of_recording(number, recording, levels, series)


class HealthyScores(NamedTuple):
    """Highest score of each fault in healthy recordings, not below 0 dB, of one channel.

    Attributes
    ----------
    fs : float
        Sampling rate [Hz]; NaN for a table.
    within_slip, other_speeds, in_bands : dict of str to float
        Score at the stated speed, within the largest error of it, and at the stated speed in the
        envelopes of bands without prewhitening [dB].
    plain : list of PlainLines
        Lines of the signals themselves.
    """

    fs: float
    within_slip: dict[str, float]
    other_speeds: dict[str, float]
    in_bands: dict[str, float]
    plain: list[PlainLines]


def healthy_scores(
    healthy: Any,
    parts: Any,
    *,
    harmonics: int = 3,
    slip: float = 0.02,
    channels: Sequence[str] | None = None,
) -> dict[str, HealthyScores]:
    """Return the highest score of each fault in healthy recordings, not below 0 dB, by channel.

    `find_faults` takes the result as `healthy`, so that many recordings can be judged one by one.

    Raises
    ------
    TypeError, ValueError
        As `find_faults`; also if the harmonics of the shaft show that a speed is wrong.
    """
    by_channel: dict[str, HealthyScores] = {}
    levels = FaultLines(parts, harmonics=harmonics, slip=slip, channels=channels)
    with located("healthy"):
        for measured in measured_spectra(healthy, levels):
            if measured.is_shifted:
                name = entry_name(healthy, measured.number)
                raise ValueError(f"{name}: {measured.speed_text(None)}")
            nothing = HealthyScores(measured.fs, {}, {}, {}, [])
            own = by_channel.setdefault(measured.channel, nothing)
            if measured.plain is not None:
                own.plain.append(measured.plain)
            spectrum = measured.spectrum
            for scores, faults in (
                (own.within_slip, spectrum.faults()),
                (own.other_speeds, spectrum.faults_at_other_speeds()),
                *((own.in_bands, coarse.faults()) for _, coarse, _ in measured.bands()),
            ):
                scores |= {f.name: max(f.score, scores.get(f.name, 0.0)) for f in faults}
    return by_channel


def _of_recording(
    number: int, stated: Recording, levels: FaultLines, series: Sequence[FaultSeries]
) -> Iterator[Measured]:
    """Measure each channel of a recording, after a small error of its speed is corrected."""
    slip, channels = levels.slip, levels.channels
    steps = envelope_spectra(series, slip, channels=channels).named_steps.values()
    prewhitening, detector, resampler, psd = steps
    top = psd.max_order
    _check_lines_are_inside(stated, top, channels)
    vibration = resampler.fit_transform([stated])
    shift = _shift_of_shaft(_order_spectra(vibration, stated, 100, top), top, levels)
    recording = _at_other_speed(stated, shift) if 0 < abs(shift) <= slip else stated
    envelope = detector.fit_transform(prewhitening.fit_transform([recording]))
    over_angle = resampler.fit_transform(envelope)
    # Lines of several faults are told apart in longer segments: 100 revolutions separate more of
    # them; in 50, those that slip has widened are higher.
    by_length = [
        _spectra(_order_spectra(over_angle, recording, revolutions, top), series, slip, channels)
        for revolutions in (25, 100, 50)
    ]
    paths = recording.paths()
    speed = sum(path.length for path in paths) / sum(path.n_times for path in paths)
    rpm = speed * recording.shaft_fs * 30 / np.pi
    plain = measure_plain_lines(recording, levels, int(longest_stroke(recording)))
    for channel in by_length[0]:
        mean = float(np.mean(envelope[0].signals[channel]))
        spectrum, *finer = (spectra[channel][0]._replace(mean=mean) for spectra in by_length)
        known = shift, rpm, recording.fs[channel], _defect(recording, channel), plain[channel]
        bands = partial(_in_bands, recording, channel, series, slip)
        yield Measured(number, channel, spectrum, finer, *known, bands)


def _in_bands(
    recording: Recording, channel: str, series: Sequence[FaultSeries], slip: float
) -> list[tuple[Band, Spectrum, Spectrum]]:
    """Return bands, and the spectra of the envelope of a channel in each, without prewhitening.

    The bands are octaves, from 15/32 of the sampling rate down to one that just holds the lines.
    """
    _, _, resampler, psd = envelope_spectra(series, slip).named_steps.values()
    highest_line = psd.max_order * np.abs(recording.velocity).max() / (2 * np.pi)
    edges = [recording.fs[channel] * k / 32 for k in (15, 8, 4, 2, 1)]
    while edges[-1] / 2 >= highest_line:
        edges.append(edges[-1] / 2)
    bands = [(low, high) for high, low in pairwise(edges)]
    detector = EnvelopeDetector(bands, squared=False)
    (envelope,) = detector.fit_transform([recording.select([channel])])
    over_angle = resampler.fit_transform([envelope])
    coarse, fine = (
        _spectra(_order_spectra(over_angle, recording, length, psd.max_order), series, slip)
        for length in (25, 100)
    )
    found = []
    for band, (name, signal) in zip(bands, envelope.signals.items(), strict=True):
        mean = float(np.mean(signal))
        if mean < 1e-4 * np.std(recording.signals[channel]):  # what the filter leaves of a tone
            continue
        (first,), (second,) = coarse[name], fine[name]
        found.append((band, first._replace(mean=mean), second._replace(mean=mean)))
    return found


def _check_lines_are_inside(recording: Recording, top: float, channels: Any) -> None:
    """Raise a ValueError if a recording is too short, or a sampling rate too low for the lines."""
    n_revolutions = longest_stroke(recording)
    fastest = np.abs(recording.velocity).max() / (2 * np.pi)
    speed = f"its speed (at most {60 * fastest:.4g} rpm)"
    if n_revolutions < 10:
        raise ValueError(
            f"its longest stroke has {n_revolutions:.3g} revolutions; 10 are needed to separate "
            f"the lines of the faults. Check {speed}, its duration ({recording.duration:.3g} s) "
            f"and the units of both, or give a longer recording."
        )
    for name in recording.channels if channels is None else channels:
        check_channel_names(recording.channels, [name])
        width = 7 / 16 * recording.fs[name]  # of the envelope of the whole band
        if top * fastest > width:
            raise ValueError(
                f"the lines of the faults reach order {top:.4g}, {top * fastest:.4g} Hz at its "
                f"highest speed, but the envelope of channel {name!r}, sampled at "
                f"{recording.fs[name]:g} Hz, ends at {width:.4g} Hz. "
                f"Check {speed}, this rate and the units of both, or lower harmonics."
            )


def longest_stroke(recording: Recording) -> float:
    """Return the length of the longest stroke [revolutions]."""
    return max((path.length for path in recording.paths()), default=0.0) / (2 * np.pi)


def _at_other_speed(recording: Recording, shift: float) -> Recording:
    """Return a recording whose stated speed is changed by a fraction."""
    motion = (1 + shift) * getattr(recording, recording.reference)
    shaft: dict[str, Any] = {recording.reference: motion, "shaft_fs": recording.shaft_fs}
    return Recording(recording.signals, recording.fs, **shaft, meta=recording.meta)


def _order_spectra(over_angle: Any, recording: Recording, revolutions: int, top: float) -> Any:
    """Return the order spectra of segments that are no longer than the recording."""
    length = min(revolutions, int(longest_stroke(recording)))
    return OrderPSD(length, max_order=top).fit_transform(over_angle)


def _shift_of_shaft(table: Any, top: float, levels: FaultLines) -> float:
    """Return by which fraction the first six harmonics of the shaft are shifted.

    It is 0 if their mean height is below 10 dB, or if they are shifted by 0.5 % at most, which
    changes nothing. Beyond that, and beyond the slip, they must be higher by 6 dB than within.
    """
    rounded, widest = 0.005, max(0.1, levels.slip)
    n_lines = min(6, int(top / (1 + widest) - 0.1))
    if n_lines < 3:
        return 0.0
    n_shifts = round(20 * widest / rounded)
    shifts = widest / n_shifts * np.arange(-n_shifts, n_shifts + 1)
    # Harmonics of a slower shaft of a gear are no harmonics of this shaft at another speed.
    turns = [line.order for gear in gears_and_orders(levels.parts)[0] for line in gear.lines()[1:3]]
    slower = np.array([turn for turn in turns if turn < 1 - widest])
    multiples = (1 + shifts)[:, np.newaxis] / slower
    of_gear = (np.abs(multiples - np.rint(multiples)) * slower < 2 * rounded).any(axis=1)
    places = np.outer(1 + shifts, np.arange(1.0, n_lines + 1))
    shaft = [FaultSeries("shaft", (1.0,), slips=False)]
    shown = []
    for (spectrum,) in _spectra(table, shaft, 0.0, levels.channels).values():
        heights = np.maximum(spectrum.lines.heights(spectrum.psd)[0], 0.0)
        lines = np.interp(places, spectrum.lines.orders, heights)
        means, highest, best = lines.mean(axis=1), -np.inf, 0
        for reach in (rounded, levels.slip, widest):
            likely = (np.abs(shifts) <= reach) & ((np.abs(shifts) <= rounded) | ~of_gear)
            place = int(np.where(likely, means, -np.inf).argmax())
            if means[place] >= highest + 6.0:
                highest, best = means[place], place
        # Two lines may be those of a bearing: 3.08 and 6.17 are near 3x and 6x.
        if highest >= 10.0 and np.count_nonzero(lines[best] >= 9.0) > n_lines / 3:
            shown.append(shifts[best])
    shift = float(np.median(shown or [0.0]))
    return shift if abs(shift) > rounded else 0.0


def _defect(recording: Recording, channel: str) -> str:
    """Return why a channel carries no answer, or "". A vibration is no switch."""
    last, series = len(recording.velocity), recording.series[channel]
    if 1 < len(np.unique(series[:4096])) <= 3:
        return f"channel {channel!r} has at most 3 values: cable or sensor?"
    spans = [path.span for path in recording.paths()]
    turning = [(start / last, stop / last) for start, stop in spans]
    defect = check_channel(series, channel, turning, may_be_switch=False).defect
    return "" if defect is None else defect.text


def _spectra(
    table: Any, series: Sequence[FaultSeries], slip: float, channels: Sequence[str] | None = None
) -> dict[str, list[Spectrum]]:
    """Return the spectrum of each row of a table, by channel."""
    highest = max(series, key=lambda fault: fault.orders[0])
    lowest_line = {highest.name: highest.orders[0]}
    # FaultLines checks the table: its axis, its values, its channels.
    checked = FaultLines(lowest_line, harmonics=1, channels=channels).fit(table)
    psd, by_channel = np.asarray(table, np.float64), {}
    for channel, (columns, known) in checked._levels.items():
        orders = tuple(known.orders.tolist())
        lines = _line_levels(orders, resolved(series, orders), slip)
        by_channel[channel] = [Spectrum(lines, row[np.newaxis, columns]) for row in psd]
    return by_channel


@lru_cache(maxsize=32)
def _line_levels(
    orders: tuple[float, ...], series: tuple[FaultSeries, ...], slip: float
) -> LineLevels:
    """Return the measurement for an order axis, with the backgrounds it has simulated.

    The background is at most 12 spectral lines on either side: strong lines are widened by random
    slip, and their skirts are no lines of other faults.
    """
    background = min(0.5, 12.5 * (orders[1] - orders[0]))
    return LineLevels(np.array(orders), series, slip, background, without_shaft=True)
