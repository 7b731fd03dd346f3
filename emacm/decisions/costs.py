"""What each decision costs under each truth, and what decisions have cost.

Orientation, everywhere: rows are the decision, columns are the truth. `cost[i, k]` is
the cost of deciding `i` when `k` is true, as C(w_i | w_k) in [1]_, Eqs. (2.39), (2.48).

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NoReturn

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_number, check_real_array, located, numbered_hint
from emacm.decisions.risks import canonical_cost, conditional_risk, least_risk

__all__ = [
    "canonical_cost",
    "check_weights",
    "conditional_risk",
    "cost_table",
    "expected_cost",
    "group_costs",
    "group_labels",
    "least_risk",
]


def cost_table(cost: Any, classes: ArrayLike) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Bring any form of stating costs to decisions and a matrix.

    Parameters
    ----------
    cost : None, array-like, DataFrame or mapping
        - None: 0 for the right decision, 1 for any other, Eq. (2.47).
        - Square array: rows are the decision, columns the truth, in the order of `classes`.
        - DataFrame: index = decisions, columns = classes, in any order. The index need
          not hold the classes: "fly" and "ground" may be the only decisions.
        - Mapping {(decision, truth): cost}: what it leaves out costs 0 or 1.

        A decision that is no class ("inspect") must price every class. Costs may be
        negative (a gain); their unit is free.
    classes : array-like of shape (n_classes,)
        The possible truths, each once.

    Returns
    -------
    decisions : ndarray of shape (n_decisions,)
        Labels of the rows. Mapping: the classes, then other decisions as they appear;
        DataFrame: its index. Their dtype is that of `classes` if all are classes.
    matrix : ndarray of shape (n_decisions, n_classes)
        Cost of each decision under each truth, columns in the order of `classes`.

    Raises
    ------
    ValueError
        If the shape is wrong, a class is unknown, missing or named twice, a cost is not
        finite, or a decision that is no class leaves a class without a price.
    TypeError
        If a cost is text, complex or a bool, or a key of a mapping is no pair.

    Examples
    --------
    >>> decisions, matrix = cost_table(
    ...     {("healthy", "worn"): 10, ("inspect", "healthy"): 0.5, ("inspect", "worn"): 0.5},
    ...     ["healthy", "worn"],
    ... )
    >>> decisions.tolist()
    ['healthy', 'worn', 'inspect']
    >>> matrix
    array([[ 0. , 10. ],
           [ 1. ,  0. ],
           [ 0.5,  0.5]])
    """
    labels = np.asarray(classes)
    known = _plain(labels.tolist())
    _check_distinct(known, "classes")
    if cost is None:
        return labels, 1.0 - np.eye(len(known))
    if isinstance(cost, pd.DataFrame):
        rows, matrix = _from_frame(cost, known)
    elif isinstance(cost, Mapping):
        rows, matrix = _from_mapping(cost, known)
    else:
        rows, matrix = known, _from_array(cost, known)
    return _decision_labels(rows, labels), matrix


def expected_cost(
    y_true: ArrayLike,
    y_pred: ArrayLike,
    *,
    cost: Any = None,
    labels: ArrayLike | None = None,
    sample_weight: ArrayLike | None = None,
) -> float:
    """Mean cost per recording of the decisions that were taken.

    Rows of `cost` are the decision, columns are the truth. The confusion matrix of
    scikit-learn and the cost of MATLAB put the truth in rows; hence
    `(cost.T * confusion_matrix(y_true, y_pred)).sum() / n_recordings` is the same number.

    Parameters
    ----------
    y_true : array-like of shape (n_recordings,)
        The true classes.
    y_pred : array-like of shape (n_recordings,)
        The decisions: classes, or other decisions that `cost` prices.
    cost : None, array-like, DataFrame or mapping, default=None
        As for `cost_table`; None counts errors (0-1).
    labels : array-like of shape (n_classes,), default=None
        The classes, in the order of an array `cost`. Default: the columns of a
        DataFrame; for a mapping, the truths it names and what occurs in `y_true`; else
        the sorted union of `y_true` and `y_pred`.
    sample_weight : array-like of shape (n_recordings,), default=None
        How often each recording counts.

    Returns
    -------
    cost : float
        Mean cost per recording, in the unit of `cost`.

    Raises
    ------
    ValueError
        If lengths differ, a label has no row or column (with its position), the array
        does not fit the labels that occur, or `cost_table` or the weights complain.

    Examples
    --------
    >>> expected_cost([0, 0, 1, 1], [0, 1, 1, 0], cost=[[0, 10], [1, 0]])
    2.75
    >>> expected_cost([0, 1], [0, "inspect"], cost={("inspect", 0): 0.2, ("inspect", 1): 0.2})
    0.1
    """
    truths, chosen = _label_list(y_true, "y_true"), _label_list(y_pred, "y_pred")
    if len(truths) != len(chosen):
        raise ValueError(
            f"y_true and y_pred must be equally long, got {len(truths)} and {len(chosen)} labels."
        )
    if not truths:
        raise ValueError("y_true must hold at least one label, got none.")
    classes = _metric_classes(cost, truths, chosen) if labels is None else np.asarray(labels)
    decisions, matrix = cost_table(cost, classes)
    rows = _positions(chosen, decisions.tolist(), "y_pred", "decision")
    columns = _positions(truths, classes.tolist(), "y_true", "class")
    weight = check_weights(sample_weight, len(truths))
    if not weight.sum() > 0:
        raise ValueError("sample_weight must not be zero for every recording.")
    return float(np.average(matrix[rows, columns], weights=weight))


def group_costs(
    groups: Mapping[Any, Any],
    costs: Any = None,
    *,
    extra: Mapping[Any, float] | None = None,
    healthy: Any = None,
    missed: float = 1.0,
    false_alarm: float = 1.0,
) -> pd.DataFrame:
    """Price decisions on families of classes, for a classifier that is trained on the classes.

    A family of faults is seldom one Gaussian: eight severities of spalling are eight. Trained
    on the states and priced by families, the classifier sums the posteriors of a family's states.

    Parameters
    ----------
    groups : mapping of family to a state or a collection of states
        Families, or the maintenance action that each calls for; each state in one of them.
    costs : None, array-like, DataFrame or mapping, default=None
        Costs between families, as `cost_table` takes them between classes: None is 0-1, a
        mapping is {(decision, true family): cost} with the rest 0-1 (or as below).
    extra : mapping of decision to cost, optional
        Further decisions that cost the same whatever is true, such as {"inspect": 0.3}.
    healthy : family, optional
        The family to which `missed` and `false_alarm` refer.
    missed, false_alarm : float, default=1
        Cost of deciding `healthy` when another family is true, and of the reverse.
        Prices in a mapping `costs` go before them.

    Returns
    -------
    DataFrame
        Index = decisions, columns = states; what `CostSensitiveGaussianBayes`, `expected_cost`
        and `least_risk` take as `cost`.

    Raises
    ------
    TypeError
        If `groups` or `extra` is no mapping, or a cost is no number.
    ValueError
        If there is no family, a family is empty, a state is in two families or twice in one, a
        family is unknown, a further decision is a family, or `missed` or `false_alarm` is given
        without `healthy` or beside a whole table of costs.

    Notes
    -----
    Metrics that compare labels, as scikit-learn's accuracy, find no family among the states, and
    call every decision wrong. Compare families with families,
    ``balanced_accuracy_score(group_labels(y, groups), model.predict(X))``, or use `score` of the
    classifier, `expected_cost`, `neg_expected_cost`.

    Examples
    --------
    >>> groups = {"normal": ["normal"], "spalling": ["spalling1", "spalling2"]}
    >>> group_costs(groups, extra={"inspect": 0.3}, healthy="normal", missed=10)
              normal  spalling1  spalling2
    normal       0.0       10.0       10.0
    spalling     1.0        0.0        0.0
    inspect      0.3        0.3        0.3
    """
    families = _checked_groups(groups)
    if missed != 1 or false_alarm != 1 or healthy is not None:
        costs = _alarm_costs(costs, list(families), healthy, missed, false_alarm)
    with located("costs between families, which stand for classes here"):
        decisions, matrix = cost_table(costs, _as_labels(list(families)))
    rows = _plain(decisions)
    place = [k for k, states in enumerate(families.values()) for _ in states]
    states = [state for states in families.values() for state in states]
    if extra is not None and not isinstance(extra, Mapping):
        raise TypeError(f"extra must be a mapping such as {{'inspect': 0.3}}, got {extra!r}.")
    matrix = matrix[:, place]
    for decision, cost in (extra or {}).items():
        if decision in rows:
            raise ValueError(f"extra names the decision {decision!r}, which costs price already.")
        price = check_number(cost, f"the cost of {decision!r} in extra")
        rows, matrix = [*rows, decision], np.vstack([matrix, np.full(len(states), price)])
    index, columns = (pd.Index(labels, tupleize_cols=False) for labels in (rows, states))
    return pd.DataFrame(matrix, index=index, columns=columns)


def group_labels(y: ArrayLike, groups: Mapping[Any, Any]) -> NDArray[Any]:
    """Return the family of each label, to be compared with decisions on families.

    Parameters
    ----------
    y : array-like of shape (n_recordings,)
        States.
    groups : mapping of family to a state or a collection of states
        As for `group_costs`.

    Returns
    -------
    ndarray of shape (n_recordings,)

    Raises
    ------
    ValueError
        If a label is in no family (with its position), or as `group_costs` has it.

    Examples
    --------
    >>> groups = {"normal": "normal", "spalling": ["spalling1", "spalling2"]}
    >>> group_labels(["spalling2", "normal"], groups).tolist()
    ['spalling', 'normal']
    """
    family_of = {s: family for family, states in _checked_groups(groups).items() for s in states}
    labels = _label_list(y, "y")
    for position, label in enumerate(labels):
        if label not in family_of:
            raise ValueError(
                f"y holds {label!r} at position {position}, which is in no family. "
                f"Known: {list(family_of)}."
            )
    return _as_labels([family_of[label] for label in labels])


def check_weights(sample_weight: ArrayLike | None, n_recordings: int) -> NDArray[np.float64]:
    """Return one finite weight of at least 0 per recording; None is a weight of 1.

    Raises
    ------
    ValueError
        If the shape differs, or a weight is negative or not finite, with its position.
    TypeError
        If the weights are not numeric.

    Examples
    --------
    >>> check_weights(None, 3)
    array([1., 1., 1.])
    """
    if sample_weight is None:
        return np.ones(n_recordings)
    weight = check_real_array(sample_weight, "sample_weight").astype(np.float64)
    if weight.shape != (n_recordings,):
        raise ValueError(
            f"sample_weight must hold one weight per recording, shape ({n_recordings},), "
            f"got shape {weight.shape}."
        )
    bad = ~(np.isfinite(weight) & (weight >= 0))
    if bad.any():
        first = int(np.argmax(bad))
        raise ValueError(
            f"sample_weight must be finite and at least 0, got {weight[first]} at "
            f"recording {first}."
        )
    return weight


def _checked_groups(groups: Any) -> dict[Any, list[Any]]:
    """Return the states of each family, each in one."""
    if not isinstance(groups, Mapping):
        raise TypeError(
            f"groups must be a mapping of family to states, such as "
            f"{{'spalling': ['spalling1', 'spalling2']}}, got {groups!r}."
        )
    if not groups:
        raise ValueError("groups must hold at least one family, got none.")
    families: dict[Any, list[Any]] = {}
    family_of: dict[Any, Any] = {}
    for family, states in groups.items():
        listed = isinstance(states, list | tuple | set | frozenset | np.ndarray | pd.Series)
        families[family] = _plain(states if listed else [states])
        if not families[family]:
            raise ValueError(f"family {family!r} has no states. Name some, or leave it out.")
        for state in families[family]:
            if state in family_of:
                raise ValueError(
                    f"state {state!r} is in family {family_of[state]!r} and in {family!r}; each "
                    f"state belongs to one family, once."
                )
            family_of[state] = family
    return families


def _alarm_costs(
    costs: Any, families: list[Any], healthy: Any, missed: Any, false_alarm: Any
) -> dict[Any, Any]:
    """Return costs between families with the price of missing a fault and of a false alarm."""
    if healthy not in families:
        raise ValueError(
            f"missed and false_alarm need healthy, one of the families {families}; "
            f"got healthy={healthy!r}."
        )
    if not isinstance(costs, Mapping | None):
        raise ValueError(
            "costs is a whole table and prices missed faults and false alarms itself. Leave out "
            "healthy, missed and false_alarm, or state costs as a mapping."
        )
    prices = {"missed": missed, "false_alarm": false_alarm}
    missed, false_alarm = (check_number(price, name) for name, price in prices.items())
    others = [family for family in families if family != healthy]
    alarms = {(healthy, family): missed for family in others}
    alarms |= {(family, healthy): false_alarm for family in others}
    return alarms | dict(costs or {})


def _as_labels(labels: list[Any]) -> NDArray[Any]:
    """Return labels as an array that holds them as they are."""
    return _decision_labels(labels, np.empty(0, dtype=object))


def _from_array(cost: Any, known: list[Any]) -> NDArray[np.float64]:
    if hasattr(cost, "columns"):
        raise TypeError(
            f"cost is a {type(cost).__module__.split('.')[0]} {type(cost).__name__}, which has no "
            f"index to name its decisions. Pass a pandas DataFrame or a mapping."
        )
    try:
        array = np.asarray(cost)
    except ValueError as error:
        raise ValueError(f"cost must be a rectangular array of numbers: {error}.") from error
    expected = (len(known), len(known))
    if array.shape != expected:
        raise ValueError(
            f"cost must be a square array of shape {expected}, rows = decision and columns = "
            f"truth in the order of the classes {known}; got shape {array.shape}. Decisions "
            f"that are no class need names: pass a pandas DataFrame with "
            f"index = decisions and columns = classes."
        )
    return _priced(array, known, known)


def _from_frame(cost: pd.DataFrame, known: list[Any]) -> tuple[list[Any], NDArray[np.float64]]:
    rows, columns = _plain(cost.index), _plain(cost.columns)
    _check_distinct(rows, "decisions in the index of cost")
    _check_distinct(columns, "classes in the columns of cost")
    if not rows:
        raise ValueError("cost must hold at least one decision (row), got none.")
    for column in columns:
        if column not in known:
            _refuse_class(column, known)
    missing = [label for label in known if label not in columns]
    if missing:
        raise ValueError(
            f"cost must have one column for every class (columns are the truth); missing: "
            f"{missing}. Its columns are {columns}."
        )
    order = [columns.index(label) for label in known]
    return rows, _priced(cost.to_numpy()[:, order], rows, known)


def _from_mapping(
    cost: Mapping[Any, Any], known: list[Any]
) -> tuple[list[Any], NDArray[np.float64]]:
    _check_pairs(cost)
    named = dict.fromkeys(_plain(decision for decision, _ in cost))
    rows = known + [decision for decision in named if decision not in known]
    table = np.full((len(rows), len(known)), None, dtype=object)
    table[: len(known)] = 1.0 - np.eye(len(known))
    for (decision, truth), value in cost.items():
        if truth not in known:
            _refuse_class(truth, known)
        table[rows.index(decision), known.index(truth)] = value
    for decision, prices in zip(rows[len(known) :], table[len(known) :], strict=True):
        missing = [k for k, price in zip(known, prices, strict=True) if price is None]
        if missing:
            raise ValueError(
                f"cost prices the decision {decision!r}, which is none of the classes {known}: "
                f"it must then price every class; missing: {missing}."
            )
    return rows, _priced(table, rows, known)


def _priced(table: NDArray[Any], rows: list[Any], columns: list[Any]) -> NDArray[np.float64]:
    """Return the table as floats, or say which cost is no finite number."""
    matrix = np.empty(table.shape)
    for i, k in np.ndindex(table.shape):
        name = f"cost[{i}, {k}] (deciding {rows[i]!r} when {columns[k]!r} is true)"
        matrix[i, k] = check_number(table[i, k], name)
    return matrix


def _decision_labels(rows: list[Any], classes: NDArray[Any]) -> NDArray[Any]:
    known = classes.tolist()
    if all(row in known for row in rows):
        return classes[[known.index(row) for row in rows]]
    for kind in (str, int):
        if all(type(row) is kind for row in rows):
            return np.array(rows, dtype=kind)
    decisions = np.empty(len(rows), dtype=object)
    decisions[:] = rows
    return decisions


def _metric_classes(cost: Any, truths: list[Any], chosen: list[Any]) -> NDArray[Any]:
    """Choose the classes where the caller of the metric did not."""
    if isinstance(cost, pd.DataFrame):
        return cost.columns.to_numpy()
    if isinstance(cost, Mapping):
        _check_pairs(cost)
        priced = {decision for decision, _ in cost}
        found = {*truths, *(truth for _, truth in cost), *(d for d in chosen if d not in priced)}
    else:
        found = {*truths, *chosen}
    classes = _sorted_labels(found)
    if isinstance(cost, Sequence | np.ndarray) and len(cost) != len(classes):
        raise ValueError(
            f"cost has {len(cost)} rows, but {len(classes)} labels occur in y_true and y_pred: "
            f"{classes.tolist()}. Give labels=..., the classes in the order of cost."
        )
    return classes


def _sorted_labels(found: Iterable[Any]) -> NDArray[Any]:
    try:
        ordered = sorted(found)
    except TypeError as error:
        raise ValueError(
            f"labels of different kinds have no order: {list(found)}. Give labels=..., the classes."
        ) from error
    return np.asarray(ordered)


def _label_list(labels: ArrayLike, name: str) -> list[Any]:
    # A mixed list such as [0, "inspect"] must not become an array of text.
    array = np.asarray(labels, dtype=object if isinstance(labels, list | tuple) else None)
    if array.ndim != 1:
        raise ValueError(f"{name} must be one-dimensional, got shape {array.shape}.")
    return _plain(array.tolist())


def _plain(labels: Iterable[Any]) -> list[Any]:
    """Return labels as Python's own objects, so that numpy's text and numbers compare alike."""
    return [label.item() if isinstance(label, np.generic) else label for label in labels]


def _positions(found: list[Any], known: list[Any], name: str, role: str) -> list[int]:
    place = {label: position for position, label in enumerate(known)}
    for position, label in enumerate(found):
        if label not in place:
            raise ValueError(
                f"{name} holds {label!r} at position {position}, which is no known {role}. "
                f"Known: {known}."
            )
    return [place[label] for label in found]


def _check_distinct(labels: Sequence[Any], name: str) -> None:
    doubles = [label for label in dict.fromkeys(labels) if labels.count(label) > 1]
    if doubles:
        raise ValueError(f"{name} must be named once each, got more than one of {doubles}.")


def _check_pairs(cost: Mapping[Any, Any]) -> None:
    for key in cost:
        if not (isinstance(key, tuple) and len(key) == 2):
            raise TypeError(
                f"cost as a mapping must have keys (decision, truth), got the key {key!r}."
            )


def _refuse_class(label: Any, known: list[Any]) -> NoReturn:
    raise ValueError(
        f"cost names the class {label!r} as a truth, which is unknown. Known classes: {known}."
        f"{numbered_hint(known, [label])}"
    )
