"""Facts about the last step of pipelines and searches."""

import numpy as np
import pytest
from sklearn.model_selection import GridSearchCV
from sklearn.naive_bayes import GaussianNB
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from emacm.decisions.pipelines import before_the_last_step, final_estimator, weight_parameter

X = np.array([[0.0, 3.0], [2.0, 1.0], [5.0, 4.0], [9.0, 8.0]])
Y = np.array(["new", "new", "worn", "worn"])


@pytest.mark.parametrize(
    "nested",
    [
        make_pipeline(GaussianNB()),
        make_pipeline(make_pipeline(GaussianNB())),
        GridSearchCV(make_pipeline(GaussianNB()), {}, cv=2),
    ],
)
def test_without_other_steps_the_input_is_unchanged(nested):
    final, table = before_the_last_step(nested.fit(X, Y), X)
    assert isinstance(final, GaussianNB)
    np.testing.assert_array_equal(table, X)


def test_the_input_of_the_last_step_is_transformed_by_all_others():
    inner = make_pipeline(StandardScaler(with_mean=False), GaussianNB())
    model = GridSearchCV(make_pipeline(StandardScaler(with_std=False), inner), {}, cv=2).fit(X, Y)
    final, table = before_the_last_step(model, X)
    np.testing.assert_allclose(table, (X - X.mean(axis=0)) / X.std(axis=0))
    assert final is final_estimator(model)
    np.testing.assert_array_equal(final.predict(table), model.predict(X))


def test_the_last_step_of_an_unfitted_search_is_that_of_its_estimator():
    inner = GaussianNB(var_smoothing=0.5)
    search = GridSearchCV(make_pipeline(StandardScaler(), inner), {"gaussiannb__priors": [None]})
    assert final_estimator(search) is inner


def test_the_name_of_weights_contains_all_steps():
    nested = make_pipeline(StandardScaler(), make_pipeline(GaussianNB()))
    assert weight_parameter(nested) == "pipeline__gaussiannb__sample_weight"
    assert weight_parameter(GaussianNB()) == "sample_weight"
    with pytest.raises(TypeError, match="KNeighborsClassifier accepts no sample_weight"):
        weight_parameter(make_pipeline(StandardScaler(), KNeighborsClassifier()))
