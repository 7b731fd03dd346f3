"""The report of a reproduction: one HTML page, a summary of the findings, tables as CSV files."""

from __future__ import annotations

import json
import platform
import re
from base64 import b64encode
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import pandas as pd

import emacm
from findings import Chapter, counted

REPORT = "report.html"


def write_report(folder: Path, chapters: Sequence[Chapter], *, quick: bool = False) -> None:
    """Write the page, the summary of all findings, and the tables.

    Parameters
    ----------
    folder : Path
        An existing folder.
    chapters : sequence of Chapter
        Results, in this order.
    quick : bool
        Whether this was a quick run, which the page states.

    Raises
    ------
    ValueError
        If a number of a finding is not finite.
    """
    findings = [finding for chapter in chapters for finding in chapter.findings]
    rows = [finding._asdict() for finding in findings]
    summary = json.dumps(rows, indent=1, ensure_ascii=False, allow_nan=False)
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "cell": cell,
        "short": short_name,
        "flat": flat_table,
        "counted": counted,
        "base64": lambda image: b64encode(image).decode("ascii"),
    }
    verdicts = [(verdict, chapter) for chapter in chapters for verdict in chapter.verdicts]
    verdicts.sort(key=lambda pair: pair[0].text)
    packages = ("numpy", "scipy", "scikit-learn", "pandas", "matplotlib")
    page = environment.get_template("report.html.jinja").render(
        chapters=chapters,
        findings=findings,
        verdicts=verdicts,
        first=[(chapter.number, v.evidence) for v, chapter in verdicts if v.first],
        quick=quick,
        versions=", ".join(
            [f"emacm {emacm.__version__}", f"Python {platform.python_version()}"]
            + [f"{name} {version(name)}" for name in packages]
        ),
    )
    (folder / "tables").mkdir(exist_ok=True)
    for chapter in chapters:
        for name, table in chapter.tables.items():
            path = folder / "tables" / f"chapter{chapter.number}_{short_name(name)}.csv"
            flat_table(table).to_csv(path, index=False)
    (folder / "summary.json").write_text(summary + "\n", encoding="utf-8")
    (folder / REPORT).write_text(page, encoding="utf-8")


def short_name(name: str) -> str:
    """Return a name for files and links.

    Examples
    --------
    >>> short_name("Fig. 2.7")
    'fig_2_7'
    """
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def flat_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table without index: its levels become columns, and each column has one name."""
    names = [", ".join(map(str, n)) if isinstance(n, tuple) else str(n) for n in table.columns]
    plain = isinstance(table.index, pd.RangeIndex) and table.index.name is None
    return table.set_axis(names, axis=1).reset_index(drop=plain)


def cell(value: Any) -> str:
    """Return a number with four digits, whole numbers without a point, and "–" for a gap."""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if not isinstance(value, int | float | np.number):
        return str(value)
    if not np.isfinite(value):
        return "–"
    return f"{int(value)}" if float(value).is_integer() else f"{value:.4g}"
