"""Reproduce the thesis: every chapter, and one report of what was found."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from emacm._progress import Teller
from emacm.thesis.findings import Chapter, Finding
from emacm.thesis.report import Report, counted
from emacm.thesis.report_folder import REPORT, whole_folder

CHAPTERS = (2, 3, 4)


def reproduce(
    out: Path,
    chapters: Sequence[int] = CHAPTERS,
    *,
    quick: bool = False,
    overwrite: bool = False,
    n_jobs: int | None = None,
) -> list[Finding]:
    """Reproduce chapters of the thesis, write the report and say what was found.

    Parameters
    ----------
    out : Path
        Folder for the report. It is whole or not there at all.
    chapters : sequence of int
        Which ones, in this order.
    quick : bool
        Whether to make do with fewer draws.
    overwrite : bool
        Whether a report that lies there may be replaced.
    n_jobs : int, optional
        How much may be worked on at the same time.

    Returns
    -------
    list of Finding
        Published figures beside ours.

    Raises
    ------
    OSError
        If the folder cannot be written to.
    ValueError
        If a chapter is not known, or the folder already holds a report.
    """
    makers = [_maker(number) for number in chapters]
    with (
        whole_folder(out, overwrite=overwrite) as folder,
        Teller(len(makers), unit="chapter", file=sys.stderr) as tell,
    ):
        report = Report(folder, quick=quick)
        for maker in makers:
            report.add(maker(quick=quick, n_jobs=n_jobs, report=tell))
            tell.advance()
        report.finish()
    _say(report.findings, Path(out))
    return report.findings


def _maker(number: int) -> Callable[..., Chapter]:
    """Import a chapter only now: --help and other chapters do without it."""
    if number not in CHAPTERS:
        known = ", ".join(map(str, CHAPTERS))
        raise ValueError(f"chapter {number} is not reproduced; there are {known}.")
    module = importlib.import_module(f"emacm.thesis.chapter{number}")
    return getattr(module, f"chapter{number}")


def _say(findings: Sequence[Finding], out: Path) -> None:
    for f in findings:
        if not f.agrees:
            print(f"{f.where}: published {f.published:g}, ours {f.ours:.4g} ", end="")
            print(f"({f.low:.4g} to {f.high:.4g}). {f.note}")
    print(f"Report written: {out / REPORT}")
    print(counted(findings))
