"""Correct decisions, alarms and costs, for the figures of merit of an evaluation."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.multiclass import check_classification_targets

from emacm._checks import once_hint
from emacm.decisions.families import family_mapping
from emacm.decisions.labels import check_classes, label_array
from emacm.decisions.metrics import (
    Correct,
    are_correct,
    correct_decisions,
    correct_families,
    decision_costs,
    label_of,
)
from emacm.decisions.truths import truth_cost_table, truth_priors


@dataclass(frozen=True)
class ScoringRule:
    """Correct decisions and their costs.

    Attributes
    ----------
    classes : list
        The possible true classes: those of a given family together, in the order of the families.
    correct : dict
        {class: correct decisions}, see `emacm.decisions.metrics.correct_decisions`.
    healthy : object
        Healthy label; None if it was not given.
    costs : tuple of (decisions, truths, cost) or None
        Labels of the rows and columns, and the cost; None counts wrong decisions.
    unknown : object
        Label of the unknown state; None if there is none.
    priors : dict or None
        Prior probability of each class in service; None: the frequencies of the recordings.
    """

    classes: list[Any]
    correct: Correct
    healthy: Any = None
    costs: tuple[list[Any], list[Any], NDArray[np.float64]] | None = None
    unknown: Any = None
    priors: Mapping[Any, float] | None = None

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
        """Decisions that are correct for some class that is neither healthy nor unknown."""
        others = (self.healthy, self.unknown)
        faults = [name for name, label in self.family_of.items() if label not in others]
        return {decision for name in faults for decision in self.correct[name]}

    @property
    def cleared(self) -> set[Any]:
        """Decisions that are correct for the healthy state: on a fault, missed detections."""
        healthy = [name for name, label in self.family_of.items() if label == self.healthy]
        return {decision for name in healthy for decision in self.correct[name]}

    def other_decisions(self, decisions: Sequence[Any]) -> list[Any]:
        """Return the decisions that are neither classes nor families and have no cost."""
        known = {*self.correct, *self.labels, *(self.costs[0] if self.costs else ()), self.unknown}
        return [decision for decision in dict.fromkeys(decisions) if decision not in known]

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
        if self.costs and (others := self.other_decisions(decisions)):
            raise ValueError(
                f"the estimator decided {others[0]!r}, which is none of the classes {self.classes} "
                f"and has no cost. If it is a family of classes, give families= to rescored; if "
                f"it is another decision, give its costs in cost=."
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

    def predicted_costs(
        self,
        decisions: Sequence[Any],
        posterior: pd.DataFrame,
        unknown_proba: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Return the cost that posterior probabilities predict for decisions, Eq. (2.39) of [1]_.

        Parameters
        ----------
        decisions : sequence of n_recordings
            Decisions that `judge` accepts.
        posterior : DataFrame of shape (n_recordings, n_classes)
            Posterior probability of each class (columns).
        unknown_proba : ndarray of shape (n_recordings,), optional
            Probability of the unknown state.

        Returns
        -------
        ndarray of shape (n_recordings,)
            In the unit of the cost.

        References
        ----------
        .. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
           Condition Monitoring.
        """
        of_classes = posterior.reindex(columns=self.classes, fill_value=0.0).to_numpy(float)
        truths, unknown = [*self.classes], np.zeros(len(posterior))
        if self.unknown is not None and unknown_proba is not None:
            truths, unknown = [*truths, self.unknown], unknown_proba
        weights = np.column_stack([of_classes * (1 - unknown)[:, np.newaxis], unknown])
        rows = {label: self._cost_row(label, truths) for label in set(decisions)}
        matrix = np.array([rows[label] for label in decisions])
        return np.sum(matrix * weights[:, : len(truths)], axis=1)

    def _cost_row(self, decision: Any, truths: list[Any]) -> list[float]:
        if self.costs is not None:
            return self._costs(truths, [decision] * len(truths)).tolist()
        correct = are_correct(truths, [decision] * len(truths), self.correct)
        return (1.0 - correct).tolist()

    def _costs(self, truths: Sequence[Any], decisions: Sequence[Any]) -> NDArray[np.float64]:
        """Return the cost of each decision; a class without costs has those of its family."""
        assert self.costs is not None
        rows = self.costs[0]
        chosen = [d if d in rows else label_of(d, self.correct) for d in decisions]
        return decision_costs(truths, chosen, self.costs)


def scoring_rule(
    classes: NDArray[Any],
    *,
    families: Any = None,
    healthy: Any = None,
    cost: Any = None,
    unknown: Any = None,
    priors: Any = None,
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
    unknown : object, optional
        Label of the unknown state of the classifier. It is a decision, and may have costs.
    priors : None, "uniform", array-like or mapping, optional
        As for `CostSensitiveGaussianBayes`.

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
    if unknown is not None and unknown in names:
        raise ValueError(f"unknown = {unknown!r} is a class with recordings. Choose another label.")
    if families is not None:
        correct = correct_families(family_mapping(families, names))
    else:
        decisions, _, matrix = _table(cost, names, unknown)
        is_known = np.array([decision != unknown for decision in decisions])
        known = [decision for decision in decisions if decision != unknown]
        correct = correct_decisions(known, names, matrix[is_known, : len(names)])
    order = names
    if families is not None:
        listed = list(dict.fromkeys(decisions[0] for decisions in correct.values()))
        order = [name for name in correct if name in names]
        order.sort(key=lambda name: listed.index(correct[name][0]))
    family_of = {name: correct[name][0] for name in order}
    stated = {
        "healthy": _healthy_label(healthy, family_of, names),
        "unknown": unknown,
        "priors": None if priors is None else _priors(priors, classes, unknown),
    }
    if cost is None:
        return ScoringRule(order, correct, **stated)
    labels = list(dict.fromkeys(family_of.values()))
    truths = _truths(cost) - {unknown}
    if truths <= {*labels} and not truths <= {*names}:
        decisions, columns, matrix = _table(cost, labels, unknown)
        places = [labels.index(family_of[name]) for name in names]
        matrix = matrix[:, [*places, *range(len(labels), len(columns))]]
    else:
        decisions, _, matrix = _table(cost, names, unknown)
    columns = names if unknown is None else [*names, unknown]
    return ScoringRule(order, correct, costs=(decisions, columns, matrix), **stated)


def _table(cost: Any, columns: list[Any], unknown: Any) -> tuple[list[Any], list[Any], Any]:
    decisions, matrix = truth_cost_table(cost, label_array(columns), unknown)
    return decisions.tolist(), columns if unknown is None else [*columns, unknown], matrix


def _priors(priors: Any, classes: NDArray[Any], unknown: Any) -> dict[Any, float]:
    stated, _ = truth_priors(priors, classes, np.ones(len(classes)), unknown)
    return dict(zip(classes.tolist(), stated.tolist(), strict=True))


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


def checked_classes(y: ArrayLike, X: Any) -> NDArray[Any]:
    """Return y as an array, or raise an error if it has not one class for each recording."""
    if isinstance(X, str | Mapping) or not (hasattr(X, "shape") or hasattr(X, "__len__")):
        raise TypeError(
            f"X must be a list of recordings or a table, got {type(X).__name__}.{once_hint(X)}"
        )
    n_recordings = X.shape[0] if hasattr(X, "shape") else len(X)
    classes = np.asarray(y)
    if classes.shape != (n_recordings,):
        raise ValueError(
            f"y must contain one class for each of {n_recordings} recordings in X, got shape "
            f"{classes.shape}."
        )
    check_classes(y)
    check_classification_targets(classes)
    if len(np.unique(classes)) < 2:
        raise ValueError(f"y must contain at least two classes, got {np.unique(classes)}.")
    return classes
