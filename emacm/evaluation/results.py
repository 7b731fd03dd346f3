"""The result of an evaluation: figures of merit, decisions, confusion matrices and caveats."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.evaluation.figures import (
    FIGURES,
    confusion,
    figure_row,
    label_posteriors,
    probability_columns,
    reliability_curve,
    tallies,
)
from emacm.evaluation.held_out import Decided
from emacm.evaluation.schemes import Scheme
from emacm.evaluation.scoring import ScoringRule

_WIDTH = 98  # characters of a printed line


@dataclass(frozen=True, repr=False)
class Evaluation:
    """Result of `evaluate`; printed as its caveats, followed by its figures of merit.

    Attributes
    ----------
    table : DataFrame
        One row for each hold-out scheme. Columns: each figure of merit with the lower and upper
        limit of its confidence interval (``accuracy``, ``accuracy_low``, ``accuracy_high``), then
        the numbers of "recordings" held out, "folds", "labels" and "groups", and the kind of
        group that is "resampled". NaN in the row of a scheme that cannot be scored.
    predictions : DataFrame
        One row for each scheme and recording held out: "scheme", "fold", "left_out", "recording"
        (its position in X), "group", "truth", "decision", "true_label" and "decided_label"
        (families, if there are any), "correct", "cost", and the posterior probability of each
        label, ``P(label)``, with the "predicted_cost" of the decision; with an unknown state also
        "typicality" and "unknown_proba".
    confusions : dict of str to DataFrame
        Counts for each scheme that can be scored: rows are the decision (its family, if there
        are any), columns the true class.
    calibration : DataFrame
        Reliability curve of each scheme (`emacm.evaluation.calibration.reliability`) with
        confidence intervals; empty without probabilities.
    caveats : list of str
        What limits the conclusions, most serious first.
    confidence : float
        Confidence level of the intervals.
    """

    table: pd.DataFrame
    predictions: pd.DataFrame
    confusions: dict[str, pd.DataFrame]
    calibration: pd.DataFrame
    caveats: list[str]
    confidence: float

    def summary(self) -> pd.DataFrame:
        """Return the figures of merit as text, such as "0.95 (0.90 to 0.98)"."""
        columns = {}
        for name in (name for name in FIGURES if name in self.table):
            limits = self.table[[name, f"{name}_low", f"{name}_high"]].to_numpy()
            columns[name.replace("_", " ")] = [_with_limits(*row) for row in limits]
        if columns:
            counts = zip(self.table["groups"], self.table["resampled"], strict=True)
            columns["bootstrap groups"] = [f"{number} ({name})" for number, name in counts]
        return pd.DataFrame(columns, index=self.table.index)

    def __str__(self) -> str:
        caveats = [
            fill(text, _WIDTH, initial_indent="- ", subsequent_indent="  ") for text in self.caveats
        ]
        return "\n".join([*caveats, self.summary().T.to_string(), f"({self._interval})"])

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        caveats = "".join(f"<li>{html.escape(text)}</li>" for text in self.caveats)
        return f"<ul>{caveats}</ul>{self.summary().T.to_html()}<p>{self._interval}</p>"

    @property
    def _interval(self) -> str:
        level = f"{100 * self.confidence:g} %"
        return f"in brackets: {level} confidence interval, from a bootstrap over whole groups"


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
    schemes: Sequence[Scheme], scores: Mapping[str, SchemeScore], **attributes: Any
) -> Evaluation:
    """Combine the results of the schemes.

    Parameters
    ----------
    schemes : sequence of Scheme
        All of them.
    scores : mapping of str to SchemeScore
        The result of each that can be scored, by its name.
    **attributes
        Further attributes of `Evaluation`.

    Returns
    -------
    Evaluation
    """
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
        **attributes,
    )


def _stacked(tables: list[pd.DataFrame]) -> pd.DataFrame:
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()


def _with_limits(value: float, low: float, high: float) -> str:
    if np.isnan(value):
        return "-"
    return f"{value:.3g}" + ("" if np.isnan(low) else f" ({low:.3g} to {high:.3g})")
