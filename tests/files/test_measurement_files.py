"""Files written by their own libraries are read with names, rates, units and start."""

import sys

import numpy as np
import pandas as pd
import pytest
import scipy.io
from files.written import ignored, library, write

from emacm import Layout, Recording, open_recording

RNG = np.random.default_rng(6)
N = 1500
VIB, AMP = RNG.normal(size=N), RNG.normal(size=N) - 3
SPEED = 900 + 30 * np.sin(np.arange(N) / 90)
COLUMNS = {"vib": VIB, "amp": AMP, "speed": SPEED}
UNITS = {"vib": "g", "amp": "A", "speed": "rpm"}
EXPECTED = Recording(
    {"vib": VIB, "amp": AMP},
    12_000.0,  # of which UFF states 8.33333e-05 s
    velocity=SPEED * (np.pi / 30),
    units={"vib": "g", "amp": "A"},
)


@ignored
@pytest.mark.parametrize("suffix", ["parquet", "h5", "tdms", "uff", "mf4"])
def test_names_rates_units_and_start_are_those_of_the_file(tmp_path, suffix):
    start = np.datetime64("2026-11-01T08:01:00.5")
    path = write(tmp_path / f"a.{suffix}", COLUMNS, fs=12_000, units=UNITS, start=start)
    opened = open_recording(path, Layout(channels=["vib", "amp"], velocity="speed"))
    assert opened == EXPECTED
    assert opened.start == (pd.Timestamp(start) if suffix in ("tdms", "mf4") else None)


def test_parquet_with_metadata_of_fields_and_file(tmp_path):
    pyarrow, parquet = library("pyarrow"), library("pyarrow.parquet")
    fields = [
        pyarrow.field(name, pyarrow.float64(), metadata={"unit": unit, "comment": "left"})
        for name, unit in UNITS.items()
    ]
    schema = pyarrow.schema(fields, metadata={"fs": "12000"})
    parquet.write_table(pyarrow.table([*COLUMNS.values()], schema=schema), tmp_path / "a.parquet")
    assert open_recording(tmp_path / "a.parquet", Layout(velocity="speed")) == EXPECTED


LIBRARIES = {"parquet": "pyarrow", "h5": "h5py", "tdms": "nptdms", "uff": "pyuff", "mf4": "asammdf"}


@ignored
@pytest.mark.parametrize("suffix", LIBRARIES)
def test_without_the_library_or_its_content_there_is_one_clear_error(tmp_path, monkeypatch, suffix):
    path, name = tmp_path / f"a.{suffix}", LIBRARIES[suffix]
    library(name)
    path.write_bytes(b"something else " * 40)
    with pytest.raises(ValueError, match=rf"{path.name}: it (cannot be read as|contains no sig)"):
        assert open_recording(path, Layout(velocity=3)).duration
    monkeypatch.setitem(sys.modules, "pyarrow.parquet" if suffix == "parquet" else name, None)
    extra = "mdf" if suffix == "mf4" else "files"
    message = rf"files are read by {name}, which is not .*pip install 'emacm\[{extra}\]'"
    with pytest.raises(ImportError, match=message):
        assert open_recording(path, Layout(velocity=3)).duration


# Files of unusual form


@pytest.mark.parametrize(
    ("columns", "names", "message"),
    [
        ({"vib": [[1.0]] * 200, "b": VIB[:200]}, None, "'vib' holds values of the type list<"),
        ({"vib": [None, *["x"] * 199], "b": VIB[:200]}, None, "'vib' holds values of the type str"),
        ({"vib": ["x"] * 199 + [None]}, None, "'vib' must be numeric, got 'x' at"),
        ({"vib": [[1.0]] * 200}, None, "no signal, .*'vib' holds values"),
        ({"vib": VIB, "b": VIB}, ["vib", "vib"], "its columns must have different names"),
    ],
)
def test_parquet_columns_that_are_no_signals_are_named(tmp_path, columns, names, message):
    pa, parquet = library("pyarrow"), library("pyarrow.parquet")
    arrays = [pa.array(values) for values in columns.values()]
    table = pa.Table.from_arrays(arrays, names=names or list(columns))
    parquet.write_table(table, tmp_path / "a.parquet")
    layout = Layout(fs=100, channels=["vib"], velocity=3)
    with pytest.raises((ValueError, TypeError), match=message):
        assert open_recording(tmp_path / "a.parquet", layout).duration


def test_parquet_reads_decimals(tmp_path):
    pyarrow, parquet = library("pyarrow"), library("pyarrow.parquet")
    hundredths = np.round(VIB, 2)
    column = pyarrow.array(hundredths).cast(pyarrow.decimal128(6, 2))
    parquet.write_table(pyarrow.table({"vib": column}), tmp_path / "a.parquet")
    opened = open_recording(tmp_path / "a.parquet", Layout(velocity=3, fs=2560))
    np.testing.assert_allclose(opened.signals["vib"], hundredths, rtol=1e-15)


def test_cells_and_arrays_of_structures_of_a_mat_file_are_numbered(tmp_path):
    cell = np.empty(2, object)
    cell[0], cell[1] = VIB, 2 * VIB
    runs = np.array([(3 * VIB,), (4 * VIB,)], dtype=[("y", "O")])
    speed = {"data": SPEED, "unit": "rpm"}  # the unit is that of the only array
    scipy.io.savemat(tmp_path / "a.mat", {"cell": cell, "runs": runs, "speed": speed})
    layout = Layout(fs=100, channels={"a": "cell.1", "b": "runs.0.y"}, velocity="speed.data")
    recording = open_recording(tmp_path / "a.mat", layout)
    np.testing.assert_array_equal(recording.signals["a"], 2 * VIB)
    np.testing.assert_array_equal(recording.signals["b"], 3 * VIB)
    np.testing.assert_allclose(recording.velocity, EXPECTED.velocity)


@pytest.mark.parametrize("key", ["fs", "sampling_rate", "sample_rate", "samplerate", "rate"])
@pytest.mark.parametrize("place", ["/", "bench"])
def test_attributes_of_an_hdf5_file_or_group_hold_for_all_its_data_sets(tmp_path, key, place):
    with library("h5py").File(tmp_path / "a.h5", "w") as file:
        file["bench/vib"], file["bench/low/amp"], file["notes"] = VIB, AMP, "text"
        if place == "bench":
            file.attrs["fs"] = 5.0  # that of a group comes before it
        file[place].attrs[key] = 100.0
        file.attrs["units"] = '{"bench/vib": "g", "bench/low/amp": "A"}'
    run = open_recording(tmp_path / "a.h5", Layout(channels=["vib", "amp"], velocity=3))
    assert dict(run.fs) == {"amp": 100, "vib": 100}
    assert dict(run.units) == {"amp": "A", "vib": "g"}


@pytest.mark.parametrize(
    ("array", "reason"),
    [
        (np.zeros(0), "is empty"),
        (np.zeros((2, 3, 4)), "has 3 dimensions"),
        (np.array(["a", "b"]), "holds no numbers, but <U"),
        (VIB * 1j, "is complex, as a spectrum"),
    ],
)
def test_an_array_that_cannot_be_a_channel_is_named_with_the_reason(array, reason, tmp_path):
    np.savez(tmp_path / "a.npz", other=array, vib=VIB)
    layout = Layout(channels=["other"], velocity=3, fs=2560)
    with pytest.raises(ValueError, match=f"'other' {reason}"):
        _ = open_recording(tmp_path / "a.npz", layout).channels


def test_the_fields_of_a_structured_array_are_columns_beside_dates(tmp_path):
    table = np.rec.fromarrays([VIB, SPEED], names=["vib", "speed"])
    start = np.datetime64("2026-11-01T08:00:00", "us")
    at = start + np.round(np.arange(N) * 1e6 / 2560).astype("m8[us]")
    np.savez(tmp_path / "a.npz", bench=table, at=at)
    opened = open_recording(tmp_path / "a.npz", Layout(velocity="bench.speed", time="at"))
    np.testing.assert_array_equal(opened.signals["bench.vib"], VIB)
    assert opened.fs["bench.vib"] == pytest.approx(2560, rel=1e-6)
    assert opened.start == pd.Timestamp(start)


def test_channels_that_start_at_different_times_are_refused(tmp_path):
    nptdms = library("nptdms")
    objects = [
        nptdms.ChannelObject("g", name, VIB, {"wf_increment": 0.1, "wf_start_offset": late})
        for name, late in (("vib", 0.0), ("speed", 2.0))
    ]
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment(objects)
    with pytest.raises(ValueError, match="'speed' starts 2 s later than 'vib'"):
        _ = open_recording(tmp_path / "a.tdms", Layout(velocity="speed")).fs
