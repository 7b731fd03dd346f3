"""Facts about bad input of decisions: what was expected, what came, where, what to do."""

import numpy as np
import pandas as pd
import pytest
from anything import ANYTHING, FUZZ, NUMBERS, VALUES, survive
from bad_input import Case, T, V, check_refused, classifier, each, features, run
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse
from sklearn.model_selection import cross_validate
from sklearn.pipeline import make_pipeline

from emacm import (
    CostSensitiveGaussianBayes,
    OrderPSD,
    OrderResampler,
    expected_cost,
    neg_expected_cost,
)


def masked_features():
    return np.ma.masked_greater(features()[0], 1.5)


CASES = [
    Case(
        "an unknown class in costs",
        lambda: classifier(cost={("healthy", "broken"): 3}),
        V,
        "cost",
        "'broken'",
        "unknown",
        "['healthy', 'worn']",
    ),
    Case(
        "an unknown class in a table",
        lambda: classifier(cost=pd.DataFrame(np.eye(2), ["a", "b"], ["healthy", "broken"])),
        V,
        "'broken'",
        "unknown",
    ),
    Case(
        "a cost that is not square",
        lambda: classifier(cost=np.ones((3, 2))),
        V,
        "cost",
        "square",
        "(2, 2)",
        "(3, 2)",
        "DataFrame",
    ),
    Case(
        "a cost with a nan",
        lambda: classifier(cost=[[0, np.nan], [1, 0]]),
        V,
        "'healthy' when 'worn'",
        "deciding 'healthy' when 'worn' is true",
        "nan",
    ),
    Case(
        "text for a cost",
        lambda: classifier(cost=[["a", "b"], ["c", "d"]]),
        T,
        "'healthy' when 'healthy'",
        "number",
        "'a'",
    ),
    Case(
        "priors that do not add up",
        lambda: classifier(priors=[0.5, 0.4]),
        V,
        "priors",
        "add up to 1",
        "0.9",
    ),
    Case(
        "priors of an unknown class",
        lambda: classifier(priors={"healthy": 0.5, "x": 0.5}),
        V,
        "priors",
        "['x']",
        "['worn']",
    ),
    Case(
        "a negative prior",
        lambda: classifier(priors=[1.5, -0.5]),
        V,
        "prior of class 'worn'",
        "at least 0",
        "-0.5",
    ),
    Case(
        "an unknown covariance",
        lambda: classifier(covariance="round"),
        V,
        "covariance",
        "'full', 'tied', 'diag'",
        "'round'",
    ),
    Case(
        "shrinkage above one", lambda: classifier(shrinkage=2), V, "shrinkage", "at most 1", "got 2"
    ),
    Case(
        "unknown shrinkage",
        lambda: classifier(shrinkage="best"),
        V,
        "shrinkage",
        "'oas', 'auto'",
        "'best'",
    ),
    Case(
        "singular classes with a number",
        lambda: CostSensitiveGaussianBayes(shrinkage=0).fit(
            features()[0][:, [0, 0]], features()[1]
        ),
        V,
        "'healthy', 'worn'",
        "singular",
        "shrinkage=0",
        "oas",
    ),
    Case(
        "y of wrong length",
        lambda: CostSensitiveGaussianBayes().fit(features()[0], ["healthy"] * 3),
        V,
        "inconsistent numbers of samples",
        "[20, 3]",
    ),
    Case(
        "labels of wrong length for the pipeline",
        lambda: cross_validate(
            make_pipeline(OrderResampler(), OrderPSD(1), CostSensitiveGaussianBayes()),
            [run(0), run(1)],
            ["healthy"],
        ),
        V,
        "inconsistent numbers of samples",
        "[2, 1]",
    ),
    Case(
        "masked features",
        lambda: CostSensitiveGaussianBayes().fit(masked_features(), features()[1]),
        T,
        "X has masked samples",
    ),
    Case(
        "masked features in partial_fit",
        lambda: CostSensitiveGaussianBayes().partial_fit(masked_features(), features()[1], "hw"),
        T,
        "X has masked samples",
    ),
    Case(
        "masked features after fit",
        lambda: classifier().predict(masked_features()),
        T,
        "X has masked samples",
    ),
    Case(
        "a column of times",
        lambda: CostSensitiveGaussianBayes().fit(
            pd.DataFrame(features()[0]).assign(age=pd.to_timedelta(range(20), unit="h")),
            features()[1],
        ),
        T,
        "X must be numeric",
        "timedelta64",
        "column 'age'",
        "total_seconds",
    ),
    Case(
        "two columns of one name",
        lambda: CostSensitiveGaussianBayes().fit(
            pd.DataFrame(features()[0], columns=["a", "b", "a"]), features()[1]
        ),
        V,
        "X has columns of the same name: ['a']",
    ),
    *[
        Case(
            f"an unknown state called {label!r}",
            lambda label=label: classifier(unknown=label),
            T,
            "unknown must be a label",
            repr(label),
        )
        for label in (np.nan, ["new"])
    ],
    Case(
        "a gradient before fit",
        lambda: CostSensitiveGaussianBayes().log_density_gradient(features()[0]),
        V,
        "not fitted",
    ),
    Case(
        "sparse features",
        lambda: CostSensitiveGaussianBayes().fit(sparse.csr_array(features()[0]), features()[1]),
        T,
        "dense",
    ),
    Case(
        "decisions before fit",
        lambda: CostSensitiveGaussianBayes().predict(np.ones((2, 3))),
        V,
        "not fitted",
    ),
    Case(
        "a cost of other labels",
        lambda: expected_cost(["a"], ["b"], cost=pd.DataFrame(np.ones((1, 1)), ["a"], ["a"])),
        V,
        "y_pred",
        "'b'",
        "position 0",
        "['a']",
    ),
    Case(
        "labels of unequal number",
        lambda: expected_cost(["a", "b"], ["a"]),
        V,
        "equally long",
        "2 and 1",
    ),
    Case("no labels", lambda: expected_cost([], []), V, "at least one label"),
    Case(
        "a score without a cost",
        lambda: neg_expected_cost(object(), [], []),
        T,
        "cost_",
        "make_scorer",
    ),
]


@each(CASES)
def test_bad_input_is_refused_with_what_where_and_what_to_do(case):
    check_refused(case)


@pytest.mark.slow
@FUZZ
@given(st.sampled_from(sorted(CostSensitiveGaussianBayes().get_params())), VALUES)
def test_any_option_of_the_classifier_is_taken_or_refused(name, value):
    result = survive(lambda: classifier(**{name: value}).risk(features(1)[0]))
    assert not np.isnan(result).any()


@pytest.mark.slow
@FUZZ
@given(
    st.dictionaries(
        st.tuples(*[st.sampled_from(["healthy", "worn", "inspect", 0, None])] * 2),
        NUMBERS,
        max_size=4,
    )
)
def test_any_mapping_of_costs_is_taken_or_refused(cost):
    result = survive(lambda: classifier(cost=cost).risk(features(1)[0]))
    assert not np.isnan(result).any()


@pytest.mark.slow
@FUZZ
@given(st.lists(NUMBERS, max_size=4), st.lists(NUMBERS, max_size=4))
def test_any_numbers_for_priors_and_costs_are_taken_or_refused(priors, cost):
    result = survive(lambda: classifier(priors=priors).risk(features(1)[0]))
    assert not np.isnan(result).any()
    square = [cost[:2], cost[2:]]
    result = survive(lambda: classifier(cost=square).risk(features(1)[0]))
    assert not np.isnan(result).any()


@pytest.mark.slow
@FUZZ
@given(ANYTHING, ANYTHING, ANYTHING)
def test_the_cost_of_any_decisions_is_a_number_or_refused(truth, decision, cost):
    assert not np.isnan(survive(lambda: expected_cost(truth, decision, cost=cost))).any()


def test_weights_that_sum_to_less_than_one_are_refused_though_a_feature_is_constant():
    X = np.array([[3.0, 1.0], [3.0, 2.0], [5.0, 7.0], [6.0, 9.0]])
    model = CostSensitiveGaussianBayes(shrinkage=0.5, covariance="diag")
    with pytest.raises(ValueError, match=r"total weight of \[0\.8.*Multiply the weights"):
        model.fit(X, ["a", "a", "b", "b"], sample_weight=[0.4, 0.4, 2, 3])
