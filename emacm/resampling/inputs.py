"""Checks of recordings over the shaft angle, for the estimators after OrderResampler."""

from __future__ import annotations

from collections.abc import Sequence
from math import isclose
from typing import Any

import numpy as np

from emacm._checks import check_choice, check_number
from emacm.recordings.inputs import as_recordings, check_channels, described
from emacm.resampling.angle_recording import AngleRecording


def as_angle_recordings(X: Any, who: str) -> list[AngleRecording]:
    """Return X as a list of recordings over the shaft angle.

    Parameters
    ----------
    X : sequence of AngleRecording
        What `OrderResampler` returns.
    who : str
        Name of the estimator, for the message.

    Returns
    -------
    list of AngleRecording

    Raises
    ------
    TypeError
        If X is not a list, or an entry is of another type, such as a recording over time.
    ValueError
        If X is empty.
    """
    if are_over_angle(X):
        return list(X)
    rows = as_recordings(X, who, also=(AngleRecording,))
    for index, row in enumerate(rows):
        if not isinstance(row, AngleRecording):
            raise TypeError(
                f"{described(row, index)} is over time; put an OrderResampler before {who}."
            )
    return rows


def are_over_angle(X: Any) -> bool:
    """Return whether X is a list of recordings over the shaft angle, and of nothing else."""
    return isinstance(X, list) and len(X) > 0 and all(isinstance(r, AngleRecording) for r in X)


def check_angle_step(theta_s: Any) -> float:
    """Return the angle between samples.

    Parameters
    ----------
    theta_s : float
        Angle between samples [rad], at most π. A rounded float32 (or float16) value of 2π/n is
        replaced by 2π/n.

    Returns
    -------
    float

    Raises
    ------
    TypeError, ValueError
        If it is not a number above 0 and at most π.

    Examples
    --------
    >>> check_angle_step(np.float32(2 * np.pi / 64)) == 2 * np.pi / 64
    True
    """
    step = check_number(theta_s, "theta_s", above=0, unit="rad per sample")
    if step > np.pi:
        raise ValueError(
            f"theta_s = {step:g} rad is more than half a revolution between two samples. It is the "
            f"angle between samples, not their number: for {step:g} samples per revolution, write "
            f"theta_s=2 * np.pi / {step:g}."
        )
    if isinstance(theta_s, np.floating) and theta_s.dtype.itemsize < 8:
        exact = 2 * np.pi / round(2 * np.pi / step)
        if theta_s == theta_s.dtype.type(exact):
            return exact
    return step


def check_alike(
    rows: Sequence[AngleRecording],
    channels: Sequence[str],
    theta_s: float | None,
    who: str,
    *,
    by_direction: bool = False,
    exactly: bool = True,
) -> None:
    """Compare recordings with those of `fit`.

    Parameters
    ----------
    rows : sequence of AngleRecording
        Recordings.
    channels : sequence of str
        Channels in `fit`.
    theta_s : float or None
        Angle between samples in `fit` [rad].
    who : str
        Name of the estimator, for the message.
    by_direction : bool
        Whether forward and reverse strokes must be separate.
    exactly : bool
        Whether no other channels are allowed, nor another order of them.

    Raises
    ------
    ValueError
        If a recording has other channels, was not resampled at this angle, or its directions were
        joined.
    """
    if any(row.channels != channels for row in rows):
        check_channels(rows, channels, others=not exactly, ordered=exactly)
    for index, row in enumerate(rows):
        if theta_s is None or not isclose(row.theta_s, theta_s, rel_tol=1e-12):
            raise ValueError(
                f"{described(row, index)} was resampled with theta_s = {row.theta_s!r}, but "
                f"{who} was fitted on {theta_s!r}. Use the same theta_s, or fit again."
            )
        if by_direction and row.direction == "travel":
            raise ValueError(
                "by_direction needs strokes, but direction='travel' of OrderResampler joins "
                "both directions. Use direction='strokes'."
            )


def separates_directions(by_direction: bool | str, rows: Sequence[Any]) -> bool:
    """Return whether forward and reverse strokes are separate.

    Parameters
    ----------
    by_direction : bool or "auto"
        "auto": if a recording has strokes of at least one revolution in both directions.
    rows : sequence of AngleRecording or ndarray
        Rows of `fit`; arrays have no direction.

    Returns
    -------
    bool

    Raises
    ------
    ValueError
        If `by_direction` is neither.
    """
    check_choice(by_direction, "by_direction", (True, False, "auto"))
    if by_direction != "auto":
        return bool(by_direction)
    turning = (
        {stroke.direction for stroke in row.strokes if stroke.revolutions >= 1}
        for row in rows
        if isinstance(row, AngleRecording)
    )
    return any({1, -1} <= directions for directions in turning)
