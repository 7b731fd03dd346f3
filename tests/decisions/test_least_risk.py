"""Facts about decisions of least risk: costs and priors take effect when a decision is made."""

import itertools

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.calibration import CalibratedClassifierCV
from sklearn.ensemble import BaggingClassifier, StackingClassifier, VotingClassifier
from sklearn.frozen import FrozenEstimator
from sklearn.linear_model import LogisticRegression, RidgeClassifier
from sklearn.model_selection import cross_val_predict
from sklearn.naive_bayes import GaussianNB
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeClassifier
from sklearn.utils.estimator_checks import parametrize_with_checks

from emacm import (
    ConditionRouter,
    CostSensitiveGaussianBayes,
    LeastRiskClassifier,
    PosteriorProduct,
    neg_expected_cost,
)

STATES = ["spall", "dry", "new"]
COSTS = {
    "None": None,
    "array": [[0, 2, 1], [8, 0, 3], [4, 1, 0]],  # dry, new, spall
    "mapping": {("new", "spall"): 30, ("new", "dry"): 4},
    "negative": pd.DataFrame(
        [[1, -1, 9], [0.5, 0, -2]], index=["fly", "ground"], columns=["dry", "new", "spall"]
    ),
    "inspect": {("inspect", state): 0.15 for state in STATES},
}
PRIORS = [None, "uniform", [0.2, 0.7, 0.1], {"spall": 0.3, "dry": 0.6, "new": 0.1}]
KINDS = [("full", None), ("tied", "auto"), ("diag", 0.3), ("full", "oas")]


def recordings(seed=0, counts=(14, 9, 20)):
    rng = np.random.default_rng(seed)
    y = rng.permutation(np.repeat(STATES, counts))
    centres = dict(zip(STATES, [(2.0, 0.5, 1.0), (-1.0, 1.0, 0.0), (0.0, 0.0, 0.3)], strict=True))
    return np.array([rng.normal(centres[label], (1.0, 1.4, 0.6)) for label in y]), y


X, Y = recordings()
LATER, Y_LATER = recordings(1, counts=(6, 5, 8))


def assert_same(model, refitted):
    """All results are equal, bit for bit."""
    for name in ("classes_", "decisions_", "cost_", "priors_"):
        np.testing.assert_array_equal(getattr(model, name), getattr(refitted, name))
    for method in ("predict", "risk", "predict_proba", "predict_log_proba"):
        found, expected = getattr(model, method)(LATER), getattr(refitted, method)(LATER)
        np.testing.assert_array_equal(found, expected)
    assert model.score(LATER, Y_LATER) == refitted.score(LATER, Y_LATER)
    assert neg_expected_cost(model, LATER, Y_LATER) == neg_expected_cost(refitted, LATER, Y_LATER)


def product(classifier):
    return PosteriorProduct([("first", classifier), ("second", GaussianNB())], priors="uniform")


MODELS = {
    f"{covariance}, {shrinkage}": CostSensitiveGaussianBayes(
        covariance=covariance, shrinkage=shrinkage
    )
    for covariance, shrinkage in KINDS
} | {
    "wrapped logistic regression": LeastRiskClassifier(LogisticRegression()),
    "wrapped pipeline": LeastRiskClassifier(make_pipeline(StandardScaler(), GaussianNB())),
    "product": product(CostSensitiveGaussianBayes()),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", MODELS)
def test_costs_and_priors_set_after_fit_equal_those_of_a_refit(kind):
    model = clone(MODELS[kind]).fit(X, Y)
    for cost, priors in zip(COSTS.values(), itertools.cycle(PRIORS[1:])):
        model.set_params(cost=cost, priors=priors)
        assert_same(model, clone(model).fit(X, Y))


@pytest.mark.parametrize("kind", ["full, None", "wrapped logistic regression", "product"])
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"cost": {("new", "wear"): 3}}, "class 'wear' as a truth, which is unknown"),
        ({"cost": [[0, 1], [1, 0]]}, r"square array of shape \(3, 3\).*got shape \(2, 2\)"),
        ({"priors": [0.5, 0.5]}, "each of the 3 classes"),
        ({"priors": {"new": 1.0}}, r"missing: \['dry', 'spall'\]"),
    ],
)
def test_an_invalid_later_cost_or_prior_is_an_error_in_predict(kind, options, message):
    model = clone(MODELS[kind]).fit(X, Y).set_params(**options)
    with pytest.raises(ValueError, match=message):
        model.predict(LATER)
    with pytest.raises(ValueError, match=message):
        model.score(LATER, Y_LATER)
    with pytest.raises(ValueError, match=message):
        clone(model).fit(X, Y)


# Any classifier


@pytest.mark.slow
@parametrize_with_checks(
    [
        LeastRiskClassifier(LogisticRegression()),
        LeastRiskClassifier(CostSensitiveGaussianBayes(covariance="tied", shrinkage=0.1)),
    ]
)
def test_every_check_of_scikit_learn_passes(estimator, check):
    check(estimator)


def test_the_posterior_of_the_estimator_is_left_alone():
    for estimator in (LogisticRegression(), GaussianNB(), DecisionTreeClassifier(random_state=0)):
        model = LeastRiskClassifier(estimator).fit(X, Y)
        expected = clone(estimator).fit(X, Y).predict_proba(LATER)
        np.testing.assert_allclose(model.predict_proba(LATER), expected, rtol=1e-13)
        np.testing.assert_allclose(model.risk(LATER), 1 - expected, atol=1e-12)


def test_the_unknown_state_of_the_estimator_is_decided_on():
    own = CostSensitiveGaussianBayes(COSTS["inspect"], unknown="odd", unknown_rate=0.05)
    inside, groups = make_pipeline(StandardScaler(), own), np.arange(len(Y)) // 4
    model = LeastRiskClassifier(inside, COSTS["inspect"])
    for one in (inside, model):
        one.fit(X, Y, costsensitivegaussianbayes__groups=groups)
    new = np.vstack([LATER, 50 * LATER[:3]])
    scaled = inside[:-1].transform(new)
    for name in ("typicality", "unknown_proba", "risk", "predict"):
        expected = getattr(inside[-1], name)(scaled)
        np.testing.assert_array_equal(getattr(model, name)(new), expected)
    assert model.predict(new)[-3:].tolist() == ["odd"] * 3
    priors = {"dry": 0.2, "new": 0.4, "spall": 0.3, "odd": 0.1}
    assert model.set_params(priors=priors).unknown_prior_ == pytest.approx(0.1)
    assert not hasattr(LeastRiskClassifier(LogisticRegression()), "unknown_proba")
    table = pd.DataFrame(X, columns=list("abc")).assign(load=20)
    with pytest.raises(ValueError, match="Put LeastRiskClassifier inside ConditionRouter"):
        LeastRiskClassifier(ConditionRouter(own, "load")).fit(table, Y, groups=groups)


def test_other_priors_follow_from_bayes_rule():
    model = LeastRiskClassifier(LogisticRegression(), priors=[0.2, 0.7, 0.1]).fit(X, Y)
    own = model.estimator_.predict_proba(LATER)
    frequencies = np.array([9, 20, 14]) / 43
    np.testing.assert_allclose(model.estimator_priors_, frequencies)
    assert model.truths_.tolist() == ["dry", "new", "spall"]
    expected = own * [0.2, 0.7, 0.1] / frequencies
    expected /= expected.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(model.predict_proba(LATER), expected, rtol=1e-12)


# What scikit-learn combines or calibrates gets numbers as classes

COMBINATIONS = {
    "calibrated": lambda inner: CalibratedClassifierCV(inner, cv=3, ensemble=False),
    "votes": lambda inner: VotingClassifier([("one", inner)], voting="soft"),
    "stack": lambda inner: StackingClassifier([("one", inner)], cv=3),
    "bag": lambda inner: BaggingClassifier(inner, n_estimators=3, random_state=0),
}


@pytest.mark.parametrize("kind", COMBINATIONS)
def test_costs_and_priors_by_name_stand_outside_of_a_combination(kind):
    combined, cost = COMBINATIONS[kind], COSTS["inspect"] | COSTS["mapping"]
    model = LeastRiskClassifier(combined(CostSensitiveGaussianBayes()), cost).fit(X, Y)
    posterior = combined(CostSensitiveGaussianBayes()).fit(X, Y).predict_proba(LATER)
    np.testing.assert_allclose(model.predict_proba(LATER), posterior, rtol=1e-12)
    assert "inspect" in model.predict(LATER)
    np.testing.assert_allclose(model.risk(LATER)[:, 1], posterior @ [4, 0, 30])
    model.set_params(priors=PRIORS[3])
    np.testing.assert_allclose(model.priors_, [0.6, 0.1, 0.3])
    with pytest.raises(ValueError, match=r"outside: LeastRiskClassifier\(VotingClassifier"):
        combined(CostSensitiveGaussianBayes(cost)).fit(X, Y)
    with pytest.raises(ValueError, match=r"loses the unknown state 'odd'.* unknown=None"):
        LeastRiskClassifier(combined(CostSensitiveGaussianBayes(unknown="odd"))).fit(X, Y)


def test_probabilities_of_cross_val_predict_need_no_costs_and_decisions_take_them():
    model = CostSensitiveGaussianBayes(COSTS["inspect"], priors=[0.6, 0.1, 0.3])
    assert "inspect" in cross_val_predict(model, X, Y)
    for each in (model, LeastRiskClassifier(GaussianNB(), COSTS["inspect"])):
        with pytest.raises(ValueError, match=r"predict_proba.* needs no costs"):
            cross_val_predict(each, X, Y, method="predict_proba")
        without = clone(each).set_params(cost=None)
        assert cross_val_predict(without, X, Y, method="predict_proba").shape == (43, 3)


def test_weights_reach_the_estimator_and_its_prior():
    weight = np.arange(len(Y)) % 3
    for estimator, name in (
        (GaussianNB(), "sample_weight"),
        (make_pipeline(StandardScaler(), GaussianNB()), "gaussiannb__sample_weight"),
    ):
        model = LeastRiskClassifier(estimator, priors="uniform").fit(X, Y, **{name: weight})
        repeated = LeastRiskClassifier(estimator, priors="uniform")
        repeated.fit(np.repeat(X, weight, axis=0), np.repeat(Y, weight))
        np.testing.assert_allclose(model.estimator_priors_, repeated.estimator_priors_)
        found, expected = model.predict_proba(LATER), repeated.predict_proba(LATER)
        if name == "sample_weight":  # the scaler has no weights
            np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("estimator", "error", "message"),
    [
        (RidgeClassifier(), TypeError, "RidgeClassifier has no predict_proba.*Calibrated"),
        (GaussianNB, TypeError, "Cannot clone object. You should provide an instance"),
        (
            FrozenEstimator(GaussianNB().fit(X[Y != "dry"], Y[Y != "dry"])),
            ValueError,
            r"trained on the classes \['new', 'spall'\], but y contains \['dry', 'new', 'spall'\]",
        ),
    ],
)
def test_estimators_that_cannot_be_used_are_refused(estimator, error, message):
    with pytest.raises(error, match=message):
        LeastRiskClassifier(estimator).fit(X, Y)


def test_a_class_that_the_estimator_excludes_cannot_be_given_a_prior():
    plain = CostSensitiveGaussianBayes(priors=[0.5, 0.5, 0.0])
    model = LeastRiskClassifier(plain).fit(X, Y)
    with pytest.raises(ValueError, match="estimator has the prior 0 of class 'spall'"):
        model.set_params(priors="uniform").predict(LATER)
    with pytest.raises(ValueError, match="estimator has the prior 0 of class 'spall'"):
        model.fit(X, Y)
