"""What a recording allows over the shaft angle: revolutions, speeds, highest order, caveats."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from emacm.recordings.recording import Recording
from emacm.resampling.spreading import PASS

_MANY = 10  # strokes of less than a revolution that look like noise


def recording_quality(
    recording: Recording,
    channels: Sequence[str],
    theta_s: float,
    min_speed: float,
    direction: str,
    ratio: float = 1.0,
) -> dict[str, Any]:
    """Return the row of `OrderResampler.quality` of one recording.

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

    Returns
    -------
    dict of str to object
        The columns by name.
    """
    velocity, fs = recording.velocity, recording.shaft_fs
    if direction == "travel":
        direction = "strokes"  # which is what travel joins
    paths = [path.geared(ratio) for path in recording.paths(direction, min_speed)]
    starts = [round(path.start_time * fs) for path in paths]
    speeds = [
        ratio * np.abs(velocity[start : start + path.n_times])
        for start, path in zip(starts, paths, strict=True)
    ]
    turned = [path.length / (2 * np.pi) for path in paths]
    fastest = max((float(speed.max()) for speed in speeds), default=0.0)
    slowest = min(channels, key=lambda name: recording.fs[name])
    max_order = recording.fs[slowest] / 2 / (fastest / (2 * np.pi)) if fastest else np.inf
    row: dict[str, Any] = {
        "revolutions": float(sum(turned)),
        "strokes": len(paths),
        "longest_stroke": float(max(turned, default=0.0)),
        "standing": float(np.mean(np.abs(velocity) <= min_speed)),
        "slowest": min((float(speed.min()) for speed in speeds), default=0.0),
        "fastest": fastest,
        "max_order": max_order,
    }
    n_short = sum(length < 1 for length in turned)
    found = _warnings(row, slowest, n_short, fastest / ratio / fs, theta_s)
    jump, text = jump_warning(recording)
    row["warnings"] = "; ".join([*found, text] if jump * ratio > theta_s else found)
    return row


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


def _warnings(
    row: dict[str, Any], slowest: str, n_short: int, step: float, theta_s: float
) -> list[str]:
    found = []
    if not row["strokes"]:
        found.append("the shaft never turns")
    if PASS * np.pi / theta_s > row["max_order"]:
        found.append(
            f"channel {slowest!r} has no content above order {row['max_order']:.4g} at the highest "
            f"speed (half its sampling rate), though theta_s reaches order {np.pi / theta_s:.4g}"
        )
    if n_short > _MANY:
        found.append(
            f"{n_short} strokes of less than a revolution: raise min_speed above the noise at "
            f"standstill"
        )
    if step > np.pi:
        found.append(
            "the shaft turns by more than half a revolution between its samples: "
            "is the angle in rad, and its rate right?"
        )
    return found
