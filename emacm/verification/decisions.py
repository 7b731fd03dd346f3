"""Known answers of posteriors and decisions, run lengths, coverage, streams and model files."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import multivariate_normal
from sklearn.decomposition import PCA
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm.alarms.control_charts import CUSUM, EWMA
from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.metrics import expected_cost
from emacm.decisions.posterior_product import PosteriorProduct
from emacm.life.prognostic_metrics import coverage_by_unit
from emacm.models.model_files import load_model, save_model
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.recording import Recording
from emacm.resampling.order_resampler import OrderResampler
from emacm.simulation.chapter3 import chapter3_recordings
from emacm.streams.order_monitor import OrderMonitor

Table = tuple[NDArray[np.float64], NDArray[np.str_]]


def covariances() -> dict[str, float]:
    """Compare variances with those by hand."""
    X, y = [[1.0], [2.0], [4.0], [0.0], [1.0]], ["a", "a", "a", "b", "b"]
    tied = CostSensitiveGaussianBayes(covariance="tied").fit(X, y).covariances_
    full = CostSensitiveGaussianBayes().fit(X, y).covariances_
    return {"full": full[0, 0, 0], "tied": tied[0, 0]}


def posteriors() -> dict[str, float]:
    """Compare posteriors with formulas and other packages, Eqs. (2.41), (2.42)."""
    equal = _pairs(0, 1, 2, 1)
    # At 0.75 the densities are phi(0.75) and phi(0.75) / 2.
    unequal = CostSensitiveGaussianBayes(priors=[0.7, 0.3]).fit(*_pairs(0, 1, 2.25, 2))
    product = PosteriorProduct([(name, CostSensitiveGaussianBayes()) for name in ("one", "two")])
    models = {
        "equal": CostSensitiveGaussianBayes().fit(*equal),
        "temperature": CostSensitiveGaussianBayes(temperature=2.0).fit(*equal),
        "product": product.fit(*equal),
    }
    found = {name: model.predict_proba([[0.0]])[0, 0] for name, model in models.items()}
    found["unequal"] = unequal.predict_proba([[0.75]])[0, 0]
    X, y = np.random.default_rng(5).standard_normal((2000, 2)), np.repeat(["a", "b"], 1000)
    X[y == "b", 0] += 1.0
    # LDA divides the covariance by N, not by N - K.
    tied = CostSensitiveGaussianBayes(covariance="tied", temperature=1998 / 2000).fit(X, y)
    of_lda = LinearDiscriminantAnalysis(solver="lsqr").fit(X, y).predict_proba(X)
    moments = [(X[y == name].mean(axis=0), np.cov(X[y == name].T)) for name in "ab"]
    densities = np.stack([multivariate_normal(*of_class).pdf(X) for of_class in moments], axis=1)
    of_scipy = densities / densities.sum(axis=1, keepdims=True)
    full = CostSensitiveGaussianBayes().fit(X, y).predict_proba(X)
    found["scikit-learn"] = np.abs(tied.predict_proba(X) - of_lda).max()
    return found | {"scipy": np.abs(full - of_scipy).max()}


def least_risk() -> dict[str, float]:
    """Compare decisions of least conditional risk with formulas, Eq. (2.43)."""
    cost, axis = np.array([[0.0, 10.0], [1.0, 0.0]]), np.linspace(-1, 3, 4001)[:, np.newaxis]
    model = CostSensitiveGaussianBayes(cost).fit(*_pairs(0, 1, 2, 1))
    limit = 1 - np.log(10) / 2  # 10 P(b|x) = P(a|x): 2 (x - 1) = -ln 10
    risks = model.risk([[limit]])[0]
    sides = model.predict([[limit - 1e-6], [limit + 1e-6]]) == ["a", "b"]
    inspect = {("inspect", "a"): 0.3, ("inspect", "b"): 0.3}
    later = CostSensitiveGaussianBayes(inspect).fit(*_pairs(0, 1, 2, 1))
    inspected = np.ptp(axis[later.predict(axis) == "inspect"])
    difference = np.abs(later.set_params(cost=cost).risk(axis) - model.risk(axis)).max()
    mean = expected_cost(list("aabb"), list("abbb"), cost=cost, labels=["a", "b"])
    found = {"tie": risks[0] - risks[1], "sides": sides.sum(), "inspect": inspected}
    return found | {"refit": difference, "mean": mean}


def chapter_3() -> dict[str, float]:
    """Decide on three classes of 40 runs in bins of order 1, chapter 3 of the thesis."""
    recordings, y = chapter3_recordings(40)
    bins = BinTransformer(1, stop_bands=((5.6, 6.4),))
    spectra = make_pipeline(OrderResampler(), OrderPSD(16, max_order=51), bins)
    X = np.asarray(spectra.fit_transform(recordings))
    model = make_pipeline(PCA(2), CostSensitiveGaussianBayes(priors="uniform"))
    return {"bins": X.shape[1], "right": model.fit(X, y).score(X, y) * len(y)}


def _pairs(*moments: float) -> Table:
    """Return two recordings of each of two classes, with these means and standard deviations."""
    mean_a, spread_a, mean_b, spread_b = moments
    ends = np.array([[-1.0], [1.0]]) / np.sqrt(2)
    return np.vstack([mean_a + spread_a * ends, mean_b + spread_b * ends]), np.array(list("aabb"))


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
