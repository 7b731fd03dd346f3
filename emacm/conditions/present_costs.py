"""Costs and priors of a classifier for the classes of one condition."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.decisions.costs import cost_of_some, cost_table
from emacm.decisions.pipelines import final_estimator


def narrowed(model: Any, known: NDArray[Any], classes: NDArray[Any]) -> Any:
    """Restrict all costs and priors of an estimator, nested ones included, to some classes.

    Parameters
    ----------
    model : estimator
        It is changed; pass a clone.
    known, classes : ndarray of shape (n_known,) and (n_classes,)
        Classes that occur in the condition, and in all conditions, sorted.

    Returns
    -------
    estimator
        The same object.
    """
    for name, value in model.get_params().items():
        if name.rpartition("__")[2] == "cost":
            model.set_params(**{name: cost_of_some(value, known.tolist(), classes.tolist())})
        elif name.rpartition("__")[2] == "priors":
            model.set_params(**{name: priors_of_some(value, known, classes)})
    return model


def with_present_costs(final: Any, model: Any, template: Any, classes: NDArray[Any]) -> Any:
    """Return a fitted last step with the `cost` and `priors` that its template has now.

    Parameters
    ----------
    final : estimator
        Fitted last step of `model`; it is not changed.
    model : estimator
        Fitted clone of the template. What a search in it has selected stays.
    template : estimator
        Estimator whose parameters may have been set after `fit`.
    classes : ndarray of shape (n_classes,)
        Classes of all conditions.

    Returns
    -------
    estimator
        A shallow copy; `final` itself if it has no cost.
    """
    stated = final_estimator(template)
    if not (hasattr(final, "cost") and hasattr(stated, "cost")):
        return final
    selected = {name.rpartition("__")[2] for name in getattr(model, "best_params_", {})}
    final, known = copy.copy(final), final.classes_
    if "cost" not in selected:
        final.cost = cost_of_some(stated.cost, known.tolist(), classes.tolist())
    if "priors" not in selected and hasattr(stated, "priors"):
        final.priors = priors_of_some(stated.priors, known, classes)
    return final


def present_cost_table(
    models: Sequence[Any], template: Any, classes: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Return the decisions and their costs for all classes, from the present cost.

    Parameters
    ----------
    models : sequence of estimator
        Fitted clones of the template, one for each condition.
    template : estimator
        Estimator whose parameters may have been set after `fit`.
    classes : ndarray of shape (n_classes,)
        Classes of all conditions.

    Returns
    -------
    decisions, cost : ndarray of shape (n_decisions,) and (n_decisions, n_truths)
        As of `emacm.decisions.costs.cost_table`.

    Raises
    ------
    AttributeError
        If the last step has no cost.
    """
    whole = [model for model in models if len(model.classes_) == len(classes)]
    final = final_estimator(template)
    if whole:  # a search in a condition with all classes may have selected a cost
        final = with_present_costs(final_estimator(whole[0]), whole[0], template, classes)
    if not hasattr(final, "cost"):
        raise AttributeError(f"{type(final).__name__} has no costs.")
    return cost_table(final.cost, classes, getattr(final, "unknown", None))


def priors_of_some(priors: Any, known: NDArray[Any], classes: NDArray[Any]) -> Any:
    """Remove classes that do not occur from priors, and normalise the others.

    Parameters
    ----------
    priors : None, str, array-like or mapping
        As for `CostSensitiveGaussianBayes`.
    known, classes : ndarray of shape (n_known,) and (n_classes,)
        Classes that occur, and all classes, sorted.

    Returns
    -------
    None, str, ndarray or dict
        Unchanged if all classes occur, or if they do not fit the classes.

    Examples
    --------
    >>> priors = {"dry": 0.125, "ok": 0.375, "worn": 0.5}
    >>> priors_of_some(priors, np.array(["dry", "ok"]), np.array(["dry", "ok", "worn"]))
    {'dry': 0.25, 'ok': 0.75}
    """
    if priors is None or isinstance(priors, str) or len(known) == len(classes):
        return priors
    if isinstance(priors, Mapping | pd.Series):
        kept = {k: p for k, p in priors.items() if k in known or k not in classes}
        total = sum(kept.values())
        return {label: prior / total for label, prior in kept.items()} if total > 0 else priors
    if np.shape(priors) not in {(len(classes),), (len(classes) + 1,)}:
        return priors
    occurs = [*np.isin(classes, known), True]  # the last is that of the unknown state
    kept_values = np.asarray(priors)[occurs[: len(priors)]]
    return kept_values / kept_values.sum() if kept_values.sum() > 0 else priors
