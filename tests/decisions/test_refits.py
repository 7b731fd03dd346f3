"""Facts about temperature and unknown state of any classifier, by fits without each group."""

import contextlib
from unittest import SkipTest

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.ensemble import IsolationForest, RandomForestClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.naive_bayes import GaussianNB
from sklearn.neighbors import KernelDensity
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.least_risk import LeastRiskClassifier
from emacm.decisions.unknown import unknown_probability

FAR = np.array([[60.0, -70.0, 80.0]])


def draw(seed, n_units=8):
    rng = np.random.default_rng(seed)
    codes, units = np.tile([0, 0, 1, 1, 2], n_units), np.repeat(np.arange(n_units), 5)
    places = np.array([[0.0, 0, 2], [2, 0, 0], [0, 3, 0]])[codes]
    X = places + 0.4 * rng.normal(size=(n_units, 3, 3))[units, codes]
    return X + 0.7 * rng.normal(size=X.shape), np.array(["b", "c", "a"])[codes], units


def detected(**options):
    options = {"unknown": "unknown", "detector": KernelDensity(bandwidth=0.5)} | options
    return LeastRiskClassifier(LogisticRegression(C=100.0), **options)


def test_the_temperature_of_gaussian_classes_is_that_of_the_classifier_itself():
    X, y, units = draw(0)
    own = CostSensitiveGaussianBayes(covariance="tied", shrinkage=0.1, temperature="groups")
    wrapped = LeastRiskClassifier(
        CostSensitiveGaussianBayes(covariance="tied", shrinkage=0.1), temperature="groups"
    )
    for model in (own, wrapped):
        model.fit(X, y, groups=units)
    assert wrapped.temperature_ == pytest.approx(own.temperature_, rel=1e-5)
    np.testing.assert_allclose(wrapped.predict_proba(X), own.predict_proba(X), rtol=1e-4)


def test_distant_recordings_are_unknown_and_known_ones_are_classified():
    X, y, units = draw(1)
    model = detected(temperature="groups").fit(X, y, groups=units)
    assert model.predict(FAR) == ["unknown"]
    assert np.mean(model.predict(X) == y) > 0.8
    np.testing.assert_array_equal(
        model.unknown_proba(X), unknown_probability(model.typicality(X), 0.01)
    )
    assert ((model.typicality(X) > 0) & (model.typicality(X) <= 1)).all()


def test_left_out_recordings_determine_the_typicality():
    X, y, units = draw(2, n_units=60)
    typicality = detected().fit(X, y, groups=units).typicality
    for level in (0.1, 0.3):
        assert np.mean(typicality(draw(3, 200)[0]) <= level) == pytest.approx(level, rel=0.35)


def test_costs_and_priors_set_later_equal_those_of_a_refit():
    X, y, units = draw(4)
    later = {
        "cost": {("inspect", name): 0.2 for name in ("a", "b", "c", "unknown")},
        "priors": {"a": 0.6, "b": 0.2, "c": 0.1, "unknown": 0.1},
    }
    model = detected(temperature=3.0).fit(X, y, groups=units).set_params(**later)
    anew = detected(temperature=3.0, **later).fit(X, y, groups=units)
    for method in ("predict_proba", "unknown_proba", "risk", "predict"):
        np.testing.assert_array_equal(getattr(model, method)(X), getattr(anew, method)(X))
    assert model.unknown_prior_ == pytest.approx(0.1)


def test_without_detector_and_temperature_nothing_changes():
    X, y, _ = draw(5)
    plain = LogisticRegression().fit(X, y)
    model = LeastRiskClassifier(LogisticRegression()).fit(X, y)
    np.testing.assert_array_equal(model.predict_log_proba(X), plain.predict_log_proba(X))
    assert model.temperature_ == 1
    assert not hasattr(model, "unknown_proba")


def test_a_temperature_of_1_keeps_the_posterior():
    X, y, _ = draw(6)
    model = LeastRiskClassifier(LogisticRegression(), temperature=1.0).fit(X, y)
    expected = LogisticRegression().fit(X, y).predict_proba(X)
    np.testing.assert_allclose(model.predict_proba(X), expected)


def test_probabilities_of_0_have_a_finite_temperature():
    X, y, units = draw(7)
    forest = RandomForestClassifier(20, random_state=0, max_features=1)
    model = LeastRiskClassifier(forest, temperature="groups").fit(X, y, groups=units)
    assert 0.1 < model.temperature_ < 100
    assert np.isfinite(model.predict_log_proba(X)).all()


@pytest.mark.slow
def test_it_works_in_a_search_and_with_pipelines():
    X, y, units = draw(8)
    detector = make_pipeline(StandardScaler(), IsolationForest(random_state=0))
    model = detected(detector=detector, temperature="groups")
    search = GridSearchCV(
        make_pipeline(StandardScaler(), model),
        {"leastriskclassifier__estimator__C": [0.1, 10.0]},
        cv=GroupKFold(2),
        error_score="raise",
    )
    search.fit(X, y, groups=units, leastriskclassifier__groups=units)
    assert search.predict(FAR).shape == (1,)


def test_groups_that_are_not_needed_reach_the_estimator():
    X, y, units = draw(9)
    inner = CostSensitiveGaussianBayes(temperature="groups", shrinkage=0.1)
    wrapped = LeastRiskClassifier(inner).fit(X, y, groups=units)
    assert wrapped.estimator_.temperature_ == clone(inner).fit(X, y, groups=units).temperature_


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"unknown": "new", "detector": None}, "needs detector="),
        ({"detector": LogisticRegression()}, "score_samples"),
        ({"temperature": "group"}, "temperature"),
        ({"unknown": "b"}, "'b' is a class"),
    ],
)
def test_invalid_parameters_are_errors(options, message):
    X, y, units = draw(10)
    with pytest.raises((TypeError, ValueError), match=message):
        detected(**options).fit(X, y, groups=units)


def test_one_group_per_class_is_an_error():
    X, y, _ = draw(11)
    with pytest.raises(ValueError, match="two groups"):
        detected().fit(X, y, groups=y)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:fit was called without groups:UserWarning")
def test_every_check_of_scikit_learn_passes():
    model = LeastRiskClassifier(
        GaussianNB(), unknown="unknown", temperature="groups", detector=KernelDensity()
    )
    for estimator, check in parametrize_with_checks([model]).args[1]:
        # Without groups, repeated recordings fall into other parts than weighted ones.
        if "sample_weight_equivalence" not in str(check):
            with contextlib.suppress(SkipTest):
                check(estimator)
