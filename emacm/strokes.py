"""Cutting the shaft's motion into strokes, and the path that each of them runs."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_choice, check_number, check_signal

DIRECTIONS = ("strokes", "forward", "reverse", "travel")


class Stroke(NamedTuple):
    """Samples `start` to `stop` (exclusive) in which the shaft turns one way."""

    start: int
    stop: int
    direction: int


@dataclass(frozen=True, eq=False)
class Path:
    """Way of the shaft along its own motion, at uniform times.

    Attributes
    ----------
    travel : ndarray of shape (n_shaft_times,)
        Angle run since the start of the path [rad], from 0 upwards.
    fs : float
        Sampling rate of `travel` [Hz].
    start_time : float
        Time of its first sample [s].
    start_angle : float
        Shaft angle there [rad].
    direction : {1, -1, 0}
        Forward, reverse, or 0 for a path that joins both.
    """

    travel: NDArray[np.floating]
    fs: float
    start_time: float
    start_angle: float
    direction: int

    def __eq__(self, other: object) -> bool:
        """Two paths are equal if they run the same way at the same time."""
        if not isinstance(other, Path):
            return NotImplemented
        mine = (self.fs, self.start_time, self.start_angle, self.direction)
        theirs = (other.fs, other.start_time, other.start_angle, other.direction)
        return mine == theirs and np.array_equal(self.travel, other.travel)

    def __hash__(self) -> int:
        """Agree for equal paths."""
        return hash((self.fs, self.start_time, self.start_angle, self.direction))

    @property
    def length(self) -> float:
        """Angle from start to end [rad]."""
        return float(self.travel[-1])


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
    velocity = check_signal(velocity, "velocity", min_length=1)
    min_speed = check_number(min_speed, "min_speed", at_least=0, unit="rad/s")
    turning = np.flatnonzero(np.abs(velocity) > min_speed)
    if not len(turning):
        return []
    signs = np.sign(velocity[turning]).astype(np.int8)
    cuts = np.flatnonzero(np.diff(signs)) + 1
    first = np.concatenate([[0], cuts])
    last = np.concatenate([cuts, [len(turning)]]) - 1
    return [
        Stroke(int(turning[i]), int(turning[j]) + 1, int(signs[i]))
        for i, j in zip(first, last, strict=True)
    ]


def stroke_paths(
    angle: NDArray[np.floating],
    velocity: NDArray[np.floating],
    fs: float,
    *,
    direction: str = "strokes",
    min_speed: float = 0.0,
) -> list[Path]:
    """Return the paths along which a signal is to be resampled.

    Parameters
    ----------
    angle, velocity : ndarray of shape (n_times,)
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
    list of Path
        Strokes of a single sample, which have no length, are left out.

    Raises
    ------
    ValueError
        If `direction` is none of the four.
    """
    check_choice(direction, "direction", DIRECTIONS)
    strokes = find_strokes(velocity, min_speed=min_speed)
    if direction == "travel":
        return _joined_path(angle, fs, strokes)
    wanted = {"strokes": (1, -1), "forward": (1,), "reverse": (-1,)}[direction]
    paths = []
    for start, stop, sign in strokes:
        travel = sign * (angle[start:stop] - angle[start])
        if sign in wanted and stop - start > 1 and travel[-1] > 0:
            paths.append(Path(travel, fs, start / fs, float(angle[start]), sign))
    return paths


def _joined_path(angle: NDArray[np.floating], fs: float, strokes: list[Stroke]) -> list[Path]:
    """Join the strokes; at rest between them the path stands still."""
    if not strokes:
        return []
    origin, end = strokes[0].start, strokes[-1].stop
    steps = np.zeros(end - origin - 1)
    for start, stop, sign in strokes:
        steps[start - origin : stop - 1 - origin] = sign * np.diff(angle[start:stop])
    for before, after in pairwise(strokes):
        if after.start == before.stop:  # the shaft turns between two samples, without rest
            steps[before.stop - 1 - origin] = abs(angle[after.start] - angle[before.stop - 1])
    travel = np.concatenate([[0.0], np.cumsum(steps)])
    return [Path(travel, fs, origin / fs, float(angle[origin]), 0)] if travel[-1] > 0 else []
