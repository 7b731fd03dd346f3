"""Which decisions were right, where decisions need not be classes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def right_decisions(
    y_true: ArrayLike, y_pred: ArrayLike, decisions: ArrayLike, classes: ArrayLike, cost: ArrayLike
) -> NDArray[np.bool_]:
    """Tell which recordings were decided rightly.

    Where the true class is itself a decision, that one is right and no other ("inspect" is
    not). Where it is none, as a sub-state whose family is decided for, the
    decision that costs least for it is right; of several that cost the same, each.

    Parameters
    ----------
    y_true : array-like of shape (n_recordings,)
        True classes.
    y_pred : array-like of shape (n_recordings,)
        Decisions taken.
    decisions : array-like of shape (n_decisions,)
        Rows of the cost.
    classes : array-like of shape (n_classes,)
        Columns of the cost.
    cost : array-like of shape (n_decisions, n_classes)
        Rows are the decision, columns the truth.

    Returns
    -------
    right : ndarray of bool of shape (n_recordings,)
        Whether each decision was right. If all decisions are classes, none is right for a
        truth that is no class.

    Raises
    ------
    ValueError
        If numbers of recordings differ, or a truth is neither class nor decision while some
        decisions are no classes, with its position: nobody can say what is right for it.

    Examples
    --------
    >>> decisions, classes = ["healthy", "dry"], ["healthy", "dry 1", "dry 2"]
    >>> cost = [[0, 9, 9], [1, 0, 0]]
    >>> right_decisions(["dry 1", "dry 2"], ["dry", "healthy"], decisions, classes, cost)
    array([ True, False])
    """
    rows, columns = _listed(decisions), _listed(classes)
    truths, chosen = _listed(y_true), _listed(y_pred)
    if len(truths) != len(chosen):
        raise ValueError(
            f"y_true and y_pred must be equally long, got {len(truths)} and {len(chosen)} labels."
        )
    matrix = np.asarray(cost, dtype=np.float64)
    least = matrix == matrix.min(axis=0)
    cheapest = {
        label: {row for row, best in zip(rows, least[:, code], strict=True) if best}
        for code, label in enumerate(columns)
    }
    right = cheapest | {label: {label} for label in rows}
    if set(rows) <= set(columns):
        return np.array([d in right.get(k, ()) for d, k in zip(chosen, truths, strict=True)], bool)
    for place, truth in enumerate(truths):
        if truth not in right:
            raise ValueError(
                f"y holds {truth!r} at recording {place}, which is none of the classes {columns} "
                f"and none of the decisions {rows}: which decision is right for it is not "
                f"known. Leave such recordings out, or give their truth as a decision."
            )
    return np.array([d in right[k] for d, k in zip(chosen, truths, strict=True)], bool)


def _listed(labels: Any) -> list[Any]:
    """Return labels as Python's own objects; a mixed list must not become text."""
    kept = np.asarray(labels, dtype=object if isinstance(labels, list | tuple) else None)
    return [label.item() if isinstance(label, np.generic) else label for label in kept.tolist()]
