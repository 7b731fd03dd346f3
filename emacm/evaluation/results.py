"""The result of an evaluation: figures of merit, decisions, confusion matrices and caveats."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
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

_NOVELTY = {
    "auroc": "AUROC, unknown from known",
    "known_flagged": "known with typicality <= 0.01",
    "unknown_flagged": "unknown with typicality <= 0.01",
    "unknown_called_healthy": "unknown decided healthy",
}
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
    novelty : DataFrame
        One row for each family of faults that was left out of training, with intervals as in
        `table`: "auroc", the area under the ROC curve of typicality, by which its recordings are
        told from the known ones; fraction of the known recordings with a typicality of at most
        0.01 ("known_flagged") and of those left out ("unknown_flagged"); fraction of those left
        out that were decided to be healthy ("unknown_called_healthy"); numbers of recordings
        ("known", "unknown"). Empty if no family was left out.
    novelty_predictions : DataFrame
        One row for each family left out and recording held out: "left_out", "fold", "recording",
        "group", "true_label", "is_unknown" (of the family left out), "decision",
        "decided_label", "confidence" (the largest posterior probability of a label), "typicality"
        and "unknown_proba".
    nuisances : DataFrame
        One row for each nuisance and scheme: number of "levels"; balanced accuracy of predictions
        from the nuisance "alone", with its interval, and its "chance"; "balanced_accuracy" of the
        classifier; the same "within" one level, with its interval: the mean over all pairs of a
        level with at least two labels and a label of the fraction recognised, its
        "within_chance", and the number of "recordings" in these levels. NaN if there are none.
    scoring : ScoringRule or None
        Definition of a correct decision, and costs.
    bootstrap : mapping
        Options of the bootstrap.
    """

    table: pd.DataFrame
    predictions: pd.DataFrame
    confusions: dict[str, pd.DataFrame]
    calibration: pd.DataFrame
    caveats: list[str]
    confidence: float
    novelty: pd.DataFrame = field(default_factory=pd.DataFrame)
    novelty_predictions: pd.DataFrame = field(default_factory=pd.DataFrame)
    nuisances: pd.DataFrame = field(default_factory=pd.DataFrame)
    scoring: ScoringRule | None = None
    bootstrap: Mapping[str, Any] = field(default_factory=dict)

    def summary(self) -> pd.DataFrame:
        """Return the figures of merit as text, such as "0.95 (0.90 to 0.98)"."""
        columns = _texts(self.table, [name for name in FIGURES if name in self.table])
        if columns:
            counts = zip(self.table["groups"], self.table["resampled"], strict=True)
            columns["bootstrap groups"] = [f"{number} ({name})" for number, name in counts]
        return pd.DataFrame(columns, index=self.table.index)

    def novelty_summary(self) -> pd.DataFrame:
        """Return the rates of the families left out as text."""
        names = [name for name in _NOVELTY if name in self.novelty]
        texts = _texts(self.novelty, names).values()
        titles = [_NOVELTY[name] for name in names]
        return pd.DataFrame(dict(zip(titles, texts, strict=True)), index=self.novelty.index)

    def nuisance_summary(self) -> pd.DataFrame:
        """Return the scores by nuisance as text."""
        table = self.nuisances
        if table.empty:
            return pd.DataFrame()
        texts = _texts(table, ["alone", "within"])
        texts = {
            "nuisance alone": texts["alone"],
            "chance": [f"{value:.3g}" for value in table["chance"]],
            "classifier": [f"{value:.3g}" for value in table["balanced_accuracy"]],
            "within one level": texts["within"],
            "chance within": [_with_limits(v, np.nan, np.nan) for v in table["within_chance"]],
        }
        index = pd.MultiIndex.from_frame(table[["nuisance", "scheme"]])
        return pd.DataFrame(texts, index=index)

    def __str__(self) -> str:
        caveats = [
            fill(text, _WIDTH, initial_indent="- ", subsequent_indent="  ") for text in self.caveats
        ]
        parts = [self.summary().T.to_string()]
        for title, table in self._further():
            parts += [f"\n{title}", table.to_string()]
        return "\n".join([*caveats, *parts, f"({self._interval})"])

    def _further(self) -> list[tuple[str, pd.DataFrame]]:
        """Return the titles and texts of the tables that are not empty."""
        tables = {
            "families of faults left out of training:": self.novelty_summary().T,
            "balanced accuracy by nuisance:": self.nuisance_summary(),
        }
        return [(title, table) for title, table in tables.items() if len(table)]

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        caveats = "".join(f"<li>{html.escape(text)}</li>" for text in self.caveats)
        further = "".join(
            f"<p>{html.escape(title)}</p>{table.to_html()}" for title, table in self._further()
        )
        table = self.summary().T.to_html()
        return f"<ul>{caveats}</ul>{table}{further}<p>{self._interval}</p>"

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


def _texts(table: pd.DataFrame, names: Sequence[str]) -> dict[str, list[str]]:
    """Return figures of merit with their limits as text, such as "0.95 (0.90 to 0.98)"."""
    return {
        name.replace("_", " "): [
            _with_limits(*row)
            for row in table[[name, f"{name}_low", f"{name}_high"]].to_numpy(float)
        ]
        for name in names
    }


def _with_limits(value: float, low: float, high: float) -> str:
    if np.isnan(value):
        return "-"
    return f"{value:.3g}" + ("" if np.isnan(low) else f" ({low:.3g} to {high:.3g})")
