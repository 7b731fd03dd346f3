"""Quality of a recording over the shaft angle: revolutions, speeds, highest order, defects.

A channel that is computed when it is read, such as an envelope, is judged by the measured signal
it is computed from.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emacm._statements import Statement
from emacm.findings.channel_checks import check_channel
from emacm.recordings.recording import Recording
from emacm.shaft.motion import ShaftPath


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
    defects = [*_motion_defects(over_angle, row, slowest, n_short)]
    defects += [check.defect for check in checks.values() if check.defect is not None]
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


def _motion_defects(
    over_angle: Any, row: dict[str, float], slowest: str, n_short: int
) -> Iterator[Statement]:
    recording, theta_s = over_angle.measured, over_angle.theta_s
    if not row["strokes"]:
        yield Statement("standstill", "", "the shaft never turns")
    if over_angle.flat_order > row["max_order"]:
        text = (
            f"channel {slowest!r} has no content above order {row['max_order']:.4g} at the highest "
            f"speed (half its sampling rate, or the width of the band of an envelope), though "
            f"theta_s reaches order {np.pi / theta_s:.4g}"
        )
        limit = row["max_order"]
        yield Statement("order", slowest, text, value=over_angle.flat_order, limit=limit)
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
