"""
What does maintenance staff read?
=================================

`maintenance_report` writes one page for each recording, as HTML: the decision, its confidence in
words, the action, and which orders are raised. Its picture compares the recording with healthy
ones.
"""

from html import escape
from tempfile import TemporaryDirectory

import numpy as np
from IPython.display import HTML
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

import emacm
from emacm.displays import OrderBinsDisplay
from emacm.simulation import simulate_fleet

training, states, units = simulate_fleet(4, 2, severity=(0.2, 0.5), seed=1)
bins = make_pipeline(
    emacm.OrderResampler(2 * np.pi / 64, channels=["accelerometer"], min_speed=1.0),
    emacm.OrderPSD(8),
    emacm.BinTransformer(1.0, max_order=20),
    FunctionTransformer(np.log10, feature_names_out="one-to-one"),
)
classifier = emacm.CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto")
model = make_pipeline(*[step for _, step in bins.steps], classifier).fit(training, states)

new = simulate_fleet(1, 1, severity=(0.4, 0.4), first_unit=8)[0][1]
healthy = [training[i] for i in np.flatnonzero(states == "healthy")]
(order,) = new.meta["orders"]["screw"]
predicted = {"screw": order, "2x screw": 2 * order}
OrderBinsDisplay.from_estimator(
    bins, [*healthy, new], labels=["healthy"] * len(healthy) + ["this one"], fault_orders=predicted
)

with TemporaryDirectory() as folder:
    actions = {"screw": "Replace the screw within 200 cycles."}
    page, *_ = emacm.maintenance_report(
        model, [new], folder, actions=actions, parts={"screw": order}, background=healthy
    )
    text = escape(page.read_text(encoding="utf-8"))
HTML(f'<div><iframe srcdoc="{text}" title="report" width="100%" height="700"></iframe></div>')
