"""Families of classes: a decision for the family of a sub-state is right."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from emacm.decisions.costs import cost_table


def family_mapping(families: Mapping[Any, Any], classes: Iterable[Any]) -> dict[Any, Any]:
    """Bring families to a mapping from each class to its family.

    Parameters
    ----------
    families : mapping
        Either {class: family}, or {family: [classes]}, with lists, tuples or sets.
    classes : iterable
        The classes; each must have a family.

    Returns
    -------
    family_of : dict
        {class: family}, families in the order given.

    Raises
    ------
    TypeError
        If `families` is no mapping.
    ValueError
        If a class has no family or two, or a family is called like a class of another one.

    Examples
    --------
    >>> family_mapping({"normal": ["normal"], "worn": ["worn1", "worn2"]}, ["normal", "worn1"])
    {'normal': 'normal', 'worn1': 'worn', 'worn2': 'worn'}
    """
    if isinstance(families, pd.Series):
        families = families.to_dict()
    if not isinstance(families, Mapping):
        raise TypeError(
            f"families must map each class to its family, as {{'worn1': 'worn'}}, or each family "
            f"to its classes, as {{'worn': ['worn1', 'worn2']}}; got {families!r}."
        )
    family_of: dict[Any, Any] = {}
    for name, members in families.items():
        listed = isinstance(members, list | tuple | set | frozenset | np.ndarray)
        for label, family in ((m, name) for m in members) if listed else ((name, members),):
            if family_of.setdefault(label, family) != family:
                raise ValueError(
                    f"families puts {label!r} into {family_of[label]!r} and into {family!r}; a "
                    f"class has one family."
                )
    missing = [label for label in classes if label not in family_of]
    if missing:
        raise ValueError(f"families must name a family for every class; missing: {missing}.")
    for family in family_of.values():
        if family_of.get(family, family) != family:
            raise ValueError(
                f"families has a family {family!r} and a class {family!r} that belongs to "
                f"{family_of[family]!r}: a decision for {family!r} could be either. Rename one."
            )
    return family_of


def families_of_cost(cost: Any, classes: ArrayLike) -> dict[Any, Any]:
    """Read from a cost matrix which decision is right: the one that costs exactly 0.

    Parameters
    ----------
    cost : None, array-like, DataFrame or mapping
        As for `emacm.decisions.costs.cost_table`: rows are decisions, columns truths.
    classes : array-like of shape (n_classes,)
        The truths.

    Returns
    -------
    family_of : dict
        {class: right decision}. Where every class is a decision too, each is its own.

    Raises
    ------
    ValueError
        If a class is no decision, and not exactly one decision costs 0 for a class.

    Examples
    --------
    >>> prices = [[0, 1, 1], [5, 0, 0]]
    >>> cost = pd.DataFrame(prices, index=["fly", "ground"], columns=["new", "worn", "broken"])
    >>> families_of_cost(cost, ["new", "worn", "broken"])
    {'new': 'fly', 'worn': 'ground', 'broken': 'ground'}
    """
    decisions, matrix = cost_table(cost, classes)
    labels, rows = np.asarray(classes).tolist(), decisions.tolist()
    if all(label in rows for label in labels):
        return {label: label for label in labels}
    family_of = {}
    for label, prices in zip(labels, matrix.T, strict=True):
        free = [row for row, price in zip(rows, prices, strict=True) if price == 0]
        if len(free) != 1:
            raise ValueError(
                f"the decisions {rows} are not the classes, and {len(free)} of them cost 0 when "
                f"{label!r} is true, so that the cost does not tell which one is right. Give "
                f"families=, which maps each class to the decision that is right."
            )
        family_of[label] = free[0]
    return family_of


def as_families(labels: Sequence[Any], family_of: Mapping[Any, Any]) -> list[Any]:
    """Return the family of each label; what is no class (a family, "inspect") stays.

    Examples
    --------
    >>> as_families(["worn2", "worn", "inspect"], {"worn1": "worn", "worn2": "worn"})
    ['worn', 'worn', 'inspect']
    """
    return [family_of.get(label, label) for label in labels]
