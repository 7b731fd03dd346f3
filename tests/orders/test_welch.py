"""Facts about the order spectrum: Welch's method, where power stands, and what smears."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import signal as filters

from emacm import OrderPSD, OrderResampler, Recording
from emacm.orders.segment_plan import SegmentPlan
from emacm.orders.welch import order_psd

TURN = 2 * np.pi
WINDOWS = [
    "boxcar",
    "hann",
    "hamming",
    "blackman",
    "flattop",
    "blackmanharris",
    "bartlett",
    ("kaiser", 8.6),
    ("tukey", 0.5),
]
every_window = pytest.mark.parametrize("window", WINDOWS, ids=str)


def noise(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


def angles(samples_per_rev, revolutions):
    return TURN / samples_per_rev * np.arange(int(samples_per_rev * revolutions))


def assert_same_spectrum(ours, theirs):
    """Agree to 1e-12 of each line, or of the largest where detrending leaves nothing."""
    np.testing.assert_allclose(ours[0], theirs[0], rtol=1e-12)
    np.testing.assert_allclose(ours[1], theirs[1], rtol=1e-12, atol=1e-14 * theirs[1].max())


# The same samples, and scipy.signal.welch


@pytest.mark.parametrize("length", [255, 256])
@pytest.mark.parametrize("scaling", ["density", "spectrum"])
@pytest.mark.parametrize("average", ["mean", "median"])
@pytest.mark.parametrize("detrend", ["constant", "linear", False])
def test_the_order_spectrum_is_that_of_welch(length, scaling, average, detrend):
    signal = noise(2, 5000) + 3
    options = {"scaling": scaling, "average": average, "detrend": detrend}
    ours = order_psd(signal, 60, n_per_segment=length, **options)
    assert_same_spectrum(ours, filters.welch(signal, 60, nperseg=length, **options))


@every_window
@pytest.mark.parametrize("length", [128, 129])
def test_every_window_is_that_of_welch(window, length):
    signal = noise(3000)
    ours = order_psd(signal, 50, n_per_segment=length, window=window)
    assert_same_spectrum(ours, filters.welch(signal, 50, window=window, nperseg=length))


def test_a_window_may_be_an_array_as_in_welch():
    signal, window = noise(3000), np.linspace(0.1, 1, 100)
    ours = order_psd(signal, 50, n_per_segment=100, window=window)
    assert_same_spectrum(ours, filters.welch(signal, 50, window=window))


@given(
    length=st.integers(2, 120),
    overlap=st.floats(0, 0.95),
    n_angles=st.integers(120, 400),
    average=st.sampled_from(["mean", "median"]),
)
def test_every_overlap_is_that_of_welch(length, overlap, n_angles, average):
    signal = noise(n_angles, seed=1)
    both = {"average": average, "detrend": False}
    ours = order_psd(signal, 32, n_per_segment=length, overlap=overlap, **both)
    theirs = filters.welch(signal, 32, nperseg=length, noverlap=int(overlap * length), **both)
    assert_same_spectrum(ours, theirs)


def test_at_constant_speed_orders_are_hertz_over_the_speed():
    fs, speed = 10_240.0, 20.0  # 512 time samples per revolution, 128 angles
    time = np.arange(int(8 * fs) + 1) / fs
    signal = noise(len(time)) + 3 * np.sin(7.3 * TURN * speed * time)
    recording = Recording({"x": signal}, fs, velocity=np.full(len(time), TURN * speed))
    psd = OrderPSD(8)
    (over_orders,) = psd.fit_transform(OrderResampler(TURN / 128).fit_transform([recording]))
    hertz, over_hertz = filters.welch(signal, fs, nperseg=4096)
    # Beyond the lines that detrending bends, up to 0.78 of the highest order.
    lines = slice(3, int(0.78 * 64 * 8))
    np.testing.assert_allclose(psd.orders_[lines], hertz[lines] / speed, rtol=1e-12)
    np.testing.assert_allclose(over_orders[lines], over_hertz[lines] * speed, rtol=0.005)


# Power


@every_window
@given(signal=arrays(float, 60, elements=st.floats(-100, 100)))
def test_the_density_integrates_to_the_mean_square_under_the_window(window, signal):
    # Parseval, line by line: without a doubled line at order 0 or at half the rate.
    for length in (60, 59):
        part = signal[:length]
        orders, psd = order_psd(
            part, 32, n_per_segment=length, window=window, detrend=None, overlap=0
        )
        weight = filters.get_window(window, length)
        mean_square = np.sum((part * weight) ** 2) / np.sum(weight**2)
        np.testing.assert_allclose(psd.sum() * orders[1], mean_square, rtol=1e-12, atol=1e-12)


@every_window
def test_the_density_of_white_noise_is_its_variance_over_the_highest_order(window):
    orders, psd = order_psd(5 * noise(64 * 4000), 64, window=window)
    inner = (orders > 1) & (orders < 31)
    assert psd[inner].mean() == pytest.approx(25 / 32, rel=0.015)


@every_window
@pytest.mark.parametrize("revolutions", [4, 16, 64])
def test_in_a_spectrum_a_tone_reads_half_its_amplitude_squared(window, revolutions):
    angle = angles(64, 200)
    orders, spectrum = order_psd(
        3 * np.sin(7 * angle), 64, revolutions=revolutions, window=window, scaling="spectrum"
    )
    assert orders[spectrum.argmax()] == 7
    assert spectrum.max() == pytest.approx(9 / 2, rel=2e-5)  # 1e-5: side lobes of Kaiser's window


def test_the_density_of_a_tone_grows_with_the_segment_and_its_integral_does_not():
    angle = angles(64, 200)
    signal = 3 * np.sin(7 * angle)
    peaks, powers = [], []
    for revolutions in (8, 16, 64):
        orders, psd = order_psd(signal, 64, revolutions=revolutions)
        peaks.append(psd.max())
        powers.append(psd.sum() * orders[1])
    # Hann spreads a tone over 1.5 lines.
    np.testing.assert_allclose(peaks, 4.5 / 1.5 * np.array([8, 16, 64]), rtol=1e-9)
    np.testing.assert_allclose(powers, 4.5, rtol=1e-9)


def test_the_line_at_half_the_sampling_rate_is_not_doubled():
    signal = np.tile([1.0, -1.0], 500)
    orders, spectrum = order_psd(signal, 32, window="boxcar", scaling="spectrum", detrend=None)
    assert orders[-1] == 16
    assert spectrum[-1] == pytest.approx(1)
    assert spectrum[:-1].max() < 1e-20


def test_a_mean_stands_at_order_0_unless_it_is_taken_out():
    signal = np.full(1000, 3.0)
    for detrend, power in ((None, 9.0), ("constant", 0.0)):
        _, spectrum = order_psd(
            signal, 32, revolutions=4, window="boxcar", scaling="spectrum", detrend=detrend
        )
        assert spectrum[0] == pytest.approx(power)
        assert spectrum[1:].max() < 1e-20


def test_the_median_is_less_moved_by_a_shock_than_the_mean():
    signal = noise(64 * 500)
    shocked = signal.copy()
    shocked[10_000] += 1000
    floor = {}
    for average in ("mean", "median"):
        for name, row in (("calm", signal), ("shocked", shocked)):
            floor[average, name] = order_psd(row, 64, average=average)[1][20:-20].mean()
    assert floor["median", "calm"] == pytest.approx(floor["mean", "calm"], rel=0.03)
    assert floor["median", "shocked"] == pytest.approx(floor["median", "calm"], rel=0.05)
    assert floor["mean", "shocked"] > 10 * floor["mean", "calm"]


# The axis


@given(samples_per_rev=st.floats(4, 2000), revolutions=st.floats(1, 100))
def test_the_axis_carries_the_true_step(samples_per_rev, revolutions):
    plan = SegmentPlan(samples_per_rev, revolutions=revolutions)
    assert abs(plan.n_per_segment - revolutions * samples_per_rev) <= 0.5
    assert plan.order_step == samples_per_rev / plan.n_per_segment
    assert plan.revolutions == pytest.approx(1 / plan.order_step)
    orders = np.arange(plan.n_orders) * samples_per_rev / plan.n_per_segment
    np.testing.assert_array_equal(plan.orders, orders)
    assert plan.orders[-1] <= samples_per_rev / 2 * (1 + 1e-12)


def test_max_order_cuts_lines_and_changes_none():
    signal = noise(5000)
    orders, psd = order_psd(signal, 64)
    few_orders, few = order_psd(signal, 64, max_order=10)
    assert few_orders[-1] == 10
    np.testing.assert_array_equal(few_orders, orders[: len(few_orders)])
    np.testing.assert_allclose(few, psd[: len(few)], rtol=1e-12)


# Strokes


def test_segments_of_all_strokes_count_alike_and_none_spans_two():
    strokes = [noise(1, n, seed=n) for n in (700, 130, 127, 500)]
    plan = SegmentPlan(32, revolutions=4)
    counts = [(row.shape[1] - 128) // 64 + 1 if row.shape[1] >= 128 else 0 for row in strokes]
    assert counts == [9, 1, 0, 6]
    each = [plan.average_of([row]) for row, n in zip(strokes, counts, strict=True) if n]
    expected = np.average(each, axis=0, weights=[n for n in counts if n])
    np.testing.assert_allclose(plan.average_of(strokes), expected, rtol=1e-12)


def reversing_recording(fault):
    """Strokes of 15 revolutions; `fault` is a function of angle and of forward motion."""
    fs = 10_000
    time = np.arange(4 * fs) / fs
    angle = 48 * (1 - np.cos(np.pi * time))
    return Recording({"x": fault(angle, np.mod(time, 2) < 1)}, fs, angle=angle, meta={"unit": "B"})


@given(
    sizes=st.lists(st.integers(1, 400), min_size=1, max_size=12),
    length=st.integers(8, 300),
    overlap=st.sampled_from([0.0, 0.25, 0.5, 0.9]),
    average=st.sampled_from(["mean", "median"]),
)
@example(sizes=[100, 100], length=100, overlap=0.5, average="mean")
@example(sizes=[100, 70, 30], length=60, overlap=0.25, average="median")
def test_a_signal_in_blocks_has_the_spectrum_of_the_whole(sizes, length, overlap, average):
    signal = np.random.default_rng(sum(sizes)).standard_normal((2, sum(sizes)))
    plan = SegmentPlan(32.0, n_per_segment=length, overlap=overlap, average=average)
    cuts = np.cumsum(sizes)[:-1]
    blocks = np.split(signal, cuts, axis=1)
    if sum(sizes) < length:
        with pytest.raises(ValueError, match="no signal holds a segment"):
            plan.average_of([iter(blocks)])
        return
    expected = plan.average_of([signal])
    found = plan.average_of([iter(blocks)])
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-15)


def test_by_direction_both_ways_together_are_the_spectrum():
    rng = np.random.default_rng(2)
    recording = reversing_recording(lambda angle, _: rng.standard_normal(len(angle)))
    over_angle = OrderResampler().fit_transform([recording])
    both = OrderPSD(4).fit_transform(over_angle)
    forward, reverse = np.split(OrderPSD(4, by_direction=True).fit_transform(over_angle)[0], 2)
    # Two strokes of equal length each way: both count alike.
    np.testing.assert_allclose((forward + reverse) / 2, both[0], rtol=1e-9)


# Recordings shorter than a segment


@pytest.mark.parametrize("order", [4.0, 9.3, 30.0])
@pytest.mark.parametrize("window", ["hann", "boxcar", "hamming"])
def test_padded_strokes_have_the_power_of_a_tone(order, window):
    recording = reversing_recording(lambda angle, _: np.sin(order * angle))
    over_angle = OrderResampler().fit_transform([recording])
    psd = OrderPSD(20, short="pad", window=window)
    (spectrum,) = psd.fit_transform(over_angle)
    assert spectrum.sum() * psd.order_step_ == pytest.approx(0.5, rel=0.02)
    near = np.abs(psd.orders_ - order) < 2
    assert spectrum[near].sum() * psd.order_step_ == pytest.approx(0.5, rel=0.02)
    assert psd.orders_[spectrum.argmax()] == pytest.approx(order, abs=psd.order_step_)


# What smears


def test_a_mains_hum_smears_in_orders_and_not_in_hertz():
    fs = 10_000
    time = np.arange(8 * fs) / fs
    angle = TURN * (5 * time + 2 * time**2)
    recording = Recording({"x": np.sin(TURN * 50 * time)}, fs, angle=angle)
    psd = OrderPSD(8, scaling="spectrum")
    (over_orders,) = psd.fit_transform(OrderResampler().fit_transform([recording]))
    _, over_hertz = filters.welch(recording.signals["x"], fs, nperseg=fs, scaling="spectrum")
    assert over_hertz.max() / 0.5 == pytest.approx(1, abs=1e-6)
    assert over_orders.max() / 0.5 < 0.3


# Errors


def test_a_signal_shorter_than_a_segment_is_refused():
    with pytest.raises(ValueError, match=r"no segment of 544 samples \(17 rev.*Lower revolutions"):
        order_psd(np.zeros(520), 32, revolutions=17)
