"""Leaving groups out: every recording is judged by a model that was fitted without its group.

`left_out` divides the recordings. What is learnt from those left out: a quantile in which each
group counts once (`grouped_quantile`) and the temperature of their densities (`fit_temperature`).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar
from scipy.special import logsumexp
from sklearn.model_selection import GroupKFold

from emacm._checks import group_codes

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def left_out(
    codes: Indices, groups: ArrayLike, max_folds: int = 10
) -> Iterator[tuple[Indices, Indices]]:
    """Yield the recordings that remain and those that are left out, in turn.

    Parameters
    ----------
    codes : ndarray of int, shape (n_recordings,)
        Number of the class of each recording.
    groups : array-like of shape (n_recordings,)
        Labels of recordings that were measured together (unit, run); a group is left out as a
        whole, by scikit-learn's `GroupKFold`; those of each class are divided among the folds.
    max_folds : int, default=10
        Largest number of folds. Of fewer groups, each is left out once.

    Yields
    ------
    others : ndarray of int
        Recordings that remain.
    rows : ndarray of int
        Recordings that are left out.

    Raises
    ------
    ValueError
        If there is not one group for each recording.

    Examples
    --------
    >>> [rows.tolist() for _, rows in left_out(np.zeros(3, int), ["b", "a", "b"])]
    [[0, 2], [1]]
    """
    numbers = group_codes(groups, len(codes))
    # The groups of each class are divided among the folds, so that no fold holds a whole class.
    first = np.unique(numbers, return_index=True)[1]
    folds = np.empty(len(first), dtype=np.intp)
    folds[np.argsort(codes[first], kind="stable")] = np.arange(len(first)) % max_folds
    numbers = folds[numbers]
    n_folds = min(max_folds, len(np.unique(numbers)))
    if n_folds > 1:
        yield from GroupKFold(n_folds).split(codes, groups=numbers)


def single_recordings(codes: Indices, X: Array) -> Indices:
    """Return the groups of recordings of which nothing is stated.

    The recordings of each class are divided among ten folds. Equal rows of a table are together.

    Parameters
    ----------
    codes : ndarray of int, shape (n_recordings,)
        Number of the class of each recording.
    X : ndarray of shape (n_recordings, n_features)
        Features.

    Returns
    -------
    ndarray of int, shape (n_recordings,)

    Examples
    --------
    >>> single_recordings(np.zeros(3, int), np.array([[4.0], [3.0], [4.0]]))
    array([1, 0, 1])
    """
    rows = np.column_stack([codes, X])
    return np.unique(rows, axis=0, return_inverse=True)[1].ravel() % 10


def check_judged(judged: NDArray[np.bool_]) -> None:
    """Raise a ValueError if no recording could be judged by others of its class."""
    if not judged.any():
        raise ValueError(
            "no class has recordings in two groups, so that no recording can be judged by others "
            "of its class. Give groups= with at least two groups in one class."
        )


def fit_temperature(
    log_densities: Array, codes: NDArray[np.intp], weight: Array, priors: Array
) -> float:
    """Return the temperature of least log loss, with posteriors ``prior * density ** (1 / T)``.

    Correlated features, and recordings that are near copies, make densities over-confident; a
    temperature above 1 widens them [1]_. Priors are not scaled, so that they keep their meaning
    when they change. The log loss is convex in 1 / T.

    Parameters
    ----------
    log_densities : ndarray of shape (n_recordings, n_classes)
        Of recordings under models that were fitted without them; -inf for classes that these
        models do not contain.
    codes : ndarray of shape (n_recordings,)
        Number of the true class, with a finite log density.
    weight : ndarray of shape (n_recordings,)
        Number of times each recording is counted.
    priors : ndarray of shape (n_classes,)
        Prior probabilities, positive.

    Returns
    -------
    float
        Between 1e-6 and 1e6; 1 if there are no recordings, or one class only.

    References
    ----------
    .. [1] Guo, Pleiss, Sun and Weinberger, On calibration of modern neural networks, ICML 2017.

    Examples
    --------
    >>> logs = 10 * np.array([[0.0, -1.0], [-1.0, 0.0], [0.0, -1.0], [0.0, -1.0]])
    >>> round(fit_temperature(logs, np.array([0, 1, 0, 1]), np.ones(4), np.full(2, 0.5)), 3)
    9.102
    """
    if not len(codes) or log_densities.shape[1] < 2:
        return 1.0
    own = np.arange(len(codes)), codes
    with np.errstate(divide="ignore"):
        log_priors = np.log(priors)
    scores = log_densities - log_densities[own][:, np.newaxis]

    def log_loss(log_temperature: float) -> float:
        joint = scores * np.exp(-log_temperature) + log_priors
        return float(weight @ (logsumexp(joint, axis=1) - log_priors[codes]))

    # Unimodal over the logarithm; the bounds are beyond every calibration that makes sense.
    found = minimize_scalar(log_loss, bounds=np.log([1e-6, 1e6]), options={"xatol": 1e-8})
    return float(np.exp(found.x))


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
    beyond: int = 0,
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
    beyond : int, default=0
        Further groups that are taken to be beyond all values. With 1, a new group that is
        exchangeable with the others is below the quantile as often as stated [1]_.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If there are fewer groups than ``coverage / (1 - coverage)``.

    References
    ----------
    .. [1] Lee, Barber and Willett, Distribution-free inference with hierarchical data, 2023,
       arXiv:2306.06342, section 3.

    Examples
    --------
    >>> values, groups = [1.0, 2.0, 3.0, 9.0], np.array([0, 0, 0, 1])
    >>> [grouped_quantile(values, groups, 0.5, beyond=beyond) for beyond in (0, 1)]
    [3.0, 9.0]
    """
    numbers = np.unique(groups, return_inverse=True)[1]
    n_groups = int(numbers.max(initial=-1)) + 1
    if n_groups < groups_needed(coverage):
        raise ValueError(
            f"{n_groups} {name} cannot support a coverage of {coverage:g}, which takes at least "
            f"{groups_needed(coverage)}; they support at most {n_groups / (n_groups + 1):.3g}. "
            f"Fit with more {name}, or give a smaller coverage."
        )
    shares = 1 / np.bincount(numbers)[numbers]
    if weight is not None:
        shares = shares * np.asarray(weight)
    order = np.argsort(values)
    covered = np.cumsum(shares[order]) / shares.sum() * n_groups / (n_groups + beyond)
    return float(np.asarray(values)[order[np.argmax(covered >= coverage - 1e-9)]])
