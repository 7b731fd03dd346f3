"""The conditional risk of each decision, and the decision of least risk.

Rows of a cost matrix are decisions, columns are true classes, as in `emacm.decisions.costs`.

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import logsumexp
from sklearn.utils.metaestimators import available_if

from emacm.decisions.costs import cost_table
from emacm.decisions.metrics import fraction_correct
from emacm.decisions.pipelines import before_the_last_step, final_estimator
from emacm.decisions.truths import label_array, truth_labels, truth_priors
from emacm.decisions.typicality import prior_for_rate, unknown_probability

Array = NDArray[np.float64]


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
        (`emacm.decisions.typicality.prior_for_rate`); or else 0.01.
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


class CombinedRiskMixin(LeastRiskMixin):
    """Decisions from the posteriors of fitted classifiers, with the unknown state that they have.

    A recording is as typical as for the classifier that knows least of it, so that one whose
    channel is dead does not decide. All classifiers must have the same unknown state, or none.
    """

    _inside: Any  # classifiers or pipelines by name; before `fit`, those that were given

    @property
    def unknown(self):
        """Label of the unknown state of the classifiers inside; None if they have none."""
        for final in map(final_estimator, self._inside.values()):
            has_prior = getattr(type(final), "unknown_prior_", None) is not None
            if getattr(final, "unknown", None) is not None and not has_prior:
                kind = f"{type(self).__name__} inside {type(final).__name__}"
                raise ValueError(f"the unknown state would be lost. Put {kind}, not around it.")
        return self._agreed("unknown")

    @property
    def unknown_rate(self):
        """Rate of the unknown state of the classifiers inside; None if they have none."""
        return self._agreed("unknown_rate")

    @property
    def unknown_limit_(self):
        """Typicality up to which a recording is most probably unknown; None without a rate.

        The least of the classifiers inside: it depends on how many groups each of them left out.
        """
        if self.unknown_rate is None:
            return None
        return min(final_estimator(inner).unknown_limit_ for inner in self._inside.values())

    @property
    def _unknown_default(self) -> float:
        finals = map(final_estimator, self._inside.values())
        return max((getattr(final, "unknown_prior_", None) or 0.0 for final in finals), default=0.0)

    def _agreed(self, name: str) -> Any:
        """Return a property of the classifiers inside, which must be the same for all."""
        inside = self._inside.items()
        found = {key: getattr(final_estimator(inner), name, None) for key, inner in inside}
        first = next(iter(found.values()), None)
        if any(value != first for value in found.values()):
            raise ValueError(
                f"members have different {name}: {found}. Give all the same unknown= and "
                f"unknown_rate=, or none: a member that knows of no unknown state would decide on "
                f"recordings of a dead channel."
            )
        return first

    def least_typical(self, X: Any) -> Any:
        """Return the classifier or pipeline inside that knows least of one recording."""
        found = [final.typicality(table)[0] for final, table in self._opened(X)]
        return [*self._inside.values()][int(np.argmin(found))]

    def _opened(self, X: Any) -> list[tuple[Any, Any]]:
        """Return each classifier inside, without the steps before it, and its input."""
        return [before_the_last_step(inner, X) for inner in self._inside.values()]

    @available_if(lambda self: self._has("typicality"))
    def typicality(self, X):
        """Return the fraction of known recordings that are at least as unlike the training.

        The least typicality p of m classifiers is at most p by chance m times as often:
        ``1 - (1 - p)^m`` is uniform for known recordings if the classifiers are independent within
        each class (Tippett's method [1]_), and too large rather than too small if they agree.

        Parameters
        ----------
        X : list of Recording, or table
            As for `fit`.

        Returns
        -------
        typicality : ndarray of shape (n_recordings,)
            In (0, 1].

        References
        ----------
        .. [1] Tippett, The Methods of Statistics (1931); Loughin, A systematic comparison of
           methods for combining p-values, Computational Statistics & Data Analysis 47 (2004).
        """
        found = [final.typicality(table) for final, table in self._opened(X)]
        if len(found) == 1:
            return found[0]
        with np.errstate(divide="ignore"):  # log(0) of the most typical recording
            return -np.expm1(len(found) * np.log1p(-np.min(found, axis=0)))

    @available_if(lambda self: self._has("second_states"))
    def second_states(self, X, decisions):
        """Return the class whose lines each recording has beyond those of the decided one.

        As `CostSensitiveGaussianBayes.second_states`, by the first classifier that finds one.

        Parameters
        ----------
        X : list of Recording, or table
            As for `fit`.
        decisions : sequence of n_recordings labels
            Decisions of `predict`.

        Returns
        -------
        list of label or None
        """
        found = [final.second_states(table, decisions) for final, table in self._opened(X)]
        return [
            next((state for state in states if state is not None), None)
            for states in zip(*found, strict=True)
        ]

    def _has(self, name: str) -> bool:
        return all(hasattr(final_estimator(inner), name) for inner in self._inside.values())

    @property
    def n_features_in_(self):
        """Number of features, as the (first) classifier inside counts them."""
        return next(iter(self._inside.values())).n_features_in_

    @property
    def feature_names_in_(self):
        """Names of the features, as the (first) classifier inside knows them."""
        return next(iter(self._inside.values())).feature_names_in_


def pooled_log_posterior(
    log_posteriors: Sequence[ArrayLike], member_priors: ArrayLike, priors: ArrayLike
) -> Array:
    """Multiply the likelihoods of all members and the prior.

    The posterior of a member divided by the prior of this member is, up to a constant, the
    likelihood. The product rule [1]_ is exact if the members are independent within each class.

    Parameters
    ----------
    log_posteriors : sequence of n_members array-likes of shape (n_recordings, n_classes)
        Logarithm of the posterior of each member.
    member_priors : array-like of shape (n_members, n_classes)
        The prior within the posterior of each member; positive where `priors` are.
    priors : array-like of shape (n_classes,)
        The prior of the result. A class of prior 0 stays impossible.

    Returns
    -------
    log_posterior : ndarray of shape (n_recordings, n_classes)
        Normalised. Never NaN: a posterior of exactly 0 (of a class with a prior) counts
        as the smallest positive number, or as the least of its row if that is smaller;
        members that contradict each other with certainty cancel.

    References
    ----------
    .. [1] Kittler, Hatef, Duin and Matas, On combining classifiers, IEEE Transactions on Pattern
       Analysis and Machine Intelligence 20 (3), 1998.

    Examples
    --------
    Two channels, each 4:1 for the second class, whose prior is 0.5:

    >>> one = np.log([[0.2, 0.8]])
    >>> half = [0.5, 0.5]
    >>> np.exp(pooled_log_posterior([one, one], [half, half], half)).round(3)
    array([[0.059, 0.941]])
    """
    shared, own = np.asarray(priors, dtype=np.float64), np.asarray(member_priors, dtype=np.float64)
    possible = shared > 0
    pooled = np.full((len(np.asarray(log_posteriors[0])), len(shared)), -np.inf)
    pooled[:, possible] = np.log(shared[possible])
    for logs, prior in zip(log_posteriors, own, strict=True):
        # log p(k|x_1..x_m) = log P(k) + sum_j [log p_j(k|x_j) - log P_j(k)] + constant
        likelihood = _finite(np.asarray(logs, dtype=np.float64)[:, possible])
        likelihood = likelihood - np.log(prior[possible])
        pooled[:, possible] += likelihood - likelihood.max(axis=1, keepdims=True)
    return pooled - logsumexp(pooled, axis=1, keepdims=True)


def _finite(logs: Array) -> Array:
    """Replace the logarithm of 0 by that of the smallest number that it may stand for."""
    zero = np.isneginf(logs)
    tiny = np.log(np.finfo(np.float64).tiny)
    least = np.where(zero, tiny, logs).min(axis=1, keepdims=True)
    return np.maximum(np.where(zero, least, logs), -1e300)  # sums do not overflow


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
