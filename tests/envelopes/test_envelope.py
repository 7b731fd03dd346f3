"""Facts about envelopes of bands, and about recordings that hold them."""

import numpy as np
import pytest
from laboratory import FAULT_ORDERS, LaboratoryBench
from scipy import signal as filters
from sklearn.pipeline import make_pipeline

from emacm import EnvelopeDetector, OrderPSD, OrderResampler, Recording
from emacm.envelopes.envelope import EnvelopeSeries, analytic_filter, kaiser_order

TURN = 2 * np.pi
FS = 10_000.0
TIMES = np.arange(20_000) / FS
BAND = (1500.0, 2500.0)
REACH = kaiser_order(*BAND, FS)[0] // 2
INNER = slice(REACH, -REACH)


def noise(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


def tone(frequency, amplitude=1.0):
    return amplitude * np.sin(TURN * frequency * TIMES + 0.3)


def envelope(signal, fs, band, **options):
    return EnvelopeSeries(signal, fs, band, **options)[:]


# The envelope


def test_the_squared_envelope_of_a_modulated_tone_is_the_square_of_its_modulation():
    modulation = 1 + 0.6 * np.cos(TURN * 30 * TIMES)
    squared = envelope(3 * modulation * tone(2000), FS, BAND)
    np.testing.assert_allclose(squared[INNER], 9 * modulation[INNER] ** 2, atol=9e-3)
    plain = envelope(3 * modulation * tone(2000), FS, BAND, squared=False)
    np.testing.assert_allclose(plain[INNER], 3 * modulation[INNER], atol=3e-3)


def test_it_is_the_analytic_signal_of_what_a_filter_without_delay_lets_through():
    signal = noise(20_000)
    taps = analytic_filter(*BAND, FS)
    passed = filters.fftconvolve(signal, taps.real, mode="same")
    expected = np.abs(filters.hilbert(passed)) ** 2
    ours = envelope(signal, FS, BAND)
    away = slice(2000, -2000)  # the transform of the whole reaches far from the ends
    np.testing.assert_allclose(ours[away], expected[away], atol=2e-3 * expected.max())


def test_the_mean_of_the_squared_envelope_of_noise_is_twice_its_power_in_the_band():
    squared = envelope(noise(400_000), FS, BAND)
    # Unit noise has 1000 / 5000 of its power in the band; 80 000 of its values are free. As
    # the edges fall over an eighth of the width to either side, a twentieth is lost.
    assert squared.mean() == pytest.approx(0.95 * 2 * 1000 / 5000, rel=0.015)


def test_beyond_its_ends_the_signal_is_its_mirror_image():
    signal = noise(3000)
    mirrored = np.concatenate([signal[:0:-1], signal, signal[-2::-1]])
    np.testing.assert_allclose(
        envelope(signal, FS, BAND), envelope(mirrored, FS, BAND)[2999:5999], rtol=1e-9, atol=1e-12
    )


# Computed when read


@pytest.mark.parametrize(
    "key", [slice(100, 4000), slice(7, 9), slice(3, 5000, 3), slice(300, 100), 5, -1], ids=str
)
def test_what_is_read_in_part_is_what_the_whole_has_there(key):
    signal = noise(5000)
    np.testing.assert_allclose(
        EnvelopeSeries(signal, FS, BAND)[key],
        envelope(signal, FS, BAND)[key],
        rtol=1e-9,
        atol=1e-12,
    )


# Recordings


def knocking(seed=0, *, order=3.1, strength=1.0, fs=FS, dtype=float, **meta):
    """A resonance at 2 kHz is struck `order` times a turn, of a shaft that slows down."""
    rng = np.random.default_rng(seed)
    times = np.arange(int(2 * fs)) / fs
    velocity = TURN * (12 - 2 * times)
    angle = np.cumsum(velocity) / fs
    struck = np.diff(np.floor(order * angle / TURN), prepend=0) > 0
    ring = np.exp(-np.arange(200) / 40) * np.sin(TURN * 2000 / fs * np.arange(200))
    sound = strength * np.convolve(struck, ring)[: len(times)] + 0.1 * rng.normal(size=len(times))
    signals = {"sound": sound.astype(dtype), "current": np.sin(angle[::10]).astype(dtype)}
    rates = {"sound": fs, "current": fs / 10}
    return Recording(signals, rates, velocity=velocity, shaft_fs=fs, meta=meta)


def contrast(recording, order, *before):
    """Density at an order of the accelerometer, over the median of what lies beside it."""
    resampler = OrderResampler(TURN / 64, channels=["accelerometer"], min_speed=1.0)
    pipe = make_pipeline(*before, resampler, OrderPSD(8, max_order=30))
    power = np.asarray(pipe.fit_transform([recording]))[0]
    away = np.abs(pipe[-1].orders_ - order)
    return power[away <= 0.15].max() / np.median(power[(away > 0.25) & (away < 1.5)])


def test_a_damaged_inner_ring_shows_in_the_envelope_and_not_in_the_plain_spectrum():
    order = FAULT_ORDERS["inner ring"][0]
    detector = EnvelopeDetector((1000, 3000), channels=["accelerometer"])
    sound, damaged = (
        LaboratoryBench(faults=faults, duration=2.0).record(condition=5)
        for faults in ({}, {"inner ring": 0.5})
    )
    assert contrast(damaged, order) < 2 * contrast(sound, order)  # waviness of a healthy ring
    assert contrast(sound, order, detector) < 5
    assert contrast(damaged, order, detector) > 20


def test_the_other_channels_shaft_and_meta_stay():
    run = knocking(unit="A")
    (heard,) = EnvelopeDetector(BAND, channels=["sound"]).fit_transform([run])
    assert isinstance(heard, Recording)
    assert heard.channels == run.channels
    assert heard.meta == run.meta
    assert heard.fs == run.fs
    assert heard.duration == run.duration
    assert heard.signals["current"] is run.signals["current"]
    np.testing.assert_array_equal(heard.velocity, run.velocity)
    np.testing.assert_array_equal(heard.signals["sound"], envelope(run.signals["sound"], FS, BAND))
    assert not heard.signals["sound"].flags.writeable


@pytest.mark.parametrize("antialias", [True, False])
@pytest.mark.parametrize("dtype", [np.float32, float])
def test_over_the_angle_it_is_what_the_whole_envelope_is(antialias, dtype):
    run = knocking(dtype=dtype)
    full = Recording({"sound": envelope(run.signals["sound"], FS, BAND)}, FS, velocity=run.velocity)
    resampler = OrderResampler(TURN / 512, antialias=antialias, channels=["sound"])
    detector = EnvelopeDetector(BAND, channels=["sound"])
    (heard,) = make_pipeline(detector, resampler).fit_transform([run])
    expected = resampler.fit_transform([full])[0].strokes[0].signals
    assert heard.dtype == dtype
    np.testing.assert_allclose(heard.strokes[0].signals, expected, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize(
    ("options", "error", "match"),
    [
        ({"band": BAND}, ValueError, r"recording 0 \(unit='A'\): channel 'current': band reaches"),
        ({"band": (9, 1)}, ValueError, "from a lower to a higher"),
        ({"band": (0, 1500)}, ValueError, "edges of band"),
        ({"band": 1500}, TypeError, r"pair \(low, high\)"),
        ({"band": {"sound": BAND}}, TypeError, r"pair \(low, high\)"),
        ({"band": BAND, "channels": ["lvdt"]}, ValueError, r"recording 0 .*no channel 'lvdt'"),
        ({"band": BAND, "channels": "sound"}, TypeError, "list of names"),
        ({"band": BAND, "squared": "no"}, ValueError, "squared must be one of"),
        ({"band": (2000, 2001), "channels": ["sound"]}, ValueError, "needs a filter of 20.1 s"),
    ],
)
def test_wrong_parameters_are_refused_by_fit(options, error, match):
    with pytest.raises(error, match=match):
        EnvelopeDetector(**options).fit([knocking(unit="A")])


@pytest.mark.parametrize("band", [(5, 3000), (2000, 4990)])
def test_a_band_at_the_edge_with_a_long_filter_warns(band):
    with pytest.warns(UserWarning, match=r"filter lasts .* Keep it within"):
        EnvelopeDetector(band, channels=["sound"]).fit([knocking()])


def test_a_slower_recording_is_named_with_channel_and_rate():
    detector = EnvelopeDetector(BAND, channels=["sound"]).fit([knocking()])
    match = r"recording 1: channel 'sound': band reaches to 2500 Hz, but at a sampling rate of 4000"
    with pytest.raises(ValueError, match=match):
        detector.transform([knocking(), knocking(fs=4000.0)])


# Several bands, relative bands, bands at the edge


def test_each_of_several_bands_has_an_envelope_of_its_own_in_place_of_the_channel():
    bands = [(1500, 2500), (3000, 4500)]
    detector = EnvelopeDetector(bands, channels=["sound"]).fit([knocking()])
    names = ["sound_1500-2500Hz", "sound_3000-4500Hz", "current"]
    assert list(detector.get_feature_names_out()) == names
    (found,) = detector.transform([knocking()])
    for name, band in zip(names, bands, strict=False):
        expected = envelope(knocking().signals["sound"], FS, band)
        np.testing.assert_array_equal(found.signals[name], expected)
        assert found.fs[name] == FS


def test_the_full_band_follows_the_sampling_rate():
    (found,) = EnvelopeDetector("full").fit_transform([knocking()])
    run = knocking()
    expected = envelope(run.signals["current"], FS / 10, (FS / 320, 15 * FS / 320))
    np.testing.assert_array_equal(found.signals["current"], expected)
    np.testing.assert_array_equal(
        found.signals["sound"], envelope(run.signals["sound"], FS, (FS / 32, 15 * FS / 32))
    )


def test_the_quality_of_an_envelope_knows_its_bandwidth():
    run = Recording({"sound": noise(20_000)}, FS, velocity=np.full(20_000, TURN * 30))
    resampler = OrderResampler(TURN / 64)
    (found,) = EnvelopeDetector((2000, 2100)).fit_transform([run])
    row = resampler.quality([found]).iloc[0]
    assert row["max_order"] == pytest.approx(100 / 30)
    assert "above order 3.333 at the highest speed (half its sampling rate, or" in row["warnings"]
    assert resampler.quality([run])["max_order"][0] == pytest.approx(5000 / 30)


def test_the_filter_of_a_band_is_flat_inside_and_80_db_down_outside():
    low, high, fs = 2000.0, 6000.0, 48_000.0
    taps = analytic_filter(low, high, fs)
    times = (np.arange(len(taps)) - len(taps) // 2) / fs
    frequencies = np.arange(-fs / 2, fs / 2, 12.5)
    gain = np.abs(np.exp(-1j * TURN * np.outer(frequencies, times)) @ taps) / 2
    eighth = (high - low) / 8
    inside = (frequencies >= low + eighth) & (frequencies <= high - eighth)
    outside = (frequencies <= low - eighth) | (frequencies >= high + eighth)
    np.testing.assert_allclose(gain[inside], 1, atol=2e-4)
    assert gain[outside].max() < 1e-4
    assert gain[frequencies == low] == pytest.approx(0.5, abs=0.01)
