"""Gradients of log odds and of expected costs, averaged along straight lines.

An integrated gradient is the mean gradient along a line, multiplied by the difference of its ends.
For two Gaussian classes the log odds are quadratic, and the mean gradient is the gradient at the
midpoint; expected costs are integrated numerically (Gauss-Legendre, piecewise).
"""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.explanations.feature_traces import with_names

Array = NDArray[np.float64]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)
_NODES, _WEIGHTS = (_NODES + 1) / 2, _WEIGHTS / 2  # Gauss-Legendre quadrature from 0 to 1


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
    step, total = end - start, np.zeros(start.shape[1])
    for low, high in pairwise([0.0, *_breakpoints(classifier, start, end), 1.0]):
        points = start + (low + (high - low) * _NODES[:, np.newaxis]) * step
        posterior = softmax(joint_log_proba(classifier, points), axis=1)
        change = posterior * (costs - posterior @ costs[:, np.newaxis])  # per log density
        slopes = classifier.log_density_gradient(with_names(classifier, points))
        total += (high - low) * np.einsum("n,nk,nkf->f", _WEIGHTS, change, slopes)
    return total[np.newaxis]


def _breakpoints(
    classifier: CostSensitiveGaussianBayes,
    start: Array,
    end: Array,
    *,
    range_of_odds: float = 40.0,
    step: float = 20.0,
) -> list[float]:
    """Return points between which the log odds of any two probable classes change little.

    A posterior changes only while log odds are within `range_of_odds` [nats]. This part may be much
    shorter than the line; it is divided into steps [nats].
    """
    line = np.concatenate([start, (start + end) / 2, end])
    first, middle, last = joint_log_proba(classifier, line)[:, classifier.priors_ > 0]
    parabolas = np.array([2 * (first + last - 2 * middle), 4 * middle - 3 * first - last, first])
    points = set()
    for pair in combinations(range(len(first)), 2):
        for level in np.arange(-range_of_odds, range_of_odds + step, step):
            # Complex roots mark where the log odds are nearest to the level.
            for root in np.roots(parabolas[:, pair] @ [1, -1] - [0, 0, level]).real:
                joint = np.polyval(parabolas, root)
                if 0 < root < 1 and joint[list(pair)].max() >= joint.max() - range_of_odds:
                    points.add(float(root))
    return sorted(points)
