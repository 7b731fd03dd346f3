"""Quality of a recording over the shaft angle: revolutions, speeds, highest order, findings.

A channel that is computed when it is read, such as an envelope, is judged by the measured signal
it is computed from. At most 32,768 values in 32 blocks are read, so that a recording that is larger
than memory costs no more than a short one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from emacm.recordings.recording import Recording
from emacm.resampling.angle_recording import AngleRecording, jump_warning
from emacm.resampling.spreading import DESIGN
from emacm.shaft.motion import Series, ShaftPath, blocks, sources

Array = NDArray[np.float64]


class Finding(NamedTuple):
    """A warning about a recording: its kind, and a sentence."""

    kind: str
    text: str


class Quality(NamedTuple):
    """Properties of one recording that are known without resampling it.

    Attributes
    ----------
    row : dict of str to float
        The columns of `OrderResampler.quality` except the last one.
    rates, levels : dict of str to float
        Sampling rate [Hz] and level (root mean square about the mean) of each channel.
    units : dict of str to str
        Unit of each channel of which one is stated.
    findings : tuple of Finding
        Warnings about the recording.
    has_jump : bool
        Whether the shaft reference has an isolated jump of any size, which no real motion has.
    forward : float
        Fraction of the revolutions that are forward; NaN without strokes.
    """

    row: dict[str, float]
    rates: dict[str, float]
    levels: dict[str, float]
    units: dict[str, str]
    findings: tuple[Finding, ...]
    has_jump: bool
    forward: float = np.nan

    @property
    def warnings(self) -> str:
        """The findings as one text."""
        return "; ".join(finding.text for finding in self.findings)


def recording_quality(row: AngleRecording) -> Quality:
    """Return the properties of a recording; they are computed once, and nothing is resampled.

    Parameters
    ----------
    row : AngleRecording
        The recording, and how it is to be resampled.

    Returns
    -------
    Quality
    """
    options = (row.channels, row.theta_s, row.min_speed, row.direction, row.ratio, row.max_rest)
    return row.measured.once(("quality", *options), lambda: _quality(row))


def _quality(over_angle: AngleRecording) -> Quality:
    recording, names, ratio = over_angle.measured, over_angle.channels, over_angle.ratio
    velocity, fs, low = recording.velocity, recording.shaft_fs, over_angle.min_speed
    # What "travel" joins is judged stroke by stroke.
    joined = over_angle.direction == "travel"
    paths = (replace(over_angle, direction="strokes") if joined else over_angle).paths
    spans = [(start := round(path.start_time * fs), start + path.n_times) for path in paths]
    ranges = [speed_range(velocity[start:stop]) for start, stop in spans]
    turned = [path.length / (2 * np.pi) for path in paths]
    slowest_speed = min((least for least, _ in ranges), default=0.0)
    fastest = ratio * max((most for _, most in ranges), default=0.0)
    limits = {name: _highest_frequency(recording, name) for name in names}
    slowest = min(names, key=limits.__getitem__)
    always = spans == [(0, len(velocity))] and slowest_speed > low
    standing = 0.0 if always else float(np.mean(np.abs(velocity) <= low))
    row: dict[str, float] = {
        "revolutions": float(sum(turned)),
        "strokes": len(paths),
        "longest_stroke": float(max(turned, default=0.0)),
        "standing": standing,
        "slowest": ratio * slowest_speed,
        "fastest": fastest,
        "max_order": limits[slowest] / (fastest / (2 * np.pi)) if fastest else np.inf,
    }
    parts = [(start / len(velocity), stop / len(velocity)) for start, stop in spans]
    checks = {name: check_channel(recording.series[name], name, parts) for name in names}
    n_short = sum(length < 1 for length in turned)
    defects = [*_motion_findings(over_angle, row, slowest, n_short)]
    defects += [Finding(check.defect, check.text) for check in checks.values() if check.defect]
    rates = {name: recording.fs[name] for name in names}
    levels = {name: check.level for name, check in checks.items()}
    units = {name: unit for name, unit in recording.units.items() if name in names}
    has_jump = recording.jump is not None
    return Quality(row, rates, levels, units, tuple(defects), has_jump, forward_share(paths))


def speed_range(velocity: NDArray[np.floating]) -> tuple[float, float]:
    """Return the lowest and the highest speed of velocities in either direction.

    Examples
    --------
    >>> speed_range(np.array([-3.0, -2.0])), speed_range(np.array([-3.0, 1.0]))
    ((2.0, 3.0), (1.0, 3.0))
    """
    low, high = float(velocity.min()), float(velocity.max())
    lowest = float(np.abs(velocity).min()) if low < 0 < high else min(abs(low), abs(high))
    return lowest, max(-low, high)


def forward_share(paths: Sequence[ShaftPath]) -> float:
    """Return the fraction of the travel along strokes that is forward; NaN without strokes."""
    turned = sum(path.length for path in paths)
    forward = sum(path.length for path in paths if path.direction > 0)
    return float(forward / turned) if turned else np.nan


def _highest_frequency(recording: Recording, channel: str) -> float:
    """Return half the sampling rate of a channel, or the bandwidth of an envelope [Hz]."""
    bandwidth = getattr(recording.series[channel], "bandwidth", np.inf)
    return min(recording.fs[channel] / 2, float(bandwidth))


def _motion_findings(
    over_angle: AngleRecording, row: dict[str, float], slowest: str, n_short: int
) -> Iterator[Finding]:
    recording, theta_s = over_angle.measured, over_angle.theta_s
    if not row["strokes"]:
        yield Finding("standstill", "the shaft never turns")
    if DESIGN.flat * np.pi / theta_s > row["max_order"]:
        text = (
            f"channel {slowest!r} has no content above order {row['max_order']:.4g} at the highest "
            f"speed (half its sampling rate, or the width of the band of an envelope), though "
            f"theta_s reaches order {np.pi / theta_s:.4g}"
        )
        yield Finding("order", text)
    if n_short > 10:  # so many look like noise
        text = "strokes of less than a revolution: raise min_speed above the noise at standstill"
        yield Finding("short strokes", f"{n_short} {text}")
    turned = row["fastest"] / over_angle.ratio / recording.shaft_fs
    if recording.reference == "angle" and turned > np.pi:  # samples of a speed may be slow
        text = "the shaft turns by more than half a revolution between its samples: "
        yield Finding("speed", text + "is the angle in rad, and its rate right?")
    jump, text = jump_warning(recording)
    if jump * over_angle.ratio > theta_s:
        yield Finding("jump", text)


@dataclass(frozen=True)
class ChannelCheckSettings:
    """Limits of `check_channel`.

    No benchmark of this repository repeats their choice;
    ``pytest tests/resampling/test_channel_checks.py`` has the channels without a defect that must
    not be reported, and defects that must be.

    Attributes
    ----------
    n_blocks, block : int
        Number and length of the blocks of a long channel that are read.
    clipped, held : int
        Equal samples in succession: at the extremes, and anywhere.
    stretches : int
        Fewest stretches of them, or wrap-arounds; fewer may be coincidence, or the machine at rest.
    few : float
        Fraction of equal neighbours below which nothing is clipped or lost.
    sharp : float
        Smallest step at the end of a stretch, in usual steps: those of a signal that comes to rest
        are smaller.
    gap : int
        Equal samples of a single gap: a little less than 5 ms at 10 kHz.
    chance : float
        Probability of so many by coincidence.
    rough : float
        Usual step of a signal that has no plateaus, in standard deviations.
    near : int
        Samples before and after a gap in which the signal is active.
    fine : float
        Smallest step, in usual steps, of a signal that noise changes even at standstill.
    digital : float
        Fraction of time at constant values above which a signal is a switch.
    lost : float
        Fraction of time in drop-outs from which they are reported. It is low, as the blocks may
        contain few of the drop-outs: 2 % in gaps of 5 ms at 50 kHz are three gaps in 32 blocks.
    leap : float
        Step at the end of a gap, in usual steps, of a smooth signal: one that has come to rest
        starts more slowly.
    offset : float
        Largest middle of the range, in standard deviations. There, one step of float32 or of a
        converter of 24 bits is up to 1/280 of a standard deviation. A temperature of 300 K with
        noise of 0.02 K, and a supply of 24 V with a ripple of 1 mV, remain below.
    far : float
        Size of a wrap-around, in ranges of the signal.
    close : float
        What it lacks to the full range (median), in ranges: the true step. Of the largest steps of
        rolling bearings it is 0.2 and more, of tones up to a third of the sampling rate 0.17.
    beside : float
        Largest step beside a wrap-around, in true steps (medians); of faster tones 2.5 and more.
    onward : float
        Fraction of wrap-arounds beside which the signal does not move back: 1/2 of the edges of a
        square wave with noise, 0.83 and more of wrap-arounds.
    turns : float
        Fraction of wrap-arounds that are followed by one back: none of a wrapped angle.
    between : float
        Fraction of time in the middle half of the range: none of a switch.
    """

    n_blocks: int = 32
    block: int = 1024
    clipped: int = 3
    held: int = 16
    stretches: int = 5
    few: float = 1e-3
    sharp: float = 0.3
    gap: int = 48
    chance: float = 1e-6
    rough: float = 0.1
    near: int = 8
    fine: float = 0.02
    digital: float = 0.9
    lost: float = 0.005
    leap: float = 5.0
    offset: float = 3e4
    far: float = 0.75
    close: float = 0.17
    beside: float = 2.2
    onward: float = 0.75
    turns: float = 0.2
    between: float = 0.1


CHANNEL_CHECKS = ChannelCheckSettings()


class ChannelCheck(NamedTuple):
    """Level and defect of one channel.

    Attributes
    ----------
    level : float
        Root mean square of the deviations from the mean, in the unit of the channel.
    defect : {"", "constant", "offset", "wrap-around", "clipped", "drop-outs"}
        What is wrong; empty if nothing.
    text : str
        Description of the defect.
    """

    level: float
    defect: str
    text: str


def check_channel(
    series: Series,
    name: str,
    turning: Sequence[tuple[float, float]] = (),
    *,
    settings: ChannelCheckSettings = CHANNEL_CHECKS,
) -> ChannelCheck:
    """Return the level and the defect of one channel.

    Parameters
    ----------
    series : Series
        The channel.
    name : str
        Its name.
    turning : sequence of (float, float)
        Begin and end of each stroke of the shaft, as fractions of the duration.
    settings : ChannelCheckSettings
        Limits of the check.

    Returns
    -------
    ChannelCheck

    Notes
    -----
    A channel is clipped if it stays at its largest or smallest value at least five times for three
    or more samples, and reaches this value by steps of the usual size. A coarsely quantised signal
    with a smooth maximum reaches it by small steps, so it is not clipped. Drop-outs are stretches
    of 16 or more equal samples, at any value, that begin and end with such steps. A single one of
    48 or more is sufficient where the shaft turns, if the signal has no plateaus and so many equal
    samples are no coincidence; of a smooth signal one of 16, if it ends with a leap of five usual
    steps. Signals with few values (switches) are left out.

    An offset is reported above 30,000 standard deviations, where few digits are left for the
    signal. Integers that overflow jump to and fro between both extremes, by the range less a usual
    step. They are recognised if the signal is smooth enough to move by less than about 0.15 of the
    range per sample: in white noise, a wrap-around looks like any other step.

    Examples
    --------
    >>> wave = np.sin(np.arange(4000.0))
    >>> check_channel(np.clip(wave, -0.5, 0.5), "current").text
    "channel 'current' is clipped at 0.5"
    >>> check_channel(np.zeros(100), "current").defect
    'constant'
    """
    series = sources(series)[0]
    rows, starts = _sampled(series, settings)
    low, high, n = float(rows.min()), float(rows.max()), len(series)
    largest = max(high, -low) or 1.0
    if low == high and all((block == rows[0, 0]).all() for _, block in blocks(series)):
        text = f"channel {name!r} is constant ({rows[0, 0]:.4g}): cable or sensor?"
        return ChannelCheck(0.0, "constant", text)
    scaled = rows / largest  # squares of any finite value
    level, middle, where = float(scaled.std()), (low + high) / 2, 0.0
    steps, far = np.diff(scaled, axis=1), settings.far * (high - low) / largest
    sizes = np.abs(steps)
    if low < high and abs(middle) > settings.offset * level * largest:
        defect = "offset"
    elif sizes.max(initial=0.0) > far and _wraps_around(scaled, steps, sizes > far, settings):
        defect = "wrap-around"
    else:
        parts = [(a * n, b * n) for a, b in turning]
        defect, where = _flat_stretches(scaled, sizes, starts, parts, settings)
    texts = {
        "offset": f"has an offset of {middle:.4g} and a level of {level * largest:.2g}: "
        f"measure it with AC coupling, or leave it out",
        "wrap-around": "jumps from one extreme to the other: do its integers overflow?",
        "clipped": f"is clipped at {where * largest:.4g}",
        "drop-outs": f"has drop-outs: in {100 * where:.2g} % of the time it is constant",
    }
    return ChannelCheck(level * largest, defect, defect and f"channel {name!r} {texts[defect]}")


def _sampled(series: Series, settings: ChannelCheckSettings) -> tuple[Array, NDArray[np.intp]]:
    """Return blocks of a channel, evenly spread, shape (n_blocks, n_times), and their begins."""
    length = len(series)
    if length <= settings.n_blocks * settings.block:
        return np.asarray(series[:], np.float64)[np.newaxis], np.zeros(1, np.intp)
    starts = np.linspace(0, length - settings.block, settings.n_blocks).astype(np.intp)
    blocks_of = [series[start : start + settings.block] for start in starts.tolist()]
    return np.array(blocks_of, np.float64), starts


def _wraps_around(
    rows: Array, steps: Array, is_far: NDArray[np.bool_], settings: ChannelCheckSettings
) -> bool:
    """Return whether a continuous signal jumps to and fro between its extremes.

    It goes on beyond the extreme, and each jump is the range less a usual step. A switch has no
    values in between, an impulse or a fast tone has large steps beside its largest one.
    """
    span = np.ptp(rows)
    block, place = np.nonzero(is_far)
    if len(place) < settings.stretches:
        return False
    ways = np.sign(steps[is_far])
    padded = np.pad(steps, ((0, 0), (1, 1)))
    beside = np.array([padded[block, place], padded[block, place + 2]])
    is_jump = np.abs(beside) > settings.far * span  # noise crosses the limit several times
    largest = np.where(is_jump.all(axis=0), np.inf, np.abs(beside * ~is_jump).max(axis=0))
    between = np.abs(rows - (rows.max() + rows.min()) / 2) < span / 4
    missing = np.median(span - np.abs(steps[is_far])) + np.abs(steps[steps != 0]).min()
    is_smooth = np.median(largest) < settings.beside * missing and missing < settings.close * span
    goes_on = np.mean(beside.sum(axis=0) * ways <= 0) > settings.onward
    turns = np.mean(ways[1:] != ways[:-1]) > settings.turns
    return bool(is_smooth and goes_on and turns and between.mean() > settings.between)


def _flat_stretches(
    rows: Array,
    steps: Array,
    starts: NDArray[np.intp],
    turning: Sequence[tuple[float, float]],
    settings: ChannelCheckSettings,
) -> tuple[str, float]:
    """Return the defect, and the value it is clipped at or the fraction of time it is constant.

    Parameters
    ----------
    rows : ndarray of shape (n_blocks, n_times)
        Blocks of the channel.
    steps : ndarray of shape (n_blocks, n_times - 1)
        Sizes of their steps.
    starts : ndarray of shape (n_blocks,)
        Samples at which they begin.
    turning : sequence of (float, float)
        Samples at which strokes of the shaft begin and end.
    settings : ChannelCheckSettings
        Limits of the check.

    Returns
    -------
    defect : {"", "clipped", "drop-outs"}
    where : float
    """
    equal = steps == 0
    if equal.mean() < settings.few or equal.all():
        return "", 0.0
    # Stretches of equal samples; a column of other steps keeps the blocks apart.
    flat = np.pad(equal, ((0, 0), (1, 1))).ravel().astype(np.int8)
    changes = np.diff(flat)
    first, last = np.flatnonzero(changes == 1), np.flatnonzero(changes == -1)
    around = np.pad(steps, ((0, 0), (1, 1))).ravel()  # the outermost steps are not known
    outer = np.array([around[first], around[last + 1]])
    usual, finest = float(np.median(steps[~equal])), float(steps[~equal].min())
    step = max(settings.sharp * usual, 1.5 * finest)  # a signal that comes to rest has smaller ones
    sharp = outer.max(axis=0) > step
    lengths = last - first + 1  # samples
    width = rows.shape[1] + 1
    values = rows[first // width, first % width]
    for extreme in (rows.max(), rows.min()):
        here = (lengths >= settings.clipped) & (values == extreme)
        if np.count_nonzero(here & sharp) >= max(settings.stretches, 0.5 * np.count_nonzero(here)):
            return "clipped", float(extreme)
    held = lengths >= settings.held
    share = float(lengths[held].sum() / rows.size)
    are_many = np.count_nonzero(held & sharp) >= settings.stretches
    if are_many and settings.lost < share < settings.digital:
        return "drop-outs", share
    # A single gap counts while the shaft turns, in a signal whose samples differ otherwise.
    is_rough = usual >= settings.rough * rows.std()
    shortest = settings.gap if is_rough else settings.held
    is_long = lengths >= shortest
    if not is_rough:  # it may have plateaus, which it leaves slowly
        is_long &= outer.max(axis=0) > settings.leap * usual
    if not is_long.any() or share >= settings.digital:
        return "", 0.0
    first, last, lengths, outer = first[is_long], last[is_long], lengths[is_long], outer[:, is_long]
    begin = starts[first // width] + first % width
    turned, is_within = _while_turning(begin, begin + lengths, turning)
    n_long = int((lengths - 1).sum())
    often = max((equal.sum() - n_long) / (equal.size - n_long), 1 / equal.size)
    is_lost = np.log(equal.size) + (turned - 1) * np.log(often) < np.log(settings.chance)
    if is_rough and finest > settings.fine * usual:
        # Near its ends the signal is active, unlike one that comes to rest, or the shaft is at rest
        active = maximum_filter1d(around, 2 * settings.near + 1)[[first, last + 1]] > step
        is_unknown = (outer == 0) | ~is_within  # beyond a block
        is_lost &= (active | is_unknown).all(axis=0) & active.any(axis=0)
    share = float(turned[(turned >= shortest) & is_lost].sum() / rows.size)
    return ("drop-outs", share) if settings.lost < share < settings.digital else ("", 0.0)


def _while_turning(
    begin: NDArray[np.intp], end: NDArray[np.intp], turning: Sequence[tuple[float, float]]
) -> tuple[Array, NDArray[np.bool_]]:
    """Return how many samples of stretches lie within strokes, and whether their ends do.

    Shapes (n_stretches,) and (2, n_stretches).
    """
    ends = np.array([begin, end])
    turned = np.zeros(len(begin))
    is_within = np.zeros(ends.shape, dtype=bool)
    for low, high in turning:
        turned += np.clip(np.minimum(end, high) - np.maximum(begin, low), 0, None)
        is_within |= (ends > low) & (ends < high)
    return turned, is_within
