"""The true states: the classes, and the unknown state if there is one, with its priors.

The unknown state has no recordings: "Unhealthy - Unknown" in Eq. (2.35) of [1]_. Its probability
follows from typicality (`emacm.decisions.typicality`).

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm._checks import check_choice, check_number, check_real_array
from emacm.decisions.labels import label_array, numbered_hint, plain_labels


def class_priors(
    priors: Any, classes: NDArray[Any], counts: NDArray[np.float64]
) -> NDArray[np.float64]:
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
                f"{numbered_hint(known, unknown)}"
            )
        priors = [named[label] for label in known]
    values = check_real_array(priors, "priors").astype(np.float64)
    if values.shape != (len(known),):
        raise ValueError(
            f"priors must contain one probability for each of the {len(known)} classes {known}, "
            f"got shape {values.shape}."
        )
    for label, value in zip(known, values, strict=True):
        check_number(float(value), f"the prior of class {label!r}", at_least=0)
    if abs(values.sum() - 1) > 1e-6:
        raise ValueError(f"priors must add up to 1, got {values.tolist()}, sum {values.sum():.8g}.")
    return values / values.sum()


def check_possible(
    priors: NDArray[np.float64],
    own: NDArray[np.float64],
    classes: NDArray[Any],
    name: str = "estimator",
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
            f"{name} has the prior 0 of class {classes.tolist()[code]!r}, so that its posterior "
            f"carries no information about it, but priors give it {priors[code]:g}. Give {name} "
            f"another prior."
        )


Array = NDArray[np.float64]


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
            f"unknown = {unknown!r} is a class with recordings. Choose a label that is none of "
            f"{known}."
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
    if unknown is None:
        return class_priors(priors, classes, counts), 0.0
    if not states_unknown(priors, classes, unknown):
        return class_priors(priors, classes, counts), default
    truths = truth_labels(classes, unknown)
    every = class_priors(priors, truths, np.ones(len(truths)))
    if not every[:-1].sum() > 0:
        raise ValueError(f"priors give {unknown!r} the probability 1, and no class any.")
    return every[:-1] / every[:-1].sum(), float(every[-1])


def states_unknown(priors: Any, classes: NDArray[Any], unknown: Any) -> bool:
    """Return whether priors state that of the unknown state."""
    if isinstance(priors, Mapping | pd.Series):
        return unknown in dict(priors.items())
    return np.shape(priors) == (len(classes) + 1,)
