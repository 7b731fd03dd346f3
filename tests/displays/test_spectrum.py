"""Order spectra are drawn with their values, units and labels."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from sklearn.pipeline import make_pipeline

from emacm import EnvelopeDetector, OrderPSD, OrderResampler, Recording
from emacm.displays import OrderSpectrumDisplay
from emacm.orders.columns import OrderTable, order_columns


def spectra():
    orders = np.arange(9) / 4
    values = np.array([[1.0], [3.0], [10.0]]) * np.ones((3, 18))
    return orders, OrderTable(values, order_columns(["vibration", "current"], orders))


def test_a_spectrum_is_the_mean_of_each_label_in_db(ax):
    orders, table = spectra()
    display = OrderSpectrumDisplay.from_table(table, "current", labels=[*"aab"], unit="A", ax=ax)
    frame = display.frame()
    assert list(frame.columns) == ["a", "b"]
    assert np.array_equal(frame.index, orders)
    assert (frame["a"] == 2).all()
    drawn = {line.get_label(): line.get_ydata() for line in ax.lines}
    assert np.allclose(drawn["b"], 10)
    assert ax.get_ylabel() == "PSD of current [dB re 1 A²/order]"
    assert display.ax_ is ax


def test_every_channel_has_a_panel_and_its_own_unit():
    _, table = spectra()
    axes = Figure(figsize=(6, 9)).subplots(2)
    units = {"vibration": "m/s²", "current": "A"}
    display = OrderSpectrumDisplay.from_table(table, labels=[*"aab"], unit=units, ax=axes)
    assert display.channel == ["vibration", "current"]
    two = OrderSpectrumDisplay([0, 1, 2], {"a": [[1, 1, 1], [100, 100, 100]]}, channel=["x", "y"])
    two.plot(ax=Figure().subplots(2))
    assert [panel.lines[0].get_ydata()[0] for panel in two.ax_] == [0, 20]
    assert display.frame()["current", "b"].eq(10).all()
    assert "A²/order" in axes[1].get_ylabel()
    assert "(m/s²)²/order" in axes[0].get_ylabel()
    assert np.allclose(axes[1].lines[0].get_ydata(), 10 * np.log10(2))


def test_a_power_spectrum_is_not_called_a_density(ax):
    angle = 2 * np.pi / 32 * np.arange(32 * 20)
    psd = OrderPSD(4, theta_s=2 * np.pi / 32, scaling="spectrum").fit([np.sin(3 * angle)])
    OrderSpectrumDisplay.from_estimator(psd, [np.sin(3 * angle)], "signal", unit="A", ax=ax)
    assert ax.get_ylabel() == "power of signal [dB re 1 A²]"


@pytest.mark.parametrize(("squared", "unit"), [(False, "g²"), (True, "g⁴")])
def test_a_pipeline_with_an_envelope_detector_draws_envelope_spectra(squared, unit, ax):
    times = np.arange(8000) / 2000
    ringing = (1 + np.cos(2.7 * 30 * times)) * np.sin(2 * np.pi * 500 * times)
    runs = [Recording({"vibration": ringing}, 2000, velocity=np.full(8000, 30.0))]
    detector = EnvelopeDetector((350, 650), squared=squared)
    pipeline = make_pipeline(detector, OrderResampler(), OrderPSD(10, max_order=8)).fit(runs)
    display = OrderSpectrumDisplay.from_estimator(pipeline, runs, unit="g", ax=ax)
    words = "squared envelope" if squared else "envelope"
    assert ax.get_ylabel().replace("\n", " ") == (
        f"{words} order spectrum of vibration [dB re 1 {unit}/order]"
    )
    assert display.frame().iloc[10:, 0].idxmax() == pytest.approx(2.7)
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert names == ["all recordings"]
