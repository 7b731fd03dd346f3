"""Means of what was decided, and how far they may be off: whole groups of recordings resampled.

Recordings of one run are near copies of one another, so they count as one observation, not as
many: the interval comes from drawing runs (or units) anew, with all their recordings [1]_.

References
----------
.. [1] A. C. Davison and D. V. Hinkley, Bootstrap Methods and their Application, Cambridge 1997,
   section 3.8 (hierarchical data).
.. [2] T. C. Hesterberg, What Teachers Should Know About the Bootstrap, The American Statistician
   69(4), 2015: percentiles expanded for few observations.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import norm, t

from emacm._checks import check_count, check_number

Array = NDArray[np.float64]

_BLOCK = 1 << 22  # draws held at a time
_FEW = 5  # groups, below which draws repeat so often that their percentiles say little
_LEAST = 100  # draws
_SHARE = 0.1  # of the draws that must hold every cell, or there is no interval


def cell_mean(values: ArrayLike, cells: ArrayLike) -> float:
    """Average within each cell, then over the cells.

    With values 0 or 1 (right or wrong) and one cell for each class this is the balanced
    accuracy; with a single cell it is a share.

    Parameters
    ----------
    values : array-like of shape (n_recordings,)
        One number for each recording.
    cells : array-like of int of shape (n_recordings,)
        Cell of each; a negative one leaves the recording out.

    Returns
    -------
    mean : float
        NaN if no recording is in a cell.

    Examples
    --------
    >>> cell_mean([1, 1, 1, 0], [0, 0, 0, 1])
    0.5
    >>> cell_mean([1, 1, 1, 0], [0, 0, 0, 0])
    0.75
    """
    sums, counts = _by_group(np.asarray(values, float), np.asarray(cells))
    return float(np.mean(sums.sum(axis=0) / counts.sum(axis=0))) if counts.size else np.nan


def group_intervals(
    values: ArrayLike,
    cells: ArrayLike,
    groups: ArrayLike,
    *,
    confidence: float = 0.95,
    n_resamples: int = 2000,
    random_state: Any = 0,
) -> Array:
    """Find an interval for each of several cell means by drawing groups with replacement.

    Parameters
    ----------
    values : array-like of shape (n_figures, n_recordings)
        One number for each figure and recording.
    cells : array-like of int of shape (n_figures, n_recordings)
        Cells of each figure, as for `cell_mean`.
    groups : array-like of shape (n_recordings,)
        Group of each recording (run, unit); recordings of a group are drawn together.
    confidence : float, default=0.95
        Probability that the interval is to hold.
    n_resamples : int, default=2000
        How many times groups are drawn.
    random_state : int, Generator or None, default=0
        Seed.

    Returns
    -------
    intervals : ndarray of shape (n_figures, 2)
        Lower and upper end. NaN where fewer than two groups hold recordings that count, or
        where more than nine in ten draws miss one of the cells.

    Notes
    -----
    Percentiles of n groups are too narrow by sqrt((n-1)/n), and as much again as a normal
    distribution is narrower than Student's; they are taken further out to make up for it
    ([2]_, "expanded percentile interval"). No percentile lies beyond the draws, though, and of
    few groups there are few different ones: below five groups the interval is that of Student's
    t with the standard deviation of the draws, cut where no value lies. A draw without any
    recording of a cell is left out. Values that never differ give an interval of no width, which
    is no certainty.

    Examples
    --------
    >>> right = np.repeat([1.0, 1.0, 0.0, 1.0], 25)  # four runs of 25 near copies
    >>> one_cell = np.zeros((1, 100), int)
    >>> group_intervals([right], one_cell, np.repeat([1, 2, 3, 4], 25))
    array([[0., 1.]])
    >>> group_intervals([right], one_cell, np.arange(100)).round(2)  # as if they were no copies
    array([[0.66, 0.83]])
    """
    check_limits(confidence, n_resamples)
    values, cells = np.asarray(values, float), np.asarray(cells)
    codes = np.unique(np.asarray(groups), return_inverse=True)[1]
    tables = [_by_group(v, c, codes) for v, c in zip(values, cells, strict=True)]
    replicates = _replicates(tables, n_resamples, np.random.default_rng(random_state))
    intervals = []
    for value, cell, (_, counts), drawn in zip(values, cells, tables, replicates, strict=True):
        n_groups, drawn = int((counts.sum(axis=1) > 0).sum()), drawn[np.isfinite(drawn)]
        if n_groups < 2 or len(drawn) < _SHARE * n_resamples:
            intervals.append((np.nan, np.nan))
        elif n_groups < _FEW:
            low, high = _student(cell_mean(value, cell), drawn, n_groups, confidence)
            extremes = value[cell >= 0].min(), value[cell >= 0].max()
            intervals.append((max(low, extremes[0]), min(high, extremes[1])))
        else:
            intervals.append(_expanded_percentiles(drawn, n_groups, confidence))
    return np.array(intervals).reshape(-1, 2)


def check_limits(confidence: float, n_resamples: int) -> None:
    """Check what `group_intervals` takes, before anything costly is done.

    Raises
    ------
    TypeError, ValueError
        If `confidence` is not between 0 and 1, or `n_resamples` no count of at least 100.
    """
    check_number(confidence, "confidence", above=0, below=1)
    check_count(n_resamples, "n_resamples", at_least=_LEAST)


def _by_group(
    values: Array, cells: NDArray[Any], codes: NDArray[np.intp] | None = None
) -> tuple[Array, Array]:
    """Sum up values and recordings, shape (n_groups, n_cells); cells without any are dropped."""
    codes = np.zeros(len(values), np.intp) if codes is None else codes
    n_groups, counted = int(codes.max(initial=0)) + 1, cells >= 0
    known, places = np.unique(cells[counted], return_inverse=True)
    flat = codes[counted] * len(known) + places
    shape, size = (n_groups, len(known)), n_groups * len(known)
    sums = np.bincount(flat, values[counted], minlength=size).reshape(shape)
    counts = np.bincount(flat, minlength=size).reshape(shape)
    return sums.astype(np.float64), counts.astype(np.float64)


def _replicates(
    tables: list[tuple[Array, Array]], n_resamples: int, rng: np.random.Generator
) -> list[Array]:
    """Draw groups; return the figures of each draw, NaN where a cell is empty."""
    n_groups = len(tables[0][0]) if tables else 1
    sizes = [sums.shape[1] for sums, _ in tables]
    sums, counts = (np.hstack([table[part] for table in tables]) for part in (0, 1))
    drawn = []
    step = max(1, _BLOCK // n_groups)
    for start in range(0, n_resamples, step):
        shares = np.full(n_groups, 1 / n_groups)
        times = rng.multinomial(n_groups, shares, min(step, n_resamples - start)).astype(float)
        below = times @ counts
        drawn.append((times @ sums) / np.where(below > 0, below, np.nan))
    ratios = np.split(np.vstack(drawn), np.cumsum(sizes)[:-1], axis=1)
    return [ratio.mean(axis=1) if ratio.shape[1] else np.empty(0) for ratio in ratios]


def _student(mean: float, drawn: Array, n_groups: int, confidence: float) -> tuple[float, float]:
    spread = drawn.std() * np.sqrt(n_groups / (n_groups - 1))
    reach = float(spread * t.ppf((1 + confidence) / 2, n_groups - 1))
    return mean - reach, mean + reach


def _expanded_percentiles(drawn: Array, n_groups: int, confidence: float) -> tuple[float, float]:
    # Hesterberg (2015): Phi^-1(a') = -sqrt(n / (n - 1)) t_{a, n-1}.
    reach = np.sqrt(n_groups / (n_groups - 1)) * t.ppf((1 + confidence) / 2, n_groups - 1)
    tail = float(norm.cdf(-reach))
    low, high = np.quantile(drawn, [tail, 1 - tail])
    return float(low), float(high)
