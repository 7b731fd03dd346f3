"""Facts about routing: each condition has its own estimator, and rows keep their places."""

import numpy as np
import pandas as pd
import pytest
from order_models import log, order_bins
from sklearn.base import BaseEstimator, ClassifierMixin, clone
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import LinearRegression, LogisticRegression
from sklearn.model_selection import GridSearchCV, cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from sklearn.svm import LinearSVC

from emacm import (
    ConditionRouter,
    CostSensitiveGaussianBayes,
    LeastRiskClassifier,
    PosteriorProduct,
    Recording,
    explain_decision,
    family_costs,
)


def run(load, worn, seed):
    """Under more load the whole current is higher, as it is in a worn one."""
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * 6 * np.arange(600) / 200
    current = (1 + load / 20) * np.sin(2 * angle) * (1.4 if worn else 1.0)
    current = current * (1 + 0.05 * rng.standard_normal()) + 0.1 * rng.standard_normal(600)
    return Recording({"current": current}, 200, angle=angle, meta={"load": load})


@pytest.fixture(scope="module")
def fleet():
    y = np.repeat(["healthy", "worn"], 18)
    return [run([-40, 20, 40][i % 3], y[i] == "worn", i) for i in range(36)], y


def chain():
    bayes = CostSensitiveGaussianBayes(covariance="tied", shrinkage="oas")
    return order_bins(log(), bayes, samples=16, max_order=6)


def table(loads, levels):
    return pd.DataFrame({"load": loads, "level": np.asarray(levels, dtype=float)})


LOADED = table([20] * 4 + [40] * 4, [1, 2, 5, 6, 5, 6, 9, 10])
STATES = np.array(["healthy", "healthy", "worn", "worn"] * 2)


@pytest.mark.slow
def test_it_predicts_what_an_estimator_fitted_on_that_condition_alone_predicts(fleet):
    X, y = fleet
    router = ConditionRouter(chain()).fit(X, y)
    loads = np.array([recording.meta["load"] for recording in X])
    for load in (-40, 20, 40):
        of_load = np.flatnonzero(loads == load)
        own = [X[i] for i in of_load]
        alone = chain().fit(own, y[of_load])
        np.testing.assert_array_equal(router.predict(X)[of_load], alone.predict(own))
        np.testing.assert_array_equal(router.predict_proba(X)[of_load], alone.predict_proba(own))
        np.testing.assert_array_equal(
            router.predict_log_proba(X)[of_load], alone.predict_log_proba(own)
        )


def test_levels_that_one_model_confuses_are_told_apart_by_load(fleet):
    X, y = fleet
    router = cross_val_predict(ConditionRouter(chain()), X, y, cv=3)
    pooled = cross_val_predict(chain(), X, y, cv=3)
    assert np.mean(router == y) > 0.95 > np.mean(pooled == y)


def test_a_function_may_read_rows_of_a_bare_array():
    X = LOADED.to_numpy()
    router = ConditionRouter(LogisticRegression(), lambda row: row[0]).fit(X, STATES)
    assert router.conditions_ == (20.0, 40.0)
    assert router.score(X, STATES) == 1.0


# Classes that not all conditions have


UNEVEN = table([20] * 6 + [40] * 4, [1, 1.2, 5, 5.2, 9, 9.2, 1, 1.2, 9, 9.2])
UNEVEN_STATES = ["a", "a", "b", "b", "c", "c", "a", "a", "c", "c"]


def test_a_class_that_a_condition_has_not_is_impossible_there():
    router = ConditionRouter(CostSensitiveGaussianBayes(covariance="tied"))
    router.fit(UNEVEN, UNEVEN_STATES)
    assert router.classes_.tolist() == ["a", "b", "c"]
    proba = router.predict_proba(table([40, 20], [5.1, 5.1]))
    np.testing.assert_allclose(proba.sum(axis=1), 1)
    assert proba[0, 1] == 0
    assert proba[1, 1] > 0.99
    assert router.predict_log_proba(table([40], [5.1]))[0, 1] == -np.inf
    risk = router.risk(UNEVEN)
    assert np.all(np.isinf(risk[6:, 1]))
    np.testing.assert_array_equal(router.decisions_[risk.argmin(axis=1)], router.predict(UNEVEN))


# Conditions not seen


def test_a_pooled_estimator_knows_all_recordings():
    model = CostSensitiveGaussianBayes(covariance="tied")
    router = ConditionRouter(model, unseen="pooled").fit(LOADED, STATES)
    alone = clone(model).fit(LOADED[["level"]], STATES)
    levels = table([30, 20, 50], [4.0, 4.0, 9.0])
    proba = router.predict_proba(levels)
    np.testing.assert_array_equal(proba[[0, 2]], alone.predict_proba(levels[["level"]])[[0, 2]])
    assert proba[1].tolist() != proba[0].tolist()
    with pytest.raises(ValueError, match="row 0 has load=30"):  # a second fit forgets it
        router.set_params(unseen="raise").fit(LOADED, STATES).predict(levels)


def test_it_has_the_methods_of_its_estimator_alone():
    assert not hasattr(ConditionRouter(chain()), "transform")
    assert not hasattr(ConditionRouter(chain()), "decision_function")
    assert hasattr(ConditionRouter(chain()), "risk")
    assert not hasattr(ConditionRouter(LinearSVC()), "predict_proba")
    assert not hasattr(ConditionRouter(LinearSVC()), "risk")
    vectors = ConditionRouter(LinearSVC()).fit(LOADED, STATES)
    np.testing.assert_array_equal(vectors.cost_, [[0, 1], [1, 0]])
    assert vectors.score(LOADED, STATES) == np.mean(vectors.predict(LOADED) == STATES)


class Weighed(ClassifierMixin, BaseEstimator):
    """Remembers what `fit` was given."""

    def fit(self, X, y=None, sample_weight=None, names=None, order=None):
        self.given_ = np.asarray(sample_weight).tolist(), names, order
        self.classes_ = np.unique(y)
        return self


def test_arguments_with_an_entry_for_each_recording_are_cut_by_condition():
    router = ConditionRouter(Weighed())
    router.fit(LOADED, STATES, sample_weight=np.arange(8), names=list("abcdefgh"), order="strictly")
    assert router.estimators_[20].given_ == ([0, 1, 2, 3], list("abcd"), "strictly")
    assert router.estimators_[40].given_ == ([4, 5, 6, 7], list("efgh"), "strictly")


def test_a_router_after_other_steps_is_not_explained():
    X = LOADED.assign(level=[1.0, 2, 3, 5, 7, 8, 8, 9])
    router = ConditionRouter(CostSensitiveGaussianBayes(covariance="tied"))
    model = make_pipeline(FunctionTransformer(), router).fit(X, STATES)
    with pytest.raises(TypeError, match="ConditionRouter"):
        explain_decision(model, X.iloc[[0]])


FAMILIES = {"healthy": ["healthy"], "worn": ["worn", "dry"]}
SUB_STATES = np.array(["healthy", "healthy", "dry", "worn", "healthy", "healthy", "worn", "worn"])
FORMS_OF_A_COST = {
    "families": family_costs(
        FAMILIES, other_decisions={"inspect": 0.3}, healthy="healthy", missed_cost=10
    ),
    "mapping": {("healthy", "dry"): 10, ("healthy", "worn"): 10},
    "array": [[0, 1, 1], [10, 0, 1], [10, 1, 0]],  # dry, healthy, worn
}


def gaussian(cost):
    return CostSensitiveGaussianBayes(cost=cost, covariance="tied")


@pytest.mark.parametrize("cost", FORMS_OF_A_COST.values(), ids=FORMS_OF_A_COST)
def test_a_cost_may_name_a_class_that_some_condition_lacks(cost):
    router = ConditionRouter(gaussian(cost)).fit(LOADED, SUB_STATES)
    assert router.cost_.shape == (len(router.decisions_), 3)
    assert router.estimators_[40].cost_.shape[1] == 2
    assert router.predict(LOADED)[4:].tolist() == ["healthy", "healthy", "worn", "worn"]


@pytest.mark.parametrize(
    "priors", [{"dry": 0.2, "healthy": 0.6, "worn": 0.2}, [0.2, 0.6, 0.2], "uniform"]
)
def test_priors_of_a_class_that_some_condition_lacks_go_to_the_others(priors):
    model = CostSensitiveGaussianBayes(priors=priors, covariance="tied")
    router = ConditionRouter(model).fit(LOADED, SUB_STATES)
    assert len(router.estimators_[20].priors_) == 3
    expected = [0.5, 0.5] if priors == "uniform" else [0.75, 0.25]
    np.testing.assert_allclose(router.estimators_[40].priors_, expected)
    assert router.estimator.priors == priors
    router.predict(LOADED)


# Costs and priors at the time of decision

PRESENT = [
    {"cost": FORMS_OF_A_COST["families"]},
    {"cost": FORMS_OF_A_COST["mapping"], "priors": {"dry": 0.1, "healthy": 0.2, "worn": 0.7}},
    {"cost": FORMS_OF_A_COST["array"], "priors": [0.5, 0.2, 0.3]},
    {"priors": "uniform"},
]
LEVELS = table([20, 40, 30, 20, 40, 55] * 3, np.linspace(0, 11, 18))


@pytest.mark.slow
@pytest.mark.parametrize("present", PRESENT)
@pytest.mark.parametrize(
    "model",
    [
        gaussian({("healthy", "dry"): 3}),
        make_pipeline(StandardScaler(), gaussian(None)),
        LeastRiskClassifier(LogisticRegression()),
        PosteriorProduct([("one", gaussian(None))]),
    ],
)
def test_costs_and_priors_set_after_fit_decide_as_a_refit_does(model, present):
    router = ConditionRouter(model, unseen="pooled").fit(LOADED, SUB_STATES)
    final = "estimator__costsensitivegaussianbayes__" if hasattr(model, "steps") else "estimator__"
    router.set_params(**{final + name: value for name, value in present.items()})
    again = clone(router).fit(LOADED, SUB_STATES)
    for method in ("predict", "predict_proba", "predict_log_proba", "risk"):
        now, refitted = (getattr(either, method)(LEVELS) for either in (router, again))
        np.testing.assert_array_equal(now, refitted)
    np.testing.assert_array_equal(router.decisions_, again.decisions_)
    np.testing.assert_array_equal(router.cost_, again.cost_)
    assert router.score(LOADED, SUB_STATES) == again.score(LOADED, SUB_STATES)


def test_a_search_over_costs_inside_has_no_effect_and_outside_it_has():
    costs = [{("worn", "healthy"): 1e9}, {("healthy", "worn"): 5}]

    def called_worn(model, X, y):
        return np.mean(model.predict(X) == "worn")

    options = {"scoring": called_worn, "cv": [(range(4),) * 2]}
    inside = ConditionRouter(GridSearchCV(gaussian(None), {"cost": costs}, **options))
    assert inside.fit(LOADED, STATES).cost_[0, 1] == 1
    options["cv"] = [(range(8),) * 2]
    outside = GridSearchCV(ConditionRouter(gaussian(None)), {"estimator__cost": costs}, **options)
    assert outside.fit(LOADED, STATES).best_estimator_.cost_[0, 1] == 5


LOGISTIC = LogisticRegression()
UNSEEN = ConditionRouter(LOGISTIC, unseen="guess")
BAD_FITS = [
    (ConditionRouter(LinearRegression()), LOADED, STATES, "estimator must be a classifier or a"),
    (ConditionRouter(LOGISTIC), LOADED, None, "y should be a 1d array"),
    (ConditionRouter(LOGISTIC), LOADED, STATES[:7], "y has 7 entries for 8 recordings"),
    (ConditionRouter(LOGISTIC), LOADED, [*STATES[:7], None], "position 7 has None"),
    (ConditionRouter(LOGISTIC), LOADED, [*STATES[:7], 3], "position 7 has 3"),
    (ConditionRouter(LOGISTIC), LOADED, [*"abab", *["worn"] * 4], "40: all 4 are of class 'worn'"),
    (ConditionRouter(LOGISTIC), LOADED[["load"]], STATES, "no columns besides the condition"),
    (ConditionRouter(LOGISTIC, "speed"), LOADED, STATES, "recording 0 has no column 'speed'"),
    (UNSEEN, LOADED, STATES, "unseen must be one of 'raise', 'pooled'"),
    (
        ConditionRouter(CostSensitiveGaussianBayes(shrinkage="oas", covariance="tied")),
        LOADED.assign(level=[1.0, 2, 3, 4, 7, 7, 7, 7]),
        STATES,
        "among the recordings of load=40: The largest variance",
    ),
]


@pytest.mark.parametrize(("router", "X", "y", "message"), BAD_FITS)
def test_what_cannot_be_fitted_is_refused(router, X, y, message):
    with pytest.raises((TypeError, ValueError), match=message):
        router.fit(X, y)


def test_what_cannot_be_decided_is_refused(fleet):
    with pytest.raises(NotFittedError):
        ConditionRouter(gaussian(None)).risk(LOADED)
    router = ConditionRouter(gaussian(None)).fit(LOADED, SUB_STATES)
    with pytest.raises(ValueError, match=r"row 1 has load=30, but .*\[20, 40\]"):
        router.predict(table([20, 30], [1, 2]))
    with pytest.raises(ValueError, match="X contains no recording"):
        router.predict([])
    router.set_params(estimator__cost={("healthy", "loose"): 10})
    with pytest.raises(ValueError, match=r"condition of row 0: .*'loose'"):
        router.predict(LOADED)
