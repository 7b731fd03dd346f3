"""Calibration of predicted probabilities: log loss, Brier score, reliability curve.

References
----------
.. [1] G. W. Brier, Verification of forecasts expressed in terms of probability, Monthly Weather
   Review 78(1), 1950.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_count, check_real_array

Array = NDArray[np.float64]

_TOLERANCE = 1e-5  # of the sum of the probabilities of a recording; float32 is accepted


def log_losses(probabilities: ArrayLike, truths: ArrayLike) -> Array:
    """Return minus the logarithm of the probability of the true class.

    Parameters
    ----------
    probabilities : array-like of shape (n_recordings, n_classes)
        Probability of each class.
    truths : array-like of int of shape (n_recordings,)
        Index of the true class.

    Returns
    -------
    losses : ndarray of shape (n_recordings,)
        In nats. A probability of 0 is replaced by 2.2e-16, which gives 36 nats, because the loss
        would otherwise be infinite.

    Raises
    ------
    TypeError, ValueError
        If there is not one probability for each recording and class.

    Examples
    --------
    >>> log_losses([[0.5, 0.5], [1.0, 0.0]], [0, 0]).round(3) + 0.0
    array([0.693, 0.   ])
    """
    posterior, codes = _checked(probabilities, truths)
    of_truth = posterior[np.arange(len(posterior)), codes]
    # A probability may exceed 1 by rounding, and a loss is never negative.
    return np.abs(np.log(np.clip(of_truth, np.finfo(float).eps, 1.0)))


def brier_scores(probabilities: ArrayLike, truths: ArrayLike) -> Array:
    """Return the squared error of the probabilities, summed over all classes [1]_.

    Parameters
    ----------
    probabilities : array-like of shape (n_recordings, n_classes)
        Probability of each class.
    truths : array-like of int of shape (n_recordings,)
        Index of the true class.

    Returns
    -------
    scores : ndarray of shape (n_recordings,)
        From 0 (certain and correct) to 2 (certain and wrong). For two classes this is twice the
        score that counts one class only.

    Raises
    ------
    TypeError, ValueError
        If there is not one probability for each recording and class.

    Examples
    --------
    >>> brier_scores([[0.5, 0.5], [1.0, 0.0], [1.0, 0.0]], [0, 0, 1])
    array([0.5, 0. , 2. ])
    """
    posterior, codes = _checked(probabilities, truths)
    return np.sum((posterior - np.eye(posterior.shape[1])[codes]) ** 2, axis=1)


def reliability(probabilities: ArrayLike, truths: ArrayLike, *, n_bins: int = 10) -> pd.DataFrame:
    """Compare the probability of the most probable class with the frequency at which it is true.

    Parameters
    ----------
    probabilities : array-like of shape (n_recordings, n_classes)
        Probability of each class.
    truths : array-like of int of shape (n_recordings,)
        Index of the true class.
    n_bins : int, default=10
        Number of bins of equal width from 0 to 1 of the largest probability of each recording.

    Returns
    -------
    DataFrame
        One row for each bin that contains recordings: its edges "from" and "to", the mean
        probability ("confidence"), the relative "frequency" at which the most probable class is
        the true one, and the "count" of recordings.

    Raises
    ------
    TypeError, ValueError
        If there is not one probability for each recording and class, or `n_bins` is not a
        positive integer.

    Examples
    --------
    >>> reliability([[0.8, 0.2], [0.8, 0.2], [0.4, 0.6], [0.4, 0.6]], [0, 0, 0, 1], n_bins=2)
       from   to  confidence  frequency  count
    0   0.5  1.0         0.7       0.75      4
    """
    largest, correct, bins = most_probable(probabilities, truths, n_bins=n_bins)
    table = pd.DataFrame({"bin": bins, "confidence": largest, "frequency": correct})
    curve = table.groupby("bin").mean().assign(count=table.groupby("bin").size())
    curve.insert(0, "from", curve.index / n_bins)
    curve.insert(1, "to", (curve.index + 1) / n_bins)
    return curve.reset_index(drop=True)


def most_probable(
    probabilities: ArrayLike, truths: ArrayLike, *, n_bins: int = 10
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Return the largest probability of each recording, whether it is of the true class, its bin.

    Parameters
    ----------
    probabilities : array-like of shape (n_recordings, n_classes)
        Probability of each class.
    truths : array-like of int of shape (n_recordings,)
        Index of the true class.
    n_bins : int, default=10
        Number of bins of equal width from 0 to 1; each includes its lower edge, the last both.

    Returns
    -------
    largest : ndarray of shape (n_recordings,)
        Probability of the most probable class; of the first, if several are equal.
    correct : ndarray of shape (n_recordings,)
        1 if that class is the true one, else 0.
    bins : ndarray of int of shape (n_recordings,)
        Index of the bin.

    Raises
    ------
    TypeError, ValueError
        If there is not one probability for each recording and class, or `n_bins` is not a
        positive integer.

    Examples
    --------
    >>> most_probable([[0.8, 0.2], [0.4, 0.6]], [0, 0], n_bins=5)
    (array([0.8, 0.6]), array([1., 0.]), array([4, 3]))
    """
    check_count(n_bins, "n_bins")
    posterior, codes = _checked(probabilities, truths)
    largest = posterior.max(axis=1)
    correct = (posterior.argmax(axis=1) == codes).astype(float)
    # 0.6 * 5 is 3.0000000000000004 or 2.9999999999999996; the rounding error must not count.
    bins = np.minimum(np.floor(largest * n_bins + 1e-9), n_bins - 1).astype(np.intp)
    return largest, correct, bins


def _checked(probabilities: ArrayLike, truths: ArrayLike) -> tuple[Array, NDArray[np.intp]]:
    posterior = check_real_array(probabilities, "probabilities").astype(float)
    codes = np.asarray(truths)
    if posterior.ndim != 2 or codes.shape != posterior.shape[:1] or codes.dtype.kind not in "iu":
        raise ValueError(
            f"probabilities must have shape (n_recordings, n_classes), and truths must contain the "
            f"index of a class for each recording; got shapes {posterior.shape} and {codes.shape} "
            f"({codes.dtype})."
        )
    if codes.size and not (codes.min() >= 0 and codes.max() < posterior.shape[1]):
        raise ValueError(
            f"truths must be indices of the {posterior.shape[1]} classes, counted from 0; got "
            f"{codes.min()} to {codes.max()}."
        )
    bad = ~(posterior >= 0).all(axis=1) | ~(np.abs(posterior.sum(axis=1) - 1) <= _TOLERANCE)
    if bad.any():
        first = int(np.argmax(bad))
        raise ValueError(
            f"probabilities must be at least 0 and add up to 1, got {posterior[first].tolist()} "
            f"for recording {first}."
        )
    return posterior, codes.astype(np.intp)
