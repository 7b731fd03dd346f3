"""Metrics of decisions: which decisions are correct, and their mean cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.utils import check_consistent_length

from emacm._checks import located, positive_weights
from emacm.decisions.costs import (
    check_pairs,
    cost_table,
    label_list,
    label_positions,
    plain_labels,
)
from emacm.decisions.pipelines import final_estimator

Correct = dict[Any, tuple[Any, ...]]


def correct_decisions(decisions: ArrayLike, classes: ArrayLike, cost: ArrayLike) -> Correct:
    """Return the correct decisions for each true class.

    Where the true class is itself a decision, this decision is correct and no other ("inspect" is
    not). Where it is not, such as a state whose family is decided on, the decision with the least
    cost for it is correct; if several have the same least cost, each of them is.

    Parameters
    ----------
    decisions : array-like of shape (n_decisions,)
        Rows of the cost.
    classes : array-like of shape (n_classes,)
        Columns of the cost.
    cost : array-like of shape (n_decisions, n_classes)
        Rows are decisions, columns are true classes.

    Returns
    -------
    dict
        {true class: correct decisions}, in the order of `decisions`. Decisions that are not
        classes are included, each correct for itself, since `y` may contain families.

    Examples
    --------
    >>> cost = [[0, 9, 9], [1, 0, 0]]
    >>> correct_decisions(["healthy", "dry"], ["healthy", "dry 1", "dry 2"], cost)
    {'healthy': ('healthy',), 'dry 1': ('dry',), 'dry 2': ('dry',), 'dry': ('dry',)}
    """
    rows, columns = label_list(decisions, "decisions"), label_list(classes, "classes")
    matrix = np.asarray(cost, dtype=np.float64)
    least, largest = matrix.min(axis=0), np.abs(matrix).max(axis=0)
    cheapest = matrix - least <= 1e-12 * largest  # equal but for rounding
    correct: Correct = {
        label: tuple(row for row, is_least in zip(rows, column, strict=True) if is_least)
        for label, column in zip(columns, cheapest.T, strict=True)
    }
    return correct | {label: (label,) for label in rows}


def are_correct(
    y_true: Sequence[Any], y_pred: Sequence[Any], correct: Mapping[Any, Sequence[Any]]
) -> NDArray[np.bool_]:
    """Return whether each decision is correct.

    Parameters
    ----------
    y_true, y_pred : sequence of n_recordings
        True classes, and decisions, as Python objects. A decision that is a class stands for the
        decision that is correct for this class, so a classifier of states may be compared by
        families.
    correct : mapping
        Of `correct_decisions`. A label that it does not contain is correct for itself only.

    Returns
    -------
    ndarray of bool of shape (n_recordings,)

    Examples
    --------
    >>> correct = {"healthy": ("healthy",), "dry 1": ("dry",), "dry 2": ("dry",)}
    >>> are_correct(["dry 1", "dry 1", "healthy"], ["dry", "dry 2", "dry"], correct)
    array([ True,  True, False])
    """
    decided = [label_of(decision, correct) for decision in y_pred]
    pairs = zip(y_true, decided, strict=True)
    return np.array([label in correct.get(truth, (truth,)) for truth, label in pairs], bool)


def label_of(label: Any, correct: Mapping[Any, Sequence[Any]]) -> Any:
    """Return the first correct decision for a class, or a label that is not a class itself."""
    return correct[label][0] if label in correct else label


def fraction_correct(
    y_true: ArrayLike,
    y_pred: ArrayLike,
    table: tuple[ArrayLike, ArrayLike, ArrayLike],
    sample_weight: ArrayLike | None = None,
) -> float:
    """Return the fraction of correct decisions, the `score` of classifiers with costs.

    Parameters
    ----------
    y_true : array-like of shape (n_recordings,)
        True classes, or decisions.
    y_pred : array-like of shape (n_recordings,)
        Decisions.
    table : tuple of (decisions, classes, cost)
        As for `correct_decisions`.
    sample_weight : array-like of shape (n_recordings,), optional
        How often each recording counts.

    Returns
    -------
    float
        0 to 1. If all decisions are classes, no decision is correct for a truth that is not a
        class.

    Raises
    ------
    ValueError
        If the numbers of recordings differ, or a truth is neither a class nor a decision while
        some decisions are not classes (its correct decision is unknown).

    Examples
    --------
    >>> table = ["healthy", "dry"], ["healthy", "dry 1", "dry 2"], [[0, 9, 9], [1, 0, 0]]
    >>> fraction_correct(["dry 1", "dry 2"], ["dry", "healthy"], table)
    0.5
    """
    truths, chosen = _equally_long(y_true, y_pred)
    decisions, classes = (label_list(labels) for labels in table[:2])
    correct = correct_decisions(*table)
    if not set(decisions) <= set(classes):
        label_positions(truths, list(correct), "y", "class or decision")
    is_correct = are_correct(truths, chosen, correct)
    return float(np.average(is_correct, weights=positive_weights(sample_weight, len(truths))))


def expected_cost(
    y_true: ArrayLike,
    y_pred: ArrayLike,
    *,
    cost: Any = None,
    labels: ArrayLike | None = None,
    sample_weight: ArrayLike | None = None,
) -> float:
    """Return the mean cost per recording of decisions.

    Rows of `cost` are decisions, columns are true classes. The confusion matrix of
    scikit-learn and the cost of MATLAB have the true classes in rows; therefore
    ``(cost.T * confusion_matrix(y_true, y_pred)).sum() / n_recordings`` is the same number.

    Parameters
    ----------
    y_true : array-like of shape (n_recordings,)
        The true classes.
    y_pred : array-like of shape (n_recordings,)
        The decisions: classes, or other decisions that `cost` contains.
    cost : None, array-like, DataFrame or mapping, default=None
        As for `CostSensitiveGaussianBayes`; None counts errors (0-1).
    labels : array-like of shape (n_classes,), default=None
        The classes, in the order of an array `cost`. Default: the columns of a DataFrame; for a
        mapping, the true classes in its keys and in `y_true`; otherwise the sorted union
        of `y_true` and `y_pred`.
    sample_weight : array-like of shape (n_recordings,), default=None
        How often each recording counts.

    Returns
    -------
    cost : float
        Mean cost per recording, in the unit of `cost`.

    Raises
    ------
    TypeError, ValueError
        If lengths differ, a label has no row or column (the message gives its position), the
        array does not fit the labels that occur, or a cost or a weight is invalid.

    See Also
    --------
    emacm.neg_expected_cost : As a scorer of scikit-learn.
    emacm.evaluate : With intervals, by run and by unit.

    Examples
    --------
    >>> expected_cost([0, 0, 1, 1], [0, 1, 1, 0], cost=[[0, 10], [1, 0]])
    2.75
    >>> expected_cost([0, 1], [0, "inspect"], cost={("inspect", 0): 0.2, ("inspect", 1): 0.2})
    0.1
    """
    truths, chosen = _equally_long(y_true, y_pred)
    if not truths:
        raise ValueError("y_true must contain at least one label, got none.")
    classes = _metric_classes(cost, truths, chosen) if labels is None else np.asarray(labels)
    decisions, matrix = cost_table(cost, classes)
    costs = decision_costs(truths, chosen, (decisions, classes, matrix))
    return float(np.average(costs, weights=positive_weights(sample_weight, len(truths))))


def neg_expected_cost(estimator: Any, X: Any, y: ArrayLike) -> float:
    """Score a fitted classifier by the negative of the mean cost of its decisions.

    A scorer for `scoring=` of `GridSearchCV`, `cross_validate` and others. The cost is
    that of the classifier itself, found at the end of a Pipeline or in the best estimator
    of a search. It is not suitable for a search over the cost itself, whose unit would change, nor
    for `TunedThresholdClassifierCV`, which tunes what costs determine here: that takes
    ``make_scorer(expected_cost, greater_is_better=False, cost=...)``.

    Parameters
    ----------
    estimator : CostSensitiveGaussianBayes, Pipeline or fitted search
        Fitted; the last step has `cost_`, `decisions_` and `classes_`.
    X : array-like of n_recordings
        Input of the estimator.
    y : array-like of shape (n_recordings,)
        True classes.

    Returns
    -------
    score : float
        Negative of the mean cost per recording; higher is better.

    Raises
    ------
    TypeError
        If the classifier has no cost.
    ValueError
        If `y` contains a class that is absent from training.

    See Also
    --------
    emacm.expected_cost : The figure itself.

    Examples
    --------
    >>> from emacm import CostSensitiveGaussianBayes
    >>> X, y = [[0.0], [1.0], [2.0], [3.0]], ["healthy", "healthy", "worn", "worn"]
    >>> model = CostSensitiveGaussianBayes({("healthy", "worn"): 10}).fit(X, y)
    >>> neg_expected_cost(model, [[0.5], [0.4]], ["healthy", "worn"])
    -5.0
    """
    final = final_estimator(estimator)
    if not hasattr(final, "cost_"):
        raise TypeError(
            f"neg_expected_cost needs a fitted classifier with costs, but {final!r} has no cost_. "
            f"For others: make_scorer(expected_cost, greater_is_better=False, cost=...)."
        )
    truths, chosen = _equally_long(y, estimator.predict(X))
    table = final.decisions_, getattr(final, "truths_", final.classes_), final.cost_
    return -float(decision_costs(truths, chosen, table).mean())


def decision_costs(
    truths: Sequence[Any], chosen: Sequence[Any], table: tuple[ArrayLike, ArrayLike, ArrayLike]
) -> NDArray[np.float64]:
    """Return the cost of each decision.

    Parameters
    ----------
    truths, chosen : sequence of n_recordings
        True classes, and decisions, as Python objects.
    table : tuple of (decisions, classes, cost)
        Labels of the rows and columns, and the cost of shape (n_decisions, n_classes).

    Returns
    -------
    ndarray of shape (n_recordings,)
        In the unit of the cost.

    Raises
    ------
    ValueError
        If a label has no row or column; the message gives its position.

    Examples
    --------
    >>> labels, cost = ["new", "worn"], [[0, 9], [1, 0]]
    >>> decision_costs(["new", "worn"], ["worn", "new"], (labels, labels, cost))
    array([1., 9.])
    """
    decisions, classes = (plain_labels(np.asarray(labels)) for labels in table[:2])
    rows = label_positions(chosen, decisions, "y_pred", "decision")
    columns = label_positions(truths, classes, "y_true", "class")
    return np.asarray(table[2], dtype=np.float64)[rows, columns]


def _equally_long(y_true: ArrayLike, y_pred: ArrayLike) -> tuple[list[Any], list[Any]]:
    truths, chosen = label_list(y_true, "y_true"), label_list(y_pred, "y_pred")
    check_consistent_length(truths, chosen)
    return truths, chosen


def _metric_classes(cost: Any, truths: list[Any], chosen: list[Any]) -> NDArray[Any]:
    """Return the classes where the caller of the metric gave none."""
    if isinstance(cost, pd.DataFrame):
        return cost.columns.to_numpy()
    found = {*truths, *chosen}
    if isinstance(cost, Mapping):
        check_pairs(cost)
        decisions, causes = (set(labels) for labels in zip(*cost, strict=True))
        found = {*truths, *causes, *(set(chosen) - decisions)}
    with located("labels of different types have no order, give labels=..., the classes"):
        return np.asarray(sorted(found))
