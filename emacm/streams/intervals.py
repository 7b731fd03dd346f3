"""Intervals of a stream: which samples of each channel belong to a reading."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, floor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm.streams.packed_state import Resumable

Samples = NDArray[np.floating]
_NOTHING: Samples = np.empty(0)


class IntervalCutter(Resumable):
    """Divides streams of samples into intervals, as `Recording.cut` divides a recording.

    Parameters
    ----------
    rates : sequence of float
        Sampling rates of groups of channels, and last that of the shaft reference [Hz].
    n_rows : sequence of int
        Channels in each group; 1 for the shaft.
    every : float or None
        Length of an interval [s or revolutions]; None for a single one.
    in_seconds : bool
        Which of the two.
    turn : float
        Angle of the measured shaft in one revolution of the shaft of interest [rad].
    reference : {"velocity", "angle"}
        What is measured of the shaft.
    min_speed : float
        Speed up to which the shaft counts as standing still [rad/s].
    rounding : float
        Samples, by which a time in seconds may miss a sample.

    Attributes
    ----------
    start : float
        Start of the interval [s].
    stop : float or None
        Its end, exclusive, once it is known [s].
    """

    held = (
        "_waiting",
        "_forgotten",
        "_given",
        "_examined",
        "_number",
        "_turned",
        "_last_shaft",
        "start",
        "stop",
    )

    def __init__(
        self,
        rates: Sequence[float],
        n_rows: Sequence[int],
        every: float | None,
        in_seconds: bool,
        turn: float,
        reference: str,
        min_speed: float,
        rounding: float = 1e-6,
    ) -> None:
        self._rates, self._every, self._in_seconds = rates, every, in_seconds
        self._turn, self._reference, self._min_speed = turn, reference, min_speed
        self._rounding = rounding
        # Samples at the end of an interval that the next one may begin with.
        self._shared = 2 if every is not None and len(set(rates)) > 1 else 0
        self._waiting: list[list[Samples]] = [[_NOTHING] * n for n in n_rows]
        self._forgotten = [0] * len(rates)  # samples before those waiting
        self._given = [0] * len(rates)  # samples that were given out, or belong to no interval
        self._examined = 0  # samples of the shaft
        self._number = 0
        self._turned = 0.0  # angle of the shaft in the interval [rad]
        self._last_shaft: Samples = _NOTHING
        self.start = 0.0
        self.stop = every if in_seconds else None

    @property
    def received(self) -> list[int]:
        """Samples received of each group and of the shaft."""
        return [n + len(w[0]) for n, w in zip(self._forgotten, self._waiting, strict=True)]

    @property
    def n_waiting(self) -> int:
        """Most samples of a channel that are held."""
        return max(len(rows[0]) for rows in self._waiting)

    def append(self, streams: list[list[Samples]]) -> None:
        """Add the next samples of the channels of each group, and of the shaft."""
        for i, (waiting, rows) in enumerate(zip(self._waiting, streams, strict=True)):
            if len(waiting[0]):
                rows = [np.concatenate(pair) for pair in zip(waiting, rows, strict=True)]
            self._waiting[i] = rows

    def take(self, *, all_of_them: bool = False) -> list[list[Samples]]:
        """Return the samples that are known to belong to the interval."""
        if self.stop is None and self._every is not None:
            self._look_for_stop()
        taken = []
        counts = self.received
        for i, (rows, received) in enumerate(zip(self._waiting, counts, strict=True)):
            first, last = min(received, self._given[i]), received
            if not all_of_them or self.stop is not None:
                last = max(first, min(received, self._last(i, received, counts[-1])))
            before = self._forgotten[i]
            now = slice(first - before, last - before)
            taken.append(rows if last - first == len(rows[0]) else [row[now] for row in rows])
            self._given[i] = max(self._given[i], last)
            self._forgotten[i] = kept = max(before, last - self._shared)
            if kept < received:
                self._waiting[i] = [row[kept - before :].copy() for row in rows]
            else:
                self._waiting[i] = [_NOTHING] * len(rows)
        return taken

    @property
    def complete(self) -> bool:
        """Whether all samples of the interval were given out."""
        if self.stop is None:
            return False
        return all(
            n >= ceil(self.stop * rate - self._rounding)
            for n, rate in zip(self._given, self._rates, strict=True)
        )

    def next(self) -> None:
        """Begin the next interval at the end of this one."""
        assert self.stop is not None
        self._number += 1
        self.start, self._turned = self.stop, 0.0
        self.stop = None
        if self._in_seconds and self._every is not None:
            self.stop = (self._number + 1) * self._every
        slowest = min(self._rates)
        begin = ceil(self.start * slowest - self._rounding) / slowest
        self._given = [round(begin * rate) for rate in self._rates]

    def _last(self, i: int, received: int, n_shaft: int) -> int:
        """Last + 1 sample that may be given out."""
        if self.stop is not None:
            return ceil(self.stop * self._rates[i] - self._rounding)
        if self._every is None or i == len(self._rates) - 1:
            return received
        # The interval may end where the shaft has got to.
        return floor(n_shaft / self._rates[-1] * self._rates[i])

    def _look_for_stop(self) -> None:
        """Find the sample of the shaft at which the interval has its revolutions."""
        new = self._waiting[-1][0][self._examined - self._forgotten[-1] :]
        if not len(new):
            return
        assert self._every is not None
        limit = self._every * self._turn * (1 - 1e-12)  # beyond the rounding of the sum
        used, turned = len(new), self._turned + self._angle_of(new)
        if turned >= limit:
            n_before = len(self._last_shaft)
            steps = self._steps(np.concatenate([self._last_shaft, new]))
            reached = self._turned + np.cumsum(steps) >= limit
            used = (int(reached.argmax()) if reached.any() else len(reached) - 1) + 2 - n_before
            self.stop = (self._examined + used) / self._rates[-1]
        self._examined += used
        self._turned = turned
        self._last_shaft = new[used - 1 : used].copy()

    def _steps(self, shaft: Samples) -> Samples:
        """Return the angles between successive samples, 0 at standstill [rad]."""
        if self._reference == "angle":
            steps = np.abs(np.diff(shaft))
            return steps * (steps * self._rates[-1] > self._min_speed)
        steps = np.abs(shaft[1:] + shaft[:-1]) * (0.5 / self._rates[-1])
        return steps * (np.abs(shaft[1:]) > self._min_speed)

    def _angle_of(self, new: Samples) -> float:
        """Return the angle from the last sample over the next ones [rad]."""
        return float(self._steps(np.concatenate([self._last_shaft, new])).sum())

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state; an end that is not known is not in it."""
        super().restore({"stop": None, **state})
