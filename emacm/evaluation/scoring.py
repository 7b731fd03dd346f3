"""Correct decisions, alarms and costs, for the figures of merit of an evaluation."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.decisions.costs import cost_table
from emacm.decisions.families import family_mapping
from emacm.decisions.labels import label_array
from emacm.decisions.metrics import (
    Correct,
    are_correct,
    correct_decisions,
    correct_families,
    decision_costs,
    label_of,
)


@dataclass(frozen=True)
class ScoringRule:
    """Correct decisions and their costs.

    Attributes
    ----------
    classes : list
        The possible true classes, those of a family together.
    correct : dict
        {class: correct decisions}, see `emacm.decisions.metrics.correct_decisions`.
    healthy : object
        Healthy label; None if it was not given.
    costs : tuple of (decisions, classes, cost) or None
        Labels of the rows and columns, and the cost; None counts wrong decisions.
    """

    classes: list[Any]
    correct: Correct
    healthy: Any = None
    costs: tuple[list[Any], list[Any], NDArray[np.float64]] | None = None

    @property
    def family_of(self) -> dict[Any, Any]:
        """The first correct decision for each class."""
        return {label: self.correct[label][0] for label in self.classes}

    @property
    def labels(self) -> list[Any]:
        """The labels that are scored: families, or classes if there are no families."""
        return list(dict.fromkeys(self.family_of.values()))

    @property
    def has_families(self) -> bool:
        """Whether the label of some class is not the class itself."""
        return any(label != family for label, family in self.family_of.items())

    @property
    def alarms(self) -> set[Any]:
        """Decisions that are correct for some class that is not healthy."""
        faults = [name for name, label in self.family_of.items() if label != self.healthy]
        return {decision for name in faults for decision in self.correct[name]}

    def judge(self, truths: Sequence[Any], decisions: Sequence[Any]) -> pd.DataFrame:
        """Return label, correctness and cost of each decision.

        Parameters
        ----------
        truths, decisions : sequence of n_recordings
            True classes, and decisions.

        Returns
        -------
        DataFrame
            One row for each recording: "truth", "decision", "true_label" and "decided_label"
            (families, if there are any), "correct" and "cost".

        Raises
        ------
        ValueError
            If a decision is not a class or family and has no cost.
        """
        rows = self.costs[0] if self.costs else []
        known = {*self.correct, *self.labels, *rows}
        for decision in decisions:
            if decision not in known:
                raise ValueError(
                    f"the estimator decided {decision!r}, which is none of the classes "
                    f"{self.classes} and has no cost. If it is a family of classes, give "
                    f"families=; if it is another decision, give its costs in cost=."
                )
        table = pd.DataFrame({"truth": _column(truths), "decision": _column(decisions)})
        is_correct = are_correct(truths, decisions, self.correct)
        labels = [label_of(truth, self.correct) for truth in truths]
        # If several decisions are correct, each of them counts as the first.
        decided = [
            label if correct else label_of(decision, self.correct)
            for label, decision, correct in zip(labels, decisions, is_correct, strict=True)
        ]
        table["true_label"], table["decided_label"] = _column(labels), _column(decided)
        table["correct"] = is_correct
        table["cost"] = self._costs(truths, decisions) if self.costs else 1.0 - is_correct
        return table

    def _costs(self, truths: Sequence[Any], decisions: Sequence[Any]) -> NDArray[np.float64]:
        """Return the cost of each decision; a class without costs has those of its family."""
        assert self.costs is not None
        rows = self.costs[0]
        chosen = [d if d in rows else label_of(d, self.correct) for d in decisions]
        return decision_costs(truths, chosen, self.costs)


def scoring_rule(
    classes: NDArray[Any], *, families: Any = None, healthy: Any = None, cost: Any = None
) -> ScoringRule:
    """Return the definition of correct decisions and their costs.

    Parameters
    ----------
    classes : ndarray of shape (n_classes,)
        The possible true classes, sorted.
    families : mapping, optional
        {class: family} or {family: [classes]}. Default: the class itself is correct, or, if it is
        not a decision of `cost`, the decision with the least cost.
    healthy : object, optional
        Healthy class or family.
    cost : None, array-like, DataFrame or mapping, optional
        As for `CostSensitiveGaussianBayes`; its columns may also be the families.

    Returns
    -------
    ScoringRule

    Raises
    ------
    TypeError, ValueError
        If classes, families, costs and `healthy` are inconsistent.

    Examples
    --------
    >>> families = {"normal": ["normal"], "worn": ["worn1", "worn2"]}
    >>> rule = scoring_rule(np.array(["normal", "worn1", "worn2"]), families=families)
    >>> rule.judge(["worn1", "worn2", "normal"], ["worn", "worn1", "worn2"])["correct"].tolist()
    [True, True, False]
    """
    names = classes.tolist()
    if families is not None:
        correct = correct_families(family_mapping(families, names))
    elif cost is not None:
        correct = correct_decisions(*_table(cost, names))
    else:
        correct = {name: (name,) for name in names}
    order = [name for name in correct if name in names] if families is not None else names
    family_of = {name: correct[name][0] for name in order}
    healthy = _healthy_label(healthy, family_of, names)
    if cost is None:
        return ScoringRule(order, correct, healthy)
    labels = list(dict.fromkeys(family_of.values()))
    truths = _truths(cost)
    if truths <= {*labels} and not truths <= {*names}:
        decisions, _, matrix = _table(cost, labels)
        matrix = matrix[:, [labels.index(family_of[name]) for name in names]]
    else:
        decisions, _, matrix = _table(cost, names)
    return ScoringRule(order, correct, healthy, (decisions, names, matrix))


def _table(cost: Any, columns: list[Any]) -> tuple[list[Any], list[Any], NDArray[np.float64]]:
    decisions, matrix = cost_table(cost, label_array(columns))
    return decisions.tolist(), columns, matrix


def _healthy_label(healthy: Any, family_of: Mapping[Any, Any], names: list[Any]) -> Any:
    if healthy is None:
        return None
    labels = list(dict.fromkeys(family_of[name] for name in names))
    if not isinstance(healthy, Hashable):
        raise TypeError(f"healthy must be one class or family, got {healthy!r}.")
    label = family_of.get(healthy, healthy)
    if label not in labels:
        raise ValueError(
            f"healthy={healthy!r} is neither a class nor a family. Classes: {names}; labels that "
            f"are scored: {labels}."
        )
    return label


def _truths(cost: Any) -> set[Any]:
    """Return the true classes in the columns or keys of a cost; none for an array."""
    if isinstance(cost, pd.DataFrame):
        return set(cost.columns.tolist())
    if isinstance(cost, Mapping):
        return {key[1] for key in cost if isinstance(key, tuple) and len(key) == 2}
    return set()


def _column(values: Sequence[Any]) -> pd.Series:
    return pd.Series(label_array(list(values)))
