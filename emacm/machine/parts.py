"""Common properties of the parts of a machine: their lines, a speed ratio and a name."""

from __future__ import annotations

from typing import NamedTuple

from emacm._checks import check_number


class Line(NamedTuple):
    """One series of spectral lines of a part.

    Attributes
    ----------
    name : str
        Short name, such as "BPFI".
    kind : str
        Component or phenomenon, such as "inner ring".
    order : float
        Order of the first harmonic.
    sidebands : tuple of (str, float)
        Name and order of each modulation.
    slips : bool
        Whether the slip of rolling elements changes the order.
    strikes : int
        Impacts of a local defect per period: the first harmonic that it excites.
    of_damage : bool
        Whether an undamaged part has no such line, as against that of a shaft, mesh or supply.
    """

    name: str
    kind: str
    order: float
    sidebands: tuple[tuple[str, float], ...] = ()
    slips: bool = False
    strikes: int = 1
    of_damage: bool = True


class Part:
    """Base class of the parts of a machine, which compute the orders of their faults.

    Orders are cycles per revolution of the motor shaft. The formulas of rolling elements assume
    rolling without slip; real ones slip by 1 to 2 %, and their lines are marked accordingly. The
    orders of teeth, poles and shafts are exact.
    """

    name: str

    def lines(self) -> tuple[Line, ...]:
        """Return the series of spectral lines of the part."""
        raise NotImplementedError


def check_mounting(part: Part) -> None:
    """Check the speed ratio, where a part has one, and the name."""
    check_number(getattr(part, "ratio", 1.0), "ratio", above=0)
    if not isinstance(part.name, str) or "@" in part.name:
        raise TypeError(f"name must be a string without '@', got {part.name!r}.")
