"""The order axis as column names, and an array that keeps its column names.

A column of an order spectrum is named ``channel@order``, a column of bins ``channel@low-high`` or
``channel@name``. The names are exact: a number in a name is parsed to the float it was written
from. The axis is therefore kept by arrays, DataFrames and files, and no order step is stated twice.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import lru_cache
from hashlib import sha256
from itertools import groupby
from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.base import TransformerMixin
from sklearn.utils.validation import check_array, check_is_fitted, validate_data

from emacm._checks import check_finite_table, check_table, check_unique_columns
from emacm._saved import SavedEstimator

BARE_CHANNEL = "signal"  # the channel of a table or row without names
_NUMBER = re.compile(r"[0-9]+(\.[0-9]*)?(e[+-]?[0-9]+)?", re.IGNORECASE)
_BAND = re.compile(rf"(?P<low>{_NUMBER.pattern})-(?P<high>{_NUMBER.pattern})", re.IGNORECASE)
_LOGARITHMS = (np.log, np.log2, np.log10)


class OrderBlock(NamedTuple):
    """The columns that belong to one channel."""

    channel: str
    orders: NDArray[np.floating]
    columns: slice


class BinBlock(NamedTuple):
    """The bins of one channel; `bands` is None where the bins have names."""

    channel: str
    names: tuple[str, ...]
    bands: NDArray[np.floating] | None
    columns: NDArray[np.intp]


class BinPowers(np.ndarray):
    """Powers in bins: a plain array; an error of its logarithm states recording and column.

    Parameters
    ----------
    values : ndarray of shape (n_recordings, n_bins)
        Powers.
    names : sequence of str
        One name for each column, for messages. No operation keeps them.
    """

    _names: tuple[str, ...] | None

    def __new__(cls, values: NDArray[np.floating], names: Sequence[str]) -> Self:
        """View `values`."""
        powers = values.view(cls)
        powers._names = tuple(names)
        return powers

    def __array_finalize__(self, obj: Any) -> None:
        """Drop the names; a subclass restores them where they still hold."""
        self._names = None

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        """Return the result of a ufunc or a reduction: a number, or a plain array.

        A logarithm of 0, as of the power of a dead channel, raises a ValueError: only here are
        the recording and the column known.
        """
        values = np.asarray(array)
        if context is None or context[0] not in _LOGARITHMS or values.ndim != 2:
            return values[()]  # a number, if it has no dimension
        for row, column in np.argwhere(~np.isfinite(values))[:1]:
            name = column if self._names is None else self._names[column]
            raise ValueError(
                f"the logarithm of recording {row}, column {name!r}, does not exist: its value is "
                f"{np.asarray(context[1][0])[row, column]:g}. A channel without power is constant, "
                f"dead, or equal to its baseline: check its sensor, or leave the channel or the "
                f"recording out."
            )
        return values


class OrderTable(BinPowers):
    """A table with one row per recording that keeps the names of its columns.

    It differs from a plain float array in one respect: its `columns` attribute (a tuple of names)
    is kept by pickle, copies and a choice of rows, and by changes of elements in place. It is
    dropped by any other operation (a choice of columns, arithmetic), after which the names may be
    wrong. `numpy.save` does not keep the names and warns; pickle and joblib keep them.

    Parameters
    ----------
    values : array-like of shape (n_recordings, n_columns)
        The table; float32 stays float32, all other numbers become float64.
    columns : sequence of str
        One name for each column.

    Attributes
    ----------
    columns : tuple of str or None
        Names of the columns, or None where they are unknown.
    """

    def __new__(cls, values: Any, columns: Sequence[str]) -> Self:
        """Make a table of `values`, copying them once."""
        columns = tuple(columns)
        # joblib hashes an array by its class, dtype and bytes, so two tables with equal numbers
        # and different axes would have one hash; it also hashes the metadata of the dtype.
        values = np.asarray(values)
        precision = np.float32 if values.dtype == np.float32 else np.float64
        digest = sha256("\0".join(columns).encode()).hexdigest()
        dtype = np.dtype(precision, metadata={"columns": digest})
        return super().__new__(cls, values.astype(dtype), columns)

    @property
    def columns(self) -> tuple[str, ...] | None:
        """Names of the columns, or None where they are unknown."""
        return self._names

    def __getitem__(self, key: Any) -> Any:
        """Index as an array; a choice of rows keeps the names."""
        chosen = super().__getitem__(key)
        if isinstance(chosen, OrderTable) and _chooses_rows(key) and chosen.ndim == self.ndim:
            chosen._names = self._names
        return chosen

    def copy(self, order: Any = "C") -> OrderTable:
        """Return a copy with the names."""
        copied = super().copy(order)
        copied._names = self._names
        return copied

    def __copy__(self, memo: Any = None) -> OrderTable:
        """Return a copy with the names."""
        return self.copy()

    __deepcopy__ = __copy__

    def __reduce__(self) -> Any:
        """Return the state of an ndarray with the names."""
        pickled: Any = super().__reduce__()
        function, arguments, state = pickled
        return function, arguments, (state, self._names)

    def __setstate__(self, state: Any) -> None:
        """Restore numbers and names."""
        numbers, self._names = state
        super().__setstate__(numbers)


def lost_axis(X: Any) -> bool:
    """Return whether an array was computed from an order table and has lost its orders."""
    if column_names(X) is not None:
        return False
    metadata = getattr(getattr(X, "dtype", None), "metadata", None) or {}
    return isinstance(X, OrderTable) or "columns" in metadata


def number_name(number: float) -> str:
    """Write a number in the shortest form that is parsed to the same float.

    Examples
    --------
    >>> number_name(5.0), number_name(0.1), number_name(1 / 3)
    ('5', '0.1', '0.3333333333333333')
    """
    return repr(float(number)).removesuffix(".0")


def order_columns(channels: Iterable[str], orders: Iterable[float]) -> tuple[str, ...]:
    """Name the columns of an order spectrum, channel by channel.

    Examples
    --------
    >>> order_columns(["current"], [0, 0.5, 1])
    ('current@0', 'current@0.5', 'current@1')
    """
    names = [number_name(order) for order in orders]
    return tuple(f"{channel}@{name}" for channel in channels for name in names)


def column_names(X: Any) -> tuple[Any, ...] | None:
    """Return the names of a table's columns, or None if it has none."""
    columns = getattr(X, "columns", None)
    if columns is None or (isinstance(X, OrderTable) and X.shape[-1] != len(columns)):
        return None
    return tuple(columns)


def parse_order_columns(columns: Sequence[Any]) -> tuple[OrderBlock, ...] | None:
    """Parse the order axis from column names.

    Parameters
    ----------
    columns : sequence
        Column names, those of one channel adjacent.

    Returns
    -------
    tuple of OrderBlock or None
        One block per channel; None if no name has the form ``channel@order``.

    Raises
    ------
    ValueError
        If only some names have that form, if a channel occurs in two places, or if its orders do
        not increase.
    """
    return _parsed_columns(tuple(columns))


@lru_cache(maxsize=128)
def _parsed_columns(columns: tuple[Any, ...]) -> tuple[OrderBlock, ...] | None:
    parsed = [_parse(name) for name in columns]
    known = [entry for entry in parsed if entry is not None]
    if not known:
        return None
    if len(known) < len(parsed):
        stranger = columns[parsed.index(None)]
        order = next(name for name, entry in zip(columns, parsed, strict=True) if entry)
        raise ValueError(
            f"all columns or none must be named 'channel@order', but there are {order!r} and "
            f"{stranger!r}. Select the order columns first (for example by a ColumnTransformer)."
        )
    blocks, start = [], 0
    for channel, entries in groupby(known, key=lambda entry: entry[0]):
        orders = np.array([order for _, order in entries])
        if np.any(np.diff(orders) <= 0):
            place = start + 1 + int(np.argmax(np.diff(orders) <= 0))
            raise ValueError(
                f"the orders of a channel must increase, but column {columns[place]!r} follows "
                f"{columns[place - 1]!r}. Restore the order of the columns."
            )
        orders.flags.writeable = False  # it is shared by all callers
        blocks.append(OrderBlock(channel, orders, slice(start, start + len(orders))))
        start += len(orders)
    names = [block.channel for block in blocks]
    if len(set(names)) < len(names):
        raise ValueError(
            f"the columns of a channel must be adjacent; the channels are in the order {names}."
        )
    return tuple(blocks)


def parse_bin_columns(columns: Sequence[Any]) -> tuple[BinBlock, ...] | None:
    """Parse channels and bins from column names, as written by `BinTransformer`.

    Parameters
    ----------
    columns : sequence
        Column names, ``channel@low-high`` or ``channel@name``, in any order.

    Returns
    -------
    tuple of BinBlock or None
        One block per channel, with `bands` of shape (n_bins, 2) [orders] where all its names are
        bands of orders; None if a name has neither form.

    Examples
    --------
    >>> (block,) = parse_bin_columns(["current@0-0.5", "current@0.5-1"])
    >>> block.channel, block.names, block.bands.tolist()
    ('current', ('0-0.5', '0.5-1'), [[0.0, 0.5], [0.5, 1.0]])
    """
    found: dict[str, list[tuple[int, str]]] = {}
    for place, column in enumerate(columns):
        if not isinstance(column, str) or "@" not in column:
            return None
        channel, _, name = column.rpartition("@")
        found.setdefault(channel, []).append((place, name))
    blocks = []
    for channel, entries in found.items():
        names = tuple(name for _, name in entries)
        matches = [_BAND.fullmatch(name) for name in names]
        bands = [(float(match["low"]), float(match["high"])) for match in matches if match]
        increasing = len(bands) == len(names) and all(low < high for low, high in bands)
        known = np.array(bands) if increasing else None
        blocks.append(BinBlock(channel, names, known, np.array([place for place, _ in entries])))
    return tuple(blocks) or None


def _parse(name: Any) -> tuple[str, float] | None:
    if not isinstance(name, str) or "@" not in name:
        return None
    channel, _, order = name.rpartition("@")
    # float() also accepts "1_0", " 5" and digits of other scripts.
    if not _NUMBER.fullmatch(order) or not np.isfinite(float(order)):
        return None
    return channel, float(order)


def _chooses_rows(key: Any) -> bool:
    """Return whether an index leaves the columns unchanged."""
    rows, *rest = key if isinstance(key, tuple) and key else (key,)
    full = all(k is Ellipsis or (isinstance(k, slice) and k == slice(None)) for k in rest)
    return full and (isinstance(rows, slice) or rows is Ellipsis or np.ndim(rows) == 1)


class NamedColumns(TransformerMixin, SavedEstimator):
    """Base of transformers that name their columns.

    A subclass sets in `fit` the names of its columns, `_columns_out`, and the names, if any, and
    the number of those of its input.
    """

    _columns_out: tuple[str, ...]
    _names_in: Sequence[Any] | None
    _n_in: int | None

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:
        """Return the names of the columns.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of the input: columns, channels, or the samples of a row. If given, they are
            compared with those of `fit`.

        Returns
        -------
        ndarray of str
        """
        check_is_fitted(self)
        names, n_expected = input_features, self._n_in
        if names is not None and self._names_in is not None and [*names] != [*self._names_in]:
            raise ValueError("input_features is not equal to feature_names_in_.")
        if names is not None and n_expected is not None and len(names) != n_expected:
            raise ValueError(
                f"input_features should have length equal to what fit saw ({n_expected}), "
                f"got {len(names)}."
            )
        return np.array(self._columns_out, dtype=object)


class OrderTableTransformer(NamedColumns):
    """Base of transformers whose input is a table of order spectra.

    A subclass sets `order_step`, or None where the axis always comes from the names of the columns.

    Attributes
    ----------
    n_features_in_ : int
        Number of columns seen in `fit`.
    feature_names_in_ : ndarray of str
        Their names, where they have names.
    """

    order_step: float | None = None

    def _checked_table(self, X: Any, *, reset: bool) -> NDArray[np.floating]:
        """Check spectra; in `fit`, store the names of their columns, else compare them."""
        if not reset:
            check_is_fitted(self)
        check_table(X)
        names = column_names(X)
        if isinstance(X, pd.DataFrame):
            check_unique_columns(X, "X")
        if self.order_step is None and lost_axis(X):
            raise ValueError(
                f"X was an order table, but an operation on it (a choice of columns, arithmetic) "
                f"has removed its orders. Do that after {type(self).__name__}, or pass a DataFrame "
                f"with the names of the columns, or state order_step of BinTransformer."
            )
        dtype = np.float64 if reset else [np.float64, np.float32]
        options = {"dtype": dtype, "ensure_all_finite": False, "ensure_min_features": 1 + reset}
        if names is not None and (_names_orders(names) if reset else self._same_axis(names)):
            # validate_data would not see the names of every container.
            psd = check_array(X, **options)
            if reset:
                self.n_features_in_ = psd.shape[1]
                self.feature_names_in_ = np.array(names, dtype=object)
        else:
            psd = validate_data(self, X, reset=reset, **options)
        if reset:
            self._names_in, self._n_in = getattr(self, "feature_names_in_", None), psd.shape[1]
        check_finite_table(psd, "recording", names)
        return psd

    def _same_axis(self, names: Sequence[Any]) -> bool:
        """Return whether the names are the order axis of `fit`; refuse another one."""
        seen = getattr(self, "feature_names_in_", None)
        if seen is None or not (_names_orders(names) or _names_orders(seen)):
            return False  # scikit-learn reports other mismatches
        if tuple(names) == tuple(seen):
            return True
        raise ValueError(
            f"X has another order axis than the one {type(self).__name__} was fitted on: expected "
            f"{len(seen)} columns {seen[0]!r} to {seen[-1]!r}, got {len(names)} columns "
            f"{names[0]!r} to {names[-1]!r}. Use the same theta_s, revolutions and channels in the "
            f"same order, or fit again."
        )


def _names_orders(names: Sequence[Any]) -> bool:
    """Return whether the first name is a column of an order spectrum."""
    return parse_order_columns(names[:1]) is not None
