"""A bench records what the laboratory of the thesis would, and its faults where they are."""

import pickle
from functools import cache

import numpy as np
import pytest
from laboratory import CONDITIONS, FAULT_ORDERS, FAULTS, LaboratoryBench
from laboratory.constants import PEAK_SPEED

from emacm import OrderPSD, OrderResampler

INNER = FAULT_ORDERS["inner ring"][0]


@cache
def record(condition=3, run=1, faults=None, *, duration=2.0, **constants):
    bench = LaboratoryBench(faults=dict(faults or ()), duration=duration, **constants)
    return bench.record(condition, run)


def spectrum(recording, channel, *, revolutions=8, max_order=45):
    """Order PSD of one channel."""
    resampler = OrderResampler(2 * np.pi / 128, channels=[channel], min_speed=1.0)
    psd = OrderPSD(revolutions, max_order=max_order)
    (power,) = psd.fit_transform(resampler.fit_transform([recording]))
    return psd.orders_, np.asarray(power)


def level(recording, channel, order, **more):
    """Highest density within 0.15 of an order."""
    orders, power = spectrum(recording, channel, **more)
    return power[np.abs(orders - order) <= 0.15].max()


def contrast(recording, channel, order):
    """Density at an order over the median of half an order to either side."""
    orders, power = spectrum(recording, channel, revolutions=12)
    away = np.abs(orders - order)
    return power[away <= 0.15].max() / np.median(power[(away > 0.25) & (away < 0.6)])


def same(one, other):
    return all(np.array_equal(one.signals[name], other.signals[name]) for name in one.channels)


def test_a_recording_has_the_channels_of_the_thesis_at_48_khz_and_more_if_wanted():
    plain, more = record(), record(phases="abc")
    assert plain.channels == ("lvdt", "velocity", "current_a", "accelerometer")
    assert set(plain.fs.values()) == {48_000}
    assert (plain.reference, plain.duration) == ("angle", pytest.approx(2))
    assert more.channels[2:5] == ("current_a", "current_b", "current_c")
    assert same(plain, more)
    assert np.abs(plain.signals["velocity"]).max() < PEAK_SPEED


@pytest.mark.parametrize("condition", [1, 2, 5])
def test_the_rod_follows_its_command_by_a_lag_of_the_position_loop(condition):
    # The speed is the gain of the loop, 40 / s, times the position error.
    bench = LaboratoryBench(duration=3.0, unit_spread=0, run_spread=0)
    truth = bench.truth(condition)
    error = truth.position_command - truth.position
    row = CONDITIONS[condition]  # Table 4.3
    centre = (truth.position_command.min() + truth.position_command.max()) / 2
    assert centre == pytest.approx(row.bias, abs=1e-3)
    per_period = {"sine": 2 * np.pi, "triangle": 4.0}[row.shape]  # fastest, in amplitudes
    fastest = per_period * row.frequency * abs(row.amplitude)
    assert np.abs(error).max() == pytest.approx(fastest / 40, rel=0.25)


def test_orders_of_rolling_faults_are_those_of_textbook_geometry():
    # Randall and Antoni, Rolling element bearing diagnostics, Eqs. (1) to (4), written out.
    gamma = 0.2478 * np.cos(np.radians(25))
    expected = {
        "inner ring": 5 * (1 + gamma),
        "outer ring": 5 * (1 - gamma),
        "ball": (1 - gamma**2) / 0.2478,  # it meets either ring once in a turn of its own
        "cage": (1 - gamma) / 2,
        "screw": 10 * (1 - 0.1323 * np.cos(np.radians(45))),
    }
    assert round(expected["inner ring"], 3) == 6.123  # chapter 4
    for fault, order in expected.items():
        assert FAULT_ORDERS[fault] == pytest.approx((order,), rel=1e-13)


def test_the_resolver_and_the_velocity_channel_show_the_same_motion():
    recording = record(4)
    velocity = recording.signals["velocity"].astype(float)
    turned = np.concatenate(([0.0], np.cumsum((velocity[1:] + velocity[:-1]) / 2))) / 48_000
    # Of both filters: sqrt(2) / w of second order at 800 Hz, 2.613 / w of fourth at 15 kHz.
    delay = np.sqrt(2) / (2 * np.pi * 800) + 2.613 / (2 * np.pi * 15_000)
    times = np.arange(len(turned)) / 48_000
    away = np.interp(times[::10] + delay, times, turned)[:-10] - recording.angle[:-10]
    assert np.ptp(away) < 0.05  # of 230 rad


@pytest.mark.parametrize("condition", [2, 3, 5])
def test_the_current_has_its_fundamental_at_order_6(condition):
    orders, power = spectrum(record(condition), "current_a", revolutions=4)
    assert orders[power.argmax()] == pytest.approx(6, abs=0.13)


ORDER_OF_SIGHT = {
    "inner ring": ("accelerometer", 3, 6 * INNER),
    "outer ring": ("accelerometer", 3, 8 * FAULT_ORDERS["outer ring"][0]),
    "ball": ("accelerometer", 3, 9 * FAULT_ORDERS["ball"][0]),
    "screw": ("accelerometer", 3, 2 * FAULT_ORDERS["screw"][0]),
    "eccentricity": ("accelerometer", 3, 1.0),
    "phase imbalance": ("current_a", 4, 18.0),
}


@pytest.mark.parametrize("fault", ORDER_OF_SIGHT)
def test_a_fault_raises_the_line_at_its_order(fault):
    channel, condition, order = ORDER_OF_SIGHT[fault]
    sick = record(condition, faults=((fault, 1.0),))
    assert level(sick, channel, order) > 5 * level(record(condition), channel, order)


@pytest.mark.slow
@pytest.mark.parametrize("m", [1, 2])
def test_a_defect_stands_in_the_current_at_6_plus_and_minus_its_order(m):
    # Eq. (2.4), of the screw: its order does not fall on a multiple of 6.
    (order,) = FAULT_ORDERS["screw"]
    sick, sound = record(5, faults=(("screw", 1.0),), duration=6.0), record(5, duration=6.0)
    for line in (abs(6 - m * order), 6 + m * order):
        ratio = level(sick, "current_a", line, revolutions=6)
        assert ratio > 2 * level(sound, "current_a", line, revolutions=6)


@pytest.mark.parametrize(("channel", "order"), [("lvdt", 12), ("lvdt", 36), ("velocity", 36)])
def test_the_motors_noise_stands_at_orders_12_and_36_as_the_parameter_says(channel, order):
    usual, little, none = record(4), *(record(4, electrical_noise=noise) for noise in (0.2, 0.0))
    assert contrast(usual, channel, order) > 100
    # A fifth of the noise has a 25th of its power. The velocity at order 12 has an error of the
    # resolver too.
    assert level(usual, channel, order) == pytest.approx(
        25 * level(little, channel, order), rel=0.2
    )
    assert level(none, channel, order) < 0.01 * level(usual, channel, order)


def test_the_same_bench_and_run_give_the_same_recording_in_any_order():
    bench = LaboratoryBench(unit=2, faults={"ball": 0.5, "jam": 0.1}, duration=0.2)
    order = [(4, 1), (1, 3), (4, 2)]
    forth = {key: bench.record(*key) for key in order}
    back = {key: bench.record(*key) for key in reversed(order)}
    assert forth == back
    assert pickle.loads(pickle.dumps(bench)).record(4, 2) == forth[4, 2]
    assert len({recording.digest for recording in forth.values()}) == 3
    healthy = LaboratoryBench(unit=2, duration=0.2).record(4, 1)
    none = LaboratoryBench(unit=2, faults=dict.fromkeys(FAULTS, 0.0), duration=0.2)
    assert none.record(4, 1) == healthy != forth[4, 1]
