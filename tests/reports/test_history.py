"""Since when a state has been decided."""

import pandas as pd
import pytest

from emacm.reports.maintenance import add_since
from emacm.reports.pages import Page


def table(*decisions):
    return pd.DataFrame({"decision": decisions, "time": range(100, 100 * len(decisions) + 1, 100)})


def since(history, times):
    """Return what a page states of a history without units."""
    page = Page("new", "worn", "fault")
    add_since([page], history, None, times, "cycle")
    return page.since


@pytest.mark.parametrize(
    ("earlier", "text"),
    [
        (table("ok", "worn", "worn"), "Since cycle 200, in 3 recordings in a row; before that, "),
        (table("ok", "worn", "ok"), "New: the recording before, of this unit, was 'ok' (cycle 300"),
        (table("worn", "worn"), "Since cycle 100, in 3 recordings in a row: in all that are known"),
        (table(), "No earlier result of this unit is known."),
    ],
)
def test_the_uninterrupted_decisions_before_count(earlier, text):
    assert since(earlier, [950]).startswith(text)


def test_only_results_before_the_recording_count_in_the_order_of_time():
    shuffled = table("ok", "worn", "ok", "ok").iloc[[3, 0, 2, 1]]
    assert since(shuffled, [250]).startswith("Since cycle 200, in 2")
    assert since(shuffled, [100]) == "No earlier result of this unit is known."


def test_units_are_separate_and_recordings_count_as_results_of_each_other():
    pages = [Page(str(k), d, "fault") for k, d in enumerate(["ok", "worn", "worn", "worn"])]
    pages.append(Page("4", "no decision", "undecided"))
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


def test_times_may_have_a_zone_or_fractions():
    dates = pd.DataFrame({"decision": ["worn"], "time": ["2024-05-01T10:00:00Z"]})
    assert since(dates, ["2024-05-02"]).startswith("Since 2024-05-01 10:00, in 2")
    numbers = pd.DataFrame({"decision": ["worn"], "time": [4.5]})
    assert since(numbers, [5]).startswith("Since cycle 4.5, in 2")


@pytest.mark.parametrize(
    ("history", "units", "times", "message"),
    [
        ([], None, [950], "history must be a table"),
        (table("worn"), ["A"], [950], "it has no 'unit'"),
        (table("worn"), ["A"], None, "history needs the time"),
        (table("worn"), None, ["2024-05-01"], "all be numbers"),
        (None, ["A"], ["soon"], "got 'soon'"),
    ],
)
def test_an_invalid_history_is_refused(history, units, times, message):
    with pytest.raises(ValueError, match=message):
        add_since([Page("new", "worn", "fault")], history, units, times)
