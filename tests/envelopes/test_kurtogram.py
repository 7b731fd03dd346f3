"""Spectral kurtosis is 0 for Gaussian noise, -1 for a tone, and finds the band of impacts."""

import numpy as np
import pytest
from scipy import signal as filters
from sklearn.pipeline import make_pipeline

from emacm import (
    EnvelopeDetector,
    OrderPSD,
    OrderResampler,
    Recording,
    kurtogram,
    spectral_kurtosis,
)
from emacm.envelopes.kurtogram import Kurtogram

FS = 11_000.0
TURN = 2 * np.pi


def noise(n_times=200_000, seed=0):
    return np.random.default_rng(seed).standard_normal(n_times)


def struck(frequency, *, period=701, n_times=200_000, decay=25):
    """Impacts that excite a resonance."""
    impulses = np.zeros(n_times)
    impulses[50::period] = 1.0
    times = np.arange(400)
    ring = np.exp(-times / decay) * np.sin(TURN * frequency / FS * times)
    return np.convolve(impulses, ring)[:n_times]


def test_gaussian_noise_has_none_in_any_band():
    found = kurtogram(noise(), FS)
    for kurtosis in found.kurtosis[:4]:  # narrower bands have fewer values
        assert np.abs(kurtosis.mean()) < 0.03
        assert np.abs(kurtosis).max() < 0.3
    _, kurtosis = spectral_kurtosis(noise(), FS, n_per_segment=128)
    assert np.abs(kurtosis).max() < 0.2


def test_short_bursts_have_the_inverse_of_their_share_of_time():
    # Noise that is on for a share p of the time has E|Y|^4 / (E|Y|^2)^2 = 2 / p.
    signal = noise(400_000) * (np.arange(400_000) % 20_000 < 4_000)
    _, kurtosis = spectral_kurtosis(signal, FS, n_per_segment=64)
    assert kurtosis.mean() == pytest.approx(2 / 0.2 - 2, rel=0.05)


@pytest.mark.parametrize("frequency", [1450, 3300])
def test_impacts_are_found_in_the_band_of_their_resonance(frequency):
    # The other frequencies are louder.
    signal = struck(frequency) + 0.2 * noise() + np.sin(TURN * 610 * np.arange(200_000) / FS)
    low, high = kurtogram(signal, FS).band
    assert low < frequency < high
    assert high - low < 1600
    frequencies, kurtosis = spectral_kurtosis(signal, FS)
    assert abs(frequencies[kurtosis.argmax()] - frequency) < 400


def test_it_is_the_kurtosis_of_the_signal_in_each_band():
    signal = struck(2000, n_times=1500) + 0.1 * noise(1500)
    found = kurtogram(signal, FS)
    for width, centres, kurtosis in zip(found.widths, found.centres, found.kurtosis, strict=True):
        n_bands = round(FS / width)
        taps = filters.firwin(8 * n_bands, 0.5, fs=n_bands)
        starts = range(0, len(signal) - len(taps) + 1, n_bands // 2)
        frames = np.array([signal[k : k + len(taps)] * taps for k in starts])
        times = np.arange(len(taps)) / FS
        power = np.abs(frames @ np.exp(-1j * TURN * np.outer(times, centres))) ** 2
        expected = (power**2).mean(axis=0) / power.mean(axis=0) ** 2 - 2
        np.testing.assert_allclose(kurtosis, expected, rtol=1e-9)


@pytest.mark.parametrize("n_per_segment", [8, 9, 30])
def test_spectral_kurtosis_is_that_of_the_lines_of_overlapping_segments(n_per_segment):
    signal = struck(2000, n_times=400) + 0.1 * noise(400)
    frequencies, kurtosis = spectral_kurtosis(signal, FS, n_per_segment=n_per_segment)
    starts = range(0, 401 - n_per_segment, n_per_segment // 4)
    window = np.sin(np.pi * np.arange(n_per_segment) / n_per_segment) ** 2
    frames = np.array([signal[k : k + n_per_segment] * window for k in starts])
    power = np.abs(np.fft.rfft(frames)) ** 2
    expected = (power**2).mean(axis=0) / power.mean(axis=0) ** 2 - 2
    axis = np.fft.rfftfreq(n_per_segment, 1 / FS)
    inner = (axis > 0) & (axis < FS / 2)
    np.testing.assert_allclose(frequencies, axis[inner])
    np.testing.assert_allclose(kurtosis, expected[inner], rtol=1e-9)


def test_the_band_is_that_of_the_largest_kurtosis_and_of_equal_ones_the_widest():
    centres = (np.array([4.0, 6, 8]), np.array([2.0, 3, 4, 5]))
    found = Kurtogram((4.0, 2.0), centres, (np.array([0, 1, 2.0]), np.array([0, 3.0, 1, 0])))
    assert found.band == (2, 4)
    found = Kurtogram((4.0, 2.0), centres, (np.array([0, 1, 3.0]), np.array([0, 3.0, 1, 0])))
    assert found.band == (6, 10)


def recording(frequency, n_times=200_000):
    signal = struck(frequency, n_times=n_times) + 0.2 * noise(n_times)
    return Recording({"sound": signal}, FS, velocity=np.full(len(signal), TURN * 5))


@pytest.mark.slow
def test_the_detector_takes_the_band_of_each_recording():
    runs = [recording(1450, 70_000), recording(3300, 70_000)]
    spectra = OrderResampler(TURN / 64), OrderPSD(10, max_order=10)
    chain = make_pipeline(EnvelopeDetector("kurtogram"), *spectra)
    power = np.asarray(chain.fit_transform(runs))
    orders = chain[-1].orders_
    # The strikes are FS / 701 = 15.69 Hz apart: order 3.138.
    heights = power[:, 31] / np.median(power[:, 20:45], axis=1)
    assert orders[31] == pytest.approx(3.1)
    assert heights.min() > 30
    bands = [run.series["sound"]._band for run in chain[0].transform(runs)]
    assert bands == [kurtogram(run.signals["sound"], FS).band for run in runs]
    assert chain[0].bands_ == {"sound": "kurtogram"}


@pytest.mark.parametrize(
    ("signal", "error", "match"),
    [
        (noise(100), ValueError, "100 samples; a kurtogram needs at least 320"),
        (noise(1000).reshape(2, -1), ValueError, "one-dimensional"),
        (np.zeros(5000), ValueError, "no power at some frequencies"),
        (["a"], (TypeError, ValueError), "signal"),
        (np.full(5000, np.nan), ValueError, "signal must be finite, got nan at sample 0"),
    ],
)
def test_what_has_no_kurtogram_is_refused(signal, error, match):
    with pytest.raises(error, match=match):
        kurtogram(signal, FS)
