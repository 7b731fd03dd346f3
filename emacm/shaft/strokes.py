"""Strokes: the sections of a shaft's motion in one direction."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_number, check_signal
from emacm.shaft.motion import Series, Stroke, blocks

__all__ = ["Stroke", "find_strokes", "strokes_of"]


def find_strokes(velocity: ArrayLike, *, min_speed: float = 0.0) -> list[Stroke]:
    """Find the sections in which the shaft turns in one direction.

    A stroke is cut only where the direction changes. Samples at or below
    `min_speed` between two sections of the same direction remain in it; at its ends,
    or between opposite directions, they belong to no stroke. So neither noise
    at standstill nor a pause of one sample creates strokes.

    Parameters
    ----------
    velocity : array-like of shape (n_times,)
        Shaft velocity [rad/s], signed.
    min_speed : float
        Speed up to which the shaft counts as standing still [rad/s].

    Returns
    -------
    list of Stroke
        In order of time; empty if the shaft never turns.

    Raises
    ------
    ValueError
        If `velocity` is not finite or `min_speed` is negative.

    Examples
    --------
    >>> find_strokes([0.0, 2.0, 0.0, 2.0, 0.0, -1.0, -1.0])
    [Stroke(start=1, stop=4, direction=1), Stroke(start=5, stop=7, direction=-1)]
    """
    speed: Series = check_signal(velocity, "velocity", min_length=1)
    return strokes_of(speed, check_number(min_speed, "min_speed", at_least=0, unit="rad/s"))


def longest_gap(max_rest: float | None, fs: float) -> float:
    """Return the most samples from one in which the shaft turns to the next of the same stroke.

    Parameters
    ----------
    max_rest : float or None
        Longest time at standstill that does not end a stroke [s]; None for any.
    fs : float
        Sampling rate of the shaft reference [Hz].

    Returns
    -------
    float

    Raises
    ------
    TypeError, ValueError
        If `max_rest` is not a number of at least 0.
    """
    if max_rest is None:
        return np.inf
    return check_number(max_rest, "max_rest", at_least=0, unit="s") * fs + 1


def strokes_of(velocity: Series, min_speed: float, max_gap: float = np.inf) -> list[Stroke]:
    """Find strokes as `find_strokes` does, block by block and without checks.

    Parameters
    ----------
    velocity : ndarray of shape (n_times,), or LazySeries
        Finite shaft velocity [rad/s], signed.
    min_speed : float
        Speed up to which the shaft counts as standing still [rad/s].
    max_gap : float
        Most samples from one in which the shaft turns to the next of the same stroke.

    Returns
    -------
    list of Stroke
    """
    strokes: list[Stroke] = []
    for first, block in blocks(velocity):
        extend_strokes(strokes, first, block, min_speed, max_gap)
    return strokes


def extend_strokes(
    strokes: list[Stroke],
    first: int,
    velocity: NDArray[np.floating],
    min_speed: float,
    max_gap: float = np.inf,
) -> None:
    """Extend strokes, the last of which may still go on, by the next samples.

    Parameters
    ----------
    strokes : list of Stroke
        Those of the samples before; changed in place.
    first : int
        Number of the first of the next samples.
    velocity : ndarray of shape (n_times,)
        Finite shaft velocity [rad/s], signed.
    min_speed, max_gap : float
        As for `strokes_of`.
    """
    for start, stop, sign in _sections(velocity, min_speed, max_gap):
        last = strokes[-1] if strokes else None
        if last and last.direction == sign and first + start - (last.stop - 1) <= max_gap:
            strokes[-1] = Stroke(last.start, first + stop, sign)
        else:
            strokes.append(Stroke(first + start, first + stop, sign))


def _sections(
    velocity: NDArray[np.floating], min_speed: float, max_gap: float
) -> Iterator[tuple[int, int, int]]:
    """Yield first sample, last + 1 and direction of the strokes within one block."""
    if velocity.min() > min_speed:
        yield 0, len(velocity), 1
        return
    if velocity.max() < -min_speed:
        yield 0, len(velocity), -1
        return
    turning = np.flatnonzero(np.abs(velocity) > min_speed)
    if not len(turning):
        return
    signs = np.sign(velocity[turning]).astype(np.int8)
    cuts = np.flatnonzero((np.diff(signs) != 0) | (np.diff(turning) > max_gap)) + 1
    for i, j in zip([0, *cuts], [*cuts, len(turning)], strict=True):
        yield int(turning[i]), int(turning[j - 1]) + 1, int(signs[i])
