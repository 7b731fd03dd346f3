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

from emacm.alarms.control_charts import CUSUM as CUSUM
from emacm.alarms.control_charts import EWMA as EWMA
from emacm.alarms.control_charts import AlarmReadings as AlarmReadings
from emacm.alarms.health_index import HealthIndex as HealthIndex
from emacm.alarms.health_index import health_trend as health_trend
from emacm.alarms.run_lengths import RunLength as RunLength
from emacm.history.records import record_of as record_of
from emacm.history.sqlite_history import History as History
from emacm.life.prognostic_metrics import coverage_by_unit as coverage_by_unit
from emacm.life.prognostic_metrics import phm2012_lives as phm2012_lives
from emacm.life.prognostic_metrics import phm2012_score as phm2012_score
from emacm.life.remaining_life import MaintenanceCosts as MaintenanceCosts
from emacm.life.remaining_life import RemainingLife as RemainingLife
from emacm.machine.severity_zones import severity_zone as severity_zone
from emacm.machine.severity_zones import severity_zones as severity_zones
from emacm.machine.severity_zones import vibration_indicators as vibration_indicators
from emacm.machine.severity_zones import vibration_severity as vibration_severity
from emacm.machine.severity_zones import vibration_velocity as vibration_velocity
from emacm.streams.order_monitor import OrderMonitor as OrderMonitor
from emacm.streams.streamed_models import Reading as Reading

__all__ = sorted(name for name in globals() if not name.startswith("_"))
