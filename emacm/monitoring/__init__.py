"""Continuous monitoring: streams, alarms, trends and remaining life.

- `EWMA`, `CUSUM`: alarms on readings, with the average run length for the baseline in use;
  `InputAlarm`: alarms on unknown states and implausible input.
- `severity_zones`, `severity_zone`, `vibration_velocity`, `vibration_severity`: vibration severity
  zones of ISO 20816-3, and velocity from acceleration.
"""

from emacm.monitoring.alarms import CUSUM, EWMA, AlarmReadings
from emacm.monitoring.baseline_run_length import RunLength
from emacm.monitoring.input_alarms import InputAlarm
from emacm.monitoring.severity_zones import (
    severity_zone,
    severity_zones,
    vibration_severity,
    vibration_velocity,
)

__all__ = [
    "CUSUM",
    "EWMA",
    "AlarmReadings",
    "InputAlarm",
    "RunLength",
    "severity_zone",
    "severity_zones",
    "vibration_severity",
    "vibration_velocity",
]
