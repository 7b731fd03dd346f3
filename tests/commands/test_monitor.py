"""The command monitor: readings of a text that is written while it is read."""

import io
import json
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from commands.worn_files import signals
from order_models import order_bins

from emacm import CostSensitiveGaussianBayes, Layout, load_model, open_recording, save_model
from emacm.__main__ import main
from emacm.commands import monitor as command
from emacm.history.records import SCHEMA
from emacm.history.sqlite_history import History

pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
LAYOUT = 'fs = 1000\nvelocity = "speed"\n[units]\nspeed = "rpm"\n'
N = 6000


def rows_of(worn, seed, n=N):
    rows = zip(*signals(worn, seed, n).values(), strict=True)
    return [f"{vib:.17g},{speed:.17g}\n" for vib, speed in rows]


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench")
    (folder / "layout.toml").write_text(LAYOUT)
    X, y = [], []
    for seed in range(12):
        path = folder / f"{seed}.csv"
        path.write_text("vib,speed\n" + "".join(rows_of(seed % 3 == 2, seed, 2000)))
        X.append(open_recording(path, Layout.from_toml(folder / "layout.toml")))
        y.append("worn" if seed % 3 == 2 else "ok")
    options = {"covariance": "diag", "shrinkage": 0.1, "temperature": "groups"}
    bayes = CostSensitiveGaussianBayes({("ok", "worn"): 5}, **options)
    model = order_bins(bayes, samples=24, bin_size=0.5, max_order=9)
    model.fit(X, y, costsensitivegaussianbayes__groups=range(12))
    save_model(model, folder / "model.emacm")
    (folder / "stream.csv").write_text("vib,speed\n" + "".join(rows_of(True, 20)))
    return folder


def run(*arguments, source="stream.csv"):
    options = ["--layout", "layout.toml", "--max-speed", "100 rad/s", *arguments]
    return main(["monitor", "model.emacm", source, *options])


def printed(capsys):
    """Return the records that were printed, all of which are valid, without what the clock says."""
    schema = pytest.importorskip("jsonschema", reason="jsonschema is not installed (extra 'test')")
    validator = schema.Draft202012Validator(SCHEMA)
    records = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    for record in records:
        validator.validate(record)
        if record["times"] == "clock":
            del record["start"], record["end"]
    return records


def alarms_of(records):
    changes = [change for record in records for change in record["alarms"]]
    return [(change["kind"], change["state"], change["time"]) for change in changes]


def test_a_file_gives_the_decision_and_cost_of_its_recording(here, capsys):
    assert run("--idle", "0") == 0
    (reading,) = printed(capsys)
    model = load_model("model.emacm")
    recording = open_recording("stream.csv", Layout.from_toml("layout.toml"))
    assert reading["decision"] == model.predict([recording])[0] == "worn"
    cost = model[-1].risk(model[:-1].transform([recording])).min()
    assert reading["expected_cost"] == pytest.approx(cost)
    assert (reading["stream_start"], reading["stream_end"]) == (0.0, 6.0)
    assert (reading["unit"], reading["recording"]) == ("stream", "stream.csv")


def test_a_position_of_a_screw_behind_a_gear_gives_the_readings_of_the_speed(here, capsys):
    text = LAYOUT.replace('velocity = "speed"', 'angle = {column = "x", lead = 5.0}\nratio = 2.5')
    (here / "screw.toml").write_text(text.replace('speed = "rpm"', ""))
    turned = 90.0 / 2.5 * np.arange(N) / 1000
    rows = [row.split(",")[0] for row in rows_of(True, 20)]
    positions = [f"{vib},{x:.17g}\n" for vib, x in zip(rows, 5 * turned / 2 / np.pi, strict=True)]
    (here / "screw.csv").write_text("vib,x\n" + "".join(positions))
    run("--idle", "0", "--every", "2", "--unit", "s")
    by_speed = printed(capsys)
    options = ("--idle", "0", "--every", "2", "--unit", "s", "--layout", "screw.toml")
    assert run(*options, "--max-speed", "1200", source="screw.csv") == 0
    by_position = printed(capsys)
    costs = [[r["expected_cost"] for r in records] for records in (by_speed, by_position)]
    np.testing.assert_allclose(*costs, rtol=1e-6)
    assert run(*options, "--max-speed", "800", source="screw.csv") == 3  # it turns at 859 rpm
    assert "(859.4 and 800 rpm)" in capsys.readouterr().out
    (here / "screw.toml").write_text('angle = {currents = ["a", "b"], pole_pairs = 2}')
    assert run(*options, source="screw.csv") == 2
    assert "an angle from currents needs whole recordings" in capsys.readouterr().err


def test_the_standard_input_gives_a_reading_for_each_interval(here, capsys, monkeypatch):
    text = io.TextIOWrapper(io.BytesIO((here / "stream.csv").read_bytes()))
    monkeypatch.setattr("sys.stdin", text)
    assert run("--every", "1.5", "--unit", "s", source="-") == 0
    readings = printed(capsys)
    assert [r["stream_end"] for r in readings] == [1.5, 3.0, 4.5, 6.0]
    assert {r["decision"] for r in readings} == {"worn"}


@pytest.mark.slow
def test_a_file_that_grows_is_followed(here):
    path = here / "growing.csv"
    rows = rows_of(False, 30)
    path.write_text("vib,speed\n" + "".join(rows[:1000]))
    options = ["--layout", "layout.toml", "--max-speed", "100 rad/s", "--every", "2", "--unit", "s"]
    arguments = [sys.executable, "-m", "emacm", "monitor", "model.emacm", str(path), *options]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as process:
        for start in range(1000, N, 500):
            with open(path, "a") as file:
                text = "".join(rows[start : start + 500])
                file.write(text[:-30])
                file.flush()
                time.sleep(0.02)
                file.write(text[-30:])
        times = [json.loads(process.stdout.readline())["stream_end"] for _ in range(3)]
        process.terminate()
    assert times == [2.0, 4.0, 6.0]


def test_an_interrupted_run_goes_on_from_its_state(here, capsys, monkeypatch):
    run("--idle", "0", "--every", "20")
    expected = printed(capsys)
    push = command.OrderMonitor.push
    calls = []

    def interrupted(self, *args, **options):
        calls.append(1)
        if len(calls) in (18, 40):
            raise KeyboardInterrupt
        return push(self, *args, **options)

    monkeypatch.setattr(command.OrderMonitor, "push", interrupted)
    found = []
    for status in (130, 130, 0):
        assert run("--idle", "0", "--every", "20", "--state", "here.state") == status
        found += printed(capsys)
    assert len(expected) > 3
    assert list({record["id"]: record for record in found}.values()) == expected


@pytest.mark.parametrize(
    ("row", "message"), [("nothing,1\n", "vib"), ("0.5,9,9\n", "a row does not fit the 2 columns")]
)
def test_invalid_rows_are_reported_with_their_time_and_skipped(here, capsys, row, message):
    rows = rows_of(True, 20)
    rows[2345] = "0.5,88888\n"
    rows[4200] = row
    (here / "bad.csv").write_text("vib,speed\n" + "".join(rows))
    assert run("--idle", "0", source="bad.csv") == 3
    lines = printed(capsys)
    errors = [line for line in lines if line["error"]]
    assert re.search("at 2.345.* above max_speed = 100", errors[0]["error"])
    assert message in errors[1]["error"]
    assert errors[0]["error"].endswith("The 100 rows after 2.3 s are skipped.")
    readings = [line for line in lines if line["decision"]]
    assert [line["decision"] for line in readings] == ["worn"] * 3
    intervals = [(line["stream_start"], line["stream_end"]) for line in readings]
    np.testing.assert_allclose(intervals, [(0, 2.3), (2.4, 4.2), (4.3, 6.0)])


def test_blank_lines_are_no_rows(here, capsys):
    rows = rows_of(True, 20)
    rows[2000:2000] = ["\n"] * 150
    rows[5000:5000] = ["  \n", "\r\n"]
    (here / "blank.csv").write_text("vib,speed\n" + "".join(rows))
    readings = []
    for source in ("blank.csv", "stream.csv"):
        assert run("--idle", "0", "--every", "20", source=source) == 0
        readings.append([(r["stream_end"], r["typicality"]) for r in printed(capsys)])
    assert readings[0] == readings[1]


def test_a_stream_without_rows_is_named(here, capsys):
    (here / "empty.csv").write_text("vib,speed\n")
    assert run("--idle", "0", source="empty.csv") == 2
    assert "empty.csv: it has no rows of numbers" in capsys.readouterr().err
    (here / "wide.csv").write_text("vib,speed\n1,2\n", encoding="utf-16")
    assert run("--idle", "0", source="wide.csv") == 2
    assert "wide.csv: it contains bytes 0: it is binary, or UTF-16" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--max-speed", "-3"), "--max-speed: expected a speed above 0, in rpm or as"),
        (("--state", "x", "-"), "needs a file"),
    ],
)
def test_invalid_arguments_have_status_2(here, capsys, arguments, message):
    source = "-" if "-" in arguments else "stream.csv"
    arguments = [a for a in arguments if a != "-"]
    assert run("--idle", "0", *arguments, source=source) == 2
    assert message in capsys.readouterr().err


def test_a_state_that_is_damaged_or_of_another_file_is_refused(here, capsys):
    state = here / "other.state"
    run("--idle", "0", "--state", str(state))
    content = state.read_bytes()
    (here / "another.csv").write_text("vib,speed\n" + "".join(rows_of(True, 21)))
    short = (here / "stream.csv").read_text().splitlines(keepends=True)[:500]
    (here / "short.csv").write_text("".join(short))
    capsys.readouterr()
    cases = [
        ("stream.csv", content[:-50], "no state of"),
        ("stream.csv", content[:3000], "no state of"),
        ("stream.csv", b"", "no state of"),
        ("another.csv", content, "written for another file, "),
        ("short.csv", content, "written for another file, "),
    ]
    for source, written, message in cases:
        state.write_bytes(written)
        assert run("--idle", "0", "--state", str(state), source=source) == 2
        error = " ".join(capsys.readouterr().err.split())
        assert message in error
        assert "without which the file is read from its beginning" in error


ALARMS = ("--healthy", "ok", "--every", "1", "--unit", "s", "--start", "2026-03-01T10:00+01:00")
RULE = ("--alarm-after", "2/3", "--clear-after", "2")


def at(second):
    return f"2026-03-01T09:00:{second:02}.000Z"


def test_an_alarm_is_told_when_it_is_raised_and_when_it_is_cleared(here, capsys):
    rows = [*rows_of(False, 40), *rows_of(True, 41), *rows_of(False, 42)]
    (here / "worn.csv").write_text("vib,speed\n" + "".join(rows))
    options = ("--idle", "0", "--name", "pump 3", "--sink", "worn.sqlite", *ALARMS, *RULE)
    assert run(*options, source="worn.csv") == 0
    records = printed(capsys)
    assert {(record["unit"], record["times"]) for record in records} == {("pump 3", "stated")}
    changes = [("decision", "raised", at(8)), ("decision", "cleared", at(14))]
    assert alarms_of(records) == changes
    history = History("worn.sqlite")
    assert history.records() == [*records]
    (alarm,) = history.alarms()
    assert (alarm["state"], alarm["since"], alarm["time"]) == ("cleared", at(8), at(14))


@pytest.mark.parametrize("option", [("--min-speed", "910"), ("--quiet", "30")])
def test_there_are_no_alarms_of_a_slow_shaft_and_just_after_its_start(here, capsys, option):
    assert run("--idle", "0", *ALARMS, *RULE, *option) == 0
    records = printed(capsys)
    assert {record["decision"] for record in records} == {"worn"}
    assert alarms_of(records) == []


def test_a_single_healthy_reading_raises_no_alarm(here, capsys):
    (here / "fine.csv").write_text("vib,speed\n" + "".join(rows_of(False, 21)))
    assert run("--idle", "0", "--healthy", "ok", source="fine.csv") == 0
    (record,) = printed(capsys)
    assert (record["decision"], record["alarms"]) == ("ok", [])


@pytest.mark.slow
def test_a_killed_run_loses_no_record_and_no_change_of_an_alarm(here, capsys):
    rows = [*rows_of(False, 40, 2000), *rows_of(True, 41, 2000), *rows_of(False, 42, 2000)]
    (here / "killed.csv").write_text("vib,speed\n" + "".join(rows))
    options = [*ALARMS, *RULE, "--every", "0.1", "--sink", "killed.sqlite", "--state", "k.state"]
    arguments = ["--layout", "layout.toml", "--max-speed", "100 rad/s", "--idle", "0", *options]
    command = [sys.executable, "-m", "emacm", "monitor", "model.emacm", "killed.csv", *arguments]
    lines = []
    for pause in (0.0, 0.02):  # killed at two places after its first record, and then not
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            lines.append(process.stdout.readline())
            time.sleep(pause)
            process.kill()
            lines += process.stdout.readlines()
    run("--idle", "0", *options, source="killed.csv")
    records = [*map(json.loads, filter(str.strip, lines)), *printed(capsys)]
    seen = {record["id"]: record for record in records}
    run("--idle", "0", *ALARMS, *RULE, "--every", "0.1", source="killed.csv")
    expected = {record["id"]: record for record in printed(capsys) if record["complete"]}
    assert len(expected) == 60
    assert {key: record for key, record in seen.items() if record["complete"]} == expected
    assert {record["id"]: record for record in History("killed.sqlite").records()} == seen


def test_an_alarm_is_acknowledged_by_a_person_and_stays_so(here, capsys):
    options = ("--idle", "0", "--sink", "known.sqlite", *ALARMS, *RULE)
    run(*options)
    capsys.readouterr()
    assert main(["alarms", "known.sqlite"]) == 1
    (alarm,) = History("known.sqlite").alarms()
    assert re.search("decision +alarm +raised", capsys.readouterr().out)
    acknowledge = ["alarms", "known.sqlite", "--ack", alarm["id"]]
    assert main(acknowledge) == 2
    assert main([*acknowledge, "--by", "Ada"]) == 0
    run(*options)  # the same records again
    (alarm,) = History("known.sqlite").alarms()
    assert (alarm["state"], alarm["by"]) == ("acknowledged", "Ada")
    assert main(["alarms", "known.sqlite", "--suppress", "0f", "--by", "Ada"]) == 2
    assert "no open alarm '0f'" in capsys.readouterr().err


def test_the_page_of_the_fleet_is_kept_up_to_date(here, capsys):
    pytest.importorskip("jinja2", reason="jinja2 is not installed (extra 'report')")
    options = ("--idle", "0", "--page", "page", *ALARMS, *RULE)
    assert run(*options) == 2
    assert "--page needs a history" in capsys.readouterr().err
    assert run(*options, "--sink", "paged.sqlite", "--name", "pump 7") == 0
    page = (here / "page" / "fleet.html").read_text()
    assert re.search(">pump 7</a>.*>alarm</strong>, unit, decision: worn, raised", page, re.DOTALL)


def test_the_schema_is_printed(capsys):
    assert main(["schema"]) == 0
    assert json.loads(capsys.readouterr().out) == SCHEMA


@pytest.mark.slow
@pytest.mark.parametrize("every", [("1", "s"), ("15", "revolutions")])
def test_the_signals_before_an_alarm_are_decided_on_again_bit_for_bit(here, capsys, every):
    rows = [*rows_of(False, 40), *rows_of(True, 41)]
    (here / "kept.csv").write_text("vib,speed\n" + "".join(rows))
    folder = here / every[1]
    options = ("--idle", "0", *ALARMS, *RULE, "--keep-alarms", "4", "--evidence", str(folder))
    run(*options, "--every", every[0], "--unit", every[1], source="kept.csv")
    streamed = {record["id"]: record for record in printed(capsys)}
    table = str(here / f"{every[1]}.jsonl")
    options = ["--layout", "layout.toml", "--out", table]
    assert main(["score", "model.emacm", str(folder), *options]) == 0
    scored = list(map(json.loads, Path(table).read_text().splitlines()))
    assert [found["decision"] for found in scored] == ["ok", "ok", "worn", "worn"]
    for path, found in zip(sorted(folder.glob("*.json")), scored, strict=True):
        record = json.loads(path.read_text())
        for name in ("decision", "expected_cost", "P(ok)", "P(worn)", "model"):
            assert record[name] == found[name]
            assert record[name] == pytest.approx(streamed[record["id"]][name])
