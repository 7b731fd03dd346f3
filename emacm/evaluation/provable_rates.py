"""Proofs of a rate from whole units: exact binomial test, and Bentkus' bound of means.

References
----------
.. [1] Bentkus, On Hoeffding's inequalities, Annals of Probability 32 (2), 2004.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import binom


def largest_missed(n_units: int, rate: float, confidence: float, *, exact: bool = False) -> float:
    """Return the largest fraction missed among some units that proves a missed detection rate.

    Parameters
    ----------
    n_units : int
        Number of units with faults.
    rate, confidence : float
        As for `miss_rate_limit`.
    exact : bool, default=False
        Whether each unit has one recording, so that the number of missed units is binomial.

    Returns
    -------
    float
        Mean over the units of the fraction of their recordings missed; negative if not even 0
        proves the rate.

    Notes
    -----
    Let p be the rate, B binomial of n units, and S the sum over units of the fractions missed. If
    their mean exceeds p, E f(S) <= E f(B) for every convex decreasing function f (Hoeffding), and
    f = (t - s)+ with Markov's inequality gives P(S <= x) <= E (t - B)+ / (t - x) for every
    t > x [1]_. No t gives more than Hoeffding's exponential bound, or than e P(B <= x).

    Examples
    --------
    >>> largest_missed(29, 0.1, 0.95) >= 0, largest_missed(28, 0.1, 0.95) >= 0
    (True, False)
    >>> [round(largest_missed(100, 0.1, 0.95, exact=exact), 3) for exact in (False, True)]
    [0.043, 0.04]
    """
    level = 1 - confidence
    t = np.arange(1, n_units + 1)
    probabilities = binom.cdf(t - 1, n_units, rate)  # of B <= t - 1
    if exact:
        return (int(np.count_nonzero(probabilities <= level)) - 1) / n_units
    expected = np.cumsum(probabilities)  # E (t - B)+
    return float(np.max(t - expected / level)) / n_units


def check_units(n_units: int, rate: float, confidence: float) -> None:
    """Raise a ValueError if so many units cannot prove a rate, even if none is missed."""
    needed = int(np.ceil(np.log1p(-confidence) / np.log1p(-rate) - 1e-9))
    if n_units < needed:
        lowest = 1 - (1 - confidence) ** (1 / max(n_units, 1))
        raise ValueError(
            f"{n_units} units with faults cannot prove a missed detection rate of {rate:g} with "
            f"confidence {confidence:g}: even if none is missed, the rate may be as high as "
            f"1 - (1 - {confidence:g})^(1/{max(n_units, 1)}) = {lowest:.3g}. It takes {needed} "
            f"units; otherwise give a larger rate or less confidence."
        )
