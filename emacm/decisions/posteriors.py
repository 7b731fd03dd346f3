"""Posteriors, risks and decisions of Gaussian classes with priors, block by block.

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emacm.decisions.blocks import in_blocks, product
from emacm.decisions.gaussians import GaussianClasses
from emacm.decisions.risks import LeastRisk, distinct_rows

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BayesRule:
    """Bayes' rule for Gaussian classes, Eqs. (2.41)-(2.43) of [1]_.

    Attributes
    ----------
    gaussians : GaussianClasses
        Density of each class.
    log_priors : ndarray of shape (n_classes,)
        Logarithms of the prior probabilities; -inf for a class that never occurs.

    Examples
    --------
    >>> from emacm.decisions.gaussians import class_moments, fit_gaussians
    >>> X = np.array([[0.0], [2.0], [5.0], [7.0]])
    >>> gaussians = fit_gaussians(class_moments(X, np.array([0, 0, 1, 1]), 2))
    >>> rule = BayesRule(gaussians, np.log([0.5, 0.5]))
    >>> rule.posterior(np.array([[3.5], [9.0]])).round(3)
    array([[0.5, 0.5],
           [0. , 1. ]])
    >>> rule.decide(np.array([[3.5], [9.0]]), np.array([[0.0, 1.0], [10.0, 0.0]]))
    array([0, 1])
    """

    gaussians: GaussianClasses
    log_priors: Array

    def joint(self, X: Array) -> Array:
        """Logarithm of prior times density, shape (n_recordings, n_classes)."""
        n_rows = self.gaussians.distances.n_rows

        def block(rows: Array) -> Array:
            return self.gaussians.log_terms(rows, self.log_priors).T

        return in_blocks(block, X, n_rows, len(self.log_priors))

    def log_posterior(self, X: Array) -> Array:
        """Logarithm of the posterior, Eq. (2.42), shape (n_recordings, n_classes)."""

        def block(rows: Array) -> Array:
            scores = self._scores(rows)
            scores -= scores.max(axis=0)
            scores -= np.log(np.exp(scores).sum(axis=0))
            return scores.T

        return in_blocks(block, X, self._n_rows, len(self.log_priors))

    def posterior(self, X: Array) -> Array:
        """Posterior, Eq. (2.42), shape (n_recordings, n_classes)."""
        return in_blocks(
            lambda rows: self._posterior(rows).T, X, self._n_rows, len(self.log_priors)
        )

    def risk(self, X: Array, cost: Array) -> Array:
        """Conditional risk, Eq. (2.39), shape (n_recordings, n_decisions)."""
        first, place = distinct_rows(cost)
        prices = cost[first]

        def block(rows: Array) -> Array:
            return product(prices, self._posterior(rows)).T

        risk = in_blocks(block, X, self._n_rows, len(first))
        return risk if len(first) == len(place) else risk[:, place]

    def decide(self, X: Array, cost: Array) -> NDArray[np.intp]:
        """Row of the cost with the least risk, Eq. (2.43), shape (n_recordings,)."""
        least = LeastRisk(cost)

        def block(rows: Array) -> NDArray[np.intp]:
            return least.decide_by_scores(self._scores(rows))

        return in_blocks(block, X, self._n_rows, dtype=np.intp)

    @property
    def _n_rows(self) -> int:
        linear = self.gaussians.discriminants
        return self.gaussians.distances.n_rows if linear is None else linear.n_rows

    def _scores(self, rows: Array) -> Array:
        return self.gaussians.log_scores(rows, self.log_priors)

    def _posterior(self, rows: Array) -> Array:
        scores = self._scores(rows)
        if len(scores) == 2:
            return _of_two(scores)
        scores -= scores.max(axis=0)
        np.exp(scores, out=scores)
        scores /= scores.sum(axis=0)
        return scores


def _of_two(scores: Array) -> Array:
    """Posterior of two classes, by one exponential instead of two."""
    gap = scores[1] - scores[0]
    second = (gap > 0).astype(np.float64)
    ratio = np.exp(-np.abs(gap))  # of the smaller to the larger, which is 1 at first
    np.maximum(1 - second, ratio, out=scores[0])
    np.maximum(second, ratio, out=scores[1])
    scores /= 1 + ratio
    return scores
