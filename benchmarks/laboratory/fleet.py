"""Units on the bench: those of the thesis, and fleets of short runs."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm._checks import check_count, check_number
from emacm.recordings.recording import Recording
from laboratory.bench import LaboratoryBench

STATES = ("healthy", "screw", "inner ring")


def simulate_actuator(
    state: str = "healthy",
    *,
    severity: float = 0.5,
    run: int = 1,
    **constants: Any,
) -> Recording:
    """Simulate one short run of an actuator that moves back and forth: a preset of the bench.

    Parameters
    ----------
    state : {"healthy", "screw", "inner ring"}
        State of health; for other faults, and for several, see `LaboratoryBench`.
    severity : float
        Severity of the fault in [0, 1]; ignored if healthy.
    run : int
        Number of the run, from 1.
    **constants
        Parameters of `LaboratoryBench`. Here, `duration` is 6 s by default, `fs` is 4 kHz and
        `cutoff` 1.5 kHz, which contain only the first two modes of the housing and orders up to 24.

    Returns
    -------
    Recording
        As returned by `LaboratoryBench.record` in condition 4: strokes of 28 revolutions, at most
        61 rev/s.

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
    faults = {} if state == "healthy" else {state: severity}
    options = {"duration": 6.0, "fs": 4000.0, "cutoff": 1500.0} | constants
    return LaboratoryBench(faults=faults, **options).record(4, run)


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
            unit = 1_000_000 * position + number  # a range of numbers for each state
            recordings += [
                simulate_actuator(state, severity=size, unit=unit, run=run, seed=seed)
                for run in range(1, n_runs + 1)
            ]
    states, units = (np.array([r.meta[key] for r in recordings]) for key in ("label", "unit"))
    return recordings, states, units


def thesis_benches(**constants: Any) -> tuple[LaboratoryBench, LaboratoryBench]:
    """Return the two units of the thesis: a healthy one and one with a bad bearing.

    The defect of the inner ring has a severity of 0.5 (not in the thesis, assumed), and the bearing
    75 % of its grease. Section 4.5 reports electrical noise in LVDT and velocity of the healthy
    unit, and less for the other (the ratio is assumed): a classifier can distinguish the units by
    noise that is unrelated to the fault. For a study without this confounding, set equal
    `electrical_noise` by `dataclasses.replace`.

    Parameters
    ----------
    **constants
        Parameters of both benches, as for `LaboratoryBench`.

    Returns
    -------
    healthy, degraded : LaboratoryBench
        Units 0 and 1.

    Raises
    ------
    TypeError, ValueError
        If a parameter is invalid.

    Examples
    --------
    >>> [bench.label for bench in thesis_benches()]
    ['healthy', 'inner ring + lubrication']
    """
    faults = {"inner ring": 0.5, "lubrication": 0.25}
    return (
        LaboratoryBench(unit=0, **constants),
        LaboratoryBench(unit=1, faults=faults, electrical_noise=0.2, **constants),
    )
