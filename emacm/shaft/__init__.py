"""Motion of the shaft: its angle from what was measured, strokes and travel.

- `angle_from_velocity`, `angle_from_wrapped`, `angle_from_position`, `angle_from_resolver`,
  `angle_from_currents`: the shaft angle from other signals.
- `angle_from_vibration`: the shaft angle without any shaft sensor, and how far it is reliable.
- `pulse_times`, `angle_from_pulses`, `angle_from_tacho`: the shaft angle from a tachometer.
"""

from emacm.shaft.angle import (
    angle_from_currents,
    angle_from_position,
    angle_from_resolver,
    angle_from_velocity,
    angle_from_wrapped,
)
from emacm.shaft.tacho import angle_from_pulses, angle_from_tacho, pulse_times
from emacm.shaft.vibration import angle_from_vibration

__all__ = [
    "angle_from_currents",
    "angle_from_position",
    "angle_from_pulses",
    "angle_from_resolver",
    "angle_from_tacho",
    "angle_from_velocity",
    "angle_from_vibration",
    "angle_from_wrapped",
    "pulse_times",
]
