"""Series that grow while they are read, and of which only the last samples are held."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm.shaft.motion import LazySeries

_SPARE = 1.25  # of the memory, so that not every block moves the samples


class HeldRows:
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
        self._memory = np.empty((n_rows, 0))
        self._offset = 0  # of the first sample, in the memory
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
        n_new = len(blocks[0])
        stop = self._offset + self.length - self.first
        if stop + n_new > self._memory.shape[1]:
            stop = self._make_room(n_new)
        place = self._memory[:, stop : stop + n_new]
        for row, block in zip(place, blocks, strict=True):
            row[:] = block
        self.length += n_new

    def drop(self, before: int) -> None:
        """Forget the samples before a number."""
        forgotten = min(max(0, before - self.first), self.length - self.first)
        self.first += forgotten
        self._offset += forgotten

    def state(self) -> dict[str, Any]:
        """Return the samples that are held."""
        return {"first": self.first, "values": self._held.copy()}

    def restore(self, state: dict[str, Any]) -> None:
        """Hold the samples of a state."""
        self._memory = np.array(state["values"], dtype=np.float64)
        self._offset, self.first = 0, int(state["first"])
        self.length = self.first + self._memory.shape[1]

    @property
    def _held(self) -> NDArray[np.floating]:
        return self._memory[:, self._offset : self._offset + self.length - self.first]

    def _make_room(self, n_new: int) -> int:
        """Move what is held to the start of the memory, and return its end there."""
        n_held = self.length - self.first
        needed, memory = n_held + n_new, self._memory
        if needed > memory.shape[1] or 4 * needed < memory.shape[1]:
            self._memory = np.empty((len(memory), int(_SPARE * needed)))
        for row, before in zip(self._memory, memory, strict=True):
            row[:n_held] = before[self._offset : self._offset + n_held]
        self._offset = 0
        return n_held


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
