"""The motion of a shaft while it is measured: its angle, and its strokes up to now."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm import _kernels
from emacm.shaft.motion import (
    DifferentiatedVelocity,
    LazySeries,
    ScaledTravel,
    ShaftPath,
    Stroke,
    extend_strokes,
    longest_gap,
)
from emacm.streams.packed_state import Resumable


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

    held = ("first", "length", "_blocks")

    def __init__(self, n_rows: int) -> None:
        self._blocks: list[NDArray[Any]] = [np.empty((n_rows, 0))]  # joined when they are read
        self.first = self.length = 0

    @property
    def series(self) -> list[HeldSeries]:
        """The signals, valid until the next `append`."""
        return [HeldSeries(self.first, row) for row in self._held]

    def since(self, first: int) -> NDArray[np.floating]:
        """Return the samples from a number on, shape (n_rows, n_times)."""
        return self._held[:, max(first - self.first, 0) :]

    def append(self, blocks: Sequence[NDArray[np.floating]]) -> None:
        """Add the next samples of each signal, equally many."""
        self._blocks.append(np.stack(blocks))
        self.length += len(blocks[0])

    def drop(self, before: int) -> None:
        """Forget the samples before a number."""
        forgotten = min(max(0, before - self.first), self.length - self.first)
        self._blocks = [self._held[:, forgotten:]]
        self.first += forgotten

    @property
    def _held(self) -> NDArray[np.floating]:
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

    def __getitem__(self, key: Any) -> Any:
        """Return one sample, a slice, or the samples with the numbers in an array."""
        if isinstance(key, np.ndarray):
            return self._values[key - self.first]
        return super().__getitem__(key)


Samples = NDArray[np.floating]


class GrowingStroke:
    """A stroke as far as it is known.

    Parameters
    ----------
    stroke : Stroke
        Its samples so far; the last one is a sample in which the shaft turns.
    start_angle : float
        Shaft angle at its start [rad].
    complete : bool
        Whether it has ended.
    largest_step : float
        Largest speed [rad/s], or largest angle between two samples [rad] where angles are measured.
    farthest, reversal : float
        Farthest angle travelled, and the largest angle by which the shaft turned back [rad].
    lowest, highest : float
        Range of its speed [rad/s].
    length : float
        Angle between its ends [rad], once it is complete.
    """

    def __init__(
        self,
        stroke: Stroke,
        start_angle: float,
        complete: bool = False,
        largest_step: float = 0.0,
        farthest: float = 0.0,
        reversal: float = 0.0,
        lowest: float = np.inf,
        highest: float = 0.0,
        length: float = 0.0,
    ) -> None:
        self.stroke, self.start_angle, self.complete = stroke, start_angle, complete
        self.largest_step, self.farthest, self.reversal = largest_step, farthest, reversal
        self.lowest, self.highest, self.length = lowest, highest, length


class ShaftStream:
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

    Attributes
    ----------
    strokes : list of GrowingStroke
        Those that were not removed; only the last one may still grow.
    n_examined : int
        Samples of which the strokes consist.
    """

    def __init__(self, reference: str, fs: float, min_speed: float, max_rest: float | None) -> None:
        self.reference = reference
        self.fs = fs
        self._min_speed = min_speed
        self._max_gap = longest_gap(max_rest, fs)
        self._angle, self._velocity = HeldRows(1), HeldRows(1)
        self.strokes: list[GrowingStroke] = []
        self.n_examined = 0

    @property
    def angle(self) -> HeldSeries:
        """Cumulative shaft angle, as far as it is known [rad]."""
        return self._angle.series[0]

    @property
    def n_received(self) -> int:
        """Samples received."""
        return self._measured.length

    @property
    def n_held(self) -> int:
        """Samples held."""
        return self._measured.length - self._measured.first

    def append(self, samples: Samples) -> None:
        """Add the next samples of the reference."""
        self._measured.append([samples])

    def advance(self) -> None:
        """Extend angle and strokes by the samples received."""
        if self.reference == "angle":
            self._differentiate(self.n_received - 1)  # the last one depends on the next angle
        elif self.n_received > self.n_examined:
            self._angle.append([self._integrated()])
            self._examine()

    def close(self) -> None:
        """Complete the last stroke: the recording ends here."""
        self.advance()
        if self.reference == "angle":
            self._differentiate(self.n_received)
        if self.strokes:
            self.strokes[-1].complete = True

    def path(self, growing: GrowingStroke, ratio: float) -> ShaftPath:
        """Return the travel along a stroke up to now, of the shaft of interest."""
        stroke, start_angle = growing.stroke, growing.start_angle
        start, stop, sign = stroke
        travel = ScaledTravel(self.angle, start, stop, origin=start_angle, scale=sign)
        known = self.fastest(growing), growing.reversal
        path = ShaftPath(travel, self.fs, start / self.fs, start_angle, sign, *known)
        return path.geared(ratio)

    def count(self, growing: GrowingStroke, theta_s: float) -> int:
        """Return the number of angles `theta_s` [rad] apart on a stroke so far."""
        stroke = growing.stroke
        travel = stroke.direction * (float(self.angle[stroke.stop - 1]) - growing.start_angle)
        growing.length = travel
        return int(travel / theta_s + 1e-9) + 1 if travel > 0 else 0

    def fastest(self, growing: GrowingStroke) -> float:
        """Return the highest speed along a stroke so far [rad/s]."""
        return growing.largest_step * (1.0 if self.reference == "velocity" else self.fs)

    def drop(self, before: int) -> None:
        """Forget samples that neither resampling nor the strokes need any more."""
        if self.strokes and not self.strokes[-1].complete:
            before = min(before, self.strokes[-1].stroke.stop - 1)
        self._angle.drop(min(before, self.n_examined - 2))
        self._velocity.drop(min(before, self.n_examined - 1))

    @property
    def _measured(self) -> HeldRows:
        return self._velocity if self.reference == "velocity" else self._angle

    def _integrated(self) -> Samples:
        """Continue the integral over the velocity by the trapezoidal rule, in one running sum."""
        n_before = min(1, self.n_examined)
        total = np.array([float(self.angle[-1]) if n_before else 0.0])
        speed = self._velocity.series[0][self.n_examined - n_before :]
        speed.flags.writeable = False  # so that one kind of array is compiled for
        angle = np.empty(len(speed))
        _kernels.loops.integrate(speed, 0.5 / self.fs, total, len(speed), angle)
        return angle[n_before:]

    def _differentiate(self, known: int) -> None:
        """Compute the velocity of the samples before a number."""
        if known > max(self.n_examined, 1):
            velocity = DifferentiatedVelocity(self.angle, self.fs)
            self._velocity.append([velocity.read(self.n_examined, known)])
            self._examine()

    def _examine(self) -> None:
        """Extend the strokes by samples whose velocity is known."""
        first = self.n_examined
        velocity = self._velocity.series[0][first:]
        self.n_examined += len(velocity)
        growing = self.strokes[-1] if self.strokes and not self.strokes[-1].complete else None
        known = [growing.stroke] if growing else []
        extend_strokes(known, first, velocity, self._min_speed, self._max_gap)
        if growing:
            before, growing.stroke = growing.stroke.stop, known.pop(0)
            self._extend(growing, before)
        for stroke in known:
            if self.strokes:
                self.strokes[-1].complete = True
            self.strokes.append(GrowingStroke(stroke, float(self.angle[stroke.start])))
            self._extend(self.strokes[-1], stroke.start)
        if self.strokes and self.n_examined - self.strokes[-1].stroke.stop + 1 > self._max_gap:
            self.strokes[-1].complete = True

    def _extend(self, growing: GrowingStroke, first: int) -> None:
        """Take up the samples of a stroke from `first` on."""
        stroke = growing.stroke
        if first == stroke.stop:
            return
        steps = self._velocity.series[0][first : stroke.stop]
        ends = float(steps.min()), float(steps.max())
        slowest, fastest = sorted(map(abs, ends))
        if ends[0] <= 0 <= ends[1]:
            slowest = float(np.abs(steps).min())
        growing.lowest, growing.highest = (
            min(growing.lowest, slowest),
            max(growing.highest, fastest),
        )
        if self.reference == "velocity" and self._min_speed == 0:  # the shaft never turns back
            growing.largest_step = max(growing.largest_step, fastest)
            return
        low = max(first - 1, stroke.start)
        travel = stroke.direction * (self.angle[low : stroke.stop] - growing.start_angle)
        if self.reference == "angle":
            steps = np.diff(travel)
        largest = float(np.abs(steps).max(initial=0.0))
        growing.largest_step = max(growing.largest_step, largest)
        reached = np.maximum(np.maximum.accumulate(travel), growing.farthest)
        growing.reversal = max(growing.reversal, float(np.max(reached - travel)))
        growing.farthest = float(reached[-1])

    def state(self) -> dict[str, Any]:
        """Return all that `restore` needs."""
        strokes = [{**vars(s), "stroke": np.array(s.stroke)} for s in self.strokes]
        return {
            "angle": self._angle.state(),
            "velocity": self._velocity.state(),
            "examined": self.n_examined,
            "strokes": strokes,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a state."""
        self._angle.restore(state["angle"])
        self._velocity.restore(state["velocity"])
        self.n_examined = state["examined"]
        self.strokes = []
        for values in state["strokes"]:
            stroke = Stroke(*values.pop("stroke").tolist())
            self.strokes.append(GrowingStroke(stroke, **values))
