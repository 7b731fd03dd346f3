"""Evidence of a model: the recordings it was fitted to, and its decisions on those held out."""

from __future__ import annotations

import json
import warnings
from collections.abc import Sequence
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd

from emacm.decisions.pipelines import fitted_resamplers
from emacm.evaluation.evaluate import Evaluation
from emacm.evaluation.novelty import evaluate_unknown
from emacm.files.folder import RecordingFolder
from emacm.findings.training_range import CONDITIONS
from emacm.recordings.digests import digest_of_file
from emacm.resampling.order_resampler import OrderResampler


def training_evidence(
    found: Evaluation,
    labels: Sequence[Any],
    groups: Sequence[Any],
    *,
    keys: tuple[str, str],
    recordings: RecordingFolder | None = None,
    model: Any = None,
    intended_use: str | None = None,
    limits: str | None = None,
) -> dict[str, Any]:
    """Return what a model file states about training and evaluation, as JSON can hold it.

    Parameters
    ----------
    found : Evaluation
        Of the model, by unit.
    labels, groups : sequence of shape (n_recordings,)
        State and unit of each recording.
    keys : tuple of str
        The keys of `meta` with state and unit.
    recordings : RecordingFolder, optional
        The recordings. None: the model was fitted to features that were stored.
    model : estimator, optional
        The fitted model, whose resampler states the speeds.
    intended_use, limits : str, optional
        As stated by the user.

    Returns
    -------
    dict
        "intended_use", "limits", "labels" and "groups" (the keys), "pattern", "files" (their
        SHA-256 by name), "caveats"; and tables, to be read by `evidence_table`: "states"
        (recordings and units of each), "rates" (figures of merit of each split, with intervals),
        "confusion" and "calibration" (whole units held out), "left_out" (each family of faults left
        out of training in turn, see `evaluate_unknown`) and "domain" (`operating_points`).
    """
    counted = pd.DataFrame({"state": labels, "unit": groups}).groupby("state")["unit"]
    calibration = found.calibration
    if len(calibration):
        calibration = calibration[calibration["scheme"] == "by unit"].drop(columns="scheme")
    tables = {
        "states": counted.agg(recordings="size", units="nunique").reset_index(),
        "rates": found.table.reset_index(names="split"),
        "confusion": found.confusions.get("by unit", pd.DataFrame()).reset_index(),
        "calibration": calibration.reset_index(drop=True),
    }
    stated: dict[str, Any] = {"pattern": None, "files": {}}
    caveats = list(found.caveats)
    if recordings is not None:
        tables["left_out"], further = _left_out(found, model, recordings, labels, groups)
        caveats += further
        tables["domain"] = operating_points(recordings, labels, model)
        names = [path.relative_to(recordings.folder).as_posix() for path in recordings.paths]
        digests = dict(zip(names, map(digest_of_file, recordings.paths), strict=True))
        stated = {"pattern": recordings.pattern, "files": digests}
    as_json = {name: table.to_json(orient="split", index=False) for name, table in tables.items()}
    return {
        "intended_use": intended_use,
        "limits": limits,
        "labels": keys[0],
        "groups": keys[1],
        **stated,
        "caveats": caveats,
        **{name: json.loads(text) for name, text in as_json.items()},
    }


def _left_out(
    found: Evaluation, model: Any, recordings: Any, labels: Sequence[Any], groups: Sequence[Any]
) -> tuple[pd.DataFrame, list[str]]:
    """Return how families of faults left out of training are recognised, and caveats.

    The steps before the classifier are those of the model.
    """
    if found.scoring.unknown is None:
        return pd.DataFrame(), []
    features = np.asarray(model[:-1].transform(recordings))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # as for all families
        classifier, healthy = model[-1], found.scoring.healthy
        result = evaluate_unknown(classifier, features, labels, units=groups, healthy=healthy)
    return result.table.rename_axis("family").reset_index(), result.caveats


def evidence_table(evidence: dict[str, Any], name: str) -> pd.DataFrame:
    """Return a table of `training_evidence` by its first column; empty if it is not stated."""
    table = pd.DataFrame(**evidence.get(name, {}))
    return table.set_index(table.columns[0]) if len(table.columns) else table


def operating_points(recordings: Any, labels: Sequence[Any], model: Any = None) -> pd.DataFrame:
    """Return the operating conditions of recordings.

    Parameters
    ----------
    recordings : sequence of Recording
        With meta.
    labels : sequence of shape (n_recordings,)
        State of each.
    model : estimator, optional
        A fitted model, whose first resampler states the speeds.

    Returns
    -------
    DataFrame
        One row for each recording: "state", "slowest" and "fastest" speed in strokes [rad/s], and
        those conditions, and "severity", that all `meta` state as numbers.

    Examples
    --------
    >>> from emacm import Recording
    >>> run = Recording({"x": [1.0, 2.0]}, 10, velocity=3.0, meta={"load": 40, "run": 1})
    >>> operating_points([run], ["worn"]).to_dict("records")
    [{'state': 'worn', 'slowest': 3.0, 'fastest': 3.0, 'load': 40}]
    """
    resampler = next(iter(fitted_resamplers(model)), None) or OrderResampler()
    speeds = resampler.quality(recordings)[["slowest", "fastest"]]
    points = pd.DataFrame({"state": list(labels)}).join(speeds)
    metas = [recording.meta for recording in recordings]
    for name in (*CONDITIONS, "severity"):
        if all(isinstance(meta.get(name), Real) for meta in metas):
            points[name] = [meta[name] for meta in metas]
    return points
