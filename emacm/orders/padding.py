"""Strokes that are shorter than a segment: padded with zeros, or an error."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from emacm.orders.windows import detrended, window_values

if TYPE_CHECKING:
    from emacm.orders.segment_plan import SegmentPlan, WeightedLines


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
    for lines, weight in padded_lines(plan, signals):
        part = np.abs(lines[:, 0]) ** 2
        power = part if power is None else power + part
        total += weight
    if power is None:
        raise ValueError("no stroke has two samples.")
    return power * (plan.sides / total)


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
