"""Selection of the recordings of a healthy machine."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm.recordings.inputs import described, kind_of
from emacm.recordings.meta import called, listed_recordings, meta_value, plain_label

_COLLECTIONS = (list, tuple, set, frozenset, np.ndarray, pd.Series, pd.Index)


def healthy_recordings(X: Any, y: ArrayLike | None, healthy: Any) -> NDArray[np.bool_]:
    """Return which recordings were made of a healthy machine.

    Parameters
    ----------
    X : sequence of Recording or AngleRecording, or DataFrame
        Recordings.
    y : array-like of shape (n_recordings,) or None
        Their labels; needed if `healthy` is a label.
    healthy : label, collection of labels, mapping or callable
        Labels of `y`; or {key of `meta`: value, or a list of values}, all of
        which must hold; or a function of the recording that returns a bool.

    Returns
    -------
    ndarray of bool, shape (n_recordings,)

    Raises
    ------
    TypeError
        If a function does not return a bool.
    ValueError
        If `y` is needed and missing, has another length than X, or does not contain the label;
        or a recording lacks a key.

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
        answers = [called(healthy, entry, i, "healthy") for i, entry in enumerate(entries)]
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
                all(meta_value(entry, index, key, "healthy") in own for key, own in wanted.items())
                for index, entry in enumerate(entries)
            ]
        )
    return _labelled(y, len(entries), _listed(healthy))


def _listed(values: Any) -> list[Any]:
    listed = list(values) if isinstance(values, _COLLECTIONS) else [values]
    return [plain_label(value) for value in listed]


def _labelled(y: Any, n_recordings: int, healthy: list[Any]) -> NDArray[np.bool_]:
    if y is None:
        raise ValueError(
            f"healthy = {healthy} names labels of y, but no y was given. Call fit(X, y), or let "
            f"healthy read the recordings: a mapping of meta keys to values, or a function."
        )
    if isinstance(y, str | Mapping) or not isinstance(y, Iterable) or getattr(y, "ndim", 1) > 1:
        came = f"an array of shape {np.shape(y)}" if hasattr(y, "shape") else kind_of(y)
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
