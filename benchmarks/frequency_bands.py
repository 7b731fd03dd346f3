"""Order bins or third octaves: the sound of an induction motor; and a second microphone.

Recordings of motor 1 with a hi-fi microphone, 66 of 3 s, below EMACM_DATA (M. Recio, Acoustic and
Vibration Fault Detection in Rotating Machines, Test Results, Apache-2.0), at supplies of 20 to
60 Hz: healthy (with a new bearing, too), unbalance, damaged bearing, broken bar. There is one motor
for each state at a time, so that what separates states may be the assembly. The default settings of
`BandPowers` and of `spectrum_recipe` are used; no feature was chosen on these figures. Orders are
those of the supply frequency, from which the shaft differs by the slip.

**Features.** Balanced accuracy with each recording left out, and with each supply frequency left
out. Beside `CostSensitiveGaussianBayes` (tied covariance, shrinkage "auto") the linear discriminant
analysis and the logistic regression of scikit-learn, on the same features.

**A second microphone** is made from the same recordings: a response that is smooth over frequency
(6 dB of standard deviation, correlated over an octave) and a gain of at most 10 dB, added to the
levels of third octaves. Trained on two thirds of the recordings, tested on the others as heard by
40 such microphones; every second healthy one of the others is given as a baseline, and is not
tested. "unknown": share that is decided to be unknown.

**The check of a baseline.** How often `add_baseline` refuses half of the recordings of a state as
healthy ones: those of a fault should be refused, healthy ones and those of another microphone
not. "not seen" are those for which it warns that a fault would not be seen. The limits of
`add_baseline`, 0.6 and 0.5, were chosen by this table, on motor 1.

Another file of this form, such as motor2_sound.npz, is evaluated as well; the settings were chosen
without it.

    python benchmarks/frequency_bands.py [--json [FILE]] [--quick]
"""

from __future__ import annotations

import argparse
import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from measure import header, json_option, table, write_json
from numpy.typing import NDArray
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import balanced_accuracy_score
from sklearn.model_selection import LeaveOneGroupOut, cross_val_predict
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from threadpoolctl import threadpool_limits

from emacm import (
    CostSensitiveGaussianBayes,
    EmacmWarning,
    FeatureBaseline,
    Recording,
    add_baseline,
    spectrum_recipe,
)

Array = NDArray[np.float64]


def read_motor(file: Path) -> tuple[list[Recording], NDArray[Any], NDArray[Any]]:
    """Return recordings with their states and supply frequencies [Hz]."""
    stored = np.load(file)
    recordings, states, supplies = [], [], []
    for key in (key for key in stored if "|" in key and not key.endswith("/scale")):
        unit, state, device, _, supply = key.split("|")
        sound = stored[key] / stored[f"{key}/scale"]
        recordings.append(
            Recording(
                {"sound": sound},
                float(stored["fs"]),
                velocity=2 * np.pi * float(supply),
                meta={"unit": unit, "device": device},
            )
        )
        states.append("healthy" if state == "new" else state.partition("_")[0].rstrip("24"))
        supplies.append(supply)
    return recordings, np.array(states), np.array(supplies)


def by_features(
    recordings: list[Recording], y: NDArray[Any], supplies: NDArray[Any]
) -> Iterator[dict[str, Any]]:
    """Yield balanced accuracies of features and classifiers."""
    tied = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto")
    classifiers = {
        "emacm": tied,
        "LDA": LinearDiscriminantAnalysis(),
        "logistic regression": make_pipeline(StandardScaler(), LogisticRegression(max_iter=5000)),
    }
    chosen: dict[str, dict[str, Any]] = {
        "order bins up to 20": {"features": "orders"},
        "order bins up to 100": {"features": "orders", "max_order": 100},
        "third octaves": {"features": "bands"},
        "both": {"features": "both"},
        "third octaves up to 2 kHz": {"features": "bands", "high": 2000},
    }
    splits = {"recording left out": np.arange(len(y)), "supply left out": supplies}
    for name, options in chosen.items():
        X = np.asarray(spectrum_recipe(**options)[:-1].fit_transform(recordings))
        for split, groups in splits.items():
            row = {"features": name, "split": split, "columns": X.shape[1], "recordings": len(y)}
            for label, classifier in classifiers.items():
                options = {"groups": groups, "cv": LeaveOneGroupOut()}
                decided = cross_val_predict(classifier, X, y, **options)
                row[label] = float(balanced_accuracy_score(y, decided))
            yield row


class Microphones:
    """Levels of recordings, as rows of a table, also through simulated microphones.

    Parameters
    ----------
    levels : ndarray of shape (n_recordings, n_bands)
        Logarithms of powers.
    seed : int
        Of the choices and of the responses.
    """

    def __init__(self, levels: Array, seed: int) -> None:
        self._levels, self._rng = levels, np.random.default_rng(seed)
        k = np.arange(levels.shape[1])
        smooth = np.exp(-0.5 * ((k[:, np.newaxis] - k) / 3) ** 2) + 1e-6 * np.eye(len(k))
        self._root = np.linalg.cholesky(smooth)

    def some(self, share: float) -> NDArray[np.bool_]:
        """Return a share of the recordings at random."""
        return self._rng.random(len(self._levels)) < share

    def heard(self, rows: Any, unit: str) -> list[Recording]:
        """Return rows of the table as recordings by a microphone; that of "A" is the original."""
        response = 0.6 * self._root @ self._rng.normal(size=len(self._root))
        response += self._rng.uniform(-1, 1)  # of log10: 6 dB, and a gain of 10 dB
        return [
            Recording(
                {"levels": self._levels[row] + (unit == "B") * response},
                1,
                velocity=1.0,
                meta={"unit": unit},
            )
            for row in np.flatnonzero(rows)
        ]


def relative_model(recordings: list[Recording], y: NDArray[Any]) -> Pipeline:
    """Return a fitted model of levels relative to healthy recordings of the unit."""
    levels = FunctionTransformer(lambda X: np.array([run.signals["levels"] for run in X]))
    bayes = spectrum_recipe("bands")[-1]
    groups = {"costsensitivegaussianbayes__groups": np.arange(len(y))}
    return make_pipeline(FeatureBaseline(levels, condition="unit"), bayes).fit(
        recordings, y, **groups
    )


def second_microphone(levels: Array, y: NDArray[Any], n: int) -> Iterator[dict[str, Any]]:
    """Yield what a model decides on recordings by another microphone, before and after."""
    found: dict[str, list[tuple[float, float]]] = {}
    for seed in range(n):
        sound = Microphones(levels, seed)
        train = sound.some(2 / 3)
        model = relative_model(sound.heard(train, "A"), y[train])
        baseline = np.isin(np.arange(len(y)), np.flatnonzero(~train & (y == "healthy"))[::2])
        test = ~train & ~baseline
        other = sound.heard(baseline | test, "B")  # by the same microphone
        is_test = test[baseline | test]
        known = model[0].means_["A"]
        cases = {
            "same microphone": (sound.heard(test, "A"), None),
            "another microphone": ([r for r, use in zip(other, is_test, strict=True) if use], None),
        }
        cases["another microphone, with a baseline"] = (
            cases["another microphone"][0],
            [r for r, use in zip(other, is_test, strict=True) if not use],
        )
        for name, (recordings, healthy) in cases.items():
            model[0].means_["B"], model[0].conditions_ = known, ("A", "B")
            if healthy is not None:
                model[0].add_healthy(healthy)
            decided = model.predict(recordings)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # "unknown" is no true state
                right = balanced_accuracy_score(y[test], decided)
            found.setdefault(name, []).append((right, np.mean(decided == "unknown")))
    for name, values in found.items():
        right, unknown = np.mean(values, axis=0)
        yield {"case": name, "balanced accuracy": float(right), "unknown": float(unknown)}


def refusals(levels: Array, y: NDArray[Any], n: int) -> Iterator[dict[str, Any]]:
    """Yield how often recordings of a state are refused as a baseline."""
    cases = [(state, "A", state) for state in np.unique(y)]
    cases.append(("healthy", "B", "healthy, another microphone"))
    for state, unit, name in cases:
        counts = {"refused": 0, "not seen": 0}
        for seed in range(n):
            sound = Microphones(levels, seed)
            given = sound.some(1 / 2) & (y == state)
            model = relative_model(sound.heard(~given, "A"), y[~given])
            new = sound.heard(given, unit)
            new = [Recording(dict(run.signals), 1, velocity=1.0, meta={"unit": "C"}) for run in new]
            with warnings.catch_warnings():
                warnings.simplefilter("error", EmacmWarning)
                try:
                    add_baseline(model, new)
                except EmacmWarning:
                    counts["not seen"] += 1
                except ValueError:
                    counts["refused"] += 1
        shares = {key: count / n for key, count in counts.items()}
        yield {"baseline of": name} | shares | {"trials": n}


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    json_option(parser)
    parser.add_argument(
        "--quick", action="store_true", help="four trials of each kind, every third recording"
    )
    options = parser.parse_args()
    n = 4 if options.quick else 40
    print(header())
    folder = Path(os.environ.get("EMACM_DATA", "")) / "gear_and_motor"
    files = sorted(folder.glob("motor*_sound.npz"))
    if not files:
        print("no recordings: set EMACM_DATA to the folder of gear_and_motor/motor1_sound.npz")
        return
    rows: list[dict[str, Any]] = []
    for file in files:
        recordings, y, supplies = read_motor(file)
        few = [part[:: 3 if options.quick else 1] for part in (recordings, y, supplies)]
        name = {"motor": file.stem.partition("_")[0]}
        with threadpool_limits(1):
            levels = np.asarray(spectrum_recipe("bands")[:-1].fit_transform(recordings))
            for title, found in (
                ("Features: balanced accuracy", by_features(*few)),
                ("A second microphone", second_microphone(levels, y, n)),
                ("Baselines that are refused", refusals(levels, y, n)),
            ):
                of_title = [name | row for row in found]
                print(f"\n{title}\n{table(of_title)}", flush=True)
                rows += of_title
    write_json(options, rows)


if __name__ == "__main__":
    main()
