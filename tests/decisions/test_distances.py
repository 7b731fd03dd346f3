"""Facts about distances to classes: known answers, whatever the units and however far."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from emacm.decisions.distances import class_distances


def chain(n_features, slope):
    """Triangular factor with powers of two, and its inverse, both exact.

    Each feature is the last one times `slope` (a power of two) plus something new; every
    eighth starts anew, so that numbers have few digits.
    """
    i, j = np.indices((n_features, n_features))
    together = i // 8 == j // 8
    lower = np.where(together & (i >= j), float(slope) ** np.maximum(i - j, 0), 0.0)
    inverse = np.eye(n_features) - slope * (together & (i == j + 1))
    np.testing.assert_array_equal(lower @ inverse, np.eye(n_features))
    return lower, inverse


def known(n_features, n_classes, *, slope=0.5, shift=0.0, apart=4.0, tied=False, scales=False):
    """Recordings with squared distances that are known exactly.

    Every number is a multiple of a power of two and small enough to be exact.
    """
    rng = np.random.default_rng(0)
    lower, inverse = chain(n_features, slope)
    unit = 2.0 ** rng.integers(-30, 30, size=n_features) if scales else np.ones(n_features)
    sizes = np.ones(1) if tied else 2.0 ** np.arange(n_classes)
    white = rng.integers(-8, 8, size=(200, n_features)).astype(float)
    means = shift + apart * rng.integers(-4, 4, size=(n_classes, n_features))
    X = means[0] + white @ lower.T
    factors = np.stack([inverse.T / size for size in sizes]) / unit[:, np.newaxis]
    squares = np.stack(
        [
            np.sum((((X - mean) @ inverse.T) / sizes[k % len(sizes)]) ** 2, axis=1)
            for k, mean in enumerate(means)
        ]
    )
    np.testing.assert_array_equal(squares[0], np.sum(white**2, axis=1) / sizes[0] ** 2)
    return X * unit, means * unit, factors, squares


@pytest.mark.parametrize("n_features", [1, 2, 7, 24, 50])
@pytest.mark.parametrize("tied", [False, True])
@pytest.mark.parametrize("scales", [False, True])
@pytest.mark.parametrize("shift", [0.0, 2.0**20])
@pytest.mark.parametrize("apart", [4.0, 2.0**20])
def test_squared_distances_are_the_known_ones(n_features, tied, scales, shift, apart):
    X, means, factors, squares = known(
        n_features, 3, shift=shift, apart=apart, tied=tied, scales=scales
    )
    distances = class_distances(means, factors)
    assert bool(distances.bands) == (apart == 4)
    np.testing.assert_allclose(distances.squares(X), squares, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("tied", [False, True])
def test_nearly_dependent_features_cost_no_accuracy(tied):
    # Slope 64 over three features: condition number of the covariance above 1e8.
    X, means, factors, squares = known(3, 4, slope=64.0, shift=2.0**20, tied=tied)
    assert np.linalg.cond(chain(3, 64.0)[0]) > 1e4
    distances = class_distances(means, factors)
    np.testing.assert_allclose(distances.squares(X), squares, rtol=1e-9, atol=1e-9)


def test_factors_need_not_be_triangular():
    rng = np.random.default_rng(1)
    X, means = rng.normal(size=(40, 30)), rng.normal(size=(2, 30))
    factors = rng.normal(size=(2, 30, 30))
    squares = class_distances(means, factors).squares(X)
    for k, factor in enumerate(factors):
        expected = cdist(X, means[k : k + 1], "mahalanobis", VI=factor @ factor.T)[:, 0] ** 2
        np.testing.assert_allclose(squares[k], expected, rtol=1e-9)


@pytest.mark.parametrize("n_groups", [1, 3])
def test_diagonal_factors_are_reciprocal_deviations(n_groups):
    rng = np.random.default_rng(2)
    X, means = rng.normal(size=(40, 5)), rng.normal(size=(3, 5))
    deviations = rng.uniform(0.5, 2, size=(n_groups, 5))
    squares = class_distances(means, 1 / deviations).squares(X)
    for k in range(3):
        variances = deviations[k % n_groups] ** 2
        expected = cdist(X, means[k : k + 1], "seuclidean", V=variances)[:, 0] ** 2
        np.testing.assert_allclose(squares[k], expected, rtol=1e-12)


@pytest.mark.parametrize("apart", [1.0, 1e9])
@pytest.mark.parametrize("factors", [np.stack([np.eye(2)] * 2), np.eye(2)[None], np.ones((2, 2))])
def test_no_distance_overflows(factors, apart):
    distances = class_distances(np.array([[0.0, 0.0], [apart, 0.0]]), factors)
    far = np.array([[1e160, 0.0], [1.7e308, -1.7e308], [-1.7e308, 1.7e308], [1.0, 0.0]])
    squares = distances.squares(far)
    assert np.isfinite(squares).all()
    assert (squares[:, :3] > 1e307).all()
    np.testing.assert_allclose(squares[:, 3], [1, (apart - 1) ** 2])


def test_the_order_of_memory_changes_nothing():
    X, means, factors, squares = known(20, 3)
    distances = class_distances(means, factors)
    np.testing.assert_allclose(distances.squares(np.asfortranarray(X)), squares, rtol=1e-12)
