"""Facts about the temperature of least log loss."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar
from scipy.special import log_softmax

from emacm.calibration.left_out import fit_temperature


def draw(seed, confidence=1.0, n_recordings=300, n_classes=3):
    """Log densities of classes, and true classes drawn from the posteriors they imply."""
    rng = np.random.default_rng(seed)
    priors = np.array([0.5, 0.3, 0.2])[:n_classes]
    scores = 2 * rng.normal(size=(n_recordings, n_classes))
    posterior = np.exp(log_softmax(np.log(priors) + scores, axis=1))
    codes = np.array([rng.choice(n_classes, p=p) for p in posterior])
    return confidence * scores, codes, np.ones(n_recordings), priors


def log_loss(temperature, scores, codes, weight, priors):
    logs = log_softmax(np.log(priors) + scores / temperature, axis=1)
    return -np.average(logs[np.arange(len(codes)), codes], weights=weight)


@pytest.mark.parametrize("confidence", [0.2, 1.0, 7.0])
def test_the_temperature_of_a_search_over_the_log_loss_is_found(confidence):
    case = draw(0, confidence)
    found = fit_temperature(*case)
    bounds = np.log(found) + np.array([-2, 2])
    best = minimize_scalar(lambda t: log_loss(np.exp(t), *case), bounds=bounds, method="bounded")
    assert found == pytest.approx(np.exp(best.x), rel=1e-3)
    assert found == pytest.approx(confidence, rel=0.3)


@given(st.integers(0, 200), st.floats(0.01, 100))
def test_over_confident_densities_have_a_proportional_temperature(seed, factor):
    scores, codes, weight, priors = draw(seed, n_recordings=60)
    found = fit_temperature(scores, codes, weight, priors)
    if 1e-3 < found < 1e3:
        assert fit_temperature(factor * scores, codes, weight, priors) == pytest.approx(
            factor * found, rel=1e-6
        )


def test_a_class_that_a_model_does_not_contain_takes_no_part():
    scores, codes, weight, priors = draw(3)
    scores[codes == 0, 1] = -np.inf
    assert np.isfinite(fit_temperature(scores, codes, weight, priors))


def test_one_class_or_no_recording_has_no_temperature():
    assert fit_temperature(np.zeros((3, 1)), np.zeros(3, int), np.ones(3), np.ones(1)) == 1
    assert fit_temperature(np.zeros((0, 2)), np.zeros(0, int), np.ones(0), np.full(2, 0.5)) == 1


def test_densities_that_tell_nothing_have_the_highest_temperature():
    scores, codes = np.repeat([[3.0], [-1.0]], 2, axis=1), np.array([0, 1])
    assert fit_temperature(scores, codes, np.ones(2), np.full(2, 0.5)) == pytest.approx(1e6)
