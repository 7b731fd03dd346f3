"""Comparisons are drawn with the rates, the mean cost and the log loss of each evaluation."""

import numpy as np
import pandas as pd
import pytest
from matplotlib import pyplot
from matplotlib.figure import Figure
from sklearn.naive_bayes import GaussianNB

from emacm.displays import ComparisonDisplay
from emacm.evaluation.comparison import compare
from emacm.evaluation.evaluate import evaluate

RATES = ["balanced_accuracy", "false_alarm_rate", "inspection_rate", "missed_detection_rate"]
VALUES = {
    "balanced_accuracy": ([0.9, 0.6], [0.8, 0.5], [0.95, 0.7]),
    "false_alarm_rate": ([0.1, 0.25], [0.05, 0.2], [0.15, 0.45]),
    "inspection_rate": ([0.3, 0.05], [0.2, 0.01], [0.4, 0.1]),
    "missed_detection_rate": ([0.02, 0.35], [0.0, 0.3], [0.04, 0.5]),
    "expected_cost": ([1.5, 0.4], [1.1, 0.3], [2.5, 0.6]),
    "log_loss": ([0.7, np.nan], [0.6, np.nan], [0.9, np.nan]),
}
TABLE = pd.DataFrame(
    {
        f"{name}{end}": column
        for name, columns in VALUES.items()
        for end, column in zip(("", "_low", "_high"), columns, strict=True)
    },
    index=["vibration", "current"],
).assign(groups=[12, 9], resampled="unit")


def drawn(**options):
    panels = Figure(figsize=(14, 5)).subplots(1, 3)
    return ComparisonDisplay(TABLE, **options).plot(ax=panels), panels


def test_the_three_rates_of_each_evaluation_are_drawn_separately_in_per_cent():
    _, panels = drawn()
    points = {line.get_label(): line.get_xdata() for line in panels[0].lines}
    assert np.allclose(points["balanced accuracy"], [90, 60])
    assert np.allclose(points["false alarms (of healthy)"], [10, 25])
    assert np.allclose(points["inspections (of healthy)"], [30, 5])
    assert np.allclose(points["missed detections (of faulty)"], [2, 35])
    limits = [[s[:, 0].tolist() for s in c.get_segments()] for c in panels[0].collections]
    assert np.allclose(limits[1], [[5, 15], [20, 45]])
    assert panels[0].get_xlabel() == "share of the recordings [%]"


def test_the_first_evaluation_is_on_top_and_named_with_its_groups():
    _, panels = drawn(scheme="by unit")
    names = [label.get_text() for label in panels[0].get_yticklabels()]
    assert names == ["vibration\n(units: 12)", "current\n(units: 9)"]
    assert panels[0].get_ylim()[0] > panels[0].get_ylim()[1]
    assert panels[0].get_title(loc="left") == "by unit"


def test_mean_cost_and_log_loss_are_drawn_with_their_intervals():
    _, panels = drawn()
    cost, loss = panels[1:]
    assert np.allclose(cost.lines[0].get_xydata(), [[1.5, 0], [0.4, 1]])
    segments = cost.collections[0].get_segments()
    assert np.allclose(segments, [[[1.1, 0], [2.5, 0]], [[0.3, 1], [0.6, 1]]])
    assert np.allclose(loss.lines[0].get_xydata()[0], [0.7, 0])
    assert (cost.get_xlabel(), loss.get_xlabel()) == ("mean cost", "log loss [nats]")
    assert cost.get_xlim()[0] == loss.get_xlim()[0] == 0


def test_the_frame_has_one_row_for_each_evaluation_and_figure_of_merit():
    display, _ = drawn()
    frame = display.frame().set_index(["evaluation", "figure"])
    assert len(frame) == 2 * (len(RATES) + 2)
    assert frame.loc[("current", "missed_detection_rate")].tolist() == [0.35, 0.3, 0.5]


def test_a_comparison_is_drawn_as_it_was_computed():
    rng = np.random.default_rng(0)
    y, runs = np.tile(["new", "new", "worn"], 20), np.repeat(np.arange(12), 5)
    found = {
        name: evaluate(
            GaussianNB(),
            rng.normal(size=(60, 1)) + shift * (y == "worn")[:, None],
            y,
            runs=runs,
            healthy="new",
        )
        for name, shift in {"vibration": 3, "current": 1.5}.items()
    }
    display = ComparisonDisplay.from_comparison(compare(found))
    frame = display.frame().set_index(["evaluation", "figure"])
    for name, each in found.items():
        row = each.table.loc["by run"]
        assert frame.loc[(name, "false_alarm_rate"), "high"] == row["false_alarm_rate_high"]
        assert frame.loc[(name, "log_loss"), "value"] == row["log_loss"]
    display.figure_.draw_without_rendering()
    boxes = [panel.get_window_extent() for panel in display.ax_]
    assert boxes[0].y0 > boxes[1].y1  # rates above
    assert boxes[1].x1 < boxes[2].x0
    assert display.figure_.get_figwidth() == 6.3
    pyplot.close(display.figure_)


def test_without_costs_and_losses_there_is_one_panel():
    columns = [f"{name}{end}" for name in RATES for end in ("", "_low", "_high")]
    display = ComparisonDisplay(TABLE[columns]).plot()
    assert len(display.ax_) == 1
    pyplot.close(display.figure_)


def test_invalid_tables_are_refused():
    with pytest.raises(TypeError, match="must be the result of compare, got DataFrame"):
        ComparisonDisplay.from_comparison(TABLE)
    with pytest.raises(TypeError, match="table must be a DataFrame that is not empty"):
        ComparisonDisplay(TABLE.iloc[:0])
    with pytest.raises(ValueError, match=r"the table has no \['accuracy'"):
        ComparisonDisplay(TABLE, figures="accuracy")
    with pytest.raises(ValueError, match="shares from 0 to 1"):
        ComparisonDisplay(TABLE.assign(false_alarm_rate=30.0))
