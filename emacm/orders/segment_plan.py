"""Plans of Welch's method over shaft angle: which segments are averaged, and how.

Source: P. D. Welch, IEEE Trans. Audio Electroacoust. 15(2), 70-73, 1967; Chirico, Eqs. (2.14) to
(2.22).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np
import scipy  # scipy.signal takes a tenth of a second to import, so it is imported on first use
from numpy.typing import NDArray
from scipy import fft

from emacm import _kernels
from emacm._checks import check_choice, check_count, check_number, check_real_array
from emacm.resampling.angle_recording import AngleRecording

Blocks = Iterable[NDArray[np.floating]]  # consecutive, of shape (n_channels, n_angles)
Signal = NDArray[np.floating] | Blocks  # whole, or in blocks
# Samples, and the number of segments, the first of which begins with them.
Section = tuple[NDArray[np.floating], int]
Lines = NDArray[np.complexfloating]  # shape (n_channels, n_segments, n_lines)
WeightedLines = tuple[Lines, float]


@dataclass(eq=False)
class SegmentPlan:
    """How signals over shaft angle are cut, windowed, transformed and averaged.

    The defaults of Welch's method are given here.

    Parameters
    ----------
    samples_per_rev : float
        Samples per shaft revolution, 2π/theta_s.
    revolutions : float
        Length of a segment; the distance between spectral lines is 1/revolutions (to the nearest
        whole number of samples).
    n_per_segment : int, optional
        Length of a segment in samples, in place of `revolutions`.
    window : str, tuple or array-like of shape (n_per_segment,)
        As for `scipy.signal.get_window`. "hann" is Chirico, Eq. (2.17).
    overlap : float
        Fraction of a segment that overlaps the next one, in [0, 1).
    detrend : {"constant", "linear", None, False}
        What is removed from each segment. "constant" distorts the first two lines, so bins of
        interest should begin above them.
    scaling : {"density", "spectrum"}
        "density" [U²/order] integrates to the mean square. In "spectrum" [U²] a tone of amplitude A
        has the value A²/2, and lines must not be summed.
    average : {"mean", "median"}
        "median" is less affected by single shocks; it is corrected for its bias on noise, as in
        `scipy.signal.welch`.
    max_order : float, optional
        Highest order of interest: lines above the first one at or above it are omitted.
    by_direction : bool
        Average forward and reverse strokes separately.
    short : {"raise", "pad"}
        For a recording whose strokes are all shorter than a segment: an error, or zero padding.

    Attributes
    ----------
    n_per_segment : int
        Samples of a segment, L in Chirico, Eqs. (2.14) to (2.22).
    step : int
        Samples from one segment to the next.
    weights : ndarray of shape (n_per_segment,)
        The samples of the window.
    n_orders : int
        Lines that are kept, from order 0 upwards.

    Raises
    ------
    TypeError, ValueError
        If an option is invalid.
    """

    samples_per_rev: float
    _: KW_ONLY
    revolutions: float = 16
    n_per_segment: Any = None
    window: Any = "hann"
    overlap: float = 0.5
    detrend: Any = "constant"
    scaling: str = "density"
    average: str = "mean"
    max_order: float | None = None
    by_direction: bool = False
    short: str = "raise"

    def __post_init__(self) -> None:
        """Check the options, and set what follows from them."""
        per_rev = check_number(self.samples_per_rev, "samples_per_rev", above=0)
        if self.n_per_segment is not None:
            length = check_count(self.n_per_segment, "n_per_segment", at_least=2)
        else:
            length = round(check_number(self.revolutions, "revolutions", above=0) * per_rev)
        if not 2 <= length <= 1 << 31:
            raise ValueError(
                f"a segment must have 2 to 2**31 samples, got {length:.4g} from n_per_segment = "
                f"{self.n_per_segment}, revolutions = {self.revolutions} and {per_rev:g} samples "
                f"per revolution. Change one of them, or theta_s."
            )
        overlap = check_number(self.overlap, "overlap", at_least=0, below=1)
        check_choice(self.detrend, "detrend", ("constant", "linear", None, False))
        check_choice(self.scaling, "scaling", ("density", "spectrum"))
        check_choice(self.average, "average", ("mean", "median"))
        check_choice(self.by_direction, "by_direction", (True, False))
        check_choice(self.short, "short", ("raise", "pad"))
        self.n_orders = length // 2 + 1
        if self.max_order is not None:
            top = check_number(self.max_order, "max_order", at_least=0, unit="orders")
            # The line at or above the limit is kept, so that bins up to it can be integrated.
            self.n_orders = min(self.n_orders, int(np.ceil(top * length / per_rev - 1e-9)) + 1)
        self.samples_per_rev, self.n_per_segment = per_rev, length
        self.revolutions = length / per_rev  # exactly
        self.step = length - min(int(overlap * length), length - 1)
        self.weights = window_values(self.window, length)

    @property
    def order_step(self) -> float:
        """Distance between two spectral lines [orders]."""
        return self.samples_per_rev / self.n_per_segment

    @property
    def orders(self) -> NDArray[np.floating]:
        """Orders of the spectral lines, shape (n_orders,)."""
        # Multiplied first, so that 3 lines of 1/10 order are at 0.3 exactly.
        return np.arange(self.n_orders) * self.samples_per_rev / self.n_per_segment

    @property
    def sides(self) -> NDArray[np.floating]:
        """Factors of the one-sided spectrum, Eqs. (2.20) and (2.21) of Chirico."""
        sides = np.full(self.n_orders, 2.0)
        sides[0] = 1.0
        if 2 * (self.n_orders - 1) == self.n_per_segment:
            sides[-1] = 1.0  # the line at half the sampling rate has no mirror image
        return sides

    def spectra_of(self, row: AngleRecording | NDArray[np.floating]) -> NDArray[np.floating]:
        """Estimate the power spectra of one recording, resampling it one block at a time.

        Parameters
        ----------
        row : AngleRecording or ndarray of shape (n_angles,)
            A recording, or one signal over shaft angle.

        Returns
        -------
        ndarray of shape (n_channels, [n_directions,] n_orders)

        Raises
        ------
        ValueError
            If no stroke (`by_direction`: of one direction) is as long as a segment, or powers
            exceed the range of float64.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            if isinstance(row, np.ndarray):
                powers = self._average_or_padded([[row[np.newaxis]]], [len(row)], "row")
            else:
                kinds = row.strokes_by_kind(self.by_direction)
                powers = np.empty((len(row.channels), len(kinds), self.n_orders))
                for number, (kind, strokes) in enumerate(kinds):
                    lengths = [stroke.n_angles for stroke in strokes]
                    for group in row.rate_groups:  # channels of one sampling rate at a time
                        blocks = [stroke.blocks(group) for stroke in strokes]
                        powers[group, number] = self._average_or_padded(blocks, lengths, kind)
                powers = powers if self.by_direction else powers[:, 0]
        if not np.isfinite(powers).all():
            raise ValueError("its power exceeds the range of float64. State it in other units.")
        return powers

    def _average_or_padded(
        self, signals: Sequence[Blocks], lengths: Sequence[int], kind: str
    ) -> NDArray[np.floating]:
        """Estimate the power spectra of signals, which `kind` calls a stroke or a row."""
        whole, short = self.usable(signals, lengths, kind, "OrderPSD")
        return padded(self, short) if short else self.average_of(whole)

    def usable(
        self, signals: Sequence[Blocks], lengths: Sequence[int], kind: str, who: str
    ) -> tuple[Sequence[Blocks], Iterable[NDArray[np.floating]]]:
        """Return the signals that hold a segment, or those that are to be padded, read one by one.

        Parameters
        ----------
        signals : sequence of iterable of ndarray of shape (n_channels, n_angles)
            The blocks of each signal.
        lengths : sequence of int
            Its samples.
        kind, who : str
            What a signal is called, and the estimator, for the message.

        Raises
        ------
        ValueError
            If no signal is as long as a segment (`short` is "pad": as two samples).
        """
        whole = [s for s, n in zip(signals, lengths, strict=True) if n >= self.n_per_segment]
        if whole:
            return whole, ()
        if self.short == "pad" and max(lengths, default=0) > 1:
            return (), (np.concatenate(list(blocks), axis=1) for blocks in signals)
        if not lengths or self.short == "pad":
            raise ValueError(
                f"it has no {kind} of two samples. Leave it out, or set by_direction=False."
            )
        raise ValueError(
            f"no {kind} holds a segment of {self.revolutions:g} revolutions ({self.n_per_segment} "
            f"samples): its longest {kind} holds {max(lengths) / self.samples_per_rev:.4g}. Lower "
            f"revolutions of {who}, set short='pad', or leave it out."
        )

    def average_of(self, signals: Iterable[Signal]) -> NDArray[np.floating]:
        """Average the power spectra of all segments of all signals.

        Parameters
        ----------
        signals : iterable of ndarray of shape (n_channels, n_angles), or of their blocks
            Signals at uniform angles, such as the strokes of a recording, each whole or in
            consecutive blocks; read one at a time. Signals shorter than a segment are skipped.

        Returns
        -------
        ndarray of shape (n_channels, n_orders)

        Raises
        ------
        ValueError
            If no signal holds a segment.
        """
        collected: list[NDArray[np.floating]] = []
        count = 0
        for section, n_segments in sections(signals, self.n_per_segment, self.step):
            count += n_segments
            powers = self.section_powers(section, n_segments)
            del section  # before the next one is made
            if collected and self.average == "mean":
                powers += collected.pop()
            collected.append(powers)
        if not collected:
            raise ValueError(f"no signal holds a segment of {self.n_per_segment} samples.")
        if self.average == "median":
            median = np.median(np.concatenate(collected, axis=1), axis=1)
            return self.spectrum_of(median, _median_bias(count))
        return self.spectrum_of(collected[0], count)

    def spectrum_of(self, powers: NDArray[np.floating], count: float) -> NDArray[np.floating]:
        """Return the power spectrum for a sum of the powers of a number of segments."""
        return powers / count * (self.sides / self.window_factor(self.weights))

    def lines_of(self, signals: Iterable[Signal]) -> Iterator[WeightedLines]:
        """Yield the Fourier transforms of all segments, those of all channels together.

        A product of two lines, summed over all segments, divided by the sum of the weights and
        multiplied by `sides`, is a spectral density (or spectrum).

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
        factor = self.window_factor(self.weights)
        for section, n_segments in sections(signals, self.n_per_segment, self.step):
            for transforms in self._transforms(section, n_segments):
                lines = transforms[..., : self.n_orders]
                yield lines, factor * lines.shape[1]
            del section  # before the next one is made

    def section_powers(
        self, section: NDArray[np.floating], n_segments: int
    ) -> NDArray[np.floating]:
        """Return squared lines, summed over the segments of a section or, for the median, of each.

        Parameters
        ----------
        section : ndarray of shape (n_channels, n_angles)
            As `sections` yields it.
        n_segments : int
            Number of its segments.

        Returns
        -------
        ndarray of shape (n_channels, n_orders) or (n_channels, n_segments, n_orders)
        """
        if self.average == "median":
            batches = self._transforms(section, n_segments)
            lines = (transforms[..., : self.n_orders] for transforms in batches)
            return np.concatenate([part.real**2 + part.imag**2 for part in lines], axis=1)
        total = np.zeros((len(section), self.n_orders))
        for transforms in self._transforms(section, n_segments):
            _kernels.loops.add_powers(transforms, total)
            del transforms  # before the next ones are made
        return total

    def _transforms(self, section: NDArray[np.floating], n_segments: int) -> Iterator[Lines]:
        """Yield the Fourier transforms of a few segments of all channels at a time."""
        loops, length, linear = _kernels.loops, self.n_per_segment, self.detrend == "linear"
        section = np.ascontiguousarray(section, np.float64)
        at_once = max(1, loops.SEGMENT_BYTES // (8 * length * len(section)))
        window = np.ones(length) if linear else self.weights
        for start in range(0, n_segments, at_once):
            segments = np.empty((len(section), min(at_once, n_segments - start), length))
            cut = start * self.step, self.step, window, self.detrend == "constant"
            loops.set_segments(section, *cut, segments)
            if linear:
                segments = detrended(segments, self.detrend) * self.weights
            transforms = [fft.rfft(segments)]
            del segments
            yield transforms.pop()

    def window_factor(self, window: NDArray[np.floating]) -> float:
        """Return what the power of a windowed segment is divided by."""
        # Eq. (2.18) of Chirico with (2.14) and (2.22); T_p there is L over the sampling rate.
        if self.scaling == "density":
            return float(self.samples_per_rev * (window @ window))
        return float(np.sum(window) ** 2)


def sections(signals: Iterable[Signal], length: int, step: int) -> Iterator[Section]:
    """Yield sections of signals that hold whole segments, and how many each holds.

    Segments have `length` samples; each begins `step` samples after the one before. No segment
    spans two signals, which are read one at a time; shorter signals are skipped.
    """
    for signal in signals:
        cutter = SectionCutter(length, step)
        for block in [signal] if isinstance(signal, np.ndarray) else signal:
            yield from cutter.add(block)
            del block  # before the next one is made


class SectionCutter:
    """Cuts a signal that comes block by block into sections of whole segments.

    Parameters
    ----------
    length, step : int
        As for `sections`.

    Attributes
    ----------
    rest : list of ndarray of shape (n_channels, n_angles)
        The samples from the start of the next section on.
    """

    def __init__(self, length: int, step: int) -> None:
        self._length, self._step = length, step
        self.rest: list[NDArray[np.floating]] = []

    def add(self, block: NDArray[np.floating]) -> Iterator[Section]:
        """Yield the section that is complete with the next samples, if there is one."""
        joined = np.concatenate([*self.rest, block], axis=1) if self.rest else block
        n_segments = max((joined.shape[1] - self._length) // self._step + 1, 0)
        if n_segments:
            yield joined, n_segments
        self.rest = [joined[:, n_segments * self._step :].copy()]


def _median_bias(n_segments: int) -> float:
    """Median over mean of n exponential variables (Allen et al., arXiv gr-qc/0509116, App. B)."""
    even = 2 * np.arange(1, (n_segments - 1) // 2 + 1)
    return float(1 + np.sum(1 / (even + 1) - 1 / even))


def padded(plan: SegmentPlan, signals: Iterable[NDArray[np.floating]]) -> NDArray[np.floating]:
    """Estimate power spectra from signals that are shorter than a segment.

    Each signal is detrended, windowed over its own length and padded with zeros. Powers and
    window factors are summed before they are divided, so that a signal is weighted by its
    length; `average` has no effect, as there is one spectrum for each signal.

    Parameters
    ----------
    plan : SegmentPlan
        Length of a segment, window and scaling.
    signals : iterable of ndarray of shape (n_channels, n_angles)
        Signals of at most `n_per_segment` samples, one of them of at least two.

    Returns
    -------
    ndarray of shape (n_channels, n_orders)

    Raises
    ------
    ValueError
        If the window is an array, which has no shorter form.
    """
    lines, weights = zip(*padded_lines(plan, signals), strict=True)
    power = sum(np.abs(part[:, 0]) ** 2 for part in lines)
    return power * (plan.sides / sum(weights))


def padded_lines(
    plan: SegmentPlan, signals: Iterable[NDArray[np.floating]]
) -> Iterator[WeightedLines]:
    """Yield the Fourier transform of each signal, padded with zeros to a segment.

    Parameters
    ----------
    plan : SegmentPlan
        Length of a segment, window and scaling.
    signals : iterable of ndarray of shape (n_channels, n_angles)
        Signals of at most `n_per_segment` samples; those of a single sample are skipped.

    Yields
    ------
    lines, weight
        As `SegmentPlan.lines_of` does; the lines of a signal have the shape
        (n_channels, 1, n_orders).

    Raises
    ------
    ValueError
        If the window is an array, which has no shorter form.
    """
    for signal in signals:
        n_angles = signal.shape[-1]
        if n_angles < 2:
            continue
        if not isinstance(plan.window, str | tuple):
            raise ValueError("short='pad' needs a window by name, as an array cannot be shortened.")
        window = window_values(plan.window, n_angles)
        lines = fft.rfft(detrended(signal, plan.detrend) * window, plan.n_per_segment)
        yield lines[:, np.newaxis, : plan.n_orders], plan.window_factor(window)


def window_values(window: Any, length: int) -> NDArray[np.floating]:
    """Return the samples of a window.

    Parameters
    ----------
    window : str, tuple or array-like of shape (length,)
        As for `scipy.signal.get_window`, or the samples themselves.
    length : int
        Samples of a segment.

    Returns
    -------
    ndarray of shape (length,)

    Raises
    ------
    TypeError, ValueError
        If the window is unknown, has another length, or its samples sum to 0.
    """
    if isinstance(window, str | tuple):
        try:
            values = scipy.signal.get_window(window, length)
        except (ValueError, TypeError, IndexError, AttributeError, OverflowError) as error:
            raise ValueError(
                f"window must be an argument of scipy.signal.get_window, such as 'hann' or "
                f"('kaiser', 8.0); got {window!r}: {error}"
            ) from error
    else:
        values = check_real_array(window, "window")
        if values.shape != (length,):
            raise ValueError(
                f"a window given as an array must have the {length} samples of a segment, "
                f"got shape {values.shape}. Name it instead, or set n_per_segment."
            )
    values = values.astype(np.float64)
    if not np.isfinite(values).all() or np.sum(values) == 0:
        named = window if isinstance(window, str | tuple) else "an array"
        raise ValueError(
            f"window must be finite and must not sum to 0, but the samples of {named!r} are not "
            f"finite or sum to 0. Choose another window."
        )
    return values


def detrended(segments: NDArray[np.floating], detrend: Any) -> NDArray[np.floating]:
    """Remove the mean or the straight line of best fit from each segment, in float64.

    Parameters
    ----------
    segments : ndarray of shape (..., n_angles)
    detrend : {"constant", "linear", None, False}

    Returns
    -------
    ndarray of shape (..., n_angles)
    """
    segments = segments.astype(np.float64, copy=False)
    if detrend == "constant":
        return segments - segments.mean(axis=-1, keepdims=True)
    return scipy.signal.detrend(segments, axis=-1, type="linear") if detrend else segments
