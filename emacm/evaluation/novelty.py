"""Families of faults left out of training: whether they are recognised as unknown."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_count
from emacm.decisions.costs import stated_cost, stated_truths
from emacm.decisions.metrics import label_of
from emacm.evaluation.bootstrap import cell_mean, draw_interval, drawn_groups, group_intervals
from emacm.evaluation.figures import label_posteriors
from emacm.evaluation.held_out import (
    Decided,
    Fold,
    Scheme,
    all_schemes,
    decide_held_out,
    read_groupings,
    strictest_scheme,
    training_groups,
)
from emacm.evaluation.results import as_texts
from emacm.evaluation.scoring import ScoringRule, checked_classes, scoring_rule

Array = NDArray[np.float64]

FLAGGED = 0.01  # recordings of at most this typicality are flagged


@dataclass(frozen=True)
class UnknownEvaluation:
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

    def __str__(self) -> str:
        names = [name for name in self.table if f"{name}_low" in self.table]
        texts = as_texts(self.table, names)
        return "\n".join([*(f"- {text}" for text in self.caveats), texts.T.to_string()])

    __repr__ = __str__


def evaluate_unknown(
    estimator: Any,
    X: Any,
    y: ArrayLike,
    *,
    runs: Any = None,
    units: Any = None,
    families: Any = None,
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
    families : mapping, optional
        {class: family} or {family: [classes]}. Default: defined by the cost of the estimator.
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
    unknown, priors = stated_truths(estimator)
    if unknown is None:
        raise ValueError(
            "estimator has no unknown state, so that it assigns any state to a known one. Set "
            "unknown= of CostSensitiveGaussianBayes."
        )
    classes = checked_classes(y, X)
    check_count(n_splits, "n_splits", at_least=2)
    stated = {"families": families, "healthy": healthy, "cost": stated_cost(estimator)}
    rule = scoring_rule(np.unique(classes), unknown=unknown, priors=priors, **stated)
    labels = [rule.family_of[label] for label in classes.tolist()]
    groupings = read_groupings(X, runs, units, None)
    divided = strictest_scheme(all_schemes(classes, labels, groupings, None, n_splits), groupings)
    schemes = [] if divided is None else left_out_families(divided, labels, rule)
    groups = training_groups(estimator, groupings)
    schemes, decided = decide_held_out(estimator, X, classes, schemes, groups=groups)
    return _score_novelty(schemes, decided, classes, rule)


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
            methods = ("fit", "predict")
            schemes.append(replace(scheme, name=str(family), folds=folds, may_refuse=methods))
    return schemes


def _score_novelty(
    schemes: Sequence[Scheme],
    decided: Sequence[Sequence[Decided]],
    y: NDArray[Any],
    rule: ScoringRule,
) -> UnknownEvaluation:
    caveats = [
        f"{scheme.name!r} could not be left out of training. {scheme.impossible}"
        for scheme in schemes
        if scheme.impossible
    ]
    parts = [
        novelty_predictions(scheme, folds, y, rule)
        for scheme, folds in zip(schemes, decided, strict=True)
        if not scheme.impossible and all(fold.typicality is not None for fold in folds)
    ]
    if not parts:
        caveats.append("No family of faults was left out as unknown.")
        return UnknownEvaluation(pd.DataFrame(), pd.DataFrame(), caveats)
    predictions = pd.concat(parts, ignore_index=True)
    bootstrap = {"confidence": 0.95, "n_resamples": 2000, "random_state": 0}
    return UnknownEvaluation(
        novelty_table(predictions, rule.cleared, bootstrap), predictions, caveats
    )


def novelty_predictions(
    scheme: Scheme, decided: Sequence[Decided], y: NDArray[Any], rule: ScoringRule
) -> pd.DataFrame:
    """Return one row for each recording held out while a family was left out.

    Parameters
    ----------
    scheme : Scheme
        One of `left_out_families`.
    decided : sequence of Decided
        Its decisions.
    y : ndarray of shape (n_recordings,)
        True classes.
    rule : ScoringRule
        Labels of the classes.

    Returns
    -------
    DataFrame
        Part of `UnknownEvaluation.predictions`.
    """
    numbers = np.concatenate([fold.test for fold in scheme.folds])
    labels = [rule.family_of[truth] for truth in y[numbers].tolist()]
    decisions = [label for fold in decided for label in fold.decisions]
    tables = [fold.posterior for fold in decided if fold.posterior is not None]
    posteriors = np.vstack([label_posteriors(table, rule) for table in tables])
    return pd.DataFrame(
        {
            "left_out": scheme.name,
            "fold": np.repeat(np.arange(len(decided)), [len(fold.test) for fold in scheme.folds]),
            "recording": numbers,
            "group": scheme.resampled.labels[numbers],
            "true_label": labels,
            "is_unknown": [str(label) == scheme.name for label in labels],
            "decision": decisions,
            "decided_label": [label_of(decision, rule.correct) for decision in decisions],
            "confidence": posteriors.max(axis=1),
            "typicality": np.concatenate([fold.typicality for fold in decided]),
            "unknown_proba": np.concatenate([fold.unknown_proba for fold in decided]),
        }
    )


def novelty_table(
    predictions: pd.DataFrame, cleared: Collection[Any], bootstrap: Mapping[str, Any]
) -> pd.DataFrame:
    """Return how well each family that was left out is recognised as unknown.

    Parameters
    ----------
    predictions : DataFrame
        From `novelty_predictions`.
    cleared : collection
        Decisions that are correct for the healthy state; empty if it was not given.
    bootstrap : mapping
        Options of `emacm.evaluation.bootstrap.group_intervals`.

    Returns
    -------
    DataFrame
        As `UnknownEvaluation.table`.
    """
    rows = []
    for family, part in predictions.groupby("left_out", sort=False):
        is_unknown = part["is_unknown"].to_numpy()
        flagged = (part["typicality"] <= FLAGGED).to_numpy(float)
        known, unknown = np.where(is_unknown, -1, 0), np.where(is_unknown, 0, -1)
        found = {"known_flagged": (flagged, known), "unknown_flagged": (flagged, unknown)}
        if cleared:
            called_healthy = part["decided_label"].isin(cleared).to_numpy(float)
            found["unknown_called_healthy"] = (called_healthy, unknown)
        groups = part["group"].to_numpy()
        row: dict[str, Any] = {"left_out": family}
        row |= _auroc_row(part["typicality"].to_numpy(), is_unknown, groups, bootstrap)
        values, cells = zip(*found.values(), strict=True)
        limits = group_intervals(values, cells, groups, **bootstrap)
        for (name, each), (low, high) in zip(found.items(), limits, strict=True):
            row |= {name: cell_mean(*each), f"{name}_low": low, f"{name}_high": high}
        row |= {"known": int((~is_unknown).sum()), "unknown": int(is_unknown.sum())}
        rows.append(row)
    return pd.DataFrame(rows).set_index("left_out") if rows else pd.DataFrame()


def _auroc_row(
    typicality: Array,
    is_unknown: NDArray[np.bool_],
    groups: NDArray[Any],
    bootstrap: Mapping[str, Any],
) -> dict[str, float]:
    """Return the area under the ROC curve, and its interval by a bootstrap over groups."""
    codes = np.unique(groups, return_inverse=True)[1]
    wins, unknown, known = pair_counts(typicality, is_unknown, codes)
    n_pairs, some = unknown.sum() * known.sum(), unknown > 0
    estimate = float(wins.sum() / n_pairs) if n_pairs else np.nan
    options = {name: bootstrap[name] for name in ("n_resamples", "random_state")}
    drawn = []
    for times in drawn_groups(len(wins), **options):
        pairs = (times @ unknown) * (times @ known)
        won = np.sum((times[:, some] @ wins[some]) * times, axis=1)
        drawn.append(won / np.where(pairs > 0, pairs, np.nan))
    n_groups = int(min(np.count_nonzero(some), np.count_nonzero(known)))
    limits = draw_interval(
        np.concatenate(drawn), estimate, n_groups, (0.0, 1.0), bootstrap["confidence"]
    )
    return dict(zip(("auroc", "auroc_low", "auroc_high"), (estimate, *limits), strict=True))


def pair_counts(
    typicality: Array, is_unknown: NDArray[np.bool_], codes: NDArray[np.intp]
) -> tuple[Array, Array, Array]:
    """Count the pairs in which the unknown recording is less typical than the known one.

    Parameters
    ----------
    typicality : ndarray of shape (n_recordings,)
        Typicality.
    is_unknown : ndarray of bool of shape (n_recordings,)
        Whether the recording is of a family that was left out.
    codes : ndarray of int of shape (n_recordings,)
        Group of each recording, from 0.

    Returns
    -------
    wins : ndarray of shape (n_groups, n_groups)
        Number of such pairs of an unknown recording of the first group and a known one of the
        second; equal typicalities count one half. The sum over the number of pairs is the area
        under the ROC curve (Mann-Whitney).
    unknown, known : ndarray of shape (n_groups,)
        Number of recordings in each group.

    Examples
    --------
    >>> wins, unknown, known = pair_counts(
    ...     np.array([0.5, 0.2, 0.2, 0.1]), np.array([False, False, True, True]), np.arange(4) % 2
    ... )
    >>> wins, unknown, known
    (array([[1. , 0.5],
           [1. , 1. ]]), array([1., 1.]), array([1., 1.]))
    """
    members = np.eye(int(codes.max()) + 1)[codes]
    own, theirs = typicality[is_unknown, np.newaxis], typicality[~is_unknown]
    won = (own < theirs) + 0.5 * (own == theirs)
    wins = members[is_unknown].T @ won @ members[~is_unknown]
    return wins, members[is_unknown].sum(axis=0), members[~is_unknown].sum(axis=0)
