"""Sentences about a recording that is unlike the training, from the deviations of its columns."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.explanations.deviations import Deviations

Array = NDArray[np.float64]

_SAME = 3.0  # dB by which bins may differ under one gain
_GAIN = 2.0  # dB from which a common deviation is called a gain
_COVERED = 0.9  # fraction of the bins of a channel that a gain must explain
_SILENT = -20.0  # dB of all bins of a channel
_LEAST = 1.0  # dB, or standard deviations, outside of the training that are stated
_LINE = 4  # adjacent bins that a line and its leakage fill
_PEAK, _HIGH_PEAK = 6.0, 15.0  # its height over these, and over the bins of a longer range [dB]
_BROAD = 0.5  # fraction of the bins of a channel
_MOST = 5  # sentences
_SHARE = 0.03  # of the largest contribution, below which a sentence is left out

PROJECTED = (
    "the features are projections of the bins, so that the bins that deviate are not determined; "
    "give training recordings as background"
)


def unknown_statements(
    bins: pd.DataFrame, shares: Array, found: Deviations, nearest: str
) -> list[str]:
    """State which channels and orders of a recording deviate from the training, and how.

    Parameters
    ----------
    bins : DataFrame
        Columns "column", "channel", "low" and "high", one row for each column of the table.
    shares : ndarray of shape (n_columns,)
        Contribution of each to the distance.
    found : Deviations
        Of the recording.
    nearest : str
        Name of the nearest class.

    Returns
    -------
    list of str
        The most important first.
    """
    powers = found.in_decibels & bins["low"].notna().to_numpy()  # in bands of orders
    channels = {
        str(name): np.flatnonzero((bins["channel"] == name) & powers)
        for name in bins["channel"].unique()
        if ((bins["channel"] == name) & powers).any()
    }
    gain = _common_gain(channels, found)
    if gain:
        return [gain]
    swapped = _swapped(channels, bins, found)
    if swapped:
        return [swapped]
    stated: list[tuple[float, str]] = []
    for name, rows in channels.items():
        stated += _of_channel(name, rows, bins, shares, found, nearest)
    stated += _of_others(np.flatnonzero(~powers), bins, shares, found, nearest)
    stated.sort(key=lambda pair: -pair[0])
    texts = [text for weight, text in stated[:_MOST] if weight >= _SHARE * stated[0][0]]
    if not texts:
        largest = ", ".join(map(repr, bins["column"].iloc[np.argsort(-np.abs(shares))[:3]]))
        texts = [f"no column is far outside the training; together they are, above all {largest}"]
    return texts


def _gain(rows: NDArray[np.intp], found: Deviations) -> float | None:
    """Return the gain [dB] without which the bins are in the range of the training; None if none.

    0 if they are in this range. One bin in ten may deviate.
    """
    least, most = found.of_largest[rows] - _LEAST, found.of_least[rows] + _LEAST
    if np.isnan(least).any():
        least, most = found.of_mean[rows] - _SAME, found.of_mean[rows] + _SAME
    candidates = np.concatenate([[0.0], least, most])
    covered = ((least <= candidates[:, np.newaxis]) & (candidates[:, np.newaxis] <= most)).mean(1)
    if covered.max() < _COVERED:
        return None
    if covered[0] >= _COVERED:
        return 0.0
    return float(candidates[covered == covered.max()].mean())


def _common_gain(channels: dict[str, NDArray[np.intp]], found: Deviations) -> str:
    """Return a sentence if all channels have the same gain."""
    if len(channels) < 2 or not all(_gain(rows, found) for rows in channels.values()):
        return ""
    gain = _gain(np.concatenate([*channels.values()]), found)
    if gain is None or abs(gain) < _GAIN:
        return ""
    return f"all channels {_decibels(gain)} training: gain or unit?"


def _swapped(channels: dict[str, NDArray[np.intp]], bins: pd.DataFrame, found: Deviations) -> str:
    """Return a sentence if two channels have the levels of each other."""
    for one, other in combinations(channels, 2):
        first, second = channels[one], channels[other]
        if not np.array_equal(
            *(bins[["low", "high"]].to_numpy()[rows] for rows in (first, second))
        ):
            continue
        own, crossed = (
            np.mean(np.abs(found.levels[to] - found.mean_levels[of]))
            for to, of in (
                (np.r_[first, second], np.r_[first, second]),
                (np.r_[first, second], np.r_[second, first]),
            )
        )
        if own > 2 * _SAME and crossed < own / 3:
            return f"channels {one!r} and {other!r} as if exchanged: are they swapped?"
    return ""


def _of_channel(
    name: str,
    rows: NDArray[np.intp],
    bins: pd.DataFrame,
    shares: Array,
    found: Deviations,
    nearest: str,
) -> list[tuple[float, str]]:
    """Return the sentences about the bins of one channel, each with its contribution."""
    rows = rows[np.argsort(bins["low"].to_numpy()[rows], kind="stable")]
    outside, limit, of = found.outside[rows], _LEAST, "the training"
    if np.isnan(outside).all():
        outside, limit, of = found.of_mean[rows], 2 * _SAME, repr(nearest)
    weight = np.abs(shares[rows])
    gain = _gain(rows, found)
    if (outside < -limit).all() and np.median(found.of_mean[rows]) <= _SILENT:
        level = _decibels(float(np.median(found.of_mean[rows])))
        return [(weight.sum(), f"channel {name!r} {level} training: cable or sensor?")]
    if gain is not None and abs(gain) >= _GAIN:
        text = f"channel {name!r} {_decibels(gain)} training at all orders: gain or unit?"
        return [(weight.sum(), text)]
    far = np.abs(outside) > limit
    if far.mean() > _BROAD:
        text = (
            f"channel {name!r} {_span(outside[far])} {of} in {100 * far.mean():.0f} % of its "
            f"order bins: broad band"
        )
        return [(weight.sum(), text)]
    return [
        (weight[part].sum(), _of_orders(name, bins.iloc[rows[part]], outside[part], of))
        for part in _adjacent(np.sign(outside) * far)
    ]


def _of_orders(name: str, bins: pd.DataFrame, outside: Array, of: str) -> str:
    """Return a sentence about adjacent bins."""
    end = "maximum" if outside[0] > 0 else "minimum"
    of = f"the training {end}" if of == "the training" else of
    peak = int(np.abs(outside).argmax())
    others = np.abs(np.delete(outside, peak))
    height = _PEAK if len(bins) <= _LINE else _HIGH_PEAK
    if (others <= abs(outside[peak]) - height).all():
        bins, outside = bins.iloc[[peak]], outside[[peak]]
    low, high = bins["low"].min(), bins["high"].max()
    orders = f"order {low:g} to {high:g}"
    if len(bins) > 2:
        return f"orders {low:g} to {high:g} of {name!r} {_span(outside)} {of}"
    kind = "line at " if outside[0] > 0 else ""
    return f"{kind}{orders} of {name!r}, {_decibels(float(outside[np.abs(outside).argmax()]))} {of}"


def _of_others(
    rows: NDArray[np.intp], bins: pd.DataFrame, shares: Array, found: Deviations, nearest: str
) -> list[tuple[float, str]]:
    """Return sentences about columns that are not powers in a band of orders."""
    stated = []
    for row in rows:
        outside, deviation = found.outside[row], found.of_mean[row]
        if not (np.abs(outside) > _LEAST or (np.isnan(outside) and np.abs(deviation) > 3)):
            continue
        way = "above" if deviation > 0 else "below"
        size = f"{abs(deviation):.3g} standard deviations {way}"
        if found.in_decibels[row]:
            size = _decibels(float(deviation))
        text = f"{bins['column'].iloc[row]!r} {size} {nearest!r}"
        stated.append((float(np.abs(shares[row])), text))
    return stated


def _adjacent(signs: Array) -> list[slice]:
    """Return the ranges of equal signs other than 0."""
    edges = np.flatnonzero(np.diff(signs)) + 1
    parts = zip([0, *edges.tolist()], [*edges.tolist(), len(signs)], strict=True)
    return [slice(start, stop) for start, stop in parts if signs[start]]


def _decibels(value: float) -> str:
    return f"{abs(value):.0f} dB {'above' if value > 0 else 'below'}"


def _span(values: Array) -> str:
    """Return a range of deviations in words; of both signs, that of the majority."""
    way = 1 if (values > 0).mean() >= 0.5 else -1
    sizes = np.abs(values[np.sign(values) == way])
    low, high = f"{sizes.min():.0f}", f"{sizes.max():.0f}"
    return f"{low if low == high else f'{low} to {high}'} dB {'above' if way > 0 else 'below'}"
