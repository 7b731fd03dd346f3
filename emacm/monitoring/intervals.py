"""Intervals of a stream: which samples of each channel belong to a reading."""

from __future__ import annotations

from math import ceil, floor
from typing import Any

import numpy as np
from numpy.typing import NDArray

_ROUNDING = 1e-6  # samples, by which a time in seconds may miss a sample

Samples = NDArray[np.floating]


class IntervalCutter:
    """Divides streams of samples into intervals, as `Recording.cut` divides a recording.

    Parameters
    ----------
    rates : sequence of float
        Sampling rates of the channels, and last that of the shaft reference [Hz].
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

    Attributes
    ----------
    start : float
        Start of the interval [s].
    stop : float or None
        Its end, exclusive, once it is known [s].
    """

    def __init__(
        self,
        rates: list[float],
        every: float | None,
        in_seconds: bool,
        turn: float,
        reference: str,
        min_speed: float,
    ) -> None:
        self._rates, self._every, self._in_seconds = rates, every, in_seconds
        self._turn, self._reference, self._min_speed = turn, reference, min_speed
        # Samples at the end of an interval that the next one may begin with.
        self._shared = 2 if every is not None and len(set(rates)) > 1 else 0
        self._waiting: list[Samples] = [np.empty(0)] * len(rates)
        self._forgotten = [0] * len(rates)  # samples before those waiting
        self._given = [0] * len(rates)  # samples that were given out, or belong to no interval
        self._examined = 0  # samples of the shaft
        self._number = 0
        self._turned = 0.0  # angle of the shaft in the interval [rad]
        self._last_shaft = np.empty(0)
        self.start = 0.0
        self.stop = every if in_seconds else None

    @property
    def received(self) -> list[int]:
        """Samples received of each channel and of the shaft."""
        return [n + len(w) for n, w in zip(self._forgotten, self._waiting, strict=True)]

    @property
    def n_waiting(self) -> int:
        """Most samples of a channel that are held."""
        return max(map(len, self._waiting))

    def append(self, streams: list[Samples]) -> None:
        """Add the next samples of the channels and of the shaft."""
        pairs = zip(self._waiting, streams, strict=True)
        self._waiting = [np.concatenate(pair) if len(pair[0]) else pair[1] for pair in pairs]

    def take(self, *, all_of_them: bool = False) -> list[Samples]:
        """Return the samples that are known to belong to the interval."""
        if self.stop is None and self._every is not None:
            self._look_for_stop()
        taken = []
        counts = self.received
        for i, received in enumerate(counts):
            first, last = min(received, self._given[i]), received
            if not all_of_them or self.stop is not None:
                last = max(first, min(received, self._last(i, received, counts[-1])))
            waiting, before = self._waiting[i], self._forgotten[i]
            taken.append(waiting[first - before : last - before])
            self._given[i] = max(self._given[i], last)
            self._forgotten[i] = max(before, last - self._shared)
            self._waiting[i] = waiting[self._forgotten[i] - before :].copy()
        return taken

    @property
    def complete(self) -> bool:
        """Whether all samples of the interval were given out."""
        if self.stop is None:
            return False
        return all(
            n >= ceil(self.stop * rate - _ROUNDING)
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
        begin = ceil(self.start * slowest - _ROUNDING) / slowest
        self._given = [round(begin * rate) for rate in self._rates]

    def _last(self, i: int, received: int, n_shaft: int) -> int:
        """Last + 1 sample that may be given out."""
        if self.stop is not None:
            return ceil(self.stop * self._rates[i] - _ROUNDING)
        if self._every is None or i == len(self._rates) - 1:
            return received
        # The interval may end where the shaft has got to.
        return floor(n_shaft / self._rates[-1] * self._rates[i])

    def _look_for_stop(self) -> None:
        """Find the sample of the shaft at which the interval has its revolutions."""
        new = self._waiting[-1][self._examined - self._forgotten[-1] :]
        shaft = np.concatenate([self._last_shaft, new])
        n_before = len(self._last_shaft)
        if len(shaft) <= n_before or len(shaft) < 2:
            return
        assert self._every is not None
        limit = self._every * self._turn * (1 - 1e-12)  # beyond the rounding of the sum
        used, turned = len(shaft), self._turned + self._angle_of(shaft)
        if turned >= limit:
            reached = self._turned + np.cumsum(self._steps(shaft)) >= limit
            used = (int(reached.argmax()) if reached.any() else len(reached) - 1) + 2
            self.stop = (self._examined + used - n_before) / self._rates[-1]
        self._examined += used - n_before
        self._turned = turned
        self._last_shaft = shaft[used - 1 : used].copy()

    def _steps(self, shaft: Samples) -> Samples:
        """Return the angles between successive samples, 0 at standstill [rad]."""
        if self._reference == "angle":
            steps = np.abs(np.diff(shaft))
            return steps * (steps * self._rates[-1] > self._min_speed)
        steps = np.abs(shaft[1:] + shaft[:-1]) * (0.5 / self._rates[-1])
        return steps * (np.abs(shaft[1:]) > self._min_speed)

    def _angle_of(self, shaft: Samples) -> float:
        """Return their sum."""
        if self._reference == "velocity" and shaft.min() > self._min_speed:  # faster
            return float(shaft.sum() - 0.5 * (shaft[0] + shaft[-1])) / self._rates[-1]
        return float(self._steps(shaft).sum())

    def state(self) -> dict[str, Any]:
        """Return all that `restore` needs."""
        return {
            "waiting": self._waiting,
            "forgotten": self._forgotten,
            "given": self._given,
            "examined": self._examined,
            "number": self._number,
            "turned": self._turned,
            "last": self._last_shaft,
            "start": self.start,
            "stop": self.stop,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a state."""
        self._waiting = state["waiting"]
        self._forgotten = [int(n) for n in state["forgotten"]]
        self._given = [int(n) for n in state["given"]]
        self._examined = int(state["examined"])
        self._number, self._turned = int(state["number"]), float(state["turned"])
        self._last_shaft, self.start = state["last"], float(state["start"])
        self.stop = float(state["stop"]) if "stop" in state else None
