"""Models of one unit, from pipelines and routers that end in a classifier for new units."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.pipeline import Pipeline

from emacm.conditions.router import ConditionRouter
from emacm.decisions.labels import label_list
from emacm.decisions.pipelines import before_the_last_step, search_estimator
from emacm.recordings.meta import chosen_rows, read_meta


def for_unit(model: Any, X: Any, y: Any) -> Any:
    """Return a fitted model for one unit, of which some recordings are known.

    `NewUnitClassifier.for_unit` for models that contain one: the recordings pass through the
    earlier steps of a pipeline, which do not change, and in a `ConditionRouter` each goes to the
    model of its condition.

    Parameters
    ----------
    model : NewUnitClassifier, Pipeline, ConditionRouter or search
        Fitted; it is not changed.
    X : list of Recording, or table
        Recordings of the unit, as for `predict`.
    y : label, or array-like of shape (n_recordings,)
        Their class ("healthy"), or that of each of them.

    Returns
    -------
    estimator
        A copy, of a search the best estimator. In a router, conditions without a
        recording are classified as for a new unit.

    Raises
    ------
    TypeError
        If the last step is not a `NewUnitClassifier`.
    ValueError
        As `NewUnitClassifier.for_unit`, or if a condition was not in training.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn.preprocessing import StandardScaler
    >>> from emacm import NewUnitClassifier
    >>> rng = np.random.default_rng(0)
    >>> units, y = np.repeat(np.arange(20), 4), np.tile(["healthy", "worn"], 40)
    >>> X = 4.0 * (y == "worn") + 3 * rng.normal(size=21)[units] + rng.normal(size=80)
    >>> model = make_pipeline(StandardScaler(), NewUnitClassifier())
    >>> model = model.fit(X[:, np.newaxis], y, newunitclassifier__groups=units)
    >>> model.predict([[6.0]])
    array(['worn'], dtype='<U7')
    >>> for_unit(model, [[5.5], [6.5], [5.0]], "healthy").predict([[6.0]])
    array(['healthy'], dtype='<U7')
    """
    model = search_estimator(model)
    if isinstance(model, ConditionRouter):
        return _router_for_unit(model, X, y)
    if isinstance(model, Pipeline):
        last, table = model.steps[-1], model[:-1].transform(X) if len(model) > 1 else X
        known = copy.copy(model)
        known.steps = [*model.steps[:-1], (last[0], for_unit(last[1], table, y))]
        return known
    if not hasattr(model, "for_unit"):
        raise TypeError(
            f"model must be a NewUnitClassifier, or a pipeline or ConditionRouter that ends in "
            f"one; the last step is {type(model).__name__}, which has no unit effects."
        )
    return model.for_unit(X, y)


def prediction_sets(model: Any, X: Any, coverage: float = 0.9) -> NDArray[np.bool_]:
    """Return the classes that cannot be excluded, as `NewUnitClassifier.prediction_sets`.

    Parameters
    ----------
    model : NewUnitClassifier, or Pipeline or search that ends in one
        Fitted, or from `for_unit`.
    X : list of Recording, or table
        Recordings.
    coverage : float, default=0.9
        Probability with which a set contains the true class.

    Returns
    -------
    ndarray of bool, shape (n_recordings, n_classes)
        Never empty.

    Raises
    ------
    TypeError
        If the last step is not a `NewUnitClassifier`. For a `ConditionRouter`, use the model of one
        condition, ``prediction_sets(router.estimators_[load], X)``.
    ValueError
        As `NewUnitClassifier.prediction_sets`.
    """
    final, table = before_the_last_step(model, X)
    if not hasattr(final, "prediction_sets"):
        raise TypeError(
            f"prediction sets need a NewUnitClassifier as last step, got {type(final).__name__}; "
            f"of a ConditionRouter, use the models in its estimators_."
        )
    return final.prediction_sets(table, coverage)


def _router_for_unit(router: ConditionRouter, X: Any, y: Any) -> ConditionRouter:
    found, known = read_meta(X, router.condition), copy.copy(router)
    labels = [y] * len(found) if np.ndim(y) == 0 else label_list(y)
    if len(labels) != len(found):
        raise ValueError(f"y has {len(labels)} classes for {len(found)} recordings.")
    known.estimators_ = dict(router.estimators_)
    for value in dict.fromkeys(found):
        if value not in router.estimators_:
            raise ValueError(
                f"X has a recording of the condition {value!r}, but the conditions in training "
                f"were {list(router.conditions_)}. Leave it out."
            )
        rows = np.flatnonzero([other == value for other in found])
        some, classes = chosen_rows(router.inner(X), rows), [labels[row] for row in rows]
        known.estimators_[value] = for_unit(router.estimators_[value], some, classes)
    return known
