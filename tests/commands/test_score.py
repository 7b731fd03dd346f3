"""The command score: one row for each file, an exit status, and a table that can be continued."""

import io
import json
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands.worn_files import save_trained, write

from emacm.__main__ import main
from emacm.commands import score as command
from emacm.history.records import SCHEMA
from emacm.reports.inputs import read_results

pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
ROOT = Path(__file__).parents[2]
LAYOUT = 'fs = 1000\nvelocity = "speed"\nmeta = "{state}_{run:d}"\n[units]\nspeed = "rpm"\n'


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench")
    (folder / "files").mkdir()
    for number in range(12):
        worn = number % 3 == 2
        write(folder / "files" / f"{'worn' if worn else 'ok'}_{number:02d}.npz", worn, number)
    (folder / "layout.toml").write_text(LAYOUT)
    save_trained(folder, "files", {("ok", "worn"): 5})
    return folder


def run(*arguments, paths=("files",)):
    return main(["score", "model.emacm", *paths, "--layout", "layout.toml", *arguments])


def test_a_pattern_chooses_files_of_folders(here, capsys):
    assert run("--pattern", "worn_*.npz", "--fail-on", "worn") == 1
    rows = capsys.readouterr().out.splitlines()[1:]
    assert [row.split(",")[0] for row in rows] == [
        f"files/worn_{number}.npz" for number in ("02", "05", "08", "11")
    ]
    assert run("--pattern", "*.wav") == 2
    assert "matches '*.wav'" in capsys.readouterr().err


@pytest.mark.parametrize("suffix", [".csv", ".jsonl", ".sqlite"])
def test_tables_of_all_types_hold_the_same_rows(here, capsys, suffix):
    (here / "files" / "bad_7.npz").write_bytes(b"PK")
    assert run("--out", f"table{suffix}", "--jobs", "2") == 3
    printed = capsys.readouterr().out
    assert printed == f"13 files: 8 ok, 4 worn, 1 failed. Table: table{suffix}\n"
    assert run("--out", "other.csv") == 3
    first, other = (
        read_results(Path(name)).sort_values("recording").reset_index()
        for name in (f"table{suffix}", "other.csv")
    )
    for name in ("recording", "decision", "error"):
        assert first[name].fillna("").tolist() == other[name].fillna("").tolist()
    known = first["error"] == ""
    first, other = (table["P(worn)"][known].astype(float) for table in (first, other))
    np.testing.assert_allclose(first, other, rtol=1e-14)


def test_a_record_states_unit_times_and_where_they_are_from(here):
    schema = pytest.importorskip("jsonschema", reason="jsonschema is not installed (extra 'test')")
    Path("files/bad_7.npz").write_bytes(b"PK")
    for path in Path("files").iterdir():
        os.utime(path, (1_800_000_000, 1_800_000_000))
    assert run("--out", "table.jsonl", "--unit", "run") == 3
    records = [json.loads(line) for line in Path("table.jsonl").read_text().splitlines()]
    for record in records:
        schema.Draft202012Validator(SCHEMA).validate(record)
    (first,) = (record for record in records if record["recording"] == "files/ok_00.npz")
    times = ("2027-01-15T07:59:58.000Z", "2027-01-15T08:00:00.000Z", "modified")
    assert (first["unit"], first["start"], first["end"], first["times"]) == ("0", *times)


# The exit status


def test_an_alarm_is_status_1(here):
    for state, status in (("worn", 0), ("ok", 1)):
        assert run("--fail-on", state, paths=["files/ok_00.npz"]) == status


def test_a_failed_file_is_status_3_and_the_table_is_complete(here, capsys):
    assert run(paths=["files/ok_00.npz", "files/none.npz", "files/worn_02.npz"]) == 3
    printed = pd.read_csv(io.StringIO(capsys.readouterr().out))
    assert printed["decision"].fillna("-").tolist() == ["ok", "-", "worn"]
    assert "no file" in printed["error"][1]


@pytest.mark.parametrize(
    ("arguments", "paths", "message"),
    [
        (["--fail-on", "old"], ["files"], "--fail-on names 'old'; the decisions are ['ok', "),
        (["--out", "table.xlsx"], ["files"], "must end with one of .csv, .jsonl"),
        (["--priors", "ok"], ["files"], "--priors must be 'uniform' or as in"),
        (["--priors", "ok=0.5"], ["files"], "priors"),
        (["--priors", "ok=0.5,ok=0.2,worn=0.8"], ["files"], "--priors must be"),
        (["--jobs", "0"], ["files"], "a whole number of at least 1, or -1, got '0'"),
        (["--unit", "unt"], ["files"], "has no 'unt', only ["),
        (["--cost", "none.csv"], ["files"], "none.csv"),
        (["--features"], ["files"], "--features needs --out FILE.sqlite"),
        (["--watch", "-1"], ["files"], "--watch: expected a number above 0"),
        ([], ["empty"], "has no file that matches"),
    ],
)
def test_an_invalid_command_is_status_2_and_one_line(here, capsys, arguments, paths, message):
    (here / "empty").mkdir()
    assert run(*arguments, paths=paths) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.err.count("\n") == 1


@pytest.mark.parametrize("name", ["model.emacm", "layout.toml"])
def test_a_bad_model_or_layout_is_status_2(here, capsys, name):
    (here / name).write_text("none")
    assert run() == 2
    assert name in capsys.readouterr().err


# Costs and priors


def test_costs_and_priors_are_those_of_the_command(here, capsys):
    Path("cost.csv").write_text(",ok,worn\nok,0,0\nworn,2,1\n")
    assert run("--cost", "cost.csv", "--priors", "ok=0.999999,worn=0.000001") == 0
    printed = capsys.readouterr()
    assert (pd.read_csv(io.StringIO(printed.out))["decision"] == "ok").all()
    assert "cost.csv: if 'worn' is true, deciding 'ok' costs 0, the right decision 1" in printed.err
    Path("cost.csv").write_text("decision;ok;worn\nok;0;10,5\n")
    assert run("--cost", "cost.csv") == 0
    text = "cost.csv: it has no row for the decision 'worn', which is then never made"
    assert text in capsys.readouterr().err
    Path("cost.csv").write_text("decision,ok,worn\nok,0,10\nany fault,1,0\n")  # families
    assert run("--cost", "cost.csv") == 0
    assert "WARNING: cost.csv" not in capsys.readouterr().err


# Continued tables


def counted(monkeypatch):
    scored = []
    original = command.scored_rows

    def spy(model, sources, names, n_jobs, **options):
        scored.extend(names)
        return original(model, sources, names, n_jobs, **options)

    monkeypatch.setattr(command, "scored_rows", spy)
    return scored


@pytest.mark.parametrize("suffix", [".csv", ".jsonl", ".sqlite"])
def test_only_new_changed_and_failed_files_are_decided_on_again(here, monkeypatch, suffix):
    table = Path(f"table{suffix}")
    (here / "files" / "bad_7.npz").write_bytes(b"PK")
    assert run("--out", str(table)) == 3
    first = read_results(table)
    scored = counted(monkeypatch)
    assert run("--out", str(table)) == 3
    assert scored == ["files/bad_7.npz"]
    pd.testing.assert_frame_equal(read_results(table), first)
    scored.clear()
    write(here / "files" / "bad_7.npz", True, 70)
    write(here / "files" / "new_8.npz", False, 80)
    write(here / "files" / "ok_03.npz", True, 90)
    assert run("--out", str(table)) == 0
    assert scored == ["files/bad_7.npz", "files/new_8.npz", "files/ok_03.npz"]
    replaced = suffix != ".sqlite"  # a history keeps what was decided on an earlier content
    assert len(read_results(table)) == (14 if replaced else 16)
    scored.clear()
    assert run("--out", str(table), "--again") == 0
    assert len(scored) == 14
    scored.clear()
    assert run("--out", str(table), "--priors", "uniform") == 0
    assert len(scored) == 14  # other priors, other results


def test_a_killed_run_is_continued_and_ends_with_the_same_table(here, monkeypatch):
    assert run("--out", "whole.csv") == 0
    lines = Path("whole.csv").read_text().splitlines(keepends=True)
    Path("table.csv").write_text("".join(lines[:6]) + lines[6][:30])
    scored = counted(monkeypatch)
    assert run("--out", "table.csv") == 0
    assert len(scored) == 7
    assert Path("table.csv").read_text() == "".join(lines)


def test_a_table_with_other_columns_is_refused(here, capsys):
    Path("table.csv").write_text("file,state\na,ok\n")
    assert run("--out", "table.csv") == 2
    assert "its columns are" in capsys.readouterr().err
    assert Path("table.csv").read_text() == "file,state\na,ok\n"


def test_watching_decides_on_files_as_they_come(here, monkeypatch):
    def sleep(seconds):
        assert seconds == 7
        if len(Path("table.jsonl").read_text().splitlines()) == 13:
            raise KeyboardInterrupt
        write(here / "files" / "new_9.npz", True, 9)
        os.utime(here / "files" / "new_9.npz", (1, 1))

    for path in (here / "files").iterdir():
        os.utime(path, (1, 1))
    monkeypatch.setattr(command.time, "sleep", sleep)
    assert run("--out", "table.jsonl", "--watch", "7") == 130
    rows = [json.loads(line) for line in Path("table.jsonl").read_text().splitlines()]
    assert [row["decision"] for row in rows if row["recording"] == "files/new_9.npz"] == ["worn"]


def test_a_misspelt_time_is_in_the_row_of_each_file(here, capsys):
    assert run("--time", "day") == 3
    assert capsys.readouterr().out.count("its meta has no 'day' (--time)") == 12
