"""A laboratory bench with one actuator on it."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from emacm._checks import check_choice, check_count, check_number
from emacm.recordings.recording import Recording
from emacm.simulation.impacts import ball_passage
from laboratory import motor, sensors
from laboratory.constants import (
    ASSUMED,
    CONDITIONS,
    RATED_CURRENT,
    TRANSDUCERS,
    Actuator,
    Array,
    draw_run,
    draw_unit,
    drift,
    warmth,
)
from laboratory.faults import (
    FAULTS,
    check_faults,
    draw_imperfections,
    healthy_lines,
)
from laboratory.mechanics import bench_motion, rod_position


class BenchTruth(NamedTuple):
    """True quantities of one run, before any sensor; it starts 0.1 s before the recording.

    Attributes
    ----------
    actuator : Actuator
        The unit at the start of this recording.
    times : ndarray of shape (n_times,)
        Times [s]; the recording starts at 0.
    torques : Torques
        Torques and motion of the shaft.
    position : ndarray of shape (n_times,)
        Position of the rod [in].
    currents : ndarray of shape (3, n_times)
        Phase currents, including the ripple of the inverter [A].
    acceleration : ndarray of shape (n_times,)
        Acceleration of the housing [g].
    position_command : ndarray of shape (n_times,)
        Commanded position [in].
    """

    actuator: Actuator
    times: Array
    torques: motor.Torques
    position: Array
    currents: Array
    acceleration: Array
    position_command: Array


@dataclass(frozen=True, kw_only=True)
class LaboratoryBench:
    """The laboratory of chapter 4 of the thesis, with one unit on the bench.

    An actuator (synchronous motor of 12 poles, resolver, ball screw) follows the position
    commands of Table 4.3 against a load. Signals are scaled and limited as in Table 4.2, filtered
    at 15 kHz and sampled at 48 kHz. Every part is a mechanical or electrical model; constants
    state their source or "assumed". Drift, warm-up and mounting were added because a classifier of
    the current did too well without them; nothing else was chosen by the result of one.

    The three phases are fed by an inverter from 220 V: currents sum to zero, and current and
    voltage are limited. A healthy unit has lines of its rolling elements, the resolver has errors
    at orders 1, 2 and 12, and cables carry mains and switching noise, which are fixed in time. A
    unit warms up during its runs in a condition, its friction and gains drift within a recording,
    and every five runs its accelerometer is mounted again.

    Parameters
    ----------
    unit : int
        Number of the unit. The same number is the same unit, before and after a fault.
    faults : mapping of str to float
        Severities in [0, 1] of the faults in `FAULTS`.
    electrical_noise : float
        Electrical noise of the motor in the cables of LVDT and velocity, relative to the default.
    unit_spread, run_spread : float
        Unit-to-unit and run-to-run variation, relative to the default; 0: none.
    phases : str
        Recorded phase currents: "a" as in the thesis, or "abc".
    duration : float
        Length of a recording [s]; not in the thesis, assumed.
    fs : float
        Sampling rate [Hz].
    cutoff : float
        Cut-off frequency of the conditioning filter [Hz].
    seed : int
        Seed of all units and runs.

    Raises
    ------
    TypeError, ValueError
        If a parameter is invalid.

    Examples
    --------
    >>> bench = LaboratoryBench(unit=3, faults={"inner ring": 0.5}, duration=1.0)
    >>> recording = bench.record(condition=3, run=1)
    >>> recording.channels
    ('lvdt', 'velocity', 'current_a', 'accelerometer')
    >>> recording.meta["label"], recording.meta["orders"]
    ('inner ring', {'inner ring': (6.1229153481384095,)})
    """

    unit: int = 0
    faults: Mapping[str, float] = field(default_factory=dict, hash=False)
    electrical_noise: float = 1.0
    unit_spread: float = 1.0
    run_spread: float = 1.0
    phases: str = "a"
    duration: float = 10.0
    fs: float = 48_000.0
    cutoff: float = 15_000.0
    seed: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "faults", check_faults(self.faults))
        for name in ("unit", "seed"):
            check_count(getattr(self, name), name, at_least=0)
        for name in ("electrical_noise", "unit_spread", "run_spread"):
            check_number(getattr(self, name), name, at_least=0)
        check_choice(self.phases, "phases", ("a", "b", "c", "ab", "ac", "bc", "abc"))
        check_number(self.duration, "duration", at_least=0.01, unit="s")
        check_number(self.cutoff, "cutoff", above=0, unit="Hz")
        check_number(self.fs, "fs", above=max(2 * self.cutoff, 2 / self.duration), unit="Hz")

    @property
    def label(self) -> str:
        """Faults of the unit joined by " + ", or "healthy"."""
        return " + ".join(self._present) or "healthy"

    @property
    def severity(self) -> float:
        """Severity of the worst fault."""
        return max(self._present.values(), default=0.0)

    @property
    def built(self) -> Actuator:
        """Constants of this unit: those of the design with unit-to-unit variation."""
        return draw_unit(self._rng("unit"), self.unit_spread)

    def record(self, condition: int, run: int = 1) -> Recording:
        """Simulate one recording.

        The same bench, condition and run always give the same recording.

        Parameters
        ----------
        condition : int
            Row of Table 4.3.
        run : int
            Number of the run, from 1.

        Returns
        -------
        Recording
            Channels "lvdt" [in], "velocity" [rad/s], "current_a" [A] (or those of `phases`)
            and "accelerometer" [g], in float32, which is sufficient for 16 bits. The shaft
            reference is the angle of the resolver at a tenth of the rate: the actuator itself
            measures it, and it has neither drift nor the electrical noise of the velocity channel.
            `meta` contains unit, condition, run, label, severity, faults and orders.

        Raises
        ------
        TypeError, ValueError
            If the condition or run does not exist.
        """
        truth = self.truth(condition, run)
        rng = partial(self._rng, condition=condition, run=run)
        unit, angle = truth.actuator, truth.torques.angle
        current = truth.torques.motor / (unit.torque_constant * RATED_CURRENT)
        error, slope = sensors.resolver_error(angle, unit, *self._imperfections[:2])
        lvdt_gain = drift("lvdt_gain", truth.times, self.run_spread) * unit.lvdt_gain
        gain = drift("accelerometer_gain", truth.times, self.run_spread) * unit.accelerometer_gain
        quantities = {
            "lvdt": lvdt_gain * truth.position + unit.lvdt_offset,
            "velocity": (slope + 1) * truth.torques.velocity,  # computed from the resolver
            **{f"current_{x}": truth.currents["abc".index(x)] for x in self.phases},
            "accelerometer": gain * truth.acceleration,
        }
        kept = slice(int(np.count_nonzero(truth.times < 0)), None)
        level = self.electrical_noise * unit.electrical_noise
        mains, carrier = sensors.interference(truth.times, rng("interference"))
        signals = {}
        for name, values in quantities.items():
            sensor = name.partition("_")[0]
            transducer = TRANSDUCERS[sensor]
            cable = transducer.mains * mains + transducer.carrier * carrier
            mark = unit.mark + len(sensor)  # different phases in different cables
            cable += sensors.motor_noise(sensor, angle, current, level, mark)
            settled = sensors.measured(
                sensor, values, rng(name), fs=self.fs, cutoff=self.cutoff, cable=cable
            )
            signals[name] = settled[kept]
        return Recording(
            signals,
            self.fs,
            angle=sensors.resolver_angle((angle + error)[kept], rng("resolver")),
            shaft_fs=self.fs / ASSUMED.shaft_decimation,
            meta=self.meta(condition, run),
        )

    def truth(self, condition: int, run: int = 1) -> BenchTruth:
        """Simulate one run, and return the true quantities.

        Parameters
        ----------
        condition, run : int
            As for `record`.

        Returns
        -------
        BenchTruth

        Raises
        ------
        TypeError, ValueError
            If the condition or run does not exist.
        """
        meta, row, fs = self.meta(condition, run), CONDITIONS[condition], self.fs
        rng = partial(self._rng, condition=condition, run=run)
        of_run = rng("run")
        actuator = self._in_run(condition, run, of_run)
        faults = {name: FAULTS[name].scaled(self.faults.get(name, 0.0)) for name in FAULTS}
        phase = of_run.uniform(0, 2 * np.pi)
        share = 1 + 0.01 * self.run_spread * of_run.standard_normal()
        times = np.arange(-round(ASSUMED.before * fs), round(self.duration * fs)) / fs
        motion = bench_motion(row, actuator, times, phase, share, faults["jam"])
        force = motor.low_passed_noise(
            len(times), ASSUMED.load_bandwidth, fs, rng("load"), ASSUMED.load_error
        )
        force += share * row.load(motion.angle / actuator.angle_per_inch)
        passages = {
            name: ball_passage(
                *faults[name].orders,
                motion.angle,
                rng(name),
                turns_with=faults[name].turns_with,
                mark=actuator.mark,
            )
            for name in meta["faults"]
            if faults[name].rolls
        }
        unit = motor.Unit(actuator, faults, passages)
        shares = self._imperfections[2]
        line_force, line_torque = healthy_lines(motion.angle, shares, rng("lines"), fs)
        torques = motor.shaft_torques(
            unit, motion, force, line_torque, rng("friction"), self.run_spread
        )
        backlash = faults["backlash"].backlash
        position, knocks = rod_position(torques.angle, force, actuator, backlash, fs)
        shaking = motor.housing_force(unit, torques, knocks, line_force, rng("forces"), fs)
        currents = motor.phase_currents(unit, torques.motor, torques.angle)
        if fs / 2 > ASSUMED.carrier:
            turned = rng("carrier").uniform(0, 2 * np.pi)
            currents += motor.carrier_ripple(torques, times, turned, actuator)
        return BenchTruth(
            actuator,
            times,
            torques,
            position,
            currents,
            motor.housing_acceleration(shaking, actuator, fs),
            row.position(times, phase),
        )

    def meta(self, condition: int, run: int) -> dict[str, Any]:
        """Return the `meta` of the recording of a run, without simulating it.

        Parameters
        ----------
        condition, run : int
            As for `record`.

        Returns
        -------
        dict

        Raises
        ------
        TypeError, ValueError
            If the condition or run does not exist.
        """
        check_choice(check_count(condition, "condition"), "condition", tuple(CONDITIONS))
        return {
            "unit": self.unit,
            "condition": int(condition),
            "run": check_count(run, "run"),
            "label": self.label,
            "severity": self.severity,
            "faults": self._present,
            "orders": {name: FAULTS[name].orders for name in self._present},
        }

    @property
    def _present(self) -> dict[str, float]:
        return {name: severity for name, severity in self.faults.items() if severity}

    @property
    def _imperfections(self) -> tuple[Array, Array, Array]:
        return draw_imperfections(self._rng("imperfections"), self.unit_spread)

    def _in_run(self, condition: int, run: int, rng: np.random.Generator) -> Actuator:
        """Return the constants of the unit in a run: warm-up, and the mounted accelerometer."""
        mounted = self._rng("mounting", condition, (run - 1) // ASSUMED.runs_per_mounting)
        warm = warmth(self._rng("warmth", condition), run)
        return draw_run(self.built, rng, self.run_spread, warm, float(mounted.standard_normal()))

    def _rng(self, stream: str, condition: int = 0, run: int = 0) -> np.random.Generator:
        # The name, not a number in a list: a new fault or channel must not change any other stream.
        key = (zlib.crc32(stream.encode()), self.unit, condition, run)
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=key))
