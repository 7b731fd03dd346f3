"""The command report and the reports of score: pages of files, with actions, parts and history."""

import json
import os
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands.worn_files import save_trained, write

from emacm import Bearing, Gear
from emacm.__main__ import main
from emacm.reports.inputs import read_actions, read_parts, read_results

pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra 'plot')")
LAYOUT = 'fs = 1000\nvelocity = "speed"\nmeta = "{unit}_{state}_{day:d}"\n[units]\nspeed = "rpm"\n'
PARTS = '[orders]\n"outer race" = 4.7\n'
ACTIONS = 'healthy = "None."\nworn = "Replace the bearing."\n'


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench")
    for name, first in (("training", 0), ("new", 50)):
        (folder / name).mkdir()
        for number in range(12 if name == "training" else 3):
            state = "worn" if number % 3 == 2 else "healthy"
            write(folder / name / f"A_{state}_{number}.npz", state == "worn", first + number)
    (folder / "layout.toml").write_text(LAYOUT)
    (folder / "parts.toml").write_text(PARTS)
    (folder / "actions.toml").write_text(ACTIONS)
    save_trained(folder, "training")
    return folder


def run(command, *arguments, paths=("new",)):
    return main([command, "model.emacm", *paths, "--layout", "layout.toml", *arguments])


REPORT = ("--actions", "actions.toml", "--parts", "parts.toml", "--unit", "unit", "--time", "day")


def test_pages_are_decided_by_the_costs_of_the_command(here, capsys):
    # If the bearing is worn, an inspection costs less than deciding so.
    costs = "decision,healthy,worn\nhealthy,0,9\nworn,4,2\ninspect,1,1\n"
    Path("costs.csv").write_text(costs)
    Path("inspect.toml").write_text('inspect = "Look at the bearing."\n')
    options = ("--cost", "costs.csv", "--actions", "inspect.toml")
    assert run("report", "--out", "pages", "--json", *options) == 0
    assert json.loads(capsys.readouterr().out)[2]["decision"] == "inspect"
    assert run("score", "--out", "made.csv", "--report", "reports", *options) == 0
    assert pd.read_csv("made.csv")["decision"].tolist() == ["healthy", "healthy", "inspect"]
    for folder in (Path("pages"), Path("reports")):
        html = (folder / "A_worn_2.html").read_text(encoding="utf-8")
        assert "Look at the bearing." in html
        assert "of costs.csv" in html


def test_with_healthy_files_the_rise_of_a_line_is_exact(here):
    Path("healthy").mkdir()
    for day in range(4):
        write(Path(f"healthy/A_healthy_{day}.npz"), False, 80 + day)
    arguments = ("--parts", "parts.toml", "--healthy", "healthy", "--out", "worn.html")
    assert run("report", *arguments, paths=["new/A_worn_2.npz"]) == 0
    html = Path("worn.html").read_text(encoding="utf-8")
    assert "mean of the healthy recordings given" in html
    rise = float(re.search(r"<td>outer race</td><td>vib</td><td>4\.75?\b.*?\+(\d+)", html)[1])
    # Amplitude 2 over 0.1, in noise of variance 1 over orders 0 to 34.9; a lobe has five lines.
    line, noise = 2.0**2 / 2, 5 / 4 / 34.9
    assert rise == pytest.approx(10 * np.log10((line + noise) / (0.1**2 / 2 + noise)), abs=1.5)


def test_earlier_results_state_since_when(here):
    table = {"recording": ["old/A_worn_0.npz", "old/A_worn_1.npz"], "decision": ["healthy", "worn"]}
    pd.DataFrame(table).to_csv("earlier.csv", index=False)
    paths = ["new/A_worn_2.npz", "new/A_worn_9.npz"]
    options = ("--history", "earlier.csv", *REPORT, "--out", "all.html")
    assert run("report", *options, paths=paths) == 3
    html = Path("all.html").read_text(encoding="utf-8")
    assert "Since day 1, in 2 recordings in a row" in html
    assert "there is no file" in html or "No such file" in html


@pytest.mark.slow
def test_a_history_gives_the_page_of_the_fleet_with_links_to_recordings(here):
    assert run("score", "--out", "seen.sqlite", "--unit", "unit", "--report", "pages") == 0
    assert run("report", "--history", "seen.sqlite", "--unit", "unit") == 0
    for folder in map(Path, ("pages", "report")):
        assert '<a href="./fleet.html">' in (folder / "index.html").read_text(encoding="utf-8")
        fleet = (folder / "fleet.html").read_text(encoding="utf-8")
        (unit,) = re.findall(r'<td><a href="\./(unit_A_\w+\.html)">A</a></td>', fleet)
        links = re.findall(r'<a href="\./([^"]*)">new/', (folder / unit).read_text("utf-8"))
        assert sorted(links) == ["A_healthy_0.html", "A_healthy_1.html", "A_worn_2.html"]
        assert all((folder / link).is_file() for link in links)


@pytest.mark.slow
def test_score_writes_reports_of_new_files_and_lists_all(here):
    options = ("--out", "table.csv", "--report", "pages", *REPORT)
    assert run("score", *options) == 0
    pages = sorted(path.name for path in Path("pages").glob("*.html"))
    expected = ["A_healthy_0", "A_healthy_1", "A_worn_2", "fleet", "index"]
    assert [page.removesuffix(".html") for page in pages[:-1]] == expected
    assert pages[-1].startswith("unit_A_")
    written = {path: path.stat().st_mtime_ns for path in Path("pages").glob("A_*")}
    write(Path("new/A_worn_3.npz"), True, 77)
    Path("pages/A_healthy_0.html").unlink()  # as after an interruption
    assert run("score", *options) == 0
    new = {path for path in Path("pages").glob("A_*") if path not in written}
    assert new == {Path("pages/A_worn_3.html")}
    same = [path for path, time in written.items() if path.stat().st_mtime_ns == time]
    assert {path.stem for path in same} == {"A_healthy_1", "A_worn_2"}
    html = Path("pages/A_worn_3.html").read_text(encoding="utf-8")
    assert "Since day 2, in 2 recordings in a row" in html
    index = Path("pages/index.html").read_text(encoding="utf-8")
    assert (index.count("<a href="), index.count("Replace the bearing.")) == (5, 2)
    (unit,) = Path("pages").glob("unit_A_*.html")
    assert unit.read_text(encoding="utf-8").count('<a href="./A_') == 4


@pytest.mark.slow
def test_without_a_key_the_time_is_that_of_the_file(here):
    for number, path in enumerate(sorted(Path("new").iterdir())):
        os.utime(path, (1.7e9 + 86400 * number, 1.7e9 + 86400 * number))
    shown = ["new/A_healthy_1.npz", "new/A_worn_2.npz"]
    assert run("report", "--unit", "unit", "--out", "all.html", paths=shown) == 0
    day = pd.Timestamp(1.7e9 + 86400, unit="s")
    html = Path("all.html").read_text(encoding="utf-8")
    assert f"was &#39;healthy&#39; ({day:%Y-%m-%d %H:%M})" in html
    assert f"{day:%Y-%m-%d %H:%M} UTC (file time)</h1>" in html
    Path("new/A_worn_9.npz").write_bytes(b"damaged")
    assert run("report", "--unit", "unit", "--out", "9.html", paths=["new/A_worn_9.npz"]) == 3
    assert "UTC (file time)</h1>" in Path("9.html").read_text(encoding="utf-8")
    # Without a key of the unit, too; the page of the fleet has no other dates.
    assert run("report", "--out", "pages", paths=shown) == 0
    index, fleet = (Path("pages", f"{name}.html").read_text() for name in ("index", "fleet"))
    dates = set(re.findall(r"(\d{4}-\d\d-\d\d \d\d:\d\d) UTC", index))
    assert len(dates) == 2
    assert set(re.findall(r"(\d{4}-\d\d-\d\d \d\d:\d\d) UTC", fleet)) <= dates


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--actions", "parts.toml"], "the action for"),
        (["--actions", "actoins.toml"], "emacm: there is no file 'actoins.toml'."),
        (["--unit", "bench"], "its meta has no 'bench', only ['unit', 'state', 'day']"),
        (["--history", "layout.toml"], "must end with .csv, .jsonl or .sqlite"),
        (["--parts", "layout.toml"], "it has a table 'fs'"),
        (["--out", "layout.toml"], "path must end with .html, or be a folder"),
    ],
)
def test_an_invalid_command_is_status_2_and_one_line(here, capsys, arguments, message):
    Path("parts.toml").write_text("[actions]\nworn = 3\n")
    assert run("report", *arguments) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.err.count("\n") == 1


def test_parts_are_read_by_the_names_of_their_classes(tmp_path):
    file = tmp_path / "parts.toml"
    file.write_text(
        '[[Bearing]]\nn_balls = 9\nball_diameter = 7.94\npitch_diameter = 39.04\nname = "DE"\n'
        "[Gear]\nteeth = 17\nmating_teeth = 43\n[orders]\nsupply = 6\n"
    )
    bearing, gear, orders = read_parts(file)
    assert bearing == Bearing(9, 7.94, 39.04, name="DE")
    assert gear == Gear(17, 43)
    assert orders == {"supply": 6}
    file.write_text("")
    with pytest.raises(ValueError, match="holds no part"):
        read_parts(file)


def test_actions_stand_in_a_table_or_at_the_top(tmp_path):
    (tmp_path / "c.toml").write_text("[actions]\n3 = 'Look.'\n")
    assert read_actions(tmp_path / "c.toml") == {"3": "Look."}
    (tmp_path / "d.toml").write_text("actions = 3\n")
    with pytest.raises(ValueError, match="must hold actions"):
        read_actions(tmp_path / "d.toml")


def test_a_table_of_other_results_is_refused(tmp_path):
    pd.DataFrame({"decision": ["7"]}).to_csv(tmp_path / "u.csv", index=False)
    with pytest.raises(ValueError, match="not a table of emacm score"):
        read_results(tmp_path / "u.csv")
