"""Early detection of a growing fault by control charts."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from chapter4_spectra import SIGNALS
from chapter5_data import Features
from chapter5_detection import Detector, ratios
from emacm.alarms.control_charts import CUSUM

ALARMS = "units with an alarm"
SEVERITY = "severity at the alarm"
_LENGTH = 100.0  # nominal number of runs until a false alarm


class Followed(NamedTuple):
    """One unit, followed by one signal.

    Attributes
    ----------
    severity : ndarray of shape (n_runs,)
        True severities of the runs after the baseline.
    alarm : int, optional
        The first run with an alarm.
    """

    severity: np.ndarray
    alarm: int | None


def trend_table(features: Features, found: dict[str, Detector], n_baseline: int) -> pd.DataFrame:
    """Return when a chart of each signal raises an alarm while a fault grows.

    The reading is the logarithm of the largest deviation of `ratios`. Its baseline are the first
    healthy runs of the same unit; a CUSUM chart follows the runs of the growing fault, and for
    comparison as many runs without a fault.

    Parameters
    ----------
    features : Features
        Those of all recordings.
    found : dict of str to Detector
        Result of `detectors`.
    n_baseline : int
        Healthy runs of the baseline.

    Returns
    -------
    DataFrame
        One row per fault and signal: units with an alarm, median severity at the first alarm,
        and median number of runs from it to severity 1. Alarms of the rows "none" are false.
    """
    followed = features.frame["role"] == "trend"
    frame = features.frame[followed].reset_index(drop=True)
    readings = np.log(ratios(features, found)[followed]).reset_index(drop=True)
    made = {}
    for fault in pd.unique(frame["label"]):
        for name in readings:
            units = [
                _follow(readings[name].to_numpy(), rows, fault, n_baseline)
                for _, rows in frame.groupby("unit")
            ]
            raised = [(u.severity[u.alarm], u.alarm) for u in units if u.alarm is not None]
            row: dict[str, Any] = {ALARMS: f"{len(raised)} of {len(units)}"}
            if raised and fault != "healthy":
                severity, run = np.median(raised, axis=0)
                row[SEVERITY] = severity
                row["runs left until severity 1"] = len(units[0].severity) - 1 - run
            made["none" if fault == "healthy" else fault, SIGNALS.get(name, name)] = row
    table = pd.DataFrame.from_dict(made, orient="index")
    table.index = pd.MultiIndex.from_tuples(made, names=["fault", "signal"])
    return table


def _follow(readings: np.ndarray, frame: pd.DataFrame, fault: str, n_baseline: int) -> Followed:
    """Apply a chart to the runs of one unit."""
    healthy = frame[frame["label"] == "healthy"].sort_values("run")
    growing = healthy[n_baseline:]
    if fault != "healthy":
        growing = frame[frame["label"] == fault].sort_values("run")
    chart = CUSUM(arl=_LENGTH).fit(readings[healthy.index[:n_baseline]][:, np.newaxis])
    alarm = chart.update(readings[growing.index][:, np.newaxis]).alarm[:, 0]
    first = int(alarm.argmax()) if alarm.any() else None
    return Followed(growing["severity"].to_numpy(), first)
