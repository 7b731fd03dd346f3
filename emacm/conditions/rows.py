"""Rows of the recordings of one condition, and results in the order of all recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn import config_context

from emacm._checks import located
from emacm.decisions.labels import check_classes
from emacm.recordings.meta import chosen_rows

Rows = NDArray[np.intp]


def joined_rows(parts: Sequence[Any], places: Sequence[Rows]) -> NDArray[Any]:
    """Join arrays row by row.

    Parameters
    ----------
    parts : sequence of array-like of shape (n_rows, ...)
        Results for some recordings each.
    places : sequence of ndarray of shape (n_rows,)
        Numbers of the rows in the result.

    Returns
    -------
    ndarray of shape (n_recordings, ...)
        Text and numbers together are kept as objects.

    Raises
    ------
    ValueError
        If parts have different numbers of columns.

    Examples
    --------
    >>> joined_rows([["b"], ["a", "inspect"]], [np.array([1]), np.array([0, 2])]).tolist()
    ['a', 'b', 'inspect']
    """
    arrays = [np.asarray(part) for part in parts]
    shapes = {array.shape[1:] for array in arrays}
    if len(shapes) > 1:
        raise ValueError(
            f"classifiers of different conditions return rows of different shapes: "
            f"{sorted(shapes)}. Give them parameters that do not depend on the condition."
        )
    joined = np.empty((sum(map(len, places)), *shapes.pop()), _common_type(arrays))
    for array, rows in zip(arrays, places, strict=True):
        joined[rows] = array
    return joined


def aligned_columns(
    parts: Sequence[Any], known: Sequence[NDArray[Any]], labels: NDArray[Any], *, absent: float
) -> list[NDArray[np.floating]]:
    """Return each part with one column for each label.

    Parameters
    ----------
    parts : sequence of array-like of shape (n_rows, n_known)
        Results for some recordings each.
    known : sequence of ndarray of shape (n_known,)
        Labels of the columns of each part.
    labels : ndarray of shape (n_labels,)
        Labels of the result.
    absent : float
        Value of a label that a part has no column for.

    Returns
    -------
    list of ndarray of shape (n_rows, n_labels)
        The parts unchanged, if all have these labels in this order.

    Raises
    ------
    ValueError
        If the columns of a part are not one for each label.

    Examples
    --------
    >>> aligned_columns([[[0.2, 0.8]]], [np.array(["a", "c"])], np.array(["a", "b", "c"]), absent=0)
    [array([[0.2, 0. , 0.8]])]
    """
    arrays = [np.asarray(part) for part in parts]
    wanted = labels.tolist()
    if all(own.tolist() == wanted for own in known):
        return arrays
    aligned = []
    for array, own in zip(arrays, known, strict=True):
        if array.shape != (len(array), len(own)):
            raise ValueError(
                f"results of shape {array.shape} cannot be joined with those of other conditions: "
                f"expected one column for each of {own.tolist()}."
            )
        table = np.full((len(array), len(wanted)), float(absent))
        table[:, [wanted.index(label) for label in own.tolist()]] = array
        aligned.append(table)
    return aligned


def fit_on_rows(
    model: Any,
    rows: Rows,
    name: str,
    *,
    X: Any,
    y: Any,
    fit_params: Mapping[str, Any],
    config: Mapping[str, Any],
) -> Any:
    """Fit on some recordings, with their rows of all other arguments.

    `config` is the configuration of scikit-learn in the calling thread.
    """
    cut = {
        key: chosen_rows(value, rows) if _per_recording(value, len(y)) else value
        for key, value in fit_params.items()
    }
    with located(f"among the recordings {name}"), config_context(**config):
        return model.fit(chosen_rows(X, rows), chosen_rows(y, rows), **cut)


def check_labels(y: Any, n_recordings: int) -> None:
    """Raise if y does not hold one valid class for each recording."""
    if y is None:
        raise ValueError("a classifier needs y, the class of each recording; call fit(X, y).")
    if isinstance(y, str | Mapping) or getattr(y, "ndim", 1) == 0 or not hasattr(y, "__len__"):
        raise TypeError(
            f"y must be a list or an array with one class for each of {n_recordings} recordings, "
            f"got {type(y).__name__}."
        )
    if len(y) != n_recordings:
        raise ValueError(f"y has {len(y)} entries for {n_recordings} recordings.")
    check_classes(y)


def check_two_classes(y: Any, groups: Sequence[Rows], names: Sequence[str]) -> None:
    """Raise a ValueError if the recordings of a condition are all of one class."""
    for rows, name in zip(groups, names, strict=True):
        classes = np.unique(np.asarray(chosen_rows(y, rows))).tolist()
        if len(classes) < 2:
            raise ValueError(
                f"all {len(rows)} recordings {name} are of class {classes[0]!r}; a classifier "
                f"needs two classes in each condition. Add recordings of another class there, or "
                f"leave this condition out."
            )


def _common_type(arrays: Sequence[NDArray[Any]]) -> Any:
    kinds = {"U" if array.dtype.kind in "US" else array.dtype.kind for array in arrays}
    if kinds <= {"U"} or kinds <= set("iuf") or len(kinds) == 1:
        return np.result_type(*arrays)
    return np.dtype(object)


def _per_recording(value: Any, n_recordings: int) -> bool:
    if isinstance(value, str | Mapping) or not hasattr(value, "__len__"):
        return False
    shape = getattr(value, "shape", None)
    return (len(value) if shape is None else shape[0] if shape else -1) == n_recordings
