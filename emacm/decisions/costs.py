"""Costs of decisions: the forms in which they are given, and the table that results.

Orientation, everywhere: rows are decisions, columns are true classes. ``cost[i, k]`` is the cost
of deciding ``i`` when ``k`` is true, C(w_i | w_k) in [1]_, Eqs. (2.39) and (2.48).

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import joblib
import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_number
from emacm.decisions.truths import (
    check_distinct,
    label_array,
    plain_labels,
    truth_labels,
)


def cost_table(
    cost: Any, classes: ArrayLike, unknown: Any = None
) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Convert any form of stating costs to decisions and a matrix.

    Parameters
    ----------
    cost : None, array-like, DataFrame or mapping
        - None: 0 for the correct decision, 1 for any other, Eq. (2.47).
        - Square array: rows are decisions, columns are true classes, both in the order of
          `classes` (followed by the unknown state, or without it).
        - DataFrame: index = decisions, columns = classes, in any order. The index need
          not contain the classes: "fly" and "ground" may be the only decisions.
        - Mapping {(decision, true class): cost}: all other entries are 0 or 1.

        A decision that is not a class ("inspect") needs a cost for every class. Costs may be
        negative (a gain); their unit is arbitrary.
    classes : array-like of shape (n_classes,)
        The possible true classes, each once.
    unknown : label, default=None
        Label of the unknown state, one more decision and true state; None: there is none. What
        `cost` does not state of it: if the true state is unknown, deciding a class, or any decision
        that is the cheapest for some class, costs 1, and any other ("inspect") its largest cost
        for a class. Deciding "unknown" costs under each true state what "inspect" costs there,
        because an unknown state has to be looked at (of several such decisions, the one that costs
        least if the true state is unknown, and less than any class). Without such a decision it
        costs 0 if it is true and 1 otherwise.

    Returns
    -------
    decisions : ndarray of shape (n_decisions,)
        Labels of the rows. Mapping: the classes, `unknown`, then other decisions as they appear;
        DataFrame: its index, then `unknown`. The dtype is that of `classes` if all decisions are
        classes.
    matrix : ndarray of shape (n_decisions, n_truths)
        Cost of each decision under each true state: `classes`, then `unknown`.

    Raises
    ------
    ValueError
        If the shape is wrong, a class is unknown, missing or named twice, a cost is not
        finite, a decision that is not a class lacks the cost of a class, or costs of the unknown
        state are not stated although all others are above 1.
    TypeError
        If a cost is text, complex or a bool, or a key of a mapping is not a pair.

    Examples
    --------
    >>> decisions, matrix = cost_table(
    ...     {("healthy", "worn"): 10, ("inspect", "healthy"): 0.5, ("inspect", "worn"): 0.4},
    ...     ["healthy", "worn"],
    ...     unknown="new",
    ... )
    >>> decisions.tolist()
    ['healthy', 'worn', 'new', 'inspect']
    >>> matrix
    array([[ 0. , 10. ,  1. ],
           [ 1. ,  0. ,  1. ],
           [ 0.5,  0.4,  0.5],
           [ 0.5,  0.4,  0.5]])
    """
    labels = np.asarray(classes)
    known = plain_labels(labels.tolist())
    check_distinct(known, "classes")
    every = truth_labels(labels, unknown)
    truths = plain_labels(every.tolist())
    rows, stated = _stated_pairs(cost, known, truths)
    _check_labels(rows, stated, known, truths)
    matrix = np.empty((len(rows), len(truths)))
    for (i, decision), (k, truth) in itertools.product(enumerate(rows), enumerate(truths)):
        name = f"the cost of deciding {decision!r} when {truth!r} is true"
        matrix[i, k] = check_number(stated.get((decision, truth), float(decision != truth)), name)
    if unknown is not None:
        others = np.array([row != unknown for row in rows])
        of_classes = matrix[others, :-1]
        least = of_classes[of_classes > 0].min(initial=np.inf)
        if 1 < least < np.inf and not any(unknown in pair for pair in stated):
            raise ValueError(
                f"cost must state a row and a column of the unknown state {unknown!r}: their "
                f"default 1 is below all other costs, of which the smallest is {least:g}."
            )
        names_states = (matrix[:, :-1] == of_classes.min(axis=0)).any(axis=1)
        names_states |= [decision in truths for decision in rows]
        for row, decision in enumerate(rows):
            if decision not in truths and (decision, unknown) not in stated:
                matrix[row, -1] = 1.0 if names_states[row] else matrix[row, :-1].max()
        cheapest = np.lexsort((~names_states, matrix[:, -1], ~others))[0]  # a class, if as cheap
        if not names_states[cheapest]:  # an inspection
            is_default = [(unknown, truth) not in stated for truth in truths]
            matrix[rows.index(unknown), is_default] = matrix[cheapest, is_default]
    return label_array(rows, every), matrix


def stated_costs(estimator: Any) -> dict[str, Any]:
    """Return the cost by which an estimator decides, its unknown state and its priors.

    They are found among its parameters. Costs and priors of an estimator inside another one that
    has a cost (a member of a `PosteriorProduct`, for example) do not count: the outer one decides,
    on the unknown state of those inside.

    Returns
    -------
    dict
        "cost", "unknown" and "priors"; None if they are not stated, or differ.

    Raises
    ------
    ValueError
        If there are several costs that differ.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from emacm import CostSensitiveGaussianBayes
    >>> model = CostSensitiveGaussianBayes(unknown="unknown", priors="uniform")
    >>> stated_costs(make_pipeline(model))
    {'cost': None, 'unknown': 'unknown', 'priors': 'uniform'}
    """
    given = estimator.get_params() if hasattr(estimator, "get_params") else {}
    owners = [name.removesuffix("cost") for name in given if name.rpartition("__")[2] == "cost"]
    outer = [o for o in owners if not any(o != other and o.startswith(other) for other in owners)]
    stated = {}
    for name in ("cost", "unknown", "priors"):
        asked = owners if name == "unknown" else outer
        values = [given[owner + name] for owner in asked if given.get(owner + name) is not None]
        distinct = {joblib.hash(value): value for value in values}
        if name == "cost" and len(distinct) > 1:
            raise ValueError(
                "the estimator has several costs that differ. Put it into a LeastRiskClassifier "
                "with the cost of its decisions."
            )
        stated[name] = values[0] if len(distinct) == 1 else None
    return stated


def cost_of_some(cost: Any, known: Sequence[Any], all_classes: Sequence[Any]) -> Any:
    """Remove classes that do not occur from a cost.

    The posterior probability of a class that is absent from training is 0, and so is its
    contribution to every expected cost, Eq. (2.39) of [1]_: removing its column changes no
    decision among those that remain.

    Parameters
    ----------
    cost : None, array-like, DataFrame or mapping
        As for `cost_table`.
    known : sequence
        Classes that occur.
    all_classes : sequence
        All classes, sorted.

    Returns
    -------
    None, array-like, DataFrame or mapping
        A DataFrame without the columns of absent classes, and with every decision; a mapping
        without pairs that name an absent class; an array without their rows and columns. A cost
        that does not fit `all_classes` is returned unchanged.

    Examples
    --------
    >>> cost_of_some({("ok", "worn"): 10, ("ok", "dry"): 5}, ["dry", "ok"], ["dry", "ok", "worn"])
    {('ok', 'dry'): 5}
    """
    absent = [label for label in all_classes if label not in known]
    if cost is None or not absent:
        return cost
    if isinstance(cost, pd.DataFrame):
        return cost.drop(columns=absent, errors="ignore")
    if isinstance(cost, Mapping):
        check_pairs(cost)
        return {pair: value for pair, value in cost.items() if not set(pair) & set(absent)}
    n_classes = len(all_classes)
    if np.shape(cost) not in {(n_classes,) * 2, (n_classes + 1,) * 2}:
        return cost
    kept = [place for place, label in enumerate(all_classes) if label in known]
    kept += range(n_classes, len(cost))  # the last may be the unknown state
    return np.asarray(cost)[np.ix_(kept, kept)]


def check_pairs(cost: Mapping[Any, Any]) -> None:
    """Raise a TypeError if a key of a cost is not a tuple (decision, true class)."""
    for key in cost:
        if not (isinstance(key, tuple) and len(key) == 2):
            raise TypeError(
                f"the keys of a cost mapping must be tuples (decision, true class), got {key!r}."
            )


def _stated_pairs(
    cost: Any, known: list[Any], truths: list[Any]
) -> tuple[list[Any], dict[tuple[Any, Any], Any]]:
    """Return the decisions, and the costs that are stated, {(decision, true state): cost}."""
    if cost is None:
        return truths, {}
    if isinstance(cost, Mapping):
        check_pairs(cost)
        pairs = {tuple(plain_labels(pair)): value for pair, value in cost.items()}
        return list(dict.fromkeys([*truths, *(decision for decision, _ in pairs)])), pairs
    if isinstance(cost, pd.DataFrame):
        rows, columns = plain_labels(cost.index), plain_labels(cost.columns)
        check_distinct(rows, "decisions in the index of cost")
        check_distinct(columns, "classes in the columns of cost")
        missing = [label for label in known if label not in columns]
        if (missing and set(columns) <= set(truths)) or not rows:
            raise ValueError(
                f"cost must have at least one decision (row), and one column for every class "
                f"(columns are the truth); missing: {missing}. Its columns are {columns}."
            )
        values = cost.to_numpy()
    else:
        values = _square(cost, known, truths)
        rows = columns = truths[: len(values)]
    own = truths[len(known) :]  # the unknown state comes last
    pairs = dict(zip(itertools.product(rows, columns), values.ravel().tolist(), strict=True))
    return [*(row for row in rows if row not in own), *own], pairs


def _square(cost: Any, known: list[Any], truths: list[Any]) -> NDArray[Any]:
    """Return costs that are given as an array, in the order of the classes."""
    try:
        array = np.asarray(cost)
    except ValueError as error:
        raise ValueError(f"cost must be a rectangular array of numbers: {error}.") from error
    if array.shape not in {(len(known),) * 2, (len(truths),) * 2}:
        raise ValueError(
            f"cost must be a square array of shape {(len(known),) * 2}, rows = decisions and "
            f"columns = true classes in the order of the classes {known}; got shape {array.shape}. "
            f"Decisions that are not classes need names: pass a DataFrame."
        )
    return array


def _check_labels(
    rows: list[Any], stated: dict[tuple[Any, Any], Any], known: list[Any], truths: list[Any]
) -> None:
    """Raise a ValueError if a label of a cost is missing or unknown, or a cost is not stated."""
    for _, truth in stated:
        if truth not in truths:
            raise ValueError(
                f"cost names the class {truth!r} as a truth, which is unknown. Known: {truths}."
            )
    for decision in rows:
        missing = [truth for truth in known if (decision, truth) not in stated]
        if decision not in truths and missing:
            raise ValueError(
                f"cost contains the decision {decision!r}, which is none of the classes {known}: "
                f"it then needs a cost for every class; missing: {missing}."
            )
