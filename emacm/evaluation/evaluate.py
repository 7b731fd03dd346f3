"""Hold-out schemes compared: performance on the next run, the next unit, a new condition.

A random split estimates the performance on recordings with near copies in the training data. To
estimate performance on the next run, the next machine or a new load, hold out whole runs, machines
or loads. `evaluate` scores all of these schemes and lists the limits of the conclusions.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from emacm._checks import check_count
from emacm._statements import warn
from emacm.decisions.pipelines import check_unknown_states, stated_costs
from emacm.evaluation.caveats import single_unit_labels
from emacm.evaluation.held_out import all_schemes, decide_held_out, read_groupings
from emacm.evaluation.results import Evaluation, score_held_out
from emacm.evaluation.scoring import checked_classes, scoring_rule


def evaluate(
    estimator: Any,
    X: Any,
    y: ArrayLike,
    *,
    runs: Any = None,
    units: Any = None,
    conditions: Any = None,
    splits: Mapping[str, Any] | None = None,
    healthy: Any = None,
    n_splits: int = 10,
) -> Evaluation:
    """Evaluate a classifier by several hold-out schemes: at random, by run, unit and condition.

    In each fold a clone is fitted to the training recordings and decides on the recordings held
    out. Confidence intervals are from a bootstrap over whole runs or units, because recordings of
    one run are near copies of one another.

    Parameters
    ----------
    estimator : estimator
        Classifier or pipeline; it is not changed.
    X : sequence of Recording, or array-like of n_recordings
        Input of the estimator.
    y : array-like of shape (n_recordings,)
        True classes.
    runs : key, tuple of keys, callable or array-like of shape (n_recordings,), optional
        Run of each recording: a key of `meta` (a column, if X is a DataFrame), a tuple of keys,
        a function of the recording, or an array. Recordings of one run are held out together, and
        passed as `groups` to a classifier with an unknown state (without runs: units).
    units : key, tuple of keys, callable or array-like of shape (n_recordings,), optional
        Machine or assembly of each recording; passed as `groups` to a classifier that learns how
        units differ, such as `NewUnitClassifier` (without units: runs).
    conditions : key, tuple of keys, callable or array-like of shape (n_recordings,), optional
        Operating condition, such as load; one is left out at a time. The scheme is not scored if
        the estimator refuses conditions without training data.
    splits : mapping of str to split, optional
        Further schemes by name: a tuple (train, test) of positions or masks, as for "later
        runs"; a list of such tuples; or an object with ``split(X, y, groups)``.
    healthy : object, optional
        The healthy class, or the family of a cost. Without it the three rates are not computed.
    n_splits : int, default=10
        Largest number of folds, at least 2. Up to this number of runs (or units), one is left out
        at a time.

    Returns
    -------
    Evaluation
        Balanced accuracy (mean over the labels of the fraction recognised) and accuracy. With
        `healthy`: false alarm rate (fraction of the healthy recordings decided to be faulty),
        inspection rate (fraction of them with a decision that is not a label, such as "inspect"
        or "unknown") and missed detection rate (fraction of the faulty recordings decided to be
        healthy, or any other that is correct for the healthy state). Mean cost of a decision on
        these recordings (``expected_cost``), in the unit of the cost. With `predict_proba`: mean
        cost that was paid (``realised_cost``) and mean cost that the probabilities predict for
        the same decisions (``predicted_cost``), where the true classes have the classifier's
        `priors` as weights; log loss [nats] and expected calibration error (0 to 1): the mean over
        the recordings of the difference of confidence and frequency in ten bins of equal width of
        the highest posterior [1]_.

    Warns
    -----
    EmacmWarning
        If a label occurs in one unit only.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid; or an error of the estimator, with the fold.

    See Also
    --------
    evaluate_unknown : Families of faults that are left out of training.

    Notes
    -----
    The cost is the one among the estimator's parameters (several that differ are an error);
    without any, 0-1. Decisions on families of states follow from a cost of `family_costs`. Folds
    are processed in parallel within ``joblib.parallel_config(n_jobs=4)`` (default: processes).

    If a label is held out without being in the training data, the scheme cannot be scored; its row
    is NaN and a caveat gives the group and the label. The bootstrap
    (`emacm.evaluation.bootstrap.GroupBootstrap`) draws runs, or units if no `runs` are given and
    for the split by unit; without either it draws recordings, and a caveat says so. The intervals
    cover the variation of the recordings held out, not that of the training data.

    A classifier whose priors differ from the class frequencies of these recordings is, correctly,
    not calibrated on them. The calibration error of few recordings is too large, because chance
    differences add up; its interval describes its variation only.

    Whether a property that should not matter, such as the day, predicts the label, is shown by a
    classifier of this property alone (see the last example); and how good a classifier is within
    one day, by its `predictions` of each day.

    References
    ----------
    .. [1] M. P. Naeini, G. F. Cooper and M. Hauskrecht, Obtaining well calibrated probabilities
       using Bayesian binning, AAAI 2015.

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn.neighbors import KNeighborsClassifier
    >>> rng = np.random.default_rng(2)
    >>> X = np.repeat(rng.normal(size=(10, 2)), 9, axis=0)  # 10 runs of 9 copies
    >>> y = np.repeat(["healthy", "worn"] * 5, 9)  # unrelated to X
    >>> runs = pd.Series(np.repeat(np.arange(10), 9), name="run")
    >>> result = evaluate(KNeighborsClassifier(1), X, y, runs=runs, healthy="healthy")
    >>> result.table["accuracy"].to_dict()
    {'random split': 1.0, 'by run': 0.5}

    Healthy runs were all measured on one day, worn ones on another:

    >>> from sklearn.naive_bayes import MultinomialNB
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn.preprocessing import OneHotEncoder
    >>> day = np.repeat([["monday"], ["tuesday"]] * 5, 9, axis=0)
    >>> of_day = OneHotEncoder(handle_unknown="ignore"), MultinomialNB(fit_prior=False)
    >>> evaluate(make_pipeline(*of_day), day, y, runs=runs).table["accuracy"].to_dict()
    {'random split': 1.0, 'by run': 1.0}
    """
    for method in ("fit", "predict"):
        if isinstance(estimator, type) or not hasattr(estimator, method):
            raise TypeError(f"estimator must be a classifier with {method}, got {estimator!r}.")
    check_unknown_states(estimator)
    classes = checked_classes(y, X)
    check_count(n_splits, "n_splits", at_least=2)
    rule = scoring_rule(np.unique(classes), healthy=healthy, **stated_costs(estimator))
    labels = [rule.family_of[label] for label in classes.tolist()]
    groupings = read_groupings(X, runs, units, conditions)
    schemes = all_schemes(classes, labels, groupings, splits, n_splits)
    held_out = decide_held_out(estimator, X, classes, schemes, groupings)
    result = score_held_out(held_out, rule)
    by_unit = groupings["units"]
    if by_unit is not None and single_unit_labels(labels, by_unit.labels.tolist()):
        warn("single units", result.caveats[0], stacklevel=2)
    return result
