"""Facts about the last step of pipelines and searches."""

import numpy as np
import pytest
from sklearn.model_selection import GridSearchCV, RandomizedSearchCV
from sklearn.naive_bayes import GaussianNB
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    LeastRiskClassifier,
    NewUnitClassifier,
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


def test_groups_are_passed_to_all_steps_that_leave_them_out():
    classifier = CostSensitiveGaussianBayes(temperature="groups")
    bins = make_pipeline(BinTransformer(), StandardScaler())
    both = {"pipeline__bintransformer", "costsensitivegaussianbayes"}
    inside = LeastRiskClassifier(make_pipeline(bins, GaussianNB()))
    for model, names in (
        (classifier, {"groups"}),
        (CostSensitiveGaussianBayes(), set()),
        (make_pipeline(bins, classifier), both),
        (GridSearchCV(make_pipeline(bins, GaussianNB()), {}), {"pipeline__bintransformer"}),
        (inside, {"pipeline__bintransformer"}),
    ):
        found = groups_options(model, ["a", "b"])
        assert {name.removesuffix("__groups") for name in found} == names
        assert all(groups == ["a", "b"] for groups in found.values())
        assert groups_options(model, None) == {}


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
def test_groups_reach_a_classifier_that_leaves_them_out_under_the_name_of_its_step(options, needed):
    model = CostSensitiveGaussianBayes(**options)
    nested = make_pipeline(make_pipeline(StandardScaler(), model))
    search = GridSearchCV(in_pipeline(model), {})
    names = "groups", "costsensitivegaussianbayes__groups"
    expected = [names[0], names[1], f"pipeline__{names[1]}", names[1]]
    for each, name in zip((model, in_pipeline(model), nested, search), expected, strict=True):
        assert groups_options(each, ["a", "b"]) == ({name: ["a", "b"]} if needed else {})
    assert not any(groups_are_units(each) for each in (model, nested, search))


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


def test_a_search_stands_for_its_best_estimator_once_it_is_fitted():
    search = GridSearchCV(GaussianNB(), {"var_smoothing": [0.5]}, cv=2)
    assert search_estimator(search) is search.estimator
    assert search_estimator(search.fit(X, Y)).var_smoothing == 0.5
    random = RandomizedSearchCV(KNeighborsClassifier(), {"n_neighbors": [1]}, n_iter=1)
    assert search_estimator(random) is random.estimator
    assert search_estimator(LeastRiskClassifier(GaussianNB())).estimator is not None
    plain = GaussianNB()
    assert search_estimator(plain) is plain
