"""Evaluation by several hold-out schemes."""

import re
from functools import cache

import joblib
import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.ensemble import VotingClassifier
from sklearn.metrics import balanced_accuracy_score, log_loss
from sklearn.model_selection import GroupKFold, LeaveOneGroupOut
from sklearn.naive_bayes import GaussianNB
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from emacm import (
    CostSensitiveGaussianBayes,
    NewUnitClassifier,
    OrderPSD,
    OrderResampler,
    PosteriorProduct,
    Recording,
    evaluate,
)

STATES = ["normal", "worn1", "worn2", "spalled"]
FAMILIES = {"normal": ["normal"], "worn": ["worn1", "worn2"], "spalled": ["spalled"]}


def near_copies(n_runs=60, n_copies=4, n_classes=3, seed=0):
    """Return features that are those of the run and tell nothing of the class."""
    rng = np.random.default_rng(seed)
    X = np.repeat(rng.normal(size=(n_runs, 3)), n_copies, axis=0)
    y = np.repeat(np.arange(n_runs) % n_classes, n_copies)
    return X, y, np.repeat(np.arange(n_runs), n_copies)


def sub_states(n_runs=8, seed=0, width=1.0):
    """Return features of four states around their own centres, eight runs of each."""
    rng = np.random.default_rng(seed)
    y = np.repeat(STATES, n_runs * 3)
    centres = dict(zip(STATES, [(0, 0), (3, 0), (0, 3), (3, 3)], strict=True))
    X = np.array([centres[state] for state in y]) + rng.normal(scale=width, size=(len(y), 2))
    return X, y, np.tile(np.repeat(np.arange(n_runs), 3), len(STATES))


def family_cost():
    family_of = {state: family for family, members in FAMILIES.items() for state in members}
    prices = [[float(family_of[state] != family) * 2 for state in STATES] for family in FAMILIES]
    return pd.DataFrame(prices, index=[*FAMILIES], columns=STATES)


@cache
def evaluated_states():
    X, y, runs = sub_states()
    return evaluate(GaussianNB(), X, y, runs=runs)


class Echo(ClassifierMixin, BaseEstimator):
    """Answers what its feature says, whatever it was taught."""

    def __init__(self, cost=None):
        self.cost = cost

    def fit(self, X, y):
        self.classes_ = np.unique(y)
        return self

    def predict(self, X):
        return [row[0] for row in X]


def echoed(y, answers, cost=None, **options):
    X = np.array(answers, dtype=object)[:, np.newaxis]
    return evaluate(Echo(cost), X, y, **options)


@cache
def evaluated_copies():
    X, y, runs = near_copies()
    return evaluate(KNeighborsClassifier(1), X, y, runs=runs)


def test_near_copies_give_an_optimistic_random_split_and_chance_by_run():
    found = evaluated_copies()
    assert found.table.loc["random split", "balanced_accuracy"] > 0.99
    by_run = found.table.loc["by run"]
    assert by_run["balanced_accuracy_low"] < 1 / 3 < by_run["balanced_accuracy_high"]
    assert re.search(r"random split is optimistic: .* interval of 'by run'\.", found.caveats[0])


def test_figures_are_those_of_scikit_learn_on_the_decisions():
    found = evaluated_states()
    for scheme, held in found.predictions.groupby("scheme"):
        row = found.table.loc[scheme]
        expected = balanced_accuracy_score(held["truth"], held["decision"])
        assert row["balanced_accuracy"] == pytest.approx(expected)
        assert row["accuracy"] == pytest.approx((held["truth"] == held["decision"]).mean())
        stated = held[[f"P({state})" for state in sorted(STATES)]]
        expected = log_loss(held["truth"], stated, labels=sorted(STATES))
        assert row["log_loss"] == pytest.approx(expected)


def test_decisions_are_those_of_a_clone_fitted_to_the_other_runs():
    X, y, runs = sub_states()
    found = evaluated_states()
    held = found.predictions.query("scheme == 'by run'").set_index("recording")
    expected = np.empty(len(y), object)
    for train, test in LeaveOneGroupOut().split(X, y, runs):
        expected[test] = GaussianNB().fit(X[train], y[train]).predict(X[test])
    assert (held.loc[np.arange(len(y)), "decision"].to_numpy() == expected).all()
    assert held["left_out"].unique().tolist() == [f"run {run}" for run in range(8)]


def test_no_group_is_in_training_and_test_where_there_are_more_groups_than_folds():
    X, y, runs = near_copies(n_runs=23)
    found = evaluate(GaussianNB(), X, y, runs=runs, n_splits=4)
    assert found.table.loc["by run", "folds"] == 4
    held = found.predictions.query("scheme == 'by run'")
    assert (held.groupby("group")["fold"].nunique() == 1).all()
    assert sorted(held["recording"]) == list(range(len(y)))


def test_an_inspection_is_neither_a_false_alarm_nor_a_missed_detection_and_never_correct():
    cost = {("inspect", "ok"): 0.2, ("inspect", "worn"): 0.3}
    found = echoed(
        ["ok"] * 7 + ["worn"] * 3,
        ["ok", "inspect", "worn", "inspect", "ok", "inspect", "ok"] + ["inspect", "ok", "inspect"],
        healthy="ok",
        cost=cost,
        n_splits=2,
    )
    row = found.table.loc["random split"]
    assert row["false_alarm_rate"] == 1 / 7
    assert row["inspection_rate"] == 3 / 7
    assert row["missed_detection_rate"] == 1 / 3
    assert row["accuracy"] == 3 / 10
    assert row["expected_cost"] == pytest.approx((3 * 0.2 + 1 + 2 * 0.3 + 1) / 10)
    assert found.confusions["random split"].to_dict("index") == {
        "ok": {"ok": 3, "worn": 1},
        "worn": {"ok": 1, "worn": 0},
        "inspect": {"ok": 3, "worn": 2},
    }
    for rate in ("false_alarm_rate", "inspection_rate", "missed_detection_rate"):
        assert row[f"{rate}_low"] <= row[rate] <= row[f"{rate}_high"]


def test_every_decision_that_is_correct_for_the_healthy_state_misses_a_fault():
    rows, columns = ["inspect", "cruise", "fly", "ground"], ["worn", "new"]
    cost = pd.DataFrame([[0.3, 0.2], [5, 0], [9, 0], [0, 1]], index=rows, columns=columns)
    y = ["worn"] * 7 + ["new"] * 5
    answers = ["fly", "cruise", "ground", "inspect", "ground", "fly", "ground"]
    answers += ["fly", "cruise", "ground", "inspect", "fly"]
    found = echoed(y, answers, healthy="new", cost=cost, n_splits=2)
    row = found.table.loc["random split"]
    assert found.scoring.cleared == {"fly", "cruise"}
    assert row["missed_detection_rate"] == 3 / 7
    assert row["false_alarm_rate"] == 1 / 5
    assert row["inspection_rate"] == 1 / 5
    assert row["accuracy"] == 6 / 12


def test_families_decided_on_are_scored_by_the_cost():
    X, y, runs = sub_states()
    model = CostSensitiveGaussianBayes(family_cost(), covariance="tied")
    found = evaluate(model, X, y, runs=runs, healthy="normal")
    held = found.predictions.query("scheme == 'by run'")
    family_of = {state: family for family, states in FAMILIES.items() for state in states}
    families = held["truth"].map(family_of)
    assert set(held["decision"]) == set(FAMILIES)
    assert found.table.loc["by run", "balanced_accuracy"] == pytest.approx(
        balanced_accuracy_score(families, held["decision"])
    )
    assert found.table.loc["by run", "labels"] == 3
    assert found.confusions["by run"].shape == (3, 4)
    assert found.confusions["by run"].loc["worn", ["worn1", "worn2"]].sum() > 40
    assert "Scored by families" in found.caveats[-1]


def test_a_label_of_one_unit_gives_a_warning_and_the_split_by_unit_is_not_scored():
    X, y, runs = sub_states()
    units = [f"{s}-{run % 2}" if s != "spalled" else "S" for s, run in zip(y, runs, strict=True)]
    with pytest.warns(UserWarning, match="confounded: 'spalled' only in 'S'") as caught:
        found = evaluate(GaussianNB(), X, y, runs=runs, units=units)
    assert [warning.filename for warning in caught] == [__file__]
    assert found.caveats[0].startswith("Label and unit are confounded")
    assert found.caveats[1].startswith("Each unit has one label")
    assert found.caveats[2] == (
        "'by unit' cannot be scored. In 1 of 7 folds a label is absent from training: without "
        "unit S, training has no 'spalled'."
    )
    assert np.isnan(found.table.loc["by unit", "balanced_accuracy"])
    assert found.table.loc["by unit", ["recordings", "folds", "groups"]].tolist() == [0, 0, 0]
    assert found.table.index.name == "scheme"
    accuracy = next(line for line in str(found).splitlines() if line.startswith("accuracy"))
    assert accuracy.split()[-1] == "-"
    assert "by unit" not in found.confusions
    assert "by unit" not in set(found.predictions["scheme"])


def test_one_condition_is_left_out_at_a_time():
    X, y, runs = sub_states()
    loads = pd.Series(np.tile([-40, 20, 40], len(y) // 3), name="load")
    found = evaluate(GaussianNB(), X, y, runs=runs, conditions=loads, n_splits=2)
    held = found.predictions.query("scheme == 'by load'")
    assert held["left_out"].unique().tolist() == ["load -40", "load 20", "load 40"]
    assert found.table.loc["by load", ["groups", "resampled"]].tolist() == [8, "run"]


class Unsure(GaussianNB):
    """Has no probabilities."""

    def predict_proba(self, X):
        return super().predict_proba(X) * np.nan


def test_probabilities_that_do_not_add_up_to_one_are_refused():
    X, y, runs = sub_states()
    with pytest.raises(ValueError, match=r"random split, fold 0.* rows that add up to 1"):
        evaluate(Unsure(), X, y, runs=runs)


class OnlyKnownLoads(GaussianNB):
    """Refuses a load, its first feature, that it was not trained on."""

    def fit(self, X, y):
        self.loads_ = set(X[:, 0])
        return super().fit(X, y)

    def predict(self, X):
        if not set(X[:, 0]) <= self.loads_:
            raise ValueError(f"no model for the load {X[0, 0]:g}")
        return super().predict(X)


def test_an_estimator_that_refuses_new_loads_is_not_scored_by_load():
    X, y, runs = sub_states()
    loads = np.tile([20.0, 40.0], len(y) // 2)
    found = evaluate(OnlyKnownLoads(), np.column_stack([loads, X]), y, runs=runs, conditions=loads)
    assert found.caveats[0].startswith(
        "'by condition' cannot be scored. The estimator refuses: by condition, fold 0 (condition "
        "20.0 left out): no model for the load 20"
    )
    assert list(found.confusions) == ["random split", "by run"]


def test_labels_are_read_from_the_meta_of_recordings():
    rng = np.random.default_rng(0)
    recordings, y = [], []
    for number in range(16):
        y.append("worn" if number % 2 else "new")
        signal = rng.normal(scale=1 + 2 * (number % 2), size=2000)
        meta = {"run": number // 4, "unit": "AB"[number % 4 // 2], "load": number // 2 % 3}
        recordings.append(Recording({"current": signal}, 500, velocity=30.0, meta=meta))
    model = make_pipeline(OrderResampler(), OrderPSD(4), GaussianNB())
    options = {"runs": "run", "healthy": "new", "n_splits": 4}
    found = evaluate(model, recordings, y, units="unit", conditions="load", **options)
    assert list(found.table.index) == ["random split", "by run", "by unit", "by load"]
    assert (found.table["accuracy"] == 1).all()
    assert any("does not prove certainty" in caveat for caveat in found.caveats)
    lazily = make_pipeline(OrderPSD(4), GaussianNB())
    resampled = OrderResampler().fit_transform(recordings)
    again = evaluate(lazily, resampled, y, **options)
    assert (again.table.loc["by run"] == found.table.loc["by run"]).all()


def test_later_runs_and_splitters_are_held_out_as_given():
    X, y, runs = sub_states()
    late = runs >= 6
    splits = {
        "later runs": (~late, late),
        "numbers": [(np.flatnonzero(~late), np.flatnonzero(late))],
        "splitter": GroupKFold(4),
    }
    found = evaluate(GaussianNB(), X, y, runs=runs, splits=splits, n_splits=2)
    table = found.table
    assert table.loc["later runs", ["recordings", "folds", "groups"]].tolist() == [24, 1, 2]
    assert table.loc["later runs", "accuracy"] == table.loc["numbers", "accuracy"]
    assert table.loc["splitter", ["recordings", "folds"]].tolist() == [96, 4]


def test_without_runs_recordings_are_resampled_and_a_caveat_says_so():
    X, y, _ = sub_states()
    found = evaluate(GaussianNB(), X, y)
    assert found.table.loc["random split", ["groups", "resampled"]].tolist() == [96, "recording"]
    assert found.caveats[0].startswith("Only a random split was made")
    assert "bootstrap over single recordings" in found.caveats[1]


def assert_equal_results(one, other):
    for name in ("table", "predictions", "calibration"):
        pd.testing.assert_frame_equal(getattr(one, name), getattr(other, name))


def test_the_estimator_and_the_data_are_unchanged():
    X, y, runs = sub_states()
    model, before = CostSensitiveGaussianBayes(family_cost()), joblib.hash((X, y, runs))
    evaluate(model, X, y, runs=runs, n_splits=2)
    assert not hasattr(model, "classes_")
    assert model.cost.equals(family_cost())
    assert joblib.hash((X, y, runs)) == before


def test_caveats_are_printed_before_the_figures_of_merit():
    X, y, runs = sub_states(n_runs=3)
    found = evaluate(GaussianNB(), X, y, runs=pd.Series(runs, name="<run>"), healthy="normal")
    text = str(found)
    assert text.startswith("- Confidence intervals from fewer than 10 groups")
    assert text.index("balanced accuracy") > text.index("approximate")
    assert "95 % confidence interval" in text
    assert re.search(r"false alarm rate +0\.\d+ \(", text)
    page = found._repr_html_()
    assert page.index("<li>Confidence") < page.index("<table")
    assert "&lt;run&gt;" in page
    assert "<run>" not in page


def test_an_error_of_the_estimator_names_the_fold():
    X, y, runs = sub_states()
    X[runs == 5] = np.nan
    with pytest.raises(ValueError, match=r"^random split, fold 0: .*NaN"):
        evaluate(GaussianNB(), X, y, runs=runs)


def test_costs_that_have_no_effect_are_refused():
    X, y, _ = sub_states()
    first, second = (CostSensitiveGaussianBayes(k * (1 - np.eye(4))) for k in (1, 2))
    both = VotingClassifier([("first", first), ("second", second)])
    with pytest.raises(ValueError, match="no effect on decisions of VotingClassifier"):
        evaluate(both, X, y)


BAD = {
    "y has 5 entries for 96 recordings": {"y": ["a"] * 5},
    "y must contain a label everywhere, but position 0 has None": {"y": [None] * 96},
    "y must contain classes of one type, text or numbers": {"y": ["a"] * 95 + [3]},
    "y must contain at least two classes, got ['a']": {"y": ["a"] * 96},
    "abel type": {"y": np.linspace(0.5, 9.7, 96)},  # measured values
    "runs must hold one label for each of 96 recordings": {"runs": [1, 2]},
    "recording 95: the label in units is nan": {"units": ["a"] * 95 + [np.nan]},
    "runs names the meta key 'run', but recording 0 is a ndarray without meta": {"runs": "run"},
    "healthy='sound' is neither a class nor a family": {"healthy": "sound"},
    "n_splits must be a whole number of at least 2": {"n_splits": 1},
    "healthy=['normal'] is neither a class nor a family": {"healthy": ["normal"]},
    "splits must map names to splits": {"splits": [1]},
    "splits['s']: Expected": {"splits": {"s": "train"}},
    "splits['s']: cannot unpack": {"splits": {"s": [1]}},
    "splits['s']: fold 0 must have recordings in train": {"splits": {"s": ([1], [])}},
    "splits['s']: fold 0: give positions, or masks": {"splits": {"s": ([96], [1])}},
    "in both: [2]": {"splits": {"s": ([1, 2], [2])}},
    "more than once: ['random split']": {"splits": {"random split": ([1], [2])}},
}


@pytest.mark.parametrize("message", BAD)
def test_an_invalid_argument_is_refused(message):
    X, y, _ = sub_states()
    options = {"y": y, **BAD[message]}
    with pytest.raises((TypeError, ValueError), match=re.escape(message)):
        evaluate(GaussianNB(), X, options.pop("y"), **options)


def test_a_file_in_place_of_recordings_is_refused():
    with pytest.raises(TypeError, match="X must be a list of recordings, got"):
        evaluate(GaussianNB(), "recordings.csv", ["a", "b"])
    with pytest.raises(TypeError, match="a classifier with predict, got StandardScaler"):
        evaluate(StandardScaler(), [[0.0], [1.0]], ["a", "b"])


def test_a_class_of_one_recording_cannot_be_held_out():
    with pytest.raises(ValueError, match="y has one recording of each class"):
        evaluate(GaussianNB(), [[0.0], [1.0]], ["a", "b"])
    found = evaluate(GaussianNB(), [[0.0], [1.0], [2.0]], ["a", "a", "b"], conditions=[1] * 3)
    assert "'random split' cannot be scored" in found.caveats[0]
    assert "'by condition' cannot be scored. It has no fold" in found.caveats[1]


def test_a_classifier_with_an_unknown_state_leaves_out_units_of_the_training_data():
    rng = np.random.default_rng(2)
    units = np.repeat(np.arange(8), 5)
    y = np.where(units % 2, "worn", "healthy")
    X = rng.normal(size=(40, 3)) + np.where(units % 2, 6.0, 0.0)[:, np.newaxis]
    seen = []

    class Recorded(CostSensitiveGaussianBayes):
        def fit(self, X, y, sample_weight=None, groups=None):
            seen.append(set(groups))
            return super().fit(X, y, sample_weight, groups)

    model = make_pipeline(StandardScaler(), Recorded(unknown="unknown", covariance="tied"))
    options = {"healthy": "healthy", "n_splits": 4}
    result = evaluate(model, X, y, units=units, **options)
    assert all(len(groups) in (6, 8) for groups in seen)  # by unit: two of eight held out
    assert result.table.loc["by unit", "false_alarm_rate"] == 0


@pytest.mark.slow
@pytest.mark.parametrize(("given", "expected"), [("both", "unit"), ("runs", "run")])
def test_a_classifier_for_new_units_learns_from_units_and_others_from_runs(given, expected):
    rng = np.random.default_rng(5)
    units = np.repeat([f"unit {k}" for k in range(9)], 6)
    runs = np.array([f"run {k}" for k in np.arange(54) // 3])
    y = np.tile(["worn", "dry", "new"], 18)
    X = rng.normal(size=(54, 2)) + np.searchsorted(["dry", "new", "worn"], y)[:, np.newaxis] * 5
    seen = []

    class OfUnits(NewUnitClassifier):
        def fit(self, X, y, groups=None):
            seen.append(groups[0].split()[0])
            return super().fit(X, y, groups)

    class OfRuns(CostSensitiveGaussianBayes):
        def fit(self, X, y, sample_weight=None, groups=None):
            seen.append(groups[0].split()[0])
            return super().fit(X, y, sample_weight, groups)

    options = {"runs": runs} | ({"units": units} if given == "both" else {})
    both = PosteriorProduct([("a", OfUnits()), ("b", make_pipeline(StandardScaler(), OfUnits()))])
    evaluate(both, X, y, **options, n_splits=2)
    assert set(seen) == {expected}
    seen.clear()
    evaluate(OfRuns(temperature="groups", covariance="tied"), X, y, **options, n_splits=2)
    assert set(seen) == {"run"}


def test_folds_may_be_decided_in_parallel():
    X, y, runs = sub_states()
    with joblib.parallel_config(backend="threading", n_jobs=2):
        assert_equal_results(evaluate(GaussianNB(), X, y, runs=runs), evaluated_states())
