"""Gaussian classifier for units that were not in training, which differ by an offset.

The model is a mixed one, with a random effect of each unit: a recording of unit u in class k is
z = m_k + b_u + e. The offset b_u of a unit is the same in all
classes, with covariance B over the units; e varies from recording to recording with covariance W.
Along suitable directions both are uncorrelated, and each direction is a model of its own.

References
----------
.. [1] Searle, Casella and McCulloch, Variance Components, Wiley 1992: section 5.5 (Henderson's
   method of fitting constants) and chapter 7 (best linear unbiased prediction).
.. [2] Amemiya, What should be done when an estimated between-group covariance matrix is not
   nonnegative definite?, The American Statistician 39 (2), 1985.
.. [3] Paule and Mandel, Consensus values and weighting factors, Journal of Research of the National
   Bureau of Standards 87 (5), 1982.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.special import softmax
from scipy.stats import mannwhitneyu

from emacm._checks import check_number, group_codes
from emacm._statements import warn
from emacm.calibration.left_out import Array, Indices, grouped_quantile
from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.gaussians import (
    GaussianClasses,
    class_gaussians,
    class_moments,
    inverse_factor,
    shrink,
    shrinkage_coefficients,
)


class NewUnitClassifier(CostSensitiveGaussianBayes):
    """Gaussian Bayes classifier for new units: units differ by an offset common to all classes.

    The scatter within a class is divided into a covariance between units and one within a unit
    (a mixed model with a random effect of each unit). A recording of a new unit is judged with the
    sum of both covariances.

    Parameters
    ----------
    cost : None, array-like, DataFrame or mapping, default=None
        As for `CostSensitiveGaussianBayes`.
    priors : None, "uniform", array-like or mapping, default=None
        As for `CostSensitiveGaussianBayes`.
    shrinkage : None, float in [0, 1], "oas" or "auto", default="auto"
        As for `CostSensitiveGaussianBayes` with ``covariance="tied"``.
    unknown : label, default=None
        As for `CostSensitiveGaussianBayes`. Typicality is that of recordings of new units.
    temperature : None, float or "groups", default=None
        As for `CostSensitiveGaussianBayes`; "groups": from the densities of left-out units.

    Attributes
    ----------
    means_ : ndarray of shape (n_classes, n_features)
        Mean of each class over the units (generalised least squares).
    covariances_ : ndarray of shape (n_classes, n_features, n_features)
        Covariance of a recording of a new unit about `means_`; as in `CostSensitiveGaussianBayes`
        if no difference between units is found.
    classes_, truths_, decisions_, cost_, priors_, ...
        As of `CostSensitiveGaussianBayes`.

    See Also
    --------
    emacm.CostSensitiveGaussianBayes : Without an offset for each unit.
    emacm.FeatureBaseline : Subtracts the mean of healthy recordings of the unit.

    Notes
    -----
    Class means of different units differ by chance. The part of this that is caused by the units
    widens the densities too. Covariances are estimated from mean squares (`fit_unit_levels` in this
    module); with few units they are uncertain, which the densities do not
    contain; ``temperature="groups"`` and `prediction_sets` determine this uncertainty from left-out
    units. `evaluate` passes its `units` as groups, or `runs` where there are none.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> units = np.repeat(np.arange(20), 5)
    >>> y = np.where(units % 2, "worn", "healthy")
    >>> offsets = 3 * rng.normal(size=(21, 1))
    >>> X = 4.0 * (y == "worn")[:, np.newaxis] + offsets[units] + rng.normal(size=(100, 1))
    >>> model = NewUnitClassifier().fit(X, y, groups=units)
    >>> model.predict_proba([[6.0]]).round(2)  # of a new unit
    array([[0.1, 0.9]])
    """

    covariance = "tied"
    unknown_rate = None
    needs_groups = True
    groups_are_units = True
    _without_units = True

    def __init__(
        self,
        cost: Any = None,
        *,
        priors: Any = None,
        shrinkage: Any = "auto",
        unknown: Any = None,
        temperature: Any = None,
    ):
        self.cost = cost
        self.priors = priors
        self.shrinkage = shrinkage
        self.unknown = unknown
        self.temperature = temperature

    def fit(self, X, y, groups=None):  # type: ignore[override]
        """Estimate the mean of each class, and the covariances between and within units.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features, in any units.
        y : array-like of shape (n_recordings,)
            True class of each recording.
        groups : array-like of shape (n_recordings,)
            Unit of each recording; several recordings of a unit are needed. Without groups there
            is no difference between units, and the densities are those of
            ``CostSensitiveGaussianBayes(covariance="tied")``.

        Returns
        -------
        self : NewUnitClassifier
            The fitted classifier.

        Raises
        ------
        ValueError
            As `CostSensitiveGaussianBayes.fit`; if there is a single unit, no class was recorded
            on two units, no unit has two recordings, or the covariance within units is singular.

        Warns
        -----
        EmacmWarning
            If there are no `groups`.
        """
        self._without_units = groups is None
        super().fit(X, y, groups=groups)
        if groups is None:
            warn(
                "groups",
                "NewUnitClassifier was fitted without groups, and knows no difference between "
                "units. Give them, in a pipeline as newunitclassifier__groups=units.",
                stacklevel=2,
            )
            return self
        table = self._checked_features(X)
        codes = np.searchsorted(self.classes_, np.asarray(y))
        units = group_codes(groups, len(table))
        levels = self._estimated(table, codes, units)
        if levels.variances.any():  # otherwise exactly as without units
            self._gaussians = levels.gaussians()
            self.means_, self.covariances_ = self._gaussians.means, self._gaussians.covariances
        return self

    def prediction_sets(self, X, coverage=0.9, groups=None):
        """Return the classes that cannot be excluded for each recording.

        The set has the most probable class, and every class that is at least as probable as a
        threshold: the one with which the sets of units that were left out in training contain the
        true class with probability `coverage`, for present priors.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features.
        coverage : float, default=0.9
            Probability above 0 and below 1. If the most probable class is correct more often than
            that, the sets have one class and a higher coverage.
        groups : array-like of shape (n_recordings,), default=None
            Unit of each recording. Default: all are of one unit.

        Returns
        -------
        ndarray of bool, shape (n_recordings, n_classes)
            Never empty.

        Raises
        ------
        ValueError
            If an input is invalid, `fit` had no groups, or there are fewer units than
            ``coverage / (1 - coverage)``.

        Warns
        -----
        EmacmWarning
            If the units are less typical than those of the training were when they were left out
            (test of Mann and Whitney on the mean typicality of each unit, at 5 %): the coverage
            holds for units of the same kind only. On simulated fleets of 50 units the warning came
            for 2 to 5 % of calls with units of the same kind. Of units shifted by half a standard
            deviation, which are covered with 86 to 87 %, it came for 8 % of single units, 44 % of
            tens and 76 % of forties; shifted by one (73 to 77 %), for 42, 98 and 99 %
            (``benchmarks/stated_limits.py``).
        """
        coverage = check_number(coverage, "coverage", above=0, below=1)
        posterior = self.predict_proba(X)
        if self._without_units:
            raise ValueError(
                "NewUnitClassifier knows no difference between units: it was fitted without "
                "groups. Call fit with groups=, the unit of each recording."
            )
        left = self._calibrated("left_out")
        self._warn_of_shift(X, groups, left.typicality, left.units)
        threshold = probability_threshold(
            left.log_densities, left.codes, left.units, self.priors_, self.temperature_, coverage
        )
        return classes_above(posterior, threshold)

    def _warn_of_shift(self, X: Any, groups: Any, known: Array, units: Indices) -> None:
        """Warn if units are less typical than those of the training were when left out."""
        typicality = pd.Series(self.typicality(X))
        labels = np.zeros(len(typicality)) if groups is None else groups
        new = typicality.groupby(group_codes(labels, len(typicality))).mean()
        usual = pd.Series(known).groupby(units).mean()
        probability = mannwhitneyu(new, usual, alternative="less").pvalue
        if probability < 0.05:
            warn(
                "shifted units",
                f"{len(new)} units with a mean typicality of {new.mean():.2g} are less "
                f"typical than those of the training (p = {probability:.2g}): the sets may contain "
                f"the true class less often than stated. Train with such units.",
                stacklevel=3,
            )

    def _estimated(self, X: Array, codes: Indices, units: Indices) -> UnitLevels:
        """Estimate the covariances from recordings of classes and units numbered from 0."""
        moments = class_moments(X, codes, int(codes.max()) + 1, covariance="tied")
        plain = class_gaussians(moments, "tied", self.shrinkage, (X, codes)).covariances[0]
        shrinkage = shrinkage_coefficients(moments, self.shrinkage, (X, codes))
        return fit_unit_levels(X, codes, units, plain, *shrinkage)

    def _densities_without(
        self, X: Array, codes: Indices, units: Indices, weight: Array, X_left: Array
    ) -> Array:
        """Return log densities of classes estimated without the units of left-out recordings."""
        if self._without_units:
            return super()._densities_without(X, codes, units, weight, X_left)
        logs = np.full((len(X_left), len(self.classes_)), -np.inf)
        known, numbers = np.unique(codes, return_inverse=True)
        with suppress(ValueError):  # too few units remain
            levels = self._estimated(X, numbers, np.unique(units, return_inverse=True)[1])
            logs[:, known] = levels.gaussians().log_densities(X_left)
        return logs


def classes_above(posterior: Array, threshold: float) -> NDArray[np.bool_]:
    """Return the most probable class, and all that are at least as probable as a threshold.

    Examples
    --------
    >>> classes_above(np.array([[0.8, 0.15, 0.05], [0.5, 0.3, 0.2]]), 0.3).astype(int)
    array([[1, 0, 0],
           [1, 1, 0]])
    """
    return (posterior >= threshold) | (posterior == posterior.max(axis=1, keepdims=True))


def probability_threshold(
    log_densities: Array,
    codes: Indices,
    units: Indices,
    priors: Array,
    temperature: float,
    coverage: float,
) -> float:
    """Return the largest threshold for which `classes_above` contains the true class often enough.

    Units are pooled with equal weights (`emacm.calibration.left_out`), and the classes have the
    weights of the priors [1]_.

    Parameters
    ----------
    log_densities : ndarray of shape (n_recordings, n_classes)
        Of recordings under models that were fitted without their units; -inf for classes that these
        models do not contain.
    codes, units : ndarray of int, shape (n_recordings,)
        Number of the true class, whose density is finite, and of the unit.
    priors : ndarray of shape (n_classes,)
        Prior probabilities in service.
    temperature : float
        Of the posteriors.
    coverage : float
        Fraction of recordings of new units whose set is to contain the true class.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If there are fewer than coverage / (1 - coverage) units.

    References
    ----------
    .. [1] Podkopaev and Ramdas, Distribution-free uncertainty quantification for classification
       under label shift, UAI 2021.
    """
    with np.errstate(divide="ignore"):
        posterior = softmax(log_densities / temperature + np.log(priors), axis=1)
    own = posterior[np.arange(len(posterior)), codes]
    own[own == posterior.max(axis=1)] = 1.0  # always in the set
    shares = np.bincount(codes, 1 / np.bincount(units)[units], len(priors))[codes]
    return -grouped_quantile(-own, units, coverage, priors[codes] / shares)


class UnitLevels(NamedTuple):
    """Estimates for a new unit: its level m_k + b in each class.

    Attributes
    ----------
    directions : ndarray of shape (n_features, n_features)
        D, with W = D D' and B diagonal: coordinates along its columns are independent.
    means : ndarray of shape (n_features, n_classes)
        Expected coordinate, along each direction, of the level in each class.
    variances : ndarray of shape (n_features, n_classes)
        Its variance along each direction, where that within a unit is 1.
    """

    directions: Array
    means: Array
    variances: Array

    def gaussians(self) -> GaussianClasses:
        """Return the densities of a recording of the unit in each class."""
        total = 1 + np.maximum(self.variances.T, 0.0)[:, np.newaxis, :]  # rounding leaves -1e-17
        inverse = np.linalg.inv(self.directions).T
        determinants = 2 * np.linalg.slogdet(self.directions)[1] + np.log(total).sum(axis=(1, 2))
        return GaussianClasses(
            self.means.T @ self.directions.T,
            (self.directions * total) @ self.directions.T,
            inverse / np.sqrt(total),
            determinants,
            np.zeros(len(total), bool),
        )


class UnitScatter(NamedTuple):
    """Scatter of recordings about the means of their classes, divided into two parts.

    Attributes
    ----------
    within, between : ndarray of shape (n_features, n_features)
        Mean squares within units, and of what the offsets of the units explain.
    between_divisor : int
        Degrees of freedom of the second.
    multiplicity : float
        Effective number of recordings of a unit, n: the expected values are W and W + n B.
    """

    within: Array
    between: Array
    between_divisor: int
    multiplicity: float


def unit_scatter(X: Array, codes: Indices, units: Indices) -> UnitScatter:
    """Divide the scatter about class means by Henderson's method of fitting constants, [1]_.

    Parameters
    ----------
    X : ndarray of shape (n_recordings, n_features)
        Features.
    codes, units : ndarray of int, shape (n_recordings,)
        Number of the class, and of the unit, of each recording; none is left out.

    Returns
    -------
    UnitScatter

    Raises
    ------
    ValueError
        If no class was recorded on several units, or no unit has several recordings.

    Examples
    --------
    >>> X = np.array([[1.0], [3.0], [5.0], [7.0]])
    >>> parts = unit_scatter(X, np.zeros(4, int), np.array([0, 0, 1, 1]))
    >>> parts.within.round(9), parts.between.round(9), parts.multiplicity
    (array([[2.]]), array([[16.]]), 2.0)
    """
    classes = np.eye(codes.max() + 1)[codes]
    counts = _sums(classes, units)
    sizes, totals = counts.sum(axis=1, keepdims=True), counts.sum(axis=0)
    deviations = X - (_sums(X, codes) / totals[:, np.newaxis])[codes]
    inside = deviations - (_sums(deviations, units) / sizes)[units]
    classes_inside = classes - (counts / sizes)[units]
    fitted, _, rank, _ = np.linalg.lstsq(classes_inside, inside, rcond=None)
    rest = inside - classes_inside @ fitted
    explained = deviations - rest
    rank += len(counts)  # of the classes and the units together
    within, between = len(X) - int(rank), int(rank) - len(totals)
    if between < 1 or within < 1:
        raise ValueError(
            "the variances within and between units cannot be told apart. Record one class on two "
            "units, and units several times, or use CostSensitiveGaussianBayes."
        )
    shared = float(np.sum(counts**2 / totals))
    mean_squares = rest.T @ rest / within, explained.T @ explained / between
    return UnitScatter(*mean_squares, between, (len(X) - shared) / between)


def fit_unit_levels(
    X: Array, codes: Indices, units: Indices, plain: Array, *shrinkage: ArrayLike
) -> UnitLevels:
    """Estimate what is known of a new unit before any recording of it.

    Both mean squares of `unit_scatter` are shrunk like the covariance of the classifier. The
    eigenvalues of that between units, which has few degrees of freedom, are corrected where W is
    the identity (`population_eigenvalues`). B is not negative along any direction, [2]_.

    Parameters
    ----------
    X, codes, units : ndarray
        As for `unit_scatter`.
    plain : ndarray of shape (n_features, n_features)
        Covariance within the classes without a difference between units: W if none is found.
    *shrinkage : array-like
        Arguments `coefficients` and `squared_scales` of `shrink`.

    Returns
    -------
    UnitLevels

    Raises
    ------
    ValueError
        As `unit_scatter`, or if W is singular.
    """
    parts = unit_scatter(X, codes, units)
    within, between = (shrink(part[np.newaxis], *shrinkage)[0] for part in parts[:2])
    white, of_plain = inverse_factor(within), inverse_factor(plain)
    if white is None or of_plain is None:
        raise ValueError(
            f"the covariance within units is singular, for {X.shape[1]} features and {len(X)} "
            f'recordings. Use shrinkage="auto", more recordings of each unit or fewer features.'
        )
    mean_square = white[0].T @ between @ white[0]
    values, vectors = np.linalg.eigh(mean_square)
    values = population_eigenvalues(values, parts.between_divisor)
    ratios = np.maximum(values - 1, 0) / parts.multiplicity
    directions = within @ white[0] @ vectors if ratios.any() else plain @ of_plain[0]
    return UnitLevels(directions, *_class_levels(directions, ratios, X, codes, units))


def population_eigenvalues(values: ArrayLike, divisor: int) -> Array:
    """Correct the eigenvalues of a covariance that has few degrees of freedom.

    The largest of a sample are too large, the smallest too small. Those beyond the range of
    eigenvalues of uncorrelated features of one variance are moved to the value that would have
    caused them [1]_; the others are shrunk towards their mean, as far as their variance is that of
    equal ones [2]_. Their sum, which is unbiased, is kept. That variance is the mean of the
    corrected others; it is iterated until it stays the same.

    Parameters
    ----------
    values : array-like of shape (n_features,)
        Eigenvalues, at least 0, in any order.
    divisor : int
        Degrees of freedom of the covariance.

    Returns
    -------
    corrected : ndarray of shape (n_features,)
        In the same order.

    References
    ----------
    .. [1] Donoho, Gavish and Johnstone, Optimal shrinkage of eigenvalues in the spiked covariance
       model, Annals of Statistics 46 (4), 2018, Eq. (1.10).
    .. [2] Ledoit and Wolf, A well-conditioned estimator for large-dimensional covariance
       matrices, Journal of Multivariate Analysis 88 (2004).

    Examples
    --------
    >>> population_eigenvalues([9.0, 1.4, 1.1, 0.9, 0.6], 20).round(3)
    array([8.693, 1.077, 1.077, 1.077, 1.077])
    """
    values = np.asarray(values)
    ratio, level = len(values) / divisor, values.mean()  # of the features that are equal
    corrected = np.empty(len(values))
    while True:
        above = values > level * (1 + np.sqrt(ratio)) ** 2
        half = (values[above] / level + 1 - ratio) / 2
        corrected[above] = level * (half + np.sqrt(half**2 - values[above] / level))
        before, level = level, (values.sum() - corrected[above].sum()) / np.count_nonzero(~above)
        if before - level <= 1e-12 * values.mean():  # it only decreases
            break
    corrected[~above] = level
    spread = values[~above] - values[~above].mean()
    variance = np.mean(spread**2)
    if variance > ratio * level**2:  # more than equal features would show
        corrected[~above] += (1 - ratio * level**2 / variance) * spread
    return corrected


def _class_levels(
    directions: Array, ratios: Array, X: Array, codes: Indices, units: Indices
) -> tuple[Array, Array]:
    """Return means and variances of `UnitLevels` by generalised least squares.

    The uncertainty of the class means counts as far as it stems from the units: without it, classes
    recorded on different units would seem to differ by the offsets of these units.
    """
    coordinates = np.linalg.solve(directions, X.T).T
    counts = _sums(np.eye(codes.max() + 1)[codes], units)
    totals = counts.sum(axis=0)
    weight = ratios / (1 + np.outer(counts.sum(axis=1), ratios))  # (I + r Z Z')^-1, by Woodbury
    sums = _sums(coordinates, codes) - counts.T @ (weight * _sums(coordinates, units))
    information = np.diag(totals) - np.einsum("uj,uk,ul->jkl", weight, counts, counts)
    prior = _contrast_precision(information, sums)
    means = np.einsum("jkl,lj->jk", np.linalg.inv(information + prior), sums)
    excess = np.linalg.inv(information + prior) - np.linalg.inv(np.diag(totals) + prior)
    return means, np.diagonal(excess, axis1=1, axis2=2) + ratios[:, np.newaxis]


def _sums(rows: NDArray[Any], numbers: Indices) -> Array:
    """Add up the rows of each number."""
    sums = np.zeros((numbers.max() + 1, rows.shape[1]))
    np.add.at(sums, numbers, rows)
    return sums


def _contrast_precision(information: Array, sums: Array) -> Array:
    """Return the prior precision of the differences between the classes, (n_classes, n_classes).

    Where units differ much, means of classes recorded on different units differ by chance; this
    must not pass for a difference between the classes. The differences have the same variance t
    along every direction, for which sum y^2 / (t + variance of y) has its expected value [3]_.
    """
    n_classes = len(sums)
    centring = np.eye(n_classes) - 1 / n_classes
    contrasts = np.linalg.eigh(centring)[1][:, 1:]  # orthonormal, without the common level
    of_means = np.linalg.inv(information)
    variances, axes = np.linalg.eigh(contrasts.T @ of_means @ contrasts)
    means = np.einsum("jkl,lj->jk", of_means, sums) @ contrasts
    squares = np.einsum("jkl,jk->jl", axes, means) ** 2

    def excess(variance: float) -> float:
        return float(np.sum(squares / (variance + variances))) - squares.size

    smallest = 1e-6  # where the variance within a unit is 1
    if excess(smallest) <= 0:  # no difference is proven
        return centring / smallest
    return centring / brentq(excess, smallest, squares.mean())
