"""Gaussian classes: moments that merge exactly, covariances, log densities.

`ClassMoments` holds what the recordings of each class have in common; `fit_gaussians`
makes densities of it; `GaussianClasses.log_densities` evaluates them, Eq. (2.44) of [1]_.

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.1.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_triangular

from emacm.decisions.blocks import in_blocks
from emacm.decisions.discriminants import LinearDiscriminants, linear_discriminants
from emacm.decisions.distances import ClassDistances, class_distances
from emacm.decisions.moments import ClassMoments, class_moments, diagonals
from emacm.decisions.shrinkage import ledoit_wolf_coefficients, oas_coefficient, shrink

__all__ = [
    "FLOOR",
    "ClassMoments",
    "GaussianClasses",
    "class_moments",
    "fit_gaussians",
    "is_singular",
    "ledoit_wolf_coefficients",
    "oas_coefficient",
    "shrink",
]

Array = NDArray[np.float64]

FLOOR = 1e-9  # least eigenvalue of a singular covariance, per largest feature variance


@dataclass(frozen=True)
class GaussianClasses:
    """Gaussian densities, ready to evaluate.

    Attributes
    ----------
    means : ndarray of shape (n_classes, n_features)
        Mean of each class.
    covariances : ndarray of shape (n_groups, n_features, n_features) or (n_groups, n_features)
        Covariance of each class, or the one of all (`n_groups` = 1), or their diagonals.
    factors : ndarray of the shape of `covariances`
        P with P P' = inverse of the covariance (whitens by a product from the right).
    log_determinants : ndarray of shape (n_groups,)
        Logarithm of the determinant of each covariance.
    singular : ndarray of bool, shape (n_groups,)
        Where the covariance was singular; raised to the floor if there was one, else its
        factor is zero and means nothing.
    distances : ClassDistances
        The same means and factors, prepared for evaluation.
    discriminants : LinearDiscriminants or None
        If one covariance serves all classes, and they are accurate.
    """

    means: Array
    covariances: Array
    factors: Array
    log_determinants: Array
    singular: NDArray[np.bool_]
    distances: ClassDistances = field(init=False, repr=False)
    discriminants: LinearDiscriminants | None = field(init=False, repr=False)

    def __post_init__(self) -> None:
        linear = None
        if len(self.factors) < len(self.means) and self.factors.ndim == 3:
            deviations = np.sqrt(np.diagonal(self.covariances[0]))
            linear = linear_discriminants(self.means, self.factors[0], deviations)
        object.__setattr__(self, "distances", class_distances(self.means, self.factors))
        object.__setattr__(self, "discriminants", linear)

    def log_densities(self, X: Array) -> Array:
        """Logarithm of the density of each class, Eq. (2.44), shape (n_recordings, n_classes)."""
        n_rows, n_classes = self.distances.n_rows, len(self.means)
        return in_blocks(lambda rows: self.log_terms(rows).T, X, n_rows, n_classes)

    def log_terms(self, X: Array, log_weights: ArrayLike = 0.0) -> Array:
        """Logarithm of weight times density for a block, shape (n_classes, n_rows).

        Classes first, as the work arrays of `emacm.decisions.distances` have them.
        """
        constant = X.shape[1] * np.log(2 * np.pi) + self.log_determinants
        terms = self.distances.squares(X)
        terms *= -0.5
        terms += np.reshape(log_weights - 0.5 * constant, (-1, 1))
        return terms

    def log_scores(self, X: Array, log_weights: Array) -> Array:
        """As `log_terms`, up to one number per recording, which no posterior depends on."""
        linear = self.discriminants
        scores = None if linear is None else linear.scores(X, log_weights)
        return self.log_terms(X, log_weights) if scores is None else scores


def fit_gaussians(
    moments: ClassMoments,
    coefficients: ArrayLike = 0.0,
    squared_scales: ArrayLike = 1.0,
    *,
    diagonal: bool = False,
    floor: float | None = None,
) -> GaussianClasses:
    """Estimate covariances, Eq. (2.46), shrink them and factorise them.

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
    >>> X = np.array([[0.0], [2.0], [5.0], [7.0]])
    >>> gaussians = fit_gaussians(class_moments(X, np.array([0, 0, 1, 1]), 2))
    >>> gaussians.log_densities(np.array([[1.0]])).round(3)
    array([[-1.266, -7.516]])
    """
    scatter = diagonals(moments.scatter) if diagonal else moments.scatter
    free = np.maximum(moments.divisors, 0.0)
    inverse = np.divide(1.0, free, out=np.zeros_like(free), where=free > 0)
    covariances = scatter * inverse.reshape(-1, *(1,) * (scatter.ndim - 1))
    covariances = shrink(covariances, coefficients, squared_scales)
    factors, log_determinants = np.zeros_like(covariances), np.zeros(len(covariances))
    singular = np.array([is_singular(S) for S in covariances])
    for group, bad in enumerate(singular):
        if not bad:
            factors[group], log_determinants[group] = _factorise(covariances[group])
        elif floor:
            covariances[group], factors[group], log_determinants[group] = _lift(
                covariances[group], floor
            )
    return GaussianClasses(moments.means, covariances, factors, log_determinants, singular)


def is_singular(covariance: Array) -> bool:
    """Whether a covariance, or a vector of variances, has no inverse.

    Judged on the correlation matrix, so that features of very different units are not
    called singular.

    Examples
    --------
    >>> is_singular(np.diag([1e-12, 1e12])), is_singular(np.ones((2, 2)))
    (False, True)
    """
    if not (diagonals(covariance[np.newaxis]) > 0).all():
        return True
    if covariance.ndim == 1:
        return False
    eigenvalues = np.linalg.eigvalsh(_correlation(covariance)[0])
    rounding = 10 * len(covariance) * np.finfo(np.float64).eps
    return bool(eigenvalues[0] <= rounding * eigenvalues[-1])


def _factorise(covariance: Array) -> tuple[Array, float]:
    """Return the inverse factor and the log determinant, by Cholesky of the correlations."""
    if covariance.ndim == 1:
        return 1 / np.sqrt(covariance), float(np.log(covariance).sum())
    correlation, deviations = _correlation(covariance)
    lower = np.linalg.cholesky(correlation)
    inverse = solve_triangular(lower, np.diag(1 / deviations), lower=True)
    return inverse.T, float(2 * (np.log(np.diagonal(lower)) + np.log(deviations)).sum())


def _lift(covariance: Array, floor: float) -> tuple[Array, Array, float]:
    """Raise the eigenvalues to the floor; return covariance, inverse factor, log determinant."""
    if covariance.ndim == 1:
        lifted = np.maximum(covariance, floor)
        return lifted, *_factorise(lifted)
    eigenvalues, vectors = np.linalg.eigh(covariance)
    eigenvalues = np.maximum(eigenvalues, floor)
    root = vectors * np.sqrt(eigenvalues)
    return root @ root.T, vectors / np.sqrt(eigenvalues), float(np.log(eigenvalues).sum())


def _correlation(covariance: Array) -> tuple[Array, Array]:
    deviations = np.sqrt(np.diagonal(covariance))
    return covariance / deviations / deviations[:, np.newaxis], deviations
