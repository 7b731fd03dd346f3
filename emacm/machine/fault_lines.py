"""Features of a machine from its geometry: how far predicted fault lines rise above background."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage
from scipy.stats import iqr

from emacm._checks import check_number
from emacm.findings.training_range import line_heights
from emacm.machine.fault_orders import FaultSeries, Parts, fault_series
from emacm.orders.columns import OrderTableTransformer, column_names, parse_order_columns
from emacm.recordings.inputs import check_channel_names, chosen_channels

Array = NDArray[np.float64]


def resolution(orders: ArrayLike) -> float:
    """Return the least distance of two lines of a spectrum, and of one from order 0 [orders].

    The main lobe of a Hann window is four lines of the axis wide, and places are rounded to half a
    line. A line nearer to order 0 cannot be told from a slow change of the signal.
    """
    first, second = np.asarray(orders, dtype=np.float64)[:2]
    return float(3.5 * (second - first))


def resolved(series: Sequence[FaultSeries], orders: ArrayLike) -> tuple[FaultSeries, ...]:
    """Return the series whose lowest line a spectrum resolves from order 0.

    Examples
    --------
    >>> series = (FaultSeries("tooth", (0.0149,), False), FaultSeries("shaft", (1.0,), False))
    >>> [fault.name for fault in resolved(series, [0.0, 0.04, 0.08])]
    ['shaft']
    """
    return tuple(fault for fault in series if fault.orders[0] >= resolution(orders))


def nearest_lines(orders: ArrayLike, axis: Array) -> NDArray[np.intp]:
    """Return the numbers of the lines of an evenly spaced axis that are nearest to orders.

    Examples
    --------
    >>> nearest_lines([0.9, 2.2], np.arange(0, 4, 0.5))
    array([2, 4])
    """
    step = (axis[-1] - axis[0]) / (len(axis) - 1)
    return np.rint((np.asarray(orders) - axis[0]) / step).astype(np.intp)


class LineLevels:
    """Levels of series of lines above the local background, for one order axis.

    Parameters
    ----------
    orders : ndarray of shape (n_orders,)
        Evenly spaced orders of the spectra.
    series : sequence of FaultSeries
        Lines to measure.
    slip : float
        Largest slip, as a fraction of the order, either way.
    background : float
        The background of a line is the median of the spectrum within this distance [orders] on
        either side.
    without_shaft : bool, default=False
        Lines at whole orders do not count for rolling elements, unless they are predicted there:
        for naming faults. Without it, the level is the same for any slip.

    Raises
    ------
    ValueError
        If a line lies outside the orders of the spectra, or the spectra are too coarse.
    """

    def __init__(
        self,
        orders: NDArray[np.floating],
        series: Sequence[FaultSeries],
        slip: float,
        background: float,
        *,
        without_shaft: bool = False,
    ) -> None:
        self.orders = np.asarray(orders, dtype=np.float64)
        self.series = tuple(series)
        self.slip = check_number(slip, "slip", at_least=0, below=0.2)
        check_number(background, "background", above=0, unit="orders")
        self._step = (self.orders[-1] - self.orders[0]) / (len(self.orders) - 1)
        self._width = 2 * round(background / self._step) + 1
        if self._width < 5:  # lines of background, which a median needs
            raise ValueError(
                f"a background of {background:g} orders on either side holds fewer than 5 lines of "
                f"the spectra, which are {self._step:g} orders apart. Use a larger background, or "
                f"OrderPSD(revolutions={np.ceil(5 / background):.0f}) or more."
            )
        self._places = [self._grid(fault) for fault in self.series]
        self._of_shaft = _from_whole(self.orders) < 1.5 * self._step
        self._without_shaft = without_shaft
        self._drawn: dict[float, Array] = {}

    def _grid(self, fault: FaultSeries) -> tuple[Array, NDArray[np.intp]]:
        """Return slips, and the places of the lines for each, of shape (n_slips, n_lines)."""
        lines = np.array(fault.orders)
        reach = self.slip if fault.slips else 0.0
        top = self.orders[-1]
        n_steps = int(np.ceil(reach * min(lines[-1], top) / self._step))
        slips = np.linspace(-reach, reach, 2 * n_steps + 1)
        places = nearest_lines(np.outer(1 + slips, lines), self.orders)
        if places.min() < 2:  # the skirt of order 0; to be named, a line must be `resolved`
            raise ValueError(
                f"the first line of {fault.name!r} is at order {lines[0]:.4g}; the spectra have a "
                f"line every {self._step:.4g} orders. Raise revolutions of OrderPSD, or "
                f"--revolutions, to {np.ceil(2 / (lines[0] * (1 - reach))):.0f}."
            )
        if places.max() > len(self.orders) - 2:
            raise ValueError(
                f"the lines of {fault.name!r} reach order {lines[-1] * (1 + reach):.4g}, but the "
                f"spectra hold orders {self.orders[0]:.4g} to {top:.4g}. Lower theta_s of "
                f"OrderResampler, raise max_order of OrderPSD, or lower harmonics."
            )
        return slips, places

    def _apart_from_shaft(self, fault: FaultSeries) -> NDArray[np.bool_]:
        """Return which lines of a series cannot be harmonics of the shaft."""
        distance = _from_whole(np.array(fault.orders))
        separable = self._without_shaft and fault.slips and distance[0] >= 1.5 * self._step
        return np.asarray(separable & (distance > 0.5 * self._step))

    def separates(self, fault: FaultSeries) -> bool:
        """Return whether the lowest line of a series cannot be a harmonic of the shaft."""
        return bool(self._apart_from_shaft(fault)[0])

    def heights(self, psd: Array) -> Array:
        """Return each line over its local background [dB], of the shape of `psd`.

        Parameters
        ----------
        psd : ndarray of shape (n_rows, n_orders)
            Order spectra [U²/order] in any unit U.

        Returns
        -------
        ndarray of shape (n_rows, n_orders)
            0 where line and background are both 0.
        """
        return line_heights(psd, self._width)

    def measure(
        self, psd: Array, explained: NDArray[np.bool_] | None = None
    ) -> tuple[Array, Array, list[Array]]:
        """Measure the level of each series.

        Parameters
        ----------
        psd : ndarray of shape (n_rows, n_orders)
            Order spectra [U²/order] in any unit U.
        explained : ndarray of bool, shape (n_orders,), optional
            Orders whose lines do not count, as of `explained`: their heights are NaN. A series of
            several lines of which fewer than two remain has the level -inf.

        Returns
        -------
        levels : ndarray of shape (n_rows, n_series)
            Mean height of the lines of a series above the local background [dB], at the slip
            where it is largest.
        slips : ndarray of shape (n_rows, n_series)
            That slip, as a fraction of the order.
        lines : list of ndarray of shape (n_rows, n_lines)
            Height of each line of each series at that slip [dB].
        """
        heights = self.heights(psd)
        # Rolling elements are not synchronous with the shaft: what is at a whole order may not be
        # theirs, even within the range of slip, unless it is predicted there.
        peaks = np.stack([_peaks(heights), _peaks(heights, self._of_shaft)])
        rows = np.arange(len(psd))
        levels, slips, lines = [], [], []
        for fault, (grid, places) in zip(self.series, self._places, strict=True):
            apart = self._apart_from_shaft(fault)
            values = peaks[apart.astype(np.intp), :, places].transpose(2, 0, 1)
            if explained is not None:
                values = np.where(explained[places], np.nan, values)
            counts = np.isfinite(values).sum(axis=2)
            means = np.nansum(values, axis=2) / np.maximum(counts, 1)
            means[counts < min(2, values.shape[2])] = -np.inf
            # Of equal levels the smallest slip.
            nearest = np.argsort(np.abs(grid), kind="stable")
            best = nearest[np.argmax(means[:, nearest], axis=1)]
            levels.append(means[rows, best])
            slips.append(grid[best])
            lines.append(values[rows, best])
        return np.stack(levels, axis=1), np.stack(slips, axis=1), lines

    def explained(
        self, fault: FaultSeries, slip: float, modulations: Sequence[float]
    ) -> NDArray[np.bool_]:
        """Return which orders a fault explains: its harmonics, with three sidebands on either side.

        Parameters
        ----------
        fault : FaultSeries
            The fault.
        slip : float
            Its slip, as `measure` finds it.
        modulations : sequence of float
            Orders of the modulations.

        Returns
        -------
        ndarray of bool, shape (n_orders,)
        """
        first = fault.orders[0] * (1 + slip)
        carriers = first * np.arange(1, np.ceil(self.orders[-1] / first) + 1)
        sides = np.outer(np.arange(-3, 4), modulations).ravel()
        lines = np.add.outer(carriers, [0.0, *sides]).ravel()
        distance = np.abs(self.orders[:, np.newaxis] - lines).min(axis=1)
        return np.asarray(distance < 2.5 * self._step)  # the main lobe of a Hann window

    def height_between(
        self,
        psd: Array,
        fault: FaultSeries,
        slip: float,
        modulations: Sequence[float],
        *,
        reach: float,
    ) -> float:
        """Return the height of the lines between those of a fault, in parts of theirs.

        Impacts of another source, as of a belt, a piston or a cracked tooth, have lines at all
        multiples of a lower order, which are as high between the lines of the fault: about 1.

        Parameters
        ----------
        psd : ndarray of shape (1, n_orders)
            Order spectrum, of long segments.
        fault : FaultSeries
            The fault.
        slip : float
            Its slip, as `measure` finds it; it may be that of a coarser spectrum.
        modulations : sequence of float
            Orders of the modulations, whose sidebands the fault explains.
        reach : float
            Distance from its lowest line within which it is found [orders].

        Returns
        -------
        float
            Median height of the lines between, over the mean height of the fault's lines: at the
            multiples of the fraction 1/2 to 1/24 of its lowest line (at least order 0.2) for which
            it is largest, without sidebands and whole orders; if the fault's lines are at multiples
            of half an order, as those of pistons, also with these at fractions that are such too.
        """
        heights = self.heights(psd)[0]
        highest = ndimage.maximum_filter1d(heights, 3)

        def place(orders: Array) -> NDArray[np.intp]:
            return np.clip(nearest_lines(orders, self.orders), 2, len(highest) - 3)

        multiples = np.arange(1, len(fault.orders) + 1)
        candidates = fault.orders[0] * (1 + slip) + reach * np.linspace(-1, 1, 161)
        means = highest[place(np.outer(candidates, multiples))].mean(axis=1)
        first, level = candidates[means.argmax()], means.max()
        lobes = np.add.outer(place(first * multiples), np.arange(-2, 3))
        peaks = lobes[multiples - 1, heights[lobes].argmax(axis=1)]
        known = self.explained(fault, first / fault.orders[0] - 1, modulations) | self._of_shaft
        fractions = set(range(2, min(24, int(first / 0.2)) + 1)) - {fault.strikes}
        compared = [(n, known) for n in fractions]
        if (_from_whole(2 * self.orders[peaks]) < 3 * self._step).all():
            compared += [(n, np.zeros_like(known)) for n in fractions if round(2 * first) % n == 0]
        between = [0.0]
        for n, without in compared:
            parts = np.arange(1, n * len(multiples))
            places = place(first / n * parts[parts % n > 0])
            left = highest[places[~without[places]]]
            if len(left) > 1:
                between.append(float(np.median(left)))
        return max(between) / level

    def amplitude(self, psd: Array, fault: FaultSeries, slip: float) -> float:
        """Return the amplitude of the sum of the lines of a fault, in the unit of the signal.

        The power of a line is the integral of its main lobe above the background.

        Parameters
        ----------
        psd : ndarray of shape (1, n_orders)
            Order spectrum.
        fault : FaultSeries
            The fault.
        slip : float
            Its slip, as `measure` finds it.

        Returns
        -------
        float
        """
        places = nearest_lines(np.array(fault.orders) * (1 + slip), self.orders)
        lobes = np.add.outer(places, np.arange(-2, 3))  # of a Hann window
        above = (psd - self.background(psd))[0, np.clip(lobes, 0, len(self.orders) - 1)]
        return float(np.sqrt(2 * self._step * np.maximum(above.sum(axis=1), 0.0).sum()))

    def background(self, psd: Array) -> Array:
        """Return the local background of each line, of the shape and the unit of `psd`."""
        return psd / 10 ** (self.heights(psd) / 10)

    def sidebands(self, psd: Array, fault: FaultSeries, slip: float) -> dict[str, float]:
        """Return the median height of the sidebands of a series, by name of the modulation [dB].

        Parameters
        ----------
        psd : ndarray of shape (1, n_orders)
            Order spectrum.
        fault : FaultSeries
            The series.
        slip : float
            Its slip, as `measure` finds it.

        Returns
        -------
        dict of str to float
            Only sidebands within the orders of the spectrum are taken.
        """
        peaks = _peaks(self.heights(psd))[0]
        found = {}
        for name, order in fault.sidebands:
            sides = np.add.outer((1 + slip) * np.array(fault.orders), (-order, order)).ravel()
            places = nearest_lines(sides, self.orders)
            inside = (sides > 2 * self._step) & (places < len(peaks) - 1)
            if inside.any():
                found[name] = float(np.median(peaks[places[inside]]))
        return found

    def of_no_fault(self, psd: Array) -> tuple[float, list[float]]:
        """Return the order of the highest impacts of no series, and the heights of three lines.

        Their lines are 6 dB high, and 10 dB in the mean. None are so high in the recordings of
        CWRU, MFPT and UESTC in which the right bearing shows no fault.

        Parameters
        ----------
        psd : ndarray of shape (1, n_orders)
            Order spectrum.

        Returns
        -------
        order : float
            NaN if there are none.
        heights : list of float
            Of this order, and of two and three times it [dB].
        """
        peaks = _peaks(self.heights(psd))[0]
        known = np.abs(self.orders - np.rint(self.orders)) <= 1.5 * self._step  # of the shaft
        for series in self.series:
            slip = self.slip if series.slips else 0.0
            for order in series.orders:
                known |= np.abs(self.orders - order) <= max(slip * order, 2 * self._step)
        first = np.arange(int(1.2 / self._step), len(peaks) // 3)
        near = ndimage.maximum_filter1d(peaks, 3)
        lines = np.stack([peaks[first], near[2 * first], near[3 * first]])
        is_own = ~known[first] & (known[np.outer((2, 3), first)].sum(axis=0) < 2)
        means = np.where(is_own & (lines.min(axis=0) >= 6.0), lines.mean(axis=0), 0.0)
        best = int(means.argmax())
        if means[best] < 10.0:
            return np.nan, []
        return float(self.orders[first[best]]), lines[:, best].tolist()

    def compare(self, psd: Array, levels: Array) -> tuple[Array, Array]:
        """Compare levels with those of background alone.

        The background is assumed to be noise whose lines are Gamma distributed, as averages of
        Welch's method are. The shape parameter is estimated from the spread of each spectrum. The
        levels of 2000 simulated spectra of that shape are measured in the same way.

        Parameters
        ----------
        psd : ndarray of shape (n_rows, n_orders)
            Order spectra.
        levels : ndarray of shape (n_rows, n_series)
            Their levels [dB].

        Returns
        -------
        excess : ndarray of shape (n_rows, n_series)
            Level minus the mean level of background alone [dB].
        p : ndarray of shape (n_rows, n_series)
            Probability of levels at least as high in background alone, not smaller than 1/2001.
        """
        excess, p = np.empty_like(levels), np.empty_like(levels)
        for row, shape in enumerate(self.background_shapes(psd)):
            drawn = self._background_levels(float(shape))
            excess[row] = levels[row] - drawn.mean(axis=0)
            p[row] = (1 + (drawn >= levels[row]).sum(axis=0)) / (1 + len(drawn))
        return excess, p

    def background_shapes(self, psd: Array) -> Array:
        """Return the Gamma shape of the background of each spectrum, from its spread.

        Parameters
        ----------
        psd : ndarray of shape (n_rows, n_orders)
            Order spectra.

        Returns
        -------
        ndarray of shape (n_rows,)
            The nearest of a grid of shapes; for an average of n independent segments, n.
        """
        shapes, spreads = _simulated_spreads(self._width)
        # A few strong lines do not change the interquartile range.
        spread = iqr(self.heights(psd), axis=-1)
        return shapes[np.argmin(np.abs(spread[:, np.newaxis] - spreads), axis=1)]

    def _background_levels(self, shape: float) -> Array:
        """Return levels of simulated backgrounds, of shape (n_draws, n_series)."""
        if shape not in self._drawn:
            rng = np.random.default_rng(20_111)  # equal input gives equal p-values
            spectra = rng.standard_gamma(shape, (2000, len(self.orders)))
            self._drawn[shape] = self.measure(spectra)[0]
        return self._drawn[shape]


def _from_whole(orders: Array) -> Array:
    """Return the distance of orders from the nearest whole one, but not from 0."""
    return np.asarray(np.abs(orders - np.maximum(np.rint(orders), 1)))


def _peaks(heights: Array, excluded: NDArray[np.bool_] | None = None) -> Array:
    """Return the height of the line at each order, of the shape of `heights` [dB].

    A line between two orders of the axis appears at the higher of both. The skirt of a strong line
    is no line of its own: a harmonic of the shaft would be found at the cage frequency beside it.
    """
    strongest = ndimage.maximum_filter1d(heights, 5, axis=-1, mode="nearest")  # the main lobe
    is_none = heights < strongest - 3.0  # a line between two orders is at least so near at one
    if excluded is not None:
        is_none |= excluded
    own = np.where(is_none, np.minimum(heights, 0.0), heights)
    found: Array = ndimage.maximum_filter1d(own, 3, axis=-1, mode="nearest")
    return found


@lru_cache(maxsize=8)
def _simulated_spreads(width: int) -> tuple[Array, Array]:
    """Return Gamma shapes, and the spread of simulated heights for each of them."""
    rng, shapes = np.random.default_rng(20_111), np.geomspace(0.5, 2000, 120)
    psd = rng.standard_gamma(shapes[:, np.newaxis], (len(shapes), 40_000))
    return shapes, iqr(line_heights(psd, width), axis=-1)


class FaultLines(OrderTableTransformer):
    """Level of the spectral lines of each fault above their local background [dB].

    It replaces `BinTransformer` if the geometry of the machine is known. The levels do not depend
    on the gain of a channel, and not on the slip of the rolling elements, so they can be compared
    between machines.

    Parameters
    ----------
    parts : part, or sequence of parts
        `Bearing`, `Gear`, `Motor` and so on, or a mapping of fault names to orders.
    harmonics : int
        Number of lines of each fault: its order, twice its order, and so on.
    slip : float
        Largest deviation of rolling elements from the predicted orders, as a fraction.
    background : float
        The background of a line is the median of the spectrum within this distance on either side
        [orders].
    channels : sequence of str, optional
        Channels, in this order. Default: all.

    Attributes
    ----------
    channels_ : tuple of str
        Channels that are measured.
    faults_ : tuple of str
        Names of the faults.
    n_features_in_ : int
        Number of columns seen in `fit`.
    feature_names_in_ : ndarray of str
        Their names.

    See Also
    --------
    emacm.find_faults : Names faults without training data.
    emacm.BinTransformer : All orders up to a highest one.

    Notes
    -----
    The level of a fault is the mean over its lines of 10 log10(line / background). One common slip
    for all lines of a fault is chosen such that the level is largest. A defect of a ball strikes
    both rings in each turn, so its lines are at 2, 4, ... times BSF. Noise alone has a level of 1
    to 3 dB, because the largest of several lines is taken.

    The segments should be long: 25 revolutions separate the lines of most bearings. For faults of
    rolling bearings the spectra are those of the envelope (`EnvelopeDetector`). A line that is not
    of damage, such as that of the hunting tooth, is left out where they do not resolve it.

    Columns are named ``channel@BPFI``.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from emacm import FaultLines
    >>> orders = np.arange(0, 10.01, 0.1)
    >>> psd = np.where(np.isin(orders.round(1), [2.5, 5.0]), 100.0, 1.0)
    >>> table = pd.DataFrame([psd], columns=[f"vibration@{order:g}" for order in orders])
    >>> lines = FaultLines({"BPFO": 2.5, "BPFI": 3.5}, harmonics=2).set_output(transform="pandas")
    >>> lines.fit_transform(table)
       vibration@BPFO  vibration@BPFI
    0            20.0             0.0
    """

    def __init__(
        self,
        parts: Parts,
        *,
        harmonics: int = 3,
        slip: float = 0.02,
        background: float = 0.5,
        channels: Sequence[str] | None = None,
    ) -> None:
        self.parts = parts
        self.harmonics = harmonics
        self.slip = slip
        self.background = background
        self.channels = channels

    def fit(self, X: Any, y: Any = None) -> FaultLines:
        """Read the order axis from the columns and locate the lines.

        Parameters
        ----------
        X : table of shape (n_recordings, n_columns)
            Power spectral densities [U²/order], with columns named ``channel@order``.
        y : ignored

        Returns
        -------
        FaultLines
            Itself.

        Raises
        ------
        TypeError, ValueError
            If the columns have no order axis, a line lies outside of it, the spectra are too
            coarse, or a parameter is invalid.
        """
        self._checked_table(X, reset=True)
        blocks = {b.channel: b for b in parse_order_columns(column_names(X) or ()) or ()}
        if not blocks:
            raise ValueError(
                "FaultLines needs order spectra whose columns are named channel@order, as OrderPSD "
                "returns them. Put FaultLines after OrderPSD, or pass a DataFrame with such names."
            )
        self.channels_ = chosen_channels(self.channels, [*blocks])
        check_channel_names([*blocks], self.channels_, "X")
        series = fault_series(self.parts, self.harmonics)
        above = resolved(series, blocks[self.channels_[0]].orders)
        series = tuple(fault for fault in series if fault.of_damage or fault in above)
        self.faults_ = tuple(fault.name for fault in series)
        self._levels = {}
        for channel, orders, columns in (blocks[name] for name in self.channels_):
            measure = LineLevels(orders, series, self.slip, self.background)
            self._levels[channel] = columns, measure
        self._columns_out = tuple(f"{c}@{fault}" for c in self.channels_ for fault in self.faults_)
        return self

    def transform(self, X: Any) -> NDArray[np.float64]:
        """Measure the levels.

        Parameters
        ----------
        X : table of shape (n_recordings, n_columns)
            Power spectral densities [U²/order] over the orders seen in `fit`.

        Returns
        -------
        ndarray of shape (n_recordings, n_channels * n_faults)
            Level of each fault [dB], channel by channel.

        Raises
        ------
        ValueError
            If the columns are not those of `fit`.
        """
        psd = self._checked_table(X, reset=False).astype(np.float64)
        return np.hstack(
            [levels.measure(psd[:, columns])[0] for columns, levels in self._levels.values()]
        )
