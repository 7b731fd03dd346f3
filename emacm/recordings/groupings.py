"""Labels of recordings, from an array or from their `meta`: run, unit, condition."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray


@dataclass(frozen=True)
class Grouping:
    """A label for each recording, and what such a label is called.

    Attributes
    ----------
    name : str
        Such as "run".
    labels : ndarray of shape (n_recordings,)
        The labels.
    """

    name: str
    labels: NDArray[Any]


def read_grouping(values: Any, X: Any, n_recordings: int, role: str, name: str) -> Grouping | None:
    """Read a label for each recording from an array or from the recordings' `meta`.

    Parameters
    ----------
    values : None, str or array-like of shape (n_recordings,)
        A string is a key of `meta`, or a column if X is a DataFrame.
    X : sequence of Recording, or anything if `values` is an array
        The recordings.
    n_recordings : int
        How many there are.
    role : str
        Name of the parameter, for messages.
    name : str
        What a label is called if neither a key nor the name of a Series says so.

    Returns
    -------
    Grouping or None
        None if `values` is None.

    Raises
    ------
    TypeError
        If a key is given and the recordings have no `meta`.
    ValueError
        If a recording has no label, or the lengths differ.
    """
    if values is None:
        return None
    if isinstance(values, str):
        name, columns = values, getattr(X, "columns", ())
        if values in columns:
            values = X[values]
        else:
            values = [_meta_label(X, i, values, role) for i in range(n_recordings)]
    elif isinstance(values, pd.Series) and isinstance(values.name, str):
        name = values.name
    labels = np.asarray(values)
    if labels.shape != (n_recordings,):
        raise ValueError(
            f"{role} must hold one label for each of {n_recordings} recordings, or be a key of "
            f"their meta; got shape {labels.shape}."
        )
    # Asked of the values as given: numpy makes text of a missing one beside text.
    missing = np.flatnonzero(pd.isna(np.asarray(values, dtype=object)))
    if len(missing):
        raise ValueError(f"{role} must label every recording; recording {missing[0]} has none.")
    try:
        np.unique(labels)
    except TypeError as error:
        kinds = sorted({type(label).__name__ for label in labels})
        raise TypeError(f"{role} must hold labels of one kind, got {', '.join(kinds)}.") from error
    return Grouping(name, labels)


def plain_label(label: Any) -> Any:
    """Return a label as Python's own object, so that messages show it as it was written."""
    return label.item() if isinstance(label, np.generic) else label


def _meta_label(X: Any, index: int, key: str, role: str) -> Any:
    meta = getattr(X[index], "meta", None) if isinstance(X, Sequence) else None
    if meta is None:
        raise TypeError(
            f"{role}={key!r} names a key of the recordings' meta, but X holds no recordings with "
            f"meta ({type(X).__name__}). Give an array, one label for each recording."
        )
    if key not in meta:
        raise ValueError(
            f"{role}={key!r} is no key of meta of recording {index}, whose keys are {list(meta)}."
        )
    return meta[key]
