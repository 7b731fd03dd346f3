"""Evaluations of several sensors are compared by paired differences."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from sklearn.naive_bayes import GaussianNB
from sklearn.svm import LinearSVC

from emacm import CostSensitiveGaussianBayes, evaluate
from emacm.evaluation.comparison import compare

STATES = ["worn", "new", "new", "dry", "new"]


def sensors(n_runs=14, seed=0):
    """Return two sensors that are disturbed by the same runs, classes and runs."""
    rng = np.random.default_rng(seed)
    y, runs = np.tile(STATES, n_runs), np.repeat(np.arange(n_runs), len(STATES))
    signal = 2.5 * np.array([{"new": 0, "worn": 1, "dry": 2}[state] for state in y])
    disturbed = signal + rng.normal(scale=2.0, size=n_runs)[runs]
    vibration = disturbed + rng.normal(scale=0.4, size=len(y))
    current = disturbed + rng.normal(scale=0.9, size=len(y))
    return {"vibration": vibration[:, None], "current": current[:, None]}, y, runs


@pytest.fixture(scope="module")
def found():
    X, y, runs = sensors()
    return {
        name: evaluate(GaussianNB(), columns, y, runs=runs, healthy="new", n_splits=5)
        for name, columns in X.items()
    }


def test_differences_are_those_of_the_figures_of_merit(found):
    row = compare(found).differences.loc["current"]
    tables = {name: each.table.loc["by run"] for name, each in found.items()}
    for name in ("balanced_accuracy", "missed_detection_rate", "log_loss", "calibration_error"):
        expected = tables["current"][name] - tables["vibration"][name]
        assert row[name] == pytest.approx(expected, abs=1e-12)
        assert row[f"{name}_low"] <= row[name] <= row[f"{name}_high"]
    turned = compare(dict(reversed(found.items()))).differences.loc["vibration"]
    assert turned["log_loss"] == pytest.approx(-row["log_loss"])
    assert turned["log_loss_low"] == pytest.approx(-row["log_loss_high"])


@pytest.mark.parametrize("faulty", [False, True])
def test_figures_without_any_recording_and_of_few_groups_have_no_interval(faulty):
    X, y, runs = sensors()
    of_state = (y != "new") == faulty
    later = {"later": (runs < 7, (runs >= 7) & of_state)}
    options = {"runs": runs, "healthy": "new", "splits": later, "n_splits": 2}
    found = [evaluate(CostSensitiveGaussianBayes(), each, y, **options) for each in X.values()]
    comparison = compare(found, scheme="later")
    row = comparison.differences.loc["2"]
    names = ["missed_detection_rate", "false_alarm_rate"]
    known, unknown = names if faulty else names[::-1]
    assert np.isnan(row[[unknown, f"{unknown}_low", f"{unknown}_high"]]).all()
    assert row[f"{known}_low"] <= row[known] <= row[f"{known}_high"]
    assert comparison.reference == "1"
    assert comparison.caveats == []
    assert "95 % confidence interval" in str(comparison)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rows": slice(65)}, "their recordings, folds, classes, groups differ"),
        ({"n_splits": 3}, "their folds differ"),
        ({"units": True}, "their groups differ"),
        ({"seen": "new"}, "classes differ"),
        ({"healthy": "dry"}, "their labels or healthy labels differ"),
    ],
)
def test_unpaired_evaluations_have_no_difference_and_a_caveat_says_why(found, change, words):
    X, y, runs = sensors()
    rows = change.get("rows", slice(None))
    if "seen" in change:
        y = np.where(np.arange(len(y)) == 3, "worn", y)
    runs = pd.Series(runs + 100 * ("units" in change), name="run")[rows]
    options = {"healthy": change.get("healthy", "new"), "n_splits": change.get("n_splits", 5)}
    other = evaluate(GaussianNB(), X["current"][rows], y[rows], runs=runs, **options)
    scheme = "random split" if "n_splits" in change else "by run"
    comparison = compare({"one": found["current"], "two": other}, scheme=scheme)
    assert comparison.caveats[0].startswith("No differences between 'two' and 'one': ")
    assert words in comparison.caveats[0]
    assert comparison.differences.isna().all(axis=None)
    assert comparison.table["accuracy"].notna().all()


def test_costs_are_compared_only_if_they_are_equal():
    X, y, runs = sensors()
    options = {"runs": runs, "healthy": "new", "n_splits": 3}
    few, many = {("new", "worn"): 10}, {("new", "worn"): 50}
    priors = {"new": 0.9, "worn": 0.04, "dry": 0.06}
    models = [CostSensitiveGaussianBayes(cost) for cost in (few, many, few)]
    models.append(CostSensitiveGaussianBayes(few, priors=priors))
    found = [evaluate(model, X["current"], y, **options) for model in models]
    comparison = compare(dict(zip("abcd", found, strict=True)))
    assert "No differences of costs between 'd' and 'a'" in comparison.caveats[1]
    assert "No differences of costs between 'b' and 'a': their costs, or" in comparison.caveats[0]
    row = comparison.differences.loc["b"]
    assert np.isnan(row[["expected_cost", "realised_cost", "predicted_cost"]]).all()
    assert not np.isnan(row["accuracy"])
    assert comparison.differences.loc["c", "expected_cost"] == 0
    assert [*comparison.differences] == [*found[0].table.columns[:30]]  # ten with limits


def test_the_second_scheme_that_all_have_scored_is_compared_or_the_only_one():
    X, y, runs = sensors()
    options = {"runs": runs, "n_splits": 5}
    some = evaluate(GaussianNB(), X["current"], y, n_splits=5)
    every = evaluate(GaussianNB(), X["current"], y, units=runs // 2, **options)
    assert compare([every, every]).scheme == "by run"
    for pair in ([some, every], [every, some], [some, some]):
        assert compare(pair).scheme == "random split"
    only = replace(every, confusions={"by unit": every.confusions["by unit"]})
    assert compare([only, every]).scheme == "by unit"
    assert compare([only, every]).differences["accuracy"].tolist() == [0.0]
    with pytest.raises(ValueError, match=r"scheme in common .*'1': \['random split'\], '2': \['by"):
        compare([some, only])


def test_figures_of_merit_that_one_of_two_lacks_are_left_out():
    X, y, runs = sensors()
    options = {"runs": runs, "n_splits": 3}
    both = [evaluate(model, X["current"], y, **options) for model in (GaussianNB(), LinearSVC())]
    comparison = compare(both)
    assert "log_loss" not in comparison.differences
    assert np.isnan(comparison.table.loc["2", "log_loss"])
    assert comparison.summary().loc["2", "log loss"] == "-"


@pytest.mark.parametrize(
    ("change", "options", "error", "words"),
    [
        (lambda found: found["current"], {}, TypeError, "must be a mapping of names to results"),
        (lambda found: {"a": found["current"].table}, {}, TypeError, "dict of .*DataFrame"),
        (lambda found: [found["current"]], {}, ValueError, "at least two"),
        (lambda found: found, {"scheme": "x"}, ValueError, r"'by run'\]; got 'x'"),
    ],
)
def test_invalid_evaluations_are_refused(found, change, options, error, words):
    with pytest.raises(error, match=words):
        compare(change(found), **options)
