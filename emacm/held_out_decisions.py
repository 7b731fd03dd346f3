"""Decisions about recordings that the classifier was not trained on, fold by fold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import joblib
import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from numpy.typing import NDArray
from sklearn.base import clone

from emacm._checks import located
from emacm.hold_out import Fold, Scheme

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
    Where a class is absent from training, costs that name it (a DataFrame or mapping among
    the estimator's parameters, called `cost`) lose its column: a family can be decided on when
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


def stated_cost(estimator: Any) -> Any:
    """Return the cost that an estimator holds among its parameters, however deep; None without.

    Raises
    ------
    ValueError
        If it holds several that differ.
    """
    costs = _cost_parameters(estimator)
    if len({joblib.hash(cost) for cost in costs.values()}) > 1:
        raise ValueError(
            f"the estimator holds several costs, {list(costs)}, and they differ. State cost=, "
            f"the one that decisions are to be priced by."
        )
    return next(iter(costs.values()), None)


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
        model = clone(estimator)
        classes = np.unique(y[fold.train])
        narrower = {
            name: _known_part(cost, classes.tolist(), np.unique(y).tolist())
            for name, cost in _cost_parameters(model).items()
        }
        model.set_params(**narrower)
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


def _cost_parameters(estimator: Any) -> dict[str, Any]:
    parameters = estimator.get_params(deep=True) if hasattr(estimator, "get_params") else {}
    return {
        name: value
        for name, value in parameters.items()
        if name.rpartition("__")[2] == "cost" and value is not None
    }


def _known_part(cost: Any, known: list[Any], everything: list[Any]) -> Any:
    """Take the classes that are absent from training out of a labelled cost."""
    absent = [label for label in everything if label not in known]
    if not absent:
        return cost
    if isinstance(cost, pd.DataFrame):
        return cost.drop(columns=[label for label in absent if label in cost.columns])
    if isinstance(cost, Mapping):
        return {pair: price for pair, price in cost.items() if not set(pair) & set(absent)}
    return cost
