"""Prediction intervals that are calibrated by unit.

A score is the value of the predicted distribution function at the true remaining life of a unit
that was left out of the fit. The scores of different units are exchangeable, those of the readings
of one unit are not: each unit counts once.

References
----------
.. [1] V. Chernozhukov, K. Wuethrich and Y. Zhu, Distributional conformal prediction, PNAS 118(48),
   2021.
.. [2] R. Dunn, L. Wasserman and A. Ramdas, Distribution-free prediction sets for two-layer
   hierarchical models, J. Am. Stat. Assoc. 118, 2023.
.. [3] R. Beran and P. Hall, Interpolated nonparametric prediction intervals and confidence
   intervals, J. R. Stat. Soc. B 55(3), 643-652, 1993.
.. [4] B. Efron, The two sample problem with censored data, Proc. 5th Berkeley Symposium 4, 1967:
   the weight of a censored value is redistributed to the larger ones.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def units_needed(coverage: float) -> int:
    """Return the smallest number of failed units that can support a coverage.

    Examples
    --------
    >>> units_needed(0.9), units_needed(0.95), units_needed(0.8)
    (9, 19, 4)
    """
    return int(np.ceil(coverage / (1 - coverage) - 1e-9))


def check_coverage(coverage: float, n_units: int) -> None:
    """Raise a ValueError if this number of failed units cannot support a coverage.

    Among n + 1 exchangeable units, the new one has the largest score with probability
    1 / (n + 1); beyond that, intervals say nothing about the data.
    """
    needed = units_needed(coverage)
    if not n_units:
        raise ValueError(
            f"no unit failed; intervals of {coverage:.0%} coverage take {needed} that did. Add "
            f"units that were followed until they failed."
        )
    if n_units < needed:
        raise ValueError(
            f"{n_units} units that failed cannot support intervals of {coverage:.0%} coverage; it "
            f"takes {needed}. They support at most {n_units / (n_units + 1):.0%}: set coverage "
            f"to this or less, or add units."
        )


def half_width(levels: Array, censored: NDArray[np.bool_], coverage: float) -> float:
    """Return how far from the median, in probability, an interval must reach [1]_.

    Among n + 1 exchangeable units, the k-th smallest score of n covers the new one with probability
    k / (n + 1); between these steps, the score is interpolated, so that the coverage is the one
    stated up to terms of the order 1 / n**2 [3]_, and not the next multiple of 1 / (n + 1).

    Parameters
    ----------
    levels : ndarray of shape (n_units,)
        Predicted probability of a life up to the true one (of a censored unit: up to the
        observed one), one for each unit.
    censored : ndarray of bool, shape (n_units,)
        Units that have not failed.
    coverage : float
        Coverage of a further unit.

    Returns
    -------
    float
        Largest ``|level - 0.5|`` of the interval; infinite if the units do not support it.

    Examples
    --------
    >>> units = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.96])
    >>> [round(half_width(units, np.zeros(9, bool), c), 2) for c in (0.8, 0.85, 0.9, 0.91)]
    [0.4, 0.43, 0.46, inf]
    """
    weights = redistributed(levels, censored)
    scores = np.abs(levels - 0.5)
    order = np.argsort(scores, kind="stable")
    order = order[weights[order] > 0]
    reached = np.cumsum(weights[order])
    if not len(order) or coverage > reached[-1] + 1e-9:
        return np.inf
    return float(np.interp(coverage, np.append(0.0, reached), np.append(0.0, scores[order])))


def redistributed(levels: Array, censored: NDArray[np.bool_]) -> Array:
    """Return the weight of each unit; the new unit, which may be anywhere, has the rest to 1.

    The weight 1 / (n + 1) of a censored unit is given to the units with larger levels and to the
    new one, in equal parts [4]_.

    Examples
    --------
    >>> redistributed(np.array([0.2, 0.5, 0.8]), np.array([False, True, False])).tolist()
    [0.25, 0.0, 0.375]
    """
    n_units = len(levels)
    weights = np.full(n_units, 1 / (n_units + 1))
    # At equal levels, failures come before censored units, as in the Kaplan-Meier estimate.
    order = np.lexsort((censored, levels))
    for position, unit in enumerate(order):
        if censored[unit]:
            later = order[position + 1 :]
            weights[later] += weights[unit] / (len(later) + 1)
            weights[unit] = 0
    return weights
