"""Facts about OrderCrossSpectrum: pairs, names, bins, directions, and what is refused."""

import numpy as np
import pytest
from scipy import signal
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import FeatureUnion, make_pipeline
from sklearn.preprocessing import StandardScaler

from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    OrderCrossSpectrum,
    OrderPSD,
    OrderResampler,
    Recording,
)

TURN = 2 * np.pi
RESAMPLER = OrderResampler(TURN / 32, min_speed=1.0)


def drive(seed=0, gain=2.0, *, shift=0.0, dtype=float, seconds=20, other_rate=False, **meta):
    """A shaft goes to and fro; the current follows the torque three samples later."""
    rng = np.random.default_rng(seed)
    times = np.arange(500 * seconds) / 500
    velocity = TURN * 8 * np.sin(TURN * 0.1 * times)
    angle = np.cumsum(velocity) / 500 + shift
    torque = rng.standard_normal(len(times))
    current = gain * np.roll(torque, 3) + rng.standard_normal(len(times))
    error = np.sin(3 * angle) + rng.standard_normal(len(times))
    rates = {"torque": 500.0, "current": 500.0, "error": 500.0}
    if other_rate:
        error, rates["error"] = error[::2], 250.0
    signals = {"torque": torque, "current": current, "error": error}
    signals = {name: values.astype(dtype) for name, values in signals.items()}
    return Recording(signals, rates, angle=angle, shaft_fs=500, meta=meta)


@pytest.fixture(scope="module")
def over_angle():
    return RESAMPLER.fit_transform([drive(seed, unit=seed) for seed in range(3)])


def frame(estimator, X):
    return clone(estimator).set_output(transform="pandas").fit_transform(X)


# Agreement with SciPy


def test_of_one_stroke_it_is_what_scipy_says():
    run = Recording(
        dict(zip("xy", np.random.default_rng(0).standard_normal((2, 8000)), strict=True)),
        500,
        velocity=np.full(8000, 50.0),
    )
    (row,) = RESAMPLER.fit_transform([run])
    x, y = row.strokes[0].signals
    table = frame(OrderCrossSpectrum(4, kind=("cross", "coherence", "response")), [row]).iloc[0]
    orders, csd = signal.csd(x, y, 32, nperseg=128)
    response = csd / signal.welch(x, 32, nperseg=128)[1]
    shared = signal.coherence(x, y, 32, nperseg=128)[1]
    expected = np.concatenate([csd.real, csd.imag, shared, response.real, response.imag])
    np.testing.assert_allclose(table, expected, rtol=1e-9, atol=1e-12)
    quantities = ["cross.real", "cross.imag", "coherence", "response.real", "response.imag"]
    assert list(table.index) == [f"x*y:{what}@{k:g}" for what in quantities for k in orders]


def test_no_segment_spans_two_strokes(over_angle):
    row = over_angle[0]
    table = OrderCrossSpectrum(4, kind="cross", pairs=[("torque", "current")]).fit_transform([row])
    n_orders = table.shape[1] // 2
    sums, count = 0.0, 0
    for stroke in row.strokes:
        x, y = stroke.signals[:2]
        n_segments = (len(x) - 128) // 64 + 1
        sums = sums + n_segments * signal.csd(x, y, 32, nperseg=128)[1]
        count += n_segments
    assert len(row.strokes) > 2
    ours = table[0, :n_orders] + 1j * table[0, n_orders:]
    np.testing.assert_allclose(ours, sums / count, rtol=1e-9, atol=1e-15)


def test_channels_of_different_rates_share_one_angle_grid():
    (row,) = RESAMPLER.fit_transform([drive(other_rate=True)])
    stroke = row.strokes[0]
    joint = np.concatenate(list(stroke.blocks([2, 0])), axis=1)
    np.testing.assert_array_equal(joint, stroke.signals[[2, 0]])
    pairs = [("error", "torque"), ("torque", "current")]
    estimator = OrderCrossSpectrum(4, pairs=pairs, kind="cross", max_order=8)
    ours = estimator.fit_transform([row])
    same = RESAMPLER.fit_transform([drive()])
    # The error is sampled at half the rate: below a quarter of it, it is the same but for folding.
    names = list(estimator.get_feature_names_out())
    torque = [i for i, name in enumerate(names) if name.startswith("torque")]
    np.testing.assert_allclose(ours[0, torque], estimator.transform(same)[0, torque], rtol=1e-9)


# Physics


def test_the_response_is_that_of_the_drive(over_angle):
    estimator = OrderCrossSpectrum(4, pairs=[("torque", "current")], form="polar", bin_size=1)
    table = frame(estimator.set_params(max_order=8), over_angle)
    gain = table.filter(like="response.magnitude").to_numpy()
    assert gain.shape == (3, 8)
    np.testing.assert_allclose(gain[:, 1:].mean(axis=0), 2, rtol=0.07)


def test_the_phase_between_channels_is_blind_to_the_shaft_angle_at_the_start():
    estimator = OrderCrossSpectrum(4, form="polar", bin_size=1, max_order=8)
    here, there = (frame(estimator, RESAMPLER.fit_transform([drive(shift=a)])) for a in (0, 1))
    wave = [c for c in here if "*error" not in c]
    np.testing.assert_allclose(there[wave], here[wave], rtol=1e-7)


def test_a_delay_lags_on_forward_and_reverse_strokes_alike(over_angle):
    estimator = OrderCrossSpectrum(
        4, pairs=[("torque", "current")], form="log", bin_size=3, max_order=6, by_direction=True
    )
    table = frame(estimator, over_angle).filter(like="@3-6")
    names = ["log", "phase"]
    assert list(table) == [f"torque*current:response.{q}{s}@3-6" for q in names for s in "+-"]
    phase = table.iloc[:, 2:].to_numpy()
    # 6 ms at order 4.5 and at the highest speed, or the mean of the speed over the angle.
    fastest = TURN * 8
    assert np.all((phase > -4.5 * fastest * 0.006) & (phase < -4.5 * fastest * np.pi / 4 * 0.006))
    np.testing.assert_allclose(phase[:, 0], phase[:, 1], atol=0.06)
    np.testing.assert_allclose(table.iloc[:, :2], np.log(2), atol=0.1)


def test_what_is_unrelated_is_hardly_coherent(over_angle):
    table = frame(OrderCrossSpectrum(2, kind="coherence", bin_size=2, max_order=12), over_angle)
    assert table.filter(like="torque*error").to_numpy().max() < 0.2
    assert table.filter(like="torque*current").iloc[:, 1:].to_numpy().min() > 0.4


# Columns and bins


def test_all_pairs_by_default_in_the_order_of_the_channels(over_angle):
    estimator = OrderCrossSpectrum(4).fit(over_angle)
    assert estimator.pairs_ == (("torque", "current"), ("torque", "error"), ("current", "error"))


def test_an_ordered_pair_says_which_is_the_input(over_angle):
    there, back = (
        frame(OrderCrossSpectrum(4, kind="cross", pairs=[pair]), over_angle).to_numpy()
        for pair in [("torque", "error"), ("error", "torque")]
    )
    n_orders = there.shape[1] // 2
    np.testing.assert_allclose(there[:, :n_orders], back[:, :n_orders], rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(there[:, n_orders:], -back[:, n_orders:], rtol=1e-9, atol=1e-15)


def test_lines_pass_through_the_bin_transformer_and_agree_with_own_bins(over_angle):
    after = make_pipeline(OrderCrossSpectrum(4, kind="cross"), BinTransformer(1.5, max_order=9))
    within = OrderCrossSpectrum(4, kind="cross", bin_size=1.5, max_order=9)
    np.testing.assert_allclose(
        after.fit_transform(over_angle), within.fit_transform(over_angle), rtol=1e-9, atol=1e-15
    )
    assert list(after.get_feature_names_out()) == list(within.get_feature_names_out())


# scikit-learn


def test_a_recording_does_not_depend_on_others(over_angle):
    transform = OrderCrossSpectrum(4).fit(over_angle).transform
    np.testing.assert_array_equal(transform(over_angle)[1:2], transform(over_angle[1:2]))


def test_it_is_searched_and_decides_beside_the_power_spectrum():
    X = [drive(seed, gain=2 + seed % 2, seconds=10) for seed in range(12)]
    y = ["sound", "worn"] * 6
    pipe = make_pipeline(
        OrderResampler(TURN / 32, min_speed=1.0),
        FeatureUnion(
            [
                ("power", make_pipeline(OrderPSD(2), BinTransformer(4, max_order=12))),
                ("between", OrderCrossSpectrum(2, bin_size=4, max_order=12, form="log")),
            ]
        ),
        StandardScaler(),
        CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto"),
    )
    grid = {"featureunion__between__bin_size": [4, 6]}
    search = GridSearchCV(pipe, grid, cv=3, error_score="raise").fit(X, y)
    assert search.best_score_ == 1
    assert list(search.best_estimator_.predict(X)) == y


# What is refused


def short_run():
    times = np.arange(2000) / 500
    return Recording({"a": np.sin(times), "b": np.cos(times)}, 500, velocity=np.full(2000, 20.0))


def test_a_recording_without_a_segment_is_named_with_the_remedy(over_angle):
    rows = RESAMPLER.fit_transform([short_run()])
    match = r"recording 0: no stroke holds a segment of 16 revolutions.*of OrderCrossSpectrum"
    with pytest.raises(ValueError, match=match):
        OrderCrossSpectrum().fit_transform(rows)


def test_short_recordings_are_padded_on_demand():
    rows = RESAMPLER.fit_transform([short_run()])
    assert OrderCrossSpectrum(short="pad").fit_transform(rows).shape == (1, 2 * 257)
    with pytest.raises(ValueError, match=r"recording 0: coherence of a single segment is 1"):
        OrderCrossSpectrum(short="pad", kind="coherence").fit_transform(rows)


def test_a_missing_channel_is_named_with_the_recording(over_angle):
    fitted = OrderCrossSpectrum(4, pairs=[("current", "error")]).fit(over_angle)
    less = OrderResampler(TURN / 32, channels=["torque", "current"], min_speed=1.0)
    rows = less.fit_transform([drive(unit="A")])
    with pytest.raises(ValueError, match=r"recording 0 \(unit='A'\) has no channel 'error'; its"):
        fitted.transform(rows)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("level", [0.0, -1e6])
def test_a_stuck_sensor_has_no_response_whatever_its_level(level, kind):
    motion = {"velocity": np.full(5000, 60.0)}
    channels = {"a": np.full(5000, level, kind), "b": np.sin(np.arange(5000.0)).astype(kind)}
    rows = RESAMPLER.fit_transform([Recording(channels, 500, **motion)])
    with pytest.raises(ValueError, match=r"channel 'a' has no power at .*Check its sensor"):
        OrderCrossSpectrum(4).fit_transform(rows)


@pytest.mark.parametrize(
    ("X", "error", "match"),
    [
        ([drive(seconds=1)], TypeError, "recording 0 is over time; put an OrderResampler before"),
        ([[1.0, 2.0]], TypeError, "entry 0 of X must be .* OrderCrossSpectrum, got a list"),
    ],
)
def test_what_is_no_list_of_recordings_over_the_angle_is_refused(X, error, match):
    with pytest.raises(error, match=match):
        OrderCrossSpectrum().fit(X)


@pytest.mark.parametrize(
    ("options", "error", "match"),
    [
        ({"pairs": "torque"}, ValueError, "got 'torque'"),
        ({"pairs": [("torque", "error", "current")]}, ValueError, "two of the channels"),
        ({"pairs": [("torque", "lvdt")]}, ValueError, "got .*lvdt"),
        ({"pairs": [("torque", "torque")]}, ValueError, "pairs of two of the channels"),
        ({"pairs": []}, ValueError, "one or more pairs"),
        ({"pairs": [("torque", "error")] * 2}, ValueError, "one or more pairs"),
        ({"pairs": 5}, ValueError, "one or more pairs .* got 5"),
        ({"kind": ("coherence",) * 2}, ValueError, "kind must name .* each once"),
        ({"kind": ()}, ValueError, "kind must name one or more"),
        ({"kind": 5}, ValueError, "kind must be one of .* got 5"),
        ({"kind": "gain"}, ValueError, "kind must be one of 'response', 'coherence', 'cross'"),
        ({"form": "bode"}, ValueError, "form must be one of 'rectangular', 'polar', 'log'"),
        ({"bin_size": 0}, ValueError, "bin_size must be a number of orders, above 0"),
        ({"bin_size": 1, "max_order": 20}, ValueError, "reaches beyond the spectrum"),
    ],
)
def test_wrong_parameters_are_told_at_fit(over_angle, options, error, match):
    estimator = OrderCrossSpectrum(**options)
    with pytest.raises(error, match=match):
        estimator.fit(over_angle)


def test_the_logarithm_of_nothing_is_refused():
    run = drive()
    signals = {"a": run.signals["torque"], "b": np.zeros(len(run.signals["torque"]))}
    rows = RESAMPLER.fit_transform([Recording(signals, 500, angle=run.angle)])
    with pytest.raises(ValueError, match=r"recording 0: some value exceeds.*logarithm of 0"):
        OrderCrossSpectrum(4, form="log").fit_transform(rows)
