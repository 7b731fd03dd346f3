"""Facts about the alarm chart and the display of the remaining life."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from emacm.displays import AlarmDisplay, RemainingLifeDisplay
from emacm.monitoring import CUSUM, EWMA, RemainingLife


def readings(seed, n_readings, shift=0.0):
    return np.random.default_rng(seed).normal([5.0 + shift, -3.0], [0.5, 2.0], (n_readings, 2))


@pytest.mark.parametrize("chart", [EWMA(0.3, arl=200), CUSUM(0.5, arl=200)])
def test_the_chart_of_readings_is_drawn_without_changing_the_alarm(chart):
    chart.fit(readings(0, 70))
    chart.update(readings(1, 9))
    state = chart.statistic_.tolist()
    later = readings(2, 20, shift=1.0)
    times = np.arange(20) * 2.5
    shown = AlarmDisplay.from_estimator(chart, later, times, ax=Figure().subplots())
    assert chart.statistic_.tolist() == state
    expected = chart.reset().update(later)
    np.testing.assert_array_equal(shown.frame()["statistic"], expected.statistic[:, 0])
    np.testing.assert_array_equal(shown.frame()["alarm"], expected.alarm[:, 0])
    first = times[expected.alarm[:, 0]][0]
    texts = [text.get_text() for text in shown.ax_.get_legend().get_texts()]
    assert f"alarm, first at {first:g}" in texts
    horizontal = [line.get_ydata()[0] for line in shown.ax_.lines if line.get_linestyle() == "--"]
    both = [chart.limit_, -chart.limit_]
    assert horizontal == (both if isinstance(chart, EWMA) else both[:1])


def worn(units):
    """Units whose index rises with different slopes from age 5 on, and which fail at 30."""
    X, y, groups = [], [], []
    for unit in units:
        slope = 1.0 + 0.5 * np.sin(7.0 * unit)
        life = 5 + 30 / slope
        ages = np.arange(0, life, 2.0)
        noise = 0.3 * np.sin(40 * ages * (unit + 1))
        X.append(np.column_stack([ages, np.maximum(slope * (ages - 5), -1) + noise]))
        y.append(life - ages)
        groups += [unit] * len(ages)
    return np.vstack(X), np.concatenate(y), np.array(groups)


def test_the_remaining_life_of_one_unit_is_that_of_the_estimator():
    X, y, groups = worn(range(14))
    model = RemainingLife(onset=2.0).fit(X, y, groups=groups)
    X, y, _ = worn([20])
    shown = RemainingLifeDisplay.from_estimator(model, X, y, ax=Figure().subplots(), unit="days")
    expected = model.predict_interval(X, np.zeros(len(X)))
    pd.testing.assert_frame_equal(shown.frame().drop(columns="true"), expected)
    assert shown.ax_.get_ylabel() == "remaining life [days]"
    texts = [text.get_text().replace("\n", " ") for text in shown.ax_.get_legend().get_texts()]
    assert "90% interval, life of the population" in texts
    assert "90% interval, from the health index" in texts
