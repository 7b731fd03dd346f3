"""A short simulated run of an actuator at 4 kHz: enough to try a pipeline in seconds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

from emacm._checks import check_choice, check_count, check_number
from emacm.recordings.recording import Recording

STATES = ("healthy", "screw", "bearing")

# Of the motor: 12 poles, so currents at 6 orders (Chirico, section 4.1). Of the bearing's inner
# ring: 6.123 impulses per revolution (the same, chapter 4). All other constants are assumed.
ELECTRICAL_ORDER = 6.0
SCREW_ORDER = 3.125
BEARING_ORDER = 6.123
_RESONANCE = 600.0  # Hz, of the housing
_DAMPING = 0.05  # of the resonance


def simulate_actuator(
    state: str,
    *,
    severity: float = 1.0,
    seed: int | Sequence[int] = 0,
    unit_seed: int | Sequence[int] | None = None,
    unit: str | None = None,
    duration: float = 6.0,
    fs: float = 4000.0,
) -> Recording:
    """Simulate one run of an actuator to and fro, at strongly varying speed.

    The shaft follows a sum of two sines of random phase, peaks at some 20 rev/s
    and reverses several times. The phase current lies at 6 orders; a screw defect
    modulates the torque and so adds a line at order 3.125; a defect of the
    bearing's inner ring strikes the housing 6.123 times a revolution, the harder
    the faster the shaft turns.

    Parameters
    ----------
    state : {"healthy", "screw", "bearing"}
        State of health.
    severity : float
        Size of the fault; 0 is healthy, and a healthy unit has 0.
    seed : int or sequence of int
        Of what differs from run to run: motion, load and noise.
    unit_seed : int or sequence of int, optional
        Of what differs from unit to unit: gains, torque ripple and noise level.
        Default: a unit without deviations.
    unit : str, optional
        Name of the unit, kept in `meta`.
    duration : float
        Length of the recording [s].
    fs : float
        Sampling rate [Hz] of both channels; the speed has a tenth of it.

    Returns
    -------
    Recording
        Channels "current" [A] and "vibration" [m/s²], velocity [rad/s]; `meta`
        holds state, severity and unit.

    Raises
    ------
    TypeError, ValueError
        If a parameter is not what it should be.

    Examples
    --------
    >>> simulate_actuator("screw", seed=1, duration=2.0).channels
    ('current', 'vibration')
    """
    check_choice(state, "state", STATES)
    severity = check_number(severity, "severity", at_least=0)
    duration = check_number(duration, "duration", above=0, unit="s")
    fs = check_number(fs, "fs", above=0, unit="Hz")
    rng = np.random.default_rng(seed)
    times = np.arange(round(duration * fs)) / fs
    velocity, angle = _motion(times, rng)
    unit_rng = None if unit_seed is None else np.random.default_rng(unit_seed)
    gain, ripple, noise = _unit(unit_rng)
    severity = 0.0 if state == "healthy" else severity
    faults = dict.fromkeys(STATES, 0.0) | {state: severity}
    current = gain * _current(times, angle, velocity, faults["screw"], ripple, rng)
    strikes = _strikes(angle, velocity, faults["bearing"], fs, rng)
    vibration = gain * (strikes + _shaking(angle, velocity, ripple))
    slower = max(1, round(0.1 * fs * duration))
    return Recording(
        {
            "current": current + 0.25 * noise * rng.standard_normal(len(times)),
            "vibration": vibration + noise * rng.standard_normal(len(times)),
        },
        fs,
        velocity=np.interp(np.arange(slower) * 10 / fs, times, velocity),
        shaft_fs=fs / 10,
        meta={"state": state, "severity": severity, "unit": unit},
    )


def simulate_fleet(
    n_units: int, n_runs: int, *, severity: float = 1.0, seed: int = 0, first_unit: int = 0
) -> tuple[list[Recording], NDArray[np.str_], NDArray[np.str_]]:
    """Simulate several units of each state, several runs of each unit.

    Parameters
    ----------
    n_units, n_runs : int
        Units of each state, and runs of each unit.
    severity : float
        Mean size of the faults; single units have 0.7 to 1.3 of it.
    seed : int
        Of everything random. Same seed, same recordings.
    first_unit : int
        Number of the first unit: units of other numbers are other units.

    Returns
    -------
    recordings : list of Recording
        ``3 * n_units * n_runs`` recordings.
    states : ndarray of str
        State of each.
    units : ndarray of str
        Unit of each, such as "screw 2".

    Raises
    ------
    TypeError, ValueError
        If a parameter is not what it should be.
    """
    check_count(n_units, "n_units")
    check_count(n_runs, "n_runs")
    recordings = []
    for kind, state in enumerate(STATES):
        for number in range(first_unit, first_unit + n_units):
            of_unit = [seed, kind, number]
            size = severity * np.random.default_rng(of_unit).uniform(0.7, 1.3)
            recordings += [
                simulate_actuator(
                    state,
                    severity=size,
                    seed=[*of_unit, run],
                    unit_seed=of_unit,
                    unit=f"{state} {number}",
                )
                for run in range(n_runs)
            ]
    states = np.array([recording.meta["state"] for recording in recordings])
    units = np.array([recording.meta["unit"] for recording in recordings])
    return recordings, states, units


def _motion(
    times: NDArray[np.floating], rng: np.random.Generator
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Velocity [rad/s] and its exact integral [rad]."""
    velocity, angle = np.zeros_like(times), np.zeros_like(times)
    for peak, frequency in ((17.0, rng.uniform(0.2, 0.3)), (4.0, rng.uniform(0.8, 1.2))):
        omega, phase = 2 * np.pi * frequency, rng.uniform(0, 2 * np.pi)
        velocity += 2 * np.pi * peak * np.cos(omega * times + phase)
        angle += 2 * np.pi * peak * (np.sin(omega * times + phase) - np.sin(phase)) / omega
    return velocity, angle


def _unit(rng: np.random.Generator | None) -> tuple[float, float, float]:
    """Gain of the sensors, torque ripple and noise level of one unit."""
    if rng is None:
        return 1.0, 1.0, 1.0
    gain, ripple, noise = np.exp(rng.normal(0, [0.03, 0.3, 0.03]))
    return float(gain), float(ripple), float(noise)


def _current(
    times: NDArray[np.floating],
    angle: NDArray[np.floating],
    velocity: NDArray[np.floating],
    screw: float,
    ripple: float,
    rng: np.random.Generator,
) -> NDArray[np.floating]:
    """Phase current [A]: friction and load at the electrical order, and what the torque adds."""
    load = 5.0 + rng.normal(0, 0.3) + 0.01 * np.abs(velocity)
    cogging = 0.05 * ripple * np.sin(2 * ELECTRICAL_ORDER * angle)
    supply = 0.1 * np.sin(2 * np.pi * 100.0 * times)
    return (
        load * np.sin(ELECTRICAL_ORDER * angle)
        + cogging
        + supply
        + 0.04 * screw * np.sin(SCREW_ORDER * angle)
    )


def _shaking(
    angle: NDArray[np.floating], velocity: NDArray[np.floating], ripple: float
) -> NDArray[np.floating]:
    """Vibration of a healthy unit [m/s²]: unbalance and screw balls, growing with speed."""
    speed = velocity / 100.0
    return speed**2 * (1.0 * np.sin(angle) + 0.3 * ripple * np.sin(2 * angle + 1.0))


def _strikes(
    angle: NDArray[np.floating],
    velocity: NDArray[np.floating],
    bearing: float,
    fs: float,
    rng: np.random.Generator,
) -> NDArray[np.floating]:
    """Vibration [m/s²] of a housing that is struck whenever a ball passes the defect."""
    passed = np.floor(BEARING_ORDER * angle / (2 * np.pi) + rng.uniform())
    struck = np.zeros_like(angle)
    struck[1:] = (np.diff(passed) != 0) * np.abs(velocity[1:]) / 100.0
    struck *= 1 + 0.2 * rng.standard_normal(len(struck))
    # Impulse response of a damped oscillator, matched at the sampling instants.
    decay = np.exp(-2 * np.pi * _RESONANCE * _DAMPING / fs)
    turn = 2 * np.pi * _RESONANCE * np.sqrt(1 - _DAMPING**2) / fs
    ringing = filters.lfilter(
        [decay * np.sin(turn)], [1, -2 * decay * np.cos(turn), decay**2], struck
    )
    return 1.0 * bearing * ringing + 0.5 * bearing * struck
