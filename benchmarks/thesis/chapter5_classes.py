"""Isolation of faults by single signals, fusion, cross spectra, and numbers of units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd
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
INSPECTIONS = (0.5, 0.2, 0.1)  # costs of an inspection, relative to a wrong decision; assumed
_NOVELTY_SIGNALS = ("current_a", "accelerometer")
AREA, FLAGGED = "area under the ROC curve", "unknown, flagged [%]"
_CHANCE = 0.5
_RATES = {
    "balanced_accuracy": "balanced accuracy [%]",
    "false_alarm_rate": "false alarms [%]",
    "inspection_rate": "inspections of healthy [%]",
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
    table = pd.DataFrame(found).T.rename_axis("features")
    return table.drop(columns=_RATES["inspection_rate"])  # which no decision asks for


def inspection_table(rows: Features) -> pd.DataFrame:
    """Fuse the features of all signals, with the further decision to inspect a unit.

    Parameters
    ----------
    rows : Features
        Result of `labelled_rows`.

    Returns
    -------
    DataFrame
        One row per cost of an inspection: balanced accuracy, false alarm rate, share of healthy
        recordings that are inspected, and missed detection rate [%], as in `fusion_table`.
    """
    labels, found = pd.unique(rows.frame["label"]), {}
    for cost in INSPECTIONS:
        model = classifier(cost={("inspect", label): cost for label in labels})
        found[f"{cost:g}"] = _by_unit(model, rows.joint(), rows.frame)
    return pd.DataFrame(found).T.rename_axis("cost of an inspection")


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
    """Compare training with one unit per class, as in the thesis, with training with several.

    Every unit is tested once; the training units are the next ones in a circle.

    Returns
    -------
    DataFrame
        One row per number of training units: balanced accuracy and false alarm rate [%] as the
        mean over the tested units, with the lowest and the highest.
    """
    table, frame = rows.joint(), rows.frame
    units = np.unique(frame["unit"])
    found: dict[int, Mapping[str, str]] = {}
    for number in [n for n in (1, 2, 4, len(units) - 1) if n < len(units)]:
        scores = []
        for place, tested in enumerate(units):
            trained = np.roll(units, -place - 1)[:number]
            training, test = frame["unit"].isin(trained), frame["unit"] == tested
            model = classifier().fit(table[training], frame["label"][training])
            decisions, truth = model.predict(table[test]), frame["label"][test].to_numpy()
            alarms = np.mean(decisions[truth == "healthy"] != "healthy")
            scores.append((balanced_accuracy_score(truth, decisions), alarms))
        accuracy, alarm = 100 * np.array(scores).T
        found[number] = {
            f"{words} [%]": f"{v.mean():.0f} ({v.min():.0f} to {v.max():.0f})"
            for words, v in (("balanced accuracy", accuracy), ("false alarms", alarm))
        }
    return pd.DataFrame(found).T.rename_axis("training units of each class")


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
            FLAGGED: (100 * novelty["unknown_flagged"]).round(),
            "unknown, decided healthy [%]": (100 * novelty["unknown_called_healthy"]).round(),
        }
    )


def unknown_remark(table: pd.DataFrame) -> str:
    """Name the faults of an `unknown_table` that are not recognised.

    Examples
    --------
    >>> table = pd.DataFrame({AREA: [0.43, 0.97], "low": [0.3, 0.9], FLAGGED: [0.0, 8.0]})
    >>> unknown_remark(table.set_axis(["cage", "ball"])).split(":")[0]
    'Not recognised as unknown are cage (0.43)'
    """
    chance = table[~(table["low"] > _CHANCE)]
    never = table.index[table[FLAGGED] == 0]
    missed = _listed(f"{name} ({area:.2f})" for name, area in chance[AREA].items())
    return (
        f"Not recognised as unknown are {missed}: with them left out of training, the 95 % "
        "interval of the area under the ROC curve of the typicality contains 0.5, that of chance, "
        "or lies below it. At a typicality of at most 0.01, no recording is flagged of "
        f"{_listed(never)}. What is not recognised is decided to be healthy or another fault."
    )


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"
