"""Gaussian densities of the classes without one group of recordings, from moments.

An unbiased assessment of a recording requires a model that was fitted without it, and without those
that were measured together with it. The moments of the remaining recordings are those of all
recordings minus those of the group: neither features nor moments are computed again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm._checks import group_codes
from emacm.decisions.gaussians import (
    FLOOR,
    GaussianClasses,
    fit_gaussians,
    shrunk_covariances,
    solved_log_densities,
)
from emacm.decisions.moments import ClassMoments, class_moments, diagonals
from emacm.decisions.shrinkage import ledoit_wolf_coefficient, oas_coefficient

Array = NDArray[np.float64]

MAX_PARTS = 64  # parts of the recordings that are left out in turn, if no groups are given
_BLOCK = 256  # recordings at a time, whose deviations stay in the cache
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
        self._values = training.X - moments.means[training.codes]
        self._groups = np.unique(training.groups)
        self._without: dict[int, ClassMoments] = {}
        self._scatter = moments.scatter
        if not moments.pooled:
            scaled = self._values * np.sqrt(training.weight)[:, np.newaxis]
            self._scatter = (scaled.T @ scaled)[np.newaxis]

    def all_gaussians(self, shrinkage: Any) -> GaussianClasses:
        """Return densities with one covariance for all classes, of all recordings."""
        moments = ClassMoments(self._moments.counts, self._moments.means, self._scatter, True)
        return self._gaussians(moments, None, shrinkage)

    def left_out_gaussians(self, shrinkage: Any) -> list[LeftOut]:
        """Return densities with one covariance for all classes, without each group in turn.

        Parameters
        ----------
        shrinkage : None, float or str
            As for `CostSensitiveGaussianBayes`. Singular covariances are raised to the floor.

        Returns
        -------
        list of LeftOut
            One for each group whose removal leaves enough recordings for a covariance.
        """
        found = []
        for group in self._groups:
            moments = self._without[group] = self.without(group)
            seen = (moments.counts > 0) & (moments.divisors > 0)
            if seen.any():
                rows = np.flatnonzero(self._training.groups == group)
                found.append(LeftOut(rows, self._gaussians(moments, group, shrinkage), seen))
        return found

    def log_densities(self, covariance: str, shrinkage: Any) -> Array:
        """Return the log densities of each recording without its group.

        Parameters
        ----------
        covariance, shrinkage : str and None, float or str
            As for `CostSensitiveGaussianBayes`. Singular covariances are raised to the floor.

        Returns
        -------
        ndarray of shape (n_recordings, n_classes)
            -inf for classes of which too few other recordings remain.
        """
        training, diagonal = self._training, covariance == "diag"
        found = np.full((len(training.X), training.n_classes), -np.inf)
        products = covariance == "full" or shrinkage in ("oas", "auto")  # of two features
        parts = [(np.arange(training.n_classes), self)]
        if covariance != "tied" and products:
            parts = [
                (np.array([code]), _of_class(training, code)) for code in range(training.n_classes)
            ]
        members = [np.flatnonzero(training.groups == group) for group in self._groups]
        for columns, part in parts:  # one class after the other: a single matrix stays in the cache
            for group, rows in zip(self._groups, members, strict=True):
                moments = part.without(group, variances_only=diagonal and not products)
                seen = (moments.counts > 0) & (moments.divisors > 0)
                if not seen.any():
                    continue
                target = part._target(moments, group, shrinkage)
                shrunk, least = shrunk_covariances(moments, *target, diagonal=diagonal)
                shrunk, X = shrunk if moments.pooled else shrunk[seen], training.X[rows]
                logs = solved_log_densities(X, moments.means[seen], shrunk, least)
                if logs is None:  # singular
                    floor = FLOOR * self.without(group).feature_variances.max()
                    lifted = fit_gaussians(moments, *target, diagonal=diagonal, floor=floor)
                    logs = lifted.log_densities(X)[:, seen]
                found[rows[:, np.newaxis], columns[seen]] = logs
        return found

    def without(self, group: int, *, variances_only: bool = False) -> ClassMoments:
        """Return the moments of all recordings but those of a group.

        Without rows r of a class, of weights w, the mean moves by ``-sum(w r) / n``, where n counts
        the remaining recordings, and the scatter loses ``sum(w r r') + sum(w r) sum(w r)' / n``.

        Parameters
        ----------
        group : int
            Number of the group.
        variances_only : bool, default=False
            The variances of each class, instead of one scatter matrix for all classes.
        """
        if group in self._without and not variances_only:
            return self._without[group]
        training = self._training
        rows = np.flatnonzero(training.groups == group)
        values, weight = self._values[rows], training.weight[rows, np.newaxis]
        member = (training.codes[rows] == np.arange(training.n_classes)[:, np.newaxis]) * 1.0
        before = self._moments.counts
        counts = before - member @ weight[:, 0]
        counts[counts <= 1e-9 * before] = 0.0
        seen = (counts > 0)[:, np.newaxis]
        sums = member @ (weight * values)
        roots = np.sqrt(counts)[:, np.newaxis]
        moved = np.divide(sums, roots, out=np.zeros_like(sums), where=seen)
        if variances_only:
            total = diagonals(self._moments.scatter)
            scatter = total - member @ (weight * values**2) - moved**2
        else:
            lost = np.vstack([np.sqrt(weight) * values, moved])
            total, scatter = diagonals(self._scatter), self._scatter - lost.T @ lost
        moved = np.divide(moved, roots, out=moved, where=seen)
        means = np.where(seen, self._moments.means - moved, 0.0)
        moments = ClassMoments(counts, means, scatter, not variances_only)
        left = diagonals(scatter) < _CANCELLED * total
        if left[moments.group_counts > 0].any():  # rounding errors dominate the difference
            others = training.take(training.groups != group)
            moments = others.moments(pooled=not variances_only, variances_only=variances_only)
        return moments

    def _gaussians(
        self, moments: ClassMoments, group: int | None, shrinkage: Any
    ) -> GaussianClasses:
        floor = FLOOR * moments.feature_variances.max()
        return fit_gaussians(moments, *self._target(moments, group, shrinkage), floor=floor)

    def _target(
        self, moments: ClassMoments, group: int | None, shrinkage: Any
    ) -> tuple[ArrayLike, ...]:
        """Return the arguments of `shrink` for all recordings but those of a group.

        For "auto" as `ledoit_wolf_coefficients`, from moments and the norms of the deviations.
        """
        count, scatter = float(moments.group_counts[0]), moments.scatter[0]
        if shrinkage == "oas":
            return (oas_coefficient(scatter, count),)
        if shrinkage != "auto":
            return (float(shrinkage or 0.0),)
        variances = np.diagonal(scatter) / count
        variances = np.where(variances > 0, variances, 1.0)
        weight = np.where(self._training.groups == group, 0.0, self._training.weight)
        fourth = float(weight @ self._norms(moments.means, 1 / variances) ** 2)
        scaled = scatter / np.sqrt(variances)
        scaled /= np.sqrt(variances)[:, np.newaxis]
        return ledoit_wolf_coefficient(scaled, count, fourth), variances

    def _norms(self, means: Array, inverse: Array) -> Array:
        """Return squared norms of the standardised deviations from moved means."""
        codes, moved = self._training.codes, means - self._moments.means
        norms = np.empty(len(codes))
        for start in range(0, len(codes), _BLOCK):
            part = slice(start, start + _BLOCK)
            deviations = self._values[part] - np.take(moved, codes[part], axis=0)
            norms[part] = np.square(deviations, out=deviations) @ inverse
        return norms


def _of_class(training: Training, code: int) -> Remaining:
    rows = np.flatnonzero(training.codes == code)
    codes = np.zeros(len(rows), dtype=np.intp)
    only = Training(training.X[rows], codes, training.groups[rows], training.weight[rows], 1)
    return Remaining(only, only.moments(pooled=True))
