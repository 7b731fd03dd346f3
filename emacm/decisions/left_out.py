"""Gaussian densities of the classes without one group of recordings, from moments.

An unbiased assessment of a recording requires a model that was fitted without it, and without those
that were measured together with it. The moments of the remaining recordings are those of all
recordings minus those of the group: neither features nor moments are computed again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg.blas import dtrsm
from scipy.linalg.lapack import dpotrs

from emacm._checks import group_codes
from emacm.decisions.gaussians import (
    FAR,
    FLOOR,
    GaussianClasses,
    cholesky_root,
    fit_gaussians,
    shrunk_covariances,
    solved_log_densities,
)
from emacm.decisions.left_out_moments import RemainingMoments, Training, of_rows
from emacm.decisions.left_out_products import ClassProducts
from emacm.decisions.moments import ClassMoments
from emacm.decisions.shrinkage import oas_coefficient

Array = NDArray[np.float64]

MAX_PARTS = 64  # parts of the recordings that are left out in turn, if no groups are given


@dataclass(frozen=True)
class LeftOut:
    """Classes with one covariance, without one group.

    Attributes
    ----------
    rows : ndarray of int, shape (n_group,)
        Recordings of the group.
    X : ndarray of shape (n_group, n_features)
        Their features.
    means : ndarray of shape (n_classes, n_features)
        Mean of each class, of all other recordings.
    variances : ndarray of shape (n_features,)
        Diagonal of the covariance within the classes, of all other recordings.
    root : ndarray of shape (n_features, n_features)
        Lower triangular L with L L' = the covariance.
    seen : ndarray of bool, shape (n_classes,)
        Classes of which enough other recordings remain.
    """

    rows: NDArray[np.intp]
    X: Array
    means: Array
    variances: Array
    root: Array
    seen: NDArray[np.bool_]


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
    return group_codes(groups, len(X))


class Remaining:
    """Densities of the recordings that remain without a group.

    They equal those of separate fits without each group, except for rounding.

    Parameters
    ----------
    training : Training
        The recordings.
    moments : ClassMoments
        Of all of them, of any kind.
    """

    def __init__(self, training: Training, moments: ClassMoments):
        self._training, self._moments = training, moments
        self._left = RemainingMoments(training, moments)
        self._rows = self._left.rows
        self._tables: dict[int, Array] = {}
        self._floors: dict[int, float] = {}

    def all_gaussians(self, shrinkage: Any) -> GaussianClasses:
        """Return densities with one covariance for all classes, of all recordings."""
        moments = self._left.without(None)
        floor = FLOOR * moments.feature_variances.max()
        return fit_gaussians(moments, *self._left.target(moments, None, shrinkage), floor=floor)

    def left_out_gaussians(self, shrinkage: Any) -> Iterator[LeftOut]:
        """Yield classes with one covariance for all of them, without each group in turn.

        Parameters
        ----------
        shrinkage : None, float or str
            As for `CostSensitiveGaussianBayes`. Singular covariances are raised to the floor.

        Yields
        ------
        LeftOut
            One for each group whose removal leaves enough recordings for a covariance.
        """
        for group, rows in self._rows.items():
            moments = self._moments_without(group, shrinkage)
            seen = (moments.counts > 0) & (moments.divisors > 0)
            if not seen.any():
                continue
            scatter, scales, coefficient = self._left.standardised(moments, group, shrinkage)
            covariance = scatter * ((1 - coefficient) / moments.divisors)
            target = coefficient * np.trace(scatter) / len(scatter) / moments.divisors
            variances = covariance.ravel()[:: len(covariance) + 1]
            variances += target
            root = cholesky_root(covariance, target[0] / (variances.max() or 1.0))
            if root is None:
                scaled = covariance * np.multiply.outer(scales, scales)
                root = _floored_root(scaled, self._floor(group))
            else:
                root *= scales[:, np.newaxis]
            X = self._features(group)
            yield LeftOut(rows, X, moments.means, variances * scales**2, root, seen)

    def log_densities(self, covariance: str, shrinkage: Any) -> Array:
        """Return the log densities of each recording without its group.

        Parameters
        ----------
        covariance, shrinkage : str and None, float or str
            As for `CostSensitiveGaussianBayes`. Singular covariances are raised to the floor.

        Returns
        -------
        ndarray of shape (n_recordings, n_classes)
            -inf for classes of which too few other recordings remain. With one covariance, less the
            square of the recording, which is the same for all classes.
        """
        training, kind = self._training, (covariance, shrinkage)
        found = np.full((len(training.X), training.n_classes), -np.inf)
        classes = range(training.n_classes)
        if covariance == "tied":
            for part in self.left_out_gaussians(shrinkage):
                found[np.ix_(part.rows, np.flatnonzero(part.seen))] = _relative_log_densities(part)
        elif covariance == "full" or kind == ("diag", "auto"):
            for code in classes:  # one by one, so that a matrix stays in the cache
                self._judge_class(found, code, kind)
        else:
            coefficients: Array | list[None] = [None] * len(self._rows)
            if kind == ("diag", "oas"):
                coefficients = np.column_stack([self._oas_coefficients(code) for code in classes])
            for group, target in zip(self._rows, coefficients, strict=True):
                self._judge(found, np.arange(training.n_classes), self, group, kind, target)
        return found

    def _judge_class(self, found: Array, code: int, kind: tuple[str, Any]) -> None:
        """Find the log densities of a class whose covariance is its own."""
        training, part, (_, shrinkage) = self._training, None, kind
        products = None if shrinkage == "auto" else self._products(code)
        if products and shrinkage == "oas":
            coefficients = products.oas_coefficients()
        else:
            coefficients = np.full(len(self._rows), 0.0 if products is None else shrinkage or 0.0)
        for place, (group, rows) in enumerate(self._rows.items()):
            logs = None
            if products and products.usable[place]:
                moments = self._left.without(group, variances_only=True)
                deviations = self._features(group) - moments.means[code]
                if coefficients[place] > 0:
                    logs = products.shrunk_log_densities(place, coefficients[place], deviations)
                else:
                    logs = products.floored_log_densities(place, self._floor(group), deviations)
            if logs is None:
                part = part or _of_class(training, code)
                self._judge(found, np.array([code]), part, group, kind)
            else:
                found[rows, code] = logs

    def _moments_without(self, group: int, shrinkage: Any, **kind: bool) -> ClassMoments:
        """Return the moments without a group, not as a difference where a covariance is singular.

        Shrinkage makes it regular, whatever the rounding.
        """
        training = self._training
        n_remaining = len(training.X) - len(self._rows.get(group, ()))
        singular = n_remaining <= training.X.shape[1] + training.n_classes
        return self._left.without(group, **kind, anew=singular and not shrinkage)

    def _features(self, group: int) -> Array:
        """Return the features of a group."""
        if group not in self._tables:
            self._tables[group] = of_rows(self._training.X, self._rows[group])
        return self._tables[group]

    def _oas_coefficients(self, code: int) -> Array:
        """Return the coefficient of shrinkage of a class without each group."""
        products, groups, left = self._products(code), list(self._rows), None
        found = products.oas_coefficients() if products else np.zeros(len(groups))
        for place in range(len(groups)):
            if not (products and products.usable[place]):
                left = left or _of_class(self._training, code)._left
                remaining = left.without(groups[place])
                count = float(remaining.group_counts[0])
                found[place] = oas_coefficient(remaining.scatter[0], count)
        return found

    def _products(self, code: int) -> ClassProducts | None:
        """Return the inner products of a class, or None if a covariance is smaller than they."""
        training = self._training
        own = np.flatnonzero(training.codes == code)
        if len(own) > training.X.shape[1]:
            return None
        of_class = self._left.deviations[own], training.weight[own], training.groups[own]
        return ClassProducts(*of_class, list(self._rows))

    def _judge(
        self,
        found: Array,
        columns: NDArray[np.intp],
        part: Remaining,
        group: int,
        kind: tuple[str, Any],
        coefficients: Array | None = None,
    ) -> None:
        """Find the log densities of a group under some classes, whose recordings are a part."""
        (covariance, shrinkage), rows = kind, self._rows[group]
        variances_only = covariance == "diag" and part is self
        which = {"pooled": not variances_only, "variances_only": variances_only}
        moments = part._moments_without(group, shrinkage, **which)
        seen = moments.divisors > 0
        if not seen.any():
            return
        target: tuple[ArrayLike, ...]
        if coefficients is not None:
            target = (coefficients,)
        else:
            target = part._left.target(moments, group, shrinkage)
        diagonal = covariance == "diag"
        shrunk, least = shrunk_covariances(moments, *target, diagonal=diagonal)
        shrunk = shrunk if moments.pooled else shrunk[seen]
        X = self._features(group)
        logs = solved_log_densities(X, moments.means[seen], shrunk, least)
        if logs is None:  # singular
            lifted = fit_gaussians(moments, *target, diagonal=diagonal, floor=self._floor(group))
            logs = lifted.log_densities(X)[:, seen]
        found[rows[:, np.newaxis], columns[seen]] = logs

    def _floor(self, group: int) -> float:
        if group not in self._floors:
            moments = self._left.without(group, variances_only=True)
            self._floors[group] = FLOOR * float(moments.feature_variances.max())
        return self._floors[group]


def _relative_log_densities(part: LeftOut) -> Array:
    """Return log densities of a group, less a term of each recording, of classes that are seen."""
    means, root = part.means[part.seen], part.root.T  # the transposes are not copied
    solved, _ = dpotrs(root, means.T)
    norms = np.einsum("kf,fk->k", means, solved)
    if norms.max() < FAR:
        logs: Array = part.X @ solved - norms / 2
        return logs
    X, means = (dtrsm(1.0, root, rows.T, trans_a=1).T for rows in (part.X, means))
    return np.array([np.square(X - mean).sum(axis=1) for mean in means]).T / -2


def _floored_root(covariance: Array, floor: float) -> Array:
    """Return the lower triangular root of a covariance whose eigenvalues are raised to a floor."""
    eigenvalues, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(eigenvalues, floor))
    triangular: Array = np.linalg.qr(root.T)[1].T
    return triangular


def _of_class(training: Training, code: int) -> Remaining:
    rows = np.flatnonzero(training.codes == code)
    codes = np.zeros(len(rows), dtype=np.intp)
    only = Training(training.X[rows], codes, training.groups[rows], training.weight[rows], 1)
    return Remaining(only, only.moments(pooled=True))
