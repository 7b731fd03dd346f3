"""Calibration on left-out groups: typicality, and the temperature of posteriors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sklearn.utils.metaestimators import available_if
from sklearn.utils.validation import check_is_fitted

from emacm.decisions.fit_checks import check_temperature, has_unknown
from emacm.decisions.gaussians import GaussianClasses
from emacm.decisions.left_out import Remaining, Training
from emacm.decisions.moments import ClassMoments
from emacm.decisions.temperature import fit_temperature
from emacm.decisions.truths import truth_priors
from emacm.decisions.typicality import fit_typicality
from emacm.decisions.unknown import unknown_probability

Array = NDArray[np.float64]

_SHRINKAGE = "auto"  # of the covariance of the distances


class LeftOutCalibration(NamedTuple):
    """Results of leaving out each group in turn.

    Attributes
    ----------
    typicality : Typicality, DetectorTypicality or None
        A function of features. None before anything was left out.
    temperature : float or None
        Temperature of least log loss; None if it was not requested.
    """

    typicality: Callable[[Any], Array] | None
    temperature: float | None


class LeftOutMixin:
    """Typicality, unknown state and temperature of a classifier with a `LeftOutCalibration`."""

    classes_: NDArray[Any]
    class_count_: Array
    priors: Any
    unknown: Any
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
        """Prior probability in effect of the unknown state; 0 if there is none."""
        return self._truth_priors()[1]

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


def calibrate(
    training: Training,
    moments: ClassMoments,
    gaussians: GaussianClasses,
    covariance: str,
    shrinkage: Any,
    *,
    temperature: bool,
) -> LeftOutCalibration:
    """Calibrate a classifier with Gaussian classes on left-out groups.

    Parameters
    ----------
    training : Training
        The recordings.
    moments : ClassMoments
        Of all of them, as for `gaussians`.
    gaussians : GaussianClasses
        Densities of the classifier, fitted to all of them.
    covariance, shrinkage : str and None, float or str
        Of the classifier.
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
    # In the order of the groups, which are then not copied. Expanded squares need an origin among
    # the features; the value next to 0 loses no digits, unlike means that one recording may shift.
    training = training.take(np.argsort(training.groups, kind="stable"))
    origin = np.clip(0.0, training.X.min(axis=0), training.X.max(axis=0))
    moved = replace(training, X=training.X - origin)
    remaining = Remaining(moved, replace(moments, means=moments.means - origin))
    left_out = remaining.left_out_gaussians(_SHRINKAGE)
    if (covariance, shrinkage) != ("tied", _SHRINKAGE):
        gaussians = replace(remaining.all_gaussians(_SHRINKAGE), means=moments.means)
    distances = fit_typicality(training, gaussians, left_out)
    if not temperature:
        return LeftOutCalibration(distances, None)
    log_densities = remaining.log_densities(covariance, shrinkage)
    return LeftOutCalibration(distances, _temperature(training, log_densities))


def _temperature(training: Training, log_densities: Array) -> float:
    judged = np.isfinite(log_densities[np.arange(len(training.X)), training.codes])
    if not judged.any():
        raise ValueError(
            "no class has enough recordings in two groups, so that no recording can be judged by "
            "others of its class. Give groups= with at least two groups in one class, or a number "
            "as temperature."
        )
    codes, weight = training.codes[judged], training.weight[judged]
    counts = np.bincount(training.codes, training.weight, training.n_classes)
    return fit_temperature(log_densities[judged], codes, weight, counts / counts.sum())
