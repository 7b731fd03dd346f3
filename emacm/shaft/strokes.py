"""Cutting the shaft's motion into strokes, and the path that each of them runs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_choice, check_number, check_signal
from emacm.shaft.motion import IntegratedAngle, Series, blocks
from emacm.shaft.paths import JoinedTravel, ShaftPath, Stroke, StrokeTravel

__all__ = ["DIRECTIONS", "ShaftPath", "Stroke", "find_strokes", "stroke_paths"]

DIRECTIONS = ("strokes", "forward", "reverse", "travel")


def find_strokes(velocity: ArrayLike, *, min_speed: float = 0.0) -> list[Stroke]:
    """Find the stretches in which the shaft turns one way.

    A stroke is cut only where the direction changes. Samples at or below
    `min_speed` between two stretches of one direction stay in it; at its ends,
    or between opposite directions, they belong to no stroke. So neither noise
    at rest nor a pause of one sample makes strokes.

    Parameters
    ----------
    velocity : array-like of shape (n_times,)
        Shaft velocity [rad/s], signed.
    min_speed : float
        Speed up to which the shaft counts as standing [rad/s].

    Returns
    -------
    list of Stroke
        In order of time; empty if the shaft never turns.

    Raises
    ------
    ValueError
        If `velocity` is not finite or `min_speed` is negative.

    Examples
    --------
    >>> find_strokes([0.0, 2.0, 0.0, 2.0, 0.0, -1.0, -1.0])
    [Stroke(start=1, stop=4, direction=1), Stroke(start=5, stop=7, direction=-1)]
    """
    speed: Series = check_signal(velocity, "velocity", min_length=1)
    return _strokes(speed, check_number(min_speed, "min_speed", at_least=0, unit="rad/s"))


def stroke_paths(
    angle: Series,
    velocity: Series,
    fs: float,
    *,
    direction: str = "strokes",
    min_speed: float = 0.0,
) -> list[ShaftPath]:
    """Return the paths along which a signal is to be resampled.

    Parameters
    ----------
    angle, velocity : ndarray of shape (n_times,), or what slices like one
        Cumulative shaft angle [rad] and signed velocity [rad/s].
    fs : float
        Their sampling rate [Hz].
    direction : {"strokes", "forward", "reverse", "travel"}
        Each stroke by itself, those of one direction, or one path over the
        integral of the speed, whichever way the shaft turns.
    min_speed : float
        See `find_strokes`.

    Returns
    -------
    list of ShaftPath
        Strokes of a single sample, which have no length, are left out.

    Raises
    ------
    ValueError
        If `direction` is none of the four.
    """
    check_choice(direction, "direction", DIRECTIONS)
    way = angle.one_way(min_speed) if isinstance(angle, IntegratedAngle) else 0
    strokes = [Stroke(0, len(angle), way)] if way else _strokes(velocity, min_speed)
    if direction == "travel":
        return _joined_path(angle, fs, strokes)
    wanted = {"strokes": (1, -1), "forward": (1,), "reverse": (-1,)}[direction]
    # The integral of a speed that is nowhere the other way never turns back.
    monotonic = min_speed == 0 and isinstance(angle, IntegratedAngle)
    paths = []
    for stroke in strokes:
        if stroke.direction not in wanted or stroke.stop - stroke.start < 2:
            continue
        travel = StrokeTravel(angle, stroke, monotonic=monotonic)
        path = ShaftPath(travel, fs, stroke.start / fs, travel.start_angle, stroke.direction)
        if path.length > 0:
            paths.append(path)
    return paths


def _strokes(velocity: Series, min_speed: float) -> list[Stroke]:
    """Join what was found block by block."""
    strokes: list[Stroke] = []
    for first, block in blocks(velocity):
        for start, stop, sign in _stretches(block, min_speed):
            if strokes and strokes[-1].direction == sign:
                strokes[-1] = Stroke(strokes[-1].start, first + stop, sign)
            else:
                strokes.append(Stroke(first + start, first + stop, sign))
    return strokes


def _stretches(velocity: NDArray[np.floating], min_speed: float) -> Iterator[tuple[int, int, int]]:
    """Yield first sample, last + 1 and direction of the strokes within one block."""
    if velocity.min() > min_speed:
        yield 0, len(velocity), 1
        return
    if velocity.max() < -min_speed:
        yield 0, len(velocity), -1
        return
    turning = np.flatnonzero(np.abs(velocity) > min_speed)
    if not len(turning):
        return
    signs = np.sign(velocity[turning]).astype(np.int8)
    cuts = np.flatnonzero(np.diff(signs)) + 1
    for i, j in zip([0, *cuts], [*cuts, len(turning)], strict=True):
        yield int(turning[i]), int(turning[j - 1]) + 1, int(signs[i])


def _joined_path(angle: Series, fs: float, strokes: list[Stroke]) -> list[ShaftPath]:
    if not strokes:
        return []
    travel = JoinedTravel(angle, strokes)
    origin = strokes[0].start
    path = ShaftPath(travel, fs, origin / fs, float(angle[origin]), 0)
    return [path] if path.length > 0 else []
