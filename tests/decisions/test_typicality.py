"""Facts about typicality: what is far, calibrated on groups that were left out."""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

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
@settings(max_examples=10)
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
