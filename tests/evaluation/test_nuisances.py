"""Properties that should not matter, such as the day, are checked for what they tell of labels."""

import re

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.naive_bayes import GaussianNB

from emacm import Recording, evaluate
from emacm.evaluation.held_out import Fold, Scheme
from emacm.evaluation.nuisances import predict_by_level, read_nuisances
from emacm.recordings.meta import Grouping


def fleet(days, n_each=3, seed=0):
    """Return units, healthy and faulty by turns, whose first feature is the offset of the day."""
    rng = np.random.default_rng(seed)
    units = np.repeat(np.arange(len(days)), n_each)
    y = np.where(units % 2, "faulty", "healthy")
    day = np.repeat(days, n_each)
    X = rng.normal(size=(len(y), 2)) * 0.1
    X[:, 0] += 5 * (day == "tuesday")
    return pd.DataFrame(X, columns=["offset", "level"]), y, units, day


def by_unit(model, X, y, units, day):
    table = evaluate(model, X, y, units=units).by_nuisance(X, {"day": day})
    return table.set_index("scheme").loc["by unit"]


def test_a_day_for_each_label_predicts_it_and_leaves_no_score_within_one_day():
    X, y, units, day = fleet(["monday", "tuesday"] * 7)
    row = by_unit(GaussianNB(), X, y, units, day)
    assert row["balanced_accuracy"] == 1  # of the day, not of the health
    assert (row["nuisance"], row["levels"], row["held_out"]) == ("day", 2, "by unit")
    assert (row["alone"], row["alone_low"], row["chance"]) == (1, 1, 0.5)
    assert np.isnan([row["within"], row["within_low"], row["within_chance"]]).all()
    assert row["recordings"] == 0


# Six of seven healthy units on Monday, six of seven faulty ones on Tuesday.
MIXED_DAYS = ["monday", "tuesday"] * 6 + ["tuesday", "monday"]


def test_a_classifier_of_the_day_has_a_score_of_chance_within_one_day():
    X, y, units, day = fleet(MIXED_DAYS)
    row = by_unit(GaussianNB(), X[["offset"]], y, units, day)
    assert row["balanced_accuracy"] == row["alone"] == pytest.approx(6 / 7)
    assert row["alone_low"] < 6 / 7 <= row["alone_high"]
    assert row["within"] == pytest.approx(0.5)
    assert (row["within_chance"], row["recordings"]) == (0.5, 42)


def test_a_classifier_of_the_health_keeps_its_score_within_one_day():
    X, y, units, day = fleet(MIXED_DAYS)
    X = X.assign(level=X["level"] + (y == "faulty"))
    row = by_unit(GaussianNB(), X[["level"]], y, units, day)
    assert row["within"] == row["balanced_accuracy"] == 1


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
    found = evaluate(Says(), X, table["truth"], n_splits=2)
    row = found.by_nuisance(X, {"bench": table["bench"]}).iloc[0]
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


def test_columns_of_a_table_tuples_and_functions_name_nuisances():
    table = pd.DataFrame({"day": ["mo", "tu", "mo"], "bench": [2, 2, 1]})
    found = read_nuisances([("day", "bench"), "bench"], table)
    assert {name: levels.tolist() for name, levels in found.items()} == {
        "day, bench": [0, 1, 2],
        "bench": [0, 0, 1],
    }

    def shift(recording):
        return recording.meta["hour"] // 8

    made = [
        Recording({"current": np.zeros(9)}, 50, velocity=9.0, meta={"hour": hour})
        for hour in (9, 23, 17, 10)
    ]
    assert read_nuisances([shift], made)["shift"].tolist() == [0, 1, 1, 0]


@pytest.mark.parametrize(
    ("nuisances", "words"),
    [
        ("day", "nuisances must be a tuple of keys of meta, as ('day', 'bench')"),
        (("week",), "recording 0 has no column 'week', only ['day']"),
        ({"day": [1, 2, 3]}, "nuisances must hold one label for each of 2 recordings"),
    ],
)
def test_invalid_nuisances_are_refused(nuisances, words):
    table = pd.DataFrame({"day": ["mo", "tu"]})
    with pytest.raises((TypeError, ValueError), match=re.escape(words)):
        read_nuisances(nuisances, table)


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
    found = read_nuisances(given, [0] * 22)
    assert {name: len(set(levels)) for name, levels in found.items()} == {
        "eleven": 10, "ten": 10, "days": 10, "names": 22, "flags": 2, "skewed": 4,
    }  # fmt: skip
    assert found["eleven"].tolist() == [0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9] * 2
