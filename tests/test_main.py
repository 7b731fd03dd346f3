"""The command line does what it says, and bad input ends with one line and exit code 2."""

import joblib
import numpy as np
import pytest

from emacm import demo
from emacm.__main__ import main
from emacm.simulation import simulate_fleet


def test_the_demo_prints_saves_and_draws(tmp_path, capsys, monkeypatch):
    # Fewer and shorter runs than the demo itself has, which CI runs as printed in the README.
    monkeypatch.setattr(
        demo, "simulate_fleet", lambda units, runs, **kwargs: simulate_fleet(3, 2, **kwargs)
    )
    assert main(["demo", "--out", str(tmp_path), "--jobs", "2"]) == 0
    printed = capsys.readouterr().out
    for words in (
        "Best of 12",
        "Cost matrix: uniform",
        "Cost matrix: a missed detection costs 10",
        "false alarms",
        "missed detections",
        "expected cost",
        "loaded again",
        "drawn in",
    ):
        assert words in printed
    assert (tmp_path / "simulated.png").stat().st_size > 10_000
    model = joblib.load(tmp_path / "simulated.joblib")
    unseen, truths, _ = simulate_fleet(1, 2, severity=1, seed=1, first_unit=20)
    assert set(model.predict(unseen)) <= set(truths)


def test_the_demo_on_the_real_actuator_sets_splits_side_by_side(cranfield_file, tmp_path, capsys):
    with np.load(cranfield_file) as file:
        arrays = dict(file)
    chosen = np.isin(arrays["state"], ["normal", "spalling8", "spalling7"])
    chosen &= (arrays["load_kgf"] > 0) & np.isin(arrays["group"] % 5, [0, 1])
    for name, values in arrays.items():
        arrays[name] = values[chosen] if values.shape[:1] == chosen.shape else values
    np.savez(tmp_path / "part.npz", **arrays)
    arguments = ["demo", "--actuator", str(tmp_path / "part.npz"), "--out", str(tmp_path)]
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    assert "recordings of normal, spalling8; runs [1, 2, 3, 4, 5, 6, 7]" in printed
    for words in ("Balanced accuracy", "held out (honest)", "random split", "confounded"):
        assert words in printed
    assert (tmp_path / "actuator.png").stat().st_size > 10_000


def test_a_missing_file_is_one_line_and_exit_code_2(tmp_path, capsys):
    arguments = ["demo", "--actuator", str(tmp_path / "none.npz"), "--out", str(tmp_path)]
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("emacm: there is no file")
    assert captured.err.count("\n") == 1


def test_a_folder_that_is_a_file_is_one_line_and_exit_code_2(tmp_path, capsys):
    (tmp_path / "taken").write_text("")
    assert main(["demo", "--out", str(tmp_path / "taken")]) == 2
    assert "cannot write to the folder" in capsys.readouterr().err


def test_without_matplotlib_the_extra_is_named(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert main(["demo", "--out", str(tmp_path)]) == 2
    assert "install emacm[plot]" in capsys.readouterr().err


def test_an_unknown_command_is_refused(capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["dance"])
    assert stopped.value.code == 2
    assert "invalid choice: 'dance'" in capsys.readouterr().err
