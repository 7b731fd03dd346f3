"""Units of angles, speeds and times, and how two units of a channel are related."""

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
_SIGNALS: dict[str, dict[str, float]] = {  # unit of each quantity and its size; case matters
    "m/s^2": {"m/s^2": 1.0, "mm/s^2": 1e-3, "g": 9.80665, "G": 9.80665, "gn": 9.80665},
    "m/s": {"m/s": 1.0, "mm/s": 1e-3, "in/s": 0.0254, "ips": 0.0254},
    "m": {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "mil": 25.4e-6},
    "V": {"V": 1.0, "mV": 1e-3, "uV": 1e-6, "µV": 1e-6, "μV": 1e-6, "kV": 1e3},
    "A": {"A": 1.0, "mA": 1e-3, "kA": 1e3},
    "N": {"N": 1.0, "kN": 1e3, "mN": 1e-3},
    "N*m": {"N*m": 1.0, "Nm": 1.0, "mNm": 1e-3, "Ncm": 1e-2, "kNm": 1e3},
    "Pa": {"Pa": 1.0, "hPa": 100.0, "kPa": 1e3, "MPa": 1e6, "bar": 1e5, "mbar": 100.0},
    "W": {"W": 1.0, "kW": 1e3, "mW": 1e-3},
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


def unit_ratio(one: str, other: str) -> float | None:
    """Return the factor by which values in one unit of a channel become values in another.

    Returns
    -------
    float or None
        None if a unit is not known, or they are units of different quantities.

    Examples
    --------
    >>> unit_ratio("g", "m/s²"), unit_ratio("mV", "V"), unit_ratio("mV", "g"), unit_ratio("x", "x")
    (9.80665, 0.001, None, 1.0)
    """
    if same_unit(one, other):
        return 1.0
    before, after = _plain(one, case=True), _plain(other, case=True)
    for sizes in _SIGNALS.values():
        if before in sizes and after in sizes:
            return sizes[before] / sizes[after]
    return None


def _plain(unit: str, *, case: bool = False) -> str:
    plain = unit.strip() if case else unit.strip().lower()
    for written, meant in (("²", "^2"), ("³", "^3"), ("⁻¹", "^-1"), ("**", "^"), ("·", "*")):
        plain = plain.replace(written, meant)
    plain = plain.replace(" ", "")
    return plain.replace("s2", "s^2") if plain.endswith("/s2") else plain


_ONLY_SPEEDS = {_plain(name) for names in _SPEEDS.values() for name in names}
_ONLY_SPEEDS -= {"hz", "1/s", "s^-1"}
