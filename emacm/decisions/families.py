"""Families of states that call for the same decision, and states that are sets of faulty parts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_number, located
from emacm.decisions.costs import (
    cost_table,
    label_array,
    label_list,
    label_positions,
    plain_labels,
)


def family_mapping(families: Any) -> dict[Any, Any]:
    """Read families as a mapping from each state to its family.

    Parameters
    ----------
    families : mapping
        Either {state: family}, or {family: states} with lists (or other collections) of states. In
        the second form, a family with one state of the same name may be written without a list.

    Returns
    -------
    family_of : dict
        {state: family}, families in the order given.

    Raises
    ------
    TypeError
        If `families` is not a mapping, or empty.
    ValueError
        If a family has no states, a state has two families, the two forms are mixed, or a
        family has the name of a state of another family.

    Examples
    --------
    >>> family_mapping({"normal": ["normal"], "worn": ["worn1", "worn2"]})
    {'normal': 'normal', 'worn1': 'worn', 'worn2': 'worn'}
    >>> family_mapping({"normal": "normal", "worn1": "worn", "worn2": "worn"})
    {'normal': 'normal', 'worn1': 'worn', 'worn2': 'worn'}
    """
    if not isinstance(families, Mapping) or not families:
        raise TypeError(
            f"families must map each state to its family, as {{'worn1': 'worn'}}, or each family "
            f"to its states, as {{'worn': ['worn1', 'worn2']}}; got {families!r}."
        )
    family_of: dict[Any, Any] = {}
    for state, family in _states_and_families(families):
        if family_of.setdefault(state, family) != family:
            raise ValueError(
                f"families puts the state {state!r} into {family_of[state]!r} and into {family!r}."
            )
    for family in family_of.values():
        if family_of.get(family, family) != family:
            raise ValueError(
                f"families has a family {family!r} and a state {family!r} that belongs to "
                f"{family_of[family]!r}: a decision for {family!r} is ambiguous. Rename one."
            )
    return family_of


def as_families(y: ArrayLike, families: Any) -> NDArray[Any]:
    """Return the family of each label, to be compared with decisions on families.

    Parameters
    ----------
    y : array-like of shape (n_recordings,)
        States.
    families : mapping
        {state: family} or {family: states}, as for `family_costs`.

    Returns
    -------
    ndarray of shape (n_recordings,)
        The families.

    Raises
    ------
    TypeError, ValueError
        If a label has no family (the message gives its position), or `families` is ambiguous.

    See Also
    --------
    emacm.family_costs : The costs of families.

    Examples
    --------
    >>> families = {"normal": ["normal"], "spalling": ["spalling1", "spalling2"]}
    >>> as_families(["spalling2", "normal"], families).tolist()
    ['spalling', 'normal']
    """
    family_of = family_mapping(families)
    labels = label_list(y, "y")
    label_positions(labels, list(family_of), "y", "state of a family")
    return label_array([family_of[label] for label in labels])


def family_costs(
    families: Any,
    costs: Any = None,
    *,
    other_decisions: Mapping[Any, float] | None = None,
    healthy: Any = None,
    missed_cost: float = 1.0,
    false_alarm_cost: float = 1.0,
) -> pd.DataFrame:
    """Return costs of decisions on families, for a classifier that is trained on the states.

    A family of faults is seldom one Gaussian: eight severities of spalling are eight. A classifier
    that is trained on the states and decides on families adds the posterior probabilities of
    the states of a family.

    Parameters
    ----------
    families : mapping
        {family: states} or {state: family}: families of faults, or the maintenance action that
        each state calls for. See `emacm.decisions.families.family_mapping`.
    costs : None, array-like, DataFrame or mapping, default=None
        Costs between families, in the forms that `CostSensitiveGaussianBayes` accepts between
        classes: None is 0-1, a mapping is {(decision, true family): cost}, all other entries 0-1
        (or as below).
    other_decisions : mapping of decision to cost, optional
        Further decisions whose cost does not depend on the true state, such as {"inspect": 0.3}.
    healthy : family, optional
        The family to which `missed_cost` and `false_alarm_cost` refer.
    missed_cost, false_alarm_cost : float, default=1
        Cost of deciding `healthy` when another family is true (missed detection), and of the
        reverse (false alarm). Entries of a mapping `costs` take precedence.

    Returns
    -------
    DataFrame
        Index = decisions, columns = states; the form that `CostSensitiveGaussianBayes`,
        `expected_cost` and the classifiers accept as `cost`.

    Raises
    ------
    TypeError
        If `families` is not a mapping, or a cost is not a number.
    ValueError
        If `families` is ambiguous, a family is unknown, one of `other_decisions` is a family, or
        `missed_cost` or `false_alarm_cost` is given without `healthy` or with a complete table.

    See Also
    --------
    emacm.as_families : Labels as families.
    emacm.set_costs : Costs of opening parts.

    Notes
    -----
    Metrics that compare labels, such as scikit-learn's accuracy, count every decision on families
    as wrong if `y` contains states. Compare families with families,
    ``balanced_accuracy_score(as_families(y, families), model.predict(X))``, or use `score` of the
    classifier, `expected_cost` or `neg_expected_cost`.

    Examples
    --------
    >>> families = {"normal": ["normal"], "spalling": ["spalling1", "spalling2"]}
    >>> family_costs(families, other_decisions={"inspect": 0.3}, healthy="normal", missed_cost=10)
              normal  spalling1  spalling2
    normal       0.0       10.0       10.0
    spalling     1.0        0.0        0.0
    inspect      0.3        0.3        0.3
    """
    family_of = family_mapping(families)
    names = list(dict.fromkeys(family_of.values()))
    if missed_cost != 1 or false_alarm_cost != 1 or healthy is not None:
        if healthy not in names or not isinstance(costs, Mapping | None):
            raise ValueError(
                f"missed_cost and false_alarm_cost need healthy, one of {names}, and no complete "
                f"table of costs; got healthy = {healthy!r} and costs = {costs!r}."
            )
        faults = [family for family in names if family != healthy]
        missed = {(healthy, fault): missed_cost for fault in faults}
        false_alarms = {(fault, healthy): false_alarm_cost for fault in faults}
        costs = missed | false_alarms | dict(costs or {})
    with located("costs between families (the classes are the families here)"):
        decisions, matrix = cost_table(costs, label_array(names))
    matrix = matrix[:, [names.index(family) for family in family_of.values()]]
    rows = dict(zip(decisions.tolist(), matrix.tolist(), strict=True))
    return _cost_frame(rows, other_decisions, list(family_of))


def set_costs(
    states: Iterable[str],
    opening: Mapping[str, float],
    left: Mapping[str, float],
    *,
    healthy: str = "healthy",
    other_decisions: Mapping[str, float] | None = None,
) -> pd.DataFrame:
    """Return costs of decisions on which parts to open, where several may be faulty at once.

    A decision is a set of parts: opening each of them costs, and so does each faulty part that is
    left.

    Parameters
    ----------
    states : iterable of str
        True states: `healthy`, or faulty parts joined by " + ", as `find_faults` names them.
        Repeated ones, such as the labels of all recordings, count once.
    opening : mapping of part to cost
        Cost of opening each part, whether it is faulty or not. Its parts and their order name the
        decisions.
    left : mapping of part to cost
        Cost of each part that is faulty and not opened.
    healthy : str, default="healthy"
        State without a faulty part, and the decision to open none.
    other_decisions : mapping of decision to cost, optional
        Further decisions whose cost does not depend on the true state, such as {"inspect": 0.3}.

    Returns
    -------
    DataFrame
        Index = decisions (all sets of parts), columns = states; the form that
        `CostSensitiveGaussianBayes`, `expected_cost` and the classifiers accept as `cost`.

    Raises
    ------
    TypeError
        If a cost is not a number.
    ValueError
        If `opening` and `left` have different parts, a state contains another part, there are
        more than ten parts, or one of `other_decisions` is a set of parts.

    See Also
    --------
    emacm.family_costs : Costs of decisions on one fault.

    Notes
    -----
    The cost is a sum over parts, so the decision of least risk opens part p where P(p is faulty) >
    opening[p] / left[p], whatever the other parts are: the conditional risk of Eq. (2.43) of the
    thesis [1]_, part by part. More than ten parts can be decided so, one at a time.

    A classifier with ``unknown="unknown"`` needs the costs of that decision and of that state too:
    ``other_decisions={"unknown": 1000}``, and ``cost["unknown"] = [...]`` with 0 for the decision
    "unknown".

    References
    ----------
    .. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
       Condition Monitoring, section 2.2.

    Examples
    --------
    >>> states = ["healthy", "screw", "bearing", "bearing + screw"]
    >>> set_costs(states, opening={"screw": 2, "bearing": 1}, left={"screw": 9, "bearing": 5})
                     healthy  screw  bearing  bearing + screw
    healthy              0.0    9.0      5.0             14.0
    screw                2.0    2.0      7.0              7.0
    bearing              1.0   10.0      1.0             10.0
    screw + bearing      3.0    3.0      3.0              3.0
    """
    parts = list(opening)
    if set(parts) != set(left):
        raise ValueError(f"opening and left must have the same parts; got {parts}, {list(left)}.")
    if len(parts) > 10:
        raise ValueError(
            f"opening has {len(parts)} parts, at most 10 are possible: decide each part alone, by "
            f"P(faulty) > opening / left."
        )
    faulty_parts = {state: set(state.split(" + ")) - {healthy} for state in states}
    for state, faulty in faulty_parts.items():
        if not faulty <= set(parts):
            raise ValueError(f"opening must have the parts of the state {state!r}; got {parts}.")
    for name, costs in (("opening", opening), ("left", left)):
        for part, value in costs.items():
            check_number(value, f"the cost of {part!r} in {name}")
    rows = {
        " + ".join(opened) or healthy: [
            sum(opening[p] for p in opened) + sum(left[p] for p in faulty.difference(opened))
            for faulty in faulty_parts.values()
        ]
        for n_opened in range(len(parts) + 1)
        for opened in combinations(parts, n_opened)
    }
    return _cost_frame(rows, other_decisions, list(faulty_parts))


def _cost_frame(
    rows: dict[Any, list[float]], other_decisions: Mapping[Any, float] | None, states: list[Any]
) -> pd.DataFrame:
    """Return costs as a table, with decisions whose cost does not depend on the true state."""
    for decision, value in (other_decisions or {}).items():
        if decision in rows:
            raise ValueError(f"other_decisions contains {decision!r}, which has costs already.")
        rows[decision] = [check_number(value, f"the cost of {decision!r} in other_decisions")]
        rows[decision] *= len(states)
    return pd.DataFrame(list(rows.values()), index=list(rows), columns=states, dtype=float)


def _states_and_families(families: Mapping[Any, Any]) -> list[tuple[Any, Any]]:
    """Return each state and its family, from either form of families."""
    listed = {name: np.iterable(v) and not isinstance(v, str) for name, v in families.items()}
    if not any(listed.values()):
        return [tuple(plain_labels(pair)) for pair in families.items()]
    pairs = []
    for family, states in families.items():
        if not (len(states) if listed[family] else states == family):
            raise ValueError(
                f"families must have a list of states for {family!r}, as others; got {states!r}."
            )
        pairs += [(s, family) for s in plain_labels(states if listed[family] else [states])]
    return pairs
