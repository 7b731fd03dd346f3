"""Which orders determine a decision or a model.

A classifier may be correct for the wrong reason: Chirico (section 4.5) found by inspection that two
of his four signals were separated by electrical noise of the healthy unit, at orders 12 and 36, and
not by the bearing. These functions quantify it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.special import softmax

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.truths import label_list, label_positions
from emacm.explanations.deviations import (
    PROJECTED,
    find_deviations,
    unknown_statements,
)
from emacm.explanations.feature_traces import FeatureTrace, trace_features, with_names
from emacm.explanations.opened_pipelines import OpenedPipeline, one_recording

Array = NDArray[np.float64]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)
_NODES, _WEIGHTS = (_NODES + 1) / 2, _WEIGHTS / 2  # Gauss-Legendre quadrature from 0 to 1


def explain_decision(
    pipeline: Any, x: Any, *, decision: Any = None, against: Any = None, background: Any = None
) -> pd.DataFrame:
    """Explain a decision on one recording by order bins, or by other named features.

    The explained quantity (log odds or expected cost) is distributed over the bins by integrated
    gradients [1]_ along the straight line from a baseline, which represents the alternative,
    to the recording. The contributions add up to the quantity at the recording minus that at the
    baseline; a bin with the same value at both has the contribution 0.

    Parameters
    ----------
    pipeline : Pipeline, CostSensitiveGaussianBayes, fitted search or ConditionRouter
        Fitted; ends in a `CostSensitiveGaussianBayes`. Of a router, the pipeline for the condition
        of the recording is explained.
    x : Recording, or one row of a table
        Input of the pipeline: a recording (or a list of one), or a row of a table if the pipeline
        starts after the bins.
    decision : label, optional
        Class or decision to explain. Default: the decision of the pipeline.
    against : label, optional
        The alternative. Default: the most probable other class; if the decision is not a class,
        or some class is not a decision, the decision with the next higher risk.
    background : recordings or table, optional
        Recordings of the class that represents the alternative, for example training recordings;
        their mean is the baseline. Default: the point nearest to the recording whose
        features are the mean of that class.

    Returns
    -------
    DataFrame
        One row for each bin or feature, largest contribution first: "column", "channel", "low"
        and "high" [orders; NaN without a band], "contribution", and "share" (its magnitude
        divided by the sum of magnitudes). In `attrs`: "decision", "against", "baseline"
        (its class), "quantity" (the explained quantity), "value" (at the recording) and
        "baseline_value"; the contributions add up to the difference of the two.

    Raises
    ------
    TypeError
        If the pipeline does not end in a `CostSensitiveGaussianBayes`.
    ValueError
        If a step is neither element-wise nor linear (the message gives its name), `x` is not
        exactly one recording, or a label is unknown.

    Notes
    -----
    For two classes, the log odds log P(decision | x) - log P(against | x) [nats] are explained,
    without any cost. They are quadratic in the features, so the gradient is linear along the
    line and its mean is the gradient at the midpoint: exact, without numerical integration. If one
    of the two is not a class ("inspect"), the difference in expected cost, risk(against) -
    risk(decision) [unit of the cost], is explained, by numerical integration; the baseline is
    then the class for which `against` is best compared with `decision`. If some class is not a
    decision (decisions are families, classes are their states), two decisions are always compared
    by cost, even if they have the names of classes.

    If one of the two is the unknown state, the squared distance from the nearest class is
    explained, in the metric of `CostSensitiveGaussianBayes.typicality`; the baseline is that class.
    The table then has the columns "deviation" (from that class), "outside_training" (from the range
    of the training recordings: 0 within) and "unit" of both: "dB" for powers, exactly, and
    "standard deviations" for other features. `attrs` has "statements": sentences such as "line at
    order 9 to 9.5 of 'vibration', 14 dB above the training maximum". After a projection (PCA),
    which bins deviate is not determined; give the training recordings as `background`.

    A pipeline with a `BinTransformer` among its steps is explained by the bins of the last one.
    Any other is explained by the columns of the step that turns recordings into a table, such as
    a `FeatureUnion` of order bins, `RecordingStatistics` and others, by their names and with
    their values in that table (logarithms inside the union belong to the column).

    The line is straight in the space of the last element-wise step (logarithm, scaler), where each
    number belongs to one bin. After a projection to fewer features, the bins at the mean of a class
    are unknown; the nearest point differs from the recording only in directions that the
    projection retains. `background` provides the bins.

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
    if _with_unknown(classifier, decision, against):
        costs, code = None, int(classifier.distances_.nearest(traced.features)[0])
    else:
        costs, code = _saved_costs(classifier, decision, against)
    others, centre = None, None
    if background is not None:
        values = opened.table(background)[0]
        if not len(values):
            raise ValueError("background must contain at least one recording, got none.")
        others = traced.trace.positions(values)
        centre = others.mean(axis=0)
    step, start, end = traced.lines(classifier, code, centre)
    if _with_unknown(classifier, decision, against):
        distances, nearest = classifier.distances_, classifier.classes_.tolist()[code]
        slope = distances.square_gradient((start + end) / 2, code)
        value, baseline = (distances.squares(z, code)[0] for z in (end, start))
        quantity = f"squared distance from {nearest!r}, the nearest class [standard deviations]"
    elif costs is None:
        own = classifier.classes_.tolist().index(decision)
        slope = mean_slope_of_log_odds(classifier, start, end, own, code)
        value, baseline = (log_odds(classifier, z, own, code)[0] for z in (end, start))
        quantity = f"log odds of {decision!r} against {against!r} [nats]"
    else:
        slope = mean_slope_of_cost(classifier, start, end, costs)
        value, baseline = (cost_saved(classifier, z, costs)[0] for z in (end, start))
        quantity = f"expected cost saved by deciding {decision!r} instead of {against!r}"
    table = traced.bins.assign(contribution=traced.split(step, slope)[0])
    statements = {}
    if _with_unknown(classifier, decision, against):
        scales = opened.scales(len(table))
        deviations = traced.deviations(classifier, scales, step, others)
        statements["statements"] = [PROJECTED]
        if others is not None or not traced.trace.linear:
            statements["statements"] = unknown_statements(table.join(deviations), str(nearest))
        table = table.join(deviations[["deviation", "outside_training", "unit"]])
    table = _ranked(table)
    table.attrs = statements | {
        "decision": decision,
        "against": against,
        "baseline": classifier.classes_.tolist()[code],
        "quantity": quantity,
        "value": float(value),
        "baseline_value": float(baseline),
    }
    return table


def explain_model(pipeline: Any, X: Any, y: ArrayLike | None = None) -> pd.DataFrame:
    """Explain a model by order bins, or other named features, averaged over many recordings.

    The log odds of the class of each recording against each other class are distributed over the
    bins as in `explain_decision`; the magnitudes of the contributions are averaged.

    Parameters
    ----------
    pipeline : Pipeline, CostSensitiveGaussianBayes or fitted search
        Fitted; ends in a `CostSensitiveGaussianBayes`.
    X : recordings or table
        Input of the pipeline.
    y : array-like of shape (n_recordings,), optional
        True classes. With `y`, the class of a recording is the true one, and the baseline is the
        mean of the other class in `X`; without, its class is the most probable one, and the
        baseline the nearest point with the mean of the other class.

    Returns
    -------
    DataFrame
        One row for each bin or feature, largest contribution first: "column", "channel", "low"
        and "high" [orders; NaN without a band], "contribution" (mean magnitude over recordings
        and other classes [nats]), "share", and the mean magnitude for each pair of classes, "a vs
        b". In `attrs`: "quantity".

    Raises
    ------
    TypeError, ValueError
        As `explain_decision`; or if `y` has another length, an unknown class or a single class.

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
    magnitudes: dict[str, Array] = {}
    for pair in combinations(codes, 2):
        found = []
        for code, other in (pair, pair[::-1]):
            centre = None if y is None else traced.positions[own == other].mean(axis=0)
            step, start, end = traced.lines(classifier, other, centre, chosen=own == code)
            slope = mean_slope_of_log_odds(classifier, start, end, code, other)
            found.append(np.abs(traced.split(step, slope)))
        if any(map(len, found)):
            name = " vs ".join(str(label) for label in classifier.classes_[list(pair)].tolist())
            magnitudes[name] = np.concatenate(found)
    if not magnitudes:
        raise ValueError(
            "a model is explained by pairs of classes, but the recordings have one class only."
        )
    pairs = {name: values.mean(axis=0) for name, values in magnitudes.items()}
    overall = np.concatenate([*magnitudes.values()]).mean(axis=0)
    table = _ranked(traced.bins.assign(contribution=overall, **pairs))
    table.attrs = {"quantity": "mean magnitude of the contributions to the log odds [nats]"}
    return table


@dataclass(frozen=True)
class _Traced:
    """Recordings as bins, positions (after the element-wise steps) and features."""

    values: Array
    bins: pd.DataFrame
    trace: FeatureTrace
    positions: Array
    features: Array

    @classmethod
    def of(cls, opened: OpenedPipeline, X: Any) -> _Traced:
        values, bins = opened.table(X)
        trace = trace_features(opened.steps, values)
        positions = trace.positions(values)
        return cls(values, bins, trace, positions, trace.features(positions))

    def lines(
        self,
        classifier: CostSensitiveGaussianBayes,
        code: int,
        centre: Array | None,
        *,
        chosen: Any = slice(None),
    ) -> tuple[Array, Array, Array]:
        """Return the lines to the chosen recordings: steps in positions, both ends in features."""
        end, matrix = self.features[chosen], self.trace.matrix
        if centre is not None:
            step = self.positions[chosen] - centre
        else:
            step = end - classifier.means_[code]
            if self.trace.linear:  # the shortest step with this difference of features
                step = step @ np.linalg.pinv(matrix).T
        return step, end - step @ matrix.T, end

    def deviations(
        self,
        classifier: CostSensitiveGaussianBayes,
        scales: Array,
        step: Array,
        others: Array | None,
    ) -> pd.DataFrame:
        """Return the deviations of one recording, which is a step away from the nearest class.

        `others` are the positions of background recordings, whose range is that of the training
        where the features are projections of several columns.
        """
        place = self.positions[0]
        low, high, spread = np.full((3, len(place)), np.nan)
        if not self.trace.linear:  # each feature is the position of one column
            low, high = classifier.feature_range_
            spread = classifier.distances_.deviations
        elif others is not None:
            low, high, spread = others.min(axis=0), others.max(axis=0), others.std(axis=0)
        references = (place - step[0], low, high)
        return find_deviations(self.trace, self.values[0], scales, references, spread)

    def split(self, step: Array, slope: Array) -> Array:
        """Distribute the explained quantity over the bins, shape (n_recordings, n_bins)."""
        return self.trace.by_column(step * (slope @ self.trace.matrix), len(self.bins))


def _ranked(table: pd.DataFrame) -> pd.DataFrame:
    """Add the shares to a table of contributions, largest first."""
    magnitudes = table["contribution"].abs()
    table.insert(5, "share", magnitudes / (magnitudes.sum() or 1.0))
    return table.sort_values(
        "contribution", key=lambda values: -values.abs(), kind="stable", ignore_index=True
    )


def _question(
    classifier: CostSensitiveGaussianBayes, features: Array, decision: Any, against: Any
) -> tuple[Any, Any]:
    """Return the two labels that are compared."""
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
            raise ValueError(f"there is no alternative to {decision!r}. Give against=...")
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
            f"{decision!r} and {against!r} cannot be compared: both must be classes {classes}, "
            f"or both must be decisions {decisions}."
        )
    return pair


def _as_classes(classifier: CostSensitiveGaussianBayes, *labels: Any) -> bool:
    """Return whether labels are compared as classes (by odds) and not as decisions (by cost)."""
    classes, decisions = set(classifier.classes_.tolist()), set(classifier.decisions_.tolist())
    return classes.issuperset(labels) and (classes <= decisions or not decisions.issuperset(labels))


def _with_unknown(classifier: CostSensitiveGaussianBayes, *labels: Any) -> bool:
    """Return whether one of the labels is the unknown state, which has no density."""
    return classifier.unknown is not None and classifier.unknown in labels


def _saved_costs(
    classifier: CostSensitiveGaussianBayes, decision: Any, against: Any
) -> tuple[Array | None, int]:
    """Return the cost saved by the decision for each class, and the class of the baseline.

    For two classes, costs are not used (None), and the baseline is the other class.
    """
    if _as_classes(classifier, decision, against):
        return None, classifier.classes_.tolist().index(against)
    decisions, known = classifier.decisions_.tolist(), len(classifier.classes_)
    cost = classifier.cost_[:, :known]  # given that the true state is one of the classes
    saved = cost[decisions.index(against)] - cost[decisions.index(decision)]
    return saved, int(np.argmin(np.where(classifier.priors_ > 0, saved, np.inf)))


def _class_codes(
    classifier: CostSensitiveGaussianBayes, y: ArrayLike, n_recordings: int
) -> NDArray[np.intp]:
    labels = label_list(y)
    if len(labels) != n_recordings:
        raise ValueError(
            f"y must contain one class for each of {n_recordings} recordings, got {len(labels)}."
        )
    return np.array(label_positions(labels, classifier.classes_.tolist(), "y", "class"), np.intp)


def joint_log_proba(classifier: CostSensitiveGaussianBayes, features: Array) -> Array:
    """Return the logarithm of prior times density, shape (n_recordings, n_classes)."""
    return classifier.predict_joint_log_proba(with_names(classifier, features))


def log_odds(
    classifier: CostSensitiveGaussianBayes, features: Array, code: int, other: int
) -> Array:
    """Return the log odds of one class (by index) against another [nats], shape (n_recordings,)."""
    joint = joint_log_proba(classifier, features)
    return joint[:, code] - joint[:, other]


def cost_saved(classifier: CostSensitiveGaussianBayes, features: Array, costs: Array) -> Array:
    """Return the expectation of costs of the classes, shape (n_recordings,)."""
    return softmax(joint_log_proba(classifier, features), axis=1) @ costs


def mean_slope_of_log_odds(
    classifier: CostSensitiveGaussianBayes, start: Array, end: Array, code: int, other: int
) -> Array:
    """Return the mean gradient of the log odds along lines.

    Parameters
    ----------
    classifier : CostSensitiveGaussianBayes
        Fitted.
    start, end : ndarray of shape (n_recordings, n_features)
        Ends of each line.
    code, other : int
        Indices of the two classes.

    Returns
    -------
    ndarray of shape (n_recordings, n_features)
        Nats per unit of the feature.

    Examples
    --------
    >>> model = CostSensitiveGaussianBayes().fit([[0.0], [2.0], [5.0], [9.0]], [0, 0, 1, 1])
    >>> start, end = np.array([[1.0]]), np.array([[6.0]])
    >>> total = mean_slope_of_log_odds(model, start, end, 1, 0) * (end - start)
    >>> change = log_odds(model, end, 1, 0) - log_odds(model, start, 1, 0)
    >>> bool(np.isclose(total[0, 0], change[0]))
    True
    """
    middle = (start + end) / 2  # the gradient is linear along the line
    slopes = classifier.log_density_gradient(with_names(classifier, middle))
    return slopes[:, code] - slopes[:, other]


def mean_slope_of_cost(
    classifier: CostSensitiveGaussianBayes, start: Array, end: Array, costs: Array
) -> Array:
    """Return the mean gradient of an expected cost along one line.

    Parameters
    ----------
    classifier : CostSensitiveGaussianBayes
        Fitted.
    start, end : ndarray of shape (1, n_features)
        Ends of the line.
    costs : ndarray of shape (n_classes,)
        Cost if a class is true.

    Returns
    -------
    ndarray of shape (1, n_features)
        Unit of the cost per unit of the feature.

    Examples
    --------
    >>> model = CostSensitiveGaussianBayes().fit([[0.0], [2.0], [5.0], [9.0]], [0, 0, 1, 1])
    >>> start, end, costs = np.array([[1.0]]), np.array([[6.0]]), np.array([0.0, 10.0])
    >>> total = mean_slope_of_cost(model, start, end, costs) * (end - start)
    >>> change = cost_saved(model, end, costs) - cost_saved(model, start, costs)
    >>> bool(np.isclose(total[0, 0], change[0]))
    True
    """
    step, total = end - start, np.zeros(start.shape[1])
    for low, high in pairwise([0.0, *_breakpoints(classifier, start, end), 1.0]):
        points = start + (low + (high - low) * _NODES[:, np.newaxis]) * step
        posterior = softmax(joint_log_proba(classifier, points), axis=1)
        change = posterior * (costs - posterior @ costs[:, np.newaxis])  # per log density
        slopes = classifier.log_density_gradient(with_names(classifier, points))
        total += (high - low) * np.einsum("n,nk,nkf->f", _WEIGHTS, change, slopes)
    return total[np.newaxis]


def _breakpoints(
    classifier: CostSensitiveGaussianBayes,
    start: Array,
    end: Array,
    *,
    range_of_odds: float = 40.0,
    step: float = 20.0,
) -> list[float]:
    """Return points between which the log odds of any two probable classes change little.

    A posterior changes only while log odds are within `range_of_odds` [nats]. This part may be much
    shorter than the line; it is divided into steps [nats].
    """
    line = np.concatenate([start, (start + end) / 2, end])
    first, middle, last = joint_log_proba(classifier, line)[:, classifier.priors_ > 0]
    parabolas = np.array([2 * (first + last - 2 * middle), 4 * middle - 3 * first - last, first])
    points = set()
    for pair in combinations(range(len(first)), 2):
        for level in np.arange(-range_of_odds, range_of_odds + step, step):
            # Complex roots mark where the log odds are nearest to the level.
            for root in np.roots(parabolas[:, pair] @ [1, -1] - [0, 0, level]).real:
                joint = np.polyval(parabolas, root)
                if 0 < root < 1 and joint[list(pair)].max() >= joint.max() - range_of_odds:
                    points.add(float(root))
    return sorted(points)
