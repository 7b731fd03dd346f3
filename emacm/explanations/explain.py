"""Which orders carry a decision, which carry a model, and whether a fault is expected there.

A classifier may be right for the wrong reason: Chirico (section 4.5) found by looking that two
of his four signals were told apart by electrical noise of the healthy unit, at orders 12
and 36, and not by the bearing. These functions put it in numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_count, check_number
from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.explanations.feature_traces import FeatureTrace, trace_features, with_names
from emacm.explanations.opened_pipelines import OpenedPipeline, one_recording
from emacm.explanations.slopes import (
    cost_saved,
    joint_log_proba,
    log_odds,
    mean_slope_of_cost,
    mean_slope_of_log_odds,
)
from emacm.machine.fault_orders import named_orders, slip_ranges

Array = NDArray[np.float64]


def explain_decision(
    pipeline: Any, x: Any, *, decision: Any = None, against: Any = None, background: Any = None
) -> pd.DataFrame:
    """Say which order bins, or other named features, carry the decision on one recording.

    The difference that is explained is split over the bins by integrated gradients [1]_
    along the straight line from a baseline, which stands for the alternative, to the
    recording. The contributions add up to what is explained at the recording
    less what it is at the baseline, and a bin whose values do not differ has none.

    Parameters
    ----------
    pipeline : Pipeline, CostSensitiveGaussianBayes or fitted search
        Fitted; ends in a `CostSensitiveGaussianBayes`.
    x : Recording, or one row of a table
        What the pipeline takes: a recording (or a list of one), or, for a pipeline that
        starts behind the bins, a row of its table.
    decision : label, optional
        Class or decision to be explained. Default: what the pipeline decides.
    against : label, optional
        The alternative. Default: the most probable other class; or, for a decision that is no
        class, or any decision if some class is none, the decision of the next least risk.
    background : recordings or table, optional
        Recordings of the class that stands for the alternative, in training say; their
        mean is the baseline. Default: the point nearest to the recording that
        has all its features at the mean of that class.

    Returns
    -------
    DataFrame
        A row a bin or feature, the largest contribution first: "column", "channel", "low" and
        "high" [orders; NaN of what is no band], "contribution" and "share" (of the sum of their
        sizes). In `attrs`:
        "decision", "against", "baseline" (its class), "quantity" (what is explained),
        "value" (at the recording) and "baseline_value"; the contributions add
        up to the difference of the two.

    Raises
    ------
    TypeError
        If the pipeline does not end in a `CostSensitiveGaussianBayes`.
    ValueError
        If a step cannot be traced (it is named), `x` is not one recording, or a label is
        unknown.

    Notes
    -----
    Between two classes, the log odds are explained, log P(decision | x) - log P(against | x)
    [nats], before any cost. They are quadratic in the features, so the gradient is linear along
    the line, and its integral is its value half-way: exact, without steps. Where one of the two
    is no class ("inspect"), no odds exist; then the difference in expected cost is explained,
    risk(against) - risk(decision) [unit of the cost], integrated numerically, and the baseline is
    the class for which `against` is the best compared with `decision`. Where some class is no
    decision (families are decided for, their sub-states are the classes), two decisions are
    always compared by cost, even if they share their names with classes.

    A pipeline with a `BinTransformer` among its steps is explained by the bins of the last one.
    Any other is explained by the columns of the step that makes a table of the recordings, such as
    a `FeatureUnion` of order bins, `RecordingStatistics` and others, under the names it gives them
    and as they leave it (logarithms inside the union belong to the column).

    The line is drawn in the space of the last element-wise step (logarithms, a scaler): there each
    number belongs to one bin. Behind a projection to fewer features the bins at a class's mean are
    not known; the nearest point moves only what the projection sees. `background` gives them.

    References
    ----------
    .. [1] Sundararajan, Taly and Yan, Axiomatic attribution for deep networks, ICML 2017.

    Examples
    --------
    >>> from emacm import CostSensitiveGaussianBayes, explain_decision
    >>> X = pd.DataFrame({"torque@0-1": [1.0, 2, 3, 4], "torque@1-2": [0.0, 1, 8, 9]})
    >>> y = ["healthy", "healthy", "worn", "worn"]
    >>> model = CostSensitiveGaussianBayes(covariance="tied", shrinkage=0.5).fit(X, y)
    >>> table = explain_decision(model, X.iloc[[3]])
    >>> table["column"].tolist()
    ['torque@1-2', 'torque@0-1']
    >>> value, baseline = (table.attrs[name] for name in ("value", "baseline_value"))
    >>> bool(np.isclose(table["contribution"].sum(), value - baseline))
    True
    """
    x = one_recording(x)
    opened = OpenedPipeline.of(pipeline, x)
    classifier = opened.classifier
    traced = _Traced.of(opened, x)
    decision, against = _question(classifier, traced.features, decision, against)
    prices, code = _prices(classifier, decision, against)
    centre = None
    if background is not None:
        centre = traced.trace.positions(opened.table(background)[0]).mean(axis=0)
    step, start, end = traced.lines(classifier, code, centre)
    if prices is None:
        own = classifier.classes_.tolist().index(decision)
        slope = mean_slope_of_log_odds(classifier, start, end, own, code)
        value, baseline = (log_odds(classifier, z, own, code)[0] for z in (end, start))
        quantity = f"log odds of {decision!r} against {against!r} [nats]"
    else:
        slope = mean_slope_of_cost(classifier, start, end, prices)
        value, baseline = (cost_saved(classifier, z, prices)[0] for z in (end, start))
        quantity = f"expected cost saved by {decision!r} against {against!r}"
    table = _ranked(traced.bins, traced.split(step, slope)[0])
    table.attrs = {
        "decision": decision,
        "against": against,
        "baseline": classifier.classes_.tolist()[code],
        "quantity": quantity,
        "value": float(value),
        "baseline_value": float(baseline),
    }
    return table


def explain_model(pipeline: Any, X: Any, y: ArrayLike | None = None) -> pd.DataFrame:
    """Say which order bins, or other named features, carry a whole model, over many recordings.

    Each recording's log odds of its own class against each other class are split over the
    bins as by `explain_decision`; the sizes of the contributions are averaged.

    Parameters
    ----------
    pipeline : Pipeline, CostSensitiveGaussianBayes or fitted search
        Fitted; ends in a `CostSensitiveGaussianBayes`.
    X : recordings or table
        What the pipeline takes.
    y : array-like of shape (n_recordings,), optional
        True classes. With them a recording's own class is the true one, and the baseline
        the mean of the other class in `X`; without, its own class is the most
        probable one, and the baseline the nearest point with that mean.

    Returns
    -------
    DataFrame
        A row a bin or feature, the largest contribution first: "column", "channel", "low" and
        "high" [orders; NaN of what is no band], "contribution" (mean size over recordings and
        other classes [nats]),
        "share", and the mean size for each pair of classes, "a vs b". In `attrs`:
        "quantity".

    Raises
    ------
    TypeError, ValueError
        As for `explain_decision`; and if `y` does not fit, or holds fewer than two classes.

    Examples
    --------
    >>> from emacm import CostSensitiveGaussianBayes, explain_model
    >>> X = pd.DataFrame({"torque@0-1": [1.0, 2, 3, 4], "torque@1-2": [0.0, 1, 8, 9]})
    >>> y = ["healthy", "healthy", "worn", "worn"]
    >>> model = CostSensitiveGaussianBayes(covariance="tied", shrinkage=0.5).fit(X, y)
    >>> explain_model(model, X, y)[["column", "share"]].round(2)
           column  share
    0  torque@1-2   0.93
    1  torque@0-1   0.07
    """
    opened = OpenedPipeline.of(pipeline, X)
    classifier = opened.classifier
    traced = _Traced.of(opened, X)
    if y is None:
        own = np.argmax(joint_log_proba(classifier, traced.features), axis=1)
        codes = np.flatnonzero(classifier.priors_ > 0).tolist()
    else:
        own = _class_codes(classifier, y, len(traced.features))
        codes = np.unique(own).tolist()
    sizes: dict[str, Array] = {}
    for pair in combinations(codes, 2):
        found = []
        for code, other in (pair, pair[::-1]):
            centre = None if y is None else traced.positions[own == other].mean(axis=0)
            step, start, end = traced.lines(classifier, other, centre, chosen=own == code)
            slope = mean_slope_of_log_odds(classifier, start, end, code, other)
            found.append(np.abs(traced.split(step, slope)))
        if any(map(len, found)):
            name = " vs ".join(str(label) for label in classifier.classes_[list(pair)].tolist())
            sizes[name] = np.concatenate(found)
    if not sizes:
        raise ValueError("a model is explained between two classes at the least; found one.")
    pairs = {name: size.mean(axis=0) for name, size in sizes.items()}
    overall = np.concatenate([*sizes.values()]).mean(axis=0)
    table = _ranked(traced.bins.assign(**pairs), overall)
    table.attrs = {"quantity": "mean size of contributions to log odds [nats]"}
    return table


def match_fault_orders(
    explanation: pd.DataFrame,
    orders: pd.DataFrame | Mapping[str, float],
    *,
    slip: float = 0.02,
    min_width: float = 0.0,
    harmonics: int = 1,
) -> pd.DataFrame:
    """Put the predicted fault orders beside the bins that carry a decision or a model.

    Parameters
    ----------
    explanation : DataFrame
        Of `explain_decision` or `explain_model`, or rows of it (those of one channel, say).
    orders : DataFrame of `fault_orders`, or mapping of str to float
        Predicted orders by name.
    slip : float
        Share of its order by which a line that slips may lie lower or higher; in a mapping
        every order may slip.
    min_width : float
        Least width of a line [orders], such as ``4 / revolutions``.
    harmonics : int
        Multiples of each order that count too.

    Returns
    -------
    DataFrame
        The explanation, with "fault" (the predicted order that lies in the bin, nearest to
        its middle, or "none"), "fault_order" (NaN if none) and "n_faults" (how many lie in the
        bin: it cannot tell them apart). `attrs` gains "predicted_share", the share of the
        contributions in bins with a fault order, and "predicted_bins", the share of the bins
        that have one: what a model would reach that leans on all bins alike.

    Raises
    ------
    ValueError
        If it is no explanation, or there is no order, or one that is not positive.

    Notes
    -----
    A predicted share near the share of bins proves nothing, and one below it speaks for a
    model that knows the units, not the fault. Many harmonics and wide bins make any bin match.

    Examples
    --------
    >>> from emacm import match_fault_orders
    >>> explanation = pd.DataFrame(
    ...     {"column": ["v@12-13", "v@6-7"], "low": [12, 6], "high": [13, 7], "share": [0.3, 0.7]}
    ... )
    >>> matched = match_fault_orders(explanation, {"BPFI": 6.123}, harmonics=2)
    >>> matched["fault"].tolist(), matched.attrs["predicted_share"]
    (['2xBPFI', 'BPFI'], 1.0)
    """
    missing = [c for c in ("column", "low", "high", "share") if c not in explanation.columns]
    if missing:
        raise ValueError(
            f"explanation must be a table of explain_decision or explain_model; it has no "
            f"column {missing[0]!r}."
        )
    check_number(slip, "slip", at_least=0, below=1)
    check_number(min_width, "min_width", at_least=0, unit="orders")
    names, centres, low, high = _with_harmonics(orders, slip, min_width, harmonics)
    matched = explanation.copy()
    bottom, top = (
        explanation[name].to_numpy(np.float64)[:, np.newaxis] for name in ("low", "high")
    )
    inside = (low <= top) & (high >= bottom)
    for row, column in enumerate(explanation["column"]):
        if np.isnan(bottom[row, 0]):  # a named band whose orders are not known
            inside[row] = np.array(names) == str(column).rpartition("@")[2]
    off = np.where(np.isnan(bottom), 0.0, np.abs(centres - (bottom + top) / 2))
    nearest = np.argmin(np.where(inside, off, np.inf), axis=1)
    hit = np.any(inside, axis=1)
    matched["fault"] = np.where(hit, np.array(names, dtype=object)[nearest], "none")
    matched["fault_order"] = np.where(hit, centres[nearest], np.nan)
    matched["n_faults"] = inside.sum(axis=1)
    total = float(explanation["share"].sum())
    matched.attrs = {
        **explanation.attrs,
        "predicted_share": float(explanation["share"][hit].sum()) / total if total else 0.0,
        "predicted_bins": float(hit.mean()) if len(hit) else 0.0,
    }
    return matched


@dataclass(frozen=True)
class _Traced:
    """Recordings on their way from bins by positions to features."""

    bins: pd.DataFrame
    trace: FeatureTrace
    positions: Array
    features: Array

    @classmethod
    def of(cls, opened: OpenedPipeline, X: Any) -> _Traced:
        values, bins = opened.table(X)
        trace = trace_features(opened.steps, values)
        positions = trace.positions(values)
        return cls(bins, trace, positions, trace.features(positions))

    def lines(
        self,
        classifier: CostSensitiveGaussianBayes,
        code: int,
        centre: Array | None,
        *,
        chosen: Any = slice(None),
    ) -> tuple[Array, Array, Array]:
        """Return lines to the chosen recordings: steps of positions, and both ends as features."""
        end, matrix = self.features[chosen], self.trace.matrix
        if centre is not None:
            step = self.positions[chosen] - centre
        else:
            step = end - classifier.means_[code]
            if self.trace.linear:  # the shortest step that makes up this difference
                step = step @ np.linalg.pinv(matrix).T
        return step, end - step @ matrix.T, end

    def split(self, step: Array, slope: Array) -> Array:
        """Split what the lines explain over the bins, shape (n_recordings, n_bins)."""
        return self.trace.by_column(step * (slope @ self.trace.matrix), len(self.bins))


def _ranked(bins: pd.DataFrame, contributions: Array) -> pd.DataFrame:
    """Put contributions and shares beside the bins, the largest first."""
    sizes = np.abs(contributions)
    shares = sizes / sizes.sum() if sizes.sum() > 0 else sizes
    table = bins.copy()
    table.insert(4, "contribution", contributions)
    table.insert(5, "share", shares)
    return table.iloc[np.argsort(-sizes, kind="stable")].reset_index(drop=True)


def _question(
    classifier: CostSensitiveGaussianBayes, features: Array, decision: Any, against: Any
) -> tuple[Any, Any]:
    """Settle what is compared with what."""
    classes, decisions = classifier.classes_.tolist(), classifier.decisions_.tolist()
    for name, label in (("decision", decision), ("against", against)):
        if label is not None and label not in classes and label not in decisions:
            raise ValueError(
                f"{name} must be one of the classes {classes} or decisions {decisions}, "
                f"got {label!r}."
            )
    if decision is None:
        decision = classifier.predict(with_names(classifier, features)).tolist()[0]
    if against is None:
        if _as_classes(classifier, decision):
            merit, labels = joint_log_proba(classifier, features)[0], classes
        else:
            merit, labels = -classifier.risk(with_names(classifier, features))[0], decisions
        others = [i for i, label in enumerate(labels) if label != decision]
        if not others:
            raise ValueError(f"there is no alternative to {decision!r}; state against.")
        against = labels[max(others, key=lambda i: merit[i])]
    if decision == against:
        raise ValueError(f"decision and against must differ, both are {decision!r}.")
    pair = (decision, against)
    if _as_classes(classifier, *pair):
        never = [k for k in pair if not classifier.priors_[classes.index(k)] > 0]
        if never:
            raise ValueError(f"class {never[0]!r} has the prior 0, so its log odds are infinite.")
    elif not all(label in decisions for label in pair):
        raise ValueError(
            f"{decision!r} and {against!r} cannot be compared: they must both be classes {classes} "
            f"or both be decisions {decisions}."
        )
    return pair


def _as_classes(classifier: CostSensitiveGaussianBayes, *labels: Any) -> bool:
    """Whether labels are explained as classes, by their odds, or as decisions, by their cost."""
    classes, decisions = set(classifier.classes_.tolist()), set(classifier.decisions_.tolist())
    return classes.issuperset(labels) and (classes <= decisions or not decisions.issuperset(labels))


def _prices(
    classifier: CostSensitiveGaussianBayes, decision: Any, against: Any
) -> tuple[Array | None, int]:
    """Return what the decision saves under each class, and the class of the baseline.

    Between two classes nothing is priced, and the baseline is the other class.
    """
    if _as_classes(classifier, decision, against):
        return None, classifier.classes_.tolist().index(against)
    decisions = classifier.decisions_.tolist()
    cost = classifier.cost_
    saved = cost[decisions.index(against)] - cost[decisions.index(decision)]
    return saved, int(np.argmin(np.where(classifier.priors_ > 0, saved, np.inf)))


def _class_codes(
    classifier: CostSensitiveGaussianBayes, y: ArrayLike, n_recordings: int
) -> NDArray[np.intp]:
    classes, labels = classifier.classes_.tolist(), np.asarray(y).tolist()
    if len(labels) != n_recordings:
        raise ValueError(
            f"y must hold one class for each of {n_recordings} recordings, got {len(labels)}."
        )
    for place, label in enumerate(labels):
        if label not in classes:
            raise ValueError(
                f"y holds {label!r} at recording {place}, which is none of the classes {classes}."
            )
    return np.array([classes.index(label) for label in labels], dtype=np.intp)


def _with_harmonics(
    orders: pd.DataFrame | Mapping[str, float], slip: float, min_width: float, harmonics: int
) -> tuple[list[str], Array, Array, Array]:
    """Return names, orders, and from where to where each may lie, multiples included."""
    check_count(harmonics, "harmonics")
    names, centres = named_orders(orders)
    if not names:
        raise ValueError("orders must hold at least one predicted order, got none.")
    _, low, high = slip_ranges(orders, slip=slip)
    times = np.arange(1, harmonics + 1)[:, np.newaxis]
    all_names = [name if k == 1 else f"{k}x{name}" for k in times[:, 0] for name in names]
    centre = (times * centres).ravel()
    half = np.maximum((times * (high - low)).ravel(), min_width) / 2
    return all_names, centre, centre - half, centre + half
