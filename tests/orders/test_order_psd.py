"""Facts about OrderPSD: directions, axes, precision, range, short recordings, defaults."""

import numpy as np
import pandas as pd
import pytest
from scipy import signal as filters

from emacm import BinTransformer, OrderCrossSpectrum, OrderPSD, OrderResampler, Recording
from emacm.orders.segment_plan import SegmentPlan, padded_lines
from emacm.orders.welch import order_psd, samples_per_revolution

TURN = 2 * np.pi
RNG = np.random.default_rng(5)


def to_and_fro(fs=640.0, turns=40, revolutions_per_s=5.0):
    """Velocity of a shaft that turns forward, rests, and turns back."""
    n = round(turns / revolutions_per_s * fs)
    return TURN * revolutions_per_s * np.repeat([1.0, 0.0, -1.0], [n, 20, n])


def powers_by_column(table):
    """Largest power of each channel and direction."""
    names = np.array([name.rpartition("@")[0] for name in table.columns])
    values = np.asarray(table)[0]
    return {str(name): float(values[names == name].max()) for name in np.unique(names)}


# Columns


@pytest.mark.parametrize("channels", [("zeta", "alpha"), ("alpha", "zeta")])
def test_by_direction_each_column_has_the_power_of_its_channel_and_direction(channels):
    fs, velocity = 640.0, to_and_fro()
    angle = np.cumsum(velocity) / fs
    forward, reverse = velocity > 0, velocity < 0
    tone = np.sin(6 * angle)
    amplitudes = {"zeta+": 1.0, "zeta-": 3.0, "alpha+": 20.0, "alpha-": 5.0}
    signals = {
        name: tone * (amplitudes[name + "+"] * forward + amplitudes[name + "-"] * reverse)
        for name in channels
    }
    X = OrderResampler(TURN / 64).fit_transform([Recording(signals, fs, velocity=velocity)])
    found = powers_by_column(OrderPSD(8, by_direction=True, scaling="spectrum").fit_transform(X))
    for name, amplitude in amplitudes.items():
        assert found[name] == pytest.approx(amplitude**2 / 2, rel=0.02), name


def test_channels_of_different_rates_keep_their_order_and_their_power():
    fs, velocity = 640.0, np.full(6400, TURN * 5.0)
    angle = np.cumsum(velocity) / fs
    signals = {name: a * np.sin(6 * angle) for name, a in (("c", 1.0), ("a", 2.0), ("b", 3.0))}
    signals["a"] = signals["a"][::2]
    rates = {"c": fs, "a": fs / 2, "b": fs}
    run = Recording(signals, rates, velocity=velocity, shaft_fs=fs)
    X = OrderResampler(TURN / 64).fit_transform([run])
    table = OrderPSD(8, scaling="spectrum").fit_transform(X)
    found = powers_by_column(table)
    assert list(dict.fromkeys(name.rpartition("@")[0] for name in table.columns)) == [*"cab"]
    assert [found[name] for name in "cab"] == pytest.approx([0.5, 2.0, 4.5], rel=0.02)


@pytest.mark.parametrize("samples", [99.6, 99.4, 30.999, 128.0, 2.5])
def test_a_fractional_number_of_samples_per_revolution_is_not_rounded(samples):
    assert samples_per_revolution(TURN / samples) == pytest.approx(samples, rel=1e-12)
    orders, _ = order_psd(RNG.standard_normal(4000), samples, n_per_segment=500)
    np.testing.assert_allclose(orders, np.arange(251) * samples / 500, rtol=1e-14)


@pytest.mark.parametrize("theta_s", [64, 128.0, 3.2])
def test_a_number_of_samples_in_place_of_an_angle_step_is_refused_with_the_remedy(theta_s):
    recording = Recording({"a": RNG.standard_normal(600)}, 600, velocity=np.full(600, 40.0))
    remedy = rf"theta_s = {theta_s:g} rad .*write theta_s=2 \* np.pi / {theta_s:g}"
    with pytest.raises(ValueError, match=remedy):
        OrderResampler(theta_s).fit([recording])
    with pytest.raises(ValueError, match=remedy):
        OrderPSD(4, theta_s=theta_s).fit([np.ones(99)])


# Precision and range


def test_plain_rows_in_single_precision_have_the_spectrum_of_the_same_numbers():
    rows = (1e6 + RNG.standard_normal((2, 3000))).astype(np.float32)
    for options in ({}, {"average": "median"}):
        psd = OrderPSD(8, theta_s=TURN / 32, **options)
        one, other = psd.fit_transform(rows), psd.fit_transform(rows.astype(np.float64))
        np.testing.assert_allclose(one, other, rtol=1e-12)


def scaled(factor, channels=("z", "a")):
    values = np.random.default_rng(3).standard_normal((2, 4000))
    signals = {channels[0]: values[0], channels[1]: factor * values[1]}
    return OrderResampler(TURN / 32).fit_transform([Recording(signals, 400, velocity=30.0)])


def test_powers_that_overflow_are_refused_with_the_recording():
    with pytest.raises(ValueError, match=r"recording 0: .*float64"):
        OrderPSD(8).fit_transform(scaled(1e160))


def test_bins_that_overflow_are_refused_with_recording_and_column():
    columns = [f"{channel}@{order}" for channel in ("z", "a") for order in (0, 10, 20)]
    psd = pd.DataFrame([[1.0] * 6, [1.0] * 3 + [1e308] * 3], columns=columns)
    with pytest.raises(ValueError, match=r"another unit: .* recording 1, column 'a@0-20'"):
        BinTransformer(20, max_order=20).fit_transform(psd)
    bins = BinTransformer(20, max_order=20).fit(psd.clip(upper=2.0))
    with pytest.raises(ValueError, match=r"another unit: .* recording 1, column 'a@0-20'"):
        bins.transform(psd.clip(upper=1e38).astype(np.float32))


def test_a_spectrum_that_is_fitted_again_on_recordings_forgets_the_table():
    table = pd.DataFrame(RNG.standard_normal((3, 512)), columns=[f"x{k}" for k in range(512)])
    psd = OrderPSD(4, theta_s=TURN / 32).fit(table).fit(scaled(1.0))
    assert not {"n_features_in_", "feature_names_in_"} & {*vars(psd)}


@pytest.mark.parametrize("level", [0.0, 1e-200, 7.25])
def test_a_channel_without_any_variation_has_no_power_and_is_not_refused(level):
    signals = {"z": RNG.standard_normal(4000), "a": np.full(4000, level)}
    X = OrderResampler(TURN / 32).fit_transform([Recording(signals, 400, velocity=30.0)])
    power = np.asarray(OrderPSD(8).fit_transform(X))[0]
    half = len(power) // 2
    assert power[half:].max() <= 1e-15 * level**2  # of resampling
    assert power[:half].min() > 0


# Short recordings


@pytest.mark.parametrize("detrend", ["constant", False])
def test_a_padded_stroke_loses_its_own_mean(detrend):
    rng = np.random.default_rng(0)
    row = 50 + 0.3 * np.arange(60) + rng.standard_normal(60)
    found = OrderPSD(8, theta_s=TURN / 16, short="pad", detrend=detrend).fit_transform([row])[0]
    _, expected = filters.welch(row, 16, nperseg=60, nfft=128, detrend=detrend)
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12 * expected.max())


def test_a_single_short_row_names_its_length_and_the_remedy():
    psd = OrderPSD(4, theta_s=TURN / 16).fit([np.ones(64)])
    with pytest.raises(ValueError, match=r"row 1: no row holds .*\(64 samples\).*holds 3.75.*pad"):
        psd.transform([np.ones(64), np.ones(60)])


# Defaults


@pytest.mark.parametrize("estimator", [OrderPSD, OrderCrossSpectrum])
def test_a_stroke_of_a_single_sample_cannot_be_padded(estimator):
    signals = {"z": RNG.standard_normal(300), "a": RNG.standard_normal(300)}
    X = OrderResampler(3.0).fit_transform([Recording(signals, 300, velocity=np.full(300, 1.0))])
    assert [stroke.n_angles for stroke in X[0].strokes] == [1]
    with pytest.raises(ValueError, match=r"recording 0: it has no stroke of two .* Leave it out"):
        estimator(16, short="pad").fit_transform(X)


def test_directions_are_separated_on_demand_where_there_are_both():
    turn = 2 * np.pi
    there = np.linspace(0, 40 * turn, 4001)
    angle = np.r_[there, there[-2::-1]]
    both = Recording({"x": np.sin(3 * angle)}, 100, angle=angle)
    one = Recording({"x": np.sin(3 * there)}, 100, angle=there)
    for run, channels in ((both, {"x+", "x-"}), (one, {"x"})):
        rows = OrderResampler(turn / 20).fit_transform([run])
        psd = OrderPSD(8, by_direction="auto").fit(rows)
        assert {name.partition("@")[0] for name in psd.get_feature_names_out()} == channels
        assert psd.transform(rows).shape == (1, len(channels) * len(psd.orders_))
    assert OrderPSD(8, by_direction="auto").fit(np.ones((2, 50))).by_direction_ is False


def test_the_plan_is_that_of_fit_and_strokes_of_one_sample_are_no_padded_segments():
    over_angle = OrderResampler(2 * np.pi / 32).fit_transform(
        [Recording({"b": np.ones(900)}, 300, velocity=np.full(900, 31.0))]
    )
    fitted = OrderPSD(2).fit(over_angle)
    assert fitted.plan_.n_per_segment == 64
    assert fitted.get_feature_names_out().dtype == object
    plan = SegmentPlan(32.0, n_per_segment=8, detrend=None)
    short = np.random.default_rng(0).normal(size=(1, 5))
    both = list(padded_lines(plan, [short[:, :1], short]))
    assert len(both) == 1
    window = np.sin(np.pi * np.arange(5) / 5) ** 2
    np.testing.assert_allclose(both[0][0][:, 0], np.fft.rfft(short * window, 8))


@pytest.mark.parametrize(("factor", "same"), [(1 + 9e-13, True), (1 + 1.4e-12, False)])
def test_a_stated_angle_step_is_that_of_the_recordings(factor, same):
    psd = OrderPSD(4, theta_s=TURN / 32 * factor)
    if same:
        assert psd.fit(scaled(1.0)).theta_s_ == pytest.approx(TURN / 32, rel=1e-12)
    else:
        with pytest.raises(ValueError, match=r"recording 0 was resampled with .* OrderPSD has"):
            psd.fit(scaled(1.0))


def test_rows_without_an_axis_have_segments_of_the_shortest_and_plain_spectra():
    rows = [RNG.standard_normal(n) for n in (13, 10, 12)]
    psd = OrderPSD().fit(rows)
    assert psd.n_per_segment_ == 10
    found = psd.transform(rows)
    assert type(found) is np.ndarray
    assert psd.get_feature_names_out().tolist() == [f"line{k}" for k in range(6)]
    assert OrderPSD().fit(rows * 2).n_per_segment_ == 10
    assert OrderPSD().fit([np.ones(30), np.ones(40)]).n_per_segment_ == 16
