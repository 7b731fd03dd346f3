"""Integration of an order spectrum over bins: one exact linear operator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_number, check_real_array
from emacm.orders.columns import number_name, parse_bin_columns, parse_order_columns

Band = tuple[float, float]


def bin_edges(bin_size: float, max_order: float) -> list[Band]:
    """Divide the orders from 0 to `max_order` into bins; the last may be narrower.

    Parameters
    ----------
    bin_size : float
        Width of a bin [orders].
    max_order : float
        Where the last bin ends [orders].

    Returns
    -------
    list of (low, high)
        Edges of each bin [orders], rounded to 12 digits.

    Raises
    ------
    ValueError
        If either is not positive.

    Examples
    --------
    >>> bin_edges(0.4, 1.0)
    [(0.0, 0.4), (0.4, 0.8), (0.8, 1.0)]
    """
    bin_size = check_number(bin_size, "bin_size", above=0, unit="orders")
    max_order = check_number(max_order, "max_order", above=0, unit="orders")
    if max_order / bin_size > 10_000:  # far narrower than any line
        raise ValueError(
            f"bin_size = {bin_size:g} would make {max_order / bin_size:.3g} bins up to order "
            f"{max_order:g}. It is the width of a bin in orders, such as 1."
        )
    n_bins = max(1, int(np.ceil(max_order / bin_size - 1e-9)))
    edges = [round_edge(i * bin_size) for i in range(n_bins)] + [round_edge(max_order)]
    return list(pairwise(edges))


def check_edges(edges: ArrayLike | Mapping[str, Band]) -> dict[str, Band] | list[Band]:
    """Check user-defined bins: increasing edges, or named bands.

    Parameters
    ----------
    edges : array-like of shape (n_bins + 1,) or mapping of str to (low, high)
        Edges of adjacent bins, or named bands, which may overlap [orders].

    Returns
    -------
    list of (low, high), or dict of str to (low, high)
        The bins, named if names were given.

    Raises
    ------
    TypeError
        If an edge is not a number or a name not a string.
    ValueError
        If edges do not increase, are negative or not finite, or a band is named like other orders.
    """
    if isinstance(edges, Mapping):
        if not edges:
            raise ValueError("edges must name at least one band, got an empty mapping.")
        for name in edges:
            if not isinstance(name, str) or not name:
                raise TypeError(f"bands in edges must be named by strings, got {name!r}.")
        bands = {name: _check_band(band, f"band {name!r} of edges") for name, band in edges.items()}
        for name, band in bands.items():
            _check_name(name, band)
        return bands
    values = check_real_array(edges, "edges")
    if values.ndim != 1 or len(values) < 2 or not np.isfinite(values).all():
        raise ValueError(f"edges must be a list of at least 2 finite orders, got {edges!r}.")
    rounded = [round_edge(value) for value in values]
    falling = np.flatnonzero(np.diff(rounded) <= 0)
    if len(falling) or rounded[0] < 0:
        place = int(falling[0]) + 1 if len(falling) else 0
        raise ValueError(
            f"edges must be at least 0 and increase, but {values[place]:.15g} is at position "
            f"{place}. Sort them, or write named bands as {{'name': (low, high)}}."
        )
    return list(pairwise(rounded))


def check_stop_bands(stop_bands: Sequence[Band]) -> list[Band]:
    """Check stop bands and join those that overlap, in increasing order.

    Raises
    ------
    TypeError
        If it is not a sequence of pairs of numbers.
    ValueError
        If a band does not run from a lower to a higher order.
    """
    if not np.iterable(stop_bands):
        raise TypeError(f"stop_bands must be pairs such as ((low, high),), got {stop_bands!r}.")
    bands = sorted(_check_band(b, f"stop band {i}") for i, b in enumerate(stop_bands))
    joined: list[Band] = []
    for low, high in bands:
        if joined and low <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(high, joined[-1][1]))
        else:
            joined.append((low, high))
    return joined


def kept_intervals(band: Band, stop_bands: Sequence[Band]) -> list[Band]:
    """Return the parts of a band outside the stop bands (sorted and disjoint).

    Examples
    --------
    >>> kept_intervals((5.0, 7.0), [(5.6, 6.4)])
    [(5.0, 5.6), (6.4, 7.0)]
    """
    kept, low = [], band[0]
    for stop_low, stop_high in stop_bands:
        if stop_low > low:
            kept.append((low, min(stop_low, band[1])))
        low = max(low, stop_high)
    kept.append((low, band[1]))
    return [(a, b) for a, b in kept if b > a]


def named_bins(
    bin_size: float,
    max_order: float,
    edges: ArrayLike | Mapping[str, Band] | None,
    stop_bands: Sequence[Band],
) -> dict[str, Band]:
    """Return the bins that do not lie inside stop bands, by their name after the @ of a column.

    Parameters
    ----------
    bin_size, max_order : float
        As for `bin_edges`; not used where `edges` are given.
    edges : array-like of shape (n_bins + 1,) or mapping of str to (low, high), optional
        As for `check_edges`.
    stop_bands : sequence of (low, high)
        Bands that are removed [orders].

    Returns
    -------
    dict of str to (low, high)

    Raises
    ------
    TypeError, ValueError
        If one of these is invalid, or no bin is left.

    Examples
    --------
    >>> named_bins(0.5, 1.5, None, [(0, 0.5)])
    {'0.5-1': (0.5, 1.0), '1-1.5': (1.0, 1.5)}
    """
    stops = check_stop_bands(stop_bands)
    bins = bin_edges(bin_size, max_order) if edges is None else check_edges(edges)
    if not isinstance(bins, dict):
        bins = {f"{number_name(low)}-{number_name(high)}": (low, high) for low, high in bins}
    kept = {name: band for name, band in bins.items() if kept_intervals(band, stops)}
    if not kept:
        raise ValueError(f"stop_bands {stops} cover all bins. Remove one of them.")
    return kept


def bin_operator(
    orders: ArrayLike, bins: Sequence[Band], *, stop_bands: Sequence[Band] = ()
) -> NDArray[np.floating]:
    """Make the matrix that integrates a piecewise-linear spectrum over bins.

    The spectrum is interpolated linearly between its lines and integrated between the exact edges
    of each bin. The sum of adjacent bins is therefore the whole integral, for any edges.

    Parameters
    ----------
    orders : array-like of shape (n_orders,)
        Increasing orders of the spectral lines.
    bins : sequence of (low, high)
        Bins [orders], within the range of `orders` to 1e-9.
    stop_bands : sequence of (low, high)
        Bands in which the spectrum is set to zero [orders], exact at their edges.

    Returns
    -------
    operator : ndarray of shape (n_bins, n_orders)
        ``psd @ operator.T`` are the bins, in U² for a PSD in U²/order.

    Raises
    ------
    ValueError
        If a bin reaches beyond the orders.

    Examples
    --------
    >>> bin_operator([0, 1, 2], [(0, 2), (0.5, 1)])
    array([[0.5  , 1.   , 0.5  ],
           [0.125, 0.375, 0.   ]])
    """
    orders, stops = np.asarray(orders, np.float64), check_stop_bands(stop_bands)
    _check_range(orders, bins)
    # A stop band may divide a bin into parts; adjacent ones share a limit.
    parts = [(row, *part) for row, b in enumerate(bins) for part in kept_intervals(b, stops)]
    rows, *edges = np.array(parts).reshape(-1, 3).T
    limits, places = np.unique(edges, return_inverse=True)
    below = _weights_below(orders, limits)
    low, high = places.reshape(2, -1)
    operator = np.zeros((len(bins), len(orders)))
    np.add.at(operator, rows.astype(np.intp), below[high] - below[low])
    return operator


def round_edge(order: float) -> float:
    """Round an edge to 12 digits, so that 3 * 0.1 reads 0.3, and -0 reads 0."""
    return float(f"{order:.12g}") + 0.0


def _weights_below(
    orders: NDArray[np.floating], limits: NDArray[np.floating]
) -> NDArray[np.floating]:
    """Weights of the lines in the integrals from the first order to each limit."""
    steps = np.diff(orders)
    # Fraction of each interval between two lines that lies below the limit.
    below = np.clip((limits[:, np.newaxis] - orders[:-1]) / steps, 0.0, 1.0)
    weights = np.zeros((len(limits), len(orders)))
    weights[:, :-1] += steps * (below - below**2 / 2)  # falling half of a line's triangle
    weights[:, 1:] += steps * below**2 / 2  # rising half
    return weights


def _check_band(band: Any, name: str) -> Band:
    if isinstance(band, str) or not np.iterable(band) or len(list(band)) != 2:
        raise TypeError(f"{name} must be a pair (low, high) of orders, got {band!r}.")
    low, high = (check_number(edge, f"{name}", at_least=0, unit="orders") for edge in band)
    low, high = round_edge(low), round_edge(high)
    if not low < high:
        raise ValueError(f"{name} must run from a lower to a higher order, got {band!r}.")
    return low, high


def _check_name(name: str, band: Band) -> None:
    """Refuse a name from which another channel or other orders would be read in a column."""
    (block,) = parse_bin_columns([f"@{name}"]) or ()
    is_order = parse_order_columns([f"@{name}"]) is not None
    is_other = block.bands is not None and tuple(block.bands[0]) != band
    if "@" in name or is_order or is_other:
        raise ValueError(
            f"band {name!r} of edges, with the orders {band[0]:g} to {band[1]:g}, is named like "
            f"other orders or another channel. Name it by a word, such as 'BPFI'."
        )


def _check_range(orders: NDArray[np.floating], bins: Sequence[Band]) -> None:
    slack = 1e-9  # orders; an edge closer than this to the end of the axis lies on it
    for low, high in bins:
        if high > orders[-1] + slack or low < orders[0] - slack:
            raise ValueError(
                f"the bin {low:g}-{high:g} reaches beyond the spectrum, whose orders are "
                f"{orders[0]:g} to {orders[-1]:g}. Lower max_order (or edges) of the bins, or "
                f"resample with a smaller theta_s: orders up to pi/theta_s exist."
            )
