"""The decision on a recording and its confidence, in words."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from emacm.decisions.risks import LeastRiskMixin
from emacm.explanations.deviations import second_state_statement
from emacm.models.scoring import opened_classifier
from emacm.recordings.recording import Recording
from emacm.reports.facts import confidence, listed, percent


class Verdict(NamedTuple):
    """A decision in words.

    Attributes
    ----------
    decision : label
        The decision.
    kind : {"healthy", "fault", "unknown", "other"}
        "other": a decision that is no state, such as "inspect".
    sentences : list of str
        What was decided, how certain it is, and which other states are possible.
    normal : list of str
        What was found normal about it.
    other : label
        The most probable known state that was not decided.
    """

    decision: Any
    kind: str
    sentences: list[str]
    normal: list[str]
    other: Any


def verdict_on(
    model: Any,
    recording: Recording,
    row: dict[str, Any],
    healthy: Any,
    *,
    named: float = 0.01,
    most_named: int = 4,
) -> Verdict:
    """Return the decision on a recording in words.

    Parameters
    ----------
    model : estimator
        Fitted classifier.
    recording : Recording
        The recording.
    row : dict
        Its row of `score`.
    healthy : label
        The healthy state; None if the model has none.
    named : float
        Probability from which another state is named.
    most_named : int
        Most other states that are named.

    Returns
    -------
    Verdict
    """
    classifier, table = opened_classifier(model, [recording])
    probabilities, names = classifier.predict_proba(table), classifier.classes_.tolist()
    decisions, cost, unknown = names, 1 - np.eye(len(names)), None
    if isinstance(classifier, LeastRiskMixin):
        probabilities = classifier.truth_proba(table, probabilities)
        names, decisions = classifier.truths_.tolist(), classifier.decisions_.tolist()
        cost, unknown = classifier.cost_, classifier.unknown
    truths, decision = probabilities[0], row["decision"]
    # A decision that is cheapest for several states, as a family is, stands for all of them.
    covered = cost[decisions.index(decision)] <= cost.min(axis=0)
    own = np.array([name == decision or name not in decisions for name in names])
    own &= covered | [name == decision for name in names]
    others = [k for k in np.argsort(-truths, kind="stable") if not own[k]]
    kind = "fault" if own.any() else "other"
    if decision in (unknown, healthy):
        kind = "unknown" if decision == unknown else "healthy"
    probability = float(truths[own].sum())
    sentences = [_decided(kind, decision, probability, classifier.classes_.tolist())]
    possible = [f"{names[k]} ({percent(truths[k])})" for k in others if truths[k] >= named]
    if possible:
        sentences.append(f"Possible too: {listed(possible[:most_named])}.")
    if kind in ("healthy", "fault") and probability < max(truths[others], default=0.0):
        sentences.append("It was decided because the costs of the other decisions are higher.")
    if getattr(classifier, "temperature", None) is None:
        sentences.append(
            "The probabilities were not calibrated on left-out recordings: they are usually too "
            "close to certainty."
        )
    if hasattr(classifier, "second_states"):
        (second,) = classifier.second_states(table, [decision])
        if second is not None:
            sentences.append(f"There are {second_state_statement(decision, second)}.")
    normal, typicality = [], float(row["typicality"])
    if typicality <= 0.01:  # 1 in 100
        sentences.append(
            "The recording is unusual: fewer than 1 in 100 training recordings are as far away "
            "from the states of the model."
        )
    elif not np.isnan(typicality):
        normal.append(
            f"as typical as the training recordings ({percent(typicality)} of them differ from "
            f"their state by as much or more)"
        )
    known = [names[k] for k in others if names[k] not in (decision, unknown)]
    return Verdict(decision, kind, sentences, normal, known[0] if known else None)


def _decided(kind: str, decision: Any, probability: float, states: list[Any]) -> str:
    if kind == "other":
        return f"No state is certain enough: {str(decision)!r} has the lowest expected cost."
    if kind == "unknown":
        return (
            f"The recording is unlike all states that the model knows ({listed(states)}); the "
            f"probability of an unknown state is {percent(probability)}. What it is must be found "
            f"out at the machine."
        )
    return (
        f"Confidence: {confidence(probability)}. The probability of this state is "
        f"{percent(probability)}."
    )
