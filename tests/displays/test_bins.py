"""Order bins and contributions are drawn between the exact edges of the bins."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from sklearn.pipeline import make_pipeline

from emacm import BinTransformer, OrderPSD, OrderResampler
from emacm.displays import ContributionsDisplay, OrderBinsDisplay
from emacm.simulation.fleet import simulate_actuator

NAMES = ["current@0-0.5", "current@0.5-2", "current@3-4"]
PARTS = ["current@3-4", "current@5-7", "vibration@3-4", "vibration@5-7"]


def axes(n_panels=1):
    return Figure(figsize=(7, 8)).subplots(n_panels, squeeze=False)[:, 0]


def table():
    return pd.DataFrame([[1.0, 10, 100], [3.0, 10, 100]], columns=NAMES)


def test_a_line_is_between_exact_edges_at_the_level_of_each_bin():
    (ax,) = axes()
    OrderBinsDisplay.from_table(table(), unit="A", ax=ax)
    x, y = ax.lines[0].get_data()
    known = ~np.isnan(y)
    assert x[known].tolist() == [0.0, 0.5, 0.5, 2.0, 3.0, 4.0]
    assert np.allclose(y[known], 10 * np.log10(np.repeat([2, 10, 100], 2)))
    assert ax.get_xlabel() == "order [cycles per revolution]"
    assert ax.get_ylabel() == "power of current [dB re 1 A²]"


def test_bins_with_names_are_drawn_side_by_side():
    (ax,) = axes()
    OrderBinsDisplay(["a@BPFO", "a@BPFI"], {"all": [1.0, 10.0]}).plot(ax=ax)
    x, y = ax.lines[0].get_data()
    assert np.allclose(x[~np.isnan(y)], [-0.4, 0.4, 0.6, 1.4])
    assert y[~np.isnan(y)].tolist() == [0, 0, 10, 10]
    assert [t.get_text() for t in ax.get_xticklabels()] == ["BPFO", "BPFI"]
    assert ax.get_xlabel() == "order bin"


def test_a_pipeline_draws_its_bins_and_its_stop_bands():
    runs = [simulate_actuator("screw", seed=seed) for seed in (1, 2)]
    bins = BinTransformer(max_order=10, stop_bands=((5.5, 6.5),))
    resampler = OrderResampler(channels=["current_a", "accelerometer"])
    pipeline = make_pipeline(resampler, OrderPSD(4), bins).fit(runs)
    panels = axes(2)
    display = OrderBinsDisplay.from_estimator(
        pipeline, runs, unit={"current_a": "A"}, fault_orders={"screw": 3.125}, ax=panels
    )
    assert np.allclose(display.frame().iloc[:, 0], pipeline.transform(runs).mean(axis=0))
    assert display.stop_bands == [(5.5, 6.5)]
    assert "A²" in panels[0].get_ylabel()
    assert "unit²" in panels[1].get_ylabel()
    assert [text.get_text() for text in panels[0].texts] == ["screw"]
    assert len(panels[1].lines) == 2  # the powers; the mark again, without its name
    assert not panels[1].texts


def bars(ax):
    return sorted((bar.get_x(), bar.get_width(), bar.get_height()) for bar in ax.patches)


def test_each_channel_has_bars_between_the_edges_of_its_bins():
    panels = axes(2)
    ContributionsDisplay(PARTS, [2.0, -1.0, 0.5, 0.0]).plot(ax=panels)
    assert bars(panels[0]) == [(3, 1, 2.0), (5, 2, -1.0)]
    assert bars(panels[1]) == [(3, 1, 0.5), (5, 2, 0.0)]
    assert panels[0].get_ylim() == panels[1].get_ylim()
    label = panels[0].get_ylabel().replace("\n", " ")
    assert label == "contribution of current [nats]"


def test_predicted_fault_orders_are_marked_and_set_beside_the_bins():
    panels = axes(2)
    orders = {"screw": 3.125, "BPFI": 6.123, "2 BPFI": 12.246}
    display = ContributionsDisplay(PARTS, [2.0, 0, 0, 1], fault_orders=orders).plot(ax=panels)
    assert [text.get_text() for text in panels[0].texts] == ["screw", "BPFI"]
    assert display.frame()["contribution"].tolist() == [2.0, 0, 0, 1]
