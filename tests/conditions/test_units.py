"""Models of one unit, from pipelines, searches and routers."""

import numpy as np
import pandas as pd
import pytest
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from emacm import (
    ConditionRouter,
    CostSensitiveGaussianBayes,
    NewUnitClassifier,
    evaluate,
    for_unit,
    prediction_sets,
)

GROUPS = "newunitclassifier__groups"


def fleet(n_units=40, n_runs=6, seed=0):
    """Return features, states and units; at load 75 everything is three times as large."""
    rng = np.random.default_rng(seed)
    units = np.repeat(np.arange(n_units), n_runs)
    worn = units % 2 == 1
    X = rng.normal(size=(n_units, 2))[units] * [3, 1] + worn[:, np.newaxis] * [4, 1.5]
    frame = pd.DataFrame(X + rng.normal(scale=0.6, size=X.shape), columns=["rms", "kurtosis"])
    frame["load"] = np.tile([30, 75, 75], 2 * n_units)
    frame.loc[frame["load"] == 75, ["rms", "kurtosis"]] *= 3
    return frame, np.where(worn, "worn", "healthy"), units


def test_recordings_of_a_unit_pass_through_the_earlier_steps():
    frame, y, units = fleet()
    X = frame[["rms", "kurtosis"]]
    model = make_pipeline(StandardScaler(), NewUnitClassifier()).fit(X, y, **{GROUPS: units})
    before = model.predict_proba(X)
    known = for_unit(model, X[:4], y[:4])
    scaled = model[0].transform(X)
    direct = model[-1].for_unit(scaled[:4], "healthy")
    np.testing.assert_array_equal(known.predict_proba(X), direct.predict_proba(scaled))
    np.testing.assert_array_equal(model.predict_proba(X), before)
    assert not np.allclose(known.predict_proba(X), before)
    np.testing.assert_array_equal(
        prediction_sets(known, X, 0.8), direct.prediction_sets(scaled, 0.8)
    )
    nested = make_pipeline(StandardScaler(), make_pipeline(NewUnitClassifier()))
    nested.fit(X, y, **{f"pipeline__{GROUPS}": units})
    np.testing.assert_array_equal(
        for_unit(nested, X[:4], "healthy").predict_proba(X), known.predict_proba(X)
    )


def test_costs_set_on_a_model_of_one_unit_take_effect():
    frame, y, units = fleet()
    X = frame[["rms", "kurtosis"]]
    model = make_pipeline(StandardScaler(), NewUnitClassifier()).fit(X, y, **{GROUPS: units})
    known = for_unit(model, X[:4], "healthy")
    known.set_params(newunitclassifier__cost={("healthy", "worn"): 1e9})
    assert (known.predict(X) == "worn").all()
    assert (model.predict(X) == "healthy").any()


@pytest.mark.slow
def test_a_search_gives_its_best_estimator():
    frame, y, units = fleet()
    X = frame[["rms", "kurtosis"]]
    model = make_pipeline(StandardScaler(), NewUnitClassifier())
    search = GridSearchCV(model, {"newunitclassifier__shrinkage": [0.0, 0.9]}, cv=GroupKFold(4))
    search.fit(X, y, groups=units, **{GROUPS: units})
    known = for_unit(search, X[:2], "healthy")
    expected = for_unit(search.best_estimator_, X[:2], "healthy")
    np.testing.assert_array_equal(known.predict_proba(X), expected.predict_proba(X))
    assert prediction_sets(search, X).shape == (240, 2)


@pytest.mark.slow
def test_a_router_gives_each_recording_to_the_model_of_its_condition():
    frame, y, units = fleet()
    router = ConditionRouter(make_pipeline(StandardScaler(), NewUnitClassifier(priors="uniform")))
    router.fit(frame, y, **{GROUPS: units})
    later = fleet(seed=1)[0]
    light = later[later["load"] == 30]
    known = for_unit(router, light[:2], "healthy")
    expected = for_unit(router.estimators_[30], light[:2][["rms", "kurtosis"]], "healthy")
    np.testing.assert_array_equal(
        known.predict_proba(light), expected.predict_proba(light[["rms", "kurtosis"]])
    )
    heavy = later[later["load"] == 75]
    np.testing.assert_array_equal(known.predict_proba(heavy), router.predict_proba(heavy))
    both = for_unit(router, later[:6], ["healthy"] * 6)
    assert {load: model[-1].n_unit_recordings_ for load, model in both.estimators_.items()} == {
        30: 2,
        75: 4,
    }
    both.set_params(estimator__newunitclassifier__cost={("healthy", "worn"): 1e100})
    assert (both.predict(later) == "worn").all()
    with pytest.raises(ValueError, match=r"condition 40, but the conditions .* \[30, 75\]"):
        for_unit(router, later[:2].assign(load=40), "healthy")
    with pytest.raises(ValueError, match="y has 3 classes for 2 recordings"):
        for_unit(router, later[:2], ["healthy"] * 3)
    with pytest.raises(TypeError, match=r"of a ConditionRouter, use the models in its estimators_"):
        prediction_sets(router, later)


@pytest.mark.slow
def test_evaluate_passes_the_units_as_groups():
    frame, y, units = fleet(20)
    model = make_pipeline(StandardScaler(), NewUnitClassifier())
    result = evaluate(model, frame[["rms", "kurtosis"]], y, units=units, healthy="healthy")
    assert 0.6 < result.table.loc["by unit", "balanced_accuracy"] < 1


def test_other_classifiers_know_no_units():
    frame, y, _ = fleet()
    X = frame[["rms", "kurtosis"]]
    model = make_pipeline(StandardScaler(), CostSensitiveGaussianBayes()).fit(X, y)
    with pytest.raises(TypeError, match="CostSensitiveGaussianBayes, which has no unit effects"):
        for_unit(model, X[:2], "healthy")
    with pytest.raises(TypeError, match="last step, got CostSensitiveGaussianBayes"):
        prediction_sets(model, X)
