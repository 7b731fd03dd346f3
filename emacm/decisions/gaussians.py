"""Gaussian densities of the classes: covariances, log densities and their gradients.

`class_moments` collects counts, means and scatter, which merge exactly; `class_gaussians` computes
densities from them, shrunk if wanted; `GaussianClasses.log_densities` evaluates Eq. (2.44) of [1]_.

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

from emacm.calibration.left_out import Array, Indices


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
        with np.errstate(over="ignore", invalid="ignore"):
            white = (self._whiten(X - mean, k) for k, mean in enumerate(self.means))
            squares = np.array([np.einsum("rf,rf->r", each, each) for each in white])
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
            white = self._whiten(X - mean, k)
            gradients[:, k] = -(white * factor if factor.ndim == 1 else white @ factor.T)
        return gradients

    def _whiten(self, deviations: Array, k: int) -> Array:
        """Scale deviations from the mean of class k, one row per recording, to unit variance."""
        factor = self.factors[k % len(self.factors)]
        return deviations * factor if factor.ndim == 1 else deviations @ factor


def class_gaussians(
    moments: ClassMoments,
    covariance: str = "full",
    shrinkage: Any = None,
    recordings: tuple[Array, Indices] | None = None,
    *,
    floored: bool | None = None,
) -> GaussianClasses:
    """Compute the densities of `CostSensitiveGaussianBayes` from moments.

    Parameters
    ----------
    moments : ClassMoments
        Of `class_moments` with the same `covariance` and `shrinkage`.
    covariance, shrinkage : str and None, float or str
        As for `CostSensitiveGaussianBayes`.
    recordings : tuple of (X, codes)
        Features, and the number of the class of each recording; needed for "auto" only.
    floored : bool, default=None
        Whether the eigenvalues of a singular covariance are raised to 1e-9 of the largest feature
        variance. None: without shrinkage.

    Returns
    -------
    GaussianClasses

    Examples
    --------
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
    least = 1e-9 * moments.feature_variances.max() if floored else 0.0
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
    moments: ClassMoments, shrinkage: Any, recordings: Any
) -> tuple[ArrayLike, ArrayLike]:
    """Return the arguments `coefficients` and `squared_scales` of `shrink`."""
    if shrinkage == "auto":
        X, codes = recordings
        return ledoit_wolf_coefficients(X, codes, moments.means, pooled=moments.pooled)
    if shrinkage == "oas":
        variances = diagonals(moments.scatter) / np.maximum(moments.group_counts, 1)[:, np.newaxis]
        variances = np.where(variances > 0, variances, 1.0)
        scales = np.sqrt(variances)
        standard = moments.scatter / scales[:, :, np.newaxis] / scales[:, np.newaxis]
        pairs = zip(standard, moments.group_counts, strict=True)
        return [oas_coefficient(scatter, count) for scatter, count in pairs], variances
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
    inverse = solve_triangular(root, np.eye(len(root)), trans="T", lower=True)
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


def oas_coefficient(scatter: ArrayLike, count: float) -> float:
    """Return the coefficient of Oracle Approximating Shrinkage, from second moments only [1]_.

    Parameters
    ----------
    scatter : array-like of shape (n_features, n_features)
        Scatter or covariance, in any scale.
    count : float
        Number of recordings.

    Returns
    -------
    coefficient : float
        Fraction of the spherical target, 0 to 1, as in `sklearn.covariance.oas`.

    References
    ----------
    .. [1] Chen, Wiesel, Eldar and Hero, Shrinkage algorithms for MMSE covariance
       estimation, IEEE Trans. Signal Process. 58 (2010), Eq. (23), without its terms 2/p
       as in scikit-learn.

    Examples
    --------
    >>> round(oas_coefficient([[3.0, 1.0], [1.0, 1.0]], 10), 6)
    0.636364
    """
    S = np.asarray(scatter, dtype=np.float64)
    n_features = len(S)
    mean_square, squared_mean = np.mean(S**2), (np.trace(S) / n_features) ** 2
    excess = (count + 1) * (mean_square - squared_mean / n_features)
    if n_features == 1 or mean_square == 0:
        return 0.0
    return float(min(1.0, (mean_square + squared_mean) / excess)) if excess > 0 else 1.0


def ledoit_wolf_coefficients(
    X: Array, codes: Indices, means: Array, *, pooled: bool
) -> tuple[Array, Array]:
    """Return Ledoit-Wolf coefficients of standardised features, as in scikit-learn's LDA.

    The coefficient depends on fourth moments of the recordings.

    Parameters
    ----------
    X : ndarray of shape (n_recordings, n_features)
        Features.
    codes : ndarray of shape (n_recordings,)
        Number of the class of each recording.
    means : ndarray of shape (n_classes, n_features)
        Mean of each class.
    pooled : bool
        One coefficient for the deviations from the class means, all classes together.

    Returns
    -------
    coefficients : ndarray of shape (n_groups,)
        Fraction of the target in each covariance, 0 to 1.
    squared_scales : ndarray of shape (n_groups, n_features)
        Variances by which the features were standardised; 1 for a constant feature.

    Examples
    --------
    >>> X = np.random.default_rng(0).normal(size=(8, 3))
    >>> ledoit_wolf_coefficients(X, np.zeros(8, int), X.mean(axis=0)[None], pooled=False)[0]
    array([1.])
    """
    # Imported here: it takes 0.1 s and is rarely needed.
    from sklearn.covariance import ledoit_wolf_shrinkage
    from sklearn.preprocessing import StandardScaler

    groups = [X - means[codes]] if pooled else [X[codes == k] for k in range(len(means))]
    coefficients, squared_scales = np.zeros(len(groups)), np.ones((len(groups), X.shape[1]))
    for group, rows in enumerate(groups):
        if len(rows) > 1:
            scaler = StandardScaler().fit(rows)
            coefficients[group] = ledoit_wolf_shrinkage(scaler.transform(rows))
            squared_scales[group] = scaler.scale_**2
    return coefficients, squared_scales


def shrink(
    covariances: Array,
    coefficients: ArrayLike,
    squared_scales: ArrayLike = 1.0,
    factors: ArrayLike = 1.0,
) -> Array:
    """Shrink covariances towards uncorrelated features of equal (scaled) variance.

    (1 - c) f S + c m diag(v), where m is the mean over the features of f S_jj / v_j. With
    f = v = 1 this is `sklearn.covariance.shrunk_covariance`.

    Parameters
    ----------
    covariances : ndarray of shape (n_groups, n_features, n_features) or (n_groups, n_features)
        S, or the diagonals.
    coefficients : float or array-like of shape (n_groups,)
        c, 0..1.
    squared_scales : float or array-like of shape (n_groups, n_features), default=1.0
        v, in squared units of the features.
    factors : float or array-like of shape (n_groups,), default=1.0
        f, such as the inverse of the divisor if S is a scatter.

    Returns
    -------
    shrunk : ndarray of the shape of `covariances`
        Shrunk covariances, or their diagonals.

    Examples
    --------
    >>> shrink(np.array([[[3.0, 1.0], [1.0, 1.0]]]), 0.5)
    array([[[2.5, 0.5],
            [0.5, 1.5]]])
    """
    share, factors = (np.atleast_1d(each)[:, np.newaxis] for each in (coefficients, factors))
    scaled = diagonals(covariances) * (factors / squared_scales)
    target = share * (scaled.sum(axis=1, keepdims=True) / scaled.shape[1]) * squared_scales
    kept = (1 - share) * factors
    if covariances.ndim == 2:
        return kept * covariances + target
    shrunk = kept[:, :, np.newaxis] * covariances
    shrunk.reshape(len(shrunk), -1)[:, :: shrunk.shape[-1] + 1] += target
    return shrunk


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
                "covariance or shrinkage has changed since the last fit or partial_fit, and the "
                "moments kept of earlier recordings do not suffice for the new choice. Call fit."
            )
        counts = self.counts + other.counts
        share = np.divide(other.counts, counts, out=np.zeros_like(counts), where=counts > 0)
        step = other.means - self.means  # a class without recordings has the mean 0, of no weight
        means = self.means + share[:, np.newaxis] * step
        weight = self.counts * share
        if self.scatter.ndim == 2:  # variances only
            between = weight[:, np.newaxis] * step**2
        else:
            between = np.einsum("k,kf,kg->kfg", weight, step, step)
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
    codes: Indices,
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
