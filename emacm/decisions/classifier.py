"""The Bayes classifier of least risk: Gaussian classes, labelled costs."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, column_or_1d, validate_data

from emacm._checks import check_choice, check_number
from emacm.decisions.costs import cost_table
from emacm.decisions.gaussians import FLOOR, fit_gaussians
from emacm.decisions.labels import check_classes
from emacm.decisions.metrics import check_weights, fraction_correct
from emacm.decisions.moments import ClassMoments, class_moments
from emacm.decisions.posteriors import BayesRule
from emacm.decisions.priors import class_priors
from emacm.decisions.shrinkage import ledoit_wolf_coefficients, oas_coefficient

_REMEDY = 'Use shrinkage="oas" or "auto", fewer features (by PCA), or more recordings.'
_FEWER = "Use fewer features (by PCA), or more recordings: two of a class at the least."


class CostSensitiveGaussianBayes(ClassifierMixin, BaseEstimator):
    """Gaussian Bayes classifier that takes the decision of least conditional risk.

    Each class is a Gaussian density, Eqs. (2.44)-(2.46) of [1]_. The decision minimises
    the expected cost under the posterior, Eq. (2.43). Rows of the cost are the decision,
    columns are the truth; scikit-learn's confusion matrix and the cost of MATLAB put the
    truth in rows.

    Parameters
    ----------
    cost : None, array-like, DataFrame or mapping, default=None
        Cost of each decision under each truth, in any unit. None: 0-1. A square array
        in the order of `classes_`; a DataFrame (index = decisions, columns = classes); or
        a mapping {(decision, truth): cost} with the rest 0-1. Decisions that are no class
        ("inspect") must price every class. See `emacm.decisions.costs.cost_table`.
    priors : None, "uniform", array-like or mapping, default=None
        Probability of each class in service. None: shares of the classes in training.
        An array is in the order of `classes_`, a mapping (or Series) names every class.
    covariance : {"full", "tied", "diag"}, default="full"
        One covariance per class (divided by N - 1), one for all classes (N - K), or
        the variances of each class only (the diagonal of the full one).
    shrinkage : None, float in [0, 1], "oas" or "auto", default=None
        Share of the target "equal variances, no correlation" in each covariance. "oas"
        finds it from second moments. "auto" is that of scikit-learn's LDA: Ledoit-Wolf on
        standardised features (tied: on the deviations from the class means); it needs
        all recordings at once, unweighted. None: no shrinkage, and the eigenvalues of
        a singular covariance are raised to 1e-9 of the largest feature variance, with a
        warning. With any number, 0 included, a singular covariance is an error.

    Attributes
    ----------
    classes_ : ndarray of shape (n_classes,)
        The possible truths, sorted.
    decisions_ : ndarray of shape (n_decisions,)
        What `predict` can answer; ties go to the first.
    cost_ : ndarray of shape (n_decisions, n_classes)
        Cost of each of `decisions_` under each of `classes_`.
    priors_ : ndarray of shape (n_classes,)
        Prior probabilities.
    class_count_ : ndarray of shape (n_classes,)
        Recordings of each class, as weighted.
    means_ : ndarray of shape (n_classes, n_features)
        Mean of each class.
    covariances_ : ndarray
        Shape (n_classes, n_features, n_features) if "full", (n_features, n_features) if
        "tied", (n_classes, n_features) if "diag".
    n_features_in_ : int
        Number of features.
    feature_names_in_ : ndarray of shape (n_features,)
        Names of the features, if they have any.

    Notes
    -----
    `partial_fit` neither warns nor raises about singular covariances, because the next
    recordings may cure them; `predict` and the others then do.
    `CalibratedClassifierCV` decides for the most probable class, whatever the cost;
    `emacm.decisions.costs.least_risk(probabilities, cost)` decides by its probabilities.

    References
    ----------
    .. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
       Condition Monitoring, section 2.2.1.

    Examples
    --------
    >>> X = [[0.0], [1.0], [2.0], [3.0], [4.0], [5.0]]
    >>> y = ["healthy"] * 3 + ["worn"] * 3
    >>> CostSensitiveGaussianBayes().fit(X, y).predict([[2.2]])
    array(['healthy'], dtype='<U7')
    >>> missed = {("healthy", "worn"): 10}
    >>> CostSensitiveGaussianBayes(missed).fit(X, y).predict([[2.2]])
    array(['worn'], dtype='<U7')
    """

    def __init__(
        self,
        cost: Any = None,
        *,
        priors: Any = None,
        covariance: str = "full",
        shrinkage: Any = None,
    ):
        self.cost = cost
        self.priors = priors
        self.covariance = covariance
        self.shrinkage = shrinkage

    def fit(self, X, y, sample_weight=None):
        """Estimate the Gaussian density of each class, forgetting earlier recordings.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features, in any units.
        y : array-like of shape (n_recordings,)
            True class of each recording.
        sample_weight : array-like of shape (n_recordings,), default=None
            How often each recording counts; weight 0 leaves it out.

        Returns
        -------
        self : CostSensitiveGaussianBayes
            The fitted classifier.

        Raises
        ------
        ValueError
            If a parameter or an input is invalid, a class has no weight, or a covariance
            is singular and `shrinkage` is not None.
        TypeError
            If labels are text and numbers together.
        """
        _check_parameters(self.covariance, self.shrinkage)
        if isinstance(y, list | tuple):
            check_classes(y)
        X, y = validate_data(self, X, y, dtype=np.float64, ensure_min_samples=2)
        check_classification_targets(y)
        weight = check_weights(sample_weight, len(X))
        if self.shrinkage == "auto":
            _check_unweighted(weight)
        classes, codes = np.unique(y, return_inverse=True)
        empty = np.bincount(codes, weight) <= 0
        if empty.any():
            raise ValueError(
                f"Every class needs a recording of positive weight; sample_weight is zero for "
                f"all recordings of class {classes[empty].tolist()}."
            )
        moments = self._measure(X, codes, weight, classes)
        if self.shrinkage == "auto":
            target = ledoit_wolf_coefficients(X, codes, moments.means, pooled=moments.pooled)
            self._settle(classes, moments, *target)
        else:
            self._settle(classes, moments, self._coefficients(moments))
        self._judge()
        self._judged = True
        return self

    def partial_fit(self, X, y, classes=None, sample_weight=None):
        """Add recordings; any pieces give what one `fit` of all of them gives.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features, in any units.
        y : array-like of shape (n_recordings,)
            True class of each recording.
        classes : array-like of shape (n_classes,), default=None
            All classes that can ever occur; needed in the first call. A class not seen
            yet has prior 0 (if `priors` is None) and is never decided.
        sample_weight : array-like of shape (n_recordings,), default=None
            How often each recording counts.

        Returns
        -------
        self : CostSensitiveGaussianBayes
            The fitted classifier.

        Raises
        ------
        ValueError
            If `classes` is missing or changes, `y` holds another class, `shrinkage` is
            "auto", or a parameter or an input is invalid.
        """
        _check_parameters(self.covariance, self.shrinkage)
        if self.shrinkage == "auto":
            raise ValueError(
                'shrinkage="auto" cannot be used with partial_fit: Ledoit-Wolf needs fourth '
                "moments of the recordings themselves, which are not kept. "
                'Use "oas" or a number, or fit all recordings at once.'
            )
        known = getattr(self, "classes_", None)
        X, y = validate_data(self, X, y, dtype=np.float64, reset=known is None)
        check_classification_targets(y)
        labels = _agreed_classes(classes, known)
        weight = check_weights(sample_weight, len(X))
        moments = self._measure(X, _class_numbers(y, labels), weight, labels)
        if known is not None:
            moments = self._merged(moments)
        if not moments.counts.sum() > 0:
            raise ValueError("sample_weight must not be zero for every recording.")
        self._settle(labels, moments, self._coefficients(moments))
        return self

    def predict_joint_log_proba(self, X):
        """Logarithm of prior times density, the terms of Eq. (2.41).

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features.

        Returns
        -------
        joint : ndarray of shape (n_recordings, n_classes)
            log(P(w_k) p(z | w_k)), density per unit of every feature; -inf where the
            prior is 0.

        Raises
        ------
        ValueError
            If an input is invalid, or after `partial_fit`, if a class with a prior has no
            recordings or a covariance is singular and `shrinkage` is not None.
        """
        X = self._features(X)
        return self._rule.joint(X)

    def predict_log_proba(self, X):
        """Logarithm of the posterior, Eq. (2.42), shape (n_recordings, n_classes)."""
        X = self._features(X)
        return self._rule.log_posterior(X)

    def predict_proba(self, X):
        """Posterior probability of each class, Eq. (2.42), shape (n_recordings, n_classes)."""
        X = self._features(X)
        return self._rule.posterior(X)

    def risk(self, X):
        """Conditional risk of each decision, Eq. (2.39), in the unit of the cost.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features.

        Returns
        -------
        risk : ndarray of shape (n_recordings, n_decisions)
            Posterior times `cost_`, columns in the order of `decisions_`.
        """
        X = self._features(X)
        return self._rule.risk(X, self.cost_)

    def predict(self, X):
        """Take the decision of least risk, Eq. (2.43).

        Scaling all costs, or adding a constant to every decision of one true class,
        changes no decision. Ties go to the first of `decisions_`.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features.

        Returns
        -------
        decisions : ndarray of shape (n_recordings,)
            One of `decisions_` for each recording.
        """
        X = self._features(X)
        return self.decisions_.take(self._rule.decide(X, self.cost_))

    def score(self, X, y, sample_weight=None):
        """Share of recordings that are decided rightly.

        A decision is right if it is the true class ("inspect" never is); for a true class
        that is no decision, as a sub-state where families are decided for, if it costs
        least. The metrics of scikit-learn (``scoring="accuracy"``) compare labels: where
        decisions are no classes, they call every one of them wrong. `neg_expected_cost` does not.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features.
        y : array-like of shape (n_recordings,)
            True classes.
        sample_weight : array-like of shape (n_recordings,), default=None
            How often each recording counts.

        Returns
        -------
        share : float
            Accuracy, 0..1.

        Raises
        ------
        ValueError
            If an input is invalid, or what is right is not known: some decisions are no
            classes, and `y` holds a label that is neither.
        """
        table = self.decisions_, self.classes_, self.cost_
        return fraction_correct(column_or_1d(y), self.predict(X), table, sample_weight)

    def _features(self, X) -> NDArray[np.float64]:
        check_is_fitted(self)
        X = validate_data(self, X, dtype=np.float64, reset=False)
        if not self._judged:
            self._judge(depth=4)
        return X

    def _measure(self, X, codes, weight, classes) -> ClassMoments:
        return class_moments(
            X,
            codes,
            len(classes),
            sample_weight=weight,
            pooled=self.covariance == "tied",
            variances_only=self.covariance == "diag" and self.shrinkage != "oas",
        )

    def _merged(self, moments: ClassMoments) -> ClassMoments:
        try:
            return self._moments.merge(moments)
        except ValueError as error:
            raise ValueError(
                "covariance or shrinkage changed since the last fit or partial_fit, and what "
                "was kept of the recordings does not serve the new choice. Call fit."
            ) from error

    def _coefficients(self, moments: ClassMoments) -> ArrayLike:
        """Return the shrinkage coefficient of each covariance, by the moments alone."""
        if self.shrinkage == "oas":
            pairs = zip(moments.scatter, moments.group_counts, strict=True)
            return [oas_coefficient(scatter, count) for scatter, count in pairs]
        return 0.0 if self.shrinkage is None else float(self.shrinkage)

    def _settle(self, classes, moments, coefficients, squared_scales=1.0) -> None:
        """Set everything that follows from the moments; nothing, if a parameter is invalid."""
        decisions, cost = cost_table(self.cost, classes)
        priors = class_priors(self.priors, classes, moments.counts)
        gaussians = fit_gaussians(
            moments,
            coefficients,
            squared_scales,
            diagonal=self.covariance == "diag",
            floor=FLOOR * moments.feature_variances.max() if self.shrinkage is None else None,
        )
        self.classes_, self.decisions_, self.cost_, self.priors_ = classes, decisions, cost, priors
        self.class_count_, self.means_ = moments.counts, moments.means
        self.covariances_ = gaussians.covariances[0] if moments.pooled else gaussians.covariances
        with np.errstate(divide="ignore"):
            self._rule = BayesRule(gaussians, np.log(priors))
        self._moments, self._judged = moments, False

    def _judge(self, depth: int = 3) -> None:
        """Raise or warn if the densities are not fit for use; the warning names the caller."""
        seen = self._moments.counts > 0
        unknown = (self.priors_ > 0) & ~seen
        if unknown.any():
            raise ValueError(
                f"priors are given, but class {self.classes_[unknown].tolist()} has had no "
                f"recordings yet. Call partial_fit with some, or leave priors=None, which "
                f"gives it the prior 0."
            )
        if not self._moments.feature_variances.max() > 0:
            raise ValueError(
                "The largest variance of the features is 0: every recording has the same "
                "features, and nothing can be told apart. Check the features."
            )
        scattered = self._moments.scatter.reshape(len(self._moments.scatter), -1).any(axis=1)
        thin = (self._moments.divisors <= 0) & scattered
        if thin.any():
            raise ValueError(
                f"sample_weight counts recordings: a covariance divides by their number less "
                f"one, but {self._named(thin)} has a total weight of "
                f"{self._moments.group_counts[thin].tolist()}. Scale the weights up."
            )
        singular = self._rule.gaussians.singular & (self._moments.group_counts > 0)
        if singular.any() and self.shrinkage is not None:
            raise ValueError(
                f"The covariance of {self._named(singular)} is singular with "
                f"shrinkage={self.shrinkage!r}. "
                f"{_FEWER if self.shrinkage in ('oas', 'auto') else _REMEDY}"
            )
        if singular.any():
            warnings.warn(
                f"The covariance of {self._named(singular)} is singular; its eigenvalues were "
                f"raised to {FLOOR:g} of the largest feature variance. {_REMEDY}",
                UserWarning,
                stacklevel=depth,
            )

    def _named(self, groups: NDArray[np.bool_]) -> str:
        if self._moments.pooled:
            return "all classes"
        return "class " + ", ".join(repr(label) for label in self.classes_[groups].tolist())


def _check_parameters(covariance: Any, shrinkage: Any) -> None:
    check_choice(covariance, "covariance", ("full", "tied", "diag"))
    if isinstance(shrinkage, str):
        check_choice(shrinkage, "shrinkage as a word", ("oas", "auto"))
    elif shrinkage is not None:
        name = 'shrinkage, if not None, "oas" or "auto",'
        check_number(shrinkage, name, at_least=0, at_most=1)


def _check_unweighted(weight: NDArray[np.float64]) -> None:
    if not (weight == 1).all():
        raise ValueError(
            'shrinkage="auto" cannot be used with sample weights other than 1: Ledoit-Wolf '
            "needs fourth moments of the recordings themselves, for which weights have no "
            'meaning. Use "oas" or a number.'
        )


def _agreed_classes(classes: ArrayLike | None, known: NDArray[Any] | None) -> NDArray[Any]:
    """Return the classes of a stream of recordings, or say why they are not clear."""
    if classes is None:
        if known is None:
            raise ValueError("classes must be given in the first call of partial_fit.")
        return known
    labels = np.unique(column_or_1d(classes))
    if known is not None and not np.array_equal(labels, known):
        raise ValueError(
            f"classes must stay the same in every call of partial_fit: got {labels.tolist()}, "
            f"before {known.tolist()}."
        )
    return labels


def _class_numbers(y: NDArray[Any], classes: NDArray[Any]) -> NDArray[np.intp]:
    place = {label: number for number, label in enumerate(classes.tolist())}
    for position, label in enumerate(y.tolist()):
        if label not in place:
            raise ValueError(
                f"y holds the class {label!r} at recording {position}, which is none of the "
                f"classes {list(place)} given to the first partial_fit."
            )
    return np.array([place[label] for label in y.tolist()], dtype=np.intp)
