"""Gaussian densities of the classes without one group of recordings, from moments.

An unbiased assessment of a recording requires a model that was fitted without it, and without those
that were measured together with it. The moments of the remaining recordings are those of all
recordings minus those of the group: neither features nor moments are computed again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm.decisions.gaussians import FLOOR, GaussianClasses, fit_gaussians
from emacm.decisions.moments import ClassMoments, class_moments, diagonals
from emacm.decisions.shrinkage import ledoit_wolf_coefficient, oas_coefficient

Array = NDArray[np.float64]

MAX_PARTS = 64  # parts of the recordings that are left out in turn, if no groups are given
_FAR = 1e6  # squared shift of a mean, in standard deviations, above which expansions lose digits
_CANCELLED = 1e-7  # remaining fraction of a scatter below which a difference is too inaccurate


@dataclass(frozen=True)
class Training:
    """Recordings to which densities are fitted, all of positive weight.

    Attributes
    ----------
    X : ndarray of shape (n_recordings, n_features)
        Features.
    codes, groups : ndarray of int, shape (n_recordings,)
        Number of the class, and of the group, of each recording.
    weight : ndarray of shape (n_recordings,)
        Number of times each recording is counted.
    n_classes : int
        Number of classes.
    """

    X: Array
    codes: NDArray[np.intp]
    groups: NDArray[np.intp]
    weight: Array
    n_classes: int

    def take(self, rows: NDArray[Any]) -> Training:
        """Return some of the recordings."""
        of_rows = self.X[rows], self.codes[rows], self.groups[rows], self.weight[rows]
        return Training(*of_rows, self.n_classes)

    def moments(self, *, pooled: bool, variances_only: bool = False) -> ClassMoments:
        """Return the moments of the classes, see `class_moments`."""
        return class_moments(
            self.X,
            self.codes,
            self.n_classes,
            sample_weight=self.weight,
            pooled=pooled,
            variances_only=variances_only,
        )


@dataclass(frozen=True)
class LeftOut:
    """Densities without one group.

    Attributes
    ----------
    rows : ndarray of int, shape (n_group,)
        Recordings of the group.
    gaussians : GaussianClasses
        Fitted to all other recordings.
    seen : ndarray of bool, shape (n_classes,)
        Classes of which enough other recordings remain.
    """

    rows: NDArray[np.intp]
    gaussians: GaussianClasses
    seen: NDArray[np.bool_]


def left_out_gaussians(training: Training, covariance: str, shrinkage: Any) -> list[LeftOut]:
    """Fit Gaussian densities without each group in turn.

    The result equals that of separate fits without each group, except for rounding.

    Parameters
    ----------
    training : Training
        The recordings.
    covariance, shrinkage : str and None, float or str
        As for `CostSensitiveGaussianBayes`. Singular covariances are raised to the floor.

    Returns
    -------
    list of LeftOut
        One for each group whose removal leaves enough recordings for a covariance.
    """
    residuals = _Residuals(training, covariance, shrinkage)
    order = np.argsort(training.groups, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(training.groups[order])) + 1)
    found = (residuals.gaussians_without(rows) for rows in parts)
    return [part for part in found if part.seen.any()]


def all_gaussians(training: Training, covariance: str, shrinkage: Any) -> GaussianClasses:
    """Fit Gaussian densities to all recordings, as `left_out_gaussians` does without some.

    Parameters
    ----------
    training, covariance, shrinkage
        As for `left_out_gaussians`.

    Returns
    -------
    GaussianClasses
    """
    residuals = _Residuals(training, covariance, shrinkage)
    return residuals.gaussians_without(np.empty(0, dtype=int)).gaussians


def group_numbers(groups: ArrayLike | None, X: Array, codes: NDArray[np.intp]) -> NDArray[np.intp]:
    """Assign numbers to groups; without groups to single recordings, equal ones together.

    Without groups, the recordings of each class are divided evenly among at most 64 parts, to
    limit the computing time; up to 64 different recordings are left out one by one.

    Parameters
    ----------
    groups : array-like of shape (n_recordings,) or None
        Labels of recordings that were measured together.
    X : ndarray of shape (n_recordings, n_features)
        Features.
    codes : ndarray of int, shape (n_recordings,)
        Number of the class of each recording.

    Returns
    -------
    ndarray of int, shape (n_recordings,)

    Raises
    ------
    ValueError
        If there is not one group for each recording.

    Examples
    --------
    >>> group_numbers(["b", "a", "b"], np.zeros((3, 1)), np.zeros(3, int))
    array([0, 1, 0])
    >>> group_numbers(None, np.array([[4.0], [3.0], [4.0]]), np.zeros(3, int))
    array([1, 0, 1])
    """
    if groups is None:
        table = np.column_stack([codes, X])
        return np.unique(table, axis=0, return_inverse=True)[1].ravel() % MAX_PARTS
    labels = pd.Series(groups)
    if len(labels) != len(X):
        raise ValueError(
            f"groups must have one label for each of the {len(X)} recordings, got {len(labels)}."
        )
    numbers, _ = pd.factorize(labels)
    if (numbers < 0).any():
        raise ValueError(
            f"groups must have a label for every recording; that of recording "
            f"{int(np.argmax(numbers < 0))} is missing."
        )
    return numbers


class _Residuals:
    """Deviations of the recordings from the mean of their class, and what follows without groups.

    Attributes
    ----------
    moments : ClassMoments
        Of all recordings.
    """

    def __init__(self, training: Training, covariance: str, shrinkage: Any):
        self._training, self._diagonal, self._shrinkage = training, covariance == "diag", shrinkage
        # Products of two features determine the shrinkage of their variances too.
        only = self._diagonal and shrinkage not in ("oas", "auto")
        self._kind = {"pooled": covariance == "tied", "variances_only": only}
        self.moments = training.moments(**self._kind)
        self._values = training.X - self.moments.means[training.codes]
        self._squares = self._values**2

    def gaussians_without(self, rows: NDArray[np.intp]) -> LeftOut:
        """Return the densities of all recordings but some."""
        moments = self.without(rows)
        coefficients: tuple[Array, ...]
        if self._shrinkage == "auto":
            coefficients = self.ledoit_wolf(moments, rows)
        elif self._shrinkage == "oas":
            pairs = zip(moments.scatter, moments.group_counts, strict=True)
            coefficients = (np.array([oas_coefficient(*pair) for pair in pairs]),)
        else:
            coefficients = (np.array([float(self._shrinkage or 0.0)]),)
        floor = FLOOR * moments.feature_variances.max() if moments.counts.any() else None
        gaussians = fit_gaussians(moments, *coefficients, diagonal=self._diagonal, floor=floor)
        return LeftOut(rows, gaussians, (moments.counts > 0) & (moments.divisors > 0))

    def without(self, rows: NDArray[np.intp]) -> ClassMoments:
        """Return the moments of all recordings but some.

        Without rows r of a class, of weights w, the mean moves by ``-sum(w r) / n``, where n counts
        the remaining recordings, and the scatter loses ``sum(w r r') + sum(w r) sum(w r)' / n``.
        """
        before, codes = self.moments, self._training.codes[rows]
        weight, values = self._training.weight[rows, np.newaxis], self._values[rows]
        member = (codes == np.arange(len(before.counts))[:, np.newaxis]).astype(float)
        counts = before.counts - member @ weight[:, 0]
        counts[counts <= 1e-9 * before.counts] = 0.0
        seen = (counts > 0)[:, np.newaxis]
        sums = member @ (weight * values)
        moved = np.divide(sums, counts[:, np.newaxis], out=np.zeros_like(sums), where=seen)
        scatter = before.scatter.copy()
        if scatter.ndim == 2:
            lost = member @ (weight * values**2) + sums * moved
            scatter -= lost.sum(axis=0) if before.pooled else lost
        else:
            for group in range(len(scatter)):
                chosen, classes = (slice(None),) * 2 if before.pooled else (codes == group, [group])
                scatter[group] -= (weight[chosen] * values[chosen]).T @ values[chosen]
                scatter[group] -= sums[classes].T @ moved[classes]
        means = np.where(seen, before.means - moved, 0.0)
        found = ClassMoments(counts, means, scatter, before.pooled)
        left = diagonals(scatter) < _CANCELLED * diagonals(before.scatter)
        if left[found.group_counts > 0].any():  # rounding errors dominate the difference
            others = np.setdiff1d(np.arange(len(self._values)), rows)
            return self._training.take(others).moments(**self._kind)
        return found

    def ledoit_wolf(self, moments: ClassMoments, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Return coefficients and squared scales of all recordings but some.

        As `ledoit_wolf_coefficients` does, from their moments and the norms of the deviations.
        """
        weight, codes = self._training.weight.copy(), self._training.codes
        weight[rows] = 0.0
        counts = moments.group_counts
        variances = diagonals(moments.scatter) / np.maximum(counts, 1e-300)[:, np.newaxis]
        variances = np.where(variances > 0, variances, 1.0)
        coefficients, moved = np.zeros(len(counts)), moments.means - self.moments.means
        for group in np.flatnonzero(counts):
            chosen = slice(None) if moments.pooled else codes == group
            norms, scatter = self._norms(chosen, moved, variances[group], moments.scatter[group])
            fourth = float(weight[chosen] @ norms**2)
            coefficients[group] = ledoit_wolf_coefficient(scatter, counts[group], fourth)
        return coefficients, variances

    def _norms(self, chosen: Any, moved: Array, variances: Array, scatter: Array) -> Any:
        """Return squared norms of standardised deviations from moved means, and their scatter."""
        inverse, codes = 1 / variances, self._training.codes[chosen]
        shifts = moved**2 @ inverse
        scale = np.sqrt(inverse)
        values = self._values[chosen]
        if scatter.ndim == 2 and (shifts < _FAR).all():
            products = values @ (moved * inverse).T
            norms = self._squares[chosen] @ inverse + shifts[codes]
            norms -= 2 * np.take_along_axis(products, codes[:, np.newaxis], 1)[:, 0]
            return norms, scatter * scale * scale[:, np.newaxis]
        scaled = (values - moved[codes]) * scale
        norms = np.einsum("rf,rf->r", scaled, scaled)
        return norms, scatter * scale * scale[:, np.newaxis]
