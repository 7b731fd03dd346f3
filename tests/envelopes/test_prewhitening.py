"""Prewhitening sets all frequencies to one level, and keeps impacts."""

import pickle
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal as filters
from sklearn.pipeline import make_pipeline

from emacm import CepstralPrewhitening, EnvelopeDetector, OrderPSD, OrderResampler, Recording
from emacm.envelopes.envelope import EnvelopeSeries
from emacm.envelopes.prewhitening import WhitenedSeries, whiten

FS = 7_000.0
N_TIMES = 30_011  # several segments, the last of which is no multiple of the others
TIMES = np.arange(N_TIMES) / FS
TURN = 2 * np.pi


def prewhitened(signal, fs):
    return WhitenedSeries(signal, fs)[:]


def noise(n_times=N_TIMES, seed=0):
    return np.random.default_rng(seed).standard_normal(n_times)


def coloured(seed=0):
    """Noise through a resonance at 1.1 kHz that is 40 dB high."""
    poles = 0.99 * np.exp(1j * TURN * 1100 / FS)
    return filters.lfilter([1], np.poly([poles, poles.conj()]).real, noise(seed=seed))


def level(signal, low, high):
    """Mean power spectral density between two frequencies [dB]."""
    frequencies, psd = filters.welch(signal, FS, nperseg=1024)
    return 10 * np.log10(psd[(frequencies > low) & (frequencies < high)].mean())


def recording(signal, fs=FS, **meta):
    return Recording({"sound": signal}, fs, velocity=np.full(len(signal), 63.0), meta=meta)


def test_coloured_noise_becomes_white():
    bands = [(200, 700), (1050, 1150), (1500, 2200), (2500, 3300)]
    before = [level(coloured(), *band) for band in bands]
    after = [level(prewhitened(coloured(), FS), *band) for band in bands]
    assert max(before) - min(before) > 30
    # The mean of the density of 300 and more estimates of 2 degrees of freedom: 0.25 dB.
    assert after == pytest.approx([10 * np.log10(2 / FS)] * 4, abs=0.8)


def test_the_magnitude_of_each_line_of_a_segment_is_the_same():
    magnitude = np.abs(np.fft.rfft(whiten(coloured()[:5001])))
    np.testing.assert_allclose(magnitude[1:], np.sqrt(5001), rtol=1e-9)
    assert magnitude[0] < 1e-9


def test_a_tone_far_above_the_noise_comes_down_to_its_level():
    for amplitude in (5, 500, 5000):
        tone = amplitude * np.sin(TURN * 440 * TIMES + 0.3)
        white = prewhitened(tone + noise(), FS)
        frequencies, psd = filters.welch(white, FS, nperseg=4096)
        near = np.abs(frequencies - 440) < 10
        assert psd[near].max() < 5 * np.median(psd)  # of a few estimates, 3 are common
        assert white.var() == pytest.approx(1, abs=0.2)


@given(st.floats(1e-9, 1e9), st.booleans())
def test_gain_changes_nothing(gain, negative):
    signal = coloured()[:9000]
    factor = -gain if negative else gain
    expected = prewhitened(signal, FS) * (-1 if negative else 1)
    np.testing.assert_allclose(prewhitened(factor * signal, FS), expected, atol=1e-6)


def test_impacts_stay_where_they_were():
    signal = np.zeros(N_TIMES)
    signal[15_000] = 1.0  # an impulse has all frequencies alike already
    white = prewhitened(signal + 1e-3 * noise(), FS)
    assert white.argmax() == 15_000  # and has the same sign
    assert abs(white[15_000]) > 20 * white[14_000:14_900].std()


def test_between_segments_the_level_stays():
    white = np.mean([prewhitened(coloured(seed), FS) ** 2 for seed in range(40)], axis=0)
    series = WhitenedSeries(TIMES, FS)
    n_segment = series._hop + series.fade
    assert n_segment < N_TIMES // 4
    local = white[: N_TIMES // 64 * 64].reshape(-1, 64).mean(axis=1)
    # Of 40 x 64 squares, the mean scatters by 3 %; where segments overlap they are not all alike.
    assert local[4:-4] == pytest.approx(np.ones(len(local) - 8), abs=0.45)


@pytest.mark.parametrize("n_times", [2, 3, 255, 4096, 4097, 7937, 7936])
def test_every_length_is_whitened(n_times):
    white = prewhitened(noise(n_times), FS)
    assert white.shape == (n_times,)
    assert np.isfinite(white).all()
    assert 0.5 < white.std() < 1.2


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("key", [slice(4000, 4100), slice(69_000, None)], ids=str)
def test_what_is_read_in_part_is_what_the_whole_has_there(key, single):
    signal = noise(70_001).astype(np.float32 if single else np.float64)
    expected = prewhitened(signal, FS)[key]
    np.testing.assert_allclose(WhitenedSeries(signal, FS)[key], expected, rtol=1e-5, atol=1e-5)


def test_float32_stays_float32():
    single = prewhitened(coloured().astype(np.float32), FS)
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, prewhitened(coloured(), FS), atol=5e-3)


def test_the_chosen_channels_alone_are_whitened():
    run = Recording({"torque": noise(), "sound": coloured()}, FS, velocity=9.0, meta={"u": 1})
    step = CepstralPrewhitening(channels=["sound"]).fit([run])
    assert list(step.get_feature_names_out()) == ["torque", "sound"]
    (white,) = step.transform([run])
    assert white.signals["torque"] is run.signals["torque"]
    np.testing.assert_array_equal(white.signals["sound"], prewhitened(coloured(), FS))
    assert white.meta == run.meta
    assert white.fs == run.fs
    assert dict(white.units) == {"sound": "1"}


@pytest.mark.slow
def test_a_long_recording_is_never_held_as_a_whole():
    n_times = 3_000_000
    sound = noise(n_times).astype(np.float32)
    sound.flags.writeable = False
    run = Recording({"sound": sound}, FS, velocity=np.full(n_times, 60.0, np.float32))
    steps = OrderResampler(TURN / 64), OrderPSD(8, max_order=10)
    for first in ([CepstralPrewhitening()], []):  # a whitened signal is filtered in its spectra
        chain = make_pipeline(*first, EnvelopeDetector((300, 3200)), *steps).fit([run])
        chain.transform([run])  # makes what is made once
        tracemalloc.start()
        chain.transform([run])
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < sound.nbytes


@pytest.mark.parametrize(
    ("options", "X", "error", "match"),
    [
        ({}, [noise(5)], TypeError, "entry 0 of X .* CepstralPrewhitening, got a ndarray"),
        ({"channels": "sound"}, [recording(noise())], TypeError, r"such as \['sound'\]"),
        (
            {"channels": ["lvdt"]},
            [recording(noise(), unit="A")],
            ValueError,
            r"recording 0 \(unit='A'\): it has no channel 'lvdt'",
        ),
    ],
)
def test_wrong_input_is_refused(options, X, error, match):
    with pytest.raises(error, match=match):
        CepstralPrewhitening(**options).fit(X)


def test_a_pickled_envelope_of_a_whitened_signal_is_the_same():
    series = EnvelopeSeries(WhitenedSeries(noise(), FS), FS, (FS / 32, 15 * FS / 32))
    assert series._whitened is not None  # whitening and filtering in one step
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(series))[:], series[:])
