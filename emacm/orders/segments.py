"""Segments of signals over shaft angle: their length, and where they begin in a signal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm._checks import check_count, check_number
from emacm.shaft.motion import blocks

# Whole, or in consecutive blocks; shape (n_channels, n_angles).
Signal = NDArray[np.floating] | Iterable[NDArray[np.floating]]
Section = tuple[NDArray[np.floating], int, int]

_MOST_SAMPLES = 1 << 31  # of a segment
_LEAST_POWER = 1e-290  # below, float64 loses digits
_LEAST_RANGE = 1e-140  # of a signal whose power is above that
_JOINED_BYTES = 2 << 20  # blocks up to this size are joined with the rest of the one before


def samples_per_revolution(theta_s: float) -> float:
    """Return 2π/theta_s, rounded to a whole number where it differs by rounding errors only.

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


def segment_length(samples_per_rev: float, revolutions: Any, n_per_segment: Any) -> int:
    """Return the samples of a segment.

    Parameters
    ----------
    samples_per_rev : float
        Samples per shaft revolution.
    revolutions : float
        Length of a segment [revolutions], used where `n_per_segment` is None.
    n_per_segment : int or None
        Length of a segment [samples].

    Returns
    -------
    int
        At least 2.

    Raises
    ------
    TypeError, ValueError
        If either is not a positive number, or the segment would be too short or too long.
    """
    if n_per_segment is not None:
        count = check_count(n_per_segment, "n_per_segment", at_least=2)
        if count > _MOST_SAMPLES:
            raise ValueError(
                f"n_per_segment = {count} is more than the {_MOST_SAMPLES} samples that a segment "
                f"may have. Lower it."
            )
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


def sections(signals: Iterable[Signal], length: int, step: int) -> Iterator[Section]:
    """Yield sections of signals, the start of the first segment in each, and how many there are.

    Parameters
    ----------
    signals : iterable of ndarray of shape (n_channels, n_angles), or of their blocks
        Each signal whole, or as an iterable of consecutive blocks. They are read one at a time.
    length : int
        Samples of a segment. No segment spans two signals; shorter signals are skipped.
    step : int
        Samples from one segment to the next.

    Yields
    ------
    section : ndarray of shape (n_channels, n_angles)
    first, n_segments : int
    """
    for signal in signals:
        rest: NDArray[np.floating] | None = None
        for block in _at_least([signal] if isinstance(signal, np.ndarray) else signal, length):
            first = 0  # in the block, of the segments that lie entirely inside
            if rest is not None and block.nbytes <= _JOINED_BYTES:
                block, rest = np.concatenate([rest, block], axis=1), None
            if rest is not None:
                # Segments that begin in the rest; only these samples are copied.
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


def _at_least(
    blocks: Iterable[NDArray[np.floating]], length: int
) -> Iterator[NDArray[np.floating]]:
    """Join blocks that are shorter than `length`; only the last one may remain shorter."""
    held: list[NDArray[np.floating]] = []
    for block in blocks:
        held.append(block)
        del block  # so that the caller can release it
        if sum(part.shape[1] for part in held) >= length:
            yield held.pop() if len(held) == 1 else np.concatenate(held, axis=1)
            held = []
    if held:
        yield np.concatenate(held, axis=1)


def too_short(lengths: Sequence[int], plan: Any, kind: str, who: str) -> ValueError:
    """Return the error for strokes none of which is as long as a segment.

    Parameters
    ----------
    lengths : sequence of int
        Samples of each stroke; may be empty.
    plan : SegmentPlan
        Its segments.
    kind : str
        What to call a stroke.
    who : str
        Name of the estimator whose parameters are the remedy.

    Returns
    -------
    ValueError
        To be raised.
    """
    if not lengths:
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
    """Check that the powers of each channel are within the range of float64.

    Parameters
    ----------
    powers : ndarray of shape (n_channels, ..., n_orders)
        Power spectra.
    row : AngleRecording or ndarray of shape (n_angles,)
        What they were estimated from.

    Raises
    ------
    ValueError
        If a power overflows, or the power of a signal that is not constant underflows.
    """
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
        ranges = [(part.min(), part.max()) for _, part in blocks(values)]
        if 0 < max(high for _, high in ranges) - min(low for low, _ in ranges) < _LEAST_RANGE:
            raise ValueError(
                f"{name} varies by less than {_LEAST_RANGE:g}, so its power is below the range of "
                f"float64. State it in other units."
            )
