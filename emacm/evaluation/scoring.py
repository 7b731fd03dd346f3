"""Correct decisions, alarms and costs, for the figures of merit of an evaluation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.multiclass import check_classification_targets

from emacm.conditions.router import check_labels
from emacm.decisions.costs import cost_table, label_array, truth_labels, truth_priors
from emacm.decisions.metrics import Correct, are_correct, correct_decisions, label_of
from emacm.recordings.meta import listed_recordings


@dataclass(frozen=True)
class ScoringRule:
    """Correct decisions and their costs.

    Attributes
    ----------
    classes : list
        The possible true classes, sorted.
    correct : dict
        {class: correct decisions}, see `emacm.decisions.metrics.correct_decisions`.
    costs : DataFrame
        Index = decisions, also classes and families that a cost does not name; columns = classes,
        and the unknown state if there is one. Without a cost, 0 for a correct decision, else 1.
    healthy : object
        Healthy label; None if it was not given.
    unknown : object
        Label of the unknown state; None if there is none.
    priors : dict or None
        Prior probability of each class in service; None: the frequencies of the recordings.
    """

    classes: list[Any]
    correct: Correct
    costs: pd.DataFrame
    healthy: Any = None
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
    def alarms(self) -> set[Any]:
        """Decisions that are correct for some class that is neither healthy nor unknown."""
        return self._correct_for({*self.labels} - {self.healthy, self.unknown})

    @property
    def cleared(self) -> set[Any]:
        """Decisions that are correct for the healthy state: on a fault, missed detections."""
        return self._correct_for({self.healthy})

    def _correct_for(self, labels: set[Any]) -> set[Any]:
        names = [name for name, label in self.family_of.items() if label in labels]
        return {decision for name in names for decision in self.correct[name]}

    def constant_costs(self, truths: Sequence[Any]) -> pd.DataFrame:
        """Return the mean cost of the same decision for every recording, as a yardstick.

        Parameters
        ----------
        truths : sequence of n_recordings
            True classes.

        Returns
        -------
        DataFrame
            One row for each of these decisions, the cheapest in service first: the healthy label,
            the label of the most frequent class, the cheapest decision, and those that are no
            labels, such as "inspect". "expected_cost": mean over the recordings; "realised_cost":
            with `priors` as weights of the classes.
        """
        share = pd.Series(list(truths)).value_counts(normalize=True)
        stated = share if self.priors is None else pd.Series(self.priors).reindex(share.index)
        weights = {"expected_cost": share, "realised_cost": stated / stated.sum()}
        costs = self.costs[share.index.tolist()]
        table = pd.DataFrame({name: costs @ weight for name, weight in weights.items()})
        known = {*self.labels, *self.classes, self.unknown}
        frequent, cheapest = self.family_of[share.idxmax()], table["realised_cost"].idxmin()
        named = {self.healthy, frequent, cheapest, *(d for d in table.index if d not in known)}
        yardsticks = table[[decision in named for decision in table.index]]
        ordered = yardsticks.sort_values("realised_cost", kind="stable")
        return ordered.rename(index=lambda decision: f"always {decision!r}").rename_axis("decision")

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
            (families, if there are any), "correct" and "cost" (1 of a decision without costs).
        """
        is_correct = are_correct(truths, decisions, self.correct)
        labels = [label_of(truth, self.correct) for truth in truths]
        # If several decisions are correct, each of them counts as the first.
        decided = [
            label if correct else label_of(decision, self.correct)
            for label, decision, correct in zip(labels, decisions, is_correct, strict=True)
        ]
        columns = {"truth": truths, "decision": decisions, "true_label": labels}
        columns["decided_label"] = decided
        table = pd.DataFrame({name: label_array(list(own)) for name, own in columns.items()})
        places = np.arange(len(table)), self.costs.columns.get_indexer(list(truths))
        return table.assign(correct=is_correct, cost=self._cost_rows(decisions)[places])

    def predicted_costs(
        self,
        decisions: Sequence[Any],
        posterior: pd.DataFrame,
        unknown_proba: ArrayLike | None = None,
    ) -> NDArray[np.float64]:
        """Return the cost that posterior probabilities predict for decisions, Eq. (2.39) of [1]_.

        Parameters
        ----------
        decisions : sequence of n_recordings
            Decisions that `judge` accepts.
        posterior : DataFrame of shape (n_recordings, n_classes)
            Posterior probability of each class (columns).
        unknown_proba : array-like of shape (n_recordings,), optional
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
        weights = posterior.reindex(columns=self.costs.columns, fill_value=0.0).to_numpy(float)
        if self.unknown is not None and unknown_proba is not None:
            unknown = np.asarray(unknown_proba)
            weights *= 1 - unknown[:, np.newaxis]
            weights[:, self.costs.columns.get_loc(self.unknown)] = unknown
        return np.sum(self._cost_rows(decisions) * weights, axis=1)

    def _cost_rows(self, decisions: Sequence[Any]) -> NDArray[np.float64]:
        """Return the costs of each decision; those of one without costs are 1."""
        return self.costs.reindex(list(decisions), fill_value=1.0).to_numpy(float)


def scoring_rule(
    classes: NDArray[Any],
    *,
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
    healthy : object, optional
        Healthy class or family.
    cost : None, array-like, DataFrame or mapping, optional
        As for `CostSensitiveGaussianBayes`. Of a class that is not a decision of it, the decision
        with the least cost is correct.
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
        If classes, costs and `healthy` are inconsistent.

    Examples
    --------
    >>> from emacm import family_costs
    >>> cost = family_costs({"normal": ["normal"], "worn": ["worn1", "worn2"]})
    >>> rule = scoring_rule(np.array(["normal", "worn1", "worn2"]), cost=cost)
    >>> rule.judge(["worn1", "worn2", "normal"], ["worn", "worn1", "worn2"])["correct"].tolist()
    [True, True, False]
    """
    names = classes.tolist()
    decisions, matrix = cost_table(cost, classes, unknown)
    table = pd.DataFrame(matrix, decisions.tolist(), truth_labels(classes, unknown).tolist())
    known = table.drop(index=[unknown], columns=[unknown], errors="ignore")
    correct = correct_decisions(known.index.tolist(), names, known)
    # A class without costs has those of its family.
    of_families = {name: label_of(name, correct) for name in correct if name not in table.index}
    of_families = {name: label for name, label in of_families.items() if label in table.index}
    if of_families:
        table = pd.concat([table, table.loc[[*of_families.values()]].set_axis([*of_families])])
    if priors is not None:
        known_priors, _ = truth_priors(priors, classes, np.ones(len(classes)), unknown)
        priors = dict(zip(names, known_priors.tolist(), strict=True))
    family_of = {name: correct[name][0] for name in names}
    labels = list(dict.fromkeys([*names, *family_of.values()]))
    if healthy is not None and healthy not in labels:
        raise ValueError(f"healthy={healthy!r} is neither a class nor a family: {labels}.")
    healthy = family_of.get(healthy, healthy)
    return ScoringRule(names, correct, table, healthy, unknown, priors)


def checked_classes(y: ArrayLike, X: Any) -> NDArray[Any]:
    """Return y as an array, or raise an error if it has not one class for each recording."""
    check_labels(y, X.shape[0] if hasattr(X, "shape") else len(listed_recordings(X)))
    classes = np.asarray(y)
    check_classification_targets(classes)
    if len(np.unique(classes)) < 2:
        raise ValueError(f"y must contain at least two classes, got {np.unique(classes)}.")
    return classes
