"""The steps from a vibration signal to its speed, each on a signal with a known answer."""

import numpy as np
import pytest

from emacm.shaft.phase_refinement import (
    Course,
    refined_speed,
)
from emacm.shaft.speed_evidence import Whitened, measure, whiten
from emacm.shaft.vibration import (
    orders_stand_out,
)

TURN = 2 * np.pi
FS = 1000.0


def noise(n_times, seed=0):
    return np.random.default_rng(seed).normal(size=n_times)


def tones(frequencies, times, amplitude=1.0):
    return amplitude * sum(np.cos(TURN * f * times + f * f) for f in frequencies)


# Spectra of frames


# Evidence by rank


def test_evidence_is_highest_at_the_speed_and_the_rate_of_change_of_the_lines():
    times = np.arange(8000) / FS
    rate = 7 * 2 / (450 * 16)  # two bins over a frame are one step, at the highest frequency
    centred = times - 2  # the first of three frames of 4 s
    turns = 21.3 * (centred + rate * centred**2 / 2)
    signal = 0.15 * sum(np.cos(TURN * k * turns + k * k) for k in range(1, 21)) + noise(8000)
    white = Whitened(signal, FS, 450.0, np.empty(0))
    found = measure(white, 4.0, (15.0, 40.0), None, n_rates=15)
    assert found.times.tolist() == [2, 4, 6]
    assert found.duration == 4
    step = 0.5 * 0.25 / 24  # half a bin at order 24
    np.testing.assert_allclose(np.diff(found.speeds), step, rtol=1e-6)
    assert found.speeds[0] == 15
    assert 40 - step < found.speeds[-1] <= 40 + 1e-9
    assert found.ratios.shape == found.rates.shape == (3, len(found.speeds))
    best = found.ratios.argmax(axis=1)
    speeds = 21.3 * (1 + rate * (found.times - 2))
    np.testing.assert_allclose(found.speeds[best], speeds, rtol=1e-3)
    assert found.fastest == pytest.approx(rate)
    np.testing.assert_allclose(np.unique(found.rates) / rate, np.arange(-7, 8) / 7, atol=1e-12)
    assert found.rates[0, best[0]] == pytest.approx(rate, rel=0.3)
    assert found.ratios.max(axis=1).min() > 15
    assert np.median(found.ratios) < 0


def test_known_orders_are_searched_for_at_these_only():
    times = np.arange(4000) / FS
    white = Whitened(tones([21.3 * 3, 21.3 * 7], times) + noise(4000), FS, 450.0, np.empty(0))
    found = measure(white, 4.0, (10.0, 40.0), np.array([3.0, 7.0]), n_rates=1)
    assert found.speeds[found.ratios[0].argmax()] == pytest.approx(21.3, rel=4e-3)
    assert np.diff(found.speeds).mean() == pytest.approx(0.5 * 0.25 / 7)
    assert found.fastest == 0


def test_lines_of_the_mains_are_no_evidence():
    times = np.arange(4000) / FS
    signal = tones([25, 50, 75, 100], times) + noise(4000)
    options = ((15.0, 40.0), np.array([2.0, 4.0]))
    plain = measure(Whitened(signal, FS, 450.0, np.empty(0)), 4.0, *options, n_rates=1)
    supply = np.array([50.0, 100.0])
    without = measure(Whitened(signal, FS, 450.0, supply), 4.0, *options, n_rates=1)
    shaft = np.abs(plain.speeds - 25).argmin()
    assert plain.speeds[plain.ratios[0].argmax()] == pytest.approx(25, rel=5e-3)
    assert without.ratios[0, shaft] == 0


# The background


def test_whitening_flattens_a_resonance_removes_the_mains_and_lowers_the_rate():
    n_times = 10_007  # a prime number
    times = np.arange(n_times) / FS
    coloured = np.convolve(noise(n_times + 40), np.hanning(8), mode="valid")[:n_times]
    signal = 5 + coloured + tones([33.3], times, 4) + tones([50, 100, 150], times, 2)
    found = whiten(signal, FS, 120.0, 4.0)
    assert found.mains.tolist() == [50, 100]
    assert found.highest == 120
    assert 480 <= found.fs < 500
    assert len(found.signal) == pytest.approx(n_times * found.fs / FS, abs=1)
    assert found.signal.std() == pytest.approx(1)
    power = np.abs(np.fft.rfft(found.signal)) ** 2
    axis = np.fft.rfftfreq(len(found.signal), 1 / found.fs)
    assert axis[power.argmax()] == pytest.approx(33.3, abs=0.11)
    flat = [np.median(power[(axis > low) & (axis < low + 14)]) for low in (2, 35, 70, 103)]
    np.testing.assert_allclose(flat, np.mean(flat), rtol=0.5)
    assert power[axis > 121].max() < 1e-3 * np.mean(flat)
    for line in (50, 100):
        assert power[np.abs(axis - line) < 0.15].max() < 0.3 * np.mean(flat)


# Paths of speeds


# Refinement by phase


def course(white, speeds, trusted, *, rates=0.0, duration=2.0, n_seconds=8):
    times = 1.0 + np.arange(len(speeds))
    rates = np.full(len(speeds), rates)
    speeds, trusted = np.array(speeds, float), np.array(trusted)
    return Course(white, times, speeds, rates, trusted, duration, np.ones(n_seconds, bool), "")


def test_a_coarse_speed_is_refined_to_that_of_its_lines_where_they_last():
    times = np.arange(8000) / FS
    speed = 20 * (1 + 0.002 * np.sin(0.5 * times))
    turns = np.cumsum(speed) / FS
    signal = sum(np.cos(TURN * k * turns + k) for k in range(1, 7)) + 0.3 * noise(8000)
    signal[6500:] = noise(1500, 3)
    white = Whitened(signal, FS, 450.0, np.empty(0))
    found, lasting = refined_speed(course(white, [20.02] * 7, [True] * 7), np.arange(1.0, 9))
    assert np.abs(found[500:5000] / speed[500:5000] - 1).max() < 2e-4
    assert lasting.tolist() == [True] * 6 + [False] * 2


# Families of lines


@pytest.mark.parametrize(("n_families", "clear"), [(0, True), (1, True), (2, False)])
@pytest.mark.parametrize("rate", [0.0, 0.01])
def test_few_families_of_lines_may_lie_between_the_orders(n_families, clear, rate):
    times = np.arange(8000) / 2000
    centred = times - 3999.5 / 2000
    turns = 40 * (centred + rate * centred**2 / 2)
    orders = np.arange(1.0, 9)
    offsets = np.array([0, 0.2, 0.4])[: n_families + 1]  # five bins each, and seven may be as high
    places = np.add.outer(orders, offsets).ravel()
    signal = sum(np.cos(TURN * place * turns + place**2) for place in places)
    signal = signal + 0.1 * noise(8000)
    assert orders_stand_out(signal, 40.0, rate, orders, 2000, 1000) is clear


@pytest.mark.parametrize(
    ("own", "other", "clear"),
    [(1, 0.08, True), (1, 0.11, False), (0.06, 0, True), (0.03, 0, False)],
)
def test_families_count_where_their_lines_stand_out_of_the_noise(own, other, clear):
    times, orders = np.arange(8000) / 2000, np.arange(1.0, 9)
    others = np.add.outer(orders, [0.2, 0.4, 0.7]).ravel()
    signal = tones(40 * orders, times, own) + tones(40 * others, times, other) + noise(8000)
    assert orders_stand_out(signal, 40.0, 0.0, orders, 2000, 1000) is clear
