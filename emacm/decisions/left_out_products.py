"""Densities of classes without one group, from inner products of recordings.

A class of fewer recordings than features has a covariance of low rank. With the deviations A (in
rows) of its remaining recordings, ``(c A'A + I)^-1 = I - c A' (c A A' + I)^-1 A`` (Woodbury): a
matrix of the size of the class is factorised instead of one of the size of the features. Inner
products are computed once for all groups; without a group they follow from the shift of the mean.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dtrsm

from emacm.decisions.gaussians import REGULAR
from emacm.decisions.shrinkage import oas_coefficient

Array = NDArray[np.float64]

CANCELLED = 1e-7  # remaining fraction of a scatter below which a difference is too inaccurate


class _Left(NamedTuple):
    """Inner products of a class without a group, and the shift of its mean in such products."""

    products: Array
    total: float
    removed: NDArray[np.bool_]
    shares: Array
    shift: Array


class ClassProducts:
    """Inner products of the recordings of one class.

    Parameters
    ----------
    values : ndarray of shape (n_class, n_features)
        Deviations of the recordings of the class from its mean.
    weight : ndarray of shape (n_class,)
        Number of times each recording is counted.
    groups : ndarray of int, shape (n_class,)
        Number of the group of each recording.

    Attributes
    ----------
    values : ndarray of shape (n_class, n_features)
        The deviations.
    """

    def __init__(self, values: Array, weight: Array, groups: NDArray[np.intp]):
        self.values, self._n_features = values, values.shape[1]
        self._roots, self._groups = np.sqrt(weight), groups
        scaled = values * self._roots[:, np.newaxis]
        self._products = scaled @ scaled.T

    def _without(self, group: int) -> _Left | None:
        """Return the products of the remaining deviations, 0 for those of the group.

        None if too few recordings remain, or the products are inaccurate.
        """
        roots, removed = self._roots, self._groups == group
        shares = np.where(removed, 0.0, roots)
        count = float(shares @ shares)
        if count <= 1 + 1e-9 * len(roots):
            return None
        shares /= count
        shift = self._products @ shares
        moved = shift - roots * (0.5 * (shares @ shift))
        outer = np.multiply.outer(moved, roots)
        products = self._products - outer
        products -= outer.T
        products[removed] = 0.0
        products[:, removed] = 0.0
        total = np.diagonal(self._products)[~removed].sum()
        if not np.trace(products) > CANCELLED * total:  # or not a number, from an overflow
            return None
        return _Left(products, count, removed, shares, shift)

    def oas_coefficient(self, group: int) -> float | None:
        """Return the coefficient of shrinkage without a group; None as for `log_densities`."""
        left = self._without(group)
        return None if left is None else oas_coefficient(*left[:2], self._n_features)

    def log_densities(
        self, group: int, shrinkage: Any, floor: float, crossed: Array, norms: Array
    ) -> Array | None:
        """Return log densities of recordings of a group under the class without it.

        Parameters
        ----------
        group : int
            Number of the group.
        shrinkage : None, float or "oas"
            As for `CostSensitiveGaussianBayes`.
        floor : float
            Least eigenvalue of a covariance without shrinkage.
        crossed, norms : ndarray of shape (n_group, n_class) and (n_group,)
            Inner products of the deviations from the mean of the whole class, of the recordings
            with those of the class (which are overwritten) and with themselves.

        Returns
        -------
        ndarray of shape (n_group,) or None
            None if the covariance itself is needed.
        """
        left = self._without(group)
        if left is None:
            return None
        products, count, removed, shares, shift = left
        crossed *= self._roots
        shifts = crossed @ shares
        mean_square = float(shares @ shift)
        norms = norms - 2 * shifts + mean_square
        crossed -= shift
        crossed -= np.multiply.outer(shifts - mean_square, self._roots)
        crossed[:, removed] = 0.0
        coefficient = float(shrinkage or 0.0) if shrinkage != "oas" else None
        if coefficient is None:
            coefficient = oas_coefficient(products, count, self._n_features)
        if coefficient == 0:
            of = products, crossed, norms, count - 1, floor
            squares, log_determinant = _lifted(*of, self._n_features)
        else:
            total = np.trace(products) / (count - 1)
            diagonal = coefficient * total / self._n_features
            scale = (1 - coefficient) / (count - 1) / diagonal
            if diagonal <= REGULAR * self._n_features * total:
                return None
            products *= scale
            products.flat[:: len(products) + 1] += 1.0
            root = np.linalg.cholesky(products)
            white = dtrsm(1.0, root.T, crossed.T, trans_a=1, overwrite_b=1)
            squares = (norms - scale * np.einsum("cr,cr->r", white, white)) / diagonal
            log_determinant = self._n_features * np.log(diagonal)
            log_determinant += 2 * np.log(np.diagonal(root)).sum()
        constant = self._n_features * np.log(2 * np.pi) + log_determinant
        log_densities: Array = -0.5 * (squares + constant)
        return log_densities


def _lifted(
    products: Array, crossed: Array, norms: Array, divisor: float, floor: float, n_features: int
) -> tuple[Array, float]:
    """Return squared distances and log determinant with the eigenvalues raised to a floor."""
    values, vectors = np.linalg.eigh(products)
    kept = values > floor * divisor
    values, along = values[kept], crossed @ vectors[:, kept]
    squares = norms / floor - along**2 @ ((1 / floor - divisor / values) / values)
    n_raised = n_features - len(values)
    return squares, float(np.log(values / divisor).sum() + n_raised * np.log(floor))
