"""Angle, velocity, strokes and travel of a shaft, computed slice by slice from what was measured.

One hour at 48 kHz would take 1.4 GB as an array of angles. The classes below behave like such
arrays, but keep only the angle at every 256th sample and compute a slice when it is read.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emacm import _kernels
from emacm._checks import check_choice, check_number

# Directions of the strokes that are resampled; "travel" joins all of them.
DIRECTIONS = {"strokes": (1, -1), "forward": (1,), "reverse": (-1,), "travel": (0,)}
BLOCK = 1 << 17  # samples that are read at once
_STRIDE = 256  # samples between two kept angles


class Stroke(NamedTuple):
    """Samples `start` to `stop` (exclusive) in which the shaft turns in one direction."""

    start: int
    stop: int
    direction: int


class LazySeries:
    """A 1-D array whose slices are computed when they are read.

    Subclasses implement `read`.

    Parameters
    ----------
    length : int
        Number of samples.
    dtype : dtype
        Their type.
    """

    def __init__(self, length: int, dtype: Any = np.float64) -> None:
        self._length = length
        self.dtype = np.dtype(dtype)

    def __len__(self) -> int:
        """Return the number of samples."""
        return self._length

    def __getitem__(self, key: Any) -> Any:
        """Return one sample, or a slice of step 1."""
        if isinstance(key, slice):
            start, stop, step = key.indices(self._length)
            if step != 1:
                return np.asarray(self)[key]
            return self.read(start, stop) if start < stop else np.empty(0, self.dtype)
        index = range(self._length)[key]
        return self.read(index, index + 1)[0]

    def __array__(self, dtype: Any = None, copy: Any = None) -> NDArray[Any]:
        """Return the whole series."""
        whole = self.read(0, self._length)
        return whole if dtype is None else whole.astype(dtype)

    def read(self, start: int, stop: int) -> NDArray[np.floating]:
        """Return the samples `start` to `stop` (exclusive), which must exist."""
        raise NotImplementedError


Series = NDArray[Any] | LazySeries  # what can be sliced like a 1-D array


class IntegratedAngle(LazySeries):
    """Cumulative angle of a velocity, by the trapezoidal rule, starting at 0.

    Parameters
    ----------
    velocity : ndarray of shape (n_times,)
        Shaft velocity [rad/s].
    fs : float
        Its sampling rate [Hz].

    Notes
    -----
    Chirico, Eq. (2.9), with the parentheses that are missing there; accumulated in float64.
    """

    def __init__(self, velocity: NDArray[np.floating], fs: float) -> None:
        super().__init__(len(velocity))
        self._integrate = _kernels.loops.integrate
        self._half_step = 0.5 / fs
        self._velocity = velocity.view()
        self._velocity.flags.writeable = False  # so that one kind of array is compiled for
        known: list[NDArray[np.floating]] = [np.zeros(1)]
        at_once = 512 * _STRIDE
        for first in range(0, len(velocity), at_once):
            angle = self._from(known[-1][-1], first, first + at_once + 1)
            known.append(angle[_STRIDE::_STRIDE].copy())
        self._kept = np.concatenate(known)

    def speed_limit(self, start: int, stop: int) -> float:
        """Return the highest speed from sample `start` to `stop` (exclusive) [rad/s]."""
        velocity = self._velocity[start:stop]
        return float(max(velocity.max(), -velocity.min()))

    def read(self, start: int, stop: int) -> NDArray[np.floating]:
        """Return the angles `start` to `stop` (exclusive) [rad]."""
        first = start // _STRIDE
        return self._from(self._kept[first], first * _STRIDE, stop)[start - first * _STRIDE :]

    def _from(self, angle: float, start: int, stop: int) -> NDArray[np.floating]:
        """Continue from the angle at a sample."""
        velocity = np.ascontiguousarray(self._velocity[start:stop])
        return self._integrate(velocity, self._half_step, angle)


class DifferentiatedVelocity(LazySeries):
    """Velocity of an angle, by central differences as in `numpy.gradient`.

    Parameters
    ----------
    angle : ndarray of shape (n_times,), or LazySeries
        Cumulative shaft angle [rad].
    fs : float
        Its sampling rate [Hz].
    """

    def __init__(self, angle: Series, fs: float) -> None:
        super().__init__(len(angle))
        self._angle = angle
        self._fs = fs

    def read(self, start: int, stop: int) -> NDArray[np.floating]:
        """Return the velocities `start` to `stop` (exclusive) [rad/s]."""
        low, high = max(start - 1, 0), min(stop + 1, self._length)
        velocity = np.gradient(self._angle[low:high]) * self._fs
        return velocity[start - low : stop - low]


class ScaledTravel(LazySeries):
    """A part of an angle or a travel, counted from another angle and scaled.

    Parameters
    ----------
    angle : Series
        Cumulative angle [rad].
    start, stop : int
        First sample, and last + 1.
    origin : float
        Angle that is subtracted [rad].
    scale : float
        Factor: the direction of a stroke, or the ratio of a gear.
    """

    def __init__(
        self, angle: Series, start: int, stop: int, *, origin: float = 0.0, scale: float = 1.0
    ) -> None:
        super().__init__(stop - start)
        self._angle, self._start, self._origin, self._scale = angle, start, origin, scale

    def read(self, start: int, stop: int) -> NDArray[np.floating]:
        """Return the travel at samples `start` to `stop` (exclusive) of the part [rad]."""
        travel = np.asarray(self._angle[self._start + start : self._start + stop], np.float64)
        if self._origin:
            travel = travel - self._origin
        return travel if self._scale == 1 else self._scale * travel


class JoinedTravel(LazySeries):
    """Angle travelled along several strokes of either direction; constant between them.

    Parameters
    ----------
    angle : Series
        Cumulative shaft angle [rad].
    strokes : sequence of Stroke
        In order of time, at least one.
    """

    def __init__(self, angle: Series, strokes: Sequence[Stroke]) -> None:
        super().__init__(strokes[-1].stop - strokes[0].start)
        self._angle = angle
        self._origin = strokes[0].start
        self._starts, self._stops, self._signs = np.array(strokes).T
        self._starts, self._stops = self._starts - self._origin, self._stops - self._origin
        self._from = np.array([angle[stroke.start] for stroke in strokes])
        ends = np.array([angle[stroke.stop - 1] for stroke in strokes])
        run = self._signs * (ends - self._from)
        # Where the shaft reverses between two samples, without rest, that step counts as well.
        no_rest = self._starts[1:] == self._stops[:-1]
        turns = no_rest * np.abs(self._from[1:] - ends[:-1])
        self._before = np.concatenate([[0.0], np.cumsum(run[:-1] + turns)])
        self._after = self._before + run

    def read(self, start: int, stop: int) -> NDArray[np.floating]:
        """Return the travel at samples `start` to `stop` (exclusive) [rad]."""
        index = np.arange(start, stop)
        stroke = np.searchsorted(self._starts, index, side="right") - 1
        angle = self._angle[self._origin + start : self._origin + stop].astype(np.float64)
        moved = self._before[stroke] + self._signs[stroke] * (angle - self._from[stroke])
        return np.where(index < self._stops[stroke], moved, self._after[stroke])


@dataclass(frozen=True, eq=False)
class ShaftPath:
    """Travel of the shaft over time: the angle covered since the start of the path.

    Attributes
    ----------
    travel : ndarray of shape (n_times,), or LazySeries
        Angle covered since the start of the path [rad], from 0 upwards.
    fs : float
        Sampling rate of `travel` [Hz].
    start_time : float
        Time of its first sample [s].
    start_angle : float
        Shaft angle at that time [rad].
    direction : {1, -1, 0}
        Forward, reverse, or 0 for a path that joins both.
    speed_limit, reversal : float or None
        `fastest` and `max_reversal`, where they are known without reading the travel.
    """

    travel: Series
    fs: float
    start_time: float
    start_angle: float
    direction: int
    speed_limit: float | None = None
    reversal: float | None = None

    @cached_property
    def n_times(self) -> int:
        """Return the number of samples of `travel`."""
        return len(self.travel)

    @property
    def span(self) -> tuple[int, int]:
        """First sample of the shaft reference on the path, and last + 1."""
        first = round(self.start_time * self.fs)
        return first, first + self.n_times

    @cached_property
    def length(self) -> float:
        """Angle from start to end [rad]."""
        return float(self.travel[self.n_times - 1])

    @property
    def fastest(self) -> float:
        """Highest speed along the path, or a little more [rad/s]."""
        return self._extremes[0] * self.fs if self.speed_limit is None else self.speed_limit

    @property
    def max_reversal(self) -> float:
        """Largest angle by which the shaft reverses on its way [rad]; 0 if it never does."""
        return self._extremes[2] if self.reversal is None else self.reversal

    def geared(self, ratio: float) -> ShaftPath:
        """Return the travel of a shaft that turns `ratio` times as far."""
        if ratio == 1:
            return self
        travel = ScaledTravel(self.travel, 0, self.n_times, scale=ratio)
        known = ratio * self.start_angle, self.direction, ratio * self.fastest
        return ShaftPath(travel, self.fs, self.start_time, *known, ratio * self.max_reversal)

    def starting_before(self, angle: float) -> ShaftPath:
        """Return the travel since an angle [rad] before the start, at the same times."""
        travel = ScaledTravel(self.travel, 0, self.n_times, origin=-angle)
        return replace(self, travel=travel, start_angle=self.start_angle - self.direction * angle)

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
        """Return the number of samples `theta_s` [rad] apart on the path, its start included."""
        return int(self.length / theta_s + 1e-9) + 1

    def sample_range(self, fs: float, n_times: int) -> tuple[int, int]:
        """Return first and last + 1 of the samples of a channel that lie on the path, at least two.

        The channel has `n_times` samples at the rate `fs` [Hz].
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
        is_within = shift <= start < stop <= shift + last * factor + 1
        if fs != factor * self.fs or abs(offset - shift) > 1e-6 or last < 3 or not is_within:
            return self._cubic(fs, start, stop)
        if factor == 1:
            return self.travel[start - shift : stop - shift]
        return self._denser(factor, start - shift, stop - shift)

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
        first, last = start // factor, (stop - 1) // factor
        low = min(max(first - 1, 0), self.n_times - 4)
        near, count = self.travel[low : max(last + 3, 4)], last - first + 1
        # The cubics next to the ends go on to the ends, as through a sample beyond that is on them.
        before, after = (4 * (p + r) - 6 * q - s for p, q, r, s in (near[:4], near[:-5:-1]))
        near = np.concatenate([[before], near, [after, after]])[first - low :]
        travel = np.empty((count, factor))
        for place in range(factor):
            weights = _lagrange(place / factor)
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
        As `find_strokes` returns them for `min_speed`.
    direction : {"strokes", "forward", "reverse", "travel"}
        Each stroke separately, those of one direction, or one path over the
        integral of the speed in either direction.
    min_speed : float
        Speed up to which the shaft counts as standing still [rad/s].

    Returns
    -------
    list of ShaftPath
        Strokes of a single sample, which have no length, are left out.
    """
    check_choice(direction, "direction", tuple(DIRECTIONS))
    paths = []
    if direction == "travel" and strokes:
        start = strokes[0].start
        travel = JoinedTravel(angle, strokes)
        paths.append(ShaftPath(travel, fs, start / fs, float(angle[start]), 0))
    # The integral of a velocity that never changes its sign never reverses.
    reversal = 0.0 if min_speed == 0 and isinstance(angle, IntegratedAngle) else None
    for start, stop, sign in strokes:
        if sign in DIRECTIONS[direction] and stop - start > 1:
            origin = float(angle[start])
            part = ScaledTravel(angle, start, stop, origin=origin, scale=sign)
            limit = angle.speed_limit(start, stop) if isinstance(angle, IntegratedAngle) else None
            paths.append(ShaftPath(part, fs, start / fs, origin, sign, limit, reversal))
    return [path for path in paths if path.length > 0]


def _lagrange(u: Any) -> tuple[Any, Any, Any, Any]:
    """Return the weights of the samples at -1, 0, 1 and 2 in the cubic through them, at `u`."""
    return (
        -u * (u - 1) * (u - 2) / 6,
        (u + 1) * (u - 1) * (u - 2) / 2,
        -(u + 1) * u * (u - 2) / 2,
        (u + 1) * u * (u - 1) / 6,
    )


def blocks(series: Series) -> Iterator[tuple[int, Any]]:
    """Yield a series in pieces of at most `BLOCK` samples, each with its first index."""
    for first in range(0, len(series), BLOCK):
        yield first, series[first : first + BLOCK]


def mirrored(series: Series, start: int, stop: int) -> NDArray[Any]:
    """Return samples of a series, and of its mirror images beyond its ends."""
    last = len(series) - 1
    if start >= 0 and stop <= last + 1:
        return np.asarray(series[start:stop])
    places = np.abs((np.arange(start, stop) + last) % (2 * last) - last)
    low = int(places.min())
    return np.asarray(series[low : int(places.max()) + 1])[places - low]


def sources(series: Series) -> list[NDArray[Any]]:
    """Return the arrays that a series is computed from, if it states them, or itself."""
    return getattr(series, "sources", None) or [np.asarray(series)]


def longest_gap(max_rest: float | None, fs: float) -> float:
    """Return the most samples from one in which the shaft turns to the next of the same stroke.

    `max_rest` is the longest time at standstill that does not end a stroke [s], None for any.
    """
    if max_rest is None:
        return np.inf
    return check_number(max_rest, "max_rest", at_least=0, unit="s") * fs + 1


def find_strokes(velocity: Series, min_speed: float = 0.0, max_gap: float = np.inf) -> list[Stroke]:
    """Find the sections in which the shaft turns in one direction.

    A stroke is cut only where the direction changes. Samples at or below
    `min_speed` between two sections of the same direction remain in it; at its ends,
    or between opposite directions, they belong to no stroke. So neither noise
    at standstill nor a pause of one sample creates strokes.

    Parameters
    ----------
    velocity : ndarray of shape (n_times,), or LazySeries
        Finite shaft velocity [rad/s], signed.
    min_speed : float
        Speed up to which the shaft counts as standing still [rad/s].
    max_gap : float
        Most samples from one in which the shaft turns to the next of the same stroke.

    Returns
    -------
    list of Stroke
        In order of time; empty if the shaft never turns.

    Examples
    --------
    >>> find_strokes(np.array([0.0, 2.0, 0.0, 2.0, 0.0, -1.0, -1.0]))
    [Stroke(start=1, stop=4, direction=1), Stroke(start=5, stop=7, direction=-1)]
    """
    strokes: list[Stroke] = []
    for first, block in blocks(velocity):
        extend_strokes(strokes, first, block, min_speed, max_gap)
    return strokes


def extend_strokes(
    strokes: list[Stroke],
    first: int,
    velocity: NDArray[np.floating],
    min_speed: float,
    max_gap: float = np.inf,
) -> None:
    """Extend strokes in place, the last of which may still go on, by the samples from `first` on.

    The other parameters are those of `find_strokes`.
    """
    for start, stop, sign in _sections(velocity, min_speed, max_gap):
        last = strokes[-1] if strokes else None
        if last and last.direction == sign and first + start - (last.stop - 1) <= max_gap:
            strokes[-1] = Stroke(last.start, first + stop, sign)
        else:
            strokes.append(Stroke(first + start, first + stop, sign))


def _sections(
    velocity: NDArray[np.floating], min_speed: float, max_gap: float
) -> Iterator[tuple[int, int, int]]:
    """Yield first sample, last + 1 and direction of the strokes within one block."""
    if len(velocity) and max(velocity.min(), -velocity.max()) > min_speed:  # as in most blocks
        yield 0, len(velocity), int(np.sign(velocity[0]))
        return
    turning = np.flatnonzero(np.abs(velocity) > min_speed)
    if not len(turning):
        return
    signs = np.sign(velocity[turning]).astype(np.int8)
    cuts = np.flatnonzero((np.diff(signs) != 0) | (np.diff(turning) > max_gap)) + 1
    for i, j in zip([0, *cuts], [*cuts, len(turning)], strict=True):
        yield int(turning[i]), int(turning[j - 1]) + 1, int(signs[i])


class Jump(NamedTuple):
    """An isolated jump of the shaft angle: sample of the shaft reference, and size [rad]."""

    sample: int
    angle: float


def largest_jump(velocity: Series, fs: float) -> Jump | None:
    """Return the largest isolated jump of the shaft angle, or None.

    A jump is a section of at most three samples with a speed of more than six times the highest
    speed of the same direction in the eleven samples on either side, and more than ten times the
    median speed. No shaft accelerates and brakes so fast; an encoder that slips or an electrical
    spike, from which the angle returns within a few samples, looks like this.
    Steps of a stepping motor and counts of a coarse encoder are not jumps, because there are many.

    Parameters
    ----------
    velocity : ndarray of shape (n_times,), or LazySeries
        Shaft velocity [rad/s].
    fs : float
        Its sampling rate [Hz].

    Examples
    --------
    >>> speed = np.full(100, 3.0)
    >>> speed[40] = 500.0
    >>> largest_jump(speed, fs=100.0)
    Jump(sample=40, angle=5.06)
    """
    jumps: list[Jump] = []
    reach = 12
    beside = np.r_[-reach:-1, 2 : reach + 1]
    for first in range(0, len(velocity), BLOCK):
        low, high = max(first - reach, 0), min(first + BLOCK + reach, len(velocity))
        signed = velocity[low:high]
        speed = np.abs(signed)
        if speed.max() <= 4 * speed.mean():  # as in most blocks
            continue
        # The median while turning; a count of an encoder is less than ten times as fast.
        fast = np.flatnonzero(speed > 10 * np.median(speed[speed > 0]))
        # Beyond its ends the speed continues: a motion that starts in the last sample is no jump.
        near = signed[np.clip(fast[:, np.newaxis] + beside, 0, len(signed) - 1)]
        near *= np.sign(signed[fast, np.newaxis])  # a spike returns: only the same way counts
        fast = fast[speed[fast] > 6 * near.max(axis=1, initial=0.0)]
        # A jump of an angle shows in two samples of its central difference, a spike two apart.
        padded = np.pad(signed, 2)
        for k in fast.tolist():
            moves = padded[k + 1 : k + 4].sum(), *(signed[k] - padded[[k, k + 4]])
            jumps.append(Jump(low + k, float(np.abs(moves).max()) / fs))
    return max(jumps, key=lambda jump: round(jump.angle, 9), default=None)  # the first of equals
