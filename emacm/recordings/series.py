"""Signals that are computed from measured ones, slice by slice, when they are read."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm.recordings.arguments import immutable
from emacm.shaft.motion import LazySeries, Series, sources


class ComputedSeries(LazySeries):
    """A signal computed from another one of the same length.

    Subclasses implement `read` and `__repr__` (class and parameters, of which digests are made).

    Parameters
    ----------
    signal : ndarray of shape (n_times,), or an object that can be sliced like one
        Finite; it may be a memory map.

    Attributes
    ----------
    bandwidth : float
        Frequency above which there is no content [Hz]; infinite if only the sampling rate limits
        it.
    """

    bandwidth = np.inf

    def __init__(self, signal: Series) -> None:
        super().__init__(len(signal), signal.dtype)
        self._signal = signal

    @property
    def sources(self) -> list[NDArray[Any]]:
        """The measured signal."""
        return sources(self._signal)

    def _described(self, *parameters: Any) -> str:
        """Return class and parameters, and those of the signal if it is computed as well."""
        inner = [self._signal] if isinstance(self._signal, ComputedSeries) else []
        return f"{type(self).__name__}({', '.join(map(repr, [*parameters, *inner]))})"

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the series, with the signal immutable."""
        vars(self).update(state)
        if isinstance(self._signal, np.ndarray):
            self._signal = immutable(self._signal)
