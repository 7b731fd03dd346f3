"""Speeds, revolutions and levels of a recording, collected while it is measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm.resampling.quality import Quality

_WHOLE = 1 << 14  # samples of a channel of which all count for its level
_BLOCK = 8192  # of them are summed at a time; more would be by several threads of BLAS
_SHOWN = 1024  # samples that count of any number of later ones that come together

Array = NDArray[np.floating]


class StreamQuality:
    """What `emacm.resampling.training_range.outside_range` needs, without findings of defects.

    Parameters
    ----------
    groups : sequence of (float, sequence of int)
        Sampling rates [Hz], each with the channels that have it.
    """

    def __init__(self, groups: Sequence[tuple[float, Sequence[int]]]) -> None:
        self._groups = groups
        # Of each group: samples seen; weight, weighted sums and sums of squares of its channels.
        self._seen = [0] * len(groups)
        self._sums = [np.zeros((3, len(channels))) for _, channels in groups]
        # Number, revolutions, longest, lowest and highest speed, revolutions forward.
        self._strokes = np.zeros(6)
        self._strokes[3] = np.inf

    def add_samples(self, group: int, rows: Array) -> None:
        """Take up the next samples of a group, shape (n_channels, n_times)."""
        n_times = rows.shape[1]
        whole = self._seen[group] < _WHOLE
        self._seen[group] += n_times
        if not whole and n_times:
            rows = rows[:, -_SHOWN:]
        for start in range(0, rows.shape[1], _BLOCK):
            part = rows[:, start : start + _BLOCK]
            weight = n_times / rows.shape[1]
            sums = [(len(row), float(np.add.reduce(row)), float(row.dot(row))) for row in part]
            self._sums[group] += weight * np.array(sums).T

    def add_stroke(self, turned: float, lowest: float, highest: float, direction: int) -> None:
        """Take up a stroke: angle [rad], speeds [rad/s] and direction of the shaft of interest."""
        revolutions = turned / (2 * np.pi)
        n, total, longest, low, high, forward = self._strokes
        speeds = min(low, lowest), max(high, highest)
        forward += revolutions if direction > 0 else 0.0
        self._strokes[:] = n + 1, total + revolutions, max(longest, revolutions), *speeds, forward

    def quality(self, names: Sequence[str]) -> Quality:
        """Return the properties of all that was taken up; `names` are those of the channels."""
        rates, levels = {}, {}
        for (fs, channels), (weight, total, squares) in zip(self._groups, self._sums, strict=True):
            mean = total / np.maximum(weight, 1.0)
            variance = squares / np.maximum(weight, 1.0) - mean**2
            for k, channel in enumerate(channels):
                rates[names[channel]] = fs
                levels[names[channel]] = float(np.sqrt(max(variance[k], 0.0)))
        n_strokes, revolutions, longest, slowest, fastest, forward = self._strokes.tolist()
        row = {
            "revolutions": revolutions,
            "strokes": n_strokes,
            "longest_stroke": longest,
            "slowest": slowest if n_strokes else 0.0,
            "fastest": fastest,
            "max_order": np.pi * min(rates.values()) / fastest if fastest else np.inf,
        }
        ordered = {name: levels[name] for name in names}
        share = forward / revolutions if revolutions else np.nan
        ordered_rates = {name: rates[name] for name in names}
        return Quality(row, ordered_rates, ordered, {}, (), False, share)

    def state(self) -> dict[str, Any]:
        """Return all that `restore` needs."""
        return {"seen": self._seen, "sums": self._sums, "strokes": self._strokes}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state."""
        self._seen = [int(n) for n in state["seen"]]
        self._sums, self._strokes = list(state["sums"]), np.array(state["strokes"])
