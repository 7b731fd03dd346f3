"""Sensors, cables, conditioning filter and analogue-to-digital converter."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

from emacm.shaft.angle import angle_from_resolver
from emacm.simulation.faults import POLE_PAIRS
from emacm.simulation.laboratory import ASSUMED, TRANSDUCERS
from emacm.simulation.waves import OrderWaves, sine_wave

PICKUP_ORDERS = (2 * POLE_PAIRS, 6 * POLE_PAIRS)


def cable_noise(
    sensor: str,
    angle: NDArray[np.floating] | OrderWaves,
    current: NDArray[np.floating],
    level: float,
    mark: float,
) -> NDArray[np.floating] | float:
    """Return the electrical noise of the motor in the cable of a sensor.

    It has orders 12 and 36, twice and six times the electrical order, caused by unequal phases
    and the dead time of the inverter. It depends on a unit and its cables, not on its health
    (thesis, section 4.5).

    Parameters
    ----------
    sensor : {"lvdt", "velocity", "current", "accelerometer", "load"}
        Current, accelerometer and load cell are not affected.
    angle : ndarray of shape (n_times,) or OrderWaves
        Shaft angle [rad].
    current : ndarray of shape (n_times,)
        Length of the current vector, relative to the rated current.
    level : float
        Level relative to the default.
    mark : float
        Phase [rad].

    Returns
    -------
    ndarray of shape (n_times,), or 0.0
        Noise [V].
    """
    if sensor not in ASSUMED.pickup or not level:
        return 0.0
    parts = zip(PICKUP_ORDERS, ASSUMED.pickup[sensor], strict=True)
    waves = OrderWaves.of(angle).sines(*((order, level * size, mark) for order, size in parts))
    return waves * (ASSUMED.pickup_floor + np.abs(current))


def measured(
    sensor: str,
    values: NDArray[np.floating],
    rng: np.random.Generator,
    *,
    fs: float,
    cutoff: float,
    cable: NDArray[np.floating] | float = 0.0,
) -> NDArray[np.float32]:
    """Return a quantity as recorded by the data acquisition.

    Scales and full scales are those of Table 4.2. LVDT and velocity pass the filter of their
    demodulator. White noise of the sensor, conditioning filter and a converter of 16 bits and 10 V
    follow (assumed, except for the cut-off).

    Parameters
    ----------
    sensor : {"lvdt", "velocity", "current", "accelerometer", "load"}
        Transducer.
    values : ndarray of shape (n_times,)
        True quantity, in the unit of the transducer.
    rng : Generator
        Random numbers of the noise.
    fs : float
        Sampling rate [Hz].
    cutoff : float
        Cut-off frequency of the conditioning filter [Hz].
    cable : ndarray of shape (n_times,) or float
        Electrical noise in the cable [V].

    Returns
    -------
    ndarray of shape (n_times,), float32
        Recorded quantity, in the unit of the transducer.

    Examples
    --------
    >>> far = np.full(4800, 3.5)
    >>> float(measured("lvdt", far, np.random.default_rng(0), fs=48_000, cutoff=15_000)[-1])
    3.0
    """
    scale, peak, _ = TRANSDUCERS[sensor]
    noise = (
        ASSUMED.noise[sensor] * np.sqrt(fs / ASSUMED.noise_rate) * rng.standard_normal(len(values))
    )
    volts = values / scale
    if sensor in ASSUMED.bandwidth and ASSUMED.bandwidth[sensor] < fs / 2:
        volts = _low_pass(volts, 2, ASSUMED.bandwidth[sensor], fs)
    volts += noise
    volts += cable
    volts = _low_pass(volts, ASSUMED.filter_order, cutoff, fs)
    step = 2 * ASSUMED.range / 2**ASSUMED.bits
    volts = np.clip(np.rint(volts / step) * step, -peak / scale, peak / scale)
    return (volts * scale).astype(np.float32)


def _low_pass(
    values: NDArray[np.floating], order: int, cutoff: float, fs: float
) -> NDArray[np.floating]:
    """Apply a Butterworth filter that starts at rest."""
    sos, at_rest = _butterworth(order, cutoff, fs)
    passed, _ = filters.sosfilt(sos, values, zi=at_rest * values[0])
    return passed


@cache
def _butterworth(
    order: int, cutoff: float, fs: float
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return the sections of a low pass, and their state for a constant input of 1."""
    sos = filters.butter(order, cutoff, fs=fs, output="sos")
    return sos, filters.sosfilt_zi(sos)


class Interference(NamedTuple):
    """Waves that are fixed in time, the same in all channels of a run.

    Attributes
    ----------
    mains, carrier : ndarray of shape (n_times,)
        Mains and switching of the inverter, relative to their sizes in `ASSUMED`.
    """

    mains: NDArray[np.floating]
    carrier: NDArray[np.floating]

    def volts(self, sensor: str) -> NDArray[np.floating]:
        """Return the interference in the cable of a sensor [V]."""
        volts = ASSUMED.mains[sensor] * self.mains
        if carrier := ASSUMED.carrier_pickup.get(sensor, 0.0):
            volts += carrier * self.carrier
        return volts


def interference(times: NDArray[np.floating], rng: np.random.Generator) -> Interference:
    """Return the waves of mains and inverter in a run.

    Parameters
    ----------
    times : ndarray of shape (n_times,)
        Times [s].
    rng : Generator
        Random numbers of the run: phases.

    Returns
    -------
    Interference
        Lines above half the sampling rate, which the conditioning filter removes, are left out.
    """
    fs = 1 / (times[1] - times[0])
    phases = rng.uniform(0, 2 * np.pi, len(ASSUMED.mains_lines) + 1)
    mains, carrier = np.zeros_like(times), np.zeros_like(times)
    for (hertz, size), phase in zip(ASSUMED.mains_lines, phases[1:], strict=True):
        if hertz < fs / 2:
            mains += size * sine_wave(hertz, times, phase)
    if fs / 2 > ASSUMED.carrier:
        carrier = sine_wave(ASSUMED.carrier, times, phases[0])
    return Interference(mains, carrier)


def resolver_angle(
    angle: NDArray[np.floating],
    rng: np.random.Generator,
    error: NDArray[np.floating] | float = 0.0,
) -> NDArray[np.floating]:
    """Return the shaft angle measured by the resolver, at a tenth of the rate of the channels.

    Parameters
    ----------
    angle : ndarray of shape (n_times,)
        Shaft angle at the rate of the channels [rad].
    rng : Generator
        Random numbers of the noise.
    error : ndarray of shape (n_times,) or float
        Error of the resolver [rad], as returned by `resolver_error`.

    Returns
    -------
    ndarray of shape (ceil(n_times / 10),)
        Cumulative angle [rad], the first within half a revolution of 0, with noise and error.
    """
    turned = (angle + error)[:: ASSUMED.shaft_decimation]
    noise = ASSUMED.resolver_noise * rng.standard_normal((2, len(turned)))
    return angle_from_resolver(np.sin(turned) + noise[0], np.cos(turned) + noise[1])
