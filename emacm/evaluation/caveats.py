"""Caveats of an evaluation: what limits the conclusions that its figures of merit allow."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.evaluation.bootstrap import cell_mean, group_intervals
from emacm.evaluation.held_out import RANDOM, Scheme
from emacm.evaluation.scoring import ScoringRule
from emacm.recordings.meta import listed_recordings, read_meta

# Condition on a row of the table (and the balanced accuracy of the random split), and text.
_CAVEATS = (
    (
        lambda row, random: random > row["balanced_accuracy_high"],
        "The random split is optimistic: its balanced accuracy is above the confidence interval of "
        "{}. Rely on the split that holds out what will be new in service.",
    ),
    (
        lambda row, _: (
            row.get("realised_cost_low", np.nan) > row.get("predicted_cost_high", np.nan)
        ),
        "The realised cost of {} is above the cost that the posterior probabilities predict: they "
        'are over-confident. See temperature="groups".',
    ),
    (
        lambda row, _: row["resampled"] == "recording",
        "Confidence intervals of {} are from a bootstrap over single recordings, because no runs= "
        "or units= were given; they are too narrow if recordings of one run are alike.",
    ),
    (
        lambda row, _: row["resampled"] != "recording" and row["groups"] < 10,
        "Confidence intervals from fewer than 10 groups are approximate: {}.",
    ),
    (
        lambda row, _: row["accuracy"] in (0, 1),
        "All decisions are correct, or all are wrong, in {}. Zero-width intervals: all resamples "
        "agree; this does not prove certainty.",
    ),
    (
        lambda row, _: row["groups"] > 1 and np.isnan(row["balanced_accuracy_low"]),
        "Balanced accuracy has no confidence interval in {}: some label occurs in so few groups "
        "that most resamples miss it.",
    ),
)


def single_unit_labels(labels: Sequence[Any], units: Sequence[Any]) -> dict[Any, Any]:
    """Return the labels that were recorded on one unit only.

    Parameters
    ----------
    labels : sequence of n_recordings
        Label (state of health) of each recording.
    units : sequence of n_recordings
        Unit (machine, assembly) of each recording.

    Returns
    -------
    dict
        {label: its only unit}.

    Examples
    --------
    >>> single_unit_labels(["new", "new", "worn", "worn"], ["A", "B", "C", "C"])
    {'worn': 'C'}
    """
    pairs = pd.DataFrame({"label": list(labels), "unit": list(units)}).drop_duplicates()
    alone = pairs[~pairs["label"].duplicated(keep=False)]
    return dict(zip(alone["label"], alone["unit"], strict=True))


def confounding_caveats(labels: Sequence[Any], units: Sequence[Any], unit: str) -> list[str]:
    """Describe how labels are confounded with units.

    Parameters
    ----------
    labels, units : sequence of n_recordings
        As in `single_unit_labels`.
    unit : str
        Name of the property "unit", for the text.

    Returns
    -------
    list of str
        Most serious first; empty if each label occurs in several units, and some unit has several
        labels.

    Examples
    --------
    >>> confounding_caveats(["new", "worn"] * 2, ["A", "A", "B", "B"], "unit")
    []
    """
    caveats = []
    if alone := single_unit_labels(labels, units):
        which = _examples([f"{label!r} only in {owner!r}" for label, owner in alone.items()])
        caveats.append(
            f"Label and {unit} are confounded: {which}. What distinguishes such a label may be "
            f"the {unit} itself; no split of these recordings can separate the two."
        )
    single = single_unit_labels(units, labels)
    if len(single) == len(set(units)):
        which = _examples([f"{owner!r} only {label!r}" for owner, label in single.items()])
        caveats.append(
            f"Each {unit} has one label: {which}. With the same {unit} in training and test, a "
            f"classifier may recognise the {unit}; only the split by {unit} excludes this."
        )
    return caveats


def scheme_caveats(
    schemes: Sequence[Scheme],
    table: pd.DataFrame,
    rule: ScoringRule,
) -> list[str]:
    """Return the caveats of the schemes, most serious first.

    Parameters
    ----------
    schemes : sequence of Scheme
        All of them.
    table : DataFrame
        `Evaluation.table`.
    rule : ScoringRule
        Definition of a correct decision.

    Returns
    -------
    list of str
    """
    caveats = [f"'{s.name}' cannot be scored. {s.impossible}" for s in schemes if s.impossible]
    if all(scheme.name == RANDOM for scheme in schemes):
        caveats.append(
            "Only a random split was made. It estimates the performance on recordings with near "
            "copies in the training data, not on the next run or unit. Give runs= or units=."
        )
    rows = {s.name: table.loc[s.name] for s in schemes if not s.impossible}
    random = rows[RANDOM]["balanced_accuracy"] if RANDOM in rows else -np.inf
    for applies, text in _CAVEATS:
        if names := [name for name, row in rows.items() if applies(row, random)]:
            caveats.append(text.format(", ".join(map(repr, names))))
    if rule.has_families:
        caveats.append("Scored by families: " + ", ".join(map(repr, rule.labels)) + ".")
    return caveats


def _examples(parts: list[str]) -> str:
    more = len(parts) - 3
    return ", ".join(parts[:3]) + (f" and {more} more" if more > 0 else "")


Array = NDArray[np.float64]


@dataclass(frozen=True)
class Nuisance:
    """Levels of a property that should not matter.

    Attributes
    ----------
    name : str
        For example "day".
    levels : ndarray of int of shape (n_recordings,)
        Number of the level of each recording.
    """

    name: str
    levels: NDArray[np.intp]


def read_nuisances(nuisances: Any, X: Any) -> list[Nuisance]:
    """Return the levels of each nuisance.

    Parameters
    ----------
    nuisances : sequence of keys, mapping of str to keys or arrays
        Each is a key of `meta` ("day"), a tuple of keys, or a function of the recording; in a
        mapping also an array with one value for each recording. "fs" is the sampling rate of the
        recording if its `meta` has no such key.
    X : sequence of Recording, or table
        The recordings.

    Returns
    -------
    list of Nuisance
        Numbers and dates of more than ten values are divided into ten levels of equally many
        recordings.

    Raises
    ------
    TypeError, ValueError
        If `nuisances` has another form, or as `emacm.recordings.meta.read_meta`.

    Examples
    --------
    >>> [day] = read_nuisances({"day": ["mo", "mo", "tu"]}, [0, 0, 0])
    >>> day.levels
    array([0, 0, 1])
    """
    given: Mapping[Any, Any] | Sequence[Any] = nuisances
    if isinstance(given, str) or not isinstance(given, Mapping | Sequence):
        raise TypeError(
            f"nuisances must be a tuple of keys of meta, as ('day', 'fs'), or a mapping of names "
            f"to keys or arrays; got {nuisances!r}."
        )
    if not isinstance(given, Mapping):
        given = {_name(key): key for key in given}
        if len(given) < len(nuisances):
            raise ValueError(f"nuisances must name each property once, got {nuisances!r}.")
    return [Nuisance(str(name), _levels(_values(key, X))) for name, key in given.items()]


def _name(key: Any) -> str:
    if not isinstance(key, Hashable):
        raise TypeError(
            f"nuisances must be keys of meta, tuples of keys or functions; got {key!r}. Give "
            f"arrays with their names, as {{'day': {key!r}}}."
        )
    if callable(key):
        return str(getattr(key, "__name__", key))
    return ", ".join(map(str, key)) if isinstance(key, tuple) else str(key)


def _values(key: Any, X: Any) -> list[Any]:
    if isinstance(key, str) and key == "fs" and not isinstance(X, pd.DataFrame | np.ndarray):
        entries = listed_recordings(X)
        if all(
            "fs" not in getattr(entry, "meta", ()) and hasattr(entry, "fs") for entry in entries
        ):
            return read_meta(entries, _sampling_rates, role="nuisances")
    return read_meta(X, key, role="nuisances", arrays=True)


def _sampling_rates(recording: Any) -> Any:
    """Return the sampling rate, or those of the channels if they differ [Hz]."""
    rates = recording.fs
    distinct = set(rates.values()) if isinstance(rates, Mapping) else {rates}
    return distinct.pop() if len(distinct) == 1 else tuple(sorted(rates.items()))


def _levels(values: list[Any]) -> NDArray[np.intp]:
    numbers = pd.Series(values)
    is_ordered = pd.api.types.is_numeric_dtype(numbers) and not pd.api.types.is_bool_dtype(numbers)
    is_ordered |= pd.api.types.is_datetime64_any_dtype(numbers)
    if is_ordered and numbers.nunique() > 10:
        edges = numbers.quantile(np.arange(1, 10) / 10).unique()
        return np.searchsorted(edges, numbers).astype(np.intp)
    return pd.factorize(np.fromiter(values, object, len(values)))[0].astype(np.intp)


def predict_by_level(
    levels: NDArray[np.intp], labels: NDArray[np.intp], scheme: Scheme
) -> tuple[Array, NDArray[np.intp]]:
    """Predict labels from the level alone: the label most frequent in it, relative to its total.

    Parameters
    ----------
    levels, labels : ndarray of int of shape (n_recordings,)
        Level and label of each recording, as numbers from 0.
    scheme : Scheme
        Its folds divide the recordings into training and test.

    Returns
    -------
    correct : ndarray of shape (n_held_out,)
        Probability of a correct prediction: 1 or 0, or one over the number of labels that are
        equally frequent, which are all of them where a level does not occur in training.
    rows : ndarray of int of shape (n_held_out,)
        Positions of the recordings held out.
    """
    shape = int(levels.max()) + 1, int(labels.max()) + 1
    correct = []
    for fold in scheme.folds:
        counts = np.zeros(shape)
        np.add.at(counts, (levels[fold.train], labels[fold.train]), 1)
        totals = counts.sum(axis=0)
        shares = np.where(totals > 0, counts / np.where(totals > 0, totals, 1), -1.0)
        best = shares >= shares.max(axis=1, keepdims=True) * (1 - 1e-12)
        is_best = best[levels[fold.test], labels[fold.test]]
        correct.append(is_best / best.sum(axis=1)[levels[fold.test]])
    return np.concatenate(correct), np.concatenate([fold.test for fold in scheme.folds])


def nuisance_table(
    nuisances: Sequence[Nuisance],
    scheme: Scheme | None,
    labels: Sequence[Any],
    predictions: pd.DataFrame,
    bootstrap: Mapping[str, Any],
) -> pd.DataFrame:
    """Return how well each nuisance predicts the label, and the score within its levels.

    Parameters
    ----------
    nuisances : sequence of Nuisance
        From `read_nuisances`.
    scheme : Scheme or None
        Folds by which a nuisance alone is scored; None if there are none.
    labels : sequence of n_recordings
        Labels that are scored.
    predictions : DataFrame
        `Evaluation.predictions`.
    bootstrap : mapping
        Options of `emacm.evaluation.bootstrap.group_intervals`.

    Returns
    -------
    DataFrame
        As `Evaluation.by_nuisance`.
    """
    codes = pd.factorize(np.fromiter(labels, object, len(labels)))[0].astype(np.intp)
    rows = []
    for nuisance in nuisances:
        alone = {"nuisance": nuisance.name, "levels": len(np.unique(nuisance.levels))}
        alone |= _alone(nuisance, scheme, codes, bootstrap)
        parts = predictions.groupby("scheme", sort=False) if len(predictions) else []
        rows += [
            alone | {"scheme": name} | _within(nuisance, codes, part, bootstrap)
            for name, part in parts
        ]
    return pd.DataFrame(rows)


def _alone(
    nuisance: Nuisance, scheme: Scheme | None, codes: NDArray[np.intp], bootstrap: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the balanced accuracy of predictions from the level alone."""
    further = {"chance": 1 / (int(codes.max()) + 1), "held_out": scheme.name if scheme else ""}
    if scheme is None:
        return dict.fromkeys(("alone", "alone_low", "alone_high"), np.nan) | further
    correct, rows = predict_by_level(nuisance.levels, codes, scheme)
    groups = scheme.resampled.labels[rows]
    ((low, high),) = group_intervals([correct], [codes[rows]], groups, **bootstrap)
    value = cell_mean(correct, codes[rows])
    return {"alone": value, "alone_low": low, "alone_high": high} | further


def _within(
    nuisance: Nuisance, codes: NDArray[np.intp], held: pd.DataFrame, bootstrap: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the balanced accuracy among recordings of one level, averaged over levels."""
    rows = held["recording"].to_numpy()
    correct, levels, labels = held["correct"].to_numpy(float), nuisance.levels[rows], codes[rows]
    pairs = pd.DataFrame({"level": levels, "label": labels})
    mixed = pairs.groupby("level")["label"].transform("nunique").to_numpy() > 1
    cells = np.where(mixed, levels * (int(codes.max()) + 1) + labels, -1)
    score = {"balanced_accuracy": cell_mean(correct, labels)}
    names = ("within", "within_low", "within_high", "within_chance")
    if not mixed.any():
        return score | dict.fromkeys(names, np.nan) | {"recordings": 0}
    combine = [_mean_of_present_cells]
    ((low, high),) = group_intervals(
        [correct], [cells], held["group"].to_numpy(), combine=combine, **bootstrap
    )
    # In each level, the fractions recognised of all labels add up to 1 for any guess.
    n_levels, n_cells = len(np.unique(levels[mixed])), len(np.unique(cells[mixed]))
    values = cell_mean(correct, cells), low, high, n_levels / n_cells
    return score | dict(zip(names, values, strict=True)) | {"recordings": int(mixed.sum())}


def _mean_of_present_cells(sums: Array, counts: Array) -> Array:
    """Return the mean of the cells that are not empty, as draws miss some; NaN if all are."""
    present = counts > 0
    means = np.where(present, sums / np.where(present, counts, 1), 0.0)
    n_present = present.sum(axis=-1)
    return means.sum(axis=-1) / np.where(n_present > 0, n_present, np.nan)


def nuisance_caveats(table: pd.DataFrame, n_recordings: int) -> list[str]:
    """Return a caveat for each nuisance that predicts the label, or has one label in each level.

    Parameters
    ----------
    table : DataFrame
        From `nuisance_table`.
    n_recordings : int
        Number of all recordings.

    Returns
    -------
    list of str
        Those with one label in each level first.
    """
    separate, predictive = [], []
    for name, part in table.groupby("nuisance", sort=False) if len(table) else ():
        row = part.iloc[-1]
        limits = "" if np.isnan(row["alone_low"]) else " ({alone_low:.2f} to {alone_high:.2f})"
        text = (
            "{nuisance!r} alone predicts the label with a balanced accuracy of {alone:.2f}"
            + limits
            + " in {held_out!r}, where chance is {chance:.2f}. "
        ).format(**row)
        least = row["alone"] if np.isnan(row["alone_low"]) else row["alone_low"]
        if not part["recordings"].any():
            separate.append(
                text + f"No level of {name!r} has two labels, so the score within one level cannot "
                f"be computed: what distinguishes the labels may be {name!r} instead of the state "
                f"of health."
            )
        elif least > row["chance"]:
            within = ", ".join(_within_text(each) for _, each in part.iterrows())
            predictive.append(
                text + f"Within one level, the balanced accuracy of the classifier is {within}, "
                f"from at most {part['recordings'].max()} of {n_recordings} recordings."
            )
    return separate + predictive


def _within_text(row: pd.Series) -> str:
    limits = "" if np.isnan(row["within_low"]) else "{within_low:.2f} to {within_high:.2f}; "
    text = "{within:.2f} (" + limits + "chance {within_chance:.2f}) in {scheme!r}"
    return text.format(**row) if row["recordings"] else "not known in {scheme!r}".format(**row)
