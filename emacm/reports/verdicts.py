"""The decision on a recording and its confidence, in words."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emacm.decisions.risks import LeastRiskMixin
from emacm.models.scoring import opened_classifier
from emacm.recordings.recording import Recording
from emacm.reports.facts import confidence, known_states, listed, percent

_NAMED = 0.01  # probability from which another state is named
_UNUSUAL = 0.01  # typicality
_MOST = 4  # states that are named


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
        The most probable state that was not decided.
    """

    decision: Any
    kind: str
    sentences: list[str]
    normal: list[str]
    other: Any


def verdict_on(model: Any, recording: Recording, row: dict[str, Any], healthy: Any) -> Verdict:
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

    Returns
    -------
    Verdict
    """
    classifier, table = opened_classifier(model, [recording])
    posterior = classifier.predict_proba(table)
    truths, names = posterior[0], np.asarray(classifier.classes_).tolist()
    covered = np.eye(len(names), dtype=bool)
    decisions, unknown = names, None
    if isinstance(classifier, LeastRiskMixin):
        truths = classifier.truth_proba(table, posterior)[0]
        names, unknown = np.asarray(classifier.truths_).tolist(), classifier.unknown
        decisions = np.asarray(classifier.decisions_).tolist()
        # A decision that is cheapest for several states, as a family is, stands for all of them.
        covered = classifier.cost_ <= classifier.cost_.min(axis=0)
    decision = row["decision"]
    own = np.array([name == decision for name in names])
    own |= covered[decisions.index(decision)] & [name not in decisions for name in names]
    probability = float(truths[own].sum())
    kind = _kind(decision, own, healthy, unknown)
    others = _others(names, truths, own)
    sentences = [_decided(model, kind, decision, probability), *others]
    if kind in ("healthy", "fault") and probability < truths[~own].max(initial=0.0):
        sentences.append("It was decided because the costs of the other decisions are higher.")
    if getattr(classifier, "temperature", None) is None:
        sentences.append(
            "The probabilities were not calibrated on left-out recordings: they are usually too "
            "close to certainty."
        )
    typical, normal = _typicality(float(row["typicality"]))
    known = [k for k, name in enumerate(names) if name != decision and name != unknown]
    other = names[max(known, key=lambda k: truths[k])] if known else None
    return Verdict(decision, kind, sentences + typical, normal, other)


def _kind(decision: Any, own: NDArray[np.bool_], healthy: Any, unknown: Any) -> str:
    if unknown is not None and decision == unknown:
        return "unknown"
    if healthy is not None and decision == healthy:
        return "healthy"
    return "fault" if own.any() else "other"


def _decided(model: Any, kind: str, decision: Any, probability: float) -> str:
    if kind == "other":
        return f"No state is certain enough: {str(decision)!r} has the lowest expected cost."
    if kind == "unknown":
        return (
            f"The recording is unlike all states that the model knows ({known_states(model)}); "
            f"the probability of an unknown state is {percent(probability)}. What it is must be "
            f"found out at the machine."
        )
    return (
        f"Confidence: {confidence(probability)}. The probability of this state is "
        f"{percent(probability)}."
    )


def _others(names: list[Any], truths: NDArray[Any], own: NDArray[np.bool_]) -> list[str]:
    """Name the other states that are possible."""
    order = [k for k in np.argsort(-truths) if not own[k] and truths[k] >= _NAMED][:_MOST]
    if not order:
        return []
    return [f"Possible too: {listed([f'{names[k]} ({percent(truths[k])})' for k in order])}."]


def _typicality(value: float) -> tuple[list[str], list[str]]:
    if np.isnan(value):
        return [], []
    if value <= _UNUSUAL:
        text = "The recording is unusual: fewer than 1 in 100 training recordings are as far away"
        return [f"{text} from the states of the model."], []
    return [], [
        f"as typical as the training recordings ({percent(value)} of them are at least as far from "
        f"their state)"
    ]
