"""The data acquisition records what its sensors, filter and converter let through."""

import numpy as np
import pytest
from scipy import signal as filters

from emacm.simulation.conditions import TRANSDUCERS
from emacm.simulation.sensors import NOISE, cable_noise, measured, resolver_angle

FS = 48_000
TIMES = np.arange(2 * FS) / FS


def recorded(sensor, values, seed=0, **more):
    rng = np.random.default_rng(seed)
    return measured(sensor, values, rng, fs=FS, cutoff=15_000, **more)


@pytest.mark.parametrize("hertz", [1000, 10_000, 15_000, 19_000, 22_000])
def test_the_conditioning_filter_is_a_butterworth_of_fourth_order_at_15_khz(hertz):
    tone = 5 * np.sin(2 * np.pi * hertz * TIMES)
    out = recorded("accelerometer", tone)
    amplitude = 2 * np.abs(np.mean(out * np.exp(-2j * np.pi * hertz * TIMES)))
    # Digital: the axis is bent by the tangent.
    bent = np.tan(np.pi * hertz / FS) / np.tan(np.pi * 15_000 / FS)
    assert amplitude / 5 == pytest.approx(1 / np.sqrt(1 + bent**8), abs=1e-3)


@pytest.mark.parametrize("sensor", NOISE)
def test_above_15_khz_there_is_less_noise(sensor):
    hertz, psd = filters.welch(recorded(sensor, np.zeros_like(TIMES)), FS, nperseg=4096)
    passed, stopped = psd[(hertz > 1000) & (hertz < 12_000)], psd[hertz > 21_000]
    assert stopped.mean() < 0.05 * passed.mean()


@pytest.mark.parametrize("sensor", NOISE)
def test_noise_and_steps_are_those_stated_in_volts(sensor):
    volts = recorded(sensor, np.zeros_like(TIMES)) / TRANSDUCERS[sensor].scale
    # Of half the sampling rate the filter leaves 15 of 24 kHz and a bit.
    assert NOISE[sensor] * 0.75 < volts.std() < NOISE[sensor] * 0.85
    step = 20 / 2**16
    assert np.abs(volts / step - np.round(volts / step)).max() < 1e-3


@pytest.mark.parametrize("sensor", NOISE)
def test_a_channel_clips_at_its_full_scale(sensor):
    peak = TRANSDUCERS[sensor].peak
    out = recorded(sensor, 2 * peak * np.sign(np.sin(2 * np.pi * TIMES)))
    assert out.max() == pytest.approx(peak, rel=1e-6)
    assert out.min() == pytest.approx(-peak, rel=1e-6)


def test_a_recording_starts_without_a_transient_of_the_filter():
    out = recorded("lvdt", np.full_like(TIMES, 2.0))
    assert np.abs(out - 2).max() < 0.5 * 6 * NOISE["lvdt"]


@pytest.mark.parametrize("sensor", ["lvdt", "velocity"])
def test_the_motor_is_heard_at_orders_12_and_36(sensor):
    turns = 2 * np.pi * np.arange(10_000) / 1000
    noise = cable_noise(sensor, turns, np.full_like(turns, 0.5), 1.0, 0.3)
    spectrum = np.abs(np.fft.rfft(noise)) / 5000
    assert np.flatnonzero(spectrum > 1e-9).tolist() == [120, 360]  # of 10 revolutions
    doubled = cable_noise(sensor, turns, np.full_like(turns, 0.5), 2.0, 0.3)
    assert doubled == pytest.approx(2 * noise)


def test_it_is_heard_louder_at_higher_current():
    turns = np.linspace(0, 10, 1000)
    idle, busy = (
        np.abs(cable_noise("lvdt", turns, np.full(1000, i), 1.0, 0.0)).max() for i in (0.0, 1.0)
    )
    assert 0 < idle < busy


@pytest.mark.parametrize("sensor", ["current", "accelerometer"])
def test_it_is_not_heard_elsewhere(sensor):
    assert cable_noise(sensor, TIMES, TIMES, 1.0, 0.0) == 0


def test_the_resolver_tells_the_angle_within_a_fraction_of_a_milliradian():
    angle = 1.0 + 40 * np.sin(2 * np.pi * TIMES)
    measured_angle = resolver_angle(angle, np.random.default_rng(0))
    assert len(measured_angle) == len(angle) / 10
    # 1e-4 of unequal amplitudes, five standard deviations of noise.
    assert np.abs(measured_angle - angle[::10]).max() < 1e-4 + 5 * 5e-5


def test_the_resolver_starts_within_half_a_revolution():
    measured_angle = resolver_angle(100 + TIMES, np.random.default_rng(0))
    assert abs(measured_angle[0]) <= np.pi
    assert measured_angle[-1] - measured_angle[0] == pytest.approx(2, abs=1e-3)
