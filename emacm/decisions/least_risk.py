"""The decision of least conditional risk, for any classifier with posterior probabilities."""

from __future__ import annotations

from typing import Any

import numpy as np
from sklearn.base import ClassifierMixin, MetaEstimatorMixin, clone
from sklearn.svm import SVC, NuSVC
from sklearn.utils import assert_all_finite, check_consistent_length, get_tags
from sklearn.utils.class_weight import compute_class_weight
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, column_or_1d

from emacm._checks import positive_weights
from emacm._saved import SavedEstimator
from emacm.decisions.costs import cost_table
from emacm.decisions.pipelines import RoutingMixin, check_unknown_states, final_estimator
from emacm.decisions.risks import Array, CombinedRiskMixin, pooled_log_posterior
from emacm.decisions.truths import check_classes, check_possible, truth_priors


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
        if isinstance(self.estimator, type) or not hasattr(self.estimator, "fit"):
            raise TypeError(f"estimator must be a classifier, got {self.estimator!r}.")
        check_unknown_states(self.estimator)
        if y is None:
            raise ValueError("fit requires y to be passed, but the target y is None.")
        check_classes(y)
        assert_all_finite(y, input_name="y")
        check_classification_targets(y)
        y = column_or_1d(y, warn=True)
        check_consistent_length(X, y)
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
    if isinstance(classifier, SVC | NuSVC):  # its probabilities are fitted without weights
        weights = None
    if isinstance(weights, str):  # "balanced": the weights of all classes have the same sum
        return 1 / counts
    return compute_class_weight(weights, classes=classes, y=y)
