"""
Why was this decided?
=====================

`explain_decision` splits the log odds of a decision over the order bins. Beside them stand the
orders that the geometry predicts: a decision that rests on other bins deserves doubt.
"""

import numpy as np
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

import emacm
from emacm.displays import ContributionsDisplay
from emacm.simulation import simulate_fleet

recordings, states, units = simulate_fleet(4, 2, severity=(0.3, 0.6), seed=1)
model = make_pipeline(
    emacm.OrderResampler(2 * np.pi / 64, channels=["accelerometer"], min_speed=1.0),
    emacm.OrderPSD(8),
    emacm.BinTransformer(1.0, max_order=20),
    FunctionTransformer(np.log10, feature_names_out="one-to-one"),
    emacm.CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto"),
).fit(recordings, states)

others, true_states, _ = simulate_fleet(1, 1, severity=(0.4, 0.5), first_unit=8)
new = others[1]
decision = model.predict([new])[0]
healthy = [recordings[i] for i in np.flatnonzero(states == "healthy")]
table = emacm.explain_decision(model, new, against="healthy", background=healthy)
print(f"decided: {decision}, true state: {true_states[1]}")

(order,) = new.meta["orders"]["screw"]
predicted = {"screw": order, "2x screw": 2 * order}
ContributionsDisplay.from_table(table, fault_orders=predicted, decision="screw against healthy")
