"""A model file states its evidence: as a card, and to be computed again."""

import json
from hashlib import sha256
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from emacm import Layout, RecordingFolder, describe_model, evaluate, load_model, save_model
from emacm.__main__ import main
from emacm.displays import DomainDisplay
from emacm.models.evidence import evidence_table

pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
AGAIN = ["--layout", "layout.toml", "--data", "files"]


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Return a folder with the files of three units, and a model that was trained on them."""
    folder = tmp_path_factory.mktemp("bench")
    (folder / "files").mkdir()
    rng = np.random.default_rng(0)
    for number in range(12):
        unit, worn, load = number % 3, number // 6, 20 * (1 + number // 3 % 2)
        angle = np.cumsum(110.0 + unit + np.zeros(2000)) / 640
        columns = {"vib": rng.normal(size=2000) + worn * np.sin(5.3 * angle), "angle": angle}
        state = ("healthy", "worn")[worn]
        np.savez(folder / f"files/U{unit}_{state}_{load}_{number}.npz", **columns, fs=640)
    meta = 'meta = "{unit}_{state}_{load:d}_{run:d}"\n'
    (folder / "layout.toml").write_text('angle = "angle"\n' + meta)
    stated = ["--intended-use", "pump P1", "--limits", "not in start-up"]
    keys = ["--labels", "state", "--groups", "unit", "--max-order", "10"]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        command = ["train", "layout.toml", "files", *keys, *stated, "--out", "model.emacm"]
        assert main(command) == 0
    return folder


def test_the_evidence_is_computed_again_and_a_changed_file_is_found(here, capsys):
    assert main(["verify", "model.emacm", *AGAIN]) == 0
    assert "NO\n" not in capsys.readouterr().out
    path = next(Path("files").glob("*worn*"))
    with np.load(path) as held:
        np.savez(path, **{**held, "vib": held["vib"] / 100})
    Path("files/U0_worn_20_99.npz").write_bytes(path.read_bytes())
    assert main(["verify", "model.emacm", *AGAIN, "--out", "again.json"]) == 1
    rows = {row["what"]: row for row in json.loads(Path("again.json").read_text())["answers"]}
    assert rows["files with another content"]["computed"] == 1
    assert rows["files that were added"]["computed"] == 1
    assert rows["recordings, state worn"]["difference"] == 1
    assert not rows["posteriors of the model, fitted again"]["passed"]
    assert rows["units, state healthy"]["passed"]


def test_the_card_states_what_the_model_is_for_and_how_it_decided(here, capsys):
    card = describe_model("model.emacm")
    folder = RecordingFolder("files", Layout.from_toml("layout.toml"))
    labels = [recording.meta["state"] for recording in folder]
    found = evaluate(load_model("model.emacm"), folder, labels, units="unit", healthy="healthy")
    rates = evidence_table(card.evidence, "rates")
    np.testing.assert_allclose(rates["accuracy_low"], found.table["accuracy_low"], atol=1e-9)
    digests = {path.name: sha256(path.read_bytes()).hexdigest() for path in folder.paths}
    assert card.evidence["files"] == digests
    for option in ([], ["--json"], ["--out", "card.html"]):
        assert main(["describe", "model.emacm", *option]) == 0
    text, html = capsys.readouterr().out, Path("card.html").read_text()
    for words in ("pump P1", "not in start-up", "missed detection rate", "fastest [rpm]"):
        assert words in text
        assert words in html
    assert "image/svg+xml" in html
    assert type(card)(card | {"healthy": 0}).facts()["Healthy state"] == "0"
    assert '"limits": "not in start-up"' in text


def test_a_model_without_evidence_has_a_card_and_cannot_be_verified(here, capsys):
    save_model(load_model("model.emacm"), "plain.emacm")
    assert "none stored" in str(describe_model("plain.emacm"))
    assert main(["verify", "plain.emacm", *AGAIN]) == 2
    assert "no training files" in capsys.readouterr().err
    assert main(["verify", "plain.emacm"]) == 2
    assert "--layout and --data" in capsys.readouterr().err


def test_the_map_has_a_bar_for_each_recording_in_revolutions_per_minute():
    points = {"state": ["worn", "healthy"], "slowest": [10.0, 20.0], "fastest": [20.0, 50.0]}
    table = pd.DataFrame(points | {"load": [20, 40]})
    display = DomainDisplay(table).plot()
    ends = np.vstack([line.get_xydata() for line in display.ax_.lines])
    np.testing.assert_allclose(ends[:, 0] * np.pi / 30, [20, 50, 10, 20])
    assert ends[0, 1] > ends[2, 1]
    assert display.ax_.get_ylabel() == "load"
    with pytest.raises(KeyError, match="torque"):
        DomainDisplay(table, condition="torque").plot()
