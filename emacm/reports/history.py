"""Since when a state has been decided, from earlier results of the same unit."""

from __future__ import annotations

from typing import Any

import pandas as pd

from emacm.reports.facts import when


def check_history(history: Any, has_unit: bool, has_time: bool) -> pd.DataFrame:
    """Return earlier results with the columns "decision", "unit" and "time".

    Parameters
    ----------
    history : DataFrame, optional
        As `score` returns it, with "unit" and "time" added.
    has_unit, has_time : bool
        Whether the units and times of the new recordings are known.

    Returns
    -------
    DataFrame
        Without rows that have no decision; "unit" and "time" are None where they are not known.

    Raises
    ------
    ValueError
        If it is not a table, or a column is missing.
    """
    columns = ["decision", *["unit"] * has_unit, *["time"] * has_time]
    if history is None:
        history = pd.DataFrame(columns=columns)
    found = list(getattr(history, "columns", ()))
    for name in columns:
        if name not in found:
            raise ValueError(
                f"history must be a table of earlier results, as from score, with the columns "
                f"{columns} as far as the new recordings have them; it has no {name!r} in {found}."
            )
    kept = history.loc[history["decision"].fillna("").astype(str) != "", columns]
    return kept.reindex(columns=["decision", "unit", "time"]).astype(object)


def as_times(values: list[Any]) -> list[Any]:
    """Return texts and dates as pandas Timestamps without a time zone; numbers are unchanged.

    Raises
    ------
    ValueError
        If a text is not a date, or numbers and dates are mixed.
    """
    numbers = [isinstance(value, int | float) for value in values]
    if all(numbers):
        return values
    try:
        if any(numbers):
            raise ValueError("some are numbers")
        return [pd.Timestamp(value).tz_localize(None) for value in values]
    except (ValueError, TypeError) as error:
        raise ValueError(
            f"times of recordings and history must all be numbers, or all be dates such as "
            f"'2024-05-01 22:10'; got {values[0]!r} ({error})."
        ) from error


def since(decision: Any, time: Any, earlier: pd.DataFrame, name: str = "") -> str:
    """Return since when a decision has been made without interruption.

    Parameters
    ----------
    decision : label
        The decision on the recording.
    time : Timestamp or number, optional
        Time of the recording. None: it is the latest.
    earlier : DataFrame
        Earlier results of the same unit with the columns "decision" and "time"; None as times: in
        their order.
    name : str
        Name of a time that is a counter, such as "cycle".

    Returns
    -------
    str
        A sentence.

    Examples
    --------
    >>> table = pd.DataFrame({"decision": ["ok", "worn", "worn"], "time": [100, 200, 300]})
    >>> since("worn", 400, table, "cycle")
    "Since cycle 200, in 3 recordings in a row; before that, 'ok' (cycle 100)."
    >>> since("ok", 50, table)
    'No earlier result of this unit is known.'
    """
    if time is not None:
        earlier = earlier[earlier["time"] < time].sort_values("time", kind="stable")
    if earlier.empty:
        return "No earlier result of this unit is known."
    rows = [
        (str(decided), "" if time is None else when(at, name))
        for decided, at in zip(earlier["decision"], earlier["time"], strict=True)
    ]
    first = len(rows)  # of the uninterrupted decisions
    while first and rows[first - 1][0] == str(decision):
        first -= 1
    before = ""
    if first:
        other, at = rows[first - 1]
        before = f"{other!r}{f' ({at})' if at else ''}."
    if first == len(rows):
        return f"New: the recording before, of this unit, was {before}"
    start = f"Since {rows[first][1]}, in" if rows[first][1] else "In"
    text = f"{start} {len(rows) - first + 1} recordings in a row"
    if before:
        return f"{text}; before that, {before}"
    return f"{text}: in all that are known of this unit."
