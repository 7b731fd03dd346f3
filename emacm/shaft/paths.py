"""The travel of a shaft over time, along one stroke or several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm._checks import check_choice
from emacm.shaft.motion import (
    GearedTravel,
    IntegratedAngle,
    JoinedTravel,
    Series,
    Stroke,
    StrokeTravel,
    blocks,
)

DIRECTIONS = ("strokes", "forward", "reverse", "travel")
_WANTED = {"strokes": (1, -1), "forward": (1,), "reverse": (-1,)}


@dataclass(frozen=True, eq=False)
class ShaftPath:
    """Travel of the shaft over time: the angle covered since the start of the path.

    Attributes
    ----------
    travel : ndarray of shape (n_shaft_times,), or LazySeries
        Angle covered since the start of the path [rad], from 0 upwards.
    fs : float
        Sampling rate of `travel` [Hz].
    start_time : float
        Time of its first sample [s].
    start_angle : float
        Shaft angle at that time [rad].
    direction : {1, -1, 0}
        Forward, reverse, or 0 for a path that joins both.
    """

    travel: Series
    fs: float
    start_time: float
    start_angle: float
    direction: int

    def __post_init__(self) -> None:
        """Take over what the travel knows of itself, in place of properties that read it."""
        vars(self).update(getattr(self.travel, "known", {}))

    @cached_property
    def n_times(self) -> int:
        """Return the number of samples of `travel`."""
        return len(self.travel)

    @cached_property
    def length(self) -> float:
        """Angle from start to end [rad]."""
        return float(self.travel[self.n_times - 1])

    @cached_property
    def fastest(self) -> float:
        """Highest speed along the path, or a little more [rad/s]."""
        return self._extremes[0] * self.fs

    @cached_property
    def max_reversal(self) -> float:
        """Largest angle by which the shaft reverses on its way [rad]; 0 if it never does."""
        return self._extremes[2]

    def geared(self, ratio: float) -> ShaftPath:
        """Return the travel of a shaft that turns `ratio` times as far."""
        if ratio == 1:
            return self
        start = self.start_time, ratio * self.start_angle
        return ShaftPath(GearedTravel(self.travel, ratio), self.fs, *start, self.direction)

    def largest_step(self) -> tuple[float, int]:
        """Return the largest angle between two samples [rad], and the number of the first."""
        return self._extremes[:2]

    @cached_property
    def _extremes(self) -> tuple[float, int, float]:
        """Largest step [rad], number of its first sample, and largest reversal [rad]."""
        largest, place, farthest, reversal = -1.0, 0, 0.0, 0.0
        last: NDArray[np.floating] = np.empty(0)
        for first, travel in blocks(self.travel):
            steps = np.abs(np.diff(travel, prepend=last))
            if len(steps) and steps.max() > largest:
                largest, place = float(steps.max()), first - len(last) + int(steps.argmax())
            reached = np.maximum(np.maximum.accumulate(travel), farthest)
            reversal = max(reversal, float(np.max(reached - travel)))
            farthest, last = float(reached[-1]), travel[-1:]
        return largest, place, reversal

    def count(self, theta_s: float) -> int:
        """Return the number of samples `theta_s` [rad] apart on the path, its start included.

        Raises
        ------
        ValueError
            If there are more than 2**31.
        """
        count = self.length / theta_s + 1e-9
        if count > 1 << 31:  # more than memory holds
            raise ValueError(
                f"theta_s = {theta_s:g} rad would make {count:.3g} samples of a stroke of "
                f"{self.length / (2 * np.pi):.3g} revolutions. It is the angle between samples, "
                f"such as 2 * np.pi / 128."
            )
        return int(count) + 1

    def sample_range(self, fs: float, n_times: int) -> tuple[int, int]:
        """Return first and last + 1 of the samples of a channel that lie on the path.

        Parameters
        ----------
        fs : float
            Sampling rate of the channel [Hz].
        n_times : int
            Its number of samples.

        Returns
        -------
        first, last : int
            At least two samples.
        """
        end_time = self.start_time + (self.n_times - 1) / self.fs
        first = int(np.ceil(self.start_time * fs - 1e-6))
        last = min(n_times, int(np.floor(end_time * fs + 1e-6)) + 1)
        if last - first < 2:
            # Shorter than a sampling interval: take the two samples around it.
            first = max(0, min(first, n_times - 2))
            last = first + 2
        return first, last

    def travel_at(self, fs: float, start: int, stop: int) -> NDArray[np.floating]:
        """Return the travel at times `start` / fs to `stop` / fs (exclusive) [rad].

        Between the samples of the shaft, it is the cubic through the four samples around.
        """
        last = self.n_times - 1
        offset, factor = self.start_time * fs, round(fs / self.fs)
        shift = round(offset)
        if fs != factor * self.fs or abs(offset - shift) > 1e-6:
            return self._cubic(fs, start, stop)
        if factor == 1 and start >= shift and stop - 1 - shift <= last:
            return self.travel[start - shift : stop - shift]
        # In between, the cubics of all intervals are evaluated at the same places.
        low = min(max(start, shift + factor), stop)
        high = max(min(stop, shift + (last - 1) * factor), low)
        parts = [
            self._cubic(fs, start, low),
            self._denser(factor, low - shift, high - shift),
            self._cubic(fs, high, stop),
        ]
        return np.concatenate(parts)

    def _cubic(self, fs: float, start: int, stop: int) -> NDArray[np.floating]:
        """Return the travel at any times, by the cubic through the four samples around each."""
        if start >= stop:
            return np.empty(0)
        last = self.n_times - 1
        position = (np.arange(start, stop) / fs - self.start_time) * self.fs
        position = np.clip(position, 0, last)
        nearest = np.rint(position)
        position = np.where(np.abs(position - nearest) < 1e-6, nearest, position)
        if last < 3:
            return np.interp(position, np.arange(last + 1), self.travel[:])
        left = np.clip(position.astype(np.intp), 1, last - 2)
        low = int(left[0]) - 1
        near = self.travel[low : int(left[-1]) + 3]
        weights = _lagrange(position - left)
        return sum(weight * near[left - low + k] for k, weight in enumerate(weights, start=-1))

    def _denser(self, factor: int, start: int, stop: int) -> NDArray[np.floating]:
        """Return the travel at `factor` places in each interval, from place `start` to `stop`."""
        if start >= stop:
            return np.empty(0)
        first, last = start // factor, (stop - 1) // factor
        near, count = self.travel[first - 1 : last + 3], last - first + 1
        travel = np.empty((count, factor))
        for place in range(factor):
            weights = _lagrange(np.float64(place / factor))
            travel[:, place] = sum(w * near[k : k + count] for k, w in enumerate(weights))
        return travel.ravel()[start - first * factor : stop - first * factor]


def paths_along(
    angle: Series,
    fs: float,
    strokes: Sequence[Stroke],
    direction: str = "strokes",
    min_speed: float = 0.0,
) -> list[ShaftPath]:
    """Return the paths along which signals are resampled.

    Parameters
    ----------
    angle : ndarray of shape (n_times,), or LazySeries
        Cumulative shaft angle [rad].
    fs : float
        Its sampling rate [Hz].
    strokes : sequence of Stroke
        As `strokes_of` returns them for `min_speed`.
    direction : {"strokes", "forward", "reverse", "travel"}
        Each stroke separately, those of one direction, or one path over the
        integral of the speed in either direction.
    min_speed : float
        Speed up to which the shaft counts as standing still [rad/s].

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
    travels: list[tuple[StrokeTravel | JoinedTravel, int, int]] = []
    if direction == "travel":
        if strokes:
            travels = [(JoinedTravel(angle, strokes), strokes[0].start, 0)]
    else:
        # The integral of a velocity that never changes its sign never reverses.
        monotonic = min_speed == 0 and isinstance(angle, IntegratedAngle)
        travels = [
            (StrokeTravel(angle, stroke, monotonic=monotonic), stroke.start, stroke.direction)
            for stroke in strokes
            if stroke.direction in _WANTED[direction] and stroke.stop - stroke.start > 1
        ]
    paths = [
        ShaftPath(travel, fs, start / fs, float(angle[start]), sign)
        for travel, start, sign in travels
    ]
    return [path for path in paths if path.length > 0]


def _lagrange(u: Any) -> tuple[Any, Any, Any, Any]:
    """Return the weights of the samples at -1, 0, 1 and 2 in the cubic through them, at `u`."""
    return (
        -u * (u - 1) * (u - 2) / 6,
        (u + 1) * (u - 1) * (u - 2) / 2,
        -(u + 1) * u * (u - 2) / 2,
        (u + 1) * u * (u - 1) / 6,
    )
