"""The main job from end to end: search, decide, save, load, diagnose, draw."""

from __future__ import annotations

import tempfile
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.base import clone
from sklearn.decomposition import PCA
from sklearn.metrics import balanced_accuracy_score, confusion_matrix
from sklearn.model_selection import BaseCrossValidator, GridSearchCV, GroupKFold, StratifiedKFold
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from emacm.datasets import load_cranfield
from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.metrics import expected_cost, neg_expected_cost
from emacm.displays import DecisionRegionsDisplay, OrderSpectrumDisplay
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.recording import Recording
from emacm.resampling.order_resampler import OrderResampler
from emacm.simulation import FAULT_ORDERS, simulate_fleet

MISSED = 10.0  # times as dear as a false alarm, in the lopsided cost matrix
_UNIFORM, _LOPSIDED = "uniform", f"a missed detection costs {MISSED:g}"
_SEVERITY = 0.25  # mean of the simulated faults: most are detected, some are missed
_LATE_RUNS = 2  # runs of the real actuator that are kept from the search

Labels = NDArray[np.str_]


def simulated_demo(out: Path, *, n_jobs: int | None = None) -> None:
    """Show the main job on simulated recordings: a healthy actuator and two faults.

    Parameters
    ----------
    out : Path
        Folder for the model and the picture.
    n_jobs : int, optional
        Processes of the search.
    """
    print("Simulating 24 actuators in 3 states of health, 4 runs each, speed varying and reversing")
    channels = {"current_a": "A", "accelerometer": "g"}
    recordings, states, units = simulate_fleet(8, 4, severity=_SEVERITY, seed=1)
    pipeline = make_pipeline(
        OrderResampler(channels=[*channels], min_speed=1.0),
        OrderPSD(max_order=24),
        # Unbalance, supply and cogging are no faults; they would take all the variance.
        BinTransformer(max_order=24, stop_bands=((0, 2.5), (5.5, 6.5), (11.5, 12.5))),
        _logarithm(),
        PCA(2),
        CostSensitiveGaussianBayes(shrinkage="oas"),
    )
    _show_quality(pipeline, recordings[::32])
    grid: dict[str, Sequence[Any]] = {
        "orderresampler__theta_s": [2 * np.pi / 64, 2 * np.pi / 128],
        "orderpsd__revolutions": [4, 8],
        "bintransformer__bin_size": [0.5, 1.0, 2.0],
    }
    search = _search(pipeline, grid, GroupKFold(4), recordings, states, units, n_jobs=n_jobs)

    print("\nNine actuators that the search never saw, 8 runs each")
    others, truths, _ = simulate_fleet(3, 8, severity=_SEVERITY, seed=1, first_unit=8)
    model = search.best_estimator_
    models = _priced_models(model, recordings, states, others, truths, healthy="healthy")
    _save_and_diagnose(models[_LOPSIDED], out / "simulated.joblib", others[::8])
    _draw(
        models,
        recordings,
        states,
        out / "simulated.png",
        channels=channels,
        fault_orders={
            "accelerometer": {"screw": FAULT_ORDERS["screw"][0]}
            | {f"{k}xBPFI": k * FAULT_ORDERS["inner ring"][0] for k in (1, 2, 3)},
        },
    )


def actuator_demo(file: Path, out: Path, *, n_jobs: int | None = None) -> None:
    """Show the main job on the Cranfield actuator: normal and the worst of each fault.

    Parameters
    ----------
    file : Path
        What `emacm.datasets.load_cranfield` reads.
    out : Path
        Folder for the model and the picture.
    n_jobs : int, optional
        Processes of the search.
    """
    with warnings.catch_warnings(record=True) as remarks:
        warnings.simplefilter("always")
        recordings, states, frame = load_cranfield(file)
    for remark in remarks:
        print(f"mind: {remark.message}")
    chosen = np.flatnonzero(np.isin(states, _worst_states(states)))
    recordings, states = [recordings[i] for i in chosen], states[chosen]
    frame = frame.iloc[chosen].reset_index(drop=True)
    runs = sorted(frame["run"].unique().tolist())
    if len(runs) <= _LATE_RUNS + 1:
        raise ValueError(f"the demo needs more than {_LATE_RUNS + 1} runs, the file has {runs}.")
    print(f"{len(recordings)} recordings of {', '.join(np.unique(states))}; runs {runs}")
    pipeline = make_pipeline(
        OrderResampler(2 * np.pi / 6, min_speed=8.0),
        OrderPSD(4, by_direction=True),
        BinTransformer(0.25, max_order=2.5),
        _logarithm(),
        StandardScaler(),
        PCA(8),
        CostSensitiveGaussianBayes(shrinkage="oas"),
    )
    _show_quality(pipeline, recordings[:3])
    late = np.asarray(frame["run"].isin(runs[-_LATE_RUNS:]))
    late_names = " and ".join(str(run) for run in runs[-_LATE_RUNS:])
    splits = {f"runs {late_names} held out (honest)": late, "random split": _random_split(states)}
    scores, kept = {}, {}
    schemes = {"a classifier per load": np.asarray(frame["load"]), "one for all loads": None}
    for split, held_out in splits.items():
        groups = np.asarray(frame["run"]) if held_out is late else None
        for scheme, loads in schemes.items():
            print(f"\n{split}; {scheme}")
            decided, models = _train_and_test(
                pipeline, recordings, states, held_out, loads=loads, groups=groups, n_jobs=n_jobs
            )
            scores[scheme, split] = balanced_accuracy_score(states[held_out], decided)
            kept[scheme, split] = decided, models
    table = pd.Series(scores).unstack().loc[[*schemes], [*splits]]
    print(f"\nBalanced accuracy\n{table.round(3).to_string()}")
    print("State and assembly are confounded on this rig: each state was one assembly.")

    honest = next(iter(splits))
    decided, _ = kept["a classifier per load", honest]
    print(f"\na classifier per load, {honest}")
    _report(states[late], decided, None, healthy="normal")
    model, truths = kept["one for all loads", honest][1][None], states[~late]
    early = [recordings[i] for i in np.flatnonzero(~late)]
    unseen = [recordings[i] for i in np.flatnonzero(late)]
    print("\none for all loads")
    models = _priced_models(model, early, truths, unseen, states[late], healthy="normal")
    _save_and_diagnose(
        models[_LOPSIDED], out / "actuator.joblib", unseen[:: max(1, len(unseen) // 8)]
    )
    channels = {"current": "A", "position_error": "mm"}
    _draw(models, early, truths, out / "actuator.png", channels=channels, fault_orders={})


def _show_quality(pipeline: Pipeline, recordings: list[Recording]) -> None:
    table = pipeline[0].quality(recordings)
    print(table.drop(columns="warnings").round(2).to_string())
    for index, warning in enumerate(table["warnings"]):
        if warning:
            print(f"  mind in recording {index}: {warning}")


def _logarithm() -> FunctionTransformer:
    return FunctionTransformer(np.log10, feature_names_out="one-to-one")


def _search(
    pipeline: Pipeline,
    grid: dict[str, Sequence[Any]],
    split: BaseCrossValidator,
    recordings: list[Recording],
    labels: Labels,
    groups: Any,
    *,
    n_jobs: int | None,
    verbose: int = 2,
) -> GridSearchCV:
    """Search by expected cost; spectra are kept for the search, so bins are tried for little."""
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        cached = clone(pipeline).set_params(orderpsd__memory=folder)
        search = GridSearchCV(
            cached,
            grid,
            cv=split,
            scoring=neg_expected_cost,
            n_jobs=n_jobs,
            verbose=verbose,
            error_score="raise",
        )
        search.fit(recordings, labels, groups=groups)
    best = {name.split("__")[1]: value for name, value in search.best_params_.items()}
    search.best_estimator_.set_params(orderpsd__memory=None)
    print(
        f"Best of {len(search.cv_results_['params'])} in {time.perf_counter() - start:.0f} s: "
        f"theta_s = 2 pi / {2 * np.pi / best['theta_s']:g}, segments of {best['revolutions']:g} "
        f"revolutions, bins of {best['bin_size']:g} orders; "
        f"expected cost {0 - search.best_score_:.3f} on the folds left out"
    )
    return search


def _train_and_test(
    pipeline: Pipeline,
    recordings: list[Recording],
    states: Labels,
    held_out: NDArray[np.bool_],
    *,
    loads: Any,
    groups: Any,
    n_jobs: int | None,
) -> tuple[Labels, dict[Any, Pipeline]]:
    """Search on the recordings not held out, and decide on the others; by load if given."""
    grid: dict[str, Sequence[Any]] = {
        "orderresampler__theta_s": [2 * np.pi / 6, 2 * np.pi / 8],
        "orderpsd__revolutions": [4, 8],
        "bintransformer__bin_size": [0.25, 0.5],
    }
    parts: dict[Any, NDArray[np.bool_]] = {None: np.ones(len(states), dtype=bool)}
    if loads is not None:
        parts = {load: loads == load for load in np.unique(loads)}
    decided, models = np.empty_like(states), {}
    random = StratifiedKFold(3, shuffle=True, random_state=0)
    for load, part in parts.items():
        train, test = np.flatnonzero(part & ~held_out), np.flatnonzero(part & held_out)
        search = _search(
            pipeline,
            grid,
            random if groups is None else GroupKFold(3),
            [recordings[i] for i in train],
            states[train],
            None if groups is None else groups[train],
            n_jobs=n_jobs,
            verbose=1,
        )
        decided[test] = search.predict([recordings[i] for i in test])
        models[load] = search.best_estimator_
    return decided[held_out], models


def _worst_states(states: Labels) -> list[str]:
    """Return the normal state and the highest number of each fault."""
    worst: dict[str, str] = {}
    for state in sorted(np.unique(states), key=lambda s: (s.rstrip("0123456789"), len(s), s)):
        worst[state.rstrip("0123456789")] = str(state)
    return list(worst.values())


def _random_split(states: Labels) -> NDArray[np.bool_]:
    """Hold two sevenths out at random, as many of each state."""
    folds = StratifiedKFold(7, shuffle=True, random_state=0).split(states, states)
    held_out = np.zeros(len(states), dtype=bool)
    for _, (_, test) in zip(range(_LATE_RUNS), folds, strict=False):
        held_out[test] = True
    return held_out


def _cost_matrices(healthy: str, classes: NDArray[Any]) -> dict[str, pd.DataFrame]:
    """Return the uniform matrix and one in which a missed detection is dear."""
    uniform = pd.DataFrame(1 - np.eye(len(classes)), index=classes, columns=classes)
    lopsided = uniform.copy()
    lopsided.loc[healthy, lopsided.columns != healthy] = MISSED
    return {_UNIFORM: uniform, _LOPSIDED: lopsided}


def _priced_models(
    model: Pipeline,
    recordings: list[Recording],
    labels: Labels,
    unseen: list[Recording],
    truths: Labels,
    *,
    healthy: str,
) -> dict[str, Pipeline]:
    """Decide on unseen recordings under each cost matrix; return the models by its name.

    The costs concern the classifier alone, so the fitted transformers are shared.
    """
    features, unseen_features = (model[:-1].transform(X) for X in (recordings, unseen))
    models, decided = {}, {}
    for name, cost in _cost_matrices(healthy, model.classes_).items():
        classifier = clone(model[-1]).set_params(cost=cost).fit(features, labels)
        models[name] = Pipeline([*model.steps[:-1], (model.steps[-1][0], classifier)])
        decided[name] = classifier.predict(unseen_features)
        print(f"\nCost matrix: {name}")
        _report(truths, decided[name], cost, healthy=healthy)
    dear = expected_cost(truths, decided[_UNIFORM], cost=cost)
    print(f"(the decisions under the uniform matrix would cost {dear:.3f})")
    return models


def _report(truths: Labels, decided: Labels, cost: pd.DataFrame | None, *, healthy: str) -> None:
    classes = list(dict.fromkeys([healthy, *np.unique(truths)]))
    # scikit-learn puts the truth in rows; here, as in the cost matrix, rows are the decision.
    table = pd.DataFrame(
        confusion_matrix(truths, decided, labels=classes).T,
        index=pd.Index(classes, name="decided"),
        columns=pd.Index(classes, name="true"),
    )
    print(table.to_string())
    sound = truths == healthy
    false_alarms = int(np.sum(sound & (decided != healthy)))
    missed = int(np.sum(~sound & (decided == healthy)))
    print(f"false alarms: {false_alarms} of {sound.sum()}", end="; ")
    print(f"missed detections: {missed} of {(~sound).sum()}", end="; ")
    print(f"expected cost: {expected_cost(truths, decided, cost=cost):.3f} per recording")


def _save_and_diagnose(model: Pipeline, file: Path, unseen: list[Recording]) -> None:
    joblib.dump(model, file)
    loaded = joblib.load(file)
    print(f"\nModel saved as {file} and loaded again; its diagnosis of recordings it never saw:")
    risk = loaded[-1].risk(loaded[:-1].transform(unseen))
    key = "state" if "state" in unseen[0].meta else "label"
    table = pd.DataFrame(risk, columns=[f"risk of {name}" for name in loaded[-1].decisions_])
    table.insert(0, "true", [recording.meta[key] for recording in unseen])
    table.insert(1, "decided", loaded.predict(unseen))
    print(table.round(3).to_string(index=False))


def _draw(
    models: dict[str, Pipeline],
    recordings: list[Recording],
    labels: Labels,
    file: Path,
    *,
    channels: dict[str, str],
    fault_orders: dict[str, dict[str, float]],
) -> None:
    """Draw the order spectra by state, and the decision regions under each cost matrix."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 8), layout="constrained")
    spectra, regions = figure.subplots(2, 2)
    model = next(iter(models.values()))
    psd = model[:2].transform(recordings)
    for ax, (channel, unit) in zip(spectra, channels.items(), strict=True):
        OrderSpectrumDisplay.from_table(
            psd,
            f"{channel}+" if model[1].by_direction else channel,
            labels=labels,
            unit=unit,
            max_order=model[2].max_order,
            fault_orders=fault_orders.get(channel),
            ax=ax,
        )
    names = ("principal component 1", "principal component 2")
    plane = model[:-1].transform(recordings)
    for ax, (cost, priced) in zip(regions, models.items(), strict=True):
        classifier, title = priced[-1], f"cost matrix: {cost}"
        if plane.shape[1] > 2:
            classifier = clone(classifier).fit(plane[:, :2], labels)
            title += "\n(a classifier of these two components alone)"
        DecisionRegionsDisplay.from_estimator(classifier, plane[:, :2], labels, names=names, ax=ax)
        ax.set_title(title, fontsize=10)
    figure.savefig(file, dpi=150)
    print(f"Order spectra and decision regions drawn in {file}")
