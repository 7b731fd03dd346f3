"""Temperature of posteriors: calibration of over-confident densities on left-out groups."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

Array = NDArray[np.float64]

_RANGE = 1e-6, 1e6  # of the exponents that are tried
_TAIL = 4.0  # exponent of the heavy tail, chosen on runs 1 to 4 (benchmarks/unknown.py)
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

    def slope(log_exponent: float) -> float:
        """Return the derivative of the log loss by the exponent 1 / T."""
        joint = np.exp(np.exp(log_exponent) * scores)
        joint *= priors[:, np.newaxis]
        with np.errstate(over="ignore"):
            mean = np.einsum("kr,kr->r", joint, scores) / joint.sum(axis=0)
            return float(weight @ (mean - true))

    low, high = np.log(_RANGE)
    if slope(low) >= 0:
        return float(np.exp(-low))
    if slope(high) <= 0:
        return float(np.exp(-high))
    return float(np.exp(-brentq(slope, low, high, xtol=1e-12)))


def fit_temperature_and_tail(
    log_densities: Array, codes: NDArray[np.intp], weight: Array, priors: Array
) -> tuple[float, float]:
    """Return the temperature and the tail of `tempered` of least log loss.

    A temperature fits recordings between two classes; some lie farther on the wrong side than it
    allows. Of no tail and a tail of 4, the one of less log loss is returned.

    Parameters
    ----------
    log_densities, codes, weight, priors
        As for `fit_temperature`.

    Returns
    -------
    temperature, tail : float
        The tail is inf if densities are only raised to the power of 1 / T.

    Examples
    --------
    >>> logs = np.array([[0.0, -30.0]] * 19 + [[0.0, -60.0]])
    >>> fit_temperature_and_tail(logs, np.repeat([0, 1], [19, 1]), np.ones(20), np.full(2, 0.5))[1]
    4.0
    """
    temperature = fit_temperature(log_densities, codes, weight, priors)
    if not len(codes) or log_densities.shape[1] < 2 or not 2e-6 < temperature < 5e5:
        return temperature, np.inf
    scores = np.maximum(log_densities - log_densities.max(axis=1, keepdims=True), _IMPOSSIBLE)
    scores, recordings = np.ascontiguousarray(scores.T), np.arange(len(codes))

    def log_loss(log_temperature: float, tail: float) -> float:
        logs = tempered(scores, np.exp(log_temperature), tail, axis=0)
        return float(weight @ (np.log(priors @ np.exp(logs)) - logs[codes, recordings]))

    at = np.log(temperature)
    heavy = minimize_scalar(
        log_loss, (at - 3, at + 1), (at - 3, at + 1), (_TAIL,), "bounded", options={"xatol": 1e-4}
    )
    if heavy.fun < log_loss(at, np.inf):
        return float(np.exp(heavy.x)), _TAIL
    return temperature, np.inf


def tempered(
    log_densities: Array, temperature: float, tail: float = np.inf, axis: int = 1
) -> Array:
    """Return the logarithms of densities to the power of 1 / T, with a heavy tail.

    Where the density p of a class is far below the largest, m, its ratio is not ``(p / m) ** (1 /
    T)`` but ``(1 + log(m / p) / (a T)) ** -a``, which is nearly the same for small differences and
    decreases as a power of the distance, as the ratio of two densities of Student's t does.

    Parameters
    ----------
    log_densities : ndarray
        Of recordings; -inf is kept.
    temperature, tail : float
        T and a, positive.
    axis : int, default=1
        Of the classes.

    Examples
    --------
    >>> logs = np.array([[0.0, -0.02, -200.0]])
    >>> tempered(logs, 2.0).tolist(), tempered(logs, 2.0, 4.0).round(2).tolist()
    ([[0.0, -0.01, -100.0]], [[0.0, -0.01, -13.03]])
    """
    if np.isinf(tail):
        return log_densities / temperature
    largest = log_densities.max(axis=axis, keepdims=True)
    largest = np.where(np.isfinite(largest), largest, 0.0)
    lag = (largest - log_densities) / (tail * temperature)
    return largest / temperature - tail * np.log1p(lag)
