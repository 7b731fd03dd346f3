"""Facts about the recording: what it takes, keeps and refuses to change."""

import copy
import os
import pickle
import time

import joblib
import numpy as np
import pandas as pd
import pytest
from numpy.lib.stride_tricks import as_strided, sliding_window_view

from emacm import Recording

TIMES = np.arange(200) / 100


def sine(**options):
    """Two seconds at 100 Hz of a shaft at 3 rad/s."""
    options = {"velocity": np.full(200, 3.0), "meta": {"unit": "A"}} | options
    return Recording({"current": np.sin(9 * TIMES), "torque": np.cos(9 * TIMES)}, 100, **options)


# What it takes


def test_channels_come_in_the_order_of_the_mapping():
    assert sine().channels == ("current", "torque")


def test_a_frame_gives_a_channel_for_each_column():
    frame = pd.DataFrame({"b": np.sin(TIMES), "a": np.cos(TIMES)})
    recording = Recording(frame, 100, velocity=np.ones(200))
    assert recording.channels == ("b", "a")
    np.testing.assert_array_equal(recording.signals["a"], np.cos(TIMES))


def test_a_frame_column_of_the_machine_may_be_the_shaft():
    frame = pd.DataFrame({"a": np.sin(TIMES), "speed": np.full(200, 2.0)})
    recording = Recording(frame[["a"]], 100, velocity=frame["speed"])
    np.testing.assert_array_equal(recording.velocity, 2.0)


def test_each_channel_may_have_a_rate_of_its_own():
    recording = Recording(
        {"vibration": np.zeros(4800), "position": np.zeros(100)},
        {"position": 1000, "vibration": 48_000},
        velocity=np.ones(50),
        shaft_fs=500,
    )
    assert dict(recording.fs) == {"vibration": 48_000.0, "position": 1000.0}
    assert recording.duration == 0.1


def test_the_rate_of_the_shaft_must_be_given_if_channels_differ():
    with pytest.raises(ValueError, match="shaft_fs must be given"):
        Recording({"a": np.zeros(20), "b": np.zeros(10)}, {"a": 20, "b": 10}, velocity=np.ones(20))


@pytest.mark.parametrize(("n_times", "n_shaft"), [(200, 200), (199, 200), (201, 200), (200, 20)])
def test_durations_may_differ_by_one_sample(n_times, n_shaft):
    shaft_fs = 100 if n_shaft > 20 else 10
    recording = Recording(
        {"a": np.zeros(n_times)}, 100, velocity=np.ones(n_shaft), shaft_fs=shaft_fs
    )
    assert recording.duration == min(n_times / 100, 2.0)


def test_durations_two_samples_apart_are_refused():
    with pytest.raises(ValueError, match=r"channel 'a' lasts 1\.98 s .* velocity 2 s"):
        Recording({"a": np.zeros(198)}, 100, velocity=np.ones(200))


# Numbers


def test_float32_stays_float32():
    recording = Recording({"a": TIMES.astype(np.float32)}, 100, velocity=np.ones(200, np.float32))
    assert recording.signals["a"].dtype == np.float32
    assert recording.velocity.dtype == np.float32


@pytest.mark.parametrize("dtype", [np.int16, np.uint8, np.int64, np.bool_, np.float16])
def test_other_numbers_become_float64(dtype):
    recording = Recording({"a": np.arange(200).astype(dtype)}, 100, velocity=np.ones(200, dtype))
    assert recording.signals["a"].dtype == np.float64
    assert recording.velocity.dtype == np.float64


@pytest.mark.parametrize("dtype", [">f8", ">f4", ">i2"])
def test_big_endian_numbers_become_native_ones_of_equal_value(dtype):
    values = np.arange(200).astype(dtype)
    signal = Recording({"a": values}, 100, velocity=np.ones(200)).signals["a"]
    assert signal.dtype.isnative
    np.testing.assert_array_equal(signal, np.arange(200))


def test_a_masked_array_is_refused_as_its_masked_samples_are_no_measurement():
    masked = np.ma.masked_array(TIMES, mask=TIMES > 1)
    with pytest.raises((TypeError, ValueError), match="mask"):
        Recording({"a": masked}, 100, velocity=np.ones(200))


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


def test_a_wrapped_angle_is_unwrapped():
    angle = 7.0 * TIMES
    recording = sine(velocity=None, angle=angle % (2 * np.pi))
    np.testing.assert_allclose(recording.angle, angle, atol=1e-9)


def test_an_angle_wrapped_about_zero_that_runs_backwards_is_unwrapped():
    angle = -7.0 * TIMES
    wrapped = (angle + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(sine(velocity=None, angle=wrapped).angle, angle, atol=1e-9)


def test_a_jump_beyond_pi_within_one_revolution_is_a_wrap():
    jump = np.linspace(0, 1, 200)
    jump[100:] += 3.2
    assert np.ptp(sine(velocity=None, angle=jump).angle) < np.pi


def test_steps_within_pi_are_never_taken_for_a_wrap():
    small = np.linspace(0, 1, 200)
    small[100:] += 3.1
    np.testing.assert_array_equal(sine(velocity=None, angle=small).angle, small)


def test_an_angle_that_spans_more_than_a_revolution_is_cumulative_whatever_its_steps():
    fast = 4.0 * np.arange(200)
    np.testing.assert_array_equal(sine(velocity=None, angle=fast).angle, fast)


# Immutability


def test_later_changes_of_the_input_do_not_show():
    signal, speed = np.sin(TIMES), np.ones(200)
    recording = Recording({"a": signal}, 100, velocity=speed)
    signal[:], speed[:] = 7.0, 7.0
    np.testing.assert_array_equal(recording.signals["a"], np.sin(TIMES))
    np.testing.assert_array_equal(recording.velocity, 1.0)


def test_later_changes_of_a_frame_do_not_show():
    frame = pd.DataFrame({"a": np.sin(TIMES), "b": np.cos(TIMES)})
    recording = Recording(frame, 100, velocity=np.ones(200))
    frame.iloc[:, 0] = 7.0
    frame.loc[3, "b"] = 7.0
    frame["a"] = 8.0
    np.testing.assert_array_equal(recording.signals["a"], np.sin(TIMES))
    np.testing.assert_array_equal(recording.signals["b"], np.cos(TIMES))


def test_later_changes_of_mappings_do_not_show():
    signals, rates, meta = {"a": TIMES}, {"a": 100}, {"unit": "A"}
    recording = Recording(signals, rates, velocity=np.ones(200), meta=meta)
    signals["b"], rates["a"], meta["unit"] = TIMES, 5, "B"
    assert recording.channels == ("a",)
    assert recording.fs["a"] == 100
    assert recording.meta["unit"] == "A"


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


def test_a_read_only_file_is_kept_without_a_copy(tmp_path):
    np.save(tmp_path / "long.npy", np.sin(TIMES))
    mapped = np.load(tmp_path / "long.npy", mmap_mode="r")
    recording = Recording({"a": mapped}, 100, velocity=np.ones(200))
    assert np.shares_memory(recording.signals["a"], mapped)


def test_a_writeable_file_is_copied(tmp_path):
    np.save(tmp_path / "long.npy", np.sin(TIMES))
    mapped = np.load(tmp_path / "long.npy", mmap_mode="r+")
    recording = Recording({"a": mapped}, 100, velocity=np.ones(200))
    assert not np.shares_memory(recording.signals["a"], mapped)


# Copies and files


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_a_copy_is_the_recording_itself(copied):
    recording = sine()
    assert copied(recording) is recording


@pytest.mark.parametrize("protocol", range(2, pickle.HIGHEST_PROTOCOL + 1))
def test_a_recording_survives_pickle(protocol):
    recording = sine(meta={"unit": "A", "trace": np.arange(3)})
    assert pickle.loads(pickle.dumps(recording, protocol)) == recording


def test_a_recording_from_pickle_is_read_only():
    again = pickle.loads(pickle.dumps(sine()))
    assert not again.signals["current"].flags.writeable
    with pytest.raises(AttributeError, match="cannot be changed"):
        again.shaft_fs = 3


@pytest.mark.parametrize("mmap_mode", [None, "r"])
def test_a_recording_survives_joblib(tmp_path, mmap_mode):
    joblib.dump([sine()], tmp_path / "runs.joblib")
    assert joblib.load(tmp_path / "runs.joblib", mmap_mode=mmap_mode) == [sine()]


@pytest.mark.parametrize(
    "change", [{"velocity": np.full(200, 4.0)}, {"meta": {"unit": "B"}}, {"shaft_fs": 100.2}]
)
def test_joblib_hashes_different_recordings_apart(change):
    assert joblib.hash(sine()) != joblib.hash(sine(**change))


# Digest

CHANGES = {
    "velocity": {"velocity": np.full(200, 4.0)},
    "angle": {"velocity": None, "angle": 3.0 * TIMES},
    "the same numbers as angle": {"velocity": None, "angle": np.full(200, 3.0)},
    "float32": {"velocity": np.full(200, 3.0, dtype=np.float32)},
    "rate": {"shaft_fs": 100.2},
}


def settled(file):
    """Make a file look as if it was written an hour ago."""
    os.utime(file, (time.time() - 3600,) * 2)


def mapped_sine(file, factor=1.0):
    """A recording of a file in which no time stamp is too fresh to be trusted."""
    np.save(file, factor * np.sin(TIMES))
    settled(file)
    return Recording({"a": np.load(file, mmap_mode="r")}, 100, velocity=np.ones(200))


def in_memory(recording):
    signals = {name: np.array(signal) for name, signal in recording.signals.items()}
    return Recording(signals, recording.fs, velocity=recording.velocity)


def test_recordings_of_equal_content_have_one_digest_whatever_their_meta():
    assert sine().digest == sine(meta={"unit": "B"}).digest


@pytest.mark.parametrize("change", CHANGES.values(), ids=list(CHANGES))
def test_recordings_of_other_content_have_other_digests(change):
    assert sine().digest != sine(**change).digest


def test_names_order_and_rates_of_channels_are_part_of_the_digest():
    one, other = np.sin(TIMES), np.cos(TIMES)
    made = [
        Recording({"a": one, "b": other}, 100, velocity=one),
        Recording({"b": other, "a": one}, 100, velocity=one),
        Recording({"a": other, "b": one}, 100, velocity=one),
        Recording({"a": one, "c": other}, 100, velocity=one),
        Recording({"a": one, "b": other}, {"a": 100, "b": 100.2}, velocity=one, shaft_fs=100),
    ]
    assert len({recording.digest for recording in made}) == len(made)


def test_where_one_channel_ends_and_the_next_begins_is_part_of_the_digest():
    long, short = np.arange(201.0), np.arange(201.0, 401.0)
    moved = np.concatenate([long, short])
    one = Recording({"a": long, "b": short}, 100, velocity=np.ones(200))
    other = Recording({"a": moved[:200], "b": moved[200:]}, 100, velocity=np.ones(200))
    assert one.digest != other.digest


def test_how_a_channel_lies_in_memory_is_no_part_of_the_digest():
    spread = np.zeros((200, 2))
    spread[:, 0] = np.sin(TIMES)
    spread.flags.writeable = False
    one = Recording({"a": spread[:, 0]}, 100, velocity=np.ones(200))
    assert one.digest == Recording({"a": np.sin(TIMES)}, 100, velocity=np.ones(200)).digest


def test_a_long_channel_is_read_to_its_end():
    signal = np.zeros((1 << 20) + 5)
    one = Recording({"a": signal}, 100, velocity=np.ones(len(signal)))
    signal[-1] = 1
    other = Recording({"a": signal}, 100, velocity=np.ones(len(signal)))
    assert one.digest != other.digest


def test_asking_for_the_digest_changes_nothing_else():
    asked, other = sine(), sine()
    assert asked.digest
    assert asked.strokes()
    assert asked == other
    assert hash(asked) == hash(other)
    assert repr(asked) == repr(other)
    assert joblib.hash(asked) == joblib.hash(other)
    assert pickle.dumps(asked) == pickle.dumps(other)


def test_a_recording_of_a_file_hashes_like_one_in_memory_for_joblib(tmp_path):
    recording = mapped_sine(tmp_path / "long.npy")
    assert recording.digest
    assert joblib.hash(recording) == joblib.hash(in_memory(recording))


# Comparison


def test_recordings_of_equal_content_are_equal_and_hash_alike():
    assert sine() == sine()
    assert hash(sine()) == hash(sine())


@pytest.mark.parametrize(
    "other",
    [
        sine(velocity=np.full(200, 4.0)),
        sine(velocity=None, angle=3.0 * TIMES),
        sine(meta={"unit": "B"}),
        sine(meta=None),
        sine(shaft_fs=100.2),
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
    with pytest.raises(
        ValueError, match=r"angle jumps by 35\d.* after sample .*angle_from_wrapped"
    ):
        Recording({"a": np.zeros(500)}, 100, angle=degrees)


def test_a_wrapped_angle_with_noise_is_refused_and_not_taken_as_cumulative():
    noise = 0.05 * np.random.default_rng(0).standard_normal(500)
    wrapped = (10 * np.arange(500) / 100) % (2 * np.pi) + noise
    with pytest.raises(ValueError, match="Is it wrapped"):
        Recording({"a": np.zeros(500)}, 100, angle=wrapped)


def test_a_recording_that_a_worker_maps_from_disk_hashes_alike(tmp_path):
    recording = Recording({"a": np.arange(2000.0)}, 10, velocity=np.ones(2000))
    joblib.dump(recording, tmp_path / "recording.joblib")
    mapped = joblib.load(tmp_path / "recording.joblib", mmap_mode="r")
    assert joblib.hash(mapped) == joblib.hash(recording)


# Buffers that somebody else can write to


def windows():
    buffer = np.arange(50.0)
    return buffer, sliding_window_view(buffer, 20)[3]


def strided():
    buffer = np.arange(50.0)
    return buffer, as_strided(buffer, shape=(20,), strides=(16,), writeable=False)


def of_a_bytearray():
    buffer = np.arange(20.0)
    stored = bytearray(buffer.tobytes())
    view = np.frombuffer(stored)
    view.flags.writeable = False
    return np.frombuffer(stored), view


@pytest.mark.parametrize("make", [windows, strided, of_a_bytearray])
def test_a_buffer_that_is_refilled_changes_no_recording(make):
    buffer, given = make()
    expected = given.copy()
    recording = Recording({"b": given, "a": given[::-1]}, 10, velocity=given + 1)
    angled = Recording({"b": given}, 10, angle=given)
    before = recording.digest
    buffer.flags.writeable = True
    buffer[:] = -7.0
    np.testing.assert_array_equal(recording.signals["b"], expected)
    np.testing.assert_array_equal(recording.signals["a"], expected[::-1])
    np.testing.assert_array_equal(angled.angle, expected)
    assert recording.digest == before


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
        (clock(fs=1000.0), r"sample 1 is at 0.001 s, expected was 0.01 s .*1000 Hz"),
        (clock(fs=10.0), r"sample 1 is at 0.1 s"),
        (clock(401).delete(123), r"sample 123 is at 1.24 s, expected was 1.23 s"),
        (clock(fs=99.0), r"sample \d+ .*mean rate of the index: 99 Hz.*Correct fs"),
        (clock()[::-1], r"sample 1 is at -0.01 s"),
        (clock().insert(7, pd.NaT).delete(399), "missing times"),
        (clock(1).repeat(400), r"sample 1 is at 0 s, .* \(mean rate of the index: inf Hz\)"),
    ],
)
def test_a_time_index_that_contradicts_the_rate_is_refused(times, words):
    with pytest.raises(ValueError, match=f"the index of channel 'torque'.*{words}|{words}"):
        Recording(table(times), 100, velocity=np.full(400, 3.0))


def test_the_time_index_of_the_shaft_is_checked_with_its_own_rate():
    frame = table(clock())
    slow = pd.Series(np.full(40, 3.0), index=clock(40, fs=10.0))
    assert Recording(frame, 100, velocity=slow, shaft_fs=10).shaft_fs == 10
    late = slow.set_axis(slow.index + pd.Timedelta("5s"))
    with pytest.raises(
        ValueError,
        match=r"velocity and channel 'torque' have different indices: velocity starts at "
        r"2024-05-01 12:00:05, channel 'torque' at 2024-05-01 12:00:00\. ",
    ):
        Recording(frame, 100, velocity=late, shaft_fs=10)
    with pytest.raises(ValueError, match=r"velocity starts at 2024-05-01 12:00:00, .* 12:00:05"):
        Recording(frame.set_axis(frame.index + pd.Timedelta("5s")), 100, velocity=slow, shaft_fs=10)
    gap = slow.set_axis(clock(41, fs=10.0).delete(9))
    with pytest.raises(ValueError, match="the index of velocity contradicts fs = 10 Hz: sample 9"):
        Recording(frame, 100, velocity=gap, shaft_fs=10)


@pytest.mark.parametrize("reference", ["velocity", "angle"])
def test_a_shaft_whose_index_is_not_that_of_the_channels_is_refused(reference):
    frame = table(np.arange(100, 500))
    shaft = pd.Series(np.linspace(1, 9, 400), index=np.arange(101, 501))
    with pytest.raises(ValueError, match=rf"{reference} and channel 'torque'.*101.*100.*Align"):
        Recording(frame, 100, **{reference: shaft})
    assert Recording(frame, 100, **{reference: shaft.to_numpy()}).duration == 4
    assert Recording(frame, 100, **{reference: shaft.reset_index(drop=True)}).duration == 4
    assert Recording(frame, 100, **{reference: shaft.set_axis(frame.index)}).duration == 4


def test_channels_of_different_indices_are_refused():
    one, other = table(clock())["torque"], table(clock(start="2024-05-01 12:00:03"))["current"]
    with pytest.raises(ValueError, match="channel 'a' and channel 'b' have different indices"):
        Recording({"b": one, "a": other}, 100, velocity=np.full(400, 3.0))


# Angles and speeds that no shaft has


@pytest.mark.parametrize("offset", [1e12, -1e12, 1e14])
def test_an_angle_whose_steps_are_lost_in_rounding_is_refused(offset):
    angle = offset + 0.006 * np.arange(500)
    with pytest.raises(
        ValueError, match=r"float64 resolves .* rad.*Subtract the angle of the first"
    ):
        Recording({"a": np.zeros(500)}, 100, angle=angle)
    assert Recording({"a": np.zeros(500)}, 100, angle=angle - angle[0]).duration == 5


@pytest.mark.parametrize(
    ("shaft", "words"),
    [
        ({"angle": [0.0, 1e16]}, "angle must be in rad, got values up to 1e.16"),
        ({"velocity": [0.0, -1e10]}, "velocity must be in rad/s, got -1e.10 at sample 1"),
    ],
)
def test_a_shaft_reference_beyond_any_shaft_is_refused(shaft, words):
    with pytest.raises(ValueError, match=words):
        Recording({"a": np.zeros(2)}, 100, **shaft)


# Durations and short angles
