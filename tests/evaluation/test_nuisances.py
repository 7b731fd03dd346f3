"""Properties that should not matter, such as the day, are checked for what they tell of labels."""

import os
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.naive_bayes import GaussianNB
from sklearn.pipeline import make_pipeline

from emacm import OrderPSD, OrderResampler, Recording
from emacm.evaluation import evaluate as evaluation
from emacm.evaluation.bootstrap import cell_mean, draw_interval, drawn_groups, group_intervals
from emacm.evaluation.caveats import (
    Nuisance,
    nuisance_caveats,
    nuisance_table,
    predict_by_level,
    read_nuisances,
)
from emacm.evaluation.held_out import Fold, Scheme
from emacm.recordings.meta import Grouping

DATA = Path(os.environ.get("EMACM_DATA", Path(__file__).parents[3] / "shared" / "data"))


def evaluate(model, X, y, *, nuisances, **options):
    """Evaluate, and score the nuisances."""
    result = evaluation.evaluate(model, X, y, **options)
    table = result.by_nuisance(X, nuisances)
    caveats = [*table.attrs["caveats"], *result.caveats]
    return SimpleNamespace(nuisances=table, caveats=caveats, table=result.table)


def fleet(days, n_each=3, seed=0):
    """Return units, healthy and faulty by turns, whose first feature is the offset of the day."""
    rng = np.random.default_rng(seed)
    units = np.repeat(np.arange(len(days)), n_each)
    y = np.where(units % 2, "faulty", "healthy")
    day = np.repeat(days, n_each)
    X = rng.normal(size=(len(y), 2)) * 0.1
    X[:, 0] += 5 * (day == "tuesday")
    return pd.DataFrame(X, columns=["offset", "level"]), y, units, day


def test_a_day_for_each_label_predicts_it_and_leaves_no_score_within_one_day():
    X, y, units, day = fleet(["monday", "tuesday"] * 7)
    found = evaluate(GaussianNB(), X, y, units=units, healthy="healthy", nuisances={"day": day})
    assert found.table.loc["by unit", "balanced_accuracy"] == 1  # of the day, not of the health
    row = found.nuisances.set_index("scheme").loc["by unit"]
    assert (row["nuisance"], row["levels"]) == ("day", 2)
    assert (row["alone"], row["alone_low"], row["chance"]) == (1, 1, 0.5)
    assert np.isnan([row["within"], row["within_low"], row["within_chance"]]).all()
    assert row["recordings"] == 0
    assert found.caveats[0] == (
        "'day' alone predicts the label with a balanced accuracy of 1.00 (1.00 to 1.00) in "
        "'by unit', where chance is 0.50. No level of 'day' has two labels, so the score within "
        "one level cannot be computed: what distinguishes the labels may be 'day' instead of the "
        "state of health."
    )
    assert "within one level" in str(found)


def test_a_classifier_of_the_day_has_a_score_of_chance_within_one_day():
    # Six of seven healthy units on Monday, six of seven faulty ones on Tuesday.
    days = ["monday", "tuesday"] * 6 + ["tuesday", "monday"]
    X, y, units, day = fleet(days)
    found = evaluate(GaussianNB(), X[["offset"]], y, units=units, nuisances={"day": day})
    row = found.nuisances.set_index("scheme").loc["by unit"]
    assert row["balanced_accuracy"] == pytest.approx(6 / 7)
    assert row["alone"] == pytest.approx(6 / 7)
    assert row["within"] == pytest.approx(0.5)
    assert row["within_chance"] == 0.5
    assert row["recordings"] == 42
    assert "Within one level, the balanced accuracy of the classifier is 0.50" in found.caveats[0]


def test_a_classifier_of_the_health_keeps_its_score_within_one_day():
    days = ["monday", "tuesday"] * 6 + ["tuesday", "monday"]
    X, y, units, day = fleet(days)
    X = X.assign(level=X["level"] + (y == "faulty"))
    found = evaluate(GaussianNB(), X[["level"]], y, units=units, nuisances={"day": day})
    row = found.nuisances.set_index("scheme").loc["by unit"]
    assert row["within"] == row["balanced_accuracy"] == 1


def test_a_day_that_is_independent_of_the_label_predicts_it_by_chance():
    days = np.tile(["monday", "monday", "tuesday", "tuesday"], 5)
    X, y, units, day = fleet(days)
    found = evaluate(GaussianNB(), X, y, units=units, nuisances={"day": day}, n_splits=20)
    row = found.nuisances.iloc[-1]
    assert row["alone"] <= 0.5
    assert not [text for text in found.caveats if "'day' alone" in text]


class Says(ClassifierMixin, BaseEstimator):
    """Decides what its feature says."""

    def fit(self, X, y):
        self.classes_ = np.unique(y)
        return self

    def predict(self, X):
        return np.array([row[0] for row in X], dtype=object)


def test_the_score_within_levels_is_the_mean_over_pairs_of_level_and_label():
    table = pd.DataFrame(
        [
            ("new", "new", "A"),
            ("new", "worn", "A"),
            ("new", "new", "A"),
            ("worn", "worn", "A"),
            ("dry", "new", "A"),
            ("worn", "new", "B"),
            ("worn", "worn", "B"),
            ("dry", "dry", "B"),
            ("dry", "dry", "C"),  # the only label of its level
            ("dry", "new", "C"),
        ],
        columns=["truth", "decision", "bench"],
    )
    X = table[["decision"]].to_numpy(object)
    nuisances = {"bench": table["bench"]}
    found = evaluate(Says(), X, table["truth"], nuisances=nuisances, n_splits=2)
    row = found.nuisances.iloc[0]
    # A: new 2/3, worn 1, dry 0; B: worn 1/2, dry 1
    assert row["within"] == pytest.approx((2 / 3 + 1 + 0 + 1 / 2 + 1) / 5)
    assert row["within_chance"] == pytest.approx(2 / 5)  # 1/3, 1/3, 1/3, 1/2, 1/2
    assert row["recordings"] == 8
    assert row["levels"] == 3


def test_the_prediction_is_the_label_most_frequent_relative_to_its_total():
    levels = np.array([0, 0, 0, 1, 1, 0, 1, 2, 0])
    labels = np.array([0, 0, 1, 0, 0, 1, 1, 1, 0])
    fold = Fold(np.arange(6), np.array([6, 7, 8]))
    # Training: label 0 has 2 of 4 in level 0 and 2 of 4 in level 1, label 1 has 2 of 2 in level 0.
    scheme = Scheme("s", [fold], Grouping("recording", np.arange(9)))
    correct, rows = predict_by_level(levels, labels, scheme)
    assert rows.tolist() == [6, 7, 8]
    # Level 1 predicts 0 (true: 1); level 2 is new, either; level 0 predicts 1 (true: 0).
    assert correct.tolist() == [0, 0.5, 0]


def recordings(rates, **meta):
    return [
        Recording({"current": np.zeros(100)}, rate, velocity=np.full(100, 9.0), meta=facts)
        for rate, facts in zip(rates, pd.DataFrame(meta).to_dict("records"), strict=True)
    ]


def test_the_sampling_rate_is_read_from_the_recordings():
    made = recordings([1000, 1000, 2000], day=["mo", "tu", "mo"])
    day, rate = read_nuisances(("day", "fs"), made)
    assert (day.name, day.levels.tolist()) == ("day", [0, 1, 0])
    assert (rate.name, rate.levels.tolist()) == ("fs", [0, 0, 1])
    stated = recordings([1000, 1000, 2000], fs=["a", "b", "b"])
    assert read_nuisances(["fs"], stated)[0].levels.tolist() == [0, 1, 1]


def test_a_different_sampling_rate_of_one_channel_is_another_level():
    signals = {"current": np.zeros(100), "vibration": np.zeros(200)}
    two = Recording(signals, {"current": 50, "vibration": 100}, velocity=np.ones(100), shaft_fs=50)
    same = Recording({"current": np.zeros(100)}, 50, velocity=np.ones(100))
    assert read_nuisances(("fs",), [two, same, two])[0].levels.tolist() == [0, 1, 0]
    # Equal rates are one level, whatever the channels and their order.
    turned = Recording(
        dict(reversed(signals.items())), {"vibration": 100, "current": 50}, velocity=np.ones(100),
        shaft_fs=50,
    )  # fmt: skip
    other = Recording({"torque": np.zeros(100)}, 50, velocity=np.ones(100))
    levels = read_nuisances(("fs",), [two, same, turned, other])[0].levels
    assert levels.tolist() == [0, 1, 0, 1]


def test_other_objects_may_have_one_sampling_rate():
    class Signal:
        def __init__(self, fs):
            self.fs = fs

    (found,) = read_nuisances(("fs",), [Signal(50.0), Signal(25.0), Signal(50.0)])
    assert found.levels.tolist() == [0, 1, 0]
    with pytest.raises(ValueError, match=r"recording 1: the value of nuisances\(\) is None"):
        read_nuisances(("fs",), [Signal(50.0), Signal(None)])


def test_many_numbers_are_divided_into_ten_levels_of_equally_many_recordings():
    temperature = np.random.default_rng(0).permutation(np.linspace(15.3, 41.9, 60))
    (found,) = read_nuisances({"temperature": temperature}, [0] * 60)
    assert np.bincount(found.levels).tolist() == [6] * 10
    order = np.argsort(temperature)
    assert (np.diff(found.levels[order]) >= 0).all()
    (few,) = read_nuisances({"load": [-40, 20, 40] * 20}, [0] * 60)
    assert len(set(few.levels)) == 3


def test_columns_of_a_table_tuples_and_functions_name_nuisances():
    table = pd.DataFrame({"day": ["mo", "tu", "mo"], "bench": [2, 2, 1]})
    found = read_nuisances([("day", "bench"), "bench"], table)
    assert [each.name for each in found] == ["day, bench", "bench"]
    assert found[0].levels.tolist() == [0, 1, 2]

    def shift(recording):
        return recording.meta["hour"] // 8

    made = recordings([50] * 4, hour=[9, 23, 17, 10])
    (by_function,) = read_nuisances([shift], made)
    assert (by_function.name, by_function.levels.tolist()) == ("shift", [0, 1, 1, 0])


@pytest.mark.parametrize(
    ("nuisances", "words"),
    [
        ("day", "nuisances must be a tuple of keys of meta, as ('day', 'fs')"),
        (3, "or a mapping of names to keys or arrays; got 3"),
        (("day", "day"), "nuisances must name each property once"),
        (([1, 2],), "Give arrays with their names, as {'day': [1, 2]}"),
        (("week",), "recording 0 has no column 'week', only ['day']"),
        ({"day": [1, 2, 3]}, "nuisances must hold one label for each of 2 recordings"),
    ],
)
def test_invalid_nuisances_are_refused(nuisances, words):
    table = pd.DataFrame({"day": ["mo", "tu"]})
    with pytest.raises((TypeError, ValueError), match=re.escape(words)):
        read_nuisances(nuisances, table)


def test_the_sampling_rate_of_the_mfpt_rig_predicts_two_of_its_three_states():
    file = DATA / "bearings" / "mfpt_train.npz"
    if not file.exists():
        pytest.skip("no recordings of bearings; set EMACM_DATA to their folder")
    with np.load(file) as stored:
        names = sorted({key.partition("/")[0] for key in stored.files})
        made = [
            Recording(
                {"vibration": stored[f"{name}/gs"][:30_000]},
                float(stored[f"{name}/fs"]),
                velocity=2 * np.pi * float(stored[f"{name}/rate"]),
            )
            for name in names
        ]
    states = [name.partition("_")[0] for name in names]
    model = make_pipeline(OrderResampler(2 * np.pi / 64), OrderPSD(4, max_order=20), GaussianNB())
    names = pd.Series(names, name="file")
    found = evaluate(model, made, states, runs=names, healthy="baseline", nuisances=("fs",))
    row = found.nuisances.iloc[-1]
    # 97,656 Hz: both healthy and two of seven outer races; 48,828 Hz: five of these, all inner.
    assert row["alone"] == pytest.approx((1 + 0 + 1) / 3)
    assert row["within_chance"] == 0.5
    assert found.caveats[0].startswith("'fs' alone predicts the label with a balanced accuracy of")


def test_caveats_are_in_the_order_of_the_nuisances_those_without_a_score_first():
    row = {"alone": 0.9, "alone_low": 0.8, "alone_high": 1.0, "chance": 0.5, "held_out": "by run"}
    row |= {"scheme": "by run", "within": 0.7, "within_low": np.nan, "within_chance": 0.25}
    recordings = {"tool": 0, "load": 12, "day": 0, "bench": 9}
    table = pd.DataFrame(
        [row | {"nuisance": name, "recordings": n} for name, n in recordings.items()]
    )
    caveats = nuisance_caveats(table, 40)
    assert [text.split("'")[1] for text in caveats] == ["tool", "day", "load", "bench"]
    assert "is 0.70 (chance 0.25) in 'by run', from at most 12 of 40 recordings" in caveats[2]


BOOTSTRAP = {"confidence": 0.9, "n_resamples": 400, "random_state": 1}


def judged_runs():
    """Return levels, labels and decisions: each of eight runs is a level and has two labels."""
    rng = np.random.default_rng(6)
    runs = np.repeat(np.arange(8), 5)
    labels = np.where(np.arange(40) % 5 < 1, "worn", "new")  # one worn recording in each run
    held = pd.DataFrame({"scheme": "by run", "recording": rng.permutation(40)})
    held["correct"] = rng.random(40) < 0.6 + 0.04 * runs[held["recording"]]
    return runs, labels, held.assign(group=runs[held["recording"]])


def test_draws_that_miss_levels_give_the_mean_of_the_present_ones():
    runs, labels, held = judged_runs()
    predictions = pd.concat([held.assign(scheme="random split"), held])
    table = nuisance_table([Nuisance("run", runs)], None, labels, predictions, BOOTSTRAP)
    right = held.assign(label=labels[held["recording"]]).groupby(["group", "label"])["correct"]
    by_run = right.mean().groupby("group").mean().to_numpy()
    (times,) = drawn_groups(8, 400, 1)
    drawn = (times > 0) @ by_run / (times > 0).sum(axis=1)
    assert table["scheme"].tolist() == ["random split", "by run"]
    for _, row in table.iterrows():
        assert row["within"] == pytest.approx(by_run.mean())
        limits = draw_interval(drawn, by_run.mean(), 8, confidence=0.9)
        assert (row["within_low"], row["within_high"]) == pytest.approx(limits)
        assert (row["within_chance"], row["recordings"], row["levels"]) == (0.5, 40, 8)
        codes = (labels == "new").astype(int)[held["recording"]]
        assert row["balanced_accuracy"] == pytest.approx(cell_mean(held["correct"], codes))
        assert np.isnan([row["alone"], row["alone_low"], row["alone_high"]]).all()
        assert (row["chance"], row["held_out"]) == (0.5, "")


def test_draws_without_any_level_of_two_labels_are_unknown():
    runs, labels, held = judged_runs()
    held["correct"] = True
    labels = np.where(runs < 2, labels, "new")  # two of eight runs have two labels
    row = nuisance_table([Nuisance("run", runs)], None, labels, held, BOOTSTRAP).iloc[0]
    assert (row["recordings"], row["within"]) == (10, 1)
    assert (row["within_low"], row["within_high"]) == (1, 1)


def test_the_score_of_a_nuisance_alone_has_the_interval_of_its_groups():
    runs, labels, held = judged_runs()
    units = Grouping("unit", runs // 2)
    tests = [np.flatnonzero(units.labels == unit) for unit in range(4)]
    folds = [Fold(np.setdiff1d(np.arange(40), test), test) for test in tests[::-1]]
    scheme = Scheme("by unit", folds, units)
    levels = (np.arange(40) % 5 < 1) ^ (np.arange(40) % 11 == 0)
    table = nuisance_table([Nuisance("x", levels * 1)], scheme, labels, held, BOOTSTRAP)
    correct = np.arange(40) % 11 != 0
    ((low, high),) = group_intervals([correct], [labels == "worn"], units.labels, **BOOTSTRAP)
    row = table.iloc[0]
    assert row["alone"] == pytest.approx(cell_mean(correct, labels == "worn"))
    assert (row["alone_low"], row["alone_high"]) == (low, high)
    assert (row["held_out"], row["levels"]) == ("by unit", 2)


def test_labels_that_no_training_recording_has_are_not_predicted_and_ties_are_shared():
    levels, labels = np.array([0, 0, 1, 1, 0, 0, 2]), np.array([0, 1, 0, 1, 2, 0, 1])
    scheme = Scheme("s", [Fold(np.arange(4), np.array([4, 5, 6]))], Grouping("r", levels))
    assert predict_by_level(levels, labels, scheme)[0].tolist() == [0, 0.5, 0.5]
    alone = Scheme("s", [Fold(np.array([1, 2]), np.array([0, 3]))], Grouping("r", levels))
    # One training recording of label 1 (level 0) and one of label 0 (level 1); both tests differ.
    assert predict_by_level(levels, labels, alone)[0].tolist() == [0, 0]
    turned = Scheme("s", [Fold(np.array([0, 3]), np.array([1, 2, 4]))], Grouping("r", levels))
    assert predict_by_level(levels, labels, turned)[0].tolist() == [0, 0, 0]


@pytest.mark.parametrize("n_levels", [1, 2])
def test_draws_with_one_label_only_have_its_fraction(n_levels):
    # Each of six runs has one label, so that some draws have one label or one level only.
    runs = np.repeat(np.arange(6), 4)
    labels = np.where(runs < 3, "worn", "new")
    right = np.array([0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 0, 1, 1, 1, 1, 1, 1])
    levels = np.arange(24) % n_levels
    held = pd.DataFrame({"recording": np.arange(24), "correct": right.astype(bool), "group": runs})
    nuisance = Nuisance("day", levels)
    held["scheme"] = "by run"
    row = nuisance_table([nuisance], None, labels, held, BOOTSTRAP).iloc[0]
    (times,) = drawn_groups(6, 400, 1)
    drawn = []
    for weight in times[:, runs]:
        cells = [weight * (levels == k) * (labels == name) for k in range(n_levels)
                 for name in ("worn", "new")]  # fmt: skip
        drawn.append(np.mean([cell @ right / cell.sum() for cell in cells if cell.sum()]))
    assert min(drawn) < 0.2  # "worn" only
    assert max(drawn) > 0.85  # "new" only
    expected = np.mean([right[(levels == k) & (labels == name)].mean()
                        for k in range(n_levels) for name in ("worn", "new")])  # fmt: skip
    assert row["within"] == pytest.approx(expected)
    limits = draw_interval(np.array(drawn), expected, 6, confidence=0.9)
    assert (row["within_low"], row["within_high"]) == pytest.approx(limits)


def test_without_decisions_or_nuisances_there_are_no_rows():
    runs, labels, held = judged_runs()
    assert nuisance_table([Nuisance("run", runs)], None, labels, pd.DataFrame(), BOOTSTRAP).empty
    assert nuisance_table([], None, labels, held, BOOTSTRAP).empty


def test_numbers_and_dates_of_more_than_ten_values_are_divided_and_others_never():
    days = pd.date_range("2024-01-01", periods=22).to_list()
    given = {
        "eleven": [*range(11)] * 2,
        "ten": [*range(10), *range(10), 0, 1],
        "days": days,
        "names": [str(k) for k in range(22)],
        "flags": [True, False] * 11,
        "skewed": [0] * 19 + [1, 2, 3],
    }
    found = {each.name: each.levels for each in read_nuisances(given, [0] * 22)}
    assert {name: len(set(levels)) for name, levels in found.items()} == {
        "eleven": 10, "ten": 10, "days": 10, "names": 22, "flags": 2, "skewed": 4,
    }  # fmt: skip
    assert found["eleven"].tolist() == [0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9] * 2
    assert {levels.dtype for levels in found.values()} == {np.dtype(np.intp)}


@pytest.mark.parametrize(
    ("changes", "stated"),
    [
        ({"alone_low": 0.5}, None),
        ({"alone_low": 0.51}, "0.70 (0.51 to 0.90) in 'by unit', where chance is 0.50. Within"),
        ({"alone_low": np.nan, "alone": 0.5}, None),
        ({"alone_low": np.nan}, "accuracy of 0.70 in 'by unit', where chance is 0.50. Within"),
        ({"alone_low": 0.1, "recordings": 0}, "0.70 (0.10 to 0.90) in 'by unit', where chance"),
    ],
)
def test_a_nuisance_that_may_predict_by_chance_only_has_no_caveat(changes, stated):
    row = {"nuisance": "day", "scheme": "by unit", "alone": 0.7, "alone_low": 0.6}
    row |= {"alone_high": 0.9, "chance": 0.5, "held_out": "by unit", "within": 0.8}
    row |= {"within_low": 0.75, "within_high": 0.85, "within_chance": 0.5, "recordings": 9}
    caveats = nuisance_caveats(pd.DataFrame([row | changes]), 40)
    if stated is None:
        assert caveats == []
    else:
        assert stated in caveats[0]
    both = pd.DataFrame([row | {"scheme": "random split", "recordings": 0}, row])
    (text,) = nuisance_caveats(both, 40)
    ending = "is not known in 'random split', 0.80 (0.75 to 0.85; chance 0.50) in 'by unit', "
    assert text.endswith(ending + "from at most 9 of 40 recordings.")
    assert nuisance_caveats(pd.DataFrame(), 40) == []
