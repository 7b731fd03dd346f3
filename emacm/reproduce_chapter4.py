"""Chapter 4 of the thesis, its protocol run on the laboratory bench."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import pandas as pd

from emacm.bench_conditions import CONDITIONS
from emacm.chapter4_pictures import draw_condition, draw_summary
from emacm.chapter4_remarks import remarks
from emacm.chapter4_spectra import READINGS, SIGNALS, Campaign, run_campaign
from emacm.chapter4_study import (
    GROUPS,
    SCHEMES,
    Model,
    decide,
    explain,
    explained_shares,
    outcome_shares,
    spread_by_condition,
    train,
)
from emacm.findings import Chapter

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
        Readings of the text, tried with the first pair of units.
    drawn : tuple of int
        Conditions of which pictures are drawn.
    """

    seeds: tuple[int, ...]
    n_runs: int
    duration: float
    readings: tuple[str, ...]
    drawn: tuple[int, ...]


FULL = Extent((0, 1, 2, 3, 4), 20, 10.0, tuple(READINGS), tuple(CONDITIONS))
QUICK = Extent((0,), 8, 3.0, ("thesis", "no filter"), (3,))


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
    decided, carried = [], []
    for seed in extent.seeds:
        first = seed == extent.seeds[0]
        campaign = run_campaign(
            seed,
            n_runs=extent.n_runs,
            readings=extent.readings if first else ("thesis",),
            keep=first,
            n_jobs=n_jobs,
            report=report,
            duration=extent.duration,
        )
        models = train(campaign)
        explanations = [explain(campaign, model) for model in models]
        decided.append(decide(campaign, models).assign(seed=seed))
        carried.append(_carried(campaign, models, explanations).assign(seed=seed))
        if first:
            chapter.tables["conditions"] = _conditions(campaign)
            chapter.tables["readings"] = _readings(campaign, extent.readings)
            chapter.tables["lines that carry the decisions"] = _lines(models, explanations)
            for condition in extent.drawn:
                draw_condition(chapter, campaign, models, explanations, condition)
                if report is not None:
                    report(f"chapter 4: condition {condition} is drawn")
            first_pair = campaign, models, explanations
    decisions = pd.concat(decided, ignore_index=True)
    draw_summary(chapter, *first_pair, decisions)
    over_seeds = _over_seeds(pd.concat(carried))
    _compare(chapter, decisions, over_seeds)
    chapter.tables["outcomes by condition"] = _by_condition(decisions)
    chapter.tables["what carries the decisions"] = over_seeds
    chapter.opening, *chapter.remarks = remarks(
        chapter.tables,
        n_pairs=len(extent.seeds),
        n_runs=extent.n_runs,
        duration=extent.duration,
    )
    return chapter


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


def _by_condition(decisions: pd.DataFrame) -> pd.DataFrame:
    """Outcomes of all seeds by scheme, signal and condition: Figs. 4.65 to 4.72 as numbers."""
    shares = outcome_shares(decisions, ["scheme", "channel", "condition"])
    return shares.rename(index=SIGNALS, level="channel").rename_axis(
        index={"channel": "signal", "scheme": "classifier"}
    )


def _carried(
    campaign: Campaign, models: list[Model], explanations: list[pd.DataFrame]
) -> pd.DataFrame:
    """Tell of each classifier which kinds of orders carry it."""
    rows = []
    for model, explanation in zip(models, explanations, strict=True):
        shares, chance = explained_shares(explanation), explanation.attrs["chance"]
        louder = explanation[explanation["louder"] == "healthy"]["share"].sum()
        components = model.pipeline[1].explained_variance_ratio_
        rows.append(
            {
                "signal": SIGNALS[model.channel],
                "conditions": _named(model),
                **{f"{group} [%]": shares[group] for group in GROUPS},
                **{f"{group}, by chance [%]": chance[group] for group in GROUPS},
                "healthy unit louder [%]": 100 * float(louder),
                "variance in two components [%]": 100 * float(components.sum()),
                "feature 1 between conditions [%]": spread_by_condition(campaign, model),
            }
        )
    return pd.DataFrame(rows)


def _over_seeds(carried: pd.DataFrame) -> pd.DataFrame:
    """Median of each number, and the range of the shares, over the pairs of units."""
    groups = carried.drop(columns="seed").groupby(["signal", "conditions"], sort=False)
    medians, lowest, highest = groups.median(), groups.min(), groups.max()
    columns = {}
    for name in map(str, medians):
        columns[name] = medians[name]
        if name.removesuffix(" [%]") in GROUPS:
            columns[f"{name}, lowest"] = lowest[name]
            columns[f"{name}, highest"] = highest[name]
    return pd.DataFrame(columns)


def _lines(models: list[Model], explanations: list[pd.DataFrame], n_lines: int = 8) -> pd.DataFrame:
    """List the strongest lines of each classifier, of the first pair of units."""
    tables = []
    for model, explanation in zip(models, explanations, strict=True):
        top = explanation.head(n_lines)
        table = pd.DataFrame(
            {
                "signal": SIGNALS[model.channel],
                "conditions": _named(model),
                "order": top["low"],
                "share [%]": 100 * top["share"],
                "louder": top["louder"],
                "expected": top["fault"],
                "expected order": top["fault_order"],
                "group": top["group"],
            }
        )
        tables.append(table)
    return pd.concat(tables, ignore_index=True)


def _readings(campaign: Campaign, readings: tuple[str, ...]) -> pd.DataFrame:
    """Tell what becomes of the outcomes under other readings of the text."""
    tables = []
    for reading in readings:
        models = train(campaign, reading)
        decisions = decide(campaign, models, reading)
        table = outcome_shares(decisions, ["scheme", "channel"])
        carried = pd.DataFrame(
            [
                {"scheme": model.scheme, "channel": model.channel}
                | explained_shares(explain(campaign, model, reading))
                for model in models
            ]
        )
        means = carried.groupby(["scheme", "channel"])[list(GROUPS)].mean()  # over conditions
        table = table.join(means.add_suffix(" [%]"))
        tables.append(table)
    table = pd.concat(tables, keys=readings, names=["reading"])
    table = table.rename(index=SIGNALS, level="channel").reset_index()
    table = table.rename(columns={"scheme": "classifier", "channel": "signal"})
    table.insert(1, "meaning", [READINGS[reading].note for reading in table["reading"]])
    return table


def _conditions(campaign: Campaign) -> pd.DataFrame:
    """Tell how the shaft moves in each condition, of run 1 of the healthy unit."""
    frame = campaign.frame
    rows = [i for i in campaign.kept if frame["health"][i] == "healthy"]
    resampler = READINGS["thesis"].resampler.set_params(direction="strokes")
    table = resampler.quality([campaign.kept[i] for i in rows])
    table.index = pd.Index(frame["condition"][rows], name="condition")
    chosen = ["revolutions", "strokes", "longest_stroke", "fastest", "max_order"]
    return table[chosen].rename(columns={"fastest": "fastest [rad/s]"})


def _named(model: Model) -> str:
    return "all" if model.scheme == "single" else str(model.conditions[0])
