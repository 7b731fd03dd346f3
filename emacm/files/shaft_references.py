"""Shaft angles and sensitivities that a layout states in other forms than the name of a column."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm._checks import check_number
from emacm._statements import Statement
from emacm.recordings.names import split_unit, unit_factor, unit_ratio
from emacm.shaft.angle import (
    angle_from_currents,
    angle_from_position,
    angle_from_resolver,
)
from emacm.shaft.vibration import angle_from_vibration

# Each form of an angle: how many columns it has, options that it needs, and others.
_FORMS: dict[str, tuple[tuple[int, ...], set[str], set[str]]] = {
    "currents": ((2, 3), {"pole_pairs"}, set()),
    "resolver": ((2,), set(), {"pole_pairs"}),
    "vibration": ((1,), {"speeds"}, {"unit", "orders"}),
    "column": ((1,), set(), {"lead", "unit", "wrapped"}),
}


def angle_form(angle: Any) -> str:
    """Return which form the angle of a layout has: "column", "currents", and so on; "" if none.

    Examples
    --------
    >>> angle_form("theta"), angle_form({"resolver": ["s", "c"]}), angle_form(None)
    ('column', 'resolver', '')
    """
    if isinstance(angle, Mapping):
        return next((form for form in _FORMS if form in angle), "")
    return "column" if isinstance(angle, str) else ""


def angle_columns(angle: Any) -> list[str]:
    """Return the names of the columns from which the angle of a layout is found."""
    form = angle_form(angle)
    named = angle[form] if isinstance(angle, Mapping) and form else angle
    return [] if not form else [named] if isinstance(named, str) else list(named)


def is_angle(angle: Any, second: Sequence[str] = ()) -> bool:
    """Tell whether the angle of a layout has a form that is known.

    Parameters
    ----------
    angle : str or mapping
        What the layout states.
    second : sequence of str
        Options of a second file, which only a column may have.
    """
    form = angle_form(angle)
    if not isinstance(angle, Mapping) or not form:
        return bool(form and angle)
    stated, names = set(angle), angle_columns(angle)
    numbers, needed, others = _FORMS[form]
    if "file" in angle and form == "column":
        others = others | set(second)
    are_names = all(isinstance(name, str) and name for name in (*names, angle.get("file", "f")))
    is_either = "lead" not in stated or not stated & {"unit", "wrapped"}
    are_limits = np.shape(angle.get("speeds", (0, 0))) == (2,)
    is_known = needed <= stated <= {form} | needed | others
    return is_known and len(names) in numbers and are_names and is_either and are_limits


def stated_angle_of(
    angle: Mapping[str, Any], values: Sequence[NDArray[Any]], fs: float
) -> tuple[NDArray[np.floating], tuple[Statement, ...]]:
    """Compute the shaft angle from the columns of a form other than that of a measured angle.

    Parameters
    ----------
    angle : mapping
        As in a layout: with "currents", "resolver", "vibration", or "column" and "lead".
    values : sequence of ndarray of shape (n_times,)
        The columns.
    fs : float
        Their sampling rate [Hz].

    Returns
    -------
    angle : ndarray of shape (n_times,)
        Angle [rad].
    statements : tuple of Statement
        What is known about it.

    Raises
    ------
    TypeError, ValueError
        As the functions of `emacm.shaft`.

    Examples
    --------
    >>> found, _ = stated_angle_of({"column": "x", "lead": 5.0}, [np.array([0.0, 2.5])], 10)
    >>> found / np.pi
    array([0., 1.])
    """
    form = angle_form(angle)
    if form == "column":
        return angle_from_position(values[0], angle["lead"]), ()
    if form == "currents":
        return angle_from_currents(np.stack(values), pole_pairs=angle["pole_pairs"]), ()
    if form == "resolver":
        return angle_from_resolver(*values, pole_pairs=angle.get("pole_pairs", 1)), ()
    factor = unit_factor(angle.get("unit", "rev/s"), "velocity")
    low, high = (factor * check_number(v, "a speed of speeds", above=0) for v in angle["speeds"])
    found = angle_from_vibration(values[0], fs, speeds=(low, high), orders=angle.get("orders"))
    share = found.confidence.fraction
    text = f"shaft angle from the vibration, reliable in {share:.0%} of the time"
    stated = Statement("shaft", angle["vibration"], text, False, share)
    return found.angle, (stated,) if share < 1 else ()


def sensitivity_of(text: str, name: str = "scale") -> tuple[float, str, str]:
    """Return the number and both units of a sensitivity.

    Raises
    ------
    TypeError
        If it has another form.

    Examples
    --------
    >>> sensitivity_of("100 mV/g"), sensitivity_of("10.2 mV/(m/s²)")
    ((100.0, 'mV', 'g'), (10.2, 'mV', 'm/s²'))
    """
    found = re.fullmatch(
        r"\s*(\d+(?:\.\d+)?(?:[eE][+-]?\d+)?)\s*([^\d\s/]+)\s*/\s*(\S.*?)\s*", text
    )
    if found is None or not float(found[1]) > 0:
        raise TypeError(f"{name} must be a number or sensitivity such as '100 mV/g', got {text!r}.")
    unit = found[3]
    return float(found[1]), found[2], unit[1:-1] if unit[0] + unit[-1] == "()" else unit


def scale_of(stated: float | str, unit: str, name: str) -> tuple[float, str]:
    """Return by what a channel is multiplied, and the unit that it has then.

    Parameters
    ----------
    stated : float or str
        A number, or a sensitivity such as "100 mV/g".
    unit : str
        Unit of the column, as the file or the layout states it.
    name : str
        Channel, for the message.

    Raises
    ------
    ValueError
        If the unit of the column is not known, or does not fit the sensitivity.

    Examples
    --------
    >>> scale_of("100 mV/g", "V", "x0"), scale_of(4.0, "g", "x0")
    ((10.0, 'g'), (4.0, 'g'))
    """
    if not isinstance(stated, str):
        return float(stated), unit
    number, of_sensor, of_channel = sensitivity_of(stated)
    ratio = unit_ratio(unit, of_sensor) if unit else None
    if ratio is None:
        state = f"is {unit!r}" if unit else "is not stated"
        raise ValueError(
            f"scale = {stated!r} needs {name!r} in {of_sensor} or V; its unit {state}. State the "
            f"unit of the column in the layout, under [units]: {split_unit(name)[0]} = 'V'."
        )
    return ratio / number, of_channel
