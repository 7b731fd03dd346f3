"""Monitoring: run lengths, coverage and streams; and model files."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm.alarms.control_charts import CUSUM, EWMA
from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.life.prognostic_metrics import coverage_by_unit
from emacm.models.model_files import load_model, save_model
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.recording import Recording
from emacm.resampling.order_resampler import OrderResampler
from emacm.streams.order_monitor import OrderMonitor


def run_lengths() -> dict[str, float]:
    """Compare average run lengths of control charts with published ones."""
    ewma, cusum = EWMA(0.2, 2.962), CUSUM(0.5, 5.0)
    return {
        "EWMA": ewma.arl(),
        "EWMA shifted": ewma.arl(1.0),
        "Shewhart": EWMA(1.0, 3.0).arl(),
        "CUSUM": cusum.arl(),
        "CUSUM shifted": cusum.arl(1.0),
        "limit": CUSUM(0.5, arl=930).fit(np.eye(9)).limit_,
    }


def coverage() -> dict[str, float]:
    """Count new recordings by their typicality, and compute an exact binomial interval."""
    X, y, groups = _in_groups(0, 60)
    model = CostSensitiveGaussianBayes(covariance="tied", unknown="unknown")
    typicality = model.fit(X, y, groups=groups).typicality(_in_groups(1, 400)[0])
    units = coverage_by_unit(np.ones(10), np.zeros(10), np.full(10, 2.0), np.arange(10))
    return {"typicality": np.mean(typicality <= 0.1), "interval": units.loc["all", "low"]}


def streams() -> dict[str, float]:
    """Compare a stream in uneven blocks with the whole recording."""
    model, recordings = _fitted()
    whole = np.asarray(model[:-1].transform(recordings[:1]))[0]
    signal, velocity = recordings[0].signals["x"], recordings[0].velocity
    options: dict[str, Any] = {"fs": 1000, "channels": ["x"], "max_speed": 70.0}
    monitors = {name: OrderMonitor(model, **options) for name in ("stream", "resumed")}
    for start, stop in pairwise([0, 7, 900, 901, 2500, len(signal)]):
        for name, monitor in monitors.items():
            if name == "stream" or start >= 901:
                monitor.push({"x": signal[start:stop]}, velocity=velocity[start:stop])
        if stop == 901:
            monitors["resumed"].restore(monitors["stream"].state())
    features = {name: monitor.flush()[0].features for name, monitor in monitors.items()}
    return {name: np.abs(row / whole - 1).max() for name, row in features.items()}


def model_file() -> dict[str, float]:
    """Save and load a model, and damage its file."""
    model, recordings = _fitted()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "model.skops"
        save_model(model, path)
        loaded = load_model(path).predict_proba(recordings)
        content = bytearray(path.read_bytes())
        content[-100] ^= 1
        path.write_bytes(content)
        try:
            load_model(path)
            refused = 0
        except ValueError:
            refused = 1
    difference = np.abs(loaded - model.predict_proba(recordings)).max()
    return {"posteriors": difference, "refused": refused}


def _fitted() -> tuple[Pipeline, list[Recording]]:
    """Return a model of two states, and the recordings to which it was fitted."""
    rng, time = np.random.default_rng(6), np.arange(4000) / 1000
    velocity = 40 + 20 * np.sin(time)
    recordings = [
        Recording({"x": level * rng.standard_normal(len(time))}, 1000, velocity=velocity)
        for level in np.repeat([1.0, 2.0], 8)
    ]
    steps = [
        OrderResampler(2 * np.pi / 32),
        OrderPSD(4, max_order=12),
        BinTransformer(4, max_order=12),
        FunctionTransformer(np.log10, feature_names_out="one-to-one"),
    ]
    model = make_pipeline(*steps, CostSensitiveGaussianBayes(covariance="diag"))
    return model.fit(recordings, np.repeat(["new", "worn"], 8)), recordings


def _in_groups(seed: int, n_groups: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Draw five recordings of each of two classes in each group, whose offset they share."""
    rng = np.random.default_rng(seed)
    codes, groups = np.tile(np.repeat([0, 1], 5), n_groups), np.repeat(np.arange(n_groups), 10)
    offsets = 0.7 * rng.standard_normal((n_groups, 2, 4))[groups, codes]
    X = 4 * codes[:, np.newaxis] + offsets + rng.standard_normal((len(codes), 4))
    return X, np.array(["new", "worn"])[codes], groups
