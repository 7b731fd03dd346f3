"""The report of a reproduction: one HTML page, and its tables and pictures as files."""

from __future__ import annotations

import json
import platform
import re
from base64 import b64encode
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from importlib.metadata import version
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
import pandas as pd

from emacm._version import __version__
from emacm.thesis.findings import Chapter, Finding, agreement_frame, findings_frame
from emacm.thesis.report_folder import REPORT

_TITLE = "Reproduction of the thesis by emacm"
_DPI = 110
_MAX_ROWS = 40  # longer tables are shortened in the page
_FEW_ROWS = 8
_UNDIVIDED = 20  # tables up to this number of rows are not divided in print
_HEADS = [
    "where", "kind", "published", "ours (median)", "range of ours", "draws",
    "probability of a miss", "agrees by range", "by median", "method, reason",
]  # fmt: skip
_KINDS = (
    'Rows of the kind "arithmetic" follow from definitions, and those of the kind "input" find an '
    'input of the simulation again: neither is evidence. A "random" row depends on drawn numbers. '
    "Ours is then the median of the draws. It agrees by range if the published number lies between "
    "the lowest and the highest draw, and by median if it lies between the first and the third "
    "quartile, as about half of further draws would. The probability of a miss is that with which "
    "a further draw of ours would not agree by range: 2/(n + 1) with n draws; for a leading bin "
    "the share of draws in which another bin leads. Rows are counted singly, though some depend on "
    "each other: the three percentages of a signal add up to 100."
)

_PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>
body { font: 16px/1.5 Georgia, serif; color: #111; max-width: 62rem; margin: 2rem auto;
  padding: 0 1rem; }
h1, h2, th, figcaption, caption, nav { font-family: Helvetica, Arial, sans-serif; }
h2 { border-bottom: 1px solid #999; margin-top: 3rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: 1rem 0; font-size: 0.85rem; }
caption { text-align: left; font-weight: bold; padding: 0.3rem 0; }
th, td { border: 1px solid #bbb; padding: 0.2rem 0.5rem; text-align: left; vertical-align: top;
  font-variant-numeric: tabular-nums; }
td.no { background: #fbe9dd; font-weight: bold; }
figure { margin: 1.5rem 0; break-inside: avoid; }
img { max-width: 100%; height: auto; }
figcaption { font-size: 0.9rem; }
.findings td:last-child { min-width: 14rem; }
@media (max-width: 40rem) {
  body { margin: 1rem auto; font-size: 15px; }
  h1 { font-size: 1.5rem; }  h2 { font-size: 1.2rem; }
}
@media print {
  body { margin: 0; max-width: none; font-size: 10pt; }
  .wide { overflow-x: visible; }
  table { font-size: 6.5pt; }
  .findings td:last-child { min-width: 0; }  .short { break-inside: avoid; }
  caption { break-after: avoid; }
  img { max-height: 20cm; }
  thead { display: table-header-group; }
  tr { break-inside: avoid; }
  h2 { break-before: page; }
}
</style>
</head>
<body>
<h1>$title</h1>
$introduction
<nav><ul>$links</ul></nav>
$sections
</body>
</html>
""")
_LINK = Template('<li><a href="#chapter$number">Chapter $number: $title</a></li>')
_SECTION = Template("""<section id="chapter$number">
<h2>Chapter $number: $title</h2>
$text
</section>""")
_FIGURE = Template("""<figure>
<img src="data:image/png;base64,$image" alt="$name: $caption">
<figcaption><b>$name.</b> $caption</figcaption>
</figure>""")


class Report:
    """A report that is written chapter by chapter.

    Only the text of each chapter is kept in memory; its pictures and tables are written at once.

    Parameters
    ----------
    folder : Path
        An empty folder.
    quick : bool
        Whether this is a quick run, which is stated in the report.

    Attributes
    ----------
    findings : list of Finding
        Those of all chapters added.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     report = Report(Path(folder))
    ...     report.add(Chapter(2, "Spectra", ["The power of a sine is one half."]))
    ...     report.finish(), sorted(path.name for path in Path(folder).iterdir())
    (None, ['figures', 'report.html', 'summary.json', 'tables'])
    """

    def __init__(self, folder: Path, *, quick: bool = False) -> None:
        self.folder = Path(folder)
        self.quick = quick
        self.findings: list[Finding] = []
        self._chapters: list[dict[str, Any]] = []
        for name in ("figures", "tables"):
            (self.folder / name).mkdir()

    def add(self, chapter: Chapter) -> None:
        """Write the pictures and tables of a chapter, and keep its text.

        Parameters
        ----------
        chapter : Chapter
            Results. Its pictures are closed.

        Raises
        ------
        ValueError
            If two of its tables or pictures would have the same file name.
        """
        self.findings += chapter.findings
        parts = [_paragraphs([chapter.opening])]
        if chapter.inputs is not None:
            parts.append(_html_table(flat_table(chapter.inputs), "Inputs and chosen readings"))
        if chapter.findings:
            parts += [_paragraphs([counted(chapter.findings) + "."]), _findings(chapter.findings)]
        parts.append(_paragraphs(chapter.remarks))
        parts += [self._picture(chapter, name) for name in chapter.figures]
        parts += [self._table(chapter, name) for name in chapter.tables]
        title, text = escape(chapter.title), "\n".join(parts)
        self._chapters.append({"number": chapter.number, "title": title, "text": text})

    def finish(self) -> None:
        """Write the page, the summary and the table of all findings.

        Raises
        ------
        ValueError
            If a number of a finding is not finite.
        """
        summary = [finding._asdict() for finding in self.findings]
        text = json.dumps(summary, indent=1, ensure_ascii=False, allow_nan=False)
        (self.folder / "summary.json").write_text(text + "\n", encoding="utf-8")
        findings_frame(self.findings).to_csv(self.folder / "tables" / "findings.csv", index=False)
        page = _PAGE.substitute(
            title=_TITLE,
            introduction="\n".join(self._introduction()),
            links="".join(map(_LINK.substitute, self._chapters)),
            sections="\n".join(map(_SECTION.substitute, self._chapters)),
        )
        (self.folder / REPORT).write_text(page, encoding="utf-8")

    def _picture(self, chapter: Chapter, name: str) -> str:
        from matplotlib import pyplot

        path = self._free_path("figures", chapter, name, "png")
        figure = chapter.figures[name]
        figure.set_dpi(_DPI)
        if engine := figure.get_layout_engine():
            # Only once: to save a figure with a layout engine is to draw it twice.
            engine.execute(figure)
            figure.set_layout_engine("none")
        figure.savefig(path, dpi=_DPI, metadata={"Software": None})
        pyplot.close(figure)
        image = b64encode(path.read_bytes()).decode("ascii")
        caption = escape(chapter.captions.get(name, ""))
        return _FIGURE.substitute(image=image, name=escape(name), caption=caption)

    def _table(self, chapter: Chapter, name: str) -> str:
        path = self._free_path("tables", chapter, name, "csv")
        table = flat_table(chapter.tables[name])
        table.to_csv(path, index=False)
        shown = table if len(table) <= _MAX_ROWS else table.head(_FEW_ROWS)
        text = _html_table(shown, name)
        if len(shown) < len(table):
            more = f"{len(table) - len(shown)} more rows are in tables/{path.name}."
            text += "\n" + _paragraphs([more])
        return text

    def _free_path(self, kind: str, chapter: Chapter, name: str, ending: str) -> Path:
        short = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "unnamed"
        path = self.folder / kind / f"chapter{chapter.number}_{short}.{ending}"
        if path.exists():
            raise ValueError(
                f"chapter {chapter.number} has two {kind} with the file name {path.name}; rename "
                f"{name!r}."
            )
        return path

    def _introduction(self) -> Iterator[str]:
        yield _paragraphs([
            "Published figures of A. J. Chirico III, A Data Driven Frequency Based Method for "
            "Electrical-Mechanical Actuator Condition Monitoring (M.S. thesis, Rochester Institute "
            f"of Technology), computed again: {counted(self.findings)}. No measured data were "
            "published: chapter 3 computes its simulated current, and chapters 4 and 5 use a "
            "simulated bench, whose results show how the method behaves and not what was measured."
        ])  # fmt: skip
        if self.quick:
            yield _paragraphs([
                "This was a quick run, with fewer draws and therefore narrower ranges."
            ])  # fmt: skip
        if self.findings:
            table = flat_table(agreement_frame(self.findings))
            yield _html_table(table, "Agreement by kind")
        packages = ("numpy", "scipy", "scikit-learn", "pandas", "matplotlib")
        versions = ", ".join(f"{name} {version(name)}" for name in packages)
        yield _paragraphs([
            _KINDS,
            "Two readings of the text were chosen by their result: the noise of chapter 3 (a "
            "standard deviation of 0.25) and the distance of the classes of Fig. 2.13. Inputs and "
            "the other readings are stated at the beginning of each chapter.",
            f"emacm {__version__}, Python {platform.python_version()}, {versions}.",
        ])  # fmt: skip


def counted(findings: Sequence[Finding]) -> str:
    """Return how many random figures lie within the range of ours, as text.

    Examples
    --------
    >>> chapter = Chapter(2, "Spectra")
    >>> _ = chapter.compare("Table 1", 1.95, [1.9, 2.3], "two draws", kind="random")
    >>> _ = chapter.compare("Table 2", 30.0, 30.0, "half of 60", kind="arithmetic")
    >>> counted(chapter.findings)
    '1 of 1 random figures within the range of ours, 0 within its middle half; 1 other figure'
    """
    random = [finding for finding in findings if finding.kind == "random"]
    within, middle = (
        sum(getattr(finding, f"agrees_by_{by}") for finding in random) for by in ("range", "median")
    )
    others = len(findings) - len(random)
    return (
        f"{within} of {len(random)} random figures within the range of ours, {middle} within its "
        f"middle half; {others} other figure{'s' * (others != 1)}"
    )


def flat_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table without index: its levels become columns, and each column has one name.

    Examples
    --------
    >>> flat_table(pd.DataFrame({("ours", "e1"): [1]}, index=pd.Index(["y1"], name="part")))
      part  ours, e1
    0   y1         1
    """
    names = [", ".join(map(str, n)) if isinstance(n, tuple) else str(n) for n in table.columns]
    plain = isinstance(table.index, pd.RangeIndex) and table.index.name is None
    return table.set_axis(names, axis=1).reset_index(drop=plain)


def _paragraphs(lines: Iterable[str]) -> str:
    return "\n".join(f"<p>{escape(line)}</p>" for line in lines if line)


def _findings(findings: Sequence[Finding]) -> str:
    rows = [
        (
            *f[:4],
            f"{_cell(f.low)} to {_cell(f.high)}",
            f.draws,
            f.probability_of_a_miss,
            f.agrees_by_range,
            f.agrees_by_median,
            f.note,
        )
        for f in findings
    ]
    page = _html_table(pd.DataFrame(rows, columns=_HEADS), "Published figures and ours")
    page = page.replace('class="wide', 'class="wide findings', 1)
    return page.replace("<td>no</td>", '<td class="no">no</td>')


def _html_table(table: pd.DataFrame, caption: str) -> str:
    with pd.option_context("display.max_colwidth", None):  # the default shortens cells
        page = table.map(_cell).to_html(index=False, border=0, justify="left")
    head, body = page.split(">", 1)
    kind = "wide short" if len(table) <= _UNDIVIDED else "wide"  # in print
    return f'<div class="{kind}">{head}>\n<caption>{escape(caption)}</caption>{body}</div>'


def _cell(value: Any) -> str:
    """Return a number with four digits, whole numbers without a point, and "–" for a gap."""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if value is None or value is pd.NA:
        return ""
    if not isinstance(value, int | float | np.number):
        return str(value)
    if np.isnan(value):
        return "–"
    return f"{int(value)}" if float(value).is_integer() else f"{value:.4g}"
