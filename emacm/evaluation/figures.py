"""Figures of merit of one hold-out scheme, each with a confidence interval."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.evaluation.bootstrap import (
    Combine,
    cell_mean,
    gap_of_cells,
    group_intervals,
    mean_of_cells,
)
from emacm.evaluation.calibration import brier_scores, log_losses, most_probable, reliability
from emacm.evaluation.scoring import ScoringRule

FIGURES = (
    "balanced_accuracy",
    "accuracy",
    "false_alarm_rate",
    "inspection_rate",
    "missed_detection_rate",
    "expected_cost",
    "realised_cost",
    "predicted_cost",
    "log_loss",
    "brier",
    "calibration_error",
)


class Tally(NamedTuple):
    """Contribution of each recording to a figure of merit (`emacm.evaluation.bootstrap`).

    Attributes
    ----------
    values : ndarray of shape (n_recordings,)
        One number for each recording.
    cells : ndarray of int of shape (n_recordings,)
        Its cell; in cell -1 it is not counted.
    combine : callable
        How the cells are combined.
    """

    values: NDArray[np.float64]
    cells: NDArray[np.intp]
    combine: Combine = mean_of_cells


def tallies(judged: pd.DataFrame, rule: ScoringRule) -> dict[str, Tally]:
    """Return the contribution of each recording to each figure of merit.

    Parameters
    ----------
    judged : DataFrame
        Rows of `Evaluation.predictions`: columns of `ScoringRule.judge`, and, with probabilities,
        "predicted_cost" and ``P(label)`` for each label.
    rule : ScoringRule
        Without a healthy label, the three rates are left out.

    Returns
    -------
    dict of str to Tally
    """
    correct = judged["correct"].to_numpy(float)
    truths = _codes(judged["true_label"], rule.labels)
    one_cell = np.zeros(len(judged), np.intp)
    found = {
        "balanced_accuracy": Tally(correct, truths),
        "accuracy": Tally(correct, one_cell),
        "expected_cost": Tally(judged["cost"].to_numpy(float), one_cell),
    }
    if rule.healthy is not None:
        is_healthy = (judged["true_label"] == rule.healthy).to_numpy()
        called_healthy = judged["decided_label"].isin(rule.cleared).to_numpy()
        called_faulty = judged["decided_label"].isin(rule.alarms).to_numpy() & ~called_healthy
        among_healthy, among_faulty = np.where(is_healthy, 0, -1), np.where(is_healthy, -1, 0)
        inspected = ~(called_healthy | called_faulty)
        found["false_alarm_rate"] = Tally(called_faulty.astype(float), among_healthy)
        found["inspection_rate"] = Tally(inspected.astype(float), among_healthy)
        found["missed_detection_rate"] = Tally(called_healthy.astype(float), among_faulty)
    if "predicted_cost" in judged:
        probabilities = judged[probability_columns(rule)].to_numpy(float)
        confidence, called, bins = most_probable(probabilities, truths)
        found["log_loss"] = Tally(log_losses(probabilities, truths), one_cell)
        found["brier"] = Tally(brier_scores(probabilities, truths), one_cell)
        found["calibration_error"] = Tally(confidence - called, bins, gap_of_cells)
        for name, column in {"realised_cost": "cost", "predicted_cost": "predicted_cost"}.items():
            found[name] = _in_service(judged[column].to_numpy(float), judged["truth"], rule)
    return {name: found[name] for name in FIGURES if name in found}


def probability_columns(rule: ScoringRule) -> list[str]:
    """Return the names of the columns of `Evaluation.predictions` with probabilities of labels."""
    return [f"P({label})" for label in rule.labels]


def _in_service(values: NDArray[np.float64], truths: pd.Series, rule: ScoringRule) -> Tally:
    """Return a mean in which the true classes have their priors in service as weights."""
    if rule.priors is None:
        return Tally(values, np.zeros(len(values), np.intp))
    cells = _codes(truths, rule.classes)
    weights = np.array([rule.priors[rule.classes[cell]] for cell in np.unique(cells)])
    if not weights.sum() > 0:
        return Tally(values, np.full(len(values), -1))
    return Tally(values, cells, partial(_weighted_mean, weights / weights.sum()))


def _weighted_mean(
    weights: NDArray[np.float64], sums: NDArray[np.float64], counts: NDArray[np.float64]
) -> NDArray[np.float64]:
    return (sums / np.where(counts > 0, counts, np.nan)) @ weights


def figure_row(found: dict[str, Tally], groups: NDArray[Any], **bootstrap: Any) -> dict[str, float]:
    """Compute the figures of merit and their confidence intervals.

    Parameters
    ----------
    found : dict
        From `tallies`.
    groups : ndarray of shape (n_recordings,)
        Group of each recording, drawn as a whole by the bootstrap.
    **bootstrap
        Options of `emacm.evaluation.bootstrap.group_intervals`.

    Returns
    -------
    dict
        "accuracy", "accuracy_low", "accuracy_high" and so on.
    """
    values, cells, combine = zip(*found.values(), strict=True)
    intervals = group_intervals(values, cells, groups, combine=combine, **bootstrap)
    row: dict[str, float] = {}
    for (name, tally), (low, high) in zip(found.items(), intervals, strict=True):
        row |= {name: cell_mean(*tally), f"{name}_low": float(low), f"{name}_high": float(high)}
    return row


def reliability_curve(
    probabilities: NDArray[np.float64],
    truths: Any,
    labels: list[Any],
    groups: NDArray[Any],
    **bootstrap: Any,
) -> pd.DataFrame:
    """Compute a reliability curve with a confidence interval for each of its bins.

    Parameters
    ----------
    probabilities : ndarray of shape (n_recordings, n_labels)
        Posterior probability of each label.
    truths : Series of shape (n_recordings,)
        True labels.
    labels : list
        The labels.
    groups : ndarray of shape (n_recordings,)
        Group of each recording, drawn as a whole by the bootstrap.
    **bootstrap
        Options of `emacm.evaluation.bootstrap.group_intervals`.

    Returns
    -------
    DataFrame
        As `emacm.evaluation.calibration.reliability`, with the interval "low", "high" of
        "frequency" and the number of "groups" in each bin.
    """
    codes = _codes(truths, labels)
    curve = reliability(probabilities, codes)
    _, correct, bins = most_probable(probabilities, codes)
    present = np.unique(bins)
    cells = np.where(bins == present[:, np.newaxis], 0, -1)
    values = np.broadcast_to(correct, cells.shape)
    curve[["low", "high"]] = group_intervals(values, cells, groups, **bootstrap)
    return curve.assign(groups=[len(np.unique(groups[bins == number])) for number in present])


def confusion(judged: pd.DataFrame, rule: ScoringRule) -> pd.DataFrame:
    """Count decisions: rows are the decision (its family, if any), columns the true class.

    Parameters
    ----------
    judged : DataFrame
        From `ScoringRule.judge`.
    rule : ScoringRule
        Classes and labels.

    Returns
    -------
    DataFrame
        Counts; the index is named "decided", the columns "true".
    """
    rows = list(dict.fromkeys([*rule.labels, *judged["decided_label"]]))
    counts = np.zeros((len(rows), len(rule.classes)), np.int64)
    places = _codes(judged["decided_label"], rows), _codes(judged["truth"], rule.classes)
    np.add.at(counts, places, 1)
    index, columns = pd.Index(rows, name="decided"), pd.Index(rule.classes, name="true")
    return pd.DataFrame(counts, index, columns)


def label_posteriors(probabilities: pd.DataFrame, rule: ScoringRule) -> NDArray[np.float64]:
    """Add the posterior probabilities of the classes of each label.

    Parameters
    ----------
    probabilities : DataFrame
        Columns are classes.
    rule : ScoringRule
        Label of each class.

    Returns
    -------
    ndarray of shape (n_recordings, n_labels)
    """
    labels, family_of = rule.labels, rule.family_of
    summed = np.zeros((len(probabilities), len(labels)))
    for name, column in zip(probabilities.columns, probabilities.to_numpy().T, strict=True):
        summed[:, labels.index(family_of.get(name, name))] += column
    return summed


def _codes(values: Any, labels: list[Any]) -> NDArray[np.intp]:
    """Return the index of each value among the labels."""
    place = {label: number for number, label in enumerate(labels)}
    return np.array([place[value] for value in values], np.intp)
