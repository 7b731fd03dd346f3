"""The result of an evaluation: figures of merit, decisions, confusion matrices and caveats."""

from __future__ import annotations

import html
from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd

from emacm.evaluation import figures
from emacm.evaluation.bootstrap import GroupBootstrap
from emacm.evaluation.caveats import confounding_caveats, scheme_caveats
from emacm.evaluation.held_out import HeldOut
from emacm.evaluation.scoring import ScoringRule

_INTERVALS = "in brackets: 95 % confidence interval, from a bootstrap over whole groups"


class Printed:
    """A result that is printed as its caveats, followed by its tables."""

    caveats: list[str]

    def printed_tables(self) -> dict[str, pd.DataFrame]:
        """Return tables of text by their titles."""
        raise NotImplementedError

    def __str__(self) -> str:
        lines = [
            fill(text, 98, initial_indent="- ", subsequent_indent="  ") for text in self.caveats
        ]
        for title, table in self.printed_tables().items():
            lines += [title] * bool(title) + [table.to_string()]
        return "\n".join([*lines, f"({_INTERVALS})"])

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        caveats = "".join(f"<li>{html.escape(text)}</li>" for text in self.caveats)
        tables = "".join(
            f"<p>{html.escape(title)}</p>{table.to_html()}"
            for title, table in self.printed_tables().items()
        )
        return f"<ul>{caveats}</ul>{tables}<p>{_INTERVALS}</p>"


def as_texts(table: pd.DataFrame) -> pd.DataFrame:
    """Return figures of merit with their limits as text, such as "0.95 (0.90 to 0.98)".

    Parameters
    ----------
    table : DataFrame
        Columns ``accuracy``, ``accuracy_low``, ``accuracy_high`` and so on; others are left out.

    Returns
    -------
    DataFrame
        The names of its columns have no underscores.
    """
    texts = {
        name.replace("_", " "): [
            _with_limits(*row)
            for row in table[[name, f"{name}_low", f"{name}_high"]].to_numpy(float)
        ]
        for name in table
        if f"{name}_low" in table
    }
    return pd.DataFrame(texts, index=table.index)


def _with_limits(value: float, low: float, high: float) -> str:
    if np.isnan(value):
        return "-"
    return f"{value:.3g}" + ("" if np.isnan(low) else f" ({low:.3g} to {high:.3g})")


@dataclass(frozen=True, repr=False)
class Evaluation(Printed):
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
    constant_costs : DataFrame
        Mean cost of the same decision for every recording (`ScoringRule.constant_costs`): a
        classifier that costs more is worse than none.
    calibration : DataFrame
        Reliability curve of each scheme (`emacm.evaluation.figures.reliability`) with
        confidence intervals; empty without probabilities.
    caveats : list of str
        What limits the conclusions, most serious first.
    scoring : ScoringRule
        Definition of a correct decision, and costs.
    """

    table: pd.DataFrame
    predictions: pd.DataFrame
    confusions: dict[str, pd.DataFrame]
    constant_costs: pd.DataFrame
    calibration: pd.DataFrame
    caveats: list[str]
    scoring: ScoringRule

    def summary(self) -> pd.DataFrame:
        """Return the figures of merit as text, such as "0.95 (0.90 to 0.98)"."""
        texts = as_texts(self.table)
        if len(texts.columns):
            counts = zip(self.table["groups"], self.table["resampled"], strict=True)
            texts["bootstrap groups"] = [f"{number} ({name})" for number, name in counts]
        return texts

    def printed_tables(self) -> dict[str, pd.DataFrame]:
        """Return the figures of merit, one column for each scheme, and the constant decisions."""
        constant = self.constant_costs.map("{:.3g}".format)
        constant.columns = [name.replace("_", " ") for name in constant]
        return {"": self.summary().T, "The same decision for every recording:": constant}


def score_held_out(held_out: HeldOut, rule: ScoringRule) -> Evaluation:
    """Score the decisions of all schemes.

    Parameters
    ----------
    held_out : HeldOut
        Schemes that are `impossible` have a row of NaN.
    rule : ScoringRule
        Definition of a correct decision, and costs.

    Returns
    -------
    Evaluation
    """
    predictions, bootstrap = judged_decisions(held_out, rule), GroupBootstrap()
    rows: dict[str, dict[str, Any]] = {}
    confusions, curves = {}, []
    for name, part in predictions.groupby("scheme", sort=False) if len(predictions) else ():
        groups, truths = part["group"].to_numpy(), part["true_label"]
        rows[name] = dict(bootstrap.figures(figures.tallies(part, rule), groups))
        rows[name] |= {"recordings": len(part), "folds": part["fold"].nunique()}
        rows[name] |= {"labels": truths.nunique(), "groups": part["group"].nunique()}
        confusions[name] = figures.confusion(part, rule)
        if "predicted_cost" in part:
            posteriors = part[figures.probability_columns(rule)].to_numpy(float)
            curve = figures.reliability(posteriors, figures.codes_of(truths, rule.labels), groups)
            curves.append(curve.assign(scheme=name)[["scheme", *curve.columns]])
    schemes = held_out.schemes
    names = pd.Index([scheme.name for scheme in schemes], name="scheme")
    table = pd.DataFrame([rows.get(name, {}) for name in names], names)
    if rows:
        counts = ["recordings", "folds", "labels", "groups"]
        table[counts] = table[counts].fillna(0).astype(int)
        table["resampled"] = [scheme.resampled.name for scheme in schemes]
    return Evaluation(
        table=table,
        predictions=predictions,
        confusions=confusions,
        constant_costs=rule.constant_costs(held_out.y.tolist()),
        calibration=pd.concat(curves, ignore_index=True) if curves else pd.DataFrame(),
        caveats=_caveats(held_out, table, predictions, rule),
        scoring=rule,
    )


def judged_decisions(held_out: HeldOut, rule: ScoringRule) -> pd.DataFrame:
    """Return one row for each recording held out, with its label, cost and probabilities."""
    table = held_out.decisions
    if table.empty:
        return table
    truths, decisions = held_out.y[table["recording"]].tolist(), table["decision"].tolist()
    certainty = [name for name in ("typicality", "unknown_proba") if name in table]
    parts = [table.drop(columns=["decision", *certainty]), rule.judge(truths, decisions)]
    posteriors = held_out.posteriors
    if len(posteriors.columns):
        costs = rule.predicted_costs(decisions, posteriors, table.get("unknown_proba"))
        parts.append(figures.label_posteriors(posteriors, rule).assign(predicted_cost=costs))
    return pd.concat([*parts, table[certainty]], axis=1)


def _caveats(
    held_out: HeldOut, table: pd.DataFrame, predictions: pd.DataFrame, rule: ScoringRule
) -> list[str]:
    caveats = []
    if (unit := held_out.groupings["units"]) is not None:
        labels = [rule.family_of[label] for label in held_out.y.tolist()]
        caveats += confounding_caveats(labels, unit.labels.tolist(), unit.name)
    if others := rule.other_decisions(predictions.get("decision", ())):
        caveats.append(
            f"The decisions {others} are none of the classes and have no cost; they count as wrong "
            f"with cost 1. Put the estimator into a LeastRiskClassifier with their costs."
        )
    return caveats + scheme_caveats(held_out.schemes, table, rule)
