"""Waves that are fixed in time: mains and switching of the inverter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def sine_wave(frequency: float, times: NDArray[np.floating], phase: float) -> NDArray[np.floating]:
    """Return a sine of a whole number of hertz over evenly spaced times.

    Parameters
    ----------
    frequency : float
        Frequency [Hz].
    times : ndarray of shape (n_times,)
        Times [s].
    phase : float
        Phase at time 0 [rad].

    Returns
    -------
    ndarray of shape (n_times,)

    Examples
    --------
    >>> sine_wave(1.0, np.arange(6) / 4, 0.0).round(9)
    array([ 0.,  1.,  0., -1.,  0.,  1.])
    """
    fs = round(1 / (times[1] - times[0]), 6)
    whole = float(fs).is_integer() and float(frequency).is_integer()
    n_computed = min(int(fs), len(times)) if whole else len(times)  # it repeats every second
    wave = np.sin(2 * np.pi * frequency * times[:n_computed] + phase)
    return wave if n_computed == len(times) else np.resize(wave, len(times))
