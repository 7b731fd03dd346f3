"""Properties that should not matter, such as the day: whether they predict the label."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.evaluation.bootstrap import GroupBootstrap, Tally
from emacm.evaluation.held_out import Scheme
from emacm.recordings.meta import read_meta

Array = NDArray[np.float64]
Codes = NDArray[np.intp]


def read_nuisances(nuisances: Any, X: Any) -> dict[str, Codes]:
    """Return the levels of each nuisance.

    Parameters
    ----------
    nuisances : sequence of keys, mapping of str to keys or arrays
        Each is a key of `meta` ("day"), a tuple of keys, or a function of the recording; in a
        mapping also an array with one value for each recording.
    X : sequence of Recording, or table
        The recordings.

    Returns
    -------
    dict of str to ndarray of int of shape (n_recordings,)
        Number of the level of each recording. Numbers and dates of more than ten values are
        divided into ten levels of equally many recordings.

    Raises
    ------
    TypeError, ValueError
        If `nuisances` has another form, or as `emacm.recordings.meta.read_meta`.

    Examples
    --------
    >>> read_nuisances({"day": ["mo", "mo", "tu"]}, [0, 0, 0])
    {'day': array([0, 0, 1])}
    """
    if isinstance(nuisances, str) or not isinstance(nuisances, Mapping | Sequence):
        raise TypeError(
            f"nuisances must be a tuple of keys of meta, as ('day', 'bench'), or a mapping "
            f"of names to keys or arrays; got {nuisances!r}."
        )
    if not isinstance(nuisances, Mapping):
        nuisances = {_name(key): key for key in nuisances}
    return {
        str(name): _levels(read_meta(X, key, role="nuisances", arrays=True))
        for name, key in nuisances.items()
    }


def _name(key: Any) -> str:
    if callable(key):
        return str(getattr(key, "__name__", key))
    return ", ".join(map(str, key)) if isinstance(key, tuple) else str(key)


def _levels(values: list[Any]) -> Codes:
    numbers = pd.Series(values)
    is_ordered = pd.api.types.is_numeric_dtype(numbers) and not pd.api.types.is_bool_dtype(numbers)
    is_ordered |= pd.api.types.is_datetime64_any_dtype(numbers)
    if is_ordered and numbers.nunique() > 10:
        edges = numbers.quantile(np.arange(1, 10) / 10).unique()
        return np.searchsorted(edges, numbers).astype(np.intp)
    return pd.factorize(np.fromiter(values, object, len(values)))[0].astype(np.intp)


def predict_by_level(levels: Codes, labels: Codes, scheme: Scheme) -> tuple[Array, Codes]:
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
    nuisances: Mapping[str, Codes],
    scheme: Scheme | None,
    labels: Codes,
    predictions: pd.DataFrame,
    bootstrap: GroupBootstrap,
) -> pd.DataFrame:
    """Return how well each nuisance predicts the label, and the score within its levels.

    Parameters
    ----------
    nuisances : mapping of str to ndarray of int
        From `read_nuisances`.
    scheme : Scheme or None
        Folds by which a nuisance alone is scored; None if there are none.
    labels : ndarray of int of shape (n_recordings,)
        Numbers of the labels that are scored.
    predictions : DataFrame
        `Evaluation.predictions`.
    bootstrap : GroupBootstrap
        Confidence level, number of draws and seed.

    Returns
    -------
    DataFrame
        As `Evaluation.by_nuisance`.
    """
    rows = []
    for name, levels in nuisances.items():
        row = {"nuisance": name, "levels": len(np.unique(levels)), "chance": 1 / len(set(labels))}
        row |= {"held_out": "", "alone": np.nan, "alone_low": np.nan, "alone_high": np.nan}
        if scheme is not None:
            correct, held = predict_by_level(levels, labels, scheme)
            alone = {"alone": Tally(correct, labels[held])}
            row |= bootstrap.figures(alone, scheme.resampled.labels[held])
            row["held_out"] = scheme.name
        for each, part in predictions.groupby("scheme", sort=False) if len(predictions) else ():
            rows.append(row | {"scheme": each} | _within(levels, labels, part, bootstrap))
    return pd.DataFrame(rows)


def _within(
    levels: Codes, labels: Codes, held: pd.DataFrame, bootstrap: GroupBootstrap
) -> dict[str, Any]:
    """Return the balanced accuracy among recordings of one level, averaged over levels."""
    rows = held["recording"].to_numpy()
    levels, labels = levels[rows], labels[rows]
    n_labels = pd.Series(labels).groupby(levels).transform("nunique").to_numpy()
    cells = np.where(n_labels > 1, levels * (labels.max() + 1) + labels, -1)
    within = {"within": Tally(held["correct"], cells, _mean_of_present_cells)}
    # In each level, the fractions recognised of all labels add up to 1 for any guess.
    mixed = n_labels > 1
    chance = len(np.unique(levels[mixed])) / len(np.unique(cells[mixed])) if mixed.any() else np.nan
    return (
        {"balanced_accuracy": Tally(held["correct"], labels).figure()}
        | bootstrap.figures(within, held["group"])
        | {"within_chance": chance, "recordings": int(mixed.sum())}
    )


def _mean_of_present_cells(sums: Array, counts: Array) -> Array:
    """Return the mean of the cells that are not empty, as draws miss some; NaN if all are."""
    present = counts > 0
    means = np.where(present, sums / np.where(present, counts, 1), 0.0)
    n_present = present.sum(axis=-1)
    return means.sum(axis=-1) / np.where(n_present > 0, n_present, np.nan)
