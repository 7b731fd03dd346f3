"""What estimators that stand after OrderResampler ask of recordings over the shaft angle."""

from __future__ import annotations

from collections.abc import Sequence
from math import isclose
from typing import Any

import numpy as np

from emacm.recordings.recording import Recording, described
from emacm.resampling.angle_recording import AngleRecording, AngleStroke

Kind = tuple[str, list[AngleStroke]]


def check_angle_recordings(X: Any, who: str) -> list[AngleRecording]:
    """Return `X` as a list of recordings over the angle.

    Parameters
    ----------
    X : sequence of AngleRecording
        What `OrderResampler` returns.
    who : str
        Name of the estimator that asks, for the message.

    Returns
    -------
    list of AngleRecording

    Raises
    ------
    TypeError
        If an entry is something else; a recording over time, above all.
    ValueError
        If there is none.
    """
    if isinstance(X, AngleRecording | Recording):
        raise TypeError("X must be a list of recordings, got a single one; write [recording].")
    if not isinstance(X, Sequence | np.ndarray) or isinstance(X, str):
        raise TypeError(f"X must be a list of recordings over the angle, got {type(X).__name__}.")
    rows = list(X)
    if not rows:
        raise ValueError("X holds no recording; at least one is needed.")
    for index, row in enumerate(rows):
        if isinstance(row, Recording):
            raise TypeError(
                f"{described(row, index)} is over time; put an OrderResampler before {who}."
            )
        if not isinstance(row, AngleRecording):
            raise TypeError(
                f"entry {index} of X is no recording over the angle, as OrderResampler makes "
                f"them, but a {type(row).__name__}; {who} takes nothing else."
            )
    return rows


def check_theta_s(rows: Sequence[AngleRecording], theta_s: float | None, who: str) -> None:
    """Raise a ValueError if a recording was not resampled at the `theta_s` of `fit` [rad]."""
    for index, row in enumerate(rows):
        if theta_s is None or not isclose(row.theta_s, theta_s, rel_tol=1e-12):
            raise ValueError(
                f"{described(row, index)} was resampled with theta_s = {row.theta_s!r}, but "
                f"{who} was fitted on {theta_s!r}. Resample it alike, or fit again."
            )


def check_present(rows: Sequence[AngleRecording], channels: Sequence[str]) -> None:
    """Raise a ValueError if a recording lacks one of `channels`; others are passed over."""
    for index, row in enumerate(rows):
        missing = [name for name in channels if name not in row.channels]
        if missing:
            raise ValueError(
                f"{described(row, index)} has no channel {missing[0]!r}; its channels are "
                f"{list(row.channels)}, expected were {list(channels)}."
            )


def check_ways_apart(rows: Sequence[AngleRecording]) -> None:
    """Raise a ValueError if strokes of both directions were joined."""
    if any(row.direction == "travel" for row in rows):
        raise ValueError(
            "by_direction needs strokes, but direction='travel' of OrderResampler joins "
            "both directions. Use direction='strokes'."
        )


def strokes_by_kind(strokes: Sequence[AngleStroke], by_direction: bool) -> list[Kind]:
    """Return all strokes, or forward and reverse ones apart, each with what to call one."""
    if not by_direction:
        return [("stroke", list(strokes))]
    ways = ((1, "forward stroke"), (-1, "reverse stroke"))
    return [(kind, [s for s in strokes if s.direction == sign]) for sign, kind in ways]
