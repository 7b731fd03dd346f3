"""The command trend: from a folder of healthy files and one of new files to a trend per unit."""

import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from emacm import Layout
from emacm.__main__ import main
from emacm.commands.trend import _most_urgent
from emacm.reports.inputs import units_and_times

LAYOUT = 'fs = 1000\nvelocity = "speed"\nmeta = "{unit}_{day:d}"\n[units]\nspeed = "rpm"\n'
N = 1500


def write(path, seed, wear=0.0, n=N):
    rng = np.random.default_rng(seed)
    angle = 90.0 * np.arange(n) / 1000
    vib = rng.normal(size=n) + wear * np.sin(3.3 * angle)
    np.savez(path, vib=vib, speed=np.full(n, 90 * 30 / np.pi))


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("layout.toml").write_text(LAYOUT)
    for folder, days in (("healthy", 6), ("nights", 4)):
        Path(folder).mkdir()
        for unit in ("press", "axis"):
            for day in range(days):
                wear = 0.4 * day if (folder, unit) == ("nights", "press") else 0.0
                first = 100 if folder == "nights" else 0
                seed = first + day + (50 if unit == "axis" else 0)
                write(Path(folder) / f"{unit}_{day}.npz", seed, wear)


def run(*arguments):
    fixed = ["--layout", "layout.toml", "--groups", "day", "--unit", "unit", "--time", "day"]
    return main(["trend", "healthy", "nights", *fixed, "--false-alarm", "0.1", *arguments])


def test_indicators_of_a_sine_stand_beside_the_index(here, capsys):
    text = LAYOUT.replace("fs = 1000", "fs = 2000") + 'vib = "m/s2"\n'
    Path("layout.toml").write_text(text)
    sine = 3 * np.sin(2 * np.pi * 25 * np.arange(4000) / 2000)
    np.savez("nights/new_1.npz", vib=sine, speed=np.full(4000, 90 * 30 / np.pi))
    assert run("--machine", "class I") == 0
    row = pd.read_csv(io.StringIO(capsys.readouterr().out)).query("unit == 'new'").iloc[0]
    mm_s = 3000 / (2 * np.pi * 25) / np.sqrt(2)
    expected = {"rms": 3 / 2**0.5, "crest_factor": 2**0.5, "kurtosis": 1.5, "velocity [mm/s]": mm_s}
    for name, value in expected.items():
        assert row[f"vib:{name}"] == pytest.approx(value, rel=0.005)
    assert row["vib:zone"] == "D"


def test_a_picture_is_drawn(here):
    pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra 'plot')")
    assert run("--out", "trend.csv", "--plot", "trend.png") == 0
    assert Path("trend.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--groups", "run"], "has no meta key 'run'"),
        (["--groups", "unit"], "Take smaller groups, as runs"),
        (["--machine", "big"], "machine_class must be one of"),
        (["--time", "hour"], "its meta has no 'hour'"),
    ],
)
def test_an_invalid_command_is_status_2_and_one_line(here, capsys, arguments, message):
    assert run(*arguments) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.err.count("\n") == 1


def test_times_are_those_that_the_files_state(tmp_path):
    rows = "time,b\n2026-11-0{}T08:01:00,1\n2026-11-0{}T08:01:01,2\n"
    for day in (1, 2):
        (tmp_path / f"dated_{3 - day}.csv").write_text(rows.format(day, day))
    (tmp_path / "undated.csv").write_text("time,b\n0,1\n1,2\n")
    (tmp_path / "damaged.csv").write_text("time")
    names = ("dated_1", "dated_2", "undated", "damaged")
    paths = [tmp_path / f"{name}.csv" for name in names]
    _, times = units_and_times(paths, Layout(velocity=3.0), None, None)
    assert times[:2] == [pd.Timestamp("2026-11-02T08:01"), pd.Timestamp("2026-11-01T08:01")]
    written = [pd.Timestamp(path.stat().st_mtime, unit="s") for path in paths]
    assert times[2:] == written[2:]


def test_texts_of_times_are_in_the_order_of_their_numbers(here, capsys):
    for day in (9, 10):
        write(Path("nights") / f"axis_{day}.npz", day, 0.0)
    Path("layout.toml").write_text(LAYOUT.replace("{day:d}", "{day}"))
    run()
    table = pd.read_csv(io.StringIO(capsys.readouterr().out))
    assert table["time"][:6].tolist() == [0, 1, 2, 3, 9, 10]


def test_the_picture_shows_the_units_that_are_closest_to_their_limits(capsys):
    units = [f"u{number}" for number in range(10)]
    latest = pd.DataFrame({"unit": units, "index": [*range(10)], "limit": [1.0] * 9 + [100.0]})
    assert sorted(set(_most_urgent(latest, latest)["unit"])) == units[1:9]
    assert "the 8 units with the highest latest index" in capsys.readouterr().err
