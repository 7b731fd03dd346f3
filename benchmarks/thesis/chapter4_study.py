"""Classifiers of chapter 4: their decisions, and the orders that determine them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from laboratory.faults import BEARING, POLE_PAIRS
from sklearn.base import clone
from sklearn.compose import make_column_transformer
from sklearn.decomposition import PCA
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler

from chapter4_spectra import CROSS, READINGS, REVOLUTIONS, SIGNALS, Campaign, Signal
from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.posterior_product import PosteriorProduct
from emacm.explanations.explain import explain_model, match_fault_orders
from emacm.machine.fault_orders import fault_orders
from emacm.machine.motors import Motor
from emacm.orders.columns import parse_order_columns

SCHEMES = {"per condition": "Table 4.5", "single": "Table 4.6"}
GROUPS = ("inner ring", "electrical noise", "shaft")  # kinds of predicted orders
LINE_WIDTH = 4 / REVOLUTIONS  # orders: main lobe of a Hann window
FUSED = ("fusion of decisions", "fusion of features", CROSS)
OUTCOMES = ("correct", "false alarm", "missed detection")
_NOISE = (2, 6)  # multiples of the supply: orders 12 and 36 of section 4.5
_SHAFT = 3  # highest harmonic of the shaft


class Model(NamedTuple):
    """One trained classifier.

    Attributes
    ----------
    scheme : str
        Key of `SCHEMES`.
    signal : Signal
        The signal that it uses.
    conditions : tuple of int
        Conditions of its training and test recordings.
    pipeline : Pipeline
        From bins to decisions.
    """

    scheme: str
    signal: Signal
    conditions: tuple[int, ...]
    pipeline: Pipeline

    @property
    def label(self) -> str:
        """The condition, or "all"."""
        return "all" if self.scheme == "single" else str(self.conditions[0])


class Study(NamedTuple):
    """All classifiers of one pair of units under one reading.

    Attributes
    ----------
    reading : str
        Key of `READINGS`.
    models : list of Model
        Trained classifiers.
    explanations : list of DataFrame
        Result of `explain` for each; empty from `classified`.
    decisions : DataFrame
        Result of `decide`.
    cross : DataFrame
        `CROSS` spectra of all recordings.
    """

    reading: str
    models: list[Model]
    explanations: list[pd.DataFrame]
    decisions: pd.DataFrame
    cross: pd.DataFrame


def study(
    campaign: Campaign, reading: str = "thesis", channels: Sequence[str] = tuple(SIGNALS)
) -> Study:
    """Train the classifiers of some channels, apply them to the test runs, and explain them."""
    found = classified(campaign, reading, channels)
    return found._replace(explanations=[explain(model) for model in found.models])


def classified(campaign: Campaign, reading: str, channels: Sequence[str] = tuple(SIGNALS)) -> Study:
    """Do as `study`, without explanations."""
    models = [m for channel in channels for m in train(campaign.signal(reading, channel))]
    return Study(reading, models, [], decide(models), campaign.spectra[reading][CROSS])


def train(signal: Signal, classifier: Any = None) -> list[Model]:
    """Train the classifiers of one signal on the first half of the runs.

    Parameters
    ----------
    signal : Signal
        Bins of one channel.
    classifier : estimator, optional
        Default: two principal components, and Gaussian classes with equal priors and uniform cost
        (Table 4.4).

    Returns
    -------
    list of Model
        One for each condition, and one for all conditions.
    """
    known = sorted(set(signal.frame["condition"]))
    groups = [("per condition", (number,)) for number in known] + [("single", tuple(known))]
    models = []
    for scheme, conditions in groups:
        pipeline = clone(classifier or make_pipeline(*_steps()))
        rows = signal.rows(conditions, training=True)
        pipeline.fit(signal.bins[rows], signal.frame["health"][rows])
        models.append(Model(scheme, signal, conditions, pipeline))
    return models


def _steps() -> list[Any]:
    return [PCA(n_components=2), CostSensitiveGaussianBayes(priors="uniform")]


def fused(found: Study) -> list[Model]:
    """Train classifiers of all signals, as chapter 5 proposes: each of `FUSED`.

    The signals have different units, so their bins are scaled before two components are taken of
    all; so are the cross spectra.
    """
    signals = {model.signal.channel: model.signal for model in found.models}
    joint = pd.concat([signal.bins for signal in signals.values()], axis=1)
    members = [
        (name, make_pipeline(make_column_transformer(("passthrough", list(bins))), *_steps()))
        for name, bins in ((name, signal.bins.columns) for name, signal in signals.items())
    ]
    scaled = make_pipeline(StandardScaler(), *_steps())
    tables = (joint, joint, found.cross)
    classifiers = (PosteriorProduct(members, priors="uniform"), scaled, scaled)
    return [
        model
        for name, table, classifier in zip(FUSED, tables, classifiers, strict=True)
        for model in train(replace(signals["lvdt"], channel=name, bins=table), classifier)
    ]


def decide(models: Sequence[Model]) -> pd.DataFrame:
    """Apply classifiers to the runs that they were not trained on.

    Returns
    -------
    DataFrame
        One row per decision: "scheme", "channel", "condition", "run", "health", "decision",
        "outcome" (one of `OUTCOMES`).
    """
    tables = []
    for model in models:
        rows = model.signal.rows(model.conditions, training=False)
        table = model.signal.frame.loc[rows, ["condition", "run", "health"]]
        table = table.assign(decision=model.pipeline.predict(model.signal.bins[rows]))
        table.insert(0, "channel", model.signal.channel)
        table.insert(0, "scheme", model.scheme)
        tables.append(table)
    table = pd.concat(tables, ignore_index=True)
    wrong = np.where(table["health"] == "healthy", "false alarm", "missed detection")
    right = table["health"] == table["decision"]
    return table.assign(outcome=np.where(right, "correct", wrong))


def outcome_shares(decisions: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    """Return the outcomes of each group in per cent of its recordings, as in section 4.4.

    Examples
    --------
    >>> decisions = pd.DataFrame({"scheme": ["single"] * 4, "outcome": ["correct"] * 3 + ["x"]})
    >>> outcome_shares(decisions, ["scheme"])["correct"].to_dict()
    {'single': 75.0}
    """
    counts = pd.crosstab([decisions[name] for name in by], decisions["outcome"])
    shares = 100 * counts.div(counts.sum(axis=1), axis=0)
    return shares.reindex(columns=list(OUTCOMES), fill_value=0.0).rename_axis(columns=None)


def expected_orders(channel: str, max_order: float) -> dict[str, dict[str, float]]:
    """Return the orders predicted for a channel, by group and name.

    Parameters
    ----------
    channel : str
        "current_a" contains mechanical orders as sidebands of its supply, Eqs. (2.2) and (2.4).
    max_order : float
        Highest order.

    Returns
    -------
    dict of str to dict of str to float
        "inner ring": multiples of 6.123 and their sidebands at one per revolution; "electrical
        noise": orders 12 and 36; "shaft": 1x to 3x.

    Examples
    --------
    >>> orders = expected_orders("accelerometer", 100)
    >>> {group: len(names) for group, names in orders.items()}
    {'inner ring': 48, 'electrical noise': 2, 'shaft': 3}
    >>> round(orders["inner ring"]["4xBPFI"], 2), orders["electrical noise"]
    (24.49, {'2xsupply': 12.0, '6xsupply': 36.0})
    """
    signal = "current" if channel.startswith("current") else "vibration"
    lines = fault_orders(
        BEARING,
        Motor(POLE_PAIRS),
        harmonics=int(max_order // 6),
        sidebands=1,
        max_order=max_order,
        signal=signal,
    )
    table = lines.reset_index()
    ring = table[table["kind"] == "inner ring"]
    supply = table[(table["kind"] == "supply") & (table["sideband"] == 0)]
    noise = supply[supply["harmonic"].isin(_NOISE)]
    turns = table[(table["kind"] == "imbalance or eccentricity") & (table["harmonic"] <= _SHAFT)]
    parts = zip(GROUPS, (ring, noise, turns), strict=True)
    return {group: dict(zip(part["name"], part["order"], strict=True)) for group, part in parts}


def explain(model: Model) -> pd.DataFrame:
    """Return the spectral lines that determine the decisions of a classifier.

    Parameters
    ----------
    model : Model
        Trained classifier.

    Returns
    -------
    DataFrame
        One row per spectral line, the largest share first: the columns of `match_fault_orders`,
        "louder" (the unit with more power at this line) and "group" (of `expected_orders`, or
        "none"). `attrs["chance"]` is the percentage of the order axis that each group covers.

    Notes
    -----
    `explain_model` gives the share of each bin over the test recordings. Order 12 and twice 6.123
    lie in the same bin, so the share of a bin is split over its lines in proportion to their
    contributions to the difference between the mean bins of the classes (bins are linear in the
    lines). A fault adds power: lines at which the healthy unit has more power are not matched
    with orders of the fault.
    """
    signal = model.signal
    rows = signal.rows(model.conditions, training=False)
    health = signal.frame["health"][rows].to_numpy()
    bins = explain_model(model.pipeline, signal.bins[rows], health)
    lines = _split(bins, signal, rows)
    top = READINGS[signal.reading].max_order
    groups = expected_orders(signal.channel, top)
    parts = [
        _matched(lines[lines["louder"] == "degraded"], groups),
        _matched(lines[lines["louder"] == "healthy"], {k: groups[k] for k in GROUPS[1:]}),
    ]
    table = pd.concat(parts, ignore_index=True)
    table = table.sort_values("share", ascending=False, kind="stable", ignore_index=True)
    table.attrs["chance"] = {group: _covered(orders, top) for group, orders in groups.items()}
    return table


def explained_shares(explanation: pd.DataFrame) -> dict[str, float]:
    """Return the share of each group of orders in the decisions [per cent].

    Examples
    --------
    >>> lines = pd.DataFrame({"group": ["inner ring", "none"], "share": [0.75, 0.25]})
    >>> explained_shares(lines)
    {'inner ring': 75.0, 'electrical noise': 0.0, 'shaft': 0.0}
    """
    shares = 100 * explanation.groupby("group")["share"].sum()
    return {group: float(shares.get(group, 0.0)) for group in GROUPS}


def _split(bins: pd.DataFrame, signal: Signal, rows: np.ndarray) -> pd.DataFrame:
    """Split the shares of bins over their spectral lines."""
    (block,) = parse_order_columns(list(signal.spectra.columns)) or ()
    values, healthy = signal.spectra[rows].to_numpy(), signal.frame["health"][rows] == "healthy"
    rise = values[~healthy].mean(axis=0) - values[healthy].mean(axis=0)
    parts = np.abs(signal.binning.operator_.toarray() * rise)
    shares = bins.set_index("column")["share"][list(signal.bins.columns)].to_numpy()
    return pd.DataFrame(
        {
            "column": list(signal.spectra.columns),
            "channel": signal.channel,
            "low": block.orders,
            "high": block.orders,
            "share": (shares / parts.sum(axis=1)) @ parts,
            "louder": np.where(rise > 0, "degraded", "healthy"),
        }
    )


def _matched(lines: pd.DataFrame, groups: Mapping[str, Mapping[str, float]]) -> pd.DataFrame:
    """Add the nearest predicted order of each line, and its group."""
    group_of = {name: group for group, orders in groups.items() for name in orders}
    named = {name: order for orders in groups.values() for name, order in orders.items()}
    matched = match_fault_orders(lines, named, slip=0.0, min_width=LINE_WIDTH)
    return matched.assign(group=[group_of.get(name, "none") for name in matched["fault"]])


def _covered(orders: Mapping[str, float], top: float) -> float:
    """Return the percentage of the order axis within half a line of any of the orders."""
    axis = np.arange(0.0, top, 1e-2)[:, np.newaxis]
    near = np.abs(axis - np.array(list(orders.values()))) <= LINE_WIDTH / 2
    return float(100 * near.any(axis=1).mean())
