"""Quality of a recording over the shaft angle: revolutions, speeds, highest order, defects.

A channel that is computed when it is read, such as an envelope, is judged by the measured signal
it is computed from. At most 32,768 values in 32 blocks are read, so that a recording that is larger
than memory costs no more than a short one. No benchmark of this repository repeats the choice of
the limits of a channel; ``pytest tests/findings`` has the channels without a defect that must not
be reported, and the defects that must be.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from emacm._statements import Statement
from emacm.recordings.recording import Recording
from emacm.shaft.motion import Series, ShaftPath, blocks, sources

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_N_BLOCKS, _BLOCK = 32, 1024  # number and length of the blocks of a long channel that are read
MOST_OFFSET = 3e4  # middle of the range, in standard deviations
_FEWEST = 5  # stretches, or wrap-arounds: fewer may be coincidence, or the machine at rest
_HELD = 16  # equal samples that a sampled signal does not have by chance
_LOST = 0.005  # of the time. It is low, as the blocks may contain few of the drop-outs: 2 % in gaps
# of 5 ms at 50 kHz are three gaps in 32 blocks.


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
    defects : tuple of Statement
        Defects of the shaft reference and of channels.
    has_jump : bool
        Whether the shaft reference has an isolated jump of any size, which no real motion has.
    forward : float
        Fraction of the revolutions that are forward; NaN without strokes.
    """

    row: dict[str, float]
    rates: dict[str, float]
    levels: dict[str, float]
    units: dict[str, str]
    defects: tuple[Statement, ...]
    has_jump: bool
    forward: float = np.nan


def recording_quality(row: Any) -> Quality:
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


def _quality(over_angle: Any) -> Quality:
    recording, names, ratio = over_angle.measured, over_angle.channels, over_angle.ratio
    speed = np.abs(recording.velocity)
    # What "travel" joins is judged stroke by stroke.
    joined = over_angle.direction == "travel"
    paths = (replace(over_angle, direction="strokes") if joined else over_angle).paths
    spans = [path.span for path in paths]
    turned = [path.length / (2 * np.pi) for path in paths]
    slowest_speed = min((float(speed[start:stop].min()) for start, stop in spans), default=0.0)
    fastest = ratio * max((float(speed[start:stop].max()) for start, stop in spans), default=0.0)
    limits = {name: _highest_frequency(recording, name) for name in names}
    slowest = min(names, key=limits.__getitem__)
    row: dict[str, float] = {
        "revolutions": float(sum(turned)),
        "strokes": len(paths),
        "longest_stroke": float(max(turned, default=0.0)),
        "standing": float(np.mean(speed <= over_angle.min_speed)),
        "slowest": ratio * slowest_speed,
        "fastest": fastest,
        "max_order": limits[slowest] / (fastest / (2 * np.pi)) if fastest else np.inf,
    }
    parts = [(start / len(speed), stop / len(speed)) for start, stop in spans]
    checks = {name: check_channel(recording.series[name], name, parts) for name in names}
    n_short = sum(length < 1 for length in turned)
    defects = [*_motion_defects(over_angle, row, slowest, n_short)]
    defects += [check.defect for check in checks.values() if check.defect is not None]
    rates = {name: recording.fs[name] for name in names}
    levels = {name: check.level for name, check in checks.items()}
    units = {name: unit for name, unit in recording.units.items() if name in names}
    has_jump = recording.jump is not None
    return Quality(row, rates, levels, units, tuple(defects), has_jump, forward_share(paths))


def forward_share(paths: Sequence[ShaftPath]) -> float:
    """Return the fraction of the travel along strokes that is forward; NaN without strokes."""
    turned = sum(path.length for path in paths)
    forward = sum(path.length for path in paths if path.direction > 0)
    return float(forward / turned) if turned else np.nan


def _highest_frequency(recording: Recording, channel: str) -> float:
    """Return half the sampling rate of a channel, or the bandwidth of an envelope [Hz]."""
    bandwidth = getattr(recording.series[channel], "bandwidth", np.inf)
    return min(recording.fs[channel] / 2, float(bandwidth))


def _motion_defects(
    over_angle: Any, row: dict[str, float], slowest: str, n_short: int
) -> Iterator[Statement]:
    recording, theta_s = over_angle.measured, over_angle.theta_s
    yield from recording.once("shaft", tuple)  # what its file states: repairs of a tachometer
    if not row["strokes"]:
        yield Statement("standstill", "", "the shaft never turns")
    if over_angle.flat_order > row["max_order"]:
        text = (
            f"channel {slowest!r} has no content above order {row['max_order']:.4g} at the highest "
            f"speed (half its sampling rate, or the width of the band of an envelope), though "
            f"theta_s reaches order {np.pi / theta_s:.4g}"
        )
        yield Statement("order", slowest, text, value=over_angle.flat_order, limit=row["max_order"])
    if n_short > 10:  # so many look like noise
        text = "strokes of less than a revolution: raise min_speed above the noise at standstill"
        yield Statement("short strokes", "", f"{n_short} {text}", value=n_short, limit=10)
    turned = row["fastest"] / over_angle.ratio / recording.shaft_fs
    if recording.reference == "angle" and turned > np.pi:  # samples of a speed may be slow
        text = "the shaft turns by more than half a revolution between its samples: "
        text += "is the angle in rad, and its rate right?"
        yield Statement("shaft samples", "", text, value=turned, limit=np.pi)
    jump = jump_statement(recording)
    if jump is not None and jump.value * over_angle.ratio > theta_s:
        yield jump


def jump_statement(recording: Recording) -> Any:
    """Return a statement on the largest isolated jump of the shaft [rad]; None if there is none."""
    jump = recording.jump
    if jump is None:
        return None
    text = (
        f"the shaft's {recording.reference} jumps by {jump.angle:.3g} rad at sample {jump.sample} "
        f"({jump.sample / recording.shaft_fs:.6g} s), faster than a shaft can move: an encoder "
        f"that slips, or a spike. Repair it, or cut the recording there"
    )
    return Statement("jump", "", text, value=jump.angle)


class ChannelCheck(NamedTuple):
    """Level and defect of one channel.

    Attributes
    ----------
    level : float
        Root mean square of the deviations from the mean, in the unit of the channel.
    defect : Statement or None
        Of the kind "constant", "offset", "wrap-around", "clipped" or "drop-outs".
    """

    level: float
    defect: Statement | None = None


def check_channel(
    series: Series,
    name: str,
    turning: Sequence[tuple[float, float]] = (),
    *,
    may_be_switch: bool = True,
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
    may_be_switch : bool
        Whether a channel that is constant for more than 90 % of the time has no drop-outs.

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
    signal: there, one step of float32 or of a converter of 24 bits is up to 1/280 of a standard
    deviation. A temperature of 300 K with noise of 0.02 K, and a supply of 24 V with a ripple of
    1 mV, remain below. Integers that overflow jump to and fro between both extremes, by the range
    less a usual step. They are recognised if the signal is smooth enough to move by less than about
    0.15 of the range per sample: in white noise, a wrap-around looks like any other step.

    Examples
    --------
    >>> wave = np.sin(np.arange(4000.0))
    >>> check_channel(np.clip(wave, -0.5, 0.5), "current").defect.text
    "channel 'current' is clipped at 0.5"
    >>> check_channel(np.zeros(100), "current").defect.kind
    'constant'
    """
    series = sources(series)[0]
    rows, starts = _sampled(series)
    low, high = float(rows.min()), float(rows.max())

    def found(kind: str, text: str, value: float | None = None) -> ChannelCheck:
        return ChannelCheck(level, Statement(kind, name, f"channel {name!r} {text}", value=value))

    level = 0.0
    if low == high and all((block == low).all() for _, block in blocks(series)):
        return found("constant", f"is constant ({low:.4g}): cable or sensor?", low)
    largest = max(high, -low) or 1.0
    scaled = rows / largest  # squares of any finite value
    level, middle = float(scaled.std()) * largest, (low + high) / 2
    if low < high and abs(middle) > MOST_OFFSET * level:
        text = f"has an offset of {middle:.4g} and a level of {level:.2g}: "
        return found("offset", text + "measure it with AC coupling, or leave it out", middle)
    steps = np.diff(scaled, axis=1)
    if _wraps_around(scaled, steps):
        text = "jumps from one extreme to the other: do its integers overflow?"
        return found("wrap-around", text)
    sizes = np.abs(steps)
    moved = sizes[sizes > 0]
    if not len(moved) or np.mean(sizes == 0) < 1e-3:  # nothing can be clipped or lost
        return ChannelCheck(level)
    usual, finest = float(np.median(moved)), float(moved.min())
    stretches = _stretches(scaled, sizes, starts, max(0.3 * usual, 1.5 * finest))
    extreme = _clipped_at(stretches, scaled)
    if extreme is not None:
        return found("clipped", f"is clipped at {extreme * largest:.4g}", extreme * largest)
    most = 0.9 if may_be_switch else 1.0
    held = stretches[stretches["length"] >= _HELD]
    share = float(held["length"].sum() / scaled.size)
    if share >= most:
        return ChannelCheck(level)
    if held["sharp"].sum() < _FEWEST or share <= _LOST:
        within = [(a * len(series), b * len(series)) for a, b in turning]
        share = _lost_share(stretches, scaled, usual, finest, within)
    if _LOST < share < most:
        text = f"has drop-outs: in {100 * share:.2g} % of the time it is constant"
        return found("drop-outs", text, share)
    return ChannelCheck(level)


def _sampled(series: Series) -> tuple[Array, NDArray[np.intp]]:
    """Return blocks of a channel, evenly spread, shape (n_blocks, n_times), and their begins."""
    length = len(series)
    if length <= _N_BLOCKS * _BLOCK:
        return np.asarray(series[:], np.float64)[np.newaxis], np.zeros(1, np.intp)
    starts = np.linspace(0, length - _BLOCK, _N_BLOCKS).astype(np.intp)
    return np.array([series[s : s + _BLOCK] for s in starts.tolist()], np.float64), starts


def _wraps_around(rows: Array, steps: Array) -> bool:
    """Return whether a continuous signal jumps to and fro between its extremes.

    It goes on beyond the extreme, and each jump is the range less a usual step. A switch has no
    values in between, an impulse or a fast tone has large steps beside its largest one.
    """
    span = np.ptp(rows)
    is_far = np.abs(steps) > 0.75 * span
    block, place = np.nonzero(is_far)
    if len(place) < _FEWEST:
        return False
    ways = np.sign(steps[is_far])
    padded = np.pad(steps, ((0, 0), (1, 1)))
    beside = np.array([padded[block, place], padded[block, place + 2]])
    is_jump = np.abs(beside) > 0.75 * span  # noise crosses the limit several times
    largest = np.where(is_jump.all(axis=0), np.inf, np.abs(beside * ~is_jump).max(axis=0))
    between = np.abs(rows - (rows.max() + rows.min()) / 2) < span / 4
    # What a jump lacks to the full range is the true step. Of the largest steps of rolling bearings
    # it is 0.2 of the range and more, of tones up to a third of the sampling rate 0.17.
    missing = np.median(span - np.abs(steps[is_far])) + np.abs(steps[steps != 0]).min()
    # Beside a jump, faster tones have steps of 2.5 true steps and more.
    is_smooth = np.median(largest) < 2.2 * missing and missing < 0.17 * span
    # Half of the edges of a square wave with noise move back, 0.17 and fewer of wrap-arounds.
    goes_on = np.mean(beside.sum(axis=0) * ways <= 0) > 0.75
    turns = np.mean(ways[1:] != ways[:-1]) > 0.2  # a wrapped angle jumps one way only
    return bool(is_smooth and goes_on and turns and between.mean() > 0.1)


def _stretches(rows: Array, sizes: Array, starts: NDArray[np.intp], edge: float) -> pd.DataFrame:
    """Return the stretches of equal samples.

    Parameters
    ----------
    rows : ndarray of shape (n_blocks, n_times)
        Blocks of the channel.
    sizes : ndarray of shape (n_blocks, n_times - 1)
        Sizes of their steps.
    starts : ndarray of shape (n_blocks,)
        Samples at which they begin.
    edge : float
        Size above which a step is sharp: a channel that comes to rest has smaller ones.

    Returns
    -------
    DataFrame
        First sample "begin", "length" and "value"; size of the step "before" the first sample and
        "after" the last one, 0 beyond a block, and whether one of them is "sharp"; whether a step
        within 8 samples is, "active_before" and "active_after".
    """
    # A column of other steps keeps the blocks apart; the outermost steps are not known.
    changes = np.diff(np.pad(sizes == 0, ((0, 0), (1, 1))).ravel().astype(np.int8))
    first, last = np.flatnonzero(changes == 1), np.flatnonzero(changes == -1)
    around = np.pad(sizes, ((0, 0), (1, 1))).ravel()
    active = maximum_filter1d(around, 2 * 8 + 1)
    block, place = np.divmod(first, rows.shape[1] + 1)
    columns = {
        "begin": starts[block] + place,
        "length": last - first + 1,
        "value": rows[block, place],
        "before": around[first],
        "after": around[last + 1],
        "active_before": active[first] > edge,
        "active_after": active[last + 1] > edge,
        "sharp": np.maximum(around[first], around[last + 1]) > edge,
    }
    return pd.DataFrame(columns)


def _clipped_at(stretches: pd.DataFrame, rows: Array) -> float | None:
    """Return the extreme at which a channel often stays for three or more samples."""
    for extreme in (rows.max(), rows.min()):
        there = stretches[(stretches["length"] >= 3) & (stretches["value"] == extreme)]
        if there["sharp"].sum() >= max(_FEWEST, 0.5 * len(there)):
            return float(extreme)
    return None


def _lost_share(
    stretches: pd.DataFrame,
    rows: Array,
    usual: float,
    finest: float,
    turning: Sequence[tuple[float, float]],
) -> float:
    """Return the fraction of the time in single gaps, in a signal whose samples differ otherwise.

    Parameters
    ----------
    stretches : DataFrame
        Of `_stretches`.
    rows : ndarray of shape (n_blocks, n_times)
        Blocks of the channel.
    usual, finest : float
        Median and smallest step between samples that differ.
    turning : sequence of (float, float)
        Samples at which strokes of the shaft begin and end: while it rests, a channel may too.
    """
    is_rough = usual >= 0.1 * rows.std()  # it has no plateaus
    shortest = 48 if is_rough else _HELD  # a little less than 5 ms at 10 kHz
    gaps = stretches[stretches["length"] >= shortest]
    if not is_rough:  # one that has come to rest leaves a plateau slowly
        gaps = gaps[gaps[["before", "after"]].max(axis=1) > 5 * usual]
    begin, length = gaps["begin"].to_numpy(), gaps["length"].to_numpy()
    ends = np.array([begin, begin + length])
    turned, is_within = np.zeros(len(begin)), np.zeros(ends.shape, dtype=bool)
    for low, high in turning:
        turned += np.clip(np.minimum(ends[1], high) - np.maximum(begin, low), 0, None)
        is_within |= (ends > low) & (ends < high)
    # How often neighbours are equal elsewhere; a gap is lost if that makes it no coincidence.
    n_steps, n_lost = rows.size - len(rows), int((length - 1).sum())
    n_equal = int((stretches["length"] - 1).sum())
    often = max((n_equal - n_lost) / (n_steps - n_lost), 1 / n_steps)
    is_lost = np.log(n_steps) + (turned - 1) * np.log(often) < np.log(1e-6)
    if is_rough and finest > 0.02 * usual:  # noise changes it even at standstill
        # Near its ends it is active, unlike one that comes to rest, or the shaft is at rest.
        is_active = gaps[["active_before", "active_after"]].to_numpy().T
        is_unknown = (gaps[["before", "after"]] == 0).to_numpy().T | ~is_within  # beyond a block
        is_lost &= (is_active | is_unknown).all(axis=0) & is_active.any(axis=0)
    return float(turned[(turned >= shortest) & is_lost].sum() / rows.size)
