"""
Is the second sensor worth its price?
=====================================

`compare` puts evaluations on the same splits beside each other, with the interval of the
difference: what one fleet shows may be chance.
"""

import numpy as np
from matplotlib import pyplot as plt
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

import emacm
from emacm.simulation import simulate_fleet

recordings, states, units = simulate_fleet(6, 2, severity=(0.05, 0.3), seed=1)
classifier = emacm.CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto")
found = {}
for channels in (["current_a"], ["current_a", "accelerometer"]):
    bins = make_pipeline(
        emacm.OrderResampler(2 * np.pi / 64, channels=channels, min_speed=1.0),
        emacm.OrderPSD(8),
        emacm.BinTransformer(2.0, max_order=20),
        FunctionTransformer(np.log10, feature_names_out="one-to-one"),
    )
    table = bins.fit_transform(recordings)  # once: no step of it learns from other recordings
    found[" + ".join(channels)] = emacm.evaluate(
        classifier, table, states, units=units, healthy="healthy", n_splits=6
    )
comparison = emacm.compare(found, scheme="by unit")
print(comparison.differences[["expected_cost", "expected_cost_low", "expected_cost_high"]])

table = comparison.table
cost = table["expected_cost"]
beside = [cost - table["expected_cost_low"], table["expected_cost_high"] - cost]
fig, ax = plt.subplots(figsize=(6.3, 2.2), layout="constrained")
ax.errorbar(cost, list(found), xerr=np.array(beside), fmt="o", capsize=4)
ax.set(xlabel="expected cost per recording, with 95 % confidence interval", xlim=(0, None))
ax.margins(y=0.4)
