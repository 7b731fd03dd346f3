"""Shrinkage of covariances: coefficients and target."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm.decisions.moments import diagonals

Array = NDArray[np.float64]


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
    X: Array, codes: NDArray[np.intp], means: Array, *, pooled: bool
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


def population_eigenvalues(values: ArrayLike, divisor: int) -> Array:
    """Correct the eigenvalues of a covariance that has few degrees of freedom.

    The largest of a sample are too large, the smallest too small. Those beyond the range of
    eigenvalues of uncorrelated features of one variance are moved to the value that would have
    caused them [1]_; the others are shrunk towards their mean, as far as their variance is that of
    equal ones [2]_. Their sum, which is unbiased, is kept. That variance is the mean of the
    corrected others; it is iterated until it stays the same.

    Parameters
    ----------
    values : array-like of shape (n_features,)
        Eigenvalues, at least 0, in any order.
    divisor : int
        Degrees of freedom of the covariance.

    Returns
    -------
    corrected : ndarray of shape (n_features,)
        In the same order.

    References
    ----------
    .. [1] Donoho, Gavish and Johnstone, Optimal shrinkage of eigenvalues in the spiked covariance
       model, Annals of Statistics 46 (4), 2018, Eq. (1.10).
    .. [2] Ledoit and Wolf, A well-conditioned estimator for large-dimensional covariance
       matrices, Journal of Multivariate Analysis 88 (2004).

    Examples
    --------
    >>> population_eigenvalues([9.0, 1.4, 1.1, 0.9, 0.6], 20).round(3)
    array([8.693, 1.077, 1.077, 1.077, 1.077])
    """
    values = np.asarray(values)
    ratio, level = len(values) / divisor, values.mean()  # of the features that are equal
    corrected = np.empty(len(values))
    while True:
        above = values > level * (1 + np.sqrt(ratio)) ** 2
        half = (values[above] / level + 1 - ratio) / 2
        corrected[above] = level * (half + np.sqrt(half**2 - values[above] / level))
        before, level = level, (values.sum() - corrected[above].sum()) / np.count_nonzero(~above)
        if before - level <= 1e-12 * values.mean():  # it only decreases
            break
    corrected[~above] = level
    spread = values[~above] - values[~above].mean()
    variance = np.mean(spread**2)
    if variance > ratio * level**2:  # more than equal features would show
        corrected[~above] += (1 - ratio * level**2 / variance) * spread
    return corrected


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
