"""What recordings show beyond a healthy machine under the same condition."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, TransformerMixin, clone
from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_choice, check_finite_table, check_real_array, located
from emacm.conditions.feature_baselines import (
    LinearBaseline,
    MeanBaseline,
    linear_baseline_of_features,
    mean_baseline_of_features,
)
from emacm.conditions.healthy import healthy_recordings
from emacm.conditions.mean_signals import (
    ALIGNMENTS,
    AngleBaseline,
    NormalizedRecording,
    mean_baseline,
)
from emacm.orders.columns import OrderTable, column_names
from emacm.recordings.inputs import check_channels, described
from emacm.recordings.meta import (
    condition_name,
    read_meta,
    sorted_conditions,
)
from emacm.recordings.recording import Recording
from emacm.resampling.angle_recording import AngleRecording
from emacm.resampling.inputs import as_angle_recordings


class BaselineNormalizer(  # type: ignore[call-arg]
    TransformerMixin, BaseEstimator, auto_wrap_output_keys=None
):
    """Subtract what healthy recordings of the same condition show.

    Load, speed and the unit itself change signals more than a beginning fault does. What
    the healthy machine shows under the same condition is taken off: either the mean
    *signal* at each shaft angle, of each direction, or mean *features*.

    Parameters
    ----------
    transformer : transformer, optional
        What makes features of recordings. None: signals are normalised; the estimator then
        stands behind `OrderResampler` and gives `OrderPSD` and the like recordings over the
        shaft angle, evaluated when read. Otherwise it makes a table, by a clone of this.
    condition : hashable, tuple or callable, default="load"
        Key of the recordings' `meta` ("load", "unit"); several keys as a tuple; or a
        function of the recording.
    healthy : label, collection of labels, mapping or callable, default="normal"
        Which recordings are healthy: those with these labels in `y`, or with these values in
        `meta`, {key: value or list of values}, or those of which a function says so.
    reference : list of Recording, optional
        Healthy recordings known beforehand (of commissioning, say), which `fit` uses besides
        those in X: a condition that has none in X gets its baseline by them. For signals they
        are resampled as X is.
    align : {"angle", "start"}, default="angle"
        For signals: put strokes together by their shaft angle, or by the angle run since they
        began, where the angle has no fixed zero (velocity alone was recorded).
    scale : bool, default=False
        For features: divide by the standard deviation of the healthy ones in that condition;
        with `regression`, by that of what the lines leave, one for all conditions.
    regression : bool, default=False
        For features: instead of means, straight lines over the conditions, which must then be
        numbers, or tuples of them. They serve conditions that were never seen, too.

    Attributes
    ----------
    conditions_ : tuple
        Conditions with healthy recordings, sorted where they have an order.
    baselines_ : dict of condition to AngleBaseline
        For signals: what is subtracted.
    channels_ : tuple of str
        For signals: the channels.
    theta_s_ : float
        For signals: angle between samples [rad].
    transformer_ : transformer
        For features: the fitted transformer.
    baseline_ : MeanBaseline or LinearBaseline
        For features: what is subtracted.

    Notes
    -----
    Signals are resampled at whole multiples of `theta_s`, so means and differences are
    taken sample by sample, without interpolation. A baseline is known where half of the healthy
    recordings have been (assumed); strokes are cut to that, and `coverage` tells how much is left.
    Short strokes of a shaft that shivers at rest would join the mean: set `min_speed` of
    `OrderResampler` above that. Healthy recordings of training are part of their own
    baseline, and so a share of 1/n_healthy nearer to it than new ones.

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn.preprocessing import FunctionTransformer
    >>> from emacm import BaselineNormalizer, Recording
    >>> runs = [
    ...     Recording({"current": [level] * 2}, 1, velocity=[1.0, 1.0], meta={"load": load})
    ...     for level, load in [(1.0, 20), (3.0, 40), (1.5, 20), (3.5, 40)]
    ... ]
    >>> levels = FunctionTransformer(lambda X: [[run.signals["current"].mean()] for run in X])
    >>> y = ["normal", "normal", "worn", "worn"]
    >>> BaselineNormalizer(levels).fit_transform(runs, y).ravel().tolist()
    [0.0, 0.0, 0.5, 0.5]
    """

    def __init__(
        self,
        transformer: Any = None,
        *,
        condition: Any = "load",
        healthy: Any = "normal",
        reference: Sequence[Any] | None = None,
        align: str = "angle",
        scale: bool = False,
        regression: bool = False,
    ) -> None:
        self.transformer = transformer
        self.condition = condition
        self.healthy = healthy
        self.reference = reference
        self.align = align
        self.scale = scale
        self.regression = regression

    def fit(self, X: Any, y: ArrayLike | None = None) -> BaselineNormalizer:
        """Learn the baselines.

        Parameters
        ----------
        X : list of AngleRecording (signals), or whatever the transformer takes (features)
            Recordings.
        y : array-like of shape (n_recordings,), optional
            Labels; needed where `healthy` is such.

        Returns
        -------
        BaselineNormalizer
            Itself.

        Raises
        ------
        TypeError, ValueError
            If `healthy` is not in y, a condition has no healthy recording (the message names
            it; not with `regression`), channels or `theta_s` differ, or a parameter is not what
            it should be.
        """
        self._fitted_table(X, y)
        return self

    def transform(self, X: Any) -> Any:
        """Subtract the baseline of each recording's condition.

        Parameters
        ----------
        X : list of AngleRecording, or whatever the transformer takes
            Recordings.

        Returns
        -------
        list of NormalizedRecording, or table of shape (n_recordings, n_features)
            For signals: recordings over the shaft angle, evaluated when read. For features: a
            table of the kind that the transformer makes, with the same columns.

        Raises
        ------
        TypeError, ValueError
            If there is no baseline of a recording's condition (the message names both), or its
            channels or `theta_s` are others.
        """
        check_is_fitted(self, "conditions_")
        if self.transformer is None:
            return self._normalized(X)
        return self._relative(self.transformer_.transform(X), self._known_conditions(X))

    def fit_transform(self, X: Any, y: ArrayLike | None = None) -> Any:
        """Learn the baselines, and subtract them, without making features twice.

        Parameters
        ----------
        X : list of AngleRecording, or whatever the transformer takes
            Recordings.
        y : array-like of shape (n_recordings,), optional
            Labels; needed where `healthy` is such.

        Returns
        -------
        list of NormalizedRecording, or table of shape (n_recordings, n_features)
            As `transform` returns.
        """
        table = self._fitted_table(X, y)
        if self.transformer is None:
            return self._normalized(X)
        return self._relative(table, self._known_conditions(X))

    def coverage(self, X: Any) -> pd.DataFrame:
        """Tell how much of the strokes lies where there is a baseline of signals.

        Parameters
        ----------
        X : list of AngleRecording
            Recordings.

        Returns
        -------
        DataFrame
            A row for each recording: "revolutions" of its strokes, "covered" (of these), and
            "share".

        Raises
        ------
        TypeError
            If features are normalised.
        """
        check_is_fitted(self, "conditions_")
        if self.transformer is not None:
            raise TypeError("coverage is of signals over the shaft angle, not of features.")
        found = np.array([recording.coverage() for recording in self._normalized(X)])
        frame = pd.DataFrame(found, columns=["revolutions", "covered"])
        return frame.assign(share=frame["covered"] / frame["revolutions"])

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:
        """Return the names of the channels, or of the transformer's features.

        Parameters
        ----------
        input_features : array-like of str, optional
            As the transformer takes it.

        Returns
        -------
        ndarray of str
        """
        check_is_fitted(self, "conditions_")
        if self.transformer is None:
            return np.array(self.channels_, dtype=object)
        return self.transformer_.get_feature_names_out(input_features)

    def set_output(self, *, transform: str | None = None) -> BaselineNormalizer:
        """Tell the transformer what to return; recordings over the angle are no table.

        Parameters
        ----------
        transform : {"default", "pandas", "polars", None}
            As for any transformer.

        Returns
        -------
        BaselineNormalizer
            Itself.
        """
        for inner in (self.transformer, getattr(self, "transformer_", None)):
            if inner is not None and hasattr(inner, "set_output"):
                inner.set_output(transform=transform)
        return self

    def __sklearn_tags__(self) -> Any:
        """Tell scikit-learn that X is no 2-D table."""
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False
        tags.target_tags.required = not (callable(self.healthy) or hasattr(self.healthy, "keys"))
        return tags

    def _fitted_table(self, X: Any, y: ArrayLike | None) -> Any:
        """Learn, and return the features that X has before anything is subtracted."""
        self._check_parameters()
        found = read_meta(X, self.condition)
        is_healthy = healthy_recordings(X, y, self.healthy)
        reference = _listed_reference(self.reference)
        with located("reference"):
            known = read_meta(reference, self.condition) if reference else []
        if not self.regression:
            self._check_healthy(found, is_healthy, known)
        conditions = [value for value, good in zip(found, is_healthy, strict=True) if good] + known
        if not conditions:
            raise ValueError(f"healthy = {self.healthy!r} holds for none of the recordings.")
        if self.transformer is None:
            self._fit_signals(X, is_healthy, reference, conditions)
            self.conditions_ = sorted_conditions(conditions)
            return None
        self.transformer_ = clone(self.transformer)
        table = self.transformer_.fit_transform(X, y)
        healthy = _values(table)[is_healthy]
        if reference:
            healthy = np.concatenate([healthy, _values(self.transformer_.transform(reference))])
        self.baseline_: MeanBaseline | LinearBaseline
        if self.regression:
            numbers = _numbers(conditions, self.condition)
            self.baseline_ = linear_baseline_of_features(healthy, numbers, scale=self.scale)
        else:
            self.baseline_ = mean_baseline_of_features(healthy, conditions, scale=self.scale)
        self.conditions_ = sorted_conditions(conditions)
        return table

    def _fit_signals(
        self, X: Any, is_healthy: NDArray[np.bool_], reference: list[Any], conditions: list[Any]
    ) -> None:
        rows = as_angle_recordings(X, "BaselineNormalizer")
        first = rows[0]
        self.channels_, self.theta_s_ = first.channels, first.theta_s
        self._check_alike(rows)
        healthy = [row for row, good in zip(rows, is_healthy, strict=True) if good]
        with located("reference"):
            known = _resampled_alike(reference, first)
            self._check_alike(known)
        healthy += known
        self.baselines_: dict[Any, AngleBaseline] = {
            condition: mean_baseline(
                [row for row, own in zip(healthy, conditions, strict=True) if own == condition],
                align=self.align,
                name=condition_name(self.condition, condition),
            )
            for condition in sorted_conditions(conditions)
        }

    def _normalized(self, X: Any) -> list[NormalizedRecording]:
        rows = as_angle_recordings(X, "BaselineNormalizer")
        self._check_alike(rows)
        found = self._known_conditions(rows)
        return [
            NormalizedRecording.of(row, self.baselines_[condition])
            for row, condition in zip(rows, found, strict=True)
        ]

    def _relative(self, table: Any, conditions: list[Any]) -> Any:
        values = _values(table)
        if self.regression:
            relative = self.baseline_.subtracted_from(values, _numbers(conditions, self.condition))
        else:
            relative = self.baseline_.subtracted_from(values, conditions)
        return _like(table, relative)

    def _known_conditions(self, X: Any) -> list[Any]:
        found = read_meta(X, self.condition)
        if self.regression:
            return found
        known = set(self.conditions_)
        for index, value in enumerate(found):
            if value not in known:
                entry = (
                    f"row {index}" if isinstance(X, pd.DataFrame) else described(X[index], index)
                )
                raise ValueError(
                    f"{entry} has {condition_name(self.condition, value)}, but healthy recordings "
                    f"were only seen under {list(self.conditions_)}. Fit with healthy recordings "
                    f"of it, in X or as reference."
                )
        return found

    def _check_parameters(self) -> None:
        check_choice(self.align, "align", ALIGNMENTS)
        check_choice(self.scale, "scale", (True, False))
        check_choice(self.regression, "regression", (True, False))
        if self.transformer is None and (self.scale or self.regression):
            raise ValueError(
                "scale and regression are for features; state the transformer that makes them, "
                "or leave both False to normalise signals."
            )
        made = self.transformer
        if made is not None and (isinstance(made, type) or not hasattr(made, "fit_transform")):
            raise TypeError(
                f"transformer must be None or one that makes a table of recordings, such as "
                f"RecordingStatistics(); got {made!r}."
            )

    def _check_healthy(
        self, found: list[Any], is_healthy: NDArray[np.bool_], known: list[Any]
    ) -> None:
        """Raise a ValueError for a condition that has no healthy recording."""
        for condition in sorted_conditions(found):
            rows = [index for index, other in enumerate(found) if other == condition]
            if not is_healthy[rows].any() and condition not in known:
                raise ValueError(
                    f"none of the {len(rows)} recordings of "
                    f"{condition_name(self.condition, condition)} is healthy "
                    f"(healthy = {self.healthy!r}). Add healthy ones, in X or as reference, or "
                    f"leave this condition out."
                )

    def _check_alike(self, rows: Sequence[AngleRecording]) -> None:
        """Compare recordings with those of `fit`."""
        check_channels(rows, self.channels_, others=False, ordered=True)
        for index, row in enumerate(rows):
            with located(partial(described, row, index)):
                if isinstance(row, NormalizedRecording):
                    raise TypeError("a baseline has been subtracted from it already.")
                if not np.isclose(row.theta_s, self.theta_s_, rtol=1e-12, atol=0):
                    raise ValueError(
                        f"it was resampled with theta_s = {row.theta_s!r}, the baseline with "
                        f"{self.theta_s_!r}. Resample it alike, or fit again."
                    )
                if row.direction == "travel" and self.align == "angle":
                    raise ValueError(
                        "align='angle' needs strokes of one direction each, but "
                        "direction='travel' of OrderResampler joins them. Use align='start'."
                    )


def _listed_reference(reference: Any) -> list[Any]:
    if reference is None:
        return []
    if isinstance(reference, Recording | AngleRecording) or not isinstance(reference, Iterable):
        raise TypeError(f"reference must be None or a list of recordings, got {reference!r}.")
    return list(reference)


def _resampled_alike(reference: list[Any], first: AngleRecording) -> list[AngleRecording]:
    """Return reference recordings over the angle, resampled as those of X are."""
    for entry in reference:
        if not isinstance(entry, Recording | AngleRecording):
            raise TypeError(f"expected recordings, got {entry!r}.")
    check_channels(reference, first.channels)
    return [
        replace(first, measured=entry) if isinstance(entry, Recording) else entry
        for entry in reference
    ]


def _numbers(conditions: list[Any], condition: Any) -> list[Any]:
    """Return conditions as numbers, or say which is none."""
    for value in conditions:
        for part in value if isinstance(value, tuple) else (value,):
            if isinstance(part, bool) or not isinstance(part, Real):
                raise ValueError(
                    f"regression needs conditions that are numbers, but there is "
                    f"{condition_name(condition, value)}. Use regression=False."
                )
    return conditions


def _values(table: Any) -> NDArray[np.float64]:
    """Return the finite numbers of a table of features."""
    values = check_real_array(table, "the table of the transformer").astype(np.float64)
    if values.ndim != 2:
        raise ValueError(
            f"the transformer must make a table of shape (n_recordings, n_features), got shape "
            f"{values.shape}."
        )
    check_finite_table(values, "recording", column_names(table))
    return values


def _like(table: Any, values: NDArray[np.float64]) -> Any:
    """Return numbers in the container of a table, with its names."""
    if isinstance(table, pd.DataFrame):
        return pd.DataFrame(values, index=table.index, columns=table.columns)
    columns = column_names(table)
    if columns is None:
        return values
    if isinstance(table, OrderTable):
        return OrderTable(values, columns)
    return type(table)(values, schema=list(columns))  # polars
