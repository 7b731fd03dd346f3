"""The decision of least conditional risk, for any classifier with posterior probabilities."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_softmax
from sklearn.base import ClassifierMixin, MetaEstimatorMixin, clone
from sklearn.utils import assert_all_finite, check_consistent_length, get_tags
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, column_or_1d

from emacm._checks import positive_weights
from emacm._saved import SavedEstimator
from emacm.decisions.costs import cost_table
from emacm.decisions.left_out_calibration import (
    DetectorTypicality,
    LeftOutCalibration,
    LeftOutMixin,
    Training,
    check_temperature,
    check_unknown_rate,
    fit_detector,
    warn_without_groups,
)
from emacm.decisions.pipelines import (
    as_rows,
    final_estimator,
    groups_options,
    log_likelihoods,
    parameters_of_rows,
    uses_groups,
    weight_parameter,
)
from emacm.decisions.risks import LeastRiskMixin, pooled_log_posterior
from emacm.decisions.truths import check_classes, check_possible, truth_priors
from emacm.recordings.meta import chosen_rows

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class LeastRiskClassifier(
    LeftOutMixin, LeastRiskMixin, MetaEstimatorMixin, ClassifierMixin, SavedEstimator
):
    """Decide by least conditional risk, given the posterior probabilities of any classifier.

    Parameters
    ----------
    estimator : estimator
        Classifier or pipeline with `predict_proba`. Its own costs have no effect.
    cost : None, array-like, DataFrame or mapping, default=None
        Cost of each decision under each true class; rows are decisions. None: 0-1. See
        `emacm.decisions.costs.cost_table`.
    priors : None, "uniform", array-like or mapping, default=None
        Probability of each class in service, as for `CostSensitiveGaussianBayes`. None: those
        within the posterior probabilities of the estimator.
    unknown : label, default=None
        Label of one more true state, without recordings, as for `CostSensitiveGaussianBayes`. Its
        probability follows from `detector`.
    temperature : None, float or "groups", default=None
        Likelihoods, posterior over prior, are raised to the power of 1 / temperature. "groups":
        the value of least log loss for groups that are left out. None: 1.
    detector : estimator, default=None
        Outlier detector or pipeline with `score_samples`, such as `IsolationForest`: the larger the
        score, the more like the training. It is fitted to X without classes.
    unknown_rate : None or float, default=None
        Largest share of known recordings whose decision may change because of the unknown state,
        as for `CostSensitiveGaussianBayes`.

    Attributes
    ----------
    classes_ : ndarray of shape (n_classes,)
        The possible true classes, sorted.
    truths_ : ndarray of shape (n_truths,)
        `classes_`, followed by `unknown` if it is given.
    decisions_ : ndarray of shape (n_decisions,)
        Possible results of `predict`; of equal risks the first is returned.
    cost_ : ndarray of shape (n_decisions, n_truths)
        Cost of each of `decisions_` under each of `truths_`.
    priors_ : ndarray of shape (n_classes,)
        Prior probabilities in effect, given that the true state is one of the classes.
    unknown_prior_ : float
        Prior probability of the unknown state.
    temperature_ : float
        Temperature in effect.
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
    otherwise the frequencies of the classes in training. A classifier that balances classes by
    other means (``class_weight="balanced"``) does not reveal its prior; the result is then wrong
    by a constant factor for each class.

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

    def __init__(
        self,
        estimator: Any,
        cost: Any = None,
        *,
        priors: Any = None,
        unknown: Any = None,
        temperature: Any = None,
        detector: Any = None,
        unknown_rate: Any = None,
    ):
        self.estimator = estimator
        self.cost = cost
        self.priors = priors
        self.unknown = unknown
        self.temperature = temperature
        self.detector = detector
        self.unknown_rate = unknown_rate

    def fit(self, X, y, sample_weight=None, groups=None, **fit_params):
        """Fit a clone of the estimator.

        Parameters
        ----------
        X : list of Recording, or table
            Input of the estimator; it is passed on unchanged.
        y : array-like of shape (n_recordings,)
            True class of each recording.
        sample_weight : array-like of shape (n_recordings,), default=None
            How often each recording counts; in a pipeline, passed to the last step.
        groups : array-like of shape (n_recordings,), default=None
            Labels of recordings that were measured together (unit, run): the estimator and the
            detector are fitted again without groups, at most ten times. None: ten parts. Passed to
            the estimator if it learns from groups, or if there is neither a detector nor
            ``temperature="groups"``.
        **fit_params : dict
            Further arguments of the estimator's `fit`.

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
        if y is None:
            raise ValueError("fit requires y to be passed, but the target y is None.")
        check_classes(y)
        assert_all_finite(y, input_name="y")
        check_classification_targets(y)
        y = column_or_1d(y, warn=True)
        check_consistent_length(X, y)
        classes, codes = np.unique(y, return_inverse=True)
        cost_table(self.cost, classes, self.unknown)
        self._check_calibration_parameters()
        calibrated = isinstance(self.temperature, str) or self.detector is not None
        if groups is not None and (self.needs_groups or not calibrated):
            named = groups_options(self.estimator, groups) or {"groups": groups}
            fit_params = named | fit_params
        if sample_weight is not None:
            fit_params = {**fit_params, weight_parameter(self.estimator): sample_weight}
        weights = [value for name, value in fit_params.items() if name.endswith("sample_weight")]
        weight = positive_weights(weights[-1] if weights else None, len(y))
        counts = np.bincount(codes, weight).astype(np.float64)
        truth_priors(self.priors, classes, counts, self.unknown)
        fitted = clone(self.estimator).fit(X, y, **fit_params)
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
        self._training_frequencies = counts / counts.sum()
        self._calibration = LeftOutCalibration()
        check_possible(self.priors_, self.estimator_priors_, classes)
        if calibrated:
            warn_without_groups(groups, stacklevel=2)
            self._leave_out(as_rows(X), codes, groups, weight, fit_params)
        return self

    def _fit_typicality(self, training: Training) -> DetectorTypicality | None:
        return None if self.detector is None else fit_detector(self.detector, training)

    def _judge(self, training: Training, others: Indices, rows: Indices) -> Array:
        """Return logarithms of posterior over prior of some recordings, by a fit to others."""
        X, codes = training[:2]
        logs, seen = np.full((len(rows), len(self.classes_)), -np.inf), np.unique(codes[others])
        if len(seen) >= min(2, len(self.classes_)):
            options = parameters_of_rows(training.options, others, len(codes))
            other = LeastRiskClassifier(self.estimator)
            other.fit(chosen_rows(X, others), self.classes_[codes[others]], **options)
            found = other.estimator_log_posterior(chosen_rows(X, rows))
            logs[:, seen] = log_likelihoods(found, other.estimator_priors_)
        return logs

    @property
    def needs_groups(self) -> bool:
        """Whether the estimator learns from groups."""
        return uses_groups(self.estimator)

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
        """
        check_is_fitted(self)
        logs = self.estimator_log_posterior(X)
        if self.priors is None and self.temperature is None:
            return logs
        check_possible(self.priors_, self.estimator_priors_, self.classes_)
        if self.temperature is None:
            return pooled_log_posterior([logs], [self.estimator_priors_], self.priors_)
        with np.errstate(divide="ignore"):
            joint = log_likelihoods(logs, self.estimator_priors_) / self.temperature_
            return log_softmax(joint + np.log(self.priors_), axis=1)

    def estimator_log_posterior(self, X: Any) -> Array:
        """Return the logarithm of the estimator's own posterior.

        Parameters
        ----------
        X : list of Recording, or table
            Input of the estimator.

        Returns
        -------
        log_posterior : ndarray of shape (n_recordings, n_classes)

        Raises
        ------
        ValueError
            If the posterior of a recording is NaN.
        """
        with np.errstate(divide="ignore"):
            if hasattr(self.estimator_, "predict_log_proba"):
                logs = np.asarray(self.estimator_.predict_log_proba(X), dtype=np.float64)
            else:
                logs = np.log(np.asarray(self.estimator_.predict_proba(X), dtype=np.float64))
        undefined = np.isnan(logs).any(axis=1)
        if undefined.any():
            raise ValueError(
                f"the posterior of recording {int(np.argmax(undefined))} is NaN. Check the "
                f"features of that recording."
            )
        return logs

    @property
    def n_features_in_(self):
        """Number of features, as the estimator counts them."""
        return self.estimator_.n_features_in_

    @property
    def feature_names_in_(self):
        """Names of the features, as the estimator knows them."""
        return self.estimator_.feature_names_in_

    def __sklearn_tags__(self):
        tags, inner = super().__sklearn_tags__(), get_tags(self.estimator)
        tags.input_tags = inner.input_tags
        tags.classifier_tags.multi_class = inner.classifier_tags is None or (
            inner.classifier_tags.multi_class
        )
        return tags

    def _checked_features(self, X: Any) -> Any:
        return X

    def _truth_priors(self) -> tuple[Array, float]:
        own = self.estimator_priors_
        if self.priors is None:
            uniform = truth_priors("uniform", self.classes_, own, self.unknown)
            return own, uniform[1]
        return truth_priors(self.priors, self.classes_, self._training_frequencies, self.unknown)

    def _check_calibration_parameters(self) -> None:
        check_temperature(self.temperature)
        check_unknown_rate(self.unknown_rate, self.unknown)
        if self.detector is not None and not hasattr(self.detector, "score_samples"):
            raise TypeError(
                f"detector must be an outlier detector with score_samples, such as "
                f"sklearn.ensemble.IsolationForest(), got {self.detector!r}."
            )
        if self.unknown is not None and self.detector is None:
            raise ValueError(
                f"unknown = {self.unknown!r} needs detector=, an outlier detector with "
                f"score_samples, such as sklearn.ensemble.IsolationForest()."
            )
