"""Facts about labels: missing and mixed ones are refused, the others keep their types."""

import numpy as np
import pandas as pd
import pytest
from sklearn.naive_bayes import GaussianNB

from emacm import CostSensitiveGaussianBayes, LeastRiskClassifier, PosteriorProduct
from emacm.decisions.truths import label_array, label_list, label_positions

X = np.array([[0.0, 2.0], [1.0, 0.5], [2.0, 1.0], [4.0, 3.0], [6.0, 2.5]])
MISSING = [None, np.nan, pd.NA]
FORMS = {
    "list": list,
    "tuple": tuple,
    "object array": lambda y: np.array([*y, "end"], dtype=object)[:-1],
    "object Series": lambda y: pd.Series(y, dtype=object),
}
FITS = {
    "fit": lambda y: CostSensitiveGaussianBayes().fit(X, y),
    "partial_fit": lambda y: CostSensitiveGaussianBayes().partial_fit(X, y, ["new", "worn"]),
    "wrapped": lambda y: LeastRiskClassifier(GaussianNB()).fit(X, y),
    "product": lambda y: PosteriorProduct([("one", GaussianNB())]).fit(X, y),
}


@pytest.mark.parametrize("fit", FITS)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("missing", MISSING, ids=lambda value: f"{type(value).__name__} {value}")
def test_a_recording_without_a_class_is_named(fit, form, missing):
    labels = FORMS[form](["new", "new", "worn", missing, "worn"])
    with pytest.raises(ValueError, match=r"position 3 has .*Leave such entries out"):
        FITS[fit](labels)


@pytest.mark.parametrize("fit", FITS)
@pytest.mark.parametrize(
    "labels",
    [
        pd.Series(["new", "new", "worn", pd.NA, "worn"], dtype="string"),
        pd.Series(["new", "new", "worn", None, "worn"], dtype="category"),
        pd.Series([0, 0, 1, pd.NA, 1], dtype="Int64"),
        np.array(["2024-01-01", "2024-01-01", "2024-01-02", "NaT", "2024-01-02"], "datetime64[D]"),
        np.array([0.0, 0.0, 1.0, np.nan, 1.0]),
    ],
    ids=["string", "category", "Int64", "datetime64", "float"],
)
def test_a_missing_class_in_a_typed_column_is_named(fit, labels):
    with pytest.raises(ValueError, match=r"position 3 has .*Leave such entries out"):
        FITS[fit](labels)


@pytest.mark.parametrize("fit", FITS)
def test_text_and_numbers_are_not_mixed(fit):
    with pytest.raises(TypeError, match="position 0 has 'new' and position 4 has 7"):
        FITS[fit](["new", "worn", "worn", "worn", 7])


def test_mixed_labels_keep_their_types():
    assert label_list([0, "inspect"]) == [0, "inspect"]
    assert label_list(np.array([2, 1])) == [2, 1]
    assert label_array([0, "inspect"]).dtype == object
    assert label_array(["b", "a"]).dtype.kind == "U"
    assert label_array([2, 1]).dtype.kind == "i"
    assert label_array([2, 1], np.array([1, 2], np.int16)).dtype == np.int16
    assert label_array([True, False]).tolist() == [True, False]
    assert label_array([]).tolist() == label_array([], [1, 2]).tolist() == []
    assert label_array([], np.array([1, 2], np.int16)).dtype == np.int16
    assert label_array(["b", 1], ["b", "a"]).tolist() == ["b", 1]


def test_labels_form_one_dimension():
    with pytest.raises(ValueError, match=r"y must be one-dimensional, got shape \(1, 2\)"):
        label_list([["a", "b"]])


def test_positions_are_those_among_the_known_labels():
    assert label_positions(["worn", "new", "worn"], ["new", "dry", "worn"], "y", "class") == [
        2,
        0,
        2,
    ]
    with pytest.raises(ValueError, match=r"y contains 'wet' at position 1.*Known: \['new'\]"):
        label_positions(["new", "wet"], ["new"], "y", "class")
