"""Distribution of left-out distances, with a model of the tail beyond the farthest of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, stdtr, stdtrit

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Peaks:
    """The largest fifth of some values, as peaks over a threshold [1]_.

    Attributes
    ----------
    threshold : float
        Above it lie the peaks.
    n_peaks : float
        Sum of their weights.
    mean_excess : float
        Of the peaks over the threshold: estimate from the peaks and from what was expected.

    References
    ----------
    .. [1] Pickands, Statistical inference using extreme order statistics, Annals of Statistics
       3 (1975).
    """

    threshold: float
    n_peaks: float
    mean_excess: float


@dataclass(frozen=True)
class StudentTail:
    """Empirical distribution whose tail is that of Student's t.

    If values, such as logarithms of distances, are normal above the threshold, and their
    standard deviation is known from a few peaks only, then the predictive distribution of the next
    one is Student's t [1]_. Its degrees of freedom are the number of peaks, with those that the
    expected mean excess counts as: a tail from few peaks is wider.

    Attributes
    ----------
    values : ndarray of shape (n_values,)
        Sorted.
    weight_from : ndarray of shape (n_values + 1,)
        Sum of the weights of each value and all larger ones; the last is 0.
    peaks : Peaks
        The values that the tail describes.
    share : float
        Fraction of the values that the model of the tail describes.
    n_expected : float
        Number of peaks that the expected mean excess counts as.

    References
    ----------
    .. [1] Geisser, Predictive Inference (1993), section 3.1.
    """

    values: Array
    weight_from: Array
    peaks: Peaks
    share: float
    n_expected: float

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
        found = (self.weight_from[np.searchsorted(self.values, values, "left")] + 1) / total
        beyond = values > self.peaks.threshold
        degrees = self.peaks.n_peaks + self.n_expected
        at, mean = _upper_share(degrees, self.share)
        excess = (values[beyond] - self.peaks.threshold) / self.peaks.mean_excess
        tail = np.minimum(
            stdtr(degrees, -(at + mean * excess)) / self.share, 1.0
        )  # 1 but for rounding
        found[beyond] = (self.peaks.n_peaks + 1) / total * tail
        return found


def student_tail(
    values: Array,
    weight: Array,
    expected: float | None = None,
    *,
    n_expected: float = 20.0,
    share: float = 0.2,
    usual_excess: float = 0.7,
) -> StudentTail:
    """Fit a tail to the largest fifth of some values.

    Of a normal distribution the mean excess over the upper fifth is 0.56 standard deviations, of an
    exponential one 1; of log distances in simulations and on a real actuator 0.5 to 0.85.

    Parameters
    ----------
    values : ndarray of shape (n_values,)
        At least one.
    weight : ndarray of shape (n_values,)
        Number of times each value is counted, positive.
    expected : float, default=None
        Mean excess that is expected before any value is seen. None: `usual_excess` standard
        deviations of the values.
    n_expected : float, default=20.0
        Number of peaks that the expected mean excess counts as.
    share : float, default=0.2
        Fraction of the values that the tail describes.
    usual_excess : float, default=0.7
        See `expected`.

    Returns
    -------
    StudentTail

    Examples
    --------
    >>> tail = student_tail(np.arange(10.0), np.ones(10), expected=1.5)
    >>> tail.peaks
    Peaks(threshold=7.0, n_peaks=2.0, mean_excess=1.5)
    >>> tail.survival(np.array([-1.0, 5.0, 8.5, 12.0])).round(5)
    array([1.     , 0.54545, 0.10763, 0.00605])
    """
    order = np.argsort(values)
    values, weight = values[order], weight[order]
    weight_from = np.append(np.cumsum(weight[::-1])[::-1], 0.0)
    if expected is None:
        spread = values - np.average(values, weights=weight)
        expected = usual_excess * float(np.sqrt(np.average(spread**2, weights=weight)))
    peaks = peaks_over_threshold(values, weight, expected, n_expected, share)
    return StudentTail(values, weight_from, peaks, share, n_expected)


def peaks_over_threshold(
    values: Array, weight: Array, expected: float, n_expected: float, share: float = 0.2
) -> Peaks:
    """Return the mean excess of the largest fifth of some values.

    The estimate of few peaks is uncertain by as much as 100 %. It is therefore combined with an
    expected value, as by a conjugate prior for the mean of exponential values.

    Parameters
    ----------
    values : ndarray of shape (n_values,)
        At least one.
    weight : ndarray of shape (n_values,)
        Number of times each value is counted, positive.
    expected : float
        Expected mean excess.
    n_expected : float
        Number of peaks that it counts as.
    share : float, default=0.2
        Largest fraction of the weight above the threshold.

    Returns
    -------
    Peaks

    Examples
    --------
    >>> peaks_over_threshold(np.arange(10.0), np.ones(10), expected=3.0, n_expected=1)
    Peaks(threshold=7.0, n_peaks=2.0, mean_excess=2.0)
    """
    order = np.argsort(values)
    values, weight = values[order], weight[order]
    # The least value above which at most a fifth of the weight lies.
    above = weight.sum() - np.cumsum(weight)
    threshold = float(values[np.argmax(above <= share * weight.sum() * (1 + 1e-12))])
    beyond = values > threshold
    n_peaks = float(weight[beyond].sum())
    excess = float(weight[beyond] @ (values[beyond] - threshold))
    mean = (excess + n_expected * expected) / (n_peaks + n_expected)
    return Peaks(threshold, max(n_peaks, 1.0), max(mean, 1e-3))  # equal values have no tail


def _upper_share(degrees: float, share: float) -> tuple[float, float]:
    """Return the quantile of Student's t above which a share lies, and the mean excess over it."""
    at = -float(stdtrit(degrees, share))
    log_density = gammaln((degrees + 1) / 2) - gammaln(degrees / 2) - np.log(degrees * np.pi) / 2
    log_density -= (degrees + 1) / 2 * np.log1p(at**2 / degrees)
    mean = (degrees + at**2) / (degrees - 1) * np.exp(log_density) / share
    return at, float(mean - at)
