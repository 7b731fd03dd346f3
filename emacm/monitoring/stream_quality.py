"""Speeds, revolutions and levels of a recording, collected while it is measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm.resampling.quality import Quality

_WHOLE = 1 << 15  # samples of a channel of which all count for its level
_EVERY, _BLOCK = 8192, 1024  # afterwards: samples that count, in each stretch of so many

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
        self._strokes = np.zeros(5)  # number, revolutions, longest, lowest and highest speed
        self._strokes[3] = np.inf

    def add_samples(self, group: int, rows: Array) -> None:
        """Take up the next samples of a group, shape (n_channels, n_times)."""
        n_times = rows.shape[1]
        if self._seen[group] < _WHOLE:
            parts = [(rows, 1.0)] if n_times else []
        else:
            starts = range(0, n_times, _EVERY)
            shown = [(rows[:, k : k + _BLOCK], min(_EVERY, n_times - k)) for k in starts]
            parts = [(part, stretch / part.shape[1]) for part, stretch in shown]
        self._seen[group] += n_times
        for part, weight in parts:
            squares = np.einsum("ij,ij->i", part, part)
            n_shown = np.full(len(part), float(part.shape[1]))
            self._sums[group] += weight * np.stack([n_shown, part.sum(axis=1), squares])

    def add_stroke(self, turned: float, lowest: float, highest: float) -> None:
        """Take up a stroke: angle [rad] and speeds [rad/s] of the shaft of interest."""
        revolutions = turned / (2 * np.pi)
        n, total, longest, low, high = self._strokes
        speeds = min(low, lowest), max(high, highest)
        self._strokes[:] = n + 1, total + revolutions, max(longest, revolutions), *speeds

    def quality(self, names: Sequence[str]) -> Quality:
        """Return the properties of all that was taken up; `names` are those of the channels."""
        rates, levels = {}, {}
        for (fs, channels), (weight, total, squares) in zip(self._groups, self._sums, strict=True):
            mean = total / np.maximum(weight, 1.0)
            variance = squares / np.maximum(weight, 1.0) - mean**2
            for k, channel in enumerate(channels):
                rates[names[channel]] = fs
                levels[names[channel]] = float(np.sqrt(max(variance[k], 0.0)))
        n_strokes, revolutions, longest, slowest, fastest = self._strokes.tolist()
        row = {
            "revolutions": revolutions,
            "strokes": n_strokes,
            "longest_stroke": longest,
            "slowest": slowest if n_strokes else 0.0,
            "fastest": fastest,
            "max_order": np.pi * min(rates.values()) / fastest if fastest else np.inf,
        }
        ordered = {name: levels[name] for name in names}
        return Quality(row, {name: rates[name] for name in names}, ordered, {}, (), False)

    def state(self) -> dict[str, Any]:
        """Return all that `restore` needs."""
        return {"seen": self._seen, "sums": self._sums, "strokes": self._strokes}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state."""
        self._seen = [int(n) for n in state["seen"]]
        self._sums, self._strokes = list(state["sums"]), np.array(state["strokes"])
