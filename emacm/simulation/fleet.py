"""Short recordings of many actuators on the bench, to try a pipeline within seconds."""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray

from emacm._checks import check_choice, check_count, check_number
from emacm.recordings.recording import Recording
from emacm.simulation.bench import LaboratoryBench
from emacm.simulation.constants import SHORT_RUN_CUTOFF

STATES = ("healthy", "screw", "inner ring")
_UNITS_OF_A_STATE = 1_000_000  # numbers of units that are reserved for each state


def simulate_actuator(
    state: str = "healthy",
    *,
    severity: float = 0.5,
    unit: int = 0,
    run: int = 1,
    condition: int = 4,
    seed: int = 0,
    duration: float = 6.0,
    fs: float = 4000.0,
) -> Recording:
    """Simulate one short run of an actuator that moves back and forth: a preset of the bench.

    Parameters
    ----------
    state : {"healthy", "screw", "inner ring"}
        State of health; for other faults, and for several, see `LaboratoryBench`.
    severity : float
        Severity of the fault in [0, 1]; ignored if healthy.
    unit, run : int
        Number of the unit, from 0, and of its run, from 1.
    condition : int
        Row of Table 4.3 of the thesis. Condition 4: strokes of 28 revolutions, at most 61 rev/s.
    seed : int
        Seed of all random numbers.
    duration : float
        Length of the recording [s].
    fs : float
        Sampling rate [Hz]. The 4 kHz of the default, instead of 48 kHz, contain only the first
        two modes of the housing and orders up to 24.

    Returns
    -------
    Recording
        As returned by `LaboratoryBench.record`.

    Raises
    ------
    TypeError, ValueError
        If a parameter is invalid.

    Examples
    --------
    >>> recording = simulate_actuator("screw", duration=2.0)
    >>> recording.channels, recording.meta["label"]
    (('lvdt', 'velocity', 'current_a', 'accelerometer'), 'screw')
    """
    check_choice(state, "state", STATES)
    fs = check_number(fs, "fs", above=0, unit="Hz")
    faults = {} if state == "healthy" else {state: severity}
    bench = LaboratoryBench(
        unit=unit, faults=faults, duration=duration, fs=fs, cutoff=SHORT_RUN_CUTOFF * fs, seed=seed
    )
    return bench.record(condition, run)


def simulate_fleet(
    n_units: int,
    n_runs: int,
    *,
    severity: tuple[float, float] = (0.3, 0.7),
    seed: int = 0,
    first_unit: int = 0,
) -> tuple[list[Recording], NDArray[np.str_], NDArray[np.int_]]:
    """Simulate several units of each state of health, and several runs of each unit.

    Parameters
    ----------
    n_units, n_runs : int
        Number of units of each state, and of runs of each unit.
    severity : (float, float)
        Range in [0, 1] from which the severity of the fault of each unit is drawn.
    seed : int
        Seed of all random numbers.
    first_unit : int
        Number of the first unit of each state. Different numbers are different units.

    Returns
    -------
    recordings : list of Recording
        ``3 * n_units * n_runs`` recordings.
    states : ndarray of str, shape (n_recordings,)
        State of health.
    units : ndarray of int, shape (n_recordings,)
        Number of the unit: no unit is recorded in two states.

    Raises
    ------
    TypeError, ValueError
        If a parameter is invalid.

    Examples
    --------
    >>> recordings, states, units = simulate_fleet(1, 2)
    >>> states.tolist()
    ['healthy', 'healthy', 'screw', 'screw', 'inner ring', 'inner ring']
    """
    check_count(n_units, "n_units")
    check_count(n_runs, "n_runs")
    check_count(first_unit, "first_unit", at_least=0)
    if not isinstance(severity, tuple) or len(severity) != 2:
        raise TypeError(f"severity must be a pair such as (0.3, 0.7), got {severity!r}.")
    low, high = (check_number(bound, "severity", at_least=0, at_most=1) for bound in severity)
    recordings = []
    for position, state in enumerate(STATES):
        for number in range(first_unit, first_unit + n_units):
            rng = np.random.default_rng([seed, zlib.crc32(state.encode()), number])
            size = rng.uniform(min(low, high), max(low, high))
            unit = _UNITS_OF_A_STATE * position + number
            recordings += [
                simulate_actuator(state, severity=size, unit=unit, run=run, seed=seed)
                for run in range(1, n_runs + 1)
            ]
    states = np.array([recording.meta["label"] for recording in recordings])
    units = np.array([recording.meta["unit"] for recording in recordings])
    return recordings, states, units
