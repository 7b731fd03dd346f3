"""Densities of classes without one group, from inner products of recordings.

A class of fewer recordings than features has a covariance of low rank. With the deviations A (in
rows) of its remaining recordings, ``(c A'A + I)^-1 = I - c A' (c A A' + I)^-1 A`` (Woodbury): a
matrix of the size of the class is factorised instead of one of the size of the features. Inner
products are computed once for all groups; without a group they follow from the shift of the mean.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dtrsm
from scipy.linalg.lapack import dpotrf

from emacm.decisions.gaussians import REGULAR
from emacm.decisions.shrinkage import oas_of_moments

Array = NDArray[np.float64]

_CANCELLED = 1e-3  # remaining fraction of a scatter below which a difference is too inaccurate


class ClassProducts:
    """Inner products of the recordings of one class, and what they give without each group.

    Parameters
    ----------
    values : ndarray of shape (n_class, n_features)
        Deviations of the recordings of the class from its mean.
    weight : ndarray of shape (n_class,)
        Number of times each recording is counted.
    groups : ndarray of int, shape (n_class,)
        Number of the group of each recording.
    every_group : list of int
        Numbers of the groups that are left out.

    Attributes
    ----------
    usable : ndarray of bool, shape (n_groups,)
        Whether enough recordings remain without a group, and their products are accurate.
    """

    def __init__(
        self, values: Array, weight: Array, groups: NDArray[np.intp], every_group: list[int]
    ):
        self._n_features, self._roots = values.shape[1], np.sqrt(weight)
        self._unit = np.abs(values).max() or 1.0  # so that no product overflows or underflows
        self._values = values / self._unit * self._roots[:, np.newaxis]
        self._products = self._values @ self._values.T
        self._remaining = groups != np.array(every_group)[:, np.newaxis]
        # The mean moves by the sum of the remaining values, times their shares.
        counts = self._remaining @ weight
        self._counts = np.where(counts > 1 + 1e-9 * len(weight), counts, 0.0)
        inverse = np.divide(1.0, counts, out=np.zeros_like(counts), where=self._counts > 0)
        self._shares = self._remaining * self._roots * inverse[:, np.newaxis]
        self._shifts = self._shares @ self._products  # along each value
        self._lengths = np.einsum("gc,gc->g", self._shares, self._shifts)  # squared
        total = self._remaining @ np.diagonal(self._products)
        self._traces = total - counts * self._lengths
        # Not if they are not numbers, from an overflow, either.
        self.usable = (self._counts > 0) & (self._traces > _CANCELLED * total)

    def oas_coefficients(self) -> Array:
        """Return the coefficient of shrinkage without each group, shape (n_groups,)."""
        kept, counts = self._remaining.astype(float), self._counts
        squares = np.einsum("gc,gc->g", kept @ np.square(self._products), kept)
        squares -= 2 * counts * np.einsum("gc,gc->g", kept, np.square(self._shifts))
        squares += np.square(counts * self._lengths)
        return oas_of_moments(self._traces, squares, counts, self._n_features)

    def shrunk_log_densities(
        self, place: int, coefficient: float, deviations: Array
    ) -> Array | None:
        """Return log densities of recordings of a group under the class without it.

        Parameters
        ----------
        place : int
            Place of the group in `every_group`, a usable one.
        coefficient : float
            Of shrinkage, positive.
        deviations : ndarray of shape (n_group, n_features)
            Of the recordings from the mean of the class without the group.

        Returns
        -------
        ndarray of shape (n_group,) or None
            None if the covariance itself is needed.
        """
        n_features, count = self._n_features, self._counts[place]
        total = self._traces[place] / (count - 1)
        if coefficient <= REGULAR * n_features**2:
            return None
        scale = (1 - coefficient) / (count - 1) / (coefficient * total / n_features)
        diagonal = coefficient * total / n_features * self._unit**2
        kept = np.flatnonzero(self._remaining[place])
        matrix = self._products.take(kept, axis=0).take(kept, axis=1)
        matrix *= scale
        matrix.ravel()[:: len(matrix) + 1] += 1.0
        root, _ = dpotrf(matrix.T, overwrite_a=1)  # the transposes are not copied
        sides = np.empty((len(kept), len(deviations) + 1))
        np.matmul(np.take(self._values, kept, axis=0), deviations.T, out=sides[:, :-1])
        sides[:, -1] = self._shares[place, kept]
        white = dtrsm(1.0, root, sides.T, side=1, overwrite_b=1)
        white, share = white[:-1], white[-1]
        squares = np.einsum("rf,rf->r", deviations, deviations)
        squares -= scale * np.einsum("rc,rc->r", white, white)
        # That was for the scatter about the mean of the whole class: it loses the product of the
        # shift of the mean with itself, once for each recording (Sherman and Morrison).
        left = count * (share @ share)
        squares += np.square(white @ share) * (scale * count / left)
        log_determinant = n_features * np.log(diagonal) + np.log(left)
        log_determinant += 2 * np.log(np.diagonal(root)).sum()
        return -0.5 * (squares / diagonal + n_features * np.log(2 * np.pi) + log_determinant)

    def floored_log_densities(self, place: int, floor: float, deviations: Array) -> Array:
        """As `shrunk_log_densities`, without shrinkage, with eigenvalues raised to a floor."""
        free = self._counts[place] - 1
        kept = np.flatnonzero(self._remaining[place])
        shift = self._shares[place] @ self._values
        values = self._values[kept] - np.multiply.outer(self._roots[kept], shift)
        eigenvalues, vectors = np.linalg.eigh(values @ values.T)
        variances = eigenvalues / free * self._unit**2
        large = variances > floor
        directions = values.T @ (vectors[:, large] / np.sqrt(eigenvalues[large]))
        squares = np.einsum("rf,rf->r", deviations, deviations) / floor
        squares -= np.square(deviations @ directions) @ (1 / floor - 1 / variances[large])
        n_raised = self._n_features - np.count_nonzero(large)
        log_determinant = np.log(variances[large]).sum() + n_raised * np.log(floor)
        constant = self._n_features * np.log(2 * np.pi) + log_determinant
        log_densities: Array = -0.5 * (squares + constant)
        return log_densities
