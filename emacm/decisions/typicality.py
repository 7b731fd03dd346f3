"""Typicality of a recording relative to the training: distances and their calibration.

Three distances to the classes are combined. The distance *inside* the discriminant space (the span
of the differences between class means) shows unknown states most clearly. The distance *outside* of
it shows deviations that are unlike any difference between classes; large deviations of few features
count less in it, because a level or a slope differs so between runs of one machine. The *largest*
deviation of a single feature shows a new spectral line. Distances are compared with those of
training recordings that are left out together with their group, and not with the chi-square
distribution: in 176 dimensions its 99 % quantile is exceeded by one known recording in five of runs
that were not trained on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dtrmm, dtrsm
from scipy.linalg.lapack import dgeqrf, dorgqr

from emacm.decisions.gaussians import GaussianClasses
from emacm.decisions.left_out import LeftOut, Training
from emacm.decisions.tails import Peaks, StudentTail, peaks_over_threshold, student_tail

Array = NDArray[np.float64]

LEAST = np.finfo(np.float64).tiny  # typicality is positive, however far a recording is
_RESOLUTION = 1e-3  # squared distance, in standard deviations, below which all are equally near
_FARTHEST = np.finfo(np.float64).max / 4  # replaces squared distances that overflow
_INDEPENDENT = 1e-3  # relative length above which a direction need not be looked for
_BLOCK = 1024  # recordings at a time, so that large tables take no more memory
# Slope and offset of each distance, in units of its mean excess, chosen by leaving runs out
# within runs 1 to 4 of a real actuator (benchmarks/unknown.py): a deviation outside the
# discriminant space counts less, that of a single feature only if it is extreme.
_SLOPES = np.array([1.0, 0.6, 1.5])
_OFFSETS = np.array([0.0, 0.0, 8.0])
# Expected mean excess of each log distance and of the combined one, and the number of peaks that
# it counts as: usual values of simulated machines (120 recordings of 60 units). With 12 units of
# two recordings, the mean excess of the 5 peaks alone was 0.02 to 1.7.
_EXPECTED = 0.5, 0.15, 0.2
_N_EXPECTED = 5.0
_EXPECTED_COMBINED = 0.85
_LARGE = 3.0  # standard deviations of a feature, above which they count less outside
_N_MODERATING = 3.0  # degrees of freedom of the expected variance of a feature


@dataclass(frozen=True)
class ClassDistances:
    """Distances to classes with a common covariance, in standard deviations.

    Attributes
    ----------
    means : ndarray of shape (n_classes, n_features)
        Mean of each class.
    factor : ndarray of shape (n_features, n_features)
        Upper triangular P with P P' = inverse of the covariance within the classes.
    deviations : ndarray of shape (n_features,)
        Standard deviation of each feature within the classes, moderated.
    directions : ndarray of shape (n_features, n_directions)
        Features times these are the coordinates in the discriminant space, of unit covariance.
    corners : ndarray of shape (n_classes, n_directions)
        Coordinates of the means of the classes, from their common mean.
    """

    means: Array
    factor: Array
    deviations: Array
    directions: Array
    corners: Array

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

        def whiten(values: Array) -> Array:  # the transposes are not copied
            return np.asarray(dtrmm(1.0, self.factor.T, values.T, lower=1, overwrite_b=1).T)

        centre = self.means.mean(axis=0)
        of_classes = self.directions, self.corners, self.means - centre, self.deviations
        with np.errstate(over="ignore", invalid="ignore"):
            return _log_squares(*_squares(X - centre, whiten, *of_classes))

    def nearest(self, X: Array) -> NDArray[np.intp]:
        """Return the number of the class that is nearest inside the discriminant space."""
        return self.log_squares(X)[0].argmin(axis=0)

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
    training: Training, gaussians: GaussianClasses, left_out: Iterable[LeftOut]
) -> Typicality:
    """Calibrate the distances to the classes on left-out groups.

    Parameters
    ----------
    training : Training
        The recordings.
    gaussians : GaussianClasses
        Fitted to all recordings, with one covariance for all classes.
    left_out : iterable of LeftOut
        The classes without each group.

    Returns
    -------
    Typicality

    Raises
    ------
    ValueError
        If no class has recordings in two groups, so that none can be left out.
    """
    n_classes, groups = training.n_classes, training.groups
    measured = np.zeros((n_classes, groups.max() + 1), bool)  # classes in groups
    measured[training.codes, groups] = True
    n_groups = measured.sum(axis=1)
    degrees = n_groups.sum() - np.count_nonzero(n_groups)  # of the variance between groups
    distances = _class_distances(gaussians, degrees)
    squares, rows, judged = [], [], []
    for part in left_out:
        elsewhere = n_groups - measured[:, groups[part.rows[0]]]
        degrees = elsewhere.sum() - np.count_nonzero(elsewhere)
        squares.append(_left_out_squares(part, degrees))
        rows.append(part.rows)
        judged.append(part.seen[training.codes[part.rows]])
    if not any(map(np.any, judged)):
        raise ValueError(
            "no class has recordings in two groups, so that no recording can be judged by others "
            "of its class. Give groups= with at least two groups in one class."
        )
    n_features, n_directions = distances.directions.shape
    used = np.array([n_directions > 0, n_directions < n_features, True])
    known = np.concatenate(judged)
    left = np.concatenate(rows)[known]
    codes, weight = training.codes[left], training.weight[left]
    joined = (np.concatenate(found, axis=-1)[..., known] for found in zip(*squares, strict=True))
    logs = _log_squares(*joined)
    own = np.array([logs[0][codes, np.arange(len(codes))], *logs[1:]])
    levels = _class_levels(own, codes, groups[left], weight, n_classes)
    peaks = tuple(
        peaks_over_threshold(values - level[codes], weight, expected, _N_EXPECTED)
        for values, level, expected in zip(own, levels, _EXPECTED, strict=True)
    )
    values = _combine(logs, levels, peaks, used)
    combined = student_tail(values, weight, _EXPECTED_COMBINED)
    feature_range = np.array([training.X.min(axis=0), training.X.max(axis=0)])
    return Typicality(distances, levels, peaks, used, combined, feature_range)


def _class_distances(gaussians: GaussianClasses, degrees: int) -> ClassDistances:
    """Return the distances to the classes of Gaussian densities with one covariance."""
    factor, means = gaussians.factors[0], gaussians.means
    if gaussians.singular[0]:  # then it is not triangular
        factor = np.linalg.qr(factor[::-1].T)[1].T[::-1, ::-1]
    centred = means - means.mean(axis=0)
    deviations = _moderated_deviations(np.diagonal(gaussians.covariances[0]), centred, degrees)
    white = centred @ factor
    basis = _discriminant_basis(white)
    return ClassDistances(means, factor, deviations, factor @ basis, white @ basis)


def _left_out_squares(part: LeftOut, degrees: int) -> tuple[Array, Array, Array]:
    """Return the squares of `_squares` for one group; inside infinite for a class not seen.

    The origin lies among the features.
    """
    root, seen = part.root.T, part.seen
    means = part.means[seen]

    def whiten(values: Array) -> Array:  # the transposes are not copied
        return np.asarray(dtrsm(1.0, root, values.T, trans_a=1, overwrite_b=1).T)

    with np.errstate(over="ignore", invalid="ignore"):
        centred = means - means.mean(axis=0)
        deviations = _moderated_deviations(part.variances, centred, degrees)
        centred = whiten(centred)
        basis = _discriminant_basis(centred)
        directions = dtrsm(1.0, root, basis) if basis.size else basis
        squares = _squares(part.X, whiten, directions, means @ directions, means, deviations)
    if seen.all():
        return squares
    inside = np.full((len(seen), len(part.X)), np.inf)
    inside[seen] = squares[0]
    return inside, *squares[1:]


def _squares(
    X: Array,
    whiten: Callable[[Array], Array],
    directions: Array,
    corners: Array,
    means: Array,
    deviations: Array,
) -> tuple[Array, Array, Array]:
    """Return the squared distances inside, outside, and of the largest deviation.

    Of recordings in their own units, which `whiten` gives unit covariance, to classes whose means
    are given in their own units and, as corners, in the discriminant space. The origin of both is
    among the features, because squares are expanded.
    """
    inner = X @ directions
    inside = -2 * corners @ inner.T
    inside += np.einsum("kd,kd->k", corners, corners)[:, np.newaxis]
    inside += np.einsum("rd,rd->r", inner, inner)
    # fmin replaces NaN, the difference of two overflows.
    inside = np.maximum(np.fmin(inside, _FARTHEST, out=inside), 0.0, out=inside)
    away = np.take(means, inside.argmin(axis=0), axis=0)
    np.subtract(X, away, out=away)
    largest = _reduce_large(away, deviations)
    inner = away @ directions
    white = whiten(away)
    outside = np.einsum("rf,rf->r", white, white) - np.einsum("rd,rd->r", inner, inner)
    outside = np.maximum(np.fmin(outside, _FARTHEST), 0.0)
    return inside, outside, largest


def _reduce_large(away: Array, deviations: Array) -> Array:
    """Make large deviations smaller, in place, and return the largest square of each recording.

    In standard deviations, their squares become those of the pseudo-Huber function ``2 d^2 (sqrt(1
    + (z / d)^2) - 1)`` with d = 3: z^2 where z is small, 2 d abs(z) where it is large. The squared
    distance is then no longer determined by the few features of heavy tails [1]_, [2]_. The largest
    square is that of before.

    References
    ----------
    .. [1] Huber, Robust estimation of a location parameter, Annals of Mathematical Statistics
       35 (1964).
    .. [2] Hartley and Zisserman, Multiple View Geometry in Computer Vision, 2nd edition (2003),
       section A6.8 (the pseudo-Huber function).
    """
    factor = away * (1 / (_LARGE * deviations))
    factor *= factor
    largest = np.fmin(_LARGE**2 * factor.max(axis=1), _FARTHEST)
    factor += 1
    np.sqrt(factor, out=factor)
    factor += 1
    np.divide(2, factor, out=factor)
    away *= np.sqrt(factor, out=factor)
    return largest


def _log_squares(inside: Array, outside: Array, largest: Array) -> tuple[Array, Array, Array]:
    inside, outside, largest = (
        np.log(squares + _RESOLUTION) for squares in (inside, outside, largest)
    )
    return inside, outside, largest


def _moderated_deviations(variances: Array, centred: Array, degrees: int) -> Array:
    """Return standard deviations of the features within classes.

    From few groups some features have by chance a variance that is far too small, and the largest
    deviation of a feature is then that of such a feature. Variances are therefore moderated [1]_:
    combined with an expected one, the same fraction of the total variance for all features.

    References
    ----------
    .. [1] Smyth, Linear models and empirical Bayes methods for assessing differential expression,
       Statistical Applications in Genetics and Molecular Biology 3 (2004), section 3.
    """
    total = variances + np.einsum("kf,kf->f", centred, centred) / len(centred)
    expected = (variances / total).sum() / len(total) * total
    moderated = degrees * variances + _N_MODERATING * expected
    return np.sqrt(moderated / (degrees + _N_MODERATING))


def _discriminant_basis(centred: Array) -> Array:
    """Return an orthonormal basis of the span of whitened class means, whose sum is 0."""
    if 1 < len(centred) <= centred.shape[1]:
        factored, reflections, *_ = dgeqrf(centred[:-1].T)
        smallest = np.abs(np.diagonal(factored)).min()
        if smallest > _INDEPENDENT * np.sqrt(np.vdot(centred, centred)):
            basis: Array = dorgqr(factored, reflections, overwrite_a=1)[0]
            return basis
    _, sizes, directions = np.linalg.svd(centred, full_matrices=False)
    n_directions = np.count_nonzero(sizes > 1e-9 * sizes[0])
    return directions[: min(n_directions, len(centred) - 1)].T


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
    levels = np.empty((len(own), n_classes))
    for values, level in zip(own, levels, strict=True):
        overall = weight @ values / weight.sum()
        means = np.bincount(codes, weight * (values - overall), n_classes) / totals
        level[:] = overall + n_groups / (n_groups + 1) * means
    return levels


def _combine(
    logs: tuple[Array, Array, Array],
    levels: Array,
    peaks: tuple[Peaks, ...],
    used: NDArray[np.bool_],
) -> Array:
    """Combine the log distances to each class, and return that to the nearest.

    The logarithm of the sum of the exponentials is nearly the largest of its terms. They are
    relative to the largest of the class where it is smallest.
    """
    slopes = _SLOPES if used[0] else np.array([0.0, 1.0, 1.0])
    terms = []
    for number in np.flatnonzero(used):
        threshold = peaks[number].threshold
        scale = slopes[number] / peaks[number].mean_excess
        level = (levels[number] + threshold) * scale + _OFFSETS[number]
        terms.append(logs[number] * scale - level[:, np.newaxis])
    largest = np.maximum.reduce(terms).min(axis=0)
    with np.errstate(over="ignore"):  # of classes that are farther
        total = sum(np.exp(term - largest) for term in terms)
    return largest + np.log(np.min(total, axis=0))
