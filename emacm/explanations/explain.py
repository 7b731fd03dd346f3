"""Which orders determine a decision or a model.

A classifier may be correct for the wrong reason: Chirico (section 4.5) found by inspection that two
of his four signals were separated by electrical noise of the healthy unit, at orders 12 and 36, and
not by the bearing. These functions quantify it.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.utils import check_consistent_length

from emacm._checks import check_number
from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.costs import label_list, label_positions
from emacm.explanations.deviations import (
    PROJECTED,
    find_deviations,
    second_state_statement,
    unknown_statements,
)
from emacm.explanations.opened_pipelines import (
    OpenedPipeline,
    TracedRecordings,
    apply_steps,
    one_recording,
    with_names,
)
from emacm.machine.fault_orders import named_orders
from emacm.machine.raised_lines import lines_within

Array = NDArray[np.float64]


def explain_decision(
    pipeline: Any, x: Any, *, decision: Any = None, against: Any = None, background: Any = None
) -> pd.DataFrame:
    """Explain a decision on one recording by order bins, or by other named features.

    The log odds of two classes are distributed over the bins by integrated
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
        Class to explain, or the unknown state. Default: the decision of the pipeline, or the most
        probable class if this decision is not a class ("inspect", or a family).
    against : label, optional
        The alternative. Default: the most probable other class.
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

    See Also
    --------
    emacm.explain_model : What the model uses in general.
    emacm.match_fault_orders : Parts whose orders explain a line.
    emacm.maintenance_report : Pages for maintenance.

    Notes
    -----
    The log odds log P(decision | x) - log P(against | x) [nats] are explained, without any cost.
    They are quadratic in the features, so the gradient is linear along the line and its mean is the
    gradient at the midpoint: exact, without numerical integration. A decision to inspect means that
    no class is probable enough: the two most probable ones are compared.

    If one of the two is the unknown state, the squared distance from the nearest class is
    explained, in the metric of `CostSensitiveGaussianBayes.typicality`; the baseline is that class.
    The table then has the columns "deviation" (from that class), "outside_training" (from the range
    of the training recordings: 0 within) and "unit" of both: "dB" for powers, exactly, and
    "standard deviations" for other features. `attrs` has "statements": sentences such as "orders 9
    to 9.5 of 'vibration' 14 dB above the training maximum". After a projection (PCA),
    which bins deviate is not determined; give the training recordings as `background`.

    Otherwise, `attrs` has "statements" if the recording has lines of another class beside those of
    `decision` (`CostSensitiveGaussianBayes.second_states`): which, and how high they are.

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
    classifier, traced = opened.classifier, opened.traced(x)
    classes = classifier.classes_.tolist()
    decision, against = _question(classifier, traced.features, decision, against)
    with_unknown = classifier.unknown is not None and classifier.unknown in (decision, against)
    of_unknown = classifier.distances_.nearest(traced.features) if with_unknown else None
    code = classes.index(against) if of_unknown is None else int(of_unknown[0])
    others, centre = None, None
    if background is not None:
        values = opened.table(background)[0]
        if not len(values):
            raise ValueError("background must contain at least one recording, got none.")
        others = apply_steps(traced.elementwise, values)
        centre = others.mean(axis=0)
    step, start, end = _lines(classifier, traced, code, centre)
    attrs = {"decision": decision, "against": against, "baseline": classes[code]}
    if with_unknown:
        distances = classifier.distances_
        slope = distances.square_gradient((start + end) / 2, code)
        value = distances.squares(end, code)[0]
        nearest = f"{classes[code]!r}, the nearest class"
        quantity = f"squared distance from {nearest} [standard deviations]"
    else:
        own = classes.index(decision)
        slope = mean_slope_of_log_odds(classifier, start, end, own, code)
        joint = joint_log_proba(classifier, end)[0]
        value = joint[own] - joint[code]
        quantity = f"log odds of {decision!r} against {against!r} [nats]"
    table = traced.bins.assign(contribution=(step * (slope @ traced.matrix))[0])
    attrs |= {"quantity": quantity, "value": float(value)}
    attrs["baseline_value"] = float(value - table["contribution"].sum())
    if with_unknown:
        deviations = _deviations(classifier, traced, step, others)
        attrs["statements"] = [PROJECTED]
        if others is not None or not traced.is_linear:
            attrs["statements"] = unknown_statements(table.join(deviations))
        table = table.join(deviations[["deviation", "outside_training", "unit"]])
    elif statement := _of_second_state(classifier, traced, decision):
        attrs["statements"] = [statement]
    table = _ranked(table)
    table.attrs = attrs
    return table


def explain_model(pipeline: Any, X: Any, y: ArrayLike) -> pd.DataFrame:
    """Explain a model by order bins, or other named features, averaged over many recordings.

    The log odds of the class of each recording against each other class are distributed over the
    bins as in `explain_decision`; the magnitudes of the contributions are averaged.

    Parameters
    ----------
    pipeline : Pipeline, CostSensitiveGaussianBayes or fitted search
        Fitted; ends in a `CostSensitiveGaussianBayes`.
    X : recordings or table
        Input of the pipeline.
    y : array-like of shape (n_recordings,)
        True classes. The baseline is the mean of the other class in `X`.

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

    See Also
    --------
    emacm.explain_decision : One recording.

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
    classifier, traced = opened.classifier, opened.traced(X)
    labels = label_list(y)
    check_consistent_length(traced.features, labels)
    own = np.array(label_positions(labels, classifier.classes_.tolist(), "y", "class"))
    magnitudes: dict[str, Array] = {}
    for pair in combinations(np.unique(own).tolist(), 2):
        found = []
        for code, other in (pair, pair[::-1]):
            centre = traced.positions[own == other].mean(axis=0)
            step, start, end = _lines(classifier, traced, other, centre, chosen=own == code)
            slope = mean_slope_of_log_odds(classifier, start, end, code, other)
            found.append(np.abs(step * (slope @ traced.matrix)))
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


def match_fault_orders(
    explanation: pd.DataFrame,
    orders: pd.DataFrame | Mapping[str, float],
    *,
    slip: float = 0.02,
    min_width: float = 0.0,
) -> pd.DataFrame:
    """Assign predicted fault orders to the bins that determine a decision or a model.

    Parameters
    ----------
    explanation : DataFrame
        From `explain_decision` or `explain_model`, or some of its rows (those of one channel, for
        example).
    orders : DataFrame from `fault_orders`, or mapping of str to float
        Predicted orders by name, with their harmonics.
    slip : float
        Largest relative deviation of a line with slip from its order; in a mapping, every
        line may slip.
    min_width : float
        Smallest width of a line [orders], for example ``4 / revolutions``.

    Returns
    -------
    DataFrame
        The explanation with the columns "fault" (the predicted order in the bin, or the one
        nearest to its centre if there are several; "none" without any), "fault_order" (NaN if
        none) and "n_faults" (number of predicted orders in the bin, which it cannot separate).
        `attrs` additionally contains "predicted_share", the fraction of the contributions in bins
        with a fault order, and "predicted_bins", the fraction of the bins with one, which is the
        predicted share of a model that depends on all bins equally.

    Raises
    ------
    TypeError, ValueError
        If `explanation` is not an explanation, there is no order, or an order is not positive.

    See Also
    --------
    emacm.fault_orders : The orders of the parts.
    emacm.explain_decision : Bins that decided.

    Notes
    -----
    A predicted share close to the fraction of bins proves nothing; one below it suggests a model
    that recognises the units instead of the fault. With many harmonics and wide bins, every bin
    contains a fault order.

    Examples
    --------
    >>> from emacm import fault_orders, match_fault_orders
    >>> explanation = pd.DataFrame(
    ...     {"column": ["v@12-13", "v@6-7"], "low": [12, 6], "high": [13, 7], "share": [0.3, 0.7]}
    ... )
    >>> matched = match_fault_orders(explanation, fault_orders({"BPFI": 6.123}, harmonics=2))
    >>> matched["fault"].tolist(), matched.attrs["predicted_share"]
    (['2xBPFI', 'BPFI'], 1.0)
    """
    columns = ("column", "low", "high", "share")
    missing = [c for c in columns if c not in getattr(explanation, "columns", ())]
    if missing:
        raise ValueError(
            f"explanation must be of explain_decision or explain_model; {missing[0]!r} is missing."
        )
    check_number(slip, "slip", at_least=0, below=1)
    low, high = (explanation[name].to_numpy(np.float64) for name in ("low", "high"))
    inside, nearest = lines_within(low, high, orders, slip=slip, min_width=min_width)
    names, centres = named_orders(orders)
    for row in np.flatnonzero(np.isnan(low)):  # a named band without known edges
        inside[row] = np.array(names) == str(explanation["column"].iloc[row]).rpartition("@")[2]
        nearest[row] = inside[row].argmax()
    hit = np.asarray(inside.any(axis=1))
    matched = explanation.assign(
        fault=np.where(hit, np.array(names, dtype=object)[nearest], "none"),
        fault_order=np.where(hit, centres[nearest], np.nan),
        n_faults=inside.sum(axis=1),
    )
    total = float(explanation["share"].sum())
    matched.attrs = {
        **explanation.attrs,
        "predicted_share": float(explanation["share"][hit].sum()) / total if total else 0.0,
        "predicted_bins": float(hit.mean()) if len(hit) else 0.0,
    }
    return matched


def _lines(
    classifier: CostSensitiveGaussianBayes,
    traced: TracedRecordings,
    code: int,
    centre: Array | None,
    *,
    chosen: Any = slice(None),
) -> tuple[Array, Array, Array]:
    """Return the lines to the chosen recordings: steps in positions, both ends in features."""
    end, matrix = traced.features[chosen], traced.matrix
    if centre is not None:
        step = traced.positions[chosen] - centre
    else:
        step = end - classifier.means_[code]
        if traced.is_linear:  # the shortest step with this difference of features
            step = step @ np.linalg.pinv(matrix).T
    return step, end - step @ matrix.T, end


def _deviations(
    classifier: CostSensitiveGaussianBayes,
    traced: TracedRecordings,
    step: Array,
    others: Array | None,
) -> pd.DataFrame:
    """Return the deviations of one recording, which is a step away from the nearest class.

    `others` are the positions of background recordings, whose range is that of the training
    where the features are projections of several columns.
    """
    low = high = spread = np.full(len(step[0]), np.nan)
    if not traced.is_linear:  # each feature is the position of one column
        low, high = classifier.feature_range_
        spread = classifier.distances_.deviations
    elif others is not None:
        low, high, spread = others.min(axis=0), others.max(axis=0), others.std(axis=0)
    return find_deviations(traced, traced.positions[0] - step[0], spread, low=low, high=high)


def _of_second_state(
    classifier: CostSensitiveGaussianBayes, traced: TracedRecordings, decision: Any
) -> str:
    """Return a sentence on lines of another class beside those of the decided one; "" if none."""
    features = with_names(classifier, traced.features)
    (second,) = classifier.second_states(features, [decision])
    if second is None or traced.is_linear:
        return "" if second is None else second_state_statement(decision, second)
    own, other = map(classifier.classes_.tolist().index, (decision, second))
    distances = classifier.distances_
    mean, spread = distances.means[own], distances.deviations
    parts = distances.raised(own)[other] * (traced.positions[0] - mean) / spread**2
    table = traced.bins.join(find_deviations(traced, mean, spread))
    return second_state_statement(decision, second, table[parts > max(parts.max() / 2, 0.0)])


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
    """Return the two labels that are compared: classes, or one of them the unknown state."""
    classes = classifier.classes_.tolist()
    known = classes if classifier.unknown is None else [*classes, classifier.unknown]
    for name, label in (("decision", decision), ("against", against)):
        if label is not None and label not in known:
            raise ValueError(f"{name} must be one of {known}, got {label!r}.")
    ranked = [classes[i] for i in np.argsort(-joint_log_proba(classifier, features)[0])]
    if decision is None:
        decided = classifier.predict(with_names(classifier, features)).tolist()[0]
        decision = decided if decided in known else next(k for k in ranked if k != against)
    if against is None:
        against = next((label for label in ranked if label != decision), decision)
    if decision == against:
        raise ValueError(f"decision and against must differ, both are {decision!r}.")
    return decision, against


def joint_log_proba(classifier: CostSensitiveGaussianBayes, features: Array) -> Array:
    """Return the logarithm of prior times density, shape (n_recordings, n_classes)."""
    return classifier.predict_joint_log_proba(with_names(classifier, features))


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
    >>> change = np.diff(joint_log_proba(model, end) - joint_log_proba(model, start))
    >>> bool(np.isclose(total[0, 0], change[0, 0]))
    True
    """
    middle = (start + end) / 2  # the gradient is linear along the line
    slopes = classifier.log_density_gradient(with_names(classifier, middle))
    return slopes[:, code] - slopes[:, other]
