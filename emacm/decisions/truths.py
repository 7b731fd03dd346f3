"""Labels of classes and decisions, and the true states: the classes and the unknown state.

The unknown state has no recordings: "Unhealthy - Unknown" in Eq. (2.35) of [1]_. Its probability
follows from typicality (`emacm.decisions.typicality`).

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_choice, check_real_array, check_unmasked

Array = NDArray[np.float64]


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
        If a label is None, NaN, pandas.NA or NaT; the message gives its position.
    TypeError
        If text and other labels are mixed.

    Examples
    --------
    >>> check_classes(["healthy", "worn"])
    """
    check_unmasked(y, "y")
    entries = y if isinstance(y, list | tuple) else np.asarray(y)
    if np.ndim(entries) != 1:
        return  # scikit-learn accepts columns, and refuses tables
    labels = label_list(entries)
    for position, label in enumerate(labels):
        if isinstance(label, str) != isinstance(labels[0], str):
            raise TypeError(
                f"y must contain classes of one type, text or numbers, but position 0 has "
                f"{labels[0]!r} and position {position} has {label!r}."
            )


def class_priors(priors: Any, classes: NDArray[Any], counts: Array) -> Array:
    """Convert any form of stating priors to one probability per class, Eq. (2.37) of [1]_.

    Parameters
    ----------
    priors : None, "uniform", array-like or mapping
        None: relative frequencies of the counts. An array is in the order of `classes`; a
        mapping or Series {class: probability} names every class.
    classes : ndarray of shape (n_classes,)
        The classes.
    counts : ndarray of shape (n_classes,)
        Recordings of each class.

    Returns
    -------
    probabilities : ndarray of shape (n_classes,)
        Their sum is 1.

    Raises
    ------
    ValueError
        If they are negative, their sum is not 1 (to 1e-6), or they do not fit the classes.
    TypeError
        If they are not numbers.

    References
    ----------
    .. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
       Condition Monitoring, section 2.2.1.

    Examples
    --------
    >>> class_priors({"worn": 0.01, "healthy": 0.99}, np.array(["healthy", "worn"]), np.ones(2))
    array([0.99, 0.01])
    """
    known = classes.tolist()
    if priors is None:
        return counts / counts.sum()
    if isinstance(priors, str):
        check_choice(priors, "priors as a word", ("uniform",))
        return np.full(len(known), 1 / len(known))
    if isinstance(priors, Mapping | pd.Series):
        named = dict(priors.items())
        unknown = [label for label in named if label not in known]
        if unknown or len(named) < len(known):
            raise ValueError(
                f"priors must name every class of {known} and no other; unknown: {unknown}, "
                f"missing: {[label for label in known if label not in named]}."
            )
        priors = [named[label] for label in known]
    values = check_real_array(priors, "priors").astype(np.float64)
    if values.shape != (len(known),) or not (values >= 0).all() or abs(values.sum() - 1) > 1e-6:
        raise ValueError(
            f"priors must contain one probability, at least 0, for each of the {len(known)} "
            f"classes {known}, and add up to 1; got {values.tolist()}."
        )
    return values / values.sum()


def check_possible(
    priors: Array, own: Array, classes: NDArray[Any], name: str = "estimator"
) -> None:
    """Raise a ValueError if a class has a prior, but none within the posterior of an estimator.

    Parameters
    ----------
    priors, own : ndarray of shape (n_classes,)
        Priors in effect, and those within the posterior of the estimator.
    classes : ndarray of shape (n_classes,)
        The classes.
    name : str
        Name of the estimator, for the message.
    """
    impossible = (priors > 0) & ~(own > 0)
    if impossible.any():
        code = int(np.argmax(impossible))
        raise ValueError(
            f"{name} has the prior 0 of class {classes.tolist()[code]!r}, but priors give it "
            f"{priors[code]:g}. Give {name} another prior."
        )


def truth_labels(classes: NDArray[Any], unknown: Any) -> NDArray[Any]:
    """Return the classes, followed by the unknown state unless it is None.

    Raises
    ------
    TypeError, ValueError
        If the unknown state has no label (a list, NaN), or the label of a class.

    Examples
    --------
    >>> truth_labels(np.array(["healthy", "worn"]), "unknown")
    array(['healthy', 'worn', 'unknown'], dtype='<U7')
    """
    if unknown is None:
        return classes
    if not isinstance(unknown, Hashable) or unknown != unknown:
        raise TypeError(f"unknown must be a label such as 'unknown', or None; got {unknown!r}.")
    known = plain_labels(classes.tolist())
    if unknown in known:
        raise ValueError(
            f"unknown = {unknown!r} is a class with recordings. Choose none of {known}."
        )
    return label_array([*known, unknown], classes)


def truth_priors(
    priors: Any, classes: NDArray[Any], counts: Array, unknown: Any, default: float = 0.01
) -> tuple[Array, float]:
    """Convert priors to those of the classes, given a known state, and that of the unknown state.

    Parameters
    ----------
    priors : None, "uniform", array-like or mapping
        As for `class_priors`. A mapping may name the unknown state, and an array may have one
        more element for it; all then add up to 1.
    classes, counts : ndarray of shape (n_classes,)
        As for `class_priors`.
    unknown : label or None
        Label of the unknown state.
    default : float, default=0.01
        Prior of the unknown state if `priors` do not state it.

    Returns
    -------
    of_classes : ndarray of shape (n_classes,)
        They add up to 1.
    of_unknown : float
        0 without an unknown state.

    Examples
    --------
    >>> stated = {"healthy": 0.9, "worn": 0.05, "unknown": 0.05}
    >>> of_classes, of_unknown = truth_priors(
    ...     stated, np.array(["healthy", "worn"]), np.ones(2), "unknown"
    ... )
    >>> of_classes.round(3), of_unknown
    (array([0.947, 0.053]), 0.05)
    """
    is_named = isinstance(priors, Mapping | pd.Series) and unknown in dict(priors.items())
    if unknown is None or not (is_named or np.shape(priors) == (len(classes) + 1,)):
        return class_priors(priors, classes, counts), 0.0 if unknown is None else default
    truths = truth_labels(classes, unknown)
    every = class_priors(priors, truths, np.ones(len(truths)))
    if not every[:-1].sum() > 0:
        raise ValueError(f"priors give {unknown!r} the probability 1, and no class any.")
    return every[:-1] / every[:-1].sum(), float(every[-1])
