"""Where chapter 4's decisions are exposed, where not, and the physical reason by condition."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.orders.columns import parse_order_columns
from emacm.simulation.actuator import Actuator
from emacm.simulation.vibration import MODES
from emacm.thesis.chapter4_spectra import SIGNALS, UNITS, Campaign
from emacm.thesis.chapter4_study import Model
from emacm.thesis.chapter4_tables import Study, named

COMPARED = ("thesis", "strokes", "band-limited")  # readings that every pair of units is told by
CALLED = {"thesis": "travel", "strokes": "strokes"}
_PICKING_UP = ("lvdt", "velocity")
_CABLE = (11, 12, 35, 36)  # bins on either side of orders 12 and 36
_MOST = 50.0  # per cent of a decision: the larger part


def motion_and_cables(campaign: Campaign, studied: Study) -> pd.DataFrame:
    """Set what all else scatters from run to run beside what the cables of two units differ by.

    Two principal components follow what varies most. The cables get one of the two where the
    units' difference at orders 12 and 36 exceeds the second pattern in which all other orders
    vary within units, which is mostly the motion.

    Parameters
    ----------
    campaign : Campaign
        Spectra.
    studied : Study
        Of one reading.

    Returns
    -------
    DataFrame
        A row for LVDT and velocity in each condition: "reading", "signal", "conditions"; "first
        scatter" and "second scatter" (standard deviations along the two main patterns within
        units, of all bins but those beside 12 and 36) and "cables" (half the distance of the
        units' means in those: the standard deviation that it makes), in unit².
    """
    rows = []
    for model in studied.models:
        if model.channel not in _PICKING_UP:
            continue
        bins, low, healthy = _training_bins(campaign, model, studied.reading)
        means = bins[healthy].mean(axis=0), bins[~healthy].mean(axis=0)
        within, cable = bins - np.where(healthy[:, np.newaxis], *means), np.isin(low, _CABLE)
        patterns = np.linalg.svd(within[:, ~cable], compute_uv=False) / np.sqrt(len(within))
        rows.append(
            {
                "reading": studied.reading,
                "signal": SIGNALS[model.channel],
                "conditions": named(model),
                "first scatter": patterns[0],
                "second scatter": patterns[1],
                "cables": np.linalg.norm((means[0] - means[1])[cable]) / 2,
            }
        )
    return pd.DataFrame(rows)


def folded_in(campaign: Campaign) -> pd.DataFrame:
    """Return how much of the accelerometer's linearly resampled power folds in from above.

    Returns
    -------
    DataFrame
        "conditions", and "folded in [%]": what band-limited resampling does not find of it,
        of all recordings of a condition.
    """
    frame, powers = campaign.frame, {}
    for reading in ("thesis", "band-limited"):
        table = campaign.spectra[reading]["accelerometer"]
        (block,) = parse_order_columns(list(table.columns)) or ()
        beyond = block.orders >= 1  # the filter takes out what is slower
        powers[reading] = table.loc[:, beyond].sum(axis=1).groupby(frame["condition"]).sum()
    shares = 100 * (1 - powers["band-limited"] / powers["thesis"])
    names = shares.index.astype(str)
    return pd.DataFrame({"conditions": names, "folded in [%]": shares.to_numpy()})


def cables_table(
    shares: pd.DataFrame, levels: pd.DataFrame, conditions: pd.DataFrame
) -> pd.DataFrame:
    """Tell where LVDT and velocity are exposed on orders 12 and 36, over travel and by strokes.

    Parameters
    ----------
    shares : DataFrame
        Medians of `shares_table`, indexed by reading, signal and conditions.
    levels : DataFrame
        Medians of `motion_and_cables`, indexed likewise.
    conditions : DataFrame
        Of `conditions_table`.

    Returns
    -------
    DataFrame
        Indexed by signal and conditions.
    """
    longest = conditions["longest_stroke"].rename(index=str)
    columns = {}
    for reading, called in CALLED.items():
        of_reading, level = shares.xs(reading), levels.xs(reading)
        columns[f"12 and 36, {called} [%]"] = of_reading["electrical noise [%]"]
        columns[f"correct, {called} [%]"] = of_reading["correct [%]"]
        for name in level:
            columns[f"{name}, {called} [unit²]"] = level[name]
    signals = [SIGNALS[channel] for channel in _PICKING_UP]
    table = pd.DataFrame(columns).loc[signals]
    reached = table.index.get_level_values("conditions").map(longest)
    table.insert(0, "longest stroke [rev]", reached)
    return table


def bearing_table(
    shares: pd.DataFrame, folded: pd.DataFrame, conditions: pd.DataFrame
) -> pd.DataFrame:
    """Tell where the accelerometer is exposed on multiples of 6.123, linear and band-limited.

    Parameters
    ----------
    shares, conditions : DataFrame
        As for `cables_table`.
    folded : DataFrame
        Medians of `folded_in`, indexed by conditions.

    Returns
    -------
    DataFrame
        Indexed by conditions. "modes above" are those of the housing whose frequency lies above
        the highest order even at the highest speed, so that linear interpolation folds them in.
    """
    (name,) = (column for column in conditions if str(column).endswith("at most [Hz]"))
    top = conditions[name].rename(index=str)
    own = shares.xs(SIGNALS["accelerometer"], level="signal")
    resonance = Actuator().resonance
    modes = [round(ratio * resonance) for ratio, _ in MODES]
    table = pd.DataFrame(index=own.xs("thesis").index)
    table[name] = table.index.map(top)
    table["modes above [Hz]"] = [
        "–" if np.isnan(hertz) else ", ".join(f"{m}" for m in modes if m > hertz) or "none"
        for hertz in table[name]
    ]
    table["folded in [%]"] = table.index.map(folded["folded in [%]"])
    for reading, called in (("thesis", "linear"), ("band-limited", "band-limited")):
        table[f"inner ring, {called} [%]"] = own.xs(reading)["inner ring [%]"]
        table[f"correct, {called} [%]"] = own.xs(reading)["correct [%]"]
    return table


def exposed_in(shares: pd.Series) -> str:
    """Name the classifiers of which the larger part of the decision is carried so.

    Examples
    --------
    >>> exposed_in(pd.Series({"1": 3.0, "2": 75.0, "4": 99.0, "all": 93.0}))
    'conditions 2 and 4, and all together'
    >>> exposed_in(pd.Series({"1": 3.0, "all": 0.0}))
    'none'
    """
    return _conditions(shares.index[shares > _MOST])


def summary(tables: Mapping[str, pd.DataFrame]) -> str:
    """Say in a few sentences which classifiers are exposed, for the opening of the chapter."""
    cables, bearing = tables["motion against cables"], tables["linear and band-limited"]
    lvdt, velocity = (cables.loc[SIGNALS[channel]] for channel in _PICKING_UP)
    parts = {
        "LVDT, over the travel": lvdt["12 and 36, travel [%]"],
        "LVDT, stroke by stroke": lvdt["12 and 36, strokes [%]"],
        "motor velocity, over the travel": velocity["12 and 36, travel [%]"],
        "motor velocity, stroke by stroke": velocity["12 and 36, strokes [%]"],
    }
    found = "; ".join(f"{name}: {exposed_in(shares)}" for name, shares in parts.items())
    return (
        "Exposed, that is, carried by more than half (median over units), on lines of orders 12 "
        f"and 36: {found}. The accelerometer on multiples of 6.123 and their sidebands, by linear "
        f"interpolation: {exposed_in(bearing['inner ring, linear [%]'])}; without folding: "
        f"{exposed_in(bearing['inner ring, band-limited [%]'])}."
    )


def cables_remark(tables: Mapping[str, pd.DataFrame]) -> str:
    """Say why velocity is exposed where it is, condition by condition."""
    table = tables["motion against cables"].loc[SIGNALS["velocity"]].drop("all")
    said = []
    for called, words in (("travel", "Over the travel"), ("strokes", "Stroke by stroke")):
        names = ("first scatter", "second scatter", "cables")
        first, second, cables = (table[f"{name}, {called} [unit²]"] for name in names)
        share = table[f"12 and 36, {called} [%]"]
        said.append(
            f"{words}: "
            + "; ".join(
                f"condition {n} {first[n]:.2g} and {second[n]:.2g} beside {cables[n]:.2g}, orders "
                f"12 and 36 carry {share[n]:.0f} %"
                for n in table.index
            )
        )
    strokes = table["12 and 36, strokes [%]"]
    hidden = strokes.index[strokes <= _MOST]
    text = (
        "Motor velocity, condition by condition: two components follow what varies most, so they "
        "find orders 12 and 36 where the cables make the units differ by much more than the second "
        "pattern in which all else scatters from run to run (first and second pattern beside the "
        f"cables, in ({UNITS['velocity']})²). {'. '.join(said)}. Over the travel a triangular "
        "command flips the sign of a full speed at each turn (conditions 2, 3, 5), and the jump "
        "spreads over all orders, otherwise in each run; a sine (condition 4) passes through zero, "
        "and its motion varies in one pattern. "
    )
    if not len(hidden):
        return text + "Stroke by stroke the flip is gone, and all conditions are exposed."
    longest = table["longest stroke [rev]"]
    short = [f"{number} ({longest[number]:.2f} revolutions)" for number in hidden]
    return text + (
        f"Stroke by stroke the flip is gone, and what is not exposed is condition "
        f"{', '.join(short)}. A stroke of one revolution is itself a wave of orders 0.5 to 3, "
        "beyond the filter's order 1, and its line at order 12, seen for a revolution, is four "
        "orders wide: components follow the motion, which hardly tells the units apart "
        f"({table['correct, strokes [%]']['1']:.0f} % correct in condition 1). So it is with the "
        "LVDT."
    )


def bearing_remark(tables: Mapping[str, pd.DataFrame]) -> str:
    """Say why folding hides the bearing where it does, condition by condition."""
    table = tables["linear and band-limited"]
    (name,) = (column for column in table if str(column).endswith("at most [Hz]"))
    said = []
    for number, row in table.drop("all").iterrows():
        ring, right = (
            " and ".join(f"{row[f'{kind}, {way} [%]']:.0f}" for way in ("linear", "band-limited"))
            for kind in ("inner ring", "correct")
        )
        modes = row["modes above [Hz]"].replace(", ", " and ")
        said.append(
            f"in {number} order 100 reaches {row[name]:.0f} Hz, modes above it {modes}, "
            f"{row['folded in [%]']:.0f} % of the power is folded in, the inner ring carries "
            f"{ring} %, correct are {right} %"
        )
    return (
        "The accelerometer, linear (thesis) and band-limited, condition by condition: strikes and "
        "rolling ring the modes of the housing in hertz, whatever the speed, and what lies above "
        "order 100 is folded in, smeared over all orders, and louder for the degraded unit. "
        f"By condition, {'; '.join(said)}. Where the shaft is slow and all modes lie above "
        "(condition 1), the housing shakes below order 100 by far less than the noise of the "
        "channel: there the thesis' way decides by folded ringing, which is of the bearing, but "
        "at no order of it, and without folding nothing is left to decide by."
    )


def _training_bins(
    campaign: Campaign, model: Model, reading: str
) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.bool_]]:
    """Return the bins of the training runs, their lower edges, and which units are healthy."""
    rows = campaign.chosen(model.conditions, training=True)
    binning = model.pipeline[0]
    values = np.asarray(binning.transform(campaign.spectra[reading][model.channel][rows]))
    names = binning.get_feature_names_out()
    low = np.array([float(str(name).rpartition("@")[2].partition("-")[0]) for name in names])
    return values, low, (campaign.frame["health"][rows] == "healthy").to_numpy()


def _conditions(names: pd.Index) -> str:
    numbers = [str(name) for name in names if name != "all"]
    text = ""
    if numbers:
        *first, last = numbers
        text = f"conditions {', '.join(first)} and {last}" if first else f"condition {last}"
    if "all" in names:
        text += ", and all together" if text else "all together"
    return text or "none"
