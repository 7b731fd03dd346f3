"""New spectral lines: orders at which a line is higher over its background than in the training.

A bin contains several spectral lines. A new line beside a strong one raises their bin by little,
and a weak one hardly changes its own bin. Over the local background of its own recording, however,
it may be far above everything in the training. The local background does not depend on load, speed,
gain or state, as the level does. What is far above is learned from the training: each recording, or
group of recordings, is compared with all others.

The background is the lower quartile of the lines around one: the floor between dense lines.
Structures wider than that are no lines: they fill bins, which show them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from emacm._checks import group_codes
from emacm.orders.columns import OrderBlock
from emacm.resampling.training_range import warn_of_statements

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NewLineSettings:
    """What a new line is; ``benchmarks/unknown.py`` chose the values, on simulated units.

    Attributes
    ----------
    least : float
        Least excess over the maximum of the training [dB], which a recording with less noise may
        also have.
    level : float
        Fraction of groups of known recordings that may exceed the limit.
    fewest : int
        Groups from which a limit can be learned.
    floor : float
        Fraction of the largest line of a channel below which lines are rounding errors.
    side, lines : float, int
        Background on either side of a line: so many orders, and at least so many lines.
    quantile : float
        Quantile of the background: the floor between dense lines, where a median would be on them.
    deepest : float
        Least height [dB]: valleys between lines, and order 0 without the mean.
    prior : int
        Weight of the spread that is common to the lines of a channel [groups].
    least_spread : float
        About the scatter of heights in spectra of thirty segments [dB].
    lobe, below : int, float
        Adjacent orders that a line fills (Hann window), down to so many dB below its peak.
    listed : int
        Statements about a recording.
    """

    least: float = 4.0
    level: float = 0.02
    fewest: int = 5
    floor: float = 1e-12
    side: float = 0.5
    lines: int = 8
    quantile: float = 0.25
    deepest: float = -20.0
    prior: int = 5
    least_spread: float = 0.8
    lobe: int = 4
    below: float = 10.0
    listed: int = 5


SETTINGS = NewLineSettings()

_collected: ContextVar[list[str] | None] = ContextVar("_collected", default=None)


class KnownLines(NamedTuple):
    """Lines of the training, of which a new one is far above.

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
    """

    maxima: Array
    limits: Array
    largest: Array


def learn_lines(
    psd: NDArray[np.floating],
    blocks: Sequence[OrderBlock],
    compared: NDArray[np.bool_],
    groups: Any = None,
) -> KnownLines:
    """Learn the lines of the training, and the excess over them that two groups in a hundred have.

    The excess of a group is that of its largest line over the maximum of all other groups at the
    same order, in standard deviations of the maxima of those groups at that order. Orders at which
    units differ, such as those of faults and of strong lines, thus have higher limits than the
    background. As groups are few, the variance is averaged with the median of the channel, which
    counts as five groups. Excesses above their median are treated as exponential (peaks over
    a threshold [1]_) with a mean that is known from so many values only, so that the predictive
    distribution of the next one is that of Lomax [2]_: with fewer groups the limit is higher.

    Parameters
    ----------
    psd : ndarray of shape (n_recordings, n_columns)
        Power spectral densities of the training.
    blocks : sequence of OrderBlock
        Columns of each channel.
    compared : ndarray of shape (n_columns,)
        Whether a column is within the bins.
    groups : array-like of shape (n_recordings,), optional
        Labels of recordings that were measured together. None: single recordings.

    Returns
    -------
    KnownLines

    Raises
    ------
    ValueError
        If there is not one group for each recording.

    References
    ----------
    .. [1] Pickands, Statistical inference using extreme order statistics, Annals of Statistics
       3 (1975).
    .. [2] Geisser, Predictive Inference (1993), section 3.1.
    """
    codes = None if groups is None else group_codes(groups, len(psd))
    largest = np.array([psd[:, block.columns].max() for block in blocks], dtype=np.float64)
    known = KnownLines(np.full(psd.shape[1], np.inf), np.full(psd.shape[1], np.inf), largest)
    excess: Any = -np.inf
    for block in blocks:
        own, used = psd[:, block.columns], compared[block.columns]
        if not used.any() or own.max() <= 0 or own.min() < 0:
            continue
        heights = _heights(own, block.orders)
        highest = heights if codes is None else _maxima_of_groups(heights, codes)
        known.maxima[block.columns] = np.where(used, highest.max(axis=0), np.inf)
        if len(highest) >= SETTINGS.fewest:
            spread, left_out = _left_out(highest)
            known.limits[block.columns] = np.where(used, spread, np.inf)
            excess = np.maximum(excess, left_out[:, used].max(axis=1))
    if np.ndim(excess):
        learned = np.isfinite(known.limits)
        known.limits[learned] = np.maximum(_limit(excess) * known.limits[learned], SETTINGS.least)
    return known


def state_new_lines(
    psd: NDArray[np.floating], known: KnownLines, blocks: Sequence[OrderBlock]
) -> list[list[str]]:
    """State at which orders recordings have lines that the training does not have.

    Parameters
    ----------
    psd : ndarray of shape (n_recordings, n_columns)
        Power spectral densities.
    known : KnownLines
        Lines of the training.
    blocks : sequence of OrderBlock
        Columns of each channel.

    Returns
    -------
    list of list of str
        Of each recording, the line that is farthest above the maximum first.
    """
    found: list[list[tuple[float, str]]] = [[] for _ in psd]
    for block, largest in zip(blocks, known.largest, strict=True):
        maxima, limits = known.maxima[block.columns], known.limits[block.columns]
        if np.isinf(limits).all():
            continue
        heights = _heights(psd[:, block.columns], block.orders)
        # What is not above the background is no line; a dead channel has only rounding errors.
        is_alive = psd[:, block.columns].max(axis=1, keepdims=True) > SETTINGS.floor * largest
        above = (heights > np.maximum(maxima + limits, SETTINGS.least)) & is_alive
        for row in np.flatnonzero(above.any(axis=1)):
            found[row] += _of_channel(block, heights[row], maxima, above[row])
    stated = []
    for pairs in found:
        texts = [text for _, text in sorted(pairs, key=lambda pair: -pair[0])]
        more = len(texts) - SETTINGS.listed
        stated.append(
            texts[: SETTINGS.listed] + ([f"and at {more} more orders"] if more > 0 else [])
        )
    return stated


@contextmanager
def collected_statements() -> Iterator[list[str]]:
    """Collect the statements about new lines that would otherwise be warnings.

    Of one recording that is transformed within the block.
    """
    found: list[str] = []
    token = _collected.set(found)
    try:
        yield found
    finally:
        _collected.reset(token)


def warn_of_new_lines(statements: Sequence[Sequence[str]], *, stacklevel: int) -> None:
    """Warn once of all recordings with new lines, unless the statements are being collected."""
    found = _collected.get()
    if found is not None:
        found += [text for own in statements for text in own if text not in found]
        return
    note = (
        f"({sum(map(bool, statements))} of {len(statements)}; of recordings like those of the "
        f"training, about {100 * SETTINGS.level:.0f} in 100 have such lines)"
    )
    rows = [None] * len(statements)
    warn_of_statements(rows, statements, note=note, stacklevel=stacklevel + 1)


def _heights(psd: NDArray[np.floating], orders: NDArray[np.floating]) -> Array:
    """Return the height of each line of a channel over its background [dB], at least -20."""
    step = (orders[-1] - orders[0]) / max(len(orders) - 1, 1)
    side = max(round(SETTINGS.side / step), SETTINGS.lines) if step > 0 else SETTINGS.lines
    floor = SETTINGS.floor * psd.max(axis=1, keepdims=True)
    heights = line_heights(np.maximum(psd, np.maximum(floor, 0.0)), 2 * side + 1, SETTINGS.quantile)
    return np.maximum(heights, SETTINGS.deepest, out=heights)


def _maxima_of_groups(heights: Array, codes: NDArray[np.intp]) -> Array:
    """Return the largest value of each group in each column, shape (n_groups, n_columns)."""
    order = np.argsort(codes, kind="stable")
    starts = np.unique(codes[order], return_index=True)[1]
    return np.maximum.reduceat(heights[order], starts, axis=0)


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
    common = SETTINGS.prior * float(np.median(total)) / (n_groups - 1)
    # The sum of squares about the mean of the others, without each group.
    others = np.maximum(total - squares * (n_groups / (n_groups - 1)), 0.0)
    columns, top = np.arange(n_columns), highest.argmax(axis=0)
    second = np.partition(highest, -2, axis=0)[-2]
    excess = highest - highest.max(axis=0)
    excess[top, columns] = highest[top, columns] - second
    excess /= np.maximum(
        np.sqrt((others + common) / (n_groups - 2 + SETTINGS.prior)), SETTINGS.least_spread
    )
    spread = np.sqrt((total + common) / (n_groups - 1 + SETTINGS.prior))
    return np.maximum(spread, SETTINGS.least_spread), excess


def _limit(excess: Array) -> float:
    """Return the excess that two groups in a hundred have, from those of left-out groups.

    Examples
    --------
    >>> round(_limit(np.array([0.0, 0.0, 0.0, 1.0, 2.0, 2.0])), 2)
    7.23
    """
    median = float(np.median(excess))
    peaks = excess[excess > median] - median
    if not len(peaks):
        return max(median, 0.0)
    tail = len(peaks) * peaks.mean() * ((2 * SETTINGS.level) ** (-1 / len(peaks)) - 1)
    return max(median + float(tail), 0.0)


def _of_channel(
    block: OrderBlock, heights: Array, maxima: Array, above: NDArray[np.bool_]
) -> list[tuple[float, str]]:
    """Return the excess and a sentence for each range of adjacent orders above the limit."""
    excess = heights - maxima
    edges = np.flatnonzero(np.diff(np.concatenate([[False], above, [False]])))
    found = []
    for start, stop in edges.reshape(-1, 2):
        peak = start + int(heights[start:stop].argmax())
        where, up_to = f"line at order {block.orders[peak]:.4g}", ""
        if np.count_nonzero(heights[start:stop] > heights[peak] - SETTINGS.below) > SETTINGS.lobe:
            where, up_to = (
                f"orders {block.orders[start]:.4g} to {block.orders[stop - 1]:.4g}",
                "up to ",
            )
        text = (
            f"{where} of {block.channel!r}, {up_to}{heights[peak]:.0f} dB above the background and "
            f"{excess[peak]:.0f} dB above the training maximum"
        )
        found.append((float(excess[peak]), text))
    return found


def line_heights(
    psd: NDArray[np.floating], width: int, quantile: float = 0.5
) -> NDArray[np.float64]:
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
    floor = floor.reshape(padded.shape)
    tiny = np.finfo(np.float64).tiny
    heights = np.maximum(psd, tiny)
    heights /= np.maximum(floor[:, half : half + psd.shape[1]], tiny)
    np.log10(heights, out=heights)
    heights *= 10
    return heights
