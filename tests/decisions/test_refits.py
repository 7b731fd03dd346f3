"""Facts about temperature and unknown state of any classifier, by fits without each group."""

import contextlib
from typing import ClassVar
from unittest import SkipTest

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, OutlierMixin, clone
from sklearn.ensemble import IsolationForest, RandomForestClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.naive_bayes import GaussianNB
from sklearn.neighbors import KernelDensity
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.least_risk import LeastRiskClassifier
from emacm.decisions.refits import (
    DetectorTypicality,
    Refits,
    as_rows,
    log_likelihoods,
    parameters_of_rows,
    parts_of,
)
from emacm.decisions.tails import student_tail
from emacm.decisions.temperature import fit_temperature
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


class Level(OutlierMixin, BaseEstimator):
    """Scores by the distance of the first feature from the weighted mean; notes what it saw."""

    seen: ClassVar[list] = []

    def fit(self, X, y=None, sample_weight=None):
        Level.seen.append((X[:, 0].tolist(), None if sample_weight is None else [*sample_weight]))
        self.mean_ = np.average(X[:, 0], weights=sample_weight)
        return self

    def score_samples(self, X):
        return -np.abs(X[:, 0] - self.mean_)


@pytest.mark.parametrize("weighted", [False, True])
def test_each_group_is_judged_once_by_detectors_and_classifiers_of_the_others(weighted):
    rng = np.random.default_rng(12)
    X, codes = rng.normal(size=(12, 2)), np.array([0, 1, 2] * 3 + [0, 1, 1])
    groups = np.array([4, 4, 4, 7, 7, 1, 1, 7, 1, 1, 4, 7])
    codes[groups == 1] = np.array([0, 1, 0, 1])  # class 2 in group 4 only
    codes[7] = 0
    weight = rng.integers(0, 4, 12).astype(float) if weighted else np.ones(12)
    weight[[0, 2, 4]] = 1
    asked = []

    def log_likelihoods(others, rows):
        asked.append((others.tolist(), rows.tolist()))
        known = np.unique(codes[others])
        return -np.abs(X[rows, 1:] - known) * len(others)

    Level.seen.clear()
    refits = Refits(X, codes, groups, weight, log_likelihoods)
    typicality, temperature = refits.calibrate(Level(), temperature=True)
    counted, scores, logs = weight > 0, np.full(12, np.nan), np.full((12, 3), -np.inf)
    expected_asked, expected_seen = [], []
    for group in (1, 4, 7):
        rows = np.flatnonzero((groups == group) & counted)
        others = np.flatnonzero((groups != group) & counted)
        expected_asked.append((others.tolist(), rows.tolist()))
        expected_seen.append((X[others, 0].tolist(), [*weight[others]] if weighted else None))
        mean = np.average(X[others, 0], weights=weight[others])
        scores[rows] = np.abs(X[rows, 0] - mean)
        known = np.unique(codes[others])
        logs[np.ix_(rows, known)] = -np.abs(X[rows, 1:] - known) * len(others)
    whole = X[counted, 0].tolist(), [*weight[counted]] if weighted else None
    assert asked == expected_asked
    assert Level.seen == [*expected_seen, whole]
    judged = counted & (codes != 2)
    tail = student_tail(scores[judged], weight[judged])
    new = np.array([[0.0, 0], [1, 0], [4, 0], [1e300, 0]])
    mean = np.average(X[:, 0], weights=weight)
    expected = np.maximum(tail.survival(np.abs(new[:, 0] - mean)), np.finfo(float).tiny)
    np.testing.assert_allclose(typicality(new), expected)
    assert typicality(new)[3] == np.finfo(float).tiny
    priors = np.bincount(codes, weight) / weight.sum()
    best = fit_temperature(logs[judged], codes[judged], weight[judged], priors)
    assert temperature == best
    only = refits.calibrate(None, temperature=True)
    assert (only.typicality, only.temperature) == (None, best)
    assert refits.calibrate(Level(), temperature=False).temperature is None


def test_a_group_without_which_one_class_remains_is_not_judged():
    codes, groups = np.array([0, 0, 1, 1, 0]), np.array([0, 1, 1, 1, 2])
    asked = []

    def log_likelihoods(others, rows):
        asked.append(rows.tolist())
        return np.zeros((len(rows), 2))

    Refits(np.eye(5), codes, groups, np.ones(5), log_likelihoods).calibrate(None, temperature=True)
    assert asked == [[0], [4]]
    one_class = Refits(np.eye(5), 0 * codes, groups, np.ones(5), log_likelihoods)
    one_class.calibrate(Level(), temperature=False)
    with pytest.raises(ValueError, match="no class has recordings in two groups"):
        Refits(np.eye(5), codes, codes, np.ones(5), None).calibrate(Level(), temperature=False)


def test_parts_are_ten_and_divide_each_class_evenly():
    codes = np.random.default_rng(0).permutation(np.repeat([0, 1, 2], [7, 20, 33]))
    parts = parts_of(codes)
    assert np.bincount(parts).tolist() == [6] * 10
    for code in range(3):
        counts = np.bincount(parts[codes == code], minlength=10)
        assert np.ptp(counts) <= 1
    assert parts[codes == 1].tolist() == [(7 + k) % 10 for k in range(20)]


def test_a_posterior_is_divided_by_its_prior_and_is_at_least_1e_15():
    logs = np.array([[np.log(0.2), np.log(0.8), -np.inf], [0.0, -690.0, -np.inf]])
    found = log_likelihoods(logs, np.array([0.5, 0.5, 0.0]))
    np.testing.assert_allclose(found[0], [np.log(0.4), np.log(1.6), -np.inf])
    np.testing.assert_allclose(found[1], [np.log(2), np.log(2e-15), -np.inf])


def test_only_what_has_an_entry_for_each_recording_is_divided():
    rows = np.array([2, 0])
    given = {
        "list": [1, 2, 3], "array": np.arange(3), "text": "abc", "number": 3, "none": None,
        "series": pd.Series([5, 6, 7], index=[9, 8, 7]), "short": [1, 2],
    }  # fmt: skip
    some = parameters_of_rows(given, rows, 3)
    assert list(some) == list(given)
    assert some["list"] == [3, 1]
    assert some["array"].tolist() == [2, 0]
    assert some["series"].tolist() == [7, 5]
    unchanged = ("text", "number", "none", "short")
    assert [some[name] for name in unchanged] == [given[name] for name in unchanged]

    class Convertible:
        def __array__(self, dtype=None, copy=None):
            return np.array([4, 5, 6])

    assert as_rows(Convertible()).tolist() == [4, 5, 6]
    assert as_rows(given["series"]) is given["series"]
    assert parameters_of_rows({"x": Convertible()}, rows, 3)["x"].tolist() == [6, 4]


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


def test_a_detector_that_cannot_read_the_input_is_named():
    X, y, units = draw(10)
    frame = pd.DataFrame(X, columns=list("abc")).assign(place=["left"] * len(X))
    columns = make_pipeline(FunctionTransformer(lambda X: X[["a", "b"]]), GaussianNB())
    model = LeastRiskClassifier(columns, unknown="unknown", detector=KernelDensity())
    with pytest.raises(ValueError, match=r"detector \(its input is that of .*a pipeline\): could"):
        model.fit(frame, y, groups=units)


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


def test_typicality_of_scores_in_single_precision_is_double():
    class Small(Level):
        def score_samples(self, X):
            return super().score_samples(X).astype(np.float32)

    tail = student_tail(np.arange(10.0), np.ones(10))
    detector, X = Small().fit(np.zeros((2, 1))), np.array([[0.1], [30.0]])
    found = DetectorTypicality(detector, tail)(X)
    expected = tail.survival(X[:, 0].astype(np.float32).astype(float))
    assert (found.dtype, found.tolist()) == (np.float64, expected.tolist())
