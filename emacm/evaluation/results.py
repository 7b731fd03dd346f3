"""The result of an evaluation: figures of merit, decisions, confusion matrices and caveats."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd

from emacm.evaluation.figures import FIGURES
from emacm.evaluation.scoring import ScoringRule

_NOVELTY = {
    "auroc": "AUROC, unknown from known",
    "known_flagged": "known with typicality <= 0.01",
    "unknown_flagged": "unknown with typicality <= 0.01",
    "unknown_called_healthy": "unknown decided healthy",
}
WIDTH = 98  # characters of a printed line


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
        Reliability curve of each scheme (`emacm.evaluation.calibration.reliability`) with
        confidence intervals; empty without probabilities.
    caveats : list of str
        What limits the conclusions, most serious first.
    confidence : float
        Confidence level of the intervals.
    scoring : ScoringRule
        Definition of a correct decision, and costs.
    bootstrap : mapping
        Options of the bootstrap.
    novelty : DataFrame
        One row for each family of faults that was left out of training, with intervals as in
        `table`: "auroc", the area under the ROC curve of typicality, which separates its recordings
        from the known ones; fraction of the known recordings with a typicality of at most 0.01
        ("known_flagged") and of those left out ("unknown_flagged"); fraction of those left out that
        were decided to be healthy ("unknown_called_healthy"); numbers of recordings ("known",
        "unknown"). Empty if no family was left out.
    novelty_predictions : DataFrame
        One row for each family left out and recording held out: "left_out", "fold", "recording",
        "group", "true_label", "is_unknown" (of the family left out), "decision",
        "decided_label", "confidence" (the largest posterior probability of a label), "typicality"
        and "unknown_proba".
    nuisances : DataFrame
        One row for each nuisance and scheme: number of "levels"; balanced accuracy of predictions
        from the nuisance "alone", with its interval, its "chance", and the scheme in which it was
        "held_out"; "balanced_accuracy" of the classifier; the same "within" one level, with its
        interval: the mean over all pairs of a level with at least two labels and a label of the
        fraction recognised, its "within_chance", and the number of "recordings" in these levels.
        NaN if there are none.
    """

    table: pd.DataFrame
    predictions: pd.DataFrame
    confusions: dict[str, pd.DataFrame]
    calibration: pd.DataFrame
    caveats: list[str]
    confidence: float
    scoring: ScoringRule
    bootstrap: Mapping[str, Any]
    novelty: pd.DataFrame = field(default_factory=pd.DataFrame)
    novelty_predictions: pd.DataFrame = field(default_factory=pd.DataFrame)
    nuisances: pd.DataFrame = field(default_factory=pd.DataFrame)

    def summary(self) -> pd.DataFrame:
        """Return the figures of merit as text, such as "0.95 (0.90 to 0.98)"."""
        texts = as_texts(self.table, [name for name in FIGURES if name in self.table])
        if len(texts.columns):
            counts = zip(self.table["groups"], self.table["resampled"], strict=True)
            texts["bootstrap groups"] = [f"{number} ({name})" for number, name in counts]
        return texts

    def novelty_summary(self) -> pd.DataFrame:
        """Return the rates of the families left out as text."""
        names = [name for name in _NOVELTY if name in self.novelty]
        texts = as_texts(self.novelty, names)
        return texts.set_axis([_NOVELTY[name] for name in names], axis="columns")

    def nuisance_summary(self) -> pd.DataFrame:
        """Return the scores by nuisance as text."""
        table = self.nuisances
        if table.empty:
            return pd.DataFrame()
        texts = as_texts(table, ["alone", "within"])
        columns = {
            "nuisance alone": texts["alone"],
            "chance": [f"{value:.3g}" for value in table["chance"]],
            "classifier": [f"{value:.3g}" for value in table["balanced_accuracy"]],
            "within one level": texts["within"],
            "chance within": [_with_limits(v, np.nan, np.nan) for v in table["within_chance"]],
        }
        index = pd.MultiIndex.from_frame(table[["nuisance", "scheme"]])
        return pd.DataFrame({name: list(column) for name, column in columns.items()}, index=index)

    def __str__(self) -> str:
        caveats = [
            fill(text, WIDTH, initial_indent="- ", subsequent_indent="  ") for text in self.caveats
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
