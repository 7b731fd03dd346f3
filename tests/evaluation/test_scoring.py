"""Decisions on the unknown state are scored with its costs."""

import numpy as np
import pandas as pd
import pytest

from emacm import CostSensitiveGaussianBayes, LeastRiskClassifier
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


def test_the_unknown_state_is_a_decision_that_has_its_own_costs():
    rule = scoring_rule(CLASSES, cost=COST, unknown="unknown", healthy="new")
    found = rule.judge(["new", "new", "worn", "dry"], ["unknown", "worn", "new", "unknown"])
    assert found["cost"].tolist() == [0.7, 1, 10, 1]
    assert found["decided_label"].tolist() == ["unknown", "worn", "new", "unknown"]
    assert not found["correct"].any()
    assert rule.alarms == {"dry", "worn"}


def test_the_probability_of_the_unknown_state_is_part_of_the_predicted_cost():
    rule = scoring_rule(CLASSES, cost=COST, unknown="unknown")
    posterior = pd.DataFrame([[0.1, 0.6, 0.3], [0.5, 0.0, 0.5]], columns=CLASSES)
    found = rule.predicted_costs(["new", "inspect"], posterior, np.array([0.2, 0.5]))
    of_new = 0.8 * (0.1 * 1 + 0.3 * 10) + 0.2 * 25
    assert found.tolist() == pytest.approx([of_new, 0.5 * 0.3 + 0.5 * 0.3])
    known = rule.predicted_costs(["new", "inspect"], posterior)
    assert known.tolist() == pytest.approx([3.1, 0.3])


@pytest.mark.slow
def test_predicted_costs_equal_the_risk_of_the_classifier():
    X, y, units = far_away()
    model = CostSensitiveGaussianBayes(COST, covariance="tied", unknown="unknown")
    found = evaluate(model, X, y, units=units, healthy="new")
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
    found = evaluate(model, X, y, units=units, healthy="new", splits=later)
    row, held = found.table.loc["later units"], found.predictions.query("scheme == 'later units'")
    assert held.set_index("recording").loc[[55, 62], "decision"].tolist() == ["unknown"] * 2
    assert row["inspection_rate"] == 1 / 6
    assert row["false_alarm_rate"] == 0
    assert row["missed_detection_rate"] == 0
    decided_unknown = found.confusions["later units"].loc["unknown"]
    assert decided_unknown.to_dict() == {"dry": 0, "new": 1, "worn": 1}


@pytest.mark.slow
def test_another_classifier_with_an_unknown_state_is_scored_alike():
    from sklearn.ensemble import IsolationForest
    from sklearn.naive_bayes import GaussianNB

    X, y, units = far_away()
    detector = IsolationForest(n_estimators=20, random_state=0)
    model = LeastRiskClassifier(GaussianNB(), unknown="novel", detector=detector)
    found = evaluate(model, X, y, units=units, n_splits=3)
    assert {"typicality", "unknown_proba"} <= set(found.predictions)
    assert found.predictions["typicality"].between(0, 1).all()


def test_an_unknown_state_with_the_label_of_a_class_is_refused():
    with pytest.raises(ValueError, match="unknown = 'dry' is a class with recordings"):
        scoring_rule(CLASSES, unknown="dry")


def test_costs_between_families_may_have_an_unknown_state():
    families = {"new": "new", "dry": "fault", "worn": "fault"}
    rows = ["new", "fault", "unknown"]
    cost = pd.DataFrame([[0, 8, 9], [3, 0, 1], [2, 1, 0]], rows, rows)
    rule = scoring_rule(CLASSES, families=families, cost=cost, unknown="unknown", healthy="new")
    found = rule.judge(["dry", "new", "worn"], ["new", "unknown", "unknown"])
    assert found["cost"].tolist() == [8, 2, 1]
