"""Facts about alarms on unknown states and implausible input."""

import numpy as np
import pandas as pd
import pytest

from emacm.monitoring import InputAlarm


def test_a_single_untypical_reading_gives_no_alarm_and_successive_ones_do():
    readings = pd.DataFrame({"typicality": [0.02, 0.009, 0.3, 0.01, 0.001, np.nan, 0.004]})
    alarms = InputAlarm(0.01).update(readings)["alarm"].tolist()
    assert alarms == ["", "", "", "", "2 successive untypical readings", "", ""]


@pytest.mark.slow
def test_the_nominal_run_length_is_that_of_a_simulation():
    typicality = np.random.default_rng(8).uniform(size=200_000)
    alarm, last, lengths = InputAlarm(0.1, consecutive=2), 0, []
    found = alarm.update(pd.DataFrame({"typicality": typicality}))["alarm"].ne("")
    for index in np.flatnonzero(found & ~found.shift(fill_value=False)):
        lengths.append(index - last)
        last = index
    # A run of alarms lasts 1 / (1 - p) readings, and the next one starts after it.
    assert np.mean(lengths) == pytest.approx(alarm.arl() + 1 / 0.9, rel=0.05)
    assert alarm.arl() == pytest.approx(110)


def test_unknown_states_warnings_and_errors_give_alarms_at_once():
    readings = pd.DataFrame(
        {
            "decision": ["screw", "new", None],
            "warnings": ["", "", ""],
            "outside_training": ["speed above", "", ""],
            "error": ["", "", "not a number at sample 7"],
        },
        index=[4, 9, 2],
    )
    alarms = InputAlarm(unknown="new").update(readings)["alarm"]
    assert alarms.to_dict() == {
        4: "outside training: speed above",
        9: "unknown state",
        2: "error: not a number at sample 7",
    }


def test_the_state_continues_a_run_of_untypical_readings():
    one = pd.DataFrame({"typicality": [0.001]})
    first = InputAlarm()
    first.update(one)
    assert InputAlarm().restore(first.state()).update(one).loc[0, "alarm"]


def test_invalid_tables_and_parameters_are_refused():
    with pytest.raises(TypeError, match="must be a DataFrame, got list"):
        InputAlarm().update([1])
    with pytest.raises(ValueError, match="at least one of the columns"):
        InputAlarm().update(pd.DataFrame({"rms": [1.0]}))
    with pytest.raises(TypeError, match="typicality must be a number, got '0"):
        InputAlarm().update(pd.DataFrame({"typicality": ["0.5"]}))
    with pytest.raises(ValueError, match="typicality must be a number above 0"):
        InputAlarm(0.0)
