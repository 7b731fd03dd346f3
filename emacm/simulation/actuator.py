"""The actuator of the laboratory bench in numbers, and how single units differ from it."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from emacm._checks import check_number
from emacm.simulation.conditions import INCH, POUND, RPM

PEAK_SPEED = 4572 * RPM  # rad/s, Table 4.1
RATED_FORCE = 3700 * POUND  # N, Table 4.1
RATED_CURRENT = 15.6 * float(np.sqrt(2))  # A peak, Table 4.1


@dataclass(frozen=True, kw_only=True)
class Actuator:
    """Constants of one electro-mechanical actuator on the bench.

    The thesis gives the poles (12), the peak speed (4572 RPM at 220 V), and 3700 lbf at
    15.6 A RMS (Table 4.1). All that follows is assumed.

    Attributes
    ----------
    screw_lead : float
        Travel per revolution [in]. With the efficiency below, 220 V between phases hold 4572 RPM
        and 3700 lbf at 15.6 A for 0.17 in at most; 0.2 in is the nearest common lead.
    efficiency : float
        Of the ball screw; what is lost is friction in proportion to the load.
    inertia : float
        Of all that turns [kg m²].
    coulomb, viscous : float
        Friction without load [N m], [N m s/rad].
    stiffness : float
        Of nut, rod and clevis [N/m].
    max_current : float
        At which the controller limits [A].
    torque_gain : float
        Torque constant over that of Table 4.1.
    position_gain : float
        Velocity command over position error [1/s].
    velocity_bandwidth : float
        Of the velocity loop [Hz].
    ripple : float
        Torque that varies once per revolution (alignment) [N m].
    cogging : float
        Cogging torque [N m], at order 36: the least common multiple of 12 poles and 18 slots.
    unbalance : float
        Mass times radius of the rotor [kg m]; 4e-5 is the balance grade G 6.3 of 3 kg.
    rolling_noise : float
        RMS force of the balls on the housing, white up to 24 kHz, at peak speed when load and
        preload together are the rated force [N].
    housing_mass : float
        That the forces shake [kg].
    resonance, damping : float
        Of the fixture, the first mode of the housing [Hz], share of critical.
    lvdt_gain, lvdt_offset : float
        Reading over position, and reading at 0 [in].
    accelerometer_gain : float
        Reading over acceleration.
    phase_mismatch : float
        Share by which phase A carries more current than its due.
    electrical_noise : float
        Of the motor in the cables of LVDT and velocity, over the usual.
    mark : float
        Angle from which the unit's ripple, unbalance and defects count [rad].

    Raises
    ------
    TypeError, ValueError
        If a constant is no number or not in its range.

    Examples
    --------
    >>> round(Actuator().torque_constant, 3)
    0.67
    """

    screw_lead: float = 0.2
    efficiency: float = 0.9
    inertia: float = 1.5e-3
    coulomb: float = 0.4
    viscous: float = 1e-3
    stiffness: float = 1e8
    max_current: float = 40.0
    torque_gain: float = 1.0
    position_gain: float = 40.0
    velocity_bandwidth: float = 60.0
    ripple: float = 0.05
    cogging: float = 0.02
    unbalance: float = 4e-5
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
        """Torque that holds a force without friction [m]: ``lead / 2 pi``."""
        return self.screw_lead * INCH / (2 * np.pi)

    @property
    def torque_constant(self) -> float:
        """Torque per ampere of the current vector [N m/A], by Table 4.1."""
        rated = RATED_FORCE * self.torque_per_force / 0.9  # at the nominal efficiency
        return self.torque_gain * rated / RATED_CURRENT

    @property
    def max_torque(self) -> float:
        """Torque at which the controller limits [N m]."""
        return self.torque_constant * self.max_current

    @property
    def angle_per_inch(self) -> float:
        """Shaft angle per travel [rad/in]."""
        return 2 * np.pi / self.screw_lead


_MAY_BE_0 = ("coulomb", "viscous", "ripple", "cogging", "unbalance", "rolling_noise") + (
    "electrical_noise",
)

# Standard deviations of the logarithm, from unit to unit and from run to run. Assumed: parts made
# to one drawing agree within per cents, friction and what comes from faults of shape do not.
_OF_UNITS = {
    "coulomb": 0.15,
    "viscous": 0.15,
    "torque_gain": 0.02,
    "ripple": 0.4,
    "cogging": 0.3,
    "unbalance": 0.4,
    "rolling_noise": 0.2,
    "resonance": 0.03,
    "damping": 0.2,
    "lvdt_gain": 0.003,
    "accelerometer_gain": 0.03,
    "electrical_noise": 0.3,
}
_OF_RUNS = {"coulomb": 0.03, "viscous": 0.03, "rolling_noise": 0.03, "electrical_noise": 0.05}


def draw_unit(nominal: Actuator, rng: np.random.Generator, *, spread: float = 1.0) -> Actuator:
    """Draw one unit made to a drawing.

    Parameters
    ----------
    nominal : Actuator
        The drawing.
    rng : Generator
        Of the unit.
    spread : float
        Of units, over the usual; 0 gives the nominal actuator.

    Returns
    -------
    Actuator

    Raises
    ------
    TypeError, ValueError
        If `spread` is no number or negative.

    Examples
    --------
    >>> draw_unit(Actuator(), np.random.default_rng(0), spread=0) == Actuator()
    True
    """
    spread = check_number(spread, "unit_spread", at_least=0)
    unit = _scattered(nominal, rng, _OF_UNITS, spread)
    offset, mismatch, turn = rng.normal(0, [0.002, 0.003, 2.0])
    return replace(
        unit,
        lvdt_offset=nominal.lvdt_offset + spread * offset,
        phase_mismatch=nominal.phase_mismatch + spread * mismatch,
        mark=nominal.mark + spread * turn,
    )


def draw_run(unit: Actuator, rng: np.random.Generator, *, spread: float = 1.0) -> Actuator:
    """Draw the state of a unit in one run: its temperature moves friction, its cables the noise.

    Parameters
    ----------
    unit : Actuator
        The unit.
    rng : Generator
        Of the run.
    spread : float
        Of runs, over the usual; 0 gives the unit itself.

    Returns
    -------
    Actuator

    Raises
    ------
    TypeError, ValueError
        If `spread` is no number or negative.
    """
    spread = check_number(spread, "run_spread", at_least=0)
    return _scattered(unit, rng, _OF_RUNS, spread)


def _scattered(
    actuator: Actuator, rng: np.random.Generator, deviations: dict[str, float], spread: float
) -> Actuator:
    factors = np.exp(spread * rng.normal(0, list(deviations.values())))
    changed = {
        name: getattr(actuator, name) * float(factor)
        for name, factor in zip(deviations, factors, strict=True)
    }
    changed["damping"] = min(changed.get("damping", actuator.damping), 1.0)
    return replace(actuator, **changed)
