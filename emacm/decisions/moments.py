"""Counts, means and scatter of the recordings of each class, which merge exactly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ClassMoments:
    """Counts, means and scatter of the recordings of each class.

    Attributes
    ----------
    counts : ndarray of shape (n_classes,)
        Sum of the weights of the recordings; their number if every weight is 1.
    means : ndarray of shape (n_classes, n_features)
        Mean of each class, Eq. (2.45); zero for a class without recordings.
    scatter : ndarray of shape (n_groups, n_features, n_features) or (n_groups, n_features)
        Sum of the outer products of the deviations from the mean of the class; in the second
        shape, of their squares only.
    pooled : bool
        If True, the scatter is summed over all classes (`n_groups` = 1).
    """

    counts: Array
    means: Array
    scatter: Array
    pooled: bool

    def merge(self, other: ClassMoments) -> ClassMoments:
        """Return the moments of both sets of recordings together, exactly [1]_.

        References
        ----------
        .. [1] Chan, Golub and LeVeque, Updating formulae and a pairwise algorithm for
           computing sample variances, COMPSTAT 1982.
        """
        if self.scatter.shape != other.scatter.shape or self.pooled != other.pooled:
            raise ValueError(
                f"Moments can be merged if they have the same kind of scatter, got the shapes "
                f"{self.scatter.shape} and {other.scatter.shape}."
            )
        counts = self.counts + other.counts
        share = np.divide(other.counts, counts, out=np.zeros_like(counts), where=counts > 0)
        step = other.means - self.means  # a class without recordings has the mean 0, of no weight
        means = self.means + share[:, np.newaxis] * step
        between = _scatter_of_rows(step, self.counts * share, self.scatter.ndim)
        if self.pooled:
            between = between.sum(axis=0, keepdims=True)
        return ClassMoments(counts, means, self.scatter + other.scatter + between, self.pooled)

    @property
    def group_counts(self) -> Array:
        """Number of recordings of each scatter, shape (n_groups,)."""
        return self.counts.sum(keepdims=True) if self.pooled else self.counts

    @property
    def divisors(self) -> Array:
        """N - 1 of each class, Eq. (2.46); if pooled, N - K of the K classes with recordings."""
        if self.pooled:
            return self.group_counts - np.count_nonzero(self.counts)
        return self.counts - 1

    @property
    def feature_variances(self) -> Array:
        """Variance of each feature over the recordings of all classes, divided by N."""
        shares = self.counts / self.counts.sum()
        spread = self.means - shares @ self.means
        return diagonals(self.scatter).sum(axis=0) / self.counts.sum() + shares @ spread**2


def class_moments(
    X: Array,
    codes: NDArray[np.intp],
    n_classes: int,
    weight: Array | None = None,
    covariance: str = "full",
    shrinkage: Any = None,
) -> ClassMoments:
    """Return the moments that a kind of covariance and of shrinkage needs.

    Parameters
    ----------
    X : ndarray of shape (n_recordings, n_features)
        Features.
    codes : ndarray of shape (n_recordings,)
        Number of the class of each recording, 0..n_classes-1.
    n_classes : int
        Number of classes, including those without recordings.
    weight : ndarray of shape (n_recordings,), default=None
        How often each recording counts; None: once.
    covariance, shrinkage : str and None, float or str
        As for `CostSensitiveGaussianBayes`. "tied": the scatter is summed over the classes. "diag":
        without products of different features, unless "oas" needs them.

    Returns
    -------
    ClassMoments

    Examples
    --------
    >>> X, codes = np.array([[0.0], [2.0], [5.0], [9.0]]), np.array([0, 0, 1, 1])
    >>> moments = class_moments(X, codes, 2)
    >>> moments.counts, moments.means.ravel(), moments.scatter.ravel()
    (array([2., 2.]), array([1., 7.]), array([2., 8.]))
    >>> class_moments(X, codes, 2, covariance="tied").scatter
    array([[[10.]]])
    """
    weight = np.ones(len(X)) if weight is None else weight
    n_features, pooled = X.shape[1], covariance == "tied"
    variances_only = covariance == "diag" and shrinkage != "oas"
    counts, means = np.zeros(n_classes), np.zeros((n_classes, n_features))
    shape = (n_features,) if variances_only else (n_features, n_features)
    scatter = np.zeros((1 if pooled else n_classes, *shape))
    for k in range(n_classes):
        chosen = (codes == k) & (weight > 0)
        if not chosen.any():
            continue
        rows, w = X[chosen], weight[chosen]
        counts[k] = w.sum()
        means[k] = w @ rows / counts[k]
        means[k] += w @ (rows - means[k]) / counts[k]
        constant = (rows == rows[0]).all(axis=0)
        means[k, constant] = rows[0, constant]  # without rounding, so that it has no spread
        scaled = (rows - means[k]) * np.sqrt(w)[:, np.newaxis]
        spread = np.sum(scaled**2, axis=0) if variances_only else scaled.T @ scaled
        scatter[0 if pooled else k] += spread
    return ClassMoments(counts, means, scatter, pooled)


def diagonals(matrices: Array) -> Array:
    """Return the diagonals of a stack of matrices; a stack of diagonals is returned unchanged.

    Examples
    --------
    >>> diagonals(np.array([[[1.0, 2.0], [3.0, 4.0]]]))
    array([[1., 4.]])
    """
    return matrices if matrices.ndim == 2 else np.diagonal(matrices, axis1=1, axis2=2)


def _scatter_of_rows(rows: Array, weight: Array, ndim: int) -> Array:
    """Return one weighted outer product (or square, if `ndim` is 2) per row."""
    if ndim == 2:
        return weight[:, np.newaxis] * rows**2
    return weight[:, np.newaxis, np.newaxis] * rows[:, :, np.newaxis] * rows[:, np.newaxis, :]
