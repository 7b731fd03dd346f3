"""Pictures hold the numbers they show."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from emacm import CostSensitiveGaussianBayes
from emacm.axes import OrderTable, order_columns
from emacm.displays import DecisionRegionsDisplay, OrderSpectrumDisplay


@pytest.fixture
def ax():
    return Figure().subplots()


def spectra():
    orders = np.arange(9) / 4
    values = np.array([[1.0], [3.0], [10.0]]) * np.ones((3, 18))
    return orders, OrderTable(values, order_columns(["vibration", "current"], orders))


def test_a_spectrum_is_the_mean_of_each_label_in_db(ax):
    orders, table = spectra()
    display = OrderSpectrumDisplay.from_table(
        table, "current", labels=["a", "a", "b"], unit="A", ax=ax
    )
    frame = display.frame()
    assert list(frame.columns) == ["a", "b"]
    assert np.array_equal(frame.index, orders)
    assert (frame["a"] == 2).all()
    drawn = {line.get_label(): line.get_ydata() for line in ax.lines}
    assert np.allclose(drawn["b"], 10)
    assert ax.get_ylabel() == "PSD of current [dB re 1 A²/order]"
    assert display.ax_ is ax


def test_a_spectrum_marks_fault_orders_and_stops_where_asked(ax):
    _, table = spectra()
    OrderSpectrumDisplay.from_table(
        table, "vibration", unit="m/s²", max_order=1, fault_orders={"screw": 0.75}, ax=ax
    )
    assert ax.get_xlim() == (0, 1)
    assert [text.get_text() for text in ax.texts] == ["screw"]
    assert ax.lines[0].get_xdata().max() == 1
    assert "(m/s²)²/order" in ax.get_ylabel()


def test_a_spectrum_of_a_dataframe_is_the_same(ax):
    _, table = spectra()
    frame = pd.DataFrame(np.asarray(table), columns=list(table.columns))
    one = OrderSpectrumDisplay.from_table(table, "current", ax=ax).frame()
    pd.testing.assert_frame_equal(
        one, OrderSpectrumDisplay.from_table(frame, "current", ax=ax).frame()
    )


def test_a_spectrum_without_axis_or_channel_says_so():
    _, table = spectra()
    with pytest.raises(ValueError, match="carries no order axis"):
        OrderSpectrumDisplay.from_table(np.ones((2, 3)), "current")
    with pytest.raises(ValueError, match=r"no channel 'speed', only \['vibration', 'current'\]"):
        OrderSpectrumDisplay.from_table(table, "speed")


def test_regions_are_what_the_classifier_decides(ax):
    rng = np.random.default_rng(0)
    points = np.concatenate([rng.normal(-2, 1, (50, 2)), rng.normal(2, 1, (50, 2))])
    truths = np.repeat(["healthy", "worn"], 50)
    cost = {("inspect", "healthy"): 0.1, ("inspect", "worn"): 0.1}
    model = CostSensitiveGaussianBayes(cost).fit(points, truths)
    display = DecisionRegionsDisplay.from_estimator(model, points, truths, n_grid=40, ax=ax)
    corner = [[display.first[0], display.second[0]]]
    assert display.decisions[display.regions[0, 0]] == model.predict(corner)[0] == "healthy"
    assert set(display.regions.ravel()) == {0, 1, 2}
    assert (display.frame()["true"] == truths).all()
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert "decided: inspect" in labels
    assert "true: worn" in labels


def test_regions_need_two_features():
    with pytest.raises(ValueError, match=r"two features, got X of shape \(4, 3\)"):
        DecisionRegionsDisplay.from_estimator(None, np.ones((4, 3)), ["a"] * 4)


def test_labels_that_do_not_fit_the_recordings_are_refused():
    _, table = spectra()
    with pytest.raises(ValueError, match=r"one label for each of 3 recordings, got shape \(2,\)"):
        OrderSpectrumDisplay.from_table(table, "current", labels=["a", "b"])
