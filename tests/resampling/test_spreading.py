"""Facts about resampling over the shaft angle: what passes, what folds, where a tone ends up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import emacm.resampling.spreading
from emacm import BinTransformer, OrderPSD, OrderResampler, Recording, _kernels
from emacm._kernels import using
from emacm.orders.welch import order_psd
from emacm.resampling.angle_recording import interpolated
from emacm.resampling.spreading import DESIGN, spread_rows
from emacm.shaft.motion import ShaftPath

TURN = 2 * np.pi
THETA_S = TURN / 128  # orders up to 64, flat up to 49.92
LAST_FLAT = DESIGN.flat * np.pi / THETA_S
AMPLITUDE = 1.7

# Motion: angle [rad] and speed [rad/s] as functions of time, up to 28 rev/s.
MOTIONS = {
    "constant": (lambda t: TURN * 20 * t, lambda t: TURN * 20 + 0 * t),
    "ramp": (lambda t: TURN * (4 * t + 4 * t**2), lambda t: TURN * (4 + 8 * t)),
    "sinusoidal": (
        lambda t: TURN * 15 * t + 8 * (1 - np.cos(TURN * t)),
        lambda t: TURN * (15 + 8 * np.sin(TURN * t)),
    ),
    "reversing": (lambda t: 48 * (1 - np.cos(np.pi * t)), lambda t: TURN * 24 * np.sin(np.pi * t)),
}
REFERENCES = {
    "angle": lambda angle, velocity: {"angle": angle},
    "velocity": lambda angle, velocity: {"velocity": velocity},
    "wrapped angle": lambda angle, velocity: {"angle": np.mod(angle, TURN)},
}
every_motion = pytest.mark.parametrize("motion", MOTIONS)
every_reference = pytest.mark.parametrize("reference", REFERENCES)


def in_blocks_of(n_times, monkeypatch):
    monkeypatch.setattr(_kernels.loops, "SPREAD_AT_ONCE", n_times)


def joined(make_blocks, signal, path, theta_s):
    """Angles travelled, and a signal of shape (..., n_times) at these angles."""
    signal = np.asarray(signal, dtype=np.result_type(signal, np.float32))
    rows = list(signal.reshape(-1, signal.shape[-1]))
    resampled = np.concatenate(list(make_blocks(rows)), axis=1)
    assert resampled.shape == (len(rows), path.count(theta_s))
    angles = theta_s * np.arange(resampled.shape[1])
    return angles, resampled.reshape(*signal.shape[:-1], len(angles))


def spread_to_angle(signal, fs, path, *, theta_s):
    return joined(lambda rows: spread_rows(rows, fs, path, theta_s), signal, path, theta_s)


def interpolate_to_angle(signal, fs, path, *, theta_s, interpolation="linear"):
    def make_blocks(rows):
        return interpolated(rows, fs, path, theta_s, interpolation)

    return joined(make_blocks, signal, path, theta_s)


def times(fs, duration=3.0):
    return np.arange(int(duration * fs)) / fs


def shaft(motion, reference, fs):
    angle, velocity = (function(times(fs)) for function in MOTIONS[motion])
    return REFERENCES[reference](angle, velocity)


def tone(motion, order, fs):
    return AMPLITUDE * np.sin(order * MOTIONS[motion][0](times(fs)) + 0.4)


def tone_power(recording, order, **resampling):
    """Power that the whole chain finds within half an order of a tone, each channel."""
    over_angle = OrderResampler(THETA_S, **resampling).fit_transform([recording])
    psd = OrderPSD(8).fit_transform(over_angle)
    return BinTransformer(edges={"tone": (order - 0.5, order + 0.5)}).fit_transform(psd)[0]


def steady(speed, fs, duration):
    """Times and the path of a shaft at constant `speed` [rev/s]."""
    time = times(fs, duration)
    return time, ShaftPath(TURN * speed * time, fs, 0.0, 0.0, 1)


def varying(fs, mean, swing, rate, duration):
    """Times, speed [rev/s] and path of a shaft whose speed swings about its mean."""
    time = times(fs, duration)
    speed = mean + swing * np.sin(TURN * rate * time)
    angle = TURN * mean * time + swing / rate * (1 - np.cos(TURN * rate * time))
    return time, speed, ShaftPath(angle, fs, 0.0, 0.0, 1)


def decibel(power_ratio):
    return 10 * np.log10(power_ratio)


def gains(resampled, angles, orders):
    """Gain of each row's tone [dB], by least squares away from the ends."""
    found = []
    for row, order in zip(resampled, orders, strict=True):
        waves = np.stack([np.sin(order * angles), np.cos(order * angles)], axis=1)[60:-60]
        fit, *_ = np.linalg.lstsq(waves, row[60:-60], rcond=None)
        found.append(decibel(fit @ fit))
    return np.array(found)


def power_up_to(top, resampled, samples_per_rev):
    """Power of each row in orders up to `top`, away from the ends."""
    options = {"revolutions": 8, "window": "blackmanharris"}
    orders, psd = order_psd(resampled[..., 60:-60], samples_per_rev, **options)
    return psd[..., orders <= top].sum(axis=-1) * orders[1]


# A tone locked to the shaft


@every_motion
@every_reference
@pytest.mark.parametrize("order", [1.0, 5.3, 27.0, 49.4])
def test_a_tone_locked_to_the_shaft_has_its_power_at_its_order(motion, reference, order):
    fs = 10_000
    recording = Recording({"x": tone(motion, order, fs)}, fs, **shaft(motion, reference, fs))
    (power,) = tone_power(recording, order)
    assert power == pytest.approx(AMPLITUDE**2 / 2, rel=0.003)


@every_motion
@every_reference
@pytest.mark.parametrize("shaft_fs", [1000, 48_000])
def test_channels_and_shaft_may_have_rates_of_their_own(motion, reference, shaft_fs):
    signals = {"fast": tone(motion, 12, 48_000), "slow": tone(motion, 12, 1000)}
    fs = {"fast": 48_000, "slow": 1000}
    recording = Recording(signals, fs, **shaft(motion, reference, shaft_fs), shaft_fs=shaft_fs)
    power = tone_power(recording, 12)
    np.testing.assert_allclose(power, AMPLITUDE**2 / 2, rtol=0.003)


@pytest.mark.parametrize("motion", ["constant", "ramp", "sinusoidal"])
def test_travel_is_the_stroke_where_the_shaft_never_turns_back(motion):
    recording = Recording({"x": tone(motion, 27, 10_000)}, 10_000, **shaft(motion, "angle", 10_000))
    strokes, travel = (
        OrderResampler(THETA_S, direction=direction).fit_transform([recording])[0].strokes[0]
        for direction in ("strokes", "travel")
    )
    np.testing.assert_allclose(travel.signals, strokes.signals, atol=1e-9)


def test_travel_loses_amplitude_where_phases_fold_at_each_turn():
    fs, time = 10_000, times(10_000, 20.0)
    angle = 20 * (1 - np.cos(np.pi * time))  # strokes of 6.4 revolutions
    recording = Recording({"x": np.sin(7 * angle)}, fs, angle=angle)

    def amplitude(direction):
        over_angle = OrderResampler(direction=direction).fit_transform([recording])
        spectrum = OrderPSD(4, scaling="spectrum").fit_transform(over_angle)
        return np.sqrt(2 * float(spectrum.max()))

    assert amplitude("strokes") == pytest.approx(1, abs=0.002)
    assert 0.5 < amplitude("travel") < 0.95


@pytest.mark.parametrize("samples_per_rev", [64, 128, 200])
@pytest.mark.parametrize("share", [0.02, 0.3, 0.77])
def test_the_resampled_signal_is_the_tone_at_the_angles(samples_per_rev, share):
    order = share * samples_per_rev / 2
    time = times(20_000)
    angle = MOTIONS["reversing"][0](time) - 3.0
    recording = Recording({"x": np.sin(order * angle + 0.4)}, 20_000, angle=angle)
    (over_angle,) = OrderResampler(TURN / samples_per_rev).fit_transform([recording])
    assert [stroke.direction for stroke in over_angle.strokes] == [1, -1, 1]
    for stroke in over_angle.strokes:
        grid = np.arange(stroke.n_angles) * stroke.direction * TURN / samples_per_rev
        np.testing.assert_allclose(stroke.angles, stroke.start_angle + grid, atol=1e-9)
        error = np.abs(stroke.signals[0] - np.sin(order * stroke.angles + 0.4))
        # 0.01 dB is 0.00115; the mirror at the ends is felt over 10 samples (20 of the fine grid).
        assert error[11:-11].max() < 0.00115
        assert error.max() < 0.7


@pytest.mark.parametrize("motion", ["ramp", "reversing"])
def test_a_constant_stays_what_it_is_up_to_the_ends(motion):
    recording = Recording({"x": np.ones(30_000)}, 10_000, **shaft(motion, "angle", 10_000))
    for stroke in OrderResampler().fit_transform([recording])[0].strokes:
        np.testing.assert_allclose(stroke.signals, 1, atol=1e-4)


@pytest.mark.parametrize(("fs", "share"), [(10_000.0, 0.0005), (500.0, 0.003)])
def test_a_trend_is_followed_up_to_the_ends(fs, share):
    # The slow channel ends 1.9 ms, or five angles, before the shaft does.
    _, path = steady(20.0, 10_000.0, 4.0)
    trend = TURN * 20 * times(fs, 4.0)
    angles, resampled = spread_to_angle(trend, fs, path, theta_s=THETA_S)
    np.testing.assert_allclose(resampled, angles, atol=share * path.length)


# The pass band


@pytest.mark.parametrize(
    ("fs", "speed", "duration"),
    [
        (48_000, 10.0, 2.0),  # 4800 time samples per revolution
        (10_000, 20.0, 2.0),
        (5000, 20.0, 2.0),  # 5 time samples per cycle at order 50, upsampled by 2
        (4000, 17.0, 2.0),
        (1000, 9.0, 4.0),  # upsampled by 3; fewer time samples than angles
        (25, 1.0, 40.0),  # upsampled by 9
    ],
)
def test_the_pass_band_is_flat_within_a_hundredth_of_a_decibel(fs, speed, duration):
    # Up to 0.78 of pi/theta_s, or 0.84 of half the sampling rate.
    top = min(LAST_FLAT, 0.84 * fs / 2 / speed)
    orders = np.linspace(0.05, 1, 45) * top
    time, path = steady(speed, float(fs), duration)
    signals = np.sin(np.outer(orders, TURN * speed * time) + 0.3)
    angles, resampled = spread_to_angle(signals, float(fs), path, theta_s=THETA_S)
    assert np.abs(gains(resampled, angles, orders)).max() < 0.01


def test_the_pass_band_is_flat_while_the_speed_varies():
    orders = np.linspace(0.05, 1, 20) * LAST_FLAT
    for fs in (48_000.0, 3600.0):  # dense, and upsampled by 2
        _, _, path = varying(fs, 10, 4, 0.5, 4.0)
        signals = np.sin(np.outer(orders, path.travel))
        angles, resampled = spread_to_angle(signals, fs, path, theta_s=THETA_S)
        assert np.abs(gains(resampled, angles, orders)).max() < 0.01


# What would fold


@pytest.mark.parametrize(("fs", "speed"), [(48_000.0, 10.0), (48_000.0, 40.0), (10_000.0, 5.0)])
def test_tones_that_would_fold_into_the_pass_band_are_down_by_60_decibel(fs, speed):
    orders = np.array([78.2, 79, 82, 90, 100, 117.7, 130.5, 177, 200, 206, 222, 255.5, 257, 300])
    orders = np.append(orders, [306, 350, 400, 411.3])
    time, path = steady(speed, fs, 4.0 if fs > 20_000 else 8.0)
    signals = np.sin(np.outer(orders, TURN * speed * time) + 0.3)
    _, resampled = spread_to_angle(signals, fs, path, theta_s=THETA_S)
    folded = power_up_to(LAST_FLAT, resampled, 128) / 0.5
    assert decibel(folded).max() < -60


@pytest.mark.parametrize("samples_per_rev", [64, 100, 128, 256])
def test_a_fixed_tone_of_4200_hertz_does_not_fold_at_any_speed(samples_per_rev):
    # Orders 300 to 700 at 14 to 6 rev/s.
    time, speed, path = varying(48_000.0, 10, 4, 0.25, 4.0)
    assert (speed.min(), speed.max()) == pytest.approx((6, 14))
    signal = np.sin(TURN * 4200 * time)
    _, resampled = spread_to_angle(signal, 48_000.0, path, theta_s=TURN / samples_per_rev)
    folded = power_up_to(DESIGN.flat * samples_per_rev / 2, resampled, samples_per_rev)
    assert decibel(folded / 0.5) < -60


# Noise


@pytest.fixture(scope="module")
def noise():
    """ShaftPath of a varying speed, white noise of variance 1 in four channels, and its true level.

    At f rev/s the one-sided level 2/fs per Hz is 2 f/fs per order, and over the angle a time of
    speed f counts by f: the mean over the angle is 2/fs mean(f²)/mean(f).
    """
    fs = 48_000.0
    _, speed, path = varying(fs, 40, 16, 0.3, 10.0)
    signals = np.random.default_rng(5).standard_normal((4, len(speed)))
    return fs, speed.max(), path, signals, 2 / fs * np.mean(speed**2) / np.mean(speed)


@pytest.mark.parametrize("samples_per_rev", [64, 100, 128, 256, 360, 1000, 2000])
def test_the_floor_of_white_noise_is_right_for_every_theta_s(noise, samples_per_rev):
    fs, top_speed, path, signals, level = noise
    _, resampled = spread_to_angle(signals, fs, path, theta_s=TURN / samples_per_rev)
    orders, psd = order_psd(resampled, samples_per_rev, revolutions=8)
    top = min(DESIGN.flat * samples_per_rev / 2, fs / 2 / top_speed / 2)
    flat = psd[:, (orders > 0.3) & (orders <= top)].mean(axis=0)
    # Each quarter of the band holds 2500 independent values or more: 2 %, or 0.09 dB.
    quarters = [decibel(part.mean() / level) for part in np.array_split(flat, 4)]
    np.testing.assert_allclose(quarters, 0, atol=0.3)
    assert decibel(flat.mean() / level) == pytest.approx(0, abs=0.05)


# Dense and sparse time samples


def test_nothing_steps_between_dense_and_sparse_time_samples():
    # The same band-limited signal, sampled more and more densely: 60 to 2000 samples per
    # revolution. At 128 angles per revolution upsampling by 4, 3 and 2 ends at 85, 145 and 412.
    rng = np.random.default_rng(3)
    speed, orders = 5.0, rng.uniform(0.5, 22, 60)
    amplitudes, phases = rng.uniform(0.5, 1, 60), rng.uniform(0, TURN, 60)

    def signal_at(angle):
        waves = np.sin(np.multiply.outer(angle, orders) + phases)
        return waves @ amplitudes

    results = []
    for samples_per_rev in (60.4, 85.0, 85.4, 144.9, 145.3, 411.9, 412.4, 700, 2000):
        fs = samples_per_rev * speed
        time, path = steady(speed, fs, 8.0)
        signal = signal_at(TURN * speed * time)
        angles, resampled = spread_to_angle(signal, fs, path, theta_s=THETA_S)
        results.append(resampled[60:4900])
    truth = signal_at(angles[60:4900])
    power = np.mean(truth**2)
    errors = [np.sqrt(np.mean((result - truth) ** 2) / power) for result in results]
    assert max(errors) < 0.001  # 0.009 dB
    levels = [decibel(np.mean(result**2) / power) for result in results]
    assert np.ptp(levels) < 0.001


@pytest.mark.parametrize("name", ["numpy", "numba"])
@pytest.mark.parametrize("turns", [(0, 10, 9, 9.2), (0, -1, 10, 9.2), (0, 3, 1, 10)])
def test_the_seams_do_not_show_where_the_shaft_turns_back(monkeypatch, name, turns):
    pytest.importorskip(name)
    # Also beyond its start and its end, so that what is mirrored there reaches far in.
    travel = np.interp(np.arange(12_000), np.linspace(0, 11_999, len(turns)), turns)
    path = ShaftPath(travel, 10_000, 0.0, 0.0, 1)
    signal = np.random.default_rng(0).standard_normal((2, len(travel)))
    with using(name):
        _, whole = spread_to_angle(signal, 10_000, path, theta_s=2 * np.pi / 512)
        for part in (150, 5000):
            monkeypatch.setattr(emacm.resampling.spreading, "DESIGN", replace(DESIGN, part=part))
            _, joined = spread_to_angle(signal, 10_000, path, theta_s=2 * np.pi / 512)
            np.testing.assert_allclose(joined, whole, atol=1e-12)
            in_blocks_of(5, monkeypatch)  # of a single part
            _, in_blocks = spread_to_angle(signal, 10_000, path, theta_s=2 * np.pi / 512)
            np.testing.assert_array_equal(in_blocks, joined)


# Invariances


@settings(max_examples=25)
@given(
    # Powers of 2 round nothing; else a time sample on a grid point may cross the kernel's end.
    factor=st.integers(-7, 7).map(lambda power: 2.0**power),
    antialias=st.booleans(),
    speed=st.floats(1, 60),
)
def test_all_at_another_pace_changes_nothing(factor, antialias, speed):
    signal = np.random.default_rng(7).standard_normal(1000)
    resample = spread_to_angle if antialias else interpolate_to_angle
    _, path = steady(speed, 1000.0, 1.0)
    _, slow = resample(signal, 1000.0, path, theta_s=TURN / 50)
    quick_path = ShaftPath(path.travel, 1000 * factor, 0.0, 0.0, 1)
    _, quick = resample(signal, 1000 * factor, quick_path, theta_s=TURN / 50)
    np.testing.assert_allclose(quick, slow, atol=1e-12)


# Without the filter: the thesis, and its faults


@given(
    steps=arrays(float, 50, elements=st.floats(1e-3, 1)),
    values=arrays(float, 51, elements=st.floats(-10, 10)),
)
def test_linear_interpolation_is_that_of_the_thesis(steps, values):
    travel = np.concatenate([[0.0], np.cumsum(steps)])
    path = ShaftPath(travel, 100.0, 0.0, 0.0, 1)
    angles, resampled = interpolate_to_angle(values, 100.0, path, theta_s=0.01)
    # Eq. (2.13), read from x(k-1).
    np.testing.assert_allclose(resampled, np.interp(angles, travel, values), atol=1e-12 * 10)


def test_cubic_interpolation_is_exact_for_a_cubic_of_time():
    time, path = steady(1.0, 100.0, 1.0)
    angles, resampled = interpolate_to_angle(
        3 * time**3 - time**2 + 2, 100.0, path, theta_s=0.01, interpolation="cubic"
    )
    moments = angles / TURN
    np.testing.assert_allclose(resampled, 3 * moments**3 - moments**2 + 2, atol=1e-12)


def test_interpolation_passes_over_a_shaft_that_stands_still():
    travel = np.concatenate([np.arange(50.0), np.full(30, 49.0), 49 + np.arange(50.0)]) / 10
    path = ShaftPath(travel, 100.0, 0.0, 0.0, 1)
    angles, resampled = interpolate_to_angle(travel, 100.0, path, theta_s=0.05)
    np.testing.assert_allclose(resampled, angles, atol=1e-12)
