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

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import norm, t

from emacm._checks import check_count, check_number

Array = NDArray[np.float64]
Combine = Callable[[Array, Array], Array]


def mean_of_cells(sums: Array, counts: Array) -> Array:
    """Return the mean of each cell, averaged over the cells; NaN if a cell is empty.

    Parameters
    ----------
    sums, counts : ndarray of shape (..., n_cells)
        Sum of the values in each cell, and number of recordings.

    Returns
    -------
    ndarray of shape (...)
    """
    return (sums / np.where(counts > 0, counts, np.nan)).mean(axis=-1)


def gap_of_cells(sums: Array, counts: Array) -> Array:
    """Return the absolute sums of all cells, added up and divided by the number of recordings.

    With the difference of confidence and correctness as values and bins of confidence as cells,
    this is the expected calibration error. Parameters are those of `mean_of_cells`.

    Examples
    --------
    >>> float(gap_of_cells(np.array([0.5, -1.5]), np.array([3, 5])))
    0.25
    """
    return np.abs(sums).sum(axis=-1) / counts.sum(axis=-1)


def cell_mean(values: ArrayLike, cells: ArrayLike, combine: Combine = mean_of_cells) -> float:
    """Compute the mean of each cell, and the mean of these over the cells.

    With values 0 or 1 (wrong or correct) and one cell for each class this is the balanced
    accuracy; with a single cell it is a rate.

    Parameters
    ----------
    values : array-like of shape (n_recordings,)
        One number for each recording.
    cells : array-like of int of shape (n_recordings,)
        Cell of each recording; negative: the recording is not counted.
    combine : callable, default=mean_of_cells
        Computes the result from sums and counts of the cells that are not empty.

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
    if not counts.size:
        return np.nan
    return float(combine(sums.sum(axis=0), counts.sum(axis=0)))


def group_draws(
    values: ArrayLike,
    cells: ArrayLike,
    groups: ArrayLike,
    *,
    combine: Sequence[Combine] | None = None,
    n_resamples: int = 2000,
    random_state: Any = 0,
) -> list[Array]:
    """Draw groups with replacement, and compute several figures of merit for each draw.

    Parameters
    ----------
    values : array-like of shape (n_figures, n_recordings)
        One number for each figure of merit and recording.
    cells : array-like of int of shape (n_figures, n_recordings)
        Cells of each figure of merit, as in `cell_mean`.
    groups : array-like of shape (n_recordings,)
        Group of each recording (run, unit); recordings of one group are drawn together. Equal
        groups and seeds give equal draws, so that differences of two results are paired.
    combine : sequence of callable, optional
        How the cells of each figure of merit are combined. Default: `mean_of_cells`.
    n_resamples : int, default=2000
        Number of bootstrap draws.
    random_state : int, Generator or None, default=0
        Seed.

    Returns
    -------
    list of ndarray of shape (n_resamples,)
        For each figure of merit; NaN for draws that miss one of its cells, and empty if it has no
        cell.

    """
    values, cells = np.asarray(values, float), np.asarray(cells)
    codes = np.unique(np.asarray(groups), return_inverse=True)[1]
    tables = [_by_group(v, c, codes) for v, c in zip(values, cells, strict=True)]
    combine = [mean_of_cells] * len(tables) if combine is None else combine
    sums, counts = (np.hstack([table[part] for table in tables]) for part in (0, 1))
    edges = np.cumsum([table[0].shape[1] for table in tables])[:-1]
    drawn = []
    for times in drawn_groups(len(sums), n_resamples, random_state):
        totals = (np.split(times @ part, edges, axis=1) for part in (sums, counts))
        parts = zip(combine, *totals, strict=True)
        drawn.append([f(s, n) if n.shape[1] else np.empty(0) for f, s, n in parts])
    return [np.concatenate(parts) for parts in zip(*drawn, strict=True)]


def drawn_groups(n_groups: int, n_resamples: int, random_state: Any = 0) -> Iterator[Array]:
    """Yield how often each group is drawn, in blocks of shape (n_draws, n_groups)."""
    rng, shares = np.random.default_rng(random_state), np.full(n_groups, 1 / n_groups)
    step = max(1, 2**22 // n_groups)  # limits the memory to 32 MiB
    for start in range(0, n_resamples, step):
        size = min(step, n_resamples - start)
        yield rng.multinomial(n_groups, shares, size).astype(float)


def group_intervals(
    values: ArrayLike,
    cells: ArrayLike,
    groups: ArrayLike,
    *,
    combine: Sequence[Combine] | None = None,
    confidence: float = 0.95,
    n_resamples: int = 2000,
    random_state: Any = 0,
) -> Array:
    """Compute a confidence interval of each of several cell means by a bootstrap over groups.

    Parameters
    ----------
    values, cells, groups, combine
        As for `group_draws`.
    confidence : float, default=0.95
        Confidence level, above 0 and below 1.
    n_resamples : int, default=2000
        Number of bootstrap draws, at least 100.
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
        If `confidence` or `n_resamples` is outside its range.

    Notes
    -----
    As `draw_interval`. Draws of `gap_of_cells` are first moved by the difference between their
    mean and the figure of merit: resampling adds to an absolute value. If all values are equal,
    the interval has zero width; this does not prove certainty.

    Examples
    --------
    >>> correct = np.repeat([1.0, 1.0, 0.0, 1.0], 25)  # four runs of 25 near copies
    >>> one_cell = np.zeros((1, 100), int)
    >>> group_intervals([correct], one_cell, np.repeat([1, 2, 3, 4], 25))
    array([[0., 1.]])
    >>> group_intervals([correct], one_cell, np.arange(100)).round(2)  # as if independent
    array([[0.66, 0.83]])
    """
    check_number(confidence, "confidence", above=0, below=1)
    check_count(n_resamples, "n_resamples", at_least=100)
    options = {"combine": combine, "n_resamples": n_resamples, "random_state": random_state}
    replicates = group_draws(values, cells, groups, **options)
    values, cells, groups = np.asarray(values, float), np.asarray(cells), np.asarray(groups)
    intervals = []
    for place, (value, cell, drawn) in enumerate(zip(values, cells, replicates, strict=True)):
        counted = value[cell >= 0]
        n_groups = len(np.unique(groups[cell >= 0]))
        how = mean_of_cells if combine is None else combine[place]
        estimate = cell_mean(value, cell, how)
        limits = (counted.min(), counted.max()) if len(counted) else (np.nan, np.nan)
        if how is gap_of_cells and len(counted):
            limits = (0.0, np.abs(counted).max())
            drawn = np.clip(drawn - np.nanmean(drawn) + estimate, *limits)
        intervals.append(draw_interval(drawn, estimate, n_groups, limits, confidence))
    return np.array(intervals)


def draw_interval(
    drawn: Array,
    estimate: float,
    n_groups: int,
    limits: tuple[float, float] = (-np.inf, np.inf),
    confidence: float = 0.95,
) -> tuple[float, float]:
    """Compute a confidence interval from bootstrap draws of groups.

    Parameters
    ----------
    drawn : ndarray of shape (n_draws,)
        The figure of merit in each draw; NaN where it cannot be computed.
    estimate : float
        The figure of merit of all recordings.
    n_groups : int
        Number of groups.
    limits : tuple of float
        Range of possible values; the interval is clipped to it where there are few groups.
    confidence : float, default=0.95
        Confidence level.

    Returns
    -------
    tuple of float
        Lower and upper limit. NaN if there are fewer than two groups, or fewer than one in ten
        draws are known.

    Notes
    -----
    Percentile intervals of n groups are too narrow by sqrt((n-1)/n), and further by the ratio of
    the normal to Student's t distribution; the percentiles are moved outwards to correct both
    ([2]_, "expanded percentile interval"). Percentiles cannot exceed the draws, and few groups
    give few distinct draws: with fewer than five groups the interval is computed from Student's
    t distribution and the standard deviation of the draws. Draws that are not known are ignored.
    """
    known = drawn[np.isfinite(drawn)]
    if n_groups < 2 or not len(known) or len(known) < 0.1 * len(drawn):
        return np.nan, np.nan
    # Hesterberg (2015): Phi^-1(a') = -sqrt(n / (n - 1)) t_{a, n-1}.
    reach = np.sqrt(n_groups / (n_groups - 1)) * t.ppf((1 + confidence) / 2, n_groups - 1)
    if n_groups >= 5:
        tail = norm.cdf(-reach)
        low, high = np.quantile(known, [tail, 1 - tail])
    else:  # few groups give few distinct draws, whose percentiles are uninformative
        half = reach * known.std()
        low, high = max(estimate - half, limits[0]), min(estimate + half, limits[1])
    return float(low), float(high)


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
