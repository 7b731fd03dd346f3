"""Chapter 5 of the thesis: its proposals for future work, carried out on the simulated bench."""

from __future__ import annotations

import numpy as np
import pandas as pd

from chapter4_spectra import SIGNALS
from chapter5_classes import (
    LOWEST,
    fusion_table,
    inspection_table,
    labelled_rows,
    units_table,
    unknown_remark,
    unknown_table,
)
from chapter5_data import CONDITION, FULL, MAX_ORDER, QUICK, Extent5, compute_features
from chapter5_detection import (
    ALL,
    as_text_table,
    detection_table,
    detectors,
    draw_detection,
    false_alarms,
    flagged_recordings,
    severity_of_detection,
    threshold_table,
)
from chapter5_trend import trend_table
from findings import Chapter, Report, silent

_OPENING = (
    "The thesis proposes fusion of signals, cross spectra, more units, more faults, and "
    "prognostics, and publishes no figures of them. They are carried out on the simulated bench: "
    "sizes of faults are assumed, so severities compare signals with each other and do not "
    "predict those of a machine."
)
_CAPTION = (
    "Severity from which on a signal detects a fault, at a false alarm rate of 1 %: median over "
    "units (95 % interval from a bootstrap over units); –: not detected at severity 1. One "
    "threshold applies to the bins of all signals together, which is that of the signal in which "
    "healthy units deviate furthest (table of thresholds)."
)
_UNKNOWN = "a fault left out of training: the unknown state"


def reproduce_chapter5(
    *, quick: bool = False, n_jobs: int | None = None, report: Report = silent
) -> Chapter:
    """Carry out the future work of chapter 5 [1]_ on the laboratory bench.

    Parameters
    ----------
    quick : bool
        Fewer units, severities and runs.
    n_jobs : int, optional
        Number of processes that simulate and estimate spectra.
    report : callable, optional
        Receives lines of progress.

    Returns
    -------
    Chapter
        Tables and one picture; one finding, the rank of the accelerometer.

    References
    ----------
    .. [1] Chirico, chapter 5.
    """
    extent = QUICK if quick else FULL
    features = compute_features(extent, n_jobs=n_jobs, report=report)
    chapter = Chapter(5, "Conclusions: its future work", inputs=_inputs(extent))
    found = detectors(features)
    tested = flagged_recordings(features, found)
    by_unit = severity_of_detection(tested)
    detection = detection_table(by_unit)
    chapter.opening = f"{_result(detection)} {_OPENING}"
    thresholds = threshold_table(found)
    chapter.draw("Severity of detection", draw_detection(detection), _CAPTION)
    _compare_rank(chapter, by_unit)
    chapter.tables["severity of detection"] = as_text_table(detection)
    chapter.tables["thresholds in standard deviations"] = thresholds
    chapter.tables["false alarms of units that set no threshold"] = false_alarms(tested)
    steps = {
        "isolation of the fault: single signals, fusion, cross spectra": fusion_table,
        "fusion of features with the decision to inspect": inspection_table,
        "two units against many": units_table,
        _UNKNOWN: unknown_table,
    }
    rows = labelled_rows(features)
    for name, function in steps.items():
        chapter.tables[name] = function(rows)
        report(f"chapter 5: {name}")
    chapter.tables["early detection of a growing fault"] = trend_table(
        features, found, extent.trend_runs[0]
    )
    chapter.remarks += [*_remarks(extent), unknown_remark(chapter.tables[_UNKNOWN])]
    return chapter


def _inputs(extent: Extent5) -> pd.DataFrame:
    n_healthy, n_growing = extent.trend_runs
    rows = [
        ("condition", f"{CONDITION}, 3 s at 12 kHz", "every fault has an effect in it; assumed"),
        ("features", f"log10 of the power in bins of one order up to {MAX_ORDER}", "section 2.1"),
        ("severities", ", ".join(f"{s:g}" for s in extent.severities), "assumed"),
        (
            "detector",
            "largest deviation over the bins from the mean of healthy units, in standard "
            f"deviations over units and runs ({extent.n_training} units)",
            "assumed",
        ),
        (
            "threshold",
            f"exceeded by 1 % of the healthy recordings of {extent.n_calibration} other units",
            "assumed",
        ),
        ("tested units", f"{extent.n_tested}, each healthy and with each fault", "assumed"),
        (
            "classifier",
            "Gaussian, one shrunk covariance, equal priors, uniform cost; severities of at least "
            f"{LOWEST:g}; each unit is tested by the others",
            "assumed",
        ),
        (
            "growing fault",
            f"{n_healthy} healthy runs of the same unit, then severity 0.02 to 1 in equal ratios "
            f"over {n_growing} runs; CUSUM chart, nominally 100 runs per false alarm",
            "assumed",
        ),
    ]
    return pd.DataFrame(rows, columns=["input", "value", "source"]).set_index("input")


def _result(detection: pd.DataFrame) -> str:
    """Name the signal that detects each fault at the lowest severity."""
    wide = detection["severity"].unstack("signal")[list(SIGNALS.values())]
    best = []
    for fault in dict.fromkeys(detection.index.get_level_values("fault")):
        lowest = wide.loc[fault].min()
        names = [name for name in wide.columns if wide.loc[fault, name] == lowest]
        listed = " and ".join(part for part in (", ".join(names[:-1]), names[-1]) if part)
        known = f"{listed} ({lowest:g})" if np.isfinite(lowest) else "no signal"
        best.append(f"{fault}: {known}")
    return "First signal to detect each fault, and severity: " + "; ".join(best) + "."


def _compare_rank(chapter: Chapter, by_unit: pd.DataFrame) -> None:
    """Compare the statement of chapter 5 that the accelerometer was the best signal."""
    ring = by_unit.loc["inner ring"].drop(columns=ALL)
    ranks = ring.rank(axis=1, method="min")["accelerometer"]
    chapter.compare(
        "Chapter 5, Y Accelerometer, rank among the four signals, inner ring",
        1,
        ranks,
        "published: the best signal; ours by the severity of detection of the inner ring on the "
        f"simulated bench, equal ranks counted as the better one; {len(ranks)} units",
        kind="random",
    )


def _remarks(extent: Extent5) -> list[str]:
    return [
        f"Isolation: balanced accuracy of eleven classes (healthy and ten faults) on units that "
        f"were not in training, {extent.n_tested} units. Intervals are from a bootstrap over "
        "units. With as few units, differences within the intervals are not established. Equal "
        "priors of eleven classes, as in the thesis, take many healthy recordings for a fault; the "
        "detector above is the one with few false alarms.",
        "Decision to inspect: it costs less than a wrong decision, and its number is that of "
        "healthy recordings for which it is chosen. Fewer false alarms and missed detections are "
        "paid for by inspections; balanced accuracy counts an inspection as not correct.",
        "Two units against many: training with one unit of each class, as in the thesis, takes "
        "differences between units for the fault. Means over the tested units, with the lowest "
        "and the highest.",
        "Growing fault: the baseline is short, so that the chart raises more false alarms than "
        "stated; its rows without a fault count them. The number of runs left is known from the "
        "simulation.",
    ]
