"""Plans of Welch's method over shaft angle: which segments are averaged, and how.

Source: P. D. Welch, IEEE Trans. Audio Electroacoust. 15(2), 70-73, 1967; Chirico, Eqs. (2.14) to
(2.22).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from emacm._kernels import kernels
from emacm.orders.sections import Signal, sections
from emacm.orders.windows import detrended, window_values
from emacm.resampling.angle_recording import AngleRecording, AngleStroke
from emacm.shaft.motion import blocks as blocks_of

Lines = NDArray[np.complexfloating]  # shape (n_channels, n_segments, n_lines)
WeightedLines = tuple[Lines, float]
# Signals that are averaged together: place in the result, what to call one, and their lengths.
_Part = tuple[tuple[Any, int], str, list[Signal], list[int]]

_LEAST_POWER = 1e-290  # below, float64 loses digits
_LEAST_RANGE = 1e-140  # of a signal whose power is above that


@dataclass(frozen=True, eq=False)
class SegmentPlan:
    """How signals over shaft angle are cut, windowed, transformed and averaged.

    `emacm.orders.welch.segment_plan` makes one from the options of a user.

    Attributes
    ----------
    samples_per_rev : float
        Samples per shaft revolution, 2π/theta_s.
    n_per_segment : int
        Samples of a segment, L in Chirico, Eqs. (2.14) to (2.22).
    step : int
        Samples from one segment to the next.
    window : str, tuple or array
        As for `scipy.signal.get_window`, or the samples of the window.
    weights : ndarray of shape (n_per_segment,)
        The samples of the window.
    detrend : {"constant", "linear", None, False}
        What is removed from each segment.
    scaling : {"density", "spectrum"}
        Unit² per order, or unit².
    average : {"mean", "median"}
        How segments are combined.
    n_orders : int
        Lines that are kept, from order 0 upwards.
    by_direction : bool
        Whether forward and reverse strokes are averaged separately.
    short : {"raise", "pad"}
        For a recording whose strokes are all shorter than a segment: an error, or zero padding.
    """

    samples_per_rev: float
    n_per_segment: int
    step: int
    window: Any
    weights: NDArray[np.floating]
    detrend: Any
    scaling: str
    average: str
    n_orders: int
    by_direction: bool = False
    short: str = "raise"

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
    def revolutions(self) -> float:
        """Exact length of a segment [revolutions]."""
        return self.n_per_segment / self.samples_per_rev

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
            If no stroke (`by_direction`: of one direction) is as long as a segment, or powers of a
            channel are outside the range of float64.
        """
        parts: Iterable[_Part]
        with np.errstate(over="ignore", invalid="ignore"):
            if isinstance(row, np.ndarray):
                parts, shape = [((0, 0), "row", [[row[np.newaxis]]], [len(row)])], (1, 1)
            else:
                kinds = row.strokes_by_kind(self.by_direction)
                parts, shape = _parts_of(row, kinds), (len(row.channels), len(kinds))
            powers = np.empty((*shape, self.n_orders))
            for place, kind, signals, lengths in parts:
                long = [s for s, n in zip(signals, lengths, strict=True) if n >= self.n_per_segment]
                if long:
                    powers[place] = self.average_of(long)
                elif self.short == "pad" and max(lengths, default=0) > 1:
                    joined = (np.concatenate(list(blocks), axis=1) for blocks in signals)
                    powers[place] = self.padded(joined)
                else:
                    raise too_short(lengths, self, kind, "OrderPSD")
        check_range(powers, row)
        return powers if shape[1] > 1 else powers[:, 0]

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
        for section, first, n_segments in sections(signals, self.n_per_segment, self.step):
            count += n_segments
            powers = self.section_powers(section, first, n_segments)
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
        return powers / count * (self.sides / self._window_factor(self.weights))

    def padded(self, signals: Iterable[NDArray[np.floating]]) -> NDArray[np.floating]:
        """Estimate power spectra from signals that are shorter than a segment.

        Each signal is detrended, windowed over its own length and padded with zeros. Powers and
        window factors are summed before they are divided, so that a signal is weighted by its
        length; `average` has no effect, as there is one spectrum for each signal.

        Parameters
        ----------
        signals : iterable of ndarray of shape (n_channels, n_angles)
            Signals of at most `n_per_segment` samples.

        Returns
        -------
        ndarray of shape (n_channels, n_orders)

        Raises
        ------
        ValueError
            If none has two samples, or the window is an array (which has no shorter form).
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
        loops, factor = kernels(), self._window_factor(self.weights)
        for section, first, n_segments in sections(signals, self.n_per_segment, self.step):
            for lines in self._lines(loops, section, first, n_segments):
                yield lines, factor * lines.shape[1]
            del section  # before the next one is made

    def padded_lines(self, signals: Iterable[NDArray[np.floating]]) -> Iterator[WeightedLines]:
        """Yield the Fourier transform of each signal, padded with zeros to a segment.

        Parameters
        ----------
        signals : iterable of ndarray of shape (n_channels, n_angles)
            Signals of at most `n_per_segment` samples; those of a single sample are skipped.

        Yields
        ------
        lines, weight
            As `lines_of` does; the lines of a signal have the shape (n_channels, 1, n_orders).

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
            window = window_values(self.window, n_angles)
            lines = fft.rfft(detrended(signal, self.detrend) * window, self.n_per_segment)
            yield lines[:, np.newaxis, : self.n_orders], self._window_factor(window)

    def section_powers(
        self, section: NDArray[np.floating], first: int, n_segments: int
    ) -> NDArray[np.floating]:
        """Return squared lines, summed over the segments of a section or, for the median, of each.

        Parameters
        ----------
        section : ndarray of shape (n_channels, n_angles)
            As `emacm.orders.sections.sections` yields it, with the start of its first segment and
            the number of its segments.
        first, n_segments : int
            These two numbers.

        Returns
        -------
        ndarray of shape (n_channels, n_orders) or (n_channels, n_segments, n_orders)
        """
        loops = kernels()
        if self.average == "mean" and self.detrend != "linear":
            remove_mean = self.detrend == "constant"
            return loops.segment_powers(
                section, first, self.step, self.weights, n_segments, self.n_orders, remove_mean
            )
        batches = self._lines(loops, section, first, n_segments)
        if self.average == "mean":
            return sum(loops.powers(lines) for lines in batches)
        return np.concatenate([lines.real**2 + lines.imag**2 for lines in batches], axis=1)

    def _lines(
        self,
        loops: ModuleType,
        section: NDArray[np.floating],
        first: int,
        n_segments: int,
    ) -> Iterator[Lines]:
        """Yield the Fourier transforms of a few segments of all channels at a time."""
        linear = self.detrend == "linear"
        at_once = max(1, loops.SEGMENT_BYTES // (8 * self.n_per_segment * len(section)))
        for start in range(0, n_segments, at_once):
            segments = loops.windowed(
                section,
                first + start * self.step,
                self.step,
                np.ones_like(self.weights) if linear else self.weights,
                min(at_once, n_segments - start),
                self.detrend == "constant",
            )
            if linear:
                segments = detrended(segments, self.detrend) * self.weights
            yield fft.rfft(segments, overwrite_x=True)[..., : self.n_orders]

    def _window_factor(self, window: NDArray[np.floating]) -> float:
        # Eq. (2.18) of Chirico with (2.14) and (2.22); T_p there is L over the sampling rate.
        if self.scaling == "density":
            return float(self.samples_per_rev * (window @ window))
        return float(np.sum(window) ** 2)


def _parts_of(
    row: AngleRecording, kinds: Sequence[tuple[str, Sequence[AngleStroke]]]
) -> Iterator[_Part]:
    """Yield the signals of strokes of each kind, channels of one sampling rate at a time."""
    for number, (kind, strokes) in enumerate(kinds):
        lengths = [stroke.n_angles for stroke in strokes]
        for group in row.rate_groups:
            yield (group, number), kind, [stroke.blocks(group) for stroke in strokes], lengths


def _median_bias(n_segments: int) -> float:
    """Median over mean of n exponential variables (Allen et al., arXiv gr-qc/0509116, App. B)."""
    even = 2 * np.arange(1, (n_segments - 1) // 2 + 1)
    return float(1 + np.sum(1 / (even + 1) - 1 / even))


def too_short(lengths: Sequence[int], plan: SegmentPlan, kind: str, who: str) -> ValueError:
    """Return the error for strokes, of so many samples, none of which is as long as a segment."""
    if not lengths or plan.short == "pad":
        remedy = "Leave it out"
        if kind != "stroke":
            remedy += ", or do not separate directions (by_direction=False)"
        return ValueError(f"it has no {kind} of two samples. {remedy}.")
    return ValueError(
        f"no {kind} holds a segment of {plan.revolutions:g} revolutions ({plan.n_per_segment} "
        f"samples): its longest {kind} holds {max(lengths) / plan.samples_per_rev:.4g}. Lower "
        f"revolutions (or n_per_segment) of {who}, set short='pad', or leave it out."
    )


def check_range(powers: NDArray[np.floating], row: Any) -> None:
    """Raise a ValueError if powers, shape (n_channels, ..., n_orders), overflow or underflow."""
    highest = powers.reshape(len(powers), -1).max(axis=1)  # NaN where infinite values were summed
    for channel, power in enumerate(highest):
        if _LEAST_POWER < power < np.inf:
            continue
        whole = isinstance(row, np.ndarray)
        name = "the signal" if whole else f"channel {row.channels[channel]!r}"
        if not power < np.inf:
            raise ValueError(
                f"the power of {name} exceeds the range of float64. State it in other units."
            )
        values = row if whole else row.measured.series[row.channels[channel]]
        ranges = [(part.min(), part.max()) for _, part in blocks_of(values)]
        if 0 < max(high for _, high in ranges) - min(low for low, _ in ranges) < _LEAST_RANGE:
            raise ValueError(
                f"{name} varies by less than {_LEAST_RANGE:g}, so its power is below the range of "
                f"float64. State it in other units."
            )
