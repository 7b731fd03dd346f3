"""One run of the command of the thesis; its modules are found by their folder."""

import re
import runpy
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks" / "thesis"
sys.path.insert(0, str(FOLDER))
COMMAND = "python benchmarks/thesis --quick"


@pytest.fixture(scope="session")
def quick_chapter(tmp_path_factory):
    """Return a function of its number: a chapter of the quick run, and its lines of progress."""
    with (
        pytest.MonkeyPatch.context() as patch,
        redirect_stdout(StringIO()),
        redirect_stderr(StringIO()) as progress,
    ):
        patch.setattr("sys.argv", COMMAND.split()[1:])
        patch.chdir(folder := tmp_path_factory.mktemp("thesis"))
        chapters = runpy.run_path(str(FOLDER), run_name="__main__")["chapters"]
    assert (folder / "emacm_reproduction" / "report.html").exists()
    said = [line.partition("] ")[2] for line in progress.getvalue().splitlines()]
    return lambda n: (chapters[n - 2], [text for text in said if text.startswith(f"chapter {n}")])


@pytest.fixture(scope="session")
def figures_of():
    """Return a function: the numbers of the figures that a chapter draws, or names as not drawn."""

    def numbers(text):
        found = set()
        for first, last in re.findall(r"\d\.(\d+)(?:(?: to |-)\d\.(\d+))?", text):
            found |= set(range(int(first), int(last or first) + 1))
        return found

    def named(chapter):
        omitted = [text for text in chapter.remarks if text.startswith("Not drawn: ")]
        return numbers(" ".join(chapter.figures)), numbers(" ".join(omitted))

    return named
