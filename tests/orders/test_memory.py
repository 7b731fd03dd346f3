"""Facts about memory: recordings pass through the pipeline one at a time."""

import tracemalloc

import numpy as np
import pytest
from peak_memory import peak_bytes
from sklearn.pipeline import make_pipeline

from emacm import BinTransformer, OrderPSD, OrderResampler, Recording
from emacm._kernels import using

FS = 10_000
N_TIMES = 300_000
THETA_S = 2 * np.pi / 100
SPEED = THETA_S * FS  # so that a recording has as many angles as times
UNIT = N_TIMES * 8  # bytes of one resampled channel


def made(n_recordings, n_times):
    """Recordings of one channel at constant speed."""
    rng = np.random.default_rng(0)
    return [
        Recording({"a": rng.standard_normal(n_times)}, FS, velocity=np.full(n_times, SPEED))
        for _ in range(n_recordings)
    ]


@pytest.fixture(scope="module")
def recordings():
    """Long recordings; lists refer to them over and over."""
    return made(3, N_TIMES)


def listed(recordings, n_recordings):
    return [recordings[i % len(recordings)] for i in range(n_recordings)]


def steps(**options):
    return make_pipeline(OrderResampler(THETA_S), OrderPSD(16, **options))


def test_a_resampled_recording_is_here_as_large_as_the_raw_one(recordings):
    (over_angle,) = OrderResampler(THETA_S).fit_transform(recordings[:1])
    assert sum(s.n_angles for s in over_angle.strokes) == pytest.approx(N_TIMES, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("antialias", [True, False])
def test_fifty_recordings_need_no_more_memory_than_five(antialias):
    X = made(3, 60_000)
    pipe = make_pipeline(
        OrderResampler(THETA_S, antialias=antialias), OrderPSD(16), BinTransformer(max_order=40)
    ).fit(X)
    few = peak_bytes(pipe.transform, listed(X, 5))
    many = peak_bytes(pipe.transform, listed(X, 50))
    row = 8 * pipe[1].orders_.size
    # Rows are stacked to a table, which the bins check: it is there three times at most.
    assert many < 1.1 * few + 3 * 45 * row


def spectra_peak(recording, kernels, samples_per_rev=100, **options):
    pytest.importorskip(kernels)
    resampler = OrderResampler(2 * np.pi / samples_per_rev, **options)
    pipe = make_pipeline(resampler, OrderPSD(4, max_order=40))
    with using(kernels):
        pipe.fit_transform([recording])
        return peak_bytes(pipe.transform, [recording])


def recording_of(n_times, n_channels=5, speed=SPEED):
    rng = np.random.default_rng(0)
    signal = rng.standard_normal(n_times)
    signal.flags.writeable = False  # so that the channels share it
    velocity = np.full(n_times, speed)
    return Recording(dict.fromkeys("abcdefgh"[:n_channels], signal), FS, velocity=velocity)


LINEAR = {"antialias": False, "interpolation": "linear"}
both_kernels = pytest.mark.parametrize("kernels", ["numpy", "numba"])
both_ways = pytest.mark.parametrize("options", [{}, {"antialias": False}])


@pytest.mark.slow
@both_kernels
@pytest.mark.parametrize(
    ("samples_per_rev", "options"), [(128, {}), (1000, LINEAR), (1000, {"antialias": False})]
)
def test_a_recording_needs_less_memory_than_it_takes_itself(kernels, samples_per_rev, options):
    recording = recording_of(480_000, speed=2 * np.pi * FS / 1000)  # 1000 samples a revolution
    # Measured: 0.4 to 0.7 of it.
    assert spectra_peak(recording, kernels, samples_per_rev, **options) < 5 * 480_000 * 8


@pytest.mark.slow
@both_kernels
@both_ways
def test_memory_does_not_grow_with_the_length_of_a_recording(kernels, options):
    # Several blocks at any rate, and full ones: work is cut into parts of equal length.
    lengths = 1 << 19, 1 << 20
    short, long = (spectra_peak(recording_of(n, n_channels=1), kernels, **options) for n in lengths)
    # Of the shaft, the angle at every 256th sample is held, and two speeds.
    assert long < 1.05 * short + 8 * 8 * (lengths[1] - lengths[0]) / 256


def test_fitting_resamples_nothing(recordings):
    resampler = OrderResampler(THETA_S)
    over_angle = resampler.fit_transform(recordings)
    OrderPSD(16).fit(over_angle)  # imports what is imported once
    assert peak_bytes(OrderPSD(16).fit, over_angle) < 0.1 * UNIT


def test_what_the_resampler_returns_takes_no_memory(recordings):
    X = listed(recordings, 50)
    resampler = OrderResampler(THETA_S).fit(X)
    tracemalloc.start()
    before, _ = tracemalloc.get_traced_memory()
    over_angle = resampler.transform(X)
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(over_angle) == 50
    assert after - before < 0.1 * UNIT


def test_reading_one_stroke_after_the_other_keeps_none(recordings):
    (over_angle,) = OrderResampler(THETA_S).fit_transform(recordings[:1])

    def read():
        for _ in range(10):
            assert over_angle.strokes[0].signals.any()

    def read_once():
        assert over_angle.strokes[0].signals.any()

    read_once()  # compiles what is compiled once
    assert peak_bytes(read) < 1.1 * peak_bytes(read_once)
