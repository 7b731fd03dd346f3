"""Constants of the actuator on the laboratory bench, and unit-to-unit variation."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from emacm._checks import check_number
from emacm.simulation.conditions import INCH, POUND, RPM
from emacm.simulation.constants import MOUNTING, OF_RUNS, OF_UNITS, WARM

PEAK_SPEED = 4572 * RPM  # rad/s, Table 4.1
RATED_FORCE = 3700 * POUND  # N, Table 4.1
RATED_CURRENT = 15.6 * float(np.sqrt(2))  # A peak, Table 4.1
SUPPLY_VOLTAGE = 220.0  # V RMS between phases, Table 4.1


@dataclass(frozen=True, kw_only=True)
class Actuator:
    """Constants of one electro-mechanical actuator on the bench.

    The thesis states 12 poles, a peak speed of 4572 RPM at 220 V, and 3700 lbf at 15.6 A RMS
    (Table 4.1). All constants below are assumed; constants of sensors and drive are in
    `emacm.simulation.constants`.

    Attributes
    ----------
    screw_lead : float
        Travel per revolution [in]. By Table 4.1 the back-EMF between phases at 4572 RPM is
        1310 V per inch of lead at the efficiency below: 220 V allow 0.168 in. The default is
        4 mm, a common lead: 206 V.
    efficiency : float
        Efficiency of the ball screw; the loss is friction in proportion to the load.
    inertia : float
        Moment of inertia of all rotating parts [kg m²].
    coulomb, viscous : float
        Coulomb [N m] and viscous friction [N m s/rad] without load.
    stiffness : float
        Stiffness of nut, rod and clevis [N/m].
    winding_resistance : float
        Resistance of a phase [Ohm].
    winding_inductance : float
        Inductance of a phase [H]; the same in both axes.
    max_current : float
        Current limit of the controller [A].
    torque_gain : float
        Torque constant relative to that of Table 4.1.
    position_gain : float
        Velocity command per position error [1/s].
    velocity_bandwidth : float
        Bandwidth of the velocity loop [Hz].
    ripple : float
        Amplitude of the 1x torque ripple (alignment) [N m].
    cogging : float
        Cogging torque [N m], at order 36: the least common multiple of 12 poles and 18 slots.
    unbalance : float
        Mass times radius of the rotor [kg m]; 4e-5 is the balance grade G 6.3 of 3 kg.
    waviness : float
        Amplitude of the force of a ball-pass line of a healthy unit, with load and preload equal
        to the rated force [N]: some 10 nm of waviness on a contact of 5e7 N/m.
    recirculation : float
        Amplitude of the friction torque of balls that enter the return of the screw [N m].
    resolver_error : float
        Amplitude of the error of the resolver at orders 1 and 2 [arcmin]; a third at order 12.
    rolling_noise : float
        RMS force of the rolling elements on the housing, white up to 24 kHz, at peak speed and
        with load and preload equal to the rated force [N].
    housing_mass : float
        Mass of the housing [kg].
    resonance, damping : float
        Frequency [Hz] and damping ratio of the first mode of the housing (fixture).
    lvdt_gain, lvdt_offset : float
        Reading per position, and reading at position 0 [in].
    accelerometer_gain : float
        Reading per acceleration.
    phase_mismatch : float
        Negative-sequence current relative to the positive sequence: relative excess of the
        current of phase A.
    electrical_noise : float
        Electrical noise of the motor in the cables of LVDT and velocity, relative to the default.
    mark : float
        Angular position of ripple, unbalance and defects on the shaft [rad].

    Raises
    ------
    TypeError, ValueError
        If a constant is not a number or out of its range.

    Examples
    --------
    >>> round(Actuator().torque_constant, 3)
    0.528
    """

    screw_lead: float = 0.1575
    efficiency: float = 0.9
    inertia: float = 1.5e-3
    coulomb: float = 0.4
    viscous: float = 1e-3
    stiffness: float = 1e8
    winding_resistance: float = 0.25
    winding_inductance: float = 1.5e-3
    max_current: float = 40.0
    torque_gain: float = 1.0
    position_gain: float = 40.0
    velocity_bandwidth: float = 60.0
    ripple: float = 0.05
    cogging: float = 0.02
    unbalance: float = 4e-5
    waviness: float = 1.0
    recirculation: float = 0.01
    resolver_error: float = 3.0
    rolling_noise: float = 20.0
    housing_mass: float = 12.0
    resonance: float = 420.0
    damping: float = 0.04
    lvdt_gain: float = 1.0
    lvdt_offset: float = 0.0
    accelerometer_gain: float = 1.0
    phase_mismatch: float = 0.0
    electrical_noise: float = 1.0
    mark: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value, name = getattr(self, field.name), field.name
            if name in ("lvdt_offset", "phase_mismatch", "mark"):
                check_number(value, name)
            elif name in ("efficiency", "damping"):
                check_number(value, name, above=0, at_most=1)
            elif name in _MAY_BE_0:
                check_number(value, name, at_least=0)
            else:
                check_number(value, name, above=0)

    @property
    def torque_per_force(self) -> float:
        """Torque per force without friction [m]: ``lead / 2 pi``."""
        return self.screw_lead * INCH / (2 * np.pi)

    @property
    def torque_constant(self) -> float:
        """Torque per ampere of the current vector [N m/A], by Table 4.1."""
        rated = RATED_FORCE * self.torque_per_force / 0.9  # at the nominal efficiency
        return self.torque_gain * rated / RATED_CURRENT

    @property
    def emf_constant(self) -> float:
        """Peak back-EMF of a phase per speed [V s/rad]: ``2/3`` of the torque constant."""
        return 2 / 3 * self.torque_constant

    @property
    def max_torque(self) -> float:
        """Torque at the current limit [N m]."""
        return self.torque_constant * self.max_current

    @property
    def angle_per_inch(self) -> float:
        """Shaft angle per position [rad/in]."""
        return 2 * np.pi / self.screw_lead


_MAY_BE_0 = (
    "winding_resistance",
    "winding_inductance",
    "coulomb",
    "viscous",
    "ripple",
    "cogging",
    "unbalance",
    "waviness",
    "recirculation",
    "resolver_error",
    "rolling_noise",
    "electrical_noise",
)


def draw_unit(nominal: Actuator, rng: np.random.Generator, *, spread: float = 1.0) -> Actuator:
    """Draw the constants of one unit.

    Parameters
    ----------
    nominal : Actuator
        Nominal constants.
    rng : Generator
        Random numbers of the unit.
    spread : float
        Unit-to-unit variation relative to the default; 0 gives the nominal actuator.

    Returns
    -------
    Actuator

    Raises
    ------
    TypeError, ValueError
        If `spread` is not a number or negative.

    Examples
    --------
    >>> draw_unit(Actuator(), np.random.default_rng(0), spread=0) == Actuator()
    True
    """
    spread = check_number(spread, "unit_spread", at_least=0)
    unit = _scattered(nominal, rng, OF_UNITS, spread)
    offset, mismatch, turn = rng.normal(0, [0.002, 0.003, 2.0])
    return replace(
        unit,
        lvdt_offset=nominal.lvdt_offset + spread * offset,
        phase_mismatch=nominal.phase_mismatch + spread * mismatch,
        mark=nominal.mark + spread * turn,
    )


def draw_run(
    unit: Actuator,
    rng: np.random.Generator,
    *,
    spread: float = 1.0,
    warmth: float = 0.0,
    mounting: float = 0.0,
) -> Actuator:
    """Draw the constants of a unit in one run: friction, electrical noise, temperature, mounting.

    Parameters
    ----------
    unit : Actuator
        Constants of the unit.
    rng : Generator
        Random numbers of the run.
    spread : float
        Run-to-run variation relative to the default; 0 gives the unit itself.
    warmth : float
        Temperature between 0 (cold) and 1 (warm): friction, torque constant and resonance fall.
    mounting : float
        Standard normal deviate of the mounting of the accelerometer.

    Returns
    -------
    Actuator

    Raises
    ------
    TypeError, ValueError
        If `spread` is not a number or negative.
    """
    spread = check_number(spread, "run_spread", at_least=0)
    drawn = _scattered(unit, rng, OF_RUNS, spread)
    shifts = {name: warmth * shift for name, shift in WARM.items()}
    shifts["accelerometer_gain"] += MOUNTING * mounting
    return _multiplied(drawn, {name: np.exp(spread * by) for name, by in shifts.items()})


def _scattered(
    actuator: Actuator, rng: np.random.Generator, deviations: dict[str, float], spread: float
) -> Actuator:
    factors = np.exp(spread * rng.normal(0, list(deviations.values())))
    return _multiplied(actuator, dict(zip(deviations, factors, strict=True)))


def _multiplied(actuator: Actuator, factors: dict[str, float]) -> Actuator:
    changed = {name: getattr(actuator, name) * float(by) for name, by in factors.items()}
    changed["damping"] = min(changed.get("damping", actuator.damping), 1.0)
    return replace(actuator, **changed)
