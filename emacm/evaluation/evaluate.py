"""What different ways of holding out say of a classifier, side by side.

A random split asks how well recordings are told apart that stand beside near copies of
themselves. Whoever wants to know about the next run, the next machine or a load never seen must
hold out runs, machines or loads. `evaluate` does all of it and says what none of it can tell.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.multiclass import check_classification_targets

from emacm._checks import check_classes, check_count, once_hint
from emacm.decisions.families import as_families
from emacm.decisions.stated_costs import stated_cost
from emacm.evaluation.bootstrap import check_limits
from emacm.evaluation.caveats import scheme_caveats
from emacm.evaluation.confounding import confounding, single_unit_labels
from emacm.evaluation.held_out_decisions import decide_held_out
from emacm.evaluation.results import Evaluation, gathered, scored
from emacm.evaluation.schemes import Scheme, given_scheme, group_scheme, random_scheme
from emacm.evaluation.scoring import scoring_rule
from emacm.recordings.meta import Grouping, read_grouping

_ROLES = {"runs": "run", "units": "unit", "conditions": "condition"}


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
    n_splits: int = 10,
    confidence: float = 0.95,
    n_resamples: int = 2000,
    random_state: int | None = 0,
    n_jobs: int | None = None,
) -> Evaluation:
    """Evaluate a classifier by a random split, and by run, by unit and by condition beside it.

    In each fold a clone is fitted to the rest and decides on what is held out; nothing is
    learnt from recordings held out. Limits come from resampling whole groups, as recordings of
    a run are near copies.

    Parameters
    ----------
    estimator : estimator
        Classifier or pipeline; it is not changed.
    X : sequence of Recording, or array-like of n_recordings
        What the estimator takes.
    y : array-like of shape (n_recordings,)
        True classes.
    runs : key, tuple of keys, callable or array-like of shape (n_recordings,), optional
        Run of each recording: a key of `meta` (a column, if X is a DataFrame), a tuple of keys,
        a function of the recording, or an array. Recordings of one run are held out together.
    units : key, tuple of keys, callable or array-like of shape (n_recordings,), optional
        Machine or assembly of each recording.
    conditions : key, tuple of keys, callable or array-like of shape (n_recordings,), optional
        Operating condition, such as load; each is left out in turn. An estimator that refuses
        conditions it never saw is not scored by it.
    splits : mapping of str to split, optional
        Further ways of holding out, by name: a tuple (train, test) of numbers or masks, as for
        "later runs"; a list of such tuples; or an object with ``split(X, y, groups)``.
    families : mapping, optional
        {class: family} or {family: [classes]}. A decision for the right family is right,
        whether the estimator decides on classes or on families. Default: where the rows of the
        cost are not the classes, the decision that costs 0 is right.
    healthy : object, optional
        The healthy class or family. Without it these three rates are not computed.
    cost : array-like, DataFrame or mapping, optional
        Rows are decisions, columns truths, as for `emacm.decisions.costs.cost_table`; columns
        may be families. Default: the `cost` among the estimator's parameters (several that differ
        are an error); without any, 0-1.
    n_splits : int, default=10
        Folds of the random split, at least 2. With no more groups (or units) than this, one is
        left out at a time.
    confidence : float, default=0.95
        Probability that limits are to hold.
    n_resamples : int, default=2000
        How many times groups are drawn for the limits, at least 100.
    random_state : int or None, default=0
        Seed of the random split and of the limits.
    n_jobs : int, optional
        Folds in work at the same time, under joblib's active backend (by default, processes).

    Returns
    -------
    Evaluation
        Figures are shares 0..1: balanced accuracy (mean of the shares recognised of each label),
        accuracy; with `healthy`, false alarm rate (share of the healthy decided to be faulty),
        inspection rate (share of the healthy with a decision that is no label, such as "inspect")
        and missed detection rate (share of the faulty decided to be healthy); the expected cost
        in the unit of `cost`; and with `predict_proba`, log-loss [nats] and Brier score (0..2).

    Warns
    -----
    UserWarning
        If some label occurs in one unit alone.

    Raises
    ------
    TypeError, ValueError
        If an input does not fit; or what the estimator raises, with the fold named.

    Notes
    -----
    Where holding out takes all recordings of a label out of training, that scheme cannot be
    scored; its row is NaN and a caveat says which group and label. For the limits see
    `emacm.evaluation.bootstrap.group_intervals`: runs are drawn (units, if no `runs` are
    given, and for the split by unit); without either, recordings are, and a caveat says so.
    Limits tell how the figure varies with the recordings held out, not with those learnt from.

    Posteriors of a classifier whose priors are not the shares of the classes here will, rightly,
    seem ill calibrated.

    Examples
    --------
    >>> from sklearn.neighbors import KNeighborsClassifier
    >>> rng = np.random.default_rng(2)
    >>> X = np.repeat(rng.normal(size=(10, 2)), 9, axis=0)  # 10 runs of 9 copies
    >>> y = np.repeat(["healthy", "worn"] * 5, 9)  # unrelated to X
    >>> runs = pd.Series(np.repeat(np.arange(10), 9), name="run")
    >>> found = evaluate(KNeighborsClassifier(1), X, y, runs=runs, healthy="healthy")
    >>> found.table["accuracy"].to_dict()
    {'random split': 1.0, 'by run': 0.5}
    """
    for method in ("fit", "predict"):
        if isinstance(estimator, type) or not hasattr(estimator, method):
            raise TypeError(f"estimator must be a classifier, with {method}; got {estimator!r}.")
    classes = _checked_classes(y, X)
    check_count(n_splits, "n_splits", at_least=2)
    check_limits(confidence, n_resamples)
    if random_state is not None:
        check_count(random_state, "random_state", at_least=0)
    cost = stated_cost(estimator) if cost is None else cost
    rule = scoring_rule(np.unique(classes), families=families, healthy=healthy, cost=cost)
    labels = as_families(classes.tolist(), rule.family_of)
    known = {
        role: read_grouping(values, X, role, _ROLES[role])
        for role, values in zip(_ROLES, (runs, units, conditions), strict=True)
    }
    schemes = _schemes(classes, labels, known, splits, n_splits=n_splits, seed=random_state)
    limits = {"confidence": confidence, "n_resamples": n_resamples, "random_state": random_state}
    schemes, decided = decide_held_out(estimator, X, classes, schemes, n_jobs=n_jobs)
    parts = [
        None if scheme.impossible else scored(scheme, folds, classes, rule, limits)
        for scheme, folds in zip(schemes, decided, strict=True)
    ]
    caveats = scheme_caveats(schemes, parts, rule)
    if (unit := known["units"]) is not None:
        caveats = [*confounding(labels, unit.labels.tolist(), unit.name), *caveats]
        if single_unit_labels(labels, unit.labels.tolist()):
            warnings.warn(caveats[0], UserWarning, stacklevel=2)
    return gathered(schemes, parts, caveats)


def _schemes(
    y: NDArray[Any],
    labels: list[Any],
    known: Mapping[str, Grouping | None],
    splits: Mapping[str, Any] | None,
    **options: Any,
) -> list[Scheme]:
    """Return every scheme that can be made of what was given; the random split always."""
    runs, units, conditions = known.values()
    singly = Grouping("recording", np.arange(len(y)))
    resampled = runs or units or singly
    schemes = [random_scheme(y, labels, resampled, **options)]
    if runs is not None:
        schemes.append(group_scheme(y, labels, runs, runs, **options))
    if units is not None:
        schemes.append(group_scheme(y, labels, units, units, **options))
    if conditions is not None:
        singles = options | {"n_splits": None}
        left_out = group_scheme(y, labels, conditions, resampled, **singles)
        schemes.append(replace(left_out, may_refuse=True))
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
            f"two ways of holding out are both called {doubles[0]!r}; runs, units, conditions "
            f"and splits need names of their own."
        )
    return schemes


def _checked_classes(y: ArrayLike, X: Any) -> NDArray[Any]:
    if not (hasattr(X, "shape") or hasattr(X, "__len__")):
        raise TypeError(
            f"X must be a list of recordings or a table, got {type(X).__name__}.{once_hint(X)}"
        )
    n_recordings = X.shape[0] if hasattr(X, "shape") else len(X)
    classes = np.asarray(y)
    if classes.shape != (n_recordings,):
        raise ValueError(
            f"y must hold one class for each of {n_recordings} recordings in X, got shape "
            f"{classes.shape}."
        )
    missing = np.flatnonzero(pd.isna(classes))
    if len(missing):
        raise ValueError(f"y must name a class for every recording; {missing[0]} has none.")
    check_classes(y)
    check_classification_targets(classes)
    if len(np.unique(classes)) < 2:
        raise ValueError(f"y must hold two classes at the least, got {np.unique(classes)} only.")
    return classes
