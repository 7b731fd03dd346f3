"""Continuous monitoring: streams, alarms, trends and remaining life.

- `OrderMonitor`: applies a fitted model to signals while they are measured, and returns a `Reading`
  of each interval.
- `EWMA`, `CUSUM`: alarms on readings, with the average run length for the baseline in use;
  `InputAlarm`: alarms on unknown states and implausible input.
- `HealthIndex`, `health_trend`: distance from healthy recordings, its limits, and its trend for
  each unit.
- `severity_zones`, `severity_zone`, `vibration_velocity`, `vibration_severity`: vibration severity
  zones of ISO 20816-3, and velocity from acceleration.
- `RemainingLife`: remaining life with intervals that are valid by unit; `MaintenanceCosts`:
  decisions from it; `phm2012_score`, `alpha_lambda`, `prognostic_horizon`, `monotonicity`,
  `trendability`, `prognosability`, `crps`, `coverage_by_unit`: metrics.
"""

from emacm.monitoring.alarms import CUSUM, EWMA, AlarmReadings
from emacm.monitoring.baseline_run_length import RunLength
from emacm.monitoring.health_index import HealthIndex
from emacm.monitoring.health_trend import health_trend
from emacm.monitoring.index_metrics import monotonicity, prognosability, trendability
from emacm.monitoring.input_alarms import InputAlarm
from emacm.monitoring.maintenance import MaintenanceCosts
from emacm.monitoring.order_monitor import OrderMonitor
from emacm.monitoring.prognostic_metrics import (
    alpha_lambda,
    coverage_by_unit,
    crps,
    phm2012_lives,
    phm2012_score,
    prognostic_horizon,
)
from emacm.monitoring.remaining_life import RemainingLife
from emacm.monitoring.severity_zones import (
    severity_zone,
    severity_zones,
    vibration_severity,
    vibration_velocity,
)
from emacm.monitoring.streamed_models import Reading

__all__ = [
    "CUSUM",
    "EWMA",
    "AlarmReadings",
    "HealthIndex",
    "InputAlarm",
    "MaintenanceCosts",
    "OrderMonitor",
    "Reading",
    "RemainingLife",
    "RunLength",
    "alpha_lambda",
    "coverage_by_unit",
    "crps",
    "health_trend",
    "monotonicity",
    "phm2012_lives",
    "phm2012_score",
    "prognosability",
    "prognostic_horizon",
    "severity_zone",
    "severity_zones",
    "trendability",
    "vibration_severity",
    "vibration_velocity",
]
