"""Facts about Gaussian classes: moments, shrinkage, singular covariances, densities."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.stats import multivariate_normal
from sklearn.covariance import ledoit_wolf, oas, shrunk_covariance
from sklearn.preprocessing import StandardScaler

from emacm.decisions.gaussians import (
    class_gaussians,
    class_moments,
    inverse_factor,
    oas_coefficient,
    shrink,
)

KINDS = ("full", "tied", "diag")


def fit(X, codes, *kind, **options):
    """Gaussians of three classes with a kind of covariance and shrinkage."""
    moments = class_moments(X, codes, 3, None, *kind)
    return class_gaussians(moments, *kind, recordings=(X, codes), **options)


def draw(seed, n_recordings=60, n_features=4, n_classes=3):
    rng = np.random.default_rng(seed)
    mixing = rng.normal(size=(n_features, n_features))
    codes = rng.permutation(np.arange(n_recordings) % n_classes)
    return rng.normal(size=(n_recordings, n_features)) @ mixing + codes[:, None], codes


def test_means_and_covariances_are_those_of_numpy():
    X, codes = draw(0)
    moments = class_moments(X, codes, 3)
    covariances = fit(X, codes).covariances
    for k in range(3):
        np.testing.assert_allclose(moments.means[k], X[codes == k].mean(axis=0))
        np.testing.assert_allclose(covariances[k], np.cov(X[codes == k].T), rtol=1e-12)


def test_a_tied_covariance_divides_by_recordings_less_classes():
    X, codes = draw(1)
    tied = fit(X, codes, "tied")
    residuals = X - tied.means[codes]
    expected = residuals.T @ residuals / (60 - 3)
    np.testing.assert_allclose(tied.covariances, [expected], rtol=1e-12)


@given(st.floats(-1e6, 1e6), st.floats(0.1, 7))
@example(2.2250738585e-313, 0.25)
def test_the_variance_of_a_constant_feature_is_exactly_zero(value, weight):
    X = np.full((7, 1), value)
    moments = class_moments(X, np.zeros(7, int), 1, np.full(7, weight))
    merged = moments.merge(class_moments(X[:2], np.zeros(2, int), 1))
    assert moments.scatter == 0
    assert merged.scatter == 0


@pytest.mark.parametrize("shape", [(5, 20), (30, 4), (400, 10), (9, 1), (2, 2)])
def test_the_oas_coefficient_is_that_of_scikit_learn(shape):
    X = np.random.default_rng(5).normal(size=shape) * np.linspace(1, 2, shape[1])
    centred = X - X.mean(axis=0)
    expected = oas(X)[1]
    assert oas_coefficient(centred.T @ centred, shape[0]) == pytest.approx(expected, rel=1e-10)


def test_shrinkage_by_a_number_is_that_of_scikit_learn():
    X, codes = draw(6)
    covariances = fit(X, codes).covariances
    expected = [shrunk_covariance(S, 0.2) for S in covariances]
    np.testing.assert_allclose(shrink(covariances, 0.2), expected, rtol=1e-13)


@pytest.mark.parametrize("kind", KINDS)
def test_automatic_shrinkage_is_ledoit_wolf_of_standardised_features(kind):
    X, codes = draw(7, n_features=12)
    X *= np.logspace(-6, 6, 12)
    found, means = fit(X, codes, kind, "auto").covariances, fit(X, codes).means
    groups = [X - means[codes]] if kind == "tied" else [X[codes == k] for k in range(3)]
    for covariance, rows in zip(found, groups, strict=True):
        scaler = StandardScaler().fit(rows)
        standard = ledoit_wolf(scaler.transform(rows))[0] * np.outer(scaler.scale_, scaler.scale_)
        standard *= len(rows) / (len(rows) - (3 if kind == "tied" else 1))
        expected = np.diagonal(standard) if kind == "diag" else standard
        np.testing.assert_allclose(covariance, expected, rtol=1e-10)


def test_features_of_very_different_units_are_not_singular():
    rng = np.random.default_rng(9)
    X = rng.normal(size=(50, 3)) * [1e-12, 1.0, 1e12]
    gaussians = class_gaussians(class_moments(X, np.zeros(50, int), 1))
    assert not gaussians.singular.any()
    unit = class_gaussians(class_moments(X / [1e-12, 1.0, 1e12], np.zeros(50, int), 1))
    np.testing.assert_allclose(
        gaussians.log_densities(X), unit.log_densities(X / [1e-12, 1.0, 1e12]), rtol=1e-10
    )


@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e8])
def test_dependent_features_are_singular_in_any_unit(scale):
    X = np.random.default_rng(10).normal(size=(50, 3))
    X[:, 2] = X[:, 0] - 2 * X[:, 1]
    assert inverse_factor(np.cov((X * [1.0, scale, 1.0]).T)) is None
    assert inverse_factor(np.diag([1.0, 0.0])) is None


@pytest.mark.parametrize("kind", KINDS)
def test_log_densities_are_those_of_scipy(kind):
    X, codes = draw(13)
    X = X * [0.1, 1, 10, 1] + 1e4
    gaussians = fit(X, codes, kind)
    densities = gaussians.log_densities(X)
    for k in range(3):
        covariance = gaussians.covariances[k % len(gaussians.covariances)]
        covariance = np.diag(covariance) if kind == "diag" else covariance
        expected = multivariate_normal(gaussians.means[k], covariance).logpdf(X)
        np.testing.assert_allclose(densities[:, k], expected, rtol=1e-8)


def test_no_density_is_nan():
    X, codes = draw(14)
    gaussians = fit(X, codes)
    far = np.array([[1e5] * 4, [1e160] * 4, [1.7e308, -1.7e308, 1.7e308, -1.7e308]])
    densities = gaussians.log_densities(far)
    assert np.isfinite(densities[0]).all()
    np.testing.assert_array_equal(densities[1:], -np.inf)


@pytest.mark.parametrize("kind", KINDS)
def test_the_gradient_is_the_slope_of_the_log_density(kind):
    X, codes = draw(15)
    gaussians = fit(X, codes, kind)
    gradients = gaussians.log_density_gradients(X)
    assert gradients.shape == (60, 3, 4)
    for feature in range(4):
        step = np.zeros(4)
        step[feature] = 1e-4
        rise = gaussians.log_densities(X + step) - gaussians.log_densities(X - step)
        np.testing.assert_allclose(gradients[:, :, feature], rise / 2e-4, rtol=1e-6, atol=1e-6)


def test_distances_are_in_standard_deviations_of_the_class():
    X = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 2.0], [4.0, 2.0], [10.0, 5.0], [11.0, 6.0]])
    moments = class_moments(X, np.array([0, 0, 0, 0, 1, 1]), 2, covariance="diag")
    squares = class_gaussians(moments, "diag").squared_distances(np.array([[4.0, 1.0]]))
    # Class 0: mean (2, 1), variances 16/3 and 4/3; class 1: mean (10.5, 5.5), variances 1/2.
    np.testing.assert_allclose(squares, [[4 / (16 / 3), (6.5**2 + 4.5**2) * 2]])
