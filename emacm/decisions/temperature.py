"""Temperature of posteriors: calibration of over-confident densities on left-out groups."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_RANGE = 1e-6, 1e6  # of the exponents that are tried
_PRECISION = 1e-12  # of the logarithm of the temperature
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
    true = np.take_along_axis(scores, codes[:, np.newaxis], axis=1)[:, 0]
    scores = np.ascontiguousarray(scores.T)  # sums over few classes are slow along rows

    def slopes(log_exponent: float) -> tuple[float, float]:
        """Return the derivative of the log loss by the exponent 1 / T, and its slope."""
        joint = np.exp(np.exp(log_exponent) * scores)
        joint *= priors[:, np.newaxis]
        joint /= joint.sum(axis=0)
        with np.errstate(over="ignore", invalid="ignore"):
            mean = np.einsum("kr,kr->r", joint, scores)
            joint *= scores
            spread = np.einsum("kr,kr->r", joint, scores) - mean**2
            return float(weight @ (mean - true)), float(weight @ spread) * np.exp(log_exponent)

    low, high = np.log(_RANGE)
    at, (value, rise) = 0.0, slopes(0.0)
    if value >= 0 and slopes(low)[0] >= 0:
        return float(np.exp(-low))
    if value <= 0 and slopes(high)[0] <= 0:
        return float(np.exp(-high))
    while True:  # Newton's method, or a bisection where it leaves the bounds
        low, high = (low, at) if value > 0 else (at, high)
        following = at - value / rise if np.isfinite(rise) and rise > 0 else np.inf
        if not low < following < high:
            following = (low + high) / 2
        if abs(following - at) <= _PRECISION:
            return float(np.exp(-following))
        at = following
        value, rise = slopes(at)
