"""Isolated jumps of a shaft reference: an encoder that slips, a spike of a speed signal."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from emacm.shaft.motion import BLOCK, Series

_NEAR, _FAR = 2, 12  # samples: a jump is at most as wide as the first on either side
_ABOVE_NEIGHBOURS = 6.0  # times the highest speed from _NEAR to _FAR samples away
_ABOVE_MEDIAN = 10.0  # times the median speed while turning: more than a count of an encoder
_ABOVE_MEAN = 4.0  # times the mean speed; where no speed is higher, nothing is searched for


class Jump(NamedTuple):
    """An isolated jump of the shaft angle.

    Attributes
    ----------
    sample : int
        Number of the sample of the shaft reference.
    angle : float
        Size of the jump [rad].
    """

    sample: int
    angle: float


def largest_jump(velocity: Series, fs: float) -> Jump | None:
    """Return the largest isolated jump of the shaft angle.

    A jump is a section of at most three samples with a speed of more than six times the highest
    speed in the eleven samples on either side, and more than ten times the median speed. No shaft
    accelerates and brakes so fast; an encoder that slips or an electrical spike looks like this.
    Steps of a stepping motor and counts of a coarse encoder are not jumps, because there are many.

    Parameters
    ----------
    velocity : ndarray of shape (n_times,), or LazySeries
        Shaft velocity [rad/s].
    fs : float
        Its sampling rate [Hz].

    Returns
    -------
    Jump or None
        None if there is none.

    Examples
    --------
    >>> speed = np.full(100, 3.0)
    >>> speed[40] = 500.0
    >>> largest_jump(speed, fs=100.0)
    Jump(sample=40, angle=5.06)
    """
    largest = None
    for first in range(0, len(velocity), BLOCK):
        low, high = max(first - _FAR, 0), min(first + BLOCK + _FAR, len(velocity))
        speed = np.abs(velocity[low:high])
        if speed.max() <= _ABOVE_MEAN * speed.mean():
            continue
        jump = _largest(speed, fs)
        if jump is not None and (largest is None or jump.angle > largest.angle):
            largest = Jump(low + jump.sample, jump.angle)
    return largest


def _largest(speed: NDArray[np.floating], fs: float) -> Jump | None:
    turning = speed[speed > 0]
    usual = _ABOVE_NEIGHBOURS * _neighbours(speed)
    jumps = np.flatnonzero(speed > np.maximum(usual, _ABOVE_MEDIAN * np.median(turning)))
    if not len(jumps):
        return None
    # A jump of an angle shows in two samples of its central difference.
    angles = [float(speed[max(k - 1, 0) : k + 2].sum()) / fs for k in jumps]
    place = int(np.argmax(angles))
    return Jump(int(jumps[place]), angles[place])


def _neighbours(speed: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the highest speed from `_NEAR` to `_FAR` samples away, on either side.

    Beyond its ends the speed continues: a motion that starts in the last sample is no jump.
    """
    width = _FAR - _NEAR + 1
    highest = sliding_window_view(np.pad(speed, _FAR, mode="edge"), width).max(axis=-1)
    return np.maximum(highest[: len(speed)], highest[_FAR + _NEAR :][: len(speed)])
