"""The conditional risk of each decision, and the decision of least risk.

Rows of a cost matrix are the decision, columns are the truth, as in `emacm.costs`.

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Risks that differ by less than this share of the least one are a tie: rounding alone.
_TIE = 1e-12


def canonical_cost(cost: ArrayLike) -> Array:
    """Reduce a cost matrix to the part that decisions depend on.

    What is added to every decision of one true class, and the scale of the whole, change
    no decision. The least cost of each column becomes 0, the largest of all 1.

    Parameters
    ----------
    cost : array-like of shape (n_decisions, n_classes)
        Rows are the decision, columns the truth.

    Returns
    -------
    canonical : ndarray of shape (n_decisions, n_classes)
        Costs in 0..1; all zero if no decision differs from another.

    Examples
    --------
    >>> canonical_cost([[5, 20], [7, 0]])
    array([[0. , 1. ],
           [0.1, 0. ]])
    """
    matrix = np.asarray(cost, dtype=np.float64)
    matrix = matrix / max(np.abs(matrix).max(), np.finfo(float).tiny)  # no overflow below
    regret = matrix - matrix.min(axis=0)
    largest = regret.max()
    return regret / largest if largest > 0 else regret


def conditional_risk(posterior: ArrayLike, cost: ArrayLike) -> Array:
    """Weigh the costs of each decision by the probability of each truth, Eq. (2.39).

    Parameters
    ----------
    posterior : array-like of shape (n_recordings, n_classes)
        Probability of each class for each recording.
    cost : array-like of shape (n_decisions, n_classes)
        Rows are the decision, columns the truth.

    Returns
    -------
    risk : ndarray of shape (n_recordings, n_decisions)
        Expected cost of each decision, in the unit of `cost`.

    Examples
    --------
    >>> conditional_risk([[0.7, 0.3]], [[0, 1], [10, 0]])
    array([[0.3, 7. ]])
    """
    probability = np.asarray(posterior, dtype=np.float64)
    matrix = np.asarray(cost, dtype=np.float64)
    risk = np.zeros((len(probability), len(matrix)))
    # One sum for every decision in the same order, so that equal rows give equal risks.
    for k in range(matrix.shape[1]):
        risk += probability[:, k, np.newaxis] * matrix[:, k]
    return risk


def least_risk(posterior: ArrayLike, cost: ArrayLike) -> NDArray[np.intp]:
    """Find the decision of least conditional risk, Eq. (2.43).

    Scaling all the costs, or adding a constant to every decision of one true class,
    changes no decision. Ties (risks equal but for rounding) go to the first decision.

    Parameters
    ----------
    posterior : array-like of shape (n_recordings, n_classes)
        Probability of each class for each recording.
    cost : array-like of shape (n_decisions, n_classes)
        Rows are the decision, columns the truth.

    Returns
    -------
    rows : ndarray of shape (n_recordings,)
        Row of `cost` to decide for.

    Examples
    --------
    >>> least_risk([[0.7, 0.3]], [[0, 1], [10, 0]])
    array([0])
    >>> least_risk([[0.7, 0.3]], [[0, 10], [1, 0]])
    array([1])
    """
    risk = conditional_risk(posterior, canonical_cost(cost))
    # Canonical costs are not negative: no risk is a small difference of large terms.
    return np.argmax(risk <= risk.min(axis=1, keepdims=True) * (1 + _TIE), axis=1)
