"""Caveats of an evaluation: what limits the conclusions that its figures of merit allow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from emacm.evaluation.schemes import RANDOM, Scheme
from emacm.evaluation.scoring import ScoringRule

_FEW = 10  # groups; with fewer, confidence intervals are called approximate
_EXAMPLES = 3


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
    schemes: Sequence[Scheme], rows: Mapping[str, Mapping[str, Any]], rule: ScoringRule
) -> list[str]:
    """Return the caveats of the schemes, most serious first.

    Parameters
    ----------
    schemes : sequence of Scheme
        All of them.
    rows : mapping of str to mapping
        Row of `Evaluation.table` for each scheme that could be scored.
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
    caveats += _optimism(rows) + _uncertainty(rows)
    if rule.has_families:
        members = {
            label: [name for name in rule.classes if rule.family_of[name] == label]
            for label in rule.labels
        }
        families = [f"{k!r} ({', '.join(map(repr, names))})" for k, names in members.items()]
        caveats.append(f"Scored by families: {', '.join(families)}.")
    return caveats


def _optimism(rows: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """State where the random split is better than the interval of another scheme."""
    accuracy = rows.get(RANDOM, {}).get("balanced_accuracy", -np.inf)
    worse = [
        f"{row['balanced_accuracy']:.3g} {name!r}"
        for name, row in rows.items()
        if accuracy > row["balanced_accuracy_high"]
    ]
    if not worse:
        return []
    return [
        f"The random split is optimistic: balanced accuracy {accuracy:.3g}, but "
        f"{', '.join(worse)}. Rely on the split that holds out what will be new in service."
    ]


def _uncertainty(rows: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """State what is wrong with the confidence intervals."""
    caveats = []
    if any(row["resampled"] == "recording" for row in rows.values()):
        caveats.append(
            "Confidence intervals are from a bootstrap over single recordings, because no runs= "
            "or units= were given; they are too narrow if recordings of one run are alike."
        )
    few = [
        f"{row['groups']} in {name!r}"
        for name, row in rows.items()
        if row["resampled"] != "recording" and row["groups"] < _FEW
    ]
    if few:
        caveats.append(
            f"Confidence intervals from fewer than {_FEW} groups are approximate: {', '.join(few)}."
        )
    if sure := [name for name, row in rows.items() if row["accuracy"] in (0, 1)]:
        caveats.append(
            f"All decisions are correct, or all are wrong, in {sure}. Zero-width intervals: all "
            f"resamples agree; this does not prove certainty."
        )
    thin = [
        name
        for name, row in rows.items()
        if row["groups"] > 1 and np.isnan(row["balanced_accuracy_low"])
    ]
    if thin:
        caveats.append(
            f"Balanced accuracy has no confidence interval in {thin}: some label occurs in so "
            f"few groups that most resamples miss it."
        )
    return caveats


def _examples(parts: list[str]) -> str:
    more = len(parts) - _EXAMPLES
    return ", ".join(parts[:_EXAMPLES]) + (f" and {more} more" if more > 0 else "")
