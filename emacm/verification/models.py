"""The evaluation of a model, computed again from the recordings to which it was fitted."""

from __future__ import annotations

import os
from collections.abc import Iterator
from time import perf_counter
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import clone

from emacm._saved import installed_versions
from emacm.decisions.pipelines import groups_options
from emacm.evaluation.evaluate import evaluate
from emacm.files.folder import RecordingFolder
from emacm.models.evidence import evidence_table, training_evidence
from emacm.models.model_files import load_model, model_description
from emacm.recordings.meta import read_meta
from emacm.verification.record import Verification

Row = tuple[str, float, float, float]


def verify_model(path: str | os.PathLike[str], recordings: RecordingFolder) -> Verification:
    """Compute the evidence of a model file again, and compare.

    Parameters
    ----------
    path : str or Path
        A file of ``emacm train``.
    recordings : RecordingFolder
        The training recordings.

    Returns
    -------
    Verification
        Files by their SHA-256, recordings and units of each state, all figures of merit, and the
        posteriors of a model that is fitted again.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file holds no evidence, or none of files.

    Notes
    -----
    Versions of scikit-learn divide units into folds differently if there are more units than
    folds. Figures of merit are those of the file only under the versions that it states.
    """
    start, about = perf_counter(), model_description(path)
    stated = about.get("evidence") or {}
    if not stated.get("files"):
        raise ValueError(
            f"model {path}: it states no training files. Train it by emacm train, from files."
        )
    model = load_model(path)
    labels = read_meta(recordings, stated["labels"], role="--labels")
    groups = read_meta(recordings, stated["groups"], role="--groups")
    found = evaluate(clone(model), recordings, labels, units=groups, healthy=about["healthy"])
    again = training_evidence(
        found,
        labels,
        groups,
        keys=(stated["labels"], stated["groups"]),
        recordings=recordings,
        model=model,
    )
    refit = clone(model).fit(recordings, labels, **groups_options(model, groups))
    posteriors = refit.predict_proba(recordings) - model.predict_proba(recordings)
    rows = [*_files(stated["files"], again["files"]), *_figures(stated, again)]
    rows.append(("posteriors of the model, fitted again", 0, np.abs(posteriors).max(), 1e-6))
    table = pd.DataFrame(rows, columns=["what", "expected", "computed", "tolerance"])
    here = installed_versions()
    other = [f"{name} {v}" for name, v in about["versions"].items() if here.get(name) != v]
    notes = [f"trained under {', '.join(other)}, which may divide units into other folds"]
    source = f"saved {about['saved']}"
    return Verification.of(table.assign(source=source), notes if other else (), start)


def _files(stated: dict[str, str], found: dict[str, str]) -> Iterator[Row]:
    changed = sum(stated[name] != found[name] for name in stated.keys() & found.keys())
    yield "files with another content", 0, changed, 0
    yield "files that are missing", 0, len(stated.keys() - found.keys()), 0
    yield "files that were added", 0, len(found.keys() - stated.keys()), 0


def _figures(stated: dict[str, Any], found: dict[str, Any]) -> Iterator[Row]:
    """Yield the counts of each state, and the figures of each split and family left out."""
    for table in ("states", "rates", "left_out"):
        before, now = (evidence_table(each, table) for each in (stated, found))
        for case, row in before.select_dtypes("number").iterrows():
            for name, value in row.dropna().items():
                computed = now.get(name, {}).get(case, np.nan)
                yield f"{name.replace('_', ' ')}, {before.index.name} {case}", value, computed, 1e-6
        for case in now.index.difference(before.index):
            yield f"{now.index.name} {case}, which the file does not state", 0, 1, 0
