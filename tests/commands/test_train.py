"""From files to a table of decisions without writing Python: inspect, train, score."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io

from emacm import Layout, RecordingFolder, describe_model, load_model
from emacm.__main__ import main

pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
N, FS = 4000, 1280
REQUIRED = ["layout.toml", "files", "--labels", "state", "--groups", "unit"]


def signals(worn, unit):
    rng = np.random.default_rng(100 * unit + worn)
    speed = 110.0 + unit + 4 * np.sin(np.arange(N) / 500)
    angle = np.cumsum(speed) / FS
    line = (1.5 if worn else 0.05) * np.sin(5.3 * angle)
    return rng.normal(size=N) + line, speed


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Write the files of four units in three formats."""
    folder = tmp_path_factory.mktemp("bench")
    (folder / "files").mkdir()
    for unit in range(4):
        for worn in (0, 1):
            for run in range(2):
                vib, speed = signals(worn, unit * 10 + run)
                path = folder / f"files/U{unit}_{('healthy', 'worn')[worn]}_{run}"
                columns = {"vib": vib, "speed": speed, "time": np.arange(N) / FS}
                if unit < 2:
                    np.savez(f"{path}.npz", **columns)
                elif unit < 3:
                    scipy.io.savemat(f"{path}.mat", columns)
                else:
                    pd.DataFrame(columns).to_csv(f"{path}.csv", index=False)
    (folder / "layout.toml").write_text(
        'velocity = "speed"\nmeta = "{unit}_{state}_{run:d}"\n[units]\nspeed = "rad/s"\n'
    )
    return folder


def keep_three_units():
    for path in Path("files").glob("U2*"):
        path.unlink()


def train(*options):
    return main(["train", *REQUIRED, "--out", "model.emacm", *options])


def test_files_in_three_formats_become_a_table_of_decisions(here, capsys):
    assert main(["inspect", "files/U0_worn_1.npz"]) == 0
    assert train("--max-order", "10", "--note", "four units") == 0
    printed = capsys.readouterr().out
    assert "16 recordings, 4 groups (unit)" in printed
    assert re.search("false alarm rate .*missed detection rate", printed)
    assert describe_model("model.emacm")["note"] == "four units"
    arguments = ["score", "model.emacm", "files", "--layout", "layout.toml", "--out", "table.csv"]
    assert main(arguments) == 0
    table = pd.read_csv("table.csv")
    states = table["recording"].str.contains("worn").map({True: "worn", False: "healthy"})
    assert len(table) == 16
    assert (table["decision"] == states).mean() > 0.9
    assert table["typicality"].between(0, 1).all()


@pytest.mark.slow
def test_training_states_yardsticks_and_what_each_channel_contributes(here, capsys):
    for path in Path("files").iterdir():
        path.unlink()
    for unit in range(6):
        for run in range(3):
            worn = unit % 2
            vib, speed = signals(worn, unit * 10 + run)
            noise = np.random.default_rng([7, unit, run]).normal(size=N)
            name = f"files/U{unit}_{('healthy', 'worn')[worn]}_{run}.npz"
            np.savez(name, vib=vib, other=noise, speed=speed, time=np.arange(N) / FS)
    Path("cost.csv").write_text(",healthy,worn\nhealthy,0,10\nworn,1,0\ninspect,0.3,0.3\n")
    assert train("--max-order", "10", "--cost", "cost.csv") == 0
    printed = capsys.readouterr().out
    assert re.search(r"always 'inspect' +0.3\nalways 'healthy' +5.0", printed)
    costs = dict(re.findall(r"\n(all channels|without \w+) .* ([0-9.]+)[^\n]*(?=\n)", printed))
    assert sorted(costs) == ["all channels", "without other", "without vib"]
    assert re.search(r"without vib .* 0\.3", printed)  # without the signal all are inspected
    assert re.search(r"decided +\nhealthy +\d+ +\d+\n", printed)


@pytest.mark.slow
def test_a_classifier_learns_again_from_the_features_in_a_history(here, capsys):
    assert train("--max-order", "10") == 0
    first = capsys.readouterr().out
    score = ["score", "model.emacm", "files", "--layout", "layout.toml", "--out", "seen.sqlite"]
    again = ["--labels", "state", "--groups", "unit", "--like", "model.emacm", "--out", "new.emacm"]
    assert main(score) == 0
    assert main(["train", "layout.toml", "seen.sqlite", *again]) == 2
    assert "has no features of the model" in capsys.readouterr().err
    Path("seen.sqlite").unlink()
    assert main([*score, "--features"]) == 0
    for path in Path("files").iterdir():
        path.rename(path.name)  # the signals are not needed
    assert main(["train", "layout.toml", "seen.sqlite", *again]) == 0
    second = capsys.readouterr().out
    rates = re.compile(r"\nby unit .*")
    assert rates.search(first)[0] == rates.search(second)[0]
    folder = RecordingFolder(".", Layout.from_toml("layout.toml"), "U*")
    models = load_model("model.emacm"), load_model("new.emacm")
    np.testing.assert_allclose(*(model.predict_proba(folder) for model in models), atol=1e-9)


@pytest.mark.slow
def test_costs_and_priors_of_the_command_are_in_the_saved_model(here, capsys):
    Path("cost.csv").write_text(",healthy,worn\nhealthy,0,40\nworn,2,0\ninspect,0.5,0.25\n")
    options = ("--cost", "cost.csv", "--priors", "healthy=0.8,worn=0.2", "--json")
    assert train("--max-order", "10", "--revolutions", "8", *options) == 0
    assert json.loads(capsys.readouterr().out)["decisions"][2] == "inspect"
    final = load_model("model.emacm")[-1]
    cost = pd.DataFrame(final.cost_, index=final.decisions_, columns=final.truths_)
    assert cost.loc["healthy", ["healthy", "worn"]].tolist() == [0, 40]
    assert cost.loc["worn", ["healthy", "worn"]].tolist() == [2, 0]
    assert cost.loc["inspect", ["healthy", "worn"]].tolist() == [0.5, 0.25]
    priors = dict(zip(final.truths_, final.priors_, strict=False))
    assert priors["healthy"] == pytest.approx(4 * priors["worn"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--healthy", "good"], "--healthy must name the healthy state"),
        (["--labels", "condition"], "its meta has no 'condition'"),
        (["--recipe", "bearing"], "give --bearing 6205"),
        (["--max-order", "0"], "argument --max-order: expected a number above 0, got '0'"),
    ],
)
def test_an_invalid_command_is_status_2_and_one_line(here, capsys, options, message):
    assert train(*options) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.err.count("\n") == 1
    assert not Path("model.emacm").exists()


@pytest.mark.parametrize(
    "arguments",
    [["train", *REQUIRED, "--out", "none/m"], ["inspect", "run.csv", "--draft", "none/l.toml"]],
)
def test_a_missing_folder_of_the_result_is_an_error_at_once(
    tmp_path, monkeypatch, capsys, arguments
):
    monkeypatch.chdir(tmp_path)
    for name in ("layout.toml", "files", "run.csv"):
        Path(name).touch()
    assert main(arguments) == 2
    assert "there is no folder 'none'" in capsys.readouterr().err


def test_an_empty_state_and_an_output_that_is_a_folder_are_refused(here, capsys):
    rows = [f"{path.name},{path.name[:2]},\n" for path in sorted(Path("files").iterdir())]
    Path("meta.csv").write_text("file,unit,state\n" + "".join(rows))
    Path("layout.toml").write_text('velocity = "speed"\nmeta = "meta.csv"\n')
    assert train() == 2
    assert "U0_healthy_0.npz: its 'state' is empty" in capsys.readouterr().err
    assert train("--out", "files") == 2
    assert "'files' is a folder; name a file" in capsys.readouterr().err


def test_states_that_differ_only_in_case_are_stated(here, capsys):
    Path("files/U0_healthy_0.npz").rename("files/U0_Healthy_0.npz")
    assert train("--priors", "x") == 2
    assert "'Healthy' and 'healthy' differ in case or spaces only" in capsys.readouterr().err


@pytest.mark.slow
def test_sidebands_of_a_mesh_above_order_20_are_learned_without_an_option(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    Path("files").mkdir()
    angle = 2 * np.pi * 16 * np.arange(2 * N) / 2560
    for number in range(16):
        rng = np.random.default_rng(number)
        depth = 0.5 if number % 2 else 0.02
        mesh = (1 + depth * np.cos(0.7 * angle)) * np.cos(41.5 * angle)
        wave = rng.uniform(0.8, 1.2) * mesh + np.cos(23 * angle) + 0.3 * rng.normal(size=2 * N)
        np.savez(f"files/{number // 4}-{('gut', 'Ritzel')[number % 2]}-{number}.npz", x=wave)
    meta = 'meta = "{unit}-{state}-{run:d}"\n'
    Path("layout.toml").write_text(f'fs = 2560\nvelocity = "960 rpm"\n{meta}')
    assert train("--healthy", "gut") == 0
    assert re.search(r"on new units: 0\.\d+ and 0\.", capsys.readouterr().out)
    assert load_model("model.emacm")[0].theta_s < np.pi / 42


@pytest.mark.slow
def test_a_channel_that_harms_is_named(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("files").mkdir()
    angle = 2 * np.pi * 16 * np.arange(N) / FS
    for unit in range(24):
        gains = np.random.default_rng(unit).lognormal(sigma=2, size=15)  # of the unit
        for run in range(2):
            noise = np.random.default_rng(100 * unit + run).normal(size=(2, N))
            useful = noise[0] + 0.16 * (unit % 2) * np.sin(5.3 * angle)
            useless = 0.01 * noise[1] + gains @ np.sin(np.outer(np.arange(1.5, 16), angle))
            path = f"files/U{unit}_{('healthy', 'worn')[unit % 2]}_{run}.npz"
            np.savez(path, **{"drive end": useful, "drive": useless})
    Path("layout.toml").write_text('fs = 1280\nvelocity = "960 rpm"\nmeta = "{unit}_{state}_{run}"')
    assert train("--max-order", "16", "--revolutions", "4") == 0
    printed = capsys.readouterr().out
    assert re.findall("^- Without (.*) the decisions cost less", printed, re.M) == ["drive"]


def test_files_without_orders_are_named_and_defects_are_stated(here, capsys):
    bad = Path("files/U0_worn_1.npz")
    content = bad.read_bytes()
    bad.write_bytes(b"PK")
    assert train() == 2
    assert "U0_worn_1.npz" in capsys.readouterr().err
    bad.write_bytes(content)
    vib, speed = signals(0, 9)
    np.savez("files/U9_healthy_0.npz", vib=vib, speed=0 * speed, time=np.arange(N) / FS)
    assert train() == 2
    assert "U9_healthy_0.npz: the shaft is at rest" in capsys.readouterr().err
    vib[1000:2500] = 0.0
    np.savez("files/U9_healthy_0.npz", vib=vib, speed=speed, time=np.arange(N) / FS)
    assert train("--max-order", "1e6") == 2
    assert re.search("has no content above order .*Lower --max-order", capsys.readouterr().err)
    keep_three_units()
    assert train("--max-order", "5") == 0
    assert "U9_healthy_0.npz: channel 'vib' has drop-outs" in capsys.readouterr().err


def test_costs_and_priors_may_name_states_that_are_numbers(here):
    keep_three_units()
    for path in Path("files").iterdir():
        path.rename(str(path).replace("healthy", "0").replace("worn", "1"))
    text = Path("layout.toml").read_text().replace("{state}", "{state:d}")
    Path("layout.toml").write_text(text)
    Path("cost.csv").write_text("decision,0,1\n0,0,9\n1,1,0\n")
    assert train("--healthy", "0", "--cost", "cost.csv", "--priors", "0=0.9,1=0.1") == 0
    classifier = load_model("model.emacm")[-1]
    assert classifier.cost.loc[0, 1] == 9
    assert classifier.priors == {0: 0.9, 1: 0.1}
