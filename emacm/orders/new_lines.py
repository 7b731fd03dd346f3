"""New spectral lines: orders at which a spectrum is far above all those of the training.

A bin contains several spectral lines. A new line beside a strong one raises their bin by little,
but at its own order it may be far above everything in the training. What is far above is learned
from the training: each recording, or group of recordings, is compared with all others.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm._checks import group_codes
from emacm.orders.columns import OrderBlock

Array = NDArray[np.float64]

_LEAST = 6.0  # dB; twice what is stated of the level of a channel
_LEVEL = 0.01  # fraction of known recordings that may exceed the limit
_FEWEST = 5  # groups, from which a limit can be learned
_FLOOR = 1e-12  # of the largest line of a channel: rounding errors lie below
_LINE = 4  # adjacent orders that a line fills: the main lobe of a Hann window
_LISTED = 5  # statements about a recording, and recordings in a warning

_collected: ContextVar[list[str] | None] = ContextVar("_collected", default=None)


def line_maxima(psd: NDArray[np.floating], blocks: Sequence[OrderBlock]) -> Array:
    """Return the largest value at each order.

    Parameters
    ----------
    psd : ndarray of shape (n_recordings, n_columns)
        Power spectral densities of the training.
    blocks : sequence of OrderBlock
        Columns of each channel.

    Returns
    -------
    ndarray of shape (n_columns,)
        At least 1e-12 of the largest value of the channel; inf in a channel without power, whose
        lines cannot be compared.
    """
    largest = psd.max(axis=0).astype(np.float64)
    for block in blocks:
        own = largest[block.columns]
        largest[block.columns] = np.maximum(own, _FLOOR * own.max()) if own.max() > 0 else np.inf
    return largest


def excess_limit(psd: NDArray[np.floating], maxima: Array, groups: Any = None) -> float:
    """Return the excess over the training maximum that one known recording in a hundred has.

    The excess of a group is that of its largest line over the maximum of all other groups at the
    same order. Excesses above their median are treated as exponential (peaks over a threshold [1]_)
    with a mean that is known from so many values only, so that the predictive distribution of the
    next one is that of Lomax [2]_: with fewer groups the limit is higher.

    Parameters
    ----------
    psd : ndarray of shape (n_recordings, n_columns)
        Power spectral densities of the training.
    maxima : ndarray of shape (n_columns,)
        Of `line_maxima`; inf for columns that are not compared.
    groups : array-like of shape (n_recordings,), optional
        Labels of recordings that were measured together. None: single recordings.

    Returns
    -------
    float
        Limit [dB], at least 6; inf with fewer than five groups.

    Raises
    ------
    ValueError
        If there is not one group for each recording.

    References
    ----------
    .. [1] Pickands, Statistical inference using extreme order statistics, Annals of Statistics
       3 (1975).
    .. [2] Geisser, Predictive Inference (1993), section 3.1.

    Examples
    --------
    >>> psd = np.diag([1.0, 1.0, 1.0, 2.0, 4.0, 4.0]) + 1.0
    >>> round(excess_limit(psd, psd.max(axis=0)), 1)
    22.9
    """
    by_group = psd if groups is None else _maxima_of_groups(psd, groups)
    columns = np.flatnonzero(np.isfinite(maxima))
    if len(by_group) < _FEWEST or not len(columns):
        return np.inf
    by_group, known = by_group[:, columns], maxima[columns]
    ratios = (by_group / known).max(axis=1)  # of groups without any maximum; 1 with one
    excess = 10 * np.log10(np.maximum(ratios, _FLOOR))
    largest = by_group.argmax(axis=0)
    by_group[largest, np.arange(len(columns))] = 0.0
    others = np.maximum(by_group.max(axis=0), _FLOOR * known)
    np.maximum.at(excess, largest, 10 * np.log10(known / others))
    median = float(np.median(excess))
    peaks = excess[excess > median] - median
    if not len(peaks):
        return max(median, _LEAST)
    tail = len(peaks) * peaks.mean() * ((2 * _LEVEL) ** (-1 / len(peaks)) - 1)
    return float(max(median + tail, _LEAST))


def largest_medians(
    psd: NDArray[np.floating], maxima: Array, blocks: Sequence[OrderBlock]
) -> Array:
    """Return the largest median of each channel relative to the line maxima.

    Parameters
    ----------
    psd : ndarray of shape (n_recordings, n_columns)
        Power spectral densities of the training.
    maxima : ndarray of shape (n_columns,)
        Of `line_maxima`.
    blocks : sequence of OrderBlock
        Columns of each channel.

    Returns
    -------
    ndarray of shape (n_channels,)
        Over all recordings [dB]; NaN for a channel that is not compared.
    """
    found = np.full(len(blocks), np.nan)
    for number, block in enumerate(blocks):
        columns = np.arange(len(maxima))[block.columns]
        columns = columns[np.isfinite(maxima[columns])]
        if len(columns):
            medians = np.median(psd[:, columns] / maxima[columns], axis=1)
            found[number] = 10 * np.log10(max(medians.max(), _FLOOR))
    return found


def state_new_lines(
    psd: NDArray[np.floating],
    maxima: Array,
    limit: float,
    medians: Array,
    blocks: Sequence[OrderBlock],
) -> list[list[str]]:
    """State at which orders recordings exceed the training maximum by more than a limit.

    Where the whole spectrum of a channel is higher than in the training (a gain, or noise), its
    lines are lowered accordingly first.

    Parameters
    ----------
    psd : ndarray of shape (n_recordings, n_columns)
        Power spectral densities.
    maxima : ndarray of shape (n_columns,)
        Of `line_maxima`.
    limit : float
        Of `excess_limit` [dB].
    medians : ndarray of shape (n_channels,)
        Of `largest_medians`.
    blocks : sequence of OrderBlock
        Columns of each channel.

    Returns
    -------
    list of list of str
        Of each recording, the line that is farthest above the maximum first.
    """
    stated = []
    for row in psd:
        found: list[tuple[float, str]] = []
        with np.errstate(divide="ignore", invalid="ignore"):
            excess = 10 * np.log10(row / maxima)
        for block, median in zip(blocks, medians, strict=True):
            found += _of_channel(block, excess[block.columns], limit, median)
        found.sort(key=lambda pair: -pair[0])
        texts = [text for _, text in found]
        more = len(texts) - _LISTED
        stated.append(texts[:_LISTED] + ([f"and at {more} more orders"] if more > 0 else []))
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
    lines = [f"recording {index}: {'; '.join(own)}" for index, own in enumerate(statements) if own]
    if len(lines) > _LISTED:
        lines = [*lines[:_LISTED], f"and {len(lines) - _LISTED} more recordings"]
    if lines:
        warnings.warn("\n".join(lines), UserWarning, stacklevel=stacklevel + 1)


def _maxima_of_groups(psd: NDArray[np.floating], groups: Any) -> NDArray[np.floating]:
    """Return the largest value of each group in each column, shape (n_groups, n_columns)."""
    codes = group_codes(groups, len(psd))
    order = np.argsort(codes, kind="stable")
    return np.maximum.reduceat(psd[order], np.unique(codes[order], return_index=True)[1], axis=0)


def _of_channel(
    block: OrderBlock, excess: Array, limit: float, median: float
) -> list[tuple[float, str]]:
    """Return the excess and a sentence for each range of adjacent orders above the limit."""
    compared = excess[np.isfinite(excess)]
    common = max(np.median(compared) - median, 0.0) if len(compared) else 0.0
    above, name = excess - common > limit, f"of {block.channel!r}"
    edges = np.flatnonzero(np.diff(np.concatenate([[False], above, [False]])))
    found = []
    for start, stop in edges.reshape(-1, 2):
        peak = start + int(excess[start:stop].argmax())
        text = f"line at order {block.orders[peak]:.4g} {name}, {excess[peak]:.0f} dB"
        if stop - start > _LINE:
            span = f"{block.orders[start]:.4g} to {block.orders[stop - 1]:.4g}"
            text = f"orders {span} {name}, up to {excess[peak]:.0f} dB"
        found.append((float(excess[peak]), f"{text} above the training maximum"))
    return found
