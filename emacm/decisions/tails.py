"""Distribution of left-out distances, with a model of the tail beyond the farthest of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_TAIL = 0.2  # fraction of the values that the model of the tail describes
_LEAST_EXCESS = 1e-3  # in log squared distance: equal values have no tail to estimate


@dataclass(frozen=True)
class ExponentialTail:
    """Empirical distribution whose tail is exponential: peaks over a threshold [1]_.

    The tail of log distances is exponential if that of distances follows a power law, which
    bounds no distance. With k peaks their mean excess is uncertain, and the predictive
    distribution of the next excess is ``(1 + excess / (k mean_excess)) ** -k`` [2]_.

    Attributes
    ----------
    values : ndarray of shape (n_values,)
        Sorted.
    weight_from : ndarray of shape (n_values + 1,)
        Sum of the weights of each value and all larger ones; the last is 0.
    threshold : float
        Above it the tail is modelled.
    n_peaks : float
        Sum of the weights above the threshold.
    mean_excess : float
        Of the peaks over the threshold.

    References
    ----------
    .. [1] Pickands, Statistical inference using extreme order statistics, Annals of Statistics
       3 (1975); an exponential tail is a generalised Pareto tail of shape 0.
    .. [2] Geisser, Predictive Inference (1993), section 3.1: exponential sampling, with a prior
       proportional to 1 / mean.
    """

    values: Array
    weight_from: Array
    threshold: float
    n_peaks: float
    mean_excess: float

    def survival(self, values: Array) -> Array:
        """Return the probability that a known recording is at least as far, in [0, 1].

        Parameters
        ----------
        values : ndarray
            Of any shape.

        Returns
        -------
        ndarray of the shape of `values`
            ``(n + 1) / (N + 1)`` if n of N values are at least as large, up to the threshold.
        """
        total = self.weight_from[0] + 1
        counted = (self.weight_from[np.searchsorted(self.values, values, "left")] + 1) / total
        excess = np.maximum((values - self.threshold) / self.mean_excess, 0.0)
        tail = (self.n_peaks + 1) / total * (1 + excess / self.n_peaks) ** -self.n_peaks
        return np.where(excess > 0, tail, counted)


def exponential_tail(values: Array, weight: Array) -> ExponentialTail:
    """Fit a tail to the largest fifth of some values.

    Parameters
    ----------
    values : ndarray of shape (n_values,)
        At least one.
    weight : ndarray of shape (n_values,)
        Number of times each value is counted, positive.

    Returns
    -------
    ExponentialTail

    Examples
    --------
    >>> tail = exponential_tail(np.arange(10.0), np.ones(10))
    >>> tail.threshold, tail.n_peaks, tail.mean_excess
    (7.0, 2.0, 1.5)
    >>> tail.survival(np.array([-1.0, 5.0, 8.5])).round(3)
    array([1.   , 0.545, 0.121])
    """
    order = np.argsort(values, kind="stable")
    values, weight = values[order], weight[order]
    weight_from = np.append(np.cumsum(weight[::-1])[::-1], 0.0)
    # The least value above which at most a fifth of the weight lies.
    above = weight_from[np.searchsorted(values, values, "right")]
    threshold = float(values[np.argmax(above <= _TAIL * weight_from[0] * (1 + 1e-12))])
    peaks = values > threshold
    n_peaks = float(weight[peaks].sum())
    mean = float(weight[peaks] @ (values[peaks] - threshold)) / n_peaks if n_peaks else 0.0
    return ExponentialTail(
        values, weight_from, threshold, max(n_peaks, 1.0), max(mean, _LEAST_EXCESS)
    )
