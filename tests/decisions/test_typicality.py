"""Facts about typicality: what is far, calibrated on groups that were left out."""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import logsumexp, pseudo_huber

from emacm.calibration.left_out import peaks_over_threshold, student_tail
from emacm.decisions.gaussians import class_gaussians, class_moments
from emacm.decisions.typicality import fit_typicality


class Training(NamedTuple):
    """Recordings of some classes and groups."""

    X: np.ndarray
    codes: np.ndarray
    groups: np.ndarray
    weight: np.ndarray
    n_classes: int

    def take(self, rows):
        """Return some of the recordings."""
        return Training(*(column[rows] for column in self[:4]), self.n_classes)


def pooled_gaussians(training):
    recordings = training.X, training.codes
    moments = class_moments(*recordings, training.n_classes, training.weight, "tied")
    return class_gaussians(moments, "tied", "auto", recordings)


def fit(X, codes, groups, weight=None):
    weight = np.ones(len(X)) if weight is None else weight
    return fit_typicality(X, codes, groups, weight)


def draw(seed, n_groups=12, n_features=9, n_classes=3, unit_spread=0.7):
    """Five recordings of each class in each group, whose offset they share."""
    rng = np.random.default_rng(seed)
    places = np.random.default_rng(99).normal(size=(n_classes, n_features)) * 4
    codes = np.tile(np.repeat(np.arange(n_classes), 5), n_groups)
    groups = np.repeat(np.arange(n_groups), 5 * n_classes)
    offsets = unit_spread * rng.normal(size=(n_groups, n_classes, n_features))[groups, codes]
    X = places[codes] + offsets + rng.normal(size=(len(codes), n_features))
    return X, codes, groups


def test_known_recordings_of_new_groups_are_as_typical_as_stated():
    typicality = fit(*draw(0, n_groups=30))
    found = typicality(draw(1, n_groups=200)[0])
    for level in (0.05, 0.1, 0.3, 0.6):
        assert np.mean(found <= level) == pytest.approx(level, abs=0.25 * level)
    assert np.mean(found <= 0.01) <= 0.02


def test_recordings_of_known_groups_say_nothing_about_new_ones():
    X, codes, groups = draw(2, n_groups=12, n_features=20, unit_spread=3.0)
    honest = fit(X, codes, groups)
    too_near = fit(X, codes, np.arange(len(X)))
    new = draw(3, n_groups=100, n_features=20, unit_spread=3.0)[0]
    assert np.mean(honest(new) <= 0.01) < 0.03
    assert np.mean(too_near(new) <= 0.01) > 0.1


@pytest.mark.parametrize("direction", ["between two classes", "one feature", "all features"])
def test_deviations_inside_and_outside_the_discriminant_space_are_found(direction):
    X, codes, groups = draw(4)
    means = np.array([X[codes == k].mean(axis=0) for k in range(3)])
    step = {
        "between two classes": 3 * (means[1] - means[0]),
        "one feature": 12 * np.eye(9)[5],
        "all features": 5 * np.random.default_rng(0).choice([-1, 1], 9),
    }[direction]
    found = fit(X, codes, groups)(means[0] + np.outer([0, 1, 2, 1e3, 1e9], step))
    assert found[0] > 0.5
    assert found[1] < 0.01
    assert (np.diff(found) < 0).all()
    assert found[-1] > 0


def test_the_tail_tells_far_from_farther_than_any_left_out_recording():
    X, codes, groups = draw(5)
    found = fit(X, codes, groups)(X[:1] + np.array([[20.0], [200.0], [2000.0]]))
    assert found[0] < 0.1 / len(X)
    assert (found[1:] < 0.1 * found[:-1]).all()


@pytest.mark.slow
@given(seed=st.integers(0, 50))
def test_units_offsets_and_order_change_no_typicality(seed):
    rng = np.random.default_rng(seed)
    X, codes, groups = draw(seed, n_groups=4, n_features=5)
    new = draw(seed + 1, n_groups=2, n_features=5)[0]
    expected = fit(X, codes, groups)(new)
    scale, offset = 10.0 ** rng.uniform(-3, 3, 5), rng.normal(size=5)
    order, features, classes = rng.permutation(len(X)), rng.permutation(5), rng.permutation(3)
    moved = (X * scale + offset)[order][:, features], classes[codes[order]], 3 - groups[order]
    found = fit(*moved)((new * scale + offset)[:, features])
    assert_allclose(found, expected, rtol=1e-5)


@pytest.mark.parametrize(("n_classes", "n_features"), [(1, 4), (1, 1), (2, 1), (4, 2), (3, 2)])
def test_it_works_with_few_classes_and_few_features(n_classes, n_features):
    X, codes, groups = draw(8, n_features=n_features, n_classes=n_classes)
    typicality = fit(X, codes, groups)
    found = typicality(np.vstack([X, X.max(axis=0) + 1e3]))
    assert (found > 0).all()
    assert (found <= 1).all()
    assert np.mean(found[:-1] <= 0.05) < 0.08
    assert found[-1] < 1e-3


def test_a_class_of_one_group_is_known_but_calibrates_nothing():
    X, codes, groups = draw(9, n_groups=8)
    kept = (codes != 2) | (groups == 3)
    typicality = fit(X[kept], codes[kept], groups[kept])
    assert np.median(typicality(X[kept & (codes == 2)])) > 0.2
    assert np.isinf(typicality.distances.log_squares(X)[0]).sum() == 0


def test_a_constant_feature_is_no_obstacle_and_its_change_is_found():
    X, codes, groups = draw(11)
    X = np.column_stack([X, np.full(len(X), 7.0)])
    typicality = fit(X, codes, groups)
    changed = X.copy()
    changed[:, -1] = 9e3
    assert np.median(typicality(X)) > 0.3
    assert (typicality(changed) < 0.01).all()


def plain_logs(known, X, present):
    """Logarithms of the squared distances inside, outside and of the largest deviation."""
    gaussians = pooled_gaussians(known)
    S, means = gaussians.covariances[0], gaussians.means[present]
    root = np.linalg.cholesky(np.linalg.inv(S))
    centred = (means - means.mean(axis=0)) @ root
    axes = np.linalg.qr(centred.T)[0][:, : len(means) - 1] if len(means) > 1 else root[:, :0]
    offsets = (X[:, np.newaxis] - means) @ root
    inside = np.sum((offsets @ axes) ** 2, axis=2)
    total = S.diagonal() + means.var(axis=0)
    pairs = set(zip(known.codes, known.groups, strict=True))
    degrees = len(pairs) - len(set(known.codes))
    expected = np.mean(S.diagonal() / total) * total
    deviations = np.sqrt((degrees * S.diagonal() + 3 * expected) / (degrees + 3))
    away = (X - means[inside.argmin(axis=1)]) / deviations
    # The pseudo-Huber function of scipy.special is half the square, and has the unit of its first
    # argument squared.
    reduced = np.sign(away) * np.sqrt(2 * pseudo_huber(3.0, away)) * deviations @ root
    outside = np.sum(reduced**2, axis=1) - np.sum((reduced @ axes) ** 2, axis=1)
    every = np.full((len(X), known.n_classes), np.inf)
    every[:, present] = inside
    return np.log(every + 1e-3), np.log(outside + 1e-3), np.log((away**2).max(axis=1) + 1e-3)


def plain_typicality(training, new):
    """Typicality as the module describes it, by separate fits without each group."""
    n, codes, weight = len(training.X), training.codes, training.weight
    logs = [np.empty((n, training.n_classes)), np.empty(n), np.empty(n)]
    judged = np.zeros(n, bool)
    for group in np.unique(training.groups):
        rows, rest = training.groups == group, training.take(training.groups != group)
        present = np.unique(rest.codes)
        for found, part in zip(logs, plain_logs(rest, training.X[rows], present), strict=True):
            found[rows] = part
        judged[rows] = np.isin(codes[rows], present)
    logs, codes, weight = [part[judged] for part in logs], codes[judged], weight[judged]
    own = [logs[0][np.arange(len(codes)), codes], *logs[1:]]
    fresh = plain_logs(training, new, np.arange(training.n_classes))
    directions = training.n_classes - 1
    used = [directions > 0, directions < training.X.shape[1], True]
    slopes = (1.0, 0.6, 1.5) if directions else (None, 1.0, 1.0)
    terms, terms_of_new = [], []
    for number, expected in enumerate((0.5, 0.15, 0.2)):
        values, mean = own[number], np.average(own[number], weights=weight)
        levels = np.full(training.n_classes, mean)
        for k in np.unique(codes):
            n_groups = len(np.unique(training.groups[judged][codes == k]))
            of_class = np.average(values[codes == k], weights=weight[codes == k])
            levels[k] = (mean + n_groups * of_class) / (1 + n_groups)
        peaks = peaks_over_threshold(values - levels[codes], weight, expected, 5.0)
        if used[number]:
            for found, part in ((terms, logs[number]), (terms_of_new, fresh[number])):
                above = (part if number == 0 else part[:, np.newaxis]) - levels - peaks.threshold
                above = above * slopes[number] / peaks.mean_excess - (0, 0, 8)[number]
                found.append(above + np.zeros((1, training.n_classes)))
    combined = [logsumexp(found, axis=0).min(axis=1) for found in (terms, terms_of_new)]
    return student_tail(combined[0], weight, 0.85).survival(combined[1])


@pytest.mark.parametrize(
    ("n_classes", "n_features"), [(3, 6), (2, 4), (2, 1), (3, 2), (4, 2), (1, 3), (1, 1)]
)
@pytest.mark.parametrize("of_last", [4, 1])  # groups of the last class
def test_typicality_is_that_of_separate_fits_and_plain_formulas(n_classes, n_features, of_last):
    X, codes, groups = draw(15, 7, n_features, n_classes)
    kept = (codes != n_classes - 1) | (groups < of_last) if n_classes > 1 else groups < 7
    kept &= np.random.default_rng(3).random(len(X)) < 0.7
    X, codes, groups = X[kept], codes[kept], groups[kept]
    training = Training(X, codes, groups, np.ones(len(X)), n_classes)
    new = draw(16, 3, n_features, n_classes)[0] * np.linspace(0.5, 2, 15 * n_classes)[:, np.newaxis]
    typicality = fit(X, codes, groups)
    assert_allclose(typicality(new), plain_typicality(training, new), rtol=1e-5)
    assert typicality.used.tolist() == [n_classes > 1, n_features >= n_classes, True]
    assert_array_equal(typicality.feature_range, [X.min(axis=0), X.max(axis=0)])


def test_the_distance_to_one_class_has_the_slope_of_its_gradient():
    X, codes, groups = draw(17, n_groups=3, n_features=4)
    distances = fit(X, codes, groups).distances
    gaussians = pooled_gaussians(Training(X, codes, groups, np.ones(len(X)), 3))
    for code in range(3):
        squares = gaussians.squared_distances(X)[:, code]
        assert_allclose(distances.squares(X, code), squares, rtol=1e-9)
        gradient = distances.square_gradient(X, code)
        for feature, step in enumerate(1e-4 * np.eye(4)):
            rise = distances.squares(X + step, code) - distances.squares(X - step, code)
            assert_allclose(gradient[:, feature], rise / 2e-4, rtol=1e-5, atol=1e-5)
