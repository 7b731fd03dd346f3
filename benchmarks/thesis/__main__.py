"""Published figures of the thesis, computed again: ``python benchmarks/thesis``.

All chapters are reproduced, and a report compares each published figure with ours: a page
(``report.html``), all findings (``summary.json``) and each table as a CSV file. It is written again
after each chapter.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from threadpoolctl import threadpool_limits

sys.path.append(str(Path(__file__).resolve().parents[1]))  # of the package `laboratory`

from chapter2 import reproduce_chapter2
from chapter3 import reproduce_chapter3
from chapter4 import reproduce_chapter4
from chapter5 import reproduce_chapter5
from findings import Chapter, counted
from report import REPORT, write_report

CHAPTERS = {
    2: reproduce_chapter2,
    3: reproduce_chapter3,
    4: reproduce_chapter4,
    5: reproduce_chapter5,
}


def main() -> list[Chapter]:
    """Reproduce chapters, write the report, and print verdicts and findings that disagree."""
    parser = argparse.ArgumentParser(prog="python benchmarks/thesis", description=__doc__)
    parser.add_argument(
        "--chapter",
        action="append",
        type=int,
        choices=CHAPTERS,
        help="only this chapter; may be given several times (default: all)",
    )
    parser.add_argument("--quick", action="store_true", help="fewer draws: about a minute")
    parser.add_argument(
        "--overwrite", action="store_true", help="replace an existing report in the folder"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("emacm_reproduction"), help="folder (default: %(default)s)"
    )
    parser.add_argument("--jobs", type=int, default=2, help="processes (default: %(default)s)")
    options = parser.parse_args()
    if (options.out / REPORT).exists() and not options.overwrite:
        parser.error(f"{options.out} contains a report: pass --overwrite, or another --out.")
    options.out.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()

    def progress(line: str) -> None:
        print(f"[{time.perf_counter() - start:4.0f} s] {line}", file=sys.stderr, flush=True)

    # A quick run takes less time than starting processes; further threads only wait.
    jobs = None if options.quick else options.jobs
    chapters: list[Chapter] = []
    for number in dict.fromkeys(options.chapter or CHAPTERS):
        with threadpool_limits(1):
            chapters.append(CHAPTERS[number](quick=options.quick, n_jobs=jobs, report=progress))
        # After each chapter: one that fails leaves the report of those before it.
        write_report(options.out, chapters, quick=options.quick)
    findings = [finding for chapter in chapters for finding in chapter.findings]
    print(*sorted(verdict.text for chapter in chapters for verdict in chapter.verdicts), sep="\n")
    for f in findings:
        if not f.agrees_by_range:
            print(
                f"{f.where}: published {f.published:g}, ours {f.ours:.4g} ({f.low:.4g} to "
                f"{f.high:.4g}). {f.note}"
            )
    print(f"Report written: {options.out / REPORT}")
    print(counted(findings))
    return chapters


if __name__ == "__main__":
    chapters = main()
