"""Chapter 5 of the thesis: its proposals for future work, carried out on the simulated bench."""

from __future__ import annotations

import numpy as np
import pandas as pd

from chapter4_spectra import SIGNALS
from chapter5_assumptions import OTHER, TWICE, varied_table
from chapter5_classes import (
    LOWEST,
    fusion_table,
    labelled_rows,
    pairs_table,
    units_table,
    unknown_remark,
    unknown_table,
)
from chapter5_data import CONDITION, FULL, MAX_ORDER, QUICK, Extent5, compute_features
from chapter5_detection import (
    ALL,
    PHASED,
    as_text_table,
    detection_table,
    detectors,
    draw_detection,
    false_alarms,
    flagged_recordings,
    severity_of_detection,
    threshold_table,
)
from chapter5_trend import ALARMS, SEVERITY, trend_table
from findings import Chapter, Report, Verdict, lowest, silent

_OPENING = (
    "The thesis proposes fusion of signals, cross spectra, more units, more faults, and "
    "prognostics, and publishes no figures of them. They are carried out on the simulated bench. "
    "Its first limit is the assumed spread of units and runs, from which all thresholds follow "
    "(table of assumptions); sizes of faults are assumed too, so severities compare signals with "
    "each other and do not predict those of a machine."
)
_CAPTION = (
    "Severity from which on a signal detects a fault, at a false alarm rate of 1 %: median over "
    "units (95 % interval from a bootstrap over units); –: not detected at severity 1. Bins of a "
    "quarter of an order; three phases: their unbalance alone; all signals: the largest deviation "
    "over the threshold of its signal. The thresholds are uncertain themselves (table of "
    "thresholds), and the severities depend on the assumed spread of units (table of assumptions)."
)
_UNKNOWN = "a fault left out of training: the unknown state"
_UNITS = "which units have which faults in training"
_VARIED = (
    "assumptions varied: correct decisions of chapter 4 (LVDT / velocity / current / "
    "accelerometer), and numbers of faults that a signal shows at severity 1"
)
_PAIRS = "two faults at once, a classifier of single ones"
_TREND = "early detection of a growing fault"
_JAM, _CURRENT = "jam", SIGNALS["current_a"]


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
        Tables and one picture; the thesis has no figures to compare.

    References
    ----------
    .. [1] Chirico, chapter 5.
    """
    extent = QUICK if quick else FULL
    features = compute_features(extent, n_jobs=n_jobs, report=report)
    chapter = Chapter(5, "Conclusions: its future work", inputs=_inputs(extent))
    found = detectors(features)
    tested = flagged_recordings(features, found)
    detection = detection_table(severity_of_detection(tested))
    chapter.opening = _OPENING
    chapter.draw("Severities of detection", draw_detection(detection), _CAPTION)
    chapter.tables["severity of detection"] = as_text_table(detection)
    chapter.tables["thresholds in standard deviations"] = threshold_table(features, found)
    chapter.tables["false alarms of units that set no threshold"] = false_alarms(tested)
    chapter.tables[_VARIED] = varied_table(quick=quick, n_jobs=n_jobs)
    report("chapter 5: assumptions varied")
    steps = {
        "isolation of the fault: single signals, fusion, cross spectra": fusion_table,
        _UNITS: units_table,
        _UNKNOWN: unknown_table,
    }
    rows = labelled_rows(features)
    for name, function in steps.items():
        chapter.tables[name] = function(rows)
        report(f"chapter 5: {name}")
    chapter.tables[_PAIRS] = pairs_table(features)
    chapter.tables[_TREND] = trend_table(features, found, extent.trend_runs[0])
    chapter.remarks += [
        *_answers(chapter.tables, detection),
        unknown_remark(chapter.tables[_UNKNOWN]),
    ]
    chapter.verdicts += [_jam(chapter.tables[_TREND]), _viable(detection, chapter.tables[_VARIED])]
    return chapter


def _jam(trend: pd.DataFrame) -> Verdict:
    """State how early a growing jam is seen, for which chapter 5 asks."""
    warned = np.isfinite(trend.loc[(_JAM, ALL), SEVERITY])
    return Verdict(
        f"Chapter 5, is a growing jam seen before it is complete: {'yes' if warned else 'no'}: "
        f"{_alarms_of(trend, _JAM)} The law by which it grows is assumed, and equal for all units: "
        "how much life remains cannot be told from this bench.",
        _TREND,
    )


def _alarms_of(trend: pd.DataFrame, fault: str) -> str:
    """State the alarms of all signals together, and which signal alone is the earliest."""
    alarms, severity, left = trend.loc[(fault, ALL)]
    if not np.isfinite(severity):
        return "no alarm."
    single = trend.loc[fault].drop(index=ALL)[SEVERITY].astype(float)
    return (
        f"all signals together raise an alarm in {alarms} units, at severity {severity:.2f}, "
        f"{left:.0f} runs before severity 1 (a false one in {trend.loc[('none', ALL), ALARMS]}). "
        f"The earliest signal alone, known only afterwards, and its severity: {lowest(single)}."
    )


def _viable(detection: pd.DataFrame, varied: pd.DataFrame) -> Verdict:
    """Answer whether motor current is a viable signal."""
    seen = np.isfinite(detection["severity"].unstack("signal"))
    names = {s: list(seen.index[seen[s]]) for s in (_CURRENT, PHASED)}
    one, three = (detection.loc[("phase imbalance", name), "severity"] for name in names)
    both = set(names[_CURRENT]) | set(names[PHASED])
    others = [fault for fault in seen.index if fault not in both]
    vibration = seen.index[seen[SIGNALS["accelerometer"]]]
    twice = varied.loc[TWICE, _CURRENT]
    return Verdict(
        "Chapter 5, is motor current viable: "
        f"yes for {', '.join(fault for fault in seen.index if fault in both) or 'none'}; "
        f"no for {', '.join(others) or 'none'}, of which the accelerometer shows "
        f"{', '.join(fault for fault in others if fault in vibration) or 'none'}. Phase imbalance "
        f"is shown from severity {three:g} by three phases, from {one:g} by one. With {TWICE} one "
        f"phase shows {twice} of {len(seen)} in place of {len(names[_CURRENT])}. Sizes of faults "
        "are assumed.",
        "Severities of detection",
    )


def _inputs(extent: Extent5) -> pd.DataFrame:
    n_healthy, n_growing = extent.trend_runs
    rows = [
        (
            "condition",
            f"{CONDITION}, {extent.duration:g} s at 12 kHz",
            "every fault has an effect in it; assumed",
        ),
        (
            "features",
            f"log10 of the power in bins up to order {MAX_ORDER}: of one order to isolate, of a "
            "quarter to detect (the cage turns 0.39 times per revolution)",
            "section 2.1",
        ),
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


def _answers(tables: dict[str, pd.DataFrame], detection: pd.DataFrame) -> list[str]:
    """Answer the questions of chapter 5 in sentences."""
    severity = detection["severity"].unstack("signal")
    single = severity[[*SIGNALS.values(), PHASED]]
    best = "; ".join(f"{fault}: {lowest(row)}" for fault, row in single.iterrows())
    units, pairs, trend = (tables[name] for name in (_UNITS, _PAIRS, _TREND))
    accuracy = units["balanced accuracy [%]"]
    both, single = pairs.drop(index="one fault").mean(), pairs.loc["one fault"]
    conditions, spreads = tables[_VARIED][ALL], tables[_VARIED].drop(index=OTHER)
    apart, fault = (
        spreads[name].str.split(" / ", expand=True).astype(float).to_numpy()
        for name in spreads.columns[:2]
    )
    grown = [fault for fault in dict.fromkeys(trend.index.get_level_values(0)) if fault != "none"]
    return [
        f"Which signal, from which severity: {best}.",
        f"Which condition: {conditions['as assumed']} of ten faults are detected at severity 1 in "
        f"condition {CONDITION}, {conditions[OTHER]} in {OTHER}.",
        "Which conclusions survive another spread of units or of runs: two healthy units are told "
        f"apart in {apart.min():.0f} to {apart.max():.0f} % of the test runs, by any signal; one "
        f"unit without and with the fault by LVDT, velocity and current in "
        f"{fault[:, :3].min():.0f} to {fault[:, :3].max():.0f} %, by the accelerometer in "
        f"{fault[:, 3].min():.0f} to {fault[:, 3].max():.0f} %. The number of faults that are "
        f"detected is {spreads[ALL].min()} to {spreads[ALL].max()} of ten, by the current "
        f"{spreads[_CURRENT].min()} to {spreads[_CURRENT].max()}.",
        f"Several faults at once: of {both.iloc[0]:.0f} % one, of {both.iloc[1]:.0f} % both are "
        "named by a classifier of single faults; another one, which is not there, is named of "
        f"{both.iloc[2]:.0f} %, and of {single.iloc[2]:.0f} % with a single fault.",
        f"One unit or many: balanced accuracy {accuracy.iloc[0]} % with another unit for each "
        f"class, as in the thesis, {accuracy.iloc[-1]} % with {accuracy.index[-1]}. Means over the "
        "tested units, lowest and highest.",
        *(f"How early, {fault}: {_alarms_of(trend, fault)}" for fault in grown),
        "Isolation: units were not in training; intervals are from a bootstrap over few units, and "
        "differences within them are not established. Equal priors of eleven classes, as in the "
        "thesis, take many healthy recordings for a fault; the detector has few false alarms. "
        "Charts: the baseline is short, so that more alarms are false than stated.",
    ]
