"""What chapter 4 decides from its spectra, and which orders carry the decisions."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.decomposition import PCA
from sklearn.pipeline import Pipeline, make_pipeline

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.displays.outcomes import OUTCOMES
from emacm.explanations.explain import explain_model
from emacm.explanations.fault_matches import match_fault_orders
from emacm.machine.fault_orders import fault_orders
from emacm.machine.parts import Motor
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.columns import parse_order_columns
from emacm.simulation.faults import BEARING, POLE_PAIRS
from emacm.thesis.chapter4_spectra import READINGS, REVOLUTIONS, SIGNALS, Campaign

SCHEMES = {"per condition": "Table 4.5", "single": "Table 4.6"}
GROUPS = ("inner ring", "electrical noise", "shaft")  # kinds of orders that are looked for
LINE_WIDTH = 4 / REVOLUTIONS  # orders, of a Hann window's line at its foot
_NOISE = (2, 6)  # times the supply: orders 12 and 36 of section 4.5
_SHAFT = 3  # multiples of the shaft that are looked for


class Model(NamedTuple):
    """One trained classifier, and where it decides.

    Attributes
    ----------
    scheme : str
        Key of `SCHEMES`.
    channel : str
        The signal it decides from.
    conditions : tuple of int
        Conditions that it was trained in, and decides in.
    pipeline : Pipeline
        From order spectra to decisions.
    """

    scheme: str
    channel: str
    conditions: tuple[int, ...]
    pipeline: Pipeline


def train(
    campaign: Campaign, reading: str = "thesis", channels: Collection[str] = tuple(SIGNALS)
) -> list[Model]:
    """Train all classifiers of the chapter on the first half of the runs.

    Bins of one order, two principal components, Gaussian classes of equal priors and uniform cost
    (Table 4.4), for each signal by itself.

    Parameters
    ----------
    campaign : Campaign
        Spectra.
    reading : str
        Key of `READINGS`.

    channels : collection of str
        Signals, each by itself.

    Returns
    -------
    list of Model
        For each signal one for each condition, and one for all conditions.
    """
    known = sorted(set(campaign.frame["condition"]))
    groups = [("per condition", (number,)) for number in known] + [("single", tuple(known))]
    models = []
    for channel in channels:
        spectra = campaign.spectra[reading][channel]
        settings = READINGS[reading]
        for scheme, conditions in groups:
            pipeline = make_pipeline(
                BinTransformer(
                    1.0, max_order=settings.max_order, stop_bands=settings.stop_bands(channel)
                ),
                PCA(n_components=2),
                CostSensitiveGaussianBayes(priors="uniform"),
            )
            rows = campaign.chosen(conditions, training=True)
            pipeline.fit(spectra[rows], campaign.frame["health"][rows])
            models.append(Model(scheme, channel, conditions, pipeline))
    return models


def decide(campaign: Campaign, models: list[Model], reading: str = "thesis") -> pd.DataFrame:
    """Let every classifier decide on the runs that it was not trained on.

    Parameters
    ----------
    campaign : Campaign
        Spectra.
    models : list of Model
        What `train` returned.
    reading : str
        Key of `READINGS`.

    Returns
    -------
    DataFrame
        A row a decision: "scheme", "channel", "condition", "run", "health", "decision", "outcome".
    """
    tables = []
    for model in models:
        rows = campaign.chosen(model.conditions, training=False)
        spectra = campaign.spectra[reading][model.channel][rows]
        table = campaign.frame.loc[rows, ["condition", "run", "health"]]
        table = table.assign(decision=model.pipeline.predict(spectra))
        table.insert(0, "channel", model.channel)
        table.insert(0, "scheme", model.scheme)
        tables.append(table)
    table = pd.concat(tables, ignore_index=True)
    right = table["health"] == table["decision"]
    wrong = np.where(table["health"] == "healthy", "false positive", "false negative")
    return table.assign(outcome=np.where(right, "correct", wrong))


def outcome_shares(decisions: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    """Return outcomes in per cent of all recordings of each group, as section 4.4 counts them.

    Examples
    --------
    >>> decisions = pd.DataFrame({"scheme": ["single"] * 4, "outcome": ["correct"] * 3 + ["x"]})
    >>> outcome_shares(decisions, ["scheme"])["correct"].to_dict()
    {'single': 75.0}
    """
    kinds = [name for name in OUTCOMES if name != "wrong fault"]
    counts = pd.crosstab([decisions[name] for name in by], decisions["outcome"])
    shares = 100 * counts.div(counts.sum(axis=1), axis=0)
    return shares.reindex(columns=kinds, fill_value=0.0).rename_axis(columns=None)


def expected_orders(channel: str, max_order: float) -> dict[str, dict[str, float]]:
    """Return the orders that are looked for in a channel, by group and name.

    Parameters
    ----------
    channel : str
        "current_a" shows mechanical orders beside its supply, Eqs. (2.2) and (2.4).
    max_order : float
        Highest order.

    Returns
    -------
    dict of str to dict of str to float
        "inner ring": multiples of 6.123 and, one revolution beside them, their sidebands;
        "electrical noise": orders 12 and 36; "shaft": up to three per revolution.

    Examples
    --------
    >>> orders = expected_orders("accelerometer", 100)
    >>> {group: len(names) for group, names in orders.items()}
    {'inner ring': 48, 'electrical noise': 2, 'shaft': 3}
    >>> round(orders["inner ring"]["4xBPFI"], 2), orders["electrical noise"]
    (24.49, {'2xsupply': 12.0, '6xsupply': 36.0})
    """
    motor = Motor(POLE_PAIRS)
    signal = "current" if channel.startswith("current") else "vibration"
    harmonics = int(max_order // 6)
    lines = fault_orders(
        BEARING, motor, harmonics=harmonics, sidebands=1, max_order=max_order, signal=signal
    )
    table = lines.reset_index()
    ring = table[table["kind"] == "inner ring"]
    supply = table[(table["kind"] == "supply") & (table["sideband"] == 0)]
    noise = supply[supply["harmonic"].isin(_NOISE)]
    turns = table[(table["kind"] == "imbalance or eccentricity") & (table["harmonic"] <= _SHAFT)]
    parts = zip(GROUPS, (ring, noise, turns), strict=True)
    return {group: dict(zip(part["name"], part["order"], strict=True)) for group, part in parts}


def explain(campaign: Campaign, model: Model, reading: str = "thesis") -> pd.DataFrame:
    """Say which spectral lines carry a classifier, beside the orders that are looked for.

    Parameters
    ----------
    campaign : Campaign
        Spectra.
    model : Model
        Trained.
    reading : str
        Key of `READINGS`.

    Returns
    -------
    DataFrame
        A row a spectral line, the largest share first: the columns of `match_fault_orders`,
        "louder" (the unit that has more power there) and "group" (of `expected_orders`, or
        "none"). `attrs` holds "bins", the explanation by bins, and "chance", the share of
        the axis that each group covers [per cent].

    Notes
    -----
    `explain_model` gives the share of each bin over the test recordings. As order 12 and twice
    6.123 lie in one bin, shares of bins are split over their lines: in proportion to what a
    line adds to the difference between the mean bins of the classes (bins are linear in the
    lines). A fault adds power: where the healthy unit is louder, no order of the fault is
    looked for.
    """
    rows = campaign.chosen(model.conditions, training=False)
    spectra = campaign.spectra[reading][model.channel][rows]
    health = campaign.frame["health"][rows].to_numpy()
    bins = explain_model(model.pipeline, spectra, health)
    lines = _split(bins, model, spectra, health)
    top = READINGS[reading].max_order
    groups = expected_orders(model.channel, top)
    parts = [
        _matched(lines[lines["louder"] == "degraded"], groups),
        _matched(lines[lines["louder"] == "healthy"], {k: groups[k] for k in GROUPS[1:]}),
    ]
    table = pd.concat(parts, ignore_index=True)
    table = table.sort_values("share", ascending=False, kind="stable", ignore_index=True)
    named = {name: order for orders in groups.values() for name, order in orders.items()}
    table.attrs = {
        "bins": match_fault_orders(bins, named, slip=0.0, min_width=LINE_WIDTH),
        "chance": {group: _covered(orders, top) for group, orders in groups.items()},
    }
    return table


def explained_shares(explanation: pd.DataFrame) -> dict[str, float]:
    """Return the share of a decision in each group of orders [per cent].

    Examples
    --------
    >>> lines = pd.DataFrame({"group": ["inner ring", "none"], "share": [0.75, 0.25]})
    >>> explained_shares(lines)
    {'inner ring': 75.0, 'electrical noise': 0.0, 'shaft': 0.0}
    """
    shares = 100 * explanation.groupby("group")["share"].sum()
    return {group: float(shares.get(group, 0.0)) for group in GROUPS}


def spread_by_condition(campaign: Campaign, model: Model) -> float:
    """Return how much of the first feature's variance is between conditions [per cent]."""
    rows = campaign.chosen(model.conditions, training=True)
    first = model.pipeline[:-1].transform(campaign.spectra["thesis"][model.channel][rows])[:, 0]
    means = pd.Series(first).groupby(campaign.frame["condition"][rows].to_numpy()).transform("mean")
    return float(100 * means.var(ddof=0) / first.var())


def _split(
    bins: pd.DataFrame, model: Model, spectra: pd.DataFrame, health: NDArray[np.object_]
) -> pd.DataFrame:
    """Split the shares of bins over the spectral lines in them."""
    binning = model.pipeline[0]
    (block,) = parse_order_columns(list(spectra.columns)) or ()
    values = spectra.to_numpy()
    rise = values[health == "degraded"].mean(axis=0) - values[health == "healthy"].mean(axis=0)
    parts = np.abs(binning.operator_.toarray() * rise)
    shares = bins.set_index("column")["share"][binning.get_feature_names_out()].to_numpy()
    share = (shares / parts.sum(axis=1)) @ parts
    return pd.DataFrame(
        {
            "column": list(spectra.columns),
            "channel": model.channel,
            "low": block.orders,
            "high": block.orders,
            "share": share,
            "louder": np.where(rise > 0, "degraded", "healthy"),
        }
    )


def _matched(lines: pd.DataFrame, groups: Mapping[str, Mapping[str, float]]) -> pd.DataFrame:
    """Put the expected order beside each line, and its group."""
    group_of = {name: group for group, orders in groups.items() for name in orders}
    named = {name: order for orders in groups.values() for name, order in orders.items()}
    matched = match_fault_orders(lines, named, slip=0.0, min_width=LINE_WIDTH)
    return matched.assign(group=[group_of.get(name, "none") for name in matched["fault"]])


def _covered(orders: Mapping[str, float], top: float) -> float:
    """Share of the axis within half a line of any of the orders [per cent]."""
    axis = np.arange(0.0, top, 1e-2)[:, np.newaxis]
    near = np.abs(axis - np.array(list(orders.values()))) <= LINE_WIDTH / 2
    return float(100 * near.any(axis=1).mean())
