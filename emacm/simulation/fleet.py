"""Simulated actuators: a fleet with and without faults, and units that wear out."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emacm._checks import check_choice, check_count, check_number, located
from emacm.recordings.recording import Recording
from emacm.simulation.impacts import Array, ball_passage, ringing

STATES = ("healthy", "screw", "inner ring")


def simulate_actuator(
    state: str = "healthy",
    *,
    severity: float = 0.5,
    unit: int = 0,
    run: int = 1,
    duration: float = 6.0,
    seed: int = 0,
    **truth: float,
) -> Recording:
    """Simulate one run of an actuator that moves back and forth. All sizes are assumed.

    A motor of 12 poles moves a ball screw in strokes of 28 revolutions, at most 62 rev/s, against
    a spring. The torque modulates the current at order 6; forces on the housing excite its
    resonance at 420 Hz. Units differ in their gain, resonance, ripple and lines of healthy rolling
    elements. `benchmarks/laboratory` has models of the mechanical and electrical parts instead.

    Parameters
    ----------
    state : {"healthy", "screw", "inner ring"}
        State of health: a spall of the screw (order 9.064) or of the inner ring of its bearing
        (6.123).
    severity : float
        Severity of the fault in [0, 1]; ignored if healthy.
    unit, run : int
        Number of the unit, and of the run. The same number is the same unit with any fault.
    duration : float
        Duration [s].
    seed : int
        Seed of all units and runs.
    **truth
        Further entries of `meta`.

    Returns
    -------
    Recording
        Channels "lvdt" [in], "velocity" [rad/s], "current_a" [A] and "accelerometer" [g] at 4 kHz,
        and the angle of the shaft at 400 Hz. `meta` contains unit, run, label, severity and the
        orders of the fault.

    Raises
    ------
    ValueError
        If the state is unknown.

    Examples
    --------
    >>> recording = simulate_actuator("screw", duration=2.0)
    >>> recording.channels, recording.meta["orders"]
    (('lvdt', 'velocity', 'current_a', 'accelerometer'), {'screw': (9.064,)})
    """
    check_choice(state, "state", STATES)
    severity = 0.0 if state == "healthy" else severity
    of_unit = np.random.default_rng([seed, unit])
    gain, noise, ripple, *lines = np.exp([0.05, 0.2, 0.4, 0.5, 0.5] * of_unit.standard_normal(5))
    resonance = 420 * np.exp(0.03 * of_unit.standard_normal())
    rng = np.random.default_rng([seed, unit, run, zlib.crc32(state.encode())])

    fs, slow = 4000.0, 2 * np.pi * 0.7  # Hz, rad/s
    times = np.arange(round(duration * fs)) / fs
    phase = slow * times + rng.uniform(0, 2 * np.pi)
    angle = 28 * np.pi * np.sin(phase)
    velocity = 28 * np.pi * slow * np.cos(phase)
    speed = np.abs(np.cos(phase))
    load = 0.4 + 0.6 * np.sin(phase)  # relative to the largest: spring with preload
    braked = np.sign(velocity) * (0.3 + np.abs(load))

    # Orders of the fault, and of its passage through the load zone; size of its impacts.
    faults = {"screw": (9.064, 0.0, 0.4), "inner ring": (6.123, 1.0, 0.6)}
    torque = load + 0.05 * np.tanh(velocity) + 0.003 * ripple * np.sin(angle)
    force = 0.01 * noise * rng.standard_normal(len(times))
    for (order, *_), size in zip(faults.values(), lines, strict=True):  # of healthy parts
        wave = size * np.sin(order * angle + rng.uniform(0, 2 * np.pi))
        force += 0.004 * wave
        torque -= 2e-4 * braked * wave
    known = {}
    if severity:
        order, turns_with, impact = faults[state]
        known[state] = (order,)
        passage = ball_passage(order, angle, rng, turns_with=turns_with)
        torque -= 0.012 * impact * severity * braked * passage.pulses
        force += impact * severity * passage.force
    response = ringing(fs, resonance, 0.04, 0.06)
    response[0] = 0.6  # stiff parts of the housing follow at once
    vibration = 3e-4 * ripple * speed**2 * np.sin(angle)  # unbalance
    vibration += np.convolve(speed * np.abs(braked) * force, response)[: len(times)]

    quantities = {
        "lvdt": (0.1575 / (2 * np.pi) * angle, 1e-3),
        "velocity": (velocity, 0.2),
        "current_a": (30 * torque * np.sin(6 * angle), 0.008),
        "accelerometer": (gain * vibration, 3e-3),
    }
    signals = {
        name: (values + error * rng.standard_normal(len(times))).astype(np.float32)
        for name, (values, error) in quantities.items()
    }
    measured = angle[::10] + 1e-4 * rng.standard_normal(len(angle[::10]))
    label = state if severity else "healthy"
    meta = {"unit": unit, "run": run, "label": label, "severity": severity, "orders": known}
    return Recording(signals, fs, angle=measured, shaft_fs=fs / 10, meta=meta | truth)


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
    with located("severity must be a pair such as (0.3, 0.7)"):
        low, high = sorted(check_number(x, "severity", at_least=0, at_most=1) for x in severity)
    recordings = []
    for position, state in enumerate(STATES):
        for number in range(first_unit, first_unit + check_count(n_units, "n_units")):
            rng = np.random.default_rng([seed, zlib.crc32(state.encode()), number])
            size = rng.uniform(low, high)
            unit = 1_000_000 * position + number  # a range of numbers for each state
            recordings += [
                simulate_actuator(state, severity=size, unit=unit, run=run, seed=seed)
                for run in range(1, check_count(n_runs, "n_runs") + 1)
            ]
    states, units = (np.array([r.meta[key] for r in recordings]) for key in ("label", "unit"))
    return recordings, states, units


class UnitLife(NamedTuple):
    """True life of a simulated unit, and its damage at the readings.

    Attributes
    ----------
    ages : ndarray of shape (n_readings,)
        Ages of the readings [h].
    severity : ndarray of shape (n_readings,)
        Severity at the readings: 0 before the onset, 1 at the failure.
    onset : float
        Age at the onset of damage [h].
    life : float
        Age at the failure [h].
    observed : float
        Age until which the unit is observed [h]: its life, or less.
    """

    ages: Array
    severity: Array
    onset: float
    life: float
    observed: float

    @property
    def censored(self) -> bool:
        """Whether the observation ends before the failure."""
        return self.observed < self.life


@dataclass(frozen=True, kw_only=True)
class WearLaw:
    """Law by which damage begins and grows.

    The age at the onset has a Weibull distribution. From then on the logarithm of the severity is
    a Wiener process with drift, so that the severity grows exponentially; the drift is normal
    over units. A unit fails when the severity reaches 1.

    Parameters
    ----------
    onset_shape, onset_scale : float
        Weibull distribution of the age at the onset [h].
    start : float
        Severity at the onset, in (0, 1).
    drift, drift_spread : float
        Mean and standard deviation over units of the growth of the logarithm [1/h]; drifts below
        a fifth of the mean are drawn again.
    diffusion : float
        Variance of the growth of the logarithm per hour, of one unit.

    Raises
    ------
    TypeError, ValueError
        If a parameter is invalid.

    Examples
    --------
    >>> found = WearLaw().draw(unit=3, interval=10.0)
    >>> bool(found.onset < found.life), found.censored
    (True, False)
    """

    onset_shape: float = 2.0
    onset_scale: float = 200.0
    start: float = 0.05
    drift: float = 0.03
    drift_spread: float = 0.008
    diffusion: float = 0.004

    def __post_init__(self) -> None:
        for name in ("onset_shape", "onset_scale", "drift"):
            check_number(getattr(self, name), name, above=0)
        for name in ("drift_spread", "diffusion"):
            check_number(getattr(self, name), name, at_least=0)
        check_number(self.start, "start", above=0, below=1)

    def draw(
        self, unit: int, interval: float, *, observed: float = np.inf, seed: int = 0
    ) -> UnitLife:
        """Draw the life of a unit. The same unit and seed have the same life.

        Parameters
        ----------
        unit : int
            Number of the unit.
        interval : float
            Time between two readings [h]; the life is computed to 1/64 of it.
        observed : float
            Age at which the observation ends, if the unit has not failed [h].
        seed : int
            Seed of all units.

        Returns
        -------
        UnitLife
            With readings at 0, `interval`, ... before the end of the observation.

        Raises
        ------
        TypeError, ValueError
            If a parameter is invalid.
        """
        interval = check_number(interval, "interval", above=0, unit="h")
        rng = np.random.default_rng([seed, unit, 7919])
        onset = float(self.onset_scale * rng.weibull(self.onset_shape))
        drift = 0.0
        while drift < 0.2 * self.drift:
            drift = self.drift + self.drift_spread * rng.standard_normal()
        step = interval / 64
        distance = -np.log(self.start)
        n_steps = int(20 * distance / self.drift / step)  # at most 20 mean durations
        noise = np.sqrt(self.diffusion * step) * rng.standard_normal(n_steps)
        logarithm = np.append(0.0, np.cumsum(drift * step + noise)) - distance
        failed = int(np.argmax(logarithm >= 0))
        life = onset + (failed if failed else n_steps) * step
        end = min(life, float(observed))
        ages = np.arange(0, end, interval)
        times = onset + step * np.arange(len(logarithm))
        severity = np.where(ages < onset, 0.0, np.exp(np.interp(ages, times, logarithm)))
        return UnitLife(ages, np.minimum(severity, 1.0), onset, life, end)


def run_to_failure_fleet(
    n_units: int,
    *,
    law: WearLaw | None = None,
    interval: float = 10.0,
    duration: float = 1.0,
    seed: int = 0,
    first_unit: int = 0,
) -> list[Recording]:
    """Simulate units with a growing defect of the inner ring, from new to failed.

    Parameters
    ----------
    n_units : int
        Number of units.
    law : WearLaw, optional
        Law of the damage. The default has the onset after 177 h on average, then 100 h.
    interval : float
        Time between two recordings [h].
    duration : float
        Length of a recording [s].
    seed, first_unit : int
        Seed of all random numbers, and number of the first unit: other numbers are other units.

    Returns
    -------
    list of Recording
        By unit and age, with the channels and the `meta` of `simulate_fleet`. `meta`
        also contains "age", "onset", "life" and "remaining_life" (life - age) [h], the truth.

    Raises
    ------
    TypeError, ValueError
        If a parameter is invalid.

    Examples
    --------
    >>> recordings = run_to_failure_fleet(2, interval=100.0, duration=0.25)
    >>> sorted({recording.meta["unit"] for recording in recordings})
    [0, 1]
    >>> recordings[0].meta["age"], recordings[0].meta["label"]
    (0.0, 'healthy')
    """
    recordings = []
    for unit in range(first_unit, first_unit + check_count(n_units, "n_units")):
        history = (law or WearLaw()).draw(unit, interval, seed=seed)
        whole = {"onset": history.onset, "life": history.life}
        options: dict[str, Any] = {"unit": unit, "duration": duration, "seed": seed} | whole
        for run, (age, severity) in enumerate(zip(history.ages, history.severity, strict=True), 1):
            options |= {"age": float(age), "remaining_life": history.life - float(age)}
            recordings.append(
                simulate_actuator("inner ring", severity=float(severity), run=run, **options)
            )
    return recordings
