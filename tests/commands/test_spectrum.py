"""The command spectrum: what it finds in a run-up, and what it writes."""

import json

import numpy as np
import pandas as pd
import pytest

from emacm.__main__ import main

FS = 2000
TIME = np.arange(20 * FS) / FS
ANGLE = 2 * np.pi * (2 * TIME + TIME**2)  # 120 to 2520 rpm
RPM = 60 * (2 + 2 * TIME)


@pytest.fixture
def run_up(tmp_path, monkeypatch):
    """Write a CSV file of 1x, 3.5x, and mains hum at 50 Hz."""
    monkeypatch.chdir(tmp_path)
    vibration = 2 * np.cos(ANGLE + 1) + 0.4 * np.cos(3.5 * ANGLE) + np.sin(2 * np.pi * 50 * TIME)
    noise = 0.01 * np.random.default_rng(0).normal(size=len(TIME))
    table = pd.DataFrame({"t [s]": TIME, "vib [mm/s]": vibration + noise, "angle [rad]": ANGLE})
    table.to_csv("run_up.csv", index=False)
    return "run_up.csv"


def test_the_highest_lines_are_printed_with_order_frequencies_and_peak(run_up, capsys):
    assert main(["spectrum", run_up, "--csv", "s.csv"]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[1] == "    order 1 (2 to 42 Hz): 2 mm/s (peak)"
    assert printed[2].startswith("    order 3.5 ")
    table = pd.read_csv("s.csv")
    line = table[table["order"] == 3.5].iloc[0]
    assert line["unit"] == "mm/s"
    assert line["amplitude [peak]"] == pytest.approx(0.4, rel=0.03)


def test_an_order_over_rpm_is_amplitude_and_phase(run_up, capsys):
    assert main(["spectrum", run_up, "--order", "1,3.5", "--json"]) == 0
    table = pd.DataFrame(json.loads(capsys.readouterr().out))
    first = table[table["order"] == 1]
    np.testing.assert_allclose(first["amplitude [peak]"].median(), 2, rtol=0.01)
    np.testing.assert_allclose(first["phase [deg]"].median(), np.degrees(1), atol=0.5)
    expected = np.interp(first["time [s]"], TIME, RPM)
    np.testing.assert_allclose(first["speed [rpm]"], expected, rtol=0.01)


@pytest.mark.parametrize(
    "options", ["--hz --bearing 6205", "--map --over time", "--map --hz", "--order 1"]
)
def test_a_picture_is_drawn(run_up, capsys, options):
    assert main(["spectrum", run_up, *options.split(), "--plot", "s.png"]) == 0
    assert "Picture: s.png" in capsys.readouterr().out
    with open("s.png", "rb") as file:
        assert file.read(4) == b"\x89PNG"


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["--order", "0"], "an order must be a number above 0"),
        (["--map", "--order", "1"], "not both"),
        (["--max-order", "900"], "support orders up to"),
        (["--channel", "x"], "no channel 'x'"),
        (["--min-speed", "3 knots"], "in rpm or as '42 rad/s'"),
    ],
)
def test_what_cannot_be_drawn_is_one_line_and_status_2(run_up, capsys, options, word):
    assert main(["spectrum", run_up, *options]) == 2
    assert word in capsys.readouterr().err


def test_speeds_are_given_in_rpm(run_up, capsys):
    assert main(["spectrum", run_up, "--speed", "1500 rpm", "--json"]) == 0
    table = pd.DataFrame(json.loads(capsys.readouterr().out))
    hum = table[table["order"].between(1.5, 2.5)]
    assert hum.loc[hum["amplitude [peak]"].idxmax(), "order"] == pytest.approx(2)  # 50 Hz of 25


def test_inspect_prints_json_for_programs(run_up, capsys):
    assert main(["inspect", run_up, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [(row["column"], row["as"]) for row in found["rows"]] == [
        *(("t", "time"), ("vib", "channel"), ("angle", "shaft"))
    ]
