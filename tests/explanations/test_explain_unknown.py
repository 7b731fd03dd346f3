"""Facts about explanations of decisions with an unknown state."""

import numpy as np
import pandas as pd
import pytest

from emacm import CostSensitiveGaussianBayes, explain_decision

COLUMNS = ["torque@0-1", "torque@1-2", "sound@0-1", "sound@1-2"]


@pytest.fixture(scope="module")
def model():
    rng = np.random.default_rng(0)
    codes, units = np.tile([0, 0, 1, 1], 8), np.repeat(np.arange(8), 4)
    X = pd.DataFrame(rng.normal(size=(32, 4)), columns=COLUMNS)
    X.iloc[:, 0] += 5.0 * codes
    classifier = CostSensitiveGaussianBayes(
        {("inspect", "worn"): 0.2, ("inspect", "new"): 0.2},
        covariance="tied",
        shrinkage="auto",
        unknown="unknown",
    )
    return classifier.fit(X, np.array(["worn", "new"])[codes], groups=units)


def recording(**values):
    row = pd.DataFrame([[0.1, -0.2, 0.3, 0.1]], columns=COLUMNS)
    for name, value in values.items():
        row[name] = value
    return row


def test_the_deviating_bin_explains_the_unknown_state(model):
    table = explain_decision(model, recording(**{"sound@1-2": 40.0}))
    assert table.attrs["decision"] == "unknown"
    assert table["column"][0] == "sound@1-2"
    assert table["share"][0] > 0.9
    assert table.attrs["baseline"] == "worn"
    assert "distance from 'worn'" in table.attrs["quantity"]


def test_contributions_add_up_to_the_squared_distance(model):
    table = explain_decision(model, recording(**{"torque@1-2": -30.0, "sound@0-1": 9.0}))
    value, baseline = (table.attrs[name] for name in ("value", "baseline_value"))
    assert table["contribution"].sum() == pytest.approx(value - baseline)
    assert value > 100
