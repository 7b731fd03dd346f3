"""Power spectral density over orders, by Welch's method over the shaft angle."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import scipy  # which imports scipy.signal, a tenth of a second, when it is used
from numpy.typing import ArrayLike, NDArray
from scipy import fft

from emacm._checks import (
    check_choice,
    check_count,
    check_finite,
    check_number,
    check_real_array,
)
from emacm._kernels import kernels
from emacm.orders.fourier import segments_at_once, summed_powers
from emacm.shaft.motion import parts

# Whole, or in blocks that continue one another; shape (n_channels, n_angles).
Signal = NDArray[np.floating] | Iterable[NDArray[np.floating]]
Stretch = tuple[NDArray[np.floating], int, int]
Lines = NDArray[np.complexfloating]  # shape (n_rows, n_segments, n_lines)
WeightedLines = tuple[Lines, float]

DETRENDS = ("constant", "linear", None, False)
SCALINGS = ("density", "spectrum")
AVERAGES = ("mean", "median")
SHORTS = ("raise", "pad")

_MOST_SAMPLES = 1 << 31  # of a segment


@dataclass(frozen=True, eq=False)
class SegmentPlan:
    """How signals over the angle are cut, windowed, transformed and averaged.

    `segment_plan` makes one from what a user states; it answers for its own axis.

    Attributes
    ----------
    samples_per_rev : float
        Samples per shaft revolution, 2π/theta_s.
    n_per_segment : int
        Samples of a segment, L in Chirico, Eqs. (2.14) to (2.22).
    step : int
        Samples from one segment to the next.
    window : str, tuple or array
        As for `scipy.signal.get_window`, or the window itself.
    detrend : {"constant", "linear", None, False}
        What is taken out of each segment.
    scaling : {"density", "spectrum"}
        Unit² per order, or unit².
    average : {"mean", "median"}
        How segments are joined.
    n_orders : int
        Lines that are kept, from order 0 upwards.
    """

    samples_per_rev: float
    n_per_segment: int
    step: int
    window: Any
    detrend: Any
    scaling: str
    average: str
    n_orders: int

    @property
    def order_step(self) -> float:
        """Distance of two spectral lines [orders]."""
        return self.samples_per_rev / self.n_per_segment

    @property
    def orders(self) -> NDArray[np.floating]:
        """Orders of the spectral lines, shape (n_orders,)."""
        # Multiplied first, so that 3 lines of 1/10 order lie at 0.3 and not beside it.
        return np.arange(self.n_orders) * self.samples_per_rev / self.n_per_segment

    @property
    def revolutions(self) -> float:
        """True length of a segment [revolutions]."""
        return self.n_per_segment / self.samples_per_rev

    def average_of(self, signals: Iterable[Signal]) -> NDArray[np.floating]:
        """Average the spectra of all segments of all signals.

        Parameters
        ----------
        signals : iterable of ndarray of shape (n_channels, n_angles), or of their blocks
            Signals over uniform angles, such as the strokes of a recording, each whole or as
            an iterable of blocks that continue one another. No segment spans two signals;
            what is shorter than a segment is passed over. They are looked at one at a time.

        Returns
        -------
        psd : ndarray of shape (n_channels, n_orders)
            In float64, of float32 signals too: powers span more digits than signals.

        Raises
        ------
        ValueError
            If no signal holds a segment.
        """
        window = _window_values(self.window, self.n_per_segment)
        kept: list[NDArray[np.floating]] = []
        count = 0
        for stretch, first, n_segments in self._stretches(signals):
            count += n_segments
            at_once = segments_at_once(stretch[:1], self.n_per_segment)
            groups = [stretch[i : i + at_once] for i in range(0, len(stretch), at_once)]
            power = _joined([self._powers(rows, first, n_segments, window) for rows in groups])
            del stretch, groups  # before the next one is made
            if kept and self.average == "mean":
                power += kept.pop()
            kept.append(power)
        if not kept:
            raise ValueError(f"no signal holds a segment of {self.n_per_segment} samples.")
        if self.average == "median":
            psd = np.median(np.concatenate(kept, axis=1), axis=1) / _median_bias(count)
        else:
            psd = kept[0] / count
        return psd * (self.sides / self._window_factor(window))

    def padded(self, signals: Iterable[NDArray[np.floating]]) -> NDArray[np.floating]:
        """Estimate from signals that are shorter than a segment.

        Each is windowed over its own length and padded with zeros; powers and
        window factors are summed before they are divided, so that a signal
        counts by its length. `average` has no say: there is one spectrum a signal.

        Parameters
        ----------
        signals : iterable of ndarray of shape (n_channels, n_angles)
            Signals of at most `n_per_segment` samples.

        Returns
        -------
        psd : ndarray of shape (n_channels, n_orders)

        Raises
        ------
        ValueError
            If none has two samples, or the window is an array (which has no
            shorter form).
        """
        power, total = None, 0.0
        for lines, weight in self.padded_lines(signals):
            part = np.abs(lines[:, 0]) ** 2
            power = part if power is None else power + part
            total += weight
        if power is None:
            raise ValueError("no stroke has two samples.")
        return power * (self.sides / total)

    def lines_of(self, signals: Iterable[Signal]) -> Iterator[WeightedLines]:
        """Yield the Fourier transforms of all segments, those of all channels together.

        A product of lines, summed over all segments, divided by the sum of the weights and
        multiplied by `sides`, is a spectral density (or spectrum, as `scaling` says).

        Parameters
        ----------
        signals : iterable of ndarray of shape (n_channels, n_angles), or of their blocks
            As for `average_of`.

        Yields
        ------
        lines : ndarray of shape (n_channels, n_segments, n_orders)
            Of a few segments at a time.
        weight : float
            Their weight.
        """
        window = _window_values(self.window, self.n_per_segment)
        factor = self._window_factor(window)
        for stretch, first, n_segments in self._stretches(signals):
            for lines in self._lines(stretch, first, n_segments, window):
                yield lines, factor * lines.shape[1]
            del stretch  # before the next one is made

    def padded_lines(self, signals: Iterable[NDArray[np.floating]]) -> Iterator[WeightedLines]:
        """Yield the Fourier transform of each signal, padded with zeros to a segment.

        Parameters
        ----------
        signals : iterable of ndarray of shape (n_channels, n_angles)
            Signals of at most `n_per_segment` samples; less than two are passed over.

        Yields
        ------
        lines : ndarray of shape (n_channels, 1, n_orders)
        weight : float
            As in `lines_of`.

        Raises
        ------
        ValueError
            If the window is an array, which has no shorter form.
        """
        for signal in signals:
            n_angles = signal.shape[-1]
            if n_angles < 2:
                continue
            if not isinstance(self.window, str | tuple):
                raise ValueError(
                    "short='pad' needs a window by name, as an array cannot be shortened."
                )
            window = scipy.signal.get_window(self.window, n_angles)
            lines = fft.rfft(_detrended(signal, self.detrend) * window, self.n_per_segment)
            yield lines[:, np.newaxis, : self.n_orders], self._window_factor(window)

    def _stretches(self, signals: Iterable[Signal]) -> Iterator[Stretch]:
        """Yield stretches of the signals, where segments begin in them, and how many."""
        length, step = self.n_per_segment, self.step
        for signal in signals:
            rest: NDArray[np.floating] | None = None
            for block in _at_least([signal] if isinstance(signal, np.ndarray) else signal, length):
                first = 0  # in the block, of the segments that lie wholly inside
                if rest is not None and block.nbytes <= kernels().SEGMENT_BYTES:
                    block, rest = np.concatenate([rest, block], axis=1), None
                if rest is not None:
                    # Segments that begin in the rest; only they are copied together.
                    first = -rest.shape[1] % step
                    joined = np.concatenate([rest, block[:, : first - step + length]], axis=1)
                    count = (joined.shape[1] - length) // step + 1
                    if count > 0:
                        yield joined, 0, count
                count = max(0, (block.shape[1] - first - length) // step + 1)
                if count:
                    yield block, first, count
                rest = block[:, first + count * step :].copy()
                del block  # before the next one is made

    def _powers(
        self,
        rows: NDArray[np.floating],
        first: int,
        n_segments: int,
        window: NDArray[np.floating],
    ) -> NDArray[np.floating]:
        """Squared lines, summed over segments or, for the median, of each.

        Shape (n_rows, n_orders) or (n_rows, n_segments, n_orders).
        """
        if self.average == "mean" and self.detrend != "linear":
            remove_mean = self.detrend == "constant"
            return summed_powers(
                rows, first, self.step, window, n_segments, self.n_orders, remove_mean=remove_mean
            )
        found = self._lines(rows, first, n_segments, window)
        if self.average == "mean":
            return sum(kernels().powers(lines) for lines in found)
        wanted = np.concatenate(list(found), axis=1)
        return wanted.real.astype(np.float64) ** 2 + wanted.imag.astype(np.float64) ** 2

    def _lines(
        self,
        rows: NDArray[np.floating],
        origin: int,
        n_segments: int,
        window: NDArray[np.floating],
    ) -> Iterator[Lines]:
        """Yield the Fourier transforms of a few segments of each row at a time."""
        window = window.astype(rows.dtype, copy=False)
        for start, stop in parts(0, n_segments, segments_at_once(rows, self.n_per_segment)):
            first, count = origin + start * self.step, stop - start
            if self.detrend == "linear":
                ones = np.ones_like(window)
                segments = kernels().windowed(rows, first, self.step, ones, count, False)
                segments = scipy.signal.detrend(segments, axis=-1, type="linear") * window
            else:
                remove_mean = self.detrend == "constant"
                segments = kernels().windowed(rows, first, self.step, window, count, remove_mean)
            yield fft.rfft(segments, overwrite_x=True)[..., : self.n_orders]

    def _window_factor(self, window: NDArray[np.floating]) -> float:
        # Eq. (2.18) of Chirico with (2.14) and (2.22); T_p there is L over the sampling rate.
        if self.scaling == "density":
            return float(self.samples_per_rev * (window @ window))
        return float(np.sum(window) ** 2)

    @property
    def sides(self) -> NDArray[np.floating]:
        """Weights that fold the two-sided spectrum over, Eqs. (2.20) and (2.21) of Chirico."""
        sides = np.full(self.n_orders, 2.0)
        sides[0] = 1.0
        if 2 * (self.n_orders - 1) == self.n_per_segment:
            sides[-1] = 1.0  # the line at half the sampling rate has no twin
        return sides


def segment_plan(
    samples_per_rev: float,
    *,
    revolutions: float = 16,
    n_per_segment: int | None = None,
    window: Any = "hann",
    overlap: float = 0.5,
    detrend: Any = "constant",
    scaling: str = "density",
    average: str = "mean",
    max_order: float | None = None,
) -> SegmentPlan:
    """Check the options of Welch's method and work out its segments.

    Parameters are those of `order_psd`.

    Returns
    -------
    SegmentPlan

    Raises
    ------
    TypeError, ValueError
        If an option is not what it should be.
    """
    samples_per_rev = check_number(samples_per_rev, "samples_per_rev", above=0)
    length = _segment_length(samples_per_rev, revolutions, n_per_segment)
    overlap = check_number(overlap, "overlap", at_least=0, below=1)
    check_choice(detrend, "detrend", DETRENDS)
    check_choice(scaling, "scaling", SCALINGS)
    check_choice(average, "average", AVERAGES)
    n_orders = length // 2 + 1
    if max_order is not None:
        top = check_number(max_order, "max_order", at_least=0, unit="orders")
        # The line at or above the limit stays, so that bins up to the limit can be integrated.
        n_orders = min(n_orders, int(np.ceil(top * length / samples_per_rev - 1e-9)) + 1)
    _window_values(window, length)
    step = length - min(int(overlap * length), length - 1)
    return SegmentPlan(samples_per_rev, length, step, window, detrend, scaling, average, n_orders)


def samples_per_revolution(theta_s: float) -> float:
    """Return 2π/theta_s, exactly whole where it is whole but for rounding.

    Parameters
    ----------
    theta_s : float
        Angle between samples [rad].

    Returns
    -------
    float

    Examples
    --------
    >>> import numpy as np
    >>> 2 * np.pi / (2 * np.pi / 100), samples_per_revolution(2 * np.pi / 100)
    (99.99999999999999, 100.0)
    """
    samples = 2 * np.pi / check_number(theta_s, "theta_s", above=0, unit="rad per sample")
    whole = np.rint(samples)
    return float(whole if abs(samples - whole) <= 1e-14 * samples else samples)


def order_psd(
    signal: ArrayLike,
    samples_per_rev: float,
    *,
    revolutions: float = 16,
    n_per_segment: int | None = None,
    window: Any = "hann",
    overlap: float = 0.5,
    detrend: Any = "constant",
    scaling: str = "density",
    average: str = "mean",
    max_order: float | None = None,
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Estimate the order power spectral density by Welch's method [1]_.

    Parameters
    ----------
    signal : array-like of shape (..., n_angles)
        Signal at uniform shaft angles, in any unit U.
    samples_per_rev : float
        Samples per shaft revolution, 2π/theta_s.
    revolutions : float
        Length of a segment; lines lie 1/revolutions apart (to the nearest
        whole number of samples).
    n_per_segment : int, optional
        Length of a segment in samples, in place of `revolutions`.
    window : str, tuple or array-like of shape (n_per_segment,)
        As for `scipy.signal.get_window`. "hann" is Chirico, Eq. (2.17).
    overlap : float
        Share of a segment that the next one has in common with it, in [0, 1).
    detrend : {"constant", "linear", None, False}
        What is taken out of each segment. "constant" bends the first two
        lines, so bins of interest should start above them.
    scaling : {"density", "spectrum"}
        "density" [U²/order] integrates to the mean square. In "spectrum" [U²]
        a tone of amplitude A reads A²/2, and lines must not be summed.
    average : {"mean", "median"}
        "median" is less moved by single shocks (and corrected for its bias on
        noise, as in `scipy.signal.welch`).
    max_order : float, optional
        Highest order of interest: lines above the first one at or above it are cut.

    Returns
    -------
    orders : ndarray of shape (n_orders,)
        Orders, in cycles per revolution.
    psd : ndarray of shape (..., n_orders)
        Power spectral density [U²/order], or power spectrum [U²].

    Raises
    ------
    TypeError, ValueError
        If an option is not what it should be, or the signal holds no segment.

    References
    ----------
    .. [1] P. D. Welch, IEEE Trans. Audio Electroacoust. 15(2), 70-73, 1967;
       Chirico, Eqs. (2.14) to (2.22).

    Examples
    --------
    >>> import numpy as np
    >>> angle = 2 * np.pi / 64 * np.arange(64 * 100)
    >>> orders, psd = order_psd(3 * np.sin(7 * angle), 64)
    >>> print(orders[psd.argmax()], round(psd.sum() * orders[1], 6))
    7.0 4.5
    """
    plan = segment_plan(
        samples_per_rev,
        revolutions=revolutions,
        n_per_segment=n_per_segment,
        window=window,
        overlap=overlap,
        detrend=detrend,
        scaling=scaling,
        average=average,
        max_order=max_order,
    )
    signal = check_real_array(signal, "signal")
    check_finite(signal.reshape(-1), "signal")
    if signal.ndim == 0 or signal.size == 0 or signal.shape[-1] < plan.n_per_segment:
        raise ValueError(
            f"signal of shape {signal.shape} holds no segment of {plan.n_per_segment} samples "
            f"({plan.revolutions:g} revolutions). Lower revolutions or n_per_segment."
        )
    psd = plan.average_of([signal.reshape(-1, signal.shape[-1])])
    return plan.orders, psd.reshape(*signal.shape[:-1], plan.n_orders)


def _at_least(
    blocks: Iterable[NDArray[np.floating]], length: int
) -> Iterator[NDArray[np.floating]]:
    """Join blocks that are shorter than `length`; what is left over at the end may be."""
    held: list[NDArray[np.floating]] = []
    for block in blocks:
        held.append(block)
        del block  # so that who is given it can let go of it
        if sum(part.shape[1] for part in held) >= length:
            yield held.pop() if len(held) == 1 else np.concatenate(held, axis=1)
            held = []
    if held:
        yield np.concatenate(held, axis=1)


def _joined(parts: Sequence[NDArray[np.floating]]) -> NDArray[np.floating]:
    """Put parts under each other; one alone is not copied.

    Small as they are, each pass of NumPy over them lets other threads run, and then has to wait
    until one of these lets go of Python's lock.
    """
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _segment_length(samples_per_rev: float, revolutions: Any, n_per_segment: Any) -> int:
    if n_per_segment is not None:
        count = check_count(n_per_segment, "n_per_segment", at_least=2)
        if count > _MOST_SAMPLES:
            raise ValueError(f"n_per_segment = {count} is more samples than a segment may have.")
        return count
    revolutions = check_number(revolutions, "revolutions", above=0)
    samples = revolutions * samples_per_rev
    if samples > _MOST_SAMPLES:
        raise ValueError(
            f"revolutions = {revolutions:g} at {samples_per_rev:g} samples per revolution make "
            f"segments of {samples:.3g} samples. Lower revolutions, or raise theta_s."
        )
    length = round(samples)
    if length < 2:
        raise ValueError(
            f"revolutions = {revolutions:g} at {samples_per_rev:g} samples per revolution make "
            f"segments of {length} samples; at least 2 are needed. Raise revolutions."
        )
    return length


def _window_values(window: Any, length: int) -> NDArray[np.floating]:
    if isinstance(window, str):
        return _remembered_window(window, length)
    if isinstance(window, tuple):  # it may hold what cannot be remembered
        return _named_window(window, length)
    values = check_real_array(window, "window")
    if values.shape != (length,):
        raise ValueError(
            f"a window given as an array must have the {length} samples of a segment, "
            f"got shape {values.shape}. Name it instead, or set n_per_segment."
        )
    return _check_window(values, "an array")


def _named_window(window: Any, length: int) -> NDArray[np.floating]:
    try:
        values = np.asarray(scipy.signal.get_window(window, length), dtype=np.float64)
    except (ValueError, TypeError, IndexError, AttributeError) as error:
        raise ValueError(
            f"window must be what scipy.signal.get_window takes, such as 'hann' or "
            f"('kaiser', 8.0); got {window!r}: {error}"
        ) from error
    _check_window(values, window).flags.writeable = False
    return values


_remembered_window = lru_cache(maxsize=32)(_named_window)


def _check_window(values: NDArray[np.floating], name: Any) -> NDArray[np.floating]:
    if not np.all(np.isfinite(values)) or np.sum(values) == 0:
        raise ValueError(
            f"window must be finite and must not add up to 0; the values of {name!r} are not so."
        )
    return values


def _detrended(segments: NDArray[np.floating], detrend: Any) -> NDArray[np.floating]:
    if not detrend:
        return segments
    if detrend == "constant":
        means = segments.mean(axis=-1, keepdims=True, dtype=np.float64)
        return (segments - means).astype(segments.dtype, copy=False)
    return scipy.signal.detrend(segments, axis=-1, type=detrend)


def _median_bias(n_segments: int) -> float:
    """Median over mean of n exponential variables (Allen et al., arXiv gr-qc/0509116, App. B)."""
    even = 2 * np.arange(1, (n_segments - 1) // 2 + 1)
    return float(1 + np.sum(1 / (even + 1) - 1 / even))


def too_short(strokes: Sequence[Any], plan: SegmentPlan, kind: str, who: str) -> ValueError:
    """Return the error for strokes none of which holds a segment.

    Parameters
    ----------
    strokes : sequence of AngleStroke
        Perhaps none.
    plan : SegmentPlan
        Its segments.
    kind : str
        What to call one of the strokes.
    who : str
        Name of the estimator, in whose parameters the remedy lies.

    Returns
    -------
    ValueError
        To be raised.
    """
    if not strokes:
        remedy = "Leave it out"
        if kind != "stroke":
            remedy += ", or do not keep directions apart (by_direction=False)"
        return ValueError(f"it has no {kind} of two samples. {remedy}.")
    longest = max(stroke.n_angles for stroke in strokes)
    came = f"its longest {kind} holds {longest / plan.samples_per_rev:.4g}"
    return ValueError(
        f"no {kind} holds a segment of {plan.revolutions:g} revolutions "
        f"({plan.n_per_segment} samples): {came}. Lower revolutions (or n_per_segment) of "
        f"{who}, set short='pad', or leave it out."
    )
