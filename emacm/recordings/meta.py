"""Under which condition a recording was made, and whether its machine was healthy then."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import located, once_hint
from emacm.recordings.recording import check_unique_columns, described

_COLLECTIONS = (list, tuple, set, frozenset, np.ndarray, pd.Series, pd.Index)


def read_conditions(X: Any, condition: Any) -> list[Any]:
    """Return the condition of each recording.

    Parameters
    ----------
    X : sequence of Recording or AngleRecording, or DataFrame
        Recordings; of a DataFrame, each row is one. A callable may read anything else.
    condition : hashable, tuple or callable
        Key of `meta` (of a DataFrame: name of a column), several of them as a tuple, or a
        function of the recording (of the row).

    Returns
    -------
    list of hashable
        One for each recording; tuples, where there are several keys.

    Raises
    ------
    TypeError
        If X is no sequence, an entry has no `meta`, or its condition cannot be a key.
    ValueError
        If X is empty, or a recording lacks the key, or has None or a number there that is not
        finite (the message names the recording and the key); if `condition` names no key.

    Examples
    --------
    >>> from emacm import Recording
    >>> speed = [1.0, 1.0]
    >>> runs = [
    ...     Recording({"torque": [0, 1]}, 1, velocity=speed, meta={"load": load, "unit": "A"})
    ...     for load in (20, 40)
    ... ]
    >>> read_conditions(runs, "load"), read_conditions(runs, ("unit", "load"))
    ([20, 40], [('A', 20), ('A', 40)])
    """
    entries = listed_recordings(X)
    keys = _keys(condition)
    found = []
    for index, entry in enumerate(entries):
        if callable(condition):
            value = _checked(condition(entry), entry, index, "the function condition gives")
        else:
            values = tuple(_known(entry, index, key) for key in keys)
            value = values if isinstance(condition, tuple) else values[0]
        found.append(value)
    return found


def healthy_recordings(X: Any, y: ArrayLike | None, healthy: Any) -> NDArray[np.bool_]:
    """Tell which recordings are of a healthy machine.

    Parameters
    ----------
    X : sequence of Recording or AngleRecording, or DataFrame
        Recordings.
    y : array-like of shape (n_recordings,) or None
        Their labels, where `healthy` is a label.
    healthy : label, collection of labels, mapping or callable
        Labels of `y`; or {key of `meta`: value, or a list of values}, all of
        which must hold; or a function of the recording that returns a bool.

    Returns
    -------
    ndarray of bool, shape (n_recordings,)

    Raises
    ------
    TypeError
        If a function returns no bool.
    ValueError
        If `y` is needed and missing, or not as long as X, or holds no such label; or a
        recording lacks a key.

    Examples
    --------
    >>> from emacm import Recording
    >>> runs = [
    ...     Recording({"torque": [0, 1]}, 1, velocity=[1.0, 1.0], meta={"hours": hours})
    ...     for hours in (0, 900)
    ... ]
    >>> healthy_recordings(runs, ["new", "worn"], "new").tolist()
    [True, False]
    >>> healthy_recordings(runs, None, lambda run: run.meta["hours"] < 100).tolist()
    [True, False]
    """
    entries = listed_recordings(X)
    if callable(healthy):
        answers = [healthy(entry) for entry in entries]
        for index, (entry, answer) in enumerate(zip(entries, answers, strict=True)):
            if not isinstance(answer, bool | np.bool_):
                raise TypeError(
                    f"healthy as a function must return True or False, got {answer!r} for "
                    f"{described(entry, index)}."
                )
        return np.array(answers, dtype=bool)
    if isinstance(healthy, Mapping):
        wanted = {key: _listed(values) for key, values in healthy.items()}
        if not wanted:
            raise ValueError("healthy must name at least one key of meta, got an empty mapping.")
        return np.array(
            [
                all(_known(entry, index, key) in values for key, values in wanted.items())
                for index, entry in enumerate(entries)
            ]
        )
    return _labelled(y, len(entries), _listed(healthy))


def condition_name(condition: Any, value: Any) -> str:
    """Write a condition as messages do.

    Examples
    --------
    >>> condition_name("load", 20), condition_name(("unit", "load"), ("A", 20))
    ('load=20', "unit='A', load=20")
    """
    if callable(condition):
        return f"condition {value!r}"
    if isinstance(condition, tuple):
        pairs = zip(condition, value, strict=True)
        return ", ".join(f"{key}={part!r}" for key, part in pairs)
    return f"{condition}={value!r}"


def sorted_conditions(values: Iterable[Hashable]) -> tuple[Any, ...]:
    """Return each condition once, sorted where they have an order, else as they come.

    Examples
    --------
    >>> sorted_conditions([40, -40, 20, 40]), sorted_conditions(["b", 1])
    ((-40, 20, 40), ('b', 1))
    """
    distinct = list(dict.fromkeys(values))
    try:
        return tuple(sorted(distinct))
    except TypeError:
        return tuple(distinct)


def chosen_rows(values: Any, rows: NDArray[np.intp]) -> Any:
    """Return some recordings, labels or weights, in the kind of container they came in.

    Examples
    --------
    >>> chosen_rows(["a", "b", "c"], np.array([2, 0]))
    ['c', 'a']
    """
    if isinstance(values, pd.DataFrame | pd.Series):
        return values.iloc[rows]
    if isinstance(values, list | tuple):
        return [values[row] for row in rows]
    if hasattr(values, "shape"):
        return values[rows]
    return [values[int(row)] for row in rows]


def listed_recordings(X: Any) -> list[Any]:
    """Return what X holds, one entry for each recording.

    Raises
    ------
    TypeError
        If X is no sequence, array or DataFrame.
    ValueError
        If it is empty, or columns of a DataFrame have the same name.

    Examples
    --------
    >>> listed_recordings(pd.DataFrame({"load": [20, 40]}))[1]["load"]
    40
    """
    if isinstance(X, pd.DataFrame):
        check_unique_columns(X, "X")
        entries = [row for _, row in X.astype(object).iterrows()]  # whole numbers stay whole
    elif isinstance(X, str | Mapping) or not isinstance(X, Sequence | np.ndarray):
        hint = " Write [recording]." if hasattr(X, "meta") else once_hint(X)
        raise TypeError(f"X must be a list of recordings, got {_kind(X)}.{hint}")
    else:
        entries = list(X)
    if not entries:
        raise ValueError("X holds no recording; at least one is needed.")
    return entries


def _kind(value: Any) -> str:
    """Say what came in the place of a list, without all that it holds."""
    if value is None or isinstance(value, str):
        return repr(value)
    package, name = type(value).__module__.partition(".")[0], type(value).__name__
    return f"a {package} {name}, and not one of pandas" if name == "DataFrame" else f"a {name}"


def _keys(condition: Any) -> tuple[Any, ...]:
    """Return the keys that a condition names, or say why it names none."""
    keys = condition if isinstance(condition, tuple) else (condition,)
    if not keys:
        raise ValueError("condition must name at least one key of meta, got ().")
    for key in keys:
        if not isinstance(key, Hashable):
            raise TypeError(
                f"condition must be a key of meta such as 'load', a tuple of keys, or a function; "
                f"got {condition!r}."
            )
    return keys


def _known(entry: Any, index: int, key: Any) -> Any:
    """Return what a recording, or a row of a DataFrame, tells under a key."""
    facts = entry if isinstance(entry, pd.Series) else getattr(entry, "meta", None)
    kind = "column" if isinstance(entry, pd.Series) else "meta key"
    if not isinstance(facts, Mapping | pd.Series):
        raise TypeError(
            f"recording {index} is a {type(entry).__name__}, which has no meta to tell its "
            f"{key!r}. Pass recordings with meta={{{key!r}: ...}}, or a function that reads it."
        )
    if key not in facts:
        raise ValueError(
            f"{described(entry, index)} has no {kind} {key!r}, only {list(facts.keys())}. State "
            f"it when the recording is made, or leave the recording out."
        )
    return _checked(facts[key], entry, index, f"its {kind} {key!r} is")


def _checked(value: Any, entry: Any, index: int, what: str) -> Hashable:
    """Return a value that can be a key, as Python's own object."""
    value = value.item() if isinstance(value, np.generic) else value
    with located(lambda: described(entry, index)):
        try:
            hash(value)
        except TypeError as error:
            raise TypeError(
                f"{what} {value!r}, which cannot be looked up. Use a number, a text or a tuple."
            ) from error
        if value is None or (isinstance(value, float) and not np.isfinite(value)):
            raise ValueError(f"{what} {value!r}, which is no condition. State it, or leave it out.")
    return value


def _listed(values: Any) -> list[Any]:
    listed = list(values) if isinstance(values, _COLLECTIONS) else [values]
    return [value.item() if isinstance(value, np.generic) else value for value in listed]


def _labelled(y: Any, n_recordings: int, healthy: list[Any]) -> NDArray[np.bool_]:
    if y is None:
        raise ValueError(
            f"healthy = {healthy} names labels of y, but no y was given. Call fit(X, y), or let "
            f"healthy read the recordings: a mapping of meta keys to values, or a function."
        )
    if isinstance(y, str | Mapping) or not isinstance(y, Iterable) or getattr(y, "ndim", 1) > 1:
        came = f"an array of shape {np.shape(y)}" if hasattr(y, "shape") else _kind(y)
        raise TypeError(f"y must hold one label for each recording, got {came}.")
    labels = _listed(y if isinstance(y, _COLLECTIONS) else list(y))
    if len(labels) != n_recordings:
        raise ValueError(f"y has {len(labels)} labels for {n_recordings} recordings.")
    for label in healthy:
        if label not in labels:
            found = list(dict.fromkeys(labels))
            raise ValueError(f"healthy names {label!r}, which is not in y. y holds {found}.")
    if not healthy:
        raise ValueError("healthy must name at least one label of y, got none.")
    return np.array([label in healthy for label in labels])
