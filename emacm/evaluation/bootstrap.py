"""Figures of merit with confidence intervals from a bootstrap over whole groups of recordings.

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

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import norm, t

from emacm._checks import check_number

Array = NDArray[np.float64]


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


class Tally(NamedTuple):
    """Contribution of each recording to a figure of merit.

    Attributes
    ----------
    values : array-like of shape (n_recordings,)
        One number for each recording.
    cells : array-like of int of shape (n_recordings,)
        Cell of each recording; negative: the recording is not counted.
    combine : callable, default=mean_of_cells
        Computes the figure of merit from sums and counts of the cells that are not empty.

    Examples
    --------
    With values 0 or 1 (wrong or correct) and one cell for each class, the figure of merit is the
    balanced accuracy; with a single cell it is a rate.

    >>> Tally([1, 1, 1, 0], [0, 0, 0, 1]).figure()
    0.5
    >>> Tally([1, 1, 1, 0], [0, 0, 0, 0]).figure()
    0.75
    """

    values: ArrayLike
    cells: ArrayLike
    combine: Callable[[Array, Array], Array] = mean_of_cells

    def figure(self) -> float:
        """Return the figure of merit of all recordings; NaN if none is counted."""
        sums, counts = self.by_group(np.zeros(len(np.asarray(self.cells)), np.intp))
        return float(self.combine(sums[0], counts[0])) if counts.size else np.nan

    def by_group(self, codes: NDArray[np.intp]) -> tuple[Array, Array]:
        """Return sums of values and counts of recordings, shape (n_groups, n_nonempty_cells).

        `codes` is the number of the group of each recording, from 0.
        """
        counted = np.asarray(self.cells) >= 0
        known, places = np.unique(np.asarray(self.cells)[counted], return_inverse=True)
        sums, counts = np.zeros((2, int(codes.max(initial=0)) + 1, len(known)))
        np.add.at(sums, (codes[counted], places), np.asarray(self.values)[counted])
        np.add.at(counts, (codes[counted], places), 1)
        return sums, counts

    def bounds(self) -> tuple[float, float]:
        """Return the range that the figure of merit cannot leave."""
        counted = np.asarray(self.values, float)[np.asarray(self.cells) >= 0]
        if self.combine is gap_of_cells:
            return 0.0, np.abs(counted).max(initial=0)
        return counted.min(initial=np.inf), counted.max(initial=-np.inf)

    def n_groups(self, groups: ArrayLike) -> int:
        """Return the number of groups with counted recordings."""
        return len(np.unique(np.asarray(groups)[np.asarray(self.cells) >= 0]))


@dataclass(frozen=True)
class GroupBootstrap:
    """Confidence intervals of figures of merit by drawing whole groups of recordings.

    Attributes
    ----------
    confidence : float
        Confidence level of the intervals, above 0 and below 1.

    Raises
    ------
    TypeError, ValueError
        If `confidence` is outside its range.

    Notes
    -----
    There are 2000 draws. Equal groups give equal draws, so that differences of two results are
    paired.

    Examples
    --------
    >>> correct = np.repeat([1.0, 1.0, 0.0, 1.0], 25)  # four runs of 25 near copies
    >>> rate = {"rate": Tally(correct, np.zeros(100, int))}
    >>> GroupBootstrap().figures(rate, np.repeat([1, 2, 3, 4], 25))
    {'rate': 0.75, 'rate_low': 0.0, 'rate_high': 1.0}
    >>> alone = GroupBootstrap().figures(rate, np.arange(100))  # as if they were independent
    >>> round(alone["rate_low"], 2), round(alone["rate_high"], 2)
    (0.66, 0.83)
    """

    confidence: float = 0.95

    def __post_init__(self) -> None:
        """Check the level."""
        check_number(self.confidence, "confidence", above=0, below=1)

    @staticmethod
    @lru_cache(maxsize=1)  # several results are of the same groups
    def times(n_groups: int) -> Array:
        """Return how often each group is drawn, shape (n_draws, n_groups)."""
        shares = np.full(n_groups, 1 / n_groups)
        return np.random.default_rng(0).multinomial(n_groups, shares, 2000).astype(float)

    def draws(self, tallies: Mapping[str, Tally], groups: ArrayLike) -> dict[str, Array]:
        """Compute figures of merit for each draw of groups.

        Parameters
        ----------
        tallies : mapping of str to Tally
            Figures of merit by name.
        groups : array-like of shape (n_recordings,)
            Group of each recording (run, unit).

        Returns
        -------
        dict of str to ndarray of shape (n_draws,)
            NaN for draws that miss a cell of the figure, and for a figure without any cell.
        """
        names, codes = np.unique(np.asarray(groups), return_inverse=True)
        times, drawn = self.times(len(names)), {}
        for name, tally in tallies.items():
            sums, counts = (times @ part for part in tally.by_group(codes))
            is_known = counts.shape[1] > 0
            drawn[name] = tally.combine(sums, counts) if is_known else np.full(len(times), np.nan)
        return drawn

    def figures(self, tallies: Mapping[str, Tally], groups: ArrayLike) -> dict[str, float]:
        """Compute figures of merit and their confidence intervals.

        Parameters
        ----------
        tallies, groups
            As for `draws`.

        Returns
        -------
        dict
            "accuracy", "accuracy_low", "accuracy_high" and so on. The limits are NaN if fewer
            than two groups contain counted recordings, or if more than nine in ten draws miss
            one of the cells. Draws do not show how far a rate of 0 or 1 (of boolean values) may be
            from it: its limit is the exact binomial one (Clopper and Pearson), of as many groups as
            the cell with the fewest. Other figures of equal values have an interval of zero width.
        """
        row: dict[str, float] = {}
        for name, drawn in self.draws(tallies, groups).items():
            tally, n_groups = tallies[name], tallies[name].n_groups(groups)
            is_gap = tally.combine is gap_of_cells
            row |= self.interval(
                name, drawn, tally.figure(), n_groups, bounds=tally.bounds(), is_gap=is_gap
            )
            if np.asarray(tally.values).dtype == bool and np.isfinite(row[f"{name}_low"]):
                fewest = (tally.by_group(np.unique(groups, return_inverse=True)[1])[1] > 0).sum(0)
                reach = 1 - ((1 - self.confidence) / 2) ** (1 / fewest.min())
                if row[name] == 0:
                    row[f"{name}_high"] = reach
                elif row[name] == 1:
                    row[f"{name}_low"] = 1 - reach
        return row

    def interval(
        self,
        name: str,
        drawn: Array,
        estimate: float,
        n_groups: int,
        *,
        bounds: tuple[float, float] = (-np.inf, np.inf),
        is_gap: bool = False,
    ) -> dict[str, float]:
        """Compute a confidence interval from bootstrap draws of groups.

        Parameters
        ----------
        name : str
            Name of the figure of merit.
        drawn : ndarray of shape (n_draws,)
            The figure of merit in each draw; NaN where it cannot be computed.
        estimate : float
            The figure of merit of all recordings.
        n_groups : int
            Number of groups with counted recordings.
        bounds : tuple of float
            Range of possible values; the interval is clipped to it where there are few groups.
        is_gap : bool
            Whether the draws are of `gap_of_cells`: they are first moved by the difference between
            their mean and the estimate, because resampling adds to an absolute value.

        Returns
        -------
        dict
            The estimate under `name`, and its limits, `name_low` and `name_high`.

        Notes
        -----
        Percentile intervals of n groups are too narrow by sqrt((n-1)/n), and further by the ratio
        of the normal to Student's t distribution; the percentiles are moved outwards to correct
        both ([2]_, "expanded percentile interval"). Percentiles cannot exceed the draws, and few
        groups give few distinct draws: with fewer than five groups the interval is computed from
        Student's t distribution and the standard deviation of the draws.
        """
        known = drawn[np.isfinite(drawn)]
        row = {name: estimate, f"{name}_low": np.nan, f"{name}_high": np.nan}
        if n_groups < 2 or not len(known) or len(known) < 0.1 * len(drawn):
            return row
        if is_gap:
            known = np.clip(known - known.mean() + estimate, *bounds)
        # Hesterberg (2015): Phi^-1(a') = -sqrt(n / (n - 1)) t_{a, n-1}.
        reach = np.sqrt(n_groups / (n_groups - 1)) * t.ppf((1 + self.confidence) / 2, n_groups - 1)
        if n_groups >= 5:
            limits = np.quantile(known, norm.cdf([-reach, reach]))
        else:  # few groups give few distinct draws, whose percentiles are uninformative
            limits = np.clip(estimate + np.array([-1, 1]) * reach * known.std(), *bounds)
        return row | {f"{name}_low": float(limits[0]), f"{name}_high": float(limits[1])}
