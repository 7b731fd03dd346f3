"""Families of faults left out of training: whether they are recognised as unknown."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm.decisions.pipelines import stated_costs
from emacm.evaluation.bootstrap import Array, GroupBootstrap, Tally
from emacm.evaluation.evaluate import Printed, as_texts, judged_decisions
from emacm.evaluation.figures import probability_columns
from emacm.evaluation.held_out import (
    Fold,
    HeldOut,
    Scheme,
    all_schemes,
    decide_held_out,
    read_groupings,
)
from emacm.evaluation.scoring import ScoringRule, checked_classes, scoring_rule


@dataclass(frozen=True, repr=False)
class UnknownEvaluation(Printed):
    """Result of `evaluate_unknown`; printed as its caveats, followed by its table.

    Attributes
    ----------
    table : DataFrame
        One row for each family of faults that was left out of training, with intervals: "auroc",
        the area under the ROC curve of typicality, which separates its recordings from the known
        ones; fraction of the known recordings with a typicality of at most 0.01
        ("known_flagged") and of those left out ("unknown_flagged"); fraction of those left out that
        were decided to be healthy ("unknown_called_healthy"); numbers of recordings ("known",
        "unknown"). Empty if no family was left out.
    predictions : DataFrame
        One row for each family left out and recording held out: "left_out", "fold", "recording",
        "group", "true_label", "is_unknown" (of the family left out), "decision",
        "decided_label", "confidence" (the largest posterior probability of a label), "typicality"
        and "unknown_proba".
    caveats : list of str
        Families that could not be left out.
    """

    table: pd.DataFrame
    predictions: pd.DataFrame
    caveats: list[str]

    def printed_tables(self) -> dict[str, pd.DataFrame]:
        """Return the figures of merit, one column for each family."""
        return {"": as_texts(self.table).T}


def evaluate_unknown(
    estimator: Any,
    X: Any,
    y: ArrayLike,
    *,
    runs: Any = None,
    units: Any = None,
    healthy: Any = None,
    n_splits: int = 5,
) -> UnknownEvaluation:
    """Leave each family of faults out of training, and state whether it is recognised as unknown.

    Parameters
    ----------
    estimator : estimator
        Classifier or pipeline with an unknown state; it is not changed.
    X, y, runs, units, healthy
        As for `evaluate`. Recordings are held out by unit, or, if there are no units or they cannot
        be held out, by run, or at random.
    n_splits : int, default=5
        Largest number of folds for each family.

    Returns
    -------
    UnknownEvaluation

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, or the estimator has no unknown state; or an error of the
        estimator, with the fold.

    See Also
    --------
    emacm.evaluate : Recordings, runs and units held out.
    emacm.outside_training : What of a recording is outside the range of training.

    Examples
    --------
    >>> from emacm import CostSensitiveGaussianBayes
    >>> rng = np.random.default_rng(0)
    >>> y = np.tile(["new", "worn", "dry"], 60)
    >>> centres = np.array([{"new": (0, 0), "worn": (9, 0), "dry": (0, 9)}[state] for state in y])
    >>> X = centres + rng.normal(size=(180, 2))
    >>> model = CostSensitiveGaussianBayes(covariance="tied", unknown="unknown")
    >>> found = evaluate_unknown(model, X, y, units=np.arange(180) // 6, healthy="new")
    >>> found.table["auroc"].round(1).to_dict()
    {'dry': 1.0, 'worn': 1.0}
    """
    stated = stated_costs(estimator)
    if stated["unknown"] is None:
        raise ValueError("estimator has no unknown state: set unknown= of the classifier.")
    classes = checked_classes(y, X)
    rule = scoring_rule(np.unique(classes), healthy=healthy, **stated)
    labels = [rule.family_of[label] for label in classes.tolist()]
    groupings = read_groupings(X, runs, units)
    schemes = all_schemes(classes, labels, groupings, None, n_splits)
    possible = [scheme for scheme in schemes if not scheme.impossible]
    schemes = left_out_families(possible[-1], labels, rule) if possible else []  # the strictest
    held_out = decide_held_out(estimator, X, classes, schemes, groupings)
    refused = [scheme for scheme in held_out.schemes if scheme.impossible]
    caveats = [f"{s.name!r} could not be left out of training. {s.impossible}" for s in refused]
    predictions = novelty_predictions(held_out, rule)
    if predictions.empty:
        caveats.append("No family of faults was left out as unknown.")
    return UnknownEvaluation(novelty_table(predictions, rule.cleared), predictions, caveats)


def left_out_families(scheme: Scheme, labels: Sequence[Any], rule: ScoringRule) -> list[Scheme]:
    """Return the folds of a scheme without one family of faults in the training data.

    Parameters
    ----------
    scheme : Scheme
        Its folds divide the recordings into training and test, so that the known recordings of the
        test are new as well.
    labels : sequence of n_recordings
        Labels that are scored.
    rule : ScoringRule
        Every label except the healthy one is left out in turn.

    Returns
    -------
    list of Scheme
        One for each family; its name is that of the family.
    """
    names = np.fromiter(labels, object, len(labels))
    schemes = []
    for family in (label for label in rule.labels if label != rule.healthy):
        folds = [
            Fold(f.train[names[f.train] != family], f.test, f"{family}, {f.left_out}".rstrip(", "))
            for f in scheme.folds
        ]
        if all(len(fold.train) for fold in folds):
            schemes.append(replace(scheme, name=str(family), folds=folds, may_refuse=True))
    return schemes


def novelty_predictions(held_out: HeldOut, rule: ScoringRule) -> pd.DataFrame:
    """Return one row for each family left out and recording held out.

    Parameters
    ----------
    held_out : HeldOut
        Decisions in the schemes of `left_out_families`.
    rule : ScoringRule
        Labels of the classes.

    Returns
    -------
    DataFrame
        `UnknownEvaluation.predictions`; empty if no family was left out.
    """
    table = judged_decisions(held_out, rule)
    if table.empty:
        return table
    columns = ["fold", "recording", "group", "true_label", "is_unknown", "decision"]
    columns += ["decided_label", "confidence", "typicality", "unknown_proba"]
    return table.assign(
        left_out=table["scheme"],
        is_unknown=table["scheme"] == table["true_label"].astype(str),
        confidence=table[probability_columns(rule)].max(axis=1),
    )[["left_out", *columns]]


def novelty_table(predictions: pd.DataFrame, cleared: Collection[Any]) -> pd.DataFrame:
    """Return how well each family that was left out is recognised as unknown.

    Parameters
    ----------
    predictions : DataFrame
        From `novelty_predictions`.
    cleared : collection
        Decisions that are correct for the healthy state; empty if it was not given.

    Returns
    -------
    DataFrame
        As `UnknownEvaluation.table`.
    """
    rows = {}
    for family, part in predictions.groupby("left_out", sort=False) if len(predictions) else ():
        is_unknown = part["is_unknown"].to_numpy()
        flagged, cells = part["typicality"] <= 0.01, is_unknown.astype(int)
        found = {"known_flagged": Tally(flagged, -cells)}
        found["unknown_flagged"] = Tally(flagged, cells - 1)
        if cleared:
            called_healthy = part["decided_label"].isin(cleared)
            found["unknown_called_healthy"] = Tally(called_healthy, cells - 1)
        rows[family] = (
            _auroc(part["typicality"].to_numpy(), is_unknown, part["group"])
            | GroupBootstrap().figures(found, part["group"])
            | {"known": int((~is_unknown).sum()), "unknown": int(is_unknown.sum())}
        )
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("left_out")


def _auroc(typicality: Array, is_unknown: NDArray[np.bool_], groups: ArrayLike) -> dict[str, float]:
    """Return the area under the ROC curve, and its interval by a bootstrap over groups.

    The area is the fraction of pairs in which the unknown recording is less typical than the known
    one (Mann-Whitney); equal typicalities count one half.
    """
    codes = np.unique(groups, return_inverse=True)[1]
    members = np.eye(int(codes.max()) + 1)[codes]
    own, theirs = typicality[is_unknown, np.newaxis], typicality[~is_unknown]
    # Pairs won, of the unknown recordings of a group (rows) and the known ones of another.
    won = (own < theirs) + 0.5 * (own == theirs)
    wins = members[is_unknown].T @ won @ members[~is_unknown]
    unknown, known = members[is_unknown].sum(axis=0), members[~is_unknown].sum(axis=0)
    n_pairs = unknown.sum() * known.sum()
    estimate = float(wins.sum() / n_pairs) if n_pairs else np.nan
    bootstrap = GroupBootstrap()
    times = bootstrap.times(len(wins))
    pairs = (times @ unknown) * (times @ known)
    drawn = np.sum((times @ wins) * times, axis=1) / np.where(pairs > 0, pairs, np.nan)
    n_groups = int(min(np.count_nonzero(unknown), np.count_nonzero(known)))
    return bootstrap.interval("auroc", drawn, estimate, n_groups, bounds=(0.0, 1.0))
