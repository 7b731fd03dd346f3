"""Answers of several estimators, put back into the order of the recordings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.orders.columns import OrderTable, column_names

Rows = NDArray[np.intp]


def joined_rows(parts: Sequence[Any], places: Sequence[Rows]) -> NDArray[Any]:
    """Put arrays together, row by row.

    Parameters
    ----------
    parts : sequence of array-like of shape (n_rows, ...)
        The answers.
    places : sequence of ndarray of shape (n_rows,)
        Where each row belongs.

    Returns
    -------
    ndarray of shape (n_recordings, ...)
        Text and numbers together stay what they are, as objects.

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
            f"estimators of different conditions answer with rows of different shapes: "
            f"{sorted(shapes)}. Give them parameters that do not depend on the condition."
        )
    joined = np.empty((sum(map(len, places)), *shapes.pop()), _common_type(arrays))
    for array, rows in zip(arrays, places, strict=True):
        joined[rows] = array
    return joined


def aligned_columns(
    parts: Sequence[Any], known: Sequence[NDArray[Any]], labels: NDArray[Any], *, absent: float
) -> list[NDArray[np.floating]]:
    """Give each part a column for each label.

    Parameters
    ----------
    parts : sequence of array-like of shape (n_rows, n_known), or (n_rows,) for two labels
        A single column favours the second of two labels, as scikit-learn has it.
    known : sequence of ndarray of shape (n_known,)
        Labels of the columns of each part.
    labels : ndarray of shape (n_labels,)
        The labels wanted.
    absent : float
        What stands for a label that a part does not know.

    Returns
    -------
    list of ndarray
        The parts as they are, if all of them know all labels in this order.

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
        if array.ndim == 1 and len(own) == 2:
            array = np.stack([-array, array], axis=1)
        if array.shape != (len(array), len(own)):
            raise ValueError(
                f"answers of shape {array.shape} cannot be set beside those of other conditions: "
                f"expected was a column for each of {own.tolist()}."
            )
        table = np.full((len(array), len(wanted)), float(absent))
        table[:, [wanted.index(label) for label in own.tolist()]] = array
        aligned.append(table)
    return aligned


def joined_tables(
    parts: Sequence[Any], places: Sequence[Rows], *, known: Sequence[Any] | None = None
) -> Any:
    """Put tables, or lists of recordings, together row by row.

    Parameters
    ----------
    parts : sequence of list, array, OrderTable or DataFrame
        What the transformers returned.
    places : sequence of ndarray of shape (n_rows,)
        Where each row belongs.

    Returns
    -------
    list, array, OrderTable or DataFrame
        Of the kind of the parts.

    Raises
    ------
    ValueError
        If their columns differ.

    Examples
    --------
    >>> joined_tables([["b"], ["a", "c"]], [np.array([1]), np.array([0, 2])])
    ['a', 'b', 'c']
    """
    order = np.argsort(np.concatenate(places), kind="stable")
    if isinstance(parts[0], list):
        together = [entry for part in parts for entry in part]
        return [together[place] for place in order]
    names = {column_names(part) for part in parts}
    for different in (names, set(known or ())):
        if len(different) > 1:
            raise ValueError(
                "transformers of different conditions return different columns: "
                + " and ".join(_spanned(columns) for columns in different)
                + ". Give them parameters that do not depend on the condition."
            )
    if isinstance(parts[0], pd.DataFrame):
        return pd.concat(parts).iloc[order]
    joined = joined_rows(parts, places)
    columns = names.pop()
    return joined if columns is None else _named_like(parts[0], joined, columns)


def _named_like(part: Any, joined: NDArray[Any], columns: Sequence[Any]) -> Any:
    if isinstance(part, OrderTable):
        return OrderTable(joined, columns)
    return type(part)(joined, schema=list(columns))  # polars


def _common_type(arrays: Sequence[NDArray[Any]]) -> Any:
    kinds = {"U" if array.dtype.kind in "US" else array.dtype.kind for array in arrays}
    if kinds <= {"U"} or kinds <= set("iuf") or len(kinds) == 1:
        return np.result_type(*arrays)
    return np.dtype(object)


def _spanned(columns: Sequence[Any] | None) -> str:
    if columns is None:
        return "columns without names"
    return f"{len(columns)} ({columns[0]!r} to {columns[-1]!r})"
