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
        Whether to draw 20 sets of two overlapping classes in place of 200.
    n_jobs : int, optional
        Has no say: all is done in a few seconds.
    report : callable, optional
        Is told in a line what is being done.

    Returns
    -------
    Chapter
        Figures 2.3 to 2.7 and 2.10 to 2.14, Table 2.1 and what else is comparable.

    References
    ----------
    .. [1] Chirico, chapter 2.
    """
    tell = report or (lambda line: None)
    n_errors = 20 if quick else _N_DRAWS
    chapter = Chapter(2, "Feature extraction and classification, by example")
    tell("chapter 2: a ramp in time, in angle, in hertz and in orders")
    compare_resampling(chapter)
    compare_sine(chapter)
    compare_smearing(chapter)
    tell(f"chapter 2: {_N_DRAWS} draws of Table 2.1")
    compare_components(chapter, _N_DRAWS)
    tell(f"chapter 2: {n_errors} draws of two classes, decided under three cost matrices")
    compare_decisions(chapter, n_errors)
    compare_equations(chapter)
    return chapter
