"""Every figure of README and of the site's pages is one that a benchmark wrote.

`figures.txt` has, below the name of each page, text of that page in which a figure is written as
{file / label / label / column:format}. Labels choose the one row of benchmarks/results/file.json
that has all of them. Text without braces has numbers that are no results.
"""

import json
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PLACE = re.compile(r"\{([^{}:]+(?::[^{}:]+)*):([^{}:]+)\}")
RESULT = re.compile(r"\d\.\d+|\d %|\d (?:of|to) \d|\d dB|\| -?\d+ \||\d right")


def sections():
    parts = re.split(
        r"^\[(.+)\]\n", (ROOT / "tests" / "figures.txt").read_text("utf-8"), flags=re.M
    )
    return {page: text.splitlines() for page, text in zip(parts[1::2], parts[2::2], strict=True)}


@cache
def rows(name):
    path = ROOT / "benchmarks" / "results" / f"{name}.json"
    return json.loads(path.read_text(encoding="utf-8"))["rows"]


def figure(place):
    """Return the formatted figure of a place."""
    name, *labels, column = place[1].split(" / ")
    found = [row for row in rows(name) if set(labels) <= set(map(str, row.values()))]
    assert len(found) == 1, f"{len(found)} rows of {name}.json have {labels}"
    return re.sub("(?<=\\d)%", " %", format(found[0][column], place[2]))


def text_of(page):
    """Return a page without code and without line breaks."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return " ".join(re.sub(r"```.*?```|`[^`]*`|\]\([^)]*\)", "`", text, flags=re.S).split())


@pytest.mark.parametrize("page", sections())
def test_each_figure_of_a_page_is_that_of_the_benchmark(page):
    rest, bound = text_of(page), 0
    for line in filter(None, sections()[page]):
        text, n_figures = PLACE.subn(figure, line)
        assert rest.count(text) == 1, f"{page} does not say once: {text}"
        rest, bound = rest.replace(text, "#"), bound + n_figures
    assert bound
    unbound = [rest[max(0, m.start() - 60) : m.end() + 20] for m in RESULT.finditer(rest)]
    assert not unbound


def test_the_pages_with_figures_are_checked():
    pages = {"README.md", "notebooks/accuracy.md"}
    assert pages <= set(sections())


@pytest.mark.parametrize("path", sorted((ROOT / "benchmarks" / "results").glob("*.json")), ids=str)
def test_a_result_says_how_it_was_measured(path):
    found = json.loads(path.read_text(encoding="utf-8"))
    assert found["date"]
    assert found["machine"]["numpy"]
    assert (ROOT / "benchmarks" / f"{path.stem}.py").exists()
