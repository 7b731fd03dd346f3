"""A draft of inspect, completed as its comments say, reads the file: all formats, two rates."""

import numpy as np
import pandas as pd
import pytest
import scipy.io
from files.written import ignored, library, write

from emacm import Layout, open_recording
from emacm.__main__ import main

FS, SLOW, N = 2560, 40, 5120
VIBRATION = np.random.default_rng(0).normal(size=N)
TIMES, SLOW_TIMES = np.arange(N) / FS, np.arange(N * SLOW // FS) / SLOW


def rpm(times):
    return 900 + 30 * np.sin(3 * times)


CHANNELS = {"vib": (VIBRATION, FS, "g"), "rpm": (rpm(SLOW_TIMES), SLOW, "rpm")}


def csv(path):
    columns = {"Zeit [s]": TIMES, "vib [g]": VIBRATION, "rpm": rpm(TIMES)}
    pd.DataFrame(columns).to_csv(path, index=False, sep=";", decimal=",")


def npz(path):
    arrays = {name: values for name, (values, _, _) in CHANNELS.items()}
    np.savez(path, **arrays, fs=FS, fs_rpm=SLOW)


def one_rate(path):
    np.savez(path, vib=VIBRATION, rpm=CHANNELS["rpm"][0], fs=FS)  # that of rpm is proposed


def no_rate(path):
    np.savez(path, vib=VIBRATION, rpm=CHANNELS["rpm"][0])


def mat(path):
    arrays = {name: values[:, None] for name, (values, _, _) in CHANNELS.items()}
    scipy.io.savemat(path, {"run": arrays | {"fs": FS, "rpm_fs": SLOW}})


def mat_7_3(path):
    with library("h5py").File(path, "w", userblock_size=512) as file:
        for name, values in {"vib": VIBRATION, "rpm": rpm(SLOW_TIMES)}.items():
            file.create_dataset(name, data=values[None, :]).attrs["MATLAB_class"] = b"double"
        for name, rate in {"fs": FS, "fs_rpm": SLOW}.items():
            file.create_dataset(name, data=[[float(rate)]]).attrs["MATLAB_class"] = b"double"
        text = np.frombuffer("AB".encode("utf-16-le"), "u2")[:, None]
        file.create_dataset("name", data=text).attrs["MATLAB_class"] = b"char"
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(116) + bytes(8) + b"\x00\x02IM")


def parquet(path):
    library("pyarrow")
    dates = pd.Timestamp("2026-11-01T08:01:00") + pd.to_timedelta(TIMES, unit="s")
    pd.DataFrame({"time": dates, "vib [g]": VIBRATION, "rpm": rpm(TIMES)}).to_parquet(path)


def by_library(path):
    columns, rates, units = ({name: one[k] for name, one in CHANNELS.items()} for k in range(3))
    write(path, columns, fs=rates, units=units)


def wav(path):
    tacho = np.cumsum(rpm(TIMES)) / 60 / FS % 1 < 0.1
    samples = np.column_stack([VIBRATION, tacho])
    scipy.io.wavfile.write(path, FS, samples.astype("f4"))


@ignored
@pytest.mark.parametrize(
    ("writer", "suffix"),
    [
        *((csv, "csv"), (csv, "txt"), (npz, "npz"), (one_rate, "npz"), (no_rate, "npz")),
        *((mat, "mat"), (mat_7_3, "mat"), (parquet, "parquet"), (wav, "wav")),
        *((by_library, suffix) for suffix in ("h5", "tdms", "uff", "mf4")),
    ],
)
def test_a_completed_draft_reads_the_file(tmp_path, writer, suffix):
    path, draft = tmp_path / f"A_1.{suffix}", tmp_path / "layout.toml"
    writer(path)
    assert main(["inspect", str(path), "--draft", str(draft), "--meta", "{unit}_{run:d}"]) == 0
    text = draft.read_text(encoding="utf-8")
    assert "not used" not in text
    lines = (line.removeprefix("# ") if "FILL IN:" in line else line for line in text.splitlines())
    draft.write_text("\n".join(lines).replace("12000", "2560").replace("187.5", "40"))
    recording = open_recording(path, Layout.from_toml(draft))
    (channel,) = recording.channels
    np.testing.assert_allclose(recording.signals[channel], VIBRATION, rtol=1e-6)
    slow = SLOW if suffix not in ("csv", "txt", "parquet", "wav") else FS
    assert (recording.fs[channel], recording.shaft_fs) == (FS, slow)
    inner = slice(200, -200) if suffix == "wav" else slice(None)  # pulses begin after the start
    expected = rpm(np.arange(len(recording.velocity)) / slow) * np.pi / 30
    tolerance = 0.02 if suffix == "wav" else 1e-6
    np.testing.assert_allclose(recording.velocity[inner], expected[inner], rtol=tolerance)
