"""Figures of merit with answers computed by hand."""

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, ClassifierMixin

from emacm import CostSensitiveGaussianBayes
from emacm.evaluation.bootstrap import cell_mean, gap_of_cells, group_draws, group_intervals
from emacm.evaluation.evaluate import evaluate


class Stated(ClassifierMixin, BaseEstimator):
    """Decides what its first column says, with the probabilities in the others."""

    def __init__(self, cost=None, priors=None):
        self.cost = cost
        self.priors = priors

    def fit(self, X, y):
        self.classes_ = np.unique(y)
        return self

    def predict(self, X):
        return np.array([row[0] for row in X], dtype=object)

    def predict_proba(self, X):
        return np.array([[float(value) for value in row[1:]] for row in X])


TRUTHS = ["new", "new", "new", "new", "new", "worn", "worn", "worn"]
DECISIONS = ["new", "new", "worn", "inspect", "new", "worn", "new", "inspect"]
OF_NEW = [0.95, 0.92, 0.25, 0.55, 0.85, 0.1, 0.75, 0.45]
COST = {("new", "worn"): 10, ("inspect", "new"): 0.3, ("inspect", "worn"): 0.4}


def stated(**options):
    X = np.array([[d, p, 1 - p] for d, p in zip(DECISIONS, OF_NEW, strict=True)], dtype=object)
    model = Stated(COST, options.pop("priors", None))
    return evaluate(model, X, TRUTHS, healthy="new", n_splits=2, **options)


def test_log_loss_and_calibration_error_equal_those_computed_by_hand():
    row = stated().table.loc["random split"]
    of_truth = [0.95, 0.92, 0.25, 0.55, 0.85, 0.9, 0.25, 0.55]
    assert row["log_loss"] == pytest.approx(-np.mean(np.log(of_truth)), rel=1e-12)
    # Bins of the largest probability: 0.95, 0.92 and 0.90 | 0.85 | 0.75 twice, both wrong | 0.55
    # twice, both right.
    gaps = [abs(0.95 + 0.92 + 0.9 - 3), abs(0.85 - 1), abs(2 * 0.75 - 0), abs(2 * 0.55 - 2)]
    assert row["calibration_error"] == pytest.approx(sum(gaps) / 8, rel=1e-12)
    assert row["calibration_error_low"] <= row["calibration_error"]
    assert row["calibration_error"] <= row["calibration_error_high"]


def test_predicted_costs_are_the_risks_of_the_decisions():
    found = stated()
    row = found.table.loc["random split"]
    risks = [10 * 0.05, 10 * 0.08, 0.25, 0.3 * 0.55 + 0.4 * 0.45, 10 * 0.15]
    risks += [0.1, 10 * 0.25, 0.3 * 0.45 + 0.4 * 0.55]
    held = found.predictions.sort_values("recording")
    assert held["predicted_cost"].tolist() == pytest.approx(risks)
    assert row["predicted_cost"] == pytest.approx(np.mean(risks))
    paid = [0, 0, 1, 0.3, 0, 0, 10, 0.4]
    assert row["realised_cost"] == row["expected_cost"] == pytest.approx(np.mean(paid))


def test_costs_in_service_weight_the_classes_by_the_priors_of_the_classifier():
    found = stated(priors={"new": 0.9, "worn": 0.1})
    row = found.table.loc["random split"]
    assert row["realised_cost"] == pytest.approx(0.9 * (1.3 / 5) + 0.1 * (10.4 / 3))
    assert row["expected_cost"] == pytest.approx(11.7 / 8)
    held = found.predictions.groupby("truth")["predicted_cost"].mean()
    assert row["predicted_cost"] == pytest.approx(0.9 * held["new"] + 0.1 * held["worn"])


def test_without_a_cost_the_predicted_cost_is_the_predicted_error_rate():
    X = np.array([["a", 0.7, 0.3], ["b", 0.7, 0.3], ["a", 0.4, 0.6], ["b", 0.2, 0.8]], object)
    found = evaluate(Stated(), X, ["a", "a", "b", "b"], n_splits=2)
    held = found.predictions.sort_values("recording")
    assert held["predicted_cost"].tolist() == pytest.approx([0.3, 0.7, 0.6, 0.2])


@pytest.mark.slow
def test_a_calibrated_classifier_pays_what_it_predicts():
    rng = np.random.default_rng(4)
    y = rng.choice(["new", "worn"], 6000, p=[0.7, 0.3])
    X = rng.normal(1.5 * (y == "worn")[:, np.newaxis], 1.0)
    cost = COST | {("inspect", "new"): 0.5, ("inspect", "worn"): 0.5}
    model = CostSensitiveGaussianBayes(cost, covariance="tied")
    row = evaluate(model, X, y, n_splits=3).table.loc["random split"]
    assert row["realised_cost_low"] < row["predicted_cost"] < row["realised_cost_high"]
    assert row["calibration_error"] < 0.02
    sharp = CostSensitiveGaussianBayes(cost, covariance="tied", temperature=0.3)
    over = evaluate(sharp, X, y, n_splits=3)
    over_row = over.table.loc["random split"]
    assert over_row["realised_cost_low"] > 1.5 * over_row["predicted_cost_high"]
    assert over_row["calibration_error"] > 0.05
    assert any("over-confident" in caveat for caveat in over.caveats)


def test_gaps_of_opposite_sign_within_one_bin_cancel_and_between_bins_add_up():
    values = np.array([0.4, -0.4, 0.2, -0.1])
    assert cell_mean(values, [0, 0, 0, 0], gap_of_cells) == pytest.approx(0.1 / 4)
    assert cell_mean(values, [0, 1, 0, 1], gap_of_cells) == pytest.approx(1.1 / 4)


def test_the_interval_of_a_gap_is_around_it_and_not_around_its_draws():
    rng = np.random.default_rng(0)
    values, bins = rng.normal(0, 0.5, 400), rng.integers(0, 10, 400)
    gap = cell_mean(values, bins, gap_of_cells)
    (drawn,) = group_draws([values], [bins], np.arange(400), combine=[gap_of_cells])
    assert drawn.mean() > 1.2 * gap  # resampling adds to an absolute value
    ((low, high),) = group_intervals([values], [bins], np.arange(400), combine=[gap_of_cells])
    assert low < gap < high


def test_the_same_groups_and_seed_give_paired_draws():
    rng = np.random.default_rng(1)
    first, second = rng.random((2, 60))
    groups, one_cell = np.repeat(np.arange(12), 5), np.zeros((1, 60), int)
    draws = [group_draws([v], one_cell, groups)[0] for v in (first, second, first - second)]
    assert np.allclose(draws[0] - draws[1], draws[2])


def test_families_have_the_probability_of_their_classes_in_the_predicted_cost():
    X = np.array([["worn", 0.5, 0.2, 0.3], ["new", 0.6, 0.3, 0.1]] * 4, object)
    y = ["worn1", "new", "worn2", "new"] * 2
    families = {"new": "new", "worn1": "worn", "worn2": "worn"}
    cost = pd.DataFrame([[0, 7], [2, 0]], index=["new", "worn"], columns=["new", "worn"])
    found = evaluate(Stated(), X, y, families=families, cost=cost, n_splits=2)
    held = found.predictions.sort_values("recording")["predicted_cost"]
    assert held.tolist() == pytest.approx([2 * 0.5, 7 * 0.4] * 4)
