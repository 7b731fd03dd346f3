"""Moments of recordings without one group, and the coefficients of shrinkage they give.

Neither features nor moments are computed again: those of the remaining recordings are those of all
recordings minus those of the group.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csc_array

from emacm.decisions.moments import ClassMoments, class_moments, diagonals
from emacm.decisions.shrinkage import ledoit_wolf_coefficient, oas_coefficient

Array = NDArray[np.float64]

AT_ONCE = 16  # groups whose matrices are kept, and that are standardised at once
_CANCELLED = 1e-7  # remaining fraction of a scatter below which a difference is too inaccurate
_FAR = 1e4  # squared shift of means per feature, in variances, above which squares lose digits


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


def of_rows(table: Array, rows: NDArray[np.intp]) -> Array:
    """Return some rows of a table, in ascending order; without a copy if they are neighbours."""
    first, end = rows[0], rows[-1] + 1
    return table[first:end] if end - first == len(rows) else np.take(table, rows, axis=0)


class RemainingMoments:
    """Moments of the recordings that remain without a group.

    Without rows r of a class, of weights w, its mean moves by ``-sum(w r) / n``, where n counts the
    remaining recordings, and its scatter loses ``sum(w r r') + sum(w r) sum(w r)' / n``.

    Parameters
    ----------
    training : Training
        The recordings.
    moments : ClassMoments
        Of all of them, of any kind.

    Attributes
    ----------
    rows : dict of {int: ndarray of int}
        Recordings of each group.
    deviations : ndarray of shape (n_recordings, n_features)
        From the means of the classes.
    """

    def __init__(self, training: Training, moments: ClassMoments):
        self.training, self._moments = training, moments
        groups, places = np.unique(training.groups, return_inverse=True)
        self.rows = {group: np.flatnonzero(places == k) for k, group in enumerate(groups.tolist())}
        self._place = {group: place for place, group in enumerate(self.rows)}
        self._kept: dict[int, Array] = {}
        self._variances: dict[bool, tuple[Array, NDArray[np.bool_]]] = {}
        self._standards: dict[int | None, tuple[Array, float]] = {}
        self.deviations = np.take(moments.means, training.codes, axis=0)
        np.subtract(training.X, self.deviations, out=self.deviations)
        self._leave_out(places * len(moments.means) + training.codes)
        if len(groups) <= AT_ONCE:
            self._kept = {group: self._lost_scatter(group) for group in self.rows}
        self._scatter = self._pooled_scatter()

    def _leave_out(self, cells: NDArray[np.intp]) -> None:
        """Find counts and means without each group, and the sums of squares that are lost.

        Cells are numbers of group and class together, of each recording.
        """
        moments, weight = self._moments, self.training.weight
        shape = len(self.rows), len(moments.means)
        member = csc_array(
            (weight, cells, np.arange(len(cells) + 1)), (shape[0] * shape[1], len(cells))
        )
        left = moments.counts - np.bincount(cells, weight, member.shape[0]).reshape(shape)
        left[left <= 1e-9 * moments.counts] = 0.0
        inverse = np.divide(1.0, left, out=np.zeros(shape), where=left > 0)[:, :, np.newaxis]
        self._counts, self._moved = left, (member @ self.deviations).reshape(*shape, -1)
        self._means = np.where(inverse > 0, moments.means - self._moved * inverse, 0.0)
        self._moved *= np.sqrt(inverse)
        self._squares = (member @ np.square(self.deviations)).reshape(self._moved.shape)
        self._squares += np.square(self._moved)
        if moments.pooled:
            self._squares = self._squares.sum(axis=1, keepdims=True)

    def _pooled_scatter(self) -> Array:
        """Return the scatter of all recordings, summed over the classes."""
        if self._moments.scatter.ndim == 3:
            return self._moments.scatter.sum(axis=0, keepdims=True)
        moved = self._moved.reshape(-1, self._moved.shape[-1])
        total = -moved.T @ moved
        for group in self.rows:
            total += self._lost_scatter(group)
        return total[np.newaxis]

    def _lost_scatter(self, group: int) -> Array:
        """Return what the scatter of all classes loses without a group."""
        if group in self._kept:
            return self._kept[group]
        rows = self.rows[group]
        values, moved = of_rows(self.deviations, rows), self._moved[self._place[group]]
        stacked = np.concatenate([values, moved])
        stacked[: len(rows)] *= np.sqrt(self.training.weight[rows, np.newaxis])
        lost: Array = stacked.T @ stacked
        return lost

    def _remaining_variances(self, pooled: bool) -> tuple[Array, NDArray[np.bool_]]:
        """Return diagonals of the scatter without each group, and where they are inaccurate."""
        if pooled not in self._variances:
            total, lost, counts = self._moments.scatter, self._squares, self._counts
            if pooled:
                total, lost = self._scatter, lost.sum(axis=1, keepdims=True)
            left = diagonals(total) - lost
            bad: NDArray[np.bool_] = np.any(left < _CANCELLED * diagonals(total), axis=2)
            self._variances[pooled] = left, np.asarray((bad & (counts > 0)).any(axis=1))
        return self._variances[pooled]

    def without(
        self,
        group: int | None,
        *,
        pooled: bool = True,
        variances_only: bool = False,
        anew: bool = False,
    ) -> ClassMoments:
        """Return moments of all recordings but those of a group, of a kind of `class_moments`.

        Parameters
        ----------
        group : int or None
            Number of the group. None, or the number of another one: all recordings.
        pooled, variances_only : bool
            As for `class_moments`; the scatter of each class has variances only.
        anew : bool
            Without a difference, whose rounding hides that a scatter is singular.
        """
        scatter = self._scatter if pooled else self._moments.scatter
        if group is None or group not in self._place:
            scatter = diagonals(scatter) if variances_only else scatter
            return ClassMoments(self._moments.counts, self._moments.means, scatter, pooled)
        place = self._place[group]
        variances, inaccurate = self._remaining_variances(pooled)
        if anew or inaccurate[place]:  # rounding errors dominate the difference
            others = self.training.take(self.training.groups != group)
            return others.moments(pooled=pooled, variances_only=variances_only)
        scatter = variances[place] if variances_only else scatter - self._lost_scatter(group)
        return ClassMoments(self._counts[place], self._means[place], scatter, pooled)

    def target(
        self, moments: ClassMoments, group: int | None, shrinkage: Any
    ) -> tuple[ArrayLike, ...]:
        """Return the arguments of `shrink` for all recordings but those of a group."""
        _, scales, coefficient = self.standardised(moments, group, shrinkage)
        return coefficient, scales**2

    def standardised(
        self, moments: ClassMoments, group: int | None, shrinkage: Any
    ) -> tuple[Array, Array, float]:
        """Return the coefficient of shrinkage, with the scatter and the units that it is for.

        For "auto" as `ledoit_wolf_coefficients`, from moments and the norms of the deviations;
        otherwise features are not standardised.

        Returns
        -------
        scatter : ndarray of shape (n_features, n_features)
        scales : ndarray of shape (n_features,)
            Standard deviations that it was divided by.
        coefficient : float
        """
        count, scatter = float(moments.group_counts[0]), moments.scatter[0]
        if shrinkage != "auto":
            oas = shrinkage == "oas"
            coefficient = oas_coefficient(scatter, count) if oas else float(shrinkage or 0.0)
            return scatter, np.ones(len(scatter)), coefficient
        group = group if group in self._place else None
        if group not in self._standards:
            groups = [None, *self.rows]
            first = groups.index(group) // AT_ONCE * AT_ONCE
            self._standardise(groups[first : first + AT_ONCE])
        scales, fourth = self._standards[group]
        inverse = 1 / scales
        scaled = scatter * inverse
        scaled *= inverse[:, np.newaxis]
        return scaled, scales, ledoit_wolf_coefficient(scaled, count, fourth)

    def _standardise(self, groups: Sequence[int | None]) -> None:
        """Find standard deviations, and sums of the fourth powers of standardised norms.

        For several groups that are left out at once, from moved means by matrix products:
        ``|v - d|^2 = |v|^2 - 2 v d + |d|^2``, in standard deviations. That of a constant feature
        is 1.
        """
        training, n_features = self.training, self.training.X.shape[1]
        without = [self.without(group, variances_only=True) for group in groups]
        counts = np.array([moments.counts for moments in without])
        variances = np.array([moments.scatter[0] for moments in without])
        total = counts.sum(axis=1, keepdims=True)
        variances /= np.where(total > 0, total, 1.0)
        variances[~(variances > 0)] = 1.0
        moved = np.array([moments.means for moments in without]) - self._moments.means
        moved[counts == 0] = 0.0
        inverse = 1 / variances
        scaled = moved * inverse[:, np.newaxis]
        norms = np.einsum("gkf,gkf->gk", moved, scaled)
        far = np.flatnonzero(norms.max(axis=1) > _FAR * n_features)  # squares cancel
        squares = inverse @ np.square(self.deviations).T
        scaled *= -2
        for k in range(training.n_classes):
            rows = np.flatnonzero(training.codes == k)
            values = np.take(self.deviations, rows, axis=0)
            squares[:, rows] += scaled[:, k] @ values.T + norms[:, k, np.newaxis]
            for number in far:
                squares[number, rows] = np.square(values - moved[number, k]) @ inverse[number]
        for group, variance, found in zip(groups, variances, squares, strict=True):
            if group is not None:
                found[self.rows[group]] = 0.0
            fourth = float(training.weight @ np.square(found, out=found))
            self._standards[group] = np.sqrt(variance), fourth
