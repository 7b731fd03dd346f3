"""Linear discriminants of Gaussian classes that share one covariance.

With one covariance the quadratic term of Eq. (2.44) of [1]_ is the same for every class,
and posteriors follow from the linear rest.

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emacm.decisions.blocks import block_rows, product

Array = NDArray[np.float64]

_CANCELLATION = 1e5  # size of terms that may cancel, at the price of as many digits
_FAR = 1e100  # discriminant of what is so far away that squared distances may overflow


@dataclass(frozen=True)
class LinearDiscriminants:
    """Log densities of classes that share one covariance, less that of the first class.

    A product of a matrix and a vector for each recording, where distances need whitening
    and squares.

    Attributes
    ----------
    weights : ndarray of shape (n_classes - 1, n_features)
        Slopes, per unit of every feature.
    offsets : ndarray of shape (n_classes - 1, 1)
        Values at the centre, or where every feature is 0.
    centre : ndarray of shape (n_features,) or None
        What to subtract from the features, None if nothing needs to be.
    """

    weights: Array
    offsets: Array
    centre: Array | None

    @property
    def n_rows(self) -> int:
        """Recordings in one block."""
        return block_rows(1 + len(self.weights))

    def scores(self, X: Array, log_weights: Array) -> Array | None:
        """Logarithm of weight times density for a block, up to one number per recording.

        Of shape (n_classes, n_rows); None if squared distances may overflow, which is for
        `ClassDistances` to settle.
        """
        moved = X if self.centre is None else X - self.centre
        with np.errstate(over="ignore", invalid="ignore"):
            others = product(self.weights, moved.T)
        # One row will do: a feature that makes squares overflow shows in each, if only by
        # its rounding.
        if not np.abs(others[0]).max() < _FAR:
            return None
        scores = np.empty((1 + len(others), len(X)))
        scores[0] = log_weights[0]
        np.add(others, self.offsets + log_weights[1:, np.newaxis], out=scores[1:])
        return scores


def linear_discriminants(
    means: Array, factor: Array, deviations: Array
) -> LinearDiscriminants | None:
    """Prepare the discriminants of classes that share one covariance.

    Parameters
    ----------
    means : ndarray of shape (n_classes, n_features)
        Mean of each class.
    factor : ndarray of shape (n_features, n_features)
        P with P P' = inverse of the covariance.
    deviations : ndarray of shape (n_features,)
        Standard deviation of each feature within a class.

    Returns
    -------
    discriminants : LinearDiscriminants or None
        None if their terms would cancel so far that squared distances are more accurate.

    Examples
    --------
    >>> linear = linear_discriminants(np.array([[-1.0], [1.0]]), np.eye(1), np.ones(1))
    >>> linear.scores(np.array([[0.0], [2.0]]), np.zeros(2))
    array([[0., 0.],
           [0., 4.]])
    """
    centre = means.mean(axis=0)
    with np.errstate(over="ignore", invalid="ignore"):
        white = (means - centre) @ factor
        weights = (white[1:] - white[0]) @ factor.T
        offsets = -0.5 * np.sum((white[1:] - white[0]) * (white[1:] + white[0]), axis=1)
        spread = np.abs(means - centre).max(axis=0) + 10 * deviations
        cancelled = (np.abs(weights) @ spread).max(initial=0.0)
        moved = (np.abs(weights) @ np.abs(centre)).max(initial=0.0)
    if not cancelled <= _CANCELLATION:
        return None
    if moved <= _CANCELLATION:
        offsets -= weights @ centre
        return LinearDiscriminants(weights, offsets[:, np.newaxis], None)
    return LinearDiscriminants(weights, offsets[:, np.newaxis], centre)
