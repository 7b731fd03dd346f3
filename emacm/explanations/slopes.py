"""Gradients of log odds and of expected costs, averaged along straight lines.

An integrated gradient is the mean gradient along a line, multiplied by the difference of its ends.
For two Gaussian classes the log odds are quadratic, and the mean gradient is the gradient at the
midpoint; expected costs are integrated numerically.
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
    """Return the logarithm of prior times density, shape (n_recordings, n_classes)."""
    return classifier.predict_joint_log_proba(with_names(classifier, features))


def log_odds(
    classifier: CostSensitiveGaussianBayes, features: Array, code: int, other: int
) -> Array:
    """Return the log odds of one class (by index) against another [nats], shape (n_recordings,)."""
    joint = joint_log_proba(classifier, features)
    return joint[:, code] - joint[:, other]


def cost_saved(classifier: CostSensitiveGaussianBayes, features: Array, costs: Array) -> Array:
    """Return the expectation of costs of the classes, shape (n_recordings,)."""
    return softmax(joint_log_proba(classifier, features), axis=1) @ costs


def mean_slope_of_log_odds(
    classifier: CostSensitiveGaussianBayes, start: Array, end: Array, code: int, other: int
) -> Array:
    """Return the mean gradient of the log odds along lines.

    Parameters
    ----------
    classifier : CostSensitiveGaussianBayes
        Fitted.
    start, end : ndarray of shape (n_recordings, n_features)
        Ends of each line.
    code, other : int
        Indices of the two classes.

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
    slopes = classifier.log_density_gradient(with_names(classifier, middle))
    return slopes[:, code] - slopes[:, other]


def mean_slope_of_cost(
    classifier: CostSensitiveGaussianBayes, start: Array, end: Array, costs: Array
) -> Array:
    """Return the mean gradient of an expected cost along one line.

    Parameters
    ----------
    classifier : CostSensitiveGaussianBayes
        Fitted.
    start, end : ndarray of shape (1, n_features)
        Ends of the line.
    costs : ndarray of shape (n_classes,)
        Cost if a class is true.

    Returns
    -------
    ndarray of shape (1, n_features)
        Unit of the cost per unit of the feature.

    Examples
    --------
    >>> model = CostSensitiveGaussianBayes().fit([[0.0], [2.0], [5.0], [9.0]], [0, 0, 1, 1])
    >>> start, end, costs = np.array([[1.0]]), np.array([[6.0]]), np.array([0.0, 10.0])
    >>> total = mean_slope_of_cost(model, start, end, costs) * (end - start)
    >>> change = cost_saved(model, end, costs) - cost_saved(model, start, costs)
    >>> bool(np.isclose(total[0, 0], change[0]))
    True
    """
    step = end - start

    def slope(fraction: float) -> Array:
        point = start + fraction * step
        posterior = softmax(joint_log_proba(classifier, point)[0])
        weights = posterior * (costs - posterior @ costs)
        return weights @ classifier.log_density_gradient(with_names(classifier, point))[0]

    accuracy = 1e-12 * np.abs(costs).max() / max(np.abs(step).sum(), np.finfo(float).tiny)
    points = _crossings(classifier, start, end)
    mean, _ = quad_vec(slope, 0.0, 1.0, epsabs=accuracy, epsrel=1e-12, norm="max", points=points)
    return mean[np.newaxis]


def _crossings(classifier: CostSensitiveGaussianBayes, start: Array, end: Array) -> list[float]:
    """Return where along the line two classes are equally probable: the risk is steep there."""
    line = np.concatenate([start, (start + end) / 2, end])
    first, middle, last = joint_log_proba(classifier, line)[:, classifier.priors_ > 0]
    curvature, rise = 2 * (first + last - 2 * middle), 4 * middle - 3 * first - last
    roots = [
        float(root.real)
        for i, k in combinations(range(len(first)), 2)
        for root in np.roots([q[i] - q[k] for q in (curvature, rise, first)])
        if 0 < root.real < 1  # complex roots mark where two classes are nearly equally probable
    ]
    return sorted(set(roots))
