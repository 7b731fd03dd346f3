"""Features relative to the mean of healthy recordings of the same condition."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import clone
from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_finite_table, check_real_array
from emacm._statements import warn
from emacm.conditions.healthy import ConditionBaseline, check_healthy_rates
from emacm.decisions.pipelines import groups_options, parts_with_input
from emacm.orders.columns import OrderTable, column_names
from emacm.recordings.meta import read_meta, sorted_conditions
from emacm.resampling.order_resampler import OrderResampler


class FeatureBaseline(ConditionBaseline, auto_wrap_output_keys=None):  # type: ignore[call-arg]
    """Subtract the mean features of healthy recordings, for each condition.

    Load, speed and the individual unit change features more than an incipient fault does. The
    difference from healthy recordings of the same condition depends on them less. For baselines
    of the signals themselves, see `SignalBaseline`.

    Parameters
    ----------
    transformer : transformer
        Computes the features; a clone of it is fitted. The logarithm of powers belongs here,
        since a load usually multiplies them.
    condition : hashable, tuple or callable, default="load"
        Key of the recordings' `meta` ("load", "unit"), a tuple of keys, or a function of the
        recording.
    healthy : label, or collection of labels, default="healthy"
        Healthy recordings: those with these labels in `y`.
    baseline_recordings : list of Recording, optional
        Further healthy recordings, for example of commissioning, used in addition to those in
        X. A condition without healthy recordings in X gets its baseline from them.

    Attributes
    ----------
    conditions_ : tuple
        Conditions with healthy recordings, sorted if they have an order.
    means_ : dict of condition to ndarray of shape (n_features,)
        The means that are subtracted.
    n_healthy_ : dict of condition to int
        Number of recordings in each mean.
    transformer_ : transformer
        The fitted transformer.

    See Also
    --------
    emacm.SignalBaseline : For signals at each shaft angle, before spectra.
    emacm.ConditionRouter : A model for each condition.

    Notes
    -----
    Another unit of the same type needs a few healthy recordings under each load. Of the recordings
    of an actuator in seven states with a gain of 1.2, a model without baselines called all unknown;
    with 1, 2 and 5 healthy ones at each load, 27, 0 and 0 % of the healthy and 32, 15 and 10 % of
    the faulty ones (notebook 13).

    Healthy recordings used in training are part of their own mean: their difference from it is
    smaller than that of new ones, by the factor 1 - 1/n_healthy.

    With only one condition, it is a constant shift, which changes no decision of a Gaussian
    classifier. `fit` warns if at least 3 recordings of a condition differ from its healthy means
    by more than 10 times their scatter, in the median over the features (assumed), as they do if
    healthy recordings were measured differently.

    Examples
    --------
    >>> from sklearn.preprocessing import FunctionTransformer
    >>> from emacm import FeatureBaseline, Recording
    >>> runs = [
    ...     Recording({"current": [level] * 2}, 1, velocity=[1.0, 1.0], meta={"load": load})
    ...     for level, load in [(1.0, 20), (3.0, 40), (1.5, 20), (3.5, 40)]
    ... ]
    >>> levels = FunctionTransformer(lambda X: [[run.signals["current"].mean()] for run in X])
    >>> y = ["healthy", "healthy", "worn", "worn"]
    >>> FeatureBaseline(levels).fit_transform(runs, y).ravel().tolist()
    [0.0, 0.0, 0.5, 0.5]
    """

    needs_groups = True
    __metadata_request__fit: ClassVar = {"groups": True}  # where metadata routing is enabled

    def __init__(
        self,
        transformer: Any,
        *,
        condition: Any = "load",
        healthy: Any = "healthy",
        baseline_recordings: Sequence[Any] | None = None,
    ) -> None:
        super().__init__(
            condition=condition, healthy=healthy, baseline_recordings=baseline_recordings
        )
        self.transformer = transformer

    def fit(self, X: Any, y: ArrayLike | None = None, groups: Any = None) -> FeatureBaseline:
        """Fit the transformer, and average the features of healthy recordings.

        Parameters
        ----------
        X : list of Recording, or other input of the transformer with `meta`
            Recordings.
        y : array-like of shape (n_recordings,)
            Labels.
        groups : array-like of shape (n_recordings,), optional
            Labels of recordings that were measured together, for the steps of `transformer`, such
            as `BinTransformer`.

        Returns
        -------
        FeatureBaseline
            Itself.

        Raises
        ------
        TypeError, ValueError
            If X or a parameter is invalid, `healthy` is not in y, a condition has no healthy
            recording, a recording was sampled at another rate than the healthy ones, or a feature
            is not finite; the message gives the recording or the condition.
        """
        self.fit_transform(X, y, groups)
        return self

    def transform(self, X: Any) -> Any:
        """Subtract the mean of each recording's condition from its features.

        Parameters
        ----------
        X : list of Recording, or other input of the transformer with `meta`
            Recordings.

        Returns
        -------
        array, OrderTable or DataFrame of shape (n_recordings, n_features)
            Of the type that the transformer returns, with the same columns.

        Raises
        ------
        TypeError, ValueError
            If X is invalid, or a recording's condition has no baseline; the message gives the
            recording.
        """
        check_is_fitted(self)
        check_healthy_rates(X, self._rates)
        return self._difference(X, self.transformer_.transform(X))

    def fit_transform(self, X: Any, y: ArrayLike | None = None, groups: Any = None) -> Any:
        """Fit, and subtract the means, computing the features once.

        Parameters
        ----------
        X : list of Recording, or other input of the transformer with `meta`
            Recordings.
        y : array-like of shape (n_recordings,)
            Labels.
        groups : array-like of shape (n_recordings,), optional
            Labels of recordings that were measured together, for the steps of `transformer`, such
            as `BinTransformer`.

        Returns
        -------
        array, OrderTable or DataFrame of shape (n_recordings, n_features)
            As `transform` returns.
        """
        found = self._find_healthy(X, y)
        transformer = clone(self.transformer)
        table = transformer.fit_transform(X, y, **groups_options(transformer, groups))
        values = _values(table)
        healthy = values[found.mask]
        if found.further:
            healthy = np.concatenate([healthy, _values(transformer.transform(found.further))])
        self._rates = found.rates
        self.means_ = {value: healthy[rows].mean(axis=0) for value, rows in found.rows.items()}
        self.n_healthy_ = {value: len(rows) for value, rows in found.rows.items()}
        self.transformer_, self.conditions_ = transformer, tuple(self.means_)
        self._report_effect(X, values)
        return self._difference(X, table)

    def add_healthy(self, X: Any) -> FeatureBaseline:
        """Set the means of further conditions, such as new units; nothing else is learned.

        Parameters
        ----------
        X : list of Recording, or other input of the transformer with `meta`
            Healthy recordings. Their mean replaces that of a condition that is known already.

        Returns
        -------
        FeatureBaseline
            Itself.

        Raises
        ------
        TypeError, ValueError
            As of `transform`.
        """
        check_is_fitted(self)
        check_healthy_rates(X, self._rates)
        values, conditions = _values(self.transformer_.transform(X)), read_meta(X, self.condition)
        for value in dict.fromkeys(conditions):
            own = values[[entry == value for entry in conditions]]
            self.means_[value], self.n_healthy_[value] = own.mean(axis=0), len(own)
        self.conditions_ = tuple(sorted_conditions(self.means_))
        for part, own in parts_with_input(self.transformer_, X, OrderResampler):
            part.extend_range(own)  # `outside_training` knows these conditions, too
        return self

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:
        """Return the names of the transformer's features.

        Parameters
        ----------
        input_features : array-like of str, optional
            As the transformer takes it.

        Returns
        -------
        ndarray of str
        """
        check_is_fitted(self)
        return self.transformer_.get_feature_names_out(input_features)

    def set_output(self, *, transform: str | None = None) -> FeatureBaseline:
        """Set the type of table that the transformer returns.

        Parameters
        ----------
        transform : {"default", "pandas", "polars", None}
            As for any transformer.

        Returns
        -------
        FeatureBaseline
            Itself.
        """
        for inner in (self.transformer, getattr(self, "transformer_", None)):
            if inner is not None and hasattr(inner, "set_output"):
                inner.set_output(transform=transform)
        return self

    def _report_effect(self, X: Any, values: NDArray[np.float64]) -> None:
        """Warn if the baseline shifts the features much more than they scatter."""
        found = self._known_conditions(X)
        for condition, mean in self.means_.items():
            own = values[[entry == condition for entry in found]]
            if len(own) < 3:  # their scatter is not known
                continue
            shift, scatter = np.abs(own.mean(axis=0) - mean), own.std(axis=0, ddof=1)
            ratios = shift[scatter > 0] / scatter[scatter > 0]
            if len(ratios) and np.median(ratios) > 10:
                warn(
                    "baseline",
                    f"condition {condition!r}: the features of its {len(own)} recordings differ "
                    f"from the healthy means by {np.median(ratios):.3g} times their scatter "
                    f"(median over the features). They may have been measured differently: compare "
                    f"sensors, filters, gain and speed.",
                    stacklevel=4,
                )

    def _difference(self, X: Any, table: Any) -> Any:
        found = self._known_conditions(X)
        return _like(table, _values(table) - np.array([self.means_[value] for value in found]))


def left_out_differences(
    values: NDArray[np.float64], conditions: Sequence[Any], is_healthy: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Subtract from each row the mean of the other healthy rows of its condition.

    Parameters
    ----------
    values : ndarray of shape (n_recordings, n_features)
        Features.
    conditions : sequence of shape (n_recordings,)
        Condition of each, such as its unit.
    is_healthy : ndarray of bool, shape (n_recordings,)
        Which recordings are healthy.

    Returns
    -------
    ndarray of shape (n_recordings, n_features)

    Raises
    ------
    ValueError
        If a condition has fewer than two healthy recordings.

    Examples
    --------
    >>> left_out_differences(np.array([[1.0], [3.0], [9.0]]), "AAA", np.array([True, True, False]))
    array([[-2.],
           [ 2.],
           [ 7.]])
    """
    differences = np.empty_like(values, dtype=np.float64)
    for condition in dict.fromkeys(conditions):
        own = np.array([entry == condition for entry in conditions])
        healthy = values[own & is_healthy]
        if len(healthy) < 2:
            raise ValueError(
                f"{condition!r} has {len(healthy)} healthy recordings, but at least two are needed "
                f"to compare each with the others. Add healthy recordings of it, or leave it out."
            )
        counted = is_healthy[own][:, np.newaxis]
        means = (healthy.sum(axis=0) - counted * values[own]) / (len(healthy) - counted)
        differences[own] = values[own] - means
    return differences


def _values(table: Any) -> NDArray[np.float64]:
    """Return the finite numbers of a table of features."""
    values = check_real_array(table, "the table of the transformer").astype(np.float64)
    if values.ndim != 2:
        raise ValueError(f"the transformer must compute a table, got shape {values.shape}.")
    check_finite_table(values, "recording", column_names(table))
    return values


def _like(table: Any, values: NDArray[np.float64]) -> Any:
    """Return numbers in a table of the same type, with the same names."""
    if isinstance(table, pd.DataFrame):
        return pd.DataFrame(values, index=table.index, columns=table.columns)
    columns = column_names(table)
    if columns is None:
        return values
    if isinstance(table, OrderTable):
        return OrderTable(values, columns)
    return type(table)(values, schema=list(columns))  # polars
