"""Chapter 2 of the thesis: resampling, order spectra, principal components, Bayes' rule."""

from __future__ import annotations

import pandas as pd

from chapter2_classes import compare_components, compare_decisions, separation
from chapter2_spectra import compare_equations, compare_resampling, compare_sine, compare_smearing
from findings import Chapter, Report, Verdict, silent

_N_DRAWS = 200


def reproduce_chapter2(
    *, quick: bool = False, n_jobs: int | None = None, report: Report = silent
) -> Chapter:
    """Reproduce chapter 2 of the thesis [1]_.

    Parameters
    ----------
    quick : bool
        Whether to draw 20 sets of two overlapping classes instead of 200.
    n_jobs : int, optional
        Not used: the chapter takes a few seconds.
    report : callable, optional
        Receives lines of progress.

    Returns
    -------
    Chapter
        Figures 2.3 to 2.7 and 2.10 to 2.14, Table 2.1 and other comparable numbers.

    References
    ----------
    .. [1] Chirico, chapter 2.
    """
    n_errors = 20 if quick else _N_DRAWS
    chapter = Chapter(2, "Feature extraction and classification, by example", inputs=_inputs())
    report("chapter 2: speed ramp over time, angle, frequency and order")
    compare_resampling(chapter)
    compare_sine(chapter)
    compare_smearing(chapter)
    report(f"chapter 2: {_N_DRAWS} draws of Table 2.1")
    compare_components(chapter, _N_DRAWS)
    report(f"chapter 2: {n_errors} draws of two classes, three cost matrices")
    compare_decisions(chapter, n_errors)
    compare_equations(chapter)
    chapter.opening = _result(chapter)
    text = chapter.opening.removeprefix("Result: ")
    chapter.verdicts.append(
        Verdict(
            "Chapter 2, is the method right as printed: yes, but for errors of print in Eqs. "
            f"(2.1), (2.9), (2.13) and (2.20) (remarks and last table). {text}",
            "Equations as printed",
        )
    )
    chapter.remarks.append(
        "Not drawn: Figs. 2.1, 2.2, 2.8 and 2.9, which are drawings of the method."
    )
    return chapter


def _inputs() -> pd.DataFrame:
    rows = [
        ("rate of the speed ramp", "1000 Hz", "not in the thesis; assumed"),
        ("resampling", "linear, starting from the preceding sample", "Eq. (2.13), corrected"),
        ("line at half the sampling rate", "counted once", "Eq. (2.20), corrected"),
        ("set of Table 2.1", "500 draws of each of two classes", "Eqs. (2.33) and (2.34)"),
        (
            "distance of the classes of Figs. 2.12 to 2.14",
            f"{separation():.2f} standard deviations",
            "not in the thesis; chosen by the result, the errors of Fig. 2.13",
        ),
        ("cost of Fig. 2.14", "10 for deciding w1 when w2 is true", "Eqs. (2.39) and (2.48)"),
    ]
    return pd.DataFrame(rows, columns=["input", "value", "source"]).set_index("input")


def _result(chapter: Chapter) -> str:
    """Name the figures that do not agree."""
    random = [f for f in chapter.findings if f.draws > 1]
    defined = [f for f in chapter.findings if f.draws == 1]
    others = [f.where for f in chapter.findings if not f.agrees_by_range]
    n_random, n_defined = (sum(f.agrees_by_range for f in part) for part in (random, defined))
    return (
        f"Result: {n_random} of {len(random)} random figures are found again, and {n_defined} of "
        f"{len(defined)} that follow from definitions and are no evidence"
        + (f"; not {'; '.join(others)}." if others else ".")
    )
