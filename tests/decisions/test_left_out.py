"""Facts about densities without one group: they equal those of a fit from the beginning."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from emacm.decisions.gaussians import FLOOR, fit_gaussians
from emacm.decisions.left_out import (
    MAX_PARTS,
    Remaining,
    Training,
    group_numbers,
)
from emacm.decisions.left_out_moments import RemainingMoments
from emacm.decisions.moments import moments_for
from emacm.decisions.shrinkage import (
    ledoit_wolf_coefficient,
    ledoit_wolf_coefficients,
    oas_coefficient,
)

KINDS = [
    (covariance, shrinkage)
    for covariance in ("full", "tied", "diag")
    for shrinkage in (0.3, "oas", "auto")
]


def draw(seed, n_recordings=70, n_features=4, n_classes=3, n_groups=5):
    """Classes of different means, correlated features of different units, groups at random."""
    rng = np.random.default_rng(seed)
    codes = rng.permutation(np.arange(n_recordings) % n_classes)
    groups = rng.integers(0, n_groups, n_recordings)
    mixing = rng.normal(size=(n_features, n_features)) * 10.0 ** np.arange(-1, n_features - 1)
    X = rng.normal(size=(n_recordings, n_features)) @ mixing
    X += 3 * rng.normal(size=(n_classes, n_features))[codes] * X.std(axis=0)
    return Training(X, codes, groups, np.ones(n_recordings), n_classes)


def fitted_anew(training, covariance, shrinkage):
    """Fit by the functions of a fit to all recordings."""
    pooled = covariance == "tied"
    moments = training.moments(
        pooled=pooled, variances_only=covariance == "diag" and shrinkage != "oas"
    )
    if shrinkage == "auto":
        of = training.X, training.codes, moments.means
        coefficients = ledoit_wolf_coefficients(*of, pooled=pooled)
    elif shrinkage == "oas":
        pairs = zip(moments.scatter, moments.group_counts, strict=True)
        coefficients = ([oas_coefficient(*pair) for pair in pairs],)
    else:
        coefficients = (shrinkage,)
    floor = FLOOR * moments.feature_variances.max()
    return fit_gaussians(moments, *coefficients, diagonal=covariance == "diag", floor=floor)


def remaining(training, covariance="tied", shrinkage=0.0):
    """From the moments that the classifier keeps."""
    of = training.X, training.codes, training.n_classes, training.weight
    return Remaining(training, moments_for(covariance, shrinkage, *of))


def relative(log_densities, covariance):
    """With one covariance, what all classes have in common is left out."""
    if covariance != "tied":
        return log_densities
    return log_densities - log_densities.max(axis=1, keepdims=True)


@pytest.mark.parametrize(("covariance", "shrinkage"), KINDS)
@pytest.mark.parametrize("seed", [0, 1])
def test_densities_without_a_group_equal_those_of_a_fit_to_the_others(seed, covariance, shrinkage):
    training = draw(seed)
    found = remaining(training, covariance, shrinkage).log_densities(covariance, shrinkage)
    for group in range(5):
        rows = training.groups == group
        expected = fitted_anew(training.take(~rows), covariance, shrinkage)
        densities = found[rows], expected.log_densities(training.X[rows])
        assert_allclose(*(relative(each, covariance) for each in densities), rtol=1e-7)


@pytest.mark.parametrize("covariance", ["full", "diag"])
@pytest.mark.parametrize("shrinkage", [None, 1e-15, 1e-5, 0.02, 0.3, 1.0, "oas"])
@pytest.mark.parametrize(("outlier", "n_features"), [(1.0, 20), (1e7, 20), (1.0, 60)])
def test_so_do_those_of_classes_with_fewer_recordings_than_features(
    covariance, shrinkage, outlier, n_features
):
    training = draw(8, n_recordings=50, n_features=n_features, n_classes=3, n_groups=4)
    training.X[0] *= outlier
    training.X[:] /= training.X.std(axis=0)
    training.groups[training.codes == 2] %= 2  # not in all groups
    weight = np.random.default_rng(1).integers(1, 4, 50)
    weighted = Training(training.X, training.codes, training.groups, weight.astype(float), 3)
    found = remaining(weighted, covariance, shrinkage).log_densities(covariance, shrinkage)
    for group in range(4):
        rows = training.groups == group
        others = training.take(np.repeat(np.arange(50), np.where(rows, 0, weight)))
        expected = fitted_anew(others, covariance, shrinkage or 0.0)
        assert_allclose(found[rows], expected.log_densities(training.X[rows]), rtol=1e-6)


@pytest.mark.parametrize("covariance", ["full", "diag"])
@pytest.mark.parametrize("shrinkage", [None, 0.3, "oas", "auto"])
@pytest.mark.parametrize("unit", [1e-120, 1e120])
def test_units_of_features_add_a_constant_to_log_densities(covariance, shrinkage, unit):
    training = draw(9, n_recordings=40, n_features=20, n_classes=3, n_groups=4)
    training.X[:] /= training.X.std(axis=0)
    scaled = Training(training.X * unit, training.codes, training.groups, training.weight, 3)
    found, expected = (
        remaining(each, covariance, shrinkage).log_densities(covariance, shrinkage)
        for each in (scaled, training)
    )
    assert_allclose(found, expected - 20 * np.log(unit), rtol=1e-9)


@pytest.mark.parametrize("covariance", ["full", "tied", "diag"])
@pytest.mark.parametrize("shrinkage", [0.3, "oas"])
def test_units_of_features_may_differ_by_240_decades(covariance, shrinkage):
    training = draw(9, n_recordings=40, n_features=20, n_classes=3, n_groups=4)
    training.X[:] *= np.logspace(-120, 120, 20) / training.X.std(axis=0)
    found = remaining(training, covariance, shrinkage).log_densities(covariance, shrinkage)
    for group in range(4):
        rows = training.groups == group
        expected = fitted_anew(training.take(~rows), covariance, shrinkage)
        densities = found[rows], expected.log_densities(training.X[rows])
        assert_allclose(*(relative(each, covariance) for each in densities), rtol=1e-6)


@pytest.mark.parametrize("shrinkage", [0.3, "oas", "auto"])
@pytest.mark.parametrize("covariance", ["full", "tied", "diag"])
def test_common_covariances_follow_from_moments_of_any_kind(covariance, shrinkage):
    training = draw(2)
    found = list(remaining(training, covariance).left_out_gaussians(shrinkage))
    assert len(found) == 5
    for part in found:
        others = np.setdiff1d(np.arange(len(training.X)), part.rows)
        assert len(np.unique(training.groups[part.rows])) == 1
        assert not np.isin(training.groups[part.rows[0]], training.groups[others])
        expected = fitted_anew(training.take(others), "tied", shrinkage)
        assert_allclose(part.means, expected.means, rtol=1e-9, atol=1e-9)
        assert_allclose(part.root @ part.root.T, expected.covariances[0], rtol=1e-8)
        assert_allclose(part.variances, expected.covariances[0].diagonal(), rtol=1e-8)
        assert_array_equal(np.triu(part.root, 1), 0)
        assert part.seen.all()


@pytest.mark.slow
@given(seed=st.integers(0, 1000), n_groups=st.integers(2, 12))
def test_every_recording_is_left_out_once(seed, n_groups):
    training = draw(seed, n_recordings=30, n_groups=n_groups)
    found = remaining(training).left_out_gaussians(0.1)
    rows = np.concatenate([part.rows for part in found])
    assert_array_equal(np.sort(rows), np.arange(30))


@pytest.mark.parametrize(
    ("covariance", "pooled", "only"),
    [(kind, True, only) for kind in ("full", "tied", "diag") for only in (False, True)]
    + [(kind, False, True) for kind in ("full", "diag")],
)
def test_moments_without_a_group_are_those_of_the_others_and_0_for_an_absent_class(
    covariance, pooled, only
):
    training = draw(4)
    training.groups[training.codes == 1] = 7
    training.groups[training.codes != 1] %= 3
    of = training.X, training.codes, training.n_classes, training.weight
    left = RemainingMoments(training, moments_for(covariance, 0.0, *of))
    for group in (7, 0):
        expected = training.take(training.groups != group).moments(
            pooled=pooled, variances_only=only
        )
        found = left.without(group, pooled=pooled, variances_only=only)
        assert found.pooled == pooled
        for name in ("counts", "means", "scatter"):
            assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-8, atol=1e-9)
    assert_array_equal(left.without(7, pooled=pooled, variances_only=only).means[1], 0)
    whole = training.moments(pooled=pooled, variances_only=only)
    for absent in (None, 99):
        found = left.without(absent, pooled=pooled, variances_only=only)
        for name in ("counts", "means", "scatter"):
            assert_allclose(getattr(found, name), getattr(whole, name), rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("features", [slice(None), 1])
@pytest.mark.parametrize("classes", [[0, 1, 2], [0], [2]])
def test_a_group_with_outliers_leaves_accurate_moments(features, classes):
    training = draw(3)
    training.X[(training.groups == 2) & np.isin(training.codes, classes), features] *= 1e9
    for part in remaining(training).left_out_gaussians("auto"):
        others = np.setdiff1d(np.arange(len(training.X)), part.rows)
        expected = fitted_anew(training.take(others), "tied", "auto")
        assert_allclose(part.root @ part.root.T, expected.covariances[0], rtol=1e-6)


@pytest.mark.parametrize("covariance", ["full", "tied", "diag"])
def test_a_class_of_one_group_is_not_seen_without_it(covariance):
    training = draw(4)
    training.groups[training.codes == 1] = 7
    training.groups[training.codes != 1] %= 3
    found = remaining(training, covariance).log_densities(covariance, 0.2)
    assert_array_equal(np.isfinite(found[:, [0, 2]]), True)
    assert_array_equal(np.isfinite(found[:, 1]), training.groups != 7)


@pytest.mark.parametrize(("covariance", "shrinkage"), KINDS)
def test_weights_equal_repetitions(covariance, shrinkage):
    once = draw(5)
    weight = np.random.default_rng(5).integers(1, 4, len(once.X))
    weighted = Training(once.X, once.codes, once.groups, weight.astype(float), 3)
    repeated = once.take(np.repeat(np.arange(len(once.X)), weight))
    found, expected = (
        remaining(training, covariance, shrinkage).log_densities(covariance, shrinkage)
        for training in (weighted, repeated)
    )
    assert_allclose(np.repeat(found, weight, axis=0), expected, rtol=1e-8)


@pytest.mark.parametrize("n_recordings", [5, 60])
def test_ledoit_wolf_from_moments_is_that_of_scikit_learn(n_recordings):
    from sklearn.covariance import ledoit_wolf_shrinkage

    X = np.random.default_rng(n_recordings).normal(size=(n_recordings, 7)) * np.arange(1, 8)
    X -= X.mean(axis=0)
    fourth = np.sum(np.sum(X**2, axis=1) ** 2)
    found = ledoit_wolf_coefficient(X.T @ X, n_recordings, fourth)
    assert found == pytest.approx(ledoit_wolf_shrinkage(X), rel=1e-12)


# Numbers of groups


def test_equal_labels_are_one_group_whatever_their_type():
    X, codes = np.zeros((4, 1)), np.zeros(4, int)
    for labels in (["u9", "u10", "u9", "u2"], [9, 10, 9, 2], [("a", 1), "b", ("a", 1), 2]):
        assert group_numbers(labels, X, codes).tolist() == [0, 1, 0, 2]


@pytest.mark.parametrize("missing", [None, np.nan])
def test_a_missing_group_is_an_error(missing):
    with pytest.raises(ValueError, match="recording 1 is missing"):
        group_numbers(["a", missing, "b"], np.zeros((3, 1)), np.zeros(3, int))


def test_groups_of_another_length_are_an_error():
    with pytest.raises(ValueError, match="each of the 3 recordings, got 2"):
        group_numbers(["a", "b"], np.zeros((3, 1)), np.zeros(3, int))


def test_without_groups_up_to_64_recordings_are_left_out_one_by_one():
    X = np.random.default_rng(0).normal(size=(64, 2))
    assert len(np.unique(group_numbers(None, X, np.arange(64) % 3))) == 64


def test_without_groups_many_recordings_are_divided_evenly_within_each_class():
    X, codes = np.random.default_rng(0).normal(size=(640, 2)), np.arange(640) % 2
    groups = group_numbers(None, X, codes)
    for k in (0, 1):
        assert_array_equal(np.bincount(groups[codes == k], minlength=MAX_PARTS), 5)


def test_without_groups_equal_recordings_are_left_out_together():
    X = np.random.default_rng(0).normal(size=(9, 2))
    groups = group_numbers(None, np.vstack([X, X]), np.tile(np.arange(9) % 2, 2))
    assert_array_equal(groups[:9], groups[9:])
    assert len(np.unique(groups)) == 9


def test_a_covariance_that_is_singular_without_a_group_is_raised_to_the_floor():
    rng = np.random.default_rng(3)
    codes = np.repeat([0, 1], [6, 9])
    groups = np.concatenate([[0, 0, 1, 1, 2, 2], np.arange(9) % 3])
    X = rng.normal(size=(15, 4)) * [1, 10, 0.1, 3] + 5 * codes[:, np.newaxis]
    training = Training(X, codes, groups, np.ones(15), 2)
    found = remaining(training, "full", None).log_densities("full", None)
    for group in range(3):
        rows = groups == group
        expected = fitted_anew(training.take(~rows), "full", 0.0)
        assert expected.singular.tolist() == [True, False]
        assert_allclose(found[rows], expected.log_densities(X[rows]), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("covariance", ["full", "tied", "diag"])
@pytest.mark.parametrize("distance", [1.0, 1e6])
def test_densities_are_accurate_for_classes_that_are_close_and_far_apart(covariance, distance):
    training = draw(7)
    training.X[:, 0] += distance * training.codes
    found = remaining(training, covariance).log_densities(covariance, 0.0)
    rows = training.groups == 1
    expected = fitted_anew(training.take(~rows), covariance, 0.0)
    densities = found[rows], expected.log_densities(training.X[rows])
    assert_allclose(*(relative(each, covariance) for each in densities), rtol=1e-6)


def awkward(n_features, *, weighted=False, units=1.0):
    """Groups of 1 to 14 recordings; class 1 in one group, class 2 with one recording elsewhere.

    Class 3 has one or two recordings without groups 0 and 1, class 0 a constant feature.
    """
    rng = np.random.default_rng(n_features)
    codes = np.array([0] * 20 + [1] * 4 + [2] * 3 + [3] * 3)
    groups = np.array([*rng.permutation([0] * 9 + [1] * 5 + [2] * 4 + [3, 5]), 4, 4, 4, 4])
    groups = np.append(groups, [0, 0, 5, 0, 1, 1])
    X = rng.normal(size=(30, n_features)) @ rng.normal(size=(n_features, n_features))
    X += 4 * rng.normal(size=(4, n_features))[codes]
    if n_features > 1:
        X[codes == 0, 0] = 1.5
    weight = rng.choice([1.0, 1.5, 2.75], 30) if weighted else np.ones(30)
    return Training(X * units, codes, groups, weight, 4)


AWKWARD = [
    (covariance, shrinkage, weighted)
    for covariance in ("full", "tied", "diag")
    for shrinkage in (None, 0.0, 0.3, 1.0, "oas", "auto")
    for weighted in (False, True)
    if (shrinkage, weighted) != ("auto", True)
]


@pytest.mark.parametrize("n_features", [1, 2, 5])
@pytest.mark.parametrize(("covariance", "shrinkage", "weighted"), AWKWARD)
def test_awkward_groups_are_judged_by_a_fit_to_the_others(
    covariance, shrinkage, weighted, n_features
):
    # The coefficient "auto" of two recordings is 0 but for rounding, which decides on singularity.
    training, kind = awkward(n_features, weighted=weighted), (covariance, shrinkage)
    found = remaining(training, covariance, shrinkage).log_densities(covariance, shrinkage)
    for group in range(6):
        rows = training.groups == group
        others = training.take(~rows)
        counts = np.bincount(others.codes, others.weight, 4)
        seen = counts > (0 if covariance == "tied" else 1)
        compared = seen & ((counts != 2) | (kind != ("full", "auto")))
        expected = fitted_anew(others, covariance, shrinkage or 0.0).log_densities(training.X[rows])
        assert_array_equal(np.isneginf(found[rows]).all(axis=0), ~seen)
        densities = found[rows][:, compared], expected[:, compared]
        assert_allclose(*(relative(each, covariance) for each in densities), rtol=1e-5)


@pytest.mark.parametrize("shrinkage", [None, 1e-15, 0.3, 1.0, "oas", "auto"])
@pytest.mark.parametrize("units", [1.0, [1e3, 1e6, 1e6, 1.0, 1e-3]])
@pytest.mark.parametrize("dependent", [False, True])
def test_common_covariances_equal_those_of_a_fit_to_the_others(shrinkage, units, dependent):
    training = awkward(5)
    if dependent:
        training.X[:, 2] = training.X[:, 1]
        training.X[:, 4] = training.X[:, 3] - training.X[:, 1]
    training.X[:] *= units
    left = remaining(training)
    for part in left.left_out_gaussians(shrinkage):
        others = training.take(training.groups != training.groups[part.rows[0]])
        expected = fitted_anew(others, "tied", shrinkage or 0.0)
        assert_array_equal(part.seen, np.bincount(others.codes, minlength=4) > 0)
        assert_allclose(part.means[part.seen], expected.means[part.seen], rtol=1e-9)
        scales = np.sqrt(expected.covariances[0].diagonal())
        covariance = part.root @ part.root.T / np.outer(scales, scales)
        standard = expected.covariances[0] / np.outer(scales, scales)
        assert_allclose(covariance, standard, rtol=1e-6, atol=1e-9)
        assert_array_equal(np.triu(part.root, 1), 0)
        assert_array_equal(part.X, training.X[part.rows])
    whole = left.all_gaussians(shrinkage)
    expected = fitted_anew(training, "tied", shrinkage or 0.0)
    assert_array_equal(whole.singular, expected.singular)
    assert_allclose(whole.covariances, expected.covariances, rtol=1e-6)


@pytest.mark.parametrize("covariance", ["full", "tied", "diag"])
@pytest.mark.parametrize("shrinkage", [None, 0.3, "oas", "auto"])
def test_one_remaining_recording_of_each_class_gives_no_covariance(covariance, shrinkage):
    X = np.random.default_rng(2).normal(size=(4, 2))
    codes, groups = np.array([0, 1, 0, 1]), np.array([0, 0, 1, 1])
    left = remaining(Training(X, codes, groups, np.ones(4), 2), covariance, shrinkage)
    assert list(left.left_out_gaussians("auto")) == []
    assert_array_equal(left.log_densities(covariance, shrinkage), -np.inf)


@pytest.mark.parametrize("shrinkage", [0.3, "auto"])
def test_more_groups_than_are_kept_at_once_are_left_out_one_by_one(shrinkage):
    training = draw(6, n_recordings=60, n_groups=40)
    found = {part.rows[0]: part for part in remaining(training).left_out_gaussians(shrinkage)}
    assert len(found) == len(np.unique(training.groups)) > 16
    for first, part in found.items():
        others = training.take(training.groups != training.groups[first])
        expected = fitted_anew(others, "tied", shrinkage)
        assert_allclose(part.root @ part.root.T, expected.covariances[0], rtol=1e-8)
        assert_array_equal(part.rows, np.flatnonzero(training.groups == training.groups[first]))


def test_a_class_of_one_group_with_large_weights_is_not_seen_without_it():
    once = draw(4)
    once.groups[once.codes == 1] = 7
    once.groups[once.codes != 1] %= 3
    weight = 1e9 * np.random.default_rng(0).random(len(once.X))
    training = Training(once.X, once.codes, once.groups, weight, 3)
    found = remaining(training, "tied").log_densities("tied", 0.2)
    assert_array_equal(np.isfinite(found[:, 1]), once.groups != 7)


@pytest.mark.parametrize("covariance", ["full", "diag"])
@pytest.mark.parametrize("shrinkage", [None, 0.3, "oas"])
def test_equal_recordings_are_raised_to_the_floor_and_a_total_weight_of_1_is_too_little(
    covariance, shrinkage
):
    rng = np.random.default_rng(5)
    codes = np.repeat([0, 1, 2], [12, 3, 4])
    groups = np.append(np.arange(15) % 3, [0, 0, 1, 1])
    X = rng.normal(size=(19, 6))
    X[codes == 1] = X[12]
    training = Training(X, codes, groups, np.where(codes == 2, 0.5, 1.0), 3)
    found = remaining(training, covariance, shrinkage).log_densities(covariance, shrinkage)
    for group in range(3):
        rows = groups == group
        expected = fitted_anew(training.take(~rows), covariance, shrinkage or 0.0)
        densities = expected.log_densities(X[rows])
        assert_allclose(found[rows][:, :2], densities[:, :2], rtol=1e-6)
        if group < 2:
            assert_array_equal(found[rows, 2], -np.inf)
        else:
            assert_allclose(found[rows, 2], densities[:, 2], rtol=1e-6)


@pytest.mark.parametrize("shrinkage", [None, 0.3, "oas"])
@pytest.mark.parametrize("seed", [3, 4, 7, 10])
def test_one_degree_of_freedom_that_remains_is_enough_for_a_common_covariance(shrinkage, seed):
    X = np.random.default_rng(seed).normal(size=(5, 2))
    codes, groups = np.array([0, 1, 0, 0, 1]), np.array([0, 0, 1, 1, 1])
    X[:2] *= 300  # a difference would hide by rounding that the covariance is singular
    training = Training(X, codes, groups, np.ones(5), 2)
    left = remaining(training, "tied", shrinkage)
    (part,) = left.left_out_gaussians(shrinkage)
    assert_array_equal(part.rows, [0, 1])
    expected = fitted_anew(training.take(groups == 1), "tied", shrinkage or 0.0)
    assert_allclose(part.root @ part.root.T, expected.covariances[0], rtol=1e-6, atol=1e-12)
    least = (np.linalg.eigvalsh(S)[0] for S in (part.root @ part.root.T, expected.covariances[0]))
    assert_allclose(*least, rtol=1e-3)
    found = left.log_densities("tied", shrinkage)
    densities = found[:2], expected.log_densities(X[:2])
    assert_allclose(*(relative(each, "tied") for each in densities), rtol=1e-6)
    assert_array_equal(found[2:], -np.inf)
