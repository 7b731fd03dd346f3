"""The tables of chapter 4: what each classifier decided, and on which orders."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
import pandas as pd

from emacm.thesis.chapter4_spectra import READINGS, SIGNALS, Campaign
from emacm.thesis.chapter4_study import (
    GROUPS,
    Model,
    decide,
    explain,
    explained_shares,
    outcome_shares,
    spread_by_condition,
    train,
)


class Study(NamedTuple):
    """All classifiers of one pair of units under one reading.

    Attributes
    ----------
    reading : str
        Key of `READINGS`.
    models : list of Model
        Trained.
    explanations : list of DataFrame
        Of each, by `explain`.
    decisions : DataFrame
        Of `decide`.
    """

    reading: str
    models: list[Model]
    explanations: list[pd.DataFrame]
    decisions: pd.DataFrame


def study(
    campaign: Campaign, reading: str = "thesis", channels: Collection[str] = tuple(SIGNALS)
) -> Study:
    """Train classifiers of channels as `train` does, let them decide and explain them."""
    models = train(campaign, reading, channels)
    explanations = [explain(campaign, model, reading) for model in models]
    return Study(reading, models, explanations, decide(campaign, models, reading))


def shares_table(studied: Study) -> pd.DataFrame:
    """Tell of each classifier what it decides on and how often it is right.

    Returns
    -------
    DataFrame
        A row a classifier: "reading", "signal", "conditions", per cent in each of `GROUPS`, and
        "correct [%]" of its test runs.
    """
    rows = []
    for model, explanation in zip(studied.models, studied.explanations, strict=True):
        made = studied.decisions
        own = (made["scheme"] == model.scheme) & (made["channel"] == model.channel)
        own &= made["condition"].isin(model.conditions)
        shares = explained_shares(explanation)
        rows.append(
            {
                "reading": studied.reading,
                "signal": SIGNALS[model.channel],
                "conditions": named(model),
                **{f"{group} [%]": share for group, share in shares.items()},
                "correct [%]": 100 * float((made["outcome"][own] == "correct").mean()),
            }
        )
    return pd.DataFrame(rows)


def carried_table(campaign: Campaign, studied: Study) -> pd.DataFrame:
    """Tell of each classifier which kinds of orders carry it, and what its features hold."""
    rows = []
    for model, explanation in zip(studied.models, studied.explanations, strict=True):
        shares, chance = explained_shares(explanation), explanation.attrs["chance"]
        louder = explanation[explanation["louder"] == "healthy"]["share"].sum()
        components = model.pipeline[1].explained_variance_ratio_
        rows.append(
            {
                "signal": SIGNALS[model.channel],
                "conditions": named(model),
                **{f"{group} [%]": shares[group] for group in GROUPS},
                **{f"{group}, by chance [%]": chance[group] for group in GROUPS},
                "healthy unit louder [%]": 100 * float(louder),
                "variance in two components [%]": 100 * float(components.sum()),
                "feature 1 between conditions [%]": spread_by_condition(campaign, model),
            }
        )
    return pd.DataFrame(rows)


def over_pairs(carried: pd.DataFrame, shares: pd.DataFrame) -> pd.DataFrame:
    """Return medians over the pairs of units, and the range of the shares.

    Parameters
    ----------
    carried : DataFrame
        Of `carried_table`, of all pairs.
    shares : DataFrame
        Medians of `shares_table`, indexed by reading, signal and conditions.

    Returns
    -------
    DataFrame
        Indexed by signal and conditions. Beside the shares over the thesis' travel stand those
        stroke by stroke ("…, strokes [%]") and without folding ("…, band-limited [%]").
    """
    groups = carried.groupby(["signal", "conditions"], sort=False)
    medians, lowest, highest = groups.median(), groups.min(), groups.max()
    columns = {}
    for name in map(str, medians):
        columns[name] = medians[name]
        if name.removesuffix(" [%]") in GROUPS:
            columns[f"{name}, lowest"] = lowest[name]
            columns[f"{name}, highest"] = highest[name]
    table = pd.DataFrame(columns)
    for group, reading in (
        ("electrical noise", "strokes"),
        ("inner ring", "strokes"),
        ("inner ring", "band-limited"),
    ):
        table[f"{group}, {reading} [%]"] = shares.xs(reading, level="reading")[f"{group} [%]"]
    return table


def lines_table(studied: Study, n_lines: int = 8) -> pd.DataFrame:
    """List the strongest lines of each classifier."""
    tables = []
    for model, explanation in zip(studied.models, studied.explanations, strict=True):
        top = explanation.head(n_lines)
        table = pd.DataFrame(
            {
                "signal": SIGNALS[model.channel],
                "conditions": named(model),
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


def readings_table(studies: list[Study]) -> pd.DataFrame:
    """Tell what becomes of the outcomes under other readings of the text."""
    tables = []
    for studied in studies:
        carried = pd.DataFrame(
            [
                {"scheme": model.scheme, "channel": model.channel} | explained_shares(explanation)
                for model, explanation in zip(studied.models, studied.explanations, strict=True)
            ]
        )
        means = carried.groupby(["scheme", "channel"])[list(GROUPS)].mean()  # over conditions
        shares = outcome_shares(studied.decisions, ["scheme", "channel"])
        tables.append(shares.join(means.add_suffix(" [%]")))
    names = [studied.reading for studied in studies]
    table = pd.concat(tables, keys=names, names=["reading"])
    table = table.rename(index=SIGNALS, level="channel").reset_index()
    table = table.rename(columns={"scheme": "classifier", "channel": "signal"})
    table.insert(1, "meaning", [READINGS[reading].note for reading in table["reading"]])
    return table


def outcomes_table(decisions: pd.DataFrame) -> pd.DataFrame:
    """Outcomes by scheme, signal and condition: Figs. 4.65 to 4.72 as numbers."""
    shares = outcome_shares(decisions, ["scheme", "channel", "condition"])
    return shares.rename(index=SIGNALS, level="channel").rename_axis(
        index={"channel": "signal", "scheme": "classifier"}
    )


def conditions_table(campaign: Campaign) -> pd.DataFrame:
    """Tell how the shaft moves in each condition, of run 1 of the healthy unit."""
    frame = campaign.frame
    rows = [i for i in campaign.kept if frame["health"][i] == "healthy"]
    resampler = READINGS["thesis"].resampler.set_params(direction="strokes")
    table = resampler.quality([campaign.kept[i] for i in rows])
    table.index = pd.Index(frame["condition"][rows], name="condition")
    chosen = ["revolutions", "strokes", "longest_stroke", "fastest", "max_order"]
    table = table[chosen].rename(columns={"fastest": "fastest [rad/s]"})
    top = READINGS["thesis"].max_order
    table[f"order {top:g} at most [Hz]"] = top * table["fastest [rad/s]"] / (2 * np.pi)
    return table


def named(model: Model) -> str:
    """Return the condition of a classifier, or "all"."""
    return "all" if model.scheme == "single" else str(model.conditions[0])
