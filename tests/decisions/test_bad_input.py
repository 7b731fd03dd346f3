"""Facts about bad input of decisions: what was expected, what came, where, what to do."""

import numpy as np
import pandas as pd
from bad_input import Case, T, V, check_refused, each, features

from emacm import CostSensitiveGaussianBayes


def masked_features():
    return np.ma.masked_greater(features()[0], 1.5)


CASES = [
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
            lambda label=label: CostSensitiveGaussianBayes(unknown=label).fit(*features()),
            T,
            "unknown must be a label",
            repr(label),
        )
        for label in (np.nan, ["new"])
    ],
]


@each(CASES)
def test_bad_input_is_refused_with_what_where_and_what_to_do(case):
    check_refused(case)
