"""Quality of a recording over the shaft angle: revolutions, speeds, highest order, findings."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from emacm.recordings.recording import Recording
from emacm.resampling.channel_checks import check_channel
from emacm.resampling.fine_grid import PASS
from emacm.shaft.paths import ShaftPath

_MANY = 10  # strokes of less than a revolution that look like noise


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


def recording_quality(
    recording: Recording,
    channels: Sequence[str],
    theta_s: float,
    min_speed: float,
    direction: str,
    ratio: float = 1.0,
    max_rest: float | None = None,
) -> Quality:
    """Return the properties of a recording; they are computed once.

    Parameters
    ----------
    recording : Recording
        The recording.
    channels : sequence of str
        Channels that are resampled.
    theta_s : float
        Angle between samples [rad].
    min_speed : float
        Speed up to which the shaft counts as standing still [rad/s].
    direction : {"strokes", "forward", "reverse", "travel"}
        What counts as a stroke.
    ratio : float
        Revolutions of the shaft of interest per revolution of the measured shaft.
    max_rest : float or None
        Longest time at standstill that does not end a stroke [s].

    Returns
    -------
    Quality
    """
    options = (tuple(channels), theta_s, min_speed, direction, ratio, max_rest)
    return recording.once(("quality", *options), partial(_quality, recording, *options))


def _quality(
    recording: Recording,
    channels: tuple[str, ...],
    theta_s: float,
    min_speed: float,
    direction: str,
    ratio: float,
    max_rest: float | None,
) -> Quality:
    velocity, fs = recording.velocity, recording.shaft_fs
    if direction == "travel":
        direction = "strokes"  # which is what travel joins
    paths = [path.geared(ratio) for path in recording.paths(direction, min_speed, max_rest)]
    starts = [round(path.start_time * fs) for path in paths]
    speeds = [
        _speed_range(velocity[start : start + path.n_times])
        for start, path in zip(starts, paths, strict=True)
    ]
    turned = [path.length / (2 * np.pi) for path in paths]
    fastest = ratio * max((high for _, high in speeds), default=0.0)
    limits = {name: _highest_frequency(recording, name) for name in channels}
    slowest = min(channels, key=limits.__getitem__)
    max_order = limits[slowest] / (fastest / (2 * np.pi)) if fastest else np.inf
    n_turning = np.count_nonzero(velocity > min_speed) + np.count_nonzero(velocity < -min_speed)
    row: dict[str, float] = {
        "revolutions": float(sum(turned)),
        "strokes": len(paths),
        "longest_stroke": float(max(turned, default=0.0)),
        "standing": (len(velocity) - n_turning) / len(velocity),
        "slowest": ratio * min((low for low, _ in speeds), default=0.0),
        "fastest": fastest,
        "max_order": max_order,
    }
    n_short = sum(length < 1 for length in turned)
    reason = "half its sampling rate"
    if limits[slowest] < recording.fs[slowest] / 2:
        reason = "the width of the band of the envelope"
    found = _findings(row, slowest, reason, n_short, fastest / ratio / fs, theta_s)
    jump, text = jump_warning(recording)
    if jump * ratio > theta_s:
        found.append(Finding("jump", text))
    duration = len(velocity) / fs
    turning = [
        (path.start_time / duration, (path.start_time + path.n_times / fs) / duration)
        for path in paths
    ]
    checks = {name: check_channel(recording.series[name], name, turning) for name in channels}
    found += [Finding(check.defect, check.text) for check in checks.values() if check.defect]
    rates = {name: recording.fs[name] for name in channels}
    levels = {name: check.level for name, check in checks.items()}
    units = {name: unit for name, unit in recording.units.items() if name in channels}
    return Quality(row, rates, levels, units, tuple(found), jump > 0, forward_share(paths))


def forward_share(paths: Sequence[ShaftPath]) -> float:
    """Return the fraction of the travel along strokes that is forward; NaN without strokes."""
    turned = sum(path.length for path in paths)
    forward = sum(path.length for path in paths if path.direction > 0)
    return float(forward / turned) if turned else np.nan


def _highest_frequency(recording: Recording, channel: str) -> float:
    """Return half the sampling rate of a channel, or the bandwidth of an envelope [Hz]."""
    bandwidth = getattr(recording.series[channel], "bandwidth", np.inf)
    return min(recording.fs[channel] / 2, float(bandwidth))


def _speed_range(velocity: NDArray[np.floating]) -> tuple[float, float]:
    """Return the smallest and the largest magnitude; two passes where the sign is constant."""
    low, high = float(velocity.min()), float(velocity.max())
    if low <= 0 <= high:
        return float(np.abs(velocity).min()), max(-low, high)
    return (low, high) if low > 0 else (-high, -low)


def jump_warning(recording: Recording) -> tuple[float, str]:
    """Return the size of the largest isolated jump of the shaft [rad], and a description."""
    jump = recording.jump
    if jump is None:
        return 0.0, ""
    return jump.angle, (
        f"the shaft's {recording.reference} jumps by {jump.angle:.3g} rad at sample {jump.sample} "
        f"({jump.sample / recording.shaft_fs:.6g} s), faster than a shaft can move: an encoder "
        f"that slips, or a spike. Repair it, or cut the recording there"
    )


def _findings(
    row: dict[str, float], slowest: str, reason: str, n_short: int, step: float, theta_s: float
) -> list[Finding]:
    found = []
    if not row["strokes"]:
        found.append(Finding("standstill", "the shaft never turns"))
    if PASS * np.pi / theta_s > row["max_order"]:
        text = (
            f"channel {slowest!r} has no content above order {row['max_order']:.4g} at the highest "
            f"speed ({reason}), though theta_s reaches order {np.pi / theta_s:.4g}"
        )
        found.append(Finding("order", text))
    if n_short > _MANY:
        text = (
            f"{n_short} strokes of less than a revolution: raise min_speed above the noise at "
            f"standstill"
        )
        found.append(Finding("short strokes", text))
    if step > np.pi:
        text = (
            "the shaft turns by more than half a revolution between its samples: "
            "is the angle in rad, and its rate right?"
        )
        found.append(Finding("speed", text))
    return found
