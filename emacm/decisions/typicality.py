"""Typicality of a recording relative to the training: distances and their calibration.

Three distances to the classes are combined. The distance *inside* the discriminant space (the span
of the differences between class means) shows unknown states most clearly. The distance *outside* of
it shows deviations that are unlike any difference between classes. The *largest* deviation of a
single feature shows a new spectral line. Distances are compared with those of training recordings
that are left out together with their group, and not with the chi-square distribution: in 176
dimensions its 99 % quantile is exceeded by one known recording in five of runs that were not
trained on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emacm.decisions.gaussians import GaussianClasses
from emacm.decisions.left_out import LeftOut, Training
from emacm.decisions.tails import (
    Peaks,
    StudentTail,
    peaks_over_threshold,
    student_tail,
)

Array = NDArray[np.float64]

LEAST = np.finfo(np.float64).tiny  # typicality is positive, however far a recording is
_RESOLUTION = 1e-3  # squared distance, in standard deviations, below which all are equally near
_FARTHEST = np.finfo(np.float64).max / 4  # replaces squared distances that overflow
_BLOCK = 256  # recordings at a time, whose intermediate results stay in the cache
# Slope and offset of each distance, in units of its mean excess, chosen by leaving runs out
# within runs 1 to 4 of a real actuator (benchmarks/unknown.py): a deviation outside the
# discriminant space counts half, that of a single feature only if it is extreme.
_SLOPES = np.array([1.0, 0.5, 1.5])
_OFFSETS = np.array([0.0, 0.0, 8.0])
# Expected mean excess of each log distance and of the combined one, and the number of peaks that
# it counts as: usual values of simulated machines (120 recordings of 60 units). With 12 units of
# two recordings, the mean excess of the 5 peaks alone was 0.02 to 1.7.
_EXPECTED = 0.5, 0.15, 0.2
_N_EXPECTED = 5.0
_EXPECTED_COMBINED = 0.85
_N_MODERATING = 3.0  # degrees of freedom of the expected variance of a feature


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
    seen : ndarray of bool, shape (n_classes,)
        Classes that have recordings.
    basis : ndarray of shape (n_features, n_directions)
        Orthonormal basis of the discriminant space, after multiplication by `factor`.
    """

    means: Array
    factor: Array
    deviations: Array
    seen: NDArray[np.bool_]
    basis: Array

    def log_squares(self, X: Array) -> tuple[Array, Array, Array]:
        """Return logarithms of squared distances inside, outside, and of the largest deviation.

        Parameters
        ----------
        X : ndarray of shape (n_recordings, n_features)
            Features.

        Returns
        -------
        inside : ndarray of shape (n_recordings, n_classes)
            Of the distance to each class within the discriminant space; inf for a class without
            recordings.
        outside : ndarray of shape (n_recordings,)
            Of the distance from the discriminant space, the same for all classes.
        largest : ndarray of shape (n_recordings,)
            Of the largest deviation of one feature from the class that is nearest inside.
        """
        means = self.means[self.seen]
        centre = means.mean(axis=0)
        with np.errstate(over="ignore", invalid="ignore"):
            white = (X - centre) @ self.factor
            inner, corners = white @ self.basis, (means - centre) @ self.factor @ self.basis
            squares = np.einsum("rd,rd->r", inner, inner)
            distances = squares[:, np.newaxis] - 2 * inner @ corners.T + np.sum(corners**2, axis=1)
            outside = np.einsum("rf,rf->r", white, white) - squares
            # fmin replaces NaN, the difference of two overflows.
            distances = np.maximum(np.fmin(distances, _FARTHEST), 0.0)
            outside = np.maximum(np.fmin(outside, _FARTHEST), 0.0)
            deviations = X - np.take(means, distances.argmin(axis=1), axis=0)
            deviations /= self.deviations
            largest = np.maximum(deviations.max(axis=1), -deviations.min(axis=1))
            largest = np.fmin(largest**2, _FARTHEST)
        inside = np.full((len(X), len(self.means)), np.inf)
        inside[:, self.seen] = distances
        return (
            np.log(inside + _RESOLUTION),
            np.log(outside + _RESOLUTION),
            np.log(largest + _RESOLUTION),
        )

    def nearest(self, X: Array) -> NDArray[np.intp]:
        """Return the number of the class that is nearest inside the discriminant space."""
        return self.log_squares(X)[0].argmin(axis=1)

    def squares(self, X: Array, code: int) -> Array:
        """Return the squared distances to one class over all features, shape (n_recordings,)."""
        white = (X - self.means[code]) @ self.factor
        return np.einsum("rf,rf->r", white, white)

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
    """

    distances: ClassDistances
    levels: Array
    peaks: tuple[Peaks, ...]
    used: NDArray[np.bool_]
    combined: StudentTail
    feature_range: Array

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
        found = np.empty(len(X))
        for start in range(0, len(X), _BLOCK):
            block = slice(start, start + _BLOCK)
            logs = self.distances.log_squares(X[block])
            combined = _combine(logs, self.levels, self.peaks, self.used)
            found[block] = np.maximum(self.combined.survival(combined), LEAST)
        return found


def fit_typicality(
    training: Training, gaussians: GaussianClasses, left_out: Sequence[LeftOut]
) -> Typicality:
    """Calibrate the distances to the classes on left-out groups.

    Parameters
    ----------
    training : Training
        The recordings.
    gaussians : GaussianClasses
        Fitted to all recordings, with one covariance for all classes.
    left_out : sequence of LeftOut
        The same without each group.

    Returns
    -------
    Typicality

    Raises
    ------
    ValueError
        If no class has recordings in two groups, so that none can be left out.
    """
    numbers = np.unique(training.groups * training.n_classes + training.codes)
    pairs = np.column_stack([numbers % training.n_classes, numbers // training.n_classes])
    present = np.bincount(training.codes, minlength=training.n_classes) > 0
    distances = _class_distances(gaussians, present, _degrees(pairs))
    inside = np.full((len(training.X), training.n_classes), np.inf)
    others, judged = np.empty((2, len(training.X))), np.zeros(len(training.X), dtype=bool)
    for rows, fitted, seen in ((part.rows, part.gaussians, part.seen) for part in left_out):
        degrees = _degrees(pairs[pairs[:, 1] != training.groups[rows[0]]])
        parts = _class_distances(fitted, seen, degrees).log_squares(training.X[rows])
        inside[rows], others[0, rows], others[1, rows] = parts
        judged[rows] = seen[training.codes[rows]]
    if not judged.any():
        raise ValueError(
            "no class has recordings in two groups, so that no recording can be judged by others "
            "of its class. Give groups= with at least two groups in one class."
        )
    used = np.array([distances.basis.shape[1] > 0, np.diff(distances.basis.shape)[0] < 0, True])
    codes, weight = training.codes[judged], training.weight[judged]
    logs = inside[judged], *others[:, judged]
    own = np.array([np.take_along_axis(logs[0], codes[:, np.newaxis], 1)[:, 0], *logs[1:]])
    levels = _class_levels(own, codes, training.groups[judged], weight, training.n_classes)
    peaks = tuple(
        peaks_over_threshold(values - level[codes], weight, expected, _N_EXPECTED)
        for values, level, expected in zip(own, levels, _EXPECTED, strict=True)
    )
    values = _combine(logs, levels, peaks, used)
    combined = student_tail(values, weight, _EXPECTED_COMBINED)
    feature_range = np.array([training.X.min(axis=0), training.X.max(axis=0)])
    return Typicality(distances, levels, peaks, used, combined, feature_range)


def _degrees(pairs: NDArray[np.intp]) -> int:
    """Return the degrees of freedom of the variance between groups within classes.

    Of the pairs (class, group) that have recordings.
    """
    return len(pairs) - len(np.unique(pairs[:, 0]))


def _class_distances(
    gaussians: GaussianClasses, seen: NDArray[np.bool_], degrees: int
) -> ClassDistances:
    """Return the distances to the classes of Gaussian densities with one covariance.

    From few groups some features have by chance a variance that is far too small, and the largest
    deviation of a feature is then that of such a feature. Variances are therefore moderated [1]_:
    combined with an expected one, the same fraction of the total variance for all features.

    References
    ----------
    .. [1] Smyth, Linear models and empirical Bayes methods for assessing differential expression,
       Statistical Applications in Genetics and Molecular Biology 3 (2004), section 3.
    """
    factor, means = gaussians.factors[0], gaussians.means
    variances = np.diagonal(gaussians.covariances[0])
    total = variances + means[seen].var(axis=0)
    expected = np.mean(variances / total) * total
    moderated = degrees * variances + _N_MODERATING * expected
    deviations = np.sqrt(moderated / (degrees + _N_MODERATING))
    centred = means[seen] - means[seen].mean(axis=0)
    _, sizes, directions = np.linalg.svd(centred @ factor, full_matrices=False)
    n_directions = np.count_nonzero(sizes > 1e-9 * sizes[0])
    basis = directions[: min(n_directions, len(centred) - 1)].T
    return ClassDistances(means, factor, deviations, seen, basis)


def _class_levels(
    own: Array, codes: NDArray[np.intp], groups: NDArray[np.intp], weight: Array, n_classes: int
) -> Array:
    """Return the mean log distances of each class to itself, shape (3, n_classes).

    A class that was measured in g groups has the weight g, against one group of all classes.
    """
    overall = np.average(own, axis=1, weights=weight)
    levels = np.repeat(overall[:, np.newaxis], n_classes, axis=1)
    for k in np.unique(codes):
        chosen = codes == k
        n_groups = len(np.unique(groups[chosen]))
        mean = np.average(own[:, chosen], axis=1, weights=weight[chosen])
        levels[:, k] += n_groups / (n_groups + 1) * (mean - overall)
    return levels


def _combine(
    logs: tuple[Array, Array, Array],
    levels: Array,
    peaks: tuple[Peaks, ...],
    used: NDArray[np.bool_],
) -> Array:
    """Combine the log distances to each class, and return that to the nearest.

    The logarithm of the sum of the exponentials is nearly the largest of its terms.
    """
    slopes = _SLOPES if used[0] else np.array([0.0, 1.0, 1.0])
    terms = []
    for number in np.flatnonzero(used):
        values = logs[number] if number == 0 else logs[number][:, np.newaxis]
        threshold = peaks[number].threshold
        scale = slopes[number] / peaks[number].mean_excess
        terms.append(values * scale - ((levels[number] + threshold) * scale + _OFFSETS[number]))
    largest = np.maximum.reduce(terms)
    with np.errstate(invalid="ignore"):  # inf - inf, of a class without recordings
        total = sum(np.exp(term - largest) for term in terms)
        return np.nanmin(largest + np.log(total), axis=1)
