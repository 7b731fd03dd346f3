"""The way that a shaft runs along its own motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emacm._checks import check_number
from emacm.shaft.motion import BLOCK, IntegratedAngle, LazySeries, Series, blocks

_MOST_SAMPLES = 1 << 31  # over the angle of one path


class Stroke(NamedTuple):
    """Samples `start` to `stop` (exclusive) in which the shaft turns one way."""

    start: int
    stop: int
    direction: int


@dataclass(frozen=True, eq=False)
class ShaftPath:
    """Way of the shaft along its own motion, at uniform times.

    Attributes
    ----------
    travel : ndarray of shape (n_shaft_times,), or what slices like one
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

    travel: Series
    fs: float
    start_time: float
    start_angle: float
    direction: int

    def __eq__(self, other: object) -> bool:
        """Two paths are equal if they run the same way at the same time."""
        if not isinstance(other, ShaftPath):
            return NotImplemented
        mine = (self.fs, self.start_time, self.start_angle, self.direction)
        theirs = (other.fs, other.start_time, other.start_angle, other.direction)
        return mine == theirs and np.array_equal(np.asarray(self.travel), np.asarray(other.travel))

    def __hash__(self) -> int:
        """Agree for equal paths."""
        return hash((self.fs, self.start_time, self.start_angle, self.direction))

    @cached_property
    def length(self) -> float:
        """Angle from start to end [rad]."""
        return float(self.travel[-1])

    @cached_property
    def fastest(self) -> float:
        """Highest speed along the path, or a little more [rad/s]."""
        if isinstance(self.travel, StrokeTravel) and isinstance(self.travel.angle, IntegratedAngle):
            start = self.travel.start
            return self.travel.angle.speed_limit(start, start + len(self.travel))
        return self.largest_step()[0] * self.fs

    def largest_step(self) -> tuple[float, int]:
        """Find the largest angle between two samples [rad], and the number of the first."""
        largest, place = -1.0, 0
        for first in range(0, len(self.travel) - 1, BLOCK):
            steps = np.abs(np.diff(self.travel[first : first + BLOCK + 1]))
            if steps.max() > largest:
                largest, place = float(steps.max()), first + int(steps.argmax())
        return largest, place

    @cached_property
    def max_reversal(self) -> float:
        """How far the shaft ever turns back on its way [rad]; 0 if it never does."""
        if isinstance(self.travel, StrokeTravel) and self.travel.monotonic:
            return 0.0
        farthest, back = 0.0, 0.0
        for _, travel in blocks(self.travel):
            reached = np.maximum(np.maximum.accumulate(travel), farthest)
            back = max(back, float(np.max(reached - travel)))
            farthest = float(reached[-1])
        return back

    def count(self, theta_s: float) -> int:
        """Return how many samples `theta_s` [rad] apart the path holds, its start included."""
        theta_s = check_number(theta_s, "theta_s", above=0, unit="rad per sample")
        count = self.length / theta_s + 1e-9
        if count > _MOST_SAMPLES:
            raise ValueError(
                f"theta_s = {theta_s:g} rad would make {count:.3g} samples of a stroke of "
                f"{self.length / (2 * np.pi):.3g} revolutions. It is the angle between samples, "
                f"such as 2 * np.pi / 128."
            )
        return int(count) + 1

    def sample_range(self, fs: float, n_times: int) -> tuple[int, int]:
        """First and last + 1 of a channel's `n_times` samples at `fs` that lie on the path."""
        end_time = self.start_time + (len(self.travel) - 1) / self.fs
        first = int(np.ceil(self.start_time * fs - 1e-6))
        last = min(n_times, int(np.floor(end_time * fs + 1e-6)) + 1)
        if last - first < 2:
            # Shorter than a sampling interval: the two samples around it hold all there is.
            first = max(0, min(first, n_times - 2))
            last = first + 2
        return first, last

    def travel_at(self, fs: float, start: int, stop: int) -> NDArray[np.floating]:
        """Angle run at times `start` / fs to `stop` / fs (exclusive) [rad].

        Between the samples of the shaft, by the cubic through the four around.
        """
        last = len(self.travel) - 1
        offset, factor = self.start_time * fs, round(fs / self.fs)
        shift = round(offset)
        if fs != factor * self.fs or abs(offset - shift) > 1e-6:
            return self._cubic(fs, start, stop)
        if factor == 1 and start >= shift and stop - 1 - shift <= last:
            return self.travel[start - shift : stop - shift]
        # In between, the cubics of all intervals are read at the same places.
        low = min(max(start, shift + factor), stop)
        high = max(min(stop, shift + (last - 1) * factor), low)
        parts = [
            self._cubic(fs, start, low),
            self._denser(factor, low - shift, high - shift),
            self._cubic(fs, high, stop),
        ]
        return np.concatenate(parts)

    def _cubic(self, fs: float, start: int, stop: int) -> NDArray[np.floating]:
        """Angle run at any times, by the cubic through the four samples around each."""
        if start >= stop:
            return np.empty(0)
        last = len(self.travel) - 1
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
        """Angle run at `factor` places in each interval, from place `start` to `stop`."""
        if start >= stop:
            return np.empty(0)
        first, last = start // factor, (stop - 1) // factor
        near, count = self.travel[first - 1 : last + 3], last - first + 1
        travel = np.empty((count, factor))
        for place in range(factor):
            weights = _lagrange(np.float64(place / factor))
            travel[:, place] = sum(w * near[k : k + count] for k, w in enumerate(weights))
        return travel.ravel()[start - first * factor : stop - first * factor]


def _lagrange(u: Any) -> tuple[Any, Any, Any, Any]:
    """Weights of the samples at -1, 0, 1 and 2 in the cubic through them, read at `u`."""
    return (
        -u * (u - 1) * (u - 2) / 6,
        (u + 1) * (u - 1) * (u - 2) / 2,
        -(u + 1) * u * (u - 2) / 2,
        (u + 1) * u * (u - 1) / 6,
    )


class StrokeTravel(LazySeries):
    """Angle run along one stroke, read off the shaft's angle.

    `monotonic` says that it is known never to turn back.
    """

    def __init__(self, angle: Series, stroke: Stroke, *, monotonic: bool) -> None:
        super().__init__(stroke.stop - stroke.start)
        self.angle = angle
        self.start = stroke.start
        self.monotonic = monotonic
        self.start_angle = float(angle[stroke.start])
        self._sign = stroke.direction

    def _read(self, start: int, stop: int) -> NDArray[np.floating]:
        angle = self.angle[self.start + start : self.start + stop]
        travel = np.asarray(angle, np.float64)
        if self.start_angle:
            travel = travel - self.start_angle
        return travel if self._sign > 0 else -travel


class JoinedTravel(LazySeries):
    """Angle run along several strokes, whichever way; between them it stands still."""

    def __init__(self, angle: Series, strokes: Sequence[Stroke]) -> None:
        super().__init__(strokes[-1].stop - strokes[0].start)
        self._angle = angle
        self._origin = strokes[0].start
        self._starts = np.array([stroke.start for stroke in strokes]) - self._origin
        self._stops = np.array([stroke.stop for stroke in strokes]) - self._origin
        self._signs = np.array([stroke.direction for stroke in strokes])
        self._from = np.array([angle[stroke.start] for stroke in strokes])
        ends = np.array([angle[stroke.stop - 1] for stroke in strokes])
        run = self._signs * (ends - self._from)
        # Where the shaft turns between two samples, without rest, that step counts as well.
        turns = np.where(
            self._starts[1:] == self._stops[:-1], np.abs(self._from[1:] - ends[:-1]), 0
        )
        self._before = np.concatenate([[0.0], np.cumsum(run[:-1] + turns)])
        self._after = self._before + run

    def _read(self, start: int, stop: int) -> NDArray[np.floating]:
        index = np.arange(start, stop)
        stroke = np.searchsorted(self._starts, index, side="right") - 1
        angle = self._angle[self._origin + start : self._origin + stop].astype(np.float64)
        moved = self._before[stroke] + self._signs[stroke] * (angle - self._from[stroke])
        return np.where(index < self._stops[stroke], moved, self._after[stroke])
