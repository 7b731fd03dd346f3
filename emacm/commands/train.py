"""The command ``emacm train``: fit a recipe on a folder, evaluate it, and save the model."""

from __future__ import annotations

import argparse
from math import floor
from typing import Any

import numpy as np
import pandas as pd
from joblib import parallel_config
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm._checks import check_number
from emacm.commands.find import parts_of_options
from emacm.commands.score import set_costs
from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.pipelines import groups_options
from emacm.evaluation.evaluate import evaluate
from emacm.evaluation.results import as_texts
from emacm.files.folder import RecordingFolder
from emacm.files.layout import Layout
from emacm.models.model_files import save_model
from emacm.models.recipes import actuator_recipe, bearing_recipe
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.meta import read_meta
from emacm.reports.facts import healthy_label
from emacm.resampling.order_resampler import OrderResampler


def run(options: argparse.Namespace) -> int:
    """Fit, evaluate and save a model, and print its rates.

    Returns
    -------
    int
        0.
    """
    layout = Layout.from_toml(options.layout)
    recordings = RecordingFolder(options.folder, layout, options.pattern)
    if layout.meta is None:
        raise ValueError(
            f"the layout {options.layout} has no meta, where --labels and --groups are found. Add "
            f"the parts of the names of files such as {recordings.paths[0].name!r}, for example "
            f'meta = "{{unit}}_{{state}}_{{run:d}}".'
        )
    labels = read_meta(recordings, options.labels, role="--labels")
    groups = read_meta(recordings, options.groups, role="--groups")
    healthy = healthy_label(labels, options.healthy, "--healthy")
    max_order, revolutions = extent(recordings, options)
    model = _model(options, max_order, revolutions)
    set_costs(model, options.cost, options.priors)
    orders = "" if options.recipe == "bearing" else f"orders up to {max_order:g}, "
    print(
        f"{len(recordings)} recordings, {len(set(groups))} groups ({options.groups}); "
        f"{options.recipe}: {orders}segments of {revolutions:g} revolutions"
    )
    print(pd.Series(labels).value_counts().sort_index().to_string())
    with parallel_config(n_jobs=options.jobs):
        found = evaluate(model, recordings, labels, units=groups, healthy=healthy)
    print(as_texts(found.table).filter(like=" rate").to_string())
    for caveat in found.caveats:
        print(f"- {caveat}")
    model.fit(recordings, labels, **groups_options(model, groups))
    save_model(model, options.out, note=options.note, healthy=healthy)
    print(f"Model: {options.out}")
    return 0


def extent(
    recordings: RecordingFolder,
    options: argparse.Namespace,
    *,
    most_orders: float = 20.0,
    most_revolutions: float = 16.0,
) -> tuple[float, float]:
    """Return the highest order and the length of a segment [revolutions] that all support."""
    quality = OrderResampler(min_speed=options.min_speed).quality(recordings)
    orders, length = options.max_order, options.revolutions
    if orders is None:
        orders = min(most_orders, floor(8 * quality["max_order"].min()) / 10)
    if length is None:
        longest = float(quality["longest_stroke"].min())
        length = min(most_revolutions, floor(longest / 2) or floor(8 * longest) / 10)
    check_number(orders, "the highest order (--max-order)", above=0)
    return orders, check_number(length, "the length of a segment (--revolutions)", above=0)


def _model(options: argparse.Namespace, max_order: float, revolutions: float) -> Pipeline:
    """Return the unfitted pipeline of a recipe."""
    common: dict[str, Any] = {"revolutions": revolutions, "min_speed": options.min_speed}
    if options.recipe == "actuator":
        return actuator_recipe(max_order=max_order, **common)
    unknown: dict[str, Any] = {"unknown": "unknown", "unknown_rate": 0.02, "temperature": "groups"}
    classifier = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto", **unknown)
    if options.recipe == "bearing":
        return bearing_recipe(parts_of_options(options), classifier=classifier, **common)
    return make_pipeline(*order_levels(max_order, **common), classifier)


def order_levels(
    max_order: float, revolutions: float, min_speed: float, *, oversampled: float = 2.6
) -> list[Any]:
    """Return the steps from recordings to logarithms of the powers in order bins.

    With 2.6 samples per cycle of the highest order, the filter of the resampling is still flat.
    """
    return [
        OrderResampler(2 * np.pi / (oversampled * max_order), min_speed=min_speed),
        OrderPSD(revolutions, max_order=max_order),
        BinTransformer(max(1.0, 2 / revolutions), max_order=max_order),
        FunctionTransformer(np.log10, feature_names_out="one-to-one"),
    ]
