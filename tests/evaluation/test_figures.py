"""Figures of merit with answers computed by hand."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, ClassifierMixin

from emacm import CostSensitiveGaussianBayes
from emacm.evaluation.bootstrap import GroupBootstrap
from emacm.evaluation.evaluate import evaluate
from emacm.evaluation.figures import log_losses, most_probable, reliability, tallies
from emacm.evaluation.scoring import scoring_rule


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


@pytest.mark.slow
def test_a_calibrated_classifier_pays_what_it_predicts():
    rng = np.random.default_rng(4)
    y = rng.choice(["new", "worn"], 3000, p=[0.7, 0.3])
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


def judged_families():
    """Three classes in two families; "inspect" is no family."""
    rows, classes = ["new", "worn", "inspect"], np.array(["dry", "new", "spalled"])
    cost = pd.DataFrame([[4, 0, 4], [0, 1, 0], [0.5, 0.5, 0.5]], rows, classes)
    rule = scoring_rule(classes, cost=cost, healthy="new")
    truths = ["dry", "dry", "new", "spalled", "new", "new", "dry"]
    decisions = ["worn", "new", "inspect", "dry", "worn", "new", "inspect"]
    return rule.judge(truths, decisions), rule


def test_costs_in_service_are_weighted_by_the_priors_of_the_classes_that_occur():
    judged, rule = judged_families()
    held = judged[judged["truth"] != "new"].reset_index(drop=True)
    held = held.assign(predicted_cost=1.0, **{"P(worn)": 0.8, "P(new)": 0.2})
    weighted = replace(rule, priors={"dry": 0.1, "new": 1.0, "spalled": 0.3})
    row = GroupBootstrap().figures(tallies(held, weighted), np.arange(4))
    assert row["expected_cost"] == pytest.approx(4.5 / 4)
    assert row["realised_cost"] == pytest.approx(0.25 * 4.5 / 3 + 0.75 * 0)
    impossible = replace(rule, priors={"dry": 0.0, "new": 1.0, "spalled": 0.0})
    row = GroupBootstrap().figures(tallies(held, impossible), np.arange(4))
    assert np.isnan([row["realised_cost"], row["predicted_cost"]]).all()


def test_an_impossible_truth_costs_36_nats_and_no_loss_is_negative():
    assert log_losses([[1.0, 0.0]], [1])[0] == pytest.approx(36.04, abs=0.01)
    assert not np.signbit(log_losses([[1 + 4e-16, 0.0]], [0]))  # rounded to above 1


def test_an_edge_belongs_to_the_bin_above_and_certainty_to_the_last():
    of_first = np.array([0.6, 0.7, 1.0, 0.59, 0.6 - 0.8e-10, 0.6 - 1.2e-10, 1 - 1e-12])
    probabilities = np.column_stack([of_first, 1 - of_first])
    found = most_probable(probabilities, np.zeros(7, int))
    assert found[2].tolist() == [6, 7, 9, 5, 6, 5, 9]  # only rounding moves one to the bin above


def test_a_reliability_curve_by_hand():
    probabilities = np.array([[0.5, 0.5], [0.45, 0.55], [0.05, 0.95], [0.96, 0.04], [1.0, 0.0]])
    curve = reliability(probabilities, [1, 1, 0, 0, 0], np.arange(5))
    assert curve[["from", "to", "confidence", "frequency", "count"]].to_dict("list") == {
        "from": [0.5, 0.9],
        "to": [0.6, 1.0],
        "confidence": pytest.approx([0.525, (0.95 + 0.96 + 1) / 3]),
        "frequency": pytest.approx([0.5, 2 / 3]),  # of equal probabilities the first is meant
        "count": [2, 3],
    }
