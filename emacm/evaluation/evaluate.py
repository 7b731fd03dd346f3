"""Hold-out schemes compared: performance on the next run, the next unit, a new condition.

A random split estimates the performance on recordings with near copies in the training data. To
estimate performance on the next run, the next machine or a new load, hold out whole runs, machines
or loads. `evaluate` scores all of these schemes and lists the limits of the conclusions.
"""

from __future__ import annotations

import html
from collections.abc import Mapping
from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from emacm._statements import warn
from emacm.decisions.pipelines import check_unknown_states, stated_costs
from emacm.evaluation import figures
from emacm.evaluation.bootstrap import GroupBootstrap
from emacm.evaluation.caveats import confounding_caveats, scheme_caveats, single_unit_labels
from emacm.evaluation.held_out import HeldOut, all_schemes, decide_held_out, read_groupings
from emacm.evaluation.scoring import ScoringRule, checked_classes, scoring_rule

_INTERVALS = "in brackets: 95 % confidence interval, from a bootstrap over whole groups"


class Printed:
    """A result that is printed as its caveats, followed by its tables."""

    caveats: list[str]

    def printed_tables(self) -> dict[str, pd.DataFrame]:
        """Return tables of text by their titles."""
        raise NotImplementedError

    def __repr__(self) -> str:
        lines = [fill(x, 98, initial_indent="- ", subsequent_indent="  ") for x in self.caveats]
        for title, table in self.printed_tables().items():
            lines += [title] * bool(title) + [table.to_string()]
        return "\n".join([*lines, f"({_INTERVALS})"])

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


def evaluate(
    estimator: Any,
    X: Any,
    y: ArrayLike,
    *,
    runs: Any = None,
    units: Any = None,
    conditions: Any = None,
    splits: Mapping[str, Any] | None = None,
    healthy: Any = None,
    n_splits: int = 10,
) -> Evaluation:
    """Evaluate a classifier by several hold-out schemes: at random, by run, unit and condition.

    In each fold a clone is fitted to the training recordings and decides on the recordings held
    out. Confidence intervals are from a bootstrap over whole runs or units, because recordings of
    one run are near copies of one another.

    Parameters
    ----------
    estimator : estimator
        Classifier or pipeline; it is not changed.
    X : sequence of Recording, or array-like of n_recordings
        Input of the estimator.
    y : array-like of shape (n_recordings,)
        True classes.
    runs : key, tuple of keys, callable or array-like of shape (n_recordings,), optional
        Run of each recording: a key of `meta` (a column, if X is a DataFrame), a tuple of keys,
        a function of the recording, or an array. Recordings of one run are held out together, and
        passed as `groups` to a classifier with an unknown state (without runs: units).
    units : key, tuple of keys, callable or array-like of shape (n_recordings,), optional
        Machine or assembly of each recording; passed as `groups` to a classifier that learns how
        units differ, such as `NewUnitClassifier` (without units: runs).
    conditions : key, tuple of keys, callable or array-like of shape (n_recordings,), optional
        Operating condition, such as load; one is left out at a time. The scheme is not scored if
        the estimator refuses conditions without training data.
    splits : mapping of str to split, optional
        Further schemes by name: a tuple (train, test) of positions or masks, as for "later
        runs"; a list of such tuples; or an object with ``split(X, y, groups)``.
    healthy : object, optional
        The healthy class, or the family of a cost. Without it the three rates are not computed.
    n_splits : int, default=10
        Largest number of folds, at least 2. Up to this number of runs (or units), one is left out
        at a time.

    Returns
    -------
    Evaluation
        Balanced accuracy (mean over the labels of the fraction recognised) and accuracy. With
        `healthy`: false alarm rate (fraction of the healthy recordings decided to be faulty),
        inspection rate (fraction of them with a decision that is not a label, such as "inspect"
        or "unknown") and missed detection rate (fraction of the faulty recordings decided to be
        healthy, or any other that is correct for the healthy state). Mean cost of a decision on
        these recordings (``expected_cost``), in the unit of the cost. With `predict_proba`: mean
        cost that was paid (``realised_cost``) and mean cost that the probabilities predict for
        the same decisions (``predicted_cost``), where the true classes have the classifier's
        `priors` as weights; log loss [nats] and expected calibration error (0 to 1): the mean over
        the recordings of the difference of confidence and frequency in ten bins of equal width of
        the highest posterior [1]_.

    Warns
    -----
    EmacmWarning
        If a label occurs in one unit only.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid; or an error of the estimator, with the fold.

    See Also
    --------
    evaluate_unknown : Families of faults that are left out of training.

    Notes
    -----
    The cost is the one among the estimator's parameters (several that differ are an error);
    without any, 0-1. Decisions on families of states follow from a cost of `family_costs`. Folds
    are processed in parallel within ``joblib.parallel_config(n_jobs=4)`` (default: processes).

    If a label is held out without being in the training data, the scheme cannot be scored; its row
    is NaN and a caveat gives the group and the label. The bootstrap
    (`emacm.evaluation.bootstrap.GroupBootstrap`) draws runs, or units if no `runs` are given and
    for the split by unit; without either it draws recordings, and a caveat says so. The intervals
    cover the variation of the recordings held out, not that of the training data.

    A classifier whose priors differ from the class frequencies of these recordings is, correctly,
    not calibrated on them. The calibration error of few recordings is too large, because chance
    differences add up; its interval describes its variation only.

    Whether a property that should not matter, such as the day, predicts the label, is shown by a
    classifier of this property alone (see the last example); and how good a classifier is within
    one day, by its `predictions` of each day.

    References
    ----------
    .. [1] M. P. Naeini, G. F. Cooper and M. Hauskrecht, Obtaining well calibrated probabilities
       using Bayesian binning, AAAI 2015.

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn.neighbors import KNeighborsClassifier
    >>> rng = np.random.default_rng(2)
    >>> X = np.repeat(rng.normal(size=(10, 2)), 9, axis=0)  # 10 runs of 9 copies
    >>> y = np.repeat(["healthy", "worn"] * 5, 9)  # unrelated to X
    >>> runs = pd.Series(np.repeat(np.arange(10), 9), name="run")
    >>> result = evaluate(KNeighborsClassifier(1), X, y, runs=runs, healthy="healthy")
    >>> result.table["accuracy"].to_dict()
    {'random split': 1.0, 'by run': 0.5}

    Healthy runs were all measured on one day, worn ones on another:

    >>> from sklearn.naive_bayes import MultinomialNB
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn.preprocessing import OneHotEncoder
    >>> day = np.repeat([["monday"], ["tuesday"]] * 5, 9, axis=0)
    >>> of_day = OneHotEncoder(handle_unknown="ignore"), MultinomialNB(fit_prior=False)
    >>> evaluate(make_pipeline(*of_day), day, y, runs=runs).table["accuracy"].to_dict()
    {'random split': 1.0, 'by run': 1.0}
    """
    if not hasattr(estimator, "predict"):
        raise TypeError(f"estimator must be a classifier with predict, got {estimator!r}.")
    check_unknown_states(estimator)
    classes = checked_classes(y, X)
    rule = scoring_rule(np.unique(classes), healthy=healthy, **stated_costs(estimator))
    labels = [rule.family_of[label] for label in classes.tolist()]
    groupings = read_groupings(X, runs, units, conditions)
    schemes = all_schemes(classes, labels, groupings, splits, n_splits)
    held_out = decide_held_out(estimator, X, classes, schemes, groupings)
    result = score_held_out(held_out, rule)
    by_unit = groupings["units"]
    if by_unit is not None and single_unit_labels(labels, by_unit.labels.tolist()):
        warn("single units", result.caveats[0], stacklevel=2)
    return result


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
    decisions = dict.fromkeys(predictions.get("decision", ()))
    if others := [name for name in decisions if name not in rule.costs.index]:
        caveats.append(
            f"The decisions {others} are none of the classes and have no cost; they count as wrong "
            f"with cost 1. Put the estimator into a LeastRiskClassifier with their costs."
        )
    return caveats + scheme_caveats(held_out.schemes, table, rule)
