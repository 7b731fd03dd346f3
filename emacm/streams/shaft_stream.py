"""The motion of a shaft while it is measured: its angle, and its strokes up to now."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm import _kernels
from emacm._saved import Resumable
from emacm.shaft.motion import (
    DifferentiatedVelocity,
    LazySeries,
    ScaledTravel,
    ShaftPath,
    Stroke,
    extend_strokes,
    longest_gap,
)

Samples = NDArray[np.floating]


class HeldRows(Resumable):
    """The last samples of signals of one sampling rate, numbered from the start of the recording.

    Parameters
    ----------
    n_rows : int
        Number of signals.

    Attributes
    ----------
    first : int
        Number of the first sample that is held.
    length : int
        Number of the last one, + 1.
    """

    def __init__(self, n_rows: int) -> None:
        self._blocks: list[Samples] = [np.empty((n_rows, 0))]  # joined when they are read
        self.first = self.length = 0

    @property
    def series(self) -> list[HeldSeries]:
        """The signals, valid until the next `append`."""
        return [HeldSeries(self.first, row) for row in self._joined]

    @property
    def n_held(self) -> int:
        """Samples of a signal that are held."""
        return self.length - self.first

    def between(self, first: int, last: int) -> Samples:
        """Return the samples `first` to `last` (exclusive), shape (n_rows, n_times)."""
        return self._joined[:, first - self.first : last - self.first]

    def append(self, block: Samples) -> None:
        """Add the next samples, shape (n_rows, n_times)."""
        self._blocks.append(block)
        self.length += block.shape[1]

    def drop(self, before: int) -> None:
        """Forget the samples before a number."""
        forgotten = min(before - self.first, self.n_held)
        if forgotten > 0:
            self._blocks = [self._joined[:, forgotten:].copy()]
            self.first += forgotten

    @property
    def _joined(self) -> Samples:
        if len(self._blocks) > 1:
            self._blocks = [np.concatenate(self._blocks, axis=1)]
        return self._blocks[0]


class HeldSeries(LazySeries):
    """The last samples of a signal.

    Parameters
    ----------
    first : int
        Number of the first sample that is held.
    values : ndarray of shape (n_times,)
        The samples from there on.
    """

    def __init__(self, first: int, values: NDArray[np.floating]) -> None:
        super().__init__(first + len(values), values.dtype)
        self.first = first
        self._values = values

    def read(self, start: int, stop: int) -> NDArray[np.floating]:
        """Return the samples `start` to `stop` (exclusive)."""
        return self._values[start - self.first : stop - self.first]


class GrowingStroke(Resumable):
    """A stroke as far as it is known.

    Parameters
    ----------
    stroke : Stroke
        Its samples so far; the last one is a sample in which the shaft turns.
    start_angle : float
        Shaft angle at its start [rad].
    powers : dict of str to object
        What is computed along it; empty if nothing is.

    Attributes
    ----------
    complete : bool
        Whether it has ended.
    slowest, fastest : float
        Range of its speed [rad/s].
    largest_step, farthest, reversal : float
        Largest angle between two samples, farthest angle travelled, and the largest angle by which
        the shaft turned back [rad]; 0 for a velocity that never changes its sign.
    """

    def __init__(self, stroke: Stroke, start_angle: float, powers: dict[str, Any]) -> None:
        self.stroke, self.start_angle, self.powers = stroke, start_angle, powers
        self.complete = False
        self.slowest, self.fastest = np.inf, 0.0
        self.largest_step = self.farthest = self.reversal = 0.0


class ShaftStream(Resumable):
    """Angle and strokes of a shaft, block by block.

    Parameters
    ----------
    reference : {"velocity", "angle"}
        What is measured.
    fs : float
        Its sampling rate [Hz].
    min_speed : float
        Speed up to which the shaft counts as standing still [rad/s].
    max_rest : float or None
        Longest time at standstill that does not end a stroke [s].
    new_powers : callable
        Returns `GrowingStroke.powers` of a new stroke of a direction.

    Attributes
    ----------
    measured : HeldRows
        The samples of the reference, to which the next ones are appended.
    strokes : list of GrowingStroke
        Those that were not removed; only the last one may still grow.
    n_examined : int
        Samples of which the strokes consist.
    """

    held = ("_angle", "_velocity", "n_examined", "strokes")

    def __init__(
        self,
        reference: str,
        fs: float,
        min_speed: float,
        max_rest: float | None,
        new_powers: Callable[[int], dict[str, Any]],
    ) -> None:
        self._is_angle, self.fs, self._min_speed = reference == "angle", fs, min_speed
        self._max_gap, self._new_powers = longest_gap(max_rest, fs), new_powers
        self._angle, self._velocity = HeldRows(1), HeldRows(1)
        self.measured = self._angle if self._is_angle else self._velocity
        self.strokes: list[GrowingStroke] = []
        self.n_examined = 0

    @property
    def angle(self) -> HeldSeries:
        """Cumulative shaft angle, as far as it is known [rad]."""
        return self._angle.series[0]

    def advance(self, *, ended: bool) -> None:
        """Extend angle and strokes by the samples received, which may be all of the recording."""
        first, known = self.n_examined, self.measured.length
        if self._is_angle and not ended:
            known -= 1  # the velocity of the last one depends on the next angle
        if known > max(first, 1):
            if self._is_angle:
                velocity = DifferentiatedVelocity(self.angle, self.fs)
                self._velocity.append(velocity.read(first, known)[np.newaxis])
            else:
                self._angle.append(self._integrated()[np.newaxis])
            self.n_examined = known
            self._examine(first)
        if ended and self.strokes:
            self.strokes[-1].complete = True

    def path(self, growing: GrowingStroke, ratio: float) -> ShaftPath:
        """Return the travel along a stroke up to now, of the shaft of interest."""
        (start, stop, sign), start_angle = growing.stroke, growing.start_angle
        travel = ScaledTravel(self.angle, start, stop, origin=start_angle, scale=sign)
        fastest = growing.largest_step * self.fs if self._is_angle else growing.fastest
        known = fastest, growing.reversal
        path = ShaftPath(travel, self.fs, start / self.fs, start_angle, sign, *known)
        return path.geared(ratio)

    def drop(self, before: int) -> None:
        """Forget samples that neither resampling nor the strokes need any more."""
        if self.strokes and not self.strokes[-1].complete:
            before = min(before, self.strokes[-1].stroke.stop - 1)
        self._angle.drop(min(before, self.n_examined - 2))
        self._velocity.drop(min(before, self.n_examined - 1))

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state."""
        known = [Stroke(*stroke["stroke"]) for stroke in state["strokes"]]
        self.strokes = [self._new_stroke(stroke, 0.0) for stroke in known]
        super().restore(state)

    def _integrated(self) -> Samples:
        """Continue the integral over the velocity by the trapezoidal rule, in one running sum."""
        n_before = min(1, self.n_examined)
        start = float(self.angle[-1]) if n_before else 0.0
        (speed,) = self._velocity.between(self.n_examined - n_before, self._velocity.length)
        speed.flags.writeable = False  # so that one kind of array is compiled for
        return _kernels.loops.integrate(speed, 0.5 / self.fs, start)[n_before:]

    def _new_stroke(self, stroke: Stroke, start_angle: float) -> GrowingStroke:
        """Return a stroke of which no sample is known yet."""
        powers = self._new_powers(stroke.direction)
        return GrowingStroke(stroke._replace(stop=stroke.start), start_angle, powers)

    def _examine(self, first: int) -> None:
        """Extend the strokes by the samples from `first` on, whose velocity is known."""
        (velocity,) = self._velocity.between(first, self.n_examined)
        growing = [stroke for stroke in self.strokes[-1:] if not stroke.complete]
        strokes = [old.stroke for old in growing]
        extend_strokes(strokes, first, velocity, self._min_speed, self._max_gap)
        new = [self._new_stroke(s, float(self.angle[s.start])) for s in strokes[len(growing) :]]
        self.strokes += new
        for each, stroke in zip(growing + new, strokes, strict=True):
            self._extend(each, stroke)
            each.complete = each is not self.strokes[-1]
        if self.strokes and self.n_examined - self.strokes[-1].stroke.stop + 1 > self._max_gap:
            self.strokes[-1].complete = True

    def _extend(self, growing: GrowingStroke, stroke: Stroke) -> None:
        """Take up the samples of a stroke as it is known now."""
        first, growing.stroke = growing.stroke.stop, stroke
        if first == stroke.stop:
            return
        speed = np.abs(self._velocity.between(first, stroke.stop))
        growing.slowest = min(growing.slowest, float(speed.min()))
        growing.fastest = max(growing.fastest, float(speed.max()))
        low = max(first - 1, stroke.start)
        travel = stroke.direction * (self.angle[low : stroke.stop] - growing.start_angle)
        largest = float(np.abs(np.diff(travel)).max(initial=0.0))
        growing.largest_step = max(growing.largest_step, largest)
        reached = np.maximum(np.maximum.accumulate(travel), growing.farthest)
        growing.reversal = max(growing.reversal, float(np.max(reached - travel)))
        growing.farthest = float(reached[-1])
