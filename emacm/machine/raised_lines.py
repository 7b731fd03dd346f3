"""Which spectral lines rose above healthy recordings, and whose they are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from emacm.machine.fault_lines import LineLevels, nearest_lines, resolution, resolved
from emacm.machine.fault_orders import (
    FaultSeries,
    Orders,
    fault_series,
    named_orders,
    slip_ranges,
)

Array = NDArray[np.float64]


class RaisedLine(NamedTuple):
    """A line that rose.

    Attributes
    ----------
    order : float
        As in the spectrum.
    rise : float
        Above the healthy recordings [dB].
    fault : str
        Name of the series of the part that has a line there, such as "BPFI"; empty if none has.
    line : str
        Which line of it: the multiple of its order, with the sideband, such as "2x" or "1x-shaft".
    """

    order: float
    rise: float
    fault: str
    line: str


@dataclass(frozen=True)
class LineSpectrum:
    """An order spectrum, and what a line in it is.

    Attributes
    ----------
    orders : ndarray of shape (n_orders,)
        Evenly spaced.
    psd : ndarray of shape (n_orders,)
        Power spectral density [U²/order].
    """

    orders: Array
    psd: Array

    @property
    def step(self) -> float:
        """Distance between the lines of the axis [orders]."""
        return float(self.orders[1] - self.orders[0])

    def levels(self, series: Sequence[FaultSeries], slip: float) -> LineLevels:
        """Return what measures lines over the median of half an order on either side."""
        background = max(0.5, 2 * self.step)
        return LineLevels(self.orders, series, slip, background, without_shaft=True)

    @cached_property
    def heights(self) -> Array:
        """Height of each line over the local background [dB]."""
        return self.levels((), 0.0).heights(self.psd[np.newaxis])[0]

    def peaks_near(self, orders: Array) -> Array:
        """Return the order of the highest line within one line of the axis of each order."""
        around = np.add.outer(nearest_lines(orders, self.orders), [-1, 0, 1])
        best = self.heights[around].argmax(axis=1)
        return self.orders[around[np.arange(len(around)), best]]

    @staticmethod
    def is_high(heights: Any) -> NDArray[np.bool_]:
        """Return which heights are those of lines; noise alone is 1 to 3 dB high."""
        return np.asarray(heights >= 6.0)


def rise_above_spectra(spectrum: LineSpectrum, healthy: Array) -> tuple[Array, Array]:
    """Return the rise of each line above healthy spectra, measured at the line itself.

    Parameters
    ----------
    spectrum : LineSpectrum
        Of the recording.
    healthy : ndarray of shape (n_recordings, n_orders)
        Power spectral densities of healthy recordings, at the same orders.

    Returns
    -------
    rise : ndarray of shape (n_orders,)
        Power of the main lobe above its mean level in the healthy recordings [dB].
    limit : ndarray of shape (n_orders,)
        From which on a line rose [dB]: 3 dB, and four standard deviations of these levels, which
        are at least their median; hundreds of lines are looked at.
    """
    with np.errstate(divide="ignore"):
        levels = 10 * np.log10(_lobes(np.vstack([spectrum.psd, healthy])))
    spread = levels[1:].std(axis=0)
    limit = np.maximum(3.0, 4 * np.maximum(spread, np.median(spread)))
    return levels[0] - levels[1:].mean(axis=0), limit


def rise_above_bins(spectrum: LineSpectrum, bins: pd.DataFrame) -> tuple[Array, Array]:
    """Return the least rise of each line, where only the healthy power of bins is known.

    A healthy line has at most the power of its bin, so a line rose at least by the ratio of its
    own power to that of the healthy bin. A line at an edge is compared with both bins.

    Parameters
    ----------
    spectrum : LineSpectrum
        Of the recording.
    bins : DataFrame
        "low" and "high" [orders], "level" of the recording and "reference_level" of the healthy
        state [dB], and "limit" of deviations in the healthy state [dB].

    Returns
    -------
    rise, limit : ndarray of shape (n_orders,)
        As of `rise_above_spectra`; the rise is -inf outside of the bins.
    """
    at, psd, step = spectrum.orders[:, np.newaxis], spectrum.psd, spectrum.step
    low, high = (bins[name].to_numpy(np.float64) for name in ("low", "high"))
    own, healthy = (10 ** (bins[name].to_numpy() / 10) for name in ("level", "reference_level"))
    at_line = (low <= at + step / 2) & (high >= at - step / 2)
    touched = (low <= at + 1.5 * step) & (high >= at - 1.5 * step)  # beyond is 1 % of a line
    around = (touched.astype(float) @ at_line.T > 0) @ psd
    above = _lobes(np.maximum(psd - psd / 10 ** (spectrum.heights / 10), 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        rise = 10 * np.log10(
            np.minimum(above / around, 1.0) * (touched @ own / (touched @ healthy))
        )
    limit = np.where(at_line, bins["limit"].to_numpy(), np.inf).min(axis=1, initial=np.inf)
    return np.nan_to_num(rise, nan=-np.inf, neginf=-np.inf), limit


def raised_lines(
    spectrum: LineSpectrum, rise: Array, limit: Array, parts: PartLines | None = None
) -> list[RaisedLine]:
    """Return the lines of a spectrum that rose, and whose they are.

    A line is a local peak at least 6 dB over its background, and resolved from order 0.

    Parameters
    ----------
    spectrum : LineSpectrum
        Of the recording.
    rise, limit : ndarray of shape (n_orders,)
        Of `rise_above_spectra` or `rise_above_bins` [dB].
    parts : PartLines, optional
        Predicted lines in this spectrum.

    Returns
    -------
    list of RaisedLine
        In ascending order.

    Examples
    --------
    >>> from emacm import Gear
    >>> orders, healthy = np.arange(0, 30, 0.04), np.ones((5, 750))
    >>> healthy[:, [25, 50, 75]] = 1000.0  # orders 1, 2 and 3
    >>> psd = healthy[0].copy()
    >>> psd[50] *= 100.0
    >>> spectrum = LineSpectrum(orders, psd)
    >>> rise, limit = rise_above_spectra(spectrum, healthy)
    >>> for line in raised_lines(spectrum, rise, limit, PartLines(spectrum, Gear(18, 67))):
    ...     print(line.fault, line.line, line.order, round(line.rise, 1))
    pinion 2x 2.0 20.0
    """
    orders, psd = spectrum.orders, spectrum.psd
    is_peak = (psd == ndimage.maximum_filter1d(psd, 7)) & spectrum.is_high(spectrum.heights)
    places = np.flatnonzero(is_peak & (orders >= resolution(orders)) & (rise >= limit))
    owners = [("", "")] * len(places) if parts is None else parts.owners(orders[places])
    return [
        RaisedLine(float(orders[place]), float(rise[place]), *owner)
        for place, owner in zip(places, owners, strict=True)
    ]


class PartLines:
    """The lines that parts may have in a spectrum, with the slip of rolling elements.

    The first line of a series counts in any case; its other harmonics if at least half of the first
    three are above the background; and three sidebands on either side of a harmonic that is. Lines
    that the spectrum does not resolve, from order 0 or from their carrier, do not count.

    Parameters
    ----------
    spectrum : LineSpectrum
        Of the recording.
    parts : part, or sequence of parts
        `Bearing`, `Gear` and so on, or mappings of fault names to orders.
    slip : float
        Largest slip, as a fraction of the order, either way.

    Attributes
    ----------
    resolved : tuple of FaultSeries
        Series that the spectrum resolves, with those of their first three lines that it holds.
    shown : set of str
        Names of the series of which at least half of these lines are above the background.
    """

    def __init__(self, spectrum: LineSpectrum, parts: Any, slip: float = 0.02) -> None:
        top = spectrum.orders[-2] / (1 + slip)
        cut = [fault.up_to(top) for fault in resolved(fault_series(parts, 3), spectrum.orders)]
        self.resolved = tuple(fault for fault in cut if fault.orders)
        self.shown: set[str] = set()
        self._spectrum = spectrum
        lines: list[tuple[Any, ...]] = []
        if self.resolved:
            levels = spectrum.levels(self.resolved, slip)
            _, (shifts,), heights = levels.measure(spectrum.psd[np.newaxis].astype(np.float64))
            for fault, shift, (own,) in zip(self.resolved, shifts, heights, strict=True):
                is_high = spectrum.is_high(own)
                if is_high.mean() >= 0.5:
                    self.shown.add(fault.name)
                known = np.array(fault.orders)[is_high]
                if fault.slips and len(known):  # the slip is known to a line of the axis
                    shift = spectrum.peaks_near(known * (1 + shift)) @ known / (known @ known) - 1
                lines += self._lines_of(fault, 1 + float(shift))
        lines.sort(key=lambda line: line[0])  # of equally near lines the simplest
        self._lines = pd.DataFrame(lines, columns=["rank", "order", "slips", "owner"])

    def _lines_of(self, fault: FaultSeries, scale: float) -> Iterator[tuple[Any, ...]]:
        """Yield rank, order, slipping and name of the lines of a series with its slip."""
        spectrum = self._spectrum
        peaks = ndimage.maximum_filter1d(spectrum.heights, 3)
        # With more harmonics, the lines of a slow part would be everywhere.
        for number in range(1, 21 if fault.name in self.shown else 2):
            carrier, line = number * fault.orders[0] * scale, f"{number * fault.strikes}x"
            yield number, carrier, fault.slips, (fault.name, line)
            if not spectrum.is_high(np.interp(carrier, spectrum.orders, peaks, right=0.0)):
                continue
            for (name, spacing), n in product(fault.sidebands, (-3, -2, -1, 1, 2, 3)):
                if spacing >= resolution(spectrum.orders) and carrier + n * spacing > 0:
                    owner = fault.name, line + f"{n:+d}x{name}".replace("1x", "")
                    yield number + abs(n), carrier + n * spacing, fault.slips, owner

    def owners(self, orders: Array) -> list[tuple[str, str]]:
        """Return series and line of the nearest predicted line at each order; empty if none."""
        if self._lines.empty:
            return [("", "")] * len(orders)
        # Random slip broadens a line, the more the higher its order; the highest peak is anywhere.
        width = 3 * self._spectrum.step
        _, nearest = lines_within(orders, orders, self._lines, slip=0.003, min_width=width)
        return [self._lines["owner"][place] if place >= 0 else ("", "") for place in nearest]


def lines_within(
    low: ArrayLike, high: ArrayLike, orders: Orders, *, slip: float, min_width: float
) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """Return which predicted lines may be within ranges of orders.

    Parameters
    ----------
    low, high : array-like of shape (n_ranges,)
        Ends of the ranges [orders].
    orders : DataFrame from `fault_orders`, or mapping of str to float
        Predicted orders by name.
    slip, min_width : float
        As of `slip_ranges`.

    Returns
    -------
    inside : ndarray of bool, shape (n_ranges, n_lines)
    nearest : ndarray of int, shape (n_ranges,)
        Number of the line nearest to the centre, the first of equally near ones; -1 if none.

    Raises
    ------
    TypeError, ValueError
        As `named_orders`.

    Examples
    --------
    >>> orders = {"BPFI": 6.1, "supply": 6.4}
    >>> lines_within([6.0, 7.0], [7.0, 8.0], orders, slip=0.0, min_width=0.0)[1].tolist()
    [1, -1]
    """
    bottom, top = (np.asarray(ends, np.float64)[:, np.newaxis] for ends in (low, high))
    _, least, most = slip_ranges(orders, slip=slip, min_width=min_width)
    inside = (least <= top) & (most >= bottom)
    distance = np.abs(named_orders(orders)[1] - (bottom + top) / 2).round(9)
    nearest = np.argmin(np.where(inside, distance, np.inf), axis=1)
    return inside, np.where(inside.any(axis=1), nearest, -1)


def _lobes(psd: Array) -> Array:
    """Return the sum over the main lobe of a Hann window around each line."""
    return ndimage.convolve1d(psd, np.ones(5), axis=-1, mode="constant")
