"""Parts of a machine, and at which orders a fault of each shows.

Orders are cycles per revolution of the motor shaft. Rolling elements are taken to roll without
slip; real ones slip by 1 to 2 %, and lines of theirs are marked so. Teeth, poles and
shafts are bound to the shaft exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from math import asin, atan, cos, gcd, lcm, pi
from typing import NamedTuple

from emacm._checks import check_choice, check_count, check_number

_FULL = pi * (1 + 1e-9)  # half angles of balls that touch all around


class Line(NamedTuple):
    """One series of spectral lines that a part makes.

    Attributes
    ----------
    name : str
        Its short name, such as "BPFI".
    kind : str
        What it tells of, such as "inner ring".
    order : float
        Its first order.
    sidebands : tuple of (str, float)
        What it is modulated by, and the order of that.
    slips : bool
        Whether it departs from the order by the slip of rolling elements.
    strikes : int
        Which harmonic a local defect excites first.
    """

    name: str
    kind: str
    order: float
    sidebands: tuple[tuple[str, float], ...] = ()
    slips: bool = False
    strikes: int = 1


@dataclass(frozen=True)
class Bearing:
    """A rolling bearing of balls or rollers.

    Parameters
    ----------
    n_balls : int
        Number of balls or rollers in a row, n.
    ball_diameter, pitch_diameter : float
        BD and PD, in one unit of length.
    contact_angle : float
        φ [rad]; a catalogue's 15 degrees are ``math.radians(15)``.
    ratio : float
        Revolutions of the rotating ring per revolution of the motor shaft.
    rotating : {"inner", "outer"}
        Which ring turns; the other stands still.
    name : str
        Put in front of the names of its lines, to tell two bearings apart.

    Raises
    ------
    TypeError, ValueError
        If a value is not what it should be, or the balls do not fit.

    Notes
    -----
    With γ = BD/PD cos φ: BPFO = n/2 (1 - γ), BPFI = n/2 (1 + γ), BSF = PD/(2 BD) (1 - γ²),
    FTF = (1 - γ)/2 [1]_. Eq. (2.1) of Chirico calls the first of them that of the inner
    ring; it is that of the outer. If the outer ring turns, the cage turns at (1 + γ)/2 (the mean
    of the two raceways' speeds), and the others, which depend on the rings' difference in speed
    alone, stay [2]_.

    BSF is how often a ball turns relative to the cage. A defect of it strikes both rings in each
    turn, so its lines start at 2 BSF, and BSF is given up to twice as many harmonics.
    The load is taken to stand still: it modulates the lines of a ring that turns by the turns of
    that ring, and those of a ball by the cage.

    References
    ----------
    .. [1] Randall and Antoni, Rolling element bearing diagnostics, a tutorial, Mech. Syst.
       Signal Process. 25 (2011), section 2.
    .. [2] Harris and Kotzalas, Essential Concepts of Bearing Technology (2006), ch. 10.

    Examples
    --------
    >>> for line in Bearing(9, 7.94, 39.04).lines():  # 6205
    ...     print(f"{line.name} {line.order:.4f}")
    BPFO 3.5848
    BPFI 5.4152
    BSF 2.3567
    FTF 0.3983
    """

    n_balls: int
    ball_diameter: float
    pitch_diameter: float
    contact_angle: float = 0.0
    _: KW_ONLY
    ratio: float = 1.0
    rotating: str = "inner"
    name: str = ""

    def __post_init__(self) -> None:
        """Check the geometry."""
        check_count(self.n_balls, "n_balls", at_least=2)
        _check_rolling(self)
        check_choice(self.rotating, "rotating", ("inner", "outer"))
        if self.n_balls * asin(self.ball_diameter / self.pitch_diameter) > _FULL:
            raise ValueError(
                f"{self.n_balls} balls of diameter {self.ball_diameter:g} do not fit on a pitch "
                f"circle of diameter {self.pitch_diameter:g}. n_balls counts one row; both "
                f"diameters are in one unit."
            )

    def lines(self) -> tuple[Line, ...]:
        """Return the lines of both rings, the balls and the cage."""
        gamma = self.ball_diameter / self.pitch_diameter * cos(self.contact_angle)
        inner = self.rotating == "inner"
        cage = self.ratio * (1 - gamma if inner else 1 + gamma) / 2
        spin = self.ratio * self.pitch_diameter / (2 * self.ball_diameter) * (1 - gamma**2)
        half = self.ratio * self.n_balls / 2
        turns = (("shaft", self.ratio),)
        return (
            Line("BPFO", "outer ring", half * (1 - gamma), () if inner else turns, slips=True),
            Line("BPFI", "inner ring", half * (1 + gamma), turns if inner else (), slips=True),
            Line("BSF", "ball", spin, (("FTF", cage),), slips=True, strikes=2),
            Line("FTF", "cage", cage, slips=True),
        )


@dataclass(frozen=True)
class Motor:
    """A permanent-magnet synchronous motor; its shaft is the one that orders refer to.

    Parameters
    ----------
    pole_pairs : int
        Half the number of poles; the currents lie at this order, Eq. (2.3) of Chirico.
    slots : int, optional
        Slots of the stator; they give the order of cogging.
    name : str
        Put in front of the names of its lines.

    Raises
    ------
    TypeError, ValueError
        If a value is not what it should be.

    Notes
    -----
    What turns with the shaft (imbalance, a bent shaft, an eccentric rotor, and by Chirico,
    section 4.5, perhaps poor lubrication) shows at multiples of the shaft, and in the
    current at the supply plus and minus these [1]_; the order does not tell them apart.
    Electrical noise lies at harmonics of the supply: magnetic pull at twice, torque ripple
    of the 5th and 7th harmonics of the current at six times. Cogging has the least common
    multiple of slots and poles in periods per revolution [2]_.

    References
    ----------
    .. [1] Le Roux, Harley and Habetler, Detecting rotor faults in low power permanent
       magnet synchronous machines, IEEE Trans. Power Electron. 22 (2007).
    .. [2] Zhu and Howe, Influence of design parameters on cogging torque in permanent
       magnet machines, IEEE Trans. Energy Convers. 15 (2000).

    Examples
    --------
    >>> [(line.name, line.order) for line in Motor(6, slots=36).lines()]
    [('shaft', 1.0), ('supply', 6.0), ('cogging', 36.0)]
    """

    pole_pairs: int
    slots: int | None = None
    _: KW_ONLY
    name: str = ""

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_count(self.pole_pairs, "pole_pairs")
        if self.slots is not None:
            check_count(self.slots, "slots", at_least=2)
        _check_name(self.name)

    def lines(self) -> tuple[Line, ...]:
        """Return the lines of the shaft, the supply and, if `slots` is known, cogging."""
        shaft = (("shaft", 1.0),)
        lines = [
            Line("shaft", "imbalance or eccentricity", 1.0),
            Line("supply", "supply", float(self.pole_pairs), shaft),
        ]
        if self.slots is not None:
            periods = float(lcm(self.slots, 2 * self.pole_pairs))
            lines.append(Line("cogging", "cogging", periods, shaft))
        return tuple(lines)


@dataclass(frozen=True)
class Gear:
    """Two gears in mesh.

    Parameters
    ----------
    teeth, mating_teeth : int
        Teeth of the gear on the driving shaft (the pinion) and of the one it drives (the wheel).
    ratio : float
        Revolutions of the driving shaft per revolution of the motor shaft.
    name : str
        Put in front of the names of its lines, to tell two pairs apart.

    Raises
    ------
    TypeError, ValueError
        If a value is not what it should be.

    Notes
    -----
    The same two teeth meet once in lcm(teeth, mating teeth) meshes: the hunting tooth. A wear
    pattern that was run in repeats with every gcd(teeth, mating teeth) meshes: the assembly phase;
    it is left out where the gcd is 1, because it is the mesh itself [1]_. A fault of one of the
    gears modulates the mesh by the turns of that gear.

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
        check_number(self.ratio, "ratio", above=0)
        _check_name(self.name)

    @property
    def output_ratio(self) -> float:
        """Revolutions of the driven shaft per revolution of the motor shaft."""
        return self.ratio * self.teeth / self.mating_teeth

    def lines(self) -> tuple[Line, ...]:
        """Return the lines of the mesh, of both gears and of pairs of teeth."""
        mesh, common = self.ratio * self.teeth, gcd(self.teeth, self.mating_teeth)
        shafts = (("pinion", self.ratio), ("wheel", self.output_ratio))
        lines = [
            Line("mesh", "mesh", mesh, shafts),
            Line("pinion", "pinion", self.ratio),
            Line("wheel", "wheel", self.output_ratio),
            Line("hunting", "hunting tooth", mesh / lcm(self.teeth, self.mating_teeth)),
        ]
        if common > 1:
            lines.append(Line("phase", "assembly phase", mesh / common))
        return tuple(lines)


@dataclass(frozen=True)
class BallScrew:
    """A ball screw, its screw or its nut driven.

    Parameters
    ----------
    balls_per_turn : float
        Balls in one turn of the thread, need not be whole.
    ball_diameter, pitch_diameter, lead : float
        Of a ball, of the circle of ball centres, and travel per revolution, in one unit.
    contact_angle : float
        Angle between the contacts and the radius [rad].
    ratio : float
        Revolutions of the screw (or nut) per revolution of the motor shaft.
    rotating : {"screw", "nut"}
        Which of them turns; the other may travel.
    circuit_balls : int, optional
        Balls in one circuit, those in the return included.
    name : str
        Put in front of the names of its lines.

    Raises
    ------
    TypeError, ValueError
        If a value is not what it should be, or the balls do not fit.

    Notes
    -----
    A bearing whose raceways are helices. With the lead angle λ = atan(lead / (π PD)) and
    γ = BD/PD cos φ cos² λ, rolling without slip at two opposite contacts makes n/2 (1 - γ) balls
    pass a point of the nut in a turn (a spall of the nut, and each entry of a ball into the return)
    and n/2 (1 + γ) a point of the thread; a ball spins PD/(2 BD cos λ) (1 - γ²) times. Without
    lead these are the formulas of `Bearing`. Derived here; compare [1]_ for the motion of
    the balls. A ball comes back to the return ("circuit") once while `circuit_balls`
    pass. How balls crowd in the return is not taken into account.

    References
    ----------
    .. [1] Lin, Ravani and Velinsky, Kinematics of the ball screw mechanism, J. Mech. Des.
       116 (1994).

    Examples
    --------
    >>> for line in BallScrew(17, 3.175, 20.0, 5.0, circuit_balls=60).lines():
    ...     print(f"{line.name} {line.order:.3f}")
    screw 1.000
    nut race 7.552
    thread 9.448
    spin 3.120
    orbit 0.444
    circuit 0.126
    """

    balls_per_turn: float
    ball_diameter: float
    pitch_diameter: float
    lead: float
    contact_angle: float = pi / 4
    _: KW_ONLY
    ratio: float = 1.0
    rotating: str = "screw"
    circuit_balls: int | None = None
    name: str = ""

    def __post_init__(self) -> None:
        """Check the geometry."""
        check_number(self.balls_per_turn, "balls_per_turn", above=0)
        _check_rolling(self)
        check_number(self.lead, "lead", above=0)
        check_choice(self.rotating, "rotating", ("screw", "nut"))
        turn = pi * self.pitch_diameter / cos(self._lead_angle)
        if self.balls_per_turn * self.ball_diameter > turn * (1 + 1e-9):
            raise ValueError(
                f"{self.balls_per_turn:g} balls of diameter {self.ball_diameter:g} do not fit in a "
                f"turn of length {turn:g}. All lengths are in one unit."
            )
        if self.circuit_balls is not None:
            check_count(self.circuit_balls, "circuit_balls")

    @property
    def _lead_angle(self) -> float:
        return atan(self.lead / (pi * self.pitch_diameter))

    def lines(self) -> tuple[Line, ...]:
        """Return the lines of screw, nut, balls and, if known, of the circuit."""
        size, slope = self.ball_diameter / self.pitch_diameter, cos(self._lead_angle)
        gamma = size * cos(self.contact_angle) * slope**2
        screw = self.rotating == "screw"
        orbit = self.ratio * (1 - gamma if screw else 1 + gamma) / 2
        half = self.ratio * self.balls_per_turn / 2
        spin = self.ratio * (1 - gamma**2) / (2 * size * slope)
        turns = ((self.rotating, self.ratio),)
        lines = [
            Line(self.rotating, "shaft of the screw", self.ratio),
            Line("nut race", "nut", half * (1 - gamma), () if screw else turns, slips=True),
            Line("thread", "screw", half * (1 + gamma), turns if screw else (), slips=True),
            Line("spin", "ball", spin, (("orbit", orbit),), slips=True, strikes=2),
            Line("orbit", "balls", orbit, slips=True),
        ]
        if self.circuit_balls is not None:
            circuit = half * (1 - gamma) / self.circuit_balls
            lines.append(Line("circuit", "recirculation", circuit, slips=True))
        return tuple(lines)


Part = Bearing | Motor | Gear | BallScrew


def _check_rolling(part: Bearing | BallScrew) -> None:
    """Check what bearings and ball screws share."""
    check_number(part.ball_diameter, "ball_diameter", above=0)
    check_number(part.pitch_diameter, "pitch_diameter", above=part.ball_diameter)
    check_number(part.ratio, "ratio", above=0)
    angle = check_number(part.contact_angle, "contact_angle", at_least=0, unit="rad")
    if angle >= pi / 2:
        raise ValueError(
            f"contact_angle must be below pi/2 rad, got {angle:g}. "
            f"Convert degrees by math.radians({angle:g})."
        )
    _check_name(part.name)


def _check_name(name: str) -> None:
    if not isinstance(name, str) or "@" in name:
        raise TypeError(f"name must be a string without '@', got {name!r}.")


def check_distinct(names: Sequence[str]) -> None:
    """Raise a ValueError if two lines of a machine have one name.

    Examples
    --------
    >>> check_distinct(["BPFI", "BPFO"])
    """
    for place, name in enumerate(names):
        if name in names[:place]:
            raise ValueError(
                f"two parts give a line the name {name!r}. Tell them apart by name=..., as in "
                f"Bearing(..., name='front')."
            )
