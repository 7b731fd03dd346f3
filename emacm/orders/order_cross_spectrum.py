"""Cross spectra, coherence and response of channels over orders, as a step of a pipeline."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_choice
from emacm.orders.bins import bin_operator, named_bins
from emacm.orders.columns import OrderTable, order_columns
from emacm.orders.segment_plan import SegmentPlan, WeightedLines, padded_lines
from emacm.orders.welch import WelchEstimator, samples_per_revolution
from emacm.recordings.inputs import for_each
from emacm.resampling.angle_recording import (
    AngleRecording,
    AngleStroke,
    as_angle_recordings,
    check_alike,
    separates_directions,
)

Pair = tuple[int, int]
Complex = NDArray[np.complexfloating]
Part = tuple[str, Callable[[Any], NDArray[np.floating]]]


KINDS = ("response", "coherence", "cross")


# The real columns of a complex quantity.
FORMS: dict[str, tuple[Part, ...]] = {
    "rectangular": (("real", np.real), ("imag", np.imag)),
    "polar": (("magnitude", np.abs), ("phase", np.angle)),
    "log": (("log", lambda values: np.log(np.abs(values))), ("phase", np.angle)),
}


@dataclass(frozen=True, eq=False)
class CrossAverages:
    """Averages over segments of channels and of pairs of channels, by Welch's method.

    `cross_averages` makes them. Coherence and response are ratios of averages, so lines within a
    bin are summed before, by `gathered`.

    Attributes
    ----------
    power : ndarray of shape (n_channels, n_orders)
        Power spectral densities S_xx [U²/order].
    cross : ndarray of shape (n_pairs, n_orders)
        Cross-spectral densities S_xy of input and output, complex [U_x U_y/order].
    pairs : tuple of (int, int)
        Input and output channel of each pair.
    n_segments : int
        Number of segments averaged.
    channels : sequence of str
        Names of the channels, for messages.
    """

    power: NDArray[np.floating]
    cross: Complex
    pairs: tuple[Pair, ...]
    n_segments: int
    channels: Sequence[str]

    def gathered(self, operator: Any) -> CrossAverages:
        """Return the averages integrated over bins.

        Parameters
        ----------
        operator : ndarray or sparse array of shape (n_bins, n_orders)
            Weights of the lines, such as `emacm.orders.bins.bin_operator` makes them.

        Returns
        -------
        CrossAverages
            With bins in place of orders.
        """
        power, cross = self.power @ operator.T, self.cross @ operator.T
        return replace(self, power=power, cross=cross)

    def coherence(self) -> NDArray[np.floating]:
        """Return the magnitude-squared coherence ``|S_xy|² / (S_xx S_yy)``.

        Returns
        -------
        ndarray of shape (n_pairs, n_orders)
            From 0 to 1; 0 where either has no power (as at order 0 if the mean was removed).

        Raises
        ------
        ValueError
            If there is a single segment, or a channel has no power at all.
        """
        if self.n_segments < 2:
            raise ValueError(
                "coherence of a single segment is 1 for any signals; at least two segments are "
                "needed, better ten. Lower revolutions (or n_per_segment), or raise overlap."
            )
        of_x, of_y = (self._ratios(side) for side in (0, 1))
        # Divided one by one, as the product of small powers may be 0.
        return np.minimum(np.abs(of_x) * np.abs(of_y), 1.0)

    def response(self) -> Complex:
        """Return the frequency response from input to output, ``H1 = S_xy / S_xx``.

        Returns
        -------
        ndarray of shape (n_pairs, n_orders)
            Complex [U_y/U_x]; 0 where the input has no power.

        Raises
        ------
        ValueError
            If an input has no power at all.
        """
        return self._ratios(0)

    def columns(self, kinds: Sequence[str], form: str) -> NDArray[np.floating]:
        """Return quantities of the pairs as real numbers.

        Parameters
        ----------
        kinds : sequence of {"response", "coherence", "cross"}
            Quantities.
        form : {"rectangular", "polar", "log"}
            The columns of complex quantities.

        Returns
        -------
        ndarray of shape (n_pairs, n_quantities, n_orders)
        """
        found: list[NDArray[np.floating]] = []
        for kind in kinds:
            if kind == "coherence":
                found.append(self.coherence())
            else:
                values = self.response() if kind == "response" else self.cross
                found += [part(values) for _, part in FORMS[form]]
        return np.stack(found, axis=1)

    def _ratios(self, side: int) -> Complex:
        """Cross spectra divided by the powers of the inputs (0) or the outputs (1)."""
        channels = [pair[side] for pair in self.pairs]
        power = self.power[channels]
        strongest = power.max(axis=1, keepdims=True)
        if not strongest.all():
            dead = self.channels[channels[int(np.argmin(strongest))]]
            raise ValueError(
                f"channel {dead!r} has no power at any order, so neither response nor coherence "
                f"exists. Check its sensor, or leave the channel out."
            )
        present = power > 1e-28 * strongest  # less is due to rounding errors
        return np.divide(self.cross, power, out=np.zeros_like(self.cross), where=present)


def cross_averages(
    plan: SegmentPlan,
    segments: Iterable[WeightedLines],
    pairs: Sequence[Pair],
    channels: Sequence[str],
) -> CrossAverages:
    """Average products of channels over segments [1]_.

    Parameters
    ----------
    plan : SegmentPlan
        How signals are cut; its `average` has no effect, the mean is used.
    segments : iterable of (lines, weight)
        What its `lines_of` or `padded_lines` yield for signals, such as the strokes of a
        recording, at least one segment; read one at a time.
    pairs : sequence of (int, int)
        Input and output channel of each pair.
    channels : sequence of str
        Names of the channels, for messages.

    Returns
    -------
    CrossAverages

    References
    ----------
    .. [1] J. S. Bendat and A. G. Piersol, Random Data, 4th ed., Wiley, 2010, ch. 6 and 11.
    """
    power: Any = 0.0
    cross: Any = 0.0
    total, n_segments = 0.0, 0
    for lines, weight in segments:
        power = power + (lines.real**2 + lines.imag**2).sum(axis=1)
        # The input is conjugated, as in scipy.signal.csd.
        cross = cross + np.stack(
            [np.einsum("so,so->o", lines[x].conj(), lines[y]) for x, y in pairs]
        )
        total, n_segments = total + weight, n_segments + lines.shape[1]
    scale = plan.sides / total
    return CrossAverages(power * scale, cross * scale, tuple(pairs), n_segments, channels)


class OrderCrossSpectrum(WelchEstimator):
    """Estimate cross spectra, coherence or frequency response of channels over orders.

    By Welch's method, as `OrderPSD`, with a Hann window; the mean of each segment is removed, which
    also distorts the first two spectral lines. The phase between two channels does not depend on
    the absolute shaft angle: the same fault gives the same features after another assembly.

    Parameters
    ----------
    revolutions : float
        Length of a segment; the distance between spectral lines is 1/revolutions orders.
    pairs : sequence of (str, str), optional
        Input and output channels. Default: all pairs, the input being the channel that comes first.
        Channels in no pair are not resampled.
    kind : {"response", "coherence", "cross"} or sequence of these
        "response" is H1 = S_xy / S_xx [U_y/U_x], "coherence" the magnitude-squared one, "cross" the
        cross-spectral density S_xy [U_x U_y/order]. Several take no more time than one.
    form : {"rectangular", "polar", "log"}
        Columns of complex kinds: real and imaginary part, magnitude and phase [rad], or natural
        logarithm of the magnitude and phase. Phase wraps at ±π, so averages over recordings are
        biased there; "rectangular" has no such discontinuity.
    bin_size : float, optional
        Width of bins [orders], up to `max_order`. Power and cross spectra are integrated over the
        bins before ratios are formed.
    overlap : float
        Fraction of a segment that overlaps the next one, in [0, 1).
    by_direction : bool or "auto"
        Separate columns for forward and reverse strokes, ``…+@…`` and ``…-@…``.
    short : {"raise", "pad"}
        For a recording whose strokes are all shorter than a segment: an error, or an
        estimate in which each stroke, padded with zeros, is one segment weighted by its length.
    max_order : float, optional
        Highest order of interest: where bins end, or above which lines are omitted.
    n_jobs : int, optional
        Number of recordings processed in parallel, under joblib's active backend (by default,
        threads).

    Attributes
    ----------
    pairs_ : tuple of (str, str)
        Input and output of each pair.
    channels_ : tuple of str
        Channels that are read.
    orders_ : ndarray of shape (n_orders,)
        Orders of the lines.
    bins_ : tuple of (low, high), or None
        Edges of the bins [orders].
    n_per_segment_ : int
        Samples of a segment.
    theta_s_ : float
        Angle between samples [rad].

    See Also
    --------
    emacm.OrderPSD : Power of each channel.

    Notes
    -----
    `X` is what `OrderResampler` returns. Recordings are resampled one at a time, in blocks.

    Columns are named ``input*output:quantity@order``, or ``@low-high`` in bins: pair by pair, and
    for each pair the kinds in the given order, such as ``current*error:response.real@1`` or
    ``current*error:coherence@1``; with `by_direction` ``current*error:coherence+@1``.

    `BinTransformer` may follow ``kind="cross", form="rectangular"``, which can be integrated. An
    integral of coherence or response over lines gives all lines the same weight, also those without
    power; set `bin_size` here instead.

    For n independent segments of uncorrelated noise, coherence is 1/n on average; for a single one
    it is always 1, which is refused. Recordings with more segments have less of this bias: compare
    recordings of about equal length. Noise at the input biases the response towards 0.

    Bins should be narrow compared with 1/delay: where one channel lags by a revolution, the phase
    changes by 2π within one order, and the cross spectrum of a bin of that width cancels.

    The phase of a reverse stroke is taken along its own motion: a channel that is later in time
    lags there too.

    Source: Bendat and Piersol, Random Data, 4th ed., Wiley, 2010, ch. 6 and 11.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import OrderCrossSpectrum, OrderResampler, Recording
    >>> speed = np.full(20_000, 60.0)
    >>> torque = np.random.default_rng(0).standard_normal(20_000)
    >>> run = Recording({"torque": torque, "current": 4 * torque}, 1000, velocity=speed)
    >>> over_angle = OrderResampler().fit_transform([run])
    >>> cross = OrderCrossSpectrum(8, bin_size=2, max_order=4).set_output(transform="pandas")
    >>> cross.fit_transform(over_angle).round(3).iloc[:, :2]
       torque*current:response.real@0-2  torque*current:response.real@2-4
    0                               4.0                               4.0
    """

    def __init__(
        self,
        revolutions: float = 16,
        *,
        pairs: Sequence[tuple[str, str]] | None = None,
        kind: str | Sequence[str] = "response",
        form: str = "rectangular",
        bin_size: float | None = None,
        overlap: float = 0.5,
        by_direction: bool | str = False,
        short: str = "raise",
        max_order: float | None = None,
        n_jobs: int | None = None,
    ) -> None:
        self.revolutions = revolutions
        self.pairs = pairs
        self.kind = kind
        self.form = form
        self.bin_size = bin_size
        self.overlap = overlap
        self.by_direction = by_direction
        self.short = short
        self.max_order = max_order
        self.n_jobs = n_jobs

    def fit(self, X: Any, y: Any = None) -> OrderCrossSpectrum:
        """Set pairs and order axis; no spectrum is estimated.

        Parameters
        ----------
        X : list of AngleRecording
            Recordings over shaft angle.
        y : ignored

        Returns
        -------
        OrderCrossSpectrum
            The estimator itself.

        Raises
        ------
        TypeError, ValueError
            If a parameter or X is invalid.
        """
        rows = as_angle_recordings(X, "OrderCrossSpectrum")
        self.by_direction_ = separates_directions(self.by_direction, rows)
        self.theta_s_ = rows[0].theta_s
        self.pairs_ = _checked_pairs(self.pairs, rows[0].channels)
        self.channels_ = tuple(dict.fromkeys(name for pair in self.pairs_ for name in pair))
        self._names_in, self._n_in = rows[0].channels, len(rows[0].channels)
        self._kinds = tuple(np.atleast_1d(self.kind).tolist())
        for kind in self._kinds:
            check_choice(kind, "kind", KINDS)
        if not 0 < len({*self._kinds}) == len(self._kinds):
            raise ValueError(f"kind must name one or more of {KINDS}, each once, got {self.kind}.")
        self._form = check_choice(self.form, "form", tuple(FORMS))
        self._set_plan(samples_per_revolution(self.theta_s_))
        self._check_rows(rows)
        self.bins_, self._operator = None, None
        self._columns_out = order_columns(self._quantities(), self.orders_)
        if self.bin_size is not None:
            top = self.orders_[-1] if self.max_order is None else self.max_order
            bins = named_bins(self.bin_size, top, None, ())
            self.bins_ = tuple(bins.values())
            self._operator = sparse.csr_array(bin_operator(self.orders_, self.bins_))
            self._columns_out = tuple(f"{name}@{b}" for name in self._quantities() for b in bins)
        return self

    def transform(self, X: Any) -> NDArray[np.floating]:
        """Estimate the quantities of the pairs, one recording at a time.

        Parameters
        ----------
        X : list of AngleRecording
            Recordings at the theta_s of `fit` that have its channels.

        Returns
        -------
        ndarray of shape (n_recordings, n_columns)
            Without bins an OrderTable, whose ``columns`` name the orders.

        Raises
        ------
        TypeError, ValueError
            If a recording lacks a channel, has another theta_s, holds no segment (for coherence:
            two), or if a channel has no power at all. The message gives its number.
        """
        check_is_fitted(self)
        rows = as_angle_recordings(X, "OrderCrossSpectrum")
        self._check_rows(rows)
        table = np.stack(for_each(self._estimate, rows, self.n_jobs)).reshape(len(rows), -1)
        return table if self.bins_ is not None else OrderTable(table, self._columns_out)

    def __sklearn_tags__(self) -> Any:
        """Declare that X is not a 2-D table."""
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False
        return tags

    def _check_rows(self, rows: list[AngleRecording]) -> None:
        known = self.channels_, self.theta_s_, "OrderCrossSpectrum"
        check_alike(rows, *known, by_direction=self.by_direction_, exactly=False)

    def _estimate(self, row: AngleRecording) -> NDArray[np.floating]:
        """Estimate one recording, shape (n_pairs, n_quantities, n_directions, n_orders)."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            kinds = row.strokes_by_kind(self.plan_.by_direction)
            averages = [self._averages(row, strokes, kind) for kind, strokes in kinds]
            columns = np.stack([a.columns(self._kinds, self._form) for a in averages], axis=2)
        if not np.all(np.isfinite(columns)):
            raise ValueError(
                "some value exceeds the range of float64, or is the logarithm of 0. State the "
                "channels in other units, or use form='rectangular'."
            )
        return columns

    def _averages(
        self, row: AngleRecording, strokes: Sequence[AngleStroke], kind: str
    ) -> CrossAverages:
        """Average over the strokes that hold a segment, resampling them one block at a time."""
        plan, peaks = self.plan_, np.zeros(len(self.channels_))
        rows = [row.channels.index(name) for name in self.channels_]
        signals = [_with_peaks(stroke.blocks(rows), peaks) for stroke in strokes]
        lengths = [stroke.n_angles for stroke in strokes]
        whole, short = plan.usable(signals, lengths, kind, "OrderCrossSpectrum")
        segments = padded_lines(plan, short) if short else plan.lines_of(whole)
        places = {name: place for place, name in enumerate(self.channels_)}
        pairs = [(places[x], places[y]) for x, y in self.pairs_]
        averages = cross_averages(plan, segments, pairs, self.channels_)
        # Once its mean is removed, only the errors of resampling (1e-8 of its value, assumed) and
        # four rounding errors are left of a constant: it counts as no power.
        errors = max(1e-8, 4 * float(np.finfo(row.dtype).eps)) * peaks
        stuck = averages.power.max(axis=1) <= errors**2
        averages = replace(averages, power=np.where(stuck[:, np.newaxis], 0.0, averages.power))
        return averages if self._operator is None else averages.gathered(self._operator)

    def _quantities(self) -> list[str]:
        """Return the names of the columns up to the @, in order."""
        parts = [name for name, _ in FORMS[self._form]]
        names = [
            name
            for kind in self._kinds
            for name in ([kind] if kind == "coherence" else [f"{kind}.{part}" for part in parts])
        ]
        signs = "+-" if self.by_direction_ else ("",)
        return [f"{x}*{y}:{name}{sign}" for x, y in self.pairs_ for name in names for sign in signs]


def _with_peaks(
    blocks: Iterable[NDArray[np.floating]], peaks: NDArray[np.floating]
) -> Iterator[NDArray[np.floating]]:
    """Yield the blocks, and keep the largest magnitude of each channel in `peaks`."""
    for block in blocks:
        np.maximum(peaks, np.abs(block).max(axis=1, initial=0.0), out=peaks)
        yield block


def _checked_pairs(pairs: Any, channels: Sequence[str]) -> tuple[tuple[str, str], ...]:
    listed = list(combinations(channels, 2)) if pairs is None else pairs
    is_list = np.iterable(listed) and not any(isinstance(pair, str) for pair in listed)
    checked = tuple(map(tuple, listed)) if is_list else ()
    wrong = [p for p in checked if len(p) != 2 or p[0] == p[1] or not {*p} <= {*channels}]
    if wrong or not checked or len(set(checked)) < len(checked):
        raise ValueError(
            f"pairs must name one or more pairs of two of the channels {list(channels)}, each "
            f"once, as [('torque', 'current')]; got {pairs!r}."
        )
    return checked
