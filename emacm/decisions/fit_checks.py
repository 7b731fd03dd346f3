"""Checks of the parameters and the input of `CostSensitiveGaussianBayes`."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.validation import column_or_1d

from emacm._checks import check_choice, check_number
from emacm.decisions.moments import ClassMoments, diagonals


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
    thin = (moments.divisors <= 0) & diagonals(moments.scatter).any(axis=1)
    if thin.any():
        raise ValueError(
            f"sample_weight is the number of times a recording is counted, and a covariance is "
            f"divided by their sum minus one, but {_named(thin, moments, classes)} has a total "
            f"weight of {moments.group_counts[thin].tolist()}. Multiply the weights by a constant."
        )
    useless = singular & (moments.group_counts > 0)
    if not useless.any():
        return
    what = f"The covariance of {_named(useless, moments, classes)} is singular"
    remedy = (
        'Use shrinkage="oas" or "auto", fewer features (by PCA), or more recordings, at least two '
        "per class."
    )
    if shrinkage is not None:
        raise ValueError(f"{what} with shrinkage={shrinkage!r}. {remedy}")
    warnings.warn(
        f"{what}; its eigenvalues were raised to 1e-9 of the largest feature variance. {remedy}",
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


Array = NDArray[np.float64]


def can_add_recordings(classifier: Any) -> bool:
    """Return True if `partial_fit` is available; otherwise an AttributeError states the reason."""
    if isinstance(classifier.shrinkage, str) and classifier.shrinkage == "auto":
        raise AttributeError(
            'partial_fit is not available with shrinkage="auto": Ledoit-Wolf needs fourth '
            "moments of the recordings, which are not kept. "
            'Use "oas" or a number, or fit all recordings at once.'
        )
    if classifier.unknown is not None or isinstance(classifier.temperature, str):
        raise AttributeError(
            'partial_fit is not available with unknown= or temperature="groups": both are found by '
            "leaving groups out, for which all recordings are needed at once. Use fit."
        )
    return True


def has_unknown(classifier: Any) -> bool:
    """Return True if there is an unknown state; otherwise an AttributeError states the remedy."""
    if classifier.unknown is None:
        raise AttributeError(
            'unknown_proba needs the label of an unknown state, such as unknown="unknown".'
        )
    return True


def warn_without_groups(groups: Any, *, stacklevel: int) -> None:
    """Warn if single recordings are left out."""
    if groups is None:
        warnings.warn(
            "fit was called without groups, so single recordings are left out. Recordings that "
            "were measured together (of one unit, in one run) are near-duplicates and make the "
            "model over-confident: give their labels, in a pipeline as "
            "costsensitivegaussianbayes__groups=units.",
            UserWarning,
            stacklevel=stacklevel + 1,
        )


def check_parameters(covariance: Any, shrinkage: Any, temperature: Any) -> None:
    """Raise if a parameter of `CostSensitiveGaussianBayes` is invalid."""
    check_choice(covariance, "covariance", ("full", "tied", "diag"))
    if isinstance(shrinkage, str):
        check_choice(shrinkage, "shrinkage as a word", ("oas", "auto"))
    elif shrinkage is not None:
        name = 'shrinkage, if not None, "oas" or "auto",'
        check_number(shrinkage, name, at_least=0, at_most=1)
    check_temperature(temperature)


def check_temperature(temperature: Any) -> None:
    """Raise if a temperature is neither None, "groups" nor a positive number."""
    if isinstance(temperature, str):
        check_choice(temperature, "temperature as a word", ("groups",))
    elif temperature is not None:
        check_number(temperature, 'temperature, if not None or "groups",', above=0)


def check_unknown_rate(rate: Any, unknown: Any) -> None:
    """Raise an error if the rate is no share, or there is no unknown state."""
    if rate is not None:
        check_number(rate, "unknown_rate", above=0, below=1)
        if unknown is None:
            raise ValueError('unknown_rate needs the label of an unknown state: unknown="unknown".')


def as_counts(weight: Array, shrinkage: Any) -> Array:
    """Return weights as counts; those whose sum is 1 are relative. "auto" needs counts of 1."""
    counts = weight * len(weight) if np.isclose(weight.sum(), 1, rtol=1e-9) else weight
    if shrinkage == "auto" and not np.allclose(counts, 1, rtol=1e-9):
        raise ValueError(
            'shrinkage="auto" cannot be used with sample weights other than 1: Ledoit-Wolf '
            "needs fourth moments of the recordings, for which weights have no meaning. "
            'Use "oas" or a number.'
        )
    return counts


def agreed_classes(classes: ArrayLike | None, known: NDArray[Any] | None) -> NDArray[Any]:
    """Return the classes of all calls of `partial_fit`."""
    if classes is None:
        if known is None:
            raise ValueError("classes must be given in the first call of partial_fit.")
        return known
    labels = np.unique(column_or_1d(classes))
    if known is not None and not np.array_equal(labels, known):
        raise ValueError(
            f"classes must be the same in every call of partial_fit: got {labels.tolist()}, "
            f"previously {known.tolist()}."
        )
    return labels
