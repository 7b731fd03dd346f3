"""Several evaluations side by side, with paired differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from emacm.evaluation.bootstrap import GroupBootstrap, gap_of_cells
from emacm.evaluation.evaluate import Evaluation, Printed, as_texts
from emacm.evaluation.figures import tallies
from emacm.evaluation.scoring import ScoringRule


@dataclass(frozen=True, repr=False)
class Comparison(Printed):
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
    """

    table: pd.DataFrame
    differences: pd.DataFrame
    caveats: list[str]
    scheme: str
    reference: str

    def summary(self) -> pd.DataFrame:
        """Return the figures of merit as text, such as "0.95 (0.90 to 0.98)"."""
        return as_texts(self.table)

    def printed_tables(self) -> dict[str, pd.DataFrame]:
        """Return the figures of merit and the differences, one column for each evaluation."""
        return {
            f"{self.scheme}:": self.summary().T,
            f"difference from {self.reference!r}:": as_texts(self.differences).T,
        }


def compare(
    evaluations: Mapping[str, Evaluation] | Sequence[Evaluation], *, scheme: str | None = None
) -> Comparison:
    """Compare evaluations, for example of several sensors or pipelines.

    Parameters
    ----------
    evaluations : mapping of str to Evaluation, or sequence of Evaluation
        Results of `evaluate` by name; in a sequence they are numbered from 1. At least two; the
        others are compared with the first.
    scheme : str, optional
        Hold-out scheme to compare. Default: the second of those that all evaluations have scored
        (the first after the random split), or the only one.

    Returns
    -------
    Comparison

    Raises
    ------
    TypeError, ValueError
        If there are fewer than two evaluations, one is not a result of `evaluate`, no scheme was
        scored by all of them, or `scheme` is not among them.

    See Also
    --------
    emacm.evaluate : One model.

    Notes
    -----
    Differences are paired: both evaluations are computed for the same bootstrap draws of whole
    groups, so that the difficulty of a run or unit cancels [1]_. This requires the same recordings
    and folds, that is, equal positions, true classes and groups, which is checked; that the
    positions denote the same recordings is assumed. Otherwise no difference is given, and a caveat
    states the reason. Two intervals that overlap may belong to a difference whose interval excludes
    0. Each interval holds by itself: among many evaluations, some exclude 0 by chance. Differences
    of costs need equal costs and priors.

    References
    ----------
    .. [1] A. C. Davison and D. V. Hinkley, Bootstrap Methods and their Application, Cambridge 1997,
       section 3.8 (hierarchical data).

    Examples
    --------
    >>> from sklearn.naive_bayes import GaussianNB
    >>> import numpy as np
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
    named = _by_name(evaluations)
    compared = _common_scheme(named, scheme)
    first = next(iter(named))
    base, caveats = named[first], []
    rows: dict[str, dict[str, float]] = {name: {} for name in named if name != first}
    for name in rows:
        if reason := _unpaired(base, named[name], compared):
            caveats.append(f"No differences between {name!r} and {first!r}: {reason}")
            continue
        rows[name] = _differences(base, named[name], compared)
        if _have_unequal_costs(base.scoring, named[name].scoring):
            caveats.append(
                f"No differences of costs between {name!r} and {first!r}: their costs, or the "
                f"priors of the classifiers, differ."
            )
            rows[name] = {key: value for key, value in rows[name].items() if "_cost" not in key}
    table = pd.DataFrame([each.table.loc[compared] for each in named.values()], [*named])
    differences = pd.DataFrame([*rows.values()], index=[*rows])
    differences = differences[[name for name in base.table if name in differences]]
    return Comparison(table.infer_objects(), differences, caveats, compared, first)


def _by_name(evaluations: Any) -> dict[str, Evaluation]:
    if isinstance(evaluations, Sequence):
        evaluations = {str(number): each for number, each in enumerate(evaluations, 1)}
    listed = evaluations.values() if isinstance(evaluations, Mapping) else [None]
    if not all(isinstance(each, Evaluation) for each in listed):
        raise TypeError(
            f"evaluations must be a mapping of names to results of evaluate, or a list of them; "
            f"got {type(evaluations).__name__} of {[type(each).__name__ for each in listed]}."
        )
    if len(evaluations) < 2:
        raise ValueError(f"evaluations must be at least two, got {list(evaluations)}.")
    return {str(name): each for name, each in evaluations.items()}


def _common_scheme(named: Mapping[str, Evaluation], scheme: str | None) -> str:
    scored = {name: list(each.confusions) for name, each in named.items()}
    first, *others = scored.values()
    common = [name for name in first if all(name in names for names in others)]
    if not common:
        raise ValueError(f"evaluations must have a scheme in common that was scored; got {scored}.")
    if scheme is not None and scheme not in common:
        raise ValueError(f"scheme must be one of all evaluations, {common}; got {scheme!r}.")
    return common[min(1, len(common) - 1)] if scheme is None else scheme


def _held_out(evaluation: Evaluation, scheme: str) -> pd.DataFrame:
    """Return the decisions of a scheme in an order that does not depend on that of its folds."""
    held = evaluation.predictions[evaluation.predictions["scheme"] == scheme]
    return held.sort_values(["recording", "fold"])


def _unpaired(base: Evaluation, other: Evaluation, scheme: str) -> str:
    """Return why two evaluations are not paired; empty if they are."""
    first, second = (_held_out(each, scheme) for each in (base, other))
    columns = {"recording": "recordings", "fold": "folds", "truth": "classes", "group": "groups"}
    differing = [what for c, what in columns.items() if [*first[c]] != [*second[c]]]
    if differing:
        return f"their {', '.join(differing)} differ. Use the same recordings and splits."
    labels = [(each.scoring.labels, each.scoring.healthy) for each in (base, other)]
    return "" if labels[0] == labels[1] else "their labels or healthy labels differ."


def _have_unequal_costs(base: ScoringRule, other: ScoringRule) -> bool:
    """Return whether costs, or the priors that weight them, differ."""
    # One of two classifiers may have no unknown state.
    costs, others = (
        rule.costs.drop(index=[rule.unknown], columns=[rule.unknown], errors="ignore")
        for rule in (base, other)
    )
    return base.priors != other.priors or not costs.equals(others)


def _differences(base: Evaluation, other: Evaluation, scheme: str) -> dict[str, float]:
    """Return the differences of two evaluations, and their intervals."""
    held, bootstrap = _held_out(base, scheme), GroupBootstrap()
    first = tallies(held, base.scoring)
    second = tallies(_held_out(other, scheme), other.scoring)
    drawn = [bootstrap.draws(found, held["group"]) for found in (first, second)]
    row: dict[str, float] = {}
    for name in (name for name in first if name in second):
        row |= bootstrap.interval(
            name,
            drawn[1][name] - drawn[0][name],
            second[name].figure() - first[name].figure(),
            first[name].n_groups(held["group"]),
            is_gap=first[name].combine is gap_of_cells,
        )
    return row
