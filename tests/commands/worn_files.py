"""Files of a machine whose wear has a line at order 4.7, and a model of them."""

import numpy as np
from order_models import log, order_bins

from emacm import CostSensitiveGaussianBayes, Layout, RecordingFolder, save_model


def signals(worn, seed, n=2000):
    """Return vibration and speed [rpm], at 1000 Hz."""
    rng = np.random.default_rng(seed)
    line = (2.0 if worn else 0.1) * np.sin(4.7 * 90.0 * np.arange(n) / 1000)
    return {"vib": rng.normal(size=n) + line, "speed": np.full(n, 90 * 30 / np.pi)}


def write(path, worn, seed):
    np.savez(path, **signals(worn, seed))


def save_trained(folder, files, cost=None):
    """Save a model that was trained on files by their layout, all in one folder."""
    X = RecordingFolder(folder / files, Layout.from_toml(folder / "layout.toml"))
    bayes = CostSensitiveGaussianBayes(cost, covariance="diag", shrinkage=0.1)
    model = order_bins(log(), bayes, samples=24, bin_size=0.5, max_order=9)
    save_model(model.fit(X, [recording.meta["state"] for recording in X]), folder / "model.emacm")
