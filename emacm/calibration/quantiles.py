"""Quantiles in which each group counts once: its recordings are not independent, groups are.

References
----------
.. [1] Dunn, Wasserman and Ramdas, Distribution-free prediction sets for two-layer hierarchical
   models, Journal of the American Statistical Association 118, 2023: pooling of distributions.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def groups_needed(coverage: float) -> int:
    """Return the least number of groups that can support a coverage c: c / (1 - c).

    Examples
    --------
    >>> groups_needed(0.9), groups_needed(0.95)
    (9, 19)
    """
    return int(np.ceil(coverage / (1 - coverage) - 1e-9))


def grouped_quantile(
    values: ArrayLike,
    groups: NDArray[np.intp],
    coverage: float,
    weight: ArrayLike | None = None,
    *,
    name: str = "units",
) -> float:
    """Return the least of some values up to which a fraction of the distribution lies.

    Every group counts once, whatever the number of its values [1]_. It is the quantile of these
    groups: of few of them, a new one is below it somewhat less often than stated.

    Parameters
    ----------
    values : array-like of shape (n_values,)
        Values of left-out recordings.
    groups : ndarray of int, shape (n_values,)
        Number of the group of each value.
    coverage : float
        Fraction above 0 and below 1.
    weight : array-like of shape (n_values,), default=None
        Further weights of the values.
    name : str
        What the groups are, for the message.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If there are fewer groups than ``coverage / (1 - coverage)``.

    Examples
    --------
    >>> grouped_quantile([1.0, 2.0, 3.0, 9.0], np.array([0, 0, 0, 1]), 0.5)
    3.0
    """
    numbers = np.unique(groups, return_inverse=True)[1]
    n_groups = int(numbers.max()) + 1
    if n_groups < groups_needed(coverage):
        raise ValueError(
            f"{n_groups} {name} cannot support a coverage of {coverage:g}, which takes at least "
            f"{groups_needed(coverage)}; {n_groups} {name} support at most "
            f"{n_groups / (n_groups + 1):.3g}. Fit with more {name}, or give a smaller coverage."
        )
    shares = 1 / np.bincount(numbers)[numbers]
    if weight is not None:
        shares = shares * np.asarray(weight)
    order = np.argsort(values)
    covered = np.cumsum(shares[order]) / shares.sum()
    return float(np.asarray(values)[order[np.argmax(covered >= coverage - 1e-9)]])
