"""Bayes classifier with Gaussian classes and labelled costs of decisions."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import log_softmax
from sklearn.base import ClassifierMixin
from sklearn.utils.metaestimators import available_if
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, column_or_1d, validate_data

from emacm._checks import check_choice, check_number, check_table, positive_weights
from emacm._saved import SavedEstimator
from emacm._statements import warn
from emacm.calibration.left_out import Array, Indices
from emacm.decisions.costs import check_classes, cost_table, label_positions, truth_priors
from emacm.decisions.gaussians import (
    ClassMoments,
    GaussianClasses,
    class_gaussians,
    class_moments,
)
from emacm.decisions.risks import LeftOutMixin, check_temperature


def can_add_recordings(classifier: Any) -> bool:
    """Return True if `partial_fit` is available; otherwise an AttributeError states the reason."""
    left_out = classifier.unknown is not None or classifier.temperature == "groups"
    if left_out or classifier.shrinkage == "auto" or classifier.needs_groups:
        raise AttributeError(
            'partial_fit is not available with shrinkage="auto", unknown=, temperature="groups" or '
            'units, which need all recordings at once. Use "oas" or a number, or fit.'
        )
    return True


class CostSensitiveGaussianBayes(LeftOutMixin, ClassifierMixin, SavedEstimator):
    """Gaussian Bayes classifier that takes the decision of least conditional risk.

    Each class has a Gaussian density, Eqs. (2.44)-(2.46) of [1]_. The decision minimises
    the expected cost under the posterior, Eq. (2.43). Rows of the cost are decisions,
    columns are true classes; scikit-learn's confusion matrix and the cost of MATLAB have the
    true classes in rows.

    Parameters
    ----------
    cost : None, array-like, DataFrame or mapping, default=None
        Cost of each decision under each true class, in any unit. None: 0-1. A square array
        in the order of `classes_`; a DataFrame (index = decisions, columns = classes); or
        a mapping {(decision, true class): cost}, all other entries 0-1. Decisions that are not
        classes ("inspect") need a cost for every class. See `emacm.decisions.costs.cost_table`.
    priors : None, "uniform", array-like or mapping, default=None
        Probability of each class in service. None: frequencies of the classes in training.
        An array is in the order of `classes_`, a mapping (or Series) names every class.
    covariance : {"full", "tied", "diag"}, default="full"
        One covariance per class (divided by N - 1), one for all classes (N - K), or
        the variances of each class only (the diagonal of "full").
    shrinkage : None, float in [0, 1], "oas" or "auto", default=None
        Fraction of the target "equal variances, no correlation" in each covariance, for features
        of one unit. For standardised features, so that units have no effect, "oas" computes it from
        second moments, and "auto" is that of scikit-learn's LDA: Ledoit-Wolf (tied: on the
        deviations from the class means); it needs all recordings at once, unweighted. None: no
        shrinkage, and the eigenvalues of
        a singular covariance are raised to 1e-9 of the largest feature variance, with a
        warning. With any number, including 0, a singular covariance is an error.
    unknown : label, default=None
        Label of one more true state, without recordings, such as "unknown": "Unhealthy - Unknown"
        in Eq. (2.35). Its probability follows from `typicality`. It has a column in the cost and
        a prior, 0.01 unless `unknown_rate` is given or `priors` name it (an array: with one more
        element). What `cost` does not state of it: deciding "unknown" costs what "inspect" costs,
        if there is such a decision (see `emacm.decisions.costs.cost_table`). None: there is none.
    temperature : None, float or "groups", default=None
        Densities are raised to the power of 1 / temperature before they are multiplied by the
        priors. "groups": the value of least log loss for groups that are left out. None: 1.
    unknown_rate : None or float, default=None
        Accepted mean share of known recordings whose most probable state is the unknown one: those
        with a typicality of at most `unknown_limit_`. It holds for recordings of units like those
        left out: of other machines, sensors or conditions more are called unknown, and `score`
        states it where recordings are shifted as a whole. The prior of the unknown state follows
        from it, without costs, unless `priors` state that prior; see the notes. Needs `unknown`.

    Attributes
    ----------
    classes_ : ndarray of shape (n_classes,)
        The classes of the recordings, sorted.
    truths_ : ndarray of shape (n_truths,)
        The possible true states: `classes_`, followed by `unknown` if it is given.
    decisions_ : ndarray of shape (n_decisions,)
        Possible results of `predict`.
    cost_ : ndarray of shape (n_decisions, n_truths)
        Cost of each of `decisions_` under each of `truths_`.
    priors_ : ndarray of shape (n_classes,)
        Prior probabilities of the classes, given that one of them is true.
    unknown_prior_ : float
        Prior probability of the unknown state.
    unknown_limit_ : float or None
        `unknown_rate`, less one standard error of its mean over the groups that were left out.
    temperature_ : float
        Temperature in effect.
    class_count_ : ndarray of shape (n_classes,)
        Number of recordings of each class, as weighted.
    means_ : ndarray of shape (n_classes, n_features)
        Mean of each class.
    covariances_ : ndarray
        Shape (n_classes, n_features, n_features) if "full", (n_features, n_features) if
        "tied", (n_classes, n_features) if "diag".
    n_features_in_ : int
        Number of features.
    feature_names_in_ : ndarray of shape (n_features,)
        Names of the features, if they have any.

    See Also
    --------
    emacm.LeastRiskClassifier : The same decisions with another classifier's probabilities.
    emacm.NewUnitClassifier : For units that were not in training.
    emacm.family_costs : A cost matrix for families of states.

    Notes
    -----
    `cost` and `priors` take effect when a decision is made: ``set_params(cost=...)`` on a fitted
    classifier applies to the next `predict`, and equals a refit. `cost_`, `decisions_` and
    `priors_` contain the values in effect.

    No probability depends on costs. With `unknown_rate`, the rank of a recording among those left
    out decides whether the unknown state is the most probable one: its probability is at least 1/2
    for a typicality of at most `unknown_limit_`, and about twice this limit for all others
    (`emacm.decisions.costs.evidence_for_unknown`). Costs then decide by the risk, as
    everywhere: where looking is cheap, "inspect" is decided before that. Of "unknown" and
    "inspect" at the same cost, "unknown" is decided where it is the most probable state.

    `partial_fit` neither warns nor raises if covariances are singular, because further recordings
    may change that. `predict` and the other methods warn or raise. `CalibratedClassifierCV` decides
    for the most probable class, whatever the cost; wrap it in `LeastRiskClassifier`.

    References
    ----------
    .. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
       Condition Monitoring, section 2.2.1.

    Examples
    --------
    >>> X = [[0.0], [1.0], [2.0], [3.0], [4.0], [5.0]]
    >>> y = ["healthy"] * 3 + ["worn"] * 3
    >>> model = CostSensitiveGaussianBayes().fit(X, y)
    >>> model.predict([[2.2]])
    array(['healthy'], dtype='<U7')
    >>> missed = {("healthy", "worn"): 10}
    >>> model.set_params(cost=missed).predict([[2.2]])
    array(['worn'], dtype='<U7')
    """

    needs_groups = False
    __metadata_request__fit: ClassVar = {"groups": True}  # where metadata routing is enabled

    def __init__(
        self,
        cost: Any = None,
        *,
        priors: Any = None,
        covariance: str = "full",
        shrinkage: Any = None,
        unknown: Any = None,
        temperature: Any = None,
        unknown_rate: Any = None,
    ):
        self.cost = cost
        self.priors = priors
        self.covariance = covariance
        self.shrinkage = shrinkage
        self.unknown = unknown
        self.temperature = temperature
        self.unknown_rate = unknown_rate

    def fit(self, X, y, sample_weight=None, groups=None):
        """Estimate the Gaussian density of each class; earlier recordings are discarded.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features, in any units.
        y : array-like of shape (n_recordings,)
            True class of each recording.
        sample_weight : array-like of shape (n_recordings,), default=None
            How often each recording counts; a weight of 0 leaves it out. Weights whose sum is 1,
            as `AdaBoostClassifier` gives, are relative: they are multiplied by n_recordings.
        groups : array-like of shape (n_recordings,), default=None
            Labels of recordings that were measured together (unit, run), to be left out together
            for `typicality` and ``temperature="groups"``. None: single recordings are left out.

        Returns
        -------
        self : CostSensitiveGaussianBayes
            The fitted classifier.

        Raises
        ------
        ValueError
            If a parameter or an input is invalid, a class has no weight, a covariance
            is singular and `shrinkage` is not None, or no class has recordings in two groups.
        TypeError
            If labels are text and numbers together.

        Warns
        -----
        EmacmWarning
            If `groups` are needed and not given.
        """
        self._check_parameters()
        check_classes(y)
        check_table(X)
        X, y = validate_data(self, X, y, dtype=np.float64, ensure_min_samples=2)
        check_classification_targets(y)
        weight = as_counts(positive_weights(sample_weight, len(X)), self.shrinkage)
        classes, codes = np.unique(y, return_inverse=True)
        empty = np.bincount(codes, weight) <= 0
        if empty.any():
            raise ValueError(
                f"Every class needs a recording of positive weight; sample_weight is zero for "
                f"all recordings of class {classes[empty].tolist()}."
            )
        moments = class_moments(X, codes, len(classes), weight, self.covariance, self.shrinkage)
        gaussians = class_gaussians(moments, self.covariance, self.shrinkage, (X, codes))
        self._set_fitted(classes, moments, gaussians)
        self._check_fitted(stacklevel=3)
        self._checked = True
        if groups is not None or self.unknown is not None or isinstance(self.temperature, str):
            self._leave_out(X, codes, groups, weight)
        return self

    def _densities_without(
        self, X: Array, codes: Indices, units: Indices, weight: Array, X_left: Array
    ) -> Array:
        """Singular covariances are raised to the floor."""
        kind = self.covariance, self.shrinkage
        moments = class_moments(X, codes, len(self.classes_), weight, *kind)
        seen = (moments.counts > 0) & (moments.divisors > 0)
        gaussians = class_gaussians(moments, *kind, (X, codes), floored=True)
        return np.where(seen, gaussians.log_densities(X_left), -np.inf)

    @available_if(can_add_recordings)
    def partial_fit(self, X, y, classes=None, sample_weight=None):
        """Add recordings; the result equals one `fit` of all, however they are divided into parts.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features, in any units.
        y : array-like of shape (n_recordings,)
            True class of each recording.
        classes : array-like of shape (n_classes,), default=None
            All classes that can ever occur; required in the first call. A class without
            recordings has prior 0 (if `priors` is None) and is never decided.
        sample_weight : array-like of shape (n_recordings,), default=None
            How often each recording counts.

        Returns
        -------
        self : CostSensitiveGaussianBayes
            The fitted classifier.

        Raises
        ------
        AttributeError
            If `shrinkage` is "auto".
        TypeError, ValueError
            If `classes` is missing or changes, `y` contains another class, or a parameter or an
            input is invalid.
        """
        self._check_parameters()
        known = getattr(self, "classes_", None)
        check_classes(y)
        check_table(X)
        X, y = validate_data(self, X, y, dtype=np.float64, reset=known is None)
        check_classification_targets(y)
        labels = agreed_classes(classes, known)
        before = 0.0 if known is None else self._moments.counts.sum()
        weight = positive_weights(sample_weight, len(X), before)
        codes = np.array(label_positions(y.tolist(), labels.tolist(), "y", "class"), np.intp)
        moments = class_moments(X, codes, len(labels), weight, self.covariance, self.shrinkage)
        if known is not None:
            moments = self._moments.merge(moments)
        gaussians = class_gaussians(moments, self.covariance, self.shrinkage)
        self._set_fitted(labels, moments, gaussians)
        return self

    def predict_joint_log_proba(self, X):
        """Return the logarithm of prior times density, the terms of Eq. (2.41).

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features.

        Returns
        -------
        joint : ndarray of shape (n_recordings, n_classes)
            log(P(w_k) p(z | w_k)), density per unit of every feature; -inf where the
            prior is 0. With a temperature T, the density to the power of 1 / T.

        Raises
        ------
        ValueError
            If an input is invalid, features are so far from every class that distances overflow;
            after `partial_fit`, if a class with a prior has no
            recordings or a covariance is singular and `shrinkage` is not None.
        """
        X = self._checked_features(X)
        priors = self.priors_
        unseen = (priors > 0) & ~(self.class_count_ > 0)
        if unseen.any():
            raise ValueError(
                f"priors are given, but class {self.classes_[unseen].tolist()} has had no "
                f"recordings yet. Call partial_fit with recordings of it, or use priors=None."
            )
        with np.errstate(divide="ignore"):
            log_priors = np.log(priors)
        joint = self._gaussians.log_densities(X) / self.temperature_ + log_priors
        undefined = np.isneginf(joint.max(axis=1))
        if self.unknown is not None:
            joint[undefined] = log_priors  # nothing tells the classes apart; it is unknown
        elif undefined.any():
            raise ValueError(
                f"the features of recording {int(np.argmax(undefined))} are so far from every "
                f"class that its distances overflow. Check the features and their units."
            )
        return joint

    def predict_log_proba(self, X):
        """Return the logarithm of the posterior, Eq. (2.42).

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features.

        Returns
        -------
        log_posterior : ndarray of shape (n_recordings, n_classes)
            -inf where the prior is 0.
        """
        return log_softmax(self.predict_joint_log_proba(X), axis=1)

    def log_density_gradient(self, X):
        """Return the gradient of the log density of each class with respect to the features.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features.

        Returns
        -------
        gradient : ndarray of shape (n_recordings, n_classes, n_features)
            -S_k^-1 (z - m_k) / T, per unit of each feature.
        """
        X = self._checked_features(X)
        return self._gaussians.log_density_gradients(X) / self.temperature_

    def _check_parameters(self) -> None:
        check_choice(self.covariance, "covariance", ("full", "tied", "diag"))
        if isinstance(self.shrinkage, str):
            check_choice(self.shrinkage, "shrinkage as a word", ("oas", "auto"))
        elif self.shrinkage is not None:
            name = 'shrinkage, if not None, "oas" or "auto",'
            check_number(self.shrinkage, name, at_least=0, at_most=1)
        check_temperature(self.temperature)
        if self.unknown_rate is not None:
            check_number(self.unknown_rate, "unknown_rate", above=0, below=1)
            if self.unknown is None:
                raise ValueError('unknown_rate needs an unknown state: unknown="unknown".')

    def _checked_features(self, X: Any) -> Array:
        check_is_fitted(self)
        check_table(X)
        X = validate_data(self, X, dtype=np.float64, reset=False)
        if not self._checked:
            self._check_fitted(stacklevel=6)
        return X

    def _set_fitted(
        self, classes: NDArray[Any], moments: ClassMoments, gaussians: GaussianClasses
    ) -> None:
        """Set the fitted attributes; none, if the cost or the priors are invalid."""
        cost_table(self.cost, classes, self.unknown)
        truth_priors(self.priors, classes, moments.counts, self.unknown)
        self.classes_, self.class_count_, self.means_ = classes, moments.counts, moments.means
        self.covariances_ = gaussians.covariances[0] if moments.pooled else gaussians.covariances
        self._moments, self._gaussians, self._checked = moments, gaussians, False
        self._typicality = self._temperature = self._left_out = None

    def _check_fitted(self, stacklevel: int) -> None:
        """Raise an error if a covariance cannot be used; warn if it was raised to the floor."""
        moments, counts = self._moments, self._moments.group_counts
        if not moments.feature_variances.max() > 0:
            raise ValueError(
                "The largest variance of the features is 0: all recordings have the same features, "
                "so classes cannot be separated. Check the features."
            )
        singular = self._gaussians.singular & (counts > 0)
        if not singular.any():
            return
        named = "all classes"
        if not moments.pooled:
            named = "class " + ", ".join(map(repr, self.classes_[singular].tolist()))
        what = f"The covariance of {named} is singular"
        remedy = (
            'Use shrinkage="oas" or "auto", fewer features (by PCA), or more recordings, at least '
            "two per class (sample_weight is the number of times that one is counted)."
        )
        if self.shrinkage is not None:
            raise ValueError(f"{what} with shrinkage={self.shrinkage!r}. {remedy}")
        raised = "its eigenvalues were raised to 1e-9 of the largest feature variance"
        warn("singular", f"{what}; {raised}. {remedy}", stacklevel=stacklevel)


def as_counts(weight: Array, shrinkage: Any) -> Array:
    """Return weights as counts; those whose sum is 1 are relative. "auto" needs counts of 1."""
    counts = weight * len(weight) if np.isclose(weight.sum(), 1, rtol=1e-9) else weight
    if shrinkage == "auto" and not np.allclose(counts, 1, rtol=1e-9):
        raise ValueError(
            'shrinkage="auto" cannot be used with sample weights other than 1, which have no '
            'meaning for fourth moments. Use "oas" or a number.'
        )
    return counts


def agreed_classes(classes: ArrayLike | None, known: NDArray[Any] | None) -> NDArray[Any]:
    """Return the classes of all calls of `partial_fit`."""
    labels = known if classes is None else np.unique(column_or_1d(classes))
    if labels is None or not np.array_equal(labels, labels if known is None else known):
        raise ValueError(
            f"classes must be the same in every call of partial_fit, and given in the first call: "
            f"got {labels}, previously {known}."
        )
    return labels
