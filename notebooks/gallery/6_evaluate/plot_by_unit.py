"""
How well does it work on a unit that was not in training?
=========================================================

Runs of one unit resemble each other. A random split has runs of each unit on both sides and
promises too much; `evaluate` puts it beside a split by unit, with intervals.
"""

import numpy as np
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

import emacm
from emacm.displays import EvaluationDisplay
from emacm.simulation import simulate_fleet

recordings, states, units = simulate_fleet(6, 3, severity=(0.05, 0.3), seed=1)
bins = make_pipeline(
    emacm.OrderResampler(2 * np.pi / 64, channels=["accelerometer"], min_speed=1.0),
    emacm.OrderPSD(8),
    emacm.BinTransformer(2.0, max_order=20),
    FunctionTransformer(np.log10, feature_names_out="one-to-one"),
)
table = bins.fit_transform(recordings)  # once: no step of it learns from other recordings
classifier = emacm.CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto")
result = emacm.evaluate(classifier, table, states, units=units, healthy="healthy", n_splits=6)
print(result)
EvaluationDisplay.from_evaluation(result)
