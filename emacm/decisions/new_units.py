"""Gaussian classifier for units that were not in training, which differ by an offset."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import softmax
from scipy.stats import mannwhitneyu

from emacm._checks import check_number, group_codes
from emacm._statements import warn
from emacm.calibration.left_out import Array, Indices, grouped_quantile
from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.gaussians import class_gaussians, class_moments, shrinkage_coefficients
from emacm.decisions.unit_effects import UnitLevels, fit_unit_levels


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
    widens the densities too. Covariances are estimated from mean squares
    (`emacm.decisions.unit_effects`); with few units they are uncertain, which the densities do not
    contain; ``temperature="groups"`` and `prediction_sets` determine this uncertainty from left-out
    units. `evaluate` passes `runs` as groups if `runs` are given: give `units` only.

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

    def _warn_of_shift(
        self, X: Any, groups: Any, known: Array, units: Indices, *, level: float = 0.05
    ) -> None:
        """Warn if units are less typical than those of the training were when left out."""
        typicality = pd.Series(self.typicality(X))
        labels = np.zeros(len(typicality)) if groups is None else groups
        new = typicality.groupby(group_codes(labels, len(typicality))).mean()
        usual = pd.Series(known).groupby(units).mean()
        probability = mannwhitneyu(new, usual, alternative="less").pvalue
        if probability < level:
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
