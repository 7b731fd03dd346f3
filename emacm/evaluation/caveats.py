"""Caveats of an evaluation: what limits the conclusions that its figures of merit allow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from emacm.evaluation.held_out import RANDOM, Scheme
from emacm.evaluation.scoring import ScoringRule


def single_unit_labels(labels: Sequence[Any], units: Sequence[Any]) -> dict[Any, Any]:
    """Return the labels that were recorded on one unit only.

    Parameters
    ----------
    labels : sequence of n_recordings
        Label (state of health) of each recording.
    units : sequence of n_recordings
        Unit (machine, assembly) of each recording.

    Returns
    -------
    dict
        {label: its only unit}.

    Examples
    --------
    >>> single_unit_labels(["new", "new", "worn", "worn"], ["A", "B", "C", "C"])
    {'worn': 'C'}
    """
    pairs = pd.DataFrame({"label": list(labels), "unit": list(units)}).drop_duplicates()
    alone = pairs[~pairs["label"].duplicated(keep=False)]
    return dict(zip(alone["label"], alone["unit"], strict=True))


def confounding_caveats(labels: Sequence[Any], units: Sequence[Any], unit: str) -> list[str]:
    """Describe how labels are confounded with units.

    Parameters
    ----------
    labels, units : sequence of n_recordings
        As in `single_unit_labels`.
    unit : str
        Name of the property "unit", for the text.

    Returns
    -------
    list of str
        Most serious first; empty if each label occurs in several units, and some unit has several
        labels.

    Examples
    --------
    >>> confounding_caveats(["new", "worn"] * 2, ["A", "A", "B", "B"], "unit")
    []
    """
    caveats = []
    if alone := single_unit_labels(labels, units):
        which = _examples([f"{label!r} only in {owner!r}" for label, owner in alone.items()])
        caveats.append(
            f"Label and {unit} are confounded: {which}. What distinguishes such a label may be "
            f"the {unit} itself; no split of these recordings can separate the two."
        )
    single = single_unit_labels(units, labels)
    if len(single) == len(set(units)):
        which = _examples([f"{owner!r} only {label!r}" for owner, label in single.items()])
        caveats.append(
            f"Each {unit} has one label: {which}. With the same {unit} in training and test, a "
            f"classifier may recognise the {unit}; only the split by {unit} excludes this."
        )
    return caveats


def scheme_caveats(schemes: Sequence[Scheme], table: pd.DataFrame, rule: ScoringRule) -> list[str]:
    """Return the caveats of the schemes, most serious first.

    Parameters
    ----------
    schemes : sequence of Scheme
        All of them.
    table : DataFrame
        `Evaluation.table`.
    rule : ScoringRule
        Definition of a correct decision.

    Returns
    -------
    list of str
    """
    caveats = [f"'{s.name}' cannot be scored. {s.impossible}" for s in schemes if s.impossible]
    if all(scheme.name == RANDOM for scheme in schemes):
        caveats.append(
            "Only a random split was made. It estimates the performance on recordings with near "
            "copies in the training data, not on the next run or unit. Give runs= or units=."
        )
    scored = table.loc[[s.name for s in schemes if not s.impossible]]
    if len(scored):
        for text, applies in _table_caveats(scored).items():
            if applies.any():
                names = ", ".join(map(repr, scored.index[applies]))
                caveats.append(text.format(names))
    if not {*rule.labels} <= {*rule.classes}:
        caveats.append("Scored by families: " + ", ".join(map(repr, rule.labels)) + ".")
    return caveats


def _table_caveats(table: pd.DataFrame) -> dict[str, pd.Series]:
    """Return the text of each caveat, and to which schemes it applies."""
    low, high = table["balanced_accuracy_low"], table["balanced_accuracy_high"]
    random = table["balanced_accuracy"].get(RANDOM, -np.inf)
    costs = table.reindex(columns=["realised_cost_low", "predicted_cost_high"])
    one_by_one = table["resampled"] == "recording"
    return {
        "The random split is optimistic: its balanced accuracy is above the confidence "
        "interval of {}. Rely on the split that holds out what will be new in service.": (
            random > high
        ),
        "New units are decided worse than other recordings of known ones ({}): give healthy "
        "recordings of each unit as its baseline (FeatureBaseline, add_baseline), or train with "
        "more units.": (table.index == "by unit")
        & (high < low.drop("by unit", errors="ignore").max()),
        "The realised cost of {} is above the cost that the posterior probabilities predict: "
        'they are over-confident. See temperature="groups".': (
            costs["realised_cost_low"] > costs["predicted_cost_high"]
        ),
        "Confidence intervals of {} are from a bootstrap over single recordings, because no "
        "runs= or units= were given; they are too narrow if recordings of one run are alike.": (
            one_by_one
        ),
        "Confidence intervals from fewer than 10 groups are approximate: {}.": (
            ~one_by_one & (table["groups"] < 10)  # assumed
        ),
        "All decisions are correct, or all are wrong, in {}: the intervals of costs then have "
        "no width, which does not prove certainty.": table["accuracy"].isin([0, 1]),
        "Balanced accuracy has no confidence interval in {}: some label occurs in so few "
        "groups that most resamples miss it.": (table["groups"] > 1) & low.isna(),
    }


def _examples(parts: list[str]) -> str:
    more = len(parts) - 3
    return ", ".join(parts[:3]) + (f" and {more} more" if more > 0 else "")
