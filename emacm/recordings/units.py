"""Units of angles, speeds and times, and whether two units of a channel are the same."""

from __future__ import annotations

from math import pi

_SPEEDS = {
    1.0: ("rad/s", "rad/sec", "1/s rad", "rad s^-1", "rad*s^-1"),
    pi / 30: ("rpm", "r/min", "rev/min", "1/min", "min^-1", "min-1", "u/min"),
    2 * pi: ("rev/s", "r/s", "rps", "hz", "1/s", "s^-1", "turns/s"),
    pi / 180: ("deg/s", "°/s", "degree/s", "degrees/s"),
}
_ANGLES = {
    1.0: ("rad", "radian", "radians"),
    pi / 180: ("deg", "°", "degree", "degrees"),
    2 * pi: ("rev", "revolution", "revolutions", "turn", "turns"),
}
_TIMES = {
    1.0: ("s", "sec", "second", "seconds"),
    1e-3: ("ms", "millisecond", "milliseconds"),
    1e-6: ("us", "µs", "μs", "microseconds"),
    1e-9: ("ns", "nanoseconds"),
    60.0: ("min", "minute", "minutes"),
    3600.0: ("h", "hour", "hours"),
}
_KINDS = {"velocity": ("rad/s", _SPEEDS), "angle": ("rad", _ANGLES), "time": ("s", _TIMES)}


def unit_factor(unit: str, kind: str) -> float:
    """Return the factor by which values in a unit become rad/s, rad or s.

    Parameters
    ----------
    unit : str
        Unit.
    kind : {"velocity", "angle", "time"}
        Quantity.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If the unit is not known.

    Examples
    --------
    >>> unit_factor("ms", "time"), round(unit_factor("rpm", "velocity") * 30, 6)
    (0.001, 3.141593)
    """
    target, known = _KINDS[kind]
    plain = _plain(unit)
    for factor, names in known.items():
        if plain in map(_plain, names):
            return factor
    first = ", ".join(repr(names[0]) for names in known.values())
    raise ValueError(
        f"the unit {unit!r} of the {kind} is not known; known are {first}. State one of these in "
        f"units of the layout, or convert the {kind} to {target}."
    )


def is_speed_unit(unit: str) -> bool:
    """Tell whether a unit is one of angular speed; Hz and 1/s may also be of something else.

    Examples
    --------
    >>> is_speed_unit("1/min"), is_speed_unit("Hz"), is_speed_unit("m/s")
    (True, False, False)
    """
    return bool(unit) and _plain(unit) in _ONLY_SPEEDS


def same_unit(one: str, other: str) -> bool:
    """Tell whether two units are written alike, apart from spaces and exponents.

    Examples
    --------
    >>> same_unit("m/s²", "m/s^2"), same_unit("mV", "MV")
    (True, False)
    """
    return _plain(one, case=True) == _plain(other, case=True)


def _plain(unit: str, *, case: bool = False) -> str:
    plain = unit.strip() if case else unit.strip().lower()
    for written, meant in (("²", "^2"), ("³", "^3"), ("⁻¹", "^-1"), ("**", "^"), ("·", "*")):
        plain = plain.replace(written, meant)
    plain = plain.replace(" ", "")
    return plain.replace("s2", "s^2") if plain.endswith("/s2") else plain


_ONLY_SPEEDS = {_plain(name) for names in _SPEEDS.values() for name in names}
_ONLY_SPEEDS -= {"hz", "1/s", "s^-1"}
