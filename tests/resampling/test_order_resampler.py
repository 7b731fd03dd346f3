"""Facts about the first step: recordings in, recordings over the shaft angle out."""

import pickle

import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline

import emacm.resampling.angle_recording
from emacm import BinTransformer, OrderPSD, OrderResampler, Recording
from emacm._kernels import using
from emacm.resampling.spreading import spread_rows
from emacm.shaft.motion import ShaftPath

FS = 1000
THETA_S = 2 * np.pi / 32


def run(seed=0, n_times=3000, swap=False, **options):
    """A recording that goes forth and back, with two channels of noise."""
    rng = np.random.default_rng(seed)
    times = np.arange(n_times) / FS
    signals = {"a": rng.normal(size=n_times), "b": rng.normal(size=n_times)}
    if swap:
        signals = dict(reversed(signals.items()))
    velocity = 40 * np.cos(2 * np.pi * 0.25 * times + seed)
    return Recording(signals, FS, velocity=velocity, **options)


def resampled(velocity):
    """The channels of `run(0)` along another motion, over the angle."""
    return OrderResampler(THETA_S).fit_transform([Recording(run(0).signals, FS, velocity=velocity)])


def motion(velocity, fs=FS, n_signal=None, signal_fs=None):
    """A recording of one tone and a given motion."""
    velocity = np.asarray(velocity, float)
    n_signal = len(velocity) if n_signal is None else n_signal
    tone = {"a": np.sin(np.arange(n_signal))}
    return Recording(tone, signal_fs or fs, velocity=velocity, shaft_fs=fs)


def values(recordings):
    """All numbers of a result, in one list of arrays."""
    return [stroke.signals for recording in recordings for stroke in recording.strokes]


def assert_equal(one, other):
    one, other = values(one), values(other)
    assert len(one) == len(other) > 0
    for array, expected in zip(one, other, strict=True):
        np.testing.assert_array_equal(array, expected)


@pytest.fixture
def count(monkeypatch):
    """How often anything was resampled."""
    calls = []

    def counting(original):
        def counted(*args):
            calls.append(args)
            yield from original(*args)

        return counted

    for name in ("spread_rows", "interpolated"):
        original = getattr(emacm.resampling.angle_recording, name)
        monkeypatch.setattr(emacm.resampling.angle_recording, name, counting(original))
    return calls


# What scikit-learn's checks ask of an estimator


@pytest.mark.parametrize("antialias", [True, False])
def test_a_recording_by_itself_has_the_numbers_it_has_among_others(antialias):
    X = [run(seed, 2000 + 300 * seed) for seed in range(4)]
    resampler = OrderResampler(THETA_S, antialias=antialias).fit(X)
    alone = [resampler.transform([recording])[0] for recording in X]
    assert_equal(alone, resampler.transform(X))


def test_a_channel_by_itself_has_the_numbers_it_has_among_others():
    X = [run()]
    both = OrderResampler(THETA_S).fit_transform(X)
    alone = OrderResampler(THETA_S, channels=["b"]).fit_transform(X)
    np.testing.assert_array_equal(values(alone)[0][0], values(both)[0][1])


def test_channels_are_found_by_name():
    resampler = OrderResampler(THETA_S).fit([run()])
    assert_equal(resampler.transform([run(swap=True)]), resampler.transform([run()]))


def test_the_feature_names_are_the_channels():
    names = OrderResampler().fit([run()]).get_feature_names_out()
    assert names.dtype == object
    assert names.tolist() == ["a", "b"]


@pytest.mark.parametrize("container", ["default", "pandas", "polars"])
def test_set_output_is_accepted_and_changes_nothing(container):
    X = [run()]
    resampler = OrderResampler(THETA_S).set_output(transform=container)
    assert_equal(resampler.fit_transform(X), OrderResampler(THETA_S).fit_transform(X))


# Bare arrays


def bare(reference_kind, n_recordings=3, n_times=1500):
    """Arrays (n_channels, n_times) whose last channel is the shaft, and the same Recordings."""
    arrays, recordings = [], []
    for seed in range(n_recordings):
        rng = np.random.default_rng(seed)
        signals = rng.normal(size=(2, n_times))
        shaft = 40 + 5 * np.sin(np.arange(n_times) / 300)
        if reference_kind == "angle":
            shaft = np.cumsum(shaft) / FS
        arrays.append(np.vstack([signals, shaft]))
        channels = {"x0": signals[0], "x1": signals[1]}
        recordings.append(Recording(channels, FS, **{reference_kind: shaft}))
    return arrays, recordings


def resampler_of_bare(**options):
    return OrderResampler(THETA_S, fs=FS, **options)


@pytest.mark.parametrize("reference_kind", ["velocity", "angle"])
@pytest.mark.parametrize("reference", [2, -1, "x2", np.int64(2)])
def test_an_array_of_three_dimensions_equals_its_recordings(reference_kind, reference):
    arrays, recordings = bare(reference_kind)
    resampler = resampler_of_bare(reference=reference, reference_kind=reference_kind)
    over_angle = resampler.fit_transform(np.stack(arrays))
    assert resampler.channels_ == ("x0", "x1")
    assert_equal(over_angle, OrderResampler(THETA_S).fit_transform(recordings))


@pytest.mark.parametrize("reference_kind", ["velocity", "angle"])
@pytest.mark.parametrize("reference", [2, -1, "shaft"])
def test_a_list_of_frames_equals_its_recordings(reference_kind, reference):
    arrays, recordings = bare(reference_kind)
    frames = [pd.DataFrame(array.T, columns=["x0", "x1", "shaft"]) for array in arrays]
    resampler = resampler_of_bare(reference=reference, reference_kind=reference_kind)
    assert_equal(resampler.fit_transform(frames), OrderResampler(THETA_S).fit_transform(recordings))


def test_the_shaft_is_a_channel_of_the_result_only_if_named():
    arrays, _ = bare("velocity")
    resampler = resampler_of_bare(reference=2, channels=["x0", "x2"]).fit(arrays)
    assert resampler.channels_ == ("x0", "x2")
    speed = values(resampler.transform(arrays))[0][1]
    assert 35 < np.median(speed) < 45


# Laziness


def test_a_stroke_is_resampled_when_its_signals_are_read_and_no_sooner(count):
    (recording,) = OrderResampler(THETA_S).fit_transform([run()])
    for stroke in recording.strokes:
        assert stroke.revolutions > 0
        assert stroke.n_angles == len(stroke.angles)
        assert np.isfinite(stroke.start_angle)
        assert stroke.direction in (1, -1)
    assert repr(recording)
    assert not count
    signals = recording.strokes[0].signals
    assert signals.shape == (2, recording.strokes[0].n_angles)
    assert len(count) == 1


# What comes out


def test_equal_recordings_with_equal_settings_are_equal_and_hash_alike():
    one, other = (OrderResampler(THETA_S).fit_transform([run()])[0] for _ in range(2))
    assert one == other
    assert hash(one) == hash(other)
    assert one != OrderResampler(THETA_S / 2).fit_transform([run()])[0]


def test_a_frame_has_a_row_an_angle_and_a_column_a_channel():
    (recording,) = OrderResampler(THETA_S).fit_transform([run()])
    frame = recording.frame()
    assert frame.columns.tolist() == ["a", "b"]
    assert frame.index.names == ["stroke", "angle"]
    assert len(frame) == sum(stroke.n_angles for stroke in recording.strokes)
    for number, stroke in enumerate(recording.strokes):
        np.testing.assert_array_equal(frame.loc[number], stroke.signals.T)
        np.testing.assert_array_equal(frame.loc[number].index, stroke.angles)


# Quality


def quality(recording, **options):
    return OrderResampler(**options).quality([recording]).iloc[0]


def there_and_back():
    """Rest 1 s, forward 2 s at 20 rad/s, rest 1 s, reverse 1 s at 10 rad/s; at 100 Hz."""
    pieces = [np.zeros(100), np.full(200, 20.0), np.zeros(100), np.full(100, -10.0)]
    return motion(np.concatenate(pieces), fs=100)


def test_quality_states_strokes_speeds_and_the_highest_order():
    row = quality(there_and_back())
    # The trapezoid ends a stroke at its last turning sample.
    turned = np.array([199 * 0.2, 99 * 0.1]) / (2 * np.pi)
    expected = {
        "revolutions": turned.sum(),
        "strokes": 2,
        "longest_stroke": turned[0],
        "standing": 0.4,
        "slowest": 10.0,
        "fastest": 20.0,
        "max_order": 50 / (20 / (2 * np.pi)),
    }
    assert row[list(expected)].to_dict() == pytest.approx(expected, rel=1e-12)
    assert quality(there_and_back(), min_speed=10.0)["standing"] == 0.6


@pytest.mark.parametrize(
    ("direction", "strokes", "revolutions"),
    [("strokes", 2, 49.7), ("forward", 1, 39.8), ("reverse", 1, 9.9), ("travel", 2, 49.7)],
)
def test_quality_looks_at_the_strokes_of_the_wanted_direction(direction, strokes, revolutions):
    row = quality(there_and_back(), direction=direction)
    assert row["strokes"] == strokes
    assert row["revolutions"] == pytest.approx(revolutions / (2 * np.pi), rel=1e-12)


def test_the_highest_order_is_that_of_the_slowest_channel():
    recording = Recording(
        {"vibration": np.zeros(1000), "position": np.zeros(100)},
        {"vibration": 1000, "position": 100},
        velocity=np.full(1000, 20.0),
        shaft_fs=1000,
    )
    assert quality(recording)["max_order"] == pytest.approx(50 / (20 / (2 * np.pi)), rel=1e-12)


def test_quality_warns_of_a_shaft_that_stands():
    row = quality(motion(np.zeros(100)))
    assert row["warnings"] == "the shaft never turns"
    assert row["standing"] == 1.0
    assert row["revolutions"] == 0


def test_quality_warns_of_orders_that_the_rate_does_not_support():
    row = quality(there_and_back(), theta_s=2 * np.pi / 64)
    assert "channel 'a' has no content above order 15.71" in row["warnings"]
    assert "theta_s reaches order 32" in row["warnings"]


def test_quality_warns_of_noise_that_cuts_the_motion_to_pieces():
    noise = np.random.default_rng(0).normal(size=1000)
    assert "raise min_speed above the noise" in quality(motion(noise))["warnings"]


def test_quality_warns_of_a_shaft_sampled_too_slowly():
    tone = {"a": np.sin(np.arange(10_000))}
    row = quality(Recording(tone, 10_000, angle=4.0 * np.arange(100), shaft_fs=100))
    assert "more than half a revolution between its samples" in row["warnings"]
    assert "is the angle in rad" in row["warnings"]
    speed = motion(np.full(100, 400.0), fs=100, n_signal=10_000, signal_fs=10_000)
    assert not quality(speed)["warnings"]  # a speed changes less between slow samples


# What would mislead is refused


def slipping(slip, at=10_000, reference="angle"):
    """A steady shaft at 5 rev/s; its encoder slips by some rad within one sample."""
    time = np.arange(20_000) / 1000
    angle = 2 * np.pi * 5 * time + slip * (np.arange(20_000) > at)
    shaft = angle if reference == "angle" else np.gradient(angle) * 1000
    return Recording({"a": time}, 1000, **{reference: shaft}, meta={"unit": "B"})


@pytest.mark.parametrize("reference", ["angle", "velocity"])
@pytest.mark.parametrize("slip", [12.0, -12.0, 100.0])
def test_a_slip_of_the_encoder_is_refused_with_its_time(slip, reference):
    resampler = OrderResampler().fit([slipping(0.0)])
    message = rf"recording 1 \(unit='B'\): the shaft's {reference} jumps by \d+.* \(10 s\).*Repair"
    with pytest.raises(ValueError, match=message):
        resampler.transform([slipping(0.0), slipping(slip, reference=reference)])


def test_a_small_slip_is_resampled_and_stated_in_quality():
    resampler = OrderResampler(2 * np.pi / 32).fit([slipping(0.0)])
    assert len(resampler.transform([slipping(0.8)])) == 1
    assert "angle jumps by 0.8" in resampler.quality([slipping(0.8)])["warnings"][0]
    assert "12" in resampler.quality([slipping(12.0)])["warnings"][0]


def test_a_jump_below_a_hand_made_path_is_named_with_its_time():
    time = np.arange(20_000) / 1000
    path = ShaftPath(2 * np.pi * 5 * time + 100 * (time > 10), 1000.0, 0.0, 0.0, 1)
    with pytest.raises(ValueError, match=r"turns by 100 rad within one of its samples, at 10 s"):
        next(spread_rows([time], 1000.0, path, 2 * np.pi / 128))


def test_transposed_arrays_are_refused():
    resampler = OrderResampler(fs=1000, reference=1)
    with pytest.raises(ValueError, match=r"recording 0: .*\(300, 2\)\. Transpose"):
        resampler.fit(np.ones((4, 300, 2)))


def test_quality_warns_of_noise_at_rest_beside_a_long_stroke():
    noise = 1e-3 * np.random.default_rng(0).standard_normal(500)
    velocity = np.concatenate([np.full(2000, 60.0), noise])
    recording = Recording({"a": np.sin(np.arange(2500))}, 1000, velocity=velocity)
    (words,) = OrderResampler(2 * np.pi / 16).quality([recording])["warnings"]
    assert "strokes of less than a revolution: raise min_speed" in words
    (words,) = OrderResampler(2 * np.pi / 16, min_speed=1).quality([recording])["warnings"]
    assert words == ""


# float32


@pytest.mark.parametrize("kernels", ["numpy", "numba"])
@pytest.mark.parametrize(
    "options", [{}, {"antialias": False}, {"antialias": False, "interpolation": "linear"}]
)
@pytest.mark.parametrize("fs", [10_000, 300])
def test_float32_recordings_stay_float32_and_give_the_same_features(kernels, options, fs):
    pytest.importorskip(kernels)
    time = np.arange(4 * fs) / fs
    angle = 2 * np.pi * (6 * time + 1.5 * np.sin(np.pi * time))
    rng = np.random.default_rng(0)
    signal = np.sin(7.3 * angle) + 0.01 * rng.standard_normal(len(time))
    exact = Recording({"x": signal.astype(np.float32).astype(float)}, fs, angle=angle)
    single = Recording({"x": signal.astype(np.float32)}, fs, angle=angle)
    pipe = make_pipeline(
        OrderResampler(2 * np.pi / 64, **options),
        OrderPSD(8, max_order=20),
        BinTransformer(max_order=20),
    )
    with using(kernels):
        features = pipe.fit_transform([exact])
        assert pipe[0].transform([single])[0].strokes[0].signals.dtype == np.float32
        found = pipe.transform([single])
    assert found.dtype == np.float64  # powers span twice as many digits
    # Beside a tone, float32 holds nothing that is 100 dB below it.
    np.testing.assert_allclose(found, features, rtol=1e-5, atol=1e-10 * features.sum())


def test_a_ratio_equals_a_recording_of_the_other_shaft():
    measured = run(n_times=5000)
    other = Recording(measured.signals, FS, velocity=4 * measured.velocity)
    geared = OrderResampler(THETA_S, ratio=4.0).fit_transform([measured])
    assert_equal(geared, OrderResampler(THETA_S).fit_transform([other]))
    for stroke, expected in zip(
        geared[0].strokes, OrderResampler(THETA_S).fit_transform([other])[0].strokes, strict=True
    ):
        np.testing.assert_allclose(stroke.angles, expected.angles, rtol=1e-12)
        assert stroke.path.fastest == expected.path.fastest


def test_quality_describes_the_shaft_of_interest():
    measured = run(n_times=5000)
    quality = OrderResampler(THETA_S).quality([measured]).iloc[0]
    geared = OrderResampler(THETA_S, ratio=2.5).quality([measured]).iloc[0]
    for column in ("revolutions", "longest_stroke", "slowest", "fastest"):
        np.testing.assert_allclose(geared[column], 2.5 * quality[column])
    np.testing.assert_allclose(geared["max_order"], quality["max_order"] / 2.5)
    assert geared["strokes"] == quality["strokes"]


def test_min_speed_refers_to_the_measured_shaft():
    strokes = [
        OrderResampler(THETA_S, ratio=ratio, min_speed=15).fit_transform([run()])[0].strokes
        for ratio in (1.0, 0.1)
    ]
    assert len(strokes[0]) == len(strokes[1]) > 0
    for stroke, slower in zip(*strokes, strict=True):
        np.testing.assert_allclose(slower.revolutions, stroke.revolutions / 10)


def test_what_transform_returns_survives_pickle():
    over_angle = OrderResampler(THETA_S).fit_transform([run(0), run(1)])
    again = pickle.loads(pickle.dumps(over_angle))
    assert again == over_angle
    assert_equal(again, over_angle)
