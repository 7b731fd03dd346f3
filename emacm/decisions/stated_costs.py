"""Costs that estimators hold among their parameters, and the part of them that is of some classes.

Where a class cannot occur (it is absent from training, or from the recordings of a condition),
its posterior is 0 and so is what it adds to any expected cost, Eq. (2.39) of Chirico. To leave
out its column changes no decision among those that remain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import joblib
import numpy as np
import pandas as pd


def cost_parameters(estimator: Any) -> dict[str, Any]:
    """Return every cost among the parameters of an estimator, however deep, by name.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from emacm import CostSensitiveGaussianBayes
    >>> cost_parameters(make_pipeline(CostSensitiveGaussianBayes(cost={("a", "b"): 10})))
    {'costsensitivegaussianbayes__cost': {('a', 'b'): 10}}
    """
    parameters = estimator.get_params(deep=True) if hasattr(estimator, "get_params") else {}
    return {
        name: value
        for name, value in parameters.items()
        if name.rpartition("__")[2] == "cost" and value is not None
    }


def stated_cost(estimator: Any) -> Any:
    """Return the cost that an estimator holds among its parameters, however deep; None without.

    Raises
    ------
    ValueError
        If it holds several that differ.
    """
    costs = cost_parameters(estimator)
    if len({joblib.hash(cost) for cost in costs.values()}) > 1:
        raise ValueError(
            f"the estimator holds several costs, {list(costs)}, and they differ. State cost=, "
            f"the one that decisions are to be priced by."
        )
    return next(iter(costs.values()), None)


def cost_of_some(cost: Any, known: Sequence[Any], everything: Sequence[Any]) -> Any:
    """Take the classes that do not occur out of a cost.

    Parameters
    ----------
    cost : None, array-like, DataFrame or mapping
        As for `emacm.decisions.costs.cost_table`.
    known : sequence
        Classes that occur.
    everything : sequence
        All classes, sorted.

    Returns
    -------
    None, array-like, DataFrame or mapping
        Of a DataFrame, the columns of the others are left out, and every decision stays. Of a
        mapping, pairs that name one; of an array, rows and columns: a class that does not
        occur is no decision there. What does not fit all classes comes back as it is.

    Examples
    --------
    >>> cost_of_some({("ok", "worn"): 10, ("ok", "dry"): 5}, ["dry", "ok"], ["dry", "ok", "worn"])
    {('ok', 'dry'): 5}
    """
    absent = [label for label in everything if label not in known]
    if cost is None or not absent:
        return cost
    if isinstance(cost, pd.DataFrame):
        return cost.drop(columns=[label for label in absent if label in cost.columns])
    if isinstance(cost, Mapping):
        return {
            key: price
            for key, price in cost.items()
            if not (isinstance(key, tuple) and set(key) & set(absent))
        }
    if np.shape(cost) != (len(everything),) * 2:
        return cost
    kept = [place for place, label in enumerate(everything) if label in known]
    return np.asarray(cost)[np.ix_(kept, kept)]


def narrow_costs(estimator: Any, known: Sequence[Any], everything: Sequence[Any]) -> Any:
    """Set the costs of an estimator, however deep, to those of the classes that occur.

    Parameters
    ----------
    estimator : estimator
        It is changed; give a clone.
    known, everything : sequence
        As for `cost_of_some`.

    Returns
    -------
    estimator
        Itself.
    """
    costs = cost_parameters(estimator)
    narrow = {name: cost_of_some(cost, known, everything) for name, cost in costs.items()}
    return estimator.set_params(**narrow) if narrow else estimator
