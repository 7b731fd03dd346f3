"""Tables of chapter 4: outcomes, motion, and the orders that determine the decisions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from laboratory import CONDITIONS, LaboratoryBench
from scipy.stats import binomtest

from chapter4_inputs import commanded_speed
from chapter4_spectra import READINGS, SIGNALS, Campaign
from chapter4_study import FUSED, GROUPS, SCHEMES, Study, explained_shares, outcome_shares

_TEST_RUNS = 100  # of the thesis: 2 units, 5 conditions, 10 runs


def shares_table(studies: Sequence[Study]) -> pd.DataFrame:
    """Return the shares of each group of orders in the decisions of each classifier, as text.

    Returns
    -------
    DataFrame
        One row per classifier: "signal", "conditions", for each of `GROUPS` its share and its
        share by chance, and lines at which the healthy unit has more power, in per cent: medians
        over `studies` (pairs of units), lowest and highest.
    """
    table = pd.concat([_shares_of_one(study) for study in studies])
    return table.groupby(["signal", "conditions"], sort=False).agg(median_and_range)


def _shares_of_one(study: Study) -> pd.DataFrame:
    rows = []
    for model, explanation in zip(study.models, study.explanations, strict=True):
        shares, chance = explained_shares(explanation), explanation.attrs["chance"]
        healthy = explanation[explanation["louder"] == "healthy"]["share"].sum()
        rows.append(
            {
                "signal": SIGNALS[model.signal.channel],
                "conditions": model.label,
                **{f"{group} [%]": shares[group] for group in GROUPS},
                **{f"{group}, by chance [%]": chance[group] for group in GROUPS},
                "healthy unit louder [%]": 100 * float(healthy),
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


def controls_table(correct: Mapping[str, pd.Series], published: pd.Series) -> pd.DataFrame:
    """Return correct decisions of the thesis' design beside those of its controls, as text [%].

    Parameters
    ----------
    correct : dict of str to Series
        For each design the correct decisions [%] by scheme, channel (or fusion) and pair.
    published : Series
        Those of Tables 4.5 and 4.6, by scheme and channel.

    Returns
    -------
    DataFrame
        One row per scheme and signal: the published share, its 95 % interval (Clopper-Pearson, as
        if the test runs were independent), and the median, lowest and highest of each design.
    """
    columns = ["published", f"95 % interval of {_TEST_RUNS} test runs"]
    keys = [(scheme, channel) for scheme in SCHEMES for channel in (*SIGNALS, *FUSED)]
    rows = {}
    for key in keys:
        row = dict.fromkeys(columns, "")
        if key in published:
            runs = binomtest(round(published[key] * _TEST_RUNS / 100), _TEST_RUNS).proportion_ci()
            limits = f"{100 * runs.low:.0f} to {100 * runs.high:.0f}"
            row = dict(zip(columns, (f"{published[key]:g}", limits), strict=True))
        for design, shares in correct.items():
            n_pairs = shares.index.get_level_values("pair").nunique()
            row[f"{design} ({n_pairs})"] = median_and_range(shares[key])
        rows[SCHEMES[key[0]], SIGNALS.get(key[1], key[1])] = row
    table = pd.DataFrame.from_dict(rows, orient="index")
    table.index = pd.MultiIndex.from_tuples(rows, names=["table", "signal"])
    return table


def folded_table(campaign: Campaign) -> pd.DataFrame:
    """Return which share of the power of each signal is folded from above order 100 [%]."""
    shares = {}
    for channel, name in SIGNALS.items():
        linear, limited = (
            campaign.signal(reading, channel).bins.sum(axis=1)
            for reading in ("thesis", "band-limited")
        )
        shares[name] = 100 * (1 - limited / linear).groupby(campaign.frame["condition"]).median()
    return pd.DataFrame(shares).clip(lower=0)


def median_and_range(values: pd.Series) -> str:
    """Return the median, the lowest and the highest value as text; one number if all are equal.

    Examples
    --------
    >>> median_and_range(pd.Series([50.0, 97, 60])), median_and_range(pd.Series([24.0, 24]))
    ('60 (50 to 97)', '24')
    """
    middle, low, high = (f"{v:.0f}" for v in (values.median(), values.min(), values.max()))
    return middle if low == high else f"{middle} ({low} to {high})"


def conditions_table(campaign: Campaign, healthy: LaboratoryBench) -> pd.DataFrame:
    """Return the motion of the shaft in each condition, from run 1 of the healthy unit."""
    frame = campaign.frame
    rows = [i for i in campaign.kept if frame["health"][i] == "healthy"]
    resampler = READINGS["thesis"].resampler.set_params(direction="strokes")
    table = resampler.quality([campaign.kept[i] for i in rows])
    table.index = pd.Index(frame["condition"][rows], name="condition")
    names = {"longest_stroke": "longest stroke [revolutions]", "fastest": "fastest [rad/s]"}
    table = table[["revolutions", "strokes", *names]].rename(columns=names)
    top = READINGS["thesis"].max_order
    table[f"order {top:g} at most [Hz]"] = top * table["fastest [rad/s]"] / (2 * np.pi)
    table["commanded speed [rev/min]"] = [commanded_speed(CONDITIONS[n]) for n in table.index]
    reached = [float(np.ptp(campaign.kept[i].signals["lvdt"])) for i in rows]
    truths = [healthy.truth(number) for number in table.index]
    commanded = [np.ptp(truth.position_command[truth.times >= 0]) for truth in truths]
    table["stroke reached [%]"] = 100 * np.array(reached) / commanded
    return table
