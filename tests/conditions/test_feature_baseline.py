"""Facts about features relative to healthy recordings of the same condition."""

import numpy as np
import pandas as pd
import polars as pl
import pytest
from sklearn.base import BaseEstimator
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from strokes_under_load import THETA_S

from emacm import (
    BinTransformer,
    FeatureBaseline,
    OrderPSD,
    OrderResampler,
    Recording,
    RecordingStatistics,
    outside_training,
)
from emacm.orders.columns import OrderTable


class Levels(BaseEstimator):
    """Mean square and mean size, as a DataFrame or an array."""

    def __init__(self, frame=True):
        self.frame = frame

    def fit(self, X, y=None):
        self.fitted_ = True
        return self

    def fit_transform(self, X, y=None):
        return self.fit(X).transform(X)

    def transform(self, X):
        signals = [recording.signals["current"] for recording in X]
        table = np.array([[np.mean(s**2), np.mean(np.abs(s))] for s in signals])
        return pd.DataFrame(table, columns=["power", "size"]) if self.frame else table

    def get_feature_names_out(self, input_features=None):
        return np.array(["power", "size"], dtype=object)


def constant(load, extra=0.0, seed=None):
    """A recording whose level is a straight line over the load."""
    noise = 0.0 if seed is None else 0.01 * np.random.default_rng(seed).standard_normal()
    level = 2 + load / 20 + extra + noise
    return Recording({"current": [level] * 3}, 1, velocity=[1.0] * 3, meta={"load": load})


def test_the_axis_of_order_tables_survives(loaded_fleet):
    X, y = loaded_fleet
    inner = make_pipeline(OrderResampler(THETA_S, min_speed=2.0), OrderPSD(4))
    table = FeatureBaseline(inner).fit_transform(X, y)
    assert isinstance(table, OrderTable)
    assert table.columns[:2] == ("current@0", "current@0.25")
    psd = inner.fit_transform(X)
    loads = np.array([recording.meta["load"] for recording in X])
    healthy = np.asarray(psd)[(y == "healthy") & (loads == 40)].mean(axis=0)
    np.testing.assert_allclose(table[loads == 40], np.asarray(psd)[loads == 40] - healthy)


def bins():
    return make_pipeline(
        OrderResampler(THETA_S, min_speed=2.0), OrderPSD(4), BinTransformer(1, max_order=8)
    )


def test_frames_keep_names_and_index(loaded_fleet):
    X, y = loaded_fleet
    model = FeatureBaseline(bins()).set_output(transform="pandas").fit(X, y)
    frame = model.transform(X)
    assert frame.columns.tolist() == model.get_feature_names_out().tolist()
    assert frame.columns[0] == "current@0-1"
    bare = FeatureBaseline(bins()).fit(X, y).transform(X)
    np.testing.assert_allclose(frame, bare)
    polars = FeatureBaseline(bins()).set_output(transform="polars").fit_transform(X, y)
    assert isinstance(polars, pl.DataFrame)
    np.testing.assert_allclose(polars.to_numpy(), bare)


def test_commissioning_serves_features_too():
    further = [constant(60), constant(60, extra=0.2)]
    model = FeatureBaseline(Levels(), baseline_recordings=further).fit([constant(20)], ["healthy"])
    left = model.transform([constant(60, extra=0.1)])
    assert left["size"][0] == pytest.approx(0)


def test_a_transformer_must_make_a_finite_table():
    one_dimensional = FunctionTransformer(lambda X: [1.0 for _ in X])
    with pytest.raises(ValueError, match=r"must compute a table, got shape \(1,\)"):
        FeatureBaseline(one_dimensional).fit([constant(20)], ["healthy"])
    not_finite = FunctionTransformer(lambda X: [[np.nan] for _ in X])
    with pytest.raises(ValueError, match="X must be finite, got NaN in recording 0"):
        FeatureBaseline(not_finite).fit([constant(20)], ["healthy"])


def test_each_condition_has_its_own_mean():
    runs = [constant(40, extra=0.3), constant(20), constant(40, extra=0.5), constant(20, extra=1)]
    model = FeatureBaseline(Levels(frame=False)).fit(runs, ["healthy"] * 3 + ["worn"])
    assert model.conditions_ == (20, 40)
    assert model.means_[20][1] == pytest.approx(3)
    assert model.means_[40][1] == pytest.approx(4.4)
    assert model.transform(runs)[3, 1] == pytest.approx(1)


def test_a_baseline_of_another_sampling_rate_is_refused():
    def run(fs, **meta):
        signal = np.random.default_rng(0).standard_normal(400)
        return Recording({"casing": signal}, fs, velocity=np.full(400, 9.0), meta=meta)

    slow = [run(12_000, load=1), run(12_000, load=1)]
    baseline = FeatureBaseline(
        RecordingStatistics(("rms",), by_direction=False),
        baseline_recordings=[run(48_000, load=1)],
        healthy=(),
    )
    match = r"recording 0 \(load=1\): channel 'casing' is sampled at 12000 Hz, .* at 48000 Hz"
    with pytest.raises(ValueError, match=match):
        baseline.fit(slow, ["healthy"] * 2)
    further = [*slow[1:], run(12_000, load=3)]
    fitted = baseline.set_params(baseline_recordings=further).fit(slow, ["healthy"] * 2)
    with pytest.raises(ValueError, match=r"recording 1 .* is sampled at 9000 Hz"):
        fitted.transform([slow[0], run(9_000, load=1)])
    mixed = baseline.set_params(healthy="healthy")  # beside others in X
    with pytest.raises(ValueError, match=r"baseline_recordings: recording 0 .* at 48000 Hz, but"):
        mixed.set_params(baseline_recordings=[run(48_000, load=1)]).fit(slow, ["healthy"] * 2)


def test_a_unit_of_which_healthy_recordings_were_added_is_no_longer_stated_as_new():
    rng = np.random.default_rng(0)
    A, B = (
        Recording({"a": size * rng.normal(size=3000)}, 1000, velocity=90.0, meta={"unit": unit})
        for unit, size in (("A", 1.0), ("B", 9.0))
    )
    inner = make_pipeline(OrderResampler(THETA_S), OrderPSD(4), FunctionTransformer(np.log))
    baseline = FeatureBaseline(inner, condition="unit").fit([A, A], ["healthy"] * 2)
    assert {"new unit", "level"} <= {each.kind for each in outside_training(baseline, [B])[0]}
    assert outside_training(baseline.add_healthy([B]), [B]) == [[]]


def test_a_shift_far_larger_than_the_scatter_warns():
    runs = [constant(load, seed=i) for i, load in enumerate([20, 40] * 5)]
    others = [constant(load, extra=0.7, seed=50 + i) for i, load in enumerate([20, 40] * 3)]
    baseline = FeatureBaseline(Levels(), healthy=(), baseline_recordings=others[:2])
    match = r"features of its 5 recordings differ from the healthy means by \d+(\.\d)? times"
    with pytest.warns(UserWarning, match=match) as caught:
        baseline.fit(runs, ["worn"] * 10)
    assert [str(each.message)[:12] for each in caught] == ["condition 20", "condition 40"]
    baseline.set_params(baseline_recordings=runs[:2]).fit(runs, ["worn"] * 10)  # alike: no warning
