"""Check that the lines of a shaft stand out from the lines between its orders.

A machine that repeats its motion, such as an actuator that reverses all the time, has lines at all
multiples of the frequency of repetition. Any multiple of this frequency then looks like a speed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage

Array = NDArray[np.floating]

_STRONG = 4.0  # logarithm of the power over the median from which all lines are equal
_NEAR = 3  # bins of a line, either way
_LIKE = 0.65  # of the mean of the orders: lines that are as strong
# Families of lines beside that of the shaft: a damaged bearing has one for each harmonic.
_FAMILIES, _WIDTH = 7, 8  # at most, and bins that each needs


def orders_stand_out(
    frame: Array, speed: float, rate: float, orders: Array, fs: float, highest: float
) -> bool:
    """Tell whether few other positions between the orders have as many lines as the orders.

    Parameters
    ----------
    frame : ndarray of shape (n_times,)
        Signal with a flat background.
    speed : float
        Speed at the centre of the frame [Hz].
    rate : float
        Relative rate of change of the speed [1/s].
    orders : ndarray of shape (n_orders,)
        Orders with lines, ascending.
    fs : float
        Sampling rate [Hz].
    highest : float
        Highest frequency in the signal [Hz].

    Returns
    -------
    bool
        False if lines are everywhere between the orders.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(8000) / 2000
    >>> noise = 0.1 * np.random.default_rng(0).normal(size=len(t))
    >>> shaft = sum(np.cos(2 * np.pi * 20 * k * t + k * k) for k in range(1, 9))
    >>> orders_stand_out(shaft + noise, 20.0, 0.0, np.arange(1.0, 9), 2000, 1000)
    True
    >>> repeated = sum(np.cos(2 * np.pi * 2 * k * t + k * k) for k in range(1, 90))
    >>> orders_stand_out(repeated + noise, 20.0, 0.0, np.arange(1.0, 9), 2000, 1000)
    False
    """
    n_times = len(frame)
    centred = (np.arange(n_times) - (n_times - 1) / 2) / fs
    if rate:
        turned = centred + rate * centred**2 / 2
        frame = np.interp(centred, turned, frame)
    n_bins = int(highest * n_times / fs) + 1
    power = np.abs(fft.rfft(frame * np.hanning(n_times))[:n_bins]) ** 2
    heights = np.log(np.maximum(ndimage.maximum_filter1d(power, 3), 1e-300) / np.median(power))
    heights = np.clip(heights, 0, _STRONG)
    revolutions = speed * n_times / fs
    half = int(revolutions * np.diff(orders, prepend=0.0).min() / 2)
    places = np.rint(orders[:, np.newaxis] * revolutions).astype(np.intp)
    places = places + np.arange(-half, half + 1)
    inside = places[:, -1] < len(heights)
    if half < _WIDTH or not inside.any():  # too little is between the orders
        return False
    mean = heights[places[inside]].mean(axis=0)
    own = mean[half - 1 : half + 2].max()
    mean[half - _NEAR : half + _NEAR + 1] = 0
    like = ndimage.maximum_filter1d(mean, 2 * _NEAR + 1, mode="wrap") == mean
    like &= mean >= max(_LIKE * own, 1e-9)
    return int(like.sum()) <= min(_FAMILIES, 2 * half // _WIDTH)
