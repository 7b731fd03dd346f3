"""Costs with which a stated missed detection rate holds, chosen from whole units.

The more a missed detection costs, the fewer faults are decided to be healthy. `miss_rate_limit`
finds the smallest factor on this cost for which a statistical test on the units confirms the rate:
risk control [1]_ [2]_ by the exact binomial test, or by Bentkus' bound of means [3]_.

References
----------
.. [1] Bates, Angelopoulos, Lei, Malik and Jordan, Distribution-free, risk-controlling prediction
   sets, Journal of the ACM 68 (6), 2021.
.. [2] Angelopoulos, Bates, Candès, Jordan and Lei, Learn then test: calibrating predictive
   algorithms to achieve risk control, arXiv:2110.01052, 2021.
.. [3] Bentkus, On Hoeffding's inequalities, Annals of Probability 32 (2), 2004.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.stats import binom
from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_number
from emacm.decisions.costs import label_array, label_list, label_positions
from emacm.decisions.pipelines import before_the_last_step
from emacm.decisions.risks import LeastRiskMixin, decide, risks_of
from emacm.evaluation.bootstrap import Array, GroupBootstrap
from emacm.evaluation.figures import tallies
from emacm.evaluation.scoring import ScoringRule, scoring_rule
from emacm.recordings.meta import read_grouping


@dataclass(frozen=True)
class MissRateLimit:
    """Result of `miss_rate_limit`.

    Attributes
    ----------
    cost : DataFrame
        Cost for `set_params` of the classifier; index = decisions, columns = true states.
    factor : float
        Factor on the costs of missed detections, at least 1.
    table : DataFrame
        Rows: "given cost" and "limit". Columns: false alarm, inspection and missed detection rate
        as by `evaluate`, each with its interval from a bootstrap over units (``..._low``,
        ``..._high``), and "missed_by_unit", the mean over units that the limit applies to.
    n_units : int
        Number of units with a fault.
    """

    cost: pd.DataFrame
    factor: float
    table: pd.DataFrame
    n_units: int


def miss_rate_limit(
    model: Any,
    X: Any,
    y: ArrayLike,
    groups: Any,
    rate: float = 0.01,
    confidence: float = 0.95,
    *,
    healthy: Any,
) -> MissRateLimit:
    """Choose the cost of missed detections so that their rate does not exceed a limit.

    A missed detection is a fault that is decided to be healthy; an inspection is not. The excess
    cost of a missed detection over the cheapest decision is multiplied by the smallest factor for
    which a statistical test on these units confirms the rate. That is, if the units were sampled
    again, the rate among all units of the fleet would be at most `rate` in at least the fraction
    `confidence` of the samples.

    Parameters
    ----------
    model : estimator
        Classifier with costs (`CostSensitiveGaussianBayes`, `LeastRiskClassifier`,
        `PosteriorProduct`), or a pipeline, `ConditionRouter` or search that ends in one. Fitted
        to other units than these.
    X : sequence of Recording, or array-like of n_recordings
        Input of the model.
    y : array-like of shape (n_recordings,)
        True states, each a class or the label of the unknown state.
    groups : key, tuple of keys, callable or array-like of shape (n_recordings,)
        Unit of each recording: a key of `meta`, or as `units` of `evaluate`.
    rate : float, default=0.01
        Largest missed detection rate, above 0 and below 1: the mean over units with faults
        of the fraction of their faulty recordings that is decided to be healthy.
    confidence : float, default=0.95
        Fraction of fleets in which it holds, above 0 and below 1.
    healthy : object
        The healthy class or family, as in `evaluate`.

    Returns
    -------
    MissRateLimit
        With the cost to be set, and the false alarms and inspections that it entails.

    Raises
    ------
    TypeError
        If the model makes no decisions by cost.
    ValueError
        If an argument is invalid; if there are too few units to prove the rate, which takes
        ``log(1 - confidence) / log(1 - rate)`` units even without a missed detection (299 for
        0.01 and 0.95); or if no cost suffices, because the model gives some faults the
        probability 0.

    See Also
    --------
    emacm.evaluate : Rates of all decisions.

    Notes
    -----
    Units are assumed to be exchangeable: those in service resemble these, in the mix of faults
    too. Each unit is one observation, however many recordings it has. With one faulty recording
    of each unit, the test is the exact binomial one (Clopper and Pearson); otherwise the fraction
    missed of each unit lies between 0 and 1, and the test is Bentkus' (`largest_missed`).

    Examples
    --------
    >>> from emacm import CostSensitiveGaussianBayes
    >>> rng = np.random.default_rng(0)
    >>> y = np.repeat(["healthy", "worn"], 200)
    >>> X = rng.normal(size=(400, 1)) + 2 * (y == "worn")[:, np.newaxis]
    >>> model = CostSensitiveGaussianBayes().fit(X[::2], y[::2])
    >>> limit = miss_rate_limit(
    ...     model, X[1::2], y[1::2], np.arange(200), rate=0.1, healthy="healthy"
    ... )
    >>> round(limit.factor, 2), limit.n_units
    (2.15, 100)
    >>> limit.table["missed_detection_rate"].round(2).to_dict()
    {'given cost': 0.14, 'limit': 0.04}
    >>> float((model.set_params(cost=limit.cost).predict(X[1::2])[100:] == "healthy").mean())
    0.04
    """
    rate = check_number(rate, "rate", above=0, below=1)
    bootstrap = GroupBootstrap(confidence)
    check_is_fitted(model)
    units = read_grouping(groups, X, "groups", "unit")
    if units is None:
        raise ValueError("groups must give the unit of each recording, got None.")
    states = label_list(y)
    if len(states) != len(units.labels):
        raise ValueError(f"y has {len(states)} states for {len(units.labels)} recordings.")
    final, features = before_the_last_step(model, X)
    if not isinstance(final, LeastRiskMixin):
        raise TypeError(
            f"model must decide by costs, but {type(final).__name__} has no cost_. Use "
            f"LeastRiskClassifier({type(final).__name__}(...), cost=...)."
        )
    posterior = final.truth_proba(features, final.predict_proba(features))
    truths, decisions = final.truths_.tolist(), final.decisions_.tolist()
    label_positions(states, truths, "y", "state of the model")
    cost = pd.DataFrame(final.cost_, index=decisions, columns=truths)
    rule = scoring_rule(label_array(truths), healthy=healthy, cost=cost)
    rule = replace(rule, unknown=final.unknown)  # may be true here; deciding it is an inspection

    is_faulty = np.array([rule.family_of[state] != rule.healthy for state in states])
    weight, n_units, allowed = _unit_weights(units.labels, is_faulty, rate, confidence)
    scaled = _missed_costs(cost, rule)
    critical = _critical_factors(posterior[is_faulty], cost.to_numpy(), scaled)
    factor = _least_factor(critical, weight[is_faulty], allowed)
    if not np.isfinite(factor * scaled.max()):
        raise ValueError(
            f"no cost of missed detections attains a rate of {rate:g}: the model gives every fault "
            f"the probability 0 for {np.count_nonzero(np.isinf(critical))} of {len(critical)} "
            f'faulty recordings. Give the classifier an unknown state or temperature="groups".'
        )
    limit = cost + (factor - 1) * scaled
    unknown = None if final.unknown is None else decisions.index(final.unknown)
    rows = {}
    for name, table in (("given cost", cost), ("limit", limit)):
        decided = [decisions[row] for row in decide(posterior, table.to_numpy(), unknown)]
        judged = rule.judge(states, decided)
        rates = {key: tally for key, tally in tallies(judged, rule).items() if "rate" in key}
        rows[name] = bootstrap.figures(rates, units.labels)
        rows[name]["missed_by_unit"] = weight @ judged["decided_label"].isin(rule.cleared)
    table = pd.DataFrame.from_dict(rows, orient="index")
    return MissRateLimit(limit, factor, table, n_units)


def _unit_weights(
    units: NDArray[Any], is_faulty: NDArray[np.bool_], rate: float, confidence: float
) -> tuple[Array, int, float]:
    """Return the weight of each recording, the number of units, and the fraction allowed.

    Each unit with faults has the same weight, however many recordings it has.
    """
    codes, per_unit = np.unique(units[is_faulty], return_inverse=True, return_counts=True)[1:]
    n_units = len(per_unit)
    needed = int(np.ceil(np.log1p(-confidence) / np.log1p(-rate) - 1e-9))
    if n_units < needed:
        lowest = 1 - (1 - confidence) ** (1 / max(n_units, 1))
        raise ValueError(
            f"{n_units} units with faults cannot prove a missed detection rate of {rate:g} with "
            f"confidence {confidence:g}: even if none is missed, the rate may be as high as "
            f"{lowest:.3g}. It takes {needed} units."
        )
    weight = np.zeros(len(units))
    weight[is_faulty] = 1 / (n_units * per_unit[codes])
    exact = bool((per_unit == 1).all())
    return weight, n_units, largest_missed(n_units, rate, confidence, exact=exact)


def _missed_costs(cost: pd.DataFrame, rule: ScoringRule) -> Array:
    """Return what missed detections cost more than the cheapest decision, 0 for other entries."""
    faults = [rule.family_of[state] != rule.healthy for state in cost.columns]
    is_miss = np.outer(cost.index.isin(rule.cleared), faults)
    excess = np.where(is_miss, cost.to_numpy() - cost.to_numpy().min(axis=0), 0.0)
    free = is_miss & (excess <= 0)
    if free.any():
        row, column = np.argwhere(free)[0]
        raise ValueError(
            f"deciding {cost.index[row]!r} when {cost.columns[column]!r} is true must cost more "
            f"than the cheapest decision; it costs {cost.iat[row, column]:g}."
        )
    return excess


def _critical_factors(posterior: Array, cost: Array, scaled: Array) -> Array:
    """Return the factor above which each recording is not decided to be healthy; 1 or more."""
    missed = scaled.any(axis=1)
    risks, slopes = risks_of(posterior, cost), posterior @ scaled[missed].T
    others = risks[:, ~missed].min(axis=1, initial=np.inf, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        factors = 1 + (others - risks[:, missed]) / slopes  # risk + (factor - 1) slope = other risk
    factors = np.nan_to_num(factors, nan=np.inf, posinf=np.inf)
    return np.where(others < risks[:, missed], 0.0, factors).max(axis=1)  # 0: never healthy


def _least_factor(critical: Array, weight: Array, allowed: float) -> float:
    """Return the least factor from 1 on with which at most the allowed fraction is missed."""
    if weight[critical >= 1].sum() <= allowed + 1e-9:
        return 1.0
    order = np.argsort(-critical)
    above = np.cumsum(weight[order]) - weight[order]  # missed just above each critical factor
    return float(critical[order][above <= allowed + 1e-9].min()) * (1 + 1e-6)


def largest_missed(n_units: int, rate: float, confidence: float, *, exact: bool = False) -> float:
    """Return the largest fraction missed among some units that proves a missed detection rate.

    Parameters
    ----------
    n_units : int
        Number of units with faults.
    rate, confidence : float
        As for `miss_rate_limit`.
    exact : bool, default=False
        Whether each unit has one recording, so that the number of missed units is binomial.

    Returns
    -------
    float
        Mean over the units of the fraction of their recordings missed; negative if not even 0
        proves the rate.

    Notes
    -----
    Let p be the rate, B binomial of n units, and S the sum over units of the fractions missed. If
    their mean exceeds p, E f(S) <= E f(B) for every convex decreasing function f (Hoeffding), and
    f = (t - s)+ with Markov's inequality gives P(S <= x) <= E (t - B)+ / (t - x) for every
    t > x [3]_. No t gives more than Hoeffding's exponential bound, or than e P(B <= x).

    Examples
    --------
    >>> largest_missed(29, 0.1, 0.95) >= 0, largest_missed(28, 0.1, 0.95) >= 0
    (True, False)
    >>> [round(largest_missed(100, 0.1, 0.95, exact=exact), 3) for exact in (False, True)]
    [0.043, 0.04]
    """
    level = 1 - confidence
    t = np.arange(1, n_units + 1)
    probabilities = binom.cdf(t - 1, n_units, rate)  # of B <= t - 1
    if exact:
        return (int(np.count_nonzero(probabilities <= level)) - 1) / n_units
    return float(np.max(t - np.cumsum(probabilities) / level)) / n_units  # of E (t - B)+
