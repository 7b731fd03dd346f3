"""Tables of chapter 4: outcomes, motion, and the orders that determine the decisions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from chapter4_inputs import commanded_speed
from chapter4_spectra import READINGS, SIGNALS, Campaign
from chapter4_study import GROUPS, Study, explained_shares, outcome_shares
from emacm.simulation.laboratory import CONDITIONS


def shares_table(studies: Sequence[Study]) -> pd.DataFrame:
    """Return the shares of each group of orders in the decisions of each classifier.

    Returns
    -------
    DataFrame
        One row per classifier: "signal", "conditions", for each of `GROUPS` its share and its
        share by chance, lines at which the healthy unit has more power, the variance of the first
        two components, and the part of the variance of the first component between conditions,
        all in per cent. Medians over `studies` (pairs of units); "lowest" and "highest" are
        their range.
    """
    table = pd.concat([_shares_of_one(study) for study in studies])
    groups = table.groupby(["signal", "conditions"], sort=False)
    lowest, highest = (
        getattr(groups[[f"{group} [%]" for group in GROUPS]], name)() for name in ("min", "max")
    )
    return groups.median().join([lowest.add_suffix(", lowest"), highest.add_suffix(", highest")])


def ranges_as_text(shares: pd.DataFrame) -> pd.DataFrame:
    """Return a `shares_table` as text: medians with their ranges in parentheses.

    Examples
    --------
    >>> row = {f"{group} [%]": [7.0] for group in GROUPS}
    >>> row |= {f"{group} [%], {end}": [5.2] for group in GROUPS for end in ("lowest", "highest")}
    >>> ranges_as_text(pd.DataFrame(row))["shaft [%]"].tolist()
    ['7 (5 to 5)']
    """
    table = shares.copy()
    for name in (f"{group} [%]" for group in GROUPS):
        low, high = (table.pop(f"{name}, {end}") for end in ("lowest", "highest"))
        parts = zip(table[name], low, high, strict=True)
        table[name] = [f"{middle:.0f} ({a:.0f} to {b:.0f})" for middle, a, b in parts]
    return table


def _shares_of_one(study: Study) -> pd.DataFrame:
    rows = []
    for model, explanation in zip(study.models, study.explanations, strict=True):
        shares, chance = explained_shares(explanation), explanation.attrs["chance"]
        healthy = explanation[explanation["louder"] == "healthy"]["share"].sum()
        training = model.signal.rows(model.conditions, training=True)
        first = pd.Series(model.pipeline[0].transform(model.signal.bins[training])[:, 0])
        condition = model.signal.frame["condition"][training].to_numpy()
        between = np.nan  # a classifier of one condition has no difference between conditions
        if model.scheme == "single":
            between = first.groupby(condition).transform("mean").var(ddof=0) / first.var(ddof=0)
        rows.append(
            {
                "signal": SIGNALS[model.signal.channel],
                "conditions": model.label,
                **{f"{group} [%]": shares[group] for group in GROUPS},
                **{f"{group}, by chance [%]": chance[group] for group in GROUPS},
                "healthy unit louder [%]": 100 * float(healthy),
                "variance in two components [%]": 100
                * float(model.pipeline[0].explained_variance_ratio_.sum()),
                "feature 1 between conditions [%]": 100 * float(between),
            }
        )
    return pd.DataFrame(rows)


def lines_table(study: Study, n_lines: int = 8) -> pd.DataFrame:
    """Return the strongest spectral lines of each classifier."""
    tables = []
    for model, explanation in zip(study.models, study.explanations, strict=True):
        top = explanation.head(n_lines)
        table = pd.DataFrame(
            {
                "signal": SIGNALS[model.signal.channel],
                "conditions": model.label,
                "order": top["low"],
                "share [%]": 100 * top["share"],
                "louder": top["louder"],
                "predicted": top["fault"],
                "predicted order": top["fault_order"],
                "group": top["group"],
            }
        )
        tables.append(table)
    return pd.concat(tables, ignore_index=True)


def readings_table(studies: Sequence[Study]) -> pd.DataFrame:
    """Return the outcomes of one pair of units under several readings of the text, as text.

    Returns
    -------
    DataFrame
        One row per reading and classifier: "meaning", and for each signal the shares of correct
        decisions, false alarms and missed detections [%].
    """
    rows = []
    for study in studies:
        shares = outcome_shares(study.decisions, ["scheme", "channel"])
        texts = shares.apply(lambda row: " / ".join(f"{value:.0f}" for value in row), axis=1)
        wide = texts.unstack("channel")[list(SIGNALS)].rename(columns=SIGNALS)
        wide.insert(0, "meaning", READINGS[study.reading].note)
        rows.append(wide)
    names = [study.reading for study in studies]
    return pd.concat(rows, keys=names, names=["reading", "classifier"]).rename_axis(columns=None)


def outcomes_table(decisions: pd.DataFrame) -> pd.DataFrame:
    """Return the outcomes by scheme, signal and condition: the numbers of Figs. 4.65 to 4.72."""
    shares = outcome_shares(decisions, ["scheme", "channel", "condition"])
    return shares.rename(index=SIGNALS, level="channel").rename_axis(
        index={"channel": "signal", "scheme": "classifier"}
    )


def conditions_table(campaign: Campaign) -> pd.DataFrame:
    """Return the motion of the shaft in each condition, from run 1 of the healthy unit."""
    frame = campaign.frame
    rows = [i for i in campaign.kept if frame["health"][i] == "healthy"]
    resampler = READINGS["thesis"].resampler.set_params(direction="strokes")
    table = resampler.quality([campaign.kept[i] for i in rows])
    table.index = pd.Index(frame["condition"][rows], name="condition")
    table = table[["revolutions", "strokes", "longest_stroke", "fastest", "max_order"]]
    table = table.rename(columns={"fastest": "fastest [rad/s]"})
    top = READINGS["thesis"].max_order
    table[f"order {top:g} at most [Hz]"] = top * table["fastest [rad/s]"] / (2 * np.pi)
    table["commanded speed [rev/min]"] = [commanded_speed(CONDITIONS[n]) for n in table.index]
    table["stroke reached [%]"] = [
        100 * float(np.ptp(r.signals["lvdt"]) / np.ptp(r.signals["position_command"]))
        for r in (campaign.kept[i] for i in rows)
    ]
    return table
