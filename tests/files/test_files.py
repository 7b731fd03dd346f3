"""Recordings in files: equal to those in memory, read when needed, and small when pickled."""

import os
import pickle
import wave

import numpy as np
import pandas as pd
import pytest
import scipy.io
from files.written import write

from emacm import EnvelopeDetector, Layout, Recording, RecordingFolder, open_recording
from emacm.files import folder as files

FS = 2048.0
TIMES = np.arange(3000) / FS
SPEED = 60 + 9 * np.sin(3 * TIMES)
SIGNALS = {"vibration": np.sin(7.3 * np.cumsum(SPEED) / FS), "current": np.cos(900 * TIMES) - 2.5}
META = {"unit": "B7", "state": "worn"}
LAYOUT = Layout(fs=FS, velocity="speed", units={"vibration": "g"}, meta="{unit}_{state}")


def in_memory(**options):
    options = {"velocity": SPEED, "units": {"vibration": "g"}, "meta": META} | options
    return Recording(SIGNALS, FS, **options)


def written(path):
    columns = {**SIGNALS, "speed": SPEED}
    if path.suffix == ".mat":
        scipy.io.savemat(path, columns)
        return path
    return write(path, columns)


@pytest.fixture(params=["csv", "mat", "npz"])
def path(request, tmp_path):
    return written(tmp_path / f"B7_worn.{request.param}")


@pytest.fixture
def npz(tmp_path):
    return written(tmp_path / "B7_worn.npz")


# Equal to recordings in memory


def test_a_recording_in_a_file_equals_the_one_in_memory(path):
    opened = open_recording(path, LAYOUT)
    assert opened == in_memory()
    assert hash(opened) == hash(in_memory())
    assert opened.digest == in_memory().digest
    assert repr(opened) == repr(in_memory())


def test_envelopes_are_equal_bit_by_bit_and_stay_in_the_file(path):
    envelopes = EnvelopeDetector((200, 500), channels=["vibration"])
    opened = envelopes.fit_transform([open_recording(path, LAYOUT)])[0]
    assert opened.digest == envelopes.transform([in_memory()])[0].digest
    assert len(pickle.dumps(opened)) < 1000


@pytest.mark.parametrize(
    "change",
    [
        lambda recording: recording.cut(0.25, 1.0),
        lambda recording: recording.select(["current"]),
        lambda recording: recording.select(["vibration"]).cut(0.5),
    ],
)
def test_parts_of_a_file_equal_parts_in_memory_and_stay_in_the_file(npz, change):
    part = change(open_recording(npz, LAYOUT))
    assert part == change(in_memory())
    assert len(pickle.dumps(part)) < 1000
    assert pickle.loads(pickle.dumps(part)) == part


# Read when needed, and checked then


def test_a_file_is_not_read_when_it_is_opened(npz, monkeypatch):
    read = []
    monkeypatch.setattr(files, "read_columns", lambda path: read.append(path))
    opened = open_recording(npz, LAYOUT)
    assert opened.meta == META
    assert pickle.loads(pickle.dumps(opened)).meta == META
    assert not read


def test_a_relative_path_is_found_from_another_folder(npz, monkeypatch):
    monkeypatch.chdir(npz.parent)
    pickled = pickle.dumps([open_recording(npz.name, LAYOUT), *RecordingFolder(".", LAYOUT)])
    monkeypatch.chdir(npz.parent.parent)
    assert [found.digest for found in pickle.loads(pickled)] == [in_memory().digest] * 2


def test_a_replaced_file_is_an_error(npz):
    opened, later = open_recording(npz, LAYOUT), SIGNALS["current"][:100]
    np.savez(npz, vibration=later, current=later, speed=SPEED[:100])
    os.utime(npz, ns=(1, 1))
    for name in ("duration", "digest"):
        with pytest.raises(ValueError, match=r"B7_worn.npz: it was replaced or changed. Op"):
            getattr(opened, name)
    assert len(open_recording(npz, LAYOUT).signals["current"]) == 100


def test_a_file_that_is_gone_is_an_error(npz):
    opened = open_recording(npz, LAYOUT)
    npz.unlink()
    with pytest.raises(FileNotFoundError, match="there is no file"):
        assert opened.duration
    with pytest.raises(FileNotFoundError, match="there is no file"):
        open_recording(npz, LAYOUT)


# Folders


@pytest.fixture
def folder(tmp_path):
    for number in range(12):
        state = ("healthy", "worn")[number % 2]
        written(tmp_path / f"U{number // 4}_{state}_{number:02d}.npz")
    (tmp_path / "notes.md").write_text("not a recording")
    (tmp_path / ".hidden.npz").write_bytes(b"")
    layout = Layout(fs=FS, velocity="speed", meta="{unit}_{state}_{run:d}.npz")
    return RecordingFolder(tmp_path, layout)


def test_a_folder_is_a_sequence_of_recordings(folder):
    assert len(folder) == 12
    assert [recording.meta["run"] for recording in folder[2:5]] == [1, 3, 4]
    assert folder[-1].meta == {"unit": "U2", "state": "worn", "run": 11}
    assert folder[0] in folder
    assert "12 recordings" in repr(folder)


def test_a_folder_without_files_is_an_error(folder):
    with pytest.raises(ValueError, match=r"no file that matches '\*.mat'"):
        RecordingFolder(folder.folder, LAYOUT, "*.mat")
    with pytest.raises(FileNotFoundError, match="there is no folder"):
        RecordingFolder(folder.folder / "none", LAYOUT)


# Formats


def test_a_bearing_file_is_read_by_wildcards(tmp_path):
    content = {"X097_DE_time": SIGNALS["vibration"][:, None], "X097RPM": [[1796.0]]}
    scipy.io.savemat(tmp_path / "97.mat", content)
    layout = Layout(fs=FS, channels={"DE": "*_DE_time"}, velocity="*RPM", units={"X097RPM": "rpm"})
    opened = open_recording(tmp_path / "97.mat", layout)
    assert opened == Recording({"DE": SIGNALS["vibration"]}, FS, velocity=1796.0 * (np.pi / 30))


@pytest.mark.parametrize(("width", "scale"), [(1, 128), (2, 1 << 15), (4, 1 << 31)])
def test_a_wav_file_states_its_rate_and_full_scale_is_one(tmp_path, width, scale):
    values = np.array([[0, 3], [-5, 7], [11, -13], [1, 2]])
    stored = (values + 128).astype("u1") if width == 1 else values.astype(f"<i{width}")
    with wave.open(str(tmp_path / "a.wav"), "wb") as file:
        file.setnchannels(2)
        file.setsampwidth(width)
        file.setframerate(44_100)
        file.writeframes(stored.tobytes())
    opened = open_recording(tmp_path / "a.wav", Layout(velocity="1500 rpm"))
    assert dict(opened.fs) == {"x0": 44_100.0, "x1": 44_100.0}
    np.testing.assert_array_equal(opened.signals["x1"], values[:, 1] / scale)


def test_arrays_of_two_dimensions_are_columns_along_the_shorter_one(tmp_path):
    np.savez(tmp_path / "a.npz", data=np.arange(12.0).reshape(6, 2), samplerate=8)
    opened = open_recording(tmp_path / "a.npz", Layout(velocity=3))
    assert opened.channels == ("data.0", "data.1")
    np.testing.assert_array_equal(opened.signals["data.1"], [1, 3, 5, 7, 9, 11])
    assert opened.fs["data.0"] == 8


@pytest.mark.parametrize(
    ("times", "start"),
    [
        (["2026-11-01T08:01:00,000100", "2026-11-01T08:01:00,000600"], "2026-11-01T08:01:00.0001"),
        (["01.11.2026 08:01:00.0001", "01.11.2026 08:01:00.0006"], "2026-11-01T08:01:00.0001"),
        (["1.11.2026 08:01:00", "1.11.2026 08:01:00,0005"], "2026-11-01T08:01:00"),
        (["2026-11-01T08:01:00+01:00", "2026-11-01T08:01:00.0005+01:00"], "2026-11-01T07:01:00"),
        (["25.11.2026   08:01:00", "25.11.2026   08:01:00.0005"], "2026-11-25T08:01:00"),
        (["11/25/2026 08:01:00", "11/25/2026 08:01:00.0005"], "2026-11-25T08:01:00"),
        (["11/05/2026 08:01:00,0000", "11/05/2026 08:01:00,0005"], "2026-05-11T08:01:00"),
        (
            ["11/25/2026 12:59:59.9998 PM", "11/25/2026 01:00:00.0003 PM"],
            "2026-11-25T12:59:59.9998",
        ),
        (["2026-11-25  08:01:00Z", "2026-11-25  08:01:00.0005Z"], "2026-11-25T08:01:00"),
        (
            ["2026-10-25T02:59:59.9998+02:00", "2026-10-25T02:00:00.0003+01:00"],
            "2026-10-25T00:59:59.9998",
        ),
        (["08:01:00.0001", "08:01:00.0006"], None),
        (["23:59:59,9998", "0:00:00,0003"], None),
        (["12.0001", "12.0006"], None),
    ],
)
def test_times_in_the_usual_forms(tmp_path, times, start):
    rows = "".join(f"{time};{value}\n" for value, time in enumerate(times))
    (tmp_path / "a.csv").write_text(f"Zeit;b\n{rows}", encoding="utf-8")
    opened = open_recording(tmp_path / "a.csv", Layout(velocity=3.0))
    assert opened.fs["b"] == 2000
    assert opened.cut(0).start == (None if start is None else pd.Timestamp(start))


def test_numbers_of_a_text_are_read_exactly(tmp_path):
    values = np.random.default_rng(0).normal(size=1000) * 1e-7
    pd.DataFrame({"b": values}).to_csv(tmp_path / "a.csv", index=False)
    opened = open_recording(tmp_path / "a.csv", Layout(fs=10, velocity=1))
    np.testing.assert_array_equal(opened.signals["b"], values)


@pytest.mark.parametrize(
    ("columns", "options", "message"),
    [
        ({"t": [0, 1], "time": [0, 1], "b": [1, 2]}, {}, "several columns of times: \\['t', 'tim"),
        ({"t": [0.0, 0.1]}, {}, r"no channel besides \['t'\]"),
        ({"b": [1, 2], "rate": [3, 3]}, {"fs": "rate"}, "fs = 'rate' is not a single number"),
    ],
)
def test_columns_that_are_ambiguous_or_missing_are_refused(tmp_path, columns, options, message):
    np.savez(tmp_path / "a.npz", **{name: np.array(values) for name, values in columns.items()})
    with pytest.raises(ValueError, match=rf"a.npz: .*{message}"):
        assert open_recording(tmp_path / "a.npz", Layout(velocity=3, **options)).duration


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.npz", b"", r"the file is empty \(0 bytes\)"),
        ("a.xyz", b"1", r"files of type '.xyz' are not read; known are \['.csv', "),
        ("a.npz", b"no archive", r"cannot be read as a .npz file"),
        ("a.wav", b"RIFF\x04\x00\x00\x00AVI ", r"cannot be read as a .wav file"),
    ],
)
def test_a_file_without_content_or_of_no_known_type_is_refused(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=message):
        assert open_recording(tmp_path / name, Layout(fs=3, velocity=3)).duration


def test_python_objects_in_a_file_are_not_opened(tmp_path):
    np.savez(tmp_path / "a.npz", b=np.ones(3), note=np.array([{"a": 1}], object))
    with pytest.raises(ValueError, match=r"Object arrays cannot be loaded"):
        assert open_recording(tmp_path / "a.npz", Layout(fs=3, velocity=3)).duration
