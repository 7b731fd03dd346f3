"""Decisions on recordings held out, by classifiers fitted to the others."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.base import clone

from emacm._checks import located
from emacm._progress import run
from emacm.conditions.present_costs import priors_of_some
from emacm.decisions.costs import narrow_costs
from emacm.decisions.pipelines import before_the_last_step, groups_options
from emacm.evaluation.schemes import Fold, Scheme
from emacm.orders.new_lines import collected_statements
from emacm.recordings.meta import chosen_rows

Array = NDArray[np.float64]

_OUTSIDE = r"(?s)recording \d+.* training"  # a property is outside the range of the training


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
    n_jobs: int | None = None,
    verbose: bool | int = False,
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
    n_jobs : int, optional
        Number of folds processed in parallel.
    verbose : bool or int
        Report to stderr how many folds are done.

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
        run(
            decide,
            *zip(*tasks, strict=True),
            n_jobs=n_jobs,
            verbose=verbose,
            unit="fold",
            prefer="processes",
        )
        if tasks
        else []
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
            warnings.filterwarnings("ignore", _OUTSIDE)
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
