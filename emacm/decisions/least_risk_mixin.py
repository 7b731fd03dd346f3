"""Decisions of least conditional risk from posterior probabilities."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.utils.validation import column_or_1d

from emacm.decisions.metrics import fraction_correct
from emacm.decisions.risks import decide, risks_of
from emacm.decisions.truths import truth_cost_table, truth_labels

Array = NDArray[np.float64]


class LeastRiskMixin:
    """Decisions of least conditional risk, Eq. (2.43), from `predict_log_proba`.

    For classifiers with the parameter `cost` and the fitted attribute `classes_`. The cost takes
    effect when a decision is made: a cost that is set after `fit` applies to the next `predict`.
    A classifier with an unknown state has a parameter `unknown`, its label, and a method
    `unknown_proba`.
    """

    cost: Any
    classes_: NDArray[Any]
    unknown: Any = None

    @property
    def truths_(self) -> NDArray[Any]:
        """The possible true states: `classes_`, and the unknown state if there is one."""
        return truth_labels(self.classes_, self.unknown)

    @property
    def decisions_(self) -> NDArray[Any]:
        """Possible results of `predict`, shape (n_decisions,), for the present `cost`."""
        return self._cost_table()[0]

    @property
    def cost_(self) -> Array:
        """Cost of each of `decisions_` under each of `truths_`, for the present `cost`."""
        return self._cost_table()[1]

    def predict_log_proba(self, X: Any) -> Array:
        """Return the logarithm of the posterior, shape (n_recordings, n_classes)."""
        raise NotImplementedError

    def unknown_proba(self, X: Any, typicality: Array | None = None) -> Array:
        """Return the probability of the unknown state, shape (n_recordings,)."""
        raise NotImplementedError

    def predict_proba(self, X):
        """Return the posterior probability of each class, Eq. (2.42).

        Parameters
        ----------
        X : list of Recording, or table
            As for `fit`.

        Returns
        -------
        posterior : ndarray of shape (n_recordings, n_classes)
            Columns in the order of `classes_`.
        """
        return np.exp(self.predict_log_proba(X))

    def risk(self, X):
        """Return the expected cost of each decision (conditional risk), Eq. (2.39).

        Parameters
        ----------
        X : list of Recording, or table
            As for `fit`.

        Returns
        -------
        risk : ndarray of shape (n_recordings, n_decisions)
            In the unit of the cost, columns in the order of `decisions_`.
        """
        return risks_of(self._truth_proba(X), self.cost_)

    def predict(self, X):
        """Return the decision of least conditional risk, Eq. (2.43).

        Scaling all costs, or adding a constant to all decisions of one true class, changes no
        decision. Of equal risks, the first of `decisions_` is returned.

        Parameters
        ----------
        X : list of Recording, or table
            As for `fit`.

        Returns
        -------
        decisions : ndarray of shape (n_recordings,)
            One of `decisions_` for each recording.

        Raises
        ------
        TypeError, ValueError
            If an input, or the present cost or priors, are invalid.
        """
        posterior = self._truth_proba(X)
        decisions, cost = self._cost_table()
        rows = decide(posterior, cost)
        decided = decisions.take(rows)
        if decided.dtype == self.classes_.dtype or self.unknown is None:
            return decided
        known = set(self.classes_.tolist())
        if all(label in known for label in decisions[np.unique(rows)].tolist()):
            return decided.astype(self.classes_.dtype)  # numbers, unless "unknown" is among them
        return decided

    def score(self, X, y, sample_weight=None):
        """Return the fraction of correct decisions.

        A decision is correct if it is the true class ("inspect" never is); for a true class
        that is not a decision, such as a state whose family is decided on, if it has the least
        cost (`emacm.decisions.metrics.correct_decisions`). scikit-learn's ``scoring="accuracy"``
        compares labels: it counts every decision that is not a class as wrong.

        Parameters
        ----------
        X : list of Recording, or table
            As for `fit`.
        y : array-like of shape (n_recordings,)
            True classes.
        sample_weight : array-like of shape (n_recordings,), default=None
            How often each recording counts.

        Returns
        -------
        float
            Accuracy, 0 to 1.

        Raises
        ------
        ValueError
            If an input is invalid, or the correct decision is unknown: some decisions are not
            classes, and `y` contains a label that is neither.
        """
        decided = self.predict(X)
        decisions, cost = self._cost_table()
        table = decisions, self.truths_, cost
        return fraction_correct(column_or_1d(y), decided, table, sample_weight)

    def _cost_table(self) -> tuple[NDArray[Any], Array]:
        return truth_cost_table(self.cost, self.classes_, self.unknown)

    def _truth_proba(self, X: Any) -> Array:
        """Return the posterior probability of each of `truths_`."""
        return self.truth_proba(X, self.predict_proba(X))

    def truth_proba(self, X: Any, posterior: Array, typicality: Array | None = None) -> Array:
        """Return the posterior probability of each of `truths_`, given that of `classes_`.

        Parameters
        ----------
        X : list of Recording, or table
            As for `fit`.
        posterior : ndarray of shape (n_recordings, n_classes)
            Result of `predict_proba`.
        typicality : ndarray of shape (n_recordings,), optional
            Result of `typicality`, if it is known.

        Returns
        -------
        ndarray of shape (n_recordings, n_truths)
        """
        if self.unknown is None:
            return posterior
        unknown = self.unknown_proba(X, typicality)[:, np.newaxis]
        return np.hstack([posterior * (1 - unknown), unknown])
