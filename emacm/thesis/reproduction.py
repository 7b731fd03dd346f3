"""Reproduction of the thesis: chapters, and the report of their results."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Sequence
from os import PathLike
from pathlib import Path

from emacm._checks import check_choice
from emacm.thesis.chapter2 import reproduce_chapter2
from emacm.thesis.chapter3 import reproduce_chapter3
from emacm.thesis.chapter4 import reproduce_chapter4
from emacm.thesis.chapter5 import reproduce_chapter5
from emacm.thesis.findings import Chapter, Finding
from emacm.thesis.report import Report, counted
from emacm.thesis.report_folder import REPORT, whole_folder

CHAPTERS: dict[int, Callable[..., Chapter]] = {
    2: reproduce_chapter2,
    3: reproduce_chapter3,
    4: reproduce_chapter4,
    5: reproduce_chapter5,
}


def reproduce(
    out: Path,
    chapters: Sequence[int] = tuple(CHAPTERS),
    *,
    quick: bool = False,
    overwrite: bool = False,
    n_jobs: int | None = None,
) -> list[Finding]:
    """Reproduce chapters of the thesis, write the report, and print the findings that disagree.

    Progress is written to stderr.

    Parameters
    ----------
    out : Path
        Folder for the report. After an error it is unchanged.
    chapters : sequence of int
        Numbers of the chapters, in this order.
    quick : bool
        Whether to use fewer draws.
    overwrite : bool
        Whether an existing report may be replaced.
    n_jobs : int, optional
        Number of processes.

    Returns
    -------
    list of Finding
        Published figures and ours.

    Raises
    ------
    OSError
        If the folder cannot be written to.
    TypeError, ValueError
        If a chapter is unknown, the folder already contains a report, or a parameter is invalid.
    """
    if not isinstance(out, str | PathLike):
        raise TypeError(f"out must be the path of a folder, got {out!r}.")
    if isinstance(chapters, str) or not isinstance(chapters, Iterable):
        raise TypeError(f"chapters must be a list of numbers such as [3], got {chapters!r}.")
    check_choice(quick, "quick", (True, False))
    for number in chapters:
        if number not in CHAPTERS:
            known = ", ".join(map(str, CHAPTERS))
            raise ValueError(f"chapter {number} is not reproduced; available are {known}.")
    start = time.perf_counter()

    def report_line(line: str) -> None:
        print(f"[{time.perf_counter() - start:4.0f} s] {line}", file=sys.stderr, flush=True)

    with whole_folder(out, overwrite=overwrite) as folder:
        report = Report(folder, quick=quick)
        for number in chapters:
            report.add(CHAPTERS[number](quick=quick, n_jobs=n_jobs, report=report_line))
        report.finish()
    single = [f for f in report.findings if f.kind == "random" and f.draws == 1]
    for f in report.findings:
        if not (f.agrees_by_range or f in single):
            print(f"{f.where}: published {f.published:g}, ours {f.ours:.4g} ", end="")
            print(f"({f.low:.4g} to {f.high:.4g}). {f.note}")
    if single:
        print(f"{len(single)} random figures rest on a single draw, and are not listed here.")
    print(f"Report written: {Path(out) / REPORT}")
    print(counted(report.findings))
    return report.findings
