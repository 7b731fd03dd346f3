"""Facts about the last step of pipelines and searches."""

import numpy as np
import pandas as pd
import pytest
import sklearn
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV, GroupKFold, RandomizedSearchCV
from sklearn.naive_bayes import GaussianNB
from sklearn.pipeline import FeatureUnion, make_pipeline
from sklearn.preprocessing import StandardScaler

from emacm import (
    BinTransformer,
    ConditionRouter,
    CostSensitiveGaussianBayes,
    LeastRiskClassifier,
    NewUnitClassifier,
    PosteriorProduct,
)
from emacm.decisions.pipelines import (
    before_the_last_step,
    final_estimator,
    groups_are_units,
    groups_options,
    search_estimator,
)

X = np.array([[0.0, 3.0], [2.0, 1.0], [5.0, 4.0], [9.0, 8.0]])
Y = np.array(["new", "new", "worn", "worn"])


def test_the_input_of_the_last_step_is_transformed_by_all_others():
    inner = make_pipeline(StandardScaler(with_mean=False), GaussianNB())
    model = GridSearchCV(make_pipeline(StandardScaler(with_std=False), inner), {}, cv=2).fit(X, Y)
    final, table = before_the_last_step(model, X)
    np.testing.assert_allclose(table, (X - X.mean(axis=0)) / X.std(axis=0))
    assert final is final_estimator(model)
    np.testing.assert_array_equal(final.predict(table), model.predict(X))


def in_pipeline(classifier):
    return make_pipeline(StandardScaler(), classifier)


@pytest.mark.parametrize(
    ("options", "needed"),
    [
        ({}, False),
        ({"unknown": "odd"}, True),
        ({"unknown": 0}, True),
        ({"temperature": "groups"}, True),
        ({"temperature": 2.0}, False),
    ],
)
def test_groups_are_passed_to_all_steps_that_leave_them_out_by_their_names(options, needed):
    classifier, step = CostSensitiveGaussianBayes(**options), "costsensitivegaussianbayes__groups"
    bins = {"pipeline__bintransformer__groups"}
    with_bins = make_pipeline(make_pipeline(BinTransformer(), StandardScaler()), classifier)
    for model, names, always in (
        (classifier, {"groups"}, set()),
        (make_pipeline(in_pipeline(classifier)), {f"pipeline__{step}"}, set()),
        (GridSearchCV(in_pipeline(classifier), {}), {step}, set()),
        (with_bins, {step}, bins),
        (LeastRiskClassifier(with_bins), {step}, bins),
    ):
        names = names | always if needed else always
        assert groups_options(model, ["a", "b"]) == {name: ["a", "b"] for name in names}
        assert groups_options(model, None) == {}
        assert not groups_are_units(model)


def test_units_are_the_groups_of_a_classifier_for_new_units_wherever_it_is():
    model = NewUnitClassifier()
    wrapped = LeastRiskClassifier(in_pipeline(model))
    for each in (model, in_pipeline(model), GridSearchCV(in_pipeline(model), {}), wrapped):
        assert groups_are_units(each)
        (name,) = groups_options(each, ["a", "b"])
        assert name.endswith("groups")
    for each in (GaussianNB(), in_pipeline(GaussianNB()), GridSearchCV(GaussianNB(), {}), object()):
        assert groups_are_units(each) is False
        assert groups_options(each, ["a", "b"]) == {}


# Groups are given once


GROUPS, STATES = np.arange(60) % 10, np.repeat(["new", "worn"], 30)
SPECTRA = pd.DataFrame(
    np.random.default_rng(0).gamma(5, size=(60, 49)) + 2 * (STATES == "worn")[:, np.newaxis],
    columns=[f"a@{number / 4}" for number in range(49)],
)
CLASSIFIERS = [
    CostSensitiveGaussianBayes(covariance="tied", unknown="odd"),
    NewUnitClassifier(unknown="odd"),
]
WRAPPERS = {  # and the pipeline in a fitted one
    "pipeline": (lambda chain: chain, lambda model: model),
    "least risk": (LeastRiskClassifier, lambda model: model.estimator_),
    "product": (
        lambda chain: PosteriorProduct([("one", chain), ("two", clone(chain))], priors="uniform"),
        lambda model: model.estimators_[0],
    ),
    "router": (lambda chain: ConditionRouter(chain, "load"), lambda model: model.estimators_[20]),
}


def bins_and(classifier):
    """A pipeline, and what it has learned with groups at each step: line limits, typicality."""
    chain = make_pipeline(FeatureUnion([("bins", BinTransformer(2, max_order=12))]), classifier)
    bins = BinTransformer(2, max_order=12).fit(SPECTRA, groups=GROUPS)
    table = bins.transform(SPECTRA)
    fitted = clone(classifier).fit(table, STATES, groups=GROUPS)
    return chain, bins.known_lines_.limits, fitted.typicality(table)


@pytest.mark.parametrize("classifier", CLASSIFIERS)
@pytest.mark.parametrize("kind", WRAPPERS)
def test_with_metadata_routing_a_search_takes_groups_once(classifier, kind):
    chain, limits, typicality = bins_and(classifier)
    wrap, unwrap = WRAPPERS[kind]
    X = SPECTRA.assign(load=20) if kind == "router" else SPECTRA
    with sklearn.config_context(enable_metadata_routing=True):
        assert groups_options(wrap(chain), GROUPS).keys() == {"groups"}
        search = GridSearchCV(wrap(chain), {}, cv=GroupKFold(2), error_score="raise")
        found = unwrap(search.fit(X, STATES, groups=GROUPS).best_estimator_)
    np.testing.assert_array_equal(found[0]["bins"].known_lines_.limits, limits)
    np.testing.assert_array_equal(found[-1].typicality(found[:-1].transform(SPECTRA)), typicality)


def test_without_metadata_routing_each_step_takes_groups_by_its_name():
    _, limits, typicality = bins_and(CLASSIFIERS[0])
    chain = make_pipeline(BinTransformer(2, max_order=12), CLASSIFIERS[0])
    search = GridSearchCV(chain, {}, cv=GroupKFold(2), error_score="raise")
    search.fit(SPECTRA, STATES, groups=GROUPS, **groups_options(chain, GROUPS))
    found = search.best_estimator_
    np.testing.assert_array_equal(found[0].known_lines_.limits, limits)
    np.testing.assert_array_equal(found[-1].typicality(found[:-1].transform(SPECTRA)), typicality)


def test_a_search_stands_for_its_best_estimator_once_it_is_fitted():
    search = GridSearchCV(GaussianNB(), {"var_smoothing": [0.5]}, cv=2)
    assert search_estimator(search) is search.estimator
    assert search_estimator(search.fit(X, Y)).var_smoothing == 0.5
    random = RandomizedSearchCV(GaussianNB(), {"var_smoothing": [1]}, n_iter=1)
    assert search_estimator(random) is random.estimator
    assert search_estimator(LeastRiskClassifier(GaussianNB())).estimator is not None
    plain = GaussianNB()
    assert search_estimator(plain) is plain
