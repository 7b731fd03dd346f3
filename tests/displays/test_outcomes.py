"""Outcomes are counted by signal and condition: false alarms, inspections and so on."""

import pandas as pd
from matplotlib.figure import Figure

from emacm.displays import OutcomesDisplay

HEALTHY, WORN, SPALLED = "healthy", "worn", "spalled"


def axes(n_panels=1):
    return Figure(figsize=(7, 8)).subplots(n_panels, squeeze=False)[:, 0]


def counted(y_true, y_pred, **options):
    return OutcomesDisplay.from_predictions(y_true, y_pred, healthy=HEALTHY, **options)


def test_false_alarms_wrong_faults_and_missed_detections_are_distinguished():
    truths = [HEALTHY, HEALTHY, WORN, WORN, WORN]
    decided = [HEALTHY, WORN, WORN, HEALTHY, SPALLED]
    frame = counted(truths, decided, classes=[SPALLED], ax=axes()).frame()
    shares = {"correct": 40.0, "false alarm": 20.0, "wrong fault": 20.0, "missed detection": 20.0}
    assert frame.to_dict("records") == [{"inspection": 0.0, **shares, "n": 5.0}]


def test_a_decision_that_is_no_class_is_an_inspection_of_healthy_and_faulty_units():
    truths = [HEALTHY, HEALTHY, WORN, WORN, WORN]
    chosen = ["inspect", HEALTHY, "ask", "inspect", HEALTHY]
    counts = counted(truths, chosen, ax=axes()).counts
    none = {"false alarm": 0, "wrong fault": 0}
    expected = {"correct": 1, "inspection": 3, "missed detection": 1}
    assert counts.loc["all recordings"].to_dict() == none | expected


def test_bars_are_the_shares_of_each_condition_in_per_cent():
    (ax,) = axes()
    truths = [HEALTHY] * 4 + [WORN] * 4
    display = counted(truths, [HEALTHY] * 6 + [WORN] * 2, conditions=["a", "b"] * 4, ax=ax)
    correct, missed = ax.containers
    assert [bar.get_width() for bar in correct] == [75.0, 75.0]
    assert [bar.get_x() for bar in missed] == [75.0, 75.0]
    assert display.frame()["n"].tolist() == [4, 4]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["a  (n = 4)", "b  (n = 4)"]
    assert ax.get_xlabel() == "share of the recordings [%]"
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    assert legend == ["correct", "missed detection"]
    assert len({bars[0].get_hatch() for bars in ax.containers}) == 2


def test_each_signal_has_a_panel_with_its_own_conditions():
    panels = axes(2)
    rows = [("LVDT", 1), ("current", 1), ("current", 2)]
    counts = pd.DataFrame({"correct": [2, 0, 1], "false alarm": [0, 1, 0]})
    display = OutcomesDisplay(counts.set_axis(pd.MultiIndex.from_tuples(rows))).plot(ax=panels)
    assert [panel.get_title(loc="left") for panel in panels] == ["LVDT", "current"]
    assert [len(panel.get_yticks()) for panel in panels] == [1, 2]
    assert display.frame().loc[("current", 1), "false alarm"] == 100
