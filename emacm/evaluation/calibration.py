"""Whether stated probabilities hold: logarithmic loss, Brier score, reliability curve.

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

_SUM = 1e-5  # by which probabilities of a recording may miss 1; float32 is allowed


def log_losses(probabilities: ArrayLike, truths: ArrayLike) -> Array:
    """Minus the logarithm of the probability that was given to what is true.

    Parameters
    ----------
    probabilities : array-like of shape (n_recordings, n_classes)
        Probability of each class.
    truths : array-like of int of shape (n_recordings,)
        Number of the true class.

    Returns
    -------
    losses : ndarray of shape (n_recordings,)
        In nats. A probability of 0 counts as 2.2e-16, which costs 36 nats: an impossible truth
        would otherwise cost infinitely much.

    Raises
    ------
    TypeError, ValueError
        If there is no probability for each recording and class.

    Examples
    --------
    >>> log_losses([[0.5, 0.5], [1.0, 0.0]], [0, 0]).round(3) + 0.0
    array([0.693, 0.   ])
    """
    stated, numbers = _checked(probabilities, truths)
    given = stated[np.arange(len(stated)), numbers]
    # A probability may be rounded to a step above 1, and no loss is negative.
    return np.abs(np.log(np.clip(given, np.finfo(float).eps, 1.0)))


def brier_scores(probabilities: ArrayLike, truths: ArrayLike) -> Array:
    """Squared distance between stated probabilities and what is true, over all classes [1]_.

    Parameters
    ----------
    probabilities : array-like of shape (n_recordings, n_classes)
        Probability of each class.
    truths : array-like of int of shape (n_recordings,)
        Number of the true class.

    Returns
    -------
    scores : ndarray of shape (n_recordings,)
        0 (certain and right) to 2 (certain and wrong). For two classes this is twice the score
        that counts one class only.

    Raises
    ------
    TypeError, ValueError
        If there is no probability for each recording and class.

    Examples
    --------
    >>> brier_scores([[0.5, 0.5], [1.0, 0.0], [1.0, 0.0]], [0, 0, 1])
    array([0.5, 0. , 2. ])
    """
    stated, numbers = _checked(probabilities, truths)
    true = np.zeros_like(stated)
    true[np.arange(len(stated)), numbers] = 1
    return np.sum((stated - true) ** 2, axis=1)


def reliability(probabilities: ArrayLike, truths: ArrayLike, *, n_bins: int = 10) -> pd.DataFrame:
    """Set the probability of the most probable class beside how often it was true.

    Parameters
    ----------
    probabilities : array-like of shape (n_recordings, n_classes)
        Probability of each class.
    truths : array-like of int of shape (n_recordings,)
        Number of the true class.
    n_bins : int, default=10
        Bins of equal width, from 0 to 1, of the largest probability of each recording.

    Returns
    -------
    DataFrame
        A row for each bin that holds recordings: its edges "from" and "to", the mean
        probability "confidence", the share "frequency" and the number "count" of recordings.

    Raises
    ------
    TypeError, ValueError
        If there is no probability for each recording and class, or `n_bins` is no count.

    Examples
    --------
    >>> reliability([[0.8, 0.2], [0.8, 0.2], [0.4, 0.6], [0.4, 0.6]], [0, 0, 0, 1], n_bins=2)
       from   to  confidence  frequency  count
    0   0.5  1.0         0.7       0.75      4
    """
    largest, right, bins = most_probable(probabilities, truths, n_bins=n_bins)
    rows = []
    for number in np.unique(bins):
        inside = bins == number
        edges = {"from": number / n_bins, "to": (number + 1) / n_bins}
        means = {"confidence": largest[inside].mean(), "frequency": right[inside].mean()}
        rows.append({**edges, **means, "count": int(inside.sum())})
    return pd.DataFrame(rows, columns=["from", "to", "confidence", "frequency", "count"])


def most_probable(
    probabilities: ArrayLike, truths: ArrayLike, *, n_bins: int = 10
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Return the largest probability of each recording, whether it came true, and its bin.

    Parameters
    ----------
    probabilities : array-like of shape (n_recordings, n_classes)
        Probability of each class.
    truths : array-like of int of shape (n_recordings,)
        Number of the true class.
    n_bins : int, default=10
        Bins of equal width from 0 to 1; each holds its lower edge, the last both.

    Returns
    -------
    largest : ndarray of shape (n_recordings,)
        Probability of the most probable class; of several the first.
    right : ndarray of shape (n_recordings,)
        1 if that class is the true one, else 0.
    bins : ndarray of int of shape (n_recordings,)
        Number of the bin.

    Raises
    ------
    TypeError, ValueError
        If there is no probability for each recording and class, or `n_bins` is no count.

    Examples
    --------
    >>> most_probable([[0.8, 0.2], [0.4, 0.6]], [0, 0], n_bins=5)
    (array([0.8, 0.6]), array([1., 0.]), array([4, 3]))
    """
    check_count(n_bins, "n_bins")
    stated, numbers = _checked(probabilities, truths)
    largest = stated.max(axis=1)
    right = (stated.argmax(axis=1) == numbers).astype(float)
    # 0.6 * 5 is 3.0000000000000004 or 2.9999999999999996: rounding moves no probability.
    bins = np.minimum(np.floor(largest * n_bins + 1e-9), n_bins - 1).astype(np.intp)
    return largest, right, bins


def _checked(probabilities: ArrayLike, truths: ArrayLike) -> tuple[Array, NDArray[np.intp]]:
    stated = check_real_array(probabilities, "probabilities").astype(float)
    numbers = np.asarray(truths)
    if stated.ndim != 2 or numbers.shape != stated.shape[:1] or numbers.dtype.kind not in "iu":
        raise ValueError(
            f"probabilities must have shape (n_recordings, n_classes), and truths the number of "
            f"a class for each recording; got shapes {stated.shape} and {numbers.shape} "
            f"({numbers.dtype})."
        )
    if numbers.size and not (numbers.min() >= 0 and numbers.max() < stated.shape[1]):
        raise ValueError(
            f"truths must be numbers of the {stated.shape[1]} classes, counted from 0; got "
            f"{numbers.min()} to {numbers.max()}."
        )
    bad = ~(stated >= 0).all(axis=1) | ~(np.abs(stated.sum(axis=1) - 1) <= _SUM)
    if bad.any():
        first = int(np.argmax(bad))
        raise ValueError(
            f"probabilities must be at least 0 and add up to 1, got {stated[first].tolist()} for "
            f"recording {first}."
        )
    return stated, numbers.astype(np.intp)
