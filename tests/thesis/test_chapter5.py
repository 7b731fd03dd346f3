"""Chapter 5: known answers of its figures of merit, and a quick run."""

import numpy as np
import pandas as pd
import pytest
from laboratory import FAULTS

from chapter4_spectra import SIGNALS
from chapter5_classes import labelled_rows, units_table
from chapter5_data import FULL, QUICK, Features, planned_runs, severity_of_run
from chapter5_detection import (
    ALL,
    PHASED,
    detection_table,
    detectors,
    flagged_recordings,
    severity_of_detection,
)
from chapter5_trend import trend_table

SHIFT = {"velocity": 9.0, "current_a": 30.0}  # standard deviations at severity 1, of one bin


def made(n_training=60, n_calibration=60, n_tested=6, severities=(0.1, 0.4, 1.0), seed=0):
    """Standard normal features; the screw shifts one bin of two signals by its severity."""
    rng = np.random.default_rng(seed)
    rows = [("training", u, 1, "healthy", 0.0) for u in range(n_training)]
    rows += [
        ("calibration", 500 + u, r, "healthy", 0.0) for u in range(n_calibration) for r in (1, 5)
    ]
    tested = range(900, 900 + n_tested)
    rows += [("tested", u, r, "healthy", 0.0) for u in tested for r in (1, 5, 9)]
    rows += [("tested", u, 3, "screw", s) for u in tested for s in severities]
    rows += [("trend", 900, 100 + r, "healthy", 0.0) for r in range(50)]
    rows += [("trend", 900, 200 + r, "screw", severity_of_run(r, 30)) for r in range(1, 31)]
    frame = pd.DataFrame(rows, columns=["role", "unit", "run", "label", "severity"])
    spectra = {}
    for name in SIGNALS:
        values = rng.standard_normal((len(frame), 12))
        screw = (frame["label"] == "screw") * frame["severity"]
        values[:, 7] += SHIFT.get(name, 0.0) * screw
        spectra[name] = pd.DataFrame(values, columns=[f"{name}@{k}-{k + 1}" for k in range(12)])
    return Features(frame, spectra, spectra, pd.DataFrame(rng.standard_normal((len(frame), 4))))


def test_the_threshold_is_exceeded_by_one_per_cent_of_other_healthy_units():
    features = made(n_calibration=300)
    found = detectors(features)
    other = features.frame["role"] == "calibration"
    for name in SIGNALS:
        scores = found[name].deviation(features.spectra[name][other])
        assert 0 < np.mean(scores > found[name].threshold) <= 0.01
        assert np.mean(scores >= found[name].threshold) == pytest.approx(0.01, abs=0.002)


def test_a_shift_is_detected_from_the_severity_that_exceeds_the_threshold():
    # The largest of 12 normal deviations exceeds about 3.7 in 1 % of healthy recordings: 9 x 0.4
    # is below, 9 x 1 above; 30 x 0.1 is below and 30 x 0.4 above.
    features = made(n_tested=30)
    table = detection_table(
        severity_of_detection(flagged_recordings(features, detectors(features)))
    )
    assert table.loc[("screw", "Motor Velocity"), "severity"] == 1.0
    assert table.loc[("screw", "Current"), "severity"] == 0.4
    assert table.loc[("screw", ALL), "severity"] == 0.4
    assert np.isinf(table.loc[("screw", "LVDT")]).all()


def test_a_gap_in_the_detections_counts_from_its_end():
    rows = [("cage", 3, s, d) for s, d in ((0.1, True), (0.2, False), (0.7, True), (1.0, True))]
    tested = pd.DataFrame(rows, columns=["label", "unit", "severity", "lvdt"])
    assert severity_of_detection(tested).loc[("cage", 3), "lvdt"] == 0.7


def test_one_unit_is_tested_by_the_others_only():
    features = labelled_rows(made(severities=(0.1, 0.4, 0.7, 1.0)))
    assert set(features.frame["severity"]) == {0.0, 0.4, 0.7, 1.0}
    table = units_table(features)
    assert table.index.tolist()[2:] == [f"{n} with every class" for n in (1, 2, 4, 5)]
    few, many = (float(table["balanced accuracy [%]"].iloc[i].split()[0]) for i in (2, -1))
    assert many >= few > 60  # the current is shifted by 12 standard deviations and more


def test_a_class_of_its_own_unit_is_learned_as_that_unit():
    features = labelled_rows(made(n_tested=8, severities=(0.4, 1.0)))
    rng = np.random.default_rng(1)
    units = features.frame["unit"].to_numpy()
    for table in features.spectra.values():  # units differ by more than the fault
        table += 6 * rng.standard_normal((2000, table.shape[1]))[units]
    table = units_table(features)["balanced accuracy [%]"]
    rates = table.map(lambda text: float(text.split()[0]))
    assert rates["another unit for each class"] < rates["7 with every class"] - 10


def test_a_chart_of_the_shifted_signal_raises_its_alarm_before_the_end():
    features = made(n_training=200)
    table = trend_table(features, detectors(features), 20)
    assert set(table.index.get_level_values("fault")) == {"none", "screw"}
    assert table.loc[("screw", "Current"), "units with an alarm"] == "1 of 1"
    assert table.loc[("screw", "Current"), "severity at the alarm"] < 0.5
    assert table.loc[("screw", "Current"), "runs left until severity 1"] > 3


@pytest.mark.parametrize("extent", [QUICK, FULL])
def test_faulty_recordings_are_planned_over_the_same_runs_as_healthy_ones(extent):
    planned = planned_runs(extent)
    faulty = [run for role, bench, run in planned if role == "tested" and bench.faults]
    assert len(faulty) == extent.n_tested * len(FAULTS) * len(extent.severities)
    assert min(faulty) >= 2
    assert max(faulty) <= 12
    roles = {role: {bench.unit for r, bench, _ in planned if r == role} for role, *_ in planned}
    for one, other in (
        ("training", "calibration"),
        ("training", "tested"),
        ("calibration", "tested"),
    ):
        assert not roles[one] & roles[other]


@pytest.mark.slow
def test_a_quick_run_has_every_fault_signal_and_question(quick_chapter):
    chapter, lines = quick_chapter(5)
    detection = chapter.tables["severity of detection"]
    assert detection.index.tolist() == list(FAULTS)
    assert detection.columns.tolist() == [*SIGNALS.values(), PHASED, ALL]
    # An unequal phase is an electrical fault: neither position nor vibration shows it first.
    assert detection.loc["phase imbalance", "LVDT"].startswith("–")
    assert float(detection.loc["phase imbalance", "Current"].split()[0]) <= 1
    assert float(detection.loc["jam", "Current"].split()[0]) <= 1
    assert len(chapter.tables) == 9
    assert set(chapter.figures) == {"Severities of detection"}
    caption = chapter.figures["Severities of detection"][1]
    assert "three phases: their unbalance alone" in caption
    # An unequal phase is nothing but an unbalance of the three.
    assert float(detection.loc["phase imbalance", PHASED].split()[0]) <= 0.1
    assert detection.loc["cage", PHASED].startswith("–")
    varied = next(t for name, t in chapter.tables.items() if name.startswith("assumptions"))
    assert varied.index.tolist() == ["as assumed", "twice the spread of units", "condition 3"]
    apart = varied["two healthy units: correct [%]"]
    assert all(len(text.split(" / ")) == len(SIGNALS) for text in apart[:2])
    assert [v.evidence for v in chapter.verdicts] == [
        "early detection of a growing fault", "Severities of detection"
    ]  # fmt: skip
    assert any(text.startswith("Not recognised as unknown are ") for text in chapter.remarks)
    # Signals that are equally early are all named.
    first = next(text for text in chapter.remarks if text.startswith("Which signal"))
    severity = detection.drop(columns=ALL).map(
        lambda text: float(text.split()[0].replace("–", "9"))
    )
    for fault, row in severity.iterrows():
        names = row.index[row == row.min()]
        assert f"{fault}: {' and '.join(names)} ({row.min():g})" in first
    # What is asked with yes or no is so answered.
    jam, current = (verdict.text for verdict in chapter.verdicts)
    assert jam.startswith("Chapter 5, is a growing jam seen before it is complete: yes: ")
    assert "viable: yes for" in current
    assert "; no for " in current
    assert any("recordings" in line for line in lines)
