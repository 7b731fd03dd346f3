"""Chapter 4 of the thesis: its test procedure, applied to the simulated laboratory bench."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import pandas as pd

from emacm.simulation.campaign import thesis_benches
from emacm.simulation.conditions import CONDITIONS
from emacm.thesis.chapter4_pictures import draw_condition, draw_summary
from emacm.thesis.chapter4_spectra import MIN_SPEED, READINGS, REVOLUTIONS, SIGNALS, run_campaign
from emacm.thesis.chapter4_study import GROUPS, OUTCOMES, SCHEMES, Study, outcome_shares, study
from emacm.thesis.chapter4_tables import (
    conditions_table,
    lines_table,
    outcomes_table,
    readings_table,
    shares_table,
)
from emacm.thesis.findings import Chapter

# Tables 4.5 and 4.6: correct, false positive (false alarm), false negative (missed detection) [%].
PUBLISHED = {
    "per condition": {
        "lvdt": (100, 0, 0),
        "velocity": (99, 1, 0),
        "current_a": (85, 5, 10),
        "accelerometer": (99, 1, 0),
    },
    "single": {
        "lvdt": (76, 20, 4),
        "velocity": (60, 38, 2),
        "current_a": (55, 39, 6),
        "accelerometer": (69, 11, 20),
    },
}
_OPENING = (
    "No data of the laboratory were published. The procedure of chapter 4 is applied to a "
    "simulated bench (LaboratoryBench): the results show how the method behaves, not what was "
    "measured. Inputs of the simulation: the degraded unit has a defect of the inner ring of "
    "severity 0.5 and 75 % of the grease (severity 0.25), and electrical noise of the motor at "
    "orders 12 and 36 in the cables of LVDT and velocity is 1.0 for the healthy and 0.2 for the "
    "degraded unit, because section 4.5 reports it for the healthy unit. Results that follow from "
    "this noise illustrate what section 4.5 describes; they do not confirm it. No constant of the "
    "bench was chosen by the result of a classifier."
)
_READING = (
    "Table 4.4 states θ_s = 0.02π, which contains 50 orders, but the text describes 100 orders "
    "and 100 features reduced to 2: θ_s = 0.01π and 100 bins of one order are used, and the table "
    "of readings contains the printed value. Resampling is linear, Eq. (2.13), over the travel "
    f"(the integral of |speed|), where the shaft is faster than {MIN_SPEED:g} rad/s: strokes of "
    "condition 1 are one revolution long, so segments must continue over reversals. Segments have "
    f"{REVOLUTIONS} revolutions, Hann window, 50 % overlap; shorter recordings are padded (segment "
    "length and window are not in the thesis). Section 4.3 mentions a filtered PSD without "
    "stating the filter; assumed are the stop band of chapter 3 around the fundamental of the "
    "current (5.6 to 6.4) and, for the other signals, orders below 1, which contain the command. "
    "Components are computed from powers, without logarithm and scaling, as in chapter 3. Section "
    "4.5 states that the motor was fastest in conditions 1 and 2; by Table 4.3 these are the "
    "conditions 3 and 4 (table of conditions)."
)


class Extent(NamedTuple):
    """Amount of computation.

    Attributes
    ----------
    seeds : tuple of int
        Pairs of units.
    n_runs : int
        Runs of each unit in each condition.
    duration : float
        Length of a recording [s].
    readings : tuple of str
        Readings of the text that are computed for the first pair of units.
    drawn : tuple of int
        Conditions of which pictures are drawn.
    """

    seeds: tuple[int, ...]
    n_runs: int
    duration: float
    readings: tuple[str, ...]
    drawn: tuple[int, ...]


FULL = Extent((0, 1, 2, 3, 4), 20, 10.0, tuple(READINGS), tuple(CONDITIONS))
QUICK = Extent((0,), 8, 3.0, ("thesis", "50 orders"), (3,))


def reproduce_chapter4(
    *,
    quick: bool = False,
    n_jobs: int | None = None,
    report: Callable[[str], None] | None = None,
) -> Chapter:
    """Apply the procedure of chapter 4 [1]_ to the laboratory bench, and explain its decisions.

    Parameters
    ----------
    quick : bool
        One pair of units, 8 runs of 3 s, pictures of one condition.
    n_jobs : int, optional
        Number of processes that simulate and estimate spectra.
    report : callable, optional
        Receives lines of progress.

    Returns
    -------
    Chapter
        24 findings (Tables 4.5 and 4.6), tables and pictures.

    References
    ----------
    .. [1] Chirico, chapter 4.
    """
    extent = QUICK if quick else FULL
    chapter = Chapter(4, "Test Demonstration", opening=_OPENING)
    chapter.remarks += [_procedure(extent), _READING]
    studies: list[Study] = []  # of each pair of units
    for seed in extent.seeds:
        first = seed == extent.seeds[0]
        if report is not None:
            report(f"chapter 4: pair of units {len(studies) + 1} of {len(extent.seeds)}")
        campaign = run_campaign(
            thesis_benches(seed=seed, commands=first, duration=extent.duration),
            n_runs=extent.n_runs,
            readings=extent.readings if first else ("thesis",),
            keep=first,
            n_jobs=n_jobs,
            report=report,
        )
        studies.append(study(campaign, "thesis"))
        if first:
            others = [study(campaign, name) for name in extent.readings if name != "thesis"]
            chapter.tables["conditions"] = conditions_table(campaign)
            chapter.tables["readings"] = readings_table([*studies, *others])
            chapter.tables["lines that determine the decisions"] = lines_table(studies[0])
            for condition in extent.drawn:
                draw_condition(chapter, campaign, studies[0], condition)
                if report is not None:
                    report(f"chapter 4: pictures of condition {condition}")
    pairs = zip(extent.seeds, studies, strict=True)
    decisions = pd.concat([s.decisions.assign(seed=seed) for seed, s in pairs], ignore_index=True)
    draw_summary(chapter, studies[0], decisions)
    shares = shares_table(studies)
    chapter.tables["orders that determine the decisions"] = shares
    _compare(chapter, decisions, shares)
    chapter.tables["outcomes by condition"] = outcomes_table(decisions)
    return chapter


def _procedure(extent: Extent) -> str:
    n_pairs, n_training = len(extent.seeds), extent.n_runs // 2
    text = (
        f"Procedure: {n_pairs} {'pair' if n_pairs == 1 else 'pairs'} of units, five conditions, "
        f"{extent.n_runs} runs of {extent.duration:g} s of each unit in each condition, of which 1 "
        f"to {n_training} are for training and {n_training + 1} to {extent.n_runs} for test. Each "
        "signal is used separately; percentages refer to all test runs of both units. The lengths "
        "of recordings and the size of the defect are not in the thesis."
    )
    if extent.n_runs < FULL.n_runs:
        text += (
            f" This is the quick form: the thesis has {FULL.n_runs} runs, and {n_training} "
            "training runs of a class are too few for a covariance, so percentages are rough."
        )
    return text


def _compare(chapter: Chapter, decisions: pd.DataFrame, shares: pd.DataFrame) -> None:
    """Compare each cell of Tables 4.5 and 4.6."""
    outcomes = outcome_shares(decisions, ["scheme", "channel", "seed"])
    for scheme, table in SCHEMES.items():
        rows = {}
        for channel, published in PUBLISHED[scheme].items():
            ours = outcomes.xs((scheme, channel), level=(0, 1))
            for name, value in zip(OUTCOMES, published, strict=True):
                note = f"{len(ours)} pairs of units on the bench" if len(ours) > 1 else "one pair"
                where = f"{table}, {SIGNALS[channel]}, % {name}"
                finding = chapter.compare(where, value, ours[name], note)
                if not finding.agrees:
                    why = _why(shares.xs(SIGNALS[channel], level="signal"), scheme)
                    chapter.findings[-1] = finding._replace(note=f"{note}; {why}")
                rows[SIGNALS[channel], name] = finding[1:6]
        frame = pd.DataFrame(rows, index=["published", "ours", "lowest", "highest", "agrees"]).T
        chapter.tables[table] = frame.rename_axis(["signal", "% of the test runs"])


def _why(shares: pd.DataFrame, scheme: str) -> str:
    """Describe the orders that determine the decisions of a signal."""
    single = scheme == "single"
    rows = shares[(shares.index == "all") == single]
    text = "share of the decision: " + ", ".join(
        f"{group} {rows[f'{group} [%]'].mean():.0f} %" for group in GROUPS
    )
    if single:
        between = rows["feature 1 between conditions [%]"].iloc[0]
        text += f"; {between:.0f} % of the variance of the first feature is between conditions"
    return text
