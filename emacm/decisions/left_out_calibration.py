"""Calibration on left-out groups: typicality, and the temperature of posteriors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import log_softmax
from sklearn.base import clone
from sklearn.utils.metaestimators import available_if
from sklearn.utils.validation import check_is_fitted, has_fit_parameter

from emacm._checks import located
from emacm.calibration.left_out import check_judged, left_out
from emacm.calibration.tails import StudentTail, student_tail
from emacm.calibration.temperature import fit_temperature
from emacm.decisions.fit_checks import check_temperature, has_unknown
from emacm.decisions.gaussians import class_gaussians
from emacm.decisions.moments import class_moments
from emacm.decisions.truths import states_unknown, truth_priors
from emacm.decisions.typicality import fit_typicality, positive, unknown_probability
from emacm.recordings.meta import chosen_rows

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class LeftOutDensities(NamedTuple):
    """Training recordings, judged by classifiers that were fitted without their groups.

    Attributes
    ----------
    typicality : ndarray of shape (n_recordings,)
        NaN if there is none.
    log_densities : ndarray of shape (n_recordings, n_classes)
        -inf for classes of which no other recordings remain.
    codes : ndarray of int, shape (n_recordings,)
        Number of the true class.
    weight : ndarray of shape (n_recordings,)
        Number of times each recording is counted.
    """

    typicality: Array
    log_densities: Array
    codes: Indices
    weight: Array

    def fit_temperature(self, n_classes: int) -> float:
        """Return the temperature of least log loss, with the frequencies of the classes."""
        judged = np.isfinite(self.log_densities[np.arange(len(self.codes)), self.codes])
        check_judged(judged)
        counts = np.bincount(self.codes, self.weight, n_classes)
        some = self.log_densities[judged], self.codes[judged], self.weight[judged]
        return fit_temperature(*some, counts / counts.sum())


class LeftOutCalibration(NamedTuple):
    """Results of leaving out each group in turn.

    Attributes
    ----------
    typicality : Typicality, DetectorTypicality or None
        A function of features. None before anything was left out.
    temperature : float or None
        Temperature of least log loss; None if it was not requested.
    left_out : LeftOutDensities or None
        The recordings of the training; None if they are not needed.
    """

    typicality: Callable[[Any], Array] | None = None
    temperature: float | None = None
    left_out: LeftOutDensities | None = None


class LeftOutMixin:
    """Typicality, unknown state and temperature of a classifier with a `LeftOutCalibration`."""

    classes_: NDArray[Any]
    class_count_: Array
    priors: Any
    unknown: Any
    unknown_rate: Any
    temperature: Any
    _calibration: LeftOutCalibration

    @property
    def priors_(self) -> Array:
        """Prior probabilities in effect, shape (n_classes,), for the present `priors`.

        With an unknown state, those given that the true state is one of the classes.
        """
        return self._truth_priors()[0]

    @property
    def unknown_prior_(self) -> float:
        """Prior probability in effect of the unknown state; 0 if there is none.

        That of `priors`, or else the largest with which at most `unknown_rate` of the known
        recordings, each judged without its group, are decided to be unknown.
        """
        found, left = self._truth_priors()[1], self._calibration.left_out
        if left is None or self.unknown_rate is None:
            return found
        if states_unknown(self.priors, self.classes_, self.unknown):
            return found
        judged = np.isfinite(left.typicality)
        log_priors = np.log(np.maximum(self.priors_, np.finfo(np.float64).tiny))
        joint = left.log_densities[judged] / self.temperature_ + log_priors
        posterior, weight = np.exp(log_softmax(joint, axis=1)), left.weight[judged]
        model: Any = self  # its decisions and costs come from another base class
        number, cost = model.decisions_.tolist().index(self.unknown), model.cost_

        def rate(log_odds: float) -> float:
            """Return the share of known recordings that are decided to be unknown."""
            probability = unknown_probability(left.typicality[judged], 1 / (1 + np.exp(-log_odds)))
            known = (1 - probability)[:, np.newaxis] * posterior
            risks = np.column_stack([known, probability]) @ cost.T
            return float(weight @ (risks.argmin(axis=1) == number)) / weight.sum()

        low, high = -40.0, 40.0  # log odds; the rate increases with them
        for _ in range(40):
            middle = (low + high) / 2
            low, high = (middle, high) if rate(middle) <= self.unknown_rate else (low, middle)
        return float(1 / (1 + np.exp(-low)))

    @property
    def temperature_(self) -> float:
        """Temperature of the densities in effect."""
        check_temperature(self.temperature)  # it may have been set after `fit`
        if isinstance(self.temperature, str):
            return self._calibrated("temperature")
        return 1.0 if self.temperature is None else float(self.temperature)

    @property
    def distances_(self) -> Any:
        """The `ClassDistances` that `typicality` is based on."""
        return self._calibrated("typicality").distances

    @property
    def feature_range_(self) -> Array:
        """Smallest and largest training value of each feature, shape (2, n_features)."""
        return self._calibrated("typicality").feature_range

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
        return self._typicality(self._checked_features(X))

    @available_if(has_unknown)
    def unknown_proba(self, X, typicality=None):
        """Return the probability that the true state is unknown.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features.
        typicality : ndarray of shape (n_recordings,), default=None
            Result of `typicality`, if it is known; `X` is then not used.

        Returns
        -------
        probability : ndarray of shape (n_recordings,)
            From the typicality and `unknown_prior_`, by Bayes' rule.
        """
        if typicality is None:
            typicality = self.typicality(X)
        return unknown_probability(typicality, self.unknown_prior_)

    def _checked_features(self, X: Any) -> Array:
        raise NotImplementedError

    def _typicality(self, X: Any) -> Array:
        """Return the typicality of checked features."""
        found: Array = self._calibrated("typicality")(X)
        return found

    def _truth_priors(self) -> tuple[Array, float]:
        return truth_priors(self.priors, self.classes_, self.class_count_, self.unknown)

    def _calibrated(self, name: str) -> Any:
        """Return what was found by leaving groups out."""
        check_is_fitted(self)
        found = getattr(self._calibration, name)
        if found is None:
            raise ValueError(
                f"{name} is found by leaving groups out, which the last fit did not do. "
                f"Call fit with groups=, the labels of recordings that were measured together."
            )
        return found


@dataclass(frozen=True)
class DetectorTypicality:
    """Typicality from the scores of an outlier detector.

    Attributes
    ----------
    detector : estimator
        Fitted, with `score_samples`: the larger, the more like the training.
    tail : StudentTail
        Distribution of the negative scores of left-out recordings.
    """

    detector: Any
    tail: StudentTail

    def __call__(self, X: Any) -> Array:
        """Return the typicality of recordings, in (0, 1], shape (n_recordings,)."""
        return positive(self.tail.survival(_distances(self.detector, X)))


def left_out_gaussians(
    X: Array,
    codes: Indices,
    groups: ArrayLike,
    weight: Array,
    covariance: str,
    shrinkage: Any,
) -> Array:
    """Return the log densities of each recording under classes fitted without its group.

    Parameters
    ----------
    X : ndarray of shape (n_recordings, n_features)
        Features.
    codes, groups : ndarray of int, array-like of shape (n_recordings,)
        As for `emacm.calibration.left_out.left_out`.
    weight : ndarray of shape (n_recordings,)
        Number of times each recording is counted, positive.
    covariance, shrinkage : str and None, float or str
        As for `CostSensitiveGaussianBayes`. Singular covariances are raised to the floor.

    Returns
    -------
    ndarray of shape (n_recordings, n_classes)
        -inf for classes of which too few other recordings remain.
    """
    n_classes = int(codes.max()) + 1
    found = np.full((len(X), n_classes), -np.inf)
    for others, rows in left_out(codes, groups):
        some = X[others], codes[others]
        moments = class_moments(*some, n_classes, weight[others], covariance, shrinkage)
        seen = (moments.counts > 0) & (moments.divisors > 0)
        if seen.any():
            gaussians = class_gaussians(moments, covariance, shrinkage, some, floored=True)
            found[np.ix_(rows, seen)] = gaussians.log_densities(X[rows])[:, seen]
    return found


def calibrate_gaussians(
    X: Array,
    codes: Indices,
    groups: ArrayLike,
    weight: Array,
    kind: tuple[str, Any],
    *,
    temperature: bool,
    rate: bool,
) -> LeftOutCalibration:
    """Calibrate a classifier with Gaussian classes on left-out groups.

    Parameters
    ----------
    X, codes, groups, weight
        As for `left_out_gaussians`.
    kind : tuple of (covariance, shrinkage)
        Of the classifier.
    temperature, rate : bool
        Whether to determine the temperature, and whether `unknown_rate` is given.

    Returns
    -------
    LeftOutCalibration

    Raises
    ------
    ValueError
        If no class has recordings in two groups.
    """
    typicality = fit_typicality(X, codes, groups, weight)
    if not (temperature or rate):
        return LeftOutCalibration(typicality)
    logs = left_out_gaussians(X, codes, groups, weight, *kind)
    left = LeftOutDensities(typicality.left_out, logs, codes, weight)
    best = left.fit_temperature(int(codes.max()) + 1) if temperature else None
    return LeftOutCalibration(typicality, best, left if rate else None)


def calibrate_refits(
    X: Any,
    codes: Indices,
    groups: ArrayLike,
    weight: Array,
    log_likelihoods: Callable[[Indices, Indices], Array] | None,
    detector: Any,
    *,
    temperature: bool,
) -> LeftOutCalibration:
    """Calibrate any classifier on left-out groups, by fitting it again without each of them.

    Parameters
    ----------
    X : list of Recording, or table
        Recordings.
    codes, groups : ndarray of int, array-like of shape (n_recordings,)
        As for `emacm.calibration.left_out.left_out`.
    weight : ndarray of shape (n_recordings,)
        Number of times each recording is counted.
    log_likelihoods : callable or None
        ``log_likelihoods(others, rows)`` fits the classifier to some recordings and returns the
        logarithms of posterior over prior of others. None: they are not needed.
    detector : estimator or None
        Outlier detector that is not fitted yet.
    temperature : bool
        Whether to determine the temperature.

    Returns
    -------
    LeftOutCalibration

    Raises
    ------
    ValueError
        If no class has recordings in two groups.
    """

    def fitted(rows: Indices) -> Any:
        """Fit the detector to some recordings, with their weights if it accepts weights."""
        weighted = has_fit_parameter(detector, "sample_weight") and (weight != 1).any()
        options = {"sample_weight": weight[rows]} if weighted else {}
        with located("detector (its input is that of the estimator: recordings need a pipeline)"):
            return clone(detector).fit(chosen_rows(X, rows), **options)

    n_classes, counted = int(codes.max()) + 1, np.flatnonzero(weight > 0)
    logs = np.full((len(codes), n_classes), -np.inf)
    distances, judged = np.full(len(codes), np.nan), np.zeros(len(codes), dtype=bool)
    some = np.asarray(groups)[counted]
    for others, rows in left_out(codes[counted], some):
        others, rows = counted[others], counted[rows]
        seen = np.bincount(codes[others], minlength=n_classes) > 0
        if np.count_nonzero(seen) < min(2, n_classes):
            continue
        judged[rows] = seen[codes[rows]]
        if log_likelihoods is not None:
            logs[np.ix_(rows, seen)] = log_likelihoods(others, rows)
        if detector is not None:
            distances[rows] = _distances(fitted(others), chosen_rows(X, rows))
    check_judged(judged)
    typicality, found = None, np.full(len(codes), np.nan)
    if detector is not None:
        tail = student_tail(distances[judged], weight[judged])
        typicality = DetectorTypicality(fitted(counted), tail)
        found[judged] = positive(tail.survival(distances[judged]))
    left = LeftOutDensities(found, logs, codes, weight)
    best = left.fit_temperature(n_classes) if temperature else None
    return LeftOutCalibration(typicality, best, left if log_likelihoods is not None else None)


def _distances(detector: Any, X: Any) -> Array:
    """Return the negative scores of an outlier detector."""
    return -np.asarray(detector.score_samples(X), dtype=np.float64)
