"""A draft of inspect, completed as its comments say, reads the file: all formats, two rates."""

import numpy as np
import pandas as pd
import pytest
import scipy.io

from emacm import Layout, open_recording
from emacm.__main__ import main

FS, SLOW, N = 2560, 40, 5120
VIBRATION = np.random.default_rng(0).normal(size=N)
TIMES, SLOW_TIMES = np.arange(N) / FS, np.arange(N * SLOW // FS) / SLOW


def rpm(times):
    return 900 + 30 * np.sin(3 * times)


CHANNELS = {"vib": (VIBRATION, FS, "g"), "rpm": (rpm(SLOW_TIMES), SLOW, "rpm")}


def library(name):
    reason = f"{name} is not installed (extra 'files' or 'mdf')"
    return pytest.importorskip(name, reason=reason, exc_type=ImportError)


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


def hdf5(path):
    with library("h5py").File(path, "w") as file:
        for name, (values, rate, unit) in CHANNELS.items():
            file.create_dataset(f"run/{name}", data=values).attrs.update(fs=rate, unit=unit)


def parquet(path):
    library("pyarrow")
    dates = pd.Timestamp("2026-11-01T08:01:00") + pd.to_timedelta(TIMES, unit="s")
    pd.DataFrame({"time": dates, "vib [g]": VIBRATION, "rpm": rpm(TIMES)}).to_parquet(path)


def tdms(path):
    nptdms = library("nptdms")
    with nptdms.TdmsWriter(path) as writer:
        for name, (values, rate, unit) in CHANNELS.items():
            properties = {"wf_increment": 1 / rate, "unit_string": unit}
            writer.write_segment([nptdms.ChannelObject("run", name, values, properties)])


def uff(path):
    file = library("pyuff").UFF(str(path))
    for name, (values, rate, unit) in CHANNELS.items():
        one = {"type": 58, "binary": 1, "func_type": 1, "id1": name, "data": values}
        one |= {"rsp_node": 1, "rsp_dir": 1, "ref_node": 1, "ref_dir": 1, "abscissa_spacing": 1}
        one |= {"x": np.arange(len(values)) / rate, "ordinate_axis_units_lab": unit}
        one |= {"orddenom_spec_data_type": 0, "z_axis_spec_data_type": 0, "orddenom_axis_lab": ""}
        file.write_sets(one, "add")


def mdf(path):
    asammdf = library("asammdf")
    with asammdf.MDF(version="4.10") as file:
        for name, (values, rate, unit) in CHANNELS.items():
            times = np.arange(len(values)) / rate
            file.append([asammdf.Signal(values, times, name=name, unit=unit)])
        file.save(path)


def wav(path):
    tacho = np.cumsum(rpm(TIMES)) / 60 / FS % 1 < 0.1
    samples = np.column_stack([VIBRATION, tacho])
    scipy.io.wavfile.write(path, FS, samples.astype("f4"))


@pytest.mark.filterwarnings("ignore")  # of the libraries, which leave files open
@pytest.mark.parametrize(
    ("write", "suffix"),
    [
        *((csv, "csv"), (csv, "txt"), (npz, "npz"), (one_rate, "npz"), (no_rate, "npz")),
        *((mat, "mat"), (mat_7_3, "mat"), (hdf5, "h5"), (parquet, "parquet"), (tdms, "tdms")),
        *((uff, "uff"), (mdf, "mf4"), (wav, "wav")),
    ],
)
def test_a_completed_draft_reads_the_file(tmp_path, write, suffix):
    path, draft = tmp_path / f"A_1.{suffix}", tmp_path / "layout.toml"
    write(path)
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
