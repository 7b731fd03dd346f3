"""Temperature of posteriors: calibration of over-confident densities on left-out groups."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]

_RANGE = 1e-6, 1e6  # of the exponents that are tried
_PRECISION = 1e-12  # of the logarithm of the temperature
_ITERATIONS = 1000  # at most; where the loss spans hundreds of decades, far more than usual
_IMPOSSIBLE = -1e300  # replaces -inf, whose product with a probability of 0 is not defined


def fit_temperature(
    log_densities: Array, codes: NDArray[np.intp], weight: Array, priors: Array
) -> float:
    """Return the temperature of least log loss, with posteriors ``prior * density ** (1 / T)``.

    Correlated features, and recordings that are near copies, make densities over-confident; a
    temperature above 1 widens them [1]_. Priors are not scaled, so that they keep their meaning
    when they change. The log loss is convex in 1 / T: its only minimum is where
    the derivative is 0.

    Parameters
    ----------
    log_densities : ndarray of shape (n_recordings, n_classes)
        Of recordings under models that were fitted without them; -inf for classes that these
        models do not contain.
    codes : ndarray of shape (n_recordings,)
        Number of the true class, with a finite log density.
    weight : ndarray of shape (n_recordings,)
        Number of times each recording is counted.
    priors : ndarray of shape (n_classes,)
        Prior probabilities, positive.

    Returns
    -------
    float
        Between 1e-6 and 1e6; 1 if there are no recordings, or one class only.

    References
    ----------
    .. [1] Guo, Pleiss, Sun and Weinberger, On calibration of modern neural networks, ICML 2017.

    Examples
    --------
    >>> logs = 10 * np.array([[0.0, -1.0], [-1.0, 0.0], [0.0, -1.0], [0.0, -1.0]])
    >>> round(fit_temperature(logs, np.array([0, 1, 0, 1]), np.ones(4), np.full(2, 0.5)), 3)
    9.102
    """
    if not len(codes) or log_densities.shape[1] < 2:
        return 1.0
    scores = np.maximum(log_densities - log_densities.max(axis=1, keepdims=True), _IMPOSSIBLE)
    true = scores[np.arange(len(codes)), codes]
    scores = np.ascontiguousarray(scores.T)  # sums over few classes are slow along rows

    shares = weight / weight.sum()

    @cache  # `brentq` computes the values at both ends again
    def slope(log_exponent: float) -> float:
        """Return the derivative of the log loss by the exponent 1 / T."""
        joint = np.exp(np.exp(log_exponent) * scores)
        joint *= priors[:, np.newaxis]
        mean = np.einsum("kr,kr->r", joint, scores) / joint.sum(axis=0)
        return float(shares @ (mean - true))

    low, high = np.log(_RANGE)
    if slope(low) >= 0:
        return float(np.exp(-low))
    if slope(0.0) > 0:
        high = 0.0
    elif slope(high) <= 0:
        return float(np.exp(-high))
    return float(np.exp(-brentq(slope, low, high, xtol=_PRECISION, maxiter=_ITERATIONS)))
