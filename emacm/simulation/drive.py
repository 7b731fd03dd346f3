"""Inverter of the motor: voltage, its limit, and the ripple of its switching."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from emacm.simulation.actuator import SUPPLY_VOLTAGE, Actuator
from emacm.simulation.constants import CARRIER, VOLTAGE_RESERVE
from emacm.simulation.faults import POLE_PAIRS
from emacm.simulation.waves import PHASES, OrderWaves, of_phases, sine_wave

VOLTAGE_LIMIT = SUPPLY_VOLTAGE * sqrt(2 / 3)  # V peak of a phase, which 220 V between phases allow
_LINK = SUPPLY_VOLTAGE * sqrt(2)  # V: rectified supply


def phase_voltage(
    torque: NDArray[np.floating], velocity: NDArray[np.floating], actuator: Actuator
) -> NDArray[np.floating]:
    """Return the peak voltage of a phase that a torque requires at a speed.

    With the current perpendicular to the rotor flux, ``v_q = k w + R i`` and ``v_d = -p w L i``.

    Parameters
    ----------
    torque, velocity : ndarray of shape (n_times,)
        Motor torque [N m] and shaft speed [rad/s].
    actuator : Actuator
        Constants.

    Returns
    -------
    ndarray of shape (n_times,)
        Voltage [V].

    Examples
    --------
    >>> rated = phase_voltage(np.array([0.0]), np.array([4572 * np.pi / 30]), Actuator())
    >>> (rated * np.sqrt(3 / 2)).round(1)  # RMS between phases
    array([206.3])
    """
    current = torque / actuator.torque_constant
    across = actuator.emf_constant * velocity + actuator.winding_resistance * current
    along = POLE_PAIRS * actuator.winding_inductance * velocity * current
    return np.sqrt(across**2 + along**2)


def voltage_free_speed(actuator: Actuator, current: float) -> float:
    """Return a speed up to which the voltage allows a current of either sign [rad/s].

    Examples
    --------
    >>> round(voltage_free_speed(Actuator(), 10.0))
    381
    """
    left = VOLTAGE_RESERVE * VOLTAGE_LIMIT - actuator.winding_resistance * current
    per_speed = actuator.emf_constant + POLE_PAIRS * actuator.winding_inductance * current
    return max(left, 0.0) / per_speed  # voltages added as if in phase: a lower bound


def drive_limits(
    actuator: Actuator,
) -> tuple[float, float, float, float, float, float, float, float]:
    """Return the limits of current and voltage, as `limited_torque` of the kernels reads them.

    Examples
    --------
    >>> from emacm import _kernels
    >>> limit, limits = _kernels.loops.limited_torque, drive_limits(Actuator())
    >>> [round(limit(30.0, speed, limits) / limits[0], 1) for speed in (0.0, 460.0)]  # A
    [40.0, 10.9]
    """
    quarter = actuator.max_current / 4
    return (
        actuator.torque_constant,
        actuator.emf_constant,
        actuator.winding_resistance,
        POLE_PAIRS * actuator.winding_inductance,
        VOLTAGE_RESERVE * VOLTAGE_LIMIT,
        actuator.max_torque,
        voltage_free_speed(actuator, quarter),
        actuator.max_torque / 4,
    )


def carrier_ripple(
    voltage: NDArray[np.floating],
    angle: NDArray[np.floating] | OrderWaves,
    times: NDArray[np.floating],
    phase: float,
    actuator: Actuator,
    phases: str = PHASES,
) -> NDArray[np.floating]:
    """Return the ripple of the phase currents at the switching frequency of the inverter.

    The lines at ``CARRIER +- 2 x`` the electrical frequency of a sine-triangle modulation have
    the voltage ``2 V_dc / pi J_2(pi M / 2)`` each [1]_, M being the voltage relative to half the
    DC link; the line at the carrier itself is equal in all phases and drives no current. They are
    fixed in time, and sum to zero over the phases. Lines at twice the carrier are above the
    conditioning filter.

    Parameters
    ----------
    voltage : ndarray of shape (n_times,)
        Peak voltage of a phase [V].
    angle : ndarray of shape (n_times,) or OrderWaves
        Shaft angle [rad].
    times : ndarray of shape (n_times,)
        Times [s].
    phase : float
        Phase of the carrier [rad].
    actuator : Actuator
        Constants; without inductance there is no ripple to compute, and 0 is returned.
    phases : str
        Phases to compute.

    Returns
    -------
    ndarray of shape (n_phases, n_times)
        Currents [A].

    References
    ----------
    .. [1] D. G. Holmes and T. A. Lipo, Pulse Width Modulation for Power Converters, 2003.
    """
    if not actuator.winding_inductance:
        return np.zeros((len(phases), len(times)))
    x2 = (np.pi * voltage / _LINK) ** 2  # square of pi M / 2
    bessel = x2 / 8 * (1 - x2 / 12 * (1 - x2 / 32))  # J_2 within 1 % up to M = 1.15
    reactance = 2 * np.pi * CARRIER * actuator.winding_inductance
    size = bessel * sine_wave(CARRIER, times, phase)
    size *= 2 * (2 * _LINK / np.pi) / reactance
    waves = OrderWaves.of(angle)
    a = size * waves.sines((2 * POLE_PAIRS, 1.0, np.pi / 2))
    across = size * waves.sines((2 * POLE_PAIRS, -np.sqrt(3) / 2, 0.0)) if phases != "a" else a
    return of_phases(a, across, phases)
