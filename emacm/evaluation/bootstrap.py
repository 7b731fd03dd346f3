"""Means with confidence intervals from a bootstrap over whole groups of recordings.

Recordings of one run are near copies of one another and therefore count as one observation: the
bootstrap draws whole runs (or units), each with all its recordings [1]_.

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

_BLOCK = 1 << 22  # numbers of draws held in memory at a time
_FEW = 5  # groups; with fewer, draws repeat so often that their percentiles are uninformative
_FEWEST_DRAWS, _MOST_DRAWS = 100, 1_000_000
_MIN_SHARE = 0.1  # of the draws that must contain every cell, otherwise there is no interval


def cell_mean(values: ArrayLike, cells: ArrayLike) -> float:
    """Compute the mean of each cell, and the mean of these over the cells.

    With values 0 or 1 (wrong or correct) and one cell for each class this is the balanced
    accuracy; with a single cell it is a rate.

    Parameters
    ----------
    values : array-like of shape (n_recordings,)
        One number for each recording.
    cells : array-like of int of shape (n_recordings,)
        Cell of each recording; negative: the recording is not counted.

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
    """Compute a confidence interval of each of several cell means by a bootstrap over groups.

    Parameters
    ----------
    values : array-like of shape (n_figures, n_recordings)
        One number for each figure of merit and recording.
    cells : array-like of int of shape (n_figures, n_recordings)
        Cells of each figure of merit, as in `cell_mean`.
    groups : array-like of shape (n_recordings,)
        Group of each recording (run, unit); recordings of one group are drawn together.
    confidence : float, default=0.95
        Confidence level, above 0 and below 1.
    n_resamples : int, default=2000
        Number of bootstrap draws, 100 to 1,000,000.
    random_state : int, Generator or None, default=0
        Seed.

    Returns
    -------
    intervals : ndarray of shape (n_figures, 2)
        Lower and upper limit. NaN if fewer than two groups contain counted recordings, or if
        more than nine in ten draws miss one of the cells.

    Raises
    ------
    TypeError, ValueError
        If `confidence` or `n_resamples` is outside its range, or the shapes do not agree.

    Notes
    -----
    Percentile intervals of n groups are too narrow by sqrt((n-1)/n), and further by the ratio of
    the normal to Student's t distribution; the percentiles are moved outwards to correct both
    ([2]_, "expanded percentile interval"). Percentiles cannot exceed the draws, and few groups
    give few distinct draws: with fewer than five groups the interval is computed from Student's
    t distribution and the standard deviation of the draws, and is clipped to the range of the
    values. Draws that miss a cell are ignored. If all values are equal, the interval has zero
    width; this does not prove certainty.

    Examples
    --------
    >>> correct = np.repeat([1.0, 1.0, 0.0, 1.0], 25)  # four runs of 25 near copies
    >>> one_cell = np.zeros((1, 100), int)
    >>> group_intervals([correct], one_cell, np.repeat([1, 2, 3, 4], 25))
    array([[0., 1.]])
    >>> group_intervals([correct], one_cell, np.arange(100)).round(2)  # as if independent
    array([[0.66, 0.83]])
    """
    check_bootstrap(confidence, n_resamples)
    values, cells = np.asarray(values, float), np.asarray(cells)
    codes = np.unique(np.asarray(groups), return_inverse=True)[1]
    if values.ndim != 2 or values.shape != cells.shape or values.shape[1:] != codes.shape:
        raise ValueError(
            f"values and cells must have shape (n_figures, n_recordings), and groups one entry "
            f"for each recording; got {values.shape}, {cells.shape} and {codes.shape}."
        )
    tables = [_by_group(v, c, codes) for v, c in zip(values, cells, strict=True)]
    replicates = _replicates(tables, n_resamples, np.random.default_rng(random_state))
    intervals = []
    for value, cell, (_, counts), drawn in zip(values, cells, tables, replicates, strict=True):
        n_groups, drawn = int((counts.sum(axis=1) > 0).sum()), drawn[np.isfinite(drawn)]
        if n_groups < 2 or len(drawn) < _MIN_SHARE * n_resamples:
            intervals.append((np.nan, np.nan))
        elif n_groups < _FEW:
            low, high = _student(cell_mean(value, cell), drawn, n_groups, confidence)
            extremes = value[cell >= 0].min(), value[cell >= 0].max()
            intervals.append((max(low, extremes[0]), min(high, extremes[1])))
        else:
            intervals.append(_expanded_percentiles(drawn, n_groups, confidence))
    return np.array(intervals).reshape(-1, 2)


def check_bootstrap(confidence: float, n_resamples: int) -> None:
    """Check the options of `group_intervals` before a long computation.

    Raises
    ------
    TypeError, ValueError
        If `confidence` is not between 0 and 1, or `n_resamples` is not an integer from
        100 to 1,000,000.
    """
    check_number(confidence, "confidence", above=0, below=1)
    check_count(n_resamples, "n_resamples", at_least=_FEWEST_DRAWS, at_most=_MOST_DRAWS)


def _by_group(
    values: Array, cells: NDArray[Any], codes: NDArray[np.intp] | None = None
) -> tuple[Array, Array]:
    """Return sums of values and counts of recordings, shape (n_groups, n_nonempty_cells)."""
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
    """Draw groups with replacement; return the cell means of each draw, NaN for an empty cell."""
    n_groups = len(tables[0][0]) if tables else 1
    sizes = [sums.shape[1] for sums, _ in tables]
    sums, counts = (np.hstack([table[part] for table in tables]) for part in (0, 1))
    drawn = []
    step = max(1, _BLOCK // n_groups)
    for start in range(0, n_resamples, step):
        shares = np.full(n_groups, 1 / n_groups)
        times = rng.multinomial(n_groups, shares, min(step, n_resamples - start)).astype(float)
        totals = times @ counts
        drawn.append((times @ sums) / np.where(totals > 0, totals, np.nan))
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
