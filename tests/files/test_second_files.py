"""The motion of the shaft in a second file, with its own rate and times; rates of each column."""

import os
import pickle

import numpy as np
import pandas as pd
import pytest
import scipy.io

from emacm import Layout, RecordingFolder, open_recording

FS, SLOW, DURATION = 5000, 50, 4.0
TIMES = np.arange(round(FS * DURATION)) / FS
VIBRATION = np.random.default_rng(0).normal(size=len(TIMES))
SPEED = {"file": "{stem}_speed.csv", "column": "speed [rpm]"}


def rpm(times):
    return 1500 + 60 * times  # a ramp, which interpolation leaves as it is


def write_pair(folder, first, second, name="A_1"):
    """Write vibration and speed with these columns of times."""
    frame = pd.DataFrame({"vibration": VIBRATION} if first is None else {"time": first})
    frame.assign(vibration=VIBRATION).to_csv(folder / f"{name}.csv", index=False)
    times, speed = second
    columns = ({} if times is None else {"time": times}) | {"speed [rpm]": speed, "load": 3.0}
    pd.DataFrame(columns).to_csv(folder / f"{name}_speed.csv", index=False)
    return folder / f"{name}.csv"


SLOW_TIMES = np.arange(-10, 5 * SLOW) / SLOW + 0.007  # on the clock of the vibration
DATES = pd.Timestamp("2026-11-01T08:01:00") + pd.to_timedelta(TIMES, unit="s")
SLOW_DATES = pd.Timestamp("2026-11-01T08:01:00") + pd.to_timedelta(SLOW_TIMES, unit="s")


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (TIMES, SLOW_TIMES),
        (TIMES + 1000, SLOW_TIMES + 1000),
        (DATES, SLOW_DATES.strftime("%d.%m.%Y %H:%M:%S.%f")),
    ],
    ids=["from 0", "from 1000", "dates"],
)
def test_the_speed_of_a_second_file_is_aligned_by_the_times_of_both(tmp_path, first, second):
    path = write_pair(tmp_path, first, (second, rpm(SLOW_TIMES)))
    recording = open_recording(path, Layout(velocity=SPEED))
    assert recording.channels == ("vibration",)
    assert (recording.fs["vibration"], recording.shaft_fs) == (FS, SLOW)
    expected = rpm(np.arange(DURATION * SLOW) / SLOW) * np.pi / 30
    np.testing.assert_allclose(recording.velocity, expected, rtol=1e-9)
    again = pickle.loads(pickle.dumps(recording))
    assert again == recording
    os.utime(tmp_path / "A_1_speed.csv", (1, 1))
    with pytest.raises(ValueError, match=r"A_1_speed\.csv: it was replaced or changed"):
        assert recording.digest


@pytest.mark.parametrize(
    ("first", "shift", "options"),
    [
        (None, None, {"fs": SLOW}),
        (TIMES + 1000, None, {"fs": SLOW}),
        (None, 0.3, {}),
        (DATES, 0.0, {}),
        (DATES, 7.0, {"fs": SLOW, "time": False}),
    ],
)
def test_without_times_both_files_start_at_the_same_instant(tmp_path, first, shift, options):
    times = np.arange(DURATION * SLOW) / SLOW
    path = write_pair(tmp_path, first, (None if shift is None else times + shift, rpm(times)))
    layout = Layout(fs=FS, velocity=SPEED | options)
    recording = open_recording(path, layout)
    np.testing.assert_allclose(recording.velocity, rpm(times) * np.pi / 30, rtol=1e-12)


def test_a_tachometer_and_a_wrapped_angle_of_a_second_file(tmp_path):
    turns = 20 * TIMES + 0.301  # pulses begin between samples
    scipy.io.wavfile.write(tmp_path / "A_1.wav", FS, VIBRATION.astype("f4"))
    tacho = (turns % 0.5 < 0.1).astype("f4")
    scipy.io.wavfile.write(tmp_path / "A_1_speed.wav", FS, tacho)
    file = {"file": "{stem}_speed.wav", "column": "x0", "pulses_per_rev": 2}
    found = open_recording(tmp_path / "A_1.wav", Layout(tacho=file)).velocity
    np.testing.assert_allclose(found[500:-500], 40 * np.pi, rtol=0.01)
    angle = pd.DataFrame({"t": TIMES - 0.0001, "theta": turns * 2 * np.pi % (2 * np.pi)})
    angle.to_csv(tmp_path / "A_1_angle.csv", index=False)
    layout = Layout(angle={"file": "{stem}_angle.csv", "column": "theta"})
    found = open_recording(tmp_path / "A_1.wav", layout).angle
    expected = 2 * np.pi * (turns + 20 * 0.0001)
    np.testing.assert_allclose(found - found[0], expected - expected[0], atol=1e-6)


@pytest.mark.parametrize(
    ("times", "options", "error", "message"),
    [
        (SLOW_TIMES + 9, {}, ValueError, "7.807 to .* after the start of the recording, do not"),
        (SLOW_TIMES[:100], {}, ValueError, "do not cover its 4 s"),
        (SLOW_DATES, {}, ValueError, "cannot be compared with those of the first file"),
        (None, {}, ValueError, "second file: the sampling rate of 'speed' is not known"),
        (SLOW_TIMES, {"column": "n"}, ValueError, "the second file: it has no column 'n'"),
        (SLOW_TIMES, {"file": "no.csv"}, FileNotFoundError, "no.csv"),
        (SLOW_TIMES, {"file": "{x}.csv"}, ValueError, "a name with fields of .'stem'"),
    ],
)
def test_a_second_file_that_does_not_fit_is_refused(tmp_path, times, options, error, message):
    speed = rpm(SLOW_TIMES[: len(SLOW_TIMES if times is None else times)])
    path = write_pair(tmp_path, TIMES + 1, (times, speed))
    with pytest.raises(error, match=message):
        assert open_recording(path, Layout(velocity=SPEED | options)).duration


def test_second_files_are_no_recordings_of_their_folder(tmp_path):
    for name in ("A_1", "A_2"):
        write_pair(tmp_path, TIMES, (SLOW_TIMES, rpm(SLOW_TIMES)), name)
    (tmp_path / "layout.toml").write_text(
        'velocity = {file = "{unit}_{run}_speed.csv", column = "speed [rpm]"}\n'
        'meta = "{unit}_{run:d}"\n'
    )
    folder = RecordingFolder(tmp_path, Layout.from_toml(tmp_path / "layout.toml"))
    assert [recording.meta["run"] for recording in folder] == [1, 2]
    assert folder[1].shaft_fs == SLOW


@pytest.mark.parametrize("numbers", [{"fs": FS, "fs_rpm": SLOW}, {"fs_vib": FS, "rpm_fs": SLOW}])
@pytest.mark.parametrize(
    "fs", [None, {"vib": FS, "rpm": SLOW}, {"rpm": "{rpm}"}, {"vib": "{vib}", "rpm": "{rpm}"}]
)
def test_a_file_with_two_rates(tmp_path, numbers, fs):
    times = np.arange(DURATION * SLOW) / SLOW
    scipy.io.savemat(tmp_path / "a.mat", {"vib": VIBRATION, "rpm": rpm(times)} | numbers)
    named = dict(zip(("vib", "rpm"), numbers, strict=True))
    if fs is not None:
        fs = {key: v.format_map(named) if isinstance(v, str) else v for key, v in fs.items()}
    layout = Layout(fs=fs, velocity="rpm", units=["rpm [rpm]"])
    recording = open_recording(tmp_path / "a.mat", layout)
    assert (recording.fs["vib"], recording.shaft_fs) == (FS, SLOW)


def test_a_rate_of_all_columns_is_not_that_of_shorter_ones(tmp_path):
    np.savez(tmp_path / "a.npz", vib=VIBRATION, rpm=rpm(TIMES[:: FS // SLOW]), fs=FS)
    layout = Layout(velocity="rpm", units=["rpm [rpm]"])
    with pytest.raises(ValueError, match=r"rate of .rpm. is not known.* a rate for each column"):
        assert open_recording(tmp_path / "a.npz", layout).duration
    layout = Layout(fs={"rpm": SLOW}, velocity="rpm", units=["rpm [rpm]"])
    assert open_recording(tmp_path / "a.npz", layout).shaft_fs == SLOW


def test_a_second_file_in_ms_is_aligned_by_its_times(tmp_path):
    path = write_pair(tmp_path, TIMES, (SLOW_TIMES, rpm(SLOW_TIMES)))
    frame = pd.DataFrame({"time_ms": 1000 * SLOW_TIMES, "speed": rpm(SLOW_TIMES)})
    frame.to_csv(tmp_path / "A_1_speed.csv", index=False)
    found = open_recording(path, Layout(velocity=SPEED))
    expected = rpm(np.arange(DURATION * SLOW) / SLOW) * np.pi / 30
    np.testing.assert_allclose(found.velocity, expected, rtol=1e-9)
