"""Findings judge a published number by our draws; the report and its summary lose none of them."""

import json
import runpy
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from findings import Chapter, Finding, Verdict
from report import write_report

FOLDER = Path(__file__).parents[2] / "benchmarks" / "thesis"


def small_chapter(number):
    chapter = Chapter(number, "Spectra & <bins>", pd.DataFrame({"lead": ["0.2 in"]}), "A result.")
    chapter.remarks.append("A remark: 1 < 2.")
    chapter.verdicts.append(Verdict("Three of four & no more.", "Table 1.1", first=number == 4))
    chapter.compare("Table 1, a", 2.0, [1.5, 2.5], "two draws")
    chapter.compare("Table 1, b", 7.0, np.array([1, 2, 4]), "not in the range")
    index = pd.MultiIndex.from_product([["hertz", "orders"], [1, 2]], names=["axis", "run"])
    columns = pd.MultiIndex.from_tuples([("ours", "e1"), ("ours", "e2")])
    table = np.array([[1.5, np.nan], [3, 4], [5, 6], [7, 8.25]])
    chapter.tables["Table 1.1"] = pd.DataFrame(table, index, columns)
    chapter.draw("Fig. 1.1", Figure(figsize=(2, 1)), "A picture.")
    return chapter


def test_the_report_contains_each_finding_table_and_picture(tmp_path):
    chapters = [small_chapter(2), small_chapter(4)]
    write_report(tmp_path, chapters, quick=True)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for words in (
        "quick run", "Spectra &amp; &lt;bins&gt;", "A remark: 1 &lt; 2.", "0.2 in", "A picture.",
        "data:image/png;base64,", "<td>1 to 4</td>", "<th>ours, e1</th>", "<td>8.25</td>",
        "2 of 4 random figures", "@media print", "Three of four &amp; no more.",
        'href="#chapter4_table_1_1"',
    ):  # fmt: skip
        assert words in page
    # A table that the page begins with is not repeated in its chapter.
    places = [page.index(f'id="{name}"') for name in ("chapter4_table_1_1", "chapter2", "chapter4")]
    assert places == sorted(places)
    assert page.count('id="chapter4_table_1_1"') == page.count('id="chapter2_table_1_1"') == 1
    assert "http" not in page  # it needs no other file
    assert page.count("<td class=no>no</td>") == 2 * 2
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    findings = [finding for chapter in chapters for finding in chapter.findings]
    assert [Finding(**entry) for entry in summary] == findings
    read = pd.read_csv(tmp_path / "tables" / "chapter4_table_1_1.csv")
    assert read.columns.tolist() == ["axis", "run", "ours, e1", "ours, e2"]
    assert read["ours, e1"].tolist() == [1.5, 3, 5, 7]


def test_the_range_of_ours_is_without_the_tolerance():
    chapter = Chapter(4, "Tolerance", pd.DataFrame())
    found = chapter.compare("0 %", 0.0, [0.5, 2.0], "one run of 100", tolerance=1.0)
    assert (found.low, found.high, found.tolerance) == (0.5, 2.0, 1.0)
    assert found.agrees_by_range
    assert not chapter.compare("9 %", 9.0, [0.5, 2.0], "", tolerance=1.0).agrees_by_range


def test_the_command_writes_a_report_and_keeps_one_that_is_there(tmp_path, monkeypatch, capsys):
    for number in (2, 4):
        name = f"chapter{number}.reproduce_chapter{number}"
        monkeypatch.setattr(name, lambda number=number, **options: small_chapter(number))
    command = [str(FOLDER), "--quick", "--out", str(tmp_path)]
    monkeypatch.setattr("sys.argv", [*command, "--chapter", "4", "--chapter", "2"])
    runpy.run_path(str(FOLDER), run_name="__main__")
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert len(summary) == 4
    assert capsys.readouterr().out.splitlines()[-1].startswith("2 of 4 random figures")
    with pytest.raises(SystemExit, match="2"):
        runpy.run_path(str(FOLDER), run_name="__main__")
    assert "--overwrite" in capsys.readouterr().err
