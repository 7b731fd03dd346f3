"""The decision of least conditional risk, for any classifier with posterior probabilities."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import logsumexp
from sklearn.base import ClassifierMixin, MetaEstimatorMixin, clone
from sklearn.utils import assert_all_finite, get_tags
from sklearn.utils.class_weight import compute_class_weight
from sklearn.utils.metaestimators import available_if
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, column_or_1d

from emacm._checks import positive_weights
from emacm._saved import SavedEstimator
from emacm.calibration.left_out import Array
from emacm.decisions.costs import check_classes, check_possible, cost_table, truth_priors
from emacm.decisions.pipelines import (
    RoutingMixin,
    before_the_last_step,
    check_unknown_states,
    final_estimator,
)
from emacm.decisions.risks import LeastRiskMixin


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


class LeastRiskClassifier(
    CombinedRiskMixin, RoutingMixin, MetaEstimatorMixin, ClassifierMixin, SavedEstimator
):
    """Decide by least conditional risk, given the posterior probabilities of any classifier.

    Parameters
    ----------
    estimator : estimator
        Classifier or pipeline with `predict_proba`. Its own costs have no effect; its unknown
        state, if it has one, is decided on.
    cost : None, array-like, DataFrame or mapping, default=None
        Cost of each decision under each true class; rows are decisions. None: 0-1. See
        `emacm.decisions.costs.cost_table`.
    priors : None, "uniform", array-like or mapping, default=None
        Probability of each class in service, as for `CostSensitiveGaussianBayes`. None: those
        within the posterior probabilities of the estimator.

    Attributes
    ----------
    classes_ : ndarray of shape (n_classes,)
        The possible true classes, sorted.
    truths_ : ndarray of shape (n_truths,)
        `classes_`, followed by the unknown state if the estimator has one.
    decisions_ : ndarray of shape (n_decisions,)
        Possible results of `predict`.
    cost_ : ndarray of shape (n_decisions, n_truths)
        Cost of each of `decisions_` under each of `truths_`.
    priors_ : ndarray of shape (n_classes,)
        Prior probabilities in effect, given that one of the classes is true.
    unknown_prior_ : float
        Prior probability of the unknown state: of `priors`, or else of the estimator.
    estimator_ : estimator
        The fitted classifier.
    n_features_in_ : int
        Number of features, if the estimator has it.
    feature_names_in_ : ndarray of shape (n_features,)
        Names of the features, if the estimator has them.

    See Also
    --------
    emacm.CostSensitiveGaussianBayes : Gaussian classes.

    Notes
    -----
    `cost` and `priors` take effect when a decision is made: ``set_params(cost=...)`` on a
    fitted classifier applies to the next `predict`, as if it had been fitted anew.

    Other priors are applied by Bayes' rule: the posterior is multiplied by ``priors / own`` and
    normalised, where `own` is the prior within the posterior: `priors_` or
    `class_prior_` of the estimator (the last step of a pipeline, the best estimator of a search),
    otherwise the frequencies of the classes in training, times its `class_weight`; `priors` are
    refused where only classifiers within it (of a VotingClassifier and the like) have one. A
    classifier that balances classes by other means does not reveal its prior; the result is then
    wrong by a constant factor for each class.

    Examples
    --------
    >>> from sklearn.linear_model import LogisticRegression
    >>> X, y = [[0.0], [1.0], [2.0], [1.5], [3.0], [4.0]], ["new"] * 3 + ["worn"] * 3
    >>> model = LeastRiskClassifier(LogisticRegression()).fit(X, y)
    >>> model.predict([[1.4]])
    array(['new'], dtype='<U4')
    >>> model.set_params(cost={("new", "worn"): 10}).predict([[1.4]])
    array(['worn'], dtype='<U4')
    """

    def __init__(self, estimator: Any, cost: Any = None, *, priors: Any = None):
        self.estimator = estimator
        self.cost = cost
        self.priors = priors

    def fit(self, X, y, **fit_params):
        """Fit a clone of the estimator.

        Parameters
        ----------
        X : list of Recording, or table
            Input of the estimator; it is passed on unchanged.
        y : array-like of shape (n_recordings,)
            True class of each recording.
        **fit_params : dict
            Further arguments of the estimator's `fit`, such as ``sample_weight``; with
            scikit-learn's metadata routing ``groups``, wherever they are needed.

        Returns
        -------
        self : LeastRiskClassifier
            The fitted classifier.

        Raises
        ------
        TypeError, ValueError
            If a parameter or an input is invalid, the estimator has no `predict_proba`, does not
            accept an argument, or was trained on other classes.
        """
        check_unknown_states(self.estimator)
        check_classes(y)
        assert_all_finite(y, input_name="y")
        check_classification_targets(y)
        y = column_or_1d(y, warn=True)
        classes, codes = np.unique(y, return_inverse=True)
        unknown = getattr(final_estimator(self.estimator), "unknown", None)
        cost_table(self.cost, classes, unknown)
        weights = [value for name, value in fit_params.items() if name.endswith("sample_weight")]
        weight = positive_weights(weights[-1] if weights else None, len(y))
        counts = np.bincount(codes, weight).astype(np.float64)
        truth_priors(self.priors, classes, counts, unknown)
        fitted = clone(self.estimator).fit(X, y, **self._routed(fit_params))
        if not hasattr(fitted, "predict_proba"):
            raise TypeError(
                f"{type(fitted).__name__} has no predict_proba, and so no posterior. "
                f"Put it into a CalibratedClassifierCV."
            )
        known = np.asarray(fitted.classes_)
        if not np.array_equal(known, classes):
            raise ValueError(
                f"the estimator was trained on the classes {known.tolist()}, but y contains "
                f"{classes.tolist()}. Fit it on all of them."
            )
        self.classes_, self.estimator_ = classes, fitted
        counts *= _class_weights(final_estimator(fitted), classes, y, counts)
        self._training_frequencies = counts / counts.sum()
        self._check_priors()
        return self

    @property
    def _frequencies(self):
        return self.estimator_priors_

    @property
    def _inside(self):
        return {"estimator": getattr(self, "estimator_", self.estimator)}

    @property
    def estimator_priors_(self) -> Array:
        """The prior within the posterior probabilities of the estimator, shape (n_classes,)."""
        final = final_estimator(self.estimator_)
        for attribute in ("priors_", "class_prior_"):
            if hasattr(final, attribute):
                return np.asarray(getattr(final, attribute), dtype=np.float64)
        return self._training_frequencies

    def predict_log_proba(self, X):
        """Return the logarithm of the posterior under `priors_`.

        Parameters
        ----------
        X : list of Recording, or table
            Input of the estimator.

        Returns
        -------
        log_posterior : ndarray of shape (n_recordings, n_classes)
            -inf where the prior is 0.

        Raises
        ------
        ValueError
            If the posterior of a recording is NaN.
        """
        check_is_fitted(self)
        with np.errstate(divide="ignore"):
            if hasattr(self.estimator_, "predict_log_proba"):
                logs = np.asarray(self.estimator_.predict_log_proba(X), dtype=np.float64)
            else:
                logs = np.log(np.asarray(self.estimator_.predict_proba(X), dtype=np.float64))
        undefined = np.isnan(logs).any(axis=1)
        if undefined.any():
            raise ValueError(
                f"the posterior of recording {undefined.argmax()} is NaN. Check its features."
            )
        if self.priors is None:
            return logs
        self._check_priors()
        return pooled_log_posterior([logs], [self.estimator_priors_], self.priors_)

    def _check_priors(self) -> None:
        if self.priors is not None and hasattr(final_estimator(self.estimator_), "models_of"):
            raise ValueError(
                "priors of a ConditionRouter belong inside: how frequent the classes were in "
                "training differs from condition to condition. Give them to its estimator."
            )
        final = final_estimator(self.estimator_)
        kind = type(final).__name__  # those that are fitted to frequencies remove weights again
        is_fitted = kind in ("CalibratedClassifierCV", "StackingClassifier")
        inner = {} if self.priors is None or is_fitted else final.get_params()
        for name in (x for x in inner if x.endswith("__class_weight") and inner[x]):
            raise ValueError(
                f"the prior within the posterior of {kind} is not known, because of {name}="
                f"{inner[name]!r}. Leave class_weight out: priors and cost do what it is for."
            )
        check_possible(self.priors_, self.estimator_priors_, self.classes_)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags = get_tags(self.estimator).input_tags
        return tags


def _class_weights(classifier: Any, classes: Any, y: Any, counts: Array) -> Array:
    """Return the factor by which a fitted classifier multiplies the frequency of each class."""
    weights = getattr(classifier, "class_weight", None)
    if type(classifier).__name__ in ("SVC", "NuSVC"):  # probabilities are fitted without weights
        weights = None
    if isinstance(weights, str):  # "balanced": the weights of all classes have the same sum
        return 1 / counts
    return compute_class_weight(weights, classes=classes, y=y)


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
    possible, tiny = shared > 0, np.log(np.finfo(np.float64).tiny)
    pooled = np.full((len(np.asarray(log_posteriors[0])), len(shared)), -np.inf)
    pooled[:, possible] = np.log(shared[possible])
    for logs, prior in zip(log_posteriors, own, strict=True):
        # log p(k|x_1..x_m) = log P(k) + sum_j [log p_j(k|x_j) - log P_j(k)] + constant
        likelihood = np.asarray(logs, dtype=np.float64)[:, possible]
        # The logarithm of 0 becomes that of the smallest number that it may stand for.
        least = np.where(np.isneginf(likelihood), tiny, likelihood).min(axis=1, keepdims=True)
        likelihood = np.maximum(likelihood, np.maximum(least, -1e300))  # sums do not overflow
        likelihood -= np.log(prior[possible])
        pooled[:, possible] += likelihood - likelihood.max(axis=1, keepdims=True)
    return pooled - logsumexp(pooled, axis=1, keepdims=True)
