"""Which decisions are right under which truth, which are alarms, and what each costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.decisions.costs import cost_table
from emacm.decisions.families import as_families, families_of_cost, family_mapping


@dataclass(frozen=True)
class ScoringRule:
    """How decisions are judged.

    Attributes
    ----------
    classes : list
        The possible truths, those of a family together.
    family_of : dict
        {class: label that is right}; each its own where there are no families.
    healthy : object
        Healthy label; None if nobody said.
    prices : dict or None
        {(decision, truth): cost}; None counts wrong decisions.
    decisions : list
        Decisions that `prices` knows.
    """

    classes: list[Any]
    family_of: dict[Any, Any]
    healthy: Any = None
    prices: dict[tuple[Any, Any], float] | None = None
    decisions: Sequence[Any] = ()

    @property
    def labels(self) -> list[Any]:
        """What is told apart: the families, or the classes without any."""
        return list(dict.fromkeys(self.family_of[label] for label in self.classes))

    @property
    def has_families(self) -> bool:
        """Whether the right label is another than the class."""
        return any(self.family_of[label] != label for label in self.classes)

    def judge(self, truths: Sequence[Any], decisions: Sequence[Any]) -> pd.DataFrame:
        """Judge decisions one by one.

        Parameters
        ----------
        truths, decisions : sequence of n_recordings
            True classes, and what was decided.

        Returns
        -------
        DataFrame
            A row each: "truth", "decision", "true_label" and "decided_label" (families, where
            there are any), "correct" and "cost".

        Raises
        ------
        ValueError
            If a decision is no class, no family and has no price.
        """
        known = {*self.family_of, *self.family_of.values(), *self.decisions}
        for decision in decisions:
            if decision not in known:
                raise ValueError(
                    f"the estimator decided {decision!r}, which is none of the classes "
                    f"{self.classes} and has no price. If it stands for some of them, give "
                    f"families=; if it is another decision, price it in cost=."
                )
        table = pd.DataFrame({"truth": _column(truths), "decision": _column(decisions)})
        table["true_label"] = _column(as_families(truths, self.family_of))
        table["decided_label"] = _column(as_families(decisions, self.family_of))
        pairs = zip(table["true_label"], table["decided_label"], strict=True)
        table["correct"] = np.array([true == decided for true, decided in pairs], bool)
        table["cost"] = self._costs(truths, decisions) if self.prices else 1.0 - table["correct"]
        return table

    def _costs(self, truths: Sequence[Any], decisions: Sequence[Any]) -> list[float]:
        """Look up prices; those of a family stand for its classes where they have none."""
        found = []
        for truth, decision in zip(truths, decisions, strict=True):
            chosen = decision if decision in self.decisions else self.family_of.get(decision)
            if (price := (self.prices or {}).get((chosen, truth))) is None:
                raise ValueError(
                    f"cost has no price for deciding {decision!r} when {truth!r} is true. Its "
                    f"decisions (rows) are {list(self.decisions)}."
                )
            found.append(price)
        return found


def scoring_rule(
    classes: NDArray[Any], *, families: Any = None, healthy: Any = None, cost: Any = None
) -> ScoringRule:
    """Settle how decisions are judged.

    Parameters
    ----------
    classes : ndarray of shape (n_classes,)
        The possible truths, sorted.
    families : mapping, optional
        {class: family} or {family: [classes]}. Default: what costs 0, if the rows of `cost` are
        not the classes; otherwise each class is its own.
    healthy : object, optional
        Healthy class or family.
    cost : None, array-like, DataFrame or mapping, optional
        As for `emacm.decisions.costs.cost_table`; its columns may also be the families.

    Returns
    -------
    ScoringRule

    Raises
    ------
    TypeError, ValueError
        If classes, families, costs and `healthy` do not fit together.

    Examples
    --------
    >>> families = {"normal": ["normal"], "worn": ["worn1", "worn2"]}
    >>> rule = scoring_rule(np.array(["normal", "worn1", "worn2"]), families=families)
    >>> rule.judge(["worn1", "worn2", "normal"], ["worn", "worn1", "worn2"])["correct"].tolist()
    [True, True, False]
    """
    names = classes.tolist()
    if families is not None:
        family_of = family_mapping(families, names)
    elif cost is not None:
        family_of = family_mapping(families_of_cost(cost, classes), names)
    else:
        family_of = {name: name for name in names}
    order = [name for name in family_of if name in names] if families is not None else names
    rule = ScoringRule(order, family_of, _healthy_label(healthy, family_of, names))
    if cost is None:
        return rule
    truths = _truths(cost)
    by_family = truths <= {*rule.labels} and not truths <= {*names}
    columns = rule.labels if by_family else names
    decisions, matrix = cost_table(cost, columns)
    place = {name: columns.index(family_of[name] if by_family else name) for name in names}
    prices = {
        (decision, name): float(matrix[row, place[name]])
        for row, decision in enumerate(decisions.tolist())
        for name in names
    }
    return ScoringRule(order, family_of, rule.healthy, prices, decisions.tolist())


def _healthy_label(healthy: Any, family_of: Mapping[Any, Any], names: list[Any]) -> Any:
    if healthy is None:
        return None
    labels = list(dict.fromkeys(family_of[name] for name in names))
    label = family_of.get(healthy, healthy)
    if label not in labels:
        raise ValueError(
            f"healthy={healthy!r} is no class and no family. Classes: {names}; what is told "
            f"apart: {labels}."
        )
    return label


def _truths(cost: Any) -> set[Any]:
    """Return the truths that a labelled cost names."""
    if isinstance(cost, pd.DataFrame):
        return set(cost.columns.tolist())
    if isinstance(cost, Mapping):
        return {key[1] for key in cost if isinstance(key, tuple) and len(key) == 2}
    return set()


def _column(values: Sequence[Any]) -> pd.Series:
    """Keep labels as they are: numbers beside text stay numbers."""
    array = np.asarray(values)
    if array.dtype.kind in "US" and not all(isinstance(value, str) for value in values):
        array = np.empty(len(values), object)
        array[:] = values
    return pd.Series(array)
