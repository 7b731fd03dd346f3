"""The result of an evaluation: figures, decisions, confusions and what to mind."""

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
    reliability_curve,
    tallies,
)
from emacm.evaluation.schemes import Scheme
from emacm.evaluation.scoring import ScoringRule

_WIDTH = 98  # letters of a line


@dataclass(frozen=True, repr=False)
class Evaluation:
    """What `evaluate` found; it prints what to mind, and then the figures.

    Attributes
    ----------
    table : DataFrame
        A row for each way of holding out. Columns: each figure, its lower and upper limit
        (``accuracy``, ``accuracy_low``, ``accuracy_high``), then the numbers of "recordings"
        held out, "folds", "labels" told apart, "groups" resampled, and what is "resampled".
        NaN in the row of a scheme that cannot be scored.
    predictions : DataFrame
        A row for each scheme and recording held out: "scheme", "fold", "left_out", "recording",
        "group", "truth", "decision", "true_label" and "decided_label" (families, if there are
        any), "right", "cost", and the posterior of each label, ``P(label)``.
    confusions : dict of str to DataFrame
        For each scheme that can be scored, counts: rows are what was decided (its family, if
        there are any), columns the true classes.
    calibration : DataFrame
        Reliability curve of each scheme (`emacm.evaluation.calibration.reliability`), with
        limits; empty without probabilities.
    caveats : list of str
        What must be known before a figure is believed, the gravest first.
    """

    table: pd.DataFrame
    predictions: pd.DataFrame
    confusions: dict[str, pd.DataFrame]
    calibration: pd.DataFrame
    caveats: list[str]

    def summary(self) -> pd.DataFrame:
        """Return the figures as text, "0.95 (0.90 to 0.98)", for reading."""
        columns = {}
        for name in (name for name in FIGURES if name in self.table):
            parts = self.table[[name, f"{name}_low", f"{name}_high"]].to_numpy()
            columns[name.replace("_", " ")] = [_with_limits(*part) for part in parts]
        counts = zip(self.table["groups"], self.table["resampled"], strict=True)
        columns["groups"] = [f"{number} ({name})" for number, name in counts]
        return pd.DataFrame(columns, index=self.table.index)

    def __str__(self) -> str:
        caveats = [
            fill(text, _WIDTH, initial_indent="- ", subsequent_indent="  ") for text in self.caveats
        ]
        summary = self.summary().T.to_string()
        return "\n".join([*caveats, summary])

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        caveats = "".join(f"<li>{html.escape(text)}</li>" for text in self.caveats)
        return f"<ul>{caveats}</ul>{self.summary().T.to_html()}"


@dataclass(frozen=True)
class SchemeScore:
    """What is known of one scheme.

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


def scored(
    scheme: Scheme,
    decided: Sequence[tuple[list[Any], pd.DataFrame | None]],
    y: NDArray[Any],
    rule: ScoringRule,
    limits: Mapping[str, Any],
) -> SchemeScore:
    """Score one scheme.

    Parameters
    ----------
    scheme : Scheme
        One that is possible.
    decided : sequence of (decisions, probabilities)
        Of each fold, as `emacm.evaluation.held_out_decisions.decide_held_out` returns them.
    y : ndarray of shape (n_recordings,)
        True classes.
    rule : ScoringRule
        What is right, and what it costs.
    limits : mapping
        "confidence", "n_resamples" and "random_state" of the limits.

    Returns
    -------
    SchemeScore

    Raises
    ------
    ValueError
        If a decision cannot be judged, or probabilities are none.
    """
    numbers = np.concatenate([fold.test for fold in scheme.folds])
    sizes = [len(fold.test) for fold in scheme.folds]
    decisions = [decision for fold, _ in decided for decision in fold]
    judged = rule.judge(y[numbers].tolist(), decisions)
    groups = scheme.resampled.labels[numbers]
    posteriors = _posteriors([stated for _, stated in decided], rule)
    truths, labels = judged["true_label"], rule.labels
    row: dict[str, Any] = dict(
        figure_row(tallies(judged, rule.healthy, posteriors, labels), groups, **limits)
    )
    row |= {"recordings": len(numbers), "folds": len(sizes), "labels": truths.nunique()}
    row |= {"groups": len(np.unique(groups)), "resampled": scheme.resampled.name}
    curve = pd.DataFrame()
    if posteriors is not None:
        curve = reliability_curve(posteriors, truths, labels, groups, **limits)
        curve.insert(0, "scheme", scheme.name)
        stated = pd.DataFrame(posteriors, columns=[f"P({label})" for label in labels])
        judged = pd.concat([judged, stated], axis=1)
    places = {
        "scheme": scheme.name,
        "fold": np.repeat(np.arange(len(sizes)), sizes),
        "left_out": np.repeat([fold.left_out for fold in scheme.folds], sizes),
        "recording": numbers,
        "group": groups,
    }
    predictions = pd.concat([pd.DataFrame(places), judged], axis=1)
    return SchemeScore(row, predictions, confusion(judged, rule), curve)


def gathered(
    schemes: Sequence[Scheme], scores: Sequence[SchemeScore | None], caveats: list[str]
) -> Evaluation:
    """Put the schemes side by side.

    Parameters
    ----------
    schemes : sequence of Scheme
        All of them.
    scores : sequence of SchemeScore or None
        None for those that cannot be scored.
    caveats : list of str
        What to mind.

    Returns
    -------
    Evaluation
    """
    done = [score for score in scores if score is not None]
    names = pd.Index([scheme.name for scheme in schemes], name="scheme")
    columns = max((list(score.row) for score in done), key=len, default=[])
    table = pd.DataFrame([{} if s is None else s.row for s in scores], names, columns)
    for scheme in schemes:
        if scheme.impossible and columns:
            table.loc[scheme.name, "resampled"] = scheme.resampled.name
    for count in ("recordings", "folds", "labels", "groups"):
        if count in table:
            table[count] = table[count].fillna(0).astype(int)
    return Evaluation(
        table=table,
        predictions=_stacked([score.predictions for score in done]),
        confusions={
            scheme.name: score.confusion
            for scheme, score in zip(schemes, scores, strict=True)
            if score is not None
        },
        calibration=_stacked([score.calibration for score in done if len(score.calibration)]),
        caveats=caveats,
    )


def _posteriors(
    stated: Sequence[pd.DataFrame | None], rule: ScoringRule
) -> NDArray[np.float64] | None:
    found = [label_posteriors(table, rule) for table in stated if table is not None]
    return np.vstack(found) if found and len(found) == len(stated) else None


def _stacked(tables: list[pd.DataFrame]) -> pd.DataFrame:
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()


def _with_limits(value: float, low: float, high: float) -> str:
    if np.isnan(value):
        return "-"
    return f"{value:.3g}" + ("" if np.isnan(low) else f" ({low:.3g} to {high:.3g})")
