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

from emacm.decisions.left_out_products import CANCELLED
from emacm.decisions.moments import ClassMoments, class_moments, diagonals
from emacm.decisions.shrinkage import ledoit_wolf_coefficient, oas_coefficient

Array = NDArray[np.float64]

AT_ONCE = 16  # groups for which matrices are stacked
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
        n_classes, n_features = training.n_classes, training.X.shape[1]
        groups = np.unique(training.groups).tolist()
        self.rows = {group: np.flatnonzero(training.groups == group) for group in groups}
        self._fourths: dict[int | None, float] = {}
        self._place = {group: place for place, group in enumerate(groups)}
        # Of each class in each group: sum of weights, of deviations and of their squares.
        self._weights = np.zeros((len(groups), n_classes))
        self._sums, self._squares = np.empty((2, len(groups), n_classes, n_features))
        self._scatter = moments.scatter
        if not moments.pooled:
            self._scatter = np.zeros((1, n_features, n_features))
        for place, rows in enumerate(self.rows.values()):
            values, weight = self.deviations(rows), training.weight[rows]
            member = np.zeros((n_classes, len(rows)))
            member[training.codes[rows], np.arange(len(rows))] = weight
            member.sum(axis=1, out=self._weights[place])
            np.matmul(member, values, out=self._sums[place])
            np.matmul(member, values**2, out=self._squares[place])
            if not moments.pooled:
                self._scatter += self._scatter_of(values, weight)

    def deviations(self, rows: NDArray[np.intp]) -> Array:
        """Return the deviations of recordings from the means of their classes."""
        deviations = self.training.X[rows]
        deviations -= np.take(self._moments.means, self.training.codes[rows], axis=0)
        return deviations

    @staticmethod
    def _scatter_of(values: Array, weight: Array) -> Array:
        values *= np.sqrt(weight)[:, np.newaxis]
        scatter: Array = values.T @ values
        return scatter

    def without(
        self, group: int | None, *, pooled: bool = True, variances_only: bool = False
    ) -> ClassMoments:
        """Return moments of all recordings but those of a group, of a kind of `class_moments`.

        Without rows r of a class, of weights w, the mean moves by ``-sum(w r) / n``, where n counts
        the remaining recordings, and the scatter loses ``sum(w r r') + sum(w r) sum(w r)' / n``.

        Parameters
        ----------
        group : int or None
            Number of the group. None, or the number of another one: all recordings.
        pooled, variances_only : bool
            As for `class_moments`; the scatter of each class has variances only.
        """
        total = self._scatter if pooled else self._moments.scatter
        total = diagonals(total) if variances_only else total
        before, means = self._moments.counts, self._moments.means
        if group is None or group not in self._place:
            return ClassMoments(before, means, total, pooled)
        place = self._place[group]
        counts = before - self._weights[place]
        counts[counts <= 1e-9 * before] = 0.0
        inverse = np.divide(1.0, counts, out=np.zeros_like(counts), where=counts > 0)
        inverse = inverse[:, np.newaxis]
        means = np.where(inverse > 0, means - self._sums[place] * inverse, 0.0)
        moved = self._sums[place] * np.sqrt(inverse)
        if variances_only:
            lost = self._squares[place] + moved**2
            scatter = total - (lost.sum(axis=0) if pooled else lost)
        else:
            rows = self.rows[group]
            lost = self._scatter_of(self.deviations(rows), self.training.weight[rows])
            lost += moved.T @ moved
            scatter = np.subtract(total, lost, out=lost[np.newaxis])
        moments = ClassMoments(counts, means, scatter, pooled)
        left = diagonals(scatter) < CANCELLED * diagonals(total)
        if left[moments.group_counts > 0].any():  # rounding errors dominate the difference
            others = self.training.take(self.training.groups != group)
            moments = others.moments(pooled=pooled, variances_only=variances_only)
        return moments

    def target(
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
        if group not in self._fourths:
            self.find_fourths([group])
        variances = _positive_variances(moments)
        scales = 1 / np.sqrt(variances)
        scaled = scatter * scales
        scaled *= scales[:, np.newaxis]
        return ledoit_wolf_coefficient(scaled, count, self._fourths[group]), variances

    def find_fourths(self, groups: Sequence[int | None]) -> None:
        """Find sums of the fourth powers of the norms of standardised deviations, for `target`.

        For several groups that are left out at once, from moved means by matrix products:
        ``|v - d|^2 = |v|^2 - 2 v d + |d|^2``, in standard deviations.
        """
        training, n_features = self.training, self.training.X.shape[1]
        without = [self.without(group, variances_only=True) for group in groups]
        inverse = np.array([1 / _positive_variances(moments) for moments in without])
        moved = np.array([moments.means for moments in without]) - self._moments.means
        unseen = np.array([moments.counts == 0 for moments in without])
        moved[unseen] = 0.0
        scaled = moved * inverse[:, np.newaxis]
        norms = np.einsum("gkf,gkf->gk", moved, scaled)
        far = norms.max(axis=1) > _FAR * n_features  # squares cancel
        squares = np.empty((len(inverse), len(training.X)))
        for k in range(training.n_classes):
            rows = np.flatnonzero(training.codes == k)
            values = self.deviations(rows)
            found = inverse @ np.square(values).T
            found += norms[:, k, np.newaxis] - 2 * scaled[:, k] @ values.T
            for number in np.flatnonzero(far):
                found[number] = np.square(values - moved[number, k]) @ inverse[number]
            squares[:, rows] = found
        for group, found in zip(groups, squares, strict=True):
            if group is not None and group in self.rows:
                found[self.rows[group]] = 0.0
            self._fourths[group] = float(training.weight @ np.square(found, out=found))


def _positive_variances(moments: ClassMoments) -> Array:
    """Return the variances by which Ledoit-Wolf standardises; 1 for a constant feature."""
    variances = diagonals(moments.scatter)[0] / (float(moments.group_counts[0]) or 1.0)
    return np.where(variances > 0, variances, 1.0)
