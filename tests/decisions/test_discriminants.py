"""Facts about linear discriminants: posteriors without squares, where that is accurate."""

import numpy as np
import pytest
from scipy.special import softmax
from scipy.stats import multivariate_normal

from emacm.decisions.discriminants import linear_discriminants

LOG_WEIGHTS = np.log([0.2, 0.5, 0.3])


def draw(n_features, *, shift=0.0, apart=1.0):
    rng = np.random.default_rng(0)
    mixing = np.eye(n_features) + rng.normal(size=(n_features, n_features)) * 0.3 / n_features**0.5
    means = shift + apart * rng.normal(size=(3, n_features))
    X = means[rng.integers(3, size=50)] + rng.normal(size=(50, n_features)) @ mixing.T
    covariance = mixing @ mixing.T
    factor = np.linalg.inv(np.linalg.cholesky(covariance)).T
    return X, means, covariance, factor


@pytest.mark.parametrize("n_features", [1, 3, 20])
@pytest.mark.parametrize("shift", [0.0, 1e6])
def test_posteriors_are_those_of_the_densities(n_features, shift):
    X, means, covariance, factor = draw(n_features, shift=shift)
    linear = linear_discriminants(means, factor, np.sqrt(np.diagonal(covariance)))
    assert (linear.centre is None) == (shift == 0)
    joint = [
        weight + multivariate_normal(mean, covariance).logpdf(X)
        for weight, mean in zip(LOG_WEIGHTS, means, strict=True)
    ]
    found = softmax(linear.scores(X, LOG_WEIGHTS), axis=0)
    np.testing.assert_allclose(found, softmax(joint, axis=0), rtol=1e-8)


def test_a_class_of_weight_zero_has_no_score_even_if_it_is_the_first():
    X, means, _, factor = draw(2)
    linear = linear_discriminants(means, factor, np.ones(2))
    for k in range(3):
        log_weights = np.where(np.arange(3) == k, -np.inf, 0.0)
        scores = linear.scores(X, log_weights)
        assert (scores[k] == -np.inf).all()
        assert np.isfinite(np.delete(scores, k, axis=0)).all()


def test_classes_too_far_apart_have_no_accurate_discriminants():
    _, means, _, factor = draw(2, apart=1e4)
    assert linear_discriminants(means, factor, np.ones(2)) is None


def test_recordings_whose_squared_distance_may_overflow_are_left_to_the_distances():
    _, means, _, factor = draw(2)
    linear = linear_discriminants(means, factor, np.ones(2))
    assert linear.scores(np.array([[1e60, 0.0]]), LOG_WEIGHTS) is not None
    for far in ([1e154, 1.0], [-1.7e308, 1.7e308], [1.0, 1.7e308]):
        assert linear.scores(np.array([[0.0, 0.0], far]), LOG_WEIGHTS) is None
