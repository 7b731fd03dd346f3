"""What is to be said of chapter 4, with the numbers that came out."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from emacm.thesis.chapter4_exposure import bearing_remark, cables_remark, summary
from emacm.thesis.chapter4_spectra import MIN_SPEED, REVOLUTIONS, SIGNALS
from emacm.thesis.chapter4_study import LINE_WIDTH

_THESIS_RUNS = 20
_CARRIED = "what carries the decisions"


def remarks(
    tables: Mapping[str, pd.DataFrame], *, n_pairs: int, n_runs: int, duration: float
) -> list[str]:
    """Write the paragraphs of the chapter.

    Parameters
    ----------
    tables : mapping of str to DataFrame
        Tables of the chapter.
    n_pairs : int
        Pairs of units.
    n_runs : int
        Runs of each unit in each condition.
    duration : float
        Of a recording [s].

    Returns
    -------
    list of str
        Plain text. The first says that no laboratory data were published.
    """
    return [
        "No data of the laboratory were published. The protocol of chapter 4 is run here on a "
        "model of the bench (LaboratoryBench), which shows how the method behaves, and not what "
        "was measured. No constant of the bench was chosen by what a classifier makes of it; "
        "whether Tables 4.5 and 4.6 lie within our range is reported as it comes. "
        + summary(tables),
        _protocol(n_pairs, n_runs, duration),
        _reading(tables["conditions"]),
        _per_condition(tables["Table 4.5"]),
        _single(tables),
        _noise(tables[_CARRIED]),
        cables_remark(tables),
        _bearing(tables[_CARRIED]),
        bearing_remark(tables),
        _current(tables[_CARRIED]),
        _speeds(tables),
        _others(tables["readings"]),
    ]


def _protocol(n_pairs: int, n_runs: int, duration: float) -> str:
    n_training = n_runs // 2
    pairs = "one pair of units" if n_pairs == 1 else f"{n_pairs} pairs of units, each drawn anew"
    text = (
        f"Protocol: {pairs}, a healthy one and one with a defect of the inner ring and 75 % of the "
        f"grease; five conditions; {n_runs} runs of {duration:g} s of each, of which 1 to "
        f"{n_training} train and {n_training + 1} to {n_runs} test. Each signal by itself; "
        "percentages are shares of all test runs of both units, as in the thesis. The lengths of "
        "recordings and the size of the defect are not in the thesis."
    )
    if n_runs < _THESIS_RUNS:
        text += (
            f" This is the quick form: the thesis has {_THESIS_RUNS} runs, and {n_training} "
            "training runs of a class hardly give a covariance, so percentages are rough."
        )
    return text


def _reading(conditions: pd.DataFrame) -> str:
    longest = conditions["longest_stroke"]
    return (
        "Reading: Table 4.4 prints θ_s = 0.02π, which holds 50 orders, but the text speaks of 100 "
        "orders and of 100 features reduced to 2. θ_s = 0.01π, 100 bins of one order, is taken, "
        "and the printed value is shown beside it. Resampling is linear, Eq. (2.13), over the "
        f"travel (the integral of the speed), where the shaft is faster than {MIN_SPEED:g} rad/s: "
        f"a stroke of condition 1 is {longest[1]:.2f} revolutions long (of condition "
        f"{longest.idxmax()}, {longest.max():.1f}), so segments can only run on over the turns. "
        f"Segments are {REVOLUTIONS} revolutions, Hann, half overlapping; shorter recordings are "
        "padded (L and window are not in the thesis). Section 4.3 speaks of filtered PSD without "
        "saying of what: assumed are the stop band of chapter 3 around the current's fundamental "
        "(orders 5.6 to 6.4), and, for the other signals, orders below 1, where the command lies. "
        "Bins enter the components as powers, neither logarithms nor scaled, as in chapter 3."
    )


def _per_condition(table: pd.DataFrame) -> str:
    found = ", ".join(f"{signal} {_range(table, signal)}" for signal in SIGNALS.values())
    weak = str(table.xs("correct", level=1)["published"].astype(float).idxmin())
    ours = table.xs("correct", level=1)["ours"].astype(float)
    said = (
        "is also the weakest here"
        if ours.idxmin() == weak
        else (f"is not the weakest here ({ours.idxmin()} is)")
    )
    return (
        f"A classifier for each condition is right in these per cent of the test runs: {found}. "
        f"The thesis' weakest signal, {weak.lower()}, {said}. What tells the units apart, fault "
        "or not, repeats from run to run; within a condition little else differs."
    )


def _single(tables: Mapping[str, pd.DataFrame]) -> str:
    table, carried = tables["Table 4.6"], tables[_CARRIED]
    found = ", ".join(f"{signal} {_range(table, signal)}" for signal in SIGNALS.values())
    between = carried.xs("all", level="conditions")["feature 1 between conditions [%]"]
    shares = ", ".join(f"{signal} {share:.0f} %" for signal, share in between.items())
    return (
        f"One classifier for all conditions: {found}. Where it falls, components of raw power have "
        "followed the conditions with the most power: of the variance of the first feature, the "
        f"part between conditions, and not between units or runs, is {shares}. One Gaussian per "
        "class then covers five clusters; a condition whose runs all fall on one side is half "
        "right (table 'outcomes by condition')."
    )


def _noise(carried: pd.DataFrame) -> str:
    lvdt = carried.xs("LVDT", level="signal")
    noise, ring = (
        lvdt[f"{group}, by chance [%]"].max() for group in ("electrical noise", "inner ring")
    )
    louder = lvdt["healthy unit louder [%]"].drop(["1", "all"]).min()
    parts = _listed(lvdt["electrical noise [%]"])
    return (
        f"What carries the LVDT's decisions: lines within {LINE_WIDTH / 2:g} of orders 12 and 36 "
        f"carry, by condition, {parts} (median over units; chance {noise:.0f} %), "
        f"lines of the inner ring at most {lvdt['inner ring [%]'].max():.0f} % (chance "
        f"{ring:.0f} %). It is the healthy unit that is louder there ({louder:.0f} % of the "
        "decision and more in conditions 2 to 5), which no fault of the other unit explains: "
        "section 4.5 found this by looking. Strokes of condition 1, a revolution long, smear a "
        "line over an order on either side."
    )


def _bearing(carried: pd.DataFrame) -> str:
    ring = carried.xs("Y Accelerometer", level="signal")
    return (
        "The accelerometer's decisions rest on multiples of 6.123 and their sidebands, one "
        f"revolution beside them, by {_listed(ring['inner ring [%]'])} (chance "
        f"{ring['inner ring, by chance [%]'].max():.0f} %). Where the share is near chance, the "
        "degraded unit is louder at all orders alike."
    )


def _current(carried: pd.DataFrame) -> str:
    current = carried.xs("Current", level="signal")
    shaft, ring = current["shaft [%]"], current["inner ring [%]"]
    return (
        f"The current is carried by the skirts of its fundamental: sidebands one to three "
        f"revolutions beside order 6 have {shaft.min():.0f} to {shaft.max():.0f} % (chance "
        f"{current['shaft, by chance [%]'].max():.0f} %). Lines of the inner ring, |6 ± 6.123 m|, "
        f"have {ring.min():.0f} to {ring.max():.0f} %, but cover "
        f"{current['inner ring, by chance [%]'].max():.0f} % of the axis, and twice 6.123 less 6 "
        "lies at 6.25, on the skirt itself: as section 4.5 says, this bearing cannot be told from "
        "the supply."
    )


def _speeds(tables: Mapping[str, pd.DataFrame]) -> str:
    fastest = tables["conditions"]["fastest [rad/s]"].sort_values(ascending=False)
    ranked = ", ".join(f"{number} ({speed:.0f} rad/s)" for number, speed in fastest.items())
    outcomes = tables["outcomes by condition"]
    single = outcomes.xs(("single", "Y Accelerometer"), level=(0, 1))["correct"]
    best = " and ".join(str(n) for n in single.sort_values(ascending=False).index[:2])
    return (
        "Section 4.5 says that the motor was fastest in conditions 1 and 2. By Table 4.3 the "
        f"conditions rank {ranked}. One classifier of the accelerometer is best in conditions "
        f"{best} here; the thesis says 1 and 2, which fits its sentence on speeds, not its table."
    )


def _others(readings: pd.DataFrame) -> str:
    first = readings["reading"].iloc[0]
    found = []
    for name, table in readings.groupby("reading", sort=False):
        shares = table.set_index(["classifier", "signal"])["correct"]
        pairs = (
            f"{signal} {shares['per condition', signal]:.0f} and {shares['single', signal]:.0f}"
            for signal in SIGNALS.values()
        )
        found.append(f"{name}: {', '.join(pairs)}")
    without = ""
    if "no filter" in set(readings["reading"]):
        without = (
            " Without a filter the command's own motion and the fundamental take both components."
        )
    return (
        "Other readings, first pair of units, % correct by a classifier per condition and by a "
        f"single one ({first!r} is what is compared above): " + "; ".join(found) + "." + without
    )


def _range(table: pd.DataFrame, signal: str) -> str:
    row = table.xs("correct", level=1).loc[signal]
    span = "" if row["lowest"] == row["highest"] else f", {row['lowest']:g} to {row['highest']:g}"
    return f"{row['ours']:g}{span} (published {row['published']:g})"


def _listed(shares: pd.Series) -> str:
    named = {name: "in all together" if name == "all" else f"in {name}" for name in shares.index}
    return ", ".join(f"{share:.0f} % {named[name]}" for name, share in shares.items())
