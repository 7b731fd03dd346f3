"""What deviates in a recording of an unknown state is stated by order, channel and decibels."""

import re

import numpy as np
import pandas as pd
import pytest
from order_models import log, order_bins
from sklearn.decomposition import PCA
from sklearn.pipeline import FeatureUnion, make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from emacm import (
    BinTransformer,
    ConditionRouter,
    CostSensitiveGaussianBayes,
    OrderPSD,
    OrderResampler,
    Recording,
    RecordingStatistics,
    explain_decision,
    explain_model,
)

FS, N, SPEED = 2_000, 9_000, 40.0
FIRST = {"vibration": (3.3, 1.0), "current": (7.6, 12.0)}  # order and amplitude of the own line


def run(seed, gain=None, lines=(), worn=False, noise=1.0, load=20, change=None):
    """Two channels with noise and a line each; lines are (channel, order, amplitude)."""
    rng = np.random.default_rng(seed)
    angle = SPEED * np.arange(N) / FS
    signals = {}
    for name, (order, size) in FIRST.items():
        level = size * (2.0 if worn and name == "vibration" else 1.0)
        own = level * (1 + 0.1 * rng.standard_normal()) * np.cos(order * angle)
        signals[name] = own + noise * 0.3 * size * rng.standard_normal(N)
    for name, order, size in lines:
        signals[name] = signals[name] + size * np.cos(order * angle)
    for name, factor in (gain or {}).items():
        signals[name] = factor * signals[name]
    if change:
        signals = change(signals)
    velocity = np.full(N, SPEED)
    return Recording(signals, FS, velocity=velocity, meta={"load": load, "unit": seed})


def classifier():
    return CostSensitiveGaussianBayes(
        covariance="tied", shrinkage="auto", unknown="unknown", temperature="groups"
    )


def levels(*steps):
    return order_bins(log(), *steps, classifier())


def fitted(model=None, **options):
    X = [run(seed, worn=seed % 2 == 1, **options) for seed in range(24)]
    model = levels(StandardScaler()) if model is None else model
    units = np.arange(24) // 2
    return model.fit(X, ["healthy", "worn"] * 12, costsensitivegaussianbayes__groups=units), X


@pytest.fixture(scope="module")
def model():
    return fitted()[0]


ABOVE = "dB above the training maximum"


def explained(model, recording):
    return explain_decision(model, recording, decision="unknown", against="healthy")


def statements(model, recording):
    return explained(model, recording).attrs["statements"]


def low_pass(signals):
    spectrum = np.fft.rfft(signals["vibration"])
    spectrum[np.fft.rfftfreq(N, 1 / FS) > 8.5 * SPEED / (2 * np.pi)] *= 0.2
    return signals | {"vibration": np.fft.irfft(spectrum, N)}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"gain": dict.fromkeys(FIRST, 1000)}, "orders 0 to 12 of .* up to 60 dB above the"),
        ({"gain": dict.fromkeys(FIRST, 0.2)}, "orders 0 to 12 of .* up to 1[45] dB below"),
        ({"gain": {"current": 3.0}}, "orders 0 to 12 of 'current' up to 9.* dB above the"),
        ({"noise": 2.0}, "^orders 0 to 7 of 'current' up to 5.9 dB above the training"),
        ({"change": low_pass}, "^orders 9 to 12 of 'vibration' up to 1.* dB below the"),
    ],
)
def test_what_is_wrong_with_the_measurement_is_stated_first(model, options, words):
    assert re.search(words, statements(model, run(50, **options))[0])


def test_a_line_is_stated_with_its_bin_and_its_level_above_the_training_maximum(model):
    recording = run(50, lines=[("vibration", 9.4, 0.8)])
    table = explained(model, recording)
    (words,) = table.attrs["statements"]
    assert table["column"][0] == "vibration@9-10"
    value, baseline = (table.attrs[name] for name in ("value", "baseline_value"))
    assert table["contribution"].sum() == pytest.approx(value - baseline)
    X = [run(seed, worn=seed % 2 == 1) for seed in range(24)]
    is_line = model[2].get_feature_names_out() == "vibration@9-10"
    bins = model[:3].transform([*X, recording])[:, is_line]
    expected = 10 * np.log10(bins[-1, 0] / bins[:-1, 0].max())
    assert words == f"orders 9 to 10 of 'vibration' {expected:.2g} dB above the training maximum"


def test_where_no_bin_is_outside_the_training_the_largest_contributions_are_named(model):
    (words,) = statements(model, run(0))
    assert words.startswith("no column is far outside the training; together they are, above all ")
    assert words.count("@") == 3


def test_deviations_are_exact_in_decibels_with_and_without_logarithm_and_scaling(model):
    recording = run(50, gain={"vibration": 2.0, "current": 2.0})
    plain = fitted(order_bins(classifier()))[0]
    tables = [explained(m, recording).set_index("column") for m in (model, plain)]
    for own, table in zip((model, plain), tables, strict=True):
        assert (table["unit"] == "dB").all()
        X = [run(seed, worn=seed % 2 == 1) for seed in range(24)]
        powers = own[:3].transform([*X, recording])
        names = own[2].get_feature_names_out()
        highest = pd.Series(10 * np.log10(powers[-1] / powers[:-1].max(axis=0)), names)
        found = table["outside_training"]
        above = highest[highest > 0].index
        assert len(above) > 15
        np.testing.assert_allclose(found[above], highest[above], rtol=1e-9)
    # From the mean of the class: the geometric one with a logarithm, the arithmetic one without.
    geometric, arithmetic = (table["deviation"].sort_index() for table in tables)
    assert (geometric > arithmetic).all()


def test_after_a_projection_the_training_recordings_tell_what_deviates():
    model, X = fitted(levels(StandardScaler(), PCA(6)))
    gained = run(50, gain=dict.fromkeys(FIRST, 30))
    table = explained(model, gained)
    assert table["outside_training"].isna().all()
    assert "give training recordings as background" in table.attrs["statements"][0]
    options = {"decision": "unknown", "against": "healthy", "background": X}
    table = explain_decision(model, gained, **options)
    for statement in table.attrs["statements"]:
        assert re.fullmatch(f"orders 0 to 12 of '.*' up to 29 {ABOVE}", statement)
    assert table["deviation"].median() == pytest.approx(29.5, abs=1)


def test_columns_that_are_no_powers_deviate_by_standard_deviations():
    natural = FunctionTransformer(np.log, feature_names_out="one-to-one")
    union = FeatureUnion(
        [
            ("bins", make_pipeline(OrderPSD(4), BinTransformer(max_order=12), natural)),
            ("levels", RecordingStatistics(("mean", "std"), by_direction=False)),
            ("not used", "drop"),
        ],
        verbose_feature_names_out=False,
    )
    model, X = fitted(
        make_pipeline(OrderResampler(2 * np.pi / 32), union, StandardScaler(), classifier())
    )
    offset = run(50, change=lambda s: s | {"current": s["current"] + 25.0})
    table = explained(model, offset).set_index("column")
    assert table.loc["vibration@3-4", "unit"] == "dB"
    assert table.loc["current:mean", "unit"] == "standard deviations"
    means = model[:2].transform(X)[:, list(model[1].get_feature_names_out()).index("current:mean")]
    spread = np.std(
        means - np.repeat([[means[::2].mean(), means[1::2].mean()]], 12, 0).ravel(), ddof=2
    )
    assert table.loc["current:mean", "deviation"] == pytest.approx(25 / spread, rel=0.2)
    (words, *_) = table.attrs["statements"]
    assert words.startswith("'current:mean' ")
    assert words.endswith(" standard deviations above the training maximum")


def test_behind_a_router_the_pipeline_of_the_condition_is_explained():
    X = [
        run(k, worn=k % 2 == 1, load=20 + 20 * (k > 23), gain=None if k < 24 else {"current": 10})
        for k in range(48)
    ]
    y = ["healthy", "worn"] * 24
    router = ConditionRouter(levels(StandardScaler()), "load")
    router.fit(X, y, costsensitivegaussianbayes__groups=np.arange(48) // 2)
    # At the other load this level would be usual.
    at_20 = run(90, load=20, gain={"current": 10})
    (words,) = explained(router, at_20).attrs["statements"]
    size = re.fullmatch(f"orders 0 to 12 of 'current' up to (.*) {ABOVE}", words)[1]
    assert float(size) == pytest.approx(20, abs=1)
    own = router.estimators_[20]
    pd.testing.assert_frame_equal(explained(router, at_20), explained(own, at_20))
    table = explain_decision(router, run(91, load=40, worn=True, gain={"current": 10}))
    assert table.attrs["decision"] == "worn"


def test_a_router_of_tables_is_explained_without_the_column_of_the_condition():
    rng = np.random.default_rng(4)
    names = ["load", "torque@0-1", "torque@1-2"]
    X = pd.DataFrame(rng.normal(size=(40, 3)) + 4, columns=names)
    X["load"] = np.repeat([20, 40], 20)
    y = np.tile(["new", "worn"], 20)
    X.loc[y == "worn", "torque@1-2"] += 4
    router = ConditionRouter(classifier(), "load")
    router.fit(X, y, groups=np.arange(40) // 4)
    table = explain_decision(router, X.iloc[[3]])
    assert table["column"].tolist() == ["torque@1-2", "torque@0-1"]
    router.set_params(estimator__cost={("new", "worn"): 1e9, ("unknown", "new"): 5})
    assert explain_decision(router, X.iloc[[2]]).attrs["decision"] == "worn"  # the present cost
    with pytest.raises(ValueError, match=r"several conditions, .* one condition at a time"):
        explain_model(router, X, y)
