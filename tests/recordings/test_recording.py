"""Facts about the recording: what it takes, keeps and refuses to change."""

import copy
import mmap
import os
import pickle
import time

import joblib
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.lib.stride_tricks import as_strided, sliding_window_view

import emacm.recordings.recording
from emacm import Recording
from emacm._kernels import using
from emacm.recordings import digests
from emacm.recordings.content import same_content

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


def test_a_frame_equals_the_mapping_of_its_columns():
    signals = {"a": np.sin(TIMES), "b": np.cos(TIMES)}
    velocity = np.ones(200)
    from_frame = Recording(pd.DataFrame(signals), 100, velocity=velocity)
    assert from_frame == Recording(signals, 100, velocity=velocity)


def test_a_frame_column_of_the_machine_may_be_the_shaft():
    frame = pd.DataFrame({"a": np.sin(TIMES), "speed": np.full(200, 2.0)})
    recording = Recording(frame[["a"]], 100, velocity=frame["speed"])
    np.testing.assert_array_equal(recording.velocity, 2.0)


def test_lists_of_numbers_are_channels():
    recording = Recording({"a": [1, 2, 3]}, 10, velocity=[1, 1, 1])
    np.testing.assert_array_equal(recording.signals["a"], [1.0, 2.0, 3.0])


def test_one_rate_serves_all_channels_and_the_shaft():
    recording = sine()
    assert dict(recording.fs) == {"current": 100.0, "torque": 100.0}
    assert recording.shaft_fs == 100.0


def test_each_channel_may_have_a_rate_of_its_own():
    recording = Recording(
        {"vibration": np.zeros(4800), "position": np.zeros(100)},
        {"position": 1000, "vibration": 48_000},
        velocity=np.ones(50),
        shaft_fs=500,
    )
    assert dict(recording.fs) == {"vibration": 48_000.0, "position": 1000.0}
    assert recording.duration == 0.1


def test_the_rate_of_the_shaft_is_that_of_the_channels_if_they_agree():
    recording = Recording({"a": TIMES, "b": TIMES}, {"a": 100, "b": 100.0}, velocity=np.ones(200))
    assert recording.shaft_fs == 100.0


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


def test_the_sample_that_durations_may_differ_by_is_that_of_the_coarser_series():
    recording = Recording({"a": np.zeros(191)}, 100, velocity=np.ones(20), shaft_fs=10)
    assert recording.duration == 1.91


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


def test_later_changes_of_a_column_do_not_show():
    column = pd.Series(np.sin(TIMES))
    recording = Recording({"a": column}, 100, velocity=column)
    column.iloc[:] = 7.0
    np.testing.assert_array_equal(recording.signals["a"], np.sin(TIMES))
    np.testing.assert_array_equal(recording.velocity, np.sin(TIMES))


def test_later_changes_of_mappings_do_not_show():
    signals, rates, meta = {"a": TIMES}, {"a": 100}, {"unit": "A"}
    recording = Recording(signals, rates, velocity=np.ones(200), meta=meta)
    signals["b"], rates["a"], meta["unit"] = TIMES, 5, "B"
    assert recording.channels == ("a",)
    assert recording.fs["a"] == 100
    assert recording.meta["unit"] == "A"


def test_later_changes_of_what_meta_holds_do_not_show():
    loads, trace = [1, 2], np.arange(3)
    recording = sine(meta={"loads": loads, "trace": trace})
    loads.append(3)
    trace[0] = 9
    assert recording.meta["loads"] == [1, 2]
    np.testing.assert_array_equal(recording.meta["trace"], [0, 1, 2])


def test_the_input_stays_writeable():
    signal = np.sin(TIMES)
    Recording({"a": signal}, 100, velocity=signal)
    assert signal.flags.writeable


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


def test_deleting_an_attribute_is_refused():
    with pytest.raises(AttributeError, match="cannot be changed"):
        del sine().shaft_fs


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


def test_a_deep_copy_of_a_list_holds_the_same_recordings():
    recordings = [sine(), sine()]
    again = copy.deepcopy(recordings)
    assert all(one is other for one, other in zip(recordings, again, strict=True))


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


def test_joblib_hashes_equal_recordings_alike():
    assert joblib.hash(sine()) == joblib.hash(sine())


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


def known_digests(monkeypatch):
    """Count how often content is read for a digest."""
    read = []
    original = digests._read

    def counting(array):
        read.append(array)
        return original(array)

    monkeypatch.setattr(digests, "_read", counting)
    return read


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


def test_a_digest_is_worked_out_once(monkeypatch):
    read = known_digests(monkeypatch)
    recording = sine()
    assert recording.digest == recording.digest
    assert len(read) == 3  # two channels and the shaft


def test_pickling_works_no_digest_out(monkeypatch):
    read = known_digests(monkeypatch)
    again = pickle.loads(pickle.dumps(sine()))
    assert not read
    assert again.digest == sine().digest


def test_asking_for_the_digest_changes_nothing_else():
    asked, other = sine(), sine()
    assert asked.digest
    assert asked.strokes()
    assert asked == other
    assert hash(asked) == hash(other)
    assert repr(asked) == repr(other)
    assert joblib.hash(asked) == joblib.hash(other)
    assert pickle.dumps(asked) == pickle.dumps(other)


def test_a_recording_from_pickle_hashes_like_its_origin_for_joblib():
    assert joblib.hash(pickle.loads(pickle.dumps(sine()))) == joblib.hash(sine())


def test_a_recording_of_a_file_hashes_like_one_in_memory_for_joblib(tmp_path):
    recording = mapped_sine(tmp_path / "long.npy")
    assert recording.digest
    assert joblib.hash(recording) == joblib.hash(in_memory(recording))


def test_the_digest_of_a_file_is_worked_out_once(monkeypatch, tmp_path):
    read = known_digests(monkeypatch)
    recording = mapped_sine(tmp_path / "long.npy")
    assert recording.digest == recording.digest == in_memory(recording).digest
    assert len(read) == 4  # channel and shaft of each


def test_the_digest_of_a_file_that_was_rewritten_is_another(tmp_path):
    file = tmp_path / "long.npy"
    recording = mapped_sine(file)
    before = recording.digest
    mapped_sine(file, factor=2.0)
    assert recording.digest != before
    assert recording.digest == in_memory(recording).digest


def test_time_stamps_that_may_not_change_any_more_are_not_trusted(tmp_path):
    file = tmp_path / "long.npy"
    recording = mapped_sine(file)
    now = time.time_ns() + 3600 * 10**9  # so that it is fresh, however slow this test is
    os.utime(file, ns=(now, now))
    before = recording.digest
    np.save(file, np.cos(TIMES))
    os.utime(file, ns=(now, now))  # as on a file system with a coarse clock
    assert recording.digest != before


def test_the_map_of_a_replaced_file_shows_the_old_one_and_so_does_its_digest(tmp_path):
    file = tmp_path / "long.npy"
    old = mapped_sine(file)
    before = old.digest
    os.rename(file, tmp_path / "moved.npy")
    new = mapped_sine(file, factor=2.0)
    assert old.digest == before
    assert new.digest == in_memory(new).digest != before


def test_the_digest_of_a_file_that_is_gone_is_still_that_of_the_content(tmp_path):
    recording = mapped_sine(tmp_path / "long.npy")
    expected = in_memory(recording).digest
    os.rename(tmp_path / "long.npy", tmp_path / "moved.npy")
    assert recording.digest == recording.digest == expected


def as_in_a_worker(recording):
    """Send a recording as joblib does: a memory map goes by the name of its file."""
    state = recording.__getstate__()
    file = recording.signals["a"].base.filename
    state["_series"] = {"a": np.load(file, mmap_mode="r")}
    received = Recording.__new__(Recording)
    received.__setstate__(state)
    return received


def test_a_worker_reads_a_file_once_however_often_it_is_sent(monkeypatch, tmp_path):
    recording = mapped_sine(tmp_path / "long.npy")
    assert as_in_a_worker(recording).digest == recording.digest
    read = known_digests(monkeypatch)
    for _ in range(3):
        assert as_in_a_worker(recording).digest == recording.digest
    assert [array.ctypes.data for array in read] == [recording.velocity.ctypes.data] * 3


def test_a_worker_does_not_believe_the_digest_of_a_file_that_was_replaced(tmp_path):
    file = tmp_path / "long.npy"
    recording = mapped_sine(file)
    assert as_in_a_worker(recording).digest == recording.digest
    os.rename(file, tmp_path / "moved.npy")
    mapped_sine(file, factor=2.0)
    for _ in range(2):
        received = as_in_a_worker(recording)
        assert received.digest == in_memory(received).digest != recording.digest


def test_a_mapped_buffer_of_an_unknown_file_is_read_each_time(monkeypatch, tmp_path):
    file = tmp_path / "long.bin"
    file.write_bytes(np.sin(TIMES).tobytes())
    with open(file, "rb") as opened:
        buffer = mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ)
    recording = Recording({"a": np.frombuffer(buffer)}, 100, velocity=np.ones(200))
    before = recording.digest
    file.write_bytes(np.cos(TIMES).tobytes())
    assert recording.digest != before


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


@pytest.mark.parametrize(
    "value",
    [
        np.arange(3),
        {"deep": np.arange(3)},
        [np.arange(3), "b"],
        (np.arange(2), np.arange(3)),
        pd.DataFrame({"x": [1, 2]}),
        pd.Series([1, 2]),
        np.array([1.0, np.nan]),
        float("nan"),
        [1, 2],
        None,
    ],
    ids=lambda value: type(value).__name__,
)
def test_equal_meta_of_any_kind_compares_equal(value):
    one, other = sine(meta={"x": value}), sine(meta={"x": copy.deepcopy(value)})
    assert (one == other) is True


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (np.arange(3), np.arange(4)),
        (np.arange(3), [0, 1, 2]),
        ([np.arange(3)], [np.zeros(3)]),
        ({"a": np.arange(3)}, {"a": np.zeros(3)}),
        (pd.DataFrame({"x": [1]}), pd.DataFrame({"x": [2]})),
        (pd.DataFrame({"x": [1]}), 5),
    ],
)
def test_different_meta_of_any_kind_compares_unequal(one, other):
    assert (sine(meta={"x": one}) == sine(meta={"x": other})) is False


def test_a_recording_can_be_found_in_a_list():
    recordings = [sine(meta={"unit": unit}) for unit in "ABC"]
    assert recordings.index(sine(meta={"unit": "B"})) == 1


@given(st.integers(2, 30), st.floats(1, 1e5), st.integers(0, 2**32 - 1))
def test_a_pickled_recording_is_equal_and_hashes_alike(n_times, fs, seed):
    rng = np.random.default_rng(seed)
    recording = Recording({"a": rng.normal(size=n_times)}, fs, velocity=rng.normal(size=n_times))
    again = pickle.loads(pickle.dumps(recording))
    assert again == recording
    assert hash(again) == hash(recording)


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


def test_the_repr_without_meta_ends_with_the_length():
    assert repr(sine(meta=None)).endswith("2 s, 0.95 revolutions)")


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


def test_a_read_only_view_of_what_can_be_written_to_is_copied():
    values = np.arange(20.0)
    view = values.view()
    view.flags.writeable = False
    recording = Recording({"a": view}, 10, velocity=np.ones(20))
    values[0] = 99
    assert recording.signals["a"][0] == 0


def test_a_rate_that_makes_a_recording_endless_is_refused():
    with pytest.raises(ValueError, match="infinite length; they are in Hz"):
        Recording({"a": [0.0, 0.0]}, 5e-324, angle=[0.0, 1.0])


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


def made_writeable_again():
    buffer = np.arange(20.0)
    buffer.flags.writeable = False
    return buffer, buffer


@pytest.mark.parametrize("make", [windows, strided, of_a_bytearray, made_writeable_again])
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


@pytest.mark.parametrize("again", [lambda r: r, lambda r: pickle.loads(pickle.dumps(r))])
def test_nobody_makes_a_channel_writeable(again):
    recording = again(sine())
    for array in (recording.signals["current"], recording.velocity):
        with pytest.raises(ValueError, match="WRITEABLE"):
            array.setflags(write=True)
        with pytest.raises(ValueError, match="WRITEABLE"):
            array.view().setflags(write=True)
        assert not isinstance(array.base, np.ndarray) or not array.base.flags.writeable


def test_channels_of_a_recording_are_shared_with_one_that_is_made_of_them():
    recording = sine()
    again = Recording(recording.signals, recording.fs, velocity=recording.velocity, shaft_fs=100)
    assert again.signals["current"] is recording.signals["current"]


def test_a_file_that_is_rewritten_and_set_back_in_time_has_another_digest(tmp_path):
    file = tmp_path / "long.npy"
    recording = mapped_sine(file)
    before, stamp = recording.digest, os.stat(file)
    np.save(file, np.cos(TIMES))
    os.utime(file, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    assert os.stat(file).st_size == stamp.st_size
    assert recording.digest == in_memory(recording).digest != before


def test_a_digest_that_came_with_a_pickle_is_not_trusted():
    state = sine().__getstate__() | {"_digest": ("1", "0" * 64)}
    received = Recording.__new__(Recording)
    received.__setstate__(state)
    assert received.digest == sine().digest


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


def test_a_clock_coarser_than_the_rate_is_no_contradiction():
    coarse = clock(4000, fs=1000.0).floor("10ms")
    assert Recording(table(coarse), 1000, velocity=np.full(4000, 3.0)).duration == 4
    with pytest.raises(ValueError, match="contradicts fs = 500 Hz"):
        Recording(table(coarse), 500, velocity=np.full(4000, 3.0))
    with pytest.raises(ValueError, match=r"mean rate of the index: 100\d\.?\d* Hz"):
        Recording(table(coarse), 500, velocity=np.full(4000, 3.0))
    uneven = np.arange(40) * 0.01
    uneven[5], uneven[17] = 0.052, uneven[16]  # one twice, though the clock is fine enough
    index = pd.Timestamp("2024-05-01") + pd.to_timedelta(uneven, unit="s")
    with pytest.raises(ValueError, match=r"sample 17 is at 0\.16 s, expected was 0\.17 s"):
        Recording(table(index), 100, velocity=np.full(40, 3.0))


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


@pytest.mark.parametrize("offset", [0.0, 1e3, 1e8])
def test_an_angle_with_an_offset_that_float64_resolves_is_accepted(offset):
    angle = offset + 0.006 * np.arange(500)
    assert Recording({"a": np.zeros(500)}, 100, angle=angle).angle[0] == offset


def test_a_standing_shaft_with_a_large_angle_is_accepted():
    assert Recording({"a": np.zeros(50)}, 100, angle=np.full(50, 1e5)).angle[-1] == 1e5


def test_an_angle_in_float32_is_refused_only_where_steps_vanish():
    angle = 0.006 * np.arange(500) + 900
    assert Recording({"a": np.zeros(500)}, 100, angle=angle.astype(np.float32)).duration == 5
    with pytest.raises(ValueError, match="float32 resolves"):
        Recording({"a": np.zeros(500)}, 100, angle=(angle + 1e6).astype(np.float32))


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


def test_of_channels_the_longest_is_compared_whatever_its_name():
    signals = {"b": np.zeros(100), "a": np.zeros(130), "c": np.zeros(100)}
    with pytest.raises(ValueError, match=r"channel 'b' lasts 1 s and channel 'a' 1.3 s"):
        Recording(signals, 100, velocity=np.ones(100))


@pytest.mark.parametrize("n_times", [2, 5, 9])
def test_a_short_angle_may_step_by_most_of_its_range(n_times):
    angle = np.concatenate([[0.0], np.full(n_times - 1, 9.0)])
    assert Recording({"a": np.zeros(n_times)}, 100, angle=angle).angle[-1] == 9


def test_a_velocity_is_integrated_once_by_the_same_loops():
    recording = Recording({"torque": np.ones(700)}, 350, velocity=np.linspace(3, 41, 700))
    with using("numpy"):
        angle = recording.motion[0]
        assert recording.motion[0] is angle
        assert pickle.loads(pickle.dumps(recording)).motion[0] is not angle
    np.testing.assert_array_equal(angle[:], recording.motion[0][:])
    np.testing.assert_array_equal(angle[:], recording.angle)


def test_a_speed_that_no_shaft_reaches_is_refused():
    with pytest.raises(ValueError, match=r"got -1\.5e\+09 at sample 2, which no shaft reaches"):
        Recording({"a": [1.0, 2, 3]}, 10, velocity=[0.0, 1.0, -1.5e9])


def test_an_angle_whose_steps_are_rounded_away_is_refused_with_the_mean_step():
    angle = 1e9 + np.array([0.0, 1e-6, 4e-6])
    with pytest.raises(ValueError, match="the shaft turns by 2e-06 rad from sample to sample"):
        Recording({"a": [1.0, 2, 3]}, 10, angle=angle - angle % 2.0**-23)


def test_a_recording_equals_itself_whatever_its_meta():
    run = Recording({"b": [1.0, 2.0]}, 1, velocity=3.0, meta={"note": np.array([np.nan, "x"], "O")})
    assert run == copy.copy(run)
    assert run == run.select(["b"])


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ({"a": 1, "b": 2}, {"b": 2, "a": 1}, False),
        (np.array([1.0, np.nan]), np.array([1.0, np.nan]), True),
        (np.array([1, 2]), np.array([1.0, 2.0]), False),
        (np.array(["a"]), np.array(["a"]), True),
        (1, 1.0, True),
        (1, "1", False),
        ([1, (2, np.nan)], [1, (2, np.nan)], True),
        ([1, 2], [1, 2, 3], False),
        ([1, 2], [1, 3], False),
        ([1, 2], [3, 2], False),
        ([1, 2], (1, 2), False),
        (pd.Series([1, 2]), pd.Series([1, 2]), True),
        (pd.Series([1, 2]), pd.Series([1, 3]), False),
        (float("nan"), float("nan"), True),
        (None, None, True),
        (None, 0, False),
    ],
)
def test_contents_are_compared_with_their_types_and_order(one, other, same):
    assert same_content(one, other) is same


def test_a_time_index_of_two_samples_is_compared_with_the_rate():
    with pytest.raises(ValueError, match=r"sample 1 is at 1 s, expected was 0.01 s .*: 1 Hz"):
        Recording(table(clock(2, fs=1.0)), 100, velocity=3.0)
    assert Recording(table(clock(2)), 100, velocity=3.0).duration == 0.02


@pytest.mark.parametrize(("n_times", "n_shaft"), [(14, 2), (20, 2), (26, 3)])
def test_a_constant_speed_has_two_samples_or_more(n_times, n_shaft):
    run = Recording({"b": np.zeros(n_times)}, 100, velocity=-3.0, shaft_fs=10)
    assert run.velocity.tolist() == [-3.0] * n_shaft


def test_a_digest_is_the_same_in_every_version():
    run = Recording({"b": [1.0, 2.0], "a": [3.0, 5.0]}, 2, velocity=[7.0, 8.0])
    assert run.digest == "25deb50fada4cbb211e1c681af3d7c111e9595c2c281bc51f82f78609224f491"


@pytest.mark.parametrize("samples", [1, -1])
def test_indices_may_begin_one_sample_apart(samples):
    frame = table(clock(start="2024-05-01 12:00:00"))
    for apart, accepted in ((0.01, True), (0.015, False)):
        start = frame.index + pd.Timedelta(seconds=apart * samples)
        shaft = pd.Series(np.full(400, 3.0), index=start)
        if accepted:
            assert Recording(frame, 100, velocity=shaft).duration == 4
        else:
            with pytest.raises(ValueError, match="have different indices: velocity starts at"):
                Recording(frame, 100, velocity=shaft)


def test_a_constant_speed_lasts_as_long_as_the_fastest_channel():
    signals = {"a": np.zeros(250), "z": np.zeros(3)}
    run = Recording(signals, {"a": 100, "z": 1}, velocity=3.0, shaft_fs=100)
    assert len(run.velocity) == 250


def test_an_angle_in_float32_may_rise_by_its_resolution():
    angle = (4096 + 2.0**-11 * np.arange(50)).astype(np.float32)
    assert Recording({"b": np.zeros(50)}, 10, angle=angle).angle[-1] == angle[-1]
    with pytest.raises(ValueError, match="float32 resolves"):
        Recording({"b": np.zeros(99)}, 10, angle=np.repeat(angle, 2)[:99])


def test_the_repr_counts_revolutions_there_and_back():
    angle = 2 * np.pi * np.r_[np.linspace(0, 3, 31), np.linspace(3, 1, 21)[1:]]
    text = repr(Recording({"b": np.zeros(51)}, 10, angle=angle))
    assert text == "Recording(b 10 Hz; angle 10 Hz; 5.1 s, 5 revolutions)"


def test_many_strokes_and_paths_are_not_kept(monkeypatch):
    there = np.linspace(0, 40, 200)
    angle = np.r_[there, there[-2::-1], there[1:]]

    def kept(n, limits):
        monkeypatch.setattr(emacm.recordings.recording, "_MANY", limits[0])
        monkeypatch.setattr(emacm.recordings.recording, "_MANY_PATHS", limits[1])
        run = Recording({"b": np.zeros(len(angle))}, 100, angle=angle)
        assert len(run.strokes()) == len(run.paths()) == n
        return run.strokes() is run.strokes(), run.paths() is run.paths()

    assert kept(3, (3, 3)) == (True, True)
    assert kept(3, (2, 3)) == (False, True)
    assert kept(3, (3, 2)) == (True, False)


@pytest.mark.parametrize(("nanoseconds", "accepted"), [(8, True), (12, False)])
def test_one_sample_between_indices_holds_to_one_part_in_a_billion(nanoseconds, accepted):
    frame = table(clock(fs=0.1))
    later = frame.index + pd.Timedelta(10, "s") + pd.Timedelta(nanoseconds, "ns")
    shaft = pd.Series(np.full(400, 3.0), index=later)
    if accepted:
        assert Recording(frame, 0.1, velocity=shaft).duration == 4000
    else:
        with pytest.raises(ValueError, match="have different indices"):
            Recording(frame, 0.1, velocity=shaft)


@pytest.mark.parametrize(("share", "accepted"), [(0.009, True), (0.011, False)])
def test_an_angle_in_float64_resolves_a_hundredth_of_its_steps(share, accepted):
    angle = 1e8 + np.spacing(1e8) / share * np.arange(1000)
    if accepted:
        assert len(Recording({"b": np.zeros(1000)}, 10, angle=angle).angle) == 1000
    else:
        with pytest.raises(ValueError, match=r"float64 resolves 1\.5e-08 rad"):
            Recording({"b": np.zeros(1000)}, 10, angle=angle)


def test_a_single_channel_of_infinite_length_is_refused():
    for rates in ({"a": 10.0, "b": 1e-320}, {"a": 1e-320, "b": 10.0}):
        with pytest.raises(ValueError, match="make recordings of infinite length"):
            Recording({"a": np.zeros(3), "b": np.zeros(3)}, rates, velocity=3.0, shaft_fs=10)


def test_a_clock_of_one_and_a_half_sampling_intervals_is_no_contradiction():
    seconds = np.floor(np.arange(400) / 1.5) * 0.015
    index = pd.Timestamp("2024-05-01") + pd.to_timedelta(seconds, unit="s")
    assert Recording(table(index), 100, velocity=np.full(400, 3.0)).duration == 4


def test_a_number_is_not_the_same_content_as_nan():
    assert same_content(np.nan, np.nan)
    assert not same_content(np.nan, 1.0)
    assert not same_content(1.0, np.nan)


@pytest.mark.parametrize(("apart", "accepted"), [(0.015, True), (0.02, True), (0.025, False)])
@pytest.mark.parametrize("rates", [(100, 50), (50, 100)])
def test_channels_of_two_rates_may_start_a_sample_of_the_slower_one_apart(rates, apart, accepted):
    start = pd.Timestamp("2024-03-01 10:00")
    signals = {}
    for name, rate, delay in zip("ab", rates, (0.0, apart), strict=True):
        seconds = delay + np.arange(rate) / rate
        signals[name] = pd.Series(np.zeros(rate), start + pd.to_timedelta(seconds, "s"))
    options = {"velocity": np.ones(100), "shaft_fs": 100}
    fs = dict(zip("ab", rates, strict=True))
    if accepted:
        assert Recording(signals, fs, **options).duration == pytest.approx(1, abs=0.03)
    else:
        with pytest.raises(ValueError, match="channel 'b' and channel 'a' have different indices"):
            Recording(signals, fs, **options)
