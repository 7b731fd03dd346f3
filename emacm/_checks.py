"""Checks of input that every module shares, and the words they answer with."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import isfinite, nan
from numbers import Integral, Real
from operator import ge, gt, le, lt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pandas import DataFrame, Series, factorize

_LIMITS = {"above": gt, "at least": ge, "below": lt, "at most": le}


@contextmanager
def located(where: str | Callable[[], str]) -> Iterator[None]:
    """Put `where` in front of any ValueError or TypeError raised inside.

    The functions below know a channel and a sample; only their caller knows
    which recording it was. A function is called only if there is an error to locate.
    """
    try:
        yield
    except (TypeError, ValueError) as error:
        place = where if isinstance(where, str) else where()
        kind = TypeError if isinstance(error, TypeError) else ValueError
        located_error: Any = kind(f"{place}: {error}")
        located_error.place = place
        raise located_error from error


def check_real_array(values: ArrayLike, name: str) -> NDArray[np.floating]:
    """Return `values` as a float array (float32 stays), or say why it is not numeric.

    Raises
    ------
    TypeError
        If the values are text, objects, dates or complex numbers.
    ValueError
        If they are ragged.
    """
    check_unmasked(values, name)
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"{name} must be a rectangular array of numbers: {error}.") from error
    if array.dtype.kind == "c":
        raise TypeError(
            f"{name} must be real, got complex numbers ({array.dtype}). "
            f"Pass the real and the imaginary part as two channels."
        )
    if array.dtype.kind not in "biuf":
        raise TypeError(f"{name} must be numeric, got {first_non_number(values, array)}.")
    if array.dtype.kind != "f" or array.dtype.itemsize not in (4, 8):
        return array.astype(np.float64)
    return array.astype(array.dtype.newbyteorder("="), copy=False)


def check_unmasked(values: Any, name: str) -> None:
    """Raise a TypeError if `values` is a masked array with masked entries.

    NumPy and scikit-learn drop the mask and compute with what lies under it.
    """
    if np.ma.is_masked(values):
        raise TypeError(f"{name} has masked samples, which are not known. Leave them out.")


def check_table(values: Any) -> None:
    """Raise an error if a table is a masked array, of dates, or has a column name twice.

    Dates would become numbers, or an error that names no column.
    """
    check_unmasked(values, "X")
    dtypes = {"": getattr(values, "dtype", None)}
    if isinstance(values, DataFrame):
        check_unique_columns(values, "X")
        dtypes = {f" in column {column!r}": dtype for column, dtype in values.dtypes.items()}
    for where, dtype in dtypes.items():
        if getattr(dtype, "kind", "") in ("m", "M"):
            raise TypeError(f"X must be numeric, got {dtype}{where}. Use .dt.total_seconds().")


def check_finite(array: NDArray[np.floating], name: str) -> None:
    """Raise a ValueError with the place of the first NaN or infinity in a 1-D array."""
    is_finite = np.isfinite(array)
    if not is_finite.all():
        index = int(np.argmin(is_finite))
        raise ValueError(
            f"{name} must be finite, got {array[index]} at sample {index}. Cut the recording "
            f"before it, repair the gap, or leave it out."
        )


def check_signal(values: ArrayLike, name: str, *, min_length: int = 2) -> NDArray[np.floating]:
    """Return `values` as a finite 1-D float array of at least `min_length` samples."""
    array = check_real_array(values, name)
    if array.ndim != 1:
        raise ValueError(f"{name} must be one-dimensional, got shape {array.shape}.")
    if len(array) < min_length:
        raise ValueError(f"{name} must hold at least {min_length} samples, got {len(array)}.")
    check_finite(array, name)
    return array


def check_number(
    value: Any,
    name: str,
    *,
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    at_most: float | None = None,
    unit: str = "",
) -> float:
    """Return `value` as a finite float within the stated limits."""
    is_number = isinstance(value, Real) and not isinstance(value, bool | np.bool_)
    number = float(value) if is_number else nan
    limits = list(zip(_LIMITS, (above, at_least, below, at_most), strict=True))
    if isfinite(number) and all(x is None or _LIMITS[word](number, x) for word, x in limits):
        return number
    stated = " and ".join(f"{word} {x:.6g}" for word, x in limits if x is not None)
    quantity = f"{name} must be a number{f' of {unit}' if unit else ''}"
    separator = ", " if unit and stated else " " if stated else ""
    kind = ValueError if is_number else TypeError
    raise kind(f"{quantity}{separator}{stated}, got {value!r}.")


def check_count(value: Any, name: str, *, at_least: int = 1, at_most: int | None = None) -> int:
    """Return `value` as an int within the stated limits."""
    expected = f"{name} must be a whole number of at least {at_least}"
    expected += "" if at_most is None else f" and at most {at_most}"
    if isinstance(value, bool | np.bool_) or not isinstance(value, Integral):
        raise TypeError(f"{expected}, got {value!r}.")
    count = int(value)
    if count < at_least or (at_most is not None and count > at_most):
        raise ValueError(f"{expected}, got {value!r}.")
    return count


def check_orders(orders: Any) -> tuple[float, ...]:
    """Return orders as floats: positive, each once."""
    if isinstance(orders, str) or not isinstance(orders, Sequence | np.ndarray):
        raise TypeError(f"orders must be a list of numbers such as [1, 2], got {orders!r}.")
    unique = tuple(check_number(order, "an order", above=0) for order in orders)
    if not unique or len(set(unique)) < len(unique):
        raise ValueError(f"orders must contain each order once, got {list(unique)}.")
    return unique


def check_finite_table(
    table: NDArray[np.floating], rows: str, columns: Sequence[Any] | None = None
) -> None:
    """Raise a ValueError with row and column of the first NaN or infinity in a 2-D array."""
    bad = ~np.isfinite(table)
    if bad.any():
        row, column = (int(place[0]) for place in np.nonzero(bad))
        value = "NaN" if np.isnan(table[row, column]) else "inf (infinity)"
        where = f"sample {column}" if columns is None else f"column {columns[column]!r}"
        raise ValueError(f"X must be finite, got {value} in {rows} {row}, {where}. Leave it out.")


def check_finite_readings(X: NDArray[np.floating], estimator: Any) -> None:
    """Raise as `check_finite_table`, with the names of the columns that the estimator knows."""
    names = getattr(estimator, "feature_names_in_", range(X.shape[1]))
    check_finite_table(X, "reading", list(names))


def check_choice(value: Any, name: str, choices: tuple[Any, ...]) -> Any:
    """Return `value` if it is one of `choices`."""
    if isinstance(value, np.generic):
        value = value.item()
    if not any(value is choice or (value == choice) is True for choice in choices):
        listed = ", ".join(repr(choice) for choice in choices)
        raise ValueError(f"{name} must be one of {listed}; got {value!r}.")
    return value


def check_unique_columns(frame: DataFrame, name: str) -> None:
    """Raise a ValueError if two columns of a DataFrame have the same name."""
    if not frame.columns.is_unique:
        double = list(frame.columns[frame.columns.duplicated()])
        raise ValueError(f"{name} has columns of the same name: {double}. Rename them.")


def once_hint(values: Any) -> str:
    """Say what to do with a generator, of which `transform` would see nothing after `fit`.

    Examples
    --------
    >>> once_hint(iter([1, 2])), once_hint([1, 2])
    (' It can be read only once; write list(...).', '')
    """
    return " It can be read only once; write list(...)." if isinstance(values, Iterator) else ""


def first_non_number(values: Any, array: NDArray[Any]) -> str:
    """Say which of the values is no number, and where."""
    if array.ndim == 1:
        given = values if isinstance(values, list | tuple) else array
        for index, value in enumerate(given):
            if isinstance(value, bool) or not isinstance(value, Real):
                return f"{repr(value)[:60]} at sample {index}. Repair or convert it"
    return repr(values) if array.ndim == 0 else f"{array.dtype} values"


def group_codes(groups: Any, n_recordings: int) -> NDArray[np.intp]:
    """Return the number of the group of each recording, in the order of their first appearance."""
    with located("groups must be one column, such as the unit"):
        labels = Series(groups)
    if len(labels) != n_recordings:
        raise ValueError(
            f"groups must have a label for each of {n_recordings} recordings, got {len(labels)}."
        )
    codes, _ = factorize(labels)
    if (codes < 0).any():
        raise ValueError(
            f"groups must have a label for every recording; that of recording "
            f"{int(np.argmax(codes < 0))} is missing."
        )
    return codes


def positive_weights(
    sample_weight: ArrayLike | None, n_recordings: int, before: float = 0.0
) -> NDArray[np.float64]:
    """Return one finite, non-negative weight per recording; None is a weight of 1 each.

    With a weight of recordings `before` these, all of them may be 0.

    Raises
    ------
    ValueError
        If the shape differs, a weight is negative or not finite (with its position), or all are 0.
    TypeError
        If the weights are not numeric.

    Examples
    --------
    >>> positive_weights(None, 3)
    array([1., 1., 1.])
    """
    if sample_weight is None:
        return np.ones(n_recordings)
    weight = check_real_array(sample_weight, "sample_weight").astype(np.float64)
    if weight.shape != (n_recordings,):
        raise ValueError(
            f"sample_weight must have the shape ({n_recordings},), got shape {weight.shape}."
        )
    bad = ~(np.isfinite(weight) & (weight >= 0))
    if bad.any():
        first = int(np.argmax(bad))
        raise ValueError(
            f"sample_weight must be finite, at least 0, got {weight[first]} at recording {first}."
        )
    if not before + weight.sum() > 0:
        raise ValueError("sample_weight must not be zero for every recording.")
    return weight
