"""Metrics of health indices from which the remaining life is to be predicted.

References
----------
.. [1] J. B. Coble, Merging data sources to predict remaining useful life - an automated method to
   identify prognostic parameters, PhD thesis, University of Tennessee, 2010.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import rankdata

from emacm._checks import check_finite, check_real_array, column_sizes

Array = NDArray[np.float64]

_N_RESAMPLED = 100  # points to which indices of different lengths are resampled


def monotonicity(indices: Sequence[ArrayLike]) -> float:
    """Return how monotonic the indices of several units are [1]_.

    Parameters
    ----------
    indices : sequence of array-like of shape (n_readings,)
        Index of each unit from new to failed.

    Returns
    -------
    float
        Mean over units of ``|increases - decreases| / (n_readings - 1)``, between 0 and 1.

    Raises
    ------
    TypeError, ValueError
        If there is no unit, or one has fewer than two readings.

    Examples
    --------
    >>> monotonicity([[0.0, 1.0, 2.0], [0.0, 3.0, 2.0, 5.0, 9.0]])
    0.75
    """
    signs = [np.sign(np.diff(values)) for values in _units(indices)]
    return float(np.mean([abs(sign.sum()) / len(sign) for sign in signs]))


def trendability(indices: Sequence[ArrayLike], *, ranks: bool = False) -> float:
    """Return how similar the courses of the index of several units are [1]_.

    Parameters
    ----------
    indices : sequence of array-like of shape (n_readings,)
        Index of each unit from new to failed; resampled to the same number of readings.
    ranks : bool, default=False
        Whether to correlate ranks instead of values.

    Returns
    -------
    float
        Smallest absolute correlation of two units, between 0 and 1.

    Raises
    ------
    TypeError, ValueError
        If there are fewer than two units, or an index is constant.

    Examples
    --------
    >>> round(trendability([[0.0, 1.0, 2.0], [5.0, 7.0, 9.0, 11.0]]), 6)
    1.0
    """
    units = _units(indices, at_least=2)
    places = np.linspace(0, 1, _N_RESAMPLED)
    rows = [np.interp(places, np.linspace(0, 1, len(values)), values) for values in units]
    for number, row in enumerate(rows):
        if np.ptp(row) == 0:
            raise ValueError(f"the index of unit {number} is constant; it has no trend.")
    # In units of each, whose squares are finite whatever the unit of an index is.
    rows = [rankdata(row) if ranks else row / column_sizes(row) for row in rows]
    return float(np.abs(np.corrcoef(rows)).min())


def prognosability(indices: Sequence[ArrayLike]) -> float:
    """Return how well the last value of an index agrees between failed units [1]_.

    Parameters
    ----------
    indices : sequence of array-like of shape (n_readings,)
        Index of each unit from new to failed.

    Returns
    -------
    float
        ``exp(-std(last) / mean(|last - first|))``, between 0 and 1.

    Raises
    ------
    TypeError, ValueError
        If there are fewer than two units, or no index changes.

    Examples
    --------
    >>> round(prognosability([[0.0, 2.0, 9.0], [1.0, 3.0, 11.0]]), 4)  # exp(-sqrt(2) / 9.5)
    0.8617
    """
    units = _units(indices, at_least=2)
    last = np.array([values[-1] for values in units])
    change = float(np.mean([abs(values[-1] - values[0]) for values in units]))
    if change == 0:
        raise ValueError("no index changes between its first and its last reading.")
    return float(np.exp(-np.std(last, ddof=1) / change))


def _units(indices: Sequence[ArrayLike], at_least: int = 1) -> list[Array]:
    units = [check_real_array(values, f"the index of unit {i}") for i, values in enumerate(indices)]
    if len(units) < at_least:
        raise ValueError(f"indices must hold at least {at_least} units, got {len(units)}.")
    for number, values in enumerate(units):
        if values.ndim != 1 or len(values) < 2:
            raise ValueError(
                f"the index of unit {number} must have at least two readings, got shape "
                f"{values.shape}."
            )
        check_finite(values, f"the index of unit {number}")
    return [values.astype(np.float64) for values in units]
