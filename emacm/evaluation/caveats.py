"""What must be known of an evaluation before a figure of it is believed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from emacm.evaluation.results import SchemeScore
from emacm.evaluation.schemes import RANDOM, Scheme
from emacm.evaluation.scoring import ScoringRule

_FEW = 10  # groups, below which limits are called rough


def scheme_caveats(
    schemes: Sequence[Scheme], scores: Sequence[SchemeScore | None], rule: ScoringRule
) -> list[str]:
    """Say what to mind, the gravest first.

    Parameters
    ----------
    schemes : sequence of Scheme
        All of them.
    scores : sequence of SchemeScore or None
        What is known of each; None for those that cannot be scored.
    rule : ScoringRule
        What was right.

    Returns
    -------
    list of str
    """
    pairs = list(zip(schemes, scores, strict=True))
    said = [
        f"'{scheme.name}' cannot be scored. {scheme.impossible}"
        for scheme, score in pairs
        if score is None
    ]
    done = [(scheme, score) for scheme, score in pairs if score is not None]
    if all(scheme.name == RANDOM for scheme in schemes):
        said.append(
            "Only a random split was made: it says how recordings are told apart beside near "
            "copies of themselves, not how the next run or machine is. Give runs= or units=."
        )
    said += _optimism(done)
    said += _resampling(done)
    if rule.has_families:
        families = [
            f"{label!r} ({', '.join(map(repr, _members(rule, label)))})" for label in rule.labels
        ]
        said.append(f"Scored by families: {', '.join(families)}.")
    return said


def _optimism(done: Sequence[tuple[Scheme, SchemeScore]]) -> list[str]:
    """Say where the random split promises more than holding out groups keeps."""
    rows = {scheme.name: score.row for scheme, score in done}
    random = rows.pop(RANDOM, None)
    if random is None:
        return []
    name = "balanced_accuracy"
    said = [
        f"the random split has {random[name]:.3g}, {scheme!r} {row[name]:.3g}"
        for scheme, row in rows.items()
        if random[name] > row[f"{name}_high"]
    ]
    if not said:
        return []
    return [
        f"Balanced accuracy: {'; '.join(said)}. Believe the split that holds out what will be new "
        f"in service; a random split has recordings of every kind on both sides."
    ]


def _resampling(done: Sequence[tuple[Scheme, SchemeScore]]) -> list[str]:
    said = []
    counts = {scheme.resampled.name: score.row["groups"] for scheme, score in done}
    if "recording" in counts:
        said.append(
            "Limits come from resampling single recordings, as no runs= or units= were given; "
            "if recordings of one run are alike, they are too narrow."
        )
    few = [
        f"{score.row['groups']} of {scheme.resampled.name} in '{scheme.name}'"
        for scheme, score in done
        if scheme.resampled.name != "recording" and score.row["groups"] < _FEW
    ]
    if few:
        said.append(f"Limits rest on few groups and are rough (none of one): {', '.join(few)}.")
    sure = [scheme.name for scheme, score in done if score.row["accuracy"] in (0, 1)]
    if sure:
        said.append(
            f"In {sure} decisions are all right or all wrong: limits of no width say that "
            f"resampling met nothing else, not that there is nothing else."
        )
    thin = [
        scheme.name
        for scheme, score in done
        if score.row["groups"] > 1 and np.isnan(score.row["balanced_accuracy_low"])
    ]
    if thin:
        said.append(
            f"Balanced accuracy has no limits in {thin}: some label is in so few groups that "
            f"most draws miss it."
        )
    return said


def _members(rule: ScoringRule, label: object) -> list[object]:
    return [name for name in rule.classes if rule.family_of[name] == label]
