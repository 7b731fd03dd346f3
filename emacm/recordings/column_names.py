"""Information in the name of a column: its unit, and whether it is a time or a shaft motion."""

from __future__ import annotations

import re

from emacm.recordings.units import is_speed_unit

_WITH_UNIT = re.compile(r"(.*\S)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))")
_TIMES = {"t", "time", "times", "timestamp", "timestamps", "seconds", "elapsed", "datetime"}
_TIMES |= {"zeit"}
_SHAFT = {"angle", "angular", "encoder", "keyphasor", "resolver", "rpm", "speed", "tacho"}
_SHAFT |= {"tachometer", "theta", "velocity", "omega", "drehzahl", "winkel"}
_SHAFT_ENDS = ("rpm", "speed", "drehzahl")
_LINEAR = {"linear", "nut", "slider", "piston"}  # velocities that are not of a shaft


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
    return set(_words(name)) <= _TIMES | {"s", "sec", "ms"} and bool(set(_words(name)) & _TIMES)


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
    return (
        is_speed_unit(unit) or bool(words & _SHAFT) or any(w.endswith(_SHAFT_ENDS) for w in words)
    )


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
