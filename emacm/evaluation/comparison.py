"""Several evaluations side by side, with paired differences."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd

from emacm.evaluation.bootstrap import cell_mean, draw_interval, gap_of_cells, group_draws
from emacm.evaluation.figures import FIGURES, tallies
from emacm.evaluation.results import Evaluation, as_texts
from emacm.evaluation.scoring import ScoringRule

_COSTS = ("expected_cost", "realised_cost", "predicted_cost")


@dataclass(frozen=True)
class Comparison:
    """Result of `compare`; printed as its caveats, followed by figures of merit and differences.

    Attributes
    ----------
    table : DataFrame
        One row for each evaluation, with the columns of `Evaluation.table`.
    differences : DataFrame
        One row for each evaluation except the reference: its figures of merit minus those of the
        reference, with the limits of their confidence intervals (``accuracy``, ``accuracy_low``,
        ``accuracy_high``). NaN where they are not paired.
    caveats : list of str
        Limits of the conclusions.
    scheme : str
        Hold-out scheme that is compared.
    reference : str
        Name of the evaluation from which the others differ.
    confidence : float
        Confidence level of the intervals.
    healthy : object
        Healthy label; None if it was not given.
    """

    table: pd.DataFrame
    differences: pd.DataFrame
    caveats: list[str]
    scheme: str
    reference: str
    confidence: float
    healthy: Any = None

    def summary(self) -> pd.DataFrame:
        """Return the figures of merit as text, such as "0.95 (0.90 to 0.98)"."""
        return as_texts(self.table, [name for name in FIGURES if name in self.table])

    def difference_summary(self) -> pd.DataFrame:
        """Return the differences from the reference as text."""
        return as_texts(self.differences, [name for name in FIGURES if name in self.differences])

    def __str__(self) -> str:
        caveats = [
            fill(text, 98, initial_indent="- ", subsequent_indent="  ") for text in self.caveats
        ]
        parts = [part for title, table in self._tables() for part in (title, table.to_string())]
        return "\n".join([*caveats, *parts, self._interval])

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        caveats = "".join(f"<li>{html.escape(text)}</li>" for text in self.caveats)
        tables = "".join(
            f"<p>{html.escape(title)}</p>{table.to_html()}" for title, table in self._tables()
        )
        return f"<ul>{caveats}</ul>{tables}<p>{self._interval}</p>"

    def _tables(self) -> list[tuple[str, pd.DataFrame]]:
        return [
            (f"{self.scheme}:", self.summary().T),
            (f"difference from {self.reference!r}:", self.difference_summary().T),
        ]

    @property
    def _interval(self) -> str:
        level = f"{100 * self.confidence:g} %"
        return f"(in brackets: {level} confidence interval, from a bootstrap over whole groups)"


def compare(
    evaluations: Mapping[str, Evaluation] | Sequence[Evaluation],
    *,
    scheme: str | None = None,
    reference: str | None = None,
) -> Comparison:
    """Compare evaluations, for example of several sensors or pipelines.

    Parameters
    ----------
    evaluations : mapping of str to Evaluation, or sequence of Evaluation
        Results of `evaluate` by name; in a sequence they are numbered from 1. At least two.
    scheme : str, optional
        Hold-out scheme to compare. Default: the second of those that all evaluations have scored
        (the first after the random split), or the only one.
    reference : str, optional
        Name of the evaluation from which the differences of the others are computed. Default: the
        first.

    Returns
    -------
    Comparison

    Raises
    ------
    TypeError, ValueError
        If there are fewer than two evaluations, one is not a result of `evaluate`, no scheme was
        scored by all of them, or `scheme` or `reference` is not among them.

    Notes
    -----
    Differences are paired: both evaluations are computed for the same bootstrap draws of whole
    groups, so that the difficulty of a run or unit cancels [1]_. This requires the same recordings
    and folds, that is, equal positions, true classes and groups, which is checked; that the
    positions denote the same recordings is assumed. Otherwise no difference is given, and a caveat
    states the reason. Two intervals that overlap may belong to a difference whose interval excludes
    0. Differences of costs need equal costs.

    References
    ----------
    .. [1] A. C. Davison and D. V. Hinkley, Bootstrap Methods and their Application, Cambridge 1997,
       section 3.8 (hierarchical data).

    Examples
    --------
    >>> from sklearn.naive_bayes import GaussianNB
    >>> from emacm import evaluate
    >>> rng = np.random.default_rng(0)
    >>> y, runs = np.tile(["new", "new", "worn"], 20), np.repeat(np.arange(12), 5)
    >>> current = rng.normal(size=(60, 1)) + 2 * (y == "worn")[:, np.newaxis]
    >>> vibration = rng.normal(size=(60, 1)) + 4 * (y == "worn")[:, np.newaxis]
    >>> sensors = {"current": current, "vibration": vibration}
    >>> found = {
    ...     name: evaluate(GaussianNB(), X, y, runs=runs, healthy="new")
    ...     for name, X in sensors.items()
    ... }
    >>> compare(found).differences[["accuracy"]].round(1)
               accuracy
    vibration       0.1
    """
    named = _named(evaluations)
    chosen = _scheme(named, scheme)
    first = next(iter(named)) if reference is None else reference
    if first not in named:
        raise ValueError(f"reference must be one of {list(named)}, got {reference!r}.")
    base = named[first]
    rows: dict[str, dict[str, float]] = {}
    caveats = []
    for name, each in named.items():
        if name == first:
            continue
        reason = _unpaired(base, each, chosen)
        if reason:
            caveats.append(f"No differences between {name!r} and {first!r}: {reason}")
            rows[name] = {}
            continue
        if costs := _unequal_costs(base.scoring, each.scoring):
            caveats.append(f"No differences of costs between {name!r} and {first!r}: {costs}")
        rows[name] = _differences(base, each, chosen, without_costs=bool(costs))
    if sum(map(bool, rows.values())) > 1:
        caveats.append(
            f"The intervals of {len(rows)} evaluations hold one at a time; among many, some "
            f"exclude 0 by chance."
        )
    table = pd.DataFrame({name: each.table.loc[chosen] for name, each in named.items()}).T
    return Comparison(
        table=table.infer_objects(),
        differences=pd.DataFrame.from_dict(rows, orient="index", columns=_columns(rows)),
        caveats=caveats,
        scheme=chosen,
        reference=first,
        confidence=base.confidence,
        healthy=base.scoring.healthy,
    )


def _named(evaluations: Any) -> dict[str, Evaluation]:
    if isinstance(evaluations, Sequence) and not isinstance(evaluations, str):
        evaluations = {str(number): each for number, each in enumerate(evaluations, 1)}
    if not isinstance(evaluations, Mapping):
        raise TypeError(
            f"evaluations must be a mapping of names to results of evaluate, or a list of them; "
            f"got {type(evaluations).__name__}."
        )
    for name, each in evaluations.items():
        if not isinstance(each, Evaluation):
            raise TypeError(
                f"evaluations must be results of evaluate, but {name!r} is a {type(each).__name__}."
            )
    if len(evaluations) < 2:
        raise ValueError(f"evaluations must be at least two, got {list(evaluations)}.")
    return {str(name): each for name, each in evaluations.items()}


def _scheme(named: Mapping[str, Evaluation], scheme: str | None) -> str:
    scored = [list(each.confusions) for each in named.values()]
    common = [name for name in scored[0] if all(name in names for names in scored)]
    if not common:
        listed = {name: list(each.confusions) for name, each in named.items()}
        raise ValueError(f"evaluations must have a scheme in common that was scored; got {listed}.")
    if scheme is not None and scheme not in common:
        raise ValueError(
            f"scheme must be one that all evaluations scored: {common}; got {scheme!r}."
        )
    return common[min(1, len(common) - 1)] if scheme is None else scheme


def _held_out(evaluation: Evaluation, scheme: str) -> pd.DataFrame:
    """Return the decisions of a scheme in an order that does not depend on that of its folds."""
    held = evaluation.predictions[evaluation.predictions["scheme"] == scheme]
    return held.sort_values(["recording", "fold"])


def _unpaired(base: Evaluation, other: Evaluation, scheme: str) -> str:
    """Return why two evaluations are not paired; empty if they are."""
    first, second = (_held_out(each, scheme) for each in (base, other))
    if len(first) != len(second):
        return f"they have {len(second)} and {len(first)} recordings held out."
    for column, what in {
        "recording": "other recordings are held out",
        "fold": "the folds differ",
        "truth": "the true classes differ",
        "group": "the groups (runs, units) differ",
    }.items():
        if first[column].tolist() != second[column].tolist():
            return f"{what}. Evaluate both on the same recordings, with the same splits."
    rules = base.scoring, other.scoring
    if rules[0].labels != rules[1].labels or rules[0].healthy != rules[1].healthy:
        return "their labels or healthy labels differ."
    return ""


def _unequal_costs(base: ScoringRule, other: ScoringRule) -> str:
    """Return why costs are not comparable; empty if they are."""
    if base.priors != other.priors:
        return "the priors of the classifiers differ."
    tables = [_known_costs(rule) for rule in (base, other)]
    return "" if tables[0].equals(tables[1]) else "their costs differ."


def _known_costs(rule: ScoringRule) -> pd.DataFrame:
    """Return the costs without the unknown state, which one of two classifiers may not have."""
    if rule.costs is None:
        return pd.DataFrame()
    decisions, truths, matrix = rule.costs
    table = pd.DataFrame(matrix, decisions, truths)
    return table.drop(index=[rule.unknown], columns=[rule.unknown], errors="ignore")


def _differences(
    base: Evaluation, other: Evaluation, scheme: str, *, without_costs: bool
) -> dict[str, float]:
    """Return the differences of two evaluations, and their intervals."""
    held = _held_out(base, scheme)
    first = tallies(held, base.scoring)
    second = tallies(_held_out(other, scheme), other.scoring)
    left_out = _COSTS if without_costs else ()
    names = [name for name in first if name in second and name not in left_out]
    groups, seed = held["group"].to_numpy(), base.bootstrap["random_state"]
    options = {"n_resamples": base.bootstrap["n_resamples"], "random_state": seed or 0}
    drawn = []
    for found in (first, second):
        values, cells, combine = zip(*(found[name] for name in names), strict=True)
        drawn.append(group_draws(values, cells, groups, combine=combine, **options))
    row: dict[str, float] = {}
    for name, ours, theirs in zip(names, *drawn, strict=True):
        estimate = cell_mean(*second[name]) - cell_mean(*first[name])
        difference = theirs - ours  # both are empty for a figure of merit without any recording
        if first[name].combine is gap_of_cells:  # resampling adds to an absolute value
            difference = difference - np.nanmean(difference) + estimate
        n_groups = len(np.unique(groups[first[name].cells >= 0]))
        low, high = draw_interval(difference, estimate, n_groups, confidence=base.confidence)
        row |= {name: estimate, f"{name}_low": low, f"{name}_high": high}
    return row


def _columns(rows: Mapping[str, Mapping[str, float]]) -> list[str]:
    """Return the columns of all rows, in the order of the figures of merit."""
    present = {name for row in rows.values() for name in row}
    every = [f"{name}{end}" for name in FIGURES for end in ("", "_low", "_high")]
    return [name for name in every if name in present]
