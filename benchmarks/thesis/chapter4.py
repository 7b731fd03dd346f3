"""Chapter 4 of the thesis: its test procedure, applied to the simulated laboratory bench."""

from __future__ import annotations

from typing import NamedTuple

import pandas as pd

from chapter4_inputs import inputs_table
from chapter4_pictures import draw_condition, draw_summary
from chapter4_spectra import READINGS, SIGNALS, run_campaign
from chapter4_study import GROUPS, OUTCOMES, SCHEMES, Study, classified, outcome_shares, study
from chapter4_tables import (
    conditions_table,
    lines_table,
    outcomes_table,
    ranges_as_text,
    readings_table,
    shares_table,
)
from emacm.simulation.fleet import thesis_benches
from emacm.simulation.laboratory import CONDITIONS, PEAK_SPEED, RPM
from findings import Chapter, Report, silent

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
_CLEAR = {"accelerometer": (1, 2)}  # §4.5: conditions without errors under both schemes
_OPENING = (
    "No data of the laboratory were published. The procedure of chapter 4 is applied to a "
    "simulated bench (LaboratoryBench): the results show how the method behaves, not what was "
    "measured. Inputs are in the table below; no constant of the bench was chosen by the result of "
    "a classifier. The electrical noise was given to the healthy unit because section 4.5 reports "
    "it there: results that follow from it illustrate that section; they do not confirm it."
)
_SPEEDS = (
    "Section 4.5 states that the motor was fastest in conditions 1 and 2, and ranks the results "
    "accordingly. By Table 4.3 it is fastest in conditions 3 and 4 (table of conditions). The "
    "ranking is an observation, so Table 4.3 may be misprinted."
)
_READINGS = "readings, one pair of units: correct / false alarm / missed detection [%]"


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
    *, quick: bool = False, n_jobs: int | None = None, report: Report = silent
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
        29 findings (Tables 4.5 and 4.6, section 4.5), tables and pictures.

    References
    ----------
    .. [1] Chirico, chapter 4.
    """
    extent = QUICK if quick else FULL
    chapter = Chapter(4, "Test Demonstration", inputs=inputs_table(extent.duration))
    chapter.remarks += [_procedure(extent), _SPEEDS]
    studies: list[Study] = []  # of each pair of units
    for seed in extent.seeds:
        first = seed == extent.seeds[0]
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
            others = [classified(campaign, name) for name in extent.readings if name != "thesis"]
            chapter.tables["conditions"] = conditions_table(campaign)
            chapter.tables[_READINGS] = readings_table([*studies, *others])
            chapter.remarks.append(_reached(chapter.tables["conditions"]))
            chapter.tables["lines that determine the decisions"] = lines_table(studies[0])
            for condition in extent.drawn:
                draw_condition(chapter, campaign, studies[0], condition)
                report(f"chapter 4: pictures of condition {condition}")
    pairs = zip(extent.seeds, studies, strict=True)
    decisions = pd.concat([s.decisions.assign(seed=seed) for seed, s in pairs], ignore_index=True)
    draw_summary(chapter, studies[0], decisions)
    shares = shares_table(studies)
    chapter.tables["orders that determine the decisions"] = ranges_as_text(shares)
    _compare(chapter, decisions, shares)
    _compare_conditions(chapter, decisions)
    chapter.opening = f"{_result(decisions)} {_OPENING}"
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


def _reached(conditions: pd.DataFrame) -> str:
    """State which conditions require more than the peak speed."""
    fast = conditions[conditions["commanded speed [rev/min]"] * RPM > PEAK_SPEED]
    texts = [
        f"Condition {number} requires {row['commanded speed [rev/min]']:.0f} rev/min with the "
        f"assumed lead, more than the peak speed of Table 4.1, 4572 rev/min; the bench reaches "
        f"{row['stroke reached [%]']:.0f} % of its stroke."
        for number, row in fast.iterrows()
    ]
    return " ".join(texts)


def _result(decisions: pd.DataFrame) -> str:
    """Return the shares of correct decisions in a sentence."""
    correct = outcome_shares(decisions, ["scheme", "channel"])["correct"]
    parts = [
        f"{words} " + ", ".join(f"{SIGNALS[c]} {correct[scheme, c]:.0f} %" for c in SIGNALS)
        for scheme, words in (
            ("per condition", "correct decisions of a classifier for each condition:"),
            ("single", "of one classifier for all conditions:"),
        )
    ]
    return f"Result on the simulated bench: {'; '.join(parts)}."


def _compare(chapter: Chapter, decisions: pd.DataFrame, shares: pd.DataFrame) -> None:
    """Compare each cell of Tables 4.5 and 4.6."""
    outcomes = outcome_shares(decisions, ["scheme", "channel", "seed"])
    for scheme, table in SCHEMES.items():
        rows = {}
        for channel, published in PUBLISHED[scheme].items():
            ours = outcomes.xs((scheme, channel), level=(0, 1))
            for name, value in zip(OUTCOMES, published, strict=True):
                where = f"{table}, {SIGNALS[channel]}, % {name}"
                finding = chapter.compare(where, value, ours[name], _pairs(ours), kind="random")
                if not finding.agrees_by_range:
                    why = _why(shares.xs(SIGNALS[channel], level="signal"), scheme)
                    chapter.findings[-1] = finding._replace(note=f"{finding.note}; {why}")
                rows[SIGNALS[channel], name] = finding[2:6]
        frame = pd.DataFrame(rows, index=["published", "ours", "lowest", "highest"]).T
        chapter.tables[table] = frame.rename_axis(["signal", "% of the test runs"])


def _compare_conditions(chapter: Chapter, decisions: pd.DataFrame) -> None:
    """Compare what section 4.5 states in words about single conditions."""
    outcomes = outcome_shares(decisions, ["scheme", "channel", "condition", "seed"])["correct"]
    for channel, conditions in _CLEAR.items():
        for scheme, words in SCHEMES.items():
            for condition in conditions:
                ours = outcomes[scheme, channel, condition]
                where = f"§4.5, {SIGNALS[channel]}, condition {condition}, {words}, % correct"
                note = f"published: no sample was misclassified; {_pairs(ours)}"
                chapter.compare(where, 100, ours, note, kind="random")
    current = outcomes["per condition", "current_a"].unstack("condition")
    ranks = current.rank(axis=1, ascending=False)[[1, 2]].sum(axis=1)
    chapter.compare(
        "§4.5, Current, sum of the ranks of conditions 1 and 2",
        3,
        ranks,
        "published: most successful in conditions 1 and 2, ranks 1 and 2 of 5 by correct "
        f"decisions, a classifier for each condition; {_pairs(ranks)}",
        kind="random",
    )


def _pairs(values: pd.Series | pd.DataFrame) -> str:
    return f"{len(values)} pairs of units on the bench" if len(values) > 1 else "one pair"


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
