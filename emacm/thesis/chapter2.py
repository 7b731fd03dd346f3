"""Chapter 2 of the thesis: resampling, order spectra, principal components, Bayes' rule."""

from __future__ import annotations

from collections.abc import Callable

from emacm.thesis.chapter2_classes import compare_components, compare_decisions
from emacm.thesis.chapter2_spectra import (
    compare_equations,
    compare_resampling,
    compare_sine,
    compare_smearing,
)
from emacm.thesis.diagrams import draw_chapter2_diagrams
from emacm.thesis.findings import Chapter

_N_DRAWS = 200


def reproduce_chapter2(
    *,
    quick: bool = False,
    n_jobs: int | None = None,
    report: Callable[[str], None] | None = None,
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
        Figures 2.1 to 2.14, Table 2.1 and other comparable numbers.

    References
    ----------
    .. [1] Chirico, chapter 2.
    """
    progress = report or (lambda line: None)
    n_errors = 20 if quick else _N_DRAWS
    chapter = Chapter(2, "Feature extraction and classification, by example")
    progress("chapter 2: speed ramp over time, angle, frequency and order")
    draw_chapter2_diagrams(chapter)
    compare_resampling(chapter)
    compare_sine(chapter)
    compare_smearing(chapter)
    progress(f"chapter 2: {_N_DRAWS} draws of Table 2.1")
    compare_components(chapter, _N_DRAWS)
    progress(f"chapter 2: {n_errors} draws of two classes, three cost matrices")
    compare_decisions(chapter, n_errors)
    compare_equations(chapter)
    return chapter
