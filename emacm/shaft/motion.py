"""Angle, velocity and travel of a shaft, computed slice by slice from what was measured.

One hour at 48 kHz would take 1.4 GB as an array of angles. The classes below behave like such
arrays, but keep only the angle at every 256th sample and compute a slice when it is read.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from types import ModuleType
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from emacm import _kernels
from emacm._checks import check_number, check_signal

BLOCK = 1 << 17  # samples that are read at once
_STRIDE = 256  # samples between two kept angles


class Stroke(NamedTuple):
    """Samples `start` to `stop` (exclusive) in which the shaft turns in one direction."""

    start: int
    stop: int
    direction: int


class Series(Protocol):
    """An object that can be sliced like a 1-D array."""

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the samples."""

    def __len__(self) -> int:
        """Return the number of samples."""

    def __getitem__(self, key: Any) -> Any:
        """Return a slice as an array, or one sample."""


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

    @property
    def sources(self) -> list[NDArray[Any]]:
        """The arrays that the samples are computed from."""
        raise NotImplementedError


class IntegratedAngle(LazySeries):
    """Cumulative angle of a velocity, by the trapezoidal rule, starting at 0.

    Parameters
    ----------
    velocity : ndarray of shape (n_times,)
        Shaft velocity [rad/s].
    fs : float
        Its sampling rate [Hz].
    loops : module, optional
        The inner loops. Default: `emacm._kernels.loops`.

    Notes
    -----
    Chirico, Eq. (2.9), with the parentheses that are missing there; accumulated in float64.
    """

    def __init__(
        self, velocity: NDArray[np.floating], fs: float, loops: ModuleType | None = None
    ) -> None:
        super().__init__(len(velocity))
        loops = loops or _kernels.loops
        self._integrate = loops.integrate
        self._half_step = 0.5 / fs
        self._velocity = velocity.view()
        self._velocity.flags.writeable = False  # so that one kind of array is compiled for
        self._known, self._lowest, self._highest = np.empty((3, -(-len(velocity) // _STRIDE)))
        found = self._known, self._lowest, self._highest
        velocity = np.ascontiguousarray(self._velocity)
        loops.set_checkpoints(velocity, self._half_step, _STRIDE, *found)

    def speed_limit(self, start: int, stop: int) -> float:
        """Return the highest speed from sample `start` to `stop` (exclusive) [rad/s]."""
        first = min(-(-start // _STRIDE) * _STRIDE, stop)
        last = max(stop // _STRIDE * _STRIDE, first)
        pieces = slice(first // _STRIDE, last // _STRIDE)
        ends = self._velocity[start:first], self._velocity[last:stop]
        found = *ends, self._highest[pieces], self._lowest[pieces]
        return max(float(np.abs(speeds).max(initial=0.0)) for speeds in found)

    def read(self, start: int, stop: int) -> NDArray[np.floating]:
        """Return the angles `start` to `stop` (exclusive) [rad]."""
        first = start // _STRIDE
        velocity = np.ascontiguousarray(self._velocity[first * _STRIDE : stop])
        angle = np.empty(len(velocity))
        self._integrate(velocity, self._half_step, self._known[first:], _STRIDE, angle)
        return angle[start - first * _STRIDE :]


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
        # At least two samples, at the ends of the recording, where the difference is one-sided.
        low, high = min(low, max(0, self._length - 2)), max(high, min(2, self._length))
        velocity = np.gradient(self._angle[low:high]) * self._fs
        return velocity[start - low : stop - low]


class StrokeTravel(LazySeries):
    """Angle travelled along one stroke.

    Parameters
    ----------
    angle : Series
        Cumulative shaft angle [rad].
    stroke : Stroke
        First sample, last sample and direction.
    monotonic : bool
        Whether the angle is known never to reverse.
    start_angle : float, optional
        Shaft angle at the first sample [rad], where it is not read any more.

    Attributes
    ----------
    known : dict of str to float
        Attributes of a `ShaftPath` that are known without reading the travel.
    """

    known: dict[str, Any]

    def __init__(
        self, angle: Series, stroke: Stroke, *, monotonic: bool, start_angle: float | None = None
    ) -> None:
        super().__init__(stroke.stop - stroke.start)
        self.start_angle = float(angle[stroke.start]) if start_angle is None else start_angle
        self._angle, self._stroke = angle, stroke
        self.known = {
            "n_times": self._length,
            "length": float(self.read(self._length - 1, self._length)[0]),
        }
        if isinstance(angle, IntegratedAngle):
            self.known["fastest"] = angle.speed_limit(stroke.start, stroke.stop)
        if monotonic:
            self.known["max_reversal"] = 0.0

    def starting_at(self, angle: float) -> StrokeTravel:
        """Return the travel since another shaft angle [rad], at the same times."""
        moved = copy.copy(self)
        moved.start_angle = angle
        moved.known = self.known | {"length": float(moved[self._length - 1])}
        return moved

    def read(self, start: int, stop: int) -> NDArray[np.floating]:
        """Return the travel at samples `start` to `stop` (exclusive) of the stroke [rad]."""
        angle, first = self._angle, self._stroke.start
        start, stop = first + start, first + stop
        part = angle.read(start, stop) if isinstance(angle, LazySeries) else angle[start:stop]
        travel = np.asarray(part, np.float64)
        if self.start_angle:
            travel = travel - self.start_angle
        return travel if self._stroke.direction > 0 else -travel


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


class GearedTravel(LazySeries):
    """Angle travelled by another shaft, which a gear or a belt connects to the measured one.

    Parameters
    ----------
    travel : Series
        Angle travelled by the measured shaft [rad].
    ratio : float
        Revolutions of the other shaft per revolution of the measured one.

    Attributes
    ----------
    known : dict of str to float
        Attributes of a `ShaftPath` that are known without reading the travel.
    """

    def __init__(self, travel: Series, ratio: float) -> None:
        super().__init__(len(travel))
        self._travel, self._ratio = travel, ratio
        known = getattr(travel, "known", {})
        self.known = {name: x if name == "n_times" else ratio * x for name, x in known.items()}

    def read(self, start: int, stop: int) -> NDArray[np.floating]:
        """Return the travel at samples `start` to `stop` (exclusive) [rad]."""
        return self._ratio * np.asarray(self._travel[start:stop], np.float64)


def parts(start: int, stop: int, at_most: int) -> Iterator[tuple[int, int]]:
    """Divide a range into as few parts as possible, of about equal length.

    Parameters
    ----------
    start, stop : int
        The range.
    at_most : int
        Largest length of a part.

    Yields
    ------
    first, last : int
        First index of the part, and last + 1.

    Examples
    --------
    >>> list(parts(0, 10, 4))
    [(0, 3), (3, 6), (6, 10)]
    """
    count = max(0, -((start - stop) // at_most))
    for k in range(count):
        yield start + k * (stop - start) // count, start + (k + 1) * (stop - start) // count


def blocks(series: Series) -> Iterator[tuple[int, Any]]:
    """Yield a series in pieces of at most `BLOCK` samples, each with its first index."""
    for first in range(0, len(series), BLOCK):
        yield first, series[first : first + BLOCK]


def sources(series: Series) -> list[NDArray[Any]]:
    """Return the arrays that the samples of a series are computed from; an array itself."""
    return series.sources if isinstance(series, LazySeries) else [np.asarray(series)]


def find_strokes(velocity: ArrayLike, *, min_speed: float = 0.0) -> list[Stroke]:
    """Find the sections in which the shaft turns in one direction.

    A stroke is cut only where the direction changes. Samples at or below
    `min_speed` between two sections of the same direction remain in it; at its ends,
    or between opposite directions, they belong to no stroke. So neither noise
    at standstill nor a pause of one sample creates strokes.

    Parameters
    ----------
    velocity : array-like of shape (n_times,)
        Shaft velocity [rad/s], signed.
    min_speed : float
        Speed up to which the shaft counts as standing still [rad/s].

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
    return strokes_of(speed, check_number(min_speed, "min_speed", at_least=0, unit="rad/s"))


def longest_gap(max_rest: float | None, fs: float) -> float:
    """Return the most samples from one in which the shaft turns to the next of the same stroke.

    Parameters
    ----------
    max_rest : float or None
        Longest time at standstill that does not end a stroke [s]; None for any.
    fs : float
        Sampling rate of the shaft reference [Hz].

    Returns
    -------
    float

    Raises
    ------
    TypeError, ValueError
        If `max_rest` is not a number of at least 0.
    """
    if max_rest is None:
        return np.inf
    return check_number(max_rest, "max_rest", at_least=0, unit="s") * fs + 1


def strokes_of(velocity: Series, min_speed: float, max_gap: float = np.inf) -> list[Stroke]:
    """Find strokes as `find_strokes` does, block by block and without checks.

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
    """Extend strokes, the last of which may still go on, by the next samples.

    Parameters
    ----------
    strokes : list of Stroke
        Those of the samples before; changed in place.
    first : int
        Number of the first of the next samples.
    velocity : ndarray of shape (n_times,)
        Finite shaft velocity [rad/s], signed.
    min_speed, max_gap : float
        As for `strokes_of`.
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
    turning = np.flatnonzero(np.abs(velocity) > min_speed)
    if not len(turning):
        return
    signs = np.sign(velocity[turning]).astype(np.int8)
    cuts = np.flatnonzero((np.diff(signs) != 0) | (np.diff(turning) > max_gap)) + 1
    for i, j in zip([0, *cuts], [*cuts, len(turning)], strict=True):
        yield int(turning[i]), int(turning[j - 1]) + 1, int(signs[i])


class Jump(NamedTuple):
    """An isolated jump of the shaft angle.

    Attributes
    ----------
    sample : int
        Number of the sample of the shaft reference.
    angle : float
        Size of the jump [rad].
    """

    sample: int
    angle: float


def largest_jump(
    velocity: Series,
    fs: float,
    *,
    width: int = 2,
    reach: int = 12,
    above_neighbours: float = 6.0,
    above_median: float = 10.0,
    above_mean: float = 4.0,
) -> Jump | None:
    """Return the largest isolated jump of the shaft angle.

    A jump is a section of at most three samples with a speed of more than six times the highest
    speed in the eleven samples on either side, and more than ten times the median speed. No shaft
    accelerates and brakes so fast; an encoder that slips or an electrical spike looks like this.
    Steps of a stepping motor and counts of a coarse encoder are not jumps, because there are many.

    Parameters
    ----------
    velocity : ndarray of shape (n_times,), or LazySeries
        Shaft velocity [rad/s].
    fs : float
        Its sampling rate [Hz].
    width, reach : int
        A jump is less than `width` samples wide on either side; it is compared with the speed from
        there to `reach` samples away.
    above_neighbours, above_median, above_mean : float
        Multiples of the highest speed near by, of the median speed while turning (more than a count
        of an encoder) and of the mean speed; where no speed is above the last, there is no jump.

    Returns
    -------
    Jump or None
        None if there is none.

    Examples
    --------
    >>> speed = np.full(100, 3.0)
    >>> speed[40] = 500.0
    >>> largest_jump(speed, fs=100.0)
    Jump(sample=40, angle=5.06)
    """
    jumps: list[Jump] = []
    for first in range(0, len(velocity), BLOCK):
        low, high = max(first - reach, 0), min(first + BLOCK + reach, len(velocity))
        speed = np.abs(velocity[low:high])
        if speed.max() <= above_mean * speed.mean():
            continue
        limit = above_median * np.median(speed[speed > 0])
        limit = np.maximum(limit, above_neighbours * _neighbours(speed, width, reach))
        # A jump of an angle shows in two samples of its central difference.
        jumps += [
            Jump(low + int(k), float(speed[max(k - 1, 0) : k + 2].sum()) / fs)
            for k in np.flatnonzero(speed > limit)
        ]
    return max(jumps, key=lambda jump: jump.angle, default=None)


def _neighbours(speed: NDArray[np.floating], width: int, reach: int) -> NDArray[np.floating]:
    """Return the highest speed from `width` to `reach` samples away, on either side.

    Beyond its ends the speed continues: a motion that starts in the last sample is no jump.
    """
    padded = np.pad(speed, reach, mode="edge")
    highest = sliding_window_view(padded, reach - width + 1).max(axis=-1)
    return np.maximum(highest[: len(speed)], highest[reach + width :][: len(speed)])
