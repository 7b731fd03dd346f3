"""Sensors, cables, conditioning filter and analogue-to-digital converter."""

from __future__ import annotations

import numpy as np
from scipy import signal as filters
from scipy.constants import arcminute

from emacm.shaft.angle import angle_from_resolver
from laboratory.constants import ASSUMED, TRANSDUCERS, Actuator, Array, sines
from laboratory.faults import POLE_PAIRS


def interference(times: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return the waves of mains and inverter in the cables of a run, relative to their sizes.

    They are fixed in time, and the same in all channels. Lines above half the sampling rate, which
    the conditioning filter removes, are left out.
    """
    nyquist = 1 / (times[1] - times[0]) / 2
    phases = rng.uniform(0, 2 * np.pi, len(ASSUMED.mains_lines) + 1)
    lines = ((ASSUMED.carrier, 1.0), *ASSUMED.mains_lines)
    carrier, *mains = (
        (hertz, size * (hertz < nyquist), phase)
        for (hertz, size), phase in zip(lines, phases, strict=True)
    )
    return sines(2 * np.pi * times, *mains), sines(2 * np.pi * times, carrier)


def motor_noise(
    sensor: str, angle: Array, current: Array, level: float, mark: float
) -> Array | float:
    """Return the electrical noise of the motor in the cable of a sensor [V].

    It has orders 12 and 36, twice and six times the electrical order, caused by unequal phases
    and the dead time of the inverter. It depends on a unit and its cables, not on its health
    (thesis, section 4.5). `current` is relative to the rated current, `mark` is a phase [rad].
    """
    sizes = TRANSDUCERS[sensor].pickup
    if not sizes or not level:
        return 0.0
    orders = (2 * POLE_PAIRS, 6 * POLE_PAIRS)
    terms = ((order, level * size, mark) for order, size in zip(orders, sizes, strict=True))
    return sines(angle, *terms) * (ASSUMED.pickup_floor + np.abs(current))


def measured(
    sensor: str,
    values: Array,
    rng: np.random.Generator,
    *,
    fs: float,
    cutoff: float,
    cable: Array | float = 0.0,
) -> Array:
    """Return a quantity as recorded by the data acquisition.

    Scales and full scales are those of Table 4.2. LVDT and velocity pass the filter of their
    demodulator. White noise of the sensor, conditioning filter and a converter of 16 bits and 10 V
    follow (assumed, except for the cut-off).

    Parameters
    ----------
    sensor : {"lvdt", "velocity", "current", "accelerometer"}
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
    scale, peak, noise, *_ = TRANSDUCERS[sensor]
    volts = values / scale
    if (bandwidth := TRANSDUCERS[sensor].bandwidth) < fs / 2:
        volts = _low_pass(volts, 2, bandwidth, fs)
    volts += noise * np.sqrt(fs / ASSUMED.noise_rate) * rng.standard_normal(len(values))
    volts += cable
    volts = _low_pass(volts, ASSUMED.filter_order, cutoff, fs)
    step = 2 * ASSUMED.range / 2**ASSUMED.bits
    volts = np.clip(np.rint(volts / step) * step, -peak / scale, peak / scale)
    return (volts * scale).astype(np.float32)


def _low_pass(values: Array, order: int, cutoff: float, fs: float) -> Array:
    """Apply a Butterworth filter that starts at rest."""
    sos = filters.butter(order, cutoff, fs=fs, output="sos")
    passed, _ = filters.sosfilt(sos, values, zi=filters.sosfilt_zi(sos) * values[0])
    return passed


def resolver_error(
    angle: Array, actuator: Actuator, shares: Array, phases: Array
) -> tuple[Array, Array]:
    """Return the error of the resolver [rad], and its derivative by the angle.

    The error has orders 1, 2 and 12; the derivative is the error of the indicated velocity,
    relative to the velocity. `shares` and `phases` are those of `draw_imperfections`.

    Examples
    --------
    >>> ones, zeros = np.ones(3), np.zeros(3)
    >>> error, _ = resolver_error(np.array([np.pi / 2]), Actuator(), ones, zeros)  # 3' at order 1
    >>> (error * 180 * 60 / np.pi).round(6)
    array([3.])
    """
    size = actuator.resolver_error * arcminute
    parts = [
        (order, size * relative * share, phase)
        for (order, relative), share, phase in zip(
            ASSUMED.resolver_errors, shares, phases, strict=True
        )
    ]
    slopes = [(order, order * size, phase + np.pi / 2) for order, size, phase in parts]
    return sines(angle, *parts), sines(angle, *slopes)


def resolver_angle(angle: Array, rng: np.random.Generator) -> Array:
    """Return the angle that a resolver indicates [rad], with noise, at a tenth of the rate.

    The first is within half a revolution of 0.
    """
    turned = angle[:: ASSUMED.shaft_decimation]
    noise = ASSUMED.resolver_noise * rng.standard_normal((2, len(turned)))
    return angle_from_resolver(np.sin(turned) + noise[0], np.cos(turned) + noise[1])
