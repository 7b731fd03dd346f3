"""Hold-out schemes (random, by run, unit, condition, user-defined), and decisions in them."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.base import clone
from sklearn.model_selection import LeaveOneGroupOut, StratifiedGroupKFold, StratifiedKFold

from emacm._checks import located
from emacm._progress import run
from emacm.conditions.present_costs import priors_of_some
from emacm.decisions.costs import narrow_costs
from emacm.decisions.pipelines import before_the_last_step, groups_are_units, groups_options
from emacm.orders.new_lines import collected_statements
from emacm.recordings.meta import Grouping, chosen_rows, plain_label, read_grouping

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

RANDOM = "random split"


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
    seed: int | None = 0,
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
        more = f" and {len(names) - 4} more" if len(names) > 4 else ""
        folds.append(Fold(train, test, f"{grouping.name} {', '.join(names[:4])}{more}"))
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
    if not all(map(len, pair)):
        raise ValueError(f"{where} must have at least one recording in train and in test.")
    recordings = np.arange(n_recordings)
    try:
        train, test = (np.unique(recordings[np.asarray(part)]) for part in pair)
    except IndexError as error:
        raise ValueError(
            f"{where} must contain positions 0 to {n_recordings - 1}, or masks of length "
            f"{n_recordings}: {error}."
        ) from error
    both = np.intersect1d(train, test)
    if len(both):
        raise ValueError(f"{where} has recording {both[0]} in train and in test.")
    if not (len(train) and len(test)):
        raise ValueError(f"{where} must have at least one recording in train and in test.")
    return Fold(train, test)


@dataclass(frozen=True)
class Decided:
    """Decisions on the recordings held out in one fold.

    Attributes
    ----------
    decisions : list of n_recordings
        Decisions, as Python objects.
    posterior : DataFrame of shape (n_recordings, n_classes) or None
        Posterior probabilities (columns: classes); None without `predict_proba`.
    typicality, unknown_proba : ndarray of shape (n_recordings,) or None
        Typicality, and probability of the unknown state; None if there is no unknown state.
    """

    decisions: list[Any]
    posterior: pd.DataFrame | None = None
    typicality: Array | None = None
    unknown_proba: Array | None = None


def decide_held_out(
    estimator: Any,
    X: Any,
    y: NDArray[Any],
    schemes: Sequence[Scheme],
    *,
    groups: NDArray[Any] | None = None,
) -> tuple[list[Scheme], list[list[Decided]]]:
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
    groups : ndarray of shape (n_recordings,), optional
        Recordings that were measured together, for classifiers that learn from left-out groups.

    Returns
    -------
    schemes : list of Scheme
        As given; `impossible` is set where the estimator refused what was held out.
    decided : list of list of Decided
        The decisions on the recordings of `test`, for each scheme and fold.

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
    tasks = [
        (fold, f"{scheme.name}, fold {number}", scheme.may_refuse)
        for scheme in schemes
        if not scheme.impossible
        for number, fold in enumerate(scheme.folds)
    ]
    decide = partial(_decide, estimator, X, y, groups)
    found = iter(
        run(decide, *zip(*tasks, strict=True), unit="fold", prefer="processes") if tasks else []
    )
    scored, decided = [], []
    for scheme in schemes:
        folds = [] if scheme.impossible else [next(found) for _ in scheme.folds]
        refusals = [fold for fold in folds if isinstance(fold, str)]
        if refusals:
            scheme = replace(scheme, impossible=f"The estimator refuses: {refusals[0]}")
        scored.append(scheme)
        decided.append([fold for fold in folds if not isinstance(fold, str)])
    return scored, decided


def _decide(
    estimator: Any,
    X: Any,
    y: NDArray[Any],
    groups: NDArray[Any] | None,
    fold: Fold,
    where: str,
    may_refuse: tuple[str, ...],
) -> Decided | str:
    where += f" ({fold.left_out} left out)" if fold.left_out else ""
    with located(where), warnings.catch_warnings(), collected_statements():
        if "predict" in may_refuse:  # what is held out is not like the training, by design
            warnings.filterwarnings("ignore", r"(?s)recording \d+.* training")
        method = "fit"
        try:
            model = _fitted(estimator, X, y, groups, fold)
            method = "predict"
            # The steps before the last are computed once for all results.
            final, held_out = before_the_last_step(model, chosen_rows(X, fold.test))
            decisions = np.asarray(final.predict(held_out))
        except ValueError as error:
            if method not in may_refuse:
                raise
            return f"{where}: {error}"
        n_recordings = len(fold.test)
        _check_shape(decisions, "predict", (n_recordings,))
        if not hasattr(final, "predict_proba"):
            return Decided(decisions.tolist())
        known = np.asarray(getattr(model, "classes_", np.unique(y[fold.train]))).tolist()
        posterior = np.asarray(final.predict_proba(held_out))
        _check_shape(posterior, "predict_proba", (n_recordings, len(known)))
        if not (posterior >= 0).all() or not np.allclose(posterior.sum(axis=1), 1, atol=1e-5):
            raise ValueError("predict_proba of the estimator must return rows that add up to 1.")
        table = pd.DataFrame(posterior, columns=known)
        if not (hasattr(final, "typicality") and hasattr(final, "unknown_proba")):
            return Decided(decisions.tolist(), table)
        of_unknown = final.typicality(held_out), final.unknown_proba(held_out)
        return Decided(decisions.tolist(), table, *map(np.asarray, of_unknown))


def _fitted(
    estimator: Any, X: Any, y: NDArray[Any], groups: NDArray[Any] | None, fold: Fold
) -> Any:
    known, classes = np.unique(y[fold.train]), np.unique(y)
    model = narrow_costs(clone(estimator), known.tolist(), classes.tolist())
    narrow = {
        name: priors_of_some(value, known, classes)
        for name, value in model.get_params().items()
        if name.rpartition("__")[2] == "priors"
    }
    model.set_params(**narrow)
    options = groups_options(model, None if groups is None else groups[fold.train])
    return model.fit(chosen_rows(X, fold.train), y[fold.train], **options)


def _check_shape(array: NDArray[Any], method: str, expected: tuple[int, ...]) -> None:
    if array.shape != expected:
        raise ValueError(
            f"{method} of the estimator must return shape {expected}, got {array.shape}."
        )


class HeldOut(NamedTuple):
    """All that is needed to score held-out decisions, also by other costs.

    Attributes
    ----------
    schemes : list of Scheme
        The hold-out schemes.
    decided : list of list of Decided
        Decisions of each scheme and fold.
    y : ndarray of shape (n_recordings,)
        True classes.
    groupings : dict of str to Grouping or None
        "runs", "units" and "conditions".
    stated : dict
        Arguments of `scoring_rule`.
    """

    schemes: list[Scheme]
    decided: list[list[Decided]]
    y: NDArray[Any]
    groupings: dict[str, Grouping | None]
    stated: dict[str, Any]


def read_groupings(X: Any, runs: Any, units: Any, conditions: Any) -> dict[str, Grouping | None]:
    """Return the runs, units and conditions of recordings, in the forms of `read_grouping`."""
    given = {
        "runs": (runs, "run"),
        "units": (units, "unit"),
        "conditions": (conditions, "condition"),
    }
    return {role: read_grouping(values, X, role, name) for role, (values, name) in given.items()}


def training_groups(
    estimator: Any, groupings: Mapping[str, Grouping | None]
) -> NDArray[Any] | None:
    """Return the groups of `fit`: units for a classifier for new units, otherwise runs."""
    roles = ("units", "runs") if groups_are_units(estimator) else ("runs", "units")
    together = groupings[roles[0]] or groupings[roles[1]]
    return None if together is None else together.labels
