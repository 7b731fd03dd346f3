"""Costs of decisions: the forms in which they are given, and the table that results.

Orientation, everywhere: rows are decisions, columns are true classes. ``cost[i, k]`` is the cost
of deciding ``i`` when ``k`` is true, C(w_i | w_k) in [1]_, Eqs. (2.39) and (2.48).

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_number
from emacm.decisions.pipelines import final_estimator, parts_of
from emacm.decisions.truths import check_distinct, label_array, plain_labels, truth_labels


def cost_table(
    cost: Any, classes: ArrayLike, unknown: Any = None
) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Convert any form of stating costs to decisions and a matrix.

    Parameters
    ----------
    cost : None, array-like, DataFrame or mapping
        - None: 0 for the correct decision, 1 for any other, Eq. (2.47).
        - Square array: rows are decisions, columns are true classes, both in the order of
          `classes` (followed by the unknown state, or without it).
        - DataFrame: index = decisions, columns = classes, in any order. The index need
          not contain the classes: "operate" and "take out of service" may be the only decisions.
        - Mapping {(decision, true class): cost}: all other entries are 0 or 1.

        A decision that is not a class ("inspect") needs a cost for every class. Costs may be
        negative (a gain); their unit is arbitrary.
    classes : array-like of shape (n_classes,)
        The possible true classes, each once.
    unknown : label, default=None
        Label of the unknown state, one more decision and true state; None: there is none. What
        `cost` does not state of it: if the true state is unknown, deciding a class, or any decision
        that is the cheapest for some class, costs what the best of them costs at worst (minimax),
        above the right decision; and any other ("inspect") its largest cost for a class, above that
        of the right decision. Deciding "unknown" costs under each true state what "inspect" costs
        there, because an unknown state has to be looked at (of several such decisions, the one that
        costs least if the true state is unknown, and less than any class). Without such a decision
        it costs 0 if it is true, and otherwise that minimax cost more than the right decision.
        A constant for one true class, or another unit of all costs, thus changes no decision.

    Returns
    -------
    decisions : ndarray of shape (n_decisions,)
        Labels of the rows. Mapping: the classes, `unknown`, then other decisions as they appear;
        DataFrame: its index, then `unknown`. The dtype is that of `classes` if all decisions are
        classes.
    matrix : ndarray of shape (n_decisions, n_truths)
        Cost of each decision under each true state: `classes`, then `unknown`.

    Raises
    ------
    ValueError
        If the shape is wrong, a class is unknown, missing or named twice, a cost is not
        finite, or a decision that is not a class lacks the cost of a class.
    TypeError
        If a cost is text, complex or a bool, or a key of a mapping is not a pair.

    Examples
    --------
    >>> decisions, matrix = cost_table(
    ...     {("healthy", "worn"): 10, ("inspect", "healthy"): 0.5, ("inspect", "worn"): 0.4},
    ...     ["healthy", "worn"],
    ...     unknown="new",
    ... )
    >>> decisions.tolist()
    ['healthy', 'worn', 'new', 'inspect']
    >>> matrix
    array([[ 0. , 10. ,  1. ],
           [ 1. ,  0. ,  1. ],
           [ 0.5,  0.4,  0.5],
           [ 0.5,  0.4,  0.5]])
    """
    labels = np.asarray(classes)
    known = plain_labels(labels.tolist())
    check_distinct(known, "classes")
    every = truth_labels(labels, unknown)
    truths = plain_labels(every.tolist())
    rows, stated = _stated_pairs(cost, known, truths)
    _check_labels(rows, stated, known, truths)
    matrix = np.empty((len(rows), len(truths)))
    for (i, decision), (k, truth) in itertools.product(enumerate(rows), enumerate(truths)):
        name = f"the cost of deciding {decision!r} when {truth!r} is true"
        matrix[i, k] = check_number(stated.get((decision, truth), float(decision != truth)), name)
    if unknown is not None:
        others = np.array([row != unknown for row in rows])
        least = matrix[others, :-1].min(axis=0)  # of the right decisions
        above = matrix[:, :-1] - least
        names_states = (above == 0).any(axis=1) | [decision in truths for decision in rows]
        wrong = above[others & names_states].max(axis=1).min() or 1.0
        for row, decision in enumerate(rows):
            if decision != unknown and (decision, unknown) not in stated:
                matrix[row, -1] = wrong if names_states[row] else above[row].max()
        for k, truth in enumerate(known):
            if (unknown, truth) not in stated:
                matrix[rows.index(unknown), k] = least[k] + wrong
        cheapest = np.lexsort((~names_states, matrix[:, -1], ~others))[0]  # a class, if as cheap
        if not names_states[cheapest]:  # an inspection
            is_default = [(unknown, truth) not in stated for truth in truths]
            matrix[rows.index(unknown), is_default] = matrix[cheapest, is_default]
    return label_array(rows, every), matrix


def stated_costs(estimator: Any) -> dict[str, Any]:
    """Return the cost by which an estimator decides, its unknown state and its priors.

    They are those of the last step of pipelines and searches. Costs and priors of an estimator
    inside of that step (a member of a `PosteriorProduct`, for example) do not count; its unknown
    state does.

    Returns
    -------
    dict
        "cost", "unknown" and "priors"; None if they are not stated.

    Raises
    ------
    ValueError
        If the last step has no costs, but a classifier inside of it has, which decides nothing.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from emacm import CostSensitiveGaussianBayes
    >>> model = CostSensitiveGaussianBayes(unknown="unknown", priors="uniform")
    >>> stated_costs(make_pipeline(model))
    {'cost': None, 'unknown': 'unknown', 'priors': 'uniform'}
    """
    final = final_estimator(estimator)
    for inner in parts_of(final):
        if not hasattr(final, "cost") and getattr(inner, "cost", None) is not None:
            raise ValueError(
                f"the cost of {type(inner).__name__} has no effect on decisions of "
                f"{type(final).__name__}. Use LeastRiskClassifier({type(final).__name__}(...), "
                f"cost=...)."
            )
    return {name: getattr(final, name, None) for name in ("cost", "unknown", "priors")}


def narrowed(model: Any, known: Iterable[Any], classes: Iterable[Any]) -> Any:
    """Remove classes that do not occur from all costs and priors of an estimator, nested ones too.

    The posterior probability of a class that is absent from training is 0, and so is its
    contribution to every expected cost, Eq. (2.39) of [1]_: removing its column changes no
    decision among those that remain. Priors of the other classes are normalised; that of the
    unknown state stays.

    Parameters
    ----------
    model : estimator
        It is changed; pass a clone. Of a cost, a DataFrame keeps every decision, a mapping loses
        the pairs that name an absent class, an array its rows and columns. What does not fit the
        classes stays as it is.
    known, classes : iterable of labels
        Classes that occur, and all classes, sorted.

    Returns
    -------
    estimator
        The same object.

    Examples
    --------
    >>> from emacm import CostSensitiveGaussianBayes
    >>> model = CostSensitiveGaussianBayes({("ok", "worn"): 10, ("ok", "dry"): 5})
    >>> narrowed(model, ["dry", "ok"], ["dry", "ok", "worn"])
    CostSensitiveGaussianBayes(cost={('ok', 'dry'): 5})
    """
    every, occurring = plain_labels(classes), plain_labels(known)
    absent = {place: label for place, label in enumerate(every) if label not in occurring}
    of_some = {"cost": _cost_of_some, "priors": _priors_of_some}
    for name, value in model.get_params().items() if absent else ():
        parameter = name.rpartition("__")[2]
        if parameter in of_some:
            model.set_params(**{name: of_some[parameter](value, absent, every)})
    return model


def _cost_of_some(cost: Any, absent: Mapping[int, Any], every: Sequence[Any]) -> Any:
    """Remove absent classes, given by their place."""
    n_classes = len(every)
    if isinstance(cost, pd.DataFrame):
        return cost.drop(columns=[*absent.values()], errors="ignore")
    if isinstance(cost, Mapping):
        check_pairs(cost)
        named = set(absent.values())
        return {pair: value for pair, value in cost.items() if not named & set(pair)}
    if np.shape(cost) not in {(n_classes,) * 2, (n_classes + 1,) * 2}:  # such as None
        return cost
    return np.delete(np.delete(cost, [*absent], axis=0), [*absent], axis=1)


def _priors_of_some(priors: Any, absent: Mapping[int, Any], every: Sequence[Any]) -> Any:
    """Remove absent classes, given by their place; the unknown state keeps its probability."""
    is_named = isinstance(priors, Mapping | pd.Series)
    if not is_named and np.shape(priors) not in {(len(every),), (len(every) + 1,)}:
        return priors  # such as "uniform"
    labels = None if is_named else [*every, "the unknown state"][: len(priors)]
    kept = pd.Series(dict(priors) if is_named else priors, labels)
    kept = kept.drop([*absent.values()], errors="ignore")
    is_class = kept.index.isin(every)
    if not kept[is_class].sum() > 0:
        return priors
    kept[is_class] *= (1 - kept[~is_class].sum()) / kept[is_class].sum()
    return kept.to_dict() if is_named else kept.to_numpy()


def check_pairs(cost: Mapping[Any, Any]) -> None:
    """Raise a TypeError if a key of a cost is not a tuple (decision, true class)."""
    for key in cost:
        if not (isinstance(key, tuple) and len(key) == 2):
            raise TypeError(
                f"the keys of a cost mapping must be tuples (decision, true class), got {key!r}."
            )


def numbered_classes_hint(label: Any, classes: Sequence[Any]) -> str:
    """Return the remedy where scikit-learn has numbered the classes, and `label` is a name.

    Examples
    --------
    >>> numbered_classes_hint("worn", ["healthy", "screw"])
    ''
    """
    if not isinstance(label, str) or any(isinstance(known, str) for known in classes):
        return ""
    return (
        " Meta-estimators of scikit-learn pass classes as numbers. State costs and priors outside: "
        "LeastRiskClassifier(VotingClassifier(...), cost=..., priors=...). "
        'cross_val_predict(method="predict_proba") needs no costs, and priors as an array.'
    )


def _stated_pairs(
    cost: Any, known: list[Any], truths: list[Any]
) -> tuple[list[Any], dict[tuple[Any, Any], Any]]:
    """Return the decisions, and the costs that are stated, {(decision, true state): cost}."""
    if cost is None:
        return truths, {}
    if isinstance(cost, Mapping):
        check_pairs(cost)
        pairs = {tuple(plain_labels(pair)): value for pair, value in cost.items()}
        return list(dict.fromkeys([*truths, *(decision for decision, _ in pairs)])), pairs
    if isinstance(cost, pd.DataFrame):
        _check_axes(cost)
        rows, columns = plain_labels(cost.index), plain_labels(cost.columns)
        check_distinct(rows, "decisions in the index of cost")
        check_distinct(columns, "classes in the columns of cost")
        missing = [label for label in known if label not in columns]
        if (missing and set(columns) <= set(truths)) or not rows:
            raise ValueError(
                f"cost must have at least one decision (row), and one column for every class "
                f"(columns are the truth); missing: {missing}. Its columns are {columns}."
            )
        values = cost.to_numpy()
    else:
        values = _square(cost, known, truths)
        rows = columns = truths[: len(values)]
    own = truths[len(known) :]  # the unknown state comes last
    pairs = dict(zip(itertools.product(rows, columns), values.ravel().tolist(), strict=True))
    return [*(row for row in rows if row not in own), *own], pairs


def _check_axes(cost: pd.DataFrame) -> None:
    """Raise a ValueError if the names of the axes say that rows are the true classes."""
    if _meaning(cost.index.name) == "truth" or _meaning(cost.columns.name) == "decision":
        raise ValueError(
            f"the axes of cost are named {cost.index.name!r} (rows) and {cost.columns.name!r} "
            "(columns), but rows are decisions and columns truths. Give cost.T (rows and columns "
            "exchanged), or other names."
        )


def _meaning(name: Any) -> str:
    """Return "truth" or "decision", whichever the name of an axis says first; or ""."""
    meanings = dict.fromkeys(("true", "truth", "actual", "state", "wahr", "zustand"), "truth")
    meanings |= dict.fromkeys(("decision", "decided", "pred", "action"), "decision")
    meanings |= dict.fromkeys(("entsch", "vorher"), "decision")  # entschieden, vorhergesagt
    words = re.findall(r"[^\W\d_]+", str(name).lower())
    found = (mean for word in words for begin, mean in meanings.items() if word.startswith(begin))
    return next(found, "")


def _square(cost: Any, known: list[Any], truths: list[Any]) -> NDArray[Any]:
    """Return costs that are given as an array, in the order of the classes."""
    try:
        array = np.asarray(cost)
    except ValueError as error:
        raise ValueError(f"cost must be a rectangular array of numbers: {error}.") from error
    if array.shape not in {(len(known),) * 2, (len(truths),) * 2}:
        raise ValueError(
            f"cost must be a square array of shape {(len(known),) * 2}, rows = decisions and "
            f"columns = true classes in the order of the classes {known}; got shape {array.shape}. "
            f"Decisions that are not classes need names: pass a DataFrame."
        )
    return array


def _check_labels(
    rows: list[Any], stated: dict[tuple[Any, Any], Any], known: list[Any], truths: list[Any]
) -> None:
    """Raise a ValueError if a label of a cost is missing or unknown, or a cost is not stated."""
    for _, truth in stated:
        if truth not in truths:
            text = f"cost names the class {truth!r} as a truth, which is unknown. Known: {truths}."
            raise ValueError(text + numbered_classes_hint(truth, known))
    for decision in rows:
        missing = [truth for truth in known if (decision, truth) not in stated]
        if decision not in truths and missing:
            raise ValueError(
                f"cost contains the decision {decision!r}, which is none of the classes {known}: "
                f"it then needs a cost for every class; missing: {missing}."
            )
