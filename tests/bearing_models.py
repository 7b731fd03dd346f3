"""Recordings of a bearing with known lines, and models of them, for the tests of reports."""

from functools import cache

import numpy as np
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm import (
    Bearing,
    BinTransformer,
    CostSensitiveGaussianBayes,
    OrderPSD,
    OrderResampler,
    Recording,
)

FS, N, SPEED = 2000, 9000, 110.0  # 78.8 revolutions
BEARING = Bearing(9, 7.94, 39.04, name="drive end")
LINES = {"healthy": None, "outer race": 3.5848, "inner race": 5.4152}
STATES = np.array([*LINES] * 8)
COST = {("healthy", "outer race"): 10, ("healthy", "inner race"): 10} | {
    ("inspect", state): 0.3 for state in LINES
}


def recording(state, seed, *, order=None, gain=1.0, n=N, meta=None, units=None):
    """Return noise in two channels, with three lines of a fault in the first one.

    In volts and amperes, by default, no envelope is searched for the lines of parts.
    """
    rng = np.random.default_rng(seed)
    angle = SPEED * np.arange(n) / FS
    wave = rng.normal(size=n) + 0.4 * np.sin(angle)
    order = LINES[state] if order is None else order
    for k in (1, 2, 3) if order else ():
        amplitude = 0.6 * (1 + 0.05 * rng.normal())
        wave += amplitude * np.sin(0.995 * k * order * angle + rng.uniform(0, 6))
    signals = {"vib": gain * wave, "amps": 2 + rng.normal(size=n)}
    units = {"vib": "V", "amps": "A"} if units is None else units
    return Recording(signals, FS, velocity=SPEED, units=units, meta=meta or {})


@cache
def runs():
    """Return 24 training recordings, in the order of `STATES`."""
    return [recording(state, seed) for seed, state in enumerate(STATES)]


def steps(*between, table=None, bayes=None, theta_s=2 * np.pi / 44):
    """Return the steps of a pipeline, by default with order bins."""
    table = BinTransformer(0.5, max_order=17) if table is None else table
    if bayes is None:
        options = {"covariance": "tied", "shrinkage": "auto"}
        bayes = CostSensitiveGaussianBayes(COST, unknown="unknown", temperature="groups", **options)
    return [OrderResampler(theta_s), OrderPSD(16, max_order=17), table, *between, bayes]


def fitted(model):
    """Return a pipeline fitted on the training recordings."""
    name = model.steps[-1][0]
    groups = np.arange(len(STATES)) // 3
    options = {f"{name}__groups": groups} if getattr(model[-1], "unknown", None) else {}
    return model.fit(runs(), STATES, **options)


@cache
def bins_model():
    """Return a fitted model of the logarithms of order bins."""
    return fitted(make_pipeline(*steps(FunctionTransformer(np.log10))))
