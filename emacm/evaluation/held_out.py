"""Hold-out schemes (random, by run, unit, condition, user-defined), and decisions in them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.base import clone
from sklearn.model_selection import (
    LeaveOneGroupOut,
    StratifiedGroupKFold,
    StratifiedKFold,
    check_cv,
)

from emacm._checks import check_count, located
from emacm.decisions.costs import check_distinct
from emacm.decisions.pipelines import (
    before_the_last_step,
    groups_are_units,
    groups_options,
    narrowed,
)
from emacm.recordings.inputs import run
from emacm.recordings.meta import Grouping, chosen_rows, plain_label, read_grouping

Indices = NDArray[np.intp]
Groupings = Mapping[str, Grouping | None]

RANDOM = "random split"


class Fold(NamedTuple):
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
    may_refuse : bool
        Whether a ValueError means that the estimator refuses what is held out (a condition
        without training data) and is not an error of `evaluate`.
    """

    name: str
    folds: list[Fold]
    resampled: Grouping
    impossible: str = ""
    may_refuse: bool = False


def random_folds(y: NDArray[Any], n_splits: int) -> list[Fold]:
    """Hold out recordings at random, stratified by class.

    Raises
    ------
    ValueError
        If no class has two recordings.
    """
    largest = _largest_class(y)
    if largest < 2:
        raise ValueError(
            "y has one recording of each class; at least one class must have two, one to hold out."
        )
    split = StratifiedKFold(min(n_splits, largest), shuffle=True, random_state=0)
    return [Fold(train, test) for train, test in _split(split, y, None)]


def group_folds(
    y: NDArray[Any], labels: Sequence[Any], grouping: Grouping, n_splits: float
) -> list[Fold]:
    """Hold out whole groups: one at a time, or several if there are more than `n_splits`.

    Parameters
    ----------
    y : ndarray of shape (n_recordings,)
        Classes, for stratification.
    labels : sequence of n_recordings
        Labels that are scored (classes or families).
    grouping : Grouping
        The groups.
    n_splits : int
        Largest number of folds; infinite: one for each group.

    Returns
    -------
    list of Fold
        None if there is one group only.
    """
    groups, most = np.unique(grouping.labels), _largest_class(y)  # folds that scikit-learn accepts
    if len(groups) < 2:
        return []
    if len(groups) > n_splits and most > 1:
        cv = StratifiedGroupKFold(min(int(n_splits), most), shuffle=True, random_state=0)
        folds = _named_folds(cv, y, grouping)
        # With one group at a time, a label of two groups is always in the training data.
        if not why_impossible(folds, labels):
            return folds
    return _named_folds(LeaveOneGroupOut(), y, grouping)


def given_folds(name: str, split: Any, y: NDArray[Any], groups: Any) -> list[Fold]:
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

    Returns
    -------
    list of Fold

    Raises
    ------
    TypeError, ValueError
        If `split` has another form, a fold is empty, a position is out of range, or a recording
        is in both parts of a fold.
    """
    with located(f"splits[{name!r}]"):
        cv = check_cv([split] if isinstance(split, tuple) else split)
        return [
            _checked_fold(train, test, len(y), number)
            for number, (train, test) in enumerate(cv.split(np.zeros(len(y)), y, groups))
        ]


def all_schemes(
    y: NDArray[Any], labels: Sequence[Any], groupings: Groupings, splits: Any, n_splits: int
) -> list[Scheme]:
    """Return the random split, and every other scheme for which there are labels.

    Parameters
    ----------
    y : ndarray of shape (n_recordings,)
        Classes.
    labels : sequence of n_recordings
        Labels that are scored. A scheme is impossible if one is absent from a training.
    groupings : mapping
        "runs", "units" and "conditions", in this order.
    splits : mapping of str to split, optional
        As for `given_folds`.
    n_splits : int
        As for `group_folds`.

    Returns
    -------
    list of Scheme
        At random, by run, by unit, by condition, and `splits`.

    Raises
    ------
    TypeError, ValueError
        If `splits` has another form, two schemes have the same name, or as `given_folds`.
    """
    check_count(n_splits, "n_splits", at_least=2)
    if not isinstance(splits, Mapping | None):
        raise TypeError(
            f"splits must map names to splits, as {{'later runs': (train, test)}}; got {splits!r}."
        )
    runs, units, conditions = groupings.values()
    resampled = runs or units or Grouping("recording", np.arange(len(y)))
    schemes = [Scheme(RANDOM, random_folds(y, n_splits), resampled)]
    for grouping in filter(None, (runs, units)):
        folds = group_folds(y, labels, grouping, n_splits)
        schemes.append(Scheme(f"by {grouping.name}", folds, grouping))
    if conditions is not None:
        folds = group_folds(y, labels, conditions, np.inf)
        schemes.append(Scheme(f"by {conditions.name}", folds, resampled, may_refuse=True))
    for name, split in (splits or {}).items():
        folds = given_folds(str(name), split, y, None if runs is None else runs.labels)
        schemes.append(Scheme(str(name), folds, resampled))
    check_distinct([scheme.name for scheme in schemes], "names of hold-out schemes")
    return [replace(each, impossible=why_impossible(each.folds, labels)) for each in schemes]


def _largest_class(y: NDArray[Any]) -> int:
    return int(np.unique(y, return_counts=True)[1].max())


def _split(cv: Any, y: NDArray[Any], groups: Any) -> list[tuple[Indices, Indices]]:
    with warnings.catch_warnings():
        # A class with fewer recordings than folds is in every training set if it has two.
        warnings.filterwarnings("ignore", "The least populated class")
        return list(cv.split(y, y, groups))


def _named_folds(cv: Any, y: NDArray[Any], grouping: Grouping) -> list[Fold]:
    folds = []
    for train, test in _split(cv, y, grouping.labels):
        names = [str(plain_label(label)) for label in np.unique(grouping.labels[test])]
        more = f" and {len(names) - 4} more" if len(names) > 4 else ""
        folds.append(Fold(train, test, f"{grouping.name} {', '.join(names[:4])}{more}"))
    return folds


def why_impossible(folds: Sequence[Fold], labels: Sequence[Any]) -> str:
    """Return which label is held out without being in the training data; empty if none is."""
    if not folds:
        return "It has no fold; two groups are required."
    found = []
    for number, fold in enumerate(folds):
        known = {labels[row] for row in fold.train}
        absent = [labels[row] for row in fold.test if labels[row] not in known]
        if absent:
            what = fold.left_out or f"fold {number}"
            found.append(f"without {what}, training has no {absent[0]!r}")
    if not found:
        return ""
    return f"In {len(found)} of {len(folds)} folds a label is absent from training: {found[0]}."


def _checked_fold(train: Any, test: Any, n_recordings: int, number: int) -> Fold:
    recordings = np.arange(n_recordings)
    try:
        train, test = (np.unique(recordings[list(part)]) for part in (train, test))
    except IndexError as error:
        raise ValueError(f"fold {number}: give positions, or masks: {error}.") from error
    both = np.intersect1d(train, test)
    if len(both) or not (len(train) and len(test)):
        raise ValueError(
            f"fold {number} must have recordings in train and others in test, got {len(train)} and "
            f"{len(test)}; in both: {both[:3].tolist()}."
        )
    return Fold(train, test)


class HeldOut(NamedTuple):
    """All that is needed to score held-out decisions, also by other costs.

    Attributes
    ----------
    schemes : list of Scheme
        The hold-out schemes, with `impossible` set where the estimator refused what was held out.
    decisions : DataFrame
        One row for each scheme that can be scored and recording held out: "scheme", "fold",
        "left_out", "recording" (its position), "group", "decision", and, for a classifier with an
        unknown state, "typicality" and "unknown_proba".
    posteriors : DataFrame
        Posterior probabilities in the same rows; columns are classes, none without
        `predict_proba`.
    y : ndarray of shape (n_recordings,)
        True classes.
    groupings : dict of str to Grouping or None
        "runs", "units" and "conditions".
    """

    schemes: list[Scheme]
    decisions: pd.DataFrame
    posteriors: pd.DataFrame
    y: NDArray[Any]
    groupings: Groupings


def decide_held_out(
    estimator: Any, X: Any, y: NDArray[Any], schemes: Sequence[Scheme], groupings: Groupings
) -> HeldOut:
    """Fit a clone in each fold, and return its decisions on the recordings held out.

    Parameters
    ----------
    estimator : estimator
        Classifier or pipeline; it is not changed.
    X : array-like or sequence of Recording
        All recordings.
    y : ndarray of shape (n_recordings,)
        Their classes.
    schemes : sequence of Scheme
        Those that are `impossible` are skipped.
    groupings : mapping
        "runs" and "units", for classifiers that learn from left-out groups.

    Returns
    -------
    HeldOut

    Raises
    ------
    TypeError, ValueError
        Errors of the estimator; the message gives the fold.

    Notes
    -----
    If a class is absent from the training data of a fold, its entries in the estimator's
    parameters named `cost` and `priors` are left out, so that a family can be decided on when one
    of its classes was never observed.
    """
    tasks = [(s, number) for s in schemes if not s.impossible for number in range(len(s.folds))]
    decide = partial(_decide, estimator, X, y, training_groups(estimator, groupings))
    found = run(decide, *zip(*tasks, strict=True), prefer="processes") if tasks else []
    refused: dict[str, str] = {}
    for (scheme, _), result in zip(tasks, found, strict=True):
        if isinstance(result, str):
            refused.setdefault(scheme.name, f"The estimator refuses: {result}")
    parts = [r for (s, _), r in zip(tasks, found, strict=True) if s.name not in refused]
    tables = [pd.concat(each, ignore_index=True) for each in zip(*parts, strict=True)]
    decisions, posteriors = tables or (pd.DataFrame(), pd.DataFrame())
    tried = [replace(s, impossible=refused.get(s.name, s.impossible)) for s in schemes]
    return HeldOut(tried, decisions, posteriors.fillna(0.0), y, groupings)


def _decide(
    estimator: Any, X: Any, y: NDArray[Any], groups: Any, scheme: Scheme, number: int
) -> tuple[pd.DataFrame, pd.DataFrame] | str:
    """Return the decisions and posterior probabilities of a fold, or why they are refused."""
    fold, where = scheme.folds[number], f"{scheme.name}, fold {number}"
    where += f" ({fold.left_out} left out)" if fold.left_out else ""
    places = {
        "scheme": scheme.name,
        "fold": number,
        "left_out": fold.left_out,
        "recording": fold.test,
        "group": scheme.resampled.labels[fold.test],
    }
    with located(where):
        try:
            model = narrowed(clone(estimator), np.unique(y[fold.train]), np.unique(y))
            options = groups_options(model, None if groups is None else groups[fold.train])
            model.fit(chosen_rows(X, fold.train), y[fold.train], **options)
            # The steps before the last are computed once for all results.
            final, held_out = before_the_last_step(model, chosen_rows(X, fold.test))
            decisions = np.reshape(final.predict(held_out), len(fold.test))
        except ValueError as error:
            if not scheme.may_refuse:
                raise
            return f"{where}: {error}"
        table = pd.DataFrame(places).assign(decision=pd.Series(decisions.tolist(), dtype=object))
        if not hasattr(final, "predict_proba"):
            return table, pd.DataFrame(index=table.index)
        if hasattr(final, "typicality") and hasattr(final, "unknown_proba"):
            table["typicality"] = final.typicality(held_out)
            table["unknown_proba"] = final.unknown_proba(held_out)
        known = np.asarray(getattr(model, "classes_", np.unique(y[fold.train])))
        posterior = pd.DataFrame(final.predict_proba(held_out), table.index, known.tolist())
        if not np.allclose(posterior.sum(axis=1), 1, atol=1e-5):
            raise ValueError("predict_proba of the estimator must return rows that add up to 1.")
        return table, posterior


def read_groupings(X: Any, runs: Any, units: Any, conditions: Any = None) -> Groupings:
    """Return the runs, units and conditions of recordings, in the forms of `read_grouping`."""
    given = {"runs": runs, "units": units, "conditions": conditions}
    return {role: read_grouping(value, X, role, role[:-1]) for role, value in given.items()}


def training_groups(estimator: Any, groupings: Groupings) -> Any:
    """Return the groups of `fit`: units for a classifier for new units, otherwise runs."""
    runs, units = groupings["runs"], groupings["units"]
    together = (units or runs) if groups_are_units(estimator) else (runs or units)
    return None if together is None else together.labels
