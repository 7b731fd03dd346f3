"""Series that grow while they are read, and of which only the last samples are held."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm.shaft.motion import LazySeries

_SPARE = 1.5  # of the memory, so that not every block moves the samples


class HeldSeries(LazySeries):
    """The last samples of a signal, numbered from the start of the recording.

    Parameters
    ----------
    first : int
        Number of the first sample that is held.
    values : ndarray of shape (n_times,), optional
        The samples from there on.
    """

    def __init__(self, first: int = 0, values: Any = ()) -> None:
        held = np.array(values, dtype=np.float64)
        super().__init__(first + len(held))
        self._memory = held
        self._offset = 0  # of the first sample, in the memory
        self.first = first

    def append(self, values: NDArray[np.floating]) -> None:
        """Add the next samples."""
        n_held, n_new = self._length - self.first, len(values)
        stop = self._offset + n_held
        if stop + n_new > len(self._memory):
            needed = n_held + n_new
            held = self._memory[self._offset : stop]
            if needed > len(self._memory) or 4 * needed < len(self._memory):
                self._memory = np.empty(int(_SPARE * needed))
            self._memory[:n_held] = held.copy()
            self._offset, stop = 0, n_held
        self._memory[stop : stop + n_new] = values
        self._length += n_new

    def drop(self, before: int) -> None:
        """Forget the samples before a number."""
        forgotten = min(max(0, before - self.first), self._length - self.first)
        self.first += forgotten
        self._offset += forgotten

    def read(self, start: int, stop: int) -> NDArray[np.floating]:
        """Return the samples `start` to `stop` (exclusive); valid until the series changes."""
        shift = self._offset - self.first
        return self._memory[start + shift : stop + shift]

    def __getitem__(self, key: Any) -> Any:
        """Return one sample, a slice, or the samples with the numbers in an array."""
        if isinstance(key, np.ndarray):
            return self._memory[self._offset + key - self.first]
        return super().__getitem__(key)

    def state(self) -> dict[str, Any]:
        """Return the samples that are held."""
        return {"first": self.first, "values": self.read(self.first, self._length).copy()}

    @classmethod
    def restored(cls, state: dict[str, Any]) -> HeldSeries:
        """Return the series with such a state."""
        return cls(int(state["first"]), state["values"])
