"""Spectral lines that the recordings of a training do not have.

A line is compared by its height over the local background, which depends neither on load, speed,
gain nor state. ``benchmarks/unknown.py`` chose the numbers below, on simulated units.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import ndimage

from emacm._statements import Statement

Array = NDArray[np.float64]
Spectra = NDArray[np.floating]  # shape (n_recordings, n_columns), in U² per order
Axis = tuple[str, NDArray[np.floating], slice]  # channel, its orders, its columns

# dB above the maximum of the training, which a recording with less noise may also have.
_LEAST = 4.0
_FLOOR = 1e-12  # of the largest line of a channel, below which lines are rounding errors
_PRIOR = 5  # groups that the spread which is common to the lines of a channel counts as
_LEAST_SPREAD = 0.8  # dB: about the scatter of heights in spectra of thirty segments


@dataclass(frozen=True)
class KnownLines:
    """The lines of a training, and the excess over them that two groups in a hundred have.

    The excess of a group is that of its largest line over the maximum of all other groups at the
    same order, in standard deviations of the maxima of those groups at that order. Orders at which
    units differ, such as those of faults and of strong lines, thus have higher limits than the
    background. As groups are few, the variance is averaged with the median of the channel, which
    counts as five groups. Excesses above their median are treated as exponential (peaks over
    a threshold [1]_) with a mean that is known from so many values only, so that the predictive
    distribution of the next one is that of Lomax [2]_: with fewer groups the limit is higher.

    Attributes
    ----------
    maxima : ndarray of shape (n_columns,)
        Largest height over the local background at each order [dB], at least -20; inf where lines
        are not compared: outside of the bins, and in channels without power or with negative
        values, which are no power spectra.
    limits : ndarray of shape (n_columns,)
        Excess over it from which a line is new [dB], at least 4; inf with fewer than five groups.
    largest : ndarray of shape (n_channels,)
        Largest line of each channel, in the unit of the spectra.

    References
    ----------
    .. [1] Pickands, Statistical inference using extreme order statistics, Annals of Statistics
       3 (1975).
    .. [2] Geisser, Predictive Inference (1993), section 3.1.
    """

    maxima: Array
    limits: Array
    largest: Array

    @classmethod
    def of(
        cls, psd: Spectra, axes: Sequence[Axis], compared: NDArray[np.bool_], groups: Any
    ) -> KnownLines:
        """Learn the lines of spectra.

        Parameters
        ----------
        psd : ndarray of shape (n_recordings, n_columns)
            Power spectral densities of the training.
        axes : sequence of (str, ndarray, slice)
            Channels with their orders and columns.
        compared : ndarray of shape (n_columns,)
            Whether a column is within the bins.
        groups : ndarray of int, shape (n_recordings,), or None
            Numbers of recordings that were measured together. None: single recordings.
        """
        largest = np.array([psd[:, columns].max() for *_, columns in axes], dtype=np.float64)
        maxima, limits = np.full((2, psd.shape[1]), np.inf)
        excess: Any = -np.inf
        for _, orders, columns in axes:
            spectra, used = psd[:, columns], compared[columns]
            if not used.any() or spectra.max() <= 0 or spectra.min() < 0:
                continue
            highest = _heights(spectra, orders)
            if groups is not None:
                highest = pd.DataFrame(highest).groupby(groups).max().to_numpy()
            maxima[columns] = np.where(used, highest.max(axis=0), np.inf)
            if len(highest) >= 5:
                spread, left_out = _left_out(highest)
                limits[columns] = np.where(used, spread, np.inf)
                excess = np.maximum(excess, left_out[:, used].max(axis=1))
        if np.ndim(excess):
            learned = np.isfinite(limits)
            limits[learned] = np.maximum(_limit(excess) * limits[learned], _LEAST)
        return cls(maxima, limits, largest)

    def new_lines(self, psd: Spectra, axes: Sequence[Axis]) -> list[list[Statement]]:
        """State at which orders recordings have lines that the training does not have.

        Parameters
        ----------
        psd : ndarray of shape (n_recordings, n_columns)
            Power spectral densities.
        axes : sequence of (str, ndarray, slice)
            As for `of`.

        Returns
        -------
        list of list of Statement
            Of each recording, the line that is farthest above the maximum first; of more than five,
            the number is stated.
        """
        found: list[list[Statement]] = [[] for _ in psd]
        for axis, largest in zip(axes, self.largest, strict=True):
            columns = axis[2]
            maxima, limits = self.maxima[columns], self.limits[columns]
            if np.isinf(limits).all():
                continue
            heights = _heights(psd[:, columns], axis[1])
            # What is not above the background is no line; a dead channel has only rounding errors.
            is_alive = psd[:, columns].max(axis=1, keepdims=True) > _FLOOR * largest
            above = (heights > np.maximum(maxima + limits, _LEAST)) & is_alive
            for row in np.flatnonzero(above.any(axis=1)):
                found[row] += _of_channel(axis, heights[row], maxima, limits, above[row])
        stated = []
        for lines in found:
            ranked = sorted(lines, key=lambda line: -(line.value or 0.0))
            if len(ranked) > 5:
                text = f"and at {len(ranked) - 5} more orders"
                ranked[5:] = [Statement("new line", "", text)]
            stated.append(ranked)
        return stated


def _heights(psd: Spectra, orders: NDArray[np.floating]) -> Array:
    """Return the height of each line of a channel over its background [dB], at least -20.

    The background is the lower quartile, which is the floor between dense lines, of half an order
    and at least eight lines on either side; wider structures fill bins, which show them. Valleys
    between lines, and order 0 without the mean, are deeper than -20 dB.
    """
    step = (orders[-1] - orders[0]) / max(len(orders) - 1, 1)
    side = max(round(0.5 / step), 8) if step > 0 else 8
    floor = np.maximum(_FLOOR * psd.max(axis=1, keepdims=True), 0.0)
    return np.maximum(line_heights(np.maximum(psd, floor), 2 * side + 1, 0.25), -20.0)


def _left_out(highest: Array) -> tuple[Array, Array]:
    """Return the spread in each column, and the excess of each group over the others, in spreads.

    Parameters
    ----------
    highest : ndarray of shape (n_groups, n_columns)
        Maxima of groups [dB].

    Returns
    -------
    spread : ndarray of shape (n_columns,)
        In dB.
    excess : ndarray of shape (n_groups, n_columns)
        In spreads of the other groups.
    """
    n_groups, n_columns = highest.shape
    squares = (highest - highest.mean(axis=0)) ** 2
    total = squares.sum(axis=0)
    common = _PRIOR * float(np.median(total)) / (n_groups - 1)
    # The sum of squares about the mean of the others, without each group.
    others = np.maximum(total - squares * (n_groups / (n_groups - 1)), 0.0)
    columns, top = np.arange(n_columns), highest.argmax(axis=0)
    second = np.partition(highest, -2, axis=0)[-2]
    excess = highest - highest.max(axis=0)
    excess[top, columns] = highest[top, columns] - second
    spreads_of_others = np.sqrt((others + common) / (n_groups - 2 + _PRIOR))
    excess /= np.maximum(spreads_of_others, _LEAST_SPREAD)
    spread = np.sqrt((total + common) / (n_groups - 1 + _PRIOR))
    return np.maximum(spread, _LEAST_SPREAD), excess


def _limit(excess: Array) -> float:
    """Return the excess that two groups in a hundred have, from those of left-out groups.

    Examples
    --------
    >>> round(_limit(np.array([0.0, 0.0, 0.0, 1.0, 2.0, 2.0])), 2)
    7.23
    """
    level = 0.02
    median = float(np.median(excess))
    peaks = excess[excess > median] - median
    if not len(peaks):
        return max(median, 0.0)
    tail = len(peaks) * peaks.mean() * ((2 * level) ** (-1 / len(peaks)) - 1)
    return max(median + float(tail), 0.0)


def _of_channel(
    axis: Axis, heights: Array, maxima: Array, limits: Array, above: NDArray[np.bool_]
) -> list[Statement]:
    """Return a statement for each range of adjacent orders above the limit."""
    channel, orders, _ = axis
    edges = np.flatnonzero(np.diff(np.concatenate([[False], above, [False]])))
    found = []
    for start, stop in edges.reshape(-1, 2):
        peak = start + int(heights[start:stop].argmax())
        where, up_to = f"line at order {orders[peak]:.4g}", ""
        # With a Hann window a line fills four adjacent orders, down to 10 dB below its peak.
        if np.count_nonzero(heights[start:stop] > heights[peak] - 10) > 4:
            where = f"orders {orders[start]:.4g} to {orders[stop - 1]:.4g}"
            up_to = "up to "
        excess = float(heights[peak] - maxima[peak])
        text = (
            f"{where} of {channel!r}, {up_to}{heights[peak]:.0f} dB above the background and "
            f"{excess:.0f} dB above the training maximum"
        )
        found.append(Statement("new line", channel, text, value=excess, limit=float(limits[peak])))
    return found


def line_heights(psd: Spectra, width: int, quantile: float = 0.5) -> Array:
    """Return each spectral line over the median of the lines around it, or another quantile.

    The height of a line does not depend on the gain of a channel, nor on the level of its noise. A
    structure that is wider than half of `width` is a background and has no height. With a lower
    quantile, it is the floor between dense lines that is the background.

    Parameters
    ----------
    psd : ndarray of shape (n_rows, n_orders)
        Order spectra [U²/order] in any unit U; they are mirrored at their ends.
    width : int
        Odd number of lines of which the quantile is taken.
    quantile : float
        In [0, 1).

    Returns
    -------
    ndarray of shape (n_rows, n_orders)
        Heights [dB]; 0 where line and background are both 0.

    Examples
    --------
    >>> line_heights(np.array([[1.0, 1.0, 100.0, 1.0, 1.0]]), 5)
    array([[ 0.,  0., 20.,  0.,  0.]])
    """
    psd, half = np.asarray(psd, dtype=np.float64), width // 2
    padded = np.pad(psd, ((0, 0), (half, half)), mode="reflect")
    # As one row, for which SciPy has a fast algorithm; the padding keeps the rows apart.
    floor = ndimage.rank_filter(padded.ravel(), int(quantile * width), size=width)
    tiny = np.finfo(np.float64).tiny
    around = floor.reshape(padded.shape)[:, half : half + psd.shape[1]]
    return 10 * np.log10(np.maximum(psd, tiny) / np.maximum(around, tiny))
