"""Defects of classifiers and model files that were found in use, one test for each."""

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.calibration import CalibratedClassifierCV
from sklearn.ensemble import BaggingClassifier, RandomForestClassifier, VotingClassifier
from sklearn.feature_selection import SelectKBest
from sklearn.impute import SimpleImputer
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import make_scorer
from sklearn.model_selection import GridSearchCV, TunedThresholdClassifierCV
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import FeatureUnion, make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

from emacm import (
    ConditionRouter,
    CostSensitiveGaussianBayes,
    LeastRiskClassifier,
    PosteriorProduct,
    evaluate,
    expected_cost,
    load_model,
    neg_expected_cost,
    save_model,
    score,
)
from emacm.decisions.pipelines import narrowed

STATES = np.array(["healthy", "inner", "outer"])
COST = pd.DataFrame([[0.0, 20, 8], [1, 0, 3], [2, 5, 0]], STATES, STATES)


def features(n_each=(60, 24, 12), seed=0):
    """Three states of unequal numbers, whose means differ in two of three features."""
    rng, means = np.random.default_rng(seed), [[0, 0, 0], [2, 1, 0], [1, 3, 0]]
    X = np.concatenate([rng.normal(mean, 1, (n, 3)) for mean, n in zip(means, n_each, strict=True)])
    return X, np.repeat(STATES, n_each)


@pytest.mark.parametrize("covariance", ["full", "tied"])
def test_units_of_features_do_not_change_what_oas_decides(covariance):
    (X, y), (new, _) = features(), features(seed=1)
    unit = np.array([1e-9, 1.0, 1e6])
    for shrinkage in ("oas", "auto"):
        model = CostSensitiveGaussianBayes(COST, covariance=covariance, shrinkage=shrinkage)
        expected = model.fit(X, y).predict_proba(new)
        found = model.fit(X * unit, y).predict_proba(new * unit)
        np.testing.assert_allclose(found, expected, atol=1e-9)


def test_a_threshold_is_tuned_by_the_scorer_that_the_docstring_names():
    X, y = features((60, 40, 0))
    cost = COST.loc[STATES[:2], STATES[:2]]
    by_cost = make_scorer(expected_cost, greater_is_better=False, cost=cost)
    model = TunedThresholdClassifierCV(LogisticRegression(), scoring=by_cost).fit(X, y)
    plain = LogisticRegression().fit(X, y)
    new, truth = features((60, 40, 0), seed=1)
    assert expected_cost(truth, model.predict(new), cost=cost) < expected_cost(
        truth, plain.predict(new), cost=cost
    )
    assert "make_scorer(expected_cost, greater_is_better=False" in neg_expected_cost.__doc__


@pytest.mark.filterwarnings("ignore:The `probability` parameter:FutureWarning")
@pytest.mark.parametrize("weights", ["balanced", {"healthy": 0.5, "inner": 3.0}])
def test_class_weights_are_part_of_the_prior_within_a_posterior(weights):
    (X, y), (new, _) = features((3000, 1500, 1000)), features(seed=1)
    plain = LeastRiskClassifier(LogisticRegression(), priors=[0.95, 0.04, 0.01]).fit(X, y)
    weighted = clone(plain).set_params(estimator__class_weight=weights).fit(X, y)
    found, expected = weighted.predict_proba(new), plain.predict_proba(new)
    np.testing.assert_allclose(found, expected, atol=0.03)
    # SVC fits its probabilities to the decisions on all recordings, whatever their weights.
    few = slice(None, None, 50)
    vectors = SVC(class_weight=weights, probability=True, random_state=0)
    of_svc = LeastRiskClassifier(vectors).fit(X[few], y[few]).estimator_priors_
    np.testing.assert_allclose(of_svc, np.array([60, 30, 20]) / 110)
    inner = LogisticRegression(class_weight="balanced")
    for around in (BaggingClassifier(inner, 3), VotingClassifier([("a", inner)], voting="soft")):
        with pytest.raises(ValueError, match=r"__class_weight=.*Leave class_weight out"):
            LeastRiskClassifier(around, priors=[0.95, 0.04, 0.01]).fit(X, y)
        LeastRiskClassifier(around).fit(X, y)
    around = CalibratedClassifierCV(inner, cv=3)
    found = LeastRiskClassifier(around, priors=[0.95, 0.04, 0.01]).fit(X, y).predict_proba(new)
    assert np.abs(found - expected).mean() < 0.05


@pytest.mark.parametrize(
    "model",
    [
        RandomForestClassifier(5, random_state=0),
        KNeighborsClassifier(),
        LeastRiskClassifier(CalibratedClassifierCV(LogisticRegression(), cv=3), COST),
        make_pipeline(SelectKBest(k=2), LogisticRegression()),
        make_pipeline(SimpleImputer(), CostSensitiveGaussianBayes(COST)),
        make_pipeline(
            FeatureUnion([("a", StandardScaler()), ("b", StandardScaler())]).set_output(
                transform="pandas"
            ),
            CostSensitiveGaussianBayes(COST, covariance="tied", shrinkage=0.1),
        ),
    ],
    ids=lambda model: type(model).__name__,
)
def test_a_model_file_holds_the_steps_of_scikit_learn(model, tmp_path):
    X, y = features()
    save_model(model.fit(X, y), tmp_path / "model")
    loaded = load_model(tmp_path / "model")
    np.testing.assert_array_equal(loaded.predict_proba(X), model.predict_proba(X))


def test_a_model_file_names_the_step_that_it_cannot_hold(tmp_path):
    X, y = features()
    costs = [{("healthy", "inner"): cost} for cost in (5, 20)]
    search = GridSearchCV(CostSensitiveGaussianBayes(), {"cost": costs}, cv=3)
    with pytest.raises(TypeError, match=r"GridSearchCV: .*save the best_estimator_"):
        save_model(search.fit(X, y), tmp_path / "model")


@pytest.mark.parametrize(
    ("rows", "columns"),
    [("true", "predicted"), ("y_true", None), (None, "Predicted label"), ("class", "action")]
    + [("wahr", "vorhergesagt"), ("Zustand", None), (None, "Entscheidung"), ("true/decided", None)],
)
def test_a_cost_whose_rows_are_named_as_true_classes_is_refused(rows, columns):
    transposed = COST.T.rename_axis(index=rows, columns=columns)
    with pytest.raises(ValueError, match=r"rows are decisions .* Give cost\.T"):
        CostSensitiveGaussianBayes(transposed).fit(*features())
    with pytest.raises(ValueError, match=r"Give cost\.T"):
        expected_cost(["inner"], ["healthy"], cost=transposed)
    for axes in (("decision", "true class"), ("Entscheidung", "Zustand"), ("decision/true", None)):
        named = COST.rename_axis(index=axes[0], columns=axes[1])
        assert expected_cost(["inner"], ["healthy"], cost=named) == 20


# Unknown states where classifiers are combined


def bayes(**options):
    options |= {"covariance": "tied", "unknown": "unknown", "unknown_rate": 0.05}
    return CostSensitiveGaussianBayes(**options)


def test_the_unknown_state_keeps_its_prior_where_a_condition_lacks_a_class():
    stated = {"healthy": 0.6, "inner": 0.1, "outer": 0.2, "unknown": 0.1}
    for priors in (stated, np.array([*stated.values()])):
        model = narrowed(bayes(priors=priors), STATES[:2], STATES)
        kept = model.priors if isinstance(priors, np.ndarray) else [*model.priors.values()]
        np.testing.assert_allclose(kept, [0.9 * 6 / 7, 0.9 / 7, 0.1])


def test_members_that_left_out_different_numbers_of_groups_are_combined():
    X, y = features()
    groups = np.arange(len(y)) % 12
    product = PosteriorProduct([("a", bayes()), ("b", bayes())]).fit(X, y, groups=groups)
    other = bayes().fit(X, y, groups=groups % 4)
    product.named_estimators_["b"] = other
    assert product.unknown_limit_ == other.unknown_limit_ < 0.05 / (1 + 12**-0.5)
    rarer = bayes().set_params(unknown_rate=0.01)
    with pytest.raises(ValueError, match="members have different unknown_rate"):
        PosteriorProduct([("a", bayes()), ("b", rarer)]).fit(X, y, groups=groups)


def test_an_unknown_state_that_would_be_lost_is_refused_before_the_fit():
    X, y = features()
    table = pd.DataFrame(X, columns=[*"abc"]).assign(load=np.arange(len(y)) % 2)
    hidden = CalibratedClassifierCV(bayes())
    with pytest.raises(ValueError, match="loses the unknown state"):
        ConditionRouter(hidden).fit(table, y)
    with pytest.raises(ValueError, match="loses the unknown state"):
        evaluate(hidden, X, y)
    router = ConditionRouter(CostSensitiveGaussianBayes(covariance="tied"))
    with pytest.raises(ValueError, match="priors of a ConditionRouter belong inside"):
        LeastRiskClassifier(router, priors="uniform").fit(table, y)


def test_a_class_named_as_the_column_of_the_unknown_state_is_refused():
    X, y = features()
    labels = np.where(y == "outer", "unknown", y)
    model = bayes().set_params(unknown="new").fit(X, labels, groups=np.arange(len(y)) % 4)
    with pytest.raises(ValueError, match="a class of the model is named 'unknown'"):
        score(model, [])
