"""Decisions about recordings that the classifier was not trained on, fold by fold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from numpy.typing import NDArray
from sklearn.base import clone

from emacm._checks import located
from emacm.decisions.stated_costs import narrow_costs
from emacm.evaluation.schemes import Fold, Scheme

Decided = tuple[list[Any], pd.DataFrame | None]


def decide_held_out(
    estimator: Any, X: Any, y: NDArray[Any], schemes: Sequence[Scheme], *, n_jobs: int | None = None
) -> tuple[list[Scheme], list[list[Decided]]]:
    """Fit a clone for each fold, and let it decide on what the fold holds out.

    Parameters
    ----------
    estimator : estimator
        Any classifier or pipeline of scikit-learn's kind; it is not changed.
    X : array-like or sequence of Recording
        All recordings.
    y : ndarray of shape (n_recordings,)
        Their classes.
    schemes : sequence of Scheme
        Those that are `impossible` are passed over.
    n_jobs : int, optional
        Processes.

    Returns
    -------
    schemes : list of Scheme
        Those given; where the estimator refused what was held out, `impossible` says so.
    decided : list of list of (decisions, probabilities)
        For each scheme and fold, the decisions on the recordings of `test`, and a DataFrame of
        their posteriors (columns: classes), None without `predict_proba`.

    Raises
    ------
    TypeError, ValueError
        What the estimator raises; the message says in which fold.

    Notes
    -----
    Where a class is absent from training, what the estimator's parameters
    called `cost` say of it is left out: a family can be decided on when
    one of its sub-states was never seen.
    """
    tasks = [
        delayed(_decide)(estimator, X, y, fold, f"{scheme.name}, fold {number}", scheme.may_refuse)
        for scheme in schemes
        if not scheme.impossible
        for number, fold in enumerate(scheme.folds)
    ]
    found = iter(Parallel(n_jobs=n_jobs)(tasks))
    judged, decided = [], []
    for scheme in schemes:
        folds = [] if scheme.impossible else [next(found) for _ in scheme.folds]
        refusals = [fold for fold in folds if isinstance(fold, str)]
        if refusals:
            scheme = replace(scheme, impossible=f"The estimator refuses: {refusals[0]}")
        judged.append(scheme)
        decided.append([fold for fold in folds if not isinstance(fold, str)])
    return judged, decided


def chosen_recordings(X: Any, numbers: NDArray[np.intp]) -> Any:
    """Return some recordings of a list, an array or a table, in the same form."""
    if hasattr(X, "iloc"):
        return X.iloc[numbers]
    if hasattr(X, "shape"):
        return X[numbers]
    return [X[number] for number in numbers]


def _decide(
    estimator: Any, X: Any, y: NDArray[Any], fold: Fold, where: str, may_refuse: bool
) -> Decided | str:
    out = f" ({fold.left_out} left out)" if fold.left_out else ""
    with located(where + out):
        classes = np.unique(y[fold.train])
        model = narrow_costs(clone(estimator), classes.tolist(), np.unique(y).tolist())
        model.fit(chosen_recordings(X, fold.train), y[fold.train])
        held_out = chosen_recordings(X, fold.test)
        try:
            decisions = np.asarray(model.predict(held_out)).tolist()
        except ValueError as error:
            if not may_refuse:
                raise
            return f"{where + out}: {error}"
        if not hasattr(model, "predict_proba"):
            return decisions, None
        known = np.asarray(getattr(model, "classes_", classes)).tolist()
        return decisions, pd.DataFrame(np.asarray(model.predict_proba(held_out)), columns=known)
