"""The model that a command applies: costs, priors and healthy files of its options."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from sklearn.pipeline import Pipeline

from emacm.commands.find import parts_of_options
from emacm.conditions.feature_baseline import FeatureBaseline
from emacm.conditions.router import ConditionRouter
from emacm.decisions.costs import cost_table, truth_priors
from emacm.decisions.pipelines import final_estimator
from emacm.files.folder import RecordingFolder
from emacm.files.layout import Layout, read_table
from emacm.models.baselines import add_baseline
from emacm.models.model_files import load_model
from emacm.models.scoring import check_model
from emacm.recordings.meta import condition_name, read_meta
from emacm.recordings.names import printable


def loaded_model(options: argparse.Namespace, layout: Layout) -> tuple[Any, RecordingFolder | None]:
    """Return the model of a command with its costs, priors, and baseline; and the healthy files.

    Parameters
    ----------
    options : Namespace
        With model, cost, priors, healthy, pattern, bearing and parts.
    layout : Layout
        Of the healthy files.

    Raises
    ------
    TypeError, ValueError
        If costs or priors do not fit the model, or it takes no baseline that a command needs.
    """
    model = load_model(options.model)
    check_model(model)
    set_costs(model, options.cost, options.priors)
    if options.healthy is None:
        return model, None
    folder = RecordingFolder(options.healthy, layout, options.pattern)
    takes_baseline = isinstance(model, Pipeline) and isinstance(model[0], FeatureBaseline)
    if options.command == "report" and not takes_baseline:
        return model, folder
    model = add_baseline(model, folder, parts=parts_of_options(options) or None)
    key = model[0].condition
    for value in dict.fromkeys(read_meta(folder, key)):
        n = model[0].n_healthy_[value]
        text = f"{condition_name(key, value)}: a baseline of {n} healthy files"
        few = "; its own scatter is in every difference: give at least two" if n < 2 else ""
        print(f"emacm: {text}{few}.", file=sys.stderr)
    return model, folder


def set_costs(
    model: Any, cost: Path | None, priors: str | None, labels: Iterable[Any] | None = None
) -> None:
    """Set costs from a table and priors from a text on a model, fitted or not.

    Their names are texts; those of `labels` (default: the classes of the model) may be numbers.

    Raises
    ------
    ValueError
        If they do not fit the model.
    """
    final = final_estimator(model)
    while isinstance(final, ConditionRouter):
        final = final_estimator(final.estimator)
    labels = getattr(model, "classes_", ()) if labels is None else labels
    known = {str(label): label for label in labels}
    if cost is not None:
        table = read_table(cost, index_col=0)
        table.index = table.index.astype(str)
        table = table.rename(known, axis=0).rename(known, axis=1)
        for text in _doubts(table, [*known.values()]):
            print(f"emacm: WARNING: {printable(cost)}: {text}", file=sys.stderr)
        final.set_params(cost=table)
    if priors is not None:
        final.set_params(priors=priors if priors == "uniform" else _priors(priors, known))
    if hasattr(model, "classes_") and hasattr(final, "cost"):
        unknown, n_classes = getattr(final, "unknown", None), len(model.classes_)
        cost_table(final.cost, model.classes_, unknown)
        truth_priors(final.priors, model.classes_, np.ones(n_classes), unknown)


def _doubts(costs: pd.DataFrame, labels: Sequence[Any]) -> Iterator[str]:
    """State decisions that are never made, and wrong ones that cost less than the right one.

    Rows may be other decisions than the classes: families, of which one costs nothing.
    """
    has_classes = costs.index.isin(labels).any()
    for label in costs.columns.intersection(labels):
        column = pd.to_numeric(costs[label], errors="coerce")
        if label not in column:
            if has_classes and column.min() > 0:
                yield f"it has no row for the decision {str(label)!r}, which is then never made."
        elif column.min() < column[label]:
            yield (
                f"if {str(label)!r} is true, deciding {str(column.idxmin())!r} costs "
                f"{column.min():g}, the right decision {column[label]:g}: wrong sign, or rows and "
                f"columns exchanged?"
            )


def _priors(text: str, known: Mapping[str, Any]) -> dict[Any, float]:
    pairs = [part.rpartition("=") for part in text.split(",")]
    try:
        priors = {known.get(n := name.strip(), n): float(value) for name, _, value in pairs}
        if len(priors) < len(pairs):
            raise ValueError(text)
        return priors
    except ValueError as error:
        raise ValueError(
            f"--priors must be 'uniform' or as in healthy=0.9,worn=0.1, each once; got {text!r}."
        ) from error
