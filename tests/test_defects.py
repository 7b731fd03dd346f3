"""Defects that were found in use, one test for each, so that they do not come back."""

import itertools
import json
import os
import pickle
import re
import shutil
import struct
import sys
import zipfile
from contextlib import contextmanager, nullcontext
from functools import partial
from html import unescape
from io import BytesIO
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest
from order_models import order_bins
from scipy.io import savemat
from sklearn.base import clone
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline

from emacm import (
    CostSensitiveGaussianBayes,
    Layout,
    LeastRiskClassifier,
    NewUnitClassifier,
    OrderMonitor,
    OrderPSD,
    OrderResampler,
    Recording,
    load_model,
    open_recording,
    save_model,
)
from emacm.__main__ import main
from emacm._saved import locked
from emacm.commands import monitor, score
from emacm.reports import maintenance
from emacm.reports.inputs import read_actions, read_parts, read_results

# Estimators


BAYES, LOGISTIC = CostSensitiveGaussianBayes(), LogisticRegression()
GROUPS = {"groups": np.arange(40) % 5}
FITS = [
    (CostSensitiveGaussianBayes(unknown="unknown"), GROUPS),
    (CostSensitiveGaussianBayes(temperature="groups"), GROUPS),
    (NewUnitClassifier(), GROUPS),
    (BAYES, {}),
    (BAYES, GROUPS),
    (LeastRiskClassifier(BAYES), {}),
    (LeastRiskClassifier(LOGISTIC), {}),
]


@pytest.mark.parametrize(("classifier", "options"), FITS)
def test_a_fitted_model_is_displayed_and_completed_by_tab(classifier, options):
    X, y = np.random.default_rng(0).normal(size=(40, 2)), np.repeat(["healthy", "worn"], 20)
    fitted = clone(classifier).fit(X, y, **options)
    for model in (classifier, fitted, make_pipeline(fitted)):
        assert "predict" in dir(model)
        assert type(classifier).__name__ in model._repr_html_()


def test_a_model_file_does_not_state_where_spectra_are_stored(tmp_path):
    pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
    stored = OrderPSD(2, memory=str(tmp_path / "spectra")).fit(np.ones((3, 9)))
    save_model(stored, tmp_path / "model")
    assert load_model(tmp_path / "model").memory is None


@contextmanager
def full_disk(n_bytes=50):
    """No file can grow beyond so many bytes, also not one that pytest writes to."""
    resource = pytest.importorskip("resource", reason="not on Windows")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_a_full_disk_is_named_with_the_file_and_leaves_nothing_behind(tmp_path):
    pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
    model = CostSensitiveGaussianBayes().fit([[0.0], [1.0], [5.0], [7.0]], ["a", "a", "b", "b"])
    with pytest.raises(OSError, match="bench"), full_disk():
        save_model(model, tmp_path / "bench.emacm")
    assert not list(tmp_path.iterdir())


# Channels and the shaft


@pytest.mark.parametrize("width", [1, 3])
@pytest.mark.parametrize("size", [7.0, -4.0])
def test_spikes_of_the_shaft_angle_are_named_and_refused_as_jumps_are(size, width):
    angle = 0.01 * np.arange(20_000) + 0.2 * np.sin(np.arange(20_000) / 3000)
    for place in (300, 5000, 9001, 12_345, 19_000):
        angle[place : place + width] += size
    noise = np.random.default_rng(0).standard_normal(len(angle))
    recordings = [Recording({"x": noise}, 20_000, angle=angle)]
    assert f"angle jumps by {abs(size):.0f}" in OrderResampler().quality(recordings).warnings[0]
    with pytest.raises(ValueError, match="Repair it"):
        OrderResampler().fit_transform(recordings)


TIMES = np.arange(150_000) / 50_000
TONE = np.sin(2 * np.pi * 37 * TIMES)
CURRENT = TONE + 0.02 * np.random.default_rng(1).standard_normal(len(TIMES))
IN_GAP = np.isin(np.arange(len(TIMES)) // 250, [7 + 40 * k + k % 7 for k in range(15)])  # of 5 ms
LAST = np.maximum.accumulate(np.where(IN_GAP, 0, np.arange(len(TIMES))))  # sample before a gap
CHANNELS = {
    "int8": ((150 * TONE).astype(np.int64).astype(np.int8), "integers overflow"),
    "int16, scaled": (1e-3 * (4e4 * CURRENT).astype(np.int64).astype(np.int16), "overflow"),
    "an offset": (1e6 + CURRENT, "offset of 1e.06"),
    "an offset in float32": (np.float32(1e6 + CURRENT), "offset of 1e.06"),
    "zeros in 2.5 % of the time": (np.where(IN_GAP, 0.0, CURRENT), "drop-outs"),
    "held in 2.5 % of the time": (CURRENT[LAST], "drop-outs"),
    "a tone of 16 bits": (np.round(32_767 * TONE), "^$"),
    "a temperature": (300 + 0.02 * CURRENT, "^$"),
    "a wrapped angle": ((200 * TIMES + 0.1 * TONE) % (2 * np.pi), "^$"),
    "a square wave with noise": (0.1 * CURRENT + np.sign(TONE), "^$"),
    "a fast tone": (np.sin(2 * np.pi * 14_900 * TIMES), "^$"),
}


@pytest.mark.parametrize(("values", "warning"), CHANNELS.values(), ids=CHANNELS)
def test_overflow_offsets_and_short_drop_outs_are_named_and_nothing_else(values, warning):
    recording = Recording({"x": values}, 50_000, velocity=np.full(len(values), 60.0))
    assert re.search(warning, OrderResampler().quality([recording]).warnings[0])


def test_a_monitor_names_a_channel_that_begins_to_overflow():
    force, speed = np.random.default_rng(0).standard_normal((12, 8000)), np.full(8000, 60.0)
    force = force / 20 + np.sin(np.arange(8000) / 30)
    model = order_bins(BAYES, samples=128, max_order=2)
    model.fit([Recording({"x": x}, 2000, velocity=speed) for x in force[:10]], ["a", "b"] * 5)
    monitor = OrderMonitor(model, fs=2000, channels=["x"], max_speed=100)
    alarms = []
    for block in (force[10], (120 * force[11]).astype(int).astype(np.int8) / 120):
        monitor.push([block], velocity=speed)
        alarms += [" ".join(reading.alarms) for reading in monitor.flush()]
    assert ["overflow" in text for text in alarms] == [False, True]


# Files

FREE = Layout(fs=100, velocity=3)


def hdf5_of(path, **options):
    h5py = pytest.importorskip("h5py", reason="extra 'files'")
    with h5py.File(path, "w") as file:
        file["b"] = np.ones(9)
        if "link" in options:
            file["left/c"], file["right/c"] = h5py.ExternalLink(*options["link"]), np.ones(9)
        elif "virtual" in options:
            layout = h5py.VirtualLayout((9,), "f8")
            layout[:] = h5py.VirtualSource(*options["virtual"], (9,))
            file.create_virtual_dataset("c", layout)
        else:
            file.create_dataset("c", dtype="f8", **options)


def npz_of(path, names, stated=None):
    array = BytesIO()
    np.save(array, np.ones(9))
    with zipfile.ZipFile(path, "w") as archive:
        for name in names:
            archive.writestr(name, array.getvalue())
        archive.filelist[0].file_size = stated or archive.filelist[0].file_size


def tdms_without(path, n_bytes):
    nptdms = pytest.importorskip("nptdms", reason="extra 'files'")
    for mode in ("w", "a"):  # the second segment is short, as without description of its channels
        with nptdms.TdmsWriter(path, mode=mode) as writer:
            writer.write_segment([nptdms.ChannelObject("g", "b", np.arange(9.0))])
    content = path.read_bytes()
    path.write_bytes(content[: len(content) - n_bytes])


DAMAGED = struct.pack("<4sllqq40s", b"TDSm", 14, 4713, 40, 40, b"\xff" * 40)
NARROW = np.zeros(1 + (1 << 25), np.uint8)
EXTERNAL = {"shape": (8,), "external": [("/etc/passwd", 0, 64)]}
REFUSED = {
    "long line.csv": (lambda path: path.write_text("1," * 90_000), "line 1 has more than 100000"),
    "same name.npz": (partial(npz_of, names=["a", "a.npy"]), r"different names, got \['a', 'a'\]"),
    "8 TB.h5": (lambda path: hdf5_of(path, shape=(10**12,), chunks=True), "arrays of 8000 GB"),
    "huge.npz": (partial(npz_of, names=["b.npy"], stated=1 << 30), "made to fill"),
    "huge.mat": (partial(savemat, mdict={"b": NARROW}, do_compression=True), "made to fill"),
    "external.h5": (lambda path: hdf5_of(path, **EXTERNAL), "'c' is stored in another file"),
    "link.h5": (lambda path: hdf5_of(path, link=("other.h5", "b")), "'c' is stored in another"),
    "virtual.h5": (lambda path: hdf5_of(path, virtual=(path, "b")), "'c' is stored in another"),
    "device.csv": (lambda path: path.symlink_to("/dev/zero"), "not a file, but a folder or a dev"),
    "pipe.npz": (lambda path: os.mkfifo(path), "not a file, but a folder or a device"),
    "damaged.tdms": (lambda path: path.write_bytes(DAMAGED), "cannot be read as a .tdms"),
    **{
        f"{n_bytes}.tdms": (partial(tdms_without, n_bytes=n_bytes), "it is truncated: it states")
        for n_bytes in (1, 7, 80, 100)
    },
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_that_is_incomplete_or_made_to_fill_the_memory_is_refused(tmp_path, name):
    if os.name == "nt" and name.startswith(("device", "pipe", "external")):
        pytest.skip("not on Windows")
    write, message = REFUSED[name]
    write(tmp_path / name)
    recording = pickle.loads(pickle.dumps(open_recording(tmp_path / name, FREE)))
    with pytest.raises(ValueError, match=f"{name}: .*{message}"):
        assert recording.duration


@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "cp1252"])
def test_the_last_row_of_a_text_without_its_line_end_is_left_out(tmp_path, line_end, encoding):
    path = tmp_path / "a.csv"
    for last, count in (("3,500.00\n", 3), ("3,500.00", 2), ("3,5", 2), ("3,-", 2), ("3", 2)):
        text = f"b,c [°]\n1,500.00\n2,500.00\n{last}"
        path.write_text(text, encoding=encoding, newline=line_end)
        stated = pytest.warns(UserWarning, match="no line end") if count == 2 else nullcontext()
        with stated:
            signals = open_recording(path, FREE).signals
        assert signals["c"].tolist() == [500.0] * count


@pytest.mark.parametrize("line", [" " * 9**5, "x" + " " * 9**5, "[" * 9**5, "x 1" + ";" * 9**5])
def test_a_long_line_above_the_header_takes_no_time(tmp_path, line):
    (tmp_path / "a.csv").write_text(f"{line}\n# fs: 50 Hz\nb\n1\n2\n")
    assert open_recording(tmp_path / "a.csv", Layout(velocity=3)).duration == 0.04


@pytest.mark.parametrize("read", [Layout.from_toml, read_actions, read_parts])
@pytest.mark.parametrize(
    ("text", "message"),
    [("a=" + "[" * 9000, "not valid TOML"), ("a='" + "[ " * 50_000 + "'", "30000 in one line")],
)
def test_toml_that_is_nested_deeply_or_has_a_long_name_is_refused(tmp_path, read, text, message):
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(ValueError, match=f"a.toml: .*{message}"):
        read(tmp_path / "a.toml")


def test_a_layout_may_begin_with_a_byte_order_mark(tmp_path):
    (tmp_path / "a.toml").write_text("fs = 5", encoding="utf-8-sig")
    assert Layout.from_toml(tmp_path / "a.toml").fs == 5


@pytest.mark.skipif(sys.platform != "linux", reason="names are UTF-8")
def test_names_of_files_that_are_not_utf_8_are_read_and_printed(tmp_path):
    path = tmp_path / os.fsdecode(b"pr\xfcf_1.csv")
    path.write_text("b,c\n1,2\n3,4\n")
    recording = open_recording(path, Layout(fs=5, velocity=3, meta="{unit}_{run:d}"))
    assert recording.signals["c"].tolist() == [2, 4]
    assert recording.meta == {"unit": r"pr\xfcf", "run": 1}
    with pytest.raises(ValueError, match=r"pr\\xfcf_1.csv: it has no column 'd'"):
        assert open_recording(path, Layout(fs=5, velocity=3, channels=["d"])).duration
    assert main(["inspect", str(path), "--draft", str(tmp_path / "a.toml")]) == 0


# Scores and pages

ODD_NAMES = ["=1+1.csv", "@a.csv", "+b.csv", "-2.csv", "'=c.csv", "a\u2028\u2029\x85b.csv"]
ODD_NAMES += [os.fsdecode(b"pr\xfcf.csv"), "run 1.csv", "run_1.csv", "RUN_1.csv", "index.csv"]
ODD_NAMES += ["javascript:alert(1).csv", "a#b?c%20d&amp;.csv"]


@pytest.fixture
def scored(plant, tmp_path, monkeypatch, capsys):
    """Score files of the present folder: exit status, messages, files decided on at once."""
    (tmp_path / "new").mkdir()
    monkeypatch.chdir(tmp_path / "new")
    batches, original = [], score.scored_rows

    def spy(model, sources, names, n_jobs, **options):
        batches.append(names)
        return original(model, sources, names, n_jobs, **options)

    def run(*arguments):
        batches.clear()
        model, layout = str(plant / "model.emacm"), str(plant / "layout.toml")
        status = main(["score", model, *map(str, arguments), "--layout", layout])
        return status, capsys.readouterr().err, [names for names in batches if names]

    monkeypatch.setattr(score, "scored_rows", spy)
    return run


def measure(*names, seed=0):
    for name in names:
        Path(name).write_text("time,vib,speed\n" + "".join(measured(0, 1000, seed)))


def test_two_scores_do_not_write_to_one_table(scored, tmp_path):
    pytest.importorskip("fcntl", reason="not on Windows")
    measure("a.csv")
    with locked(tmp_path / "rows.csv"):
        status, err, _ = scored(".", "--out", "../rows.csv")
    assert (status, "used by another process" in err) == (2, True)
    assert [path.name for path in tmp_path.iterdir()] == ["new"]  # nor is a lock left
    assert scored(".", "--out", "../rows.csv")[0] == 0


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="such names are not possible")
def test_files_of_any_name_have_rows_and_pages_of_their_own(scored):
    pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra 'plot')")
    names = sorted(name.replace("\udcfc", r"\xfc") for name in ODD_NAMES)
    table, pages = Path("../rows.csv"), Path("../pages")
    for new in (["run_1.csv"], ODD_NAMES, ["run 1.csv"]):
        measure(*new, seed=len(new))
        status, _, decided = scored(".", "--out", table, "--report", pages)
        assert status == 0
    assert decided == [["run 1.csv"]]
    assert sorted(read_results(table)["recording"]) == names
    cells = {line.partition(",")[0] for line in table.read_text().split("\n")}
    assert {"'=1+1.csv", "'@a.csv", "'+b.csv", "'-2.csv", "''=c.csv"} <= cells
    links = re.findall(r'<a href="\./([^"]*)">([^<]*)</a>', (pages / "index.html").read_text())
    assert sorted(unescape(name) for _, name in links) == names
    assert not any(":" in link for link, _ in links)
    for link, name in links:
        assert f'data-name="{name}"' in (pages / unquote(link)).read_text()


def test_only_a_table_of_results_is_replaced_and_it_is_not_scored(scored, plant):
    measure("a.csv", "b.csv")
    shutil.copy(plant / "model.emacm", "model.csv")
    Path("c.jsonl").write_text('{"recording": 1}\n2\n')
    for out in map(Path, ("a.csv", "model.csv", "c.jsonl")):
        content = out.read_bytes()
        status, err, _ = scored("a.csv", "--out", out, "--again")
        assert (status, "is no table of these results" in err) == (2, True)
        assert out.read_bytes() == content
    Path("model.csv").unlink()
    for _ in range(2):
        assert scored(".", "--out", "rows.csv", "--again")[2] == [["a.csv"], ["b.csv"]]


def test_rows_of_slow_files_are_written_one_by_one(scored, monkeypatch):
    measure("a.csv", "b.csv", "c.csv")
    monkeypatch.setattr(score.time, "monotonic", itertools.count(step=2.0).__next__)
    assert scored(".")[2] == [["a.csv"], ["b.csv"], ["c.csv"]]


@pytest.mark.slow
def test_pages_that_were_written_before_a_kill_are_kept(scored, monkeypatch):
    pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra 'plot')")
    measure(*map("{}.csv".format, range(10, 19)))
    pages, original = Path("../pages"), maintenance.page_of

    def killed(settings, source, name, *others):
        if name == "18.csv":
            raise KeyboardInterrupt
        return original(settings, source, name, *others)

    monkeypatch.setattr(maintenance, "page_of", killed)
    status, _, batches = scored(".", "--out", "rows.csv", "--report", pages)
    assert (status, max(map(len, batches)) > 1) == (130, True)  # quick files together
    written = {path.name: path.stat().st_mtime_ns for path in pages.glob("1*.html")}
    monkeypatch.setattr(maintenance, "page_of", original)
    assert scored(".", "--out", "rows.csv", "--report", pages)[2] == []
    found = {path.name: path.stat().st_mtime_ns for path in pages.glob("1*.html")}
    assert (len(written), found) == (8, written | {"18.html": found["18.html"]})


def test_a_full_disk_is_named_with_the_table_or_the_page_and_nothing_is_left(scored, tmp_path):
    pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra 'plot')")
    measure("a.csv", "b.csv")
    for n_bytes, rows in ((50, None), (250, 0), (700, 1)):
        with full_disk(n_bytes):
            status, err, _ = scored(".", "--out", "../rows.csv", "--jobs", "1")
        assert (status, "rows.csv" in err) == (2, True)
        assert rows is None or len(read_results(tmp_path / "rows.csv")) == rows
    with full_disk():
        status, err, _ = scored(".", "--report", "../pages")
    assert (status, "a.html" in err) == (2, True)
    assert len(list(tmp_path.rglob("*"))) == 5  # new, its two files, pages, rows.csv


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="not on Windows")
def test_a_pipe_and_a_device_have_a_row_with_an_error(scored):
    os.mkfifo("pipe.csv")
    Path("zero.csv").symlink_to("/dev/zero")
    status, _, _ = scored("pipe.csv", "zero.csv", "--out", "rows.jsonl")
    errors = read_results(Path("rows.jsonl"))["error"]
    assert (status, errors.str.contains("not a file").tolist()) == (3, [True, True])


# Monitors


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    """A model and a layout of rows of time, vibration and speed."""
    pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
    folder = tmp_path_factory.mktemp("plant")
    (folder / "layout.toml").write_text('velocity = "speed"\n')
    rng, X = np.random.default_rng(0), []
    for k in range(10):
        X.append(Recording({"vib": (1 + k % 2) * rng.normal(size=2000)}, 1000, velocity=90.0))
    bayes = CostSensitiveGaussianBayes(covariance="diag")
    model = order_bins(bayes, samples=24, revolutions=2, max_order=6).fit(X, ["ok", "worn"] * 5)
    save_model(model, folder / "model.emacm")
    return folder


def measured(start, n, seed=0):
    noise = np.random.default_rng(seed).normal(size=n)
    return [f"{start + k / 1000:.3f},{x:.6f},90\n" for k, x in enumerate(noise)]


@pytest.fixture
def monitored(plant, tmp_path, capsys):
    """Write rows to a log below a header, and follow it until it does not grow."""

    def follow(rows=None, *options, every="1", idle="0"):
        if rows is not None:
            (tmp_path / "log.csv").write_text("time,vib,speed\n" + "".join(rows))
        others = ["--layout", str(plant / "layout.toml"), "--max-speed", "100 rad/s"]
        others += ["--every", every, "--unit", "s", "--idle", idle, *options]
        status = main(["monitor", str(plant / "model.emacm"), str(tmp_path / "log.csv"), *others])
        out, err = capsys.readouterr()
        return status, [json.loads(line) for line in out.splitlines()], err

    return follow


def emptied(log, text):
    log.write_text(text)


def renamed(log, text):
    log.rename(log.with_suffix(".1"))
    log.write_text(text)


def intervals(lines):
    readings = [line for line in lines if not line["error"]]
    return [(line["stream_start"], line["stream_end"], line["complete"]) for line in readings]


@pytest.mark.parametrize("restored", [True, False])
@pytest.mark.parametrize(
    ("header", "replace"),
    [("", emptied), ("time,vib,speed\n", renamed), ("speed,time,vib\n", renamed)],
)
def test_a_log_that_is_replaced_is_read_from_its_new_beginning(
    monitored, monkeypatch, tmp_path, header, replace, restored
):
    old, new = measured(0, 1500), measured(50, 2500, seed=1)  # longer than before
    if header.startswith("speed"):
        new = ["90,{},{}\n".format(*row.split(",")) for row in new]
    log, state = tmp_path / "log.csv", ("--state", str(tmp_path / "state"))
    if restored:
        first = monitored(old, *state)[1]
        replace(log, header + "".join(new))
        lines = [line for line in first if line["complete"]] + monitored(None, *state)[1]
    else:
        slept = []  # time passes only while the program sleeps, on computers of any speed

        def replace_first(seconds):
            if not slept:
                replace(log, header + "".join(new))
            slept.append(seconds)

        monkeypatch.setattr(monitor.time, "sleep", replace_first)
        monkeypatch.setattr(monitor.time, "monotonic", lambda: sum(slept))
        lines = monitored(old, idle="0.1")[1]
    (error,) = [line for line in lines if line["error"]]
    assert "log.csv was emptied or replaced" in error["error"]
    expected = [(0, 1, True), (1, 1.5, False), (50, 51, True), (51, 52, True), (52, 52.5, False)]
    np.testing.assert_allclose(intervals(lines), expected)
    assert {line["decision"] for line in lines if line["complete"]} == {"ok"}


def test_times_are_those_of_the_rows_also_after_a_pause_and_a_clock_that_jumps_back(monitored):
    rows = [*measured(1000, 2000), *measured(3602, 2000), *measured(2000, 2000)]
    status, lines, _ = monitored(rows)
    readings = intervals(lines)
    assert status == 3
    assert readings[:2] == [(1000, 1001, True), (1001, 1002, True)]
    assert [int(start) for start, _, _ in readings] == [1000, 1001, 3602, 3603, 2000, 2001]
    errors = [line["error"] for line in lines if line["error"]]
    assert ["gap of 2600" in errors[0], "not increase" in errors[1], len(errors)] == [True, True, 2]


def test_a_row_without_a_line_end_is_used_when_it_is_complete(monitored, tmp_path):
    rows, state = measured(0, 1501), ("--state", str(tmp_path / "state"))
    _, lines, _ = monitored([*rows[:-1], rows[-1][:7]], *state)
    assert intervals(lines)[-1] == (1, 1.5, False)
    status, lines, _ = monitored(rows, *state)
    assert (status, intervals(lines)) == (0, [(1, 1.501, False)])


def test_a_reading_that_a_bad_row_shortens_gives_no_alarm(monitored):
    rows = measured(0, 2000)
    rows[1450] = "sensor,error,\n"
    _, lines, _ = monitored(rows, every="1.4")
    assert [line["complete"] for line in lines if not line["error"]] == [True, False]
    assert lines[-1]["alarms"] == []


def test_a_state_on_a_full_disk_is_named_and_one_that_is_used_or_is_none_is_refused(
    monitored, tmp_path
):
    state = tmp_path / "my.state"
    monitored(measured(0, 500))
    with full_disk():
        status, _, err = monitored(None, "--state", str(state))
    assert (status, "my.state" in err, list(tmp_path.glob("*state*"))) == (2, True, [])
    with locked(state):
        status, _, err = monitored(None, "--state", str(state))
    assert (status, "used by another process" in err) == (2, True)
    state.write_text("time,vib")
    status, _, err = monitored(None, "--state", str(state))
    assert (status, "no state of OrderMonitor" in err, "pickle" in err) == (2, True, False)
    assert state.read_text() == "time,vib"
