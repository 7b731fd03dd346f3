"""Waves over time and over the shaft angle, computed with few sines."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]
BLOCK = 8192  # samples that are computed together: their arrays stay in the cache


def sine_wave(frequency: float, times: Array, phase: float) -> Array:
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


class OrderWaves:
    """Waves of whole orders over the shaft angle, all from one complex exponential.

    Parameters
    ----------
    angle : ndarray of shape (n_times,)
        Shaft angle [rad].

    Examples
    --------
    >>> waves = OrderWaves(np.array([0.0, np.pi / 6]))
    >>> waves.sines((3, 1.0, 0.0)).round(9), waves.sines((3, 2.0, np.pi / 2)).round(9)
    (array([0., 1.]), array([2., 0.]))
    """

    def __init__(self, angle: Array) -> None:
        self._turning = np.empty(len(angle), dtype=complex)
        # By the tangent of the half angle, which NumPy computes faster than sine and cosine.
        for start in range(0, len(angle), BLOCK):
            tangent = np.tan(angle[start : start + BLOCK] / 2)
            square = tangent * tangent
            turning = self._turning[start : start + BLOCK]
            turning.real = (1 - square) / (1 + square)
            turning.imag = 2 * tangent / (1 + square)

    def sines(self, *terms: tuple[int, float, float]) -> Array:
        """Return the sum of sines ``size * sin(order * angle + phase)``.

        Parameters
        ----------
        *terms : (int, float, float)
            Order, size and phase [rad] of each sine.

        Returns
        -------
        ndarray of shape (n_times,)
        """
        total = np.zeros(len(self._turning))
        weights = [(order, size * np.exp(1j * phase)) for order, size, phase in terms if size]
        # Powers stay in the cache: full-length arrays would cost more than their products.
        for start in range(0, len(total) if weights else 0, BLOCK):
            block = slice(start, start + BLOCK)
            powers = {1: self._turning[block]}
            waves = [weight * _power(powers, order) for order, weight in weights]
            for wave in waves[1:]:
                waves[0] += wave
            total[block] = waves[0].imag
        return total


def _power(powers: dict[int, NDArray[Any]], order: int) -> NDArray[Any]:
    """Return a power by multiplication, and keep it for the next ones."""
    if order not in powers:
        if order % 2:
            powers[order] = _power(powers, order - 1) * powers[1]
        else:
            powers[order] = _power(powers, order // 2) ** 2
    return powers[order]
