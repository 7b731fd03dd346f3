"""Families of classes: several true states that call for the same decision."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_number, located
from emacm.decisions.costs import cost_table
from emacm.decisions.truths import label_array, label_list, plain_labels

_FORMS = (
    "families must map each state to its family, as {'worn1': 'worn'}, or each family to its "
    "states, as {'worn': ['worn1', 'worn2']}"
)


def family_mapping(families: Any, classes: ArrayLike = ()) -> dict[Any, Any]:
    """Read families as a mapping from each state to its family.

    Parameters
    ----------
    families : mapping
        Either {state: family}, or {family: states} with lists (or other collections) of states. In
        the second form, a family with one state of the same name may be written without a list.
    classes : array-like of shape (n_classes,), optional
        Classes that must have a family.

    Returns
    -------
    family_of : dict
        {state: family}, families in the order given.

    Raises
    ------
    TypeError
        If `families` is not a mapping, or a state or a family is not a label.
    ValueError
        If there is no family, a label is missing, a family has no states, a state has no family
        or two, the two forms are mixed, or a family has the name of a state of another family.

    Examples
    --------
    >>> family_mapping({"normal": ["normal"], "worn": ["worn1", "worn2"]})
    {'normal': 'normal', 'worn1': 'worn', 'worn2': 'worn'}
    >>> family_mapping({"normal": "normal", "worn1": "worn", "worn2": "worn"})
    {'normal': 'normal', 'worn1': 'worn', 'worn2': 'worn'}
    """
    if not isinstance(families, Mapping) or not families:
        raise TypeError(f"{_FORMS}; got {families!r}.")
    if any(_is_collection(content) for content in families.values()):
        pairs = [(state, name) for name, each in families.items() for state in _states(name, each)]
    else:
        pairs = list(families.items())
    family_of: dict[Any, Any] = {}
    for state, family in map(plain_labels, pairs):
        if not isinstance(state, Hashable) or pd.isna(family) or pd.isna(state):
            raise ValueError(
                f"families must name every state and its family, got the state {state!r} of the "
                f"family {family!r}. Leave it out, or name it."
            )
        if state in family_of:
            raise ValueError(
                f"families puts the state {state!r} into {family_of[state]!r} and into {family!r}; "
                f"each state belongs to one family, once."
            )
        family_of[state] = family
    for family in family_of.values():
        if family_of.get(family, family) != family:
            raise ValueError(
                f"families has a family {family!r} and a state {family!r} that belongs to "
                f"{family_of[family]!r}: a decision for {family!r} is ambiguous. Rename one."
            )
    missing = [label for label in plain_labels(np.asarray(classes)) if label not in family_of]
    if missing:
        raise ValueError(f"families must name a family for every class; missing: {missing}.")
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

    Examples
    --------
    >>> families = {"normal": ["normal"], "spalling": ["spalling1", "spalling2"]}
    >>> as_families(["spalling2", "normal"], families).tolist()
    ['spalling', 'normal']
    """
    family_of = family_mapping(families)
    labels = label_list(y, "y")
    for position, label in enumerate(labels):
        if label not in family_of:
            raise ValueError(
                f"y contains {label!r} at position {position}, which is in no family. "
                f"Known states: {list(family_of)}."
            )
    return label_array([family_of[label] for label in labels])


def family_costs(
    families: Any,
    costs: Any = None,
    *,
    other_decisions: Mapping[Any, float] | None = None,
    healthy: Any = None,
    missed: float = 1.0,
    false_alarm: float = 1.0,
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
        The family to which `missed` and `false_alarm` refer.
    missed, false_alarm : float, default=1
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
        If `families` or `other_decisions` is not a mapping, or a cost is not a number.
    ValueError
        If `families` is ambiguous, a family is unknown, one of `other_decisions` is a family, or
        `missed` or `false_alarm` is given without `healthy` or together with a complete table.

    Notes
    -----
    Metrics that compare labels, such as scikit-learn's accuracy, count every decision on families
    as wrong if `y` contains states. Compare families with families,
    ``balanced_accuracy_score(as_families(y, families), model.predict(X))``, or use `score` of the
    classifier, `expected_cost` or `neg_expected_cost`.

    Examples
    --------
    >>> families = {"normal": ["normal"], "spalling": ["spalling1", "spalling2"]}
    >>> family_costs(families, other_decisions={"inspect": 0.3}, healthy="normal", missed=10)
              normal  spalling1  spalling2
    normal       0.0       10.0       10.0
    spalling     1.0        0.0        0.0
    inspect      0.3        0.3        0.3
    """
    family_of = family_mapping(families)
    names, states = list(dict.fromkeys(family_of.values())), list(family_of)
    if missed != 1 or false_alarm != 1 or healthy is not None:
        costs = _alarm_costs(costs, names, healthy, missed, false_alarm)
    with located("costs between families (the classes are the families here)"):
        decisions, matrix = cost_table(costs, label_array(names))
    if not isinstance(other_decisions, Mapping | None):
        raise TypeError(f"other_decisions must be a mapping, got {other_decisions!r}.")
    rows, others = plain_labels(decisions), dict(other_decisions or {})
    taken = [decision for decision in others if decision in rows]
    if taken:
        raise ValueError(f"other_decisions contains {taken}, with costs between families already.")
    values = [check_number(c, f"the cost of {d!r} in other_decisions") for d, c in others.items()]
    matrix = matrix[:, [names.index(family) for family in family_of.values()]]
    matrix = np.vstack([matrix, np.repeat(np.reshape(values, (-1, 1)), len(states), axis=1)])
    rows += others
    index, columns = (pd.Index(labels, tupleize_cols=False) for labels in (rows, states))
    return pd.DataFrame(matrix, index=index, columns=columns)


def _is_collection(content: Any) -> bool:
    return np.iterable(content) and not isinstance(content, str)


def _states(family: Any, content: Any) -> list[Any]:
    """Return the states of one family."""
    states = plain_labels(content) if _is_collection(content) else [content]
    if not states or not (_is_collection(content) or content == family):
        raise ValueError(
            f"families must have a list of states for the family {family!r}, since others have; "
            f"got {content!r}."
        )
    return states


def _alarm_costs(
    costs: Any, families: list[Any], healthy: Any, missed: Any, false_alarm: Any
) -> dict[Any, Any]:
    """Return costs between families that contain those of missed detections and false alarms."""
    if healthy not in families:
        raise ValueError(
            f"missed and false_alarm need healthy, one of the families {families}; "
            f"got healthy={healthy!r}."
        )
    if not isinstance(costs, Mapping | None):
        raise ValueError(
            "costs is a complete table, which contains the costs of missed detections and false "
            "alarms. Omit healthy, missed and false_alarm, or give costs as a mapping."
        )
    others = [family for family in families if family != healthy]
    alarms = {(healthy, family): missed for family in others}
    alarms |= {(family, healthy): false_alarm for family in others}
    return alarms | dict(costs or {})
