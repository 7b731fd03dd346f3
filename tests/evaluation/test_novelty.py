"""Families of faults that are left out of training are unknown in the test."""

import numpy as np
import pandas as pd
import pytest
from sklearn.metrics import roc_auc_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from emacm import ConditionRouter, CostSensitiveGaussianBayes, family_costs
from emacm.evaluation.bootstrap import GroupBootstrap
from emacm.evaluation.novelty import evaluate_unknown, novelty_table

STATES = ["new", "dry1", "dry2", "worn"]
FAMILIES = {"new": ["new"], "dry": ["dry1", "dry2"], "worn": ["worn"]}
PLACES = {"new": (0, 0, 0), "dry1": (9, 0, 0), "dry2": (9, 5, 0), "worn": (0, 0, 40)}


def fleet(n_units=20, n_each=4, seed=0):
    """Return recordings of units of one state each; "worn" is far from all others."""
    rng = np.random.default_rng(seed)
    units = np.repeat(np.arange(n_units), n_each)
    y = np.array(STATES)[units % 4]
    return rng.normal(size=(len(y), 3)) + [PLACES[state] for state in y], y, units


def classifier(cost=None, **options):
    return CostSensitiveGaussianBayes(cost, unknown="unknown", covariance="tied", **options)


@pytest.fixture(scope="module")
def found():
    X, y, units = fleet()
    model = make_pipeline(StandardScaler(), classifier(family_costs(FAMILIES)))
    return evaluate_unknown(model, X, y, units=units, healthy="new", n_splits=3)


@pytest.mark.slow
def test_decisions_and_typicality_are_those_of_a_classifier_without_the_family_and_the_units():
    X, y, units = fleet()
    model = classifier(family_costs(FAMILIES))
    found = evaluate_unknown(model, X, y, units=units, healthy="new", n_splits=2)
    held = found.predictions.query("left_out == 'dry'")
    assert held["fold"].nunique() > 1  # how many depends on the version of scikit-learn
    for _, part in held.groupby("fold"):
        test = np.isin(units, part["group"])
        train = ~test & ~np.isin(y, FAMILIES["dry"])
        alone = classifier().fit(X[train], y[train], groups=units[train])
        rows = part["recording"].to_numpy()
        assert set(rows) == set(np.flatnonzero(test))
        assert part["typicality"].to_numpy() == pytest.approx(alone.typicality(X[rows]))
        assert part["unknown_proba"].to_numpy() == pytest.approx(alone.unknown_proba(X[rows]))
        assert part["decision"].tolist() == alone.predict(X[rows]).tolist()
        largest = alone.predict_proba(X[rows]).max(axis=1)
        assert part["confidence"].to_numpy() == pytest.approx(largest)


def test_the_area_under_the_curve_is_that_of_scikit_learn(found):
    assert found.predictions.index.tolist() == list(range(160))  # both families
    for family, part in found.predictions.groupby("left_out"):
        expected = roc_auc_score(part["is_unknown"], -part["typicality"])
        row = found.table.loc[family]
        assert row["auroc"] == pytest.approx(expected, rel=1e-12)
        assert row["auroc_low"] <= row["auroc"] <= row["auroc_high"]


def test_a_family_far_from_all_others_is_recognised_as_unknown(found):
    far = found.table.loc["worn"]
    assert far["auroc"] == 1
    assert far["unknown_flagged"] == 1
    assert far["unknown_called_healthy"] == 0
    assert (found.table["known_flagged"] < 0.1).all()
    held = found.predictions.query("left_out == 'worn' and is_unknown")
    assert (held["decision"] == "unknown").all()


PREDICTIONS = pd.DataFrame(
    {
        "left_out": "dry",
        "group": [1, 1, 2, 2, 3, 3, 4],
        "is_unknown": [False, False, False, False, True, True, True],
        "decided_label": ["new", "worn", "unknown", "new", "new", "worn", "unknown"],
        "typicality": [0.5, 0.3, 0.01, 0.2, 0.3, 0.005, 0.0101],
    }
)


def test_rates_are_counted_among_the_known_and_the_unknown_separately():
    row = novelty_table(PREDICTIONS, {"new"}).loc["dry"]
    assert row["known_flagged"] == 1 / 4
    assert row["unknown_flagged"] == 1 / 3
    assert row["unknown_called_healthy"] == 1 / 3
    # 0.3: above 0.01 and 0.2, equal to 0.3 | 0.005: below all four | 0.0101: above 0.01 only
    assert row["auroc"] == pytest.approx((1 + 0.5 + 4 + 3) / 12)
    assert (row["known"], row["unknown"]) == (4, 3)
    both = novelty_table(PREDICTIONS, {"new", "worn"}).loc["dry"]
    assert both["unknown_called_healthy"] == 2 / 3
    without = novelty_table(PREDICTIONS, ())
    assert "unknown_called_healthy" not in without


@pytest.mark.parametrize(("n_known", "n_unknown"), [(6, 3), (3, 6), (6, 7), (1, 6), (6, 0), (0, 6)])
def test_the_interval_of_the_area_counts_the_groups_of_the_rarer_kind(n_known, n_unknown):
    rng = np.random.default_rng(5)
    is_unknown = np.repeat(np.arange(n_known + n_unknown) >= n_known, 4)
    groups = np.repeat(np.arange(n_known + n_unknown), 4)
    typicality = np.round(rng.random(len(groups)) * np.where(is_unknown, 0.7, 1), 2)
    table = {"left_out": "dry", "is_unknown": is_unknown, "typicality": typicality}
    predictions = pd.DataFrame(table | {"group": groups, "decided_label": "new"})
    row = novelty_table(predictions, ()).loc["dry"]
    times = GroupBootstrap().times(n_known + n_unknown)
    mine, theirs = typicality[is_unknown, np.newaxis], typicality[~is_unknown]
    won = (mine < theirs) + 0.5 * (mine == theirs)
    drawn = []
    for weight in times[:, groups]:
        first, second = weight[is_unknown], weight[~is_unknown]
        pairs = first.sum() * second.sum()
        drawn.append(first @ won @ second / pairs if pairs else np.nan)
    auroc = roc_auc_score(is_unknown, -typicality) if n_known and n_unknown else np.nan
    n_groups = min(n_known, n_unknown)
    expected = GroupBootstrap().interval("auroc", np.array(drawn), auroc, n_groups, bounds=(0, 1))
    found = row[[*expected]].to_numpy(float)
    assert found == pytest.approx(np.array([*expected.values()]), nan_ok=True)
    assert (row["known"], row["unknown"]) == (4 * n_known, 4 * n_unknown)


def test_a_family_without_which_the_classifier_cannot_be_fitted_is_named():
    X, y, units = fleet()
    chosen = np.isin(y, ["new", "dry1"])
    one_healthy = np.where(y == "new", 0, units)[chosen]
    found = evaluate_unknown(classifier(), X[chosen], y[chosen], units=one_healthy, healthy="new")
    assert found.table.empty
    (caveat,) = [text for text in found.caveats if "could not be left out" in text]
    assert caveat.startswith("'dry1' could not be left out of training. The estimator refuses:")
    assert "no class has recordings in two groups" in caveat


@pytest.mark.slow
def test_costs_and_priors_of_the_family_left_out_are_left_out():
    X, y, units = fleet()
    priors = {"new": 0.5, "dry1": 0.125, "dry2": 0.125, "worn": 0.25}
    cost = family_costs(FAMILIES, {("new", "worn"): 10, ("worn", "new"): 2})
    cost["unknown"] = [5.0, 1.0, 1.0]
    model = classifier(cost, priors=priors)
    found = evaluate_unknown(model, X, y, units=units, healthy="new", n_splits=2)
    assert found.table.index.tolist() == ["dry", "worn"]
    held = found.predictions.query("left_out == 'worn' and fold == 0")
    rows, test = held["recording"].to_numpy(), np.isin(units, held["group"])
    train = ~test & (y != "worn")
    some = {"new": 2 / 3, "dry1": 1 / 6, "dry2": 1 / 6}
    alone = classifier(cost.drop(columns="worn"), priors=some)
    alone.fit(X[train], y[train], groups=units[train])
    assert held["decision"].tolist() == alone.predict(X[rows]).tolist()
    table = pd.DataFrame(X, columns=["a", "b", "c"]).assign(load=np.arange(len(X)) // 2 % 2)
    router = ConditionRouter(model, "load")
    routed = evaluate_unknown(router, table, y, units=units, healthy="new", n_splits=2)
    assert routed.table.index.tolist() == ["dry", "worn"]
