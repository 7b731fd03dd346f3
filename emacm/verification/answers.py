"""Functions that compute the known answers of the field, in the order of `known_answers.csv`.

First those of resampling, spectra and lines of faults; then those of posteriors and decisions, run
lengths, coverage, streams and model files. Each returns its values by their names in the table.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters
from scipy.integrate import trapezoid
from scipy.stats import multivariate_normal
from sklearn.decomposition import PCA
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm.alarms.control_charts import CUSUM, EWMA
from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.metrics import expected_cost
from emacm.decisions.posterior_product import PosteriorProduct
from emacm.envelopes.envelope_detector import EnvelopeDetector
from emacm.envelopes.kurtogram import spectral_kurtosis
from emacm.life.prognostic_metrics import coverage_by_unit
from emacm.machine.fault_orders import fault_orders
from emacm.machine.gears import Gear, PlanetaryGear
from emacm.machine.motors import Motor
from emacm.machine.rolling import Bearing
from emacm.models.model_files import load_model, save_model
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_psd import OrderPSD
from emacm.orders.welch import order_psd
from emacm.recordings.recording import Recording
from emacm.resampling.order_resampler import OrderResampler
from emacm.simulation.chapter3 import chapter3_recordings
from emacm.streams.order_monitor import OrderMonitor


def run_up() -> dict[str, float]:
    """Resample sin(6 theta) at a speed of 100 t rad/s, Figs. 2.6 and 2.7 of the thesis."""
    time = np.arange(501) / 1000
    signal = np.sin(300 * time**2)  # Eqs. (2.5), (2.11)
    recording = Recording({"x": signal}, 1000, velocity=100 * time)
    resampler = OrderResampler(2 * np.pi / 60, interpolation="linear", antialias=False)
    psd = OrderPSD(n_per_segment=256, window="boxcar", short="pad")
    (spectrum,) = psd.fit_transform(resampler.fit_transform([recording]))
    return {
        "order": psd.orders_[spectrum.argmax()],
        "power": spectrum.sum() * psd.order_step_,
        "revolutions": resampler.quality([recording])["revolutions"].iloc[0],
    }


def reversals() -> dict[str, float]:
    """Cut a motion forth and back into strokes, with a line in the forward ones only."""
    time = np.arange(30_000) / 10_000
    angle, forward = 48 * (1 - np.cos(np.pi * time)), np.sin(np.pi * time) > 0
    recording = Recording({"x": np.where(forward, np.sin(9 * angle), 0)}, 10_000, angle=angle)
    (over_angle,) = OrderResampler().fit_transform([recording])
    psd = OrderPSD(8, by_direction=True, scaling="spectrum").set_output(transform="pandas")
    powers = psd.fit_transform([over_angle]).iloc[0]
    reverse = powers.filter(like="x-@").max()
    return {"strokes": len(over_angle.strokes), "forward": powers["x+@9"], "reverse": reverse}


def pass_band() -> dict[str, float]:
    """Resample tones below the highest order."""
    return {f"order {k:g}": _level(k, 10_000, 20.0, 128) for k in (1.0, 13.5, 49.375)}


def aliasing() -> dict[str, float]:
    """Resample a tone at order 130.5 at 100 angles per revolution: its image is order 30.5."""
    levels = {
        "filtered": _level(130.5, 48_000, 10.0, 100, read_at=30.5),
        "unfiltered": _level(130.5, 48_000, 10.0, 100, read_at=30.5, antialias=False),
    }
    return {name: 10 ** (level / 20) for name, level in levels.items()}


def noise_floor() -> dict[str, float]:
    """Resample white noise."""
    fs, speed = 48_000, 47.3  # revolutions per second
    noise = np.random.default_rng(0).standard_normal(4 * fs)
    recording = Recording({"x": noise}, fs, velocity=2 * np.pi * speed)
    found = {}
    for name, antialias in (("filtered", True), ("unfiltered", False)):
        options: dict[str, Any] = {"antialias": antialias, "interpolation": "linear"}
        orders, psd = _spectrum(recording, "density", theta_s=2 * np.pi / 100, **options)
        floor = psd[(orders > 1) & (orders < 39)].mean()
        found[name] = 10 * np.log10(floor / (2 * speed / fs))
    return found


def _level(
    order: float, fs: int, speed: float, n_angles: int, *, read_at: float = np.nan, **options: Any
) -> float:
    """Return the level that a tone has at `read_at`, or at the highest line [dB re its power]."""
    turns = speed * np.arange(3 * fs) / fs
    signal = np.sin(order * 2 * np.pi * turns + 0.3)
    recording = Recording({"x": signal}, fs, velocity=2 * np.pi * speed)
    orders, spectrum = _spectrum(recording, theta_s=2 * np.pi / n_angles, **options)
    power = spectrum.max() if np.isnan(read_at) else spectrum[np.abs(orders - read_at).argmin()]
    return float(10 * np.log10(power / 0.5))


def _spectrum(
    recording: Recording, scaling: str = "spectrum", **resampling: Any
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return orders and the spectrum of one recording."""
    psd = OrderPSD(8, scaling=scaling)
    (spectrum,) = psd.fit_transform(OrderResampler(**resampling).fit_transform([recording]))
    return psd.orders_, spectrum


def welchs_method() -> dict[str, float]:
    """Compare spectra with those of SciPy, and their integral with the mean square."""
    noise = np.random.default_rng(1).standard_normal(64 * 400)
    tone = 3 * np.sin(7 * 2 * np.pi * np.arange(64 * 200) / 64)
    _, psd = order_psd(noise, 64, revolutions=4)
    _, of_scipy = filters.welch(noise, 64, nperseg=256, detrend="constant")
    whole: dict[str, Any] = {"n_per_segment": len(noise), "window": "boxcar", "detrend": None}
    orders, lines = order_psd(noise, 64, **whole)
    powers = {
        window: order_psd(tone, 64, window=window, scaling="spectrum")[1].max()
        for window in ("hann", "flattop")
    }
    return powers | {
        "scipy": np.abs(psd - of_scipy).max() / of_scipy.max(),
        "parseval": lines.sum() * orders[1] / np.mean(noise**2),
        "noise": 25 * psd[4:-4].mean(),
    }


def order_bins() -> dict[str, float]:
    """Compare bins with the integrals between their edges."""
    ramp = np.arange(0, 10.01, 0.061)[np.newaxis]  # the order step of chapter 3
    notch = BinTransformer(1, max_order=10, order_step=0.061, stop_bands=((5.6, 6.4),))
    bins = notch.fit_transform(ramp)[0]
    flat = BinTransformer(1, max_order=10, order_step=0.5).fit_transform(np.ones((1, 21)))
    noise = np.random.default_rng(2).standard_normal((1, 2048))
    psd = OrderPSD(32, theta_s=2 * np.pi / 64)
    spectrum = psd.fit_transform(noise)
    narrow = BinTransformer(0.3, max_order=32).fit_transform(spectrum)
    integral = trapezoid(np.asarray(spectrum)[0], psd.orders_)
    found = {"stop band": bins[5], "sum": bins.sum()}
    return found | {"flat": flat.min(), "noise": narrow.sum() / integral}


def envelopes() -> dict[str, float]:
    """Detect the envelope of a modulated tone, and compute the spectral kurtosis of a tone."""
    time = np.arange(40_000) / 20_000
    modulated = (1 + 0.5 * np.cos(2 * np.pi * 30 * time)) * np.sin(2 * np.pi * 4000 * time)
    recording = Recording({"x": modulated}, 20_000, velocity=2 * np.pi * 10)
    (envelope,) = EnvelopeDetector((3000, 5000)).fit_transform([recording])
    squared = np.asarray(envelope.signals["x"])[2000:-2000]
    _, powers = order_psd(squared, 20_000, revolutions=1, scaling="spectrum")  # lines of 1 Hz
    hertz, kurtosis = spectral_kurtosis(np.sin(2 * np.pi * 2500 * time), 20_000)
    found = {"line": powers[30], "mean": squared.mean()}
    return found | {"kurtosis": kurtosis[np.abs(hertz - 2500).argmin()]}


def orders_of_faults() -> dict[str, float]:
    """Compare the orders of bearings, gears and motors with published ones."""
    bearing = fault_orders(Bearing(9, 7.94, 39.04))["order"]
    current = fault_orders(Motor(6), {"BPFI": 6.123}, signal="current")["order"]
    return bearing.to_dict() | {
        "wheel": 20 * fault_orders(Gear(8, 42))["order"]["wheel"],
        "planetary": PlanetaryGear(21, 99, 3, 39, driven_by="carrier").output_ratio,
        "current": current["supply+BPFI"],
    }


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


def _pairs(*moments: float) -> tuple[NDArray[np.float64], NDArray[np.str_]]:
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
