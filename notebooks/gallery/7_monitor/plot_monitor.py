"""
How do I monitor a machine while it runs?
=========================================

`OrderMonitor` takes blocks of samples as they are measured, applies a fitted model to each
interval, and returns a `Reading` with the decision and its probabilities.
"""

import numpy as np
from matplotlib import pyplot as plt
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

import emacm

fs, rng = 2_000, np.random.default_rng(0)
angle = 120 * np.arange(5 * fs) / fs  # 5 s at 120 rad/s


def vibration(level):
    """A line at order 5.4, in noise."""
    return level * np.sin(5.4 * angle) + rng.normal(size=len(angle))


levels = np.append(np.zeros(24), np.linspace(0.1, 0.6, 24))
model = make_pipeline(
    emacm.OrderResampler(2 * np.pi / 32),
    emacm.OrderPSD(4),
    emacm.BinTransformer(1.0, max_order=8),
    FunctionTransformer(np.log10, feature_names_out="one-to-one"),
    emacm.CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto", temperature="groups"),
).fit(
    [emacm.Recording({"housing": vibration(level)}, fs, angle=angle) for level in levels],
    np.where(levels > 0, "worn", "healthy"),
    costsensitivegaussianbayes__groups=range(48),
)

monitor = emacm.OrderMonitor(model, fs=fs, channels=["housing"], max_speed=130, every=2, unit="s")
readings = []
for level in np.linspace(0, 0.8, 20):  # the machine wears out, in blocks of 5 s
    readings += monitor.push({"housing": vibration(level)}, velocity=np.full(len(angle), 120.0))

fig, ax = plt.subplots(figsize=(6.3, 3), layout="constrained")
ax.plot([r.time for r in readings], [r.posterior["worn"] for r in readings], ".-")
ax.set(xlabel="time [s]", ylabel="probability of 'worn'")
