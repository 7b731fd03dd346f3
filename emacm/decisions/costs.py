"""What a decision follows from besides the features: labels, true states, priors and costs.

The true states are the classes and the unknown state, which has no recordings: "Unhealthy -
Unknown" in Eq. (2.35) of [1]_. Its probability follows from typicality
(`emacm.decisions.typicality`) by `unknown_probability`.

Orientation of costs, everywhere: rows are decisions, columns are true classes. ``cost[i, k]`` is
the cost of deciding ``i`` when ``k`` is true, C(w_i | w_k) in [1]_, Eqs. (2.39) and (2.48).

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_choice, check_number, check_real_array, check_unmasked

Array = NDArray[np.float64]


def plain_labels(labels: Iterable[Any]) -> list[Any]:
    """Return labels as Python objects, so that those of numpy compare and hash alike.

    Examples
    --------
    >>> plain_labels(np.array(["worn", "new"]))
    ['worn', 'new']
    """
    return [label.item() if isinstance(label, np.generic) else label for label in labels]


def label_list(labels: ArrayLike, name: str = "y") -> list[Any]:
    """Return a one-dimensional array-like of labels as a list of Python objects.

    A mixed list such as ``[0, "inspect"]`` keeps its numbers; numpy would turn them into text.

    Raises
    ------
    ValueError
        If `labels` is not one-dimensional, or a label is missing (the message gives its position).

    Examples
    --------
    >>> label_list([0, "inspect"])
    [0, 'inspect']
    """
    array = np.asarray(labels, dtype=object if isinstance(labels, list | tuple) else None)
    if array.ndim != 1:
        raise ValueError(f"{name} must be one-dimensional, got shape {array.shape}.")
    missing = pd.isna(array)
    if missing.any():
        position = int(np.argmax(missing))
        raise ValueError(
            f"{name} must contain a label everywhere, but position {position} has "
            f"{array[position]!r}. Leave such entries out."
        )
    return plain_labels(array.tolist())


def label_array(labels: Sequence[Any], classes: ArrayLike = ()) -> NDArray[Any]:
    """Return labels as an array that keeps their types.

    Parameters
    ----------
    labels : sequence
        Python objects.
    classes : array-like of shape (n_classes,), optional
        If all labels are classes, the array has the dtype of `classes`.

    Returns
    -------
    ndarray of shape (n_labels,)
        Of text or integers if all labels are, otherwise of objects.

    Examples
    --------
    >>> label_array([0, "inspect"])
    array([0, 'inspect'], dtype=object)
    """
    known = np.asarray(classes)
    place = {label: number for number, label in enumerate(known.tolist())}
    if all(label in place for label in labels):
        return known[[place[label] for label in labels]]
    for kind in (str, int):
        if all(type(label) is kind for label in labels):
            return np.array(labels)
    array = np.empty(len(labels), dtype=object)
    array[:] = labels
    return array


def label_positions(found: Sequence[Any], known: Sequence[Any], name: str, role: str) -> list[int]:
    """Return the position of each label in `known`.

    Raises
    ------
    ValueError
        If a label is not in `known`; the message gives its position and its `role`.

    Examples
    --------
    >>> label_positions(["worn", "new"], ["new", "worn"], "y_true", "class")
    [1, 0]
    """
    place = {label: position for position, label in enumerate(known)}
    for position, label in enumerate(found):
        if label not in place:
            raise ValueError(
                f"{name} contains {label!r} at position {position}, which is not a known {role}. "
                f"Known: {list(known)}."
            )
    return [place[label] for label in found]


def check_distinct(labels: Sequence[Any], name: str) -> None:
    """Raise a ValueError if a label occurs more than once."""
    doubles = [label for label in dict.fromkeys(labels) if labels.count(label) > 1]
    if doubles:
        raise ValueError(f"{name} must be unique, but these occur more than once: {doubles}.")


def check_classes(y: Any) -> None:
    """Raise if a recording has no class, or a class of another type than the first.

    numpy turns a list that contains text and a missing label or a number into text, and so
    creates a class "nan".

    Raises
    ------
    ValueError
        If a label is None, NaN, pandas.NA or NaT; the message gives its position.
    TypeError
        If text and other labels are mixed.

    Examples
    --------
    >>> check_classes(["healthy", "worn"])
    """
    check_unmasked(y, "y")
    entries = y if isinstance(y, list | tuple) else np.asarray(y)
    if np.ndim(entries) != 1:
        return  # scikit-learn accepts columns, and refuses tables
    labels = label_list(entries)
    for position, label in enumerate(labels):
        if isinstance(label, str) != isinstance(labels[0], str):
            raise TypeError(
                f"y must contain classes of one type, text or numbers, but position 0 has "
                f"{labels[0]!r} and position {position} has {label!r}."
            )


def class_priors(priors: Any, classes: NDArray[Any], counts: Array) -> Array:
    """Convert any form of stating priors to one probability per class, Eq. (2.37) of [1]_.

    Parameters
    ----------
    priors : None, "uniform", array-like or mapping
        None: relative frequencies of the counts. An array is in the order of `classes`; a
        mapping or Series {class: probability} names every class.
    classes : ndarray of shape (n_classes,)
        The classes.
    counts : ndarray of shape (n_classes,)
        Recordings of each class.

    Returns
    -------
    probabilities : ndarray of shape (n_classes,)
        Their sum is 1.

    Raises
    ------
    ValueError
        If they are negative, their sum is not 1 (to 1e-6), or they do not fit the classes.
    TypeError
        If they are not numbers.

    References
    ----------
    .. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
       Condition Monitoring, section 2.2.1.

    Examples
    --------
    >>> class_priors({"worn": 0.01, "healthy": 0.99}, np.array(["healthy", "worn"]), np.ones(2))
    array([0.99, 0.01])
    """
    known = classes.tolist()
    if priors is None:
        return counts / counts.sum()
    if isinstance(priors, str):
        check_choice(priors, "priors as a word", ("uniform",))
        return np.full(len(known), 1 / len(known))
    if isinstance(priors, Mapping | pd.Series):
        named = dict(priors.items())
        unknown = [label for label in named if label not in known]
        if unknown or len(named) < len(known):
            raise ValueError(
                f"priors must name every class of {known} and no other; unknown: {unknown}, "
                f"missing: {[label for label in known if label not in named]}."
            )
        priors = [named[label] for label in known]
    values = check_real_array(priors, "priors").astype(np.float64)
    if values.shape != (len(known),) or not (values >= 0).all() or abs(values.sum() - 1) > 1e-6:
        raise ValueError(
            f"priors must contain one probability, at least 0, for each of the {len(known)} "
            f"classes {known}, and add up to 1; got {values.tolist()}."
        )
    return values / values.sum()


def check_possible(
    priors: Array, own: Array, classes: NDArray[Any], name: str = "estimator"
) -> None:
    """Raise a ValueError if a class has a prior, but none within the posterior of an estimator.

    Parameters
    ----------
    priors, own : ndarray of shape (n_classes,)
        Priors in effect, and those within the posterior of the estimator.
    classes : ndarray of shape (n_classes,)
        The classes.
    name : str
        Name of the estimator, for the message.
    """
    impossible = (priors > 0) & ~(own > 0)
    if impossible.any():
        code = int(np.argmax(impossible))
        raise ValueError(
            f"{name} has the prior 0 of class {classes.tolist()[code]!r}, but priors give it "
            f"{priors[code]:g}. Give {name} another prior."
        )


def truth_labels(classes: NDArray[Any], unknown: Any) -> NDArray[Any]:
    """Return the classes, followed by the unknown state unless it is None.

    Raises
    ------
    TypeError, ValueError
        If the unknown state has no label (a list, NaN), or the label of a class.

    Examples
    --------
    >>> truth_labels(np.array(["healthy", "worn"]), "unknown")
    array(['healthy', 'worn', 'unknown'], dtype='<U7')
    """
    if unknown is None:
        return classes
    if not isinstance(unknown, Hashable) or unknown != unknown:
        raise TypeError(f"unknown must be a label such as 'unknown', or None; got {unknown!r}.")
    known = plain_labels(classes.tolist())
    if unknown in known:
        raise ValueError(f"unknown = {unknown!r} is a class of recordings. Choose none of {known}.")
    return label_array([*known, unknown], classes)


def truth_priors(
    priors: Any, classes: NDArray[Any], counts: Array, unknown: Any, default: float = 0.01
) -> tuple[Array, float]:
    """Convert priors to those of the classes, given a known state, and that of the unknown state.

    Parameters
    ----------
    priors : None, "uniform", array-like or mapping
        As for `class_priors`. A mapping may name the unknown state, and an array may have one
        more element for it; all then add up to 1.
    classes, counts : ndarray of shape (n_classes,)
        As for `class_priors`.
    unknown : label or None
        Label of the unknown state.
    default : float, default=0.01
        Prior of the unknown state if `priors` do not state it.

    Returns
    -------
    of_classes : ndarray of shape (n_classes,)
        They add up to 1.
    of_unknown : float
        0 without an unknown state.

    Examples
    --------
    >>> stated = {"healthy": 0.9, "worn": 0.05, "unknown": 0.05}
    >>> of_classes, of_unknown = truth_priors(
    ...     stated, np.array(["healthy", "worn"]), np.ones(2), "unknown"
    ... )
    >>> of_classes.round(3), of_unknown
    (array([0.947, 0.053]), 0.05)
    """
    is_named = isinstance(priors, Mapping | pd.Series) and unknown in dict(priors.items())
    if unknown is None or not (is_named or np.shape(priors) == (len(classes) + 1,)):
        return class_priors(priors, classes, counts), 0.0 if unknown is None else default
    truths = truth_labels(classes, unknown)
    every = class_priors(priors, truths, np.ones(len(truths)))
    if not every[:-1].sum() > 0:
        raise ValueError(f"priors give {unknown!r} the probability 1, and no class any.")
    return every[:-1] / every[:-1].sum(), float(every[-1])


def evidence_for_unknown(typicality: Array, rate: float | None = None) -> Array:
    """Return the Bayes factor for the unknown state against the known ones.

    The typicality p of known recordings is uniform; that of unknown ones has the density
    ``xi p^(xi - 1)`` with an unknown xi, uniform in (0, 1). The ratio of both densities is
    ``E(p) = (1 - p + p log p) / (p log(p)^2)`` [1]_. Its mean over known recordings is 1, so that
    it does not exaggerate; -1 / (e p log p) [2]_ is an upper bound over all xi, with a mean above
    1. E(p) rises slowly between the typicalities 1 and 0.01: a weak statement.

    The rank of a recording is a strong one: a typicality of at most `rate` is a test with this
    false alarm rate. Nothing is known of how many unknown recordings it finds; half of them are
    taken to be like known ones, the other half to be beyond the rate, where p / rate has the
    densities above: ``(1 + E(p / rate) / rate) / 2`` for ``p <= rate``, and 1/2 for all others.
    A mean of two such ratios, it has the mean 1 as well [1]_.

    Parameters
    ----------
    typicality : ndarray
        In (0, 1], of any shape.
    rate : float, default=None
        Accepted share of known recordings that are called unknown. None: E(p).

    Returns
    -------
    ndarray of the shape of `typicality`
        Between 0.5, for the most typical recording, and infinity.

    References
    ----------
    .. [1] Vovk and Wang, E-values: calibration, combination and applications, Annals of
       Statistics 49 (2021), section 2.
    .. [2] Sellke, Bayarri and Berger, Calibration of p values for testing precise null
       hypotheses, The American Statistician 55 (2001).

    Examples
    --------
    >>> evidence_for_unknown(np.array([1.0, 0.1, 0.01, 0.0001])).round(2)
    array([  0.5 ,   1.26,   4.45, 117.76])
    >>> evidence_for_unknown(np.array([1.0, 0.03, 0.02, 0.01, 0.0001]), rate=0.02).round(1)
    array([  0.5,   0.5,  13. ,  16.5, 173. ])
    """
    if rate is not None:
        rare = typicality <= rate
        beyond = evidence_for_unknown(np.where(rare, typicality / rate, 1.0)) / rate
        return (1 + rare * beyond) / 2
    surprise = -np.log(typicality)
    small = surprise < 1e-4  # the quotient of differences loses digits
    safe = np.where(small, 1.0, surprise)
    return np.where(small, 0.5 + surprise / 6, (np.expm1(safe) - safe) / safe**2)


def prior_for_rate(rate: float) -> float:
    """Return the prior with which a share of known recordings is most probably unknown.

    A recording whose typicality is `rate` is as probably of the unknown state as of a known one.
    Less typical ones, as `rate` of the known recordings are, have the unknown state as their most
    probable one.

    Parameters
    ----------
    rate : float
        Accepted mean share of known recordings, above 0 and below 1.

    Returns
    -------
    float

    Examples
    --------
    >>> prior = prior_for_rate(0.02)
    >>> unknown_probability(np.array([1.0, 0.03, 0.02, 0.01, 0.0001]), prior, 0.02).round(2)
    array([0.04, 0.04, 0.5 , 0.56, 0.93])
    """
    return float(1 / (1 + evidence_for_unknown(np.array(rate), rate)))


def unknown_probability(typicality: Array, prior: float, rate: float | None = None) -> Array:
    """Return the probability of the unknown state, by Bayes' rule.

    Parameters
    ----------
    typicality : ndarray
        In (0, 1], of any shape.
    prior : float
        Of the unknown state, 0 to 1.
    rate : float, default=None
        As for `evidence_for_unknown`.

    Returns
    -------
    ndarray of the shape of `typicality`

    Examples
    --------
    >>> unknown_probability(np.array([1.0, 0.01, 1e-6]), 0.01).round(3)
    array([0.005, 0.043, 0.981])
    """
    unknown = prior * evidence_for_unknown(typicality, rate)
    return unknown / (1 - prior + unknown)


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


def check_pairs(cost: Mapping[Any, Any]) -> None:
    """Raise a TypeError if a key of a cost is not a tuple (decision, true class)."""
    for key in cost:
        if not (isinstance(key, tuple) and len(key) == 2):
            raise TypeError(
                f"the keys of a cost mapping must be tuples (decision, true class), got {key!r}."
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
    """Raise a ValueError if the names of the axes say that rows are the true classes.

    Of a name such as "decision given the true state", the first word counts.
    """
    truth = r"(true|truth|actual|state|wahr|zustand)"
    decision = "decision|decided|pred|action|entsch|vorher"
    words = rf"(?<![^\W\d_])(?:{truth}|{decision})"  # at the beginning of a word
    rows, columns = (re.search(words, str(axis.name).lower()) for axis in cost.axes)
    if (rows and rows[1]) or (columns and not columns[1]):
        raise ValueError(
            f"the axes of cost are named {cost.index.name!r} (rows) and {cost.columns.name!r} "
            "(columns), but rows are decisions and columns truths. Give cost.T (rows and columns "
            "exchanged), or other names."
        )


def _square(cost: Any, known: list[Any], truths: list[Any]) -> NDArray[Any]:
    """Return costs that are given as an array, in the order of the classes."""
    check_unmasked(cost, "cost")
    array = np.asarray(cost, dtype=object)  # which numbers they are is checked one by one
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
            if isinstance(truth, str) and not any(isinstance(label, str) for label in known):
                text += (  # they were numbered
                    " Meta-estimators of scikit-learn pass classes as numbers. State costs and "
                    "priors outside: LeastRiskClassifier(VotingClassifier(...), cost=..., "
                    'priors=...). cross_val_predict(method="predict_proba") needs no costs, and '
                    "priors as an array."
                )
            raise ValueError(text)
    for decision in rows:
        missing = [truth for truth in known if (decision, truth) not in stated]
        if decision not in truths and missing:
            raise ValueError(
                f"cost contains the decision {decision!r}, which is none of the classes {known}: "
                f"it then needs a cost for every class; missing: {missing}."
            )
