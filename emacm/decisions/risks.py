"""The conditional risk of each decision, and the decision of least risk.

Rows of a cost matrix are the decision, columns are the truth, as in `emacm.decisions.costs`.

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm.decisions.blocks import product

Array = NDArray[np.float64]

# Risks that differ by less than this share of the least one are a tie: rounding alone.
_TIE = 1e-12
_DOUBT = 1e-9  # per class: log posteriors that differ by more have risks that are no tie


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
    first, place = distinct_rows(matrix)
    risk = product(matrix[first], probability.T).T
    return risk if len(first) == len(place) else risk[:, place]


def distinct_rows(cost: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Find the rows that differ from those before, and each row among them.

    Products of matrices may add up one column in another order than the next. Multiplied
    by distinct rows only, equal decisions have equal risks, to the last bit.

    Parameters
    ----------
    cost : ndarray of shape (n_decisions, n_classes)
        Rows are the decision.

    Returns
    -------
    first : ndarray of shape (n_distinct,)
        Numbers of the rows that differ from those before.
    place : ndarray of shape (n_decisions,)
        For each row, the number in `first` of the one it equals.

    Examples
    --------
    >>> distinct_rows(np.array([[2.0, 0.0], [1.0, 0.0], [2.0, 0.0]]))
    (array([0, 1]), array([0, 1, 0]))
    """
    rows = [tuple(row) for row in cost.tolist()]
    number = {row: at for at, row in enumerate(dict.fromkeys(rows))}
    return np.array([rows.index(row) for row in number]), np.array([number[row] for row in rows])


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
    return LeastRisk(cost).decide(np.asarray(posterior, dtype=np.float64).T)


class LeastRisk:
    """The rule of least conditional risk for one cost matrix, Eq. (2.43).

    Parameters
    ----------
    cost : array-like of shape (n_decisions, n_classes)
        Rows are the decision, columns the truth.

    Examples
    --------
    >>> LeastRisk([[0, 1], [1, 0]]).decide_by_scores(np.log([[0.7, 0.5], [0.3, 0.5]]))
    array([0, 0])
    """

    def __init__(self, cost: ArrayLike):
        canonical = canonical_cost(cost)
        self._rows, _ = distinct_rows(canonical)  # of equal rows the first wins
        self._cost = canonical[self._rows]
        self._zero_one = np.array_equal(canonical, 1.0 - np.eye(len(canonical)))

    def decide(self, weights: Array) -> NDArray[np.intp]:
        """Decide by posteriors, or by anything proportional to them.

        Parameters
        ----------
        weights : ndarray of shape (n_classes, n_recordings)
            Not negative; in every column a multiple of the posterior.

        Returns
        -------
        rows : ndarray of shape (n_recordings,)
            Row of the cost to decide for.
        """
        risk = product(self._cost, weights)
        # Canonical costs are not negative: no risk is a small difference of large terms.
        least = risk.min(axis=0)
        return self._rows[_first(~(risk > least + _TIE * np.abs(least)))]

    def decide_by_scores(self, scores: Array) -> NDArray[np.intp]:
        """Decide by logarithms of the posteriors, each column up to a constant.

        Parameters
        ----------
        scores : ndarray of shape (n_classes, n_recordings)
            Logarithms; used as work space.

        Returns
        -------
        rows : ndarray of shape (n_recordings,)
            Row of the cost to decide for.
        """
        if self._zero_one:
            return self._most_probable(scores)
        scores -= scores.max(axis=0)
        return self.decide(np.exp(scores, out=scores))

    def _most_probable(self, scores: Array) -> NDArray[np.intp]:
        """Decide by 0-1 costs, whose least risk is that of the most probable class.

        Exponentials are needed only where two classes are so close that their risks may
        be a tie.
        """
        doubt = _DOUBT * len(scores)
        if len(scores) == 2:
            gap = scores[1] - scores[0]
            if np.abs(gap).min(initial=np.inf) > doubt:
                return (gap > 0).astype(np.intp)
        least = scores.max(axis=0) - doubt
        close = scores >= least
        chosen = _first(close)
        if np.count_nonzero(close) > len(least):
            doubtful = np.flatnonzero(np.count_nonzero(close, axis=0) > 1)
            chosen[doubtful] = self.decide(np.exp(scores[:, doubtful] - least[doubtful]))
        return chosen


def _first(true: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Row of the first True in every column; there is at least one."""
    if np.count_nonzero(true) > true.shape[1] or len(true) > 256:
        return true.argmax(axis=0)
    # One in every column: the sum of their row numbers, much faster.
    numbers = np.arange(len(true), dtype=np.uint8)
    return np.einsum("k,kr->r", numbers, true.view(np.uint8)).astype(np.intp)
