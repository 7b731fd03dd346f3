"""Check that the lines of a shaft stand out from the lines between its orders.

A machine that repeats its motion, such as an actuator that reverses all the time, has lines at all
multiples of the frequency of repetition. Any multiple of this frequency then looks like a speed.
Where these lines are too close together to be counted, they are recognised by two properties: they
are evenly spaced, and together they are a signal whose level varies during the motion. A damaged
bearing may have evenly spaced lines too, and a shaft in noise a level that varies, but not both.
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
# Lines of a repeated motion: the fewest bins between two of them, their contrast as a fraction of
# that of the orders, the revolutions of the windows in which the lines are not separate, and the
# scatter of their level in these windows, relative to that of noise.
_CLOSE, _EVEN, _SHORT, _UNSTEADY = 2.5, 0.1, 5, 1.15


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
    raw = np.clip(np.log(np.maximum(power, 1e-300) / np.median(power)), 0, _STRONG)
    heights = ndimage.maximum_filter1d(raw, 3)
    revolutions = speed * n_times / fs
    gap = revolutions * float(np.diff(orders, prepend=0.0).min())
    half = int(gap / 2)
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
    if int(like.sum()) > min(_FAMILIES, 2 * half // _WIDTH):
        return False
    steady = _scatter(frame, orders[inside] * speed, _SHORT / speed, fs) < _UNSTEADY
    return steady or _evenness(raw, places[inside, half], gap) < _EVEN


def _evenness(heights: Array, places: NDArray[np.intp], gap: float) -> float:
    """Return the contrast of evenly spaced lines between orders, relative to that of the orders.

    Lines of a repeated motion are at all m-th parts of the distance of two orders, and none is
    halfway between two of them.
    """
    across = np.minimum(places[:, np.newaxis] + np.arange(int(gap)), len(heights) - 1)
    profile = heights[across].mean(axis=0)
    own = profile[[-1, 0, 1]].max() - np.median(profile)
    most = 0.0
    for m in range(_FAMILIES + 1, int(gap / _CLOSE) + 1):
        lines = np.rint(np.arange(1, m) * gap / m).astype(np.intp)
        halfway = np.rint((np.arange(m - 1) + 0.5) * gap / m).astype(np.intp)
        # Some lines may be weak and some between may be high, but not many.
        low, high = np.quantile(profile[lines], 0.25), np.quantile(profile[halfway], 0.75)
        most = max(most, float(low - high))
    return most / max(float(own), 1e-9)


def _scatter(frame: Array, frequencies: Array, duration: float, fs: float) -> float:
    """Return the scatter of the mean level of lines over time, relative to that of noise.

    The logarithm of the power of noise in one bin has a variance of pi²/6.
    """
    n_window = round(duration * fs)
    windows = np.lib.stride_tricks.sliding_window_view(frame, n_window)[:: max(1, n_window // 2)]
    spectra = np.abs(fft.rfft(windows * np.hanning(n_window + 2)[1:-1])) ** 2
    bins = np.rint(frequencies * n_window / fs).astype(np.intp)
    levels = np.log(np.maximum(spectra[:, bins], 1e-300)).mean(axis=1)
    return float(levels.std() / (np.pi / np.sqrt(6 * len(frequencies))))
