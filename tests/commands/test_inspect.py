"""The command inspect: what a file contains, a plot, and a layout with which it can be opened."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io

from emacm import Layout, open_recording
from emacm.__main__ import main
from emacm.files.drafts import contents_of, contents_table

N = 4000
VIBRATION = np.random.default_rng(0).normal(size=N)
SPEED = 1500 + 20 * np.sin(np.arange(N) / 300)


@pytest.fixture
def csv(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    frame = pd.DataFrame(
        {
            "time [s]": np.round(np.arange(N) / 2560, 6),
            "vibration [m/s²]": VIBRATION,
            "Strom": 2 + 0 * VIBRATION,
            "speed [rpm]": SPEED,
        }
    )
    frame.to_csv("A_worn_3.csv", index=False)
    return Path("A_worn_3.csv")


def test_columns_are_listed_with_rates_units_duration_and_range(csv, capsys):
    table = contents_table(contents_of(csv))
    assert table["as"].tolist() == ["time", "channel", "channel", "shaft"]
    assert table["unit"].tolist() == ["s", "m/s²", "", "rpm"]
    assert table.loc["vibration", "rate [Hz]"] == 2560
    assert table.loc["vibration", "duration [s]"] == N / 2560
    assert table.loc["vibration", "highest"] == VIBRATION.max()
    assert table.loc["Strom", "mean"] == 2
    assert main(["inspect", str(csv)]) == 0
    printed = capsys.readouterr()
    assert "vibration" in printed.out
    assert "2560" in printed.out
    assert not printed.err


def test_a_draft_opens_the_file_at_once(csv, capsys):
    assert main(["inspect", str(csv), "--draft", "layout.toml"]) == 0
    recording = open_recording(csv, Layout.from_toml("layout.toml"))
    assert recording.channels == ("vibration", "Strom")
    assert dict(recording.units) == {"vibration": "m/s²"}
    assert recording.fs["Strom"] == 2560
    np.testing.assert_allclose(recording.velocity, SPEED * np.pi / 30, rtol=1e-14)
    assert 'meta = "{field1}_{field2}_{field3}"' in Path("layout.toml").read_text(encoding="utf-8")
    assert main(["inspect", str(csv), "--draft", "layout.toml"]) == 2
    assert "exists" in capsys.readouterr().err
    assert main(["inspect", str(csv), "--draft", "other.toml", "--meta", "{unit}-{run}"]) == 2
    assert "does not match the pattern" in capsys.readouterr().err


def test_a_gap_and_values_that_are_not_finite_are_stated(tmp_path, capsys):
    times = np.delete(np.arange(N + 1) / 100, 7)
    np.savez(tmp_path / "a.npz", t=times, b=np.where(np.arange(N) == 9, np.nan, VIBRATION))
    assert main(["inspect", str(tmp_path / "a.npz")]) == 0
    printed = capsys.readouterr().out
    assert "gap of 0.02 s after sample 6" in printed
    assert "no column is named like the motion of the shaft" in printed
    assert contents_table(contents_of(tmp_path / "a.npz")).loc["b", "not finite"] == 1


def test_a_plot_is_drawn(csv, tmp_path):
    pytest.importorskip("matplotlib")
    assert main(["inspect", str(csv), "--plot", str(tmp_path / "plot.png")]) == 0
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("content", [None, b"", b"PK broken"])
def test_a_bad_file_is_one_line_and_status_2(tmp_path, capsys, content):
    if content is not None:
        (tmp_path / "a.npz").write_bytes(content)
    assert main(["inspect", str(tmp_path / "a.npz")]) == 2
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1
    assert "a.npz" in printed


def test_dates_beside_channels_are_not_used(tmp_path, capsys):
    path, days = tmp_path / "a.npz", np.arange("2026-01-01", "2026-01-05", dtype="M8[D]")
    np.savez(path, vib=np.arange(4.0), day=days, fs=10.0)
    assert main(["inspect", str(path)]) == 0
    assert "Not used: 'day', it does not consist of numbers, got" in capsys.readouterr().out


def test_a_speed_without_a_unit_is_proposed_as_velocity_with_the_unit_of_its_name(tmp_path, capsys):
    path, draft = tmp_path / "a_1.csv", tmp_path / "layout.toml"
    rows = "".join(f"{i / 8};{5 - i};{1500 + i};{400 - i};ok\n" for i in range(20))
    path.write_text("Rig: 3\n\ntime;b [g];MotorRPM;out speed;note\n" + rows.replace(".", ","))
    assert main(["inspect", str(path), "--draft", str(draft)]) == 0
    printed = capsys.readouterr().out
    assert "Not used: 'out speed', it is named like the motion of a shaft" in printed
    assert "Not used: 'note', it does not consist of numbers, got 'ok' at sample 0" in printed
    assert "To be stated" not in printed
    assert contents_table(contents_of(path))["as"].tolist() == [
        *("time", "channel", "shaft", "not used", "not used")
    ]
    recording = open_recording(path, Layout.from_toml(draft))
    assert (recording.channels, recording.fs["b"], recording.units["b"]) == (("b",), 8, "g")
    np.testing.assert_allclose(recording.velocity[:2] * 30 / np.pi, [1500, 1501], rtol=1e-14)


def test_a_draft_marks_all_that_the_file_does_not_state(tmp_path):
    path, draft = tmp_path / "A_1.npz", tmp_path / "layout.toml"
    np.savez(path, current=VIBRATION, theta=np.arange(N) * 0.7)
    assert main(["inspect", str(path), "--draft", str(draft)]) == 0
    text = draft.read_text(encoding="utf-8")
    open_lines = [line.split("  # FILL IN")[0] for line in text.splitlines() if "  # FILL" in line]
    assert open_lines == [
        "# fs = 12000",
        '# meta = "{field1}_{field2}"',
        '# "theta" = "rad"',
        '# "current" = "g"',
    ]
    completed = "\n".join(
        line.removeprefix("# ") if "  # FILL" in line else line for line in text.splitlines()
    )
    draft.write_text(completed.replace('"rad"', '"deg"'), encoding="utf-8")
    recording = open_recording(path, Layout.from_toml(draft))
    assert recording.meta == {"field1": "A", "field2": "1"}
    np.testing.assert_allclose(recording.angle[1] - recording.angle[0], np.deg2rad(0.7))


def test_a_tachometer_is_proposed_by_its_pulses(tmp_path, capsys):
    path, draft = tmp_path / "A_1.wav", tmp_path / "layout.toml"
    turns = np.cumsum(20 + 4 * np.arange(2 * N) / N) / 2000
    decaying = 0.9 ** (100 * (5.4 * turns % 1))  # impulses of a bearing are no tachometer
    tacho = 0.8 * (turns % 1 < 0.05)
    scipy.io.wavfile.write(path, 2000, np.column_stack([decaying, tacho]).astype("f4"))
    options = ["--draft", str(draft), "--meta", "{unit}_{run:d}"]
    assert main(["inspect", str(path), *options]) == 0
    assert "To be stated in the layout: pulses_per_rev of tacho: 'x1'" in capsys.readouterr().out
    text = draft.read_text(encoding="utf-8")
    assert 'channels = ["x0"]' in text
    draft.write_text(text.replace("# tacho = ", "tacho = "), encoding="utf-8")
    recording = open_recording(path, Layout.from_toml(draft))
    assert recording.meta == {"unit": "A", "run": 1}
    np.testing.assert_allclose(np.ptp(recording.angle), 2 * np.pi * np.ptp(turns), rtol=0.01)


def test_files_of_a_folder_are_listed_and_the_first_that_can_be_read_is_drafted(
    csv, tmp_path, capsys
):
    Path("broken.wav").write_bytes(b"RIFF")
    assert main(["inspect", ".", "--pattern", "*.csv", "--draft", "layout.toml"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "A_worn_3.csv vibration, Strom 2560 1.5625 speed" in printed
    pd.DataFrame({"t": [0, 0.5, 1.0], "rpm": 900}).to_csv("speed.csv", index=False)
    assert main(["inspect", ".", "--pattern", "*.csv"]) == 0  # a second file, without channels
    assert main(["inspect", "."]) == 3
    printed = capsys.readouterr().out
    assert "broken.wav" in printed
    assert "cannot be read" in printed
    assert Layout.from_toml("layout.toml").velocity == "speed"


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")  # pyuff leaves the file open
@pytest.mark.parametrize("name", ["a.uff", "a.npz"])
def test_a_file_without_signals_is_an_error(tmp_path, capsys, name):
    if name == "a.uff":
        pytest.importorskip("pyuff", reason="pyuff is not installed (extra 'files')")
        (tmp_path / name).write_text("no data set\n")
    else:
        np.savez(tmp_path / name, fs=10, note="x")
    assert main(["inspect", str(tmp_path / name)]) == 2
    assert "it contains no signal" in capsys.readouterr().err
