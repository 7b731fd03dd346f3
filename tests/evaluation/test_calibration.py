"""Calibration of predicted probabilities."""

import numpy as np
import pytest
from sklearn.metrics import log_loss

from emacm.evaluation.figures import brier_scores, log_losses, most_probable, reliability


def stated(n_recordings, n_classes, seed=0):
    """Draw probabilities, and truths that follow them: calibrated by construction."""
    rng = np.random.default_rng(seed)
    probabilities = rng.dirichlet(np.ones(n_classes), n_recordings)
    truths = (rng.random((n_recordings, 1)) > probabilities.cumsum(axis=1)).sum(axis=1)
    return probabilities, truths


def test_the_mean_logarithmic_loss_is_that_of_scikit_learn():
    probabilities, truths = stated(200, 4)
    ours = log_losses(probabilities, truths).mean()
    assert ours == pytest.approx(log_loss(truths, probabilities), rel=1e-12)


def test_an_impossible_truth_costs_36_nats():
    assert log_losses([[1.0, 0.0]], [1])[0] == pytest.approx(36.04, abs=0.01)


def test_the_brier_score_of_a_uniform_posterior_is_one_minus_one_over_k():
    # (1 - 1/K)^2 + (K - 1) / K^2 = 1 - 1/K
    assert np.allclose(brier_scores(np.full((5, 5), 0.2), [0, 1, 2, 3, 4]), 0.8)


def test_true_probabilities_have_a_lower_expected_score_than_sharper_ones():
    probabilities, truths = stated(20_000, 3)
    sharper = probabilities**2 / (probabilities**2).sum(axis=1, keepdims=True)
    for score in (log_losses, brier_scores):
        assert score(probabilities, truths).mean() < score(sharper, truths).mean()


def test_calibrated_probabilities_equal_the_frequencies():
    curve = reliability(*stated(50_000, 3))
    deviation = np.sqrt(curve["confidence"] * (1 - curve["confidence"]) / curve["count"])
    assert (np.abs(curve["frequency"] - curve["confidence"]) < 4 * deviation).all()
    assert curve["count"].sum() == 50_000
    assert curve.columns.tolist() == ["from", "to", "confidence", "frequency", "count"]


def test_overconfident_probabilities_exceed_the_frequencies():
    probabilities, truths = stated(5000, 2)
    sharp = probabilities**3 / (probabilities**3).sum(axis=1, keepdims=True)
    curve = reliability(sharp, truths)
    middle = curve[curve["to"] < 1]
    assert (middle["frequency"] < middle["confidence"]).all()


def test_an_edge_belongs_to_the_bin_above_and_certainty_to_the_last():
    probabilities = np.array([[0.6, 0.4], [0.7, 0.3], [1.0, 0.0], [0.59, 0.41]])
    assert most_probable(probabilities, [0, 0, 0, 0])[2].tolist() == [6, 7, 9, 5]


def test_only_rounding_moves_a_probability_to_the_bin_above():
    of_first = np.array([0.6 - 0.8e-10, 0.6 - 1.2e-10, 1 - 1e-12])
    probabilities = np.column_stack([of_first, 1 - of_first])
    assert most_probable(probabilities, [0, 0, 0])[2].tolist() == [6, 5, 9]


def test_the_mean_of_a_bin_lies_within_it():
    curve = reliability(*stated(500, 3), n_bins=7)
    assert np.allclose(curve["to"] - curve["from"], 1 / 7)
    assert curve["to"].tolist()[-1] == 1
    assert ((curve["from"] <= curve["confidence"]) & (curve["confidence"] <= curve["to"])).all()


def test_the_number_of_bins_is_checked():
    with pytest.raises(ValueError, match="n_bins must be a whole number of at least 1, got 0"):
        reliability([[0.5, 0.5]], [0], n_bins=0)


def test_a_probability_rounded_to_above_1_has_no_negative_loss():
    loss = log_losses([[1 + 4e-16, 0.0]], [0])
    assert loss.tolist() == [0.0]
    assert not np.signbit(loss).any()


def test_a_reliability_curve_by_hand():
    probabilities = np.array([[0.5, 0.5], [0.45, 0.55], [0.05, 0.95], [0.96, 0.04], [1.0, 0.0]])
    curve = reliability(probabilities, [1, 1, 0, 0, 0])
    assert curve.index.tolist() == [0, 1]
    assert curve.to_dict("list") == {
        "from": [0.5, 0.9],
        "to": [0.6, 1.0],
        "confidence": pytest.approx([0.525, (0.95 + 0.96 + 1) / 3]),
        "frequency": pytest.approx([0.5, 2 / 3]),  # of equal probabilities the first is meant
        "count": [2, 3],
    }
    largest, correct, bins = most_probable(probabilities, [1, 1, 0, 0, 0], n_bins=1)
    assert bins.tolist() == [0] * 5
    assert correct.tolist() == [0, 1, 0, 1, 1]
    assert (largest.dtype, correct.dtype, bins.dtype) == (float, float, np.intp)


def test_scores_of_single_precision_are_double():
    single = np.array([[0.1, 0.9], [0.7, 0.3]], np.float32)
    for score in (log_losses, brier_scores):
        found = score(single, [1, 1])
        assert found.dtype == np.float64
        assert found == pytest.approx(score(single.astype(float), [1, 1]), rel=1e-15)
