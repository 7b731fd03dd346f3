"""Data sets in the form of the package bearing-datasets (version 0.3, schema 2)."""

import json
import pickle
import sys

import numpy as np
import pandas as pd
import pytest

from emacm import Layout, Recording, open_bearing_dataset
from emacm.recordings.bearing_datasets import read_part

pyarrow = pytest.importorskip(
    "pyarrow", reason="pyarrow cannot be imported (extra 'files')", exc_type=ImportError
)
RNG = np.random.default_rng(8)
LENGTHS = {"DE": 900, "FE": 450}
RATES = {"DE": 12_000, "FE": 6000}
SIGNALS = {
    (number, name): RNG.normal(size=LENGTHS[name]).astype(dtype)
    for number, dtype in ((0, np.float32), (1, np.float64), (2, np.float64))
    for name in ("DE", "FE")
}


@pytest.fixture
def folder(tmp_path):
    """Write a data set of three recordings as `SignalWriter` of the package lays it out."""
    from pyarrow import parquet

    (tmp_path / "signals").mkdir()
    rows, writers, groups = [], {}, {}
    for (number, name), samples in SIGNALS.items():
        dtype = samples.dtype.name
        lists = pyarrow.ListArray.from_arrays([0, len(samples)], pyarrow.array(samples))
        signal = f"r{number}_{name}"
        table = pyarrow.table({"signal_id": [signal], "signal": lists})
        file = f"part-{dtype}.parquet"
        if dtype not in writers:
            writers[dtype] = parquet.ParquetWriter(tmp_path / "signals" / file, table.schema)
        writers[dtype].write_table(table)
        groups[dtype] = groups.get(dtype, -1) + 1
        rows.append(
            {
                "dataset": "bench",
                "signal_id": signal,
                "recording_id": f"r{number}",
                "channel": name,
                "fs": RATES[name],
                "n_samples": len(samples),
                "fault_type": ("normal", "inner", "outer")[number],
                "speed_rpm": (1797, 1750, 1730)[number],
                "bearing_id": f"B{number}",
                "unit": "g",
                "signal_file": file,
                "signal_row_group": groups[dtype],
                "signal_row": 0,
            }
        )
    for writer in writers.values():
        writer.close()
    pd.DataFrame(rows).to_parquet(tmp_path / "metadata.parquet")
    (tmp_path / "manifest.json").write_text(json.dumps({"dataset": "bench", "schema_version": 2}))
    return tmp_path


def test_recordings_have_channels_rates_units_speed_and_metadata(folder):
    recordings = open_bearing_dataset(folder, Layout(velocity="speed_rpm", channels=["DE"]))
    assert [recording.meta["fault_type"] for recording in recordings] == [
        "normal",
        "inner",
        "outer",
    ]
    for number, rpm in enumerate((1797, 1750, 1730)):
        expected = Recording(
            {"DE": SIGNALS[number, "DE"]},
            12_000,
            velocity=rpm * (np.pi / 30),
            units={"DE": "g"},
            meta={
                "dataset": "bench",
                "recording_id": f"r{number}",
                "fault_type": ("normal", "inner", "outer")[number],
                "speed_rpm": rpm,
                "bearing_id": f"B{number}",
            },
        )
        assert recordings[number] == expected


def test_channels_of_several_rates_are_channels_of_one_recording(folder):
    recording = open_bearing_dataset(folder)[2]
    assert dict(recording.fs) == {"DE": 12_000, "FE": 6000}
    np.testing.assert_array_equal(recording.signals["FE"], SIGNALS[2, "FE"])


def test_a_recording_is_pickled_without_its_samples(folder):
    recording = open_bearing_dataset(folder)[1]
    assert len(pickle.dumps(recording)) < 1000
    assert pickle.loads(pickle.dumps(recording)) == recording
    assert recording.cut(0.01).duration == pytest.approx(recording.duration - 0.01)


def test_recordings_are_selected_by_their_metadata(folder):
    found = open_bearing_dataset(folder, where={"bearing_id": ["B0", "B2"]})
    assert [recording.meta["recording_id"] for recording in found] == ["r0", "r2"]
    with pytest.raises(ValueError, match=r"no recording of .* has {'bearing_id': 'K1'}\."):
        open_bearing_dataset(folder, where={"bearing_id": "K1"})
    with pytest.raises(ValueError, match="where names 'state'; the metadata have"):
        open_bearing_dataset(folder, where={"state": "K1"})


def test_a_folder_without_metadata_is_an_error(tmp_path):
    with pytest.raises(FileNotFoundError, match="not built by bearing-datasets"):
        open_bearing_dataset(tmp_path)
    pd.DataFrame({"recording_id": [1]}).to_parquet(tmp_path / "metadata.parquet")
    with pytest.raises(ValueError, match="lacks the columns"):
        open_bearing_dataset(tmp_path)


def test_without_the_library_the_extra_is_named(folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(ImportError, match=r"pip install 'emacm\[files\]'"):
        open_bearing_dataset(folder)


def in_one_group(folder, facts, signals):
    """Write signals one below the other in a single row group, and their metadata."""
    from pyarrow import parquet

    (folder / "signals").mkdir()
    table = pyarrow.table({"signal": pyarrow.array(signals, pyarrow.list_(pyarrow.float64()))})
    parquet.write_table(table, folder / "signals" / "part.parquet")
    places = {"signal_file": "part.parquet", "signal_row_group": 0}
    rows = [{**fact, **places, "signal_row": row} for row, fact in enumerate(facts)]
    pd.DataFrame(rows).to_parquet(folder / "metadata.parquet")
    return folder


def test_signals_of_one_row_group_and_names_of_earlier_versions(tmp_path):
    signals = [RNG.normal(size=n).tolist() for n in (30, 48, 41)]
    facts = [
        {"recording_id": "b", "channel": "z", "fs": 10, "unit": "g", "place": "left"},
        {"recording_id": "b", "channel": "a", "fs": 16, "unit": "counts", "place": None},
        {"recording_id": "a", "channel": "z", "fs": 10, "unit": "m/s²", "place": "right"},
    ]
    old = {"condition": "worn", "severity": 3, "rpm": 90}
    folder = in_one_group(tmp_path, [fact | old for fact in facts], signals)
    first, second = open_bearing_dataset(folder)
    assert [run.channels for run in (first, second)] == [("z", "a"), ("z",)]
    assert dict(first.units) == {"z": "g"}
    assert dict(second.units) == {"z": "m/s²"}
    for run, name, values in zip((first, first, second), "zaz", signals, strict=True):
        assert run.signals[name].tolist() == values
    known = {"fault_type": "worn", "fault_severity": 3, "speed_rpm": 90}
    assert first.meta == {"recording_id": "b", **known}  # its channels are at different places
    assert second.meta == {"recording_id": "a", "place": "right", **known}
    np.testing.assert_allclose(second.velocity, 3 * np.pi)
    chosen = open_bearing_dataset(folder, where={"fault_severity": {3, 4}, "recording_id": "a"})
    assert chosen == [second]


@pytest.mark.parametrize("unit", [None, "unknown", "counts", "normalized"])
def test_without_unit_and_speed_nothing_is_assumed_of_them(tmp_path, unit):
    fact = {"recording_id": 7, "channel": "b", "fs": 10, "unit": unit}
    folder = in_one_group(tmp_path, [fact], [[1.0, 2.0, 3.0]])
    (run,) = open_bearing_dataset(folder, Layout(velocity=3.0))
    assert (dict(run.units), run.fs["b"], run.signals["b"].tolist()) == ({}, 10, [1, 2, 3])
    (unknown,) = open_bearing_dataset(folder)
    with pytest.raises(ValueError, match="has no column 'speed_rpm'"):
        assert unknown.duration


def test_a_column_of_both_names_keeps_that_of_the_present_version(tmp_path):
    fact = {"recording_id": 7, "channel": "b", "fs": 10, "rpm": 90, "speed_rpm": 60}
    (run,) = open_bearing_dataset(in_one_group(tmp_path, [fact], [[1.0, 2.0]]))
    assert run.meta == {"recording_id": 7, "rpm": 90, "speed_rpm": 60}
    np.testing.assert_allclose(run.velocity, 2 * np.pi)


@pytest.mark.parametrize(
    "speeds",
    [(60.0, None), (None, 60.0), (60.0, 90.0), (None, None), ("60", None), ("60", "unknown")],
)
def test_the_speed_is_known_if_the_channels_that_state_it_agree(tmp_path, speeds):
    facts = [
        {"recording_id": "r", "channel": name, "fs": 10, "speed_rpm": speed}
        for name, speed in zip("ab", speeds, strict=True)
    ]
    (run,) = open_bearing_dataset(in_one_group(tmp_path, facts, [[1.0, 2.0], [3.0, 4.0]]))
    if {60.0, "60"} & {*speeds} and 90.0 not in speeds:
        np.testing.assert_allclose(run.velocity, 2 * np.pi)
    else:
        with pytest.raises(ValueError, match="has no column 'speed_rpm'"):
            assert run.duration


def test_a_missing_sample_is_an_error_with_its_number(tmp_path):
    fact = {"recording_id": "r", "channel": "b", "fs": 10, "speed_rpm": 60}
    folder = in_one_group(tmp_path, [fact, fact | {"recording_id": "s"}], [[1.0, 2], [1.0, None]])
    good, gap = open_bearing_dataset(folder)
    assert good.signals["b"].tolist() == [1, 2]
    with pytest.raises(ValueError, match="channel 'b' must be finite, got nan at sample 1"):
        assert gap.duration


def test_a_recording_that_is_no_longer_listed_is_an_error(folder):
    with pytest.raises(ValueError, match="it has no recording 'r9' any more"):
        read_part(folder / "metadata.parquet", "r9")
