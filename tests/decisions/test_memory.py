"""Facts about memory: tables of any length are decided on in blocks."""

import numpy as np
import pytest
from peak_memory import peak_bytes

from emacm import CostSensitiveGaussianBayes

X = np.random.default_rng(0).normal(size=(60_000, 30))
Y = np.arange(600) % 5
RUNS = np.arange(600) // 20


@pytest.mark.slow
@pytest.mark.parametrize(
    "options", [{"unknown": "?"}, {"covariance": "tied"}, {"covariance": "diag"}]
)
@pytest.mark.parametrize("method", ["predict", "predict_proba", "risk"])
def test_decisions_need_less_memory_than_the_features_they_are_made_of(method, options):
    model = CostSensitiveGaussianBayes(**options).fit(X[:600], Y, groups=RUNS)
    decide = getattr(model, method)
    decide(X[:9])
    # Measured: up to three and a half tables of one number for each recording and state.
    assert peak_bytes(decide, X) < 4.5 * 8 * len(X) * 5 < X.nbytes


@pytest.mark.slow
def test_typicality_needs_a_fraction_of_the_memory_of_the_features():
    model = CostSensitiveGaussianBayes().fit(X[:600], Y, groups=RUNS)
    model.typicality(X[:9])
    # Measured: 0.08 of it.
    assert peak_bytes(model.typicality, X) < 0.1 * X.nbytes


def test_rows_of_a_large_table_are_decided_on_as_alone():
    model = CostSensitiveGaussianBayes().fit(X[:600] + np.outer(Y, np.ones(30)), Y)
    whole = model.predict_log_proba(X[:9001])
    for row in (0, 4095, 4096, 9000):
        np.testing.assert_allclose(model.predict_log_proba(X[[row]])[0], whole[row], rtol=1e-9)
