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
    floor: float = 1e-9,
) -> GaussianClasses:
    """Compute the densities of `CostSensitiveGaussianBayes` from moments.

    Parameters
    ----------
    moments : ClassMoments
        Of `emacm.decisions.moments.moments_for` with the same `covariance` and `shrinkage`.
    covariance, shrinkage : str and None, float or str
        As for `CostSensitiveGaussianBayes`.
    recordings : tuple of (X, codes)
        Features, and the number of the class of each recording; needed for "auto" only.
    floor : float, default=1e-9
        Least eigenvalue of a singular covariance, per largest feature variance; without shrinkage.

    Returns
    -------
    GaussianClasses

    Examples
    --------
    >>> from emacm.decisions.moments import moments_for
    >>> X, codes = np.array([[0.0], [2.0], [5.0], [7.0]]), np.array([0, 0, 1, 1])
    >>> gaussians = class_gaussians(moments_for("full", None, X, codes, 2))
    >>> gaussians.log_densities(np.array([[1.0]])).round(3)
    array([[-1.266, -7.516]])
    """
    coefficients = shrinkage_coefficients(moments, shrinkage, recordings)
    lifted = floor * moments.feature_variances.max() if shrinkage is None else None
    return fit_gaussians(moments, *coefficients, diagonal=covariance == "diag", floor=lifted)


def floored_gaussians(
    moments: ClassMoments,
    covariance: str,
    shrinkage: Any,
    recordings: tuple[Array, NDArray[np.intp]],
    *,
    floor: float = 1e-9,
) -> GaussianClasses:
    """As `class_gaussians`, with the floor for singular covariances whatever the shrinkage."""
    coefficients = shrinkage_coefficients(moments, shrinkage, recordings)
    lifted = floor * moments.feature_variances.max()
    return fit_gaussians(moments, *coefficients, diagonal=covariance == "diag", floor=lifted)


def shrinkage_coefficients(
    moments: ClassMoments, shrinkage: Any, recordings: tuple[Array, NDArray[np.intp]] | None
) -> tuple[ArrayLike, ...]:
    """Return the arguments of `shrink` for the covariances of moments, as `class_gaussians`.

    Parameters
    ----------
    moments, shrinkage, recordings
        As for `class_gaussians`.

    Returns
    -------
    tuple of (coefficients,) or (coefficients, squared_scales)
    """
    if shrinkage == "auto":
        if recordings is None:
            raise ValueError('shrinkage="auto" needs the recordings.')
        return ledoit_wolf_coefficients(*recordings, moments.means, pooled=moments.pooled)
    if shrinkage == "oas":
        pairs = zip(moments.scatter, moments.group_counts, strict=True)
        return ([oas_coefficient(scatter, count) for scatter, count in pairs],)
    return (0.0 if shrinkage is None else float(shrinkage),)


def fit_gaussians(
    moments: ClassMoments,
    coefficients: ArrayLike = 0.0,
    squared_scales: ArrayLike = 1.0,
    *,
    diagonal: bool = False,
    floor: float | None = None,
) -> GaussianClasses:
    """Compute covariances, Eq. (2.46), shrink and factorise them.

    Parameters
    ----------
    moments : ClassMoments
        Counts, means and scatter.
    coefficients, squared_scales : array-like
        As for `shrink`.
    diagonal : bool, default=False
        Keep the variances only (of the shrunk covariance).
    floor : float, default=None
        Least eigenvalue of a covariance that is singular, in squared units of the
        features; None leaves it singular.

    Returns
    -------
    gaussians : GaussianClasses
        Densities of all classes.

    Examples
    --------
    >>> from emacm.decisions.moments import class_moments
    >>> X = np.array([[0.0], [2.0], [5.0], [7.0]])
    >>> gaussians = fit_gaussians(class_moments(X, np.array([0, 0, 1, 1]), 2))
    >>> gaussians.log_densities(np.array([[1.0]])).round(3)
    array([[-1.266, -7.516]])
    """
    scatter = diagonals(moments.scatter) if diagonal else moments.scatter
    free = np.maximum(moments.divisors, 0.0)
    inverse = np.divide(1.0, free, out=np.zeros_like(free), where=free > 0)
    covariances = shrink(scatter, coefficients, squared_scales, inverse)
    if covariances.ndim == 2:
        return _fit_variances(moments.means, covariances, floor)
    factors, log_determinants = np.zeros_like(covariances), np.zeros(len(covariances))
    singular = np.zeros(len(covariances), dtype=bool)
    for group, covariance in enumerate(covariances):
        root = cholesky_root(covariance)
        singular[group] = root is None
        if root is not None:
            factors[group], log_determinants[group] = _inverse_of_root(root)
        elif floor:
            covariances[group], factors[group], log_determinants[group] = _lift(covariance, floor)
    return GaussianClasses(moments.means, covariances, factors, log_determinants, singular)


def is_singular(covariance: Array) -> bool:
    """Return whether a covariance has no inverse, in any units of the features.

    Examples
    --------
    >>> is_singular(np.diag([1e-12, 1e12])), is_singular(np.ones((2, 2)))
    (False, True)
    """
    return cholesky_root(covariance) is None


def cholesky_root(covariance: Array) -> Array | None:
    """Return the lower triangular L with L L' = a covariance, or None if it is singular.

    The correlation matrix decides, so that features in very different units do not make a
    covariance singular.
    """
    variances = np.diagonal(covariance)
    if not (variances > 0).all():
        return None
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
    return root * deviations


def factorise(covariance: Array) -> tuple[Array, float]:
    """Return P with P P' = inverse of a covariance, and the logarithm of its determinant."""
    root: Any = np.linalg.cholesky(covariance)
    return _inverse_of_root(root)


def _inverse_of_root(root: Array) -> tuple[Array, float]:
    """Return the inverse of the transpose of L, and the logarithm of the determinant of L L'."""
    inverse = solve_triangular(root, np.eye(len(root)), lower=True).T
    return inverse, float(2 * np.log(np.diagonal(root)).sum())


def _fit_variances(means: Array, variances: Array, floor: float | None) -> GaussianClasses:
    """Return densities of uncorrelated features."""
    singular: NDArray[np.bool_] = ~np.all(variances > 0, axis=1)
    if floor:
        variances[singular] = np.maximum(variances[singular], floor)
    usable = ~singular if not floor else np.ones_like(singular)
    factors, log_determinants = np.zeros_like(variances), np.zeros(len(variances))
    factors[usable] = 1 / np.sqrt(variances[usable])
    log_determinants[usable] = np.log(variances[usable]).sum(axis=1)
    return GaussianClasses(means, variances, factors, log_determinants, singular)


def _lift(covariance: Array, floor: float) -> tuple[Array, Array, float]:
    """Raise the eigenvalues to the floor; return covariance, inverse factor, log determinant."""
    eigenvalues, vectors = np.linalg.eigh(covariance)
    eigenvalues = np.maximum(eigenvalues, floor)
    root = vectors * np.sqrt(eigenvalues)
    return root @ root.T, vectors / np.sqrt(eigenvalues), float(np.log(eigenvalues).sum())
