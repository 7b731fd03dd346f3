"""Times, starts, units and names as files state them."""

from contextlib import nullcontext

import numpy as np
import pytest
from scipy.io import savemat

from emacm import Layout, open_recording


def written_rows(path, header, columns):
    rows = zip(*columns, strict=True)
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


def test_times_rounded_to_seconds_leave_the_rate_open(tmp_path):
    seconds = np.arange(5000) // 1000
    path = written_rows(tmp_path / "a.csv", "time,vib", (seconds, np.arange(5000) % 7))
    with pytest.raises(ValueError, match="rounded to 1 s, which leaves the sampling rate open"):
        _ = open_recording(path, Layout(velocity=10.0)).fs


def test_channels_that_start_at_different_times_are_refused(tmp_path):
    nptdms = pytest.importorskip("nptdms", reason="nptdms is not installed (extra 'files')")
    for late in (0.0, 2.0):
        channels = [
            nptdms.ChannelObject("g", name, np.arange(90.0), {"wf_increment": 0.1} | start)
            for name, start in (("vib", {}), ("speed", {"wf_start_offset": late}))
        ]
        with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
            writer.write_segment(channels)
        with pytest.raises(ValueError, match="starts 2 s later") if late else nullcontext():
            _ = open_recording(tmp_path / "a.tdms", Layout(velocity="speed")).fs


def test_the_unit_of_a_structure_is_that_of_its_array(tmp_path):
    speed = {"data": np.full(90, 1500.0), "unit": "rpm"}
    savemat(tmp_path / "a.mat", {"vib": np.arange(90.0), "fs": 10.0, "speed": speed})
    recording = open_recording(tmp_path / "a.mat", Layout(channels=["vib"], velocity="speed.data"))
    np.testing.assert_allclose(recording.velocity, 50 * np.pi)


def test_texts_of_a_table_of_meta_stay_as_they_are(tmp_path):
    names = [f"{n}.csv" for n in "abc"]
    rows = (names, ["001", "1", "2"], ["None", "worn", "worn"], [1, 2, 3])
    table = written_rows(tmp_path / "meta.csv", "file,unit,state,run", rows)
    metas = [Layout(velocity=1.0, meta=str(table)).meta_of(name) for name in names[:2]]
    assert metas[0] == {"unit": "001", "state": "None", "run": 1}
    assert metas[1]["unit"] == "1"


def test_a_table_of_meta_may_have_semicolons_but_must_name_the_files(tmp_path):
    (tmp_path / "meta.csv").write_text("file;unit\na.csv;001\n", encoding="utf-8-sig")
    assert Layout(velocity=1.0, meta=str(tmp_path / "meta.csv")).meta_of("a.csv") == {"unit": "001"}
    (tmp_path / "meta.csv").write_text("name,unit\na.csv,001\n")
    with pytest.raises(
        ValueError, match=r"meta.csv' has no column 'file', only \['name', 'unit'\]"
    ):
        Layout(velocity=1.0, meta=str(tmp_path / "meta.csv"))


def test_a_second_file_in_ms_is_aligned_by_its_times(tmp_path):
    seconds, vib = np.arange(100) / 100, np.arange(100) % 7
    written_rows(tmp_path / "a.csv", "time,vib", (seconds, vib))
    before = np.arange(-500, 1501, 10)
    written_rows(tmp_path / "a_speed.csv", "time_ms,speed", (before, 20 + before / 100))
    second = {"file": "{stem}_speed.csv", "column": "speed"}
    layout = Layout(channels=["vib"], velocity=second, units={"speed": "rad/s"})
    found = open_recording(tmp_path / "a.csv", layout)
    np.testing.assert_allclose(found.velocity[:100], 20 + 10 * seconds, rtol=1e-9)
