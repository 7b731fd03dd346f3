"""Since when a state has been decided, from earlier results of the same unit."""

from __future__ import annotations

from typing import Any

import pandas as pd

from emacm.reports.facts import when


def check_history(history: Any, unit: Any, time: Any) -> pd.DataFrame:
    """Return earlier results with the columns "decision", "unit" and "time".

    Parameters
    ----------
    history : DataFrame
        As `score` returns it, with "unit" and "time" added.
    unit, time : any
        Whether the units and times of the new recordings are known (not None).

    Returns
    -------
    DataFrame
        Without rows that have no decision; "unit" and "time" are None where they are not known.

    Raises
    ------
    TypeError, ValueError
        If it is not a table, or a column is missing.
    """
    if not isinstance(history, pd.DataFrame):
        raise TypeError(
            f"history must be a table of earlier results as from score, got "
            f"{type(history).__name__}."
        )
    needed = {"decision": True, "unit": unit is not None, "time": time is not None}
    for name, wanted in needed.items():
        if wanted and name not in history.columns:
            raise ValueError(
                f"history must have the column {name!r}, as the new recordings have a {name}; its "
                f"columns are {list(history.columns)}."
            )
    kept = history[history["decision"].notna() & (history["decision"].astype(str) != "")]
    columns = {name: kept[name] if wanted else None for name, wanted in needed.items()}
    return pd.DataFrame(columns, index=kept.index)


def as_times(values: list[Any]) -> list[Any]:
    """Return texts and dates as pandas Timestamps without a time zone; numbers are unchanged.

    Raises
    ------
    ValueError
        If a text is not a date, or numbers and dates are mixed.
    """
    if all(isinstance(value, int | float) for value in values):
        return values
    if any(isinstance(value, int | float) for value in values):
        raise ValueError(
            "times must all be numbers, or all be dates; got both in the recordings and history."
        )
    try:
        return [pd.Timestamp(value).tz_localize(None) for value in values]
    except (ValueError, TypeError) as error:
        raise ValueError(
            f"times must be numbers, or dates such as '2024-05-01 22:10'; got {values[0]!r} "
            f"({error})."
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
    decided = [str(value) for value in earlier["decision"]]
    times = [None if time is None else value for value in earlier["time"]]
    if not decided:
        return "No earlier result of this unit is known."
    others = [place for place, value in enumerate(decided) if value != str(decision)]
    first = others[-1] + 1 if others else 0
    count = len(decided) - first + 1  # with this one

    def at(place: int) -> str:
        return "" if times[place] is None else f" ({when(times[place], name)})"

    if count == 1:
        return f"New: the recording before, of this unit, was {decided[-1]!r}{at(-1)}."
    start = "" if times[first] is None else f"Since {when(times[first], name)}, in "
    text = f"{start}{count} recordings in a row" if start else f"In {count} recordings in a row"
    if not others:
        return f"{text}: in all that are known of this unit."
    return f"{text}; before that, {decided[others[-1]]!r}{at(others[-1])}."
