"""Typicality of a recording relative to the training: distances and their calibration.

Three distances to the classes are combined. The distance *inside* the discriminant space (the span
of the differences between class means) shows unknown states most clearly. The distance *outside* of
it shows deviations that are unlike any difference between classes; large deviations of few features
count less in it, because a level or a slope differs so between runs of one machine. The *largest*
deviation of a single feature shows a new spectral line. Distances are compared with those of
training recordings that are left out together with their group, and not with the chi-square
distribution: in 176 dimensions its 99 % quantile is exceeded by one known recording in five of runs
that were not trained on.

The constants were chosen by leaving runs out within runs 1 to 4 of the Cranfield actuator and on
simulated machines (120 recordings of 60 units): ``python benchmarks/unknown.py``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, logsumexp, stdtr, stdtrit

from emacm.calibration.left_out import Array, Indices, check_judged, left_out
from emacm.decisions.gaussians import class_gaussians, class_moments


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
        """Return the probability that a known recording is at least as far, in (0, 1].

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
        at, mean = upper_share(degrees, self.share)
        excess = (values[beyond] - self.peaks.threshold) / self.peaks.mean_excess
        # At most 1, but for rounding.
        tail = np.minimum(stdtr(degrees, -(at + mean * excess)) / self.share, 1.0)
        found[beyond] = (self.peaks.n_peaks + 1) / total * tail
        return np.maximum(found, np.finfo(np.float64).tiny)  # however far it is


def student_tail(values: Array, weight: Array, expected: float | None = None) -> StudentTail:
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
        Mean excess that is expected before any value is seen. None: 0.7 standard deviations of
        the values. It counts as 20 peaks.

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
        expected = 0.7 * float(np.sqrt(np.average(spread**2, weights=weight)))
    n_expected = 20.0
    peaks = peaks_over_threshold(values, weight, expected, n_expected)
    return StudentTail(values, weight_from, peaks, 0.2, n_expected)


def peaks_over_threshold(values: Array, weight: Array, expected: float, n_expected: float) -> Peaks:
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
    threshold = float(values[np.argmax(above <= 0.2 * weight.sum() * (1 + 1e-12))])
    beyond = values > threshold
    n_peaks = float(weight[beyond].sum())
    excess = float(weight[beyond] @ (values[beyond] - threshold))
    mean = (excess + n_expected * expected) / (n_peaks + n_expected)
    return Peaks(threshold, max(n_peaks, 1.0), max(mean, 1e-3))  # equal values have no tail


def upper_share(degrees: float, share: float) -> tuple[float, float]:
    """Return the quantile of Student's t above which a share lies, and the mean excess over it."""
    at = -float(stdtrit(degrees, share))
    log_density = gammaln((degrees + 1) / 2) - gammaln(degrees / 2) - np.log(degrees * np.pi) / 2
    log_density -= (degrees + 1) / 2 * np.log1p(at**2 / degrees)
    mean = (degrees + at**2) / (degrees - 1) * np.exp(log_density) / share
    return at, float(mean - at)


@dataclass(frozen=True)
class ClassDistances:
    """Distances to classes with a common covariance, in standard deviations.

    Attributes
    ----------
    means : ndarray of shape (n_classes, n_features)
        Mean of each class.
    factor : ndarray of shape (n_features, n_features)
        P with P P' = inverse of the covariance within the classes.
    deviations : ndarray of shape (n_features,)
        Standard deviation of each feature within the classes, moderated.
    directions : ndarray of shape (n_features, n_directions)
        Features times these are the coordinates in the discriminant space, of unit covariance.
    """

    means: Array
    factor: Array
    deviations: Array
    directions: Array

    def log_squares(self, X: Array) -> tuple[Array, Array, Array]:
        """Return logarithms of squared distances inside, outside, and of the largest deviation.

        Parameters
        ----------
        X : ndarray of shape (n_recordings, n_features)
            Features.

        Returns
        -------
        inside : ndarray of shape (n_classes, n_recordings)
            Of the distance to each class within the discriminant space.
        outside : ndarray of shape (n_recordings,)
            Of the distance from the discriminant space, of deviations (see `_reduce_large`) from
            the class that is nearest inside.
        largest : ndarray of shape (n_recordings,)
            Of the largest deviation of one feature from that class.
        """
        finite = np.finfo(np.float64).max / 4
        with np.errstate(over="ignore", invalid="ignore"):
            to_means = [np.square((X - m) @ self.directions).sum(axis=1) for m in self.means]
            inside = np.fmin(to_means, finite)  # replaces overflows, and differences of two of them
            scaled = (X - self.means[inside.argmin(axis=0)]) / self.deviations
            largest = np.fmin(np.square(scaled).max(axis=1), finite)
            away = _reduce_large(scaled) * self.deviations
            outside = np.square(away @ self.factor).sum(axis=1)
            outside -= np.square(away @ self.directions).sum(axis=1)
        squares = inside, np.clip(np.fmin(outside, finite), 0.0, None), largest
        # Within 0.03 standard deviations all recordings are equally near.
        inside, outside, largest = (np.log(square + 1e-3) for square in squares)
        return inside, outside, largest

    def nearest(self, X: Array) -> Indices:
        """Return the number of the class that is nearest inside the discriminant space."""
        return self.log_squares(X)[0].argmin(axis=0)

    def raised(self, code: int) -> Array:
        """Return by how much each state raises features above one class, 0 where it does not.

        Parameters
        ----------
        code : int
            Number of the class.

        Returns
        -------
        ndarray of shape (n_classes, n_features)
        """
        return np.clip(self.means - self.means[code], 0.0, None)

    def beyond_class(self, X: Array, codes: Indices) -> tuple[Array, Indices]:
        """Return how far recordings are from their class towards a second fault.

        Powers of two faults add, so that a logarithmic level is about the larger one: a second
        fault adds to the mean of the class what `raised` states. The deviation from the class is
        projected on it by a matched filter [1]_, in standard deviations.

        Parameters
        ----------
        X : ndarray of shape (n_recordings, n_features)
            Features.
        codes : ndarray of int, shape (n_recordings,)
            Number of the class of each recording.

        Returns
        -------
        deviations : ndarray of shape (n_recordings,)
            Largest over the other classes; -inf if none raises a feature.
        others : ndarray of int, shape (n_recordings,)
            Number of that class.

        References
        ----------
        .. [1] Kay, Fundamentals of Statistical Signal Processing II: Detection Theory (1998),
           section 4.4.
        """
        found = np.full((len(self.means), len(X)), -np.inf)
        for own in np.unique(codes):
            rows, steps = np.flatnonzero(codes == own), self.raised(own) @ self.factor
            sizes = np.linalg.norm(steps, axis=1)
            others = np.flatnonzero(sizes)
            with np.errstate(over="ignore", invalid="ignore"):
                scaled = (X[rows] - self.means[own]) @ self.factor
                projected = (steps[others] / sizes[others, np.newaxis]) @ scaled.T
            found[np.ix_(others, rows)] = projected
        return found.max(axis=0), found.argmax(axis=0)

    def squares(self, X: Array, code: int) -> Array:
        """Return the squared distances to one class over all features, shape (n_recordings,)."""
        return np.square((X - self.means[code]) @ self.factor).sum(axis=1)

    def square_gradient(self, X: Array, code: int) -> Array:
        """Return the gradient of `squares`, shape (n_recordings, n_features)."""
        return 2 * (X - self.means[code]) @ self.factor @ self.factor.T


@dataclass(frozen=True)
class Typicality:
    """The fraction of left-out training recordings that are at least as far from all classes.

    Attributes
    ----------
    distances : ClassDistances
        To the classes, fitted to all recordings.
    levels : ndarray of shape (3, n_classes)
        Usual log distance of each class.
    peaks : tuple of Peaks
        Of each log distance of left-out recordings above the level of their class.
    used : ndarray of bool, shape (3,)
        Distances that exist: none inside if there is one class, none outside if the discriminant
        space contains all features.
    combined : StudentTail
        Distribution of the combined distance of left-out recordings to their nearest class.
    feature_range : ndarray of shape (2, n_features)
        Smallest and largest value of each feature.
    left_out : ndarray of shape (n_recordings,)
        Typicality of each training recording, judged without its group; NaN if it was not.
    second : StudentTail or None
        Distribution of `ClassDistances.beyond_class` of left-out recordings. None if no state
        raises features above another, and in models of earlier versions.
    """

    distances: ClassDistances
    levels: Array
    peaks: tuple[Peaks, ...]
    used: NDArray[np.bool_]
    combined: StudentTail
    feature_range: Array
    left_out: Array
    second: StudentTail | None = None

    def __call__(self, X: Array) -> Array:
        """Return the typicality of recordings, in (0, 1].

        Parameters
        ----------
        X : ndarray of shape (n_recordings, n_features)
            Features.

        Returns
        -------
        ndarray of shape (n_recordings,)
        """
        logs = self.distances.log_squares(X)
        return self.combined.survival(_combine(logs, self.levels, self.peaks, self.used))

    def second_classes(self, X: Array, codes: Indices) -> Indices:
        """Return the class whose lines recordings have beyond those of their own; -1 if none.

        Parameters
        ----------
        X : ndarray of shape (n_recordings, n_features)
            Features.
        codes : ndarray of int, shape (n_recordings,)
            Number of the class of each recording.

        Returns
        -------
        ndarray of int, shape (n_recordings,)
        """
        if self.second is None:
            return np.full(len(X), -1)
        values, others = self.distances.beyond_class(X, codes)
        return np.where(self.second.survival(values) < 0.02, others, -1)


def fit_typicality(X: Array, codes: Indices, units: Indices, weight: Array) -> Typicality:
    """Calibrate the distances to the classes on left-out groups.

    Parameters
    ----------
    X : ndarray of shape (n_recordings, n_features)
        Features.
    codes : ndarray of int, shape (n_recordings,)
        Number of the class of each recording.
    units : ndarray of int, shape (n_recordings,)
        Number of the group of each recording.
    weight : ndarray of shape (n_recordings,)
        Number of times each recording is counted, positive.

    Returns
    -------
    Typicality

    Raises
    ------
    ValueError
        If no class has recordings in two groups, so that none can be left out.
    """
    n_classes = int(codes.max()) + 1
    distances = _fit_distances(X, codes, units, weight)
    inside = np.full((n_classes, len(X)), np.inf)
    outside, largest, beyond = np.zeros((3, len(X)))
    judged = np.zeros(len(X), dtype=bool)
    for others, rows in left_out(codes, units):
        seen, renumbered = np.unique(codes[others], return_inverse=True)
        if len(others) <= len(seen):  # no variance within classes
            continue
        part = _fit_distances(X[others], renumbered, units[others], weight[others])
        inside[np.ix_(seen, rows)], outside[rows], largest[rows] = part.log_squares(X[rows])
        beyond[rows], _ = part.beyond_class(X[rows], part.nearest(X[rows]))
        judged[rows[np.isin(codes[rows], seen)]] = True
    check_judged(judged)
    n_features, n_directions = distances.directions.shape
    used = np.array([n_directions > 0, n_directions < n_features, True])
    left = np.flatnonzero(judged)
    logs = inside[:, left], outside[left], largest[left]
    own = np.array([inside[codes[left], left], *logs[1:]])
    levels = _class_levels(own, codes[left], units[left], weight[left], n_classes)
    # Expected mean excesses count as five peaks each: with 12 units of two recordings, the mean
    # excess of the five peaks alone was 0.02 to 1.7.
    peaks = tuple(
        peaks_over_threshold(values - level[codes[left]], weight[left], mean, n_expected=5.0)
        for values, level, mean in zip(own, levels, (0.5, 0.15, 0.2), strict=True)
    )
    values = _combine(logs, levels, peaks, used)
    combined = student_tail(values, weight[left], expected=0.85)
    found = np.full(len(X), np.nan)
    found[left] = combined.survival(values)
    feature_range = np.array([X.min(axis=0), X.max(axis=0)])
    some = left[np.isfinite(beyond[left])]
    second = student_tail(beyond[some], weight[some]) if len(some) else None
    return Typicality(distances, levels, peaks, used, combined, feature_range, found, second)


def _fit_distances(X: Array, codes: Indices, units: Indices, weight: Array) -> ClassDistances:
    """Fit one covariance of all classes, shrunk by Ledoit and Wolf's coefficient."""
    n_classes = int(codes.max()) + 1
    moments = class_moments(X, codes, n_classes, weight, "tied")
    gaussians = class_gaussians(moments, "tied", "auto", (X, codes), floored=True)
    factor, means = gaussians.factors[0], gaussians.means
    centred = means - means.mean(axis=0)
    degrees = len(np.unique(np.column_stack([codes, units]), axis=0)) - n_classes
    variances = np.diagonal(gaussians.covariances[0])
    deviations = _moderated_deviations(variances, centred, degrees)
    _, sizes, directions = np.linalg.svd(centred @ factor, full_matrices=False)
    basis = directions[: np.count_nonzero(sizes[: n_classes - 1] > 1e-9 * sizes[0])].T
    return ClassDistances(means, factor, deviations, factor @ basis)


def _reduce_large(scaled: Array) -> Array:
    """Make large deviations, in standard deviations, smaller.

    Their squares become those of the pseudo-Huber function ``2 d^2 (sqrt(1 + (z / d)^2) - 1)`` with
    d = 3: z^2 where z is small, 2 d abs(z) where it is large. The squared distance is then no
    longer determined by the few features of heavy tails [1]_, [2]_.

    References
    ----------
    .. [1] Huber, Robust estimation of a location parameter, Annals of Mathematical Statistics
       35 (1964).
    .. [2] Hartley and Zisserman, Multiple View Geometry in Computer Vision, 2nd edition (2003),
       section A6.8 (the pseudo-Huber function).
    """
    return scaled * np.sqrt(2 / (1 + np.sqrt(1 + np.square(scaled / 3.0))))


def _moderated_deviations(variances: Array, centred: Array, degrees: int) -> Array:
    """Return standard deviations of the features within classes.

    From few groups some features have by chance a variance that is far too small, and the largest
    deviation of a feature is then that of such a feature. Variances are therefore moderated [1]_:
    combined with an expected one of three degrees of freedom, the same fraction of the total
    variance for all features.

    References
    ----------
    .. [1] Smyth, Linear models and empirical Bayes methods for assessing differential expression,
       Statistical Applications in Genetics and Molecular Biology 3 (2004), section 3.
    """
    total = variances + np.einsum("kf,kf->f", centred, centred) / len(centred)
    expected = (variances / total).sum() / len(total) * total
    return np.sqrt((degrees * variances + 3 * expected) / (degrees + 3))


def _class_levels(
    own: Array, codes: NDArray[np.intp], groups: NDArray[np.intp], weight: Array, n_classes: int
) -> Array:
    """Return the mean log distances of each class to itself, shape (3, n_classes).

    A class that was measured in g groups has the weight g, against one group of all classes.
    """
    judged = np.zeros((n_classes, groups.max() + 1), bool)
    judged[codes, groups] = True
    n_groups = judged.sum(axis=1)
    totals = np.maximum(np.bincount(codes, weight, n_classes), np.finfo(np.float64).tiny)
    overall = own @ weight[:, np.newaxis] / weight.sum()
    of_class = np.eye(n_classes)[codes] * weight[:, np.newaxis]
    return overall + n_groups / (n_groups + 1) * ((own - overall) @ of_class / totals)


def distance_scales(
    levels: Array, peaks: tuple[Peaks, ...], used: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Return the factor of each log distance, and what is subtracted of it then for each class.

    Distances are in units of their mean excess; one outside the discriminant space counts less, the
    largest deviation of a single feature only if it is extreme.
    """
    slopes = np.array((1.0, 0.6, 1.5) if used[0] else (0.0, 1.0, 1.0))
    slopes /= [of_one.mean_excess for of_one in peaks]
    thresholds = np.array([[of_one.threshold] for of_one in peaks])
    return slopes, (levels + thresholds) * slopes[:, np.newaxis] + [[0.0], [0.0], [8.0]]


def _combine(
    logs: tuple[Array, Array, Array],
    levels: Array,
    peaks: tuple[Peaks, ...],
    used: NDArray[np.bool_],
) -> Array:
    """Combine the log distances to each class, and return that to the nearest.

    The logarithm of the sum of the exponentials is nearly the largest of its terms.
    """
    slopes, offsets = distance_scales(levels, peaks, used)
    terms = [logs[k] * slopes[k] - offsets[k][:, np.newaxis] for k in np.flatnonzero(used)]
    return np.min(logsumexp(terms, axis=0), axis=0)
