"""The wording of messages, all in one file: `python tests/test_messages.py` writes it anew.

Other tests match only the place that a message names. Here a reader sees whether each message
states what was expected, what was received, where, and the remedy.
"""

import os
import sys
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.calibration import CalibratedClassifierCV
from sklearn.model_selection import cross_val_predict

import emacm
from emacm import (
    Bearing,
    BinTransformer,
    ConditionRouter,
    EnvelopeDetector,
    Layout,
    LeastRiskClassifier,
    OrderPSD,
    OrderResampler,
    Recording,
    open_recording,
)
from emacm import CostSensitiveGaussianBayes as Bayes
from emacm.monitoring import CUSUM, OrderMonitor, RemainingLife

STORED = Path(__file__).with_name("messages.txt")
NOISE = np.random.default_rng(0).normal(size=600)
SPOILT = np.where(np.arange(600) == 7, np.nan, NOISE)
RUN = Recording({"a": NOISE}, 100, velocity=np.where(np.arange(600) < 400, 6.0, -6.0))
ANGLES = OrderResampler(2 * np.pi / 32).fit_transform([RUN])
SPECTRA = OrderPSD(2).fit_transform(ANGLES)
X, Y = np.random.default_rng(1).normal(size=(20, 2)), np.array(["healthy", "worn"] * 10)
FITTED, UNKNOWN = Bayes().fit(X, Y), Bayes(unknown="unknown")


CASES = {
    "Recording: sample that is not finite": lambda: Recording({"a": SPOILT}, 100, velocity=NOISE),
    "Recording: channels of unequal duration": lambda: Recording(
        {"a": NOISE, "b": NOISE[:300]}, 100, velocity=NOISE
    ),
    "Recording: no shaft reference": lambda: Recording({"a": NOISE}, 100),
    "Recording: negative rate": lambda: Recording({"a": NOISE}, -1, velocity=NOISE),
    "Recording: unknown channel": lambda: RUN.select(["b"]),
    "open_recording: no such file": lambda: open_recording("no_such_file.csv", Layout()),
    "angle_from_tacho: no pulse": lambda: emacm.angle_from_tacho(np.zeros(100), 100),
    "EnvelopeDetector: band above Nyquist": lambda: EnvelopeDetector((30, 80)).fit_transform([RUN]),
    "OrderResampler: not recordings": lambda: OrderResampler().fit(["run.csv"]),
    "OrderResampler: empty": lambda: OrderResampler().fit([]),
    "OrderResampler: theta_s": lambda: OrderResampler(-1.0).fit([RUN]),
    "OrderResampler: direction": lambda: OrderResampler(direction="back").fit([RUN]),
    "OrderPSD: strokes too short": lambda: OrderPSD(100).fit_transform(ANGLES),
    "OrderPSD: overlap": lambda: OrderPSD(2, overlap=1.0).fit_transform(ANGLES),
    "BinTransformer: order above the range": lambda: BinTransformer(max_order=40).fit(SPECTRA),
    "BinTransformer: orders removed": lambda: BinTransformer(max_order=8).fit(SPECTRA * 2),
    "CostSensitiveGaussianBayes: cost of no decision": lambda: Bayes(
        {("healthy", "broken"): 2.0}
    ).fit(X, Y),
    "CostSensitiveGaussianBayes: shape of cost": lambda: Bayes(np.eye(3)).fit(X, Y),
    "CostSensitiveGaussianBayes: priors": lambda: Bayes(priors=[-1.0, 2.0]).fit(X, Y),
    "CostSensitiveGaussianBayes: singular": lambda: Bayes(shrinkage=0).fit(np.c_[X, X], Y),
    "CostSensitiveGaussianBayes: unknown without groups": lambda: UNKNOWN.fit(X, Y),
    "LeastRiskClassifier: no probabilities": lambda: LeastRiskClassifier(OrderPSD()).fit(X, Y),
    "LeastRiskClassifier: hidden unknown state": lambda: LeastRiskClassifier(
        CalibratedClassifierCV(UNKNOWN)
    ).fit(X, Y),
    "cross_val_predict: costs by name": lambda: cross_val_predict(
        Bayes({("healthy", "worn"): 2.0}), X, Y, method="predict_proba"
    ),
    "ConditionRouter: no condition": lambda: ConditionRouter(FITTED, "load").fit(
        [RUN] * 4, ["healthy", "worn"] * 2
    ),
    "fault_orders: balls": lambda: emacm.fault_orders(Bearing(0, 5.0, 30.0)),
    "evaluate: one class": lambda: emacm.evaluate(FITTED, X, ["healthy"] * 20, healthy="healthy"),
    "load_model: no such file": lambda: emacm.load_model("no_such_model.skops"),
    "CUSUM: sample that is not finite": lambda: CUSUM(0.5, arl=200).fit([[np.nan], [1.0], [2.0]]),
    "RemainingLife: negative life": lambda: RemainingLife().fit(
        [[1.0, 2.0], [2.0, 3.0]], [-1.0, -2.0], groups=["A", "A"]
    ),
    "OrderMonitor: not fitted": lambda: OrderMonitor(
        OrderPSD(), fs=9, channels=["a"], max_speed=9.0
    ),
    "find_faults: short recording": lambda: emacm.find_faults([RUN.cut(0, 0.1)], Bearing(8, 8, 34)),
}


def outcome(call):
    """Return what a call raises or warns of, or else what it returns."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            result = call()
        except Exception as error:
            return [f"{type(error).__name__}: {error}".replace(f"{Path.cwd()}{os.sep}", "")]
    stated = [f"{item.category.__name__}: {item.message}" for item in caught]
    if isinstance(result, pd.DataFrame):
        stated += result.get("explanation", pd.Series(dtype=object)).tolist()
    return stated


def messages():
    """Return all messages, each under its case."""
    return "\n".join("\n    ".join([name, *outcome(call)]) for name, call in CASES.items()) + "\n"


def test_every_message_is_as_it_was_read():
    assert messages() == STORED.read_text(encoding="utf-8")


if __name__ == "__main__":
    STORED.write_text(messages(), encoding="utf-8")
    sys.stdout.write(messages())
