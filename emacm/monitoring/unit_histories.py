"""Readings of several units, sorted by age, with the onset of damage."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm.recordings.meta import plain_label, read_grouping

Array = NDArray[np.float64]

_SAME_LIFE = 1e-6  # relative difference of age + remaining life within a unit


@dataclass(frozen=True)
class History:
    """Readings of one unit, by increasing age.

    Attributes
    ----------
    name : object
        Label of the unit.
    rows : ndarray of int, shape (n_readings,)
        Rows of the table.
    ages : ndarray of shape (n_readings,)
        Ages.
    columns : ndarray of shape (n_readings, n_columns)
        Health index and further columns.
    onset : int
        First reading with damage; ``n_readings`` if there is none.
    """

    name: Any
    rows: NDArray[np.intp]
    ages: Array
    columns: Array
    onset: int

    @property
    def states(self) -> Array:
        """Index, time since the onset and increase since then, of each reading with damage."""
        ages, index = self.ages[self.onset :], self.columns[self.onset :, 0]
        return np.column_stack([index, ages - ages[:1], index - index[:1]])


def read_histories(X: Array, groups: Any, onset: float | None, consecutive: int) -> list[History]:
    """Return the history of each unit.

    Parameters
    ----------
    X : ndarray of shape (n_readings, n_columns)
        Age, health index, further columns.
    groups : None or array-like of shape (n_readings,)
        Unit of each reading; None: each reading is of another unit.
    onset : float or None
        Index above which there is damage; None: from the first reading on.
    consecutive : int
        Readings above `onset` in succession that are the onset; fewer if the unit has fewer.

    Raises
    ------
    ValueError
        If two readings of a unit have the same age.
    """
    grouping = read_grouping(groups, X, "groups", "unit")
    labels = np.arange(len(X)) if grouping is None else grouping.labels
    units, numbers = np.unique(labels, return_inverse=True)
    by_unit = np.lexsort((X[:, 0], numbers))
    starts = np.searchsorted(numbers[by_unit], np.arange(len(units) + 1))
    histories = []
    for label, start, stop in zip(units, starts[:-1], starts[1:], strict=True):
        unit = plain_label(label)
        rows = by_unit[start:stop]
        ages = X[rows, 0]
        same = np.flatnonzero(np.diff(ages) <= 0)
        if len(same):
            raise ValueError(
                f"unit {unit!r} has two readings at age {ages[same[0]]:g} (rows {rows[same[0]]} "
                f"and {rows[same[0] + 1]}). Average them, or give the units by groups=."
            )
        columns = X[rows, 1:]
        first = _onset(columns, onset, consecutive)
        histories.append(History(unit, rows, ages, columns, first))
    return histories


def lives_of(histories: list[History], remaining: Array) -> Array:
    """Return the age at the end of each unit.

    Raises
    ------
    ValueError
        If age and remaining life of a unit do not add up to the same life.
    """
    lives = []
    for unit in histories:
        ends = unit.ages + remaining[unit.rows]
        wrong = np.abs(ends - ends[0]) > _SAME_LIFE * max(abs(ends[0]), 1e-300)
        if wrong.any():
            row = int(np.argmax(wrong))
            raise ValueError(
                f"age + remaining life of unit {unit.name!r} is {ends[0]:g} in row {unit.rows[0]} "
                f"and {ends[row]:g} in row {unit.rows[row]}. Both must be in the same unit of "
                f"time, and a unit ends once; a repaired unit is another unit."
            )
        lives.append(ends[0])
    return np.array(lives)


def censored_units(censored: Any, histories: list[History], n_rows: int) -> NDArray[np.bool_]:
    """Return whether each unit has not failed.

    Raises
    ------
    ValueError
        If `censored` has another length, or differs between the readings of a unit.
    """
    if censored is None:
        return np.zeros(len(histories), dtype=bool)
    values = np.asarray(censored)
    if values.shape != (n_rows,) or not np.isin(values, (0, 1)).all():
        raise ValueError(
            f"censored must hold True or False for each of {n_rows} readings, got shape "
            f"{values.shape} of {values.dtype}."
        )
    values = values.astype(bool)
    for unit in histories:
        if len(set(values[unit.rows])) > 1:
            raise ValueError(
                f"censored is True for some readings of unit {unit.name!r} and False for others. "
                f"It says whether the unit failed at the end, and is the same for all of them."
            )
    return np.array([values[unit.rows[0]] for unit in histories])


def _onset(values: Array, level: float | None, consecutive: int) -> int:
    """Return the first reading with damage, known from it and the readings before it."""
    if not values.shape[1]:
        return len(values)
    if level is None:
        return 0
    above = values[:, 0] > level
    run = 0
    for number, is_above in enumerate(above):
        run = run + 1 if is_above else 0
        if run >= min(consecutive, number + 1):
            return number
    return len(values)
