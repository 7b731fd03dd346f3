"""Checks of fitted densities: singular covariances, classes without recordings."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm.decisions.gaussians import FLOOR
from emacm.decisions.moments import ClassMoments, diagonals

_FEWER = "Use fewer features (by PCA), or more recordings, at least two per class."
_REMEDY = 'Use shrinkage="oas" or "auto", fewer features (by PCA), or more recordings.'


def check_densities(
    moments: ClassMoments,
    singular: NDArray[np.bool_],
    classes: NDArray[Any],
    shrinkage: Any,
    *,
    stacklevel: int,
) -> None:
    """Raise or warn if a covariance cannot be used.

    Parameters
    ----------
    moments : ClassMoments
        Moments of the classes.
    singular : ndarray of bool, shape (n_groups,)
        Of `GaussianClasses`.
    classes : ndarray of shape (n_classes,)
        The classes.
    shrinkage : None, float or str
        As for `CostSensitiveGaussianBayes`.
    stacklevel : int
        Of the warning, counted from this function.

    Raises
    ------
    ValueError
        If no feature varies, weights count less than two recordings, or a covariance is singular
        with `shrinkage`.

    Warns
    -----
    UserWarning
        If a covariance was singular and its eigenvalues were raised to the floor.
    """
    if not moments.feature_variances.max() > 0:
        raise ValueError(
            "The largest variance of the features is 0: all recordings have the same features, so "
            "classes cannot be separated. Check the features."
        )
    scattered = diagonals(moments.scatter).any(axis=1)
    thin = (moments.divisors <= 0) & scattered
    if thin.any():
        raise ValueError(
            f"sample_weight is the number of times a recording is counted, and a covariance is "
            f"divided by their sum minus one, but {_named(thin, moments, classes)} has a total "
            f"weight of {moments.group_counts[thin].tolist()}. Multiply the weights by a constant."
        )
    useless = singular & (moments.group_counts > 0)
    if useless.any() and shrinkage is not None:
        raise ValueError(
            f"The covariance of {_named(useless, moments, classes)} is singular with "
            f"shrinkage={shrinkage!r}. {_FEWER if shrinkage in ('oas', 'auto') else _REMEDY}"
        )
    if useless.any():
        warnings.warn(
            f"The covariance of {_named(useless, moments, classes)} is singular; its eigenvalues "
            f"were raised to {FLOOR:g} of the largest feature variance. {_REMEDY}",
            UserWarning,
            stacklevel=stacklevel + 1,
        )


def check_seen(
    priors: NDArray[np.float64], counts: NDArray[np.float64], classes: NDArray[Any]
) -> None:
    """Raise a ValueError if a class has a prior, but no recordings."""
    unseen = (priors > 0) & ~(counts > 0)
    if unseen.any():
        raise ValueError(
            f"priors are given, but class {classes[unseen].tolist()} has had no recordings yet. "
            f"Call partial_fit with recordings of it, or use priors=None, which gives it the "
            f"prior 0."
        )


def _named(groups: NDArray[np.bool_], moments: ClassMoments, classes: NDArray[Any]) -> str:
    if moments.pooled:
        return "all classes"
    return "class " + ", ".join(repr(label) for label in classes[groups].tolist())
