"""Which recordings are held out together: at random, by run, by unit, by condition, or as told."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.model_selection import LeaveOneGroupOut, StratifiedGroupKFold, StratifiedKFold

from emacm.recordings.meta import Grouping, plain_label

Indices = NDArray[np.intp]

RANDOM = "random split"
_NAMED = 4  # groups left out that are named one by one


@dataclass(frozen=True)
class Fold:
    """Recordings to learn from, recordings held out, and what they have in common.

    Attributes
    ----------
    train, test : ndarray of int
        Numbers of the recordings.
    left_out : str
        What is left out of training, such as "run 3"; may be empty.
    """

    train: Indices
    test: Indices
    left_out: str = ""


@dataclass(frozen=True)
class Scheme:
    """One way of holding out.

    Attributes
    ----------
    name : str
        Such as "by run".
    folds : list of Fold
        Its folds.
    resampled : Grouping
        Groups that count as one observation each.
    impossible : str
        Why it cannot be scored; empty if it can.
    may_refuse : bool
        Whether a ValueError in `predict` means that the estimator refuses what is held out, as
        it may a condition that it never saw, rather than that something is wrong.
    """

    name: str
    folds: list[Fold]
    resampled: Grouping
    impossible: str = ""
    may_refuse: bool = False


def random_scheme(
    y: NDArray[Any], labels: Sequence[Any], resampled: Grouping, n_splits: int, seed: Any
) -> Scheme:
    """Hold out at random, as many of each class in every fold.

    Raises
    ------
    ValueError
        If no class has two recordings.
    """
    most = int(np.unique(y, return_counts=True)[1].max())
    if most < 2:
        raise ValueError("a class needs two recordings, one to learn from and one to hold out.")
    split = StratifiedKFold(min(n_splits, most), shuffle=True, random_state=seed)
    with warnings.catch_warnings():
        # A class of fewer recordings than folds is still in every training set, if it has two.
        warnings.filterwarnings("ignore", "The least populated class")
        folds = [Fold(train, test) for train, test in split.split(y, y)]
    return Scheme(RANDOM, folds, resampled, _absent(folds, labels))


def group_scheme(
    y: NDArray[Any], labels: Sequence[Any], grouping: Grouping, resampled: Grouping, **options: Any
) -> Scheme:
    """Hold out whole groups: one at a time, or several where there are more than `n_splits`.

    Parameters
    ----------
    y : ndarray of shape (n_recordings,)
        Classes, to be spread evenly over the folds.
    labels : sequence of n_recordings
        What is scored: the classes or their families. None may be absent from training.
    grouping : Grouping
        The groups.
    resampled : Grouping
        Groups that count as one observation each.
    **options
        `n_splits`, at most how many folds (None: one for each group), and `seed`.

    Returns
    -------
    Scheme
        With `impossible` set if there is one group only, or if some label is in one group only.
    """
    n_groups, n_splits = len(np.unique(grouping.labels)), options["n_splits"]
    name = f"by {grouping.name}"
    if n_groups < 2:
        only = grouping.labels[0]
        said = f"There is one {grouping.name} only, {plain_label(only)!r}, and none to hold out."
        return Scheme(name, [], resampled, said)
    leave_one = _group_folds(LeaveOneGroupOut(), y, grouping)
    folds = leave_one
    if n_splits is not None and n_groups > n_splits:
        cv = StratifiedGroupKFold(n_splits, shuffle=True, random_state=options["seed"])
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "The least populated class")
            folds = _group_folds(cv, y, grouping)
        # One at a time, no label of two groups can be left out of training altogether.
        if _absent(folds, labels):
            folds = leave_one
    return Scheme(name, folds, resampled, _absent(folds, labels))


def given_scheme(
    name: str, split: Any, y: NDArray[Any], groups: Any, labels: Sequence[Any], resampled: Grouping
) -> Scheme:
    """Hold out as the user says.

    Parameters
    ----------
    name : str
        Name of the scheme.
    split : tuple (train, test), iterable of such, or object with ``split(X, y, groups)``
        Numbers of recordings, or masks.
    y : ndarray of shape (n_recordings,)
        Classes.
    groups : ndarray of shape (n_recordings,) or None
        For the object.
    labels : sequence of n_recordings
        What is scored.
    resampled : Grouping
        Groups that count as one observation each.

    Returns
    -------
    Scheme

    Raises
    ------
    TypeError, ValueError
        If something else is given, a fold is empty, numbers no recording or has one on both
        sides.
    """
    if hasattr(split, "split"):
        pairs = list(split.split(np.zeros((len(y), 1)), y, groups))
    elif isinstance(split, tuple):
        pairs = [split]
    elif isinstance(split, Iterable) and not isinstance(split, str | Mapping | np.ndarray):
        pairs = list(split)
    else:
        raise TypeError(
            f"splits[{name!r}] must be a tuple (train, test), a list of such, or an object with "
            f"a method split, as of sklearn.model_selection; got {split!r}."
        )
    folds = [
        _checked_fold(pair, len(y), f"splits[{name!r}], fold {i}") for i, pair in enumerate(pairs)
    ]
    if not folds:
        raise ValueError(f"splits[{name!r}] has no fold; it needs one at the least.")
    return Scheme(name, folds, resampled, _absent(folds, labels))


def _group_folds(cv: Any, y: NDArray[Any], grouping: Grouping) -> list[Fold]:
    folds = []
    for train, test in cv.split(y, y, grouping.labels):
        names = [str(plain_label(label)) for label in np.unique(grouping.labels[test])]
        more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
        folds.append(Fold(train, test, f"{grouping.name} {', '.join(names[:_NAMED])}{more}"))
    return folds


def _absent(folds: Sequence[Fold], labels: Sequence[Any]) -> str:
    """Say which label would have to be decided on by a classifier that never saw it."""
    known = np.asarray(pd.factorize(np.fromiter(labels, object, len(labels)))[0])
    names = dict(zip(known.tolist(), labels, strict=True))
    found = []
    for number, fold in enumerate(folds):
        absent = np.setdiff1d(known[fold.test], known[fold.train])
        if len(absent):
            what = fold.left_out or f"fold {number}"
            found.append(f"without {what}, training has no {names[int(absent[0])]!r}")
    if not found:
        return ""
    return f"In {len(found)} of {len(folds)} folds a label is absent from training: {found[0]}."


def _checked_fold(pair: Any, n_recordings: int, where: str) -> Fold:
    if not (isinstance(pair, tuple | list) and len(pair) == 2):
        raise TypeError(f"{where} must be a pair (train, test), got {type(pair).__name__}.")
    sides: list[Indices] = []
    for side, values in zip(("train", "test"), pair, strict=True):
        numbers = np.asarray(values)
        if numbers.dtype == bool and numbers.shape == (n_recordings,):
            numbers = np.flatnonzero(numbers)
        if numbers.ndim != 1 or not numbers.size or numbers.dtype.kind not in "iu":
            raise ValueError(
                f"{where}: {side} must hold the numbers of at least one recording, or a mask of "
                f"length {n_recordings}; got {numbers.dtype} of shape {numbers.shape}."
            )
        if numbers.min() < 0 or numbers.max() >= n_recordings:
            raise ValueError(
                f"{where}: {side} must number recordings 0 to {n_recordings - 1}, got "
                f"{numbers.min()} to {numbers.max()}."
            )
        sides.append(numbers.astype(np.intp))
    train, test = sides
    both = np.intersect1d(train, test)
    if len(both):
        raise ValueError(f"{where} has recording {both[0]} in train and in test.")
    return Fold(train, test)
