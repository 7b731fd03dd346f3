"""Inputs of chapter 4: what the thesis states, what is assumed, and which readings were chosen."""

from __future__ import annotations

import numpy as np
import pandas as pd
from laboratory.constants import ASSUMED, VARIATIONS, Actuator, Condition

from chapter4_spectra import MIN_SPEED, REVOLUTIONS

_ASSUMED = "assumed"
_INPUTS = [
    ("degraded unit: defect of the inner ring", "severity 0.5", "section 4.2 states no size"),
    ("degraded unit: lubrication", "severity 0.25 (75 % of the grease)", _ASSUMED),
    (
        "electrical noise at orders 12 and 36, LVDT",
        "1.0 healthy, 0.2 degraded unit",
        "section 4.5 finds it in the healthy unit; the sizes are assumed",
    ),
    (
        "electrical noise at orders 12 and 36, velocity",
        "the same",
        "the thesis states no orders for the velocity",
    ),
    (
        "order of the inner ring",
        "6.123",
        "section 4.5. It may result from Eq. (2.1) as printed, which is that of the outer ring",
    ),
    (
        "lead of the screw",
        "{lead:g} in",
        "4 mm; by Table 4.1, 220 V allow 0.168 in at 4572 rev/min. Table 4.3 requires 0.23 in for "
        "condition 3: both cannot hold",
    ),
    ("length of a recording", "{duration:g} s", _ASSUMED),
    (
        "drift within a recording",
        "viscous friction {viscous:.2g} %, other friction {coulomb:.2g} %",
        "assumed; the unit also warms up from run to run",
    ),
    (
        "θ_s",
        "0.01π: 100 bins of one order",
        "the text; Table 4.4 prints 0.02π, which contains 50 orders (table of readings)",
    ),
    (
        "resampling",
        f"linear, Eq. (2.13), over the travel (integral of |speed|), above {MIN_SPEED:g} rad/s",
        "the profiles reverse, where Eq. (2.13) is not defined; assumed",
    ),
    (
        "segments",
        f"{REVOLUTIONS} revolutions, Hann window, 50 % overlap, mean not removed; shorter "
        "recordings are padded",
        "Eqs. (2.14) to (2.16); length, window and overlap are assumed",
    ),
    ("filter, current", "stop band 5.6 to 6.4", "chapter 3; section 4.3 states no band"),
    ("filter, other signals", "orders below 1, which contain the command", _ASSUMED),
    ("components", "two, from powers without logarithm and scaling", "chapter 3"),
]


def inputs_table(duration: float) -> pd.DataFrame:
    """Return the inputs and chosen readings of chapter 4 with their sources.

    Parameters
    ----------
    duration : float
        Length of a recording [s].

    Returns
    -------
    DataFrame
        One row per input: "value" and "source", by "input".

    Examples
    --------
    >>> inputs_table(10.0).loc["lead of the screw", "value"]
    '0.1575 in'
    """
    constants = {"lead": Actuator().screw_lead, "duration": duration}
    constants |= {
        name: 100 * ASSUMED.heating * duration * VARIATIONS[name].warm
        for name in ("viscous", "coulomb")
    }
    rows = [(name, value.format(**constants), source) for name, value, source in _INPUTS]
    return pd.DataFrame(rows, columns=["input", "value", "source"]).set_index("input")


def commanded_speed(condition: Condition) -> float:
    """Return the highest shaft speed that the position command of a condition requires [rev/min].

    Examples
    --------
    >>> from laboratory import CONDITIONS
    >>> round(commanded_speed(CONDITIONS[3]))
    6685
    """
    slope = 4.0 if condition.shape == "triangle" else 2 * np.pi
    return 60 * slope * abs(condition.amplitude) * condition.frequency / Actuator().screw_lead
