"""Sensors, cables, conditioning filter and analogue-to-digital converter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

from emacm.shaft.angle import angle_from_resolver
from emacm.simulation.conditions import TRANSDUCERS
from emacm.simulation.faults import POLE_PAIRS

# RMS noise of each sensor up to half of 48 kHz [V]; assumed.
NOISE = {"lvdt": 1e-3, "velocity": 2e-3, "current": 5e-3, "accelerometer": 3e-3, "load": 1e-3}
# Electrical noise of the motor in the cables [V at rated current], at 2 and 6 times the electrical
# order: section 4.5 of the thesis reports orders 12 and 36. Sizes assumed.
PICKUP = {"lvdt": (2e-3, 1.5e-3), "velocity": (6e-3, 4e-3)}
PICKUP_ORDERS = (2.0 * POLE_PAIRS, 6.0 * POLE_PAIRS)
_PICKUP_FLOOR = 0.3  # fraction without current; assumed
_RANGE, _BITS = 10.0, 16  # range [V] and resolution of the converter; assumed
_FILTER_ORDER = 4  # Butterworth conditioning filter; assumed
_NOISE_RATE = 48_000.0  # Hz: sampling rate to which NOISE refers
SHAFT_DECIMATION = 10  # samples of the channels per sample of the shaft angle
_RESOLVER_NOISE = 5e-5  # RMS relative to the amplitude: 14 bits; assumed
_RESOLVER_MISMATCH = 2e-4  # relative difference of the two amplitudes; assumed


def cable_noise(
    sensor: str,
    angle: NDArray[np.floating],
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
    angle : ndarray of shape (n_times,)
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
    if sensor not in PICKUP or not level:
        return 0.0
    lines = [
        size * np.sin(order * angle + mark)
        for order, size in zip(PICKUP_ORDERS, PICKUP[sensor], strict=True)
    ]
    return level * (_PICKUP_FLOOR + np.abs(current)) * np.sum(lines, axis=0)


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

    Scales and full scales are those of Table 4.2, followed by the white noise of the sensor, the
    conditioning filter and a converter of 16 bits and 10 V (assumed, except for the cut-off).

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
    noise = NOISE[sensor] * np.sqrt(fs / _NOISE_RATE) * rng.standard_normal(len(values))
    volts = values / scale + noise + cable
    sos = filters.butter(_FILTER_ORDER, cutoff, fs=fs, output="sos")
    volts, _ = filters.sosfilt(sos, volts, zi=filters.sosfilt_zi(sos) * volts[0])
    step = 2 * _RANGE / 2**_BITS
    volts = np.clip(np.round(volts / step) * step, -peak / scale, peak / scale)
    return (volts * scale).astype(np.float32)


def resolver_angle(angle: NDArray[np.floating], rng: np.random.Generator) -> NDArray[np.floating]:
    """Return the shaft angle measured by the resolver, at a tenth of the rate of the channels.

    Parameters
    ----------
    angle : ndarray of shape (n_times,)
        Shaft angle at the rate of the channels [rad].
    rng : Generator
        Random numbers of the noise.

    Returns
    -------
    ndarray of shape (ceil(n_times / 10),)
        Cumulative angle [rad], the first within half a revolution of 0, with noise and with an
        error at order 2 caused by unequal amplitudes.
    """
    turned = angle[::SHAFT_DECIMATION]
    noise = _RESOLVER_NOISE * rng.standard_normal((2, len(turned)))
    sine = (1 + _RESOLVER_MISMATCH) * np.sin(turned) + noise[0]
    return angle_from_resolver(sine, np.cos(turned) + noise[1])
