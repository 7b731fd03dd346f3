"""Code of README and of the page on the method runs and gives the figures in the text."""

import re
import shlex
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from emacm import load_model, outside_training
from emacm.__main__ import main

README = Path(__file__).parents[1] / "README.md"
README_TEXT = README.read_text(encoding="utf-8")
METHOD_TEXT = (README.parent / "notebooks" / "method.md").read_text(encoding="utf-8")


TRUE_STATES = ["healthy", "healthy", "outer", "healthy", "healthy", "inner"]  # of example/new


def code_blocks(language, text=README_TEXT):
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def names_after(script):
    names = {}
    exec(compile(script, "README.md", "exec"), names)
    return names


@pytest.fixture
def run_csv(tmp_path, monkeypatch):
    """Write a file as the README describes it: a line at order 3.125, reversing speed in rpm."""
    monkeypatch.chdir(tmp_path)
    time = np.arange(40_000) / 2_000
    rpm = 600 * np.sin(2 * np.pi * 0.1 * time)
    angle = np.cumsum(rpm) * 2 * np.pi / 60 / 2_000
    columns = {"time": time, "vibration": 0.1 * np.sin(3.125 * angle), "speed": rpm}
    pd.DataFrame(columns).to_csv("run.csv", index=False)


def test_it_fits_into_150_lines_and_a_decision_into_15():
    assert len(README_TEXT.splitlines()) <= 150
    assert len(code_blocks("python")[0].splitlines()) <= 15


def test_a_file_of_ones_own_leads_to_its_order_spectrum(run_csv, tmp_path, capsys):
    names = names_after(code_blocks("python")[2])
    assert (tmp_path / "spectrum.png").exists()
    spectrum = names["spectrum"].transform([names["recording"]])[0]
    assert np.argmax(spectrum) / 8 == 3.125
    printed = capsys.readouterr().out
    for word in ("revolutions", "strokes", "max_order", "warnings"):
        assert word in printed


@pytest.mark.slow
def test_the_page_on_the_method_states_what_its_example_gives(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = names_after(code_blocks("python", METHOD_TEXT)[0])
    stated = re.search(
        r"(\d+) % of the healthy .*? called faulty, (\d+) % are sent to inspection, and\s"
        r"(\d+) % of the faulty",
        METHOD_TEXT,
    ).groups()
    row = names["result"].table.loc["by unit"]
    rates = row[["false_alarm_rate", "inspection_rate", "missed_detection_rate"]]
    assert [round(100 * rate) for rate in rates] == [int(number) for number in stated]
    model, wrong, saved = names["model"], names["wrong"], load_model("model.skops")
    assert model.predict([wrong]).tolist() == ["unknown"]
    assert "60 dB" in outside_training(model, [wrong])[0][0].text
    recordings = names["recordings"][::7]
    assert list(saved.predict(recordings)) == list(model.predict(recordings))
    assert saved[-1].cost.loc["healthy", "screw"] == 10


@pytest.mark.slow
def test_all_blocks_run_on_the_files_of_the_example(tmp_path, monkeypatch, capsys):
    for name in ("skops", "jinja2", "matplotlib"):
        pytest.importorskip(name, reason=f"{name} is not installed (extra 'report' or 'models')")
    lines = code_blocks("sh")[2].splitlines()
    assert "`emacm example example` writes a simulated pump" in README_TEXT
    monkeypatch.chdir(tmp_path)
    assert main(["example", "example"]) == 0
    monkeypatch.chdir("example")
    decision, search, *others = code_blocks("python")
    names = names_after(decision + search)
    for model in (names["model"], names["search"]):
        decided = model.predict(names["new"])
        assert list(decided) == TRUE_STATES
    for block in others:
        names_after(block)
    assert "\nBPFI " in capsys.readouterr().out
    prose = re.sub(r"```.*?```", "", README_TEXT, flags=re.DOTALL)
    for line in lines + re.findall(r"`((?:\.venv/bin/)?emacm [^`]+)`", prose):
        program, *arguments = shlex.split(line, comments=True)
        assert Path(program).name == "emacm"
        if arguments[0] == "example":  # was run first
            continue
        assert main(arguments) in (0, 1), line  # 1: something was found
    decided = pd.read_csv("decisions.csv")
    assert decided["decision"].tolist() == TRUE_STATES
    latest = pd.read_csv("trend.csv").groupby("unit").tail(1)
    assert latest["alarm"].all()  # both units end with a fault
    pages = {path.name for path in Path("report").glob("*.html")}
    assert {"index.html", "fleet.html"} < pages
    assert len(pages) == len(decided) + decided["unit"].nunique() + 2


def test_every_link_leads_to_a_file_or_a_heading():
    headings = {
        "#" + re.sub(r"[^a-z0-9 -]", "", line.lstrip("# ").lower()).replace(" ", "-")
        for line in README_TEXT.splitlines()
        if line.startswith("#")
    }
    links = re.findall(r"\]\(([^):]+)\)", README_TEXT)
    assert "notebooks/simulated.png" in links
    for link in links:
        assert link in headings or (README.parent / link).exists(), link
