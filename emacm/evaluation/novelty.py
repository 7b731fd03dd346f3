"""Families of faults left out of training: whether they are recognised as unknown."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.decisions.metrics import label_of
from emacm.evaluation.bootstrap import cell_mean, draw_interval, drawn_groups, group_intervals
from emacm.evaluation.figures import label_posteriors
from emacm.evaluation.held_out import Decided
from emacm.evaluation.schemes import Fold, Scheme
from emacm.evaluation.scoring import ScoringRule

Array = NDArray[np.float64]

FLAGGED = 0.01  # recordings of at most this typicality are flagged
_ROWS = 256  # unknown recordings that are compared with all known ones at a time


class Novelty(NamedTuple):
    """Families that were left out of training.

    Attributes
    ----------
    table, predictions : DataFrame
        `novelty` and `novelty_predictions` of an `Evaluation`.
    refused : dict of str to str
        Reason why a family could not be left out.
    """

    table: pd.DataFrame
    predictions: pd.DataFrame
    refused: dict[str, str]


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


def score_novelty(
    schemes: Sequence[Scheme],
    decided: Sequence[Sequence[Decided]],
    y: NDArray[Any],
    rule: ScoringRule,
    bootstrap: Mapping[str, Any],
) -> Novelty:
    """Score how well families that were left out are recognised as unknown.

    Parameters
    ----------
    schemes : sequence of Scheme
        From `left_out_families`, after `emacm.evaluation.held_out.decide_held_out`.
    decided : sequence of sequence of Decided
        Their decisions.
    y : ndarray of shape (n_recordings,)
        True classes.
    rule : ScoringRule
        Labels of the classes.
    bootstrap : mapping
        Options of `emacm.evaluation.bootstrap.group_intervals`.

    Returns
    -------
    Novelty
    """
    refused = {scheme.name: scheme.impossible for scheme in schemes if scheme.impossible}
    parts = [
        novelty_predictions(scheme, folds, y, rule)
        for scheme, folds in zip(schemes, decided, strict=True)
        if not scheme.impossible and all(fold.typicality is not None for fold in folds)
    ]
    predictions = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()
    table = novelty_table(predictions, rule.cleared, bootstrap) if parts else pd.DataFrame()
    return Novelty(table, predictions, refused)


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
        Part of `Evaluation.novelty_predictions`.
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
        As `Evaluation.novelty`.
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
    n_groups = int(codes.max()) + 1
    wins, rows = np.zeros((n_groups, n_groups)), np.flatnonzero(is_unknown)
    others = np.flatnonzero(~is_unknown)
    others = others[np.argsort(codes[others], kind="stable")]
    present, starts = np.unique(codes[others], return_index=True)
    for block in np.array_split(rows, -(-len(rows) // _ROWS)) if len(rows) and len(others) else ():
        mine, theirs = typicality[block, np.newaxis], typicality[others]
        won = np.add.reduceat((mine < theirs) + 0.5 * (mine == theirs), starts, axis=1)
        np.add.at(wins, (codes[block, np.newaxis], present), won)
    parts = (is_unknown, ~is_unknown)
    counts = (np.bincount(codes[part], minlength=n_groups) for part in parts)
    unknown, known = (count.astype(np.float64) for count in counts)
    return wins, unknown, known
