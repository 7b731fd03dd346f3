"""Facts about the reader of meta: every form is read alike, and what is missing is located."""

import re

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LogisticRegression

from emacm import ConditionRouter, Recording
from emacm.recordings.meta import plain_label, read_grouping, read_meta


def runs(*metas):
    return [Recording({"torque": [0.0, 1.0]}, 1, velocity=[1.0, 1.0], meta=meta) for meta in metas]


FLEET = runs(
    {"unit": "B", "load": 40}, {"unit": "A", "load": 100}, {"unit": "B", "load": np.int64(20)}
)
FRAME = pd.DataFrame({"unit": ["B", "A", "B"], "load": [40, 100, 20], "level": [1.5, 2.5, 3.5]})


@pytest.mark.parametrize("X", [FLEET, FRAME])
def test_a_key_a_tuple_and_a_function_read_the_same_values(X):
    def both(entry):
        facts = entry if isinstance(entry, pd.Series) else entry.meta
        return facts["unit"], facts["load"]

    assert read_meta(X, "load") == [40, 100, 20]
    pairs = [("B", 40), ("A", 100), ("B", 20)]
    assert read_meta(X, ("unit", "load")) == read_meta(X, both) == pairs
    assert [type(load) for load in read_meta(X, "load")] == [int] * 3


@pytest.mark.parametrize("form", [list, np.array, pd.Series, pd.Index])
def test_an_array_is_read_as_it_is(form):
    assert read_meta(FLEET, form([7, 3, 5]), arrays=True) == [7, 3, 5]
    assert read_grouping(form([7, 3, 5]), FLEET, "runs", "run").labels.tolist() == [7, 3, 5]


def test_labels_are_named_by_their_key_or_series():
    assert read_grouping("load", FLEET, "runs", "run").name == "load"
    assert read_grouping(("unit", "load"), FLEET, "runs", "run").name == "unit, load"
    assert read_grouping(pd.Series([1, 2, 3], name="day"), FLEET, "runs", "run").name == "day"
    for unnamed in ([1, 2, 3], pd.Series([1, 2, 3]), pd.Series([1, 2, 3], name=4)):
        assert read_grouping(unnamed, FLEET, "runs", "run").name == "run"
    assert read_grouping(lambda run: run.meta["load"], FLEET, "runs", "run").name == "run"
    assert read_grouping(None, FLEET, "runs", "run") is None


def test_dates_are_labels():
    days = pd.to_datetime(["2024-05-02", "2024-05-01", "2024-05-02"])
    frame = pd.DataFrame({"day": days})
    assert read_meta(frame, "day") == list(days)
    for values in (days, days.to_numpy(), "day"):
        labels = read_grouping(values, frame, "runs", "run").labels
        assert np.unique(labels, return_inverse=True)[1].tolist() == [1, 0, 1]


REFUSED = {
    "its meta key 'load' is nan": runs({"load": float("nan")}),
    "its meta key 'load' is NaT": runs({"load": pd.NaT}),
    "its meta key 'load' is inf": runs({"load": np.inf}),
    "its meta key 'load' is [1], which cannot be hashed": runs({"load": [1]}),
    "recording 0 (unit='A') has no meta key 'load'; it has 'unit'": runs({"unit": "A"}),
    "condition names the meta key 'load', but recording 0 is a int without meta": [3],
}


@pytest.mark.parametrize("message", REFUSED)
def test_a_value_that_is_missing_is_located(message):
    with pytest.raises((TypeError, ValueError), match=re.escape(message)):
        read_meta(REFUSED[message], "load")


def test_the_recording_without_a_value_is_numbered():
    X = runs({"load": 1}, {"unit": "A", "load": None})
    with pytest.raises(ValueError, match=r"recording 1 \(unit='A', load=None\).*'load' is None"):
        read_meta(X, "load")


def test_a_function_that_fails_names_the_recording():
    with pytest.raises(ValueError, match=r"recording 0 \(unit='B'.*units failed with KeyError"):
        read_grouping(lambda run: run.meta["l"], FLEET, "units", "unit")


@pytest.mark.parametrize("keys", [{"unit"}, iter("ab"), ([],), {"a": 1}])
def test_what_selects_nothing_is_refused(keys):
    with pytest.raises(TypeError, match="units must be a key of meta such as 'load'"):
        read_grouping(keys, FLEET, "units", "unit")


@pytest.mark.parametrize("values", [[1, 2], [[1, 2, 3]], np.zeros((3, 1))])
def test_an_array_of_another_length_is_refused(values):
    with pytest.raises(ValueError, match=r"runs must hold one label for each of 3 recordings.*got"):
        read_grouping(values, FLEET, "runs", "run")


@pytest.mark.parametrize("values", [["a", 1, 2], [1, set, 3]])
def test_labels_of_several_kinds_are_refused(values):
    with pytest.raises(TypeError, match="runs must hold labels of one kind, got "):
        read_grouping(values, FLEET, "runs", "run")


def test_an_array_is_not_split_with_the_recordings():
    """In a cross-validation, an array of the same length as a fold would be read silently."""
    router = ConditionRouter(LogisticRegression(), condition=[20, 20, 40, 40])
    with pytest.raises(TypeError, match=r"condition must be a key of meta.*put its values into"):
        router.fit(np.zeros((4, 1)), ["a", "b"] * 2)


def test_labels_are_python_objects():
    labels = [np.int64(3), np.float32(0.5), np.str_("a"), np.timedelta64(2, "s"), "b", None]
    found = [plain_label(label) for label in labels]
    assert found == [3, 0.5, "a", pd.Timedelta("2s"), "b", None]
    assert [type(label) for label in found[:4]] == [int, float, str, pd.Timedelta]
