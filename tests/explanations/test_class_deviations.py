"""Facts about deviations of a recording from a class, in dB."""

import numpy as np
import pandas as pd
import pytest
from sklearn.decomposition import PCA
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    FaultLines,
    OrderPSD,
    OrderResampler,
    Recording,
    explain_decision,
)
from emacm.explanations.deviations import class_deviations

N, FS, SPEED = 6000, 1100, 70.0  # 60.8 revolutions
LINE = 4.55
STATES = np.array(["healthy", "outer", "inner"] * 8)


def recording(state, seed, gain=1.0, order=LINE):
    rng = np.random.default_rng(seed)
    angle = SPEED * np.arange(N) / FS
    amplitude = {"healthy": 0.1, "outer": 1.0, "inner": 3.0}[state] * (1 + 0.05 * rng.normal())
    wave = amplitude * np.sin(order * angle)
    channels = {"sound": rng.normal(size=N), "gear": 0.3 * rng.normal(size=N) + wave}
    return Recording({n: gain * v for n, v in channels.items()}, FS, velocity=SPEED)


RUNS = [recording(state, seed) for seed, state in enumerate(STATES)]
NEW = recording("outer", 99)


def pipeline(*between, line=None):
    spectra = (OrderResampler(2 * np.pi / 25), OrderPSD(12, max_order=9))
    line = BinTransformer(0.5, max_order=9) if line is None else line
    bayes = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto", unknown="unknown")
    return make_pipeline(*spectra, line, *between, bayes)


def fitted(model):
    return model.fit(RUNS, STATES, costsensitivegaussianbayes__groups=np.arange(24) // 3)


def decibels(power):
    return 10 * np.log10(power)


def with_floor(power):
    return np.log2(power + 1e-30)


def measured_level(runs):
    """Return the mean level of the bin of the line [dB], computed by the steps alone."""
    table = make_pipeline(*pipeline().named_steps.values())[:-1].fit_transform(runs)
    names = make_pipeline(*pipeline().named_steps.values())[:-1].fit(runs).get_feature_names_out()
    return decibels(np.asarray(table)[:, list(names).index("gear@4.5-5")]).mean()


@pytest.mark.parametrize(
    "between",
    [
        [FunctionTransformer(np.log)],
        [FunctionTransformer(np.log10), StandardScaler()],
        [FunctionTransformer(decibels), StandardScaler()],
        [FunctionTransformer(with_floor)],
        [FunctionTransformer(), FunctionTransformer(np.log)],
    ],
)
def test_a_logarithm_of_the_user_gives_decibels(between):
    model = fitted(pipeline(*between))
    table = class_deviations(model, NEW, "healthy").set_index("column")
    expected = measured_level([NEW]) - measured_level(RUNS[::3])
    assert table.loc["gear@4.5-5", "deviation"] == pytest.approx(expected, abs=1e-6)
    assert set(table["unit"]) == {"dB"}
    assert table["deviation"].idxmax() == "gear@4.5-5"
    line = table.loc["gear@4.5-5"]
    assert line["deviation"] > 2 * line["limit"]
    assert line["level"] - line["reference_level"] == pytest.approx(line["deviation"])


def test_the_limit_is_four_standard_deviations_and_at_least_3_decibels():
    model = fitted(pipeline(FunctionTransformer(np.log)))
    table = class_deviations(model, NEW, "healthy")
    column = table["column"].tolist().index("gear@4.5-5")
    spread = np.sqrt(np.diag(np.asarray(model[-1].covariances_))[column])
    assert table.loc[column, "limit"] == pytest.approx(max(4 * 10 / np.log(10) * spread, 3.0))
    assert table["limit"].min() >= 3
    assert np.isinf(table["limit"][table["deviation"].abs() < 1]).all()


def test_a_fault_that_another_fault_raises_more_is_raised():
    model = fitted(pipeline(FunctionTransformer(np.log)))
    assert model.predict([NEW]) == "outer"
    table = class_deviations(model, NEW, "healthy").set_index("column")
    assert table.loc["gear@4.5-5", "deviation"] > 10
    against = class_deviations(model, NEW, "inner").set_index("column")
    assert against.loc["gear@4.5-5", "deviation"] < -5


@pytest.mark.parametrize("between", [[], [StandardScaler()]])
def test_levels_of_fault_lines_are_decibels(between):
    lines = FaultLines({"outer race": LINE, "cage": 0.41}, harmonics=1)
    model = fitted(pipeline(*between, line=lines))
    table = class_deviations(model, NEW, "healthy").set_index("column")
    levels = pd.DataFrame(model[:3].transform([*RUNS[::3], NEW]), columns=table.index)
    expected = levels.iloc[-1] - levels.iloc[:-1].mean()
    np.testing.assert_allclose(table["deviation"], expected)
    assert set(table["unit"]) == {"dB"}
    assert table["deviation"].idxmax() == "gear@outer race"


def test_what_is_unknown_of_fault_lines_is_stated_by_the_name_of_the_fault():
    lines = FaultLines({"outer race": LINE, "cage": 0.41, "ball": 2.3}, harmonics=1)
    model = fitted(pipeline(line=lines))
    new = recording("inner", 7, order=2.3)
    assert model.predict([new]) == "unknown"
    statements = explain_decision(model, new).attrs["statements"]
    assert any("'gear@ball'" in text and "dB above" in text for text in statements)
    assert not any("nan" in text or "gain" in text for text in statements)


def test_projected_bins_need_recordings_of_the_class():
    model = fitted(pipeline(FunctionTransformer(np.log), PCA(5)))
    with pytest.raises(ValueError, match="give training recordings as background"):
        class_deviations(model, NEW, "healthy")
    table = class_deviations(model, NEW, "healthy", background=RUNS[::3]).set_index("column")
    expected = measured_level([NEW]) - measured_level(RUNS[::3])
    assert table.loc["gear@4.5-5", "deviation"] == pytest.approx(expected, abs=1e-6)
