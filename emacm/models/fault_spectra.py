"""Envelope spectra of recordings with the lines of the faults of a machine, for `find_faults`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sklearn.base import clone

from emacm._checks import located
from emacm.findings.quality import check_channel
from emacm.machine.fault_lines import SETTINGS as LINES
from emacm.machine.fault_lines import FaultLines, LineLevels
from emacm.machine.fault_orders import FaultSeries
from emacm.models.recipes import bearing_recipe, highest_order, longest_stroke
from emacm.orders.columns import column_names, parse_order_columns
from emacm.recordings.inputs import as_recordings, described
from emacm.recordings.recording import Recording


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
    shaft_lines : int
        Harmonics of the shaft in the spectrum of the vibration, which show a wrong speed.
    shaft_height : float
        Their mean height from which on they do [dB]; it was set before any was measured.
    rounded : float
        Error of a speed, as a fraction, that changes nothing.
    n_values : int
        Different values of a channel that is not connected.
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
    shaft_lines: int = 6
    shaft_height: float = 10.0
    rounded: float = 0.005
    n_values: int = 3
    narrow: float = 12.5
    comb: float = 0.9


SETTINGS = NamingSettings()


class Fault(NamedTuple):
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

    def modulated(self, faults: Sequence[Fault]) -> list[Fault]:
        """Return the faults that are modulated at the order of this one.

        A shaft modulates only what has lines of its own: it has lines without any fault.
        """
        order, least = self.series.orders[0], -np.inf if self.series.slips else SETTINGS.suspected
        own = [fault for fault in faults if fault.score >= least]
        return [f for f in own if any(np.isclose(order, o) for _, o in f.series.sidebands)]


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
        scores, p = self.lines.compare(self.psd, levels)
        own = [each[0][np.isfinite(each[0])].tolist() for each in heights]
        at = list(zip(self.lines.series, slips[0], strict=True))
        mean = self.mean or np.nan  # of a dead channel
        depths = [self.lines.amplitude(self.psd, *each) / mean for each in at]
        sides = [self.lines.sidebands(self.psd, *each) for each in at]
        first = [each[0][0] for each in heights]
        columns = self.lines.series, scores[0], p[0], slips[0], own, depths, sides, first
        return list(map(Fault, *columns))

    def other_source(self, fault: Fault) -> str:
        """Return why the lines of a rolling element fault may have another source, or ""."""
        turns = {1.0} | {order for series in self.lines.series for _, order in series.sidebands}
        found = self.psd, fault.series, fault.slip, [*turns]
        reach = 1 / SETTINGS.longest
        if fault.series.slips and self.lines.height_between(*found, reach=reach) >= SETTINGS.comb:
            return "; the lines between them are as high, as with impacts of another source"
        return ""

    def wide(self) -> Spectrum | None:
        """Return it with lines within the largest error of a speed, as far as it reaches."""
        orders, widest = self.lines.orders, max(SETTINGS.speed_error, self.lines.slip)
        top = orders[-2] / (1 + widest) - orders[1]
        cut = [replace(s, orders=tuple(o for o in s.orders if o <= top)) for s in self.lines.series]
        series = tuple(fault for fault in cut if len(fault.orders) > 1)
        if not series:
            return None
        return self._replace(lines=_line_levels(tuple(orders.tolist()), series, widest))

    def _modulations(self, fault: Fault, turns: set[float]) -> list[float]:
        """Return which orders modulate a fault: its own, and those whose sidebands stand out."""
        asked = replace(fault.series, sidebands=tuple((str(turn), turn) for turn in turns))
        heights = self.lines.sidebands(self.psd, asked, fault.slip)
        own = {order for _, order in fault.series.sidebands}
        stands_out = {t for t in turns if heights.get(str(t), 0.0) >= SETTINGS.sidebands}
        # The shaft, and the cage, which slips as well.
        return [turn * slowed for turn in own | stands_out for slowed in (1.0, 1 + fault.slip)]

    def further(
        self, named: Sequence[str], possible: Sequence[str], rate: float, finest: LineLevels
    ) -> Fault | None:
        """Return the strongest possible fault that has lines which those named do not explain."""
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
            if fault.series.name in possible
            and fault.series.name not in named
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


class Measured(NamedTuple):
    """What is measured of one recording and channel.

    Attributes
    ----------
    number, channel : int, str
        Row or recording, and channel.
    spectrum, fine : Spectrum, and sequence of Spectrum
        Of segments for the average, and of longer ones.
    shift : float
        Fraction by which the harmonics of the shaft are shifted: not 0 if the speed is wrong.
        Within the slip, speed and spectra are corrected by it.
    rpm : float
        Speed [1/min]; NaN for a table.
    defect : str
        Why nothing can be found in it, or "".
    """

    number: int
    channel: str
    spectrum: Spectrum
    fine: Sequence[Spectrum]
    shift: float = 0.0
    rpm: float = np.nan
    defect: str = ""

    def corrected(self) -> str:
        """Say at which speed it was measured, if not at the stated one."""
        if self.defect or not 0 < abs(self.shift) <= self.spectrum.lines.slip:
            return ""
        return f" (speed corrected to {self.rpm:.0f} rpm by the harmonics of the shaft)"


def measured_spectra(
    X: Any, parts: Any, series: tuple[FaultSeries, ...], **options: Any
) -> Iterator[Measured]:
    """Measure each recording and channel of recordings or of a table."""
    slip, channels = options["slip"], options["channels"]
    if column_names(X) is not None:
        for number, channel, spectrum in _of_table(X, series, slip, channels):
            yield Measured(number, channel, spectrum, [spectrum])
        return
    top = highest_order(parts, options["harmonics"], slip)
    for index, recording in enumerate(as_recordings(X, "find_faults")):
        with located(partial(described, recording, index)):
            longest = longest_stroke(recording, top, channels, shortest=SETTINGS.shortest)
            recipe = bearing_recipe(parts, **options)
            vibration = clone(recipe[2]).fit_transform([recording])
            psd = recipe[3].set_params(revolutions=min(SETTINGS.fine[0], longest))
            shift = _shift_of_shaft(psd.fit_transform(vibration), top, slip, channels)
            if 0 < abs(shift) <= slip:
                motion = (1 + shift) * getattr(recording, recording.reference)
                options_of = {recording.reference: motion, "shaft_fs": recording.shaft_fs}
                recording = Recording(recording.signals, recording.fs, **options_of)
                longest = longest_stroke(recording, top, channels, shortest=1)
            paths = recording.paths()
            speed = sum(path.length for path in paths) / sum(path.n_times for path in paths)
            rpm = speed * recording.shaft_fs * 30 / np.pi
            envelope = recipe[:2].fit_transform([recording])
            over_angle = recipe[2].fit_transform(envelope)
            lengths = [min(length, longest) for length in (SETTINGS.longest, *SETTINGS.fine)]
            psds = (clone(psd).set_params(revolutions=length) for length in lengths)
            tables = (psd.fit_transform(over_angle) for psd in psds)
            spectra = (_of_table(table, series, slip, channels) for table in tables)
            for found in zip(*spectra, strict=True):
                channel = found[0][1]
                mean = float(np.mean(envelope[0].signals[channel]))
                spectrum, *fine = (each._replace(mean=mean) for *_, each in found)
                about = shift, rpm, _defect(recording, channel)
                yield Measured(index, channel, spectrum, fine, *about)


def _shift_of_shaft(table: Any, top: float, slip: float, channels: Any) -> float:
    """Return by which fraction the harmonics of the shaft are shifted.

    It is 0 if they are not clear, or shifted by `rounded` at most. Beyond that, and beyond the
    slip, they must be higher by `named` than within.
    """
    widest = max(SETTINGS.speed_error, slip)
    n_lines = min(SETTINGS.shaft_lines, int(top / (1 + widest) - 0.1))
    if n_lines < 3:
        return 0.0
    orders = np.arange(1.0, n_lines + 1)
    n_shifts = round(20 * widest / SETTINGS.rounded)
    shifts = widest / n_shifts * np.arange(-n_shifts, n_shifts + 1)
    found = []
    for *_, spectrum in _of_table(table, (FaultSeries("shaft", (1.0,), False),), slip, channels):
        heights = np.maximum(spectrum.lines.heights(spectrum.psd)[0], 0.0)
        lines = np.interp(np.outer(1 + shifts, orders), spectrum.lines.orders, heights)
        levels, level, shift = lines.mean(axis=1), -np.inf, 0.0
        for reach in (SETTINGS.rounded, slip, widest):
            best = np.where(np.abs(shifts) <= reach, levels, -np.inf).argmax()
            if levels[best] >= level + SETTINGS.named:
                level, shift = levels[best], shifts[best]
        if level >= SETTINGS.shaft_height:
            found.append(shift)
    shift = float(np.median(found or [0.0]))
    return shift if abs(shift) > SETTINGS.rounded else 0.0


def _defect(recording: Recording, channel: str) -> str:
    """Return why a channel carries no answer, or "". A vibration is no switch."""
    last = len(recording.velocity)
    starts = [round(path.start_time * recording.shaft_fs) for path in recording.paths()]
    spans = zip(starts, recording.paths(), strict=True)
    turning = [(start / last, (start + path.n_times) / last) for start, path in spans]
    if 1 < len(np.unique(recording.series[channel][:4096])) <= SETTINGS.n_values:
        return f"channel {channel!r} has at most {SETTINGS.n_values} values: cable or sensor?"
    check = check_channel(recording.series[channel], channel, turning, may_be_switch=False)
    return "" if check.defect is None else check.defect.text


def _of_table(
    table: Any, series: tuple[FaultSeries, ...], slip: float, channels: Any
) -> Iterator[tuple[int, str, Spectrum]]:
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
        yield number, channel, Spectrum(lines, psd)


@lru_cache(maxsize=32)
def _line_levels(
    orders: tuple[float, ...], series: tuple[FaultSeries, ...], slip: float
) -> LineLevels:
    """Return the measurement for an order axis, with the backgrounds it has simulated."""
    background = min(LINES.background, SETTINGS.narrow * (orders[1] - orders[0]))
    return LineLevels(np.array(orders), series, slip, background, without_shaft=True)
