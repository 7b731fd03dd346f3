"""Intervals of a stream: which samples of each channel belong to a reading."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, floor

import numpy as np

from emacm._saved import Resumable
from emacm.streams.shaft_stream import HeldRows, Samples
from emacm.streams.spectrum_stream import Settings


class IntervalCutter(Resumable):
    """Divides streams of samples into intervals, as `Recording.cut` divides a recording.

    Parameters
    ----------
    settings : Settings
        Rates and channels, and motion of the shaft.
    slowest : float
        Lowest rate of a recording of these signals [Hz].
    every : float
        Length of an interval [s or revolutions]; inf for a single one.
    in_seconds : bool
        Which of the two.

    Attributes
    ----------
    start : float
        Start of the interval [s].
    stop : float
        Its end, exclusive [s]; inf until it is known.
    rows : list of HeldRows
        Samples that wait to be taken, of each group and of the shaft.
    """

    held = ("rows", "_given", "_examined", "_number", "_turned", "start", "stop")

    def __init__(self, settings: Settings, slowest: float, every: float, in_seconds: bool) -> None:
        self._settings, self._rates, self._slowest = settings, settings.rates, slowest
        self._every, self._in_seconds = every, in_seconds
        self.rows = [HeldRows(n) for n in [*map(len, settings.groups.values()), 1]]
        self._given = [0] * len(self.rows)  # samples that were given out, or belong to no interval
        self._examined = 0  # the last sample of the shaft up to which its angle is known
        self._number = 0
        self._turned = 0.0  # angle of the shaft in the interval [rad]
        self.start = 0.0
        self.stop = every if in_seconds else np.inf

    def append(self, streams: Sequence[Samples]) -> None:
        """Add the next samples of the channels of each group, and of the shaft."""
        for rows, block in zip(self.rows, streams, strict=True):
            rows.append(block)

    def take(self, *, all_of_them: bool = False) -> list[Samples]:
        """Return the samples that are known to belong to the interval."""
        by_angle = self._every < np.inf and not self._in_seconds
        if by_angle and self.stop == np.inf:
            self._look_for_stop()
        taken = []
        for i, rows in enumerate(self.rows):
            first, last = min(rows.length, self._given[i]), rows.length
            if not all_of_them or self.stop < np.inf:
                last = max(first, min(last, self._last(i)))
            taken.append(rows.between(first, last))
            self._given[i] = max(self._given[i], last)
            is_shaft = rows is self.rows[-1]
            kept = last - 2  # the next interval may begin with samples at the end of this one
            rows.drop(min(kept, self._examined) if is_shaft and by_angle else kept)
        return taken

    @property
    def complete(self) -> bool:
        """Whether all samples of the interval were given out."""
        return all(
            n >= self.stop * rate - self._settings.rounding
            for n, rate in zip(self._given, self._rates, strict=True)
        )

    def next(self) -> None:
        """Begin the next interval at the end of this one."""
        self._number += 1
        self.start, self._turned = self.stop, 0.0
        self.stop = (self._number + 1) * self._every if self._in_seconds else np.inf
        begin = ceil(self.start * self._slowest - self._settings.rounding) / self._slowest
        self._given = [round(begin * rate) for rate in self._rates]

    def _last(self, i: int) -> int:
        """Last + 1 sample that may be given out."""
        rate, shaft = self._rates[i], self.rows[-1]
        if self.stop < np.inf:
            return ceil(self.stop * rate - self._settings.rounding)
        if self._every == np.inf or self.rows[i] is shaft:
            return self.rows[i].length
        # The interval may end where the shaft has got to.
        return floor(shaft.length / self._rates[-1] * rate)

    def _look_for_stop(self) -> None:
        """Find the sample of the shaft at which the interval has its revolutions."""
        (shaft,) = self.rows[-1].between(self._examined, self.rows[-1].length)
        steps = self._steps(shaft)
        turn = 2 * np.pi / self._settings.resampler.ratio  # of the measured shaft
        limit = self._every * turn * (1 - 1e-12)  # beyond the rounding of the sum
        used, turned = len(steps), self._turned + float(steps.sum())
        if turned >= limit:
            before = int(np.searchsorted(self._turned + np.cumsum(steps), limit))
            used = min(before + 1, len(steps))
            self.stop = (self._examined + used + 1) / self._rates[-1]
        self._examined += used
        self._turned = turned

    def _steps(self, shaft: Samples) -> Samples:
        """Return the angles between successive samples, 0 at standstill [rad]."""
        if self._settings.reference == "angle":
            steps = np.abs(np.diff(shaft))
            return steps * (steps * self._rates[-1] > self._settings.resampler.min_speed)
        steps = np.abs(shaft[1:] + shaft[:-1]) * (0.5 / self._rates[-1])
        return steps * (np.abs(shaft[1:]) > self._settings.resampler.min_speed)
