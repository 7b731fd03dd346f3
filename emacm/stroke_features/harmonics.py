"""Amplitude and phase of lines that are locked to the shaft, as named columns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from emacm._checks import check_choice, check_count
from emacm.orders.columns import number_name
from emacm.recordings.recording import Recording
from emacm.resampling.angle_recording import AngleRecording
from emacm.stroke_features.harmonic_sums import (
    check_orders,
    harmonic_coefficients,
    whole_revolutions,
)
from emacm.stroke_features.signals import StrokeSignal
from emacm.stroke_features.transformer import Row, StrokeFeatures


class ShaftHarmonics(StrokeFeatures):
    """Give the coefficients of shaft-locked lines against the absolute shaft angle.

    They are the coefficients of a synchronous average: what comes with every revolution at
    the same place of the shaft stays, all else averages out.

    **For the same assemblies only.** Where on the shaft a line stands follows from how the
    parts were put together (which tooth met which, where the sensor's zero lies) as much as from
    their state. With ``phase=True`` a classifier learns assemblies: it may tell the units
    that it was trained on without fail, and know nothing of their health. Compare
    recordings of one assembly, or set ``phase=False``.

    Parameters
    ----------
    orders : sequence of float
        Orders of the lines, in cycles per revolution.
    channels : sequence of str, optional
        Channels, in this order. Default: those of the first recording.
    by_direction : bool
        Give forward and reverse strokes columns of their own, ``channel+:…`` and ``channel-:…``.
    phase : bool
        True: cosine and sine coefficients c and s, of ``c cos(order * angle) + s sin(order *
        angle)``, in the channel's unit. False: amplitudes, sqrt(c² + s²), which do not change
        with the zero of the shaft angle.
    n_parts : int
        Equal parts of each stroke with coefficients of their own, as waves of friction may
        change along a screw; numbered from 1 in the direction of motion.
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
    `X` is a list of `Recording`, or what `OrderResampler` returns (its filter lowers orders above
    0.78 π/theta_s), but not with ``direction="travel"``. In the middle of each stroke, or part of
    it, the most whole revolutions are taken. One set of lines is fitted to all strokes of a
    direction by least squares, each sample counting by the angle it stands for, and each stroke
    having a level and a linear trend of its own; strokes too short for a revolution are passed
    over. Columns are named ``channel+:cos1``, ``channel+:sin1``, ``channel-:cos1`` and so on, or
    ``channel:cos1`` of both directions; of amplitudes ``channel+:amplitude1``; of parts
    ``channel+:1of4:cos1``.

    With ``phase=True`` the shaft's reference must be an angle. One that is integrated
    from a velocity starts at 0 wherever the shaft stood.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import Recording, ShaftHarmonics
    >>> angle = np.linspace(0.3, 60, 3000)
    >>> current = 4 + np.cos(angle) - 2 * np.sin(angle)
    >>> run = Recording({"current": current}, 1000, angle=angle)
    >>> lines = ShaftHarmonics((1,), by_direction=False)
    >>> lines.set_output(transform="pandas").fit_transform([run]).round(6)
       current:cos1  current:sin1
    0           1.0          -2.0
    """

    def __init__(
        self,
        orders: Sequence[float] = (1, 2),
        *,
        channels: Sequence[str] | None = None,
        by_direction: bool = True,
        phase: bool = True,
        n_parts: int = 1,
        min_speed: float = 0.0,
        min_revolutions: float = 0.0,
        n_jobs: int | None = None,
    ) -> None:
        self.orders = orders
        self.channels = channels
        self.by_direction = by_direction
        self.phase = phase
        self.n_parts = n_parts
        self.min_speed = min_speed
        self.min_revolutions = min_revolutions
        self.n_jobs = n_jobs

    @property
    def _absolute(self) -> bool:
        """Whether features depend on where the shaft angle is 0."""
        return self.phase

    def _check_own_parameters(self) -> None:
        check_orders(self.orders)
        check_choice(self.phase, "phase", (True, False))
        check_count(self.n_parts, "n_parts")

    def _check_row(self, row: Row) -> None:
        super()._check_row(row)
        if isinstance(row, AngleRecording) and row.direction == "travel":
            raise ValueError(
                "it was resampled with direction='travel', which has no shaft angle: phases turn "
                "over at each reversal. Use direction='strokes'."
            )
        measured: Recording = row.measured if isinstance(row, AngleRecording) else row
        if self._absolute and measured.reference == "velocity":
            raise ValueError(
                "its shaft reference is a velocity, so the angle starts at 0 wherever the shaft "
                "stood, and phases of two recordings cannot be compared. Make the Recording with "
                "angle=..., or set phase=False of ShaftHarmonics."
            )

    def _feature_names(self) -> list[tuple[str, ...]]:
        words = ("cos", "sin") if self.phase else ("amplitude",)
        lines = [word + number_name(order) for order in self.orders for word in words]
        if self.n_parts == 1:
            return [(line,) for line in lines]
        parts = [f"{part}of{self.n_parts}" for part in range(1, self.n_parts + 1)]
        return [(part, line) for part in parts for line in lines]

    def _features(self, strokes: Sequence[StrokeSignal]) -> NDArray[np.float64]:
        found = np.stack([self._of_part(strokes, part) for part in range(self.n_parts)])
        return (found if self.phase else np.hypot(found[..., 0], found[..., 1])).ravel()

    def _of_part(self, strokes: Sequence[StrokeSignal], part: int) -> NDArray[np.float64]:
        """Fit one part of all strokes, shape (n_orders, 2)."""
        found = [(s, whole_revolutions(s.travel, part, self.n_parts)) for s in strokes]
        cut = [stroke.cut(whole) for stroke, whole in found if whole is not None]
        if not cut:
            longest = max(float(np.ptp(stroke.travel)) for stroke in strokes) / (2 * np.pi)
            of = f"each of {self.n_parts} parts of a stroke" if self.n_parts > 1 else "a stroke"
            raise ValueError(
                f"a shaft-locked line needs a whole revolution of {of}, but the "
                f"longest stroke runs {longest:.4g} revolutions. Lower n_parts, check min_speed, "
                f"or leave the recording out."
            )
        lines = harmonic_coefficients(
            [stroke.angle for stroke in cut], [stroke.signal for stroke in cut], self.orders
        )
        return np.stack([lines.cosines, lines.sines], axis=-1)
