"""The third step of a pipeline: order spectra over bins, and spectral lines that are new."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage, sparse

from emacm._checks import check_number, group_codes
from emacm.orders.bins import Band, bin_operator, named_bins
from emacm.orders.columns import (
    BARE_CHANNEL,
    BinPowers,
    OrderBlock,
    OrderTableTransformer,
    column_names,
    parse_order_columns,
)
from emacm.resampling.training_range import warn_of_statements

Array = NDArray[np.float64]


class BinTransformer(OrderTableTransformer):
    """Integrate order spectra over bins.

    The PSD is interpolated linearly between its lines and integrated between the exact edges, so
    the sum of the bins equals the integral of the PSD for any bin size, and a search over
    `bin_size` is not biased.

    Parameters
    ----------
    bin_size : float
        Width of a bin [orders], δb of Chirico.
    max_order : float
        Where the last bin ends [orders]; that bin may be narrower.
    edges : array-like of shape (n_bins + 1,) or mapping of str to (low, high), optional
        User-defined bins in place of `bin_size` and `max_order`: edges of adjacent bins, or named
        bands, such as ``{"BPFI": (6.0, 6.25)}``.
    stop_bands : sequence of (low, high)
        Bands that are removed [orders], exact at their edges: the ideal band-stop filter. A bin
        that lies completely inside a stop band gives no column.
    order_step : float, optional
        Distance between the lines [orders] of a table without an axis. If it is None, such a table
        is assumed to be evenly spaced over 0 to `max_order`.

    Attributes
    ----------
    bins_ : tuple of (low, high)
        Edges of the bins [orders].
    operator_ : sparse array of shape (n_bins_of_all_channels, n_features)
        The operator that is applied to each row.
    line_maxima_ : ndarray of shape (n_features,)
        Largest height of each spectral line over its local background in the training [dB]; inf
        outside of the bins.
    new_line_limits_ : ndarray of shape (n_features,)
        Excess over it [dB] from which a line is stated to be new: at least 4, and exceeded by two
        groups of known recordings in a hundred (`learn_lines`). inf with fewer than five
        recordings or groups.
    n_features_in_ : int
        Number of columns seen in `fit`.
    feature_names_in_ : ndarray of str
        Their names, where they have names.

    See Also
    --------
    emacm.OrderPSD : Spectra that are summed.
    emacm.order_bands : Bins around the orders of a machine's faults.
    emacm.FaultLines : Levels of fault lines over their background.

    Notes
    -----
    The axis is read from columns named ``channel@order``, as returned by `OrderPSD`. The bins are
    named ``channel@low-high``, or ``channel@name``.

    A new spectral line that is weak, or beside a strong one, changes its bin by little. `transform`
    therefore compares each spectral line, relative to the background of its own recording, with its
    maximum in the training, and warns of new ones. How weak a line is recognised depends on the
    noise at its order: of lines at random orders in the vibration of simulated units, with 0.02,
    0.05, 0.1, 0.2 and 0.5 times the amplitude of the whole signal, 9, 29, 63, 68 and 88 %; in their
    current, from 0.01 times on, at least 96 %. A line remains unknown where some state of the
    training has one of that height, and with few units (``benchmarks/unknown.py``).

    Examples
    --------
    >>> import pandas as pd
    >>> from emacm import BinTransformer
    >>> psd = pd.DataFrame([[0.0, 4.0, 0.0, 0.0, 2.0]], columns=[f"current@{k}" for k in range(5)])
    >>> bins = BinTransformer(2, max_order=4).set_output(transform="pandas")
    >>> bins.fit_transform(psd)
       current@0-2  current@2-4
    0          4.0          1.0
    """

    needs_groups = True
    __metadata_request__fit: ClassVar = {"groups": True}  # where metadata routing is enabled

    def __init__(
        self,
        bin_size: float = 1.0,
        *,
        max_order: float = 50.0,
        edges: ArrayLike | Mapping[str, Band] | None = None,
        stop_bands: Sequence[Band] = (),
        order_step: float | None = None,
    ) -> None:
        self.bin_size = bin_size
        self.max_order = max_order
        self.edges = edges
        self.stop_bands = stop_bands
        self.order_step = order_step

    def fit(self, X: Any, y: Any = None, groups: Any = None) -> BinTransformer:
        """Read the axis from the columns, set the bins, and learn the maxima of spectral lines.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_columns)
            Power spectral densities [U²/order].
        y : ignored
        groups : array-like of shape (n_recordings,), optional
            Labels of recordings that were measured together (unit, run): they are left out together
            to determine `new_line_limits_`. None: single recordings are left out; if those of a
            unit are alike, the limits are then too low, and lines of a new unit may be stated.
            A `FeatureUnion` passes groups to its members, at any depth, only with scikit-learn's
            metadata routing (``sklearn.set_config(enable_metadata_routing=True)``): call
            ``set_fit_request(groups=True)`` of the classifier, and ``fit(X, y, groups=units)`` of
            the pipeline.

        Returns
        -------
        BinTransformer
            The estimator itself.

        Raises
        ------
        TypeError, ValueError
            If a parameter is invalid, or bins reach beyond the orders of the spectra.
        """
        psd = self._checked_table(X, reset=True)
        blocks = self._blocks(column_names(X))
        bins = named_bins(self.bin_size, self.max_order, self.edges, self.stop_bands)
        self.bins_ = tuple(bins.values())
        operators = (bin_operator(b.orders, self.bins_, stop_bands=self.stop_bands) for b in blocks)
        self.operator_ = sparse.block_diag([*map(sparse.csr_array, operators)], format="csr")
        self._columns_out = tuple(f"{block.channel}@{name}" for block in blocks for name in bins)
        used = np.asarray(self.operator_.sum(axis=0)).ravel() > 0
        found = learn_lines(psd, blocks, used, groups)
        self.line_maxima_, self.new_line_limits_, self._largest_lines = found
        return self

    def transform(self, X: Any) -> NDArray[np.floating]:
        """Integrate over the bins.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_columns)
            Power spectral densities [U²/order] over the orders seen in `fit`.

        Returns
        -------
        ndarray of shape (n_recordings, n_bins_of_all_channels)
            Mean square within each bin [U²], channel by channel; float32 where `X` is.

        Raises
        ------
        ValueError
            If the columns are not those of `fit`.

        Warns
        -----
        EmacmWarning
            If spectral lines exceed their maximum in the training by more than `new_line_limits_`.
        """
        psd = self._checked_table(X, reset=False)
        warn_of_new_lines(self._new_lines(psd), stacklevel=3)
        return self._integrated(psd)

    def fit_transform(self, X: Any, y: Any = None, groups: Any = None) -> NDArray[np.floating]:
        """Fit, and integrate the same spectra, in which no line is new.

        Parameters
        ----------
        X, y, groups
            As for `fit`.

        Returns
        -------
        ndarray of shape (n_recordings, n_bins_of_all_channels)
            As of `transform`.
        """
        return self.fit(X, y, groups)._integrated(self._checked_table(X, reset=False))

    def _integrated(self, psd: NDArray[np.floating]) -> BinPowers:
        """Return the bins of checked spectra."""
        # Summed in float64 in any case. The type, as the dtype of an order table has metadata.
        with np.errstate(over="ignore"):
            powers = np.ascontiguousarray((self.operator_ @ psd.T).T, dtype=psd.dtype.type)
        names = self.get_feature_names_out()
        if not np.isfinite(powers).all():
            row, column = np.argwhere(~np.isfinite(powers))[0]
            raise ValueError(
                f"the integral over recording {row}, bin {str(names[column])!r}, exceeds the range "
                f"of {powers.dtype}. State the channels in other units."
            )
        return BinPowers(powers, names.tolist())

    def _new_lines(self, psd: NDArray[np.floating]) -> list[list[str]]:
        """Return statements on new lines of each recording."""
        if np.isinf(self.new_line_limits_).all():
            return []
        known = self.line_maxima_, self.new_line_limits_, self._largest_lines
        return state_new_lines(psd, known, self._blocks(getattr(self, "feature_names_in_", None)))

    def _blocks(self, names: Sequence[Any] | None) -> tuple[OrderBlock, ...]:
        """Return the order axis of each channel."""
        blocks = None if names is None else parse_order_columns(names)
        step = self.order_step
        if step is not None:
            step = check_number(step, "order_step", above=0, unit="orders")
        if blocks is None:
            if step is None:
                top = check_number(self.max_order, "max_order", above=0, unit="orders")
                step = top / (self.n_features_in_ - 1)
            orders = step * np.arange(self.n_features_in_, dtype=np.float64)
            return (OrderBlock(BARE_CHANNEL, orders, slice(0, self.n_features_in_)),)
        for block in blocks:
            steps = np.diff(block.orders)
            if step is not None and not np.allclose(steps, step, rtol=1e-9, atol=0):
                other = steps[np.argmax(np.abs(steps - step))]
                raise ValueError(
                    f"order_step = {step:g} contradicts the columns of {block.channel!r}, where "
                    f"orders lie {other:g} apart. Leave order_step out."
                )
        return blocks


@dataclass(frozen=True)
class NewLineSettings:
    """What a new line is; ``benchmarks/unknown.py`` chose the values, on simulated units.

    The local background, over which heights are measured, depends neither on load, speed, gain nor
    state. It is the lower quartile of the lines around one; wider structures fill bins, which show
    them.

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


_collected: ContextVar[dict[int, list[str]] | None] = ContextVar("_collected", default=None)


def learn_lines(
    psd: NDArray[np.floating],
    blocks: Sequence[OrderBlock],
    compared: NDArray[np.bool_],
    groups: Any = None,
) -> tuple[Array, Array, Array]:
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
    maxima : ndarray of shape (n_columns,)
        Largest height over the local background at each order [dB], at least -20; inf where lines
        are not compared: outside of the bins, and in channels without power or with negative
        values, which are no power spectra.
    limits : ndarray of shape (n_columns,)
        Excess over it from which a line is new [dB], at least 4; inf with fewer than five groups.
    largest : ndarray of shape (n_channels,)
        Largest line of each channel, in the unit of the spectra.

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
    maxima, limits = np.full((2, psd.shape[1]), np.inf)
    excess: Any = -np.inf
    for block in blocks:
        own, used = psd[:, block.columns], compared[block.columns]
        if not used.any() or own.max() <= 0 or own.min() < 0:
            continue
        heights = _heights(own, block.orders)
        highest = heights
        if codes is not None:
            highest = pd.DataFrame(heights).groupby(codes).max().to_numpy()
        maxima[block.columns] = np.where(used, highest.max(axis=0), np.inf)
        if len(highest) >= SETTINGS.fewest:
            spread, left_out = _left_out(highest)
            limits[block.columns] = np.where(used, spread, np.inf)
            excess = np.maximum(excess, left_out[:, used].max(axis=1))
    if np.ndim(excess):
        learned = np.isfinite(limits)
        limits[learned] = np.maximum(_limit(excess) * limits[learned], SETTINGS.least)
    return maxima, limits, largest


def state_new_lines(
    psd: NDArray[np.floating],
    known: tuple[Array, Array, Array],
    blocks: Sequence[OrderBlock],
) -> list[list[str]]:
    """State at which orders recordings have lines that the training does not have.

    Parameters
    ----------
    psd : ndarray of shape (n_recordings, n_columns)
        Power spectral densities.
    known : maxima, limits, largest
        As of `learn_lines`.
    blocks : sequence of OrderBlock
        Columns of each channel.

    Returns
    -------
    list of list of str
        Of each recording, the line that is farthest above the maximum first.
    """
    found: list[list[tuple[float, str]]] = [[] for _ in psd]
    for block, largest in zip(blocks, known[2], strict=True):
        maxima, limits = known[0][block.columns], known[1][block.columns]
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
def collected_statements() -> Iterator[dict[int, list[str]]]:
    """Collect the statements about new lines that would otherwise be warnings.

    By number of the recording, of the same recordings, which are transformed within the block.
    """
    found: dict[int, list[str]] = defaultdict(list)
    token = _collected.set(found)
    try:
        yield found
    finally:
        _collected.reset(token)


def warn_of_new_lines(statements: Sequence[Sequence[str]], *, stacklevel: int) -> None:
    """Warn once of all recordings with new lines, unless the statements are being collected."""
    found = _collected.get()
    if found is not None:
        for number, own in enumerate(statements):
            found[number] += [text for text in own if text not in found[number]]
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
            first, last = block.orders[[start, stop - 1]]
            where, up_to = f"orders {first:.4g} to {last:.4g}", "up to "
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
