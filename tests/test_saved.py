"""A model that another version of the package has saved warns when it is loaded."""

import inspect
import pickle

import joblib
import numpy as np
import pytest
from sklearn.base import BaseEstimator
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

import emacm
from emacm import CostSensitiveGaussianBayes
from emacm._saved import SavedEstimator

ESTIMATORS = [
    value
    for value in (getattr(emacm, name) for name in emacm.__all__)
    if inspect.isclass(value) and issubclass(value, BaseEstimator)
]


@pytest.fixture
def model():
    X = np.array([[0.0, 1.0], [1.0, 0.5], [5.0, 2.0], [6.0, 4.0]])
    pipe = make_pipeline(StandardScaler(), CostSensitiveGaussianBayes(covariance="diag"))
    return pipe.fit(X, ["new", "new", "worn", "worn"])


def test_there_are_estimators_and_all_remember_their_version():
    assert len(ESTIMATORS) >= 12
    assert all(issubclass(estimator, SavedEstimator) for estimator in ESTIMATORS)


@pytest.mark.parametrize("module", [pickle, joblib], ids=["pickle", "joblib"])
def test_a_model_of_another_version_warns(model, module, tmp_path, monkeypatch):
    with open(tmp_path / "model", "wb") as file:
        module.dump(model, file)
    monkeypatch.setattr("emacm._saved.__version__", "99.1")
    message = rf"CostSensitiveGaussianBayes was saved by emacm {emacm.__version__} .* by emacm 99.1"
    with open(tmp_path / "model", "rb") as file, pytest.warns(UserWarning, match=message):
        loaded = module.load(file)
    assert loaded.predict([[5.0, 3.0]]).tolist() == ["worn"]


def test_a_model_of_an_unknown_version_warns(model):
    state = model[-1].__getstate__()
    del state["_emacm_version"]
    loaded = CostSensitiveGaussianBayes.__new__(CostSensitiveGaussianBayes)
    with pytest.warns(UserWarning, match="saved by emacm an unknown version"):
        loaded.__setstate__(state)
