"""Hold-out schemes: random, by run, by unit, by condition, user-defined."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.model_selection import LeaveOneGroupOut, StratifiedGroupKFold, StratifiedKFold

from emacm.recordings.meta import Grouping, plain_label

Indices = NDArray[np.intp]

RANDOM = "random split"
_LISTED = 4  # groups of a fold whose names are listed


@dataclass(frozen=True)
class Fold:
    """Recordings for training and recordings held out.

    Attributes
    ----------
    train, test : ndarray of int
        Positions of the recordings.
    left_out : str
        What is left out of training, such as "run 3"; may be empty.
    """

    train: Indices
    test: Indices
    left_out: str = ""


@dataclass(frozen=True)
class Scheme:
    """One way of holding out recordings.

    Attributes
    ----------
    name : str
        For example "by run".
    folds : list of Fold
        Its folds.
    resampled : Grouping
        Groups that the bootstrap draws as a whole.
    impossible : str
        Why the scheme cannot be scored; empty if it can.
    may_refuse : tuple of str
        Methods, "fit" or "predict", in which a ValueError means that the estimator refuses what is
        held out (a condition without training data) and is not an error of `evaluate`.
    """

    name: str
    folds: list[Fold]
    resampled: Grouping
    impossible: str = ""
    may_refuse: tuple[str, ...] = ()


def random_scheme(
    y: NDArray[Any], labels: Sequence[Any], resampled: Grouping, n_splits: int, seed: Any
) -> Scheme:
    """Hold out recordings at random, stratified by class.

    Raises
    ------
    ValueError
        If no class has two recordings.
    """
    largest = int(np.unique(y, return_counts=True)[1].max())
    if largest < 2:
        raise ValueError(
            "y has one recording of each class; at least one class must have two, one for "
            "training and one to be held out."
        )
    split = StratifiedKFold(min(n_splits, largest), shuffle=True, random_state=seed)
    folds = [Fold(train, test) for train, test in _split(split, y, None)]
    return Scheme(RANDOM, folds, resampled, _absent(folds, labels))


def group_scheme(
    y: NDArray[Any], labels: Sequence[Any], grouping: Grouping, resampled: Grouping, **options: Any
) -> Scheme:
    """Hold out whole groups: one at a time, or several if there are more than `n_splits`.

    Parameters
    ----------
    y : ndarray of shape (n_recordings,)
        Classes, for stratification.
    labels : sequence of n_recordings
        Labels that are scored (classes or families). None may be absent from training.
    grouping : Grouping
        The groups.
    resampled : Grouping
        Groups that the bootstrap draws as a whole.
    **options
        `n_splits`, the largest number of folds (None: one for each group), and `seed`.

    Returns
    -------
    Scheme
        With `impossible` set if there is one group only, or if a label occurs in one group only.
    """
    groups, n_splits = np.unique(grouping.labels), options["n_splits"]
    name = f"by {grouping.name}"
    if len(groups) < 2:
        only = f"There is only one {grouping.name}, {plain_label(groups[0])!r}; two are required."
        return Scheme(name, [], resampled, only)
    one_at_a_time = _group_folds(LeaveOneGroupOut(), y, grouping)
    folds = one_at_a_time
    most = int(np.unique(y, return_counts=True)[1].max())  # folds that scikit-learn accepts
    if n_splits is not None and len(groups) > n_splits and most > 1:
        n_folds = min(n_splits, most)
        cv = StratifiedGroupKFold(n_folds, shuffle=True, random_state=options["seed"])
        folds = _group_folds(cv, y, grouping)
        # With one group at a time, a label of two groups is always in the training data.
        if _absent(folds, labels):
            folds = one_at_a_time
    return Scheme(name, folds, resampled, _absent(folds, labels))


def given_scheme(
    name: str, split: Any, y: NDArray[Any], groups: Any, labels: Sequence[Any], resampled: Grouping
) -> Scheme:
    """Hold out recordings as specified by the user.

    Parameters
    ----------
    name : str
        Name of the scheme.
    split : tuple (train, test), iterable of tuples, or object with ``split(X, y, groups)``
        Positions of recordings, or masks.
    y : ndarray of shape (n_recordings,)
        Classes.
    groups : ndarray of shape (n_recordings,) or None
        Passed to the object.
    labels : sequence of n_recordings
        Labels that are scored.
    resampled : Grouping
        Groups that the bootstrap draws as a whole.

    Returns
    -------
    Scheme

    Raises
    ------
    TypeError, ValueError
        If `split` has another form, a fold is empty, a position is out of range, or a recording
        is in both parts of a fold.
    """
    if hasattr(split, "split"):
        pairs = list(split.split(np.zeros((len(y), 1)), y, groups))
    elif isinstance(split, tuple):
        pairs = [split]
    elif isinstance(split, Iterable) and not isinstance(split, str | Mapping | np.ndarray):
        pairs = list(split)
    else:
        raise TypeError(
            f"splits[{name!r}] must be a tuple (train, test), a list of such tuples, or a splitter "
            f"of sklearn.model_selection; got {split!r}."
        )
    folds = [
        _checked_fold(pair, len(y), f"splits[{name!r}], fold {i}") for i, pair in enumerate(pairs)
    ]
    if not folds:
        raise ValueError(f"splits[{name!r}] must have at least one fold, got none.")
    return Scheme(name, folds, resampled, _absent(folds, labels))


def all_schemes(
    y: NDArray[Any],
    labels: Sequence[Any],
    groupings: Mapping[str, Grouping | None],
    splits: Mapping[str, Any] | None,
    n_splits: int,
    seed: Any,
) -> list[Scheme]:
    """Return the random split, and every other scheme for which there are labels.

    Parameters
    ----------
    y : ndarray of shape (n_recordings,)
        Classes.
    labels : sequence of n_recordings
        Labels that are scored.
    groupings : mapping
        "runs", "units" and "conditions", in this order.
    splits : mapping of str to split, optional
        As for `given_scheme`.
    n_splits, seed
        As for `group_scheme`.

    Returns
    -------
    list of Scheme

    Raises
    ------
    TypeError, ValueError
        If `splits` has another form, two schemes have the same name, or as `given_scheme`.
    """
    runs, units, conditions = groupings.values()
    options = {"n_splits": n_splits, "seed": seed}
    resampled = runs or units or Grouping("recording", np.arange(len(y)))
    schemes = [random_scheme(y, labels, resampled, n_splits, seed)]
    schemes += [group_scheme(y, labels, g, g, **options) for g in (runs, units) if g is not None]
    if conditions is not None:
        left_out = group_scheme(y, labels, conditions, resampled, n_splits=None, seed=seed)
        schemes.append(replace(left_out, may_refuse=("predict",)))
    if splits is not None and not isinstance(splits, Mapping):
        raise TypeError(
            f"splits must map names to splits, as {{'later runs': (train, test)}}; got {splits!r}."
        )
    for name, split in (splits or {}).items():
        groups = None if runs is None else runs.labels
        schemes.append(given_scheme(str(name), split, y, groups, labels, resampled))
    names = [scheme.name for scheme in schemes]
    doubles = [name for name in names if names.count(name) > 1]
    if doubles:
        raise ValueError(
            f"two hold-out schemes have the name {doubles[0]!r}. Give runs, units, conditions and "
            f"splits different names, for example as a pandas Series with a name."
        )
    return schemes


def strictest_scheme(
    schemes: Sequence[Scheme], groupings: Mapping[str, Grouping | None]
) -> Scheme | None:
    """Return the split by unit, otherwise by run, otherwise at random, whichever can be scored."""
    names = [
        f"by {each.name}" for each in map(groupings.get, ("units", "runs")) if each is not None
    ]
    possible = {scheme.name: scheme for scheme in schemes if not scheme.impossible}
    return next((possible[name] for name in (*names, RANDOM) if name in possible), None)


def _split(cv: Any, y: NDArray[Any], groups: Any) -> list[tuple[Indices, Indices]]:
    with warnings.catch_warnings():
        # A class with fewer recordings than folds is in every training set if it has two.
        warnings.filterwarnings("ignore", "The least populated class")
        return list(cv.split(y, y, groups))


def _group_folds(cv: Any, y: NDArray[Any], grouping: Grouping) -> list[Fold]:
    folds = []
    for train, test in _split(cv, y, grouping.labels):
        names = [str(plain_label(label)) for label in np.unique(grouping.labels[test])]
        more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
        folds.append(Fold(train, test, f"{grouping.name} {', '.join(names[:_LISTED])}{more}"))
    return folds


def _absent(folds: Sequence[Fold], labels: Sequence[Any]) -> str:
    """Describe which label is held out without being in the training data."""
    codes = np.asarray(pd.factorize(np.fromiter(labels, object, len(labels)))[0])
    names = dict(zip(codes.tolist(), labels, strict=True))
    found = []
    for number, fold in enumerate(folds):
        absent = np.setdiff1d(codes[fold.test], codes[fold.train])
        if len(absent):
            what = fold.left_out or f"fold {number}"
            found.append(f"without {what}, training has no {names[int(absent[0])]!r}")
    if not found:
        return ""
    return f"In {len(found)} of {len(folds)} folds a label is absent from training: {found[0]}."


def _checked_fold(pair: Any, n_recordings: int, where: str) -> Fold:
    if not (isinstance(pair, tuple | list) and len(pair) == 2):
        raise TypeError(f"{where} must be a pair (train, test), got {type(pair).__name__}.")
    parts: list[Indices] = []
    for part, values in zip(("train", "test"), pair, strict=True):
        numbers = np.asarray(values)
        if numbers.dtype == bool and numbers.shape == (n_recordings,):
            numbers = np.flatnonzero(numbers)
        if numbers.ndim != 1 or not numbers.size or numbers.dtype.kind not in "iu":
            raise ValueError(
                f"{where}: {part} must contain the positions of at least one recording, or be a "
                f"mask of length {n_recordings}; got {numbers.dtype} of shape {numbers.shape}."
            )
        if numbers.min() < 0 or numbers.max() >= n_recordings:
            raise ValueError(
                f"{where}: {part} must contain positions 0 to {n_recordings - 1}, got "
                f"{numbers.min()} to {numbers.max()}."
            )
        distinct, counts = np.unique(numbers, return_counts=True)
        if len(distinct) < len(numbers):
            double = distinct[counts > 1][0]
            raise ValueError(f"{where}: {part} has recording {double} more than once.")
        parts.append(numbers.astype(np.intp))
    train, test = parts
    both = np.intersect1d(train, test)
    if len(both):
        raise ValueError(f"{where} has recording {both[0]} in train and in test.")
    return Fold(train, test)
