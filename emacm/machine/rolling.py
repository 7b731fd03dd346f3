"""Parts with rolling elements: bearings and ball screws."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from functools import cache
from math import asin, atan, cos, pi, radians
from pathlib import Path

import pandas as pd

from emacm._checks import check_choice, check_count, check_number
from emacm.machine.parts import Line, Part, check_mounting


@dataclass(frozen=True)
class Bearing(Part):
    """A ball or roller bearing.

    Parameters
    ----------
    n_balls : int
        Number n of balls or rollers in one row.
    ball_diameter, pitch_diameter : float
        BD and PD, in the same unit of length.
    contact_angle : float
        φ [rad]; for 15 degrees, write ``math.radians(15)``.
    ratio : float
        Revolutions of the rotating ring per revolution of the motor shaft.
    rotating : {"inner", "outer"}
        The rotating ring; the other one is stationary.
    few_balls : bool
        Confirms that the balls fill less than 30 % of the pitch circle.
    name : str
        Prefix of the names of its lines; distinguishes two bearings.

    Raises
    ------
    TypeError, ValueError
        If a value is out of range, the balls do not fit, or they fill less than 30 % of the pitch
        circle, as if the diameters were in two units: in bearings, they fill half of it or more.

    See Also
    --------
    emacm.fault_orders : Orders of the faults of several parts.
    emacm.find_faults : Names the fault of a recording.

    Notes
    -----
    With γ = BD/PD cos φ: BPFO = n/2 (1 - γ), BPFI = n/2 (1 + γ), BSF = PD/(2 BD) (1 - γ²),
    FTF = (1 - γ)/2 [1]_. Eq. (2.1) of Chirico attributes the first formula to the inner ring;
    it is that of the outer ring. If the outer ring rotates, FTF = (1 + γ)/2 (mean of the raceway
    speeds); the others depend only on the difference in speed of the rings [2]_.

    BSF counts turns of a ball relative to the cage. A defect of a ball strikes both rings in each
    turn, so its lines start at 2 BSF, and twice as many harmonics of BSF are given. The load is
    assumed stationary: it modulates the rotating ring once per revolution, and a ball by the cage.

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
    few_balls: bool = False
    name: str = ""

    def __post_init__(self) -> None:
        """Check the geometry."""
        check_count(self.n_balls, "n_balls", at_least=2)
        check_choice(self.rotating, "rotating", ("inner", "outer"))
        _check_rolling(self, self.n_balls)

    def lines(self) -> tuple[Line, ...]:
        """Return the lines of both rings, the balls and the cage."""
        kinds = {"BPFO": "outer ring", "BPFI": "inner ring", "BSF": "ball", "FTF": "cage"}
        turns = ("shaft", self.ratio)
        return _rolling_lines(kinds, self, self.n_balls, turns, self.rotating == "inner")


@dataclass(frozen=True)
class BallScrew(Part):
    """A ball screw with a rotating screw or a rotating nut.

    Parameters
    ----------
    balls_per_turn : float
        Number n of balls in one turn of the thread; need not be an integer.
    ball_diameter, pitch_diameter, lead : float
        BD, PD (circle of the ball centres), and travel per revolution, in the same unit.
    contact_angle : float
        Angle φ between contact line and radius [rad].
    ratio : float
        Revolutions of the screw (or nut) per revolution of the motor shaft.
    rotating : {"screw", "nut"}
        The rotating part; the other one may travel.
    few_balls : bool
        Confirms that the balls fill less than 30 % of the pitch circle.
    name : str
        Prefix of the names of its lines.

    Raises
    ------
    TypeError, ValueError
        As `Bearing`.

    See Also
    --------
    emacm.Bearing : A bearing.
    emacm.fault_orders : Orders of the faults of several parts.

    Notes
    -----
    A bearing with helical raceways. With the lead angle λ = atan(lead / (π PD)) and
    γ = BD/PD cos φ cos² λ, for rolling without slip at two opposite contacts, n/2 (1 - γ) balls
    per revolution pass a point of the nut (order of a nut spall, and of the balls entering the
    return), n/2 (1 + γ) a point of the thread, and a ball spins PD/(2 BD cos λ) (1 - γ²) times.
    Without lead these are the formulas of `Bearing`. Derived here; kinematics: [1]_. Crowding of
    balls in the return is neglected.

    References
    ----------
    .. [1] Lin, Ravani and Velinsky, Kinematics of the ball screw mechanism, J. Mech. Des.
       116 (1994).

    Examples
    --------
    >>> for line in BallScrew(17, 3.175, 20.0, 5.0).lines():
    ...     print(f"{line.name} {line.order:.3f}")
    screw 1.000
    nut race 7.552
    thread 9.448
    spin 3.120
    orbit 0.444
    """

    balls_per_turn: float
    ball_diameter: float
    pitch_diameter: float
    lead: float
    contact_angle: float = pi / 4
    _: KW_ONLY
    ratio: float = 1.0
    rotating: str = "screw"
    few_balls: bool = False
    name: str = ""

    def __post_init__(self) -> None:
        """Check the geometry."""
        check_number(self.balls_per_turn, "balls_per_turn", above=0)
        check_number(self.lead, "lead", above=0)
        check_choice(self.rotating, "rotating", ("screw", "nut"))
        _check_rolling(self, self.balls_per_turn, self.lead)

    def lines(self) -> tuple[Line, ...]:
        """Return the lines of screw, nut and balls."""
        kinds = {"nut race": "nut", "thread": "screw", "spin": "ball", "orbit": "balls"}
        turns, screw = (self.rotating, self.ratio), self.rotating == "screw"
        lines = _rolling_lines(kinds, self, self.balls_per_turn, turns, screw, self.lead)
        shaft = Line(self.rotating, "shaft of the screw", self.ratio, of_damage=False)
        return (shaft, *lines)


def _rolling_lines(
    kinds: Mapping[str, str],
    part: Bearing | BallScrew,
    n_balls: float,
    turns: tuple[str, float],
    inner_rotates: bool,
    lead: float = 0.0,
) -> tuple[Line, ...]:
    """Return the lines of outer and inner raceway, balls and cage; `kinds` states their names."""
    outer, inner, ball, cage = kinds
    slope = cos(atan(lead / (pi * part.pitch_diameter)))
    size = part.ball_diameter / part.pitch_diameter
    gamma = size * cos(part.contact_angle) * slope**2
    orbit = part.ratio * (1 - gamma if inner_rotates else 1 + gamma) / 2
    spin = part.ratio * (1 - gamma**2) / (2 * size * slope)
    half = part.ratio * n_balls / 2
    of_inner, of_outer = ((turns,), ()) if inner_rotates else ((), (turns,))
    return (
        Line(outer, kinds[outer], half * (1 - gamma), of_outer, slips=True),
        Line(inner, kinds[inner], half * (1 + gamma), of_inner, slips=True),
        Line(ball, kinds[ball], spin, ((cage, orbit),), slips=True, strikes=2),
        Line(cage, kinds[cage], orbit, slips=True),
    )


def _check_rolling(part: Bearing | BallScrew, n_balls: float, lead: float = 0.0) -> None:
    """Check the geometry of the rolling elements of one row, or one turn."""
    check_number(part.ball_diameter, "ball_diameter", above=0)
    check_number(part.pitch_diameter, "pitch_diameter", above=part.ball_diameter)
    angle = check_number(part.contact_angle, "contact_angle", at_least=0, unit="rad")
    if angle >= pi / 2:
        raise ValueError(
            f"contact_angle must be below pi/2 rad, got {angle:g}. "
            f"If it is in degrees, write {radians(angle):.6g}."
        )
    check_mounting(part)
    slope = cos(atan(lead / (pi * part.pitch_diameter)))
    share = n_balls * asin(part.ball_diameter * slope / part.pitch_diameter) / pi  # of the circle
    if share > 1 + 1e-9:
        raise ValueError(
            f"{n_balls:g} balls of diameter {part.ball_diameter:g} do not fit on a pitch circle of "
            f"diameter {part.pitch_diameter:g}. Give those of one row or turn, in one unit."
        )
    if share < 0.3 and not part.few_balls:
        raise ValueError(
            f"{n_balls:g} balls of diameter {part.ball_diameter:g} fill {share:.0%} of a pitch "
            f"circle of diameter {part.pitch_diameter:g}; those of bearings fill half of it or "
            f"more. Give both diameters in one unit, or confirm the geometry by few_balls=True."
        )


@cache
def published_bearings() -> pd.DataFrame:
    """Return the bearings of which the geometry is published, by designation.

    Returns
    -------
    DataFrame
        "n_balls" (of one row), "ball_diameter" and "pitch_diameter" (in one unit, or relative to
        the pitch diameter), "contact_angle_deg" [degrees] and "source".

    Notes
    -----
    Where the source gives orders, as the table of Timken for ball bearings by the size of their
    outer ring does, the ratio of both diameters is derived from them, and the contact angle where
    it is not 0; all published orders of the bearings listed agree with it. Sources
    "by bearing-datasets" were read in that package, which cites the tables of the data sets. Where
    the source is load ratings, n BD² = C0r / f0 (ISO 76), which the catalogue of NSK states; with
    balls of multiples of 1/64 inch, and PD the mean of bore and outer diameter, only one n agrees
    with f0, a function of BD / PD, and with Cr (ISO 281).

    Left out: 305K of Timken contradicts itself, 306K repeats 304K, and 9105 (6005) repeats 205K;
    the pitch diameter of 30204 in the University of Seoul data is 7 % above the mean of bore and
    outer diameter; the ratings of 6305 differ by 14 % between NSK and SKF. Series 72 is missing,
    because makers fill it differently: in the size of 7205, SNFA (E 225) has 12 balls and GMN
    (S 6205) 13. Of NU2 and 222, few sizes have a source that could be read.

    By its load ratings, NSK has 8 balls in 6200 and 10 in 6209, where the table has 7 of GMN and 9
    of Timken: BPFO is 21 and 13 % higher there.

    Examples
    --------
    >>> published_bearings().loc["6205", "source"]
    'CWRU test rig, drive end'
    """
    return pd.read_csv(Path(__file__).with_name("bearings.csv"), index_col="designation")


def designation_in(text: str) -> str | None:
    """Return the designation of a published bearing in a text, without maker, suffix and blanks.

    Examples
    --------
    >>> designation_in("SKF 6205-2RS C3"), designation_in("62052rs"), designation_in("7205 B")
    ('6205', '6205', None)
    """
    plain = re.sub(r"[\s/-]", "", text).upper()
    for name in sorted(published_bearings().index, key=len, reverse=True):
        # A digit may follow only as that of seals: 2RS, 2Z.
        if re.match(rf"[A-Z]*?{name.replace('-', '')}(?!\d(?![RZ]))", plain):
            return str(name)
    return None


def bearing_of(text: str) -> Bearing:
    """Return a bearing from its designation, or from numbers separated by commas.

    Parameters
    ----------
    text : str
        A designation of `published_bearings`, with or without maker and suffix, or the number of
        balls, ball diameter, pitch diameter, and contact angle [degrees], 0 if it is left out.

    Returns
    -------
    Bearing

    Raises
    ------
    ValueError
        If it is neither; the message lists the designations.

    Notes
    -----
    Bearings of one designation have the same outer dimensions, but the geometry inside is that of
    the maker: with the same number of balls, the orders differ by some tenths of a percent (6205:
    BPFO 3.585 on the CWRU test rig, 3.574 of Timken), which a slip of 2 % covers; with another
    number, they are others, and the numbers of the maker must be given.

    Examples
    --------
    >>> bearing_of("SKF 6205-2RS C3") == bearing_of("9,7.94,39.04")
    True
    """
    known, name = published_bearings(), designation_in(text)
    numbers = text.split(",") if name is None else known.loc[name].tolist()[:4]
    try:
        n_balls, ball, pitch, *angle = numbers
        (in_degrees,) = angle or (0.0,)
        geometry = int(n_balls), float(ball), float(pitch), radians(float(in_degrees))
    except ValueError:
        raise ValueError(
            f"the bearing must be one of {', '.join(known.index)}, or as in 9,7.94,39.04 (balls, "
            f"ball diameter, pitch diameter, and contact angle in degrees); got {text!r}."
        ) from None
    return Bearing(*geometry)
