"""Base of the transformers of order spectra, which read the order axis from the columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.base import TransformerMixin
from sklearn.utils.validation import check_array, check_is_fitted, validate_data

from emacm._checks import (
    check_finite_table,
    check_table,
    check_unique_columns,
    within_float64,
)
from emacm._saved import SavedEstimator
from emacm.orders.columns import (
    check_input_names,
    column_names,
    lost_axis,
    parse_order_columns,
)


class OrderTableTransformer(TransformerMixin, SavedEstimator):
    """Base of transformers whose input is a table of order spectra.

    A subclass sets `order_step`, or None where the axis always comes from the names of the columns,
    and `_columns_out` in `fit`.

    Attributes
    ----------
    n_features_in_ : int
        Number of columns seen in `fit`.
    feature_names_in_ : ndarray of str
        Their names, where they have names.
    """

    order_step: float | None = None
    _columns_out: tuple[str, ...]

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:
        """Return the names of the columns, ``channel@low-high`` or ``channel@name``.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of the columns; if given, they must be those of `fit`.

        Returns
        -------
        ndarray of str
        """
        check_is_fitted(self)
        if input_features is not None:
            seen = getattr(self, "feature_names_in_", None)
            check_input_names(input_features, seen, self.n_features_in_)
        return np.array(self._columns_out, dtype=object)

    def _fit_table(self, X: Any) -> NDArray[np.floating]:
        """Check the spectra passed to `fit`, and store the names of their columns."""
        names = self._checked_names(X)
        options = {"dtype": np.float64, "ensure_min_features": 2, "ensure_all_finite": False}
        with within_float64():
            if names is not None and _names_orders(names):
                psd = check_array(X, **options)
                # validate_data would not see the names of every container.
                self.n_features_in_ = psd.shape[1]
                self.feature_names_in_ = np.array(names, dtype=object)
            else:
                psd = validate_data(self, X, **options)
        check_finite_table(psd, "recording", names)
        return psd

    def _read_table(self, X: Any) -> NDArray[np.floating]:
        """Check the spectra passed to `transform`; return them in float64 or float32."""
        check_is_fitted(self)
        names = self._checked_names(X)
        options = {"dtype": [np.float64, np.float32], "ensure_all_finite": False}
        with within_float64():
            if self._same_axis(names):
                psd = check_array(X, **options)
            else:
                psd = validate_data(self, X, reset=False, **options)
        check_finite_table(psd, "recording", names)
        return psd

    def _checked_names(self, X: Any) -> tuple[Any, ...] | None:
        check_table(X)
        names = column_names(X)
        if isinstance(X, pd.DataFrame):
            check_unique_columns(X, "X")
        self._refuse_lost_axis(X)
        return names

    def _refuse_lost_axis(self, X: Any) -> None:
        if self.order_step is None and lost_axis(X):
            raise ValueError(
                f"X was an order table, but an operation on it (a choice of columns, arithmetic) "
                f"has removed its orders. Do that after {type(self).__name__}, or pass a DataFrame "
                f"with the names of the columns, or state order_step of BinTransformer."
            )

    def _same_axis(self, names: Sequence[Any] | None) -> bool:
        """Return whether the names are the order axis of `fit`; refuse another one."""
        seen = getattr(self, "feature_names_in_", None)
        if names is None or seen is None or not (_names_orders(names) or _names_orders(seen)):
            return False  # scikit-learn reports other mismatches
        if tuple(names) == tuple(seen):
            return True
        if set(names) == set(seen):
            came = "these columns in another order"
        else:
            came = f"{len(names)} columns {names[0]!r} to {names[-1]!r}"
        raise ValueError(
            f"X has another order axis than the one {type(self).__name__} was fitted on: expected "
            f"{len(seen)} columns {seen[0]!r} to {seen[-1]!r}, got {came}. Use the same theta_s, "
            f"revolutions and channels, or fit again."
        )


def _names_orders(names: Sequence[Any]) -> bool:
    """Return whether the first name is a column of an order spectrum."""
    return parse_order_columns(names[:1]) is not None
