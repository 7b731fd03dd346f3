"""The score of each hold-out scheme, and all of them as one result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.evaluation.figures import (
    confusion,
    figure_row,
    label_posteriors,
    probability_columns,
    reliability_curve,
    tallies,
)
from emacm.evaluation.held_out import Decided
from emacm.evaluation.results import Evaluation
from emacm.evaluation.schemes import Scheme
from emacm.evaluation.scoring import ScoringRule


@dataclass(frozen=True)
class SchemeScore:
    """Result of one scheme.

    Attributes
    ----------
    row : dict
        Its row of `Evaluation.table`.
    predictions, confusion, calibration : DataFrame
        Its part of `Evaluation`.
    """

    row: dict[str, Any]
    predictions: pd.DataFrame
    confusion: pd.DataFrame
    calibration: pd.DataFrame


def score_scheme(
    scheme: Scheme,
    decided: Sequence[Decided],
    y: NDArray[Any],
    rule: ScoringRule,
    bootstrap: Mapping[str, Any],
) -> SchemeScore:
    """Score the decisions of one scheme.

    Parameters
    ----------
    scheme : Scheme
        One that can be scored.
    decided : sequence of Decided
        One for each fold, from `emacm.evaluation.held_out.decide_held_out`.
    y : ndarray of shape (n_recordings,)
        True classes.
    rule : ScoringRule
        Definition of a correct decision, and costs.
    bootstrap : mapping
        Options of `emacm.evaluation.bootstrap.group_intervals`.

    Returns
    -------
    SchemeScore

    Raises
    ------
    ValueError
        If a decision is unknown or has no cost, or probabilities do not add up to 1.
    """
    predictions, posteriors = _predictions(scheme, decided, y, rule)
    groups, truths = predictions["group"].to_numpy(), predictions["true_label"]
    row: dict[str, Any] = dict(figure_row(tallies(predictions, rule), groups, **bootstrap))
    row |= {"recordings": len(predictions), "folds": len(scheme.folds)}
    row |= {"labels": truths.nunique(), "groups": len(np.unique(groups))}
    row |= {"resampled": scheme.resampled.name}
    curve = pd.DataFrame()
    if posteriors is not None:
        curve = reliability_curve(posteriors, truths, rule.labels, groups, **bootstrap)
        curve.insert(0, "scheme", scheme.name)
    return SchemeScore(row, predictions, confusion(predictions, rule), curve)


def _predictions(
    scheme: Scheme, decided: Sequence[Decided], y: NDArray[Any], rule: ScoringRule
) -> tuple[pd.DataFrame, NDArray[np.float64] | None]:
    """Return one row for each recording held out, and the probabilities of its labels."""
    numbers = np.concatenate([fold.test for fold in scheme.folds])
    sizes = [len(fold.test) for fold in scheme.folds]
    decisions = [label for fold in decided for label in fold.decisions]
    places = {
        "scheme": scheme.name,
        "fold": np.repeat(np.arange(len(sizes)), sizes),
        "left_out": np.repeat([fold.left_out for fold in scheme.folds], sizes),
        "recording": numbers,
        "group": scheme.resampled.labels[numbers],
    }
    judged = rule.judge(y[numbers].tolist(), decisions)
    predictions = pd.concat([pd.DataFrame(places), judged], axis=1)
    tables = [fold.posterior for fold in decided if fold.posterior is not None]
    if not tables:
        return predictions, None
    posteriors = np.vstack([label_posteriors(table, rule) for table in tables])
    predictions[probability_columns(rule)] = posteriors
    predictions["predicted_cost"] = np.concatenate(
        [
            rule.predicted_costs(fold.decisions, fold.posterior, fold.unknown_proba)
            for fold in decided
            if fold.posterior is not None
        ]
    )
    for name in ("typicality", "unknown_proba"):
        parts = [getattr(fold, name) for fold in decided]
        if all(part is not None for part in parts):
            predictions[name] = np.concatenate(parts)
    return predictions, posteriors


def gather(
    schemes: Sequence[Scheme],
    decided: Sequence[Sequence[Decided]],
    y: NDArray[Any],
    rule: ScoringRule,
    bootstrap: Mapping[str, Any],
) -> Evaluation:
    """Score the schemes, and combine their results.

    Parameters
    ----------
    schemes : sequence of Scheme
        All of them; those that are `impossible` have a row of NaN.
    decided : sequence of sequence of Decided
        Decisions of each scheme.
    y, rule, bootstrap
        As for `score_scheme`.

    Returns
    -------
    Evaluation
        Without caveats.
    """
    scores = {
        scheme.name: score_scheme(scheme, folds, y, rule, bootstrap)
        for scheme, folds in zip(schemes, decided, strict=True)
        if not scheme.impossible
    }
    columns = max((list(score.row) for score in scores.values()), key=len, default=[])
    rows = [
        scores[scheme.name].row if scheme.name in scores else {"resampled": scheme.resampled.name}
        for scheme in schemes
    ]
    names = pd.Index([scheme.name for scheme in schemes], name="scheme")
    table = pd.DataFrame(rows, names, columns)
    for count in ("recordings", "folds", "labels", "groups"):
        if count in table:
            table[count] = table[count].fillna(0).astype(int)
    curves = [score.calibration for score in scores.values() if len(score.calibration)]
    return Evaluation(
        table=table,
        predictions=_stacked([score.predictions for score in scores.values()]),
        confusions={name: score.confusion for name, score in scores.items()},
        calibration=_stacked(curves),
        caveats=[],
        confidence=bootstrap["confidence"],
        scoring=rule,
        bootstrap=bootstrap,
    )


def _stacked(tables: list[pd.DataFrame]) -> pd.DataFrame:
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()
