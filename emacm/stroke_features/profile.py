"""The course of each channel along the strokes of a recording, as named columns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from emacm._checks import check_choice, check_count
from emacm.stroke_features.profiles import cosine_coefficients, segment_means, stroke_positions
from emacm.stroke_features.signals import StrokeSignal
from emacm.stroke_features.transformer import StrokeFeatures

_BASES = {"cosine": cosine_coefficients, "mean": segment_means}


class StrokeProfile(StrokeFeatures):
    """Describe in few numbers how each channel runs along the stroke.

    Friction of a screw varies along it, and load along the way of an actuator: slow changes,
    over many revolutions, which order spectra take out with the mean or cannot resolve.

    Parameters
    ----------
    n_coefficients : int
        Numbers for each channel and direction.
    channels : sequence of str, optional
        Channels to describe, in this order. Default: those of the first recording.
    by_direction : bool
        Give forward and reverse strokes columns of their own, ``channel+:…`` and ``channel-:…``.
    basis : {"cosine", "mean"}
        "cosine": projections on the orthonormal cosines with 0, 1, 2, ... half waves along the
        stroke; "mean": means of equal segments of the stroke. Both in the channel's unit.
    min_speed : float
        Speed up to which the shaft counts as standing [rad/s], as for `OrderResampler`; over
        the shaft angle that one's holds.
    min_revolutions : float
        Shorter strokes are passed over [revolutions]. Where the shaft's reference is noisy at
        rest, jitter makes strokes of a fraction of a revolution that `min_speed` cannot tell.
    n_jobs : int, optional
        Recordings in work at the same time, under joblib's active backend (by default, threads).

    Attributes
    ----------
    channels_ : tuple of str
        Channels that are described.

    Notes
    -----
    `X` is a list of `Recording`, or what `OrderResampler` returns; the integrals are over the
    shaft angle in both cases, and the signal is taken as straight lines between its samples. The
    position runs from 0 at the first to 1 at the last sample of each stroke in its own
    direction of motion. Strokes of one direction are averaged, weighted by their lengths.
    Columns are named ``channel+:cosine0``, ``channel-:cosine0``, or ``channel:cosine0`` of both
    directions; of means ``channel+:segment0``.

    Coefficient k of a cosine has k / 2 waves along a stroke. As long as that is far below the
    revolutions of the stroke, no coefficient sees a wave once per revolution, nor its phase.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import Recording, StrokeProfile
    >>> angle = np.linspace(0, 100, 1001)
    >>> run = Recording({"torque": 2 + 0.01 * angle}, 1000, angle=angle)
    >>> profile = StrokeProfile(2, basis="mean", by_direction=False)
    >>> profile.set_output(transform="pandas").fit_transform([run])
       torque:segment0  torque:segment1
    0             2.25             2.75
    """

    def __init__(
        self,
        n_coefficients: int = 8,
        *,
        channels: Sequence[str] | None = None,
        by_direction: bool = True,
        basis: str = "cosine",
        min_speed: float = 0.0,
        min_revolutions: float = 0.0,
        n_jobs: int | None = None,
    ) -> None:
        self.n_coefficients = n_coefficients
        self.channels = channels
        self.by_direction = by_direction
        self.basis = basis
        self.min_speed = min_speed
        self.min_revolutions = min_revolutions
        self.n_jobs = n_jobs

    def _check_own_parameters(self) -> None:
        check_count(self.n_coefficients, "n_coefficients")
        check_choice(self.basis, "basis", tuple(_BASES))

    def _feature_names(self) -> list[tuple[str, ...]]:
        word = "cosine" if self.basis == "cosine" else "segment"
        return [(f"{word}{k}",) for k in range(self.n_coefficients)]

    def _features(self, strokes: Sequence[StrokeSignal]) -> NDArray[np.float64]:
        project = _BASES[self.basis]
        long = [s for s in strokes if len(s.travel) > 1 and np.max(s.travel) > s.travel[0]]
        if not long:
            raise ValueError(
                "no stroke holds two samples, so that nothing is known along it. Resample to a "
                "smaller theta_s, or leave the recording out."
            )
        profiles = [
            project(stroke_positions(s.travel), s.signal, self.n_coefficients) for s in long
        ]
        # By length, as statistics are pooled; and noise at rest makes strokes of no length.
        return np.average(profiles, axis=0, weights=[np.ptp(s.travel) for s in long])
