"""Properties of a recording that should not matter, such as the day: how well they predict labels.

If all faulty units were recorded on another day than the healthy ones, a classifier may recognise
the day. Two questions are answered for each such property (nuisance): how well it predicts the
label by itself, and what remains of the score among recordings of one level (one day).
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.evaluation.bootstrap import cell_mean, group_intervals
from emacm.evaluation.schemes import Scheme
from emacm.recordings.meta import listed_recordings, read_meta

Array = NDArray[np.float64]

_MOST_LEVELS = 10  # numbers and dates with more distinct values are divided at their quantiles
_EQUAL = 1e-12  # relative frequencies that differ by less are equal


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
    nuisances : sequence of keys, mapping of str to keys or arrays, or None
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
    if nuisances is None:
        return []
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
    if is_ordered and numbers.nunique() > _MOST_LEVELS:
        edges = numbers.quantile(np.arange(1, _MOST_LEVELS) / _MOST_LEVELS).unique()
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
        best = shares >= shares.max(axis=1, keepdims=True) * (1 - _EQUAL)
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
        As `Evaluation.nuisances`.
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
