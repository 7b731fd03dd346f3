"""
How do I decide on many recordings at once?
===========================================

`score` gives one row for each recording of a list or a `RecordingFolder`, also for one that
fails: decision, probabilities, expected cost, and what is outside the training. `emacm score`
does the same in the shell.
"""

import numpy as np
from matplotlib import pyplot as plt
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

import emacm
from emacm.simulation import simulate_fleet

training, states, units = simulate_fleet(6, 2, severity=(0.02, 0.3), seed=1)
model = make_pipeline(
    emacm.OrderResampler(2 * np.pi / 64, channels=["accelerometer"], min_speed=1.0),
    emacm.OrderPSD(8),
    emacm.BinTransformer(2.0, max_order=20),
    FunctionTransformer(np.log10, feature_names_out="one-to-one"),
    emacm.CostSensitiveGaussianBayes(
        {("healthy", "screw"): 10}, covariance="tied", shrinkage="auto", temperature="groups"
    ),
).fit(training, states, costsensitivegaussianbayes__groups=units)

new, truths, _ = simulate_fleet(3, 1, severity=(0.02, 0.3), seed=2, first_unit=8)
table = emacm.score(model, [*new, None])  # None: a recording that fails
print(table[["decision", "expected_cost", "error"]].assign(truth=[*truths, "-"]).round(3))

probabilities = table.filter(like="P(")[:-1]
fig, ax = plt.subplots(figsize=(6.3, 3), layout="constrained")
probabilities.plot.barh(stacked=True, ax=ax, width=0.8)
ax.set(xlabel="probability", ylabel="recording", xlim=(0, 1))
ax.legend(ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1), frameon=False)
