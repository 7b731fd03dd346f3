"""Hold-out schemes compared: performance on the next run, the next unit, a new condition.

A random split estimates the performance on recordings with near copies in the training data. To
estimate performance on the next run, the next machine or a new load, hold out whole runs, machines
or loads. `evaluate` scores all of these schemes and lists the limits of the conclusions.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.multiclass import check_classification_targets

from emacm._checks import check_count, once_hint
from emacm.decisions.costs import stated_cost, stated_truths
from emacm.decisions.labels import check_classes
from emacm.decisions.pipelines import groups_are_units
from emacm.evaluation.bootstrap import check_bootstrap
from emacm.evaluation.caveats import (
    confounding_caveats,
    novelty_caveats,
    scheme_caveats,
    single_unit_labels,
)
from emacm.evaluation.held_out import decide_held_out
from emacm.evaluation.novelty import left_out_families, score_novelty
from emacm.evaluation.nuisances import nuisance_caveats, nuisance_table, read_nuisances
from emacm.evaluation.results import Evaluation
from emacm.evaluation.scheme_scores import gather
from emacm.evaluation.schemes import all_schemes, strictest_scheme
from emacm.evaluation.scoring import scoring_rule
from emacm.recordings.meta import read_grouping

_ROLES = {"runs": "run", "units": "unit", "conditions": "condition"}
_FOLDS_OF_FAMILY = 5  # largest number of folds for each family that is left out


def evaluate(
    estimator: Any,
    X: Any,
    y: ArrayLike,
    *,
    runs: Any = None,
    units: Any = None,
    conditions: Any = None,
    splits: Mapping[str, Any] | None = None,
    families: Mapping[Any, Any] | None = None,
    healthy: Any = None,
    cost: Any = None,
    nuisances: Any = None,
    unknown_families: bool | None = None,
    n_splits: int = 10,
    confidence: float = 0.95,
    n_resamples: int = 2000,
    random_state: int | None = 0,
    n_jobs: int | None = None,
    verbose: bool | int = False,
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
    families : mapping, optional
        {class: family} or {family: [classes]}. A decision for the right family is correct,
        whether the estimator decides on classes or on families. Default: defined by the cost, as
        in `emacm.decisions.metrics.correct_decisions`.
    healthy : object, optional
        The healthy class or family. Without it the three rates are not computed.
    cost : array-like, DataFrame or mapping, optional
        Rows are decisions, columns true classes, as for `CostSensitiveGaussianBayes`;
        columns may be families. Default: the `cost` among the estimator's parameters (several
        that differ are an error); without any, 0-1.
    nuisances : sequence of keys or mapping, optional
        Properties that should not matter, such as ``("day", "fs")``: keys of `meta`, tuples of
        keys or functions; a mapping of names to them or to arrays. `Evaluation.nuisances` states
        how well each predicts the label by itself, and the score within one of its levels. "fs" is
        the sampling rate.
    unknown_families : bool, optional
        Whether to leave each family of faults out of training in turn, to test whether it is
        recognised as unknown; at most five folds for each family. Default: if the classifier has an
        unknown state.
    n_splits : int, default=10
        Largest number of folds, at least 2. Up to this number of runs (or units), one is left out
        at a time.
    confidence : float, default=0.95
        Confidence level of the intervals.
    n_resamples : int, default=2000
        Number of bootstrap draws, 100 to 1,000,000.
    random_state : int or None, default=0
        Seed of the random split and of the bootstrap.
    n_jobs : int, optional
        Number of folds processed in parallel, by joblib's active backend (default: processes).
    verbose : bool or int, default=False
        Report to stderr how many folds are done, and the time left.

    Returns
    -------
    Evaluation
        Balanced accuracy (mean over the labels of the fraction recognised) and accuracy. With
        `healthy`: false alarm rate (fraction of the healthy recordings decided to be faulty),
        inspection rate (fraction of them with a decision that is not a label, such as "inspect"
        or "unknown") and missed detection rate (fraction of the faulty recordings decided to be
        healthy, or any other that is correct for the healthy state). Mean cost of a decision on
        these recordings (``expected_cost``), in the unit of `cost`. With `predict_proba`: mean cost
        that was paid (``realised_cost``) and mean cost that the probabilities predict for the same
        decisions (``predicted_cost``), where the true classes have the classifier's `priors` as
        weights; log loss [nats], Brier score (0 to 2) and expected calibration error (0 to 1): the
        mean over the recordings of the difference of confidence and frequency in ten bins of equal
        width of the highest posterior [1]_.

    Warns
    -----
    UserWarning
        If a label occurs in one unit only.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid; or an error of the estimator, with the fold.

    Notes
    -----
    If a label is held out without being in the training data, the scheme cannot be scored; its row
    is NaN and a caveat gives the group and the label. The bootstrap
    (`emacm.evaluation.bootstrap.group_intervals`) draws runs, or units if no `runs` are given and
    for the split by unit; without either it draws recordings, and a caveat says so. The intervals
    cover the variation of the recordings held out, not that of the training data.

    Families of faults are left out, and nuisances alone are scored, in the split by unit, or, if
    there is none or it cannot be scored, by run, or at random. A nuisance predicts the label that
    is the most frequent in its level, relative to the frequency of the label. The score within
    one level is that of the same decisions, counted among recordings of the level: a classifier
    that recognises the day only has a score of chance within one day.

    A classifier whose priors differ from the class frequencies of these recordings is, correctly,
    not calibrated on them. The calibration error of few recordings is too large, because chance
    differences add up; its interval describes its variation only.

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
    """
    for method in ("fit", "predict"):
        if isinstance(estimator, type) or not hasattr(estimator, method):
            raise TypeError(f"estimator must be a classifier with {method}, got {estimator!r}.")
    classes = _checked_classes(y, X)
    check_count(n_splits, "n_splits", at_least=2)
    check_bootstrap(confidence, n_resamples)
    if random_state is not None:
        check_count(random_state, "random_state", at_least=0, at_most=2**32 - 1)
    cost = stated_cost(estimator) if cost is None else cost
    unknown, priors = stated_truths(estimator)
    stated = {"healthy": healthy, "cost": cost, "unknown": unknown, "priors": priors}
    rule = scoring_rule(np.unique(classes), families=families, **stated)
    labels = [rule.family_of[label] for label in classes.tolist()]
    groupings = {
        role: read_grouping(values, X, role, _ROLES[role])
        for role, values in zip(_ROLES, (runs, units, conditions), strict=True)
    }
    schemes = all_schemes(classes, labels, groupings, splits, n_splits, random_state)
    properties = read_nuisances(nuisances, X)
    leave_out = []
    if unknown is not None and unknown_families is not False:
        fewer = min(n_splits, _FOLDS_OF_FAMILY), random_state
        divided = strictest_scheme(all_schemes(classes, labels, groupings, None, *fewer), groupings)
        leave_out = [] if divided is None else left_out_families(divided, labels, rule)
    roles = ("units", "runs") if groups_are_units(estimator) else ("runs", "units")
    together = groupings[roles[0]] or groupings[roles[1]]
    done, decided = decide_held_out(
        estimator,
        X,
        classes,
        [*schemes, *leave_out],
        groups=None if together is None else together.labels,
        n_jobs=n_jobs,
        verbose=verbose,
    )
    bootstrap = {
        "confidence": float(confidence),
        "n_resamples": n_resamples,
        "random_state": random_state,
    }
    n_schemes = len(schemes)
    schemes, folds = done[:n_schemes], decided[:n_schemes]
    novelty = score_novelty(done[n_schemes:], decided[n_schemes:], classes, rule, bootstrap)
    result = gather(schemes, folds, classes, rule, bootstrap)
    table = nuisance_table(
        properties, strictest_scheme(schemes, groupings), labels, result.predictions, bootstrap
    )
    unseen = [] if unknown_families is False else novelty_caveats(novelty.table, novelty.refused)
    caveats = scheme_caveats(schemes, result.table, rule, unseen)
    if (unit := groupings["units"]) is not None:
        names = unit.labels.tolist()
        caveats = [*confounding_caveats(labels, names, unit.name), *caveats]
        if single_unit_labels(labels, names):
            warnings.warn(caveats[0], UserWarning, stacklevel=2)
    return replace(
        result,
        caveats=[*nuisance_caveats(table, len(classes)), *caveats],
        novelty=novelty.table,
        novelty_predictions=novelty.predictions,
        nuisances=table,
    )


def _checked_classes(y: ArrayLike, X: Any) -> NDArray[Any]:
    if isinstance(X, str | Mapping) or not (hasattr(X, "shape") or hasattr(X, "__len__")):
        raise TypeError(
            f"X must be a list of recordings or a table, got {type(X).__name__}.{once_hint(X)}"
        )
    n_recordings = X.shape[0] if hasattr(X, "shape") else len(X)
    classes = np.asarray(y)
    if classes.shape != (n_recordings,):
        raise ValueError(
            f"y must contain one class for each of {n_recordings} recordings in X, got shape "
            f"{classes.shape}."
        )
    check_classes(y)
    check_classification_targets(classes)
    if len(np.unique(classes)) < 2:
        raise ValueError(f"y must contain at least two classes, got {np.unique(classes)}.")
    return classes
