"""Files written by their own libraries are read with names, rates and units."""

import sys

import numpy as np
import pandas as pd
import pytest
import scipy.io

from emacm import Layout, Recording, open_recording

RNG = np.random.default_rng(6)
N = 1500
VIB, AMP = RNG.normal(size=N), RNG.normal(size=N) - 3
SPEED = 900 + 30 * np.sin(np.arange(N) / 90)
LAYOUT = Layout(velocity="speed", units={"speed": "rpm"})


def library(name):
    reason = f"{name} cannot be imported (extra 'files' or 'mdf')"
    return pytest.importorskip(name, reason=reason, exc_type=ImportError)


def expected(fs=2560.0, units=("g", "A")):
    return Recording(
        {"vib": VIB, "amp": AMP},
        fs,
        velocity=SPEED * (np.pi / 30),
        units={"vib": units[0], "amp": units[1]},
    )


def test_parquet_with_metadata_of_fields_and_file(tmp_path):
    pyarrow, parquet = library("pyarrow"), library("pyarrow.parquet")
    fields = [
        pyarrow.field("vib", pyarrow.float64(), metadata={"unit": "g", "comment": "left"}),
        pyarrow.field("amp", pyarrow.float64(), metadata={"unit": "A"}),
        pyarrow.field("speed", pyarrow.float64(), metadata={"unit": "rpm"}),
    ]
    schema = pyarrow.schema(fields, metadata={"fs": "2560"})
    table = pyarrow.table([VIB, AMP, SPEED], schema=schema)
    parquet.write_table(table, tmp_path / "a.parquet")
    assert open_recording(tmp_path / "a.parquet", Layout(velocity="speed")) == expected()


def test_parquet_of_a_frame_with_attributes(tmp_path):
    library("pyarrow")
    frame = pd.DataFrame({"vib": VIB, "amp [A]": AMP, "speed": SPEED})
    frame.attrs = {"fs": 2560, "units": {"vib": "g", "speed": "rpm"}}
    frame.to_parquet(tmp_path / "a.parquet")
    assert open_recording(tmp_path / "a.parquet", Layout(velocity="speed")) == expected()


def test_hdf5_with_attributes_of_data_sets_and_groups(tmp_path):
    h5py = library("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        group = file.create_group("bench")
        group.attrs["sampling_rate"] = 2560
        for name, values, unit in (("vib", VIB, "g"), ("amp", AMP, "A"), ("speed", SPEED, "rpm")):
            group.create_dataset(name, data=values, compression="gzip").attrs["unit"] = unit
        file.create_dataset("notes", data="text")
    layout = Layout(channels={"vib": "bench/vib", "amp": "amp"}, velocity="speed")
    assert open_recording(tmp_path / "a.h5", layout) == expected()


def test_mat_7_3_as_matlab_writes_it(tmp_path):
    h5py = library("h5py")
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        run = file.create_group("run")
        for name, values in (("vib", VIB), ("amp", AMP), ("speed", SPEED)):
            run.create_dataset(name, data=values[None, :]).attrs["MATLAB_class"] = b"double"
        run.create_dataset("fs", data=[[2560.0]]).attrs["MATLAB_class"] = b"double"
        text = np.frombuffer("AB".encode("utf-16-le"), "u2")[:, None]
        run.create_dataset("name", data=text).attrs["MATLAB_class"] = b"char"
    with open(tmp_path / "a.mat", "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(116) + bytes(8) + b"\x00\x02IM")
    columns = {"vib": "run.vib", "amp": "run.amp"}
    layout = Layout(
        channels=columns, velocity="run.speed", units={"run.speed": "rpm", "vib": "g", "amp": "A"}
    )
    assert open_recording(tmp_path / "a.mat", layout) == expected()


def test_tdms_with_wave_form_properties(tmp_path):
    nptdms = library("nptdms")
    units = {"vib": "g", "amp": "A", "speed": "rpm"}
    start = {"wf_start_time": np.datetime64("2026-11-01T08:01:00.5")}
    channels = [
        nptdms.ChannelObject(
            "bench", name, values, {"wf_increment": 1 / 2560, "unit_string": units[name]} | start
        )
        for name, values in (("vib", VIB), ("amp", AMP), ("speed", SPEED))
    ]
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment(channels)
    opened = open_recording(tmp_path / "a.tdms", Layout(velocity="speed"))
    assert opened == expected()
    assert opened.start == pd.Timestamp("2026-11-01T08:01:00.5")


OTHERS = ("orddenom_spec_data_type", "z_axis_spec_data_type")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")  # pyuff leaves the file open
def test_uff_58_binary(tmp_path):
    pyuff = library("pyuff")
    file = pyuff.UFF(str(tmp_path / "a.uff"))
    plain, none = ("plain", VIB, ""), ("none", AMP, "NONE")
    given = (("vib", VIB, "g"), ("amp", AMP, "A"), ("speed", SPEED, "rpm"), plain, none)
    for name, values, unit in given:
        one = {"type": 58, "binary": 1, "func_type": 1, "id1": name, "data": values}
        one |= {"rsp_node": 1, "rsp_dir": 1, "ref_node": 1, "ref_dir": 1, "abscissa_spacing": 1}
        one |= {"x": np.arange(N) / 12_000, "ordinate_axis_units_lab": unit}
        one |= dict.fromkeys(OTHERS, 0) | {"orddenom_axis_lab": ""}
        file.write_sets(one, "add")
    opened = open_recording(tmp_path / "a.uff", Layout(velocity="speed"))
    assert dict(opened.units) == {"vib": "g", "amp": "A"}
    assert opened.fs["vib"] == 12_000  # the file states 8.33333e-05 s
    np.testing.assert_array_equal(opened.signals["amp"], AMP)


@pytest.mark.filterwarnings("ignore")  # of asammdf's own imports
def test_mdf_4_with_rates_from_time_stamps(tmp_path):
    asammdf = library("asammdf")
    times = np.arange(N) / 2560
    units = {"vib": "g", "amp": "A", "speed": "rpm"}
    signals = [
        asammdf.Signal(samples=values, timestamps=times, name=name, unit=units[name])
        for name, values in (("vib", VIB), ("amp", AMP), ("speed", SPEED))
    ]
    with asammdf.MDF(version="4.10") as file:
        file.start_time = pd.Timestamp("2026-11-01T08:01:00", tz="UTC").to_pydatetime()
        file.append(signals)
        file.save(tmp_path / "a.mf4")
    opened = open_recording(tmp_path / "a.mf4", Layout(velocity="speed"))
    assert opened == expected()
    assert opened.start == pd.Timestamp("2026-11-01T08:01:00")


@pytest.mark.parametrize(
    ("name", "module", "extra"),
    [
        ("a.parquet", "pyarrow.parquet", "files"),
        ("a.h5", "h5py", "files"),
        ("a.tdms", "nptdms", "files"),
        ("a.uff", "pyuff", "files"),
        ("a.mf4", "asammdf", "mdf"),
    ],
)
def test_without_the_library_the_extra_is_named(tmp_path, monkeypatch, name, module, extra):
    (tmp_path / name).write_bytes(b"something")
    monkeypatch.setitem(sys.modules, module, None)
    opened = open_recording(tmp_path / name, LAYOUT)
    library = module.partition(".")[0]
    message = rf"files are read by {library}, which is not .*pip install 'emacm\[{extra}\]'"
    with pytest.raises(ImportError, match=message):
        assert opened.duration


@pytest.mark.filterwarnings("ignore")  # of the libraries
@pytest.mark.parametrize(
    ("name", "module"),
    [
        ("a.parquet", "pyarrow"),
        ("a.h5", "h5py"),
        ("a.tdms", "nptdms"),
        ("a.uff", "pyuff"),
        ("a.mf4", "asammdf"),
    ],
)
def test_a_damaged_file_is_one_clear_error(tmp_path, name, module):
    library(module)
    (tmp_path / name).write_bytes(b"something else " * 40)
    with pytest.raises(ValueError, match=rf"{name}: (it cannot be read as a|it contains no sig)"):
        assert open_recording(tmp_path / name, LAYOUT).duration


# Files of unusual form

WAVE = np.sin(np.arange(200.0))


def parquet_of(tmp_path, columns, names=None):
    pa, parquet = library("pyarrow"), library("pyarrow.parquet")
    arrays = [pa.array(values) for values in columns.values()]
    table = pa.Table.from_arrays(arrays, names=names or list(columns))
    parquet.write_table(table, tmp_path / "a.parquet")
    return open_recording(tmp_path / "a.parquet", Layout(fs=100, channels=["vib"], velocity=3))


@pytest.mark.parametrize(
    ("columns", "names", "message"),
    [
        ({"vib": [[1.0]] * 200, "b": WAVE}, None, "'vib' holds values of the type list<"),
        ({"vib": [None] * 200, "b": WAVE}, None, "'vib' holds values of the type null"),
        ({"vib": [None, *["x"] * 199], "b": WAVE}, None, "'vib' holds values of the type string"),
        ({"vib": ["x"] * 199 + [None], "b": WAVE}, None, "'vib' must be numeric, got 'x' at"),
        ({"vib": [[1.0]] * 200}, None, "no signal, .*'vib' holds values"),
        ({"vib": WAVE, "b": WAVE}, ["vib", "vib"], "its columns must have different names"),
    ],
)
def test_parquet_columns_that_are_no_signals_are_named(tmp_path, columns, names, message):
    with pytest.raises((ValueError, TypeError), match=message):
        assert parquet_of(tmp_path, columns, names).duration


def test_cells_and_arrays_of_structures_of_a_mat_file_are_numbered(tmp_path):
    cell = np.empty(2, object)
    cell[0], cell[1] = WAVE, 2 * WAVE
    runs = np.array([(3 * WAVE,), (4 * WAVE,)], dtype=[("y", "O")])
    scipy.io.savemat(tmp_path / "a.mat", {"cell": cell, "runs": runs})
    channels = {"a": "cell.1", "b": "runs.0.y"}
    recording = open_recording(tmp_path / "a.mat", Layout(fs=100, channels=channels, velocity=3))
    np.testing.assert_array_equal(recording.signals["a"], 2 * WAVE)
    np.testing.assert_array_equal(recording.signals["b"], 3 * WAVE)


@pytest.mark.parametrize("key", ["fs", "sampling_rate", "sample_rate", "samplerate", "rate"])
def test_attributes_of_an_hdf5_file_hold_for_all_its_data_sets(tmp_path, key):
    h5py = library("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["vib"], file["bench/amp"] = WAVE, 2 * WAVE
        file.attrs.update({key: 100.0, "units": '{"vib": "g", "bench/amp": "A"}'})
    run = open_recording(tmp_path / "a.h5", Layout(velocity=3))
    assert dict(run.fs) == {"bench/amp": 100, "vib": 100}
    assert dict(run.units) == {"bench/amp": "A", "vib": "g"}


NOT_READ = {
    "nothing": np.zeros(0),
    "volume": np.zeros((2, 3, 4)),
    "notes": np.array(["a", "b"]),
}


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("nothing", "is empty"),
        ("volume", "has 3 dimensions"),
        ("notes", "holds no numbers, but <U"),
    ],
)
def test_an_array_that_cannot_be_a_channel_is_named_with_the_reason(name, reason, tmp_path):
    np.savez(tmp_path / "a.npz", **NOT_READ, vib=VIB, speed=SPEED)
    layout = Layout(channels=[name], velocity="speed", fs=2560)
    with pytest.raises(ValueError, match=f"'{name}' {reason}"):
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


def test_parquet_reads_decimals(tmp_path):
    pyarrow, parquet = library("pyarrow"), library("pyarrow.parquet")
    hundredths = np.round(VIB, 2)
    columns = {
        "vib": pyarrow.array(hundredths).cast(pyarrow.decimal128(6, 2)),
        "speed": pyarrow.array(SPEED),
    }
    parquet.write_table(pyarrow.table(columns), tmp_path / "a.parquet")
    opened = open_recording(tmp_path / "a.parquet", Layout(velocity="speed", fs=2560))
    np.testing.assert_allclose(opened.signals["vib"], hundredths, rtol=1e-15)
