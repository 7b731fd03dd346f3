"""Facts about bad input of decisions: what was expected, what came, where, what to do."""

import numpy as np
import pandas as pd
import pytest
from bad_input import Case, T, V, check_refused, classifier, each, features, run
from scipy import sparse
from sklearn.model_selection import cross_validate
from sklearn.pipeline import make_pipeline

from emacm import (
    CostSensitiveGaussianBayes,
    OrderPSD,
    OrderResampler,
    expected_cost,
)


def masked_features():
    return np.ma.masked_greater(features()[0], 1.5)


CASES = [
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
]


@each(CASES)
def test_bad_input_is_refused_with_what_where_and_what_to_do(case):
    check_refused(case)


def test_weights_that_sum_to_less_than_one_are_refused_though_a_feature_is_constant():
    X = np.array([[3.0, 1.0], [3.0, 2.0], [5.0, 7.0], [6.0, 9.0]])
    model = CostSensitiveGaussianBayes(shrinkage=0.5, covariance="diag")
    with pytest.raises(ValueError, match=r"total weight of \[0\.8.*Multiply the weights"):
        model.fit(X, ["a", "a", "b", "b"], sample_weight=[0.4, 0.4, 2, 3])
