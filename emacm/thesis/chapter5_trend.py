"""Early detection of a growing fault by control charts."""

from __future__ import annotations

import numpy as np
import pandas as pd

from emacm.monitoring.alarms import CUSUM
from emacm.thesis.chapter4_spectra import SIGNALS
from emacm.thesis.chapter5_data import Features
from emacm.thesis.chapter5_detection import ALL, Detector

_LENGTH = 100.0  # nominal number of runs until a false alarm


def trend_table(features: Features, found: dict[str, Detector]) -> pd.DataFrame:
    """Return when a chart of each signal raises an alarm while a fault grows.

    The reading is the logarithm of the largest deviation of `Detector`. Its baseline are the
    healthy runs of the same unit; a CUSUM chart follows the runs of the growing fault.

    Returns
    -------
    DataFrame
        One row per fault and signal: units with an alarm, median severity at the first alarm, and
        median number of runs from it to severity 1.
    """
    rows = features.rows(features.frame["role"] == "trend")
    tables = rows.spectra | {ALL: rows.joint()}
    faults = [label for label in pd.unique(rows.frame["label"]) if label != "healthy"]
    made = {}
    for fault in faults:
        for name, detector in found.items():
            readings = np.log(detector.deviation(tables[name]))
            alarms = [
                _first_alarm(readings, rows.frame, unit, fault)
                for unit in pd.unique(rows.frame["unit"])
            ]
            raised = [alarm for alarm in alarms if alarm is not None]
            made[fault, SIGNALS.get(name, name)] = {
                "units with an alarm": f"{len(raised)} of {len(alarms)}",
                "severity at the alarm": np.median([a[0] for a in raised]) if raised else np.nan,
                "runs left until severity 1": np.median([a[1] for a in raised])
                if raised
                else np.nan,
            }
    table = pd.DataFrame.from_dict(made, orient="index")
    table.index = pd.MultiIndex.from_tuples(made, names=["fault", "signal"])
    return table


def _first_alarm(
    readings: np.ndarray, frame: pd.DataFrame, unit: int, fault: str
) -> tuple[float, int] | None:
    """Return severity and remaining runs at the first alarm, or None."""
    of_unit = frame["unit"] == unit
    healthy = (of_unit & (frame["label"] == "healthy")).to_numpy()
    growing = frame[of_unit & (frame["label"] == fault)].sort_values("run")
    chart = CUSUM(arl=_LENGTH).fit(readings[healthy][:, np.newaxis])
    alarm = chart.update(readings[growing.index][:, np.newaxis]).alarm[:, 0]
    if not alarm.any():
        return None
    first = int(alarm.argmax())
    return float(growing["severity"].iloc[first]), len(growing) - 1 - first
