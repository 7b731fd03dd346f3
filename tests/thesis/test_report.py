"""A report is whole or not there, needs nothing but itself, and loses no number."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from base64 import b64decode
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from emacm.__main__ import main
from emacm.thesis import reproduction
from emacm.thesis.findings import Chapter, Finding, agreement_frame, findings_frame
from emacm.thesis.report import Report, counted, flat_table
from emacm.thesis.report_folder import check_target, whole_folder

FIELDS = [
    "where", "kind", "published", "ours", "low", "high", "draws", "probability_of_a_miss",
    "agrees_by_range", "agrees_by_median", "note",
]  # fmt: skip
VOID = {"meta", "img", "br", "hr", "link", "input"}


class Page(HTMLParser):
    """Checks that elements close in order, and keeps what refers to something."""

    def __init__(self, text):
        super().__init__()
        self.open, self.images, self.links, self.ids, self.tags = [], [], [], [], []
        self.words = []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.tags.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        for name in ("src", "href", "action", "data", "srcset"):
            if name in attrs:
                (self.images if tag == "img" else self.links).append(attrs[name])
        if "id" in attrs:
            self.ids.append(attrs["id"])
        if tag == "img":
            assert attrs["alt"]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)

    @property
    def text(self):
        return " ".join(self.words)


def page_of(folder):
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>\n<html lang=")
    return Page(text)


def small_chapter(number=2, n_rows=3):
    chapter = Chapter(number, "Spectra & <bins>", ["A remark: 1 < 2 & so on."])
    chapter.compare("Table 1, a", 2.0, [1.5, 2.5], "two draws", kind="random")
    chapter.compare("Table 1, b <x>", 7.0, np.array([1, 2, 4]), "not in the range", kind="random")
    index = pd.MultiIndex.from_product([["hertz", "orders"], range(n_rows)], names=["axis", "run"])
    columns = pd.MultiIndex.from_tuples([("ours", "e1"), ("ours", "e2")])
    numbers = np.random.default_rng(0).normal(size=(2 * n_rows, 2))
    chapter.tables["Table 1.1"] = pd.DataFrame(numbers, index, columns)
    figure = Figure(figsize=(2, 1))
    figure.subplots().plot([0, 1])
    chapter.draw("Fig. 1.1", figure, "A line, from 0 to 1 & no further.")
    return chapter


def write(folder, *chapters, **options):
    report = Report(folder, **options)
    for chapter in chapters:
        report.add(chapter)
    report.finish()
    return report


@pytest.fixture
def stand_in(monkeypatch):
    """Chapters that are made at once; what they were asked is kept."""
    asked = []

    def give(number, make=small_chapter):
        def chapter(*, quick=False, n_jobs=None, report=None):
            asked.append((number, quick, n_jobs))
            report(f"chapter {number}: at work")
            return make(number)

        monkeypatch.setitem(reproduction.CHAPTERS, number, chapter)

    for number in (2, 3, 4, 5):
        give(number)
    give.asked = asked
    return give


# What is in it


def test_the_page_is_well_formed_and_refers_to_nothing_outside(tmp_path):
    write(tmp_path, small_chapter(2), small_chapter(3))
    page = page_of(tmp_path)
    assert "script" not in page.tags
    assert page.links == ["#chapter2", "#chapter3"]
    assert page.ids == ["chapter2", "chapter3"]
    assert len(page.images) == 2
    assert all(image.startswith("data:image/png;base64,") for image in page.images)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "@media print" in text
    for outside in ("http:", "https:", "url(", "@import"):
        assert outside not in text


def test_the_pictures_in_the_page_are_those_in_the_folder(tmp_path):
    write(tmp_path, small_chapter())
    (image,) = page_of(tmp_path).images
    picture = (tmp_path / "figures" / "chapter2_fig_1_1.png").read_bytes()
    assert b64decode(image.partition(",")[2]) == picture
    assert picture.startswith(b"\x89PNG")


def test_words_are_shown_as_they_are(tmp_path):
    write(tmp_path, small_chapter())
    text = page_of(tmp_path).text
    for words in (
        "Chapter 2: Spectra & <bins>",
        "A remark: 1 < 2 & so on.",
        "Table 1, b <x>",
        "A line, from 0 to 1 & no further.",
        "1 of 2 random figures within the range of ours, 1 within its middle half",
        "No measured data were published",
    ):
        assert words in text


def test_a_chapter_opens_with_its_result_and_its_inputs(tmp_path):
    chapter = small_chapter(4)
    chapter.opening = "Result: all of it was simulated."
    chapter.inputs = pd.DataFrame({"value": ["0.2 in"]}, index=pd.Index(["lead"], name="input"))
    write(tmp_path, small_chapter(), chapter)
    text = page_of(tmp_path).text
    places = [
        text.index(words)
        for words in ("computed again: 2 of 4", "Chapter 2: Spectra", "Result: all", "0.2 in")
    ]
    assert places == sorted(places)
    assert places[-1] < text.rindex("Table 1, a")


class Cells(HTMLParser):
    """The cells of all tables by row."""

    def __init__(self, text):
        super().__init__()
        self.rows, self.inside = [], False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        if tag == "tr":
            self.rows.append([])
        self.inside = tag in ("td", "th")
        if self.inside:
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        self.inside = False

    def handle_data(self, data):
        if self.inside:
            self.rows[-1][-1] += data


def test_each_finding_is_a_row_of_the_page_and_says_whether_it_agrees(tmp_path):
    write(tmp_path, small_chapter())
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    rows = Cells(text).rows
    assert rows[:2] == [
        ["kind", "figures", "agree by range", "agree by median", "expected misses"],
        ["random", "2", "1", "1", "1.167"],
    ]
    assert rows[2] == [
        "where", "kind", "published", "ours (median)", "range of ours", "draws",
        "probability of a miss", "agrees by range", "by median", "method, reason",
    ]  # fmt: skip
    assert rows[3] == [
        "Table 1, a", "random", "2", "2", "1.5 to 2.5", "2", "0.6667", "yes", "yes", "two draws",
    ]  # fmt: skip
    assert rows[4] == [
        "Table 1, b <x>", "random", "7", "2", "1 to 4", "3", "0.5", "no", "no", "not in the range",
    ]  # fmt: skip
    assert text.count('<td class="no">no</td>') == 2
    assert not re.search(r'class="no">(?!no<)', text)


def test_short_tables_are_not_divided_in_print(tmp_path):
    chapter = small_chapter()
    chapter.tables = {"few": pd.DataFrame({"n": range(20)}), "many": pd.DataFrame({"n": range(21)})}
    write(tmp_path, chapter)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    for name, undivided in (("few", True), ("many", False)):
        opening = text[: text.index(f"<caption>{name}")].rpartition("<div class=")[2]
        assert opening.startswith('"wide short"') == undivided
    assert "@media print" in text
    assert "break-inside: avoid" in text


def test_long_cells_are_not_shortened(tmp_path):
    chapter = Chapter(2, "Words")
    chapter.compare("Table 1", 1.0, 1.0, "a note of " + 40 * "many words " + "end", kind="input")
    chapter.tables["Long"] = pd.DataFrame({"text": ["x" * 300], "gap": [np.nan]})
    write(tmp_path, chapter)
    rows = Cells((tmp_path / "report.html").read_text(encoding="utf-8")).rows
    assert rows[3][-1] == "a note of " + 40 * "many words " + "end"
    assert rows[5] == ["x" * 300, "–"]


def test_only_a_quick_run_is_called_one(tmp_path):
    for quick in (True, False):
        folder = tmp_path / str(quick)
        folder.mkdir()
        write(folder, small_chapter(), quick=quick)
        assert ("quick run" in page_of(folder).text) is quick


def test_the_summary_holds_one_number_each(tmp_path):
    report = write(tmp_path, small_chapter(2), small_chapter(4))
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert len(summary) == len(report.findings) == 4
    for entry in summary:
        assert list(entry) == FIELDS
        assert all(type(entry[name]) is float for name in FIELDS[2:6])
        assert type(entry["draws"]) is int
        assert type(entry["agrees_by_range"]) is type(entry["agrees_by_median"]) is bool
    assert [Finding(**entry) for entry in summary] == report.findings


def test_tables_come_back_from_their_files(tmp_path):
    chapter = small_chapter()
    report = write(tmp_path, chapter)
    read = pd.read_csv(tmp_path / "tables" / "chapter2_table_1_1.csv")
    assert read.columns.tolist() == ["axis", "run", "ours, e1", "ours, e2"]
    expected = flat_table(chapter.tables["Table 1.1"])
    pd.testing.assert_frame_equal(
        read, expected, rtol=1e-14, check_dtype=False, check_column_type=False
    )
    findings = pd.read_csv(tmp_path / "tables" / "findings.csv")
    pd.testing.assert_frame_equal(
        findings,
        findings_frame(report.findings),
        rtol=1e-14,
        check_dtype=False,
        check_column_type=False,
    )


def test_a_long_table_is_whole_in_its_file_and_begun_in_the_page(tmp_path):
    write(tmp_path, small_chapter(n_rows=30))
    assert len(pd.read_csv(tmp_path / "tables" / "chapter2_table_1_1.csv")) == 60
    page = page_of(tmp_path)
    assert "52 more rows are in tables/chapter2_table_1_1.csv" in page.text
    assert page.tags.count("tr") == (1 + 1) + (1 + 2) + (1 + 8)


def test_a_missing_number_of_a_table_is_a_dash_and_of_a_finding_an_error(tmp_path):
    chapter = Chapter(2, "Gaps", tables={"Gaps": pd.DataFrame({"a": [1.0, np.nan]})})
    report = Report(tmp_path)
    report.add(chapter)
    gap = Chapter(3, "No number")
    gap.compare("a", 1.0, np.nan, "", kind="input")
    report.add(gap)
    with pytest.raises(ValueError, match="not JSON compliant"):
        report.finish()
    assert pd.read_csv(tmp_path / "tables" / "chapter2_gaps.csv")["a"].isna().tolist() == [
        False,
        True,
    ]


def test_two_tables_of_one_file_name_are_refused(tmp_path):
    chapter = Chapter(2, "Twins", tables={"A b": pd.DataFrame(), "a-B": pd.DataFrame()})
    with pytest.raises(ValueError, match=r"chapter 2 has two tables .* chapter2_a_b"):
        Report(tmp_path).add(chapter)


def test_pictures_are_closed_once_they_are_written(tmp_path):
    from matplotlib import pyplot

    before = pyplot.get_fignums()
    chapter = Chapter(2, "Open")
    chapter.draw("Fig. 1", pyplot.figure(), "")
    write(tmp_path, chapter)
    assert pyplot.get_fignums() == before


def test_only_random_figures_count_as_evidence():
    chapter = Chapter(2, "Counts")
    for i in range(7):
        kind = "random" if i % 3 else "arithmetic"
        chapter.compare(str(i), 1.0, [0.0, 1.0, 3.0] if i < 5 else 2.0, "", kind=kind)
    expected = "3 of 4 random figures within the range of ours, 3 within its middle half; "
    assert counted(chapter.findings) == expected + "3 other figures"
    table = agreement_frame(chapter.findings)
    assert table.loc["random"].tolist() == [4, 3, 3, 3 * 2 / 4 + 1]
    assert table.loc["arithmetic"].tolist() == [3, 2, 2, 0]


def test_the_middle_half_of_the_draws_is_narrower_than_their_range():
    chapter = Chapter(2, "Ranges")
    draws = [1.0, 2.0, 3.0, 4.0, 9.0]
    for published, by_range, by_median in (
        (8.0, True, False),
        (2.5, True, True),
        (9.5, False, False),
    ):
        finding = chapter.compare("a", published, draws, "", kind="random")
        assert (finding.ours, finding.draws, finding.probability_of_a_miss) == (3.0, 5, 2 / 6)
        assert (finding.agrees_by_range, finding.agrees_by_median) == (by_range, by_median)
    rounded = chapter.compare("b", 9.4, draws, "", kind="random", slack=0.5)
    assert rounded.agrees_by_range
    assert (rounded.low, rounded.high) == (0.5, 9.5)


def test_a_leading_bin_is_judged_by_its_share_of_the_draws():
    chapter = Chapter(3, "Bins")
    finding = chapter.compare_leader("PC1", 11, [4, 11, 4, 4, 6], ".")
    assert (finding.ours, finding.low, finding.high, finding.draws) == (4, 4, 11, 5)
    assert finding.probability_of_a_miss == pytest.approx(0.8)
    assert (finding.agrees_by_range, finding.agrees_by_median) == (True, False)
    assert finding.note.startswith(
        "most often bin 4, in 3 of 5 draws; the published bin leads in 1"
    )


def test_a_finding_of_an_unknown_kind_is_refused():
    with pytest.raises(ValueError, match="kind must be one of 'arithmetic', 'input', 'random'"):
        Chapter(2, "Kinds").compare("a", 1.0, 1.0, "", kind="chance")


# Where it is written


def test_a_folder_is_there_only_when_all_is_written(tmp_path):
    with whole_folder(tmp_path / "deep" / "out") as folder:
        write(folder, small_chapter())
        assert not (tmp_path / "deep").exists()
    assert (tmp_path / "deep" / "out" / "report.html").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["deep"]


def leave_unfinished(out, error):
    with whole_folder(out) as folder:
        (folder / "figures").mkdir()
        raise error


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_what_is_not_finished_leaves_nothing_behind(tmp_path, error):
    with pytest.raises(error):
        leave_unfinished(tmp_path / "out", error)
    assert not list(tmp_path.iterdir())


def test_an_interruption_while_the_temporary_folder_is_made_leaves_nothing(tmp_path, monkeypatch):
    make = Path.mkdir

    def interrupted(path, *arguments, **options):
        make(path, *arguments, **options)
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "mkdir", interrupted)
    with pytest.raises(KeyboardInterrupt), whole_folder(tmp_path / "out"):
        pass
    assert not list(tmp_path.iterdir())


def test_what_is_not_finished_leaves_the_report_that_was_there(tmp_path):
    with whole_folder(tmp_path) as folder:
        write(folder, small_chapter())
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    with (
        pytest.raises(FileNotFoundError, match="incomplete: summary"),
        whole_folder(tmp_path, overwrite=True) as folder,
    ):
        (folder / "report.html").write_text("half")  # and no other part
    assert {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()} == before


def test_a_new_report_replaces_the_old_one_and_nothing_else(tmp_path):
    with whole_folder(tmp_path) as folder:
        write(folder, small_chapter(2))
    (tmp_path / "mine.txt").write_text("kept")
    with whole_folder(tmp_path, overwrite=True) as folder:
        write(folder, small_chapter(3))
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["figures", "mine.txt", "report.html", "summary.json", "tables"]
    assert [p.name for p in (tmp_path / "figures").iterdir()] == ["chapter3_fig_1_1.png"]


def test_a_folder_of_other_tables_is_not_touched(tmp_path):
    (tmp_path / "tables").mkdir()
    for overwrite in (False, True):
        with pytest.raises(ValueError, match="contains tables, but no report of emacm"):
            check_target(tmp_path, overwrite=overwrite)


# The command


def test_the_command_writes_a_report_and_counts_last(tmp_path, capsys, stand_in):
    assert main(["reproduce", "--out", str(tmp_path / "out"), "--quick", "--jobs", "3"]) == 0
    captured = capsys.readouterr()
    lines = captured.out.splitlines()
    assert lines[-1] == (
        "4 of 8 random figures within the range of ours, 4 within its middle half; 0 other figures"
    )
    assert "Table 1, b <x>: published 7, ours 2 (1 to 4). not in the range" in lines
    assert "chapter 4: at work" in captured.err
    assert stand_in.asked == [(number, True, 3) for number in (2, 3, 4, 5)]
    assert page_of(tmp_path / "out").ids == [f"chapter{number}" for number in (2, 3, 4, 5)]


def test_the_seconds_passed_begin_each_line_of_progress(tmp_path, capsys, stand_in):
    assert main(["reproduce", "--out", str(tmp_path / "out"), "--chapter", "2"]) == 0
    assert capsys.readouterr().err == "[   0 s] chapter 2: at work\n"


def test_the_default_folder_is_emacm_reproduction(tmp_path, monkeypatch, stand_in):
    monkeypatch.chdir(tmp_path)
    assert main(["reproduce", "--chapter", "3"]) == 0
    assert page_of(tmp_path / "emacm_reproduction").ids == ["chapter3"]
    assert stand_in.asked == [(3, False, 2)]


def test_chapters_may_be_chosen_and_are_done_once(tmp_path, stand_in):
    arguments = ["reproduce", "--chapter", "4", "--chapter", "2", "--chapter", "4"]
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 0
    assert [number for number, _, _ in stand_in.asked] == [4, 2]


def refused(arguments, capsys):
    """Return the one line that bad input gets."""
    assert main(["reproduce", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("emacm: ")
    assert captured.err.count("\n") == 1
    assert not captured.out
    return captured.err


def test_an_unknown_chapter_is_one_line_and_exit_code_2(tmp_path, capsys):
    out = ["--out", str(tmp_path / "out")]
    assert "chapter 7 is not reproduced; available are 2, 3, 4, 5." in refused(
        ["--chapter", "7", *out], capsys
    )
    with pytest.raises(SystemExit) as stopped:
        main(["reproduce", "--chapter", "two", *out])
    assert stopped.value.code == 2
    assert "--chapter: invalid int value: 'two'" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_is_one_line_and_exit_code_2(tmp_path, capsys, stand_in):
    (tmp_path / "taken").write_text("")
    for place in ("taken", "taken/below"):
        message = refused(["--out", str(tmp_path / place)], capsys)
        assert "cannot write to the folder" in message
    assert not stand_in.asked
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_a_report_that_is_there_is_kept_unless_it_may_go(tmp_path, capsys, stand_in):
    arguments = ["reproduce", "--chapter", "2", "--out", str(tmp_path)]
    assert main(arguments) == 0
    before = (tmp_path / "report.html").read_bytes()
    capsys.readouterr()
    assert "already contains a report. Pass --overwrite" in refused(arguments[1:], capsys)
    assert (tmp_path / "report.html").read_bytes() == before
    assert main([*arguments[:2], "3", *arguments[3:], "--overwrite"]) == 0
    assert page_of(tmp_path).ids == ["chapter3"]


def test_without_matplotlib_the_extra_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert "pip install 'emacm[plot]'" in refused(["--out", str(tmp_path / "out")], capsys)
    assert not list(tmp_path.iterdir())


def test_a_chapter_that_fails_leaves_nothing_behind(tmp_path, stand_in):
    def fail(number):
        raise RuntimeError("a defect")

    stand_in(3, fail)
    with pytest.raises(RuntimeError, match="a defect"):
        main(["reproduce", "--out", str(tmp_path / "out")])
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_an_interrupted_run_leaves_nothing_behind(tmp_path, capsys, stand_in):
    def interrupt(number):
        raise KeyboardInterrupt

    stand_in(3, interrupt)
    assert main(["reproduce", "--out", str(tmp_path / "out")]) == 130
    assert capsys.readouterr().err.endswith("emacm: interrupted.\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(os.name == "nt", reason="processes are ended otherwise there")
@pytest.mark.slow
def test_a_process_that_is_told_to_end_leaves_nothing_behind(tmp_path):
    command = [sys.executable, "-m", "emacm", "reproduce", "--chapter", "3", "--jobs", "1"]
    environment = os.environ | {"MPLBACKEND": "Agg"}
    process = subprocess.Popen(
        [*command, "--out", str(tmp_path / "out")],
        cwd=Path(__file__).parents[2],
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
    )
    for _ in range(600):
        if list(tmp_path.iterdir()):
            break
        time.sleep(0.1)
    assert list(tmp_path.iterdir())  # at work, in a folder of its own
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "emacm: interrupted." in errors
    assert not list(tmp_path.iterdir())
