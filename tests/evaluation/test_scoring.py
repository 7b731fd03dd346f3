"""Decisions on the unknown state are scored with its costs."""

import numpy as np
import pandas as pd
import pytest

from emacm import CostSensitiveGaussianBayes, family_costs
from emacm.evaluation.evaluate import evaluate
from emacm.evaluation.scoring import scoring_rule

CLASSES = np.array(["dry", "new", "worn"])
COST = {
    ("new", "worn"): 10,
    ("new", "unknown"): 25,
    ("unknown", "new"): 0.7,
    ("inspect", "dry"): 0.3,
    ("inspect", "new"): 0.2,
    ("inspect", "worn"): 0.3,
}


def far_away(seed=0):
    """Return units of three classes; recordings 55 (new) and 62 (worn) are far away."""
    rng = np.random.default_rng(seed)
    units = np.repeat(np.arange(12), 6)
    y = np.array(["new", "worn", "dry"])[units % 3]
    X = rng.normal(size=(72, 2)) + 9 * np.column_stack([y == "worn", y == "dry"])
    X[55], X[62] = (0, -400), (-300, 500)
    return X, y, units


@pytest.mark.slow
def test_predicted_costs_equal_the_risk_of_the_classifier():
    X, y, units = far_away()
    model = CostSensitiveGaussianBayes(COST, covariance="tied", unknown="unknown")
    found = evaluate(model, X, y, units=units, healthy="new", n_splits=3)
    for fold, held in found.predictions.query("scheme == 'by unit'").groupby("fold"):
        test = held["recording"].to_numpy()
        train = np.setdiff1d(np.arange(72), test)
        fitted = CostSensitiveGaussianBayes(COST, covariance="tied", unknown="unknown")
        fitted.fit(X[train], y[train], groups=units[train])
        assert held["predicted_cost"].to_numpy() == pytest.approx(fitted.risk(X[test]).min(axis=1))
        assert held["typicality"].to_numpy() == pytest.approx(fitted.typicality(X[test])), fold
        assert held["unknown_proba"].to_numpy() == pytest.approx(fitted.unknown_proba(X[test]))


def test_a_healthy_recording_decided_unknown_is_an_inspection_and_a_faulty_one_is_not_missed():
    X, y, units = far_away()
    model = CostSensitiveGaussianBayes(covariance="tied", unknown="unknown")
    later = {"later units": (units < 9, units >= 9)}
    found = evaluate(model, X, y, units=units, healthy="new", splits=later, n_splits=2)
    row, held = found.table.loc["later units"], found.predictions.query("scheme == 'later units'")
    assert held.set_index("recording").loc[[55, 62], "decision"].tolist() == ["unknown"] * 2
    assert row["inspection_rate"] == 1 / 6
    assert row["false_alarm_rate"] == 0
    assert row["missed_detection_rate"] == 0
    decided_unknown = found.confusions["later units"].loc["unknown"]
    assert decided_unknown.to_dict() == {"dry": 0, "new": 1, "worn": 1}


def test_costs_between_families_may_have_an_unknown_state():
    rows, columns = ["new", "fault", "unknown"], [*CLASSES, "unknown"]
    cost = pd.DataFrame([[8, 0, 8, 9], [0, 3, 0, 1], [1, 2, 1, 0]], rows, columns)
    rule = scoring_rule(CLASSES, cost=cost, unknown="unknown", healthy="new")
    found = rule.judge(["dry", "new", "worn"], ["new", "unknown", "unknown"])
    assert found["cost"].tolist() == [8, 2, 1]
    posterior = pd.DataFrame([[0.2, 0.5, 0.3]] * 3, columns=CLASSES)
    costs = rule.predicted_costs(["new", "fault", "unknown"], posterior, np.full(3, 0.4))
    assert costs == pytest.approx([0.6 * 8 * 0.5 + 0.4 * 9, 0.6 * 3 * 0.5 + 0.4, 0.6 * 1.5])


FAMILIES = {"worn": ["dry", "worn 1"], "new": ["new"]}
STATES = np.array(["dry", "new", "worn 1"])
OF_STATES = pd.DataFrame([[9, 0, 8], [0, 1, 0.5]], ["new", "worn"], STATES)


def test_families_follow_from_the_cost():
    rule = scoring_rule(STATES, cost=OF_STATES, healthy="new")
    assert rule.classes == STATES.tolist()
    assert rule.family_of == {"dry": "worn", "worn 1": "worn", "new": "new"}
    assert (rule.alarms, rule.healthy) == ({"worn"}, "new")
    assert (rule.unknown, rule.priors) == (None, None)
    plain = scoring_rule(STATES, healthy="new")
    assert plain.labels == STATES.tolist()
    assert plain.alarms == {"dry", "worn 1"}
    assert scoring_rule(STATES).healthy is None


@pytest.mark.parametrize(("healthy", "label"), [("new", "ok"), ("ok", "ok"), (None, None)])
def test_the_healthy_class_stands_for_its_family(healthy, label):
    families = {"ok": ["new"], "worn": ["dry", "worn 1"]}
    assert scoring_rule(STATES, cost=family_costs(families), healthy=healthy).healthy == label


def test_costs_of_families_are_those_of_their_classes():
    prices = [[7, 0, 7], [0, 2, 0], [0.4, 0.5, 0.4]]
    rule = scoring_rule(STATES, cost=pd.DataFrame(prices, ["new", "worn", "look"], STATES))
    table = rule.costs.loc[["new", "worn", "look"], STATES]
    np.testing.assert_array_equal(table, [[7, 0, 7], [0, 2, 0], [0.4, 0.5, 0.4]])
    assert rule.costs.loc["dry"].tolist() == table.loc["worn"].tolist()
    found = rule.judge(["dry", "dry", "new", "worn 1"], ["worn 1", "look", "dry", "new"])
    assert found.columns.tolist() == [
        "truth", "decision", "true_label", "decided_label", "correct", "cost",
    ]  # fmt: skip
    assert found["decided_label"].tolist() == ["worn", "look", "worn", "new"]
    assert found["true_label"].tolist() == ["worn", "worn", "new", "worn"]
    assert found["correct"].tolist() == [True, False, False, False]
    assert found["cost"].tolist() == [0, 0.4, 2, 7]
    posterior = pd.DataFrame([[0.2, 0.3, 0.5]], columns=["worn 1", "dry", "new"])
    assert rule.predicted_costs(["look"], posterior) == pytest.approx(0.5 * 0.4 + 0.5 * 0.5)


def test_costs_of_0_and_1_count_wrong_decisions():
    rule = scoring_rule(STATES, cost=family_costs(FAMILIES), unknown="odd")
    found = rule.judge(["dry", "new", "new"], ["worn 1", "odd", "new"])
    assert found["cost"].tolist() == [0, 1, 0]
    assert found["decided_label"].tolist() == ["worn", "odd", "new"]
    posterior = pd.DataFrame([[0.5, 0.1, 0.4]] * 3, columns=STATES)
    costs = rule.predicted_costs(["dry", "new", "odd"], posterior, np.array([0.2, 0.0, 0.5]))
    # The unknown state is true with the stated probability, and deciding it is then correct.
    assert costs == pytest.approx([0.8 * 0.1 + 0.2, 0.9, 0.5])
    assert rule.judge(["dry"], ["rusty"])["cost"].tolist() == [1]


def test_priors_in_service_are_given_the_known_states():
    stated = {"dry": 0.2, "new": 0.5, "worn 1": 0.2, "odd": 0.1}
    rule = scoring_rule(STATES, unknown="odd", priors=stated)
    assert rule.priors == pytest.approx({"dry": 2 / 9, "new": 5 / 9, "worn 1": 2 / 9})
    uniform = dict.fromkeys(STATES, 1 / 3)
    assert scoring_rule(STATES, priors="uniform").priors == pytest.approx(uniform)


def test_the_same_decision_for_every_recording_is_a_yardstick():
    costs = pd.DataFrame(
        [[0, 10, 20], [1, 0, 1], [1, 1, 0], [0.4, 0.4, 0.4]],
        index=["new", "ball", "ring", "inspect"],
        columns=["new", "ball", "ring"],
    )
    priors = {"new": 0.98, "ball": 0.01, "ring": 0.01}
    classes = np.array(["ball", "new", "ring"])
    rule = scoring_rule(classes, healthy="new", cost=costs, priors=priors)
    table = rule.constant_costs(["new", "ball", "ball", "ball"])  # no ring
    assert table.index.tolist() == ["always 'new'", "always 'inspect'", "always 'ball'"]
    np.testing.assert_allclose(table["expected_cost"], [7.5, 0.4, 0.25])
    np.testing.assert_allclose(table["realised_cost"], [0.1 / 0.99, 0.4, 0.98 / 0.99])
