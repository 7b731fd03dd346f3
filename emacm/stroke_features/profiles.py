"""The course of a signal along a stroke, in few numbers.

Between its samples a signal is taken as straight lines, and all integrals are exact. So samples
may stand at any positions: evenly over the angle, or closer where the shaft is slow.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_count, check_signal

__all__ = ["cosine_coefficients", "segment_means", "stroke_positions"]

Array = NDArray[np.float64]


def stroke_positions(travel: ArrayLike) -> Array:
    """Return positions along a stroke, from 0 at its first sample to 1 at its last.

    Parameters
    ----------
    travel : array-like of shape (n_samples,)
        Angle run [rad, or any unit]. Where the shaft turns back a little it counts as standing.

    Returns
    -------
    ndarray of shape (n_samples,)
        Never falling.

    Raises
    ------
    ValueError
        If the travel has no length.

    Examples
    --------
    >>> stroke_positions([2.0, 3.0, 2.9, 6.0]).tolist()
    [0.0, 0.25, 0.25, 1.0]
    """
    run = check_signal(travel, "travel").astype(np.float64)
    farthest = np.maximum.accumulate(run)
    length = farthest[-1] - farthest[0]
    if not length > 0:
        raise ValueError("a stroke must have a length, but the shaft stands where it is sampled.")
    return (farthest - farthest[0]) / length


def cosine_coefficients(position: ArrayLike, signal: ArrayLike, n_coefficients: int) -> Array:
    """Project a signal on the lowest cosines along the stroke.

    Parameters
    ----------
    position : array-like of shape (n_samples,)
        From 0 to 1, never falling; see `stroke_positions`.
    signal : array-like of shape (..., n_samples)
        Signal there, in any unit U.
    n_coefficients : int
        How many; coefficient k has k half waves along the stroke.

    Returns
    -------
    ndarray of shape (..., n_coefficients)
        Integrals of the signal times 1, √2 cos(πp), √2 cos(2πp), ... over the position p [U].
        The cosines are orthonormal: the squares of all coefficients add up to the mean square
        over the position (Parseval), and the first is the mean.

    Raises
    ------
    TypeError, ValueError
        If the positions are not as above, or do not fit the signal.

    Notes
    -----
    Integrating by parts leaves, for a signal of straight pieces with the rises Δx,
    ``-(√2/ω) Σ Δx sin(ω p) sinc(ω Δp / 2)`` at ω = πk, with p in the middle of each piece.

    Examples
    --------
    >>> ramp = cosine_coefficients([0, 1], [0, 1], 3)
    >>> np.allclose(ramp, [1 / 2, -2 * np.sqrt(2) / np.pi**2, 0])
    True
    """
    p, x = _checked(position, signal)
    waves = np.pi * np.arange(1, check_count(n_coefficients, "n_coefficients"))[:, np.newaxis]
    middle, width = (p[1:] + p[:-1]) / 2, np.diff(p)
    mean = (x[..., 1:] + x[..., :-1]) @ width / 2
    weights = np.sin(waves * middle) * np.sinc(waves * width / (2 * np.pi)) / waves
    return np.concatenate([mean[..., np.newaxis], -np.sqrt(2) * np.diff(x) @ weights.T], axis=-1)


def segment_means(position: ArrayLike, signal: ArrayLike, n_segments: int) -> Array:
    """Average a signal over equal segments of the stroke.

    Parameters
    ----------
    position : array-like of shape (n_samples,)
        From 0 to 1, never falling; see `stroke_positions`.
    signal : array-like of shape (..., n_samples)
        Signal there, in any unit U.
    n_segments : int
        Number of segments.

    Returns
    -------
    ndarray of shape (..., n_segments)
        Mean over the position within each segment [U].

    Raises
    ------
    TypeError, ValueError
        If the positions are not as above, or do not fit the signal.

    Examples
    --------
    >>> segment_means([0, 1], [0, 1], 4).tolist()
    [0.125, 0.375, 0.625, 0.875]
    """
    p, x = _checked(position, signal)
    edges = np.arange(check_count(n_segments, "n_segments") + 1) / n_segments
    width = np.diff(p)
    pieces = (x[..., 1:] + x[..., :-1]) / 2 * width
    before = np.concatenate([np.zeros_like(x[..., :1]), np.cumsum(pieces, axis=-1)], axis=-1)
    left = np.clip(np.searchsorted(p, edges, side="right") - 1, 0, len(p) - 2)
    inside = edges - p[left]
    steep = np.where(width[left] > 0, inside / np.where(width[left] > 0, width[left], 1.0), 0.0)
    # The trapezium from the sample on the left to the edge.
    area = (x[..., left] + (x[..., left + 1] - x[..., left]) * steep / 2) * inside
    return np.diff(before[..., left] + area, axis=-1) * n_segments


def _checked(position: ArrayLike, signal: ArrayLike) -> tuple[Array, Array]:
    p = check_signal(position, "position").astype(np.float64)
    x = np.asarray(signal, dtype=np.float64)
    if x.ndim == 0 or x.shape[-1] != len(p):
        raise ValueError(f"a signal of shape {x.shape} does not fit {len(p)} positions.")
    if p[0] != 0 or p[-1] != 1 or np.any(np.diff(p) < 0):
        raise ValueError(
            f"positions must run from 0 to 1 and never fall; they run from {p[0]:g} to "
            f"{p[-1]:g}. See stroke_positions."
        )
    return p, x
