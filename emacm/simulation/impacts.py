"""Impacts of rolling elements on a defect, and how a structure rings with them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]


class Passage(NamedTuple):
    """Passage of the rolling elements over a defect.

    Attributes
    ----------
    phase : ndarray of shape (n_times,)
        Number of rolling elements that have passed; an impact occurs at each whole number.
    weight : ndarray of shape (n_times,)
        Fraction of the load that the contact at the defect carries, in [0, 1].
    impacts : ndarray of shape (n_impacts,), of int
        Samples of the impacts.
    sizes : ndarray of shape (n_impacts,)
        Random size of each impact, relative to the median.
    """

    phase: Array
    weight: Array
    impacts: NDArray[np.intp]
    sizes: Array

    @property
    def pulses(self) -> Array:
        """One pulse per rolling element, with mean 0 and a width of a fifth of their distance."""
        return self.weight * (np.cos(np.pi * self.phase) ** 16 - 6435 / 32768)  # less its mean

    @property
    def force(self) -> Array:
        """Size of the impact at each sample, under its load; 0 between the impacts."""
        struck = np.zeros_like(self.phase)
        struck[self.impacts] = self.sizes * self.weight[self.impacts]
        return struck


def ball_passage(
    order: float,
    angle: Array,
    rng: np.random.Generator,
    *,
    turns_with: float = 0.0,
    mark: float = 0.0,
) -> Passage:
    """Return when rolling elements pass a defect, with slip, and under which load.

    The intervals between impacts are independent random numbers, so that the phase is lost over
    many impacts, as measured on machines [1]_. The load is distributed over the ring by
    Stribeck's formula [2]_: impacts on a defect that turns through the load zone are modulated.

    Parameters
    ----------
    order : float
        Rolling elements that pass the defect per revolution.
    angle : ndarray of shape (n_times,)
        Shaft angle [rad].
    rng : Generator
        Random numbers of the slip, of the initial position and of the size of impacts.
    turns_with : float
        Order at which the defect turns through the load zone; 0: it does not move.
    mark : float
        Angular position of the defect relative to the shaft [rad].

    Returns
    -------
    Passage

    References
    ----------
    .. [1] J. Antoni and R. B. Randall, A stochastic model for simulation and diagnostics of rolling
       element bearings with localized faults, J. Vib. Acoust. 125 (2003).
    .. [2] T. A. Harris, Rolling Bearing Analysis: load over a ring is
       ``(1 - (1 - cos(psi)) / (2 epsilon)) ** 1.5``; epsilon 1.2 is assumed.

    Examples
    --------
    >>> angle = np.linspace(0, 2 * np.pi * 100, 100_000)
    >>> len(ball_passage(6.123, angle, np.random.default_rng(0)).impacts)
    612
    """
    steps = np.diff(angle, prepend=angle[0]) * (order / (2 * np.pi))
    start = rng.uniform()
    # Assumed: the interval between two balls scatters by 0.5 %, the size of an impact by 20 %.
    slip = np.cumsum(0.005 * np.sqrt(np.abs(steps)) * rng.standard_normal(len(angle)))
    phase = start + order / (2 * np.pi) * (angle - angle[0]) + slip
    impacts = np.flatnonzero(np.diff(np.floor(phase))) + 1
    sizes = np.exp(0.2 * rng.standard_normal(len(impacts)))
    weight = np.ones_like(phase)
    if turns_with:
        psi = turns_with * angle + mark
        weight = (1 - (1 - np.cos(psi)) / (2 * 1.2)) ** 1.5
    return Passage(phase, weight, impacts, sizes)


def ringing(fs: float, frequency: float, damping: float, duration: float) -> Array:
    """Return the response of a resonance to an impulse, with a first peak of about 1.

    Parameters
    ----------
    fs, frequency : float
        Sampling rate, and frequency of the resonance [Hz].
    damping : float
        Damping ratio.
    duration : float
        Length of the response [s].

    Returns
    -------
    ndarray of shape (n_times,)
    """
    phase = 2 * np.pi * frequency * np.arange(round(duration * fs)) / fs
    return np.exp(-damping * phase) * np.sin(phase)
