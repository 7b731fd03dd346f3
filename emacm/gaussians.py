"""Gaussian classes: moments that merge exactly, covariances, log densities.

`ClassMoments` holds what the recordings of each class have in common; `fit_gaussians`
makes densities of it; `GaussianClasses.log_densities` evaluates them, Eq. (2.44) of [1]_.

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_triangular
from sklearn.covariance import ledoit_wolf_shrinkage
from sklearn.preprocessing import StandardScaler

Array = NDArray[np.float64]

FLOOR = 1e-9  # least eigenvalue of a singular covariance, per largest feature variance
_LARGEST = 1e150  # of a feature, so that its square stays finite
_FARTHEST = np.finfo(np.float64).max / 4  # squared distance that stands for an overflow


@dataclass(frozen=True)
class ClassMoments:
    """Counts, means and scatter of the recordings of each class.

    Attributes
    ----------
    counts : ndarray of shape (n_classes,)
        Sum of the weights of the recordings, their number if every weight is 1.
    means : ndarray of shape (n_classes, n_features)
        Mean of each class, Eq. (2.45); zero for a class without recordings.
    scatter : ndarray of shape (n_groups, n_features, n_features) or (n_groups, n_features)
        Sum of the outer products of the deviations from the mean of the class; without
        the products of two features in the second shape.
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
                f"Moments to be merged must be of one kind, got scatter of shapes "
                f"{self.scatter.shape} and {other.scatter.shape}."
            )
        counts = self.counts + other.counts
        share = np.divide(other.counts, counts, out=np.zeros_like(counts), where=counts > 0)
        step = np.where(self.counts[:, np.newaxis] > 0, other.means - self.means, 0.0)
        means = np.where(
            self.counts[:, np.newaxis] > 0, self.means + share[:, np.newaxis] * step, other.means
        )
        between = _scatter_of_rows(step, self.counts * share, self.scatter.ndim)
        if self.pooled:
            between = between.sum(axis=0, keepdims=True)
        return ClassMoments(counts, means, self.scatter + other.scatter + between, self.pooled)

    @property
    def group_counts(self) -> Array:
        """Number of recordings behind each scatter, shape (n_groups,)."""
        return self.counts.sum(keepdims=True) if self.pooled else self.counts

    @property
    def divisors(self) -> Array:
        """N - 1 of each class, Eq. (2.46), or N - K of the K classes seen, if pooled."""
        if self.pooled:
            return self.group_counts - np.count_nonzero(self.counts)
        return self.counts - 1

    @property
    def feature_variances(self) -> Array:
        """Variance of each feature over all recordings, whatever their class, divided by N."""
        shares = self.counts / self.counts.sum()
        spread = self.means - shares @ self.means
        return _diagonals(self.scatter).sum(axis=0) / self.counts.sum() + shares @ spread**2


def class_moments(
    X: Array,
    codes: NDArray[np.intp],
    n_classes: int,
    *,
    sample_weight: Array | None = None,
    pooled: bool = False,
    variances_only: bool = False,
) -> ClassMoments:
    """Count, average and spread of the recordings of each class.

    Parameters
    ----------
    X : ndarray of shape (n_recordings, n_features)
        Features.
    codes : ndarray of shape (n_recordings,)
        Number of the class of each recording, 0..n_classes-1.
    n_classes : int
        Number of classes; some may have no recordings.
    sample_weight : ndarray of shape (n_recordings,), default=None
        How often each recording counts; None counts each once.
    pooled : bool, default=False
        Sum the scatter over the classes.
    variances_only : bool, default=False
        Leave out the products of two features.

    Returns
    -------
    moments : ClassMoments
        Counts, means and scatter.

    Raises
    ------
    ValueError
        If a feature is so large that its variance may overflow.

    Examples
    --------
    >>> X = np.array([[0.0], [2.0], [5.0]])
    >>> moments = class_moments(X, np.array([0, 0, 1]), 2)
    >>> moments.counts, moments.means.ravel(), moments.scatter.ravel()
    (array([2., 1.]), array([1., 5.]), array([2., 0.]))
    """
    _check_range(X)
    weight = np.ones(len(X)) if sample_weight is None else sample_weight
    n_features = X.shape[1]
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
        means[k] += w @ (rows - means[k]) / counts[k]  # a constant feature has no spread
        scaled = (rows - means[k]) * np.sqrt(w)[:, np.newaxis]
        spread = np.sum(scaled**2, axis=0) if variances_only else scaled.T @ scaled
        scatter[0 if pooled else k] += spread
    return ClassMoments(counts, means, scatter, pooled)


def oas_coefficient(scatter: ArrayLike, count: float) -> float:
    """Coefficient of Oracle Approximating Shrinkage, from second moments alone [1]_.

    Parameters
    ----------
    scatter : array-like of shape (n_features, n_features)
        Scatter or covariance; its scale does not matter.
    count : float
        Number of recordings.

    Returns
    -------
    coefficient : float
        Share of the spherical target, 0..1, as in `sklearn.covariance.oas`.

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
    largest = np.abs(S).max()
    if n_features == 1 or largest == 0:
        return 0.0
    S = S / largest  # squares neither overflow nor underflow
    mean_square, squared_mean = np.mean(S**2), (np.trace(S) / n_features) ** 2
    excess = (count + 1) * (mean_square - squared_mean / n_features)
    return float(min((mean_square + squared_mean) / excess, 1.0)) if excess > 0 else 1.0


def ledoit_wolf_coefficients(
    X: Array, codes: NDArray[np.intp], means: Array, *, pooled: bool
) -> tuple[Array, Array]:
    """Ledoit-Wolf shrinkage of standardised features, as in scikit-learn's LDA.

    Needs the recordings themselves: the coefficient depends on their fourth moments.

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
        Share of the target in each covariance, 0..1.
    squared_scales : ndarray of shape (n_groups, n_features)
        Variances the features were standardised by; 1 for a constant feature.

    Examples
    --------
    >>> X = np.random.default_rng(0).normal(size=(8, 3))
    >>> ledoit_wolf_coefficients(X, np.zeros(8, int), X.mean(axis=0)[None], pooled=False)[0]
    array([1.])
    """
    groups = [X - means[codes]] if pooled else [X[codes == k] for k in range(len(means))]
    coefficients, squared_scales = np.zeros(len(groups)), np.ones((len(groups), X.shape[1]))
    for group, rows in enumerate(groups):
        if len(rows) > 1:
            scaler = StandardScaler().fit(rows)
            coefficients[group] = ledoit_wolf_shrinkage(scaler.transform(rows))
            squared_scales[group] = scaler.scale_**2
    return coefficients, squared_scales


def shrink(covariances: Array, coefficients: ArrayLike, squared_scales: ArrayLike = 1.0) -> Array:
    """Mix covariances with uncorrelated features of equal (scaled) variance.

    (1 - c) S + c m diag(v), where m is the mean over the features of S_jj / v_j. With
    v = 1 this is `sklearn.covariance.shrunk_covariance`.

    Parameters
    ----------
    covariances : ndarray of shape (n_groups, n_features, n_features) or (n_groups, n_features)
        Covariances, or their diagonals.
    coefficients : float or array-like of shape (n_groups,)
        c, 0..1.
    squared_scales : float or array-like of shape (n_groups, n_features), default=1.0
        v, in squared units of the features.

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
    diagonals = _diagonals(covariances)
    share = np.broadcast_to(coefficients, len(covariances))[:, np.newaxis]
    scales = np.broadcast_to(squared_scales, diagonals.shape)
    target = share * np.mean(diagonals / scales, axis=1, keepdims=True) * scales
    if covariances.ndim == 2:
        return (1 - share) * covariances + target
    shrunk = (1 - share[:, :, np.newaxis]) * covariances
    features = np.arange(covariances.shape[-1])
    shrunk[:, features, features] += target
    return shrunk


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
    """

    means: Array
    covariances: Array
    factors: Array
    log_determinants: Array
    singular: NDArray[np.bool_]

    def log_densities(self, X: Array) -> Array:
        """Logarithm of the density of each class, Eq. (2.44), shape (n_recordings, n_classes)."""
        distances = np.empty((len(X), len(self.means)))
        with np.errstate(over="ignore", invalid="ignore"):
            for k, mean in enumerate(self.means):
                factor = self.factors[k % len(self.factors)]  # the only one, if tied
                centred = X - mean
                white = centred * factor if factor.ndim == 1 else centred @ factor
                distances[:, k] = np.sum(white**2, axis=1)
        distances[~(distances < _FARTHEST)] = _FARTHEST
        constant = X.shape[1] * np.log(2 * np.pi) + self.log_determinants
        return -0.5 * (distances + constant)


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
    scatter = _diagonals(moments.scatter) if diagonal else moments.scatter
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
    if not (_diagonals(covariance[np.newaxis]) > 0).all():
        return True
    if covariance.ndim == 1:
        return False
    eigenvalues = np.linalg.eigvalsh(_correlation(covariance)[0])
    rounding = 10 * len(covariance) * np.finfo(np.float64).eps
    return bool(eigenvalues[0] <= rounding * eigenvalues[-1])


def _check_range(X: Array) -> None:
    bad = np.abs(X) > _LARGEST
    if bad.any():
        recording, feature = np.unravel_index(int(np.argmax(bad)), bad.shape)
        raise ValueError(
            f"Features must be at most {_LARGEST:g} in size, so that their variances are finite; "
            f"got {X[recording, feature]:g} at recording {recording}, feature {feature}. "
            f"Bring the features to ordinary units first."
        )


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


def _diagonals(matrices: Array) -> Array:
    """Return the diagonals of a stack of matrices, or a stack of diagonals as it is."""
    return matrices if matrices.ndim == 2 else np.diagonal(matrices, axis1=1, axis2=2)


def _scatter_of_rows(rows: Array, weight: Array, ndim: int) -> Array:
    """Return one weighted outer product (or square, if `ndim` is 2) per row."""
    if ndim == 2:
        return weight[:, np.newaxis] * rows**2
    return weight[:, np.newaxis, np.newaxis] * rows[:, :, np.newaxis] * rows[:, np.newaxis, :]
