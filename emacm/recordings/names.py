"""Names of channels and columns, and the units that they state."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from math import pi
from typing import Any

from emacm._checks import once_hint

_WITH_UNIT = re.compile(r"(.*\S)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))")
_TIME_WORDS = {"t", "time", "times", "timestamp", "timestamps", "seconds", "elapsed", "datetime"}
_TIME_WORDS |= {"zeit"}
_SHAFT_WORDS = {"angle", "angular", "encoder", "keyphasor", "resolver", "rpm", "speed", "tacho"}
_SHAFT_WORDS |= {"tachometer", "theta", "velocity", "omega", "drehzahl", "winkel"}
_SHAFT_ENDINGS = ("rpm", "speed", "drehzahl")
_LINEAR = {"linear", "nut", "slider", "piston"}  # velocities that are not of a shaft
_MOTION_UNITS = {  # SI unit, and factors to it
    "velocity": (
        "rad/s",
        {
            1.0: ("rad/s", "rad/sec", "1/s rad", "rad s^-1", "rad*s^-1"),
            pi / 30: ("rpm", "r/min", "rev/min", "1/min", "min^-1", "min-1", "u/min"),
            2 * pi: ("rev/s", "r/s", "rps", "hz", "1/s", "s^-1", "turns/s"),
            pi / 180: ("deg/s", "°/s", "degree/s", "degrees/s"),
        },
    ),
    "angle": (
        "rad",
        {
            1.0: ("rad", "radian", "radians"),
            pi / 180: ("deg", "°", "degree", "degrees"),
            2 * pi: ("rev", "revolution", "revolutions", "turn", "turns"),
        },
    ),
    "time": (
        "s",
        {
            1.0: ("s", "sec", "second", "seconds"),
            1e-3: ("ms", "millisecond", "milliseconds"),
            1e-6: ("us", "µs", "μs", "microseconds"),
            1e-9: ("ns", "nanoseconds"),
            60.0: ("min", "minute", "minutes"),
            3600.0: ("h", "hour", "hours"),
        },
    ),
}
_SIGNALS = {  # unit of each quantity and its size; case matters
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


def chosen_channels(channels: Any, known: Sequence[str]) -> tuple[str, ...]:
    """Return the channels that the parameter `channels` of an estimator chooses.

    Parameters
    ----------
    channels : sequence of str, or None
        Names of channels in the order wanted; None for all.
    known : sequence of str
        All channels, for None. Whether the names are among them is not checked.

    Returns
    -------
    tuple of str

    Raises
    ------
    TypeError
        If `channels` is a single name, has no order (a set), can be read only once (a generator),
        or holds something that is not a name.
    ValueError
        If it is empty or repeats a name.

    Examples
    --------
    >>> chosen_channels(["torque", "current"], ("current", "speed", "torque"))
    ('torque', 'current')
    """
    if channels is None:
        return tuple(known)
    if isinstance(channels, str):
        raise TypeError(f"channels must be a list of names such as [{channels!r}]; got a text.")
    if not isinstance(channels, Iterable) or isinstance(channels, Mapping | Set | Iterator):
        raise TypeError(
            f"channels must be a list of names such as ['current'], got {channels!r}."
            f"{once_hint(channels)}"
        )
    chosen = tuple(channels)
    for name in chosen:
        if not isinstance(name, str):
            raise TypeError(f"channels must be a list of names, got {name!r} in {chosen!r}.")
    if not chosen or len(set(chosen)) < len(chosen):
        raise ValueError(
            f"channels must name at least one channel, and name each channel once; got "
            f"{list(chosen)}."
        )
    return chosen


def check_channel_names(known: Sequence[Any], channels: Sequence[Any], where: str = "it") -> None:
    """Raise a ValueError if one of `channels` is not among those that are known."""
    missing = [name for name in channels if name not in known]
    if missing:
        raise ValueError(
            f"{where} has no channel {missing[0]!r}; its channels are {list(known)}, expected "
            f"were {list(channels)}. If the names differ, use Recording.rename, or channels = "
            f"{{name: column}} in the Layout of a file."
        )


def split_unit(name: str) -> tuple[str, str]:
    """Return the name of a column without its unit, and the unit; "" if it states none.

    Examples
    --------
    >>> split_unit("speed [rpm]"), split_unit("vibration (g)"), split_unit("vibration")
    (('speed', 'rpm'), ('vibration', 'g'), ('vibration', ''))
    """
    found = _WITH_UNIT.fullmatch(name.strip())
    if found is None:
        return name.strip(), ""
    return found[1], (found[2] if found[3] is None else found[3]).strip()


def is_time_name(name: str) -> bool:
    """Tell whether a column with this name usually holds the times of the samples.

    Examples
    --------
    >>> is_time_name("Time [s]"), is_time_name("time_constant")
    (True, False)
    """
    return set(_words(name)) <= _TIME_WORDS | {"s", "sec", "ms"} and bool(
        set(_words(name)) & _TIME_WORDS
    )


def is_shaft_name(name: str, unit: str = "") -> bool:
    """Tell whether a column with this name and unit usually holds the motion of the shaft.

    Examples
    --------
    >>> is_shaft_name("shaft_speed"), is_shaft_name("MotorRPM"), is_shaft_name("n", "1/min")
    (True, True, True)
    >>> is_shaft_name("current"), is_shaft_name("nut_speed", "mm/s")
    (False, False)
    """
    words = set(_words(name))
    if words & _LINEAR:
        return False
    named = bool(words & _SHAFT_WORDS) or any(word.endswith(_SHAFT_ENDINGS) for word in words)
    return named or is_speed_unit(unit)


def unit_in_name(name: str) -> str:
    """Return the unit of speed that is a part of a name; "" if there is none.

    Examples
    --------
    >>> unit_in_name("motor_rpm"), unit_in_name("X097RPM"), unit_in_name("speed")
    ('rpm', 'rpm', '')
    """
    return "rpm" if any(word.endswith("rpm") for word in _words(name)) else ""


def _words(name: str) -> list[str]:
    """Return the words of a name, without its unit, in lower case; "shaftSpeed" has two."""
    plain = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", split_unit(name)[0])
    return re.findall(r"[a-z]+", plain.lower())


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
    target, known = _MOTION_UNITS[kind]
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
    names = {_plain(name) for names in _MOTION_UNITS["velocity"][1].values() for name in names}
    return bool(unit) and _plain(unit) in names - {"hz", "1/s", "s^-1"}


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
