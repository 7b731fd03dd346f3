"""Gears: a pair in mesh, and a planetary stage."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from math import gcd, lcm

from emacm._checks import check_choice, check_count
from emacm.machine.parts import Line, Part, check_mounting

_MEMBERS = ("sun", "ring", "carrier")


@dataclass(frozen=True)
class Gear(Part):
    """Two gears in mesh.

    Parameters
    ----------
    teeth, mating_teeth : int
        Teeth of the driving gear (pinion) and of the driven gear (wheel).
    ratio : float
        Revolutions of the driving shaft per revolution of the motor shaft.
    name : str
        Prefix of the names of its lines; distinguishes two pairs.

    Raises
    ------
    TypeError, ValueError
        If a value is out of range.

    See Also
    --------
    emacm.PlanetaryGear : Sun, planets and ring.
    emacm.GearIndicators : Indicators of the average over revolutions.

    Notes
    -----
    The same two teeth meet once in lcm(teeth, mating teeth) meshes: the hunting tooth order. A
    run-in wear pattern repeats every gcd(teeth, mating teeth) meshes: the assembly phase order,
    left out if it equals the mesh order [1]_. A fault of a gear modulates the mesh once per turn.

    References
    ----------
    .. [1] Foiles, Gear frequencies using the Euclidean algorithm, Vibration Institute;
       MathWorks, gearMeshFaultBands.

    Examples
    --------
    >>> for line in Gear(8, 42).lines():
    ...     print(f"{line.name} {line.order:.4f}")
    mesh 8.0000
    pinion 1.0000
    wheel 0.1905
    hunting 0.0476
    phase 4.0000
    """

    teeth: int
    mating_teeth: int
    _: KW_ONLY
    ratio: float = 1.0
    name: str = ""

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_count(self.teeth, "teeth", at_least=2)
        check_count(self.mating_teeth, "mating_teeth", at_least=2)
        check_mounting(self)

    @property
    def output_ratio(self) -> float:
        """Revolutions of the driven shaft per revolution of the motor shaft."""
        return self.ratio * self.teeth / self.mating_teeth

    def lines(self) -> tuple[Line, ...]:
        """Return the lines of the mesh, of both gears and of tooth pairs."""
        mesh, common = self.ratio * self.teeth, gcd(self.teeth, self.mating_teeth)
        shafts = (("pinion", self.ratio), ("wheel", self.output_ratio))
        hunting = mesh / lcm(self.teeth, self.mating_teeth)
        lines = [
            Line("mesh", "mesh", mesh, shafts, of_damage=False),
            Line("pinion", "pinion", self.ratio),
            Line("wheel", "wheel", self.output_ratio),
            Line("hunting", "hunting tooth", hunting, of_damage=False),
        ]
        if common > 1:
            lines.append(Line("phase", "assembly phase", mesh / common, of_damage=False))
        return tuple(lines)


@dataclass(frozen=True)
class PlanetaryGear(Part):
    """A planetary gear stage: sun, planets on a carrier, and ring.

    Parameters
    ----------
    sun_teeth, ring_teeth : int
        Teeth of the sun and of the ring.
    n_planets : int
        Number of planets.
    planet_teeth : int, optional
        Teeth of a planet. Default: (ring_teeth - sun_teeth) / 2.
    fixed : {"ring", "sun", "carrier"}
        The member that does not rotate.
    driven_by : {"sun", "carrier", "ring"}, optional
        The member that `ratio` refers to. Default: the sun, or the carrier if the sun is fixed.
    ratio : float
        Revolutions of that member per revolution of the motor shaft.
    name : str
        Prefix of the names of its lines; distinguishes two stages.

    Raises
    ------
    TypeError, ValueError
        If a value is out of range, the teeth do not fit, or `driven_by` is fixed.

    See Also
    --------
    emacm.Gear : Two wheels.

    Notes
    -----
    With the speeds Ω of sun, ring and carrier and their teeth Z,
    Z_s (Ω_s - Ω_c) = -Z_r (Ω_r - Ω_c) (Willis), and the mesh order is the absolute value of either
    side; all planets mesh at it with sun and ring. Relative to the carrier a planet turns
    mesh / Z_p times. A local fault of the sun, or of the ring, meets each planet once per turn
    relative to the carrier: n mesh / Z_s and n mesh / Z_r. A tooth of a planet meets sun and ring
    with opposite flanks: a fault of one flank strikes mesh / Z_p times, one of both flanks
    twice as often, which is the second harmonic of "planet fault" [1]_. "planet" is the absolute
    rotation of a planet. The mesh is modulated by the rotation of sun, ring and carrier, and by
    the passage of the planets at a sensor on the housing (n times that of the carrier).

    References
    ----------
    .. [1] Feng and Zuo, Vibration signal models for fault diagnosis of planetary gearboxes,
       J. Sound Vib. 331 (2012).

    Examples
    --------
    >>> stage = PlanetaryGear(21, 99, 3)
    >>> round(1 / stage.output_ratio, 4)
    5.7143
    >>> for line in stage.lines():
    ...     print(f"{line.name} {line.order:.4f}")
    mesh 17.3250
    sun fault 2.4750
    planet fault 0.4442
    ring fault 0.5250
    sun 1.0000
    planet 0.2692
    carrier 0.1750
    """

    sun_teeth: int
    ring_teeth: int
    n_planets: int
    planet_teeth: int | None = None
    _: KW_ONLY
    fixed: str = "ring"
    driven_by: str | None = None
    ratio: float = 1.0
    name: str = ""

    def __post_init__(self) -> None:
        """Check that the teeth fit, and which members rotate."""
        check_count(self.sun_teeth, "sun_teeth", at_least=2)
        check_count(self.ring_teeth, "ring_teeth", at_least=self.sun_teeth + 4)
        check_count(self.n_planets, "n_planets")
        space = self.ring_teeth - self.sun_teeth
        if self.planet_teeth is None:
            if space % 2:
                raise ValueError(
                    f"{self.ring_teeth} teeth of the ring and {self.sun_teeth} of the sun leave "
                    f"{space / 2:g} for a planet, which is not whole. Give planet_teeth."
                )
        else:
            check_count(self.planet_teeth, "planet_teeth", at_least=2, at_most=(space + 2) // 2)
        check_choice(self.fixed, "fixed", _MEMBERS)
        check_choice(self._input, "driven_by", _MEMBERS)
        if self._input == self.fixed:
            raise ValueError(f"driven_by and fixed must differ, got {self.fixed!r} for both.")
        check_mounting(self)

    @property
    def _input(self) -> str:
        return self.driven_by or ("carrier" if self.fixed == "sun" else "sun")

    @property
    def _planet(self) -> int:
        return self.planet_teeth or (self.ring_teeth - self.sun_teeth) // 2

    @property
    def speeds(self) -> dict[str, float]:
        """Signed revolutions of sun, planet, ring and carrier per revolution of the motor shaft."""
        # Relative to the carrier, the speeds are as those of the teeth (Willis).
        relative = {"sun": 1 / self.sun_teeth, "planet": -1 / self._planet}
        relative |= {"ring": -1 / self.ring_teeth, "carrier": 0.0}
        at_rest = relative[self.fixed]
        scale = self.ratio / (relative[self._input] - at_rest)
        return {member: scale * (speed - at_rest) for member, speed in relative.items()}

    @property
    def output_ratio(self) -> float:
        """Revolutions of the output, without their sign, per revolution of the motor shaft."""
        (output,) = set(_MEMBERS) - {self.fixed, self._input}
        return abs(self.speeds[output])

    def lines(self) -> tuple[Line, ...]:
        """Return the lines of the mesh, of local faults, and of the rotating members."""
        speeds = {member: abs(speed) for member, speed in self.speeds.items()}
        mesh = self.sun_teeth * abs(self.speeds["sun"] - self.speeds["carrier"])
        turning = {m: speed for m, speed in speeds.items() if speed > 1e-9 * self.ratio}
        of = {member: ((member, order),) for member, order in turning.items()}
        modulations = [item for item in turning.items() if item[0] != "planet"]
        if "carrier" in turning and self.n_planets > 1:
            modulations.append(("planet pass", self.n_planets * speeds["carrier"]))
        return (
            Line("mesh", "mesh", mesh, tuple(modulations), of_damage=False),
            Line("sun fault", "sun", self.n_planets * mesh / self.sun_teeth, of.get("sun", ())),
            Line("planet fault", "planet", mesh / self._planet, of.get("carrier", ())),
            Line("ring fault", "ring", self.n_planets * mesh / self.ring_teeth, of.get("ring", ())),
            *(
                Line(member, f"rotation of the {member}", order, of_damage=False)
                for member, order in turning.items()
            ),
        )
