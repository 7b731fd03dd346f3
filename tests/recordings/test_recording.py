"""Facts about the recording: what it takes, keeps and refuses to change."""

import copy
import pickle

import joblib
import numpy as np
import pandas as pd
import pytest
from numpy.lib.stride_tricks import sliding_window_view

from emacm import Recording

TIMES = np.arange(200) / 100


def sine(**options):
    """Two seconds at 100 Hz of a shaft at 3 rad/s."""
    options = {"velocity": np.full(200, 3.0), "meta": {"unit": "A"}} | options
    return Recording({"current": np.sin(9 * TIMES), "torque": np.cos(9 * TIMES)}, 100, **options)


# What it takes


def test_each_channel_may_have_a_rate_of_its_own():
    recording = Recording(
        {"vibration": np.zeros(4800), "position": np.zeros(100)},
        {"position": 1000, "vibration": 48_000},
        velocity=np.ones(50),
        shaft_fs=500,
    )
    assert dict(recording.fs) == {"vibration": 48_000.0, "position": 1000.0}
    assert recording.duration == 0.1


@pytest.mark.parametrize(("n_times", "n_shaft"), [(200, 200), (199, 200), (201, 200), (200, 20)])
def test_durations_may_differ_by_one_sample(n_times, n_shaft):
    shaft_fs = 100 if n_shaft > 20 else 10
    speed = np.ones(n_shaft)
    recording = Recording({"a": np.zeros(n_times)}, 100, velocity=speed, shaft_fs=shaft_fs)
    assert recording.duration == min(n_times / 100, 2.0)


# Numbers


@pytest.mark.parametrize("dtype", ["f4", ">f4", np.int16, np.bool_, np.float16])
def test_float32_stays_float32_and_other_numbers_become_float64(dtype):
    values = np.arange(200).astype(dtype)
    recording = Recording({"a": values}, 100, velocity=values)
    for found in (recording.signals["a"], recording.velocity):
        assert found.dtype == (np.float32 if np.dtype(dtype).str[1:] == "f4" else np.float64)
        np.testing.assert_array_equal(found, values)


# The shaft


def test_a_velocity_is_integrated_by_the_trapezoid_rule():
    speed = 3 + np.sin(TIMES)
    recording = sine(velocity=speed)
    expected = np.concatenate([[0], np.cumsum((speed[1:] + speed[:-1]) / 200)])
    np.testing.assert_allclose(recording.angle, expected, atol=1e-12)
    assert recording.reference == "velocity"


def test_an_angle_is_differentiated():
    recording = sine(velocity=None, angle=3.0 * TIMES)
    np.testing.assert_allclose(recording.velocity, 3.0, rtol=1e-9)
    assert recording.reference == "angle"


@pytest.mark.parametrize("lowest", [0.0, -np.pi])
@pytest.mark.parametrize("speed", [7.0, -7.0])
def test_a_wrapped_angle_is_unwrapped(lowest, speed):
    wrapped = (speed * TIMES - lowest) % (2 * np.pi) + lowest
    np.testing.assert_allclose(sine(velocity=None, angle=wrapped).angle, speed * TIMES, atol=1e-9)


# Immutability


def test_later_changes_of_the_input_do_not_show():
    signal, speed = np.sin(TIMES), np.ones(200)
    signals, rates, meta = {"a": signal}, {"a": 100}, {"unit": "A"}
    recording = Recording(signals, rates, velocity=speed, meta=meta)
    signal[:], speed[:] = 7.0, 7.0
    signals["b"], rates["a"], meta["unit"] = TIMES, 5, "B"
    assert (recording.channels, recording.fs["a"], recording.meta["unit"]) == (("a",), 100, "A")
    np.testing.assert_array_equal(recording.signals["a"], np.sin(TIMES))
    np.testing.assert_array_equal(recording.velocity, 1.0)


def test_arrays_are_read_only():
    recording = sine()
    with pytest.raises(ValueError, match="read-only"):
        recording.signals["current"][0] = 1
    with pytest.raises(ValueError, match="read-only"):
        recording.velocity[0] = 1


@pytest.mark.parametrize("name", ["signals", "fs", "meta"])
def test_mappings_are_read_only(name):
    with pytest.raises(TypeError, match="assignment"):
        getattr(sine(), name)["current"] = 1


@pytest.mark.parametrize("name", ["signals", "shaft_fs", "meta", "note", "_shaft"])
def test_setting_an_attribute_is_refused(name):
    with pytest.raises(AttributeError, match=f"cannot be changed.*{name}.*make a new one"):
        setattr(sine(), name, 1)


@pytest.mark.parametrize("mode", ["r", "r+"])
def test_a_file_is_kept_without_a_copy_if_it_is_read_only(tmp_path, mode):
    np.save(tmp_path / "long.npy", np.sin(TIMES))
    mapped = np.load(tmp_path / "long.npy", mmap_mode=mode)
    recording = Recording({"a": mapped}, 100, velocity=np.ones(200))
    assert np.shares_memory(recording.signals["a"], mapped) == (mode == "r")


def test_a_read_only_array_is_kept_without_a_copy():
    signal = np.sin(TIMES)
    signal.setflags(write=False)
    recording = Recording({"a": signal, "b": signal[::-1]}, 100, velocity=np.ones(200))
    assert all(np.shares_memory(recording.signals[name], signal) for name in "ab")


def test_a_buffer_that_is_refilled_changes_no_recording():
    buffer = np.arange(50.0)
    given = sliding_window_view(buffer, 20)[3]  # read-only
    recording = Recording({"b": given, "a": given[::-1]}, 10, angle=given)
    buffer[:] = -7.0
    for found in (recording.signals["b"], recording.signals["a"][::-1], recording.angle):
        np.testing.assert_array_equal(found, np.arange(3.0, 23.0))


# Copies and files


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_a_copy_is_the_recording_itself(copied):
    recording = sine()
    assert copied(recording) is recording


def test_a_recording_survives_pickle():
    recording = sine(meta={"unit": "A", "trace": np.arange(3)})
    assert pickle.loads(pickle.dumps(recording)) == recording


def test_a_recording_that_a_worker_maps_from_disk_is_equal_and_hashes_alike(tmp_path):
    recording = Recording({"a": np.arange(2000.0)}, 10, velocity=np.ones(2000))
    joblib.dump(recording, tmp_path / "recording.joblib")
    mapped = joblib.load(tmp_path / "recording.joblib", mmap_mode="r")
    assert mapped == recording
    assert joblib.hash(mapped) == joblib.hash(recording)
    assert not mapped.signals["a"].flags.writeable


# Digest


def test_recordings_of_equal_content_have_one_digest_whatever_their_meta():
    assert sine().digest == sine(meta={"unit": "B"}).digest


# Comparison


@pytest.mark.parametrize(
    "other",
    [
        sine(velocity=np.full(200, 4.0)),
        sine(velocity=None, angle=3.0 * TIMES),
        sine(meta={"unit": "B"}),
        sine(meta=None),
        sine(shaft_fs=100.2),
        sine(velocity=None, angle=np.full(200, 3.0)),  # the same numbers
        sine(velocity=np.full(200, 3.0, dtype=np.float32)),
        Recording({"current": np.sin(9 * TIMES)}, 100, velocity=np.full(200, 3.0)),
        "a recording",
        None,
    ],
)
def test_recordings_of_other_content_are_not_equal(other):
    assert sine() != other


def test_the_repr_tells_channels_rates_length_revolutions_and_meta():
    recording = Recording(
        {"current": np.zeros(200), "position": np.zeros(20)},
        {"current": 100, "position": 10},
        velocity=np.full(200, 2 * np.pi),
        shaft_fs=100,
        meta={"unit": "A", "load": 3},
    )
    assert repr(recording) == (
        "Recording(current 100 Hz, position 10 Hz; velocity 100 Hz; 2 s, 1.99 revolutions; "
        "unit='A', load=3)"
    )


# Units and views that would mislead


def test_an_angle_wrapped_in_degrees_is_refused_with_the_remedy():
    degrees = np.rad2deg(10 * np.arange(500) / 100) % 360
    with pytest.raises(ValueError, match=r"angle jumps by 35\d.* sample .*angle_from_wrapped"):
        Recording({"a": np.zeros(500)}, 100, angle=degrees)


# Indices of pandas objects


def table(times, **columns):
    rng = np.random.default_rng(8)
    names = columns or {"torque": 0, "current": 1}
    return pd.DataFrame({name: rng.normal(size=len(times)) for name in names}, index=times)


def clock(n_times=400, fs=100.0, start="2024-05-01 12:00:00"):
    return pd.Timestamp(start) + pd.to_timedelta(np.arange(n_times) / fs, unit="s")


def test_a_time_index_that_agrees_with_the_rate_is_accepted():
    frame = table(clock())
    speed = pd.Series(np.full(400, 3.0), index=frame.index)
    assert Recording(frame, 100, velocity=speed).channels == ("torque", "current")
    assert Recording(frame, 100, velocity=speed.to_numpy()).duration == 4
    elapsed = frame.set_axis(frame.index - frame.index[0])
    assert Recording(elapsed, 100, velocity=np.full(400, 3.0)).duration == 4


@pytest.mark.parametrize(
    ("times", "words"),
    [
        (clock(fs=1000.0), r"fs = 100 Hz: sample 1 is at 0.001 s, expected was 0.01 s"),
        (clock(401).delete(123), r"sample 123 is at 1.24 s, expected was 1.23 s"),
        (clock()[::-1], r"sample 1 is at -0.01 s"),
        (clock().insert(7, pd.NaT).delete(399), "sample 7 is at nan s"),
    ],
)
def test_a_time_index_that_contradicts_the_rate_is_refused(times, words):
    with pytest.raises(ValueError, match=f"the index of channel 'torque' contradicts.*{words}"):
        Recording(table(times), 100, velocity=np.full(400, 3.0))


@pytest.mark.parametrize(
    ("times", "late"),
    [(clock(), clock(40, 10.0, "2024-05-01 12:00:05")), (range(1, 401), range(2, 42))],
)
@pytest.mark.parametrize("reference", ["velocity", "angle"])
def test_a_shaft_with_another_start_than_the_channels_is_refused(times, late, reference):
    frame, shaft = table(times), pd.Series(np.linspace(1, 9, 40), index=late)
    with pytest.raises(ValueError, match=rf"{reference} and channel 'torque' have different"):
        Recording(frame, 100, **{reference: shaft}, shaft_fs=10)
    for aligned in (shaft.to_numpy(), shaft.reset_index(drop=True)):
        assert Recording(frame, 100, **{reference: aligned}, shaft_fs=10).duration == 4


@pytest.mark.parametrize(("name", "what"), [("Time [s]", "the time"), ("rpm", "the speed")])
def test_a_column_of_a_table_that_is_no_channel_is_refused_unless_it_is_listed(name, what):
    frame = pd.DataFrame({name: np.arange(5) / 10, "b": np.arange(5.0)})
    with pytest.raises(ValueError, match=rf"named like {what} of the .*drop\(columns="):
        Recording(frame, 10, velocity=3.0)
    assert Recording(dict(frame), 10, velocity=3.0).channels == (name, "b")
