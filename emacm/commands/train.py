"""The command ``emacm train``: fit a recipe on a folder, evaluate it, and save the model."""

from __future__ import annotations

import argparse
import re
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext, redirect_stdout
from math import floor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from joblib import parallel_config
from numpy.typing import NDArray
from sklearn.base import clone
from sklearn.pipeline import Pipeline, make_pipeline

from emacm.commands.find import parts_of_options
from emacm.commands.loaded_model import set_costs
from emacm.conditions.feature_baseline import FeatureBaseline, left_out_differences
from emacm.decisions.pipelines import final_estimator
from emacm.evaluation.comparison import compare
from emacm.evaluation.evaluate import Evaluation, as_texts, evaluate
from emacm.files.folder import RecordingFolder
from emacm.files.layout import Layout
from emacm.history.sqlite_history import History
from emacm.machine.bearing_recipe import bearing_recipe
from emacm.machine.fault_orders import fault_series
from emacm.models.baselines import evaluated_and_fitted
from emacm.models.evidence import training_evidence
from emacm.models.model_files import load_model, save_model
from emacm.models.recipes import actuator_recipe, recipe_classifier, spectrum_recipe
from emacm.recordings.digests import model_digest
from emacm.recordings.meta import read_meta
from emacm.recordings.names import printable
from emacm.reports.facts import healthy_label
from emacm.reports.inputs import meta_value
from emacm.reports.model_cards import describe_model
from emacm.reports.written_pages import written_record
from emacm.resampling.order_resampler import OrderResampler


def run(options: argparse.Namespace) -> int:
    """Fit, evaluate and save a model, and print its rates, or its card as JSON.

    Returns
    -------
    int
        0.
    """
    with redirect_stdout(sys.stderr) if options.json else nullcontext():
        _train(options)
    if options.json:
        print(written_record(describe_model(options.out), None, as_json=True))
    return 0


def _train(options: argparse.Namespace) -> None:
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
    print(f"{len(labels)} recordings, {len(set(groups))} groups ({options.groups})")
    print(pd.Series(labels).value_counts().sort_index().to_string())
    tried: list[tuple[float, Any]] = []  # realised cost on new units, and what was found
    for model in [clone(old[-1])] if options.like else _recipes(X, options):
        if not tried:  # a second recipe takes the classifier of the first one
            set_costs(model, options.cost, options.priors, labels)
        if options.baseline is not None:
            relative = FeatureBaseline(model[:-1], condition=options.baseline, healthy=healthy)
            model = make_pipeline(relative, model[-1])
        with parallel_config(n_jobs=options.jobs):
            found = evaluated_and_fitted(model, X, labels, groups, healthy)
        tried.append((found[0].table.loc["by unit", "realised_cost"], found))
        if tried[-1][0] == 0:
            break
    if len(tried) > 1:
        costs = " and ".join(f"{cost:.3g}" for cost, _ in tried)
        print(
            f"Realised costs on new units: {costs}. The lower one is kept: it was chosen on these"
        )
        print("recordings, and may be higher on others. --max-order states one of them.")
    _, (evaluation, model, features) = min(tried, key=lambda one: one[0])
    for caveat in evaluation.caveats:
        print(f"- {caveat}")
    _print_rates(final_estimator(model), evaluation, options.groups)
    keys = (options.labels, options.groups)
    stated = {"keys": keys, "intended_use": options.intended_use, "limits": options.limits}
    if options.like is None:
        names = model[:-1].get_feature_names_out()
        parts = _Parts(model[-1], features, labels, groups, evaluation)
        parts.print_channels(X[0].channels, names)
        if options.features == "both":
            parts.print_features(names)
        parts.print_baseline(model, X, options)
        stated |= {"recordings": X, "model": model}
    else:
        print("- The range of the training and its spectral lines are those of the first training.")
        model = Pipeline([*old.steps[:-1], (old.steps[-1][0], model)])
    evidence = training_evidence(evaluation, labels, groups, **stated)
    save_model(model, options.out, note=options.note, healthy=healthy, evidence=evidence)
    print(f"Model: {options.out}")


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


def _print_rates(classifier: Any, evaluation: Evaluation, groups: str) -> None:
    """Print costs and priors in force, the rates with their yardsticks, and the confusions."""
    costs = pd.DataFrame(classifier.cost_, classifier.decisions_, classifier.truths_)
    print("\nCosts (rows: decisions, columns: true states), and priors of the states:")
    print(costs.rename_axis("decision").to_string())
    priors = zip(classifier.classes_, classifier.priors_, strict=True)
    print(", ".join(f"{state}: {prior:.3g}" for state, prior in priors))
    if getattr(classifier, "unknown_rate", None) is not None:
        print(
            f"At most {100 * classifier.unknown_rate:g} % of the recordings of known states are "
            f"called {classifier.unknown}. This holds for recordings like those that were left "
            f"out, each {groups} in turn: of other machines, sensors or conditions more are."
        )
    print("\nRecordings held out:")
    print(as_texts(evaluation.table).filter(regex=" rate|realised cost").to_string())
    print("Cost of the same decision for every recording:")
    constant = evaluation.constant_costs["realised_cost"]
    print(constant.round(3).to_string())
    if evaluation.table.loc["by unit", "realised_cost"] >= constant.iloc[0]:
        print(f"- On new units the model is no better than {constant.index[0]}.")
    print("Whole units held out, decisions (rows) and true states (columns):")
    print(evaluation.confusions["by unit"].to_string())


class _Parts(NamedTuple):
    """Decisions on whole units from parts of the features, or from others."""

    classifier: Any
    features: NDArray[np.float64]
    labels: Sequence[Any]
    groups: Sequence[Any]
    evaluation: Evaluation

    def print_channels(self, channels: Sequence[str], names: Sequence[str]) -> None:
        """Print what the decisions cost without each channel, and warn if less."""
        if len(channels) < 2:
            return
        # The longest name first: "drive" is also the beginning of "drive end".
        longest_first = "|".join(map(re.escape, sorted(channels, key=len, reverse=True)))
        of_channel = re.compile(rf"(?:^|\*)({longest_first})(?!\w)")
        channels_of = [of_channel.findall(name) for name in names]
        kept = {
            f"without {channel}": self.features[:, [channel not in own for own in channels_of]]
            for channel in channels
        }
        for name in self._cheaper("Channels", "all channels", kept):
            print(f"- {name.capitalize()} the decisions cost less: name the other channels.")

    def print_features(self, names: Sequence[str]) -> None:
        """Print what the decisions cost with order bins or bands only, and warn if less."""
        is_band = np.array([name.endswith("Hz") for name in names])
        kept = {"orders": self.features[:, ~is_band], "bands": self.features[:, is_band]}
        for name in self._cheaper("Features", "both", kept):
            print(f"- With {name} only the decisions cost less: --features {name}.")

    def print_baseline(self, model: Pipeline, X: Any, options: argparse.Namespace) -> None:
        """Print what a baseline of each unit gains, where units have healthy recordings."""
        is_healthy = np.array([label == self.evaluation.scoring.healthy for label in self.labels])
        if options.baseline is not None:
            counts = pd.Series(read_meta(X, options.baseline))[is_healthy].value_counts()
            listed = ", ".join(f"{name}: {count}" for name, count in counts.sort_index().items())
            print(f"Healthy recordings in the baseline of each {options.baseline}: {listed}.")
            absolute = np.asarray(model[0].transformer_.transform(X))
            self._cheaper("Baseline", "with a baseline", {"without": absolute})
            return
        try:
            relative = left_out_differences(self.features, self.groups, is_healthy)
        except ValueError:  # a unit has fewer than two healthy recordings: it is not known
            return
        for _ in self._cheaper("Baseline", "without", {"with a baseline": relative}):
            print(
                f"- Relative to healthy recordings of the same {options.groups} the decisions cost "
                f"less: --baseline {options.groups}, and emacm score --healthy for new ones."
            )

    def _cheaper(self, what: str, name: str, others: Mapping[str, Any]) -> list[str]:
        """Print a comparison of features, and return those with which decisions cost less."""
        evaluations, healthy = {name: self.evaluation}, self.evaluation.scoring.healthy
        for other, features in others.items():
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # as for the first
                evaluations[other] = evaluate(
                    self.classifier, features, self.labels, units=self.groups, healthy=healthy
                )
        compared = compare(evaluations, scheme="by unit")
        differences = compared.differences.filter(regex="^realised_cost")
        shown = compared.summary().filter(regex=" rate|realised cost")
        shown[f"cost above that of {name!r}"] = as_texts(differences)["realised cost"]
        print(f"{what}, whole units held out:\n{shown.fillna('').to_string()}")
        highest = differences["realised_cost_high"]
        return [str(name) for name in highest.index[highest < 0]]


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
    return orders, length, supported


def _recipes(recordings: RecordingFolder, options: argparse.Namespace) -> Iterator[Pipeline]:
    """Yield the unfitted pipeline of a recipe, and print up to which order it looks.

    It is asked for a second one if recordings of new units are confused: if nothing states up to
    which order, that looks as far as the files support.
    """
    common: dict[str, Any] = {"min_speed": options.min_speed}
    if options.features == "bands":
        print("bands: third octaves")
        yield spectrum_recipe("bands", **common)
        return
    max_order, revolutions, supported = extent(recordings, options)
    common |= {"revolutions": revolutions}
    segments = f"segments of {revolutions:g} revolutions"
    if options.recipe == "bearing":
        print(f"bearing: {segments}")
        common["classifier"] = recipe_classifier()
        yield bearing_recipe(parts_of_options(options), **common)
        return
    more = f" (the files support {supported:g})" if max_order < supported else ""
    print(f"{options.recipe}: orders up to {max_order:g}{more}, {segments}")
    is_stated = options.max_order is not None or bool(parts_of_options(options))
    if options.recipe == "actuator":
        first = actuator_recipe(max_order=max_order, **common)
    else:
        first = spectrum_recipe(options.features, max_order=max_order, **common)
    yield first
    wide = min(supported, 150.0)  # three harmonics of a mesh of 50 teeth
    if options.recipe == "orders" and not is_stated and wide > 1.5 * max_order:
        print(f"Recordings of new units are confused: orders up to {wide:g} are tried as well.")
        second = spectrum_recipe(options.features, max_order=wide, **common)
        yield make_pipeline(*second[:-1], clone(first[-1]))
    elif more:
        print(f"Recordings of new units are confused: try --max-order {supported:g}.")
