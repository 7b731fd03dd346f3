"""Angle and velocity of a shaft, worked out piece by piece from whichever was measured.

An hour at 48 kHz would take 1.4 GB as an array of angles. What stands here looks like such an
array, but holds only the angle at every 256th sample and computes a slice when it is read.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from emacm._kernels import kernels

BLOCK = 1 << 17  # samples read in one go
_STRIDE = 256  # samples from one remembered angle to the next


class Series(Protocol):
    """What slices like a 1-D array."""

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the samples."""
        ...

    def __len__(self) -> int:
        """Return the number of samples."""
        ...

    def __getitem__(self, key: Any) -> Any:
        """Return a slice as an array, or one sample."""
        ...


class LazySeries:
    """A 1-D array of which slices are computed when they are read.

    Subclasses supply `_read`.

    Parameters
    ----------
    length : int
        Number of samples.
    dtype : dtype
        Their type.
    """

    def __init__(self, length: int, dtype: Any = np.float64) -> None:
        self._length = length
        self.dtype = np.dtype(dtype)

    def __len__(self) -> int:
        """Return the number of samples."""
        return self._length

    def __getitem__(self, key: Any) -> Any:
        """Return one sample, or a slice of step 1."""
        if isinstance(key, slice):
            start, stop, step = key.indices(self._length)
            if step != 1:
                return np.asarray(self)[key]
            return self._read(start, stop) if start < stop else np.empty(0, self.dtype)
        index = range(self._length)[key]
        return self._read(index, index + 1)[0]

    def __array__(self, dtype: Any = None, copy: Any = None) -> NDArray[Any]:
        """Return the whole series."""
        whole = self._read(0, self._length)
        return whole if dtype is None else whole.astype(dtype)

    def _read(self, start: int, stop: int) -> NDArray[np.floating]:
        raise NotImplementedError


class IntegratedAngle(LazySeries):
    """Cumulative angle of a velocity, by the trapezoid rule, from 0 upwards.

    Parameters
    ----------
    velocity : ndarray of shape (n_times,)
        Shaft velocity [rad/s].
    fs : float
        Its sampling rate [Hz].

    Notes
    -----
    Chirico, Eq. (2.9), with the parentheses it lacks; accumulated in float64.
    """

    def __init__(self, velocity: NDArray[np.floating], fs: float) -> None:
        super().__init__(len(velocity))
        self.velocity = velocity
        self.fs = fs
        self._half_step = 0.5 / fs
        self._known, self._lowest, self._highest = kernels().cumulative_angle_checkpoints(
            velocity, self._half_step, _STRIDE
        )

    def one_way(self, min_speed: float) -> int:
        """Return 1 or -1 if the shaft turns that way all the time, faster than `min_speed`."""
        return int(self._lowest.min() > min_speed) - int(self._highest.max() < -min_speed)

    def speed_limit(self, start: int, stop: int) -> float:
        """Bound the speed from sample `start` to `stop` [rad/s]: that, or a little more."""
        pieces = slice(start // _STRIDE, -(-stop // _STRIDE))
        return max(float(self._highest[pieces].max()), -float(self._lowest[pieces].min()))

    def _read(self, start: int, stop: int) -> NDArray[np.floating]:
        first = start // _STRIDE
        velocity = self.velocity[first * _STRIDE : stop]
        angle = kernels().integrate(velocity, self._half_step, self._known[first:], _STRIDE)
        return angle[start - first * _STRIDE :]


class DifferentiatedVelocity(LazySeries):
    """Velocity of an angle, by central differences, as `numpy.gradient` has it.

    Parameters
    ----------
    angle : ndarray of shape (n_times,)
        Cumulative shaft angle [rad].
    fs : float
        Its sampling rate [Hz].
    """

    def __init__(self, angle: NDArray[np.floating], fs: float) -> None:
        super().__init__(len(angle))
        self._angle = angle
        self._fs = fs

    def _read(self, start: int, stop: int) -> NDArray[np.floating]:
        low, high = max(start - 1, 0), min(stop + 1, self._length)
        # Two samples beyond an end of the recording, where the difference is one-sided.
        low, high = min(low, max(0, self._length - 2)), max(high, min(2, self._length))
        velocity = np.gradient(self._angle[low:high]) * self._fs
        return velocity[start - low : stop - low]


def parts(start: int, stop: int, at_most: int) -> Iterator[tuple[int, int]]:
    """Yield first and last + 1 of parts of a range: as few as may be, of about equal length.

    Parameters
    ----------
    start, stop : int
        The range.
    at_most : int
        Length that no part goes beyond.

    Yields
    ------
    first, last : int

    Examples
    --------
    >>> list(parts(0, 10, 4))
    [(0, 3), (3, 6), (6, 10)]
    """
    count = max(0, -((start - stop) // at_most))
    for k in range(count):
        yield start + k * (stop - start) // count, start + (k + 1) * (stop - start) // count


def blocks(series: Series, start: int = 0, stop: int | None = None) -> Iterator[tuple[int, Any]]:
    """Yield a series in pieces of at most `BLOCK` samples, each with its first index."""
    stop = len(series) if stop is None else stop
    for first in range(start, stop, BLOCK):
        yield first, series[first : min(first + BLOCK, stop)]
