"""Since when a state has been decided."""

import numpy as np
import pandas as pd
import pytest

from emacm.reports.maintenance import add_since, as_times, check_history, since
from emacm.reports.pages import Page


def table(*decisions):
    return pd.DataFrame({"decision": decisions, "time": range(100, 100 * len(decisions) + 1, 100)})


@pytest.mark.parametrize(
    ("earlier", "text"),
    [
        (table("ok", "worn", "worn"), "Since cycle 200, in 3 recordings in a row; before that, "),
        (
            table("ok", "worn", "ok"),
            "New: the recording before, of this unit, was 'ok' (cycle 300)",
        ),
        (table("worn", "worn"), "Since cycle 100, in 3 recordings in a row: in all that are known"),
        (
            table("worn", "ok", "worn"),
            "Since cycle 300, in 2 recordings in a row; before that, 'ok'",
        ),
        (table(), "No earlier result of this unit is known."),
    ],
)
def test_the_uninterrupted_decisions_before_count(earlier, text):
    assert since("worn", 950, earlier, "cycle").startswith(text)


def test_only_results_before_the_recording_count_in_the_order_of_time():
    shuffled = table("ok", "worn", "ok", "ok").iloc[[3, 0, 2, 1]]
    assert since("worn", 250, shuffled, "cycle").startswith("Since cycle 200, in 2")
    assert since("worn", 100, shuffled) == "No earlier result of this unit is known."


def test_without_times_the_order_of_the_rows_is_that_of_time():
    earlier = pd.DataFrame({"decision": ["ok", "worn"], "time": None})
    text = "In 2 recordings in a row; before that, 'ok'."
    assert since("worn", None, earlier) == text


def test_units_are_separate_and_recordings_count_as_results_of_each_other():
    pages = [Page(str(k), d, "fault") for k, d in enumerate(["ok", "worn", "worn", "worn"])]
    pages.append(Page("4", "no decision", "error"))
    times = ["2024-05-01", "2024-05-03 22:10", "2024-05-04", "2024-05-02", "2024-05-05"]
    add_since(pages, None, ["A", "A", "A", "B", "A"], times)
    assert pages[0].since == "No earlier result of this unit is known."
    assert pages[1].since == "New: the recording before, of this unit, was 'ok' (2024-05-01)."
    assert pages[2].since.startswith("Since 2024-05-03 22:10, in 2 recordings in a row; before")
    assert pages[3].since == "No earlier result of this unit is known."
    assert pages[4].since == ""
    history = pd.DataFrame({"decision": ["worn", "", None], "unit": "B", "time": "2024-04-01"})
    add_since(pages, history, ["A", "A", "A", "B", "A"], times)
    assert pages[3].since.startswith("Since 2024-04-01, in 2 recordings in a row: in all")


def test_times_are_numbers_or_dates():
    assert as_times([3, np.float64(4.5)]) == [3, 4.5]
    assert as_times(["2024-05-01T10:00:00Z"]) == [pd.Timestamp("2024-05-01 10:00")]
    with pytest.raises(ValueError, match="all be numbers"):
        as_times([3, "2024-05-01"])
    with pytest.raises(ValueError, match="got 'soon'"):
        as_times(["soon"])


def test_an_invalid_history_is_refused():
    with pytest.raises(ValueError, match="history must be a table"):
        check_history([], False, False)
    with pytest.raises(ValueError, match="it has no 'unit'"):
        check_history(pd.DataFrame({"decision": []}), True, False)
