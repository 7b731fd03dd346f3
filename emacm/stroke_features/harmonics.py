"""Shaft-locked lines (1x, 2x, ...): amplitude and phase of each channel in the strokes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_choice, check_count, check_orders
from emacm.orders.columns import number_name
from emacm.recordings.recording import Recording
from emacm.resampling.angle_recording import AngleRecording
from emacm.stroke_features.transformer import Row, Samples, StrokeFeatures, StrokeSignal

Array = NDArray[np.float64]

_COLUMNS = {
    "absolute": ("cos", "sin"),
    "relative": ("in_phase", "quadrature"),
    None: ("amplitude",),
}


class ShaftHarmonics(StrokeFeatures):
    """Amplitude and phase of shaft-locked lines: the 1x, 2x, ... components of each channel.

    The coefficients are those of a time-synchronous average: a component that repeats at the
    same shaft angle in every revolution remains, and everything else averages out.

    Parameters
    ----------
    orders : sequence of float
        Orders of the lines, in cycles per revolution.
    channels : sequence of str, optional
        Channels, in this order. Default: those of the first recording.
    by_direction : bool or "auto"
        Compute forward and reverse strokes separately, as columns ``channel+:…`` and
        ``channel-:…``. "auto": if a recording of `fit` has strokes of both directions.
    phase : {"absolute", "relative", None}
        "absolute": coefficients c and s of ``c cos(order * angle) + s sin(order * angle)``, in
        the unit of the channel, against the shaft angle. "relative": the same, with all phases
        relative to that of the first order in the forward strokes (of all strokes, without
        `by_direction`). None: amplitudes, sqrt(c² + s²).
    n_sections : int
        Number of equal sections of each stroke with coefficients of their own, for friction
        that varies along a screw; numbered from 1 in the direction of motion.
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
    emacm.OrderPSD : Power at all orders.
    emacm.SynchronousAverage : The average over revolutions.

    Notes
    -----
    **Absolute phases compare recordings of one assembly only.** The shaft angle of a line follows
    from how the parts were assembled (which teeth mesh, where the zero of the sensor lies) as much
    as from their condition. With ``phase="absolute"`` a classifier can learn to recognise the
    assemblies of the training data and fail on any other. Absolute phases also need a measured
    shaft angle: an angle that is integrated from a velocity starts at 0 wherever the shaft was.

    **Relative phases** do not change with the zero of the shaft angle or the mounting angle of a
    part, as long as the line has the same shaft angle in both directions. With c_k - j s_k the
    coefficient of order k, and φ the angle of the mean over sections at the first order k_1 of
    forward strokes, the columns are the real and negative imaginary part of
    (c_k - j s_k) exp(-j φ k / k_1). All orders must be whole multiples of k_1. If the
    forward line is weaker than the noise, φ is noise. Other properties of an assembly, such as
    the phase of reverse relative to forward strokes, remain.

    `X` is a list of `Recording`, or the output of `OrderResampler` (whose filter attenuates orders
    above 0.78 π/theta_s), but not with ``direction="travel"``. In the middle of each stroke, or
    section of it, the largest number of whole revolutions is used; strokes of less than one
    revolution are ignored. One set of lines is fitted to all strokes of a direction by least
    squares; see `harmonic_coefficients`.

    Columns are named ``channel+:cos1``, ``channel+:sin1``, ``channel-:cos1`` and so on
    (``channel:cos1`` for both directions together), ``channel+:in_phase1`` and
    ``channel+:quadrature1`` for relative phases, ``channel+:amplitude1`` for amplitudes, and
    ``channel+:1of4:cos1`` for sections.

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
        by_direction: bool | str = "auto",
        phase: str | None = "absolute",
        n_sections: int = 1,
        min_speed: float = 0.0,
        min_revolutions: float = 0.0,
        n_jobs: int | None = None,
    ) -> None:
        super().__init__(channels, by_direction, min_speed, min_revolutions, n_jobs)
        self.orders = orders
        self.phase = phase
        self.n_sections = n_sections

    _needs_angle = True

    def _check_own_parameters(self) -> None:
        orders = np.array(check_orders(self.orders))
        check_choice(self.phase, "phase", tuple(_COLUMNS))
        check_count(self.n_sections, "n_sections", at_most=10_000)
        multiples = orders / orders[0]
        whole = np.isclose(multiples, np.round(multiples), rtol=0, atol=1e-9)
        if self.phase == "relative" and not np.all(whole):
            raise ValueError(
                f"phase='relative' needs orders that are whole multiples of the first one, got "
                f"{orders.tolist()}: the phase of order {orders[np.argmin(whole)]:g} does not "
                f"follow from that of order {orders[0]:g}. Use phase='absolute' or None, or "
                f"another ShaftHarmonics for this order."
            )

    def _check_row(self, row: Row) -> None:
        super()._check_row(row)
        measured: Recording = row.measured if isinstance(row, AngleRecording) else row
        if self.phase == "absolute" and measured.reference == "velocity":
            raise ValueError(
                "its shaft reference is a velocity, so the angle starts at 0 wherever the shaft "
                "was, and phases of two recordings cannot be compared. Make the Recording with "
                "angle=..., or use ShaftHarmonics with phase='relative' or phase=None."
            )

    def _feature_names(self) -> list[str]:
        lines = [word + number_name(k) for k in self.orders for word in _COLUMNS[self.phase]]
        if self.n_sections == 1:
            return lines
        numbers = range(1, self.n_sections + 1)
        return [f"{number}of{self.n_sections}:{line}" for number in numbers for line in lines]

    def _features(self, strokes: Sequence[StrokeSignal]) -> Array:
        lines = np.stack([self._of_section(strokes, k) for k in range(self.n_sections)])
        return (lines if self.phase else np.hypot(lines[..., 0], lines[..., 1])).ravel()

    def _of_section(self, strokes: Sequence[StrokeSignal], section: int) -> Array:
        """Fit one section of all strokes, shape (n_orders, 2)."""
        sections = [(s, whole_revolutions(s.travel, section, self.n_sections)) for s in strokes]
        cut = [stroke.cut(whole) for stroke, whole in sections if whole is not None]
        if not cut:
            longest = max(float(np.ptp(stroke.travel)) for stroke in strokes) / (2 * np.pi)
            of = f"each of {self.n_sections} sections of a " if self.n_sections > 1 else "a "
            raise ValueError(
                f"a shaft-locked line needs one whole revolution in {of}stroke, but the "
                f"longest stroke has {longest:.4g} revolutions. Lower n_sections, check "
                f"min_speed, or leave the recording out."
            )
        angles, signals = [stroke.angle for stroke in cut], [stroke.signal for stroke in cut]
        return harmonic_coefficients(angles, signals, self.orders).T

    def _row(self, row: Row) -> Array:
        values = super()._row(row)
        if self.phase != "relative":
            return values
        n_ways = 2 if self.by_direction_ else 1
        shape = (len(self.channels_), n_ways, self.n_sections, len(self.orders), 2)
        return _relative(values.reshape(shape), np.asarray(self.orders, dtype=float)).ravel()


def _relative(lines: Array, orders: Array) -> Array:
    """Refer phases of (channel, direction, section, order, [cos, sin]) to those of index 0."""
    waves = lines[..., 0] - 1j * lines[..., 1]
    reference = np.angle(waves[:, 0, :, 0].mean(axis=-1))
    turned = waves * np.exp(-1j * reference[:, None, None, None] * orders / orders[0])
    return np.stack([turned.real, -turned.imag], axis=-1)


def harmonic_coefficients(
    angles: Sequence[Samples], signals: Sequence[Samples], orders: ArrayLike
) -> Array:
    """Fit cosines and sines of the shaft angle to sections of a signal, by least squares.

    Parameters
    ----------
    angles : sequence of ndarray of shape (n_samples,)
        Shaft angle in each section [rad], rising or falling, evenly sampled or not.
    signals : sequence of ndarray of shape (n_samples,)
        Signal at these angles, in any unit U; sections may have different lengths.
    orders : array-like of shape (n_orders,)
        Orders, in cycles per revolution.

    Returns
    -------
    ndarray of shape (2, n_orders)
        Cosines c and sines s [U] of ``signal = level + trend * angle + Σ c cos(order * angle)
        + s sin(order * angle)``, where each section has its own level and trend. A cosine of -2
        and a sine of 0 is a line with its maxima half a cycle from the zero of the shaft angle.

    Raises
    ------
    ValueError
        If the shapes do not match, or the samples are too few or span too little to separate the
        orders, the levels and the trends.

    Notes
    -----
    Each sample is weighted by the angle that it represents, so that over whole revolutions the
    coefficients are those of the time-synchronous average, and other orders are rejected even
    if the speed changes. At even angles, apart from the trend, they are the Fourier coefficients
    of the average revolution (no source is cited).

    Examples
    --------
    >>> angle = 2 * np.pi * np.linspace(0, 5, 500)
    >>> signal = 7 + 2 * np.cos(angle) + np.sin(angle) - np.cos(2 * angle) - 3 * np.sin(2 * angle)
    >>> harmonic_coefficients([angle], [signal], (1, 2)).round(9).tolist()
    [[2.0, -1.0], [1.0, -3.0]]
    """
    chosen = np.asarray(orders, dtype=np.float64)
    travels = [np.maximum.accumulate(np.abs(theta - theta[0])) for theta in angles]
    turned = sum(travel[-1] for travel in travels) / (2 * np.pi)
    n_samples = sum(map(len, travels))
    density = (n_samples - len(travels)) / turned
    if not chosen.max() < density / 2:
        raise ValueError(
            f"order {chosen.max():g} is above the Nyquist order {density / 2:.4g} of "
            f"{density:.4g} samples per revolution. Choose lower orders."
        )
    parts = []
    for theta, x, travel in zip(angles, signals, travels, strict=True):
        waves = chosen[:, np.newaxis] * theta
        rows = np.column_stack([np.cos(waves).T, np.sin(waves).T, x])
        parts.append(_without_trend(rows, theta, np.sqrt(np.gradient(travel))))
    left = np.concatenate(parts)
    solution, _, rank, _ = np.linalg.lstsq(left[:, :-1], left[:, -1], rcond=1e-9)
    if rank < len(solution):
        raise ValueError(
            f"{n_samples} samples over {turned:.4g} revolutions do not separate the orders "
            f"{chosen.tolist()} from one another and a trend. Use longer sections or fewer orders."
        )
    return np.asarray(solution, dtype=np.float64).reshape(2, -1)


def whole_revolutions(travel: ArrayLike, section: int = 0, n_sections: int = 1) -> slice | None:
    """Return the samples of the most whole revolutions in the middle of a section of a stroke.

    Parameters
    ----------
    travel : array-like of shape (n_samples,)
        Angle travelled [rad], from 0 upwards.
    section, n_sections : int
        Number of the section, from 0, and number of equal sections of the stroke.

    Returns
    -------
    slice or None
        None if the section contains no whole revolution, or a single sample.

    Examples
    --------
    >>> whole_revolutions(2 * np.pi * np.arange(0, 5.5, 0.25))
    slice(1, 21, None)
    """
    run = np.maximum.accumulate(np.asarray(travel, dtype=np.float64))
    if len(run) < 2:
        return None
    # A sample represents the angle up to the next one, so the stroke ends one step after the last.
    step = (run[-1] - run[0]) / (len(run) - 1)
    edges = np.array([section, section + 1]) / n_sections
    low, high = run[0] + (run[-1] + step - run[0]) * edges
    revolutions = np.floor((high - low) / (2 * np.pi) + 1e-6)
    if revolutions < 1:
        return None
    spare = (high - low - revolutions * (2 * np.pi)) / 2
    first, last = np.searchsorted(run, np.array([low + spare, high - spare]) - 1e-6 * step)
    return slice(int(first), int(last)) if last - first > 1 else None


def _without_trend(rows: Array, theta: Samples, weight: Array) -> Array:
    """Weight columns, and remove a level and a trend from each of them."""
    trend = np.column_stack([np.ones_like(theta), theta - theta.mean()]) * weight[:, np.newaxis]
    weighted = rows * weight[:, np.newaxis]
    return weighted - trend @ np.linalg.lstsq(trend, weighted, rcond=1e-9)[0]
