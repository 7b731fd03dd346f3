"""Defects of histories, monitors and commands that were found in use, one test for each."""

import json
import os
import re
import shutil
import sqlite3
import sys
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest
from order_models import order_bins
from sklearn.compose import ColumnTransformer
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline

from emacm import (
    CostSensitiveGaussianBayes,
    EmacmWarning,
    LeastRiskClassifier,
    OrderMonitor,
    OrderPSD,
    OrderResampler,
    Recording,
    SignalBaseline,
    save_model,
)
from emacm.__main__ import main
from emacm.decisions.pipelines import groups_options
from emacm.history.records import record_of
from emacm.history.sinks import MqttSink, PrometheusFile, sink_of
from emacm.history.sqlite_history import History

LAYOUT = 'fs = 1000\nvelocity = "90 rad/s"\nmeta = "{unit}_{state}_{run}"\n'
TRAIN = ["train", "layout.toml", "files", "--labels", "state", "--groups", "unit", "--out", "m"]
AGAIN = [*TRAIN[:2], "h.db", *TRAIN[3:], "--like", "model", "--healthy", "ok"]
SCORE = ["score", "model", "files", "--layout", "layout.toml"]
SPEED = ["--layout", "layout.toml", "--max-speed", "100 rad/s", "--idle", "0", "--healthy", "ok"]
RULE = ["--alarm-after", "2/3", "--clear-after", "2", "--every", "1", "--unit", "s"]


def rows_of(worn, seed, n=1000):
    return (1 + worn) * np.random.default_rng(seed).normal(size=n)


def saved(classifier, path):
    X = [Recording({"vib": rows_of(k % 2, k)}, 1000, velocity=90.0) for k in range(12)]
    model = order_bins(classifier, samples=24, revolutions=2, max_order=6)
    save_model(model.fit(X, ["ok", "worn"] * 6, **groups_options(model, range(12))), path)


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Write files of three units, a layout, a model, and rows of a stream."""
    pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
    folder = tmp_path_factory.mktemp("bench")
    (folder / "files").mkdir()
    for k in range(12):
        path = folder / f"files/U{k // 4}_{('ok', 'worn')[k % 2]}_{k}.csv"
        np.savetxt(path, rows_of(k % 2, k), header="vib", comments="")
    (folder / "layout.toml").write_text(LAYOUT)
    saved(CostSensitiveGaussianBayes(covariance="diag"), folder / "model")
    rows = [rows_of(0 < k < 5, 100 + k) for k in range(9)]
    np.savetxt(folder / "stream.csv", np.concatenate(rows), header="vib", comments="")
    return folder


@pytest.fixture
def scored(here, bench):
    """Stand there beside a history of its files, with their features."""
    known = bench / "known.db"
    if not known.exists():
        assert main([*SCORE, "--out", "h.db", "--features"]) == 0
        with closing(sqlite3.connect("h.db")) as base:
            base.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        shutil.copy("h.db", known)
    shutil.copy(known, "h.db")


def monitored(*options, source="stream.csv"):
    return main(["monitor", "model", str(source), *SPEED, *RULE, *map(str, options)])


# Commands


def test_training_states_the_orders_of_the_files_or_follows_the_parts(here, capsys):
    options = ["--healthy", "ok", "--revolutions", "4"]
    assert main([*TRAIN, *options]) == 0
    printed = capsys.readouterr().out
    assert re.search(r"orders up to 20 \(the files support 27\.9\)", printed)
    Path("parts.toml").write_text("[orders]\nmesh = 5.5\nmotor = 0.2\n")
    assert main([*TRAIN, *options, "--parts", "parts.toml"]) == 0
    assert "orders up to 22 (the files support 27.9)" in capsys.readouterr().out
    Path("slow.toml").write_text("[orders]\nslow = 0.09\n")
    bearing = [*TRAIN, *options, "--recipe", "bearing", "--parts", "slow.toml", "--revolutions"]
    assert main([*bearing, "10"]) == 2
    (needed,) = re.findall(r"--revolutions, to (\d+)", capsys.readouterr().err)
    main([*bearing, needed])
    assert "first line" not in capsys.readouterr().err


def test_a_decision_of_fail_on_is_status_1_also_if_files_failed(here, capsys):
    Path("files/U9_ok_9.csv").write_text("vib\n")
    assert main([*SCORE, "--fail-on", "worn"]) == 1
    with pytest.raises(SystemExit):
        main(["score", "--help"])
    assert "was made, even if files failed" in " ".join(capsys.readouterr().out.split())


def test_messages_state_what_the_layout_lacks_and_how_many_alarms_to_expect(here, capsys):
    Path("layout.toml").write_text('fs = 1000\nvelocity = "90 rad/s"\n')
    assert main([*TRAIN, "--healthy", "ok"]) == 2
    assert "does not say which part of the file name" in capsys.readouterr().err
    saved(CostSensitiveGaussianBayes(covariance="diag", temperature="groups"), "model")
    capsys.readouterr()
    monitored()
    stated = r"expect [\d.,]+ false alarms in 1000 h \([^a-z]+ to [^a-z]+\); for 1 in 1000 h train"
    assert re.search(stated, capsys.readouterr().err)


# Histories


END = "2026-03-01T12:00:{:02d}.000Z"


def changed(state, second, since=1, **others):
    """Return a record with an alarm that changes its state."""
    end, unit = END.format(second), others.pop("unit", "a")
    alarm = {"id": "0f", "unit": unit, "channel": "", "kind": "decision", "severity": "alarm"}
    alarm |= {"state": state, "since": END.format(since), "time": end, "by": "", "text": "worn"}
    found = {"decision": "worn", "alarms": [alarm], "end": end} | others
    return record_of(found, unit=unit, recording=f"{second}.csv")


@pytest.mark.parametrize("now", ["2026-03-01T14:00:00.000Z", "2028-01-01T00:00:00.000Z", END[:11]])
@pytest.mark.parametrize("state", ["acknowledged", "suppressed"])
def test_the_states_of_an_alarm_do_not_depend_on_clocks(tmp_path, now, state):
    raised, cleared = changed("raised", 1), changed("cleared", 5)
    history = History(tmp_path / "h.db")
    history.write(raised)
    history.set_state("0f", state, by="Ada", time=now)
    for record, expected in ((raised, state), (cleared, "cleared"), (raised, "cleared")):
        history.write(record)
        (alarm,) = history.alarms()
        assert (alarm["state"], alarm["by"]) == (expected, "Ada")
    history.write(raised | {"id": "an hour later, when clocks were set back"})
    (alarm,) = history.alarms(open_only=True)
    assert (alarm["state"], alarm["by"]) == ("raised", "")
    history.close()


def test_features_that_are_asked_for_later_are_computed(here):
    assert main([*SCORE, "--out", "h.db"]) == 0
    for _ in range(2):  # also those that a kill left out
        assert main([*SCORE, "--out", "h.db", "--features"]) == 0
        with closing(sqlite3.connect("h.db")) as base, base:
            assert base.execute("SELECT count(*) FROM features").fetchone() == (12,)
            base.execute("DELETE FROM features WHERE rowid = 3")
    assert main([*SCORE, "--out", "h.db", "--features"]) == 0
    assert main(AGAIN) == 0


DAMAGES = [
    "UPDATE records SET record = '{'",
    "UPDATE records SET record = '{}'",
    "UPDATE records SET record = NULL",
    'UPDATE features SET "values" = zeroblob(9)',
    'UPDATE features SET "values" = zeroblob(480) WHERE rowid = 2',
    "UPDATE features SET \"values\" = 'text' WHERE rowid = 2",
    "UPDATE records SET recording = CAST(x'ff' AS TEXT)",
    "ALTER TABLE records ADD COLUMN more",
    "PRAGMA user_version = 2",
    "DROP TABLE features; CREATE TABLE features (id, size)",
]


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_history_or_one_of_another_version_is_named_at_once(scored, capsys, damage):
    with closing(sqlite3.connect("h.db")) as base:
        base.executescript(damage)
    report = ["report", "model", "files/U0_ok_0.csv", *SCORE[3:], "--history", "h.db"]
    prometheus = ["--sink", "h.db", "--sink", "prometheus:a.prom"]
    capsys.readouterr()
    statuses, named = [], []
    for run in (lambda: main(AGAIN), lambda: main(report), lambda: monitored(*prometheus)):
        statuses.append(run())
        named.append("h.db" in capsys.readouterr().err)
    assert 2 in statuses
    assert all(text for status, text in zip(statuses, named, strict=True) if status == 2)


def test_pages_of_a_history_that_are_overwritten_are_named(scored, capsys):
    content = Path("h.db").read_bytes()
    Path("h.db").write_bytes(content[:4096] + b"\xff" * (len(content) - 4096))
    for command in ([*SCORE, "--out", "h.db"], ["alarms", "h.db"]):
        capsys.readouterr()
        assert main(command) == 2
        assert "h.db cannot be" in capsys.readouterr().err


def test_a_record_is_noted_as_unsent_while_it_is_written(tmp_path):
    pytest.importorskip("paho.mqtt", reason="extra 'mqtt'")
    history, url = History(tmp_path / "h.db"), "mqtt://127.0.0.1:9/plant"
    sink, record = MqttSink(url, history, patience=0), changed("raised", 1)
    history.write(record)  # and a kill
    assert history.unsent(url) == [record]
    sink._client.loop_stop()
    history.close()


@pytest.mark.parametrize("other", ["a\nb", "a%250Ab", "a%0ab", "a%"])
def test_units_whose_names_look_alike_are_other_units(tmp_path, other):
    paths = tmp_path / "a.prom", tmp_path / "points.txt"
    for kind, path in zip(("prometheus", "influx"), paths, strict=True):
        sink = sink_of(f"{kind}:{path}")
        for unit in ("a%0Ab", other):
            sink.write(changed("raised", 1, unit=unit))
        sink.close()
        assert len(set(re.findall(r'unit="?([^,"} ]*)', path.read_text()))) == 2


# Monitors


def test_two_monitors_may_write_one_file_of_prometheus(tmp_path):
    path = tmp_path / "a.prom"
    first, second = PrometheusFile(str(path)), PrometheusFile(str(path))
    for sink, unit in ((first, "a"), (second, 'b"}'), (first, "a"), (second, "c\u2028")):
        sink.write(changed("raised", 1, unit=unit))
    PrometheusFile(str(path)).write(changed("cleared", 2, unit="a"))
    lines = path.read_text().split("\n")
    assert sum(line.startswith("emacm_decision{") for line in lines) == 3
    assert 'emacm_open_alarms{unit="a"} 0.0' in lines
    assert [each.name for each in tmp_path.iterdir()] == ["a.prom"]


@contextmanager
def killed(monkeypatch, name, number):
    """Interrupt the process before it puts a file of this name in place, the n-th time."""
    replace, seen = os.replace, []

    def stop(source, target):
        seen.extend([target] if re.search(name, str(target)) else [])
        if len(seen) == number:
            raise KeyboardInterrupt
        replace(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", stop)
        yield


@pytest.mark.parametrize(
    "times", [("--every", "1"), ("--every", "11", "--unit", "revolutions", "--start", "2026-03-01")]
)
def test_a_kill_neither_loses_nor_doubles_the_signals_of_an_alarm(here, monkeypatch, times):
    options = [*times, "--keep-alarms", "2"]

    def run(folder):
        more = ["--evidence", folder, "--state", f"{folder}.state", "--sink", f"{folder}.db"]
        return monitored(*options, *more)

    assert run("whole") == 0
    expected = {path.name: path.read_bytes() for path in Path("whole").glob("*.csv")}
    assert len(expected) == 2
    for name, number in (("csv", 1), ("csv", 2), ("json", 1), ("state", 2), ("state", 3)):
        folder = f"{name}{number}"
        with killed(monkeypatch, rf"{name}$", number):
            assert run(folder) == 130
        assert run(folder) == 0
        found = {path.name: path.read_bytes() for path in Path(folder).glob("*.csv")}
        assert found == expected
        assert len([*Path(folder).glob("*.json")]) == 2
        with closing(History(f"{folder}.db")) as history:
            assert [alarm["state"] for alarm in history.alarms()] == ["cleared"]


@pytest.mark.parametrize("back", [0.6, 3600.0])
def test_an_alarm_and_its_signals_are_known_after_the_clock_was_set_back(here, capsys, back):
    Path("layout.toml").write_text('velocity = "90 rad/s"\n')
    rows = np.loadtxt("stream.csv", skiprows=1)
    times = 5000 + np.arange(9000) / 1000 - back * (np.arange(9000) >= 1000)
    table = np.column_stack([times, rows])
    np.savetxt("stream.csv", table, "%.3f", ",", header="time,vib", comments="")
    assert monitored("--keep-alarms", "2") == 3
    records = map(json.loads, capsys.readouterr().out.splitlines())
    changes = [change["state"] for record in records for change in record["alarms"]]
    assert changes == ["raised", "cleared"]
    kept = [path.read_text().count("\n") for path in Path("evidence").glob("*.csv")]
    assert kept == [1001, 1001]


def test_signals_that_cannot_be_written_are_tried_again(here, monkeypatch, capsys):
    Path("file").touch()
    assert monitored("--keep-alarms", "1", "--evidence", "file") == 2
    assert "'file'" in capsys.readouterr().err
    replace, full = os.replace, [OSError(28, "No space left on device")]

    def full_disk(source, target):
        if full and str(target).endswith(".csv"):
            raise full.pop()
        replace(source, target)

    monkeypatch.setattr(os, "replace", full_disk)
    with pytest.warns(EmacmWarning, match="No space left.* tried again"):
        assert monitored("--keep-alarms", "1") == 0
    assert len([*Path("evidence").iterdir()]) == 2


@pytest.mark.parametrize("row", ["\0\0\0\0", "1\0002", "\0" * 5000, "1\r2"])
def test_a_row_that_was_not_written_whole_is_skipped_for_this_reason(here, capsys, row):
    lines = Path("stream.csv").read_text().split("\n")
    lines[2345] = row
    Path("stream.csv").write_text("\n".join(lines), newline="")
    assert monitored() == 3
    records = map(json.loads, capsys.readouterr().out.splitlines())
    (error,) = [record["error"] for record in records if record["error"]]
    assert re.search("bytes 0, .*The 100 rows after 2.3 s are skipped", error)


@pytest.mark.skipif(sys.platform != "linux", reason="names are UTF-8")
def test_names_in_latin_1_are_written_to_a_history(here):
    stream = Path(os.fsdecode(b"pr\xfcfstand.csv"))
    Path("stream.csv").rename(stream)
    assert monitored("--sink", "h.db", source=stream) == 0
    assert monitored("--sink", "h.db", "--name", os.fsdecode(b"\xe9"), source=stream) == 0
    with closing(History("h.db")) as history:
        assert len(history.records(r"pr\xfcfstand")) == 9 == len(history.records(r"\xe9"))
        history.write(changed("raised", 1, unit="\udcff"))
        assert len(history.records("\udcff")) == 1


def test_a_masked_y_and_an_empty_list_of_recordings_are_refused():
    X, y = np.arange(8.0)[:, None], np.ma.array([0, 1] * 4, mask=[1] + [0] * 7)
    for model in (CostSensitiveGaussianBayes(), LeastRiskClassifier(LogisticRegression())):
        with pytest.raises(TypeError, match="y has masked"):
            model.fit(X, y)
    runs = [Recording({"vib": rows_of(0, 0)}, 1000, velocity=90.0, meta={"load": 1})]
    baseline = SignalBaseline(condition="load", healthy="ok", baseline_recordings=[])
    with pytest.raises(ValueError, match="baseline_recordings is empty"):
        make_pipeline(OrderResampler(), baseline).fit(runs, ["ok"])


def test_a_model_without_left_out_decisions_states_that_a_rule_is_to_be_chosen(here, capsys):
    saved(LeastRiskClassifier(LogisticRegression()), "model")
    monitored()
    assert re.search("this model are not known: --alarm-after", capsys.readouterr().err)


def test_a_monitor_gives_a_column_transformer_the_names_that_it_was_fitted_to():
    X = [Recording({"vib": rows_of(k % 2, k)}, 1000, velocity=90.0) for k in range(8)]
    steps = OrderResampler(2 * np.pi / 24), OrderPSD(2).set_output(transform="pandas")
    names = [f"vib@{order / 2:g}" for order in range(9)]
    chosen = ColumnTransformer([("low", "passthrough", names)])
    model = make_pipeline(*steps, chosen, LogisticRegression()).fit(X, [0, 1] * 4)
    monitor = OrderMonitor(model, fs=1000, channels=["vib"], max_speed=100)
    monitor.push([X[0].signals["vib"]], velocity=np.full(1000, 90.0))
    (reading,) = monitor.flush()
    np.testing.assert_allclose(reading.features, model[:-1].transform(X[:1])[0], rtol=1e-12)
