"""The conditional risk of each decision, and the decision of least risk.

Rows of a cost matrix are decisions, columns are true classes, as in `emacm.decisions.costs`.

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_real_array

Array = NDArray[np.float64]

# Risks that differ by less than this fraction of the least one are equal: rounding alone.
_TIE = 1e-12


def canonical_cost(cost: ArrayLike) -> Array:
    """Reduce a cost matrix to the part that determines decisions.

    Constants added to all decisions of one true class, and a scale of the whole matrix, change
    no decision. The least cost of each column becomes 0, the largest of all 1.

    Parameters
    ----------
    cost : array-like of shape (n_decisions, n_classes)
        Rows are decisions, columns are true classes.

    Returns
    -------
    canonical : ndarray of shape (n_decisions, n_classes)
        Costs from 0 to 1; all zero if no decision differs from another.

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
    """Return the expected cost of each decision, Eq. (2.39) of [1]_.

    Parameters
    ----------
    posterior : array-like of shape (n_recordings, n_classes)
        Probability of each class for each recording.
    cost : array-like of shape (n_decisions, n_classes)
        Rows are decisions, columns are true classes.

    Returns
    -------
    risk : ndarray of shape (n_recordings, n_decisions)
        Expected cost of each decision, in the unit of `cost`.

    Raises
    ------
    TypeError, ValueError
        If a probability is negative or not finite, a cost is not finite, or the shapes do not fit.

    References
    ----------
    .. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
       Condition Monitoring, section 2.2.

    Examples
    --------
    >>> conditional_risk([[0.7, 0.3]], [[0, 1], [10, 0]])
    array([[0.3, 7. ]])
    """
    return risks_of(*_checked(posterior, cost))


def least_risk(posterior: ArrayLike, cost: ArrayLike) -> NDArray[np.intp]:
    """Return the decision of least conditional risk, Eq. (2.43) of [1]_.

    Scaling all costs, or adding a constant to all decisions of one true class, changes no
    decision. Of equal risks (but for rounding) the first decision is returned.

    Parameters
    ----------
    posterior : array-like of shape (n_recordings, n_classes)
        Probability of each class for each recording.
    cost : array-like of shape (n_decisions, n_classes)
        Rows are decisions, columns are true classes.

    Returns
    -------
    rows : ndarray of shape (n_recordings,)
        Row of `cost` of each decision.

    Raises
    ------
    TypeError, ValueError
        If a probability is negative or not finite, all probabilities of a recording are 0, a cost
        is not finite, or the shapes do not fit.

    References
    ----------
    .. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
       Condition Monitoring, section 2.2.

    Examples
    --------
    >>> least_risk([[0.7, 0.3]], [[0, 1], [10, 0]])
    array([0])
    >>> least_risk([[0.7, 0.3]], [[0, 10], [1, 0]])
    array([1])
    """
    probability, matrix = _checked(posterior, cost)
    empty = ~(probability.sum(axis=1) > 0)
    if empty.any():
        raise ValueError(
            f"posterior must have a positive probability for every recording, but all "
            f"probabilities of recording {int(np.argmax(empty))} are 0."
        )
    return decide(probability, matrix)


def decide(probability: Array, cost: Array) -> NDArray[np.intp]:
    """As `least_risk`, without checks, for arrays of float64."""
    risk = risks_of(probability, canonical_cost(cost))
    # Canonical costs are not negative: no risk is a small difference of large terms.
    least = risk.min(axis=1, keepdims=True)
    return (risk <= least + _TIE * least).argmax(axis=1)


def risks_of(probability: Array, cost: Array) -> Array:
    """As `conditional_risk`, without checks, for arrays of float64."""
    # A matrix product may add the terms of one column in another order than those of the next.
    # Multiplied by distinct rows only, equal decisions have equal risks to the last bit.
    rows = [tuple(row) for row in cost.tolist()]
    distinct = list(dict.fromkeys(rows))
    risk = (np.array(distinct) @ probability.T).T
    return risk if len(distinct) == len(rows) else risk[:, [distinct.index(row) for row in rows]]


def _checked(posterior: ArrayLike, cost: ArrayLike) -> tuple[Array, Array]:
    """Return probabilities and costs as arrays of float64."""
    probability = check_real_array(posterior, "posterior").astype(np.float64, copy=False)
    matrix = check_real_array(cost, "cost").astype(np.float64, copy=False)
    for array, name, rows in (
        (probability, "posterior", "recording"),
        (matrix, "cost", "decision"),
    ):
        if array.ndim != 2 or not array.shape[1]:
            raise ValueError(
                f"{name} must have one row per {rows} and one column per class, "
                f"got shape {array.shape}."
            )
        bad = ~np.isfinite(array) | (array < 0 if array is probability else False)
        if bad.any():
            row, column = np.argwhere(bad)[0].tolist()
            limit = "finite and at least 0" if array is probability else "finite"
            raise ValueError(
                f"{name} must be {limit}, got {array[row, column]} for {rows} {row}, "
                f"class number {column}."
            )
    if probability.shape[1] != matrix.shape[1] or not len(matrix):
        raise ValueError(
            f"posterior and cost must have the same number of columns (classes), and cost at "
            f"least one row; got shapes {probability.shape} and {matrix.shape}."
        )
    return probability, matrix
