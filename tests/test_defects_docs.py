"""Defects of documents, pictures and the repository, each with what is right."""

import json
import re
import runpy
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[1]


def test_a_chapter_that_fails_leaves_the_report_of_those_before_it(tmp_path, monkeypatch, capsys):
    thesis = ROOT / "benchmarks" / "thesis"
    monkeypatch.syspath_prepend(thesis)
    from findings import Chapter

    def computed(number, quick, n_jobs, report):
        if number == 4:
            raise ValueError("a table of chapter 4")
        return Chapter(number, f"Title {number}", pd.DataFrame({"lead": [0.2]}))

    for n in range(2, 6):
        name = f"chapter{n}.reproduce_chapter{n}"
        monkeypatch.setattr(name, lambda n=n, **options: computed(n, **options))
    monkeypatch.setattr("sys.argv", [str(thesis), "--quick", "--out", str(tmp_path)])
    with pytest.raises(ValueError, match="chapter 4"):
        runpy.run_path(str(thesis), run_name="__main__")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Title 2" in page
    assert "Title 3" in page
    assert "not of all chapters, but of: 2, 3." in page
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8")) == []


def test_each_command_that_readme_prints_is_run_as_printed():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    names = ".ci/run", "tests/test_site.py", "tests/thesis/conftest.py"
    ci, site, thesis = ((ROOT / name).read_text("utf-8") for name in names)
    in_ci = [int(n) for n in re.findall(r"readme_command (\d)\)", ci)]
    blocks = len(re.findall(r"```sh\n", readme))
    assert sorted(in_ci) == list(range(1, blocks))  # the last one: tests/test_readme.py
    prose = re.sub(r"```.*?```", "", readme, flags=re.S)
    program = r"`((?:\.venv/bin/)?(?:python|pip|emacm|sphinx-build|bash|ruff|mypy) [^`]+)`"
    # Those of emacm are run by tests/test_readme.py.
    others = [c for c in re.findall(program, prose) if "emacm" not in c.split()[0]]
    assert len(others) > 3
    assert [command for command in others if command not in ci + site + thesis] == []
