"""Figures of one way of holding out, each with an interval from resampling groups."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.evaluation.bootstrap import cell_mean, group_intervals
from emacm.evaluation.calibration import brier_scores, log_losses, most_probable, reliability
from emacm.evaluation.scoring import ScoringRule

# A value and a cell for each recording; cell -1 does not count (emacm.evaluation.bootstrap).
Tally = tuple[NDArray[np.float64], NDArray[np.intp]]

FIGURES = (
    "balanced_accuracy",
    "accuracy",
    "false_alarm_rate",
    "inspection_rate",
    "missed_detection_rate",
    "expected_cost",
    "log_loss",
    "brier",
)


def tallies(
    judged: pd.DataFrame, healthy: Any, probabilities: NDArray[np.float64] | None, labels: list[Any]
) -> dict[str, Tally]:
    """Say what each recording contributes to each figure.

    Parameters
    ----------
    judged : DataFrame
        Of `ScoringRule.judge`.
    healthy : object
        Healthy label, or None: then there are no alarms.
    probabilities : ndarray of shape (n_recordings, n_labels) or None
        Posteriors of the labels.
    labels : list
        The labels.

    Returns
    -------
    dict of str to (values, cells)
        As `emacm.evaluation.bootstrap.cell_mean` takes them.
    """
    right = judged["right"].to_numpy(float)
    truths = _numbers(judged["true_label"], labels)
    together = np.zeros(len(judged), np.intp)
    found: dict[str, Tally] = {
        "balanced_accuracy": (right, truths),
        "accuracy": (right, together),
        "expected_cost": (judged["cost"].to_numpy(float), together),
    }
    if healthy is not None:
        code, decided = labels.index(healthy), _numbers(judged["decided_label"], labels)
        among_healthy, among_faulty = (
            np.where(truths == code, 0, -1),
            np.where(truths == code, -1, 0),
        )
        called_faulty = (decided != code) & (decided >= 0)
        found["false_alarm_rate"] = (called_faulty.astype(float), among_healthy)
        found["inspection_rate"] = ((decided < 0).astype(float), among_healthy)
        found["missed_detection_rate"] = ((decided == code).astype(float), among_faulty)
    if probabilities is not None:
        found["log_loss"] = (log_losses(probabilities, truths), together)
        found["brier"] = (brier_scores(probabilities, truths), together)
    return {name: found[name] for name in FIGURES if name in found}


def figure_row(found: dict[str, Tally], groups: NDArray[Any], **bootstrap: Any) -> dict[str, float]:
    """Compute the figures and their intervals.

    Parameters
    ----------
    found : dict
        Of `tallies`.
    groups : ndarray of shape (n_recordings,)
        What is resampled.
    **bootstrap
        As `emacm.evaluation.bootstrap.group_intervals` takes it.

    Returns
    -------
    dict
        "accuracy", "accuracy_low", "accuracy_high" and so on.
    """
    values, cells = zip(*found.values(), strict=True)
    intervals = group_intervals(np.array(values), np.array(cells), groups, **bootstrap)
    row: dict[str, float] = {}
    for (name, tally), (low, high) in zip(found.items(), intervals, strict=True):
        row |= {name: cell_mean(*tally), f"{name}_low": float(low), f"{name}_high": float(high)}
    return row


def reliability_curve(
    probabilities: NDArray[np.float64],
    truths: Any,
    labels: list[Any],
    groups: Any,
    **bootstrap: Any,
) -> pd.DataFrame:
    """Compute a reliability curve with an interval for each of its bins.

    Parameters
    ----------
    probabilities : ndarray of shape (n_recordings, n_labels)
        Posteriors of the labels.
    truths : Series of shape (n_recordings,)
        True labels.
    labels : list
        The labels.
    groups : ndarray of shape (n_recordings,)
        What is resampled.
    **bootstrap
        As `emacm.evaluation.bootstrap.group_intervals` takes it.

    Returns
    -------
    DataFrame
        As `emacm.evaluation.calibration.reliability`, with "low" and "high" of "frequency" and
        the number of "groups".
    """
    numbers = _numbers(truths, labels)
    curve = reliability(probabilities, numbers)
    _, right, bins = most_probable(probabilities, numbers)
    present = np.unique(bins)
    cells = np.where(bins == present[:, np.newaxis], 0, -1)
    values = np.broadcast_to(right, cells.shape)
    curve[["low", "high"]] = group_intervals(values, cells, groups, **bootstrap)
    return curve.assign(groups=[len(np.unique(groups[bins == number])) for number in present])


def confusion(judged: pd.DataFrame, rule: ScoringRule) -> pd.DataFrame:
    """Count decisions: rows are the decision (its family, if any), columns the true class.

    Parameters
    ----------
    judged : DataFrame
        Of `ScoringRule.judge`.
    rule : ScoringRule
        It knows the classes and families.

    Returns
    -------
    DataFrame
        Counts; index "decided", columns "true".
    """
    rows = list(dict.fromkeys([*rule.labels, *judged["decided_label"]]))
    counts = pd.DataFrame(
        0,
        index=pd.Index(rows, name="decided"),
        columns=pd.Index(rule.classes, name="true"),
    )
    for decided, true in zip(judged["decided_label"], judged["truth"], strict=True):
        counts.loc[decided, true] += 1
    return counts


def label_posteriors(probabilities: pd.DataFrame, rule: ScoringRule) -> NDArray[np.float64]:
    """Add up the posteriors of the classes of each label.

    Parameters
    ----------
    probabilities : DataFrame
        Columns are classes.
    rule : ScoringRule
        It knows the labels.

    Returns
    -------
    ndarray of shape (n_recordings, n_labels)
    """
    summed = np.zeros((len(probabilities), len(rule.labels)))
    for column, name in enumerate(probabilities.columns):
        label = rule.family_of.get(name, name)
        summed[:, rule.labels.index(label)] += probabilities.iloc[:, column]
    return summed


def _numbers(values: Any, labels: list[Any]) -> NDArray[np.intp]:
    """Return the place of each label; -1 for another decision."""
    place = {label: number for number, label in enumerate(labels)}
    return np.array([place.get(value, -1) for value in values], np.intp)
