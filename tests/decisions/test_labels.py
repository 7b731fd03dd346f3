"""Facts about labels: missing and mixed ones are refused, the others keep their types."""

import numpy as np
import pandas as pd
import pytest
from sklearn.naive_bayes import GaussianNB

from emacm import CostSensitiveGaussianBayes, LeastRiskClassifier, PosteriorProduct
from emacm.decisions.costs import label_list

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
def test_text_and_numbers_are_not_mixed(fit):
    with pytest.raises(TypeError, match="position 0 has 'new' and position 4 has 7"):
        FITS[fit](["new", "worn", "worn", "worn", 7])


def test_labels_form_one_dimension():
    with pytest.raises(ValueError, match=r"y must be one-dimensional, got shape \(1, 2\)"):
        label_list([["a", "b"]])
