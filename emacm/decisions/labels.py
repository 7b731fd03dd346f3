"""Labels of classes, decisions and families: read, compared and checked."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray


def plain_labels(labels: Iterable[Any]) -> list[Any]:
    """Return labels as Python objects, so that those of numpy compare and hash alike.

    Examples
    --------
    >>> plain_labels(np.array(["worn", "new"]))
    ['worn', 'new']
    """
    return [label.item() if isinstance(label, np.generic) else label for label in labels]


def label_list(labels: ArrayLike, name: str = "y") -> list[Any]:
    """Return a one-dimensional array-like of labels as a list of Python objects.

    A mixed list such as ``[0, "inspect"]`` keeps its numbers; numpy would turn them into text.

    Raises
    ------
    ValueError
        If `labels` is not one-dimensional, or a label is missing (the message gives its position).

    Examples
    --------
    >>> label_list([0, "inspect"])
    [0, 'inspect']
    """
    array = np.asarray(labels, dtype=object if isinstance(labels, list | tuple) else None)
    if array.ndim != 1:
        raise ValueError(f"{name} must be one-dimensional, got shape {array.shape}.")
    missing = pd.isna(array)
    if missing.any():
        position = int(np.argmax(missing))
        raise ValueError(
            f"{name} must contain a label everywhere, but position {position} has "
            f"{array[position]!r}. Leave such entries out."
        )
    return plain_labels(array.tolist())


def label_array(labels: Sequence[Any], classes: ArrayLike = ()) -> NDArray[Any]:
    """Return labels as an array that keeps their types.

    Parameters
    ----------
    labels : sequence
        Python objects.
    classes : array-like of shape (n_classes,), optional
        If all labels are classes, the array has the dtype of `classes`.

    Returns
    -------
    ndarray of shape (n_labels,)
        Of text or integers if all labels are, otherwise of objects.

    Examples
    --------
    >>> label_array([0, "inspect"])
    array([0, 'inspect'], dtype=object)
    """
    known = np.asarray(classes)
    place = {label: number for number, label in enumerate(known.tolist())}
    if all(label in place for label in labels):
        return known[[place[label] for label in labels]]
    for kind in (str, int):
        if all(type(label) is kind for label in labels):
            return np.array(labels)
    array = np.empty(len(labels), dtype=object)
    array[:] = labels
    return array


def label_positions(found: Sequence[Any], known: Sequence[Any], name: str, role: str) -> list[int]:
    """Return the position of each label in `known`.

    Raises
    ------
    ValueError
        If a label is not in `known`; the message gives its position and its `role`.

    Examples
    --------
    >>> label_positions(["worn", "new"], ["new", "worn"], "y_true", "class")
    [1, 0]
    """
    place = {label: position for position, label in enumerate(known)}
    for position, label in enumerate(found):
        if label not in place:
            raise ValueError(
                f"{name} contains {label!r} at position {position}, which is not a known {role}. "
                f"Known: {list(known)}."
            )
    return [place[label] for label in found]


def check_distinct(labels: Sequence[Any], name: str) -> None:
    """Raise a ValueError if a label occurs more than once."""
    doubles = [label for label in dict.fromkeys(labels) if labels.count(label) > 1]
    if doubles:
        raise ValueError(f"{name} must be unique, but these occur more than once: {doubles}.")


def check_classes(y: Any) -> None:
    """Raise if a recording has no class, or a class of another type than the first.

    numpy turns a list that contains text and a missing label or a number into text, and so
    creates a class "nan".

    Raises
    ------
    ValueError
        If a label is None, NaN, pandas.NA or NaT; the message gives the recording.
    TypeError
        If text and other labels are mixed.

    Examples
    --------
    >>> check_classes(["healthy", "worn"])
    """
    entries = y if isinstance(y, list | tuple) else np.asarray(y)
    if isinstance(entries, np.ndarray) and (entries.dtype.kind in "biuUS" or entries.ndim != 1):
        return
    labels = plain_labels(label for label in entries if np.ndim(label) == 0)
    for index, label in enumerate(labels):
        if pd.isna(label):
            raise ValueError(
                f"y must contain the class of every recording, but recording {index} has "
                f"{label!r}. Leave such recordings out."
            )
        if isinstance(label, str) != isinstance(labels[0], str):
            raise TypeError(
                f"y must contain classes of one type, text or numbers, but recording 0 has "
                f"{labels[0]!r} and recording {index} has {label!r}."
            )


def numbered_hint(known: Sequence[Any], named: Sequence[Any]) -> str:
    """Return a hint if classes are numbers where the user gave names; otherwise "".

    Examples
    --------
    >>> numbered_hint([0, 1], ["worn"])[:38]
    ' Some meta-estimators of scikit-learn '
    >>> numbered_hint(["healthy", "worn"], ["wron"])
    ''
    """
    if list(known) != list(range(len(known))) or not any(isinstance(k, str) for k in named):
        return ""
    return (
        " Some meta-estimators of scikit-learn replace the classes by numbers before they fit "
        "(StackingClassifier, VotingClassifier, cross_val_predict of probabilities). They use "
        "posterior probabilities, which do not depend on the cost: omit the cost there, give "
        "priors in the order of the classes, and wrap the result: "
        "LeastRiskClassifier(estimator, cost=...)."
    )
