"""The report of a reproduction: one HTML file to read, tables and pictures to use."""

from __future__ import annotations

import json
import platform
import re
from base64 import b64encode
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from emacm._version import __version__
from emacm.thesis.findings import Chapter, Finding, findings_frame
from emacm.thesis.report_folder import REPORT

_DPI = 110
_MOST_ROWS = 40  # of a table in the report; a longer one is only begun there
_FEW_ROWS = 8
_MANY_COLUMNS = 8  # of a table that is printed smaller
_STYLE = """
body { font: 16px/1.5 Georgia, serif; color: #111; max-width: 62rem; margin: 2rem auto;
  padding: 0 1rem; }
h1, h2, h3, th, figcaption, caption, nav { font-family: Helvetica, Arial, sans-serif; }
h2 { border-bottom: 1px solid #999; margin-top: 3rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: 1rem 0; font-size: 0.85rem; }
caption { text-align: left; font-weight: bold; padding: 0.3rem 0; }
th, td { border: 1px solid #bbb; padding: 0.2rem 0.5rem; text-align: left; vertical-align: top; }
td.number { text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums; }
tr.no { background: #fbe9dd; }
tr.no td:nth-child(5) { font-weight: bold; }
figure { margin: 1.5rem 0; break-inside: avoid; }
img { max-width: 100%; height: auto; }
figcaption { font-size: 0.9rem; }
@page { margin: 15mm; }
@media print {
  body { margin: 0; max-width: none; font-size: 10pt; }
  .wide { overflow-x: visible; }
  table { font-size: 7.5pt; }
  table.many { font-size: 5.5pt; }
  table.many th, table.many td { padding: 1pt 2pt; }
  thead { display: table-header-group; }
  tr { break-inside: avoid; }
  h2 { break-before: page; }
  h3, caption { break-after: avoid; }
}
"""


class Report:
    """A report in the making.

    Chapters are added one by one; of each only its text is kept in memory, its
    pictures and tables are written at once.

    Parameters
    ----------
    folder : Path
        An empty folder to write to.
    quick : bool
        Whether this is a quick run, which the report then says.

    Attributes
    ----------
    findings : list of Finding
        Those of all chapters added.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     report = Report(Path(folder))
    ...     report.add(Chapter(2, "Spectra", ["A sine reads one half."]))
    ...     report.finish()
    ...     print(*sorted(path.name for path in Path(folder).iterdir()))
    figures report.html summary.json tables
    """

    def __init__(self, folder: Path, *, quick: bool = False) -> None:
        self.folder = Path(folder)
        self.quick = quick
        self.findings: list[Finding] = []
        self._openings: list[str] = []
        self._sections: list[tuple[int, str, str]] = []
        for name in ("figures", "tables"):
            (self.folder / name).mkdir()

    def add(self, chapter: Chapter) -> None:
        """Write the pictures and tables of a chapter, and keep its text.

        Parameters
        ----------
        chapter : Chapter
            What was found. Its pictures are closed.

        Raises
        ------
        ValueError
            If two of its tables or pictures would be files of one name.
        """
        self.findings += chapter.findings
        if chapter.opening:
            self._openings.append(f"Chapter {chapter.number}: {chapter.opening}")
        opening = [chapter.opening] if chapter.opening else []
        parts = [_paragraphs(opening + ([counted(chapter.findings)] if chapter.findings else []))]
        parts += [_findings_html(chapter.findings)] if chapter.findings else []
        parts += [_paragraphs(chapter.remarks)]
        parts += [self._picture(chapter, name) for name in chapter.figures]
        parts += [self._table(chapter, name) for name in chapter.tables]
        self._sections.append((chapter.number, chapter.title, "\n".join(parts)))

    def finish(self) -> None:
        """Write the report, the summary and the table of all findings.

        Raises
        ------
        ValueError
            If a number of a finding is not finite.
        """
        summary = [_plain(finding) for finding in self.findings]
        text = json.dumps(summary, indent=1, ensure_ascii=False, allow_nan=False)
        (self.folder / "summary.json").write_text(text + "\n", encoding="utf-8")
        findings_frame(self.findings).to_csv(self.folder / "tables" / "findings.csv", index=False)
        (self.folder / REPORT).write_text(self._page(), encoding="utf-8")

    def _picture(self, chapter: Chapter, name: str) -> str:
        path = self._free_path("figures", chapter, name, "png")
        figure = chapter.figures[name]
        figure.savefig(path, dpi=_DPI, metadata={"Software": None})
        _close(figure)
        caption = chapter.captions.get(name, "")
        image = b64encode(path.read_bytes()).decode("ascii")
        return (
            f'<figure>\n<img src="data:image/png;base64,{image}" '
            f'alt="{escape(f"{name}: {caption}")}">\n'
            f"<figcaption><b>{escape(name)}.</b> {escape(caption)}</figcaption>\n</figure>"
        )

    def _table(self, chapter: Chapter, name: str) -> str:
        path = self._free_path("tables", chapter, name, "csv")
        table = flat_table(chapter.tables[name])
        table.to_csv(path, index=False)
        shown = table if len(table) <= _MOST_ROWS else table.head(_FEW_ROWS)
        text = _table_html(shown, name)
        if len(shown) < len(table):
            more = f"{len(table) - len(shown)} more rows are in tables/{path.name}."
            text += "\n" + _paragraphs([more])
        return text

    def _free_path(self, kind: str, chapter: Chapter, name: str, ending: str) -> Path:
        path = self.folder / kind / f"chapter{chapter.number}_{_file_name(name)}.{ending}"
        if path.exists():
            raise ValueError(
                f"chapter {chapter.number} has two {kind} that would be {path.name}; name them "
                f"otherwise than {name!r}."
            )
        return path

    def _page(self) -> str:
        links = "".join(
            f'<li><a href="#chapter{n}">Chapter {n}: {escape(title)}</a></li>'
            for n, title, _ in self._sections
        )
        sections = "\n".join(
            f'<section id="chapter{n}">\n<h2>Chapter {n}: {escape(title)}</h2>\n{text}\n</section>'
            for n, title, text in self._sections
        )
        title = "A reproduction by emacm"
        return (
            f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f"<title>{title}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n"
            f"{_paragraphs(self._introduction())}\n<nav><ul>{links}</ul></nav>\n{sections}\n"
            f"</body>\n</html>\n"
        )

    def _introduction(self) -> Iterator[str]:
        yield from self._openings
        yield (
            "The figures of A. J. Chirico III, A Data Driven Frequency Based Method for "
            "Electrical-Mechanical Actuator Condition Monitoring (M.S. thesis, Rochester Institute "
            "of Technology), computed anew."
        )
        yield (
            f"{counted(self.findings)}. Where numbers are random, ours is the median of several "
            f"draws and the range goes from the lowest to the highest: one more draw lies outside "
            f"of the range of n in 2 of n + 1 cases. Nothing was tuned to the published figures; "
            f"what cannot be compared is a remark and no finding."
        )
        if self.quick:
            yield "This was a quick run: fewer draws, and so narrower ranges, than in a full one."
        packages = ("numpy", "scipy", "scikit-learn", "pandas", "matplotlib")
        versions = ", ".join(f"{name} {version(name)}" for name in packages)
        yield f"emacm {__version__}, Python {platform.python_version()}, {versions}."


def counted(findings: Sequence[Finding]) -> str:
    """Say how many published figures lie within the range of ours.

    Examples
    --------
    >>> counted([Finding("Table 1", 2.0, 2.1, 1.9, 2.3, True, "")])
    '1 of 1 published figures lies within the range of ours'
    """
    agreeing = sum(finding.agrees for finding in findings)
    verb = "lies" if agreeing == 1 else "lie"
    return f"{agreeing} of {len(findings)} published figures {verb} within the range of ours"


def flat_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table with plain columns: index levels become columns, column levels one name.

    Examples
    --------
    >>> flat_table(pd.DataFrame({("ours", "e1"): [1]}, index=pd.Index(["y1"], name="part")))
      part  ours, e1
    0   y1         1
    """
    names = [", ".join(map(str, n)) if isinstance(n, tuple) else str(n) for n in table.columns]
    flat = table.set_axis(names, axis=1)
    plain = isinstance(table.index, pd.RangeIndex) and table.index.name is None
    return flat.reset_index(drop=plain)


def _plain(finding: Finding) -> dict[str, Any]:
    """Return a finding as JSON has it."""
    numbers = {name: float(getattr(finding, name)) for name in ("published", "ours", "low", "high")}
    return {**finding._asdict(), **numbers, "agrees": bool(finding.agrees)}


def _close(figure: Any) -> None:
    """Close a picture, also where it is in pyplot's list of open ones."""
    from matplotlib import pyplot

    pyplot.close(figure)


def _file_name(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "unnamed"


def _paragraphs(lines: Iterable[str]) -> str:
    return "\n".join(f"<p>{escape(line)}</p>" for line in lines)


def _findings_html(findings: Sequence[Finding]) -> str:
    rows = []
    for f in findings:
        cells = [(f.where, ""), *((_number(v), "number") for v in (f.published, f.ours))]
        words = "yes" if f.agrees else "no"
        cells += [(f"{_number(f.low)} to {_number(f.high)}", "number"), (words, ""), (f.note, "")]
        rows.append((cells, "" if f.agrees else "no"))
    heads = ("where", "published", "ours", "range of ours", "agrees", "how, and why not")
    return _html_table("Published figures beside ours", heads, rows)


def _table_html(table: pd.DataFrame, caption: str) -> str:
    rows = [
        ([_cell(value) for value in row], "") for row in table.itertuples(index=False, name=None)
    ]
    return _html_table(caption, list(table.columns), rows)


def _html_table(
    caption: str, heads: Sequence[str], rows: Sequence[tuple[list[tuple[str, str]], str]]
) -> str:
    """Lay out rows of (cells, class), a cell being (text, class)."""
    many = "many" if len(heads) > _MANY_COLUMNS else ""
    head = "".join(f'<th scope="col">{escape(str(name))}</th>' for name in heads)
    body = "\n".join(
        f"<tr{_class(kind)}>"
        + "".join(f"<td{_class(k)}>{escape(text)}</td>" for text, k in cells)
        + "</tr>"
        for cells, kind in rows
    )
    return (
        f'<div class="wide"><table{_class(many)}>\n<caption>{escape(caption)}</caption>\n'
        f"<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody>\n</table></div>"
    )


def _class(name: str) -> str:
    return f' class="{name}"' if name else ""


def _cell(value: Any) -> tuple[str, str]:
    if isinstance(value, bool | np.bool_):
        return ("yes" if value else "no"), ""
    if isinstance(value, int | float | np.number):
        return _number(value), "number"
    return ("" if value is None or value is pd.NA else str(value)), ""


def _number(value: Any) -> str:
    """Write a number to four digits; whole ones whole, none as a dash."""
    if np.isnan(value):
        return "–"
    return f"{int(value)}" if float(value).is_integer() else f"{value:.4g}"
