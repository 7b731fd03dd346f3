"""Time-synchronous average, residual signal of gears, and their indicators as named columns.

The signals of the functions are one revolution of the shaft of the gear, at uniform angles.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from emacm._checks import check_count
from emacm._statements import warn
from emacm.recordings.inputs import for_each
from emacm.resampling.angle_recording import as_angle_recordings
from emacm.stroke_features.statistics import normalized_moment
from emacm.stroke_features.transformer import StrokeFeatures, StrokeSignal

Array = NDArray[np.float64]

_INDICATORS = ("FM0", "FM4", "M6A", "sidebands", "NA4", "NB4")
# Levels are at least this, so that a signal without power has finite indicators.
_LEAST = float(np.finfo(np.float64).tiny) ** 0.25  # its square does not underflow


class _RevolutionFeatures(StrokeFeatures):
    """Base of features of averaged revolutions, which have the same number of samples each."""

    _needs_angle = True

    def __init__(
        self,
        *,
        channels: Sequence[str] | None = None,
        by_direction: bool | str = "auto",
        n_jobs: int | None = None,
    ) -> None:
        super().__init__(channels, by_direction, 0.0, 1.0, n_jobs)

    def fit(self, X: Any, y: Any = None) -> Self:
        """Set the channels, the samples per revolution and the names of the columns.

        Parameters
        ----------
        X : output of OrderResampler
            Recordings over the shaft angle.
        y : ignored

        Returns
        -------
        estimator
            Itself.

        Raises
        ------
        TypeError, ValueError
            If a parameter or X is invalid.
        """
        first = as_angle_recordings(X, type(self).__name__)[0]
        self._n_samples = round(2 * np.pi / first.theta_s)
        return super().fit(X)

    def _check_row(self, row: Any) -> None:
        super()._check_row(row)
        exact = 2 * np.pi / row.theta_s
        if abs(exact - self._n_samples) > 1e-9 * self._n_samples:
            raise ValueError(
                f"it has {exact:.9g} samples per revolution, but averages need "
                f"{self._n_samples}. Set theta_s = 2 * np.pi / {self._n_samples} of OrderResampler."
            )


class SynchronousAverage(_RevolutionFeatures):
    """Time-synchronous average (TSA): the mean over whole revolutions of a shaft.

    What repeats in each revolution of the shaft stays, and everything else averages out. The
    shaft is that of `OrderResampler`: any shaft of the machine, by its `ratio`.

    Parameters
    ----------
    channels : sequence of str, optional
        Channels, in this order. Default: those of the first recording.
    by_direction : bool or "auto"
        Average forward and reverse strokes separately, as columns ``channel+:…`` and
        ``channel-:…``. "auto": if a recording of `fit` has strokes of both directions.
    n_jobs : int, optional
        Number of recordings processed in parallel, by joblib's active backend (default: threads).

    Attributes
    ----------
    channels_ : tuple of str
        Channels that are averaged.

    See Also
    --------
    emacm.GearIndicators : Indicators of the average of a gear.
    emacm.ShaftHarmonics : Amplitude and phase at multiples of shaft speed.

    Notes
    -----
    `X` is the output of `OrderResampler` with 2π/theta_s a whole number n of samples per
    revolution. The largest number of whole revolutions of each stroke is averaged; shorter strokes
    are ignored. Strokes are aligned at the shaft angle and weighted by their revolutions. Columns
    ``channel:average0`` to ``channel:average(n-1)``: the average at angles 0, theta_s,
    2 theta_s, ... of the shaft. With a velocity as the reference, the angle starts at 0 wherever
    the shaft was. A component of another shaft is reduced to 1/(number of revolutions) or less, as
    is noise to 1/sqrt(number of revolutions).

    References
    ----------
    .. [1] McFadden, A revised model for the extraction of periodic waveforms by time domain
       averaging, Mech. Syst. Signal Process. 1 (1987).

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import OrderResampler, Recording, SynchronousAverage
    >>> angle = np.linspace(0, 40.5 * 2 * np.pi, 50_000)
    >>> run = Recording({"case": np.cos(2 * angle)}, 10_000, angle=angle)
    >>> over_angle = OrderResampler(2 * np.pi / 8).fit_transform([run])
    >>> average = SynchronousAverage().fit_transform(over_angle)
    >>> average.round(2)[0, :5].tolist()
    [1.0, 0.0, -1.0, 0.0, 1.0]
    """

    def _feature_names(self) -> list[str]:
        return [f"average{k}" for k in range(self._n_samples)]

    def _features(self, strokes: Sequence[StrokeSignal]) -> Array:
        return average_revolution(strokes, self._n_samples)


class GearIndicators(_RevolutionFeatures):
    """Condition indicators of gears, from the time-synchronous average of their shaft.

    Parameters
    ----------
    teeth : int
        Teeth of the gear on the shaft of `OrderResampler` (see its `ratio`).
    channels : sequence of str, optional
        Channels, in this order. Default: those of the first recording.
    by_direction : bool or "auto"
        Compute forward and reverse strokes separately, as columns ``channel+:…`` and
        ``channel-:…``: teeth have two flanks. "auto": if a recording of `fit` has strokes of both
        directions.
    n_jobs : int, optional
        Number of recordings processed in parallel, by joblib's active backend (default: threads).

    Attributes
    ----------
    channels_ : tuple of str
        Channels that are described.
    ensemble_ : ndarray of shape (n_channels * n_directions, 2)
        Variances of the residual signal and of the envelope, averaged over the recordings of
        `fit`: the run ensemble of NA4 and NB4.

    See Also
    --------
    emacm.SynchronousAverage : The average from which they are computed.
    emacm.Gear : Numbers of teeth.

    Notes
    -----
    Columns ``channel:FM0`` and so on [1]_:

    - "FM0": peak-to-peak value over the amplitudes of the mesh harmonics: faults of several teeth;
    - "FM4", "M6A": normalised 4th and 6th moment of the difference signal: faults of one or two
      teeth; 3 and 15 if it is Gaussian;
    - "sidebands": amplitudes of the first sidebands of the mesh over the RMS of the average;
    - "NA4", "NB4": 4th moment of the residual signal, and of the envelope of the mesh, over the
      square of their variance *in the recordings of fit*; about 3 for a gear without fault, and
      growing with the damage. Fit on healthy recordings, or on all runs so far: the transform of
      a recording never depends on the others of the same call.

    The residual signal is the average without mesh harmonics and the first two shaft harmonics;
    the difference signal lacks the first sidebands too. All need several whole revolutions, and
    several samples per tooth: theta_s of 2π / (8 teeth), say.

    An error of the shaft angle once per revolution (an eccentric encoder or resolver, uneven
    tachometer pulses) modulates the phase of the mesh by beta = error x teeth [rad], and so does an
    eccentric gear: the two cannot be told apart (`phase_modulation`). Simulated gears with 13 to 40
    teeth, noise of 0.5 % of the mesh: at beta = 0.2, FM4 of a tooth with 5 % less amplitude falls
    from 8.3 and 18 to 4.8 and 5.3, and that of a sound gear rises from 3 to 4; at 0.5, a loss of
    10 % cannot be seen any more, and at 1.2 one of 80 %. NA4 of a sound gear is 60 times larger
    already at 0.02 if `fit` had no such error. NB4 keeps at least three quarters of its increase
    (``benchmarks/stated_limits.py``). From 0.2 on `transform` warns. An eccentricity e of a gear of
    module m has about 2 e / m: 0.02 for 20 µm and 2 mm.

    References
    ----------
    .. [1] Zakrajsek, Townsend and Decker, An analysis of gear fault detection methods as applied
       to pitting fatigue failure data, NASA TM-105950 (1993).

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import GearIndicators, OrderResampler, Recording
    >>> angle = np.linspace(0, 60 * 2 * np.pi, 60_000)
    >>> noise = 0.1 * np.random.default_rng(0).normal(size=60_000)
    >>> run = Recording({"case": np.cos(13 * angle) + noise}, 10_000, angle=angle)
    >>> over_angle = OrderResampler(2 * np.pi / 128).fit_transform([run])
    >>> gear = GearIndicators(13).set_output(transform="pandas")
    >>> float(gear.fit_transform(over_angle)["case:FM0"].round(1)[0])
    2.0
    """

    def __init__(
        self,
        teeth: int,
        *,
        channels: Sequence[str] | None = None,
        by_direction: bool | str = "auto",
        n_jobs: int | None = None,
    ) -> None:
        super().__init__(channels=channels, by_direction=by_direction, n_jobs=n_jobs)
        self.teeth = teeth

    def fit(self, X: Any, y: Any = None) -> Self:
        """Set the channels and the names of the columns, and average the run ensemble.

        Parameters
        ----------
        X : output of OrderResampler
            Recordings over the shaft angle.
        y : ignored

        Returns
        -------
        GearIndicators
            Itself.

        Raises
        ------
        TypeError, ValueError
            If a parameter or X is invalid.
        """
        super().fit(X)
        moments = self._moments(for_each(self._row, X, self.n_jobs))
        self.ensemble_ = moments[:, :, 6:8].mean(axis=0)
        return self

    def _check_own_parameters(self) -> None:
        check_count(self.teeth, "teeth", at_least=4)
        mesh_orders(self.teeth, self._n_samples, sidebands=1)

    def _feature_names(self) -> list[str]:
        return list(_INDICATORS)

    def _features(self, strokes: Sequence[StrokeSignal]) -> list[float]:
        """Return the indicators, with moments for NA4, NB4, and what follows them.

        These are the two variances and the phase modulation.
        """
        average, teeth = average_revolution(strokes, self._n_samples), self.teeth
        residual = residual_signal(average, teeth)
        difference = residual_signal(average, teeth, sidebands=1)
        envelope = mesh_envelope(average, teeth)
        signals = residual, envelope - envelope.mean()
        return [
            fm0(average, teeth),
            *(normalized_moment(difference, order, least=_LEAST) for order in (4, 6)),
            sideband_level(average, teeth),
            *(float(np.mean(signal**power)) for power in (4, 2) for signal in signals),
            phase_modulation(average, teeth),
        ]

    def _moments(self, table: Any) -> Array:
        """Return what `_features` returns, by recording, and by channel and direction."""
        return np.reshape(table, (len(table), -1, len(_INDICATORS) + 3))

    def _checked_table(self, table: Array) -> Array:
        """Return the indicators; warn if the phase of a mesh is modulated by over 0.2 rad."""
        moments = self._moments(table)
        modulation = moments[:, :, -1]
        rows, gears = np.nonzero(modulation > 0.2)
        if len(rows):
            channel = self._columns_out[gears[0] * len(_INDICATORS)].rpartition(":")[0]
            warn(
                "angle reference",
                f"recording {rows[0]}: {channel}: the phase of the mesh is modulated once per "
                f"revolution by {modulation[rows[0], gears[0]]:.2g} rad (so in {len(set(rows))} of "
                f"{len(table)} recordings; accepted is 0.2). The angle reference has an error of "
                f"this over the teeth, or the gear is eccentric by half of this times its module. "
                f"FM4, M6A and NA4 miss small faults then: correct the reference, or use NB4.",
                stacklevel=4,
            )
        moments[:, :, 4:6] /= _positive(self.ensemble_) ** 2
        return moments[:, :, :6].reshape(len(table), -1)


def average_revolution(strokes: Sequence[StrokeSignal], n_samples: int) -> Array:
    """Average whole revolutions of strokes at uniform angles, aligned at the shaft angle.

    Parameters
    ----------
    strokes : sequence of StrokeSignal
        Signals at angles 2π / n_samples apart, of at least one revolution.
    n_samples : int
        Samples per revolution.

    Returns
    -------
    ndarray of shape (n_samples,)
        Average at the shaft angles 0, 2π / n_samples, ...
    """
    orders = np.arange(n_samples // 2 + 1)
    total, n_turns = np.zeros(len(orders), complex), 0
    for stroke in strokes:
        turns = len(stroke.signal) // n_samples
        whole = stroke.signal[: turns * n_samples].reshape(turns, n_samples)
        spectrum = np.fft.rfft(whole.sum(axis=0, dtype=np.float64))
        if stroke.direction < 0:
            spectrum = np.conj(spectrum)
        total += spectrum * np.exp(-1j * orders * stroke.start_angle)
        n_turns += turns
    return np.fft.irfft(total / n_turns, n_samples)


def mesh_orders(teeth: int, n_samples: int, *, sidebands: int = 0) -> NDArray[np.intp]:
    """Return the orders of the regular meshing components.

    Parameters
    ----------
    teeth : int
        Teeth of the gear, which is the order of the mesh.
    n_samples : int
        Samples per revolution.
    sidebands : int
        Number of sidebands on either side of each harmonic.

    Returns
    -------
    ndarray of shape (n_orders,), of int
        Harmonics of the mesh below half the samples per revolution, with their sidebands.

    Examples
    --------
    >>> mesh_orders(9, 50, sidebands=1).tolist()
    [8, 9, 10, 17, 18, 19]
    """
    highest = (n_samples - 1) // 2
    if teeth + sidebands > highest:
        raise ValueError(
            f"{teeth} teeth and {sidebands} sidebands need more than {2 * (teeth + sidebands)} "
            f"samples per revolution, got {n_samples}. Set theta_s = 2 * np.pi / "
            f"{8 * (teeth + sidebands)} or less."
        )
    harmonics = teeth * np.arange(1, (highest - sidebands) // teeth + 1)
    return (harmonics[:, np.newaxis] + np.arange(-sidebands, sidebands + 1)).ravel()


def residual_signal(average: Array, teeth: int, *, sidebands: int = 0) -> Array:
    """Remove the regular meshing components from a time-synchronous average [1]_.

    Parameters
    ----------
    average : ndarray of shape (n_samples,)
        One revolution, in any unit U.
    teeth : int
        Teeth of the gear.
    sidebands : int
        0: residual signal, without the harmonics of the mesh. 1: difference signal, also without
        the first sidebands on either side.

    Returns
    -------
    ndarray of shape (n_samples,)
        What is left [U], also without the mean and two harmonics of the shaft.

    References
    ----------
    .. [1] Zakrajsek, Townsend and Decker, An analysis of gear fault detection methods as applied
       to pitting fatigue failure data, NASA TM-105950 (1993).

    Examples
    --------
    >>> angle = 2 * np.pi * np.arange(64) / 64
    >>> average = np.cos(8 * angle) + 0.1 * np.cos(9 * angle) + 0.01 * np.cos(11 * angle)
    >>> residual, difference = (residual_signal(average, 8, sidebands=k) for k in (0, 1))
    >>> [round(float(signal.max()), 6) for signal in (residual, difference)]
    [0.11, 0.01]
    """
    spectrum = np.fft.rfft(average)
    spectrum[:3] = 0
    spectrum[mesh_orders(teeth, len(average), sidebands=sidebands)] = 0
    return np.fft.irfft(spectrum, len(average))


def fm0(average: Array, teeth: int) -> float:
    """Return FM0: peak-to-peak value over the sum of the amplitudes of the mesh harmonics [1]_.

    References
    ----------
    .. [1] Stewart, Some useful data analysis techniques for gearbox diagnostics, University of
       Southampton, MHM/R/10/77 (1977); NASA TM-105950.

    Examples
    --------
    >>> angle = 2 * np.pi * np.arange(64) / 64
    >>> round(fm0(3 * np.cos(8 * angle), 8), 6)
    2.0
    """
    amplitudes = _amplitudes(average)[mesh_orders(teeth, len(average))]
    return float(np.ptp(average) / _positive(amplitudes.sum()))


def mesh_envelope(average: Array, teeth: int) -> Array:
    """Return the envelope of the band of ± half the mesh order around the mesh order.

    Parameters
    ----------
    average : ndarray of shape (n_samples,)
        One revolution, in any unit U.
    teeth : int
        Teeth of the gear.

    Returns
    -------
    ndarray of shape (n_samples,)
        Envelope [U]; constant for a gear without fault.

    Examples
    --------
    >>> angle = 2 * np.pi * np.arange(64) / 64
    >>> envelope = mesh_envelope((2 + np.cos(angle)) * np.cos(8 * angle), 8)
    >>> np.allclose(envelope, 2 + np.cos(angle))
    True
    """
    spectrum = np.zeros(len(average), complex)
    low, high = teeth - teeth // 2, min(teeth + teeth // 2, (len(average) - 1) // 2)
    spectrum[low : high + 1] = 2 * np.fft.rfft(average)[low : high + 1]
    return np.abs(np.fft.ifft(spectrum))


def sideband_level(average: Array, teeth: int) -> float:
    """Return the sum of the amplitudes of the first sidebands of the mesh over the RMS.

    Examples
    --------
    >>> angle = 2 * np.pi * np.arange(64) / 64
    >>> round(sideband_level((1 + 0.2 * np.cos(angle)) * np.cos(8 * angle), 8), 4)
    0.2801
    """
    level = _amplitudes(average)[[teeth - 1, teeth + 1]].sum()
    return float(level / _positive(np.std(average)))


def phase_modulation(average: Array, teeth: int) -> float:
    """Return how far the phase of the mesh is modulated once per revolution.

    The phase of harmonic h is modulated by h times as much, and its first sidebands, relative to
    it, differ by that from sidebands of an amplitude modulation, which are symmetric. The estimate
    is the least squares of all harmonics.

    Parameters
    ----------
    average : ndarray of shape (n_samples,)
        One revolution, in any unit U.
    teeth : int
        Teeth of the gear.

    Returns
    -------
    float
        Amplitude at the first harmonic [rad]: for an error of the shaft angle, the error times
        `teeth`. 2 to 20 % too large from 0.5 to 1.2 rad. 0 below five standard errors, from the
        power of the second to fifth sidebands of each harmonic.

    Examples
    --------
    >>> angle = 2 * np.pi * np.arange(256) / 256
    >>> wrong = angle + 0.02 * np.sin(angle - 1)
    >>> round(phase_modulation((1 + 0.1 * np.cos(angle)) * np.cos(13 * wrong), 13), 2)
    0.26
    """
    spectrum = np.fft.rfft(average)
    mesh = mesh_orders(teeth, len(average), sidebands=1)[1::3]
    centre, orders = spectrum[mesh], mesh / teeth
    # cos(x + b sin(y)) has the sidebands +b/2 and -b/2; (1 + m cos(y)) cos(x) has m/2 and m/2.
    odd = spectrum[mesh + 1] * np.conj(centre) - np.conj(spectrum[mesh - 1]) * centre
    information = np.sum(np.abs(orders * centre) ** 2)
    apart = np.arange(2, 1 + min(5, teeth // 2))
    near = mesh[:, np.newaxis] + np.concatenate([-apart, apart])
    background = np.mean(np.abs(spectrum[np.minimum(near, len(spectrum) - 1)]) ** 2, axis=1)
    error = 2 * np.sum(background * np.abs(orders * centre) ** 2)
    correlation = np.abs(np.sum(odd * orders))
    return float(correlation / _positive(information) * (correlation > 5 * np.sqrt(error)))


def _amplitudes(average: Array) -> Array:
    """Return the amplitude of each order."""
    return np.abs(np.fft.rfft(average)) * 2 / len(average)


def _positive(level: Any) -> Any:
    """Return a level, at least `_LEAST`."""
    return np.maximum(level, _LEAST)
