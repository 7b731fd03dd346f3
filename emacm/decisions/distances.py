"""Distances of many recordings to the means of all classes, a block of recordings at a time.

The distance of Mahalanobis, in standard deviations of the class: its square is the
exponent of Eq. (2.44) of [1]_.

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.1.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from emacm.decisions.blocks import block_rows, product

Array = NDArray[np.float64]

_BAND = 12  # features, at the least; thinner bands save less than they cost
_TOGETHER = 16  # features, from which those of a recording are better written side by side
_FARTHEST = np.finfo(np.float64).max / 4  # squared distance that stands for an overflow
# Deviations that may cancel where means are folded into products, at the price of as many digits.
_CANCELLATION = 1e4


@dataclass(frozen=True)
class ClassDistances:
    """Squared distances to the means of classes, ready to evaluate.

    Attributes
    ----------
    means : ndarray of shape (n_classes, n_features)
        Mean of each class.
    factors : ndarray of shape (n_groups, n_features, n_features) or (n_groups, n_features)
        Whitening of each class from the left, or the one of all (`n_groups` = 1), or
        reciprocals of standard deviations.
    centre : ndarray of shape (n_features,)
        Mean of the means.
    bands : tuple of ndarray
        Bands of rows of `factors`, all groups below one another, after a first column
        that takes what the mean of the class becomes. Empty if classes are so far apart
        that folding their means into a product would cost accuracy.
    shifts : tuple of ndarray of shape (n_classes, n_rows, 1)
        With one factor for all: the means whitened, for each band.
    """

    means: Array
    factors: Array
    centre: Array
    bands: tuple[Array, ...]
    shifts: tuple[Array, ...]

    @property
    def n_rows(self) -> int:
        """Recordings in one block."""
        n_classes, n_features = self.means.shape
        return block_rows(n_classes * n_features)

    def squares(self, X: Array) -> Array:
        """Squared distance of a block of recordings, shape (n_classes, n_rows)."""
        with np.errstate(over="ignore", invalid="ignore"):
            squares = self._folded(X) if self.bands else self._one_by_one(X)
        # fmin takes the number where the other is NaN.
        return np.fmin(squares, _FARTHEST, out=squares)

    def _folded(self, X: Array) -> Array:
        moved = self._moved(X)
        squares = np.zeros((len(self.means), len(X)))
        for number, band in enumerate(self.bands):
            # The factors are triangular: a band needs the features up to its last.
            white = product(band, moved[: band.shape[1]])
            white = white.reshape(len(self.factors), -1, len(X))
            if self.shifts:
                white = white - self.shifts[number]
            squares += np.einsum("kfr,kfr->kr", white, white)
        return squares

    def _moved(self, X: Array) -> Array:
        """Ones, and below them the features from their centre."""
        n_rows, n_features = X.shape
        if n_features < _TOGETHER:
            moved = np.ones((1 + n_features, n_rows))
        else:
            moved = np.ones((n_rows, 1 + n_features)).T
        np.subtract(X.T, self.centre[:, np.newaxis], out=moved[1:])
        return moved

    def _one_by_one(self, X: Array) -> Array:
        white = np.ascontiguousarray(X.T) - self.means[:, :, np.newaxis]
        if self.factors.ndim == 2:
            white *= self.factors[:, :, np.newaxis]
        else:
            for number, centred in enumerate(white):
                factor = self.factors[number % len(self.factors)]  # the only one, if tied
                white[number] = product(factor, centred)
        return np.einsum("kfr,kfr->kr", white, white)


def class_distances(means: Array, factors: Array) -> ClassDistances:
    """Prepare the distances to the means of classes.

    Parameters
    ----------
    means : ndarray of shape (n_classes, n_features)
        Mean of each class.
    factors : ndarray of shape (n_groups, n_features, n_features) or (n_groups, n_features)
        P with P P' = inverse of the covariance of each class, or the one of all
        (`n_groups` = 1), or the diagonals of diagonal ones.

    Returns
    -------
    distances : ClassDistances
        Ready to evaluate.

    Examples
    --------
    >>> distances = class_distances(np.array([[0.0, 0.0], [3.0, 4.0]]), np.eye(2)[np.newaxis])
    >>> distances.squares(np.array([[0.0, 1.0]]))
    array([[ 1.],
           [18.]])
    """
    centre = means.mean(axis=0)
    if factors.ndim == 2:
        return ClassDistances(means, factors, centre, (), ())
    whitening = np.ascontiguousarray(factors.transpose(0, 2, 1))
    offsets = (means - centre)[:, :, np.newaxis]
    with np.errstate(over="ignore", invalid="ignore"):
        cancelled = np.matmul(np.abs(whitening), np.abs(offsets)).max()
        shifts = np.matmul(whitening, offsets)
    if not cancelled <= _CANCELLATION:
        return ClassDistances(means, whitening, centre, (), ())
    tied = len(whitening) < len(means)
    folded = np.zeros_like(shifts[:1]) if tied else -shifts
    stacked = np.concatenate([folded, whitening], axis=2)
    pairs = list(pairwise(_cuts(whitening)))
    bands = [stacked[:, low:high, : 1 + high].reshape(-1, 1 + high) for low, high in pairs]
    return ClassDistances(
        means,
        whitening,
        centre,
        tuple(bands),
        tuple(shifts[:, low:high] for low, high in pairs) if tied else (),
    )


def _cuts(whitening: Array) -> list[int]:
    """Where to cut the rows of triangular factors into bands; nowhere in others."""
    n_features = whitening.shape[1]
    triangular = not np.triu(whitening, 1).any()
    n_bands = max(1, n_features // _BAND) if triangular else 1
    return np.linspace(0, n_features, n_bands + 1).astype(int).tolist()
