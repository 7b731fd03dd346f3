"""Facts about envelopes of bands, and about recordings that hold them."""

import copy
import pickle
import tracemalloc
from unittest import mock

import joblib
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal as filters
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline

from emacm import (
    BinTransformer,
    CepstralPrewhitening,
    CostSensitiveGaussianBayes,
    EnvelopeDetector,
    OrderPSD,
    OrderResampler,
    Recording,
)
from emacm.recordings.computed_series import ComputedSeries
from emacm.recordings.envelope import (
    EnvelopeSeries,
    analytic_filter,
    analytic_gain,
    envelope,
    filter_length,
    warn_of_long_filter,
)
from emacm.recordings.envelope_detector import envelope_recording
from emacm.recordings.prewhitening import WhitenedSeries, prewhitened
from emacm.simulation.bench import LaboratoryBench
from emacm.simulation.faults import FAULT_ORDERS

TURN = 2 * np.pi
FS = 10_000.0
TIMES = np.arange(20_000) / FS
BAND = (1500.0, 2500.0)
REACH = filter_length(*BAND, FS) // 2
INNER = slice(REACH, -REACH)


def noise(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


def tone(frequency, amplitude=1.0):
    return amplitude * np.sin(TURN * frequency * TIMES + 0.3)


# The envelope


def test_the_squared_envelope_of_a_modulated_tone_is_the_square_of_its_modulation():
    modulation = 1 + 0.6 * np.cos(TURN * 30 * TIMES)
    squared = envelope(3 * modulation * tone(2000), FS, BAND)
    np.testing.assert_allclose(squared[INNER], 9 * modulation[INNER] ** 2, atol=9e-3)
    plain = envelope(3 * modulation * tone(2000), FS, BAND, squared=False)
    np.testing.assert_allclose(plain[INNER], 3 * modulation[INNER], atol=3e-3)


@given(frequency=st.floats(1625, 2375), amplitude=st.floats(1e-3, 1e3))
def test_within_the_band_a_tone_reads_the_square_of_its_amplitude(frequency, amplitude):
    squared = envelope(tone(frequency, amplitude), FS, BAND)
    np.testing.assert_allclose(squared[INNER], amplitude**2, rtol=1e-3)


@given(frequency=st.one_of(st.floats(1, 1375), st.floats(2625, 4990)))
def test_outside_of_the_band_a_tone_is_gone(frequency):
    # 80 dB down by the filter, and no more than doubled by its image.
    assert envelope(tone(frequency), FS, BAND)[INNER].max() < 4.1e-8


def test_at_an_edge_half_of_the_amplitude_passes():
    for edge in BAND:
        assert envelope(tone(edge), FS, BAND, squared=False)[INNER].mean() == pytest.approx(
            0.5, 1e-3
        )


def test_a_constant_leaves_nothing():
    assert envelope(np.full(20_000, 1e6), FS, BAND).max() < 1e-12


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


def test_there_is_no_delay():
    burst = np.exp(-(((TIMES - 1) / 0.01) ** 2)) * tone(2000)
    assert TIMES[envelope(burst, FS, BAND).argmax()] == pytest.approx(1, abs=2e-4)


def test_beyond_its_ends_the_signal_is_its_mirror_image():
    signal = noise(3000)
    mirrored = np.concatenate([signal[:0:-1], signal, signal[-2::-1]])
    np.testing.assert_allclose(
        envelope(signal, FS, BAND), envelope(mirrored, FS, BAND)[2999:5999], rtol=1e-9, atol=1e-12
    )


def test_a_value_depends_on_its_neighbourhood_alone():
    signal = noise(5000)
    other = signal.copy()
    other[: 2500 - REACH] = 0
    np.testing.assert_allclose(
        envelope(other, FS, BAND)[2500:], envelope(signal, FS, BAND)[2500:], rtol=1e-9, atol=1e-12
    )


def test_float32_stays_float32():
    signal = noise(2, 3000).astype(np.float32)
    single = envelope(signal, FS, BAND)
    assert single.dtype == np.float32
    double = envelope(signal.astype(float), FS, BAND)
    np.testing.assert_allclose(single, double, atol=1e-5)


def test_every_row_has_its_envelope():
    rows = noise(2, 3, 2000)
    stacked = envelope(rows, FS, BAND)
    np.testing.assert_array_equal(stacked[1, 2], envelope(rows[1, 2], FS, BAND))


# Computed when read


@pytest.mark.parametrize(
    "key",
    [
        slice(None),
        slice(100, 4000),
        slice(7, 9),
        slice(None, None, 1700),
        slice(3, 5000, 3),
        slice(300, 100),
        np.array([4999, 0, 17, -1]),
        np.arange(5000) % 2 == 0,
        np.array([], dtype=int),
        5,
        -1,
    ],
    ids=str,
)
def test_what_is_read_in_part_is_what_the_whole_has_there(key):
    signal = noise(5000)
    np.testing.assert_allclose(
        EnvelopeSeries(signal, FS, BAND)[key],
        envelope(signal, FS, BAND)[key],
        rtol=1e-9,
        atol=1e-12,
    )


def test_a_long_signal_is_read_in_blocks():
    signal = noise(400_000).astype(np.float32)
    series = EnvelopeSeries(signal, FS, BAND)
    parts = np.concatenate([series[k : k + 70_000] for k in range(0, 400_000, 70_000)])
    np.testing.assert_allclose(parts, series[:], rtol=1e-3, atol=1e-5)


# What is refused


@pytest.mark.parametrize(
    ("band", "error", "match"),
    [
        ((2500, 1500), ValueError, r"from a lower to a higher frequency, got \(2500, 1500\)"),
        ((0, 1500), ValueError, "edges of band must be a number of Hz, above 0, got 0"),
        ((1500, 5000), ValueError, "of 10000 Hz the Nyquist frequency is 5000 Hz"),
        ((1500, np.inf), ValueError, "edges of band must be a number"),
        ("1500", TypeError, r"must be a pair \(low, high\)"),
        (1500, TypeError, r"must be a pair \(low, high\)"),
        ((1, 2, 3), TypeError, r"must be a pair \(low, high\)"),
        ((2000, 2001), ValueError, r"needs a filter of 20\.1 s, but the signal lasts 2 s"),
        ((1500, 4999.999999), ValueError, "and keep its edges away from 0 and 5000 Hz"),
        ((5e-324, 1500), ValueError, "needs a filter of"),
    ],
)
def test_bands_that_are_none_are_refused(band, error, match):
    with pytest.raises(error, match=match):
        envelope(tone(2000), FS, band)


def test_a_filter_may_be_as_long_as_the_signal():
    n_taps = filter_length(*BAND, FS)
    assert len(envelope(tone(2000)[:n_taps], FS, BAND)) == n_taps
    with pytest.raises(ValueError, match="needs a filter of"):
        envelope(tone(2000)[: n_taps - 1], FS, BAND)


def test_a_gap_is_named():
    signal = tone(2000)
    signal[5] = np.inf
    with pytest.raises(ValueError, match="signal must be finite, got inf at sample 5"):
        envelope(signal, FS, BAND)


@pytest.mark.parametrize("signal", [1.0, [1.0], []])
def test_what_is_no_signal_is_refused(signal):
    with pytest.raises(ValueError, match="at least 2 samples"):
        envelope(signal, FS, BAND)


# Recordings


def knocking(seed=0, *, order=3.1, strength=1.0, fs=FS, dtype=float, **meta):
    """A resonance at 2 kHz is struck `order` times a turn, of a shaft that slows down."""
    rng = np.random.default_rng(seed)
    times = np.arange(int(2 * fs)) / fs
    velocity = TURN * (12 - 2 * times)
    angle = np.cumsum(velocity) / fs
    struck = np.diff(np.floor(order * angle / TURN), prepend=0) > 0
    ring = np.exp(-np.arange(200) / 40) * np.sin(TURN * 2000 / fs * np.arange(200))
    sound = strength * np.convolve(struck, ring)[: len(times)] + 0.1 * rng.standard_normal(
        len(times)
    )
    signals = {"sound": sound.astype(dtype), "current": np.sin(angle[::10]).astype(dtype)}
    return Recording(
        signals, {"sound": fs, "current": fs / 10}, velocity=velocity, shaft_fs=fs, meta=meta
    )


def highest_order(table):
    name = table.columns[int(np.asarray(table)[0].argmax())]
    return float(name.rpartition("@")[2])


def spectrum(*before, max_order=10):
    return make_pipeline(
        *before, OrderResampler(TURN / 64, channels=["sound"]), OrderPSD(8, max_order=max_order)
    )


def contrast(recording, order, *before):
    """Density at an order of the accelerometer, over the median of what lies beside it."""
    resampler = OrderResampler(TURN / 64, channels=["accelerometer"], min_speed=1.0)
    pipe = make_pipeline(*before, resampler, OrderPSD(8, max_order=30))
    power = np.asarray(pipe.fit_transform([recording]))[0]
    away = np.abs(pipe[-1].orders_ - order)
    return power[away <= 0.15].max() / np.median(power[(away > 0.25) & (away < 1.5)])


def test_the_order_of_strikes_stands_in_the_envelope_spectrum():
    detector = EnvelopeDetector(BAND, channels=["sound"])
    assert highest_order(spectrum(detector).fit_transform([knocking()])) == pytest.approx(
        3.1, abs=0.07
    )
    assert highest_order(spectrum(detector).fit_transform([knocking(order=4.6)])) == pytest.approx(
        4.6, abs=0.07
    )


def test_a_damaged_inner_ring_shows_in_the_envelope_and_not_in_the_plain_spectrum():
    order = FAULT_ORDERS["inner ring"][0]
    detector = EnvelopeDetector((1000, 3000), channels=["accelerometer"])
    sound, damaged = (
        LaboratoryBench(faults=faults, duration=4.0).record(condition=5)
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


def test_a_suffix_puts_the_envelope_beside_the_channel():
    detector = EnvelopeDetector(BAND, channels=["sound"], suffix="_envelope").fit([knocking()])
    assert detector.channels_ == ("sound", "current", "sound_envelope")
    assert list(detector.get_feature_names_out()) == ["sound", "current", "sound_envelope"]
    (heard,) = detector.transform([knocking()])
    assert heard.fs["sound_envelope"] == FS
    table = make_pipeline(detector, OrderResampler(TURN / 64), OrderPSD(8)).fit_transform(
        [knocking()]
    )
    assert "sound_envelope@3.125" in table.columns


def test_each_channel_may_have_a_band_of_its_own():
    bands = {"sound": BAND, "current": (100, 300)}
    (heard,) = EnvelopeDetector(bands, squared=False).fit_transform([knocking()])
    expected = envelope(knocking().signals["current"], FS / 10, (100, 300), squared=False)
    np.testing.assert_array_equal(heard.signals["current"], expected)


def test_of_a_mapping_only_the_chosen_channels_are_taken():
    detector = EnvelopeDetector({"sound": BAND, "lvdt": (1, 2)}, channels=["sound"])
    assert detector.fit([knocking()]).bands_ == {"sound": BAND}


def test_an_envelope_of_an_envelope_is_computed_when_read_too():
    twice = make_pipeline(
        EnvelopeDetector(BAND, channels=["sound"]), EnvelopeDetector((20, 60), channels=["sound"])
    ).fit_transform([knocking()])[0]
    once = envelope(knocking().signals["sound"], FS, BAND)
    np.testing.assert_allclose(
        twice.signals["sound"], envelope(once, FS, (20, 60)), rtol=1e-9, atol=1e-15
    )


@pytest.mark.parametrize("antialias", [True, False])
@pytest.mark.parametrize("dtype", [np.float32, float])
def test_over_the_angle_it_is_what_the_whole_envelope_is(antialias, dtype):
    run = knocking(dtype=dtype)
    whole = Recording(
        {"sound": envelope(run.signals["sound"], FS, BAND)}, FS, velocity=run.velocity
    )
    resampler = OrderResampler(TURN / 512, antialias=antialias, channels=["sound"])
    (heard,) = make_pipeline(EnvelopeDetector({"sound": BAND}), resampler).fit_transform([run])
    expected = resampler.fit_transform([whole])[0].strokes[0].signals
    assert heard.dtype == dtype
    np.testing.assert_allclose(heard.strokes[0].signals, expected, rtol=1e-3, atol=1e-5)


def test_a_long_recording_is_never_held_as_a_whole():
    n_times = 2_500_000
    sound = noise(n_times).astype(np.float32)
    sound.flags.writeable = False
    run = Recording({"sound": sound}, FS, velocity=np.full(n_times, 60.0, np.float32))
    pipe = spectrum(EnvelopeDetector(BAND)).fit([run])
    pipe.transform([run])  # makes what is made once; compiled loops take memory of their own
    tracemalloc.start()
    pipe.transform([run])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < sound.nbytes


@pytest.mark.parametrize("n_times", [7, 8])
def test_a_signal_is_extended_by_its_mirror_image(n_times):
    signal = np.arange(float(n_times)) ** 2
    series = ComputedSeries(signal)
    whole = np.pad(signal, n_times - 1, mode="reflect")
    for start in range(1 - n_times, n_times):
        for stop in range(max(start, 0) + 1, 2 * n_times):
            expected = whole[start + n_times - 1 : stop + n_times - 1]
            np.testing.assert_array_equal(series._mirrored(start, stop), expected)


def test_samples_at_indices_are_those_of_the_whole_envelope(monkeypatch):
    signal = noise(5000)
    series = EnvelopeSeries(signal, FS, BAND)
    whole = envelope(signal, FS, BAND)
    inside = np.zeros(5000, bool)
    inside[[3, 4400]] = True
    monkeypatch.setattr("emacm.recordings.envelope._GATHERED", 2 * len(series._taps))
    for index in ([4999], [-1, 0, 17], [0, 4999, 2500, 2500, -5000], inside, slice(9, 3000, 700)):
        key = index if isinstance(index, slice) else np.asarray(index)
        np.testing.assert_allclose(series[key], whole[key], rtol=1e-9)
    assert len(series[np.array([], int)]) == 0
    assert len(series[np.zeros(5000, bool)]) == 0
    assert series[-2] == pytest.approx(whole[-2], rel=1e-12)


@pytest.mark.parametrize(("dtype", "scale"), [(np.float32, 1e20), (float, 1e160), (float, 1e-170)])
def test_a_squared_envelope_out_of_range_is_refused(dtype, scale):
    values = (scale * tone(2000)[:2000]).astype(dtype)
    with pytest.raises(ValueError, match=rf"exceeds the range of {np.dtype(dtype)}.*squared=False"):
        envelope(values, FS, BAND)
    plain = envelope(values, FS, BAND, squared=False)
    assert plain.dtype == dtype
    assert plain[1000] == pytest.approx(scale, rel=1e-3)
    assert not envelope(0 * values, FS, BAND).any()


def test_a_squared_envelope_that_leaves_the_range_only_for_a_while_is_refused():
    values = tone(2000)[:2000].copy()
    values[900:1100] *= 1e160
    with pytest.raises(ValueError, match="exceeds the range of float64"):
        envelope(values, FS, BAND)


def test_a_description_holds_that_of_the_inner_series():
    inner = EnvelopeSeries(noise(5000), FS, BAND)
    outer = EnvelopeSeries(inner, FS, (200.0, 400.0), squared=False)
    assert repr(inner) == "EnvelopeSeries(10000.0, (1500.0, 2500.0), True)"
    assert repr(outer) == f"EnvelopeSeries(10000.0, (200.0, 400.0), False, {inner!r})"
    other = EnvelopeSeries(EnvelopeSeries(inner.sources[0], FS, (700.0, 900.0)), FS, (200, 400))
    assert outer != other
    assert outer != inner


def test_nothing_is_computed_before_it_is_read(monkeypatch):
    def refuse(*_):
        raise AssertionError

    monkeypatch.setattr(EnvelopeSeries, "read", refuse)
    detector = EnvelopeDetector(BAND, channels=["sound"])
    (heard,) = detector.fit_transform([knocking()])
    OrderPSD().fit(OrderResampler(TURN / 64).fit_transform([heard]))
    assert heard.duration == 2
    assert heard.digest != knocking().digest
    assert "sound 10000 Hz" in repr(heard)
    again = pickle.loads(pickle.dumps(heard))
    assert heard == again
    assert not again.series["sound"].sources[0].flags.writeable


def test_equal_envelopes_are_equal_and_others_are_not():
    run = knocking(unit="A")
    heard = envelope_recording(run, {"sound": BAND})
    assert heard == envelope_recording(knocking(unit="A"), {"sound": BAND})
    stated = envelope_recording(run, {"sound": BAND}, squared=True, suffix=None)
    assert (stated, stated.digest) == (heard, heard.digest)
    assert hash(heard) == hash(envelope_recording(knocking(unit="A"), {"sound": BAND}))
    others = [
        envelope_recording(run, {"sound": (1500.0, 2400.0)}),
        envelope_recording(run, {"sound": BAND}, squared=False),
        envelope_recording(run, {"sound": BAND}, suffix="_e"),
        envelope_recording(knocking(1, unit="A"), {"sound": BAND}),
        run,
    ]
    assert all(heard != other and other != heard for other in others)
    assert len({entry.digest for entry in [heard, *others]}) == 6
    assert len({joblib.hash(entry) for entry in [heard, *others]}) == 6
    assert copy.deepcopy(heard) is heard
    assert heard.series["sound"] == mock.ANY  # what knows how to compare itself is asked
    assert heard.series["sound"] != "sound"


def test_kept_spectra_of_two_bands_are_not_confused(tmp_path):
    def table(band, memory):
        resampler = OrderResampler(TURN / 64, channels=["sound"])
        steps = EnvelopeDetector({"sound": band}), resampler, OrderPSD(8, memory=memory)
        return np.asarray(make_pipeline(*steps).fit_transform([knocking()]))

    for band in (BAND, (1000, 3000), BAND):
        np.testing.assert_array_equal(table(band, str(tmp_path)), table(band, None))


def test_it_stands_in_a_search_over_bands():
    X = [knocking(seed, strength=1.0 * (seed % 2)) for seed in range(8)]
    y = ["sound", "damaged"] * 4
    pipe = make_pipeline(
        EnvelopeDetector(BAND, channels=["sound"]),
        OrderResampler(TURN / 64, channels=["sound"]),
        OrderPSD(4),
        BinTransformer(edges={"ring": (2.9, 3.3)}),
        CostSensitiveGaussianBayes(),
    ).set_output(transform="pandas")
    grid = {"envelopedetector__band": [BAND, (1000, 3000)]}
    search = GridSearchCV(pipe, grid, cv=2, error_score="raise").fit(X, y)
    assert search.best_score_ == 1
    assert list(clone(search.best_estimator_).fit(X, y).predict(X)) == y


@pytest.mark.parametrize(
    ("options", "error", "match"),
    [
        (
            {"band": BAND},
            ValueError,
            r"recording 0 \(unit='A'\): channel 'current': band reaches to",
        ),
        ({"band": (9, 1)}, ValueError, "from a lower to a higher"),
        ({"band": {"sound": (9, 1)}}, ValueError, "band of 'sound' must run from a lower"),
        ({"band": {"lvdt": BAND}}, ValueError, r"recording 0 .*has no channel 'lvdt'"),
        (
            {"band": {"sound": BAND}, "channels": ["current", "lvdt"]},
            ValueError,
            "^band names no band of channel 'current'",
        ),
        ({"band": {}}, ValueError, "at least one channel"),
        ({"band": BAND, "channels": []}, ValueError, "at least one channel"),
        (
            {"band": BAND, "channels": "sound"},
            TypeError,
            "list of names such as .*; got a text",
        ),
        ({"band": BAND, "channels": 3}, TypeError, "must be a list of names .*, got 3"),
        (
            {"band": {"sound": BAND}, "channels": ["current"]},
            ValueError,
            "no band of channel 'curr",
        ),
        ({"band": {"sound": BAND}, "squared": 2}, ValueError, "squared must be one of"),
        ({"band": {"sound": BAND}, "suffix": ""}, TypeError, "suffix must be text"),
        ({"band": {"sound": BAND}, "suffix": 7}, TypeError, "suffix must be text.* got 7"),
        ({"band": {"sound": (2000, 2001)}}, ValueError, "channel 'sound': the band 2000 to 2001"),
    ],
)
def test_wrong_parameters_are_told_at_fit(options, error, match):
    with pytest.raises(error, match=match):
        EnvelopeDetector(**options).fit([knocking(unit="A")])


def test_a_name_that_is_there_already_is_refused():
    run = Recording({"a": noise(2000), "a_e": noise(2000)}, FS, velocity=np.full(2000, 9.0))
    with pytest.raises(ValueError, match="recording 0: it has a channel 'a_e' already"):
        EnvelopeDetector({"a": BAND}, suffix="_e").fit([run])


def test_a_slower_recording_is_named_with_channel_and_rate():
    detector = EnvelopeDetector({"sound": BAND}).fit([knocking()])
    match = r"recording 1: channel 'sound': band reaches to 2500 Hz, but at a sampling rate of 4000"
    with pytest.raises(ValueError, match=match):
        detector.transform([knocking(), knocking(fs=4000.0)])


@pytest.mark.parametrize(
    ("X", "error", "match"),
    [
        (knocking(), TypeError, "got a single one; write .recording."),
        ([], ValueError, "X contains no recording"),
        (3, TypeError, "must be a list of recordings, got 3"),
        (iter([]), TypeError, r"got a list_iterator. It can be read only once; write list\(...\)"),
        ([noise(5)], TypeError, "entry 0 of X .* EnvelopeDetector, got a ndarray"),
    ],
)
def test_what_is_no_list_of_recordings_is_refused(X, error, match):
    with pytest.raises(error, match=match):
        EnvelopeDetector(BAND).fit(X)


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


@pytest.mark.parametrize("n_times", [243, 480, 601])
def test_the_gain_of_the_filter_is_its_fourier_transform(n_times):
    taps = analytic_filter(2000.0, 6000.0, 48_000.0)
    around = np.zeros(n_times, complex)
    around[np.arange(len(taps)) - len(taps) // 2] = taps  # its middle is at time 0
    expected = np.fft.fft(around)
    n_lines = n_times // 2 + 1
    gain = analytic_gain(2000.0, 6000.0, 48_000.0, n_times)
    np.testing.assert_allclose(gain, expected[:n_lines], rtol=0, atol=1e-12)
    assert not gain.flags.writeable
    assert np.abs(expected[n_lines:]).max() < 2e-4


def test_the_channels_are_those_of_the_first_recording_of_fit():
    one = Recording({"sound": noise(500), "load": noise(500)}, FS, velocity=np.ones(500))
    more = Recording({**one.signals, "extra": noise(500)}, FS, velocity=np.ones(500))
    detector = EnvelopeDetector({"sound": BAND}, suffix="_e").fit([one, more])
    assert detector.channels_ == ("sound", "load", "sound_e")
    assert EnvelopeDetector(BAND).fit([one, more]).bands_ == {"sound": BAND, "load": BAND}


# Several bands, relative bands, bands at the edge


def test_each_of_several_bands_has_an_envelope_of_its_own_in_place_of_the_channel():
    bands = [(1500, 2500), (3000, 4500)]
    detector = EnvelopeDetector({"sound": bands}).fit([knocking()])
    names = ["sound_1500-2500Hz", "sound_3000-4500Hz", "current"]
    assert list(detector.get_feature_names_out()) == names
    (found,) = detector.transform([knocking()])
    for name, band in zip(names, bands, strict=False):
        expected = envelope(knocking().signals["sound"], FS, band)
        np.testing.assert_array_equal(found.signals[name], expected)
        assert found.fs[name] == FS


def test_several_bands_beside_the_channel_carry_the_suffix():
    detector = EnvelopeDetector([(1500, 2500), (3000, 4500)], channels=["sound"], suffix="_e")
    assert detector.fit([knocking()]).channels_ == (
        "sound",
        "current",
        "sound_1500-2500Hz_e",
        "sound_3000-4500Hz_e",
    )


def test_the_full_band_follows_the_sampling_rate():
    (found,) = EnvelopeDetector("full").fit_transform([knocking()])
    run = knocking()
    expected = envelope(run.signals["current"], FS / 10, (FS / 320, 15 * FS / 320))
    np.testing.assert_array_equal(found.signals["current"], expected)
    np.testing.assert_array_equal(
        found.signals["sound"], envelope(run.signals["sound"], FS, (FS / 32, 15 * FS / 32))
    )


@pytest.mark.parametrize(
    ("band", "match"),
    [
        ((5, 3000), "so near to 0 that its filter lasts .* Raise its lower edge to 374 Hz"),
        ((2000, 4990), "so near to half the sampling rate .* Lower its upper edge to 4626.25 Hz"),
    ],
)
def test_a_band_at_the_edge_with_a_long_filter_warns(band, match):
    with pytest.warns(UserWarning, match=match):
        EnvelopeDetector(band, channels=["sound"]).fit([knocking()])


def test_the_edges_that_a_warning_recommends_do_not_warn():
    EnvelopeDetector((375, 3000), channels=["sound"]).fit([knocking()])
    EnvelopeDetector((2000, 4626), channels=["sound"]).fit([knocking()])


@pytest.mark.parametrize(
    ("band", "error", "match"),
    [
        ([(1500, 2500), (1500, 2500)], ValueError, "must give each band once"),
        ([(1500, 2500), (2500, 1500)], ValueError, "band 1 of band must run from a lower"),
        ("wide", ValueError, "band must be one of 'full', 'kurtogram'"),
        ([], TypeError, r"must be a pair \(low, high\)"),
        ((200, 200), ValueError, r"must run from a lower to a higher frequency, got \(200, 200\)"),
        ([(1500, 2500), 3000], TypeError, r"edges of band must be a number.*got \(1500, 2500\)"),
    ],
)
def test_lists_of_bands_that_are_none_are_refused(band, error, match):
    with pytest.raises(error, match=match):
        EnvelopeDetector(band, channels=["sound"]).fit([knocking()])


def test_the_quality_of_an_envelope_knows_its_bandwidth():
    run = Recording({"sound": noise(20_000)}, FS, velocity=np.full(20_000, TURN * 30))
    resampler = OrderResampler(TURN / 64)
    (found,) = EnvelopeDetector((2000, 2100)).fit_transform([run])
    row = resampler.quality([found]).iloc[0]
    assert row["max_order"] == pytest.approx(100 / 30)
    assert "above order 3.333 at the highest speed (the width of the band" in row["warnings"]
    assert resampler.quality([run])["max_order"][0] == pytest.approx(5000 / 30)


def test_channels_that_are_computed_are_a_mapping_too():
    (heard,) = EnvelopeDetector(BAND, channels=["sound"]).fit_transform([knocking()])
    assert list(heard.signals) == list(knocking().channels)
    assert len(heard.signals) == len(knocking().channels)
    assert not heard.signals["sound"].flags.writeable
    assert heard.series["sound"] != 3


def test_the_band_of_a_channel_that_a_recording_lacks_is_refused():
    detector = EnvelopeDetector("kurtogram", channels=["sound"]).fit([knocking()])
    with pytest.raises(ValueError, match=r"recording 0.*no channel 'sound'"):
        detector.transform([knocking().select(["current"])])


@pytest.mark.parametrize(
    ("low", "high", "remedy"),
    [
        (95.0, 4095.0, "near to 0 .* 5.26 times .* Raise its lower edge to 500 Hz"),
        (100.0, 4100.0, None),  # five times
        (105.0, 4105.0, None),
        (19_905.0, 23_905.0, "near to half the sampling rate .* 5.26 times .* edge to 23500 Hz"),
        (19_895.0, 23_895.0, None),
        (100.0, 23_875.0, "near to 0 .* Raise its lower edge"),  # and to the other end
        (150.0, 23_900.0, "near to half the sampling rate .* Lower its upper edge"),
    ],
)
def test_a_filter_of_five_times_the_usual_length_is_warned_of(low, high, remedy):
    if remedy:
        with pytest.warns(UserWarning, match=remedy):
            warn_of_long_filter(low, high, 48_000.0)
    else:
        warn_of_long_filter(low, high, 48_000.0)


@pytest.mark.parametrize(
    ("low", "high", "width"),
    [(2000, 6000, 1000), (300, 4000, 600), (500, 22_900, 1000), (15_000, 23_500, 1000)],
)
def test_a_filter_is_as_long_as_its_narrowest_transition_needs(low, high, width):
    # Kaiser: (A - 7.95) / (2.285 dw) + 1 taps for a transition dw [rad per sample] and A dB.
    needed = (80 - 7.95) / (2.285 * 2 * np.pi * width / 48_000)
    n_taps = filter_length(low, high, 48_000)
    assert n_taps % 2 == 1
    assert needed < n_taps < needed + 3
    taps = analytic_filter(low, high, 48_000.0)
    assert len(taps) == n_taps
    assert abs(taps.sum()) < 1e-12
    with pytest.raises(ValueError, match="read-only"):
        taps[0] = 0


@pytest.mark.parametrize(
    "function", [lambda x: envelope(x, FS, BAND), lambda x: prewhitened(x, FS)]
)
@pytest.mark.parametrize("shape", [(1, 900), (3, 900), (2, 3, 900)])
def test_rows_of_an_array_are_computed_by_themselves(function, shape):
    rows = np.random.default_rng(1).standard_normal(shape)
    found = function(rows)
    assert found.shape == shape
    for place in np.ndindex(shape[:-1]):
        np.testing.assert_array_equal(found[place], function(rows[place]))
    with pytest.raises(ValueError, match=r"at least 2 samples, got shape \(5, 1\)"):
        function(np.ones((5, 1)))


@pytest.mark.parametrize("step", [2, 3, -1, -2])
def test_samples_at_any_step_are_those_of_the_whole(step):
    series = EnvelopeSeries(noise(2000), FS, BAND)
    whole = series[:]
    np.testing.assert_allclose(series[100:1900][::step], whole[100:1900][::step], rtol=1e-9)
    picked = slice(100, 1900, step) if step > 0 else slice(1900, 100, step)
    np.testing.assert_allclose(series[picked], whole[picked], rtol=1e-9)


def test_an_envelope_of_a_whitened_signal_is_pickled():
    series = EnvelopeSeries(WhitenedSeries(noise(9000), FS), FS, BAND)
    again = pickle.loads(pickle.dumps(series))
    assert again == series
    np.testing.assert_array_equal(again[:], series[:])


def test_the_channels_of_a_detector_are_those_of_the_first_recording():
    first = knocking()
    other = Recording(
        {**first.signals, "extra": first.signals["sound"]},
        {**first.fs, "extra": first.fs["sound"]},
        velocity=first.velocity,
        shaft_fs=first.shaft_fs,
    )
    for step in (EnvelopeDetector(BAND, channels=["sound"]), CepstralPrewhitening()):
        assert step.fit([first, other]).channels_ == first.channels
        with pytest.raises(NotFittedError):
            clone(step).get_feature_names_out()
        with pytest.raises(NotFittedError):
            clone(step).transform([first])
