"""Gradients of log odds and of expected costs, averaged along straight lines.

An integrated gradient is the mean gradient along a line, times the line. Between two Gaussian
classes the log odds are quadratic, and the mean is the gradient half-way; expected costs are
integrated numerically.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad_vec
from scipy.special import softmax

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.explanations.feature_traces import with_names

Array = NDArray[np.float64]


def joint_log_proba(classifier: CostSensitiveGaussianBayes, features: Array) -> Array:
    """Logarithm of prior times density, shape (n_recordings, n_classes)."""
    return classifier.predict_joint_log_proba(with_names(classifier, features))


def log_odds(
    classifier: CostSensitiveGaussianBayes, features: Array, code: int, other: int
) -> Array:
    """Log odds of one class (by number) against another [nats], shape (n_recordings,)."""
    joint = joint_log_proba(classifier, features)
    return joint[:, code] - joint[:, other]


def cost_saved(classifier: CostSensitiveGaussianBayes, features: Array, prices: Array) -> Array:
    """Weigh `prices` of the classes by the posterior, shape (n_recordings,)."""
    return softmax(joint_log_proba(classifier, features), axis=1) @ prices


def mean_slope_of_log_odds(
    classifier: CostSensitiveGaussianBayes, start: Array, end: Array, code: int, other: int
) -> Array:
    """Average the gradient of the log odds along lines.

    Parameters
    ----------
    classifier : CostSensitiveGaussianBayes
        Fitted.
    start, end : ndarray of shape (n_recordings, n_features)
        Ends of each line.
    code, other : int
        Numbers of the two classes.

    Returns
    -------
    ndarray of shape (n_recordings, n_features)
        Nats per unit of the feature.

    Examples
    --------
    >>> model = CostSensitiveGaussianBayes().fit([[0.0], [2.0], [5.0], [9.0]], [0, 0, 1, 1])
    >>> start, end = np.array([[1.0]]), np.array([[6.0]])
    >>> total = mean_slope_of_log_odds(model, start, end, 1, 0) * (end - start)
    >>> change = log_odds(model, end, 1, 0) - log_odds(model, start, 1, 0)
    >>> bool(np.isclose(total[0, 0], change[0]))
    True
    """
    middle = (start + end) / 2  # the gradient is linear along the line
    return _slopes(classifier, middle, code) - _slopes(classifier, middle, other)


def mean_slope_of_cost(
    classifier: CostSensitiveGaussianBayes, start: Array, end: Array, prices: Array
) -> Array:
    """Average the gradient of an expected cost along one line.

    Parameters
    ----------
    classifier : CostSensitiveGaussianBayes
        Fitted.
    start, end : ndarray of shape (1, n_features)
        Ends of the line.
    prices : ndarray of shape (n_classes,)
        Cost if a class is true.

    Returns
    -------
    ndarray of shape (1, n_features)
        Unit of the cost per unit of the feature.

    Examples
    --------
    >>> model = CostSensitiveGaussianBayes().fit([[0.0], [2.0], [5.0], [9.0]], [0, 0, 1, 1])
    >>> start, end, prices = np.array([[1.0]]), np.array([[6.0]]), np.array([0.0, 10.0])
    >>> total = mean_slope_of_cost(model, start, end, prices) * (end - start)
    >>> change = cost_saved(model, end, prices) - cost_saved(model, start, prices)
    >>> bool(np.isclose(total[0, 0], change[0]))
    True
    """
    step = end - start

    def slope(share: float) -> Array:
        point = start + share * step
        posterior = softmax(joint_log_proba(classifier, point)[0])
        weights = posterior * (prices - posterior @ prices)
        return weights @ np.array([_slopes(classifier, point, k)[0] for k in range(len(prices))])

    accuracy = 1e-12 * np.abs(prices).max() / max(np.abs(step).sum(), np.finfo(float).tiny)
    points = _crossings(classifier, start, end)
    mean, _ = quad_vec(slope, 0.0, 1.0, epsabs=accuracy, epsrel=1e-12, norm="max", points=points)
    return mean[np.newaxis]


def _slopes(classifier: CostSensitiveGaussianBayes, features: Array, code: int) -> Array:
    """Gradient of the log density of a class, Eq. (2.44): -S^-1 (z - mean)."""
    # The factors that the densities were computed with, so that contributions add up to them.
    factors = classifier._rule.gaussians.factors
    factor, centred = factors[code % len(factors)], features - classifier.means_[code]
    return -(centred * factor**2 if factor.ndim == 1 else centred @ factor @ factor.T)


def _crossings(classifier: CostSensitiveGaussianBayes, start: Array, end: Array) -> list[float]:
    """Find where along the line two classes are equally probable: there the risk is steep."""
    line = np.concatenate([start, (start + end) / 2, end])
    first, middle, last = joint_log_proba(classifier, line)[:, classifier.priors_ > 0]
    bend, rise = 2 * (first + last - 2 * middle), 4 * middle - 3 * first - last
    roots = [
        float(root.real)
        for i, k in combinations(range(len(first)), 2)
        for root in np.roots([q[i] - q[k] for q in (bend, rise, first)])
        if 0 < root.real < 1  # complex ones, too, mark where two classes come near
    ]
    return sorted(set(roots))
