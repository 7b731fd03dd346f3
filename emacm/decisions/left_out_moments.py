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
    """

    def __init__(self, training: Training, moments: ClassMoments):
        self.training, self._moments = training, moments
        groups, (n_classes, n_features) = np.unique(training.groups).tolist(), moments.means.shape
        self.rows = {group: np.flatnonzero(training.groups == group) for group in groups}
        self._place = {group: place for place, group in enumerate(groups)}
        self._kept: dict[int, Array] = {}
        self._variances: dict[bool, tuple[Array, NDArray[np.bool_]]] = {}
        self._standards: dict[int | None, tuple[Array, float]] = {}
        self._counts = np.zeros((len(groups), n_classes))
        self._means, self._moved = np.zeros((2, *self._counts.shape, n_features))
        self._squares = np.zeros((len(groups), 1 if moments.pooled else n_classes, n_features))
        for group in groups:
            self._leave_out(group)
        self._scatter = self._pooled_scatter()

    def _leave_out(self, group: int) -> None:
        """Find counts and means without a group, and the sums of squares that are lost."""
        rows, training, place = self.rows[group], self.training, self._place[group]
        values, before = self.deviations(rows), self._moments.counts
        member = np.zeros((training.n_classes, len(rows)))
        member[training.codes[rows], np.arange(len(rows))] = training.weight[rows]
        sums, left = member @ values, before - member.sum(axis=1)
        left[left <= 1e-9 * before] = 0.0
        inverse = np.divide(1.0, left, out=np.zeros_like(left), where=left > 0)[:, np.newaxis]
        self._counts[place] = left
        shift = sums * inverse
        np.subtract(self._moments.means, shift, out=self._means[place], where=inverse > 0)
        np.multiply(sums, np.sqrt(inverse), out=self._moved[place])
        if len(self.rows) <= AT_ONCE:
            self._kept[group] = self._lost_scatter(group, values)
        squares = np.square(self._moved[place])
        if self._moments.pooled:
            member, squares = (each.sum(axis=0, keepdims=True) for each in (member, squares))
        np.matmul(member, np.square(values, out=values), out=self._squares[place])
        self._squares[place] += squares

    def deviations(self, rows: NDArray[np.intp]) -> Array:
        """Return the deviations of recordings from the means of their classes."""
        deviations = np.take(self.training.X, rows, axis=0)
        deviations -= np.take(self._moments.means, self.training.codes[rows], axis=0)
        return deviations

    def _pooled_scatter(self) -> Array:
        """Return the scatter of all recordings, summed over the classes."""
        if self._moments.scatter.ndim == 3:
            return self._moments.scatter.sum(axis=0, keepdims=True)
        moved = self._moved.reshape(-1, self._moved.shape[-1])
        total = -moved.T @ moved
        for group in self.rows:
            total += self._lost_scatter(group)
        return total[np.newaxis]

    def _lost_scatter(self, group: int, values: Array | None = None) -> Array:
        """Return what the scatter of all classes loses without a group of known deviations."""
        if group in self._kept:
            return self._kept[group]
        rows = self.rows[group]
        values = self.deviations(rows) if values is None else values
        stacked = np.empty((len(rows) + len(self._moved[0]), values.shape[1]))
        roots = np.sqrt(self.training.weight[rows, np.newaxis])
        np.multiply(values, roots, out=stacked[: len(rows)])
        stacked[len(rows) :] = self._moved[self._place[group]]
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
        return (coefficient, scales**2) if shrinkage == "auto" else (coefficient,)

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
        squares = np.empty((len(groups), len(training.X)))
        for k in range(training.n_classes):
            rows = np.flatnonzero(training.codes == k)
            values = np.take(training.X, rows, axis=0)
            values -= self._moments.means[k]
            found = norms[:, k, np.newaxis] - 2 * scaled[:, k] @ values.T
            apart = [np.square(values - moved[number, k]) for number in far]
            found += inverse @ np.square(values, out=values).T
            for number, values in zip(far, apart, strict=True):
                found[number] = values @ inverse[number]
            squares[:, rows] = found
        for group, variance, found in zip(groups, variances, squares, strict=True):
            if group is not None:
                found[self.rows[group]] = 0.0
            fourth = float(training.weight @ np.square(found, out=found))
            self._standards[group] = np.sqrt(variance), fourth
