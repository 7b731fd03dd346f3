"""The command trend: from a folder of healthy files and one of new files to a trend per unit."""

import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from emacm.__main__ import main

LAYOUT = 'fs = 1000\nvelocity = "speed"\nmeta = "{unit}_{day:d}"\n[units]\nspeed = "rpm"\n'
N = 2400


def write(path, seed, wear=0.0, n=N):
    rng = np.random.default_rng(seed)
    angle = 90.0 * np.arange(n) / 1000
    vib = rng.normal(size=n) + wear * np.sin(3.3 * angle)
    np.savez(path, vib=vib, speed=np.full(n, 90 * 30 / np.pi))


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("layout.toml").write_text(LAYOUT)
    for folder, days in (("healthy", 10), ("nights", 4)):
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


def test_a_folder_of_every_night_gives_a_trend_per_unit(here, capsys):
    assert run() == 0
    table = pd.read_csv(io.StringIO(capsys.readouterr().out))
    assert table["unit"].tolist() == 4 * ["axis"] + 4 * ["press"]
    assert table["time"].tolist() == [0, 1, 2, 3, 0, 1, 2, 3]
    assert table["index"][4:].is_monotonic_increasing
    assert table["alarm"].tolist()[-2:] == [True, True]
    assert set(table["baseline"]) == {"unit"}
    assert table["recording"][7].endswith("press_3.npz")


def test_alarms_and_failed_files_have_their_exit_status(here, capsys):
    assert run("--out", "trend.csv", "--fail-on-alarm") == 1
    printed = capsys.readouterr().out
    assert "press: " in printed
    assert "ALARM" in printed
    assert "Table: trend.csv" in printed
    write(Path("nights/press_9.npz"), 1, n=40)
    assert run("--out", "trend.csv") == 3
    table = pd.read_csv("trend.csv", keep_default_na=False)
    assert "no stroke holds" in table["error"].iloc[-1]


def test_a_picture_is_drawn(here):
    pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra 'plot')")
    assert run("--out", "trend.csv", "--plot", "trend.png") == 0
    assert Path("trend.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--false-alarm", "0.01"], "needs at least 99"),
        (["--groups", "run"], "has no meta key 'run'"),
        (["--time", "hour"], "its meta has no 'hour'"),
    ],
)
def test_an_invalid_command_is_status_2_and_one_line(here, capsys, arguments, message):
    assert run(*arguments) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.err.count("\n") == 1
