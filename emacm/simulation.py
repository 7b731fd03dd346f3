"""Simulated recordings whose truth is known, for tests and studies.

- `chapter3_recordings`: the signals of chapter 3 of the thesis, Eqs. (3.1) to (3.6).
- `simulate_actuator`, `simulate_fleet`: short runs at 4 kHz, to try a pipeline in seconds.
"""

from emacm.chapter3_signals import (
    CHAPTER3_ORDERS,
    chapter3_motion,
    chapter3_recording,
    chapter3_recordings,
)
from emacm.simple_actuator import (
    BEARING_ORDER,
    ELECTRICAL_ORDER,
    SCREW_ORDER,
    STATES,
    simulate_actuator,
    simulate_fleet,
)

__all__ = [
    "BEARING_ORDER",
    "CHAPTER3_ORDERS",
    "ELECTRICAL_ORDER",
    "SCREW_ORDER",
    "STATES",
    "chapter3_motion",
    "chapter3_recording",
    "chapter3_recordings",
    "simulate_actuator",
    "simulate_fleet",
]
