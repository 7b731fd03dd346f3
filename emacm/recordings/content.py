"""What a recording contains, as arrays, and whether two contents are equal."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.shaft.motion import Series


class Arrays(Mapping[str, NDArray[np.floating]]):
    """Channels as arrays, each computed as a whole when it is read."""

    def __init__(self, series: Mapping[str, Series]) -> None:
        self._series = series

    def __getitem__(self, name: str) -> NDArray[np.floating]:
        series = self._series[name]
        if isinstance(series, np.ndarray):
            return series
        whole = series[:]
        whole.flags.writeable = False
        return whole

    def __iter__(self) -> Iterator[str]:
        return iter(self._series)

    def __len__(self) -> int:
        return len(self._series)


def same_content(one: Any, other: Any) -> bool:
    """Compare values that may hold arrays."""
    if one is other:
        return True
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return list(one) == list(other) and all(same_content(one[key], other[key]) for key in one)
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        equal_nan = one.dtype.kind in "fc"
        return one.dtype == other.dtype and np.array_equal(one, other, equal_nan=equal_nan)
    if type(one) is not type(other):
        return bool(np.isscalar(one) and np.isscalar(other) and one == other)
    if isinstance(one, pd.DataFrame | pd.Series | pd.Index):
        return bool(one.equals(other))
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(same_content, one, other))
    return bool(one == other or (one != one and other != other))
