"""The conditional risk of each decision, the decision of least risk, and what left-out groups tell.

Rows of a cost matrix are decisions, columns are true classes, as in `emacm.decisions.costs`.

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.special import softmax
from sklearn.exceptions import NotFittedError
from sklearn.utils.metaestimators import available_if
from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_choice, check_number, group_codes
from emacm._statements import warn
from emacm.calibration.left_out import (
    Array,
    Indices,
    check_judged,
    fit_temperature,
    left_out,
    single_recordings,
)
from emacm.decisions.costs import (
    cost_table,
    label_array,
    prior_for_rate,
    truth_labels,
    truth_priors,
    unknown_probability,
)
from emacm.decisions.metrics import fraction_correct
from emacm.decisions.typicality import Typicality, fit_typicality


def has_unknown(classifier: Any) -> bool:
    """Return True if there is an unknown state; otherwise an AttributeError states the remedy."""
    if classifier.unknown is None:
        raise AttributeError(
            'unknown_proba needs the label of an unknown state, such as unknown="unknown".'
        )
    return True


class LeastRiskMixin:
    """Decisions of least conditional risk, Eq. (2.43), from `predict_log_proba`.

    For classifiers with the parameter `cost` and the fitted attribute `classes_`. The cost takes
    effect when a decision is made: a cost that is set after `fit` applies to the next `predict`.
    No probability depends on costs. A classifier with an unknown state has a label `unknown` and a
    method `typicality`, from which the probability of this state follows.
    """

    cost: Any
    priors: Any
    classes_: NDArray[Any]
    unknown: Any = None
    unknown_limit_: Any = None
    typicality: Any
    predict_log_proba: Any
    _frequencies: Any  # how often each class is expected where `priors` are None

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

    @property
    def priors_(self) -> Array:
        """Prior probabilities in effect, shape (n_classes,), for the present `priors`.

        With an unknown state, those given that the true state is one of the classes.
        """
        return self._truth_priors()[0]

    @property
    def unknown_prior_(self) -> float:
        """Prior probability in effect of the unknown state; 0 if there is none.

        That of `priors`; or else the one that follows from `unknown_limit_`, without costs
        (`emacm.decisions.costs.prior_for_rate`); or else 0.01.
        """
        return self._truth_priors()[1]

    @available_if(has_unknown)
    def unknown_proba(self, X, typicality=None):
        """Return the probability that the true state is unknown.

        Parameters
        ----------
        X : list of Recording, or table
            As for `fit`.
        typicality : ndarray of shape (n_recordings,), default=None
            Result of `typicality`, if it is known; `X` is then not used.

        Returns
        -------
        probability : ndarray of shape (n_recordings,)
            From the typicality and `unknown_prior_`, by Bayes' rule.
        """
        if typicality is None:
            typicality = self.typicality(X)
        return unknown_probability(typicality, self.unknown_prior_, self.unknown_limit_)

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
        return risks_of(self.truth_proba(X, self.predict_proba(X)), self.cost_)

    def predict(self, X):
        """Return the decision of least conditional risk, Eq. (2.43).

        Scaling all costs, or adding a constant to all decisions of one true class, changes no
        decision. Of equal risks, the first of `decisions_` is returned; the unknown state, which
        costs what an inspection costs, if and only if it is the most probable one.

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
        return self.decided(self.truth_proba(X, self.predict_proba(X)))

    def decided(self, truths):
        """Return the decisions of `predict` for given probabilities.

        Parameters
        ----------
        truths : ndarray of shape (n_recordings, n_truths)
            Result of `truth_proba`.

        Returns
        -------
        decisions : ndarray of shape (n_recordings,)
        """
        decisions, cost = self._cost_table()
        if self.unknown is None:
            return decisions.take(decide(truths, cost))
        labels = decisions.tolist()
        rows = decide(truths, cost, labels.index(self.unknown))
        return label_array([labels[row] for row in rows], self.classes_)

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
        return fraction_correct(y, decided, (decisions, self.truths_, cost), sample_weight)

    def _cost_table(self) -> tuple[NDArray[Any], Array]:
        return cost_table(self.cost, self.classes_, self.unknown)

    @property
    def _unknown_default(self) -> float:
        """Prior of the unknown state where `priors` do not state it."""
        return 0.01 if self.unknown_limit_ is None else prior_for_rate(self.unknown_limit_)

    def _truth_priors(self) -> tuple[Array, float]:
        parts = self.priors, self.classes_, self._frequencies, self.unknown
        return truth_priors(*parts, self._unknown_default)

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


def check_temperature(temperature: Any) -> None:
    """Raise if a temperature is neither None, "groups" nor a positive number."""
    if isinstance(temperature, str):
        check_choice(temperature, "temperature as a word", ("groups",))
    elif temperature is not None:
        check_number(temperature, 'temperature, if not None or "groups",', above=0)


class LeftOut(NamedTuple):
    """Training recordings, judged by classifiers that were fitted without their groups.

    Only those of classes of which others remained.

    Attributes
    ----------
    typicality : ndarray of shape (n_recordings,)
        Of each recording.
    log_densities : ndarray of shape (n_recordings, n_classes)
        -inf for classes of which no other recordings remain.
    codes, units : ndarray of int, shape (n_recordings,)
        Number of the true class, and of the group.
    """

    typicality: Array
    log_densities: Array
    codes: Indices
    units: Indices


class LeftOutMixin(LeastRiskMixin):
    """Typicality, unknown state and temperature, found by leaving out each group in turn.

    The results are None before anything was left out, and what is not needed.
    """

    class_count_: Array
    unknown_rate: Any
    temperature: Any
    _typicality: Typicality | None = None
    _temperature: float | None = None
    _left_out: LeftOut | None = None
    _checked_features: Any
    # (X, codes, units, weight, X_left): log densities of left-out recordings under classes fitted
    # to the others, shape (n_left, n_classes); -inf for classes of which too few others remain.
    _densities_without: Any

    @property
    def temperature_(self) -> float:
        """Temperature of the densities in effect."""
        check_temperature(self.temperature)  # it may have been set after `fit`
        if isinstance(self.temperature, str):
            return self._calibrated("temperature")
        return 1.0 if self.temperature is None else float(self.temperature)

    @property
    def unknown_limit_(self):
        """Typicality up to which the unknown state is the most probable one; None without a rate.

        Below `unknown_rate` by one standard error of the mean over the groups that were left out:
        the shares of untypical recordings in single groups scatter about as much as their mean
        (0.8 times, at 5 % on the runs 1 to 4 of the Cranfield actuator).
        """
        if self.unknown_rate is None:
            return None
        n_groups = len(np.unique(self._calibrated("left_out").units)) or 1
        return self.unknown_rate / (1 + n_groups**-0.5)

    @property
    def distances_(self) -> Any:
        """The `ClassDistances` that `typicality` is based on."""
        return self._calibrated("typicality").distances

    @property
    def feature_range_(self) -> Array:
        """Smallest and largest training value of each feature, shape (2, n_features)."""
        return self._calibrated("typicality").feature_range

    def _leave_out(self, X: Array, codes: Indices, groups: Any, weight: Array) -> None:
        """Set what is found by leaving each group out; without groups, single recordings."""
        rows = np.flatnonzero(weight > 0)
        if groups is None:
            warn(
                "groups",
                f"fit was called without groups, so single recordings are left out. Those that "
                f"were measured together (one unit, one run) make the model over-confident: give "
                f"their labels, in a pipeline as {type(self).__name__.lower()}__groups=units.",
                stacklevel=3,
            )
            units = single_recordings(codes[rows], X[rows])
        else:
            units = group_codes(groups, len(codes))[rows]
        X, codes, weight = X[rows], codes[rows], weight[rows]
        self._typicality = fit_typicality(X, codes, units, weight)
        logs = np.full((len(rows), len(self.classes_)), -np.inf)
        for others, left in left_out(codes, units):
            logs[left] = self._densities_without(
                X[others], codes[others], units[others], weight[others], X[left]
            )
        judged = np.isfinite(logs[np.arange(len(codes)), codes])
        columns = self._typicality.left_out, logs, codes, units
        self._left_out = LeftOut(*(column[judged] for column in columns))
        if isinstance(self.temperature, str):
            check_judged(judged)
            some = logs[judged], codes[judged], weight[judged]
            self._temperature = fit_temperature(*some, self.class_count_ / self.class_count_.sum())

    def typicality(self, X):
        """Return the fraction of left-out training recordings that are at least as far away.

        Every training recording is judged by a model without its group. Distances to the nearest
        class are measured inside and outside the discriminant space (where large deviations of few
        features count less) and for the largest deviation of a single feature, with one covariance
        for all classes; beyond the farthest left-out recordings their distribution has a modelled
        tail, which is wider the fewer they are.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features.

        Returns
        -------
        typicality : ndarray of shape (n_recordings,)
            In (0, 1]. 0.01 or less: at most one in a hundred known recordings is so far away.

        Raises
        ------
        ValueError
            If an input is invalid, or `fit` had neither `groups` nor an unknown state.
        """
        return self._calibrated("typicality")(self._checked_features(X))

    def second_states(self, X, decisions):
        """Return the class whose lines each recording has beyond those of the decided one.

        Two damaged parts raise the features of both; a classifier of single faults decides one of
        them. The deviation from the decided class is projected on what each other class raises;
        about 2 % of left-out training recordings deviate as far.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features.
        decisions : sequence of n_recordings labels
            Decisions of `predict`; in place of one that is no class, the most probable class.

        Returns
        -------
        list of label or None
            None if there is no such class, the decision is the unknown state, or `fit` had neither
            `groups` nor an unknown state.
        """
        check_is_fitted(self)
        if self._typicality is None:
            return [None] * len(decisions)
        classes = self.classes_.tolist()
        probable = zip(decisions, self.predict_proba(X).argmax(axis=1), strict=True)
        codes = [classes.index(label) if label in classes else k for label, k in probable]
        others = self._typicality.second_classes(self._checked_features(X), np.array(codes))
        return [
            None if code < 0 or decision == self.unknown else classes[code]
            for code, decision in zip(others, decisions, strict=True)
        ]

    def left_out_decisions(self):
        """Return the present decision on each training recording, judged without its group.

        Returns
        -------
        DataFrame
            "truth", "decision", "typicality" and "group" (a number) of the recordings of classes
            that other groups have as well.

        Raises
        ------
        ValueError
            If `fit` had neither `groups` nor an unknown state.
        """
        left = self._calibrated("left_out")
        log_priors = np.log(np.maximum(self.priors_, np.finfo(np.float64).tiny))
        joint = left.log_densities / self.temperature_ + log_priors
        truths = self.truth_proba(None, softmax(joint, axis=1), left.typicality)
        return pd.DataFrame(
            {
                "truth": self.classes_[left.codes],
                "decision": self.decided(truths),
                "typicality": left.typicality,
                "group": left.units,
            }
        )

    @property
    def _frequencies(self):
        return self.class_count_

    def _calibrated(self, name: str) -> Any:
        """Return what was found by leaving groups out."""
        check_is_fitted(self)
        found = getattr(self, f"_{name}")
        if found is None:
            raise NotFittedError(  # a ValueError, and an AttributeError where it is a property
                f"{name} is found by leaving groups out, which the last fit did not do. "
                f"Call fit with groups=, the labels of recordings that were measured together."
            )
        return found


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


def decide(probability: Array, cost: Array, unknown: int | None = None) -> NDArray[np.intp]:
    """Return the row of the decision of least conditional risk, Eq. (2.43) of the module's [1]_.

    Scaling all costs, or adding a constant to all decisions of one true class, changes no
    decision. Of equal risks (but for rounding) the first decision is returned; the unknown state
    if and only if it is the most probable one, so that "inspect" of the same cost is decided where
    a recording is only uncertain.

    Parameters
    ----------
    probability : ndarray of shape (n_recordings, n_classes)
        Probability of each class for each recording.
    cost : ndarray of shape (n_decisions, n_classes)
        Rows are decisions, columns are true classes.
    unknown : int, default=None
        Row of the unknown state, whose column is the last. None: there is none.

    Returns
    -------
    rows : ndarray of shape (n_recordings,)
        Row of `cost` of each decision.

    Examples
    --------
    >>> decide(np.array([[0.7, 0.3]]), np.array([[0.0, 1.0], [10.0, 0.0]]))
    array([0])
    >>> decide(np.array([[0.7, 0.3]]), np.array([[0.0, 10.0], [1.0, 0.0]]))
    array([1])
    """
    risk = risks_of(probability, canonical_cost(cost))
    # Canonical costs are not negative: no risk is a small difference of large terms.
    least = risk.min(axis=1, keepdims=True)
    tied = risk <= least * (1 + 1e-12)  # others are equal but for rounding
    if unknown is not None:
        is_unknown = probability.argmax(axis=1) == probability.shape[1] - 1
        tied[is_unknown & tied[:, unknown]] &= np.arange(len(cost)) == unknown
        tied[~is_unknown & (tied.sum(axis=1) > 1), unknown] = False
    return tied.argmax(axis=1)


def risks_of(probability: Array, cost: Array) -> Array:
    """Return the expected cost of each decision, Eq. (2.39): shape (n_recordings, n_decisions).

    Examples
    --------
    >>> risks_of(np.array([[0.7, 0.3]]), np.array([[0.0, 1.0], [10.0, 0.0]]))
    array([[0.3, 7. ]])
    """
    # A matrix product may add the terms of one column in another order than those of the next.
    # Multiplied by distinct rows only, equal decisions have equal risks to the last bit.
    distinct, places = np.unique(cost, axis=0, return_inverse=True)
    return (distinct @ probability.T).T[:, places.ravel()]
