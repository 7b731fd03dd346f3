"""Caveats of an evaluation: what limits the conclusions that its figures of merit allow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from emacm.evaluation.schemes import RANDOM, Scheme
from emacm.evaluation.scoring import ScoringRule

_EXAMPLES = 3

# Condition on a row of the table (and the balanced accuracy of the random split), and text.
_CAVEATS = (
    (
        lambda row, random: random > row["balanced_accuracy_high"],
        "The random split is optimistic: its balanced accuracy is above the confidence interval of "
        "{}. Rely on the split that holds out what will be new in service.",
    ),
    (
        lambda row, _: (
            row.get("realised_cost_low", np.nan) > row.get("predicted_cost_high", np.nan)
        ),
        "The realised cost of {} is above the cost that the posterior probabilities predict: they "
        'are over-confident. See temperature="groups".',
    ),
    (
        lambda row, _: row["resampled"] == "recording",
        "Confidence intervals of {} are from a bootstrap over single recordings, because no runs= "
        "or units= were given; they are too narrow if recordings of one run are alike.",
    ),
    (
        lambda row, _: row["resampled"] != "recording" and row["groups"] < 10,
        "Confidence intervals from fewer than 10 groups are approximate: {}.",
    ),
    (
        lambda row, _: row["accuracy"] in (0, 1),
        "All decisions are correct, or all are wrong, in {}. Zero-width intervals: all resamples "
        "agree; this does not prove certainty.",
    ),
    (
        lambda row, _: row["groups"] > 1 and np.isnan(row["balanced_accuracy_low"]),
        "Balanced accuracy has no confidence interval in {}: some label occurs in so few groups "
        "that most resamples miss it.",
    ),
)


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


def scheme_caveats(
    schemes: Sequence[Scheme],
    table: pd.DataFrame,
    rule: ScoringRule,
    further: Sequence[str] = (),
) -> list[str]:
    """Return the caveats of the schemes, most serious first.

    Parameters
    ----------
    schemes : sequence of Scheme
        All of them.
    table : DataFrame
        `Evaluation.table`.
    rule : ScoringRule
        Definition of a correct decision.
    further : sequence of str
        Less serious caveats.

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
    rows = {s.name: table.loc[s.name] for s in schemes if not s.impossible}
    random = rows[RANDOM]["balanced_accuracy"] if RANDOM in rows else -np.inf
    for applies, text in _CAVEATS:
        if names := [name for name, row in rows.items() if applies(row, random)]:
            caveats.append(text.format(", ".join(map(repr, names))))
    caveats += further
    if rule.has_families:
        caveats.append("Scored by families: " + ", ".join(map(repr, rule.labels)) + ".")
    return caveats


def novelty_caveats(table: pd.DataFrame, refused: Mapping[str, str]) -> list[str]:
    """Return the caveats about unknown states.

    Parameters
    ----------
    table : DataFrame
        `Evaluation.novelty`.
    refused : mapping of str to str
        Reason why a family could not be left out of training.

    Returns
    -------
    list of str
    """
    caveats = [
        f"{family!r} could not be left out of training. {why}" for family, why in refused.items()
    ]
    if not len(table) and not refused:
        caveats.append(
            "No family of faults was left out as unknown: the classifier has no typicality (see "
            "unknown= of CostSensitiveGaussianBayes). It assigns any unknown state to a known one."
        )
    return caveats


def _examples(parts: list[str]) -> str:
    more = len(parts) - _EXAMPLES
    return ", ".join(parts[:_EXAMPLES]) + (f" and {more} more" if more > 0 else "")
