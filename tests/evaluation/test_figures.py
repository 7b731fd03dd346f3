"""Figures of merit with answers computed by hand."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, ClassifierMixin

from emacm import CostSensitiveGaussianBayes
from emacm.evaluation.bootstrap import (
    cell_mean,
    draw_interval,
    drawn_groups,
    gap_of_cells,
    group_draws,
    group_intervals,
)
from emacm.evaluation.evaluate import evaluate
from emacm.evaluation.figures import (
    FIGURES,
    confusion,
    figure_row,
    label_posteriors,
    reliability_curve,
    tallies,
)
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


def test_costs_in_service_have_the_interval_of_the_weighted_mean():
    judged, rule = judged_families()
    held = judged.assign(predicted_cost=1.0, **{"P(worn)": 0.75, "P(new)": 0.25})
    priors = {"dry": 0.5, "new": 0.3, "spalled": 0.2}
    groups = np.array([3, 3, 1, 1, 4, 0, 4])
    row = figure_row(tallies(held, replace(rule, priors=priors)), groups, **BOOTSTRAP)
    cost, truths = held["cost"].to_numpy(), held["truth"].to_numpy()
    (times,) = drawn_groups(4, 300, 2)
    drawn = []
    for weight in times[:, np.unique(groups, return_inverse=True)[1]]:
        of = {name: weight * (truths == name) for name in priors}
        known = all(each.sum() for each in of.values())
        means = [share * (of[name] @ cost / of[name].sum()) for name, share in priors.items()
                 ] if known else [np.nan]  # fmt: skip
        drawn.append(sum(means))
    assert 0.1 < np.isnan(drawn).mean() < 0.9
    estimate = 0.5 * 4.5 / 3 + 0.3 * 1.5 / 3 + 0.2 * 0
    assert row["realised_cost"] == pytest.approx(estimate)
    limits = draw_interval(np.array(drawn), estimate, 4, (0, 4), 0.9)
    assert (row["realised_cost_low"], row["realised_cost_high"]) == pytest.approx(limits)


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
    found = evaluate(Stated(), X, y, n_splits=2).rescored(families=families, cost=cost)
    held = found.predictions.sort_values("recording")["predicted_cost"]
    assert held.tolist() == pytest.approx([2 * 0.5, 7 * 0.4] * 4)


BOOTSTRAP = {"confidence": 0.9, "n_resamples": 300, "random_state": 2}


def test_each_bin_of_a_reliability_curve_has_the_interval_of_its_own_recordings():
    of_a = np.array([0.95, 0.95, 0.91, 0.3, 0.3, 0.97, 0.95, 0.25, 0.3, 0.3, *[0.55, 0.45] * 7])
    truths = pd.Series(list("baabbbaaaa" + "aabaaaabbaaaba"))
    groups = np.array([1, 1, 2, 3, 4, 5, 6, 7, 1, 2, *np.arange(14) // 2 + 1])
    probabilities = np.column_stack([1 - of_a, of_a])
    curve = reliability_curve(probabilities, truths, ["b", "a"], groups, **BOOTSTRAP)
    assert curve["from"].tolist() == [0.5, 0.7, 0.9]
    assert curve["count"].tolist() == [14, 5, 5]
    assert curve["groups"].tolist() == [7, 5, 4]
    assert curve["frequency"].tolist() == [5 / 14, 0.4, 0.6]
    assert not curve[["low", "high"]].duplicated().any()
    middle = abs(of_a - 0.5) < 0.1
    for row, chosen in enumerate((middle, ~middle & (of_a < 0.5), ~middle & (of_a > 0.5))):
        correct = (of_a > 0.5) == (truths == "a")
        ((low, high),) = group_intervals([correct], [np.where(chosen, 0, -1)], groups, **BOOTSTRAP)
        assert (curve["low"][row], curve["high"][row]) == (low, high)


def judged_families():
    """Three classes in two families; "inspect" is no family."""
    families = {"worn": ["dry", "spalled"], "new": ["new"]}
    cost = pd.DataFrame(
        [[0, 4], [1, 0], [0.5, 0.5]], index=["new", "worn", "inspect"], columns=["new", "worn"]
    )
    classes = np.array(["dry", "new", "spalled"])
    rule = scoring_rule(classes, families=families, cost=cost, healthy="new")
    truths = ["dry", "dry", "new", "spalled", "new", "new", "dry"]
    decisions = ["worn", "new", "inspect", "dry", "worn", "new", "inspect"]
    return rule.judge(truths, decisions), rule


def test_the_confusion_counts_families_decided_on_in_the_classes_of_their_truth():
    counts = confusion(*judged_families())
    assert (counts.index.name, counts.columns.name) == ("decided", "true")
    assert counts.index.tolist() == ["worn", "new", "inspect"]
    assert counts.columns.tolist() == ["dry", "spalled", "new"]
    assert counts.to_numpy().tolist() == [[1, 1, 1], [1, 0, 1], [1, 0, 1]]


def test_figures_of_merit_by_hand_are_in_their_order():
    found = tallies(*judged_families())
    assert list(found) == [name for name in FIGURES if name in found]
    row = figure_row(found, np.arange(7), **BOOTSTRAP)
    assert list(row)[:3] == [f"balanced_accuracy{end}" for end in ("", "_low", "_high")]
    expected = {
        "balanced_accuracy": (1 / 3 + 2 / 4) / 2,
        "accuracy": 3 / 7,
        "false_alarm_rate": 1 / 3,
        "inspection_rate": 1 / 3,
        "missed_detection_rate": 1 / 4,
        "expected_cost": (4 + 0.5 + 1 + 0.5) / 7,
    }
    assert {name: row[name] for name in expected} == pytest.approx(expected)
    assert row["accuracy_low"] < 3 / 7 < row["accuracy_high"]


def test_probabilities_of_the_classes_of_a_family_are_added():
    _, rule = judged_families()
    posterior = pd.DataFrame([[0.2, 0.5, 0.3]], columns=["spalled", "new", "dry"])
    assert label_posteriors(posterior, rule) == pytest.approx(np.array([[0.5, 0.5]]))
    assert rule.labels == ["worn", "new"]


def test_classes_that_are_all_impossible_in_service_have_no_cost_in_service():
    judged, rule = judged_families()
    held = judged[judged["truth"] != "new"].reset_index(drop=True)
    held = held.assign(predicted_cost=1.0, **{"P(worn)": 0.8, "P(new)": 0.2})
    priors = {"dry": 0.0, "new": 1.0, "spalled": 0.0}
    row = figure_row(tallies(held, replace(rule, priors=priors)), np.arange(4), **BOOTSTRAP)
    assert np.isnan([row["realised_cost"], row["predicted_cost"]]).all()
    assert row["expected_cost"] == pytest.approx(4.5 / 4)
    weighted = replace(rule, priors=priors | {"dry": 0.1, "spalled": 0.3})
    row = figure_row(tallies(held, weighted), np.arange(4), **BOOTSTRAP)
    assert row["realised_cost"] == pytest.approx(0.25 * 4.5 / 3 + 0.75 * 0)
