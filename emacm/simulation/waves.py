"""Sums of sines over an angle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]


def sines(angle: Array, *terms: tuple[float, float, float]) -> Array:
    """Return the sum of sines ``size * sin(order * angle + phase)``.

    Parameters
    ----------
    angle : ndarray of shape (n_times,)
        Angle of the shaft, or 2 pi times the time [rad].
    *terms : (float, float, float)
        Order (or frequency), size and phase [rad] of each sine.

    Returns
    -------
    ndarray of shape (n_times,)

    Examples
    --------
    >>> angle = np.array([0.0, np.pi / 6])
    >>> sines(angle, (3, 1.0, 0.0)).round(9), sines(angle, (3, 2.0, np.pi / 2)).round(9)
    (array([0., 1.]), array([2., 0.]))
    """
    total = np.zeros_like(angle)
    for order, size, phase in terms:
        if size:
            total += size * np.sin(order * angle + phase)
    return total
