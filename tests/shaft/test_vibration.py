"""Shaft angle from vibration: right where it is reliable, and refused where there is no shaft."""

import os
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from laboratory import LaboratoryBench
from laboratory.constants import Condition
from scipy.signal import lfilter

from emacm import Bearing, Motor, OrderPSD, OrderResampler, Recording, angle_from_vibration

TURN = 2 * np.pi
FS = 12_000
SPEEDS = (TURN * 11, TURN * 70)
NARROW = (TURN * 20, TURN * 29.9)


def machine(rate, *, fs=FS, orders=range(1, 13), snr=0.0, seed=0):
    """Lines of random size at orders of a shaft of this speed [Hz], in noise of this level [dB]."""
    rng = np.random.default_rng(seed)
    angle = TURN * np.cumsum(rate) / fs
    tones = sum(rng.uniform(0.4, 1) * np.cos(k * angle + rng.uniform(0, 6)) for k in orders)
    noise = rng.normal(size=len(angle))
    return tones / tones.std() * 10 ** (snr / 20) + noise, TURN * rate


def errors(found, velocity, fs=FS):
    """Return the median relative error of the speed in each reliable second."""
    seconds = np.flatnonzero(found.confidence.reliable)
    relative = np.abs(found.velocity / velocity - 1)
    return np.array([np.median(relative[int(s * fs) : int((s + 1) * fs)]) for s in seconds])


@pytest.mark.parametrize(
    ("rate", "snr"), [(17.37, 0), (24.18, -10), pytest.param(43.9, -10, marks=pytest.mark.slow)]
)
def test_a_constant_speed_is_found_within_a_thousandth(rate, snr):
    signal, velocity = machine(np.full(8 * FS, rate), snr=snr)
    found = angle_from_vibration(signal, FS, speeds=(0.85 * TURN * rate, 1.2 * TURN * rate))
    assert found.confidence.reliable.shape == (8,)
    assert found.confidence.fraction >= 0.75
    assert errors(found, velocity).max() < 1e-3


def test_a_slowly_drifting_speed_is_followed():
    times = np.arange(12 * FS) / FS
    signal, velocity = machine(23.3 * (1 + 0.003 * np.sin(0.6 * times)), seed=4)
    found = angle_from_vibration(signal, FS, speeds=NARROW)
    assert found.confidence.fraction > 0.5
    assert errors(found, velocity).max() < 4e-3
    assert np.median(errors(found, velocity)) < 1e-3


def test_the_lines_of_a_gear_are_enough_where_their_orders_are_known():
    signal, velocity = machine(np.full(9 * FS, 21.7), orders=(13, 26, 39, 52), seed=2)
    found = angle_from_vibration(signal, FS, speeds=SPEEDS, orders=[13, 26, 39, 52])
    assert found.confidence.fraction > 0.5
    assert errors(found, velocity).max() < 1e-3


def test_the_angle_is_the_integral_of_the_speed_and_makes_a_recording():
    signal, velocity = machine(np.full(8 * FS, 29.63), seed=5)
    found = angle_from_vibration(signal, FS, speeds=(TURN * 25, TURN * 35))
    assert found.angle.shape == found.velocity.shape == signal.shape
    assert found.angle[0] == 0
    seconds = np.flatnonzero(found.confidence.reliable) * FS
    assert len(seconds) >= 4
    turned = found.angle[seconds + FS - 1] - found.angle[seconds]
    np.testing.assert_allclose(turned, velocity[0] * (FS - 1) / FS, rtol=1e-3)
    run = Recording({"case": signal}, FS, angle=found.angle)
    over_angle = OrderResampler(TURN / 32).fit_transform([run])
    powers = OrderPSD(20).fit_transform(over_angle)[0]
    strongest = np.argsort(powers)[-4:] / 20
    np.testing.assert_allclose(strongest, np.rint(strongest), atol=0.051)


def test_a_short_recording_is_found_or_refused_but_never_wrong():
    signal, velocity = machine(np.full(2 * FS, 31.4), snr=6, seed=6)
    found = angle_from_vibration(signal, FS, speeds=(TURN * 24, TURN * 35))
    assert errors(found, velocity).max() < 2e-3


def noise(seed):
    return np.random.default_rng(seed).normal(size=8 * FS)


def mains(frequency, strength):
    times = np.arange(8 * FS) / FS
    hum = sum(np.sin(TURN * frequency * k * times + k) / k for k in range(1, 8))
    return strength * hum + noise(1)


def resonance(frequency):
    omega = TURN * frequency / FS
    radius = 1 - 0.02 * omega
    return lfilter([1], [1, -2 * radius * np.cos(omega), radius**2], noise(2)) + 0.1 * noise(3)


NO_SHAFT = {
    "noise": lambda: noise(0),
    "mains at 50 Hz": lambda: mains(50.02, 1.0),
    "mains at 60 Hz": lambda: mains(59.98, 20.0),
    "resonance at 77 Hz": lambda: resonance(77),
    "resonance at 412 Hz": lambda: resonance(412),
    "a tone": lambda: noise(4) + np.sin(TURN * 317.3 * np.arange(8 * FS) / FS),
}


@pytest.mark.parametrize(
    ("orders", "speeds"),
    [
        *((orders, SPEEDS) for orders in ([6], [13, 26, 39])),
        *((None, (TURN * low, TURN * high)) for low, high in ((20, 29.9), (45, 67))),
    ],
)
@pytest.mark.slow
@pytest.mark.parametrize("name", NO_SHAFT)
def test_a_signal_without_a_shaft_is_refused(name, orders, speeds):
    with pytest.raises(ValueError, match="no second of the signal shows a s"):
        angle_from_vibration(NO_SHAFT[name](), FS, speeds=speeds, orders=orders)


@lru_cache
def reversing(condition):
    return LaboratoryBench(unit=3, duration=8.0, fs=FS, cutoff=4500.0).record(condition)


@pytest.mark.slow
@pytest.mark.parametrize("channel", ["accelerometer", "current_a"])
@pytest.mark.parametrize("orders", [None, [6, 12, 18]])
@pytest.mark.parametrize("condition", [3, 5])
def test_a_shaft_that_reverses_all_the_time_is_refused(condition, orders, channel):
    # It repeats its motion at 0.4 to 2.1 Hz and has lines at all multiples of that.
    recording = reversing(condition)
    top = np.abs(recording.velocity).max()
    signal = recording.signals[channel]
    for low, high in ((0.3, 0.44), (0.8, 1.15)) if orders is None else ((0.3, 1.5),):
        with pytest.raises(ValueError, match="no second of the signal"):
            angle_from_vibration(signal, FS, speeds=(low * top, high * top), orders=orders)


@pytest.mark.slow
@pytest.mark.parametrize("unit", range(2))
def test_a_phase_current_gives_the_speed_of_long_strokes_of_the_bench(unit, monkeypatch):
    # 80 in at 4 in/s, much longer than the rod, at 160 rad/s; then back at the same speed.
    stroke = Condition("triangle", 0.0, 20.0, 0.05, 0.0, 278.0)
    monkeypatch.setattr("laboratory.bench.CONDITIONS", {2: stroke})
    recording = LaboratoryBench(unit=unit, duration=20.0, fs=FS, cutoff=4500.0).record(2)
    current = recording.signals["current_a"].astype(float)
    noisy = current + 10**-0.5 * current.std() * np.random.default_rng(unit).normal(size=20 * FS)
    found = angle_from_vibration(noisy, FS, speeds=(80, 240), orders=[5, 6, 7, 30, 42])
    # Reliable seconds are right: within 1 %, without a reversal.
    n_shaft = len(recording.velocity) // 20
    speeds = np.abs(recording.velocity[: 20 * n_shaft]).reshape(20, n_shaft)
    reliable = found.confidence.reliable
    assert reliable.sum() >= 3
    assert (speeds[reliable].min(axis=1) > 0.9 * speeds.max()).all()
    velocity = found.velocity.reshape(20, FS).mean(axis=1)
    np.testing.assert_allclose(velocity[reliable], speeds.mean(axis=1)[reliable], rtol=2e-3)


@pytest.mark.parametrize(
    ("seed", "rest"), [(0, 0.05), (1, 0.2), pytest.param(3, 0.6, marks=pytest.mark.slow)]
)
def test_a_second_with_a_reversal_is_not_reliable(seed, rest):
    # Six lines at 0 dB; the shaft reverses once, between long strokes of the same speed.
    times = np.arange(12 * FS) / FS
    rate = 22.7 * np.clip((6.4 - times) / (rest / 2), -1, 1)
    signal, _ = machine(rate, orders=range(1, 7), seed=seed)
    found = angle_from_vibration(signal, FS, speeds=(TURN * 20, TURN * 25))
    reliable = found.confidence.reliable
    assert not reliable[6]
    assert reliable[:4].all()
    assert reliable[9:].all()
    assert errors(found, TURN * 22.7).max() < 1e-3


@pytest.mark.slow
def test_a_multiple_of_the_frequency_of_a_motion_is_not_a_speed():
    # 14 Hz, 14 times that of the command; its lines are four bins of a frame apart.
    recording = LaboratoryBench(unit=7, duration=20.0, fs=FS, cutoff=4500.0).record(2)
    top = np.abs(recording.velocity).max()
    for low in (0.3, 0.44, 0.65, 0.95):
        with pytest.raises(ValueError, match="no second of the signal"):
            angle_from_vibration(
                recording.signals["accelerometer"], FS, speeds=(low * top, 1.49 * low * top)
            )


def test_seconds_without_the_shaft_are_not_reliable():
    signal, velocity = machine(np.full(12 * FS, 26.3), snr=3, seed=8)
    signal[6 * FS :] = noise(9)[: 6 * FS]
    found = angle_from_vibration(signal, FS, speeds=NARROW)
    reliable = found.confidence.reliable
    assert reliable[:3].all()
    assert not reliable[8:].any()
    assert found.confidence.fraction == reliable.mean()
    assert errors(found, velocity)[:3].max() < 1e-3


@pytest.fixture(scope="module")
def bearings():
    root = Path(__file__).parents[2].parent / "shared" / "data"
    file = Path(os.environ.get("EMACM_DATA", root)) / "bearings" / "cwru_faults_12k.npz"
    if not file.exists():
        pytest.skip("no recordings of bearings; set EMACM_DATA to their folder")
    return np.load(file)


# rpm: mean of the frequencies of at least 16 harmonics divided by their order, each measured alone
# at its maximum in a spectrum with a Hann window; they agree within 0.02 %. The names of the
# recordings state the nominal speed of the load. Sidebands of BPFO lie beside high orders in the
# last four; the fifth was recorded at another load than stated.
@pytest.mark.parametrize(
    ("name", "rpm"),
    [
        ("1730_B_7_DE12", 1721.5),
        ("1750_IR_14_DE12", 1751.2),
        ("1772_OR@6_14_DE12", 1771.7),
        ("1797_B_14_DE12", 1795.6),
        ("1772_OR@12_7_DE12", 1796.6),
        ("1730_OR@12_21_DE12", 1718.3),
        ("1750_OR@12_21_DE12", 1745.9),
        ("1772_OR@12_21_DE12", 1770.8),
        ("1797_OR@12_21_DE12", 1796.0),
    ],
)
def test_the_speed_of_a_real_motor_is_that_of_its_harmonics(bearings, name, rpm):
    found = angle_from_vibration(bearings[name].ravel(), FS, speeds=(TURN * 25, TURN * 35))
    assert found.confidence.fraction == 1
    assert found.velocity.mean() * 60 / TURN == pytest.approx(rpm, rel=5e-4)


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"speeds": (100.0, 100.0)}, ValueError, "the highest speed must be a number .*above 100"),
        ({"speeds": (0.0, 100.0)}, ValueError, "the lowest speed must be a number .*above 0"),
        ({"speeds": (TURN * 16.9, TURN * 25)}, ValueError, "but 1.01 s are needed"),
        ({"speeds": SPEEDS, "orders": "12"}, TypeError, "orders must be a list of numbers"),
        ({"speeds": SPEEDS, "orders": [2, 1.9]}, ValueError, "but 15.5 s are needed"),
        ({"speeds": 100.0}, TypeError, r"speeds must be a pair \(lowest, highest\) of rad/s"),
        ({"speeds": (100.0, 9e4)}, ValueError, "the highest speed must be .*below"),
        ({"speeds": SPEEDS, "parts": 5}, TypeError, "parts must be such as Bearing"),
        ({"speeds": SPEEDS, "parts": {"mesh": -1}}, ValueError, "mesh must be a number"),
        ({"speeds": SPEEDS, "parts": [Motor(6)]}, ValueError, "no line off the orders"),
        ({"speeds": SPEEDS, "orders": []}, ValueError, "orders must contain each order once"),
        ({"speeds": SPEEDS, "orders": [0]}, ValueError, "an order must be a number above 0"),
    ],
)
def test_invalid_parameters_are_refused(options, error, words):
    with pytest.raises(error, match=words):
        angle_from_vibration(noise(0)[:FS], FS, **options)


def damaged(shaft, family):
    """Lines of a shaft of 23.7 Hz and of the outer ring of a bearing, at these levels [dB]."""
    n_times, ring = 8 * FS, 0.99 * BEARING.lines()[0].order
    lines = machine(np.full(n_times, 23.7), snr=99, seed=1)[0]
    struck = machine(np.full(n_times, 23.7 * ring), snr=99, seed=2)[0]
    lines, struck = (wave / wave.std() for wave in (lines, struck))
    return 10 ** (shaft / 20) * lines + 10 ** (family / 20) * struck + noise(3)


BEARING = Bearing(9, 7.94, 39.04)


def test_the_lines_of_a_bearing_are_not_taken_for_a_shaft_where_it_is_known():
    found = angle_from_vibration(damaged(-12, 0), FS, speeds=SPEEDS, parts=BEARING)
    assert found.confidence.fraction > 0.5
    assert found.velocity.mean() / TURN == pytest.approx(23.7, rel=1e-3)


@pytest.mark.parametrize("levels", [(-12, -90), (-90, 0), (-12, 0)])
def test_a_wide_range_without_two_families_or_without_parts_is_refused(levels):
    parts = None if levels == (-12, 0) else [BEARING]
    with pytest.raises(ValueError, match=r"no second of the signal shows .* for certain"):
        angle_from_vibration(damaged(*levels), FS, speeds=SPEEDS, parts=parts)


def test_a_constant_signal_is_refused():
    with pytest.raises(ValueError, match="signal is constant"):
        angle_from_vibration(np.full(6 * FS, 3.0), FS, speeds=SPEEDS)
