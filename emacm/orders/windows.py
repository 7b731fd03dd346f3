"""Windows and detrending of the segments of Welch's method."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import scipy  # scipy.signal takes a tenth of a second to import, so it is imported on first use
from numpy.typing import NDArray

from emacm._checks import check_real_array


def window_values(window: Any, length: int) -> NDArray[np.floating]:
    """Return the samples of a window.

    Parameters
    ----------
    window : str, tuple or array-like of shape (length,)
        As for `scipy.signal.get_window`, or the samples themselves.
    length : int
        Samples of a segment.

    Returns
    -------
    ndarray of shape (length,)

    Raises
    ------
    TypeError, ValueError
        If the window is unknown, has another length, or its samples sum to 0.
    """
    if isinstance(window, str):
        return _cached_window(window, length)
    if isinstance(window, tuple):  # it may hold values that cannot be hashed
        return _named_window(window, length)
    values = check_real_array(window, "window")
    if values.shape != (length,):
        raise ValueError(
            f"a window given as an array must have the {length} samples of a segment, "
            f"got shape {values.shape}. Name it instead, or set n_per_segment."
        )
    return _checked(values.astype(np.float64), "an array")


def detrended(segments: NDArray[np.floating], detrend: Any) -> NDArray[np.floating]:
    """Remove the mean or the straight line of best fit from each segment, in float64.

    Parameters
    ----------
    segments : ndarray of shape (..., n_angles)
    detrend : {"constant", "linear", None, False}

    Returns
    -------
    ndarray of shape (..., n_angles)
    """
    segments = segments.astype(np.float64, copy=False)
    if detrend == "constant":
        return segments - segments.mean(axis=-1, keepdims=True)
    return scipy.signal.detrend(segments, axis=-1, type="linear") if detrend else segments


def _named_window(window: Any, length: int) -> NDArray[np.floating]:
    try:
        values = np.asarray(scipy.signal.get_window(window, length), dtype=np.float64)
    except (ValueError, TypeError, IndexError, AttributeError, OverflowError) as error:
        raise ValueError(
            f"window must be an argument of scipy.signal.get_window, such as 'hann' or "
            f"('kaiser', 8.0); got {window!r}: {error}"
        ) from error
    _checked(values, window).flags.writeable = False
    return values


_cached_window = lru_cache(maxsize=32)(_named_window)


def _checked(values: NDArray[np.floating], name: Any) -> NDArray[np.floating]:
    if not np.all(np.isfinite(values)) or np.sum(values) == 0:
        raise ValueError(
            f"window must be finite and must not sum to 0, but the samples of {name!r} are not "
            f"finite or sum to 0. Choose another window."
        )
    return values
