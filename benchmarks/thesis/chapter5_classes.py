"""Isolation of faults by single signals, fusion, cross spectra, and numbers of units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from laboratory import FAULTS
from sklearn.compose import make_column_transformer
from sklearn.metrics import balanced_accuracy_score
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler

from chapter4_spectra import SIGNALS
from chapter5_data import Features
from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.posterior_product import PosteriorProduct
from emacm.evaluation.evaluate import evaluate
from emacm.evaluation.novelty import evaluate_unknown

LOWEST = 0.4  # severity: what is not detected cannot be isolated
_NOVELTY_SIGNALS = ("current_a", "accelerometer")
AREA, HEALTHY = "area under the ROC curve", "unknown, decided healthy [%]"
_CHANCE = 0.5
_RATES = {
    "balanced_accuracy": "balanced accuracy [%]",
    "false_alarm_rate": "false alarms [%]",
    "missed_detection_rate": "missed detections [%]",
}


def labelled_rows(features: Features) -> Features:
    """Return the recordings of the tested units: healthy, or with a severity of at least 0.4."""
    frame = features.frame
    known = (frame["label"] == "healthy") | (frame["severity"] >= LOWEST)
    return features.rows((frame["role"] == "tested") & known)


def classifier(**options: Any) -> Pipeline:
    """Return a Gaussian classifier with one covariance for all classes and equal priors."""
    return make_pipeline(
        StandardScaler(),
        CostSensitiveGaussianBayes(
            priors="uniform", covariance="tied", shrinkage="auto", **options
        ),
    )


def fusion_table(rows: Features) -> pd.DataFrame:
    """Compare single signals, fusion of decisions and of features, and cross spectra.

    Parameters
    ----------
    rows : Features
        Result of `labelled_rows`.

    Returns
    -------
    DataFrame
        One row per set of features: balanced accuracy (11 classes), false alarm rate and missed
        detection rate [%], on units that were not in training, with 95 % intervals over units.
    """
    joint = rows.joint()
    members = [(name, _of_columns(list(table.columns))) for name, table in rows.spectra.items()]
    candidates: dict[str, tuple[Any, pd.DataFrame]] = {
        SIGNALS[name]: (classifier(), table) for name, table in rows.spectra.items()
    }
    candidates |= {
        "fusion of decisions (PosteriorProduct)": (
            PosteriorProduct(members, priors="uniform"),
            joint,
        ),
        "fusion of features: all auto spectra": (classifier(), joint),
        "cross spectra: coherence and frequency response": (classifier(), rows.cross),
        "auto and cross spectra": (classifier(), pd.concat([joint, rows.cross], axis=1)),
    }
    found = {
        name: _by_unit(model, table, rows.frame) for name, (model, table) in candidates.items()
    }
    return pd.DataFrame(found).T.rename_axis("features")


def _of_columns(columns: list[str]) -> Pipeline:
    return make_pipeline(make_column_transformer(("passthrough", columns)), classifier())


def _by_unit(model: Any, table: pd.DataFrame, frame: pd.DataFrame) -> dict[str, str]:
    result = evaluate(
        model,
        table,
        frame["label"].to_numpy(),
        units=frame["unit"].to_numpy(),
        healthy="healthy",
        n_splits=frame["unit"].nunique(),
    )
    row = result.table.loc["by unit"]
    return {
        words: f"{100 * row[name]:.0f} ({100 * row[f'{name}_low']:.0f} to "
        f"{100 * row[f'{name}_high']:.0f})"
        for name, words in _RATES.items()
    }


def units_table(rows: Features) -> pd.DataFrame:
    """Compare designs of the training: which units have which faults.

    Every unit is tested once, by units that follow it in a circle. In the thesis' design each class
    is recorded on a unit of its own (with more classes than units, some share one).

    Returns
    -------
    DataFrame
        One row per design: balanced accuracy and false alarm rate [%] as the mean over the tested
        units, with the lowest and the highest.
    """
    units, labels = np.unique(rows.frame["unit"]), list(pd.unique(rows.frame["label"]))
    n_others = len(units) - 1
    designs: dict[str, Mapping[str, Sequence[int]]] = {
        "another unit for each class": {
            label: (place % n_others,) for place, label in enumerate(labels)
        },
        "healthy: one unit; all faults: another one": {
            label: (0 if label == "healthy" else 1,) for label in labels
        },
    }
    for number in [n for n in (1, 2, 4, n_others) if n <= n_others]:
        designs[f"{number} with every class"] = dict.fromkeys(labels, range(number))
    table = pd.DataFrame(
        {name: _tested_by(rows, rows.joint(), design) for name, design in designs.items()}
    )
    return table.T.rename_axis("training units")


def _tested_by(
    rows: Features, table: pd.DataFrame, design: Mapping[str, Sequence[int]]
) -> dict[str, str]:
    """Train with the units of a design, given as places after the tested unit."""
    frame, units, scores = rows.frame, np.unique(rows.frame["unit"]), []
    for place, tested in enumerate(units):
        others = np.roll(units, -place)[1:]
        pairs = {(others[k], label) for label, places in design.items() for k in places}
        training = [pair in pairs for pair in zip(frame["unit"], frame["label"], strict=True)]
        test = frame["unit"] == tested
        model = classifier().fit(table[training], frame["label"][training])
        decisions, truth = model.predict(table[test]), frame["label"][test].to_numpy()
        alarms = np.mean(decisions[truth == "healthy"] != "healthy")
        scores.append((balanced_accuracy_score(truth, decisions), alarms))
    accuracy, alarm = 100 * np.array(scores).T
    return {
        f"{words} [%]": f"{v.mean():.0f} ({v.min():.0f} to {v.max():.0f})"
        for words, v in (("balanced accuracy", accuracy), ("false alarms", alarm))
    }


def pairs_table(features: Features) -> pd.DataFrame:
    """Decide recordings with two faults, and of one, by a classifier of single ones.

    It is trained on half of the tested units; the recordings are of other units.

    Returns
    -------
    DataFrame
        One row per pair of faults, and one of all single ones: shares of the recordings [%] of
        which one fault is decided, all are named, and one is named that is not there. A second
        fault is named by `CostSensitiveGaussianBayes.second_states`.
    """
    known, single = labelled_rows(features), features.frame["label"].isin(FAULTS)
    units = np.unique(known.frame["unit"])
    known = known.rows(known.frame["unit"].isin(units[: (len(units) + 1) // 2]))
    others = ~features.frame["unit"].isin(known.frame["unit"]) & single
    others &= (features.frame["role"] == "tested") & (features.frame["severity"] >= LOWEST)
    seen = features.rows(others | (features.frame["role"] == "pairs"))
    model = classifier().fit(
        known.joint(),
        known.frame["label"],
        costsensitivegaussianbayes__groups=known.frame["unit"].to_numpy(),
    )
    decisions = model.predict(seen.joint())
    seconds = model[-1].second_states(model[:-1].transform(seen.joint()), decisions)
    rows = []
    for label, *named in zip(seen.frame["label"], decisions, seconds, strict=True):
        true, named = set(label.split(" + ")), {name for name in named if name}
        rows.append(
            (
                label if len(true) > 1 else "one fault",
                len(true & named) > 0,
                true <= named,
                not named <= true,
            )
        )
    columns = ["faults", "one named [%]", "all named [%]", "another one named [%]"]
    return 100 * pd.DataFrame(rows, columns=columns).groupby("faults").mean()


def unknown_table(rows: Features) -> pd.DataFrame:
    """Leave each fault out of training, and state whether it is recognised as unknown.

    Returns
    -------
    DataFrame
        One row per fault left out: area under the ROC curve of the typicality and its 95 %
        interval over units, shares of the known and of the unknown recordings with a typicality of
        at most 0.01, and of unknown ones decided to be healthy [%].
    """
    table = pd.concat([rows.spectra[name] for name in _NOVELTY_SIGNALS], axis=1)
    result = evaluate_unknown(
        classifier(unknown="unknown"),
        table,
        rows.frame["label"].to_numpy(),
        units=rows.frame["unit"].to_numpy(),
        healthy="healthy",
        n_splits=4,
    )
    novelty = result.table.rename_axis("fault left out")
    return pd.DataFrame(
        {
            AREA: novelty["auroc"].round(2),
            "low": novelty["auroc_low"].round(2),
            "high": novelty["auroc_high"].round(2),
            "known, flagged [%]": (100 * novelty["known_flagged"]).round(),
            "unknown, flagged [%]": (100 * novelty["unknown_flagged"]).round(),
            HEALTHY: (100 * novelty["unknown_called_healthy"]).round(),
        }
    )


def unknown_remark(table: pd.DataFrame) -> str:
    """Name the faults of an `unknown_table` that are not recognised, or decided to be healthy.

    Examples
    --------
    >>> columns = {AREA: [0.43, 0.97], "low": [0.3, 0.9], HEALTHY: [96.0, 8.0]}
    >>> unknown_remark(pd.DataFrame(columns, index=["cage", "ball"])).split(".")[-2]
    ' Decided to be healthy are most of cage (96 %)'
    """
    chance = table[~(table["low"] > _CHANCE)]
    missed = _listed(f"{name} ({area:.2f})" for name, area in chance[AREA].items())
    silent = table[HEALTHY][table[HEALTHY] > 100 * _CHANCE]
    return (
        f"Not recognised as unknown are {missed}: with them left out of training, the 95 % "
        "interval of the area under the ROC curve of the typicality contains .5, that of chance, "
        "or lies below it. Decided to be healthy are most of "
        f"{_listed(f'{name} ({share:.0f} %)' for name, share in silent.items())}."
    )


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"
