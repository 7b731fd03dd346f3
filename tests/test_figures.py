"""Every figure of README and of the site's pages is one that a benchmark wrote.

`figures.txt` has, below the name of each page, text of that page in which a figure is written as
{file / label / label / column:format}. Labels choose the one row of benchmarks/results/file.json
that has all of them. Text without braces has numbers that are no results. Rows that are on no page
are below "left out", with patterns of their labels and the reason.
"""

import json
import re
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PLACE = re.compile(r"\{([^{}:]+(?::[^{}:]+)*):([^{}:]+)\}")
RESULT = re.compile(r"\d\.\d+|\d %|\d (?:of|to) \d|\d (?:dB|m?s|[KMG]B|times|right)\b|\| -?\d+ \|")


def sections():
    parts = re.split(r"^\[(.+)\]\n", (ROOT / "tests/figures.txt").read_text("utf-8"), flags=re.M)
    return {page: text.splitlines() for page, text in zip(parts[1::2], parts[2::2], strict=True)}


@cache
def rows(name):
    path = ROOT / "benchmarks" / "results" / f"{name}.json"
    return json.loads(path.read_text(encoding="utf-8"))["rows"]


def rows_of(name, labels):
    """Return the rows of a file that have a value for each label, which may be a pattern."""
    texts = [list(map(str, row.values())) for row in rows(name)]
    return [
        row
        for row, values in zip(rows(name), texts, strict=True)
        if all(any(fnmatchcase(value, label) for value in values) for label in labels)
    ]


def figure(place):
    """Return the formatted figure of a place."""
    name, *labels, column = place[1].split(" / ")
    found = rows_of(name, labels)
    assert len(found) == 1, f"{len(found)} rows of {name}.json have {labels}"
    return re.sub("(?<=\\d)%", " %", format(found[0][column], place[2]))


def text_of(page):
    """Return a page without code and without line breaks."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return " ".join(re.sub(r"```.*?```|`[^`]*`|\]\([^)]*\)", "`", text, flags=re.S).split())


@pytest.mark.parametrize("page", [page for page in sections() if page != "left out"])
def test_each_figure_of_a_page_is_that_of_the_benchmark(page):
    rest, bound = text_of(page), 0
    for line in filter(None, sections()[page]):
        text, n_figures = PLACE.subn(figure, line)
        assert rest.count(text) == 1, f"{page} does not say once: {text}"
        rest, bound = rest.replace(text, "#"), bound + n_figures
    assert bound
    unbound = [rest[max(0, m.start() - 60) : m.end() + 20] for m in RESULT.finditer(rest)]
    assert not unbound


def test_each_row_of_the_results_is_on_a_page_or_left_out_for_a_reason():
    assert {"README.md", "notebooks/accuracy.md"} <= set(sections())
    shown, left_out = [], []
    for page, lines in sections().items():
        for line in filter(None, lines):
            if page == "left out":
                name, *labels = re.fullmatch(r"\{(.+)\} .+", line)[1].split(" / ")
                assert rows_of(name, labels), line
                left_out += rows_of(name, labels)
            else:
                places = [place[1].split(" / ") for place in PLACE.finditer(line)]
                shown += [row for name, *labels, _ in places for row in rows_of(name, labels)]
    for path in (ROOT / "benchmarks" / "results").glob("*.json"):
        assert [row for row in rows(path.stem) if row not in shown + left_out] == [], path.stem


@pytest.mark.parametrize("path", sorted((ROOT / "benchmarks" / "results").glob("*.json")), ids=str)
def test_a_result_says_how_it_was_measured(path):
    found = json.loads(path.read_text(encoding="utf-8"))
    assert found["date"]
    assert found["machine"]["numpy"]
    assert (ROOT / "benchmarks" / f"{path.stem}.py").exists()
