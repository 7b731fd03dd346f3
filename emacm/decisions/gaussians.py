"""Gaussian densities of the classes: covariances, log densities and their gradients.

`class_gaussians` computes densities from the moments of the classes
(`emacm.decisions.moments`); `GaussianClasses.log_densities` evaluates them, Eq. (2.44) of [1]_.

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_triangular

from emacm.decisions.moments import ClassMoments, diagonals
from emacm.decisions.shrinkage import ledoit_wolf_coefficients, oas_coefficient, shrink

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GaussianClasses:
    """Gaussian densities of the classes.

    Attributes
    ----------
    means : ndarray of shape (n_classes, n_features)
        Mean of each class.
    covariances : ndarray of shape (n_groups, n_features, n_features) or (n_groups, n_features)
        Covariance of each class, or the common one (`n_groups` = 1), or their diagonals.
    factors : ndarray of the shape of `covariances`
        P with P P' = inverse of the covariance; ``(z - mean) @ P`` has unit covariance.
    log_determinants : ndarray of shape (n_groups,)
        Logarithm of the determinant of each covariance.
    singular : ndarray of bool, shape (n_groups,)
        Whether the covariance was singular: raised to the floor if there was one, otherwise its
        factor is zero and meaningless.
    """

    means: Array
    covariances: Array
    factors: Array
    log_determinants: Array
    singular: NDArray[np.bool_]

    def squared_distances(self, X: Array) -> Array:
        """Squared Mahalanobis distances, the exponent of Eq. (2.44).

        Parameters
        ----------
        X : ndarray of shape (n_recordings, n_features)
            Features.

        Returns
        -------
        ndarray of shape (n_recordings, n_classes)
            Squared distances to the mean of each class, in standard deviations; infinite where
            they overflow.
        """
        columns = np.ascontiguousarray(X.T)  # sums over few features are slow along rows
        squares = np.empty((len(self.means), len(X)))
        common = len(self.factors) == 1 and self.factors.ndim == 3
        with np.errstate(over="ignore", invalid="ignore"):
            if common:  # transform once, then subtract the transformed means
                factor, centre = self.factors[0], self.means.mean(axis=0)
                columns = factor.T @ (columns - centre[:, np.newaxis])
                means = (self.means - centre) @ factor
            for k in range(len(self.means)):
                if common:
                    white = columns - means[k][:, np.newaxis]
                else:
                    white = self._whiten(columns - self.means[k][:, np.newaxis], k)
                squares[k] = np.einsum("fr,fr->r", white, white)
        return np.fmin(squares, np.inf).T  # where terms overflow, infinity instead of NaN

    def log_densities(self, X: Array) -> Array:
        """Logarithm of the density of each class, Eq. (2.44), shape (n_recordings, n_classes)."""
        log_densities = self.squared_distances(X)
        log_densities += X.shape[1] * np.log(2 * np.pi) + self.log_determinants
        log_densities *= -0.5
        return log_densities

    def log_density_gradients(self, X: Array) -> Array:
        """Gradients of the log densities, -S^-1 (z - mean).

        Parameters
        ----------
        X : ndarray of shape (n_recordings, n_features)
            Features.

        Returns
        -------
        ndarray of shape (n_recordings, n_classes, n_features)
            Per unit of each feature.
        """
        gradients = np.empty((len(X), *self.means.shape))
        for k, mean in enumerate(self.means):
            factor = self.factors[k % len(self.factors)]
            white = self._whiten((X - mean).T, k)
            gradients[:, k] = -(white.T * factor if factor.ndim == 1 else white.T @ factor.T)
        return gradients

    def _whiten(self, deviations: Array, k: int) -> Array:
        """Scale deviations from the mean of class k, one column per recording, to unit variance."""
        factor = self.factors[k % len(self.factors)]
        return factor[:, np.newaxis] * deviations if factor.ndim == 1 else factor.T @ deviations


def class_gaussians(
    moments: ClassMoments,
    covariance: str = "full",
    shrinkage: Any = None,
    recordings: tuple[Array, NDArray[np.intp]] | None = None,
    *,
    floored: bool | None = None,
    floor: float = 1e-9,
) -> GaussianClasses:
    """Compute the densities of `CostSensitiveGaussianBayes` from moments.

    Parameters
    ----------
    moments : ClassMoments
        Of `emacm.decisions.moments.class_moments` with the same `covariance` and `shrinkage`.
    covariance, shrinkage : str and None, float or str
        As for `CostSensitiveGaussianBayes`.
    recordings : tuple of (X, codes)
        Features, and the number of the class of each recording; needed for "auto" only.
    floored : bool, default=None
        Whether the eigenvalues of a singular covariance are raised. None: without shrinkage.
    floor : float, default=1e-9
        Least eigenvalue of a singular covariance, per largest feature variance.

    Returns
    -------
    GaussianClasses

    Examples
    --------
    >>> from emacm.decisions.moments import class_moments
    >>> X, codes = np.array([[0.0], [2.0], [5.0], [7.0]]), np.array([0, 0, 1, 1])
    >>> gaussians = class_gaussians(class_moments(X, codes, 2))
    >>> gaussians.log_densities(np.array([[1.0]])).round(3)
    array([[-1.266, -7.516]])
    """
    scatter = diagonals(moments.scatter) if covariance == "diag" else moments.scatter
    free = np.maximum(moments.divisors, 0.0)
    inverse = np.divide(1.0, free, out=np.zeros_like(free), where=free > 0)
    coefficients = shrinkage_coefficients(moments, shrinkage, recordings)
    covariances = shrink(scatter, *coefficients, factors=inverse)
    floored = shrinkage is None if floored is None else floored
    least = floor * moments.feature_variances.max() if floored else 0.0
    factors, log_determinants = np.zeros_like(covariances), np.zeros(len(covariances))
    singular = np.zeros(len(covariances), dtype=bool)
    for group, found in enumerate(covariances):
        factor = inverse_factor(found)
        singular[group] = factor is None
        if factor is None and least:
            covariances[group], factor = _raised(found, least)
        if factor is not None:
            factors[group], log_determinants[group] = factor
    return GaussianClasses(moments.means, covariances, factors, log_determinants, singular)


def shrinkage_coefficients(
    moments: ClassMoments, shrinkage: Any, recordings: tuple[Array, NDArray[np.intp]] | None
) -> tuple[ArrayLike, ArrayLike]:
    """Return the arguments `coefficients` and `squared_scales` of `shrink`."""
    if shrinkage == "auto":
        if recordings is None:
            raise ValueError('shrinkage="auto" needs the recordings.')
        return ledoit_wolf_coefficients(*recordings, moments.means, pooled=moments.pooled)
    if shrinkage == "oas":
        pairs = zip(moments.scatter, moments.group_counts, strict=True)
        return [oas_coefficient(scatter, count) for scatter, count in pairs], 1.0
    return 0.0 if shrinkage is None else float(shrinkage), 1.0


def inverse_factor(covariance: Array) -> tuple[Array, float] | None:
    """Return P with P P' = inverse of a covariance, and the logarithm of its determinant.

    Parameters
    ----------
    covariance : ndarray of shape (n_features, n_features) or (n_features,)
        In the second shape, the variances of uncorrelated features.

    Returns
    -------
    tuple of (factor, log_determinant) or None
        None if it is singular. The correlation matrix decides, so that features in very different
        units do not make a covariance singular.

    Examples
    --------
    >>> inverse_factor(np.array([4.0, 1.0]))
    (array([0.5, 1. ]), 1.3862943611198906)
    >>> inverse_factor(np.ones((2, 2)))
    """
    variances = covariance if covariance.ndim == 1 else np.diagonal(covariance)
    if not (variances > 0).all():
        return None
    if covariance.ndim == 1:
        return 1 / np.sqrt(variances), float(np.log(variances).sum())
    deviations = np.sqrt(variances)[:, np.newaxis]
    correlation = covariance / deviations / deviations[:, 0]
    try:
        root = np.asarray(np.linalg.cholesky(correlation))
    except np.linalg.LinAlgError:
        return None
    if np.diagonal(root).min() < 1e-3:  # only then may the smallest eigenvalue be rounding
        eigenvalues = np.linalg.eigvalsh(correlation)
        rounding = 10 * len(covariance) * np.finfo(np.float64).eps
        if eigenvalues[0] <= rounding * eigenvalues[-1]:
            return None
    root = root * deviations
    inverse = solve_triangular(root, np.eye(len(root)), lower=True).T
    return inverse, float(2 * np.log(np.diagonal(root)).sum())


def _raised(covariance: Array, least: float) -> tuple[Array, tuple[Array, float]]:
    """Raise eigenvalues; return the covariance, and its inverse factor and log determinant."""
    if covariance.ndim == 1:
        variances = np.maximum(covariance, least)
        return variances, (1 / np.sqrt(variances), float(np.log(variances).sum()))
    eigenvalues, vectors = np.linalg.eigh(covariance)
    eigenvalues = np.maximum(eigenvalues, least)
    root = vectors * np.sqrt(eigenvalues)
    factor = vectors / np.sqrt(eigenvalues), float(np.log(eigenvalues).sum())
    return root @ root.T, factor
