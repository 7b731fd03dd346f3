"""Lines of a second fault are in the table of `score`, in the explanation and on the page."""

import numpy as np
import pytest
from order_models import log, order_bins
from sklearn.preprocessing import StandardScaler

from emacm import CostSensitiveGaussianBayes, Recording, explain_decision, maintenance_report, score

ORDERS = {"ring": 6.3, "screw": 9.4}


def run(seed, *faults):
    rng, angle = np.random.default_rng(seed), 40.0 * np.arange(9000) / 2000
    signal = rng.uniform(0.9, 1.1) * rng.standard_normal(9000) + 2 * np.cos(3.3 * angle)
    for fault in faults:
        signal += rng.uniform(0.7, 1.0) * np.cos(ORDERS[fault] * angle)
    return Recording({"vibration": signal}, 2000, velocity=40.0)


@pytest.fixture(scope="module")
def model():
    faults = [(), ("ring",), ("screw",)] * 8
    runs = [run(seed, *own) for seed, own in enumerate(faults)]
    states = ["".join(own) or "healthy" for own in faults]
    bayes = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto")
    groups = {"costsensitivegaussianbayes__groups": np.arange(24)}
    return order_bins(log(), StandardScaler(), bayes).fit(runs, states, **groups)


def test_score_names_the_line_that_the_decided_fault_does_not_explain(model):
    table = score(model, [run(100, "ring", "screw"), run(101, "ring"), run(102)])
    other = "screw" if table["decision"][0] == "ring" else "ring"
    stated = table["outside_training"]
    low = int(ORDERS[other])
    assert f"{other!r}: orders {low} to {low + 1} of 'vibration'" in stated[0]
    assert stated[1:].tolist() == ["", ""]


def test_explanation_and_page_name_it_as_well(model, tmp_path):
    recording = run(100, "ring", "screw")
    (statement,) = explain_decision(model, recording).attrs["statements"]
    assert score(model, [recording])["outside_training"][0] == statement
    assert "statements" not in explain_decision(model, run(101, "ring")).attrs
    maintenance_report(model, [recording], tmp_path, healthy="healthy")
    (page,) = [file.read_text() for file in tmp_path.glob("**/*.html") if "index" not in file.name]
    assert "does not explain, as of" in page
    assert "dB higher" in page
