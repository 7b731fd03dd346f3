"""Order bins are drawn between their exact edges."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from sklearn.pipeline import make_pipeline

from emacm import BinTransformer, OrderPSD, OrderResampler
from emacm.displays import OrderBinsDisplay
from emacm.simulation.fleet import simulate_actuator

NAMES = ["current@0-0.5", "current@0.5-2", "current@3-4"]


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
