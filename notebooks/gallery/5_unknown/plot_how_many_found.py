"""
How many faults that were never seen would be found?
====================================================

`evaluate_unknown` leaves each fault out of training in turn, and states how well its recordings
are told from known ones that were held out too. The area under the curve is 0.5 for guessing.
"""

import numpy as np
from matplotlib import pyplot
from sklearn.metrics import RocCurveDisplay
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

import emacm
from emacm.simulation import simulate_fleet

recordings, states, units = simulate_fleet(5, 2, severity=(0.05, 0.3), seed=1)
bins = make_pipeline(
    emacm.OrderResampler(2 * np.pi / 64, channels=["accelerometer"], min_speed=1.0),
    emacm.OrderPSD(8),
    emacm.BinTransformer(2.0, max_order=20),
    FunctionTransformer(np.log10, feature_names_out="one-to-one"),
)
table = bins.fit_transform(recordings)  # once: no step of it learns from other recordings
classifier = emacm.CostSensitiveGaussianBayes(
    covariance="tied", shrinkage="auto", unknown="unknown"
)
found = emacm.evaluate_unknown(classifier, table, states, units=units, healthy="healthy")
print(found)
ax = pyplot.figure(layout="constrained").subplots()
for family, held in found.predictions.groupby("left_out"):
    RocCurveDisplay.from_predictions(held["is_unknown"], -held["typicality"], name=family, ax=ax)
ax.set(xlabel="known recordings flagged", ylabel="unknown recordings flagged")
