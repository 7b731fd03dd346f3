"""Chapter 4 of the thesis, its protocol run on the laboratory bench."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import pandas as pd

from emacm.simulation.conditions import CONDITIONS
from emacm.thesis.chapter4_control import (
    CONTROLLED,
    control_campaign,
    control_remark,
    control_table,
)
from emacm.thesis.chapter4_exposure import (
    CALLED,
    COMPARED,
    bearing_table,
    cables_table,
    folded_in,
    motion_and_cables,
)
from emacm.thesis.chapter4_pictures import draw_condition, draw_summary
from emacm.thesis.chapter4_remarks import remarks
from emacm.thesis.chapter4_spectra import READINGS, SIGNALS, Campaign, run_campaign
from emacm.thesis.chapter4_study import GROUPS, SCHEMES, outcome_shares
from emacm.thesis.chapter4_tables import (
    Study,
    carried_table,
    conditions_table,
    lines_table,
    outcomes_table,
    over_pairs,
    readings_table,
    shares_table,
    study,
)
from emacm.thesis.findings import Chapter

# Tables 4.5 and 4.6: correct, false positive, false negative [%].
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
OUTCOME_NAMES = ("correct", "false positive", "false negative")


class Extent(NamedTuple):
    """How much of the chapter is run.

    Attributes
    ----------
    seeds : tuple of int
        Pairs of units.
    n_runs : int
        Runs of each unit in each condition.
    duration : float
        Of a recording [s].
    readings : tuple of str
        Readings of the text, tried with the first pair of units; those of `COMPARED` among them
        are tried with every pair.
    drawn : tuple of int
        Conditions of which pictures are drawn.
    """

    seeds: tuple[int, ...]
    n_runs: int
    duration: float
    readings: tuple[str, ...]
    drawn: tuple[int, ...]


FULL = Extent((0, 1, 2, 3, 4), 20, 10.0, tuple(READINGS), tuple(CONDITIONS))
QUICK = Extent((0,), 8, 3.0, ("thesis", "strokes", "band-limited"), (3,))
_KEYS = ["reading", "signal", "conditions"]


def chapter4(
    *,
    quick: bool = False,
    n_jobs: int | None = None,
    report: Callable[[str], None] | None = None,
) -> Chapter:
    """Run the protocol of chapter 4 on the laboratory bench, and explain what it decides on.

    Parameters
    ----------
    quick : bool
        One pair of units, 8 runs of 3 s, pictures of one condition; seconds, not minutes.
    n_jobs : int, optional
        Processes that simulate and estimate spectra.
    report : callable, optional
        Is given a line of progress now and then.

    Returns
    -------
    Chapter
        24 findings (Tables 4.5 and 4.6), tables and pictures.
    """
    return run_chapter4(QUICK if quick else FULL, n_jobs=n_jobs, report=report)


def run_chapter4(
    extent: Extent,
    *,
    n_jobs: int | None = None,
    report: Callable[[str], None] | None = None,
) -> Chapter:
    """Run as much of the chapter as is wanted.

    Parameters
    ----------
    extent : Extent
        How much.
    n_jobs, report
        As for `chapter4`.

    Returns
    -------
    Chapter
    """
    chapter = Chapter(4, "Test Demonstration")
    settings: dict[str, Any] = {"n_jobs": n_jobs, "report": report, "duration": extent.duration}
    pairs = _Pairs()
    for seed in extent.seeds:
        first = seed == extent.seeds[0]
        campaign = run_campaign(
            seed,
            n_runs=extent.n_runs,
            readings=extent.readings if first else COMPARED,
            keep=first,
            **settings,
        )
        studies = {name: study(campaign, name) for name in campaign.spectra}
        pairs.add(seed, campaign, studies)
        if first:
            chapter.tables["conditions"] = conditions_table(campaign)
            chapter.tables["readings"] = readings_table(list(studies.values()))
            chapter.tables["lines that carry the decisions"] = lines_table(studies["thesis"])
            for condition in extent.drawn:
                draw_condition(chapter, campaign, studies, condition)
                if report is not None:
                    report(f"chapter 4: condition {condition} is drawn")
            first_pair = campaign, studies
    decisions = pd.concat(pairs.decided, ignore_index=True)
    draw_summary(chapter, *first_pair, decisions)
    pairs.tell(chapter)
    _compare(chapter, decisions, chapter.tables["what carries the decisions"])
    chapter.tables["outcomes by condition"] = outcomes_table(decisions)
    controlled = _control(chapter, *first_pair, extent.seeds[0], settings)
    chapter.opening, *chapter.remarks = remarks(
        chapter.tables,
        n_pairs=len(extent.seeds),
        n_runs=extent.n_runs,
        duration=extent.duration,
    )
    chapter.remarks.append(controlled)
    return chapter


class _Pairs:
    """What was found of each pair of units."""

    def __init__(self) -> None:
        self.decided: list[pd.DataFrame] = []
        self.carried: list[pd.DataFrame] = []
        self.shares: list[pd.DataFrame] = []
        self.levels: list[pd.DataFrame] = []
        self.folded: list[pd.DataFrame] = []

    def add(self, seed: int, campaign: Campaign, studies: Mapping[str, Study]) -> None:
        """Note one pair."""
        thesis = studies["thesis"]
        self.decided.append(thesis.decisions.assign(seed=seed))
        self.carried.append(carried_table(campaign, thesis))
        self.shares += [shares_table(studies[name]) for name in COMPARED]
        self.levels += [motion_and_cables(campaign, studies[name]) for name in CALLED]
        self.folded.append(folded_in(campaign))

    def tell(self, chapter: Chapter) -> None:
        """Write tables of medians over the pairs."""
        shares = pd.concat(self.shares).groupby(_KEYS, sort=False).median()
        levels = pd.concat(self.levels).groupby(_KEYS, sort=False).median()
        folded = pd.concat(self.folded).groupby("conditions", sort=False).median()
        conditions = chapter.tables["conditions"]
        tables = chapter.tables
        tables["what carries the decisions"] = over_pairs(pd.concat(self.carried), shares)
        tables["motion against cables"] = cables_table(shares, levels, conditions)
        tables["linear and band-limited"] = bearing_table(shares, folded, conditions)
        tables["shares by reading"] = shares


def _control(
    chapter: Chapter,
    campaign: Campaign,
    studies: Mapping[str, Study],
    seed: int,
    settings: Mapping[str, Any],
) -> str:
    """Run the control with the first pair of units; keep its table, return what it says."""
    again = control_campaign(campaign, seed, readings=list(CALLED), **settings)
    usual = pd.concat([shares_table(studies[name]) for name in CALLED])
    control = pd.concat([shares_table(study(again, name, CONTROLLED)) for name in CALLED])
    table = control_table(usual, control)
    chapter.tables["control: equal noise in the cables"] = table
    strokes = control[(control["reading"] == "strokes") & (control["conditions"] != "all")]
    shaft = strokes.groupby("signal")["shaft [%]"].mean()
    by_shaft = {name: float(shaft[name]) for name in (SIGNALS[c] for c in CONTROLLED)}
    return control_remark(table, by_shaft)


def _compare(chapter: Chapter, decisions: pd.DataFrame, carried: pd.DataFrame) -> None:
    """Set Tables 4.5 and 4.6 beside ours, a finding for each cell."""
    shares = outcome_shares(decisions, ["scheme", "channel", "seed"])
    for scheme, table in SCHEMES.items():
        rows = {}
        for channel, published in PUBLISHED[scheme].items():
            ours = shares.xs((scheme, channel), level=(0, 1))
            for name, value in zip(OUTCOME_NAMES, published, strict=True):
                note = f"{len(ours)} pairs of units on the bench" if len(ours) > 1 else "one pair"
                where = f"{table}, {SIGNALS[channel]}, % {name}"
                finding = chapter.compare(where, value, ours[name], note)
                if not finding.agrees:
                    why = _why(carried.xs(SIGNALS[channel], level="signal"), scheme)
                    chapter.findings[-1] = finding._replace(note=f"{note}; {why}")
                rows[SIGNALS[channel], name] = finding[1:6]
        frame = pd.DataFrame(rows, index=["published", "ours", "lowest", "highest", "agrees"]).T
        chapter.tables[table] = frame.rename_axis(["signal", "% of the test runs"])


def _why(carried: pd.DataFrame, scheme: str) -> str:
    """Say in numbers what a signal's decisions rest on, where they are not the thesis'."""
    single = scheme == "single"
    rows = carried[(carried.index == "all") == single]
    shares = ", ".join(f"{group} {rows[f'{group} [%]'].mean():.0f} %" for group in GROUPS)
    text = f"decided on {shares}"
    if single:
        between = rows["feature 1 between conditions [%]"].iloc[0]
        text += f"; {between:.0f} % of the first feature's variance is between conditions"
    return text
