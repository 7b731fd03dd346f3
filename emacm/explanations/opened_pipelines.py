"""Fitted pipelines, divided at their table of order bins or other named features.

How the features of the classifier depend on the columns of the table is determined by experiment:
the columns are changed one at a time, and the changes of the outputs are observed. This works for
any transformer, including user-defined ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.pipeline import FeatureUnion, Pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_finite_table, check_real_array
from emacm.conditions.feature_baseline import FeatureBaseline
from emacm.conditions.healthy import are_recordings
from emacm.conditions.router import ConditionRouter
from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.pipelines import search_estimator
from emacm.machine.fault_lines import FaultLines
from emacm.orders.band_powers import BandPowers
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.columns import column_names
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.inputs import refuse_single
from emacm.recordings.recording import Recording
from emacm.resampling.angle_recording import AngleRecording

Array = NDArray[np.float64]
Steps = Sequence[tuple[str, Any]]


def _columns(step: Any, names: Any, scales: Array) -> tuple[Any, Array]:
    """Return names and scales of the columns after a step, from those before; None: no names.

    A scale is what one unit of a column is in dB, if it is a level (the logarithm of a power); inf
    for a power, NaN for anything else.
    """
    if isinstance(step, Pipeline):
        for _, inner in flat_steps(step):
            names, scales = _columns(inner, names, scales)
        return names, scales
    if isinstance(step, FeatureBaseline):  # a difference of levels is one in dB
        return _columns(step.transformer_, names, scales)
    if isinstance(step, FeatureUnion):
        members = [(prefix, own) for prefix, own in step.transformer_list if own != "drop"]
        parts = [(prefix, *_columns(own, names, scales)) for prefix, own in members]
        if any(own is None for _, own, _ in parts):
            return None, scales
        verbose = step.verbose_feature_names_out
        joined = [f"{prefix}__{n}" if verbose else n for prefix, own, _ in parts for n in own]
        return joined, np.concatenate([own for _, _, own in parts])
    if isinstance(step, FunctionTransformer) and names is not None:
        scale = _decibels_per_unit(step)
        scales = np.where(np.isinf(scales), scale, np.nan)
        if not hasattr(step, "get_feature_names_out") and not np.isnan(scale):
            return names, scales  # a logarithm of each column
    if not hasattr(step, "get_feature_names_out"):  # from recordings to recordings
        return None, scales
    names = step.get_feature_names_out(names)
    if not isinstance(step, FunctionTransformer):
        powers = dict.fromkeys((BinTransformer, OrderPSD, BandPowers), np.inf)
        known = powers | {FaultLines: 1.0}  # levels in dB
        scales = np.full(len(names), known.get(type(step), np.nan))
    return names, scales


def _decibels_per_unit(logarithm: FunctionTransformer) -> float:
    """Return what one unit of a logarithm of a power is in dB; NaN if it is another function."""
    if logarithm.func is None:
        return np.inf
    powers = 10.0 ** np.arange(-3, 4)[:, np.newaxis]
    try:
        steps = np.diff(logarithm.func(powers, **(logarithm.kw_args or {})), axis=0)
    except (TypeError, ValueError, AttributeError):  # such as a function of DataFrames
        return np.nan
    straight = np.ptp(steps) <= 1e-6 * np.abs(steps).max()  # the powers are 10 dB apart
    return float(10.0 / steps.mean()) if straight and steps.any() else np.nan


@dataclass(frozen=True)
class OpenedPipeline:
    """A fitted pipeline, divided after its last `BinTransformer` or `FaultLines`, or at its table.

    Attributes
    ----------
    before : tuple of transformers
        Steps up to the table of bins, or of other named features; the last one names the columns.
        Empty if the input of the pipeline is a table.
    steps : tuple of (name, transformer)
        Steps from the table to the classifier.
    classifier : CostSensitiveGaussianBayes
        The last step.
    router : ConditionRouter or None
        The router whose pipeline this is, for the condition of the recordings.
    """

    before: tuple[Any, ...]
    steps: tuple[tuple[str, Any], ...]
    classifier: CostSensitiveGaussianBayes
    router: ConditionRouter | None = None

    @classmethod
    def of(cls, pipeline: Any, X: Any) -> OpenedPipeline:
        """Divide a fitted pipeline, search or classifier whose input is `X`.

        Nested pipelines are flattened. Without such a step, the pipeline is divided after the first
        step that turns the recordings `X` into a table, such as a `FeatureUnion`.
        """
        refuse_single(X)
        *steps, (name, classifier) = flat_steps(pipeline)
        if isinstance(classifier, ConditionRouter) and not steps:
            return cls._of_condition(classifier, X)
        if not isinstance(classifier, CostSensitiveGaussianBayes):
            raise TypeError(
                f"the last step must be a CostSensitiveGaussianBayes, whose densities are known; "
                f"got {name!r} ({type(classifier).__name__})."
            )
        check_is_fitted(classifier)
        kinds = BinTransformer | FaultLines
        cut = max((i for i, (_, step) in enumerate(steps, 1) if isinstance(step, kinds)), default=0)
        if not cut and are_recordings(X):
            cut = _first_table(steps, X)
        return cls(tuple(step for _, step in steps[:cut]), tuple(steps[cut:]), classifier)

    @classmethod
    def _of_condition(cls, router: ConditionRouter, X: Any) -> OpenedPipeline:
        """Divide the pipeline of a router for the condition of `X`, with its present costs."""
        check_is_fitted(router)
        models = router.models_of(X)
        if any(model is not models[0] for model in models):
            raise ValueError(
                "the recordings are of several conditions, each with a pipeline of its own in the "
                "ConditionRouter. Explain those of one condition at a time."
            )
        inner = cls.of(models[0], router.inner(X))
        priced = router.with_present_costs(inner.classifier)
        return replace(inner, classifier=priced, router=router)

    def table(self, X: Any) -> tuple[Array, pd.DataFrame, Array]:
        """Return the table of recordings, a description of its columns, and their scales.

        A scale is what one unit of a column is in dB; inf for a power, NaN for anything else.
        """
        X = X if self.router is None else self.router.inner(X)
        if not self.before:
            values, names = self._own_table(X)
            return values, _bin_frame(names), np.full(len(names), np.nan)
        for maker in self.before:
            X = maker.transform(X)
        names, scales = _columns(maker, None, np.empty(0))
        if names is None:
            raise ValueError(
                f"the columns of {type(maker).__name__} have no names, which an explanation needs. "
                f"In that step, write FunctionTransformer(np.log10, feature_names_out="
                f"'one-to-one')."
            )
        frame = _bin_frame(names)
        if isinstance(maker, BinTransformer):
            frame[["low", "high"]] = np.tile(maker.bins_, (len(frame) // len(maker.bins_), 1))
        return np.asarray(X, dtype=np.float64), frame, scales

    def _own_table(self, X: Any) -> tuple[Array, list[Any]]:
        first = self.steps[0][1] if self.steps else self.classifier
        expected = getattr(first, "feature_names_in_", None)
        names: Any = column_names(X) or expected
        if expected is not None and list(names) != list(expected):
            raise ValueError(f"X must have the columns of fit {list(expected)}, got {list(names)}.")
        values = np.asarray(check_real_array(X, "X"), dtype=np.float64)
        labels = [f"x{i}" for i in range(values.shape[1])] if names is None else list(names)
        check_finite_table(values, "recording", labels)
        return values, labels

    def traced(self, X: Any) -> TracedRecordings:
        """Return recordings after each kind of steps."""
        values, bins, scales = self.table(X)
        elementwise, matrix = trace_features(self.steps, values)
        positions, features = (apply_steps(own, values) for own in (elementwise, self.steps))
        is_linear = len(elementwise) < len(self.steps)
        return TracedRecordings(
            values, bins, scales, elementwise, is_linear, matrix, positions, features
        )


@dataclass(frozen=True)
class TracedRecordings:
    """Recordings, and the steps from their table to their features.

    Attributes
    ----------
    table : ndarray of shape (n_recordings, n_columns)
        Rows of the table.
    bins : DataFrame
        Description of its columns.
    scales : ndarray of shape (n_columns,)
        Those of `OpenedPipeline.table`.
    elementwise : sequence of (name, transformer)
        The first steps, whose outputs depend on the column in their place only.
    is_linear : bool
        Whether there are linear steps after them.
    matrix : ndarray of shape (n_features, n_columns)
        Matrix of the linear steps, which is applied to the outputs of the element-wise steps.
    positions : ndarray of shape (n_recordings, n_columns)
        These outputs.
    features : ndarray of shape (n_recordings, n_features)
        Outputs of all steps.
    """

    table: Array
    bins: pd.DataFrame
    scales: Array
    elementwise: Steps
    is_linear: bool
    matrix: Array
    positions: Array
    features: Array


def one_recording(x: Any) -> Any:
    """Return one recording, or one row of a table, as a list or table of length 1.

    Examples
    --------
    >>> one_recording(np.array([1.0, 2.0])).shape
    (1, 2)
    """
    if isinstance(x, pd.Series):
        x = x.to_frame().T
    elif isinstance(x, np.ndarray) and x.ndim == 1:
        x = x[np.newaxis]
    elif isinstance(x, Recording | AngleRecording):
        x = [x]
    if isinstance(x, str) or not hasattr(x, "__len__") or len(x) != 1:
        raise ValueError(
            f"x must be one recording, or one row of a table; got {type(x).__name__}. Select one, "
            f"as X[3] or X.iloc[[3]], or explain them together by explain_model."
        )
    return x


def flat_steps(estimator: Any, name: str = "") -> list[tuple[str, Any]]:
    """Return the steps that do something, with nested pipelines and searches opened."""
    opened = search_estimator(estimator)
    if not isinstance(opened, Pipeline):
        return [(name or type(opened).__name__.lower(), opened)]
    steps = [own for own in opened.steps if own[1] not in (None, "passthrough")]
    return [flat for inner, step in steps for flat in flat_steps(step, inner)]


def _first_table(steps: Steps, X: Any) -> int:
    """Return the number of steps that turn recordings into a table, tested with one of them."""
    sample, reason = list(X[:1]), "No step turns them into a table."
    try:
        for number, (_, step) in enumerate(steps, 1):
            sample = step.transform(sample)
            if len(getattr(sample, "shape", ())) == 2:
                return number
    except (TypeError, ValueError) as error:
        reason = str(error)
    raise ValueError(
        f"X contains recordings, but the steps before the classifier give no table: {reason} "
        f"Pass the table, or the whole pipeline."
    )


def _bin_frame(names: Sequence[Any]) -> pd.DataFrame:
    """Parse channel and orders from the names of bins or lines; from others, the channel."""
    column = pd.Series(list(map(str, names)), dtype=object, name="column")
    number = r"[0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]+)?"
    orders = column.str.extract(rf"@({number})(?:-({number}))?$").astype(np.float64)
    channels = column.str.extract("^(.*)@|^([^:@]*):")  # of a bin, or of another feature
    channel = channels[0].fillna(channels[1]).fillna("")
    low = orders[0]
    return pd.DataFrame(
        {"column": column, "channel": channel, "low": low, "high": orders[1].fillna(low)}
    )


def trace_features(steps: Steps, table: Array) -> tuple[Steps, Array]:
    """Determine the element-wise and linear steps from the columns of a table to the features.

    Parameters
    ----------
    steps : sequence of (name, transformer)
        Fitted steps after the table.
    table : ndarray of shape (n_recordings, n_columns)
        Rows of the table; the steps are tested near the first.

    Returns
    -------
    elementwise : sequence of (name, transformer)
        The leading element-wise steps.
    matrix : ndarray of shape (n_features, n_columns)
        Matrix of the linear steps after them.

    Raises
    ------
    ValueError
        If a step is neither element-wise (each output depends on its own column) nor linear,
        is nonlinear after a step that mixes columns, or gives a value that is not finite; the
        message gives its name.

    Examples
    --------
    >>> from sklearn.decomposition import PCA
    >>> from sklearn.preprocessing import StandardScaler
    >>> X = np.random.default_rng(0).normal(size=(9, 3))
    >>> scaler, pca = StandardScaler().fit(X), PCA(2).fit(StandardScaler().fit_transform(X))
    >>> elementwise, matrix = trace_features([("scaler", scaler), ("pca", pca)], X)
    >>> [name for name, _ in elementwise], np.allclose(matrix, pca.components_)
    (['scaler'], True)
    """
    row = np.asarray(table, dtype=np.float64)[:1]
    elementwise: list[tuple[str, Any]] = []
    matrix = np.eye(row.shape[1])
    for number, (name, step) in enumerate(steps):
        after = apply_step(step, row)
        if not np.isfinite(after).all():
            raise ValueError(
                f"step {name!r} ({type(step).__name__}) gives a value that is not finite, such as "
                f"the logarithm of a channel without power. Check the channels of the recording."
            )
        if len(elementwise) == number and _is_elementwise(step, row):
            elementwise.append((name, step))
        else:
            matrix = _linear_part(name, step, row) @ matrix
        row = after
    return elementwise, matrix


def apply_steps(steps: Steps, values: Array) -> Array:
    """Transform an array by several steps."""
    for _, step in steps:
        values = apply_step(step, values)
    return values


def apply_step(step: Any, values: Array) -> Array:
    """Transform an array, with the column names that the step was fitted on."""
    with np.errstate(all="ignore"):
        return np.asarray(step.transform(with_names(step, values)), dtype=np.float64)


def with_names(estimator: Any, values: Array) -> Any:
    """Return the array, as a DataFrame where the estimator was fitted on names."""
    names = getattr(estimator, "feature_names_in_", None)
    return values if names is None else pd.DataFrame(values, columns=names)


def _is_elementwise(step: Any, row: Array) -> bool:
    """Return whether each output depends on the column in its place only."""
    # One per cent more leaves a positive value positive, so that its logarithm exists.
    responses, size = column_responses(step, row, np.where(row[0] == 0, 1e-3, 0.01 * row[0]))
    strength = np.abs(responses)
    if strength.shape[0] != strength.shape[1] or not np.isfinite(strength).all():
        return False
    responds = strength > 1e-9 * strength.max(axis=1, keepdims=True) + 1e-13 * size
    return not np.any(responds & ~np.eye(len(responds), dtype=bool))


def _linear_part(name: str, step: Any, row: Array) -> Array:
    """Return the matrix of a linear step; raise if it is not linear."""
    n_columns = row.shape[1]
    scale = np.sqrt(np.mean(row**2)) or 1.0
    away = scale * np.random.default_rng(0).uniform(-2, 2, (3, n_columns))
    matrix = column_responses(step, row, np.full(n_columns, scale))[0].T / scale
    measured = apply_step(step, row + away) - apply_step(step, row)
    predicted = away @ matrix.T
    deviation = np.abs(measured - predicted).max(initial=0.0)
    if not deviation <= 1e-6 * np.abs(predicted).max(initial=0.0):
        raise ValueError(
            f"step {name!r} ({type(step).__name__}) cannot be traced back to the bins: it must be "
            f"linear, or element-wise and before any step that mixes columns. Replace it by a "
            f"linear projection (PCA, LDA), and take logarithms before that."
        )
    return matrix


def column_responses(step: Any, row: Array, changes: Array) -> tuple[Array, Array]:
    """Change one column at a time; return the changes and the magnitudes of the outputs.

    The changes have the shape (n_columns, n_outputs).
    """
    before, after = apply_step(step, row), apply_step(step, row + np.diag(changes))
    return after - before, np.abs(before) + np.abs(after).max(axis=0)
