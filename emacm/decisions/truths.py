"""The true states: the classes, and the unknown state if there is one, with costs and priors.

The unknown state has no recordings: "Unhealthy - Unknown" in Eq. (2.35) of [1]_. Its probability
follows from typicality (`emacm.decisions.unknown`).

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

from emacm._checks import check_number
from emacm.decisions.costs import check_pairs, cost_table
from emacm.decisions.labels import label_array, plain_labels
from emacm.decisions.priors import class_priors

Array = NDArray[np.float64]

UNKNOWN_PRIOR = 0.01  # of the unknown state, if none is given


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


def truth_cost_table(cost: Any, classes: NDArray[Any], unknown: Any) -> tuple[NDArray[Any], Array]:
    """Convert a cost to decisions and a matrix, with a column for the unknown state.

    Parameters
    ----------
    cost : None, array-like, DataFrame or mapping
        As for `cost_table`, with or without the unknown state as a decision and as a true state.
        What it does not state: deciding "unknown" costs 0 if that is true and 1 otherwise; if the
        true state is unknown, deciding a class, or any decision that is the cheapest for
        some class, costs 1, and any other ("inspect") its largest cost for a class.
    classes : ndarray of shape (n_classes,)
        The classes.
    unknown : label or None
        Label of the unknown state; None: there is none, and the result is that of `cost_table`.

    Returns
    -------
    decisions : ndarray of shape (n_decisions,)
        Labels of the rows: those of `cost_table`, with `unknown` after the classes.
    matrix : ndarray of shape (n_decisions, n_classes + 1)
        Cost of each decision under each true state.

    Raises
    ------
    TypeError, ValueError
        As `cost_table`, or if the unknown state has the label of a class.

    Examples
    --------
    >>> inspect = {("inspect", "healthy"): 0.3, ("inspect", "worn"): 0.3}
    >>> decisions, matrix = truth_cost_table(inspect, np.array(["healthy", "worn"]), "new")
    >>> decisions.tolist()
    ['healthy', 'worn', 'new', 'inspect']
    >>> matrix
    array([[0. , 1. , 1. ],
           [1. , 0. , 1. ],
           [1. , 1. , 0. ],
           [0.3, 0.3, 0.3]])
    """
    if unknown is None:
        return cost_table(cost, classes)
    truths = plain_labels(truth_labels(classes, unknown).tolist())
    named = cost is None or isinstance(cost, Mapping | pd.DataFrame)
    if not named and np.shape(cost) == (len(truths),) * 2:
        return cost_table(cost, truth_labels(classes, unknown))
    known, column, row = _split(cost, unknown)
    decisions, matrix = cost_table(known, classes)
    names = plain_labels(decisions.tolist())
    cheapest = (matrix == matrix.min(axis=0)).any(axis=1)
    is_class = np.array([name in truths for name in names])
    last = np.where(cheapest | is_class, 1.0, matrix.max(axis=1))
    for decision, value in column.items():
        if decision not in (*names, unknown):
            raise ValueError(
                f"cost contains the decision {decision!r}, which is none of the classes "
                f"{truths[:-1]}: it then needs a cost for every class, not only for {unknown!r}."
            )
        if decision != unknown:
            last[names.index(decision)] = _number(value, decision, unknown)
    own = [_number(row.get(truth, 1.0), unknown, truth) for truth in truths[:-1]]
    own.append(_number(column.get(unknown, 0.0), unknown, unknown))
    place = sum(is_class) if isinstance(cost, Mapping) or cost is None else len(names)
    names.insert(place, unknown)
    table = np.insert(np.column_stack([matrix, last]), place, own, axis=0)
    return label_array(names, truth_labels(classes, unknown)), table


def truth_priors(
    priors: Any, classes: NDArray[Any], counts: Array, unknown: Any
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

    Returns
    -------
    of_classes : ndarray of shape (n_classes,)
        They add up to 1.
    of_unknown : float
        0 without an unknown state, 0.01 if `priors` do not state it.

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
    named = isinstance(priors, Mapping | pd.Series)
    states_it = (
        unknown in dict(priors.items()) if named else np.shape(priors) == (len(classes) + 1,)
    )
    if not states_it:
        return class_priors(priors, classes, counts), UNKNOWN_PRIOR
    truths = truth_labels(classes, unknown)
    every = class_priors(priors, truths, np.ones(len(truths)))
    if not every[:-1].sum() > 0:
        raise ValueError(f"priors give {unknown!r} the probability 1, and no class any.")
    return every[:-1] / every[:-1].sum(), float(every[-1])


def _split(cost: Any, unknown: Any) -> tuple[Any, dict[Any, Any], dict[Any, Any]]:
    """Divide a cost into the part of the classes, and the column and row of the unknown state."""
    if isinstance(cost, Mapping):
        check_pairs(cost)
        column = {decision: cost[decision, truth] for decision, truth in cost if truth == unknown}
        row = {truth: cost[decision, truth] for decision, truth in cost if decision == unknown}
        known = {key: value for key, value in cost.items() if unknown not in key}
        return known, column, row
    if not isinstance(cost, pd.DataFrame):
        return cost, {}, {}
    column = cost[unknown].to_dict() if unknown in cost.columns else {}
    row = cost.loc[unknown].to_dict() if unknown in cost.index else {}
    known = cost.drop(index=[unknown], columns=[unknown], errors="ignore")
    return known, column, row


def _number(value: Any, decision: Any, truth: Any) -> float:
    return check_number(value, f"the cost of deciding {decision!r} when {truth!r} is true")
