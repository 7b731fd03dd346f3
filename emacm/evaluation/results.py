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

from emacm.evaluation.caveats import (
    confounding_caveats,
    nuisance_caveats,
    nuisance_table,
    read_nuisances,
    scheme_caveats,
)
from emacm.evaluation.figures import (
    FIGURES,
    confusion,
    figure_row,
    label_posteriors,
    probability_columns,
    reliability_curve,
    tallies,
)
from emacm.evaluation.held_out import Decided, HeldOut, Scheme, strictest_scheme
from emacm.evaluation.scoring import ScoringRule, scoring_rule


@dataclass(frozen=True)
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
        Reliability curve of each scheme (`emacm.evaluation.figures.reliability`) with
        confidence intervals; empty without probabilities.
    caveats : list of str
        What limits the conclusions, most serious first.
    confidence : float
        Confidence level of the intervals.
    scoring : ScoringRule
        Definition of a correct decision, and costs.
    bootstrap : mapping
        Options of the bootstrap.
    held_out : HeldOut
        The decisions of each fold, for `rescored`.
    """

    table: pd.DataFrame
    predictions: pd.DataFrame
    confusions: dict[str, pd.DataFrame]
    calibration: pd.DataFrame
    caveats: list[str]
    confidence: float
    scoring: ScoringRule
    bootstrap: Mapping[str, Any]
    held_out: HeldOut

    def rescored(
        self,
        *,
        families: Any = None,
        healthy: Any = None,
        cost: Any = None,
        confidence: float = 0.95,
        n_resamples: int = 2000,
        random_state: int | None = 0,
    ) -> Evaluation:
        """Score the same decisions by other costs or families, or with other intervals.

        Parameters
        ----------
        families : mapping, optional
            {class: family} or {family: [classes]}. A decision for the right family is correct,
            whether the estimator decides on classes or on families. Default: defined by the cost,
            as in `emacm.decisions.metrics.correct_decisions`.
        healthy : object, optional
            The healthy class or family. Default: as evaluated.
        cost : array-like, DataFrame or mapping, optional
            Rows are decisions, columns true classes, as for `CostSensitiveGaussianBayes`; columns
            may be families. Default: as evaluated.
        confidence : float, default=0.95
            Confidence level of the intervals.
        n_resamples : int, default=2000
            Number of bootstrap draws, at least 100.
        random_state : int or None, default=0
            Seed of the bootstrap.

        Returns
        -------
        Evaluation

        Raises
        ------
        TypeError, ValueError
            If an argument is invalid, or classes, families and costs are inconsistent.
        """
        stated = dict(self.held_out.stated)
        given = {"families": families, "healthy": healthy, "cost": cost}
        stated |= {name: value for name, value in given.items() if value is not None}
        bootstrap = {
            "confidence": confidence,
            "n_resamples": n_resamples,
            "random_state": random_state,
        }
        return score_held_out(self.held_out._replace(stated=stated), bootstrap)

    def by_nuisance(self, X: Any, nuisances: Any) -> pd.DataFrame:
        """Score properties that should not matter, such as the day, beside the classifier.

        A nuisance predicts the label that is the most frequent in its level, relative to the
        frequency of the label, in the split by unit, or, if there is none or it cannot be scored,
        by run, or at random. The score within one level is that of the same decisions, counted
        among recordings of the level: a classifier that recognises the day only has a score of
        chance within one day.

        Parameters
        ----------
        X : sequence of Recording, or array-like of n_recordings
            The recordings that were evaluated.
        nuisances : sequence of keys or mapping
            Keys of `meta`, tuples of keys or functions, such as ``("day", "fs")``; a mapping of
            names to them or to arrays. "fs" is the sampling rate.

        Returns
        -------
        DataFrame
            One row for each nuisance and scheme: number of "levels"; balanced accuracy of
            predictions from the nuisance "alone", with its interval, its "chance", and the scheme
            in which it was "held_out"; "balanced_accuracy" of the classifier; the same "within" one
            level, with its interval: the mean over all pairs of a level with at least two labels
            and a label of the fraction recognised, its "within_chance", and the number of
            "recordings" in these levels. NaN if there are none. `attrs` has "caveats".

        Raises
        ------
        TypeError, ValueError
            If `nuisances` has another form, or a recording lacks a key.
        """
        scheme = strictest_scheme(self.held_out.schemes, self.held_out.groupings)
        labels = [self.scoring.family_of[label] for label in self.held_out.y.tolist()]
        properties = read_nuisances(nuisances, X)
        table = nuisance_table(properties, scheme, labels, self.predictions, self.bootstrap)
        table.attrs["caveats"] = nuisance_caveats(table, len(labels))
        return table

    def summary(self) -> pd.DataFrame:
        """Return the figures of merit as text, such as "0.95 (0.90 to 0.98)"."""
        texts = as_texts(self.table, [name for name in FIGURES if name in self.table])
        if len(texts.columns):
            counts = zip(self.table["groups"], self.table["resampled"], strict=True)
            texts["bootstrap groups"] = [f"{number} ({name})" for number, name in counts]
        return texts

    def __str__(self) -> str:
        caveats = [
            fill(text, 98, initial_indent="- ", subsequent_indent="  ") for text in self.caveats
        ]
        return "\n".join([*caveats, self.summary().T.to_string(), f"({self._interval})"])

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        caveats = "".join(f"<li>{html.escape(text)}</li>" for text in self.caveats)
        table = self.summary().T.to_html()
        return f"<ul>{caveats}</ul>{table}<p>{self._interval}</p>"

    @property
    def _interval(self) -> str:
        level = f"{100 * self.confidence:g} %"
        return f"in brackets: {level} confidence interval, from a bootstrap over whole groups"


def as_texts(table: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """Return figures of merit with their limits as text, such as "0.95 (0.90 to 0.98)".

    Parameters
    ----------
    table : DataFrame
        Columns ``accuracy``, ``accuracy_low``, ``accuracy_high`` and so on.
    names : sequence of str
        Figures of merit; in the result without underscores.

    Returns
    -------
    DataFrame
    """
    texts = {
        name.replace("_", " "): [
            _with_limits(*row)
            for row in table[[name, f"{name}_low", f"{name}_high"]].to_numpy(float)
        ]
        for name in names
    }
    return pd.DataFrame(texts, index=table.index)


def _with_limits(value: float, low: float, high: float) -> str:
    if np.isnan(value):
        return "-"
    return f"{value:.3g}" + ("" if np.isnan(low) else f" ({low:.3g} to {high:.3g})")


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


def score_held_out(held_out: HeldOut, bootstrap: Mapping[str, Any]) -> Evaluation:
    """Score the decisions of all schemes.

    Parameters
    ----------
    held_out : HeldOut
        Schemes that are `impossible` have a row of NaN.
    bootstrap : mapping
        Options of `emacm.evaluation.bootstrap.group_intervals`.

    Returns
    -------
    Evaluation
    """
    schemes, y = held_out.schemes, held_out.y
    rule = scoring_rule(np.unique(y), **held_out.stated)
    scores = {
        scheme.name: score_scheme(scheme, folds, y, rule, bootstrap)
        for scheme, folds in zip(schemes, held_out.decided, strict=True)
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
    predictions = _stacked([score.predictions for score in scores.values()])
    curves = [score.calibration for score in scores.values() if len(score.calibration)]
    caveats = scheme_caveats(schemes, table, rule)
    if others := rule.other_decisions(predictions.get("decision", ())):
        caveats.insert(
            0,
            f"The decisions {others} are none of the classes and have no cost; they count as wrong "
            f"with cost 1. Give their costs by rescored(cost=...).",
        )
    if (unit := held_out.groupings["units"]) is not None:
        labels = [rule.family_of[label] for label in y.tolist()]
        caveats = [*confounding_caveats(labels, unit.labels.tolist(), unit.name), *caveats]
    return Evaluation(
        table=table,
        predictions=predictions,
        confusions={name: score.confusion for name, score in scores.items()},
        calibration=_stacked(curves),
        caveats=caveats,
        confidence=bootstrap["confidence"],
        scoring=rule,
        bootstrap=bootstrap,
        held_out=held_out,
    )


def _stacked(tables: list[pd.DataFrame]) -> pd.DataFrame:
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()
