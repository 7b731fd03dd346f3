"""Names of channels and columns, and the units that they state."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from math import pi
from typing import Any

from emacm._checks import once_hint

_TIME_WORDS = {"t", "time", "times", "timestamp", "timestamps", "seconds", "elapsed", "datetime"}
_TIME_WORDS |= {"zeit", "zeitstempel", "uhrzeit", "temps", "tempo", "tiempo", "horodatage"}
_SHAFT_WORDS = {"angle", "angular", "encoder", "keyphasor", "resolver", "rpm", "speed", "tacho"}
_SHAFT_WORDS |= {"tach", "tachometer", "theta", "velocity", "omega", "drehzahl", "winkel"}
_SHAFT_WORDS |= {"vitesse", "velocidad"}
_SHAFT_ENDINGS = ("rpm", "speed", "drehzahl")
_LINEAR = {"linear", "nut", "slider", "piston"}  # velocities that are not of a shaft
_UNITS: dict[str, dict[float, tuple[str, ...]]] = {  # of each quantity, by their size
    "velocity": {  # lower case, as the units of angle and time
        1.0: ("rad/s", "rad/sec", "1/s rad", "rad s^-1", "rad*s^-1"),
        pi / 30: (
            "rpm",
            "r/min",
            "rev/min",
            "1/min",
            "min^-1",
            "min-1",
            "u/min",
            "tr/min",
            "giri/min",
        ),
        2 * pi: ("rev/s", "r/s", "rps", "hz", "1/s", "s^-1", "turns/s"),
        pi / 180: ("deg/s", "°/s", "degree/s", "degrees/s"),
    },
    "angle": {
        1.0: ("rad", "radian", "radians"),
        pi / 180: ("deg", "°", "degree", "degrees"),
        2 * pi: ("rev", "revolution", "revolutions", "turn", "turns"),
    },
    "time": {
        1.0: ("s", "sec", "second", "seconds"),
        1e-3: ("ms", "millisecond", "milliseconds"),
        1e-6: ("us", "µs", "μs", "microseconds"),
        1e-9: ("ns", "nanoseconds"),
        60.0: ("min", "minute", "minutes"),
        3600.0: ("h", "hour", "hours"),
        86_400.0: ("d", "day", "days"),
    },
    "acceleration": {1.0: ("m/s^2",), 1e-3: ("mm/s^2",), 9.80665: ("g", "G", "gn")},
    "speed": {1.0: ("m/s",), 1e-3: ("mm/s",), 0.0254: ("in/s", "ips")},
    "length": {1.0: ("m",), 1e-3: ("mm",), 1e-6: ("um", "µm", "μm"), 25.4e-6: ("mil",)},
    "voltage": {1.0: ("V",), 1e-3: ("mV",), 1e-6: ("uV", "µV", "μV"), 1e3: ("kV",)},
    "current": {1.0: ("A",), 1e-3: ("mA",), 1e3: ("kA",)},
    "force": {1.0: ("N",), 1e3: ("kN",), 1e-3: ("mN",)},
    "torque": {1.0: ("N*m", "Nm"), 1e-3: ("mNm",), 1e-2: ("Ncm",), 1e3: ("kNm",)},
    "pressure": {1.0: ("Pa",), 1e2: ("hPa", "mbar"), 1e3: ("kPa",), 1e6: ("MPa",), 1e5: ("bar",)},
    "power": {1.0: ("W",), 1e3: ("kW",), 1e-3: ("mW",)},
}


def printable(path: str | os.PathLike[str]) -> str:
    r"""Return the name of a file as it can be printed and stored, also if it is not UTF-8.

    Parameters
    ----------
    path : str or Path
        The file; bytes of its name that are not UTF-8, as of umlauts in Latin-1, are surrogates.

    Returns
    -------
    str
        The same, with such bytes written as ``\xfc``.

    Examples
    --------
    >>> print(printable(os.fsdecode(b"pr\xfcfung.csv")), printable("prüfung.csv"))
    pr\xfcfung.csv prüfung.csv
    """
    return os.fsencode(path).decode("utf-8", "backslashreplace")


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
    ordered = isinstance(channels, Iterable) and not isinstance(
        channels, str | Mapping | Set | Iterator
    )
    if not ordered or not all(isinstance(name, str) for name in channels):
        example = [channels] if isinstance(channels, str) else ["current"]
        raise TypeError(
            f"channels must be a list of names such as {example}, got {channels!r}."
            f"{once_hint(channels)}"
        )
    chosen = tuple(channels)
    if not chosen or len(set(chosen)) < len(chosen):
        raise ValueError(f"channels must have at least one name, each once; got {list(chosen)}.")
    return chosen


def check_channel_names(known: Sequence[Any], channels: Sequence[Any], where: str = "it") -> None:
    """Raise a ValueError if one of `channels` is not among those that are known."""
    missing = [name for name in channels if name not in known]
    if missing:
        raise ValueError(
            f"{where} has no channel {missing[0]!r}; its channels are {list(known)}, expected "
            f"were {list(channels)}. If the names differ, set channels = {{name: column}} in the "
            f"Layout of a file, or make the Recording with these names."
        )


def split_unit(name: str) -> tuple[str, str]:
    """Return the name of a column without its unit, and the unit; "" if it states none.

    Examples
    --------
    >>> split_unit("speed [rpm]"), split_unit("vibration (g)"), split_unit("vibration")
    (('speed', 'rpm'), ('vibration', 'g'), ('vibration', ''))
    """
    text = name.strip()
    for opening, closing in ("[]", "()"):
        before, _, unit = text.removesuffix(closing).rpartition(opening)
        if text.endswith(closing) and before.strip() and closing not in unit:
            return before.rstrip(), unit.strip()
    return text, ""


def is_time_name(name: str) -> bool:
    """Tell whether a column with this name usually holds the times of the samples.

    Examples
    --------
    >>> is_time_name("Time [s]"), is_time_name("time_constant")
    (True, False)
    """
    words = set(_words(name))
    return bool(words & _TIME_WORDS) and words <= _TIME_WORDS | {"s", "sec", "ms", "us", "ns"}


def is_shaft_name(name: str, unit: str = "") -> bool:
    """Tell whether a column with this name and unit usually holds the motion of the shaft.

    Hz and 1/s may also be units of something else.

    Examples
    --------
    >>> is_shaft_name("shaft_speed"), is_shaft_name("MotorRPM"), is_shaft_name("n", "1/min")
    (True, True, True)
    >>> is_shaft_name("current"), is_shaft_name("nut_speed", "mm/s"), is_shaft_name("n", "Hz")
    (False, False, False)
    """
    words, plain = set(_words(name)), _plain(unit)
    if words & _LINEAR or any(plain in _sizes(linear) for linear in ("speed", "acceleration")):
        return False
    named = bool(words & _SHAFT_WORDS) or any(word.endswith(_SHAFT_ENDINGS) for word in words)
    plain = plain.lower()
    return named or (plain in _sizes("velocity") and plain not in ("hz", "1/s", "s^-1"))


def unit_in_name(name: str) -> str:
    """Return the unit of speed that is a part of a name; "" if there is none.

    Examples
    --------
    >>> unit_in_name("motor_rpm"), unit_in_name("X097RPM"), unit_in_name("speed_hz")
    ('rpm', 'rpm', 'Hz')
    """
    units = {"rpm": "rpm", "hz": "Hz", "rps": "rev/s"}
    return next((u for end, u in units.items() if any(w.endswith(end) for w in _words(name))), "")


def time_unit_in_name(name: str) -> str:
    """Return the unit of time that is a word of a name; "" if there is none.

    Examples
    --------
    >>> time_unit_in_name("time_ms"), time_unit_in_name("seconds"), time_unit_in_name("time")
    ('ms', 'seconds', '')
    """
    return next((word for word in _words(name) if word in _sizes("time")), "")


def _words(name: str) -> list[str]:
    """Return the words of a name, without its unit, in lower case; "shaftSpeed" has two."""
    plain = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", split_unit(name)[0])
    return re.findall(r"[a-z]+", plain.lower())


def unit_factor(unit: str, kind: str) -> float:
    """Return the factor by which values in a unit become rad/s, rad or s.

    Parameters
    ----------
    unit : str
        Unit; of an angle also "rev/4096" for counts of an encoder.
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
    sizes = _sizes(kind)
    if kind == "angle" and (counts := re.fullmatch(r"rev/(\d+)", _plain(unit.lower()))):
        return 2 * pi / int(counts[1])  # of an encoder
    if _plain(unit.lower()) in sizes:
        return sizes[_plain(unit.lower())]
    first = [names[0] for names in _UNITS[kind].values()]
    raise ValueError(
        f"the unit {unit!r} of the {kind} is not known; known are {str(first)[1:-1]}. State one of "
        f"these in units of the layout, or convert the {kind} to {first[0]}."
    )


def unit_word(unit: str) -> str:
    """Return the word of a unit of time.

    Examples
    --------
    >>> unit_word("d"), unit_word("us")
    ('days', 'microseconds')
    """
    return next(names[-1] for names in _UNITS["time"].values() if unit in names)


def _sizes(quantity: str) -> dict[str, float]:
    """Return the size of each unit of a quantity."""
    return {_plain(name): size for size, names in _UNITS[quantity].items() for name in names}


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
    before, after = _plain(one), _plain(other)
    if before == after:
        return 1.0
    for sizes in map(_sizes, _UNITS):
        if before in sizes and after in sizes:
            return sizes[before] / sizes[after]
    return None


def _plain(unit: str) -> str:
    """Return a unit in one way of writing, as "m/s^2"."""
    for written, meant in (("²", "^2"), ("³", "^3"), ("⁻¹", "^-1"), ("**", "^"), ("·", "*")):
        unit = unit.replace(written, meant)
    return re.sub("/s2$", "/s^2", unit.replace(" ", ""))
