"""Motion of the shaft: its angle from what was measured, strokes and travel.

- `angle_from_velocity`, `angle_from_wrapped`, `angle_from_position`, `angle_from_resolver`,
  `angle_from_currents`: the shaft angle from other signals.
- `angle_from_vibration`: the shaft angle without any shaft sensor, and how far it is reliable.
- `pulse_times`, `angle_from_pulses`, `angle_from_tacho`: the shaft angle from a tachometer.
"""

from emacm.shaft.angle import angle_from_currents as angle_from_currents
from emacm.shaft.angle import angle_from_position as angle_from_position
from emacm.shaft.angle import angle_from_resolver as angle_from_resolver
from emacm.shaft.angle import angle_from_velocity as angle_from_velocity
from emacm.shaft.angle import angle_from_wrapped as angle_from_wrapped
from emacm.shaft.tacho import angle_from_pulses as angle_from_pulses
from emacm.shaft.tacho import angle_from_tacho as angle_from_tacho
from emacm.shaft.tacho import pulse_times as pulse_times
from emacm.shaft.vibration import angle_from_vibration as angle_from_vibration
