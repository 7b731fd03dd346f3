"""The command find: faults named from the geometry of a machine, in files without a layout."""

import os

import numpy as np
import pandas as pd
import pytest

from emacm.__main__ import main

FS = 10_000
ORDERS = {"outer": 3.5848, "inner": 5.4152}  # 6205


def pump(state, seed):
    """Time, vibration and speed of a pump at 16 to 24 rev/s with ripple, 4 s."""
    rng = np.random.default_rng(seed)
    t = np.arange(4 * FS) / FS
    speed = 2 * np.pi * (rng.uniform(16, 24) + np.sin(2.5 * t))
    angle = np.cumsum(speed) / FS
    x = rng.normal(size=len(t)) + 1.5 * np.sin(angle)
    if state in ORDERS:
        turns = ORDERS[state] * 0.993 * angle / (2 * np.pi)
        turns += 0.001 * np.cumsum(rng.normal(size=len(t)))  # slip varies
        hits = np.diff(np.floor(turns), prepend=0) * (1 + 0.8 * np.cos(angle) * (state == "inner"))
        ring = np.exp(-np.arange(80) / 14) * np.sin(1.82 * np.arange(80))
        x += 8 * np.convolve(hits, ring)[: len(t)]
    return np.column_stack([t, x, 30 / np.pi * speed])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("pump")
    for number, state in enumerate(["healthy", "healthy", "outer", "inner"]):
        part = made / ("healthy" if state == "healthy" else "new")
        part.mkdir(exist_ok=True)
        names = {"header": "time,vibration,speed [rpm]", "comments": "", "delimiter": ","}
        np.savetxt(part / f"P{number}_{state}.csv", pump(state, number), **names)
    return made


@pytest.fixture
def here(folder, monkeypatch):
    monkeypatch.chdir(folder)
    return folder


@pytest.mark.slow
def test_rings_are_named_in_files_without_a_layout(here, capsys):
    options = ["--bearing", "6205", "--out", "found.csv", "--plot", "pictures"]
    pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra 'plot')")
    assert main(["find", "new", *options]) == 1
    table = pd.read_csv("found.csv")
    assert table["named"].tolist() == ["BPFO", "BPFI"]
    assert "P2_outer.csv, vibration: BPFO\n    BPFO and its harmonics" in capsys.readouterr().out
    assert len(list((here / "pictures").iterdir())) == 2


@pytest.mark.slow
def test_names_that_cannot_be_names_of_pictures_are_changed(here, capsys):
    pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra 'plot')")
    name = os.fsdecode(b"pr\xfcfung.csv")  # not UTF-8
    rows = (here / "new" / "P2_outer.csv").read_text().replace("vibration", "drive/end")
    (here / name).write_text("".join(rows.splitlines(True)[: FS + 1]))  # 1 s, 20 revolutions
    options = ["--bearing", "6205", "--plot", "drawn", "--out", "=found.csv"]
    assert main(["find", name, *options]) == 1
    assert [path.name for path in (here / "drawn").iterdir()] == ["pr_xfcfung_drive_end_001.png"]
    assert "fung.csv, drive/end: BPFO" in capsys.readouterr().out


def test_healthy_files_end_with_status_0(here):
    file = "healthy/P0_healthy.csv"
    assert main(["find", file, "--bearing", "9,7.94,39.04"]) == 0
    assert main(["find", file, "--bearing", "6205", "--healthy", "healthy"]) == 0


def test_a_file_that_fails_has_a_row_and_status_3(here, capsys):
    (here / "short.csv").write_text("time,vibration,speed [rpm]\n0,1,1500\n0.001,2,1500\n")
    assert main(["find", "short.csv", "--bearing", "6205"]) == 3
    assert "short.csv: failed" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["new", "--bearing", "62O5"], "6203, 6204, 6205"),
        (["no shaft.csv", "--bearing", "6205"], "Give --speed, or"),
    ],
)
def test_what_is_missing_is_stated(here, capsys, options, message):
    (here / "no shaft.csv").write_text("time,vibration\n0,1\n0.001,2\n0.002,3\n")
    assert main(["find", *options]) == 2
    assert message in capsys.readouterr().err


def test_a_speed_replaces_the_shaft_of_the_files_and_that_of_a_layout(here, capsys):
    pd.DataFrame(pump("outer", 5)[:, :2], columns=["t", "vib"]).to_csv("bare.csv", index=False)
    assert main(["find", "bare.csv", "--bearing", "6205", "--speed", "1200"]) != 2
    (here / "slow.toml").write_text('velocity = "300 rpm"\n')
    found = [capsys.readouterr()]
    for speed in ("1200", "20 rev/s"):
        options = ["--bearing", "6205", "--layout", "slow.toml", "--speed", speed]
        assert main(["find", "bare.csv", *options]) != 2
        found.append(capsys.readouterr())
    assert found[0].out == found[1].out == found[2].out
    assert "--speed 1200 rpm is used, '300 rpm' of the files is not" in found[2].err


def fan(folder, numbers, growth):
    """Write recordings of a fan at 1470 rpm, whose imbalance grows."""
    folder.mkdir()
    time = np.arange(4 * 2000) / 2000
    for number in numbers:
        phases = 2 * np.pi * 24.5 * time + number
        noise = 0.3 * np.random.default_rng([number, growth > 1]).normal(size=len(time))
        wave = 0.5 * growth**number * np.cos(phases) + 0.2 * np.cos(7 * phases) + noise
        np.savez(folder / f"{number:02d}.npz", x=wave, fs=2000)


def test_an_imbalance_that_grows_is_seen_by_the_trend_and_named(tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra 'plot')")
    monkeypatch.chdir(tmp_path)
    fan(tmp_path / "well", range(8), 1.0)
    fan(tmp_path / "later", range(0, 12, 4), 1.18)
    (tmp_path / "parts.toml").write_text("[orders]\nimbalance = 1.0\n")
    options = ["--speed", "1470", "--parts", "parts.toml"]
    assert main(["trend", "well", "later", *options, "--out", "trend.csv"]) == 0
    alarms = pd.read_csv("trend.csv")["alarm"].tolist()
    assert alarms == sorted(alarms)
    assert sum(alarms) == 2
    assert "Each healthy file counts as a run" in capsys.readouterr().out
    assert main(["find", "later", *options, "--healthy", "well", "--plot", "drawn"]) == 1
    lines = capsys.readouterr().out
    assert "08.npz, x: imbalance\n" in lines
    assert "00.npz, x: none\n" in lines
    assert "04.npz, x: none (suspected: imbalance)\n" in lines  # 5.8 dB; 6 dB name it
    assert len([*(tmp_path / "drawn").iterdir()]) == 2


@pytest.fixture(scope="module")
def fleet(folder):
    (folder / "layout.toml").write_text(
        'channels = ["vibration"]\nvelocity = "speed [rpm]"\nmeta = "{unit}_{state}"\n'
    )
    (folder / "fleet").mkdir()
    (folder / "known").mkdir()
    for number in range(12):
        state = ("healthy", "outer", "inner")[number % 3]
        part = folder / ("known" if state == "healthy" or number > 5 else "fleet")
        columns = {"header": "time,vibration,speed [rpm]", "comments": "", "delimiter": ","}
        np.savetxt(part / f"P{number}_{state}.csv", pump(state, 50 + number), **columns)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("bearing", [["--bearing", "6205"], []])
def test_the_trend_sees_rings_with_and_without_a_known_bearing(fleet, monkeypatch, bearing):
    monkeypatch.chdir(fleet)
    (fleet / "well").mkdir(exist_ok=True)
    for path in (fleet / "known").glob("*healthy*"):
        (fleet / "well" / path.name).write_bytes(path.read_bytes())
    rate = ["--false-alarm", "0.2", "--fail-on-alarm", "--out", "trend.csv"]
    layout = ["--layout", "layout.toml", "--groups", "unit", "--unit", "unit"]
    assert main(["trend", "well", "fleet", *layout, *rate, *bearing]) == 1
    table = pd.read_csv("trend.csv")
    assert table["alarm"].all()
    levels = {"BPFO": "outer", "BPFI": "inner"} if bearing else {}
    for line, state in levels.items():
        is_faulty = table["recording"].str.contains(state)
        level = table[f"vibration@{line} [dB]"]
        assert level[is_faulty].min() > level[~is_faulty].max() + 6


def test_a_file_of_speeds_alone_is_named(here, capsys):
    pd.DataFrame(pump("outer", 5)[:, [0, 2]], columns=["t", "rpm"]).to_csv("a.csv", index=False)
    assert main(["find", "a.csv", "--bearing", "6205"]) == 2
    assert "select those by --pattern" in capsys.readouterr().err


@pytest.mark.slow
def test_a_classifier_is_trained_on_the_lines_of_the_bearing(fleet, monkeypatch, capsys):
    pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
    monkeypatch.chdir(fleet)
    options = ["--labels", "state", "--groups", "unit", "--recipe", "bearing", "--out", "m.skops"]
    assert main(["train", "layout.toml", "known", *options, "--bearing", "6205"]) == 0
    assert main(["score", "m.skops", "fleet", "--layout", "layout.toml"]) == 0
    rows = capsys.readouterr().out.splitlines()[-4:]
    assert all(row.split(",")[1] in row.split(",")[0] for row in rows), rows
