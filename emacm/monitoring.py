"""Continuous monitoring: streams, alarms, trends and remaining life.

- `OrderMonitor`: applies a fitted model to signals while they are measured, and returns a `Reading`
  of each interval.
- `EWMA`, `CUSUM`: alarms on readings, with the average run length for the baseline in use.
- `HealthIndex`, `health_trend`: distance from healthy recordings, its limits, and its trend for
  each unit.
- `severity_zones`, `severity_zone`, `vibration_velocity`, `vibration_severity`: vibration severity
  zones of ISO 20816-3, and velocity from acceleration; `vibration_indicators`: with RMS, crest
  factor and kurtosis.
- `record_of`, `History`: readings and rows of `score` as records, and their history in SQLite.
- `RemainingLife`: remaining life with intervals that are valid by unit; `MaintenanceCosts`:
  decisions from it; `phm2012_score`, `phm2012_lives`, `coverage_by_unit`: metrics.
"""

from emacm.alarms.control_charts import CUSUM, EWMA, AlarmReadings
from emacm.alarms.health_index import HealthIndex, health_trend
from emacm.alarms.run_lengths import RunLength
from emacm.alarms.severity_zones import (
    severity_zone,
    severity_zones,
    vibration_indicators,
    vibration_severity,
    vibration_velocity,
)
from emacm.history.records import record_of
from emacm.history.sqlite_history import History
from emacm.life.prognostic_metrics import (
    coverage_by_unit,
    phm2012_lives,
    phm2012_score,
)
from emacm.life.remaining_life import MaintenanceCosts, RemainingLife
from emacm.streams.order_monitor import OrderMonitor
from emacm.streams.streamed_models import Reading

__all__ = [
    "CUSUM",
    "EWMA",
    "AlarmReadings",
    "HealthIndex",
    "History",
    "MaintenanceCosts",
    "OrderMonitor",
    "Reading",
    "RemainingLife",
    "RunLength",
    "coverage_by_unit",
    "health_trend",
    "phm2012_lives",
    "phm2012_score",
    "record_of",
    "severity_zone",
    "severity_zones",
    "vibration_indicators",
    "vibration_severity",
    "vibration_velocity",
]
