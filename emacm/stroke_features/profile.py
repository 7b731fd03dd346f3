"""Profile of each channel along the strokes of a recording, as few coefficients.

Between its samples a signal is linear, and all integrals are exact. Samples may therefore lie at
any positions: evenly spaced over the angle, or closer together where the shaft is slow.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_count
from emacm.stroke_features.transformer import StrokeFeatures, StrokeSignal

Array = NDArray[np.float64]


class StrokeProfile(StrokeFeatures):
    """Profile of each channel along the stroke, as few coefficients.

    The coefficients are projections on the orthonormal cosines with 0, 1, 2, ... half waves along
    the stroke, in the unit of the channel. The friction of a screw varies along its length, and so
    does the load of an actuator along its travel. These changes are slow, over many revolutions;
    order spectra remove them with the mean or do not resolve them.

    Parameters
    ----------
    n_coefficients : int
        Number of coefficients for each channel and direction, at most 10000.
    channels : sequence of str, optional
        Channels to describe, in this order. Default: those of the first recording.
    by_direction : bool or "auto"
        Compute forward and reverse strokes separately, as columns ``channel+:…`` and
        ``channel-:…``. "auto": if a recording of `fit` has strokes of both directions.
    min_speed : float
        Speed up to which the shaft counts as standing still [rad/s], as in `OrderResampler`. For
        resampled recordings, the value given there applies.
    min_revolutions : float
        Shorter strokes are ignored [revolutions]. A noisy shaft reference at standstill can give
        strokes of a fraction of a revolution, which `min_speed` does not exclude.
    n_jobs : int, optional
        Number of recordings processed in parallel, by joblib's active backend (default: threads).

    Attributes
    ----------
    channels_ : tuple of str
        Channels that are described.

    See Also
    --------
    emacm.ShaftHarmonics : Amplitude and phase at multiples of shaft speed.
    emacm.OrderPSD : Spectra of strokes.

    Notes
    -----
    `X` is a list of `Recording`, or the output of `OrderResampler`. In both cases the integrals
    are over the shaft angle, and the signal is linear between its samples. The position is 0 at
    the first sample of each stroke and 1 at the last, in its own direction of motion. The profiles
    of the strokes of one direction are averaged with their lengths as weights. Columns
    are named ``channel+:cosine0``, ``channel-:cosine0``, or ``channel:cosine0`` for both
    directions together.

    Coefficient k of a cosine has k / 2 waves along a stroke. If that is far below the number of
    revolutions of the stroke, no coefficient depends on the 1x component or its phase.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import Recording, StrokeProfile
    >>> angle = np.linspace(0, 100, 1001)
    >>> run = Recording({"torque": 2 + 0.01 * angle}, 1000, angle=angle)
    >>> profile = StrokeProfile(2, by_direction=False).set_output(transform="pandas")
    >>> profile.fit_transform([run]).round(3)
       torque:cosine0  torque:cosine1
    0             2.5          -0.287
    """

    def __init__(
        self,
        n_coefficients: int = 8,
        *,
        channels: Sequence[str] | None = None,
        by_direction: bool | str = "auto",
        min_speed: float = 0.0,
        min_revolutions: float = 0.0,
        n_jobs: int | None = None,
    ) -> None:
        super().__init__(channels, by_direction, min_speed, min_revolutions, n_jobs)
        self.n_coefficients = n_coefficients

    def _check_own_parameters(self) -> None:
        check_count(self.n_coefficients, "n_coefficients", at_most=10_000)

    def _feature_names(self) -> list[str]:
        return [f"cosine{k}" for k in range(self.n_coefficients)]

    def _features(self, strokes: Sequence[StrokeSignal]) -> NDArray[np.float64]:
        long = [s for s in strokes if len(s.travel) > 1 and np.max(s.travel) > s.travel[0]]
        if not long:
            raise ValueError("no stroke contains two samples. Lower theta_s, or leave it out.")
        profiles = [
            cosine_coefficients(stroke_positions(s.travel), s.signal, self.n_coefficients)
            for s in long
        ]
        # Weighted by length, as in RecordingStatistics; noise at rest makes very short strokes.
        return np.average(profiles, axis=0, weights=[np.ptp(s.travel) for s in long])


def stroke_positions(travel: ArrayLike) -> Array:
    """Return positions along a stroke, from 0 at its first sample to 1 at its last.

    Parameters
    ----------
    travel : array-like of shape (n_samples,)
        Angle travelled [rad, or any unit]. Small reversals count as standing.

    Returns
    -------
    ndarray of shape (n_samples,)
        Non-decreasing.

    Examples
    --------
    >>> stroke_positions([2.0, 3.0, 2.9, 6.0]).tolist()
    [0.0, 0.25, 0.25, 1.0]
    """
    farthest = np.maximum.accumulate(np.asarray(travel, dtype=np.float64))
    return (farthest - farthest[0]) / (farthest[-1] - farthest[0])


def cosine_coefficients(position: ArrayLike, signal: ArrayLike, n_coefficients: int) -> Array:
    """Project a signal on the cosines with the fewest half waves along the stroke.

    Parameters
    ----------
    position : array-like of shape (n_samples,)
        From 0 to 1, non-decreasing; see `stroke_positions`.
    signal : array-like of shape (n_samples,)
        Signal at these positions, in any unit U.
    n_coefficients : int
        Number of coefficients; coefficient k has k half waves along the stroke.

    Returns
    -------
    ndarray of shape (n_coefficients,)
        Integrals of the signal times 1, √2 cos(πp), √2 cos(2πp), ... over the position p [U].
        The cosines are orthonormal: the squares of all coefficients add up to the mean square
        over the position (Parseval), and the first is the mean.

    Notes
    -----
    For a piecewise linear signal with the increments Δx, integration by parts gives
    ``-(√2/ω) Σ Δx sin(ω p) sinc(ω Δp / 2)`` at ω = πk, with p the centre of each piece.

    Examples
    --------
    >>> ramp = cosine_coefficients([0, 1], [0, 1], 3)
    >>> np.allclose(ramp, [1 / 2, -2 * np.sqrt(2) / np.pi**2, 0])
    True
    """
    p, x = np.asarray(position, dtype=np.float64), np.asarray(signal, dtype=np.float64)
    middle, width, rise = (p[1:] + p[:-1]) / 2, np.diff(p), np.diff(x)
    coefficients = [(x[1:] + x[:-1]) @ width / 2]
    for omega in np.pi * np.arange(1, n_coefficients):
        weights = np.sin(omega * middle) * np.sinc(omega * width / (2 * np.pi))
        coefficients.append(-np.sqrt(2) / omega * (rise @ weights))
    return np.array(coefficients)
