"""Evaluations are drawn with the rates of each scheme, the confusion and the reliability."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from sklearn.naive_bayes import GaussianNB

from emacm.displays import EvaluationDisplay
from emacm.evaluation.evaluate import evaluate

TABLE = pd.DataFrame(
    {
        "balanced_accuracy": [0.9, 0.6, np.nan],
        "balanced_accuracy_low": [0.85, 0.4, np.nan],
        "balanced_accuracy_high": [0.95, 0.8, np.nan],
        "false_alarm_rate": [0.1, 0.3, np.nan],
        "false_alarm_rate_low": [0.0, np.nan, np.nan],
        "false_alarm_rate_high": [0.2, np.nan, np.nan],
        "groups": [7, 7, 0],
        "resampled": ["run", "run", "unit"],
    },
    index=["random split", "by run", "by unit"],
)
CONFUSION = pd.DataFrame([[8, 1], [0, 3], [2, 0]], index=["a", "b", "inspect"], columns=["a", "b"])
CURVE = pd.DataFrame(
    [[0.6, 0.5, 0.3, 0.7, 10], [0.9, 0.95, 0.9, 1.0, 40]],
    columns=["confidence", "frequency", "low", "high", "count"],
)


def axes(n_panels):
    return Figure(figsize=(14, 5)).subplots(1, n_panels)


def found(model=None, **options):
    rng = np.random.default_rng(0)
    y = np.tile(np.repeat(["normal", "worn"], 3), 12)
    X = rng.normal(size=(72, 2)) + 2 * (y == "worn")[:, np.newaxis]
    runs = pd.Series(np.repeat(np.arange(12), 6), name="run")
    model = GaussianNB() if model is None else model
    return evaluate(model, X, y, runs=runs, healthy="normal", **options)


def test_the_confusion_counts_and_is_shaded_by_columns():
    panels = axes(2)
    EvaluationDisplay(TABLE, CONFUSION, scheme="by run").plot(ax=panels)
    assert [text.get_text() for text in panels[1].texts] == ["8", "1", "3", "2"]
    assert np.allclose(panels[1].images[0].get_array(), [[0.8, 0.25], [0, 0.75], [0.2, 0]])
    assert [t.get_text() for t in panels[1].get_yticklabels()] == ["a", "b", "inspect"]
    assert (panels[1].get_xlabel(), panels[1].get_ylabel()) == ("true class", "decision")
    assert panels[1].get_title().startswith("by run")


def test_reliability_is_drawn_beside_the_diagonal():
    panels = axes(3)
    EvaluationDisplay(TABLE, CONFUSION, CURVE).plot(ax=panels)
    diagonal, curve = panels[2].lines
    assert np.allclose(diagonal.get_xydata(), [[0, 0], [100, 100]])
    assert np.allclose(curve.get_xydata(), [[60, 50], [90, 95]])
    limits, points = panels[2].collections
    assert np.allclose(limits.get_segments()[0], [[60, 30], [60, 70]])
    assert np.allclose(points.get_offsets(), [[60, 50], [90, 95]])
    assert np.allclose(points.get_sizes(), [12 + 90 * 10 / 50, 12 + 90 * 40 / 50])
    assert "confidence" in panels[2].get_xlabel()
    assert "observed frequency" in panels[2].get_ylabel()
    assert "[%]" in panels[2].get_xlabel()
    assert "[%]" in panels[2].get_ylabel()


def test_an_evaluation_is_drawn_with_its_first_split_by_groups():
    result = found()
    display = EvaluationDisplay.from_evaluation(result, ax=axes(3))
    assert display.scheme == "by run"
    assert display.confusion.equals(result.confusions["by run"])
    rates = ["false_alarm_rate", "inspection_rate", "missed_detection_rate"]
    assert display.figures == ["balanced_accuracy", *rates]
    expected = result.table.loc["random split", "false_alarm_rate_high"]
    assert display.frame().loc["random split", "false_alarm_rate_high"] == expected


def test_the_three_rates_are_drawn_separately():
    rates = ["false_alarm_rate", "inspection_rate", "missed_detection_rate"]
    table = TABLE.assign(
        **{
            f"{name}{end}": [v, v, v]
            for name, v in zip(rates, (0.3, 0.45, 0.05), strict=True)
            for end in ("", "_low", "_high")
        }
    )
    panels = axes(2)
    EvaluationDisplay(table, CONFUSION).plot(ax=panels)
    points = {line.get_label(): line.get_xdata()[0] for line in panels[0].lines}
    assert points["false alarms (of healthy)"] == 30
    assert points["inspections (of healthy)"] == 45
    assert points["missed detections (of faulty)"] == 5
