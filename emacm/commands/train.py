"""The command ``emacm train``: fit a recipe on a folder, evaluate it, and save the model."""

from __future__ import annotations

import argparse
import re
import sys
import warnings
from collections.abc import Iterator, Sequence
from math import floor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from joblib import parallel_config
from sklearn.base import clone
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm._checks import check_number
from emacm.commands.find import parts_of_options
from emacm.commands.score import set_costs
from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.pipelines import final_estimator, groups_options
from emacm.evaluation.comparison import compare
from emacm.evaluation.evaluate import evaluate
from emacm.evaluation.results import Evaluation, as_texts
from emacm.files.folder import RecordingFolder
from emacm.files.layout import Layout
from emacm.history.sqlite_history import History
from emacm.machine.bearing_recipe import bearing_recipe
from emacm.machine.fault_orders import fault_series
from emacm.models.evidence import training_evidence
from emacm.models.model_files import load_model, save_model
from emacm.models.recipes import actuator_recipe
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.digests import model_digest
from emacm.recordings.names import printable
from emacm.reports.facts import healthy_label
from emacm.reports.inputs import meta_value
from emacm.resampling.order_resampler import OrderResampler


def run(options: argparse.Namespace) -> int:
    """Fit, evaluate and save a model, and print its rates.

    Returns
    -------
    int
        0.
    """
    layout = Layout.from_toml(options.layout)
    if options.like is None:
        X: Any = RecordingFolder(options.folder, layout, options.pattern)
        paths = X.paths
    else:
        old = load_model(options.like)
        paths, X = _stored_features(old, options)
    labels, groups = (
        [meta_value(Path(path), layout, key) for path in paths]
        for key in (options.labels, options.groups)
    )
    for text in _alike(labels):
        print(f"emacm: WARNING: {text}", file=sys.stderr)
    healthy = healthy_label(labels, options.healthy, "--healthy")
    model = _recipe(X, options) if options.like is None else clone(old[-1])
    set_costs(model, options.cost, options.priors, labels)
    print(f"{len(labels)} recordings, {len(set(groups))} groups ({options.groups})")
    print(pd.Series(labels).value_counts().sort_index().to_string())
    with parallel_config(n_jobs=options.jobs):
        evaluation = evaluate(model, X, labels, units=groups, healthy=healthy)
    for caveat in evaluation.caveats:
        print(f"- {caveat}")
    model.fit(X, labels, **groups_options(model, groups))
    _print_rates(final_estimator(model), evaluation)
    keys = (options.labels, options.groups)
    stated = {"keys": keys, "intended_use": options.intended_use, "limits": options.limits}
    if options.like is None:
        _print_channels(model, X, labels, groups, evaluation)
        stated |= {"recordings": X, "model": model}
    else:
        print("- The range of the training and its spectral lines are those of the first training.")
        model = Pipeline([*old.steps[:-1], (old.steps[-1][0], model)])
    evidence = training_evidence(evaluation, labels, groups, **stated)
    save_model(model, options.out, note=options.note, healthy=healthy, evidence=evidence)
    print(f"Model: {options.out}")
    return 0


def _alike(labels: Sequence[Any]) -> Iterator[str]:
    """State labels that are probably one."""
    spelled: dict[str, str] = {}
    for label in dict.fromkeys(map(str, labels)):
        other = spelled.setdefault(label.strip().casefold(), label)
        if other != label:
            yield f"the states {other!r} and {label!r} differ in case or spaces only: are they one?"


def _stored_features(model: Pipeline, options: argparse.Namespace) -> tuple[list[str], Any]:
    """Return names of recordings, and the features that the model has stored in a history."""
    history, made_by = History(options.folder), model_digest(model[:-1])
    names, features = history.features(made_by, model[-1].n_features_in_)
    if not names:
        raise ValueError(
            f"{options.folder} has no features of the model {options.like}: run emacm score with "
            f"--features."
        )
    return names, features


def _print_rates(classifier: Any, evaluation: Evaluation) -> None:
    """Print costs and priors in force, the rates with their yardsticks, and the confusions."""
    costs = pd.DataFrame(classifier.cost_, classifier.decisions_, classifier.truths_)
    print("\nCosts (rows: decisions, columns: true states), and priors of the states:")
    print(costs.rename_axis("decision").to_string())
    priors = zip(classifier.classes_, classifier.priors_, strict=True)
    print(", ".join(f"{state}: {prior:.3g}" for state, prior in priors))
    print("\nRecordings held out:")
    print(as_texts(evaluation.table).filter(regex=" rate|realised cost").to_string())
    print("Cost of the same decision for every recording:")
    constant = evaluation.constant_costs["realised_cost"]
    print(constant.round(3).to_string())
    if evaluation.table.loc["by unit", "realised_cost"] >= constant.iloc[0]:
        print(f"- On new units the model is no better than {constant.index[0]}.")
    print("Whole units held out, decisions (rows) and true states (columns):")
    print(evaluation.confusions["by unit"].to_string())


def _print_channels(
    model: Pipeline,
    recordings: RecordingFolder,
    labels: Sequence[Any],
    groups: Sequence[Any],
    evaluation: Evaluation,
) -> None:
    """Print what the decisions on whole units cost without each channel, and warn if less."""
    channels, healthy = recordings[0].channels, evaluation.scoring.healthy
    if len(channels) < 2:
        return
    features = np.asarray(model[:-1].transform(recordings))
    # The longest name first: "drive" is also the beginning of "drive end".
    longest_first = "|".join(map(re.escape, sorted(channels, key=len, reverse=True)))
    of_channel = re.compile(rf"(?:^|\*)({longest_first})(?!\w)")
    channels_of = [of_channel.findall(name) for name in model[:-1].get_feature_names_out()]
    evaluations = {"all channels": evaluation}
    for channel in channels:
        kept = [channel not in own for own in channels_of]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # as for all channels
            part = evaluate(model[-1], features[:, kept], labels, units=groups, healthy=healthy)
        evaluations[f"without {channel}"] = part
    compared = compare(evaluations, scheme="by unit")
    print("Channels, whole units held out:")
    print(compared.summary().filter(regex=" rate|realised cost").to_string())
    differences = compared.differences.filter(regex="^realised_cost")
    print("Difference of the cost from that with all channels:")
    print(as_texts(differences).to_string())
    for name, highest in differences["realised_cost_high"].items():
        if highest < 0:
            print(f"- {str(name).capitalize()} the decisions cost less: name the other channels.")


def extent(recordings: RecordingFolder, options: argparse.Namespace) -> tuple[float, float, float]:
    """Return highest order, length of a segment [revolutions], and highest order of all files.

    By default at most 4 times the highest order of the parts, or order 20 if they are not known;
    and 16 revolutions, which separate lines 1/8 of an order apart.

    Defects of files, and the file with the lowest of the highest orders, are printed to stderr.

    Raises
    ------
    ValueError
        If a file has no orders, or not up to --max-order.
    """
    coarse = OrderResampler(np.pi / 2, min_speed=options.min_speed)
    quality = coarse.quality(recordings)
    orders, length = options.max_order, options.revolutions
    for path, row in zip(map(printable, recordings.paths), quality.itertuples(), strict=True):
        if not row.revolutions > 0:
            raise ValueError(
                f"{path}: the shaft is at rest, or never above --min-speed. Leave the file out."
            )
        if row.warnings:
            print(f"emacm: WARNING: {path}: {row.warnings}", file=sys.stderr)
        if orders is not None and orders > row.max_order:
            raise ValueError(
                f"{path} has no content above order {row.max_order:.4g}. Lower --max-order."
            )
    supported = floor(8 * quality["max_order"].min()) / 10
    if orders is None:
        parts = parts_of_options(options)
        lines = fault_series(parts, 1) if parts else ()
        orders = min(4 * max((line.orders[0] for line in lines), default=5.0), supported)
        if orders == supported:
            least = recordings.paths[int(quality["max_order"].argmin())]
            print(f"The highest order, {orders:g}, is that of {printable(least)}.", file=sys.stderr)
    if length is None:
        longest = float(quality["longest_stroke"].min())
        length = min(16.0, floor(longest / 2) or floor(8 * longest) / 10)
    check_number(orders, "the highest order (--max-order)", above=0)
    check_number(length, "the length of a segment (--revolutions)", above=0)
    return orders, length, supported


def _recipe(recordings: RecordingFolder, options: argparse.Namespace) -> Pipeline:
    """Return the unfitted pipeline of a recipe, and print up to which order it looks."""
    max_order, revolutions, supported = extent(recordings, options)
    orders = "" if options.recipe == "bearing" else f"orders up to {max_order:g}, "
    if orders and max_order < supported:
        orders += f"the files support {supported:g} (if states are confused, raise --max-order), "
    print(f"{options.recipe}: {orders}segments of {revolutions:g} revolutions")
    common: dict[str, Any] = {"revolutions": revolutions, "min_speed": options.min_speed}
    if options.recipe == "actuator":
        return actuator_recipe(max_order=max_order, **common)
    unknown: dict[str, Any] = {"unknown": "unknown", "unknown_rate": 0.02, "temperature": "groups"}
    classifier = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto", **unknown)
    if options.recipe == "bearing":
        return bearing_recipe(parts_of_options(options), classifier=classifier, **common)
    return make_pipeline(*order_levels(max_order, **common), classifier)


def order_levels(max_order: float, revolutions: float, min_speed: float) -> list[Any]:
    """Return the steps from recordings to logarithms of the powers in order bins.

    With 2.6 samples per cycle of the highest order, the filter of the resampling is still flat.
    """
    return [
        OrderResampler(2 * np.pi / (2.6 * max_order), min_speed=min_speed),
        OrderPSD(revolutions, max_order=max_order),
        BinTransformer(max(1.0, 2 / revolutions), max_order=max_order),
        FunctionTransformer(np.log10, feature_names_out="one-to-one"),
    ]
