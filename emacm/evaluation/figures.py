"""Figures of merit of one hold-out scheme, each with a confidence interval."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm.decisions.costs import label_array
from emacm.evaluation.bootstrap import Array, GroupBootstrap, Tally, gap_of_cells
from emacm.evaluation.scoring import ScoringRule


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
        In the order in which they are printed.
    """
    truths = codes_of(judged["true_label"], rule.labels)
    one_cell = np.zeros(len(judged), np.intp)
    figures = {
        "balanced_accuracy": Tally(judged["correct"], truths),
        "accuracy": Tally(judged["correct"], one_cell),
    }
    if rule.healthy is not None:
        is_faulty = (judged["true_label"] != rule.healthy).to_numpy(int)
        called_healthy = judged["decided_label"].isin(rule.cleared)
        called_faulty = judged["decided_label"].isin(rule.alarms) & ~called_healthy
        figures["false_alarm_rate"] = Tally(called_faulty, -is_faulty)
        figures["inspection_rate"] = Tally(~(called_healthy | called_faulty), -is_faulty)
        figures["missed_detection_rate"] = Tally(called_healthy, is_faulty - 1)
    figures["expected_cost"] = Tally(judged["cost"], one_cell)
    if "predicted_cost" in judged:
        probabilities = judged[probability_columns(rule)].to_numpy(float)
        confidence, called, bins = most_probable(probabilities, truths)
        figures["realised_cost"] = _in_service(judged["cost"], judged["truth"], rule)
        figures["predicted_cost"] = _in_service(judged["predicted_cost"], judged["truth"], rule)
        figures["log_loss"] = Tally(log_losses(probabilities, truths), one_cell)
        figures["calibration_error"] = Tally(confidence - called, bins, gap_of_cells)
    return figures


def probability_columns(rule: ScoringRule) -> list[str]:
    """Return the names of the columns of `Evaluation.predictions` with probabilities of labels."""
    return [f"P({label})" for label in rule.labels]


def _in_service(values: pd.Series, truths: pd.Series, rule: ScoringRule) -> Tally:
    """Return a mean in which the true classes have their priors in service as weights."""
    if rule.priors is None:
        return Tally(values, np.zeros(len(values), np.intp))
    cells = codes_of(truths, rule.classes)
    weights = np.array([rule.priors[rule.classes[cell]] for cell in np.unique(cells)])
    with np.errstate(invalid="ignore"):  # NaN where no state has a prior
        weights /= weights.sum()
    return Tally(values, cells, lambda s, n: (s / np.where(n > 0, n, np.nan)) @ weights)


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
    names = {"rownames": ["decided"], "colnames": ["true"]}
    counts = pd.crosstab(judged["decided_label"], judged["truth"], **names)
    return counts.reindex(index=rows, columns=rule.classes, fill_value=0)


def label_posteriors(probabilities: pd.DataFrame, rule: ScoringRule) -> pd.DataFrame:
    """Add the posterior probabilities of the classes of each label.

    Parameters
    ----------
    probabilities : DataFrame
        Columns are classes.
    rule : ScoringRule
        Label of each class.

    Returns
    -------
    DataFrame of shape (n_recordings, n_labels)
        Columns ``P(label)``.
    """
    labels = label_array([rule.family_of.get(name, name) for name in probabilities])
    summed = probabilities.T.groupby(labels, sort=False).sum().T
    table = summed.reindex(columns=rule.labels, fill_value=0.0)
    return table.set_axis(probability_columns(rule), axis=1)


def codes_of(values: Any, labels: list[Any]) -> NDArray[np.intp]:
    """Return the index of each value among the labels."""
    return pd.Index(labels).get_indexer(list(values))


def log_losses(probabilities: ArrayLike, truths: ArrayLike) -> Array:
    """Return minus the logarithm of the probability of the true class.

    Parameters
    ----------
    probabilities : array-like of shape (n_recordings, n_classes)
        Probability of each class.
    truths : array-like of int of shape (n_recordings,)
        Index of the true class.

    Returns
    -------
    losses : ndarray of shape (n_recordings,)
        In nats. A probability of 0 is replaced by 2.2e-16, which gives 36 nats, because the loss
        would otherwise be infinite.

    Examples
    --------
    >>> log_losses([[0.5, 0.5], [1.0, 0.0]], [0, 0]).round(3) + 0.0
    array([0.693, 0.   ])
    """
    posterior, codes = np.asarray(probabilities, float), np.asarray(truths)
    of_truth = posterior[np.arange(len(posterior)), codes]
    # A probability may exceed 1 by rounding, and a loss is never negative.
    return np.abs(np.log(np.clip(of_truth, np.finfo(float).eps, 1.0)))


def reliability(probabilities: ArrayLike, truths: ArrayLike, groups: ArrayLike) -> pd.DataFrame:
    """Compare the probability of the most probable class with the frequency at which it is true.

    Parameters
    ----------
    probabilities : array-like of shape (n_recordings, n_classes)
        Probability of each class.
    truths : array-like of int of shape (n_recordings,)
        Index of the true class.
    groups : array-like of shape (n_recordings,)
        Group of each recording, drawn as a whole by the bootstrap.

    Returns
    -------
    DataFrame
        One row for each bin, of ten of equal width from 0 to 1 of the largest probability of each
        recording, that contains recordings: its edges "from" and "to", the mean
        probability ("confidence"), the relative "frequency" at which the most probable class is
        the true one, the "count" of recordings, the interval of the frequency, "low" and "high",
        and the number of "groups".

    Examples
    --------
    >>> stated = [[0.8, 0.2], [0.8, 0.2], [0.4, 0.6], [0.4, 0.6]]
    >>> curve = reliability(stated, [0, 0, 0, 1], groups=[1, 1, 2, 2])
    >>> curve[["from", "to", "confidence", "frequency", "count", "groups"]]
       from   to  confidence  frequency  count  groups
    0   0.6  0.7         0.6        0.5      2       1
    1   0.8  0.9         0.8        1.0      2       1
    """
    largest, correct, bins = most_probable(probabilities, truths)
    present = np.unique(bins)
    table = pd.DataFrame({"confidence": largest, "frequency": correct, "group": groups})
    by_bin = table.groupby(bins)
    curve = by_bin[["confidence", "frequency"]].mean().assign(count=by_bin.size())
    curve.insert(0, "from", present / 10)
    curve.insert(1, "to", (present + 1) / 10)
    cells = {str(number): Tally(correct, np.where(bins == number, 0, -1)) for number in present}
    row = GroupBootstrap().figures(cells, groups)
    for end in ("low", "high"):
        curve[end] = [row[f"{number}_{end}"] for number in present]
    return curve.assign(groups=by_bin["group"].nunique()).reset_index(drop=True)


def most_probable(
    probabilities: ArrayLike, truths: ArrayLike
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Return the largest probability of each recording, whether it is of the true class, its bin.

    Parameters
    ----------
    probabilities : array-like of shape (n_recordings, n_classes)
        Probability of each class.
    truths : array-like of int of shape (n_recordings,)
        Index of the true class.

    Returns
    -------
    largest : ndarray of shape (n_recordings,)
        Probability of the most probable class; of the first, if several are equal.
    correct : ndarray of shape (n_recordings,)
        1 if that class is the true one, else 0.
    bins : ndarray of int of shape (n_recordings,)
        Index of the bin, of ten of equal width from 0 to 1; each includes its lower edge, the last
        both.

    Examples
    --------
    >>> most_probable([[0.8, 0.2], [0.4, 0.6]], [0, 0])
    (array([0.8, 0.6]), array([1., 0.]), array([8, 6]))
    """
    posterior, codes = np.asarray(probabilities, float), np.asarray(truths)
    largest = posterior.max(axis=1)
    correct = (posterior.argmax(axis=1) == codes).astype(float)
    # The rounding error of 10 * 0.3 must not count.
    bins = np.minimum(np.floor(10 * largest + 1e-9), 9).astype(np.intp)
    return largest, correct, bins
