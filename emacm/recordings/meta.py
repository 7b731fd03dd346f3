"""Reader of the `meta` of recordings: condition, run, unit.

Wherever a parameter selects content of `meta`, it has one of these forms:

- a key, such as "load"; if X is a DataFrame, the name of a column;
- a tuple of keys, such as ("unit", "load"), which gives tuples of values;
- a function of the recording (of the row, if X is a table);
- where the caller accepts it, an array with one value for each recording.
"""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm._checks import check_unique_columns, located, once_hint
from emacm.recordings.inputs import as_list, described

_FORMS = "{} must be a key of meta such as 'load', a tuple of keys, or a function of the recording"


@dataclass(frozen=True)
class Grouping:
    """One label for each recording, and the name of the property that is labelled.

    Attributes
    ----------
    name : str
        For example "run".
    labels : ndarray of shape (n_recordings,)
        The labels: sortable, none missing. Tuples are written as text.
    """

    name: str
    labels: NDArray[Any]


def read_meta(X: Any, keys: Any, *, role: str = "condition", arrays: bool = False) -> list[Any]:
    """Return the value of each recording under a key of its `meta`.

    Parameters
    ----------
    X : sequence of Recording or AngleRecording, or DataFrame
        Recordings; in a DataFrame, each row is one. A function may read any other entries, and
        with an array only the number of entries matters.
    keys : hashable, tuple, callable or array-like of shape (n_recordings,)
        One of the forms listed in the module's docstring.
    role : str
        Name of the caller's parameter, for messages.
    arrays : bool
        Whether an array is accepted. Estimators refuse it, because an array is not split
        along with the recordings.

    Returns
    -------
    list of hashable
        One value for each recording, as Python objects; tuples if `keys` is a tuple.

    Raises
    ------
    TypeError
        If X is not a sequence, an entry has no `meta`, a value cannot be hashed, or `keys` has
        another form.
    ValueError
        If X is empty, a recording lacks a key or its value is missing or not finite (the message
        gives the recording and the key), a function fails, or an array has another length.

    Examples
    --------
    >>> from emacm import Recording
    >>> speed = [1.0, 1.0]
    >>> runs = [
    ...     Recording({"torque": [0, 1]}, 1, velocity=speed, meta={"load": load, "unit": "A"})
    ...     for load in (20, 40)
    ... ]
    >>> read_meta(runs, "load"), read_meta(runs, ("unit", "load"))
    ([20, 40], [('A', 20), ('A', 40)])
    >>> read_meta(runs, [3, 1], arrays=True)
    [3, 1]
    """
    if _is_array(keys):
        return _array_values(keys, X, role, arrays)
    entries = listed_recordings(X)
    if callable(keys):
        what = f"the value of {role}() is"
        return [_checked(called(keys, e, i, role), e, i, what) for i, e in enumerate(entries)]
    columns = [
        [meta_value(entry, index, name, role) for index, entry in enumerate(entries)]
        for name in _named_keys(keys, role)
    ]
    return list(zip(*columns, strict=True)) if isinstance(keys, tuple) else columns[0]


def read_grouping(values: Any, X: Any, role: str, name: str) -> Grouping | None:
    """Return one sortable label for each recording, read from `meta` or from an array.

    Parameters
    ----------
    values : None, hashable, tuple, callable or array-like of shape (n_recordings,)
        As `keys` of `read_meta`.
    X : sequence of Recording, or DataFrame; any sequence if `values` is an array
        The recordings.
    role : str
        Name of the caller's parameter, for messages.
    name : str
        Name of the labels, unless `values` is a key, a tuple of keys or a named Series.

    Returns
    -------
    Grouping or None
        None if `values` is None.

    Raises
    ------
    TypeError, ValueError
        As `read_meta`; or if the labels are of several kinds that have no common order.

    Examples
    --------
    >>> frame = pd.DataFrame({"unit": ["B", "A"], "load": [20, 40]})
    >>> read_grouping(("unit", "load"), frame, "units", "unit")
    Grouping(name='unit, load', labels=array(["'B', 20", "'A', 40"], dtype='<U7'))
    """
    if values is None:
        return None
    found = read_meta(X, values, role=role, arrays=True)
    if isinstance(values, pd.Series):
        name = values.name if isinstance(values.name, str) else name
    elif not (_is_array(values) or callable(values)):
        name = ", ".join(map(str, values if isinstance(values, tuple) else (values,)))
    labels = [", ".join(map(repr, v)) if isinstance(v, tuple) else v for v in found]
    try:
        sorted(set(labels))
    except TypeError as error:
        kinds = sorted({type(label).__name__ for label in labels})
        raise TypeError(f"{role} must hold labels of one kind, got {', '.join(kinds)}.") from error
    return Grouping(name, np.asarray(labels))


def condition_name(condition: Any, value: Any) -> str:
    """Return a condition as text, for messages.

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
    """Return each condition once, sorted if they have an order, else in order of appearance.

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
    """Return some recordings, labels or weights, in the same kind of container.

    Examples
    --------
    >>> chosen_rows(["a", "b", "c"], np.array([2, 0]))
    ['c', 'a']
    """
    if isinstance(values, pd.DataFrame | pd.Series):
        return values.iloc[rows]
    return values[rows] if hasattr(values, "shape") else [values[int(row)] for row in rows]


def plain_label(label: Any) -> Any:
    """Return a label as a Python object (dates as pandas objects), as it was written.

    Examples
    --------
    >>> plain_label(np.int64(3)), plain_label(np.datetime64("2024-05-01"))
    (3, Timestamp('2024-05-01 00:00:00'))
    """
    if isinstance(label, np.datetime64):
        return pd.Timestamp(label)
    if isinstance(label, np.timedelta64):
        return pd.Timedelta(label)
    return label.item() if isinstance(label, np.generic) else label


def listed_recordings(X: Any) -> list[Any]:
    """Return the entries of X, one for each recording.

    Raises
    ------
    TypeError
        If X is not a sequence, an array or a DataFrame.
    ValueError
        If it is empty, or columns of a DataFrame have the same name.

    Examples
    --------
    >>> listed_recordings(pd.DataFrame({"load": [20, 40]}))[1]["load"]
    40
    """
    if not isinstance(X, pd.DataFrame):
        return as_list(X)
    check_unique_columns(X, "X")
    return as_list([row for _, row in X.astype(object).iterrows()])  # integers stay integers


def _is_array(keys: Any) -> bool:
    if isinstance(keys, str | bytes | tuple | np.generic):
        return False
    return isinstance(keys, Sequence) or hasattr(keys, "__array__")


def _array_values(values: Any, X: Any, role: str, accepted: bool) -> list[Any]:
    if not accepted:
        hint = " An array is not split along with the recordings: put its values into their meta."
        raise TypeError(f"{_FORMS.format(role)}; got {reprlib.repr(values)}.{hint}")
    n_recordings = X.shape[0] if hasattr(X, "shape") else len(X)
    shape = np.shape(values) if hasattr(values, "__array__") else (len(values),)
    if shape != (n_recordings,):
        raise ValueError(
            f"{role} must hold one label for each of {n_recordings} recordings, or be a key of "
            f"their meta; got shape {shape}."
        )
    return [_checked(v, None, i, f"the label in {role} is") for i, v in enumerate(values)]


def _named_keys(keys: Any, role: str) -> tuple[Any, ...]:
    """Return the keys as a tuple."""
    names = keys if isinstance(keys, tuple) else (keys,)
    if not names or any(not isinstance(n, Hashable) or isinstance(n, Iterator) for n in names):
        raise TypeError(f"{_FORMS.format(role)}; got {keys!r}.{once_hint(keys)}")
    return names


def meta_value(entry: Any, index: int, key: Any, role: str) -> Any:
    """Return the value of a recording, or of a row of a DataFrame, under a key."""
    facts = entry if isinstance(entry, pd.Series) else getattr(entry, "meta", None)
    kind = "column" if isinstance(entry, pd.Series) else "meta key"
    if not isinstance(facts, Mapping | pd.Series):
        raise TypeError(
            f"{role} names the meta key {key!r}, but recording {index} is a "
            f"{type(entry).__name__} without meta. Pass recordings with meta={{{key!r}: ...}}."
        )
    if key not in facts:
        raise ValueError(
            f"{described(entry, index)} has no {kind} {key!r}; it has "
            f"{', '.join(map(repr, facts.keys())) or 'none'}. Correct {role}, or state it in the "
            f"meta of the recording or of its layout."
        )
    return _checked(facts[key], entry, index, f"its {kind} {key!r} is")


def called(function: Callable[[Any], Any], entry: Any, index: int, role: str) -> Any:
    """Return the value of a user's function, and name the recording if it fails."""
    try:
        return function(entry)
    except Exception as error:
        raise ValueError(
            f"{described(entry, index)}: the function {role} failed with "
            f"{type(error).__name__}: {error}."
        ) from error


def _checked(value: Any, entry: Any, index: int, what: str) -> Hashable:
    """Return a value that can be looked up, as a Python object."""
    value = plain_label(value)
    with located(partial(described, entry, index)):
        if not isinstance(value, Hashable):
            raise TypeError(f"{what} {value!r}, which cannot be hashed. Use a number, or a text.")
        if value in (np.inf, -np.inf) or (pd.api.types.is_scalar(value) and pd.isna(value)):
            raise ValueError(f"{what} {value!r}. Set it, or leave the recording out.")
    return value
