"""Demonstration: from recordings to a saved model, its decisions and their cost."""

from __future__ import annotations

import copy
import sys
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import clone
from sklearn.decomposition import PCA
from sklearn.model_selection import GridSearchCV, GroupKFold, ParameterGrid
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.families import family_costs
from emacm.decisions.metrics import neg_expected_cost
from emacm.displays import DecisionRegionsDisplay, OrderSpectrumDisplay
from emacm.displays.drawing import offscreen_panels
from emacm.evaluation.scoring import scoring_rule
from emacm.machine.fault_orders import fault_orders
from emacm.models.model_files import load_model, save_model
from emacm.models.scoring import outside_training, score
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.recording import Recording
from emacm.resampling.order_resampler import OrderResampler
from emacm.simulation import FAULT_ORDERS, simulate_fleet

HEALTHY, INSPECT, UNKNOWN = "healthy", "inspect", "unknown"
P_HEALTHY = 0.9  # prior probability: nine of ten units that are measured are healthy
INSPECTION = 0.5  # cost relative to a false alarm
MISSED = (4.0, 20.0)  # costs of a missed detection that are compared, relative to a false alarm
_SEVERITY = (0.1, 0.5)  # range of the simulated faults; 1 is a fully developed fault
_CHANNELS = {"current_a": "A", "accelerometer": "g"}

Labels = NDArray[np.str_]


def simulated_demo(out: Path, *, n_jobs: int | None = None) -> None:
    """Run the demonstration on simulated recordings of healthy actuators and two faults.

    Parameters
    ----------
    out : Path
        Folder for the model and the picture.
    n_jobs : int, optional
        Number of threads of the search.
    """
    print("24 simulated actuators: 8 healthy, 8 with a spalled ball screw, 8 with a spall of the")
    print("bearing's inner ring (severity 0.1 to 0.5); 4 runs of 6 s, speed varies and reverses.")
    recordings, states, units = simulate_fleet(8, 4, severity=_SEVERITY, seed=1)
    classes = np.unique(states)
    pipeline = make_pipeline(
        OrderResampler(2 * np.pi / 64, channels=[*_CHANNELS], min_speed=1.0),
        OrderPSD(max_order=24),
        # Unbalance, supply and cogging are not faults, but have most of the variance.
        BinTransformer(max_order=24, stop_bands=((0, 2.5), (5.5, 6.5), (11.5, 12.5))),
        FunctionTransformer(np.log10, feature_names_out="one-to-one"),
        PCA(2),
        CostSensitiveGaussianBayes(
            cost_matrix(classes, MISSED[0]),
            priors=priors(classes),
            shrinkage="oas",
            unknown=UNKNOWN,
            temperature="groups",
        ),
    )
    print("\nUp to which order is each recording valid? (first run of three of the units)")
    print(pipeline[0].quality(recordings[::32]).drop(columns="warnings").round(2).to_string())
    model = _search(pipeline, recordings, states, units, n_jobs=n_jobs)

    others, truths, _ = simulate_fleet(8, 3, severity=_SEVERITY, seed=1, first_unit=8)
    print("\nTest: 24 further actuators, 3 runs each")
    models = {}
    for missed in MISSED:  # costs are applied in `predict`
        cost = cost_matrix(classes, missed)
        models[missed] = copy.deepcopy(model).set_params(costsensitivegaussianbayes__cost=cost)
        print_decisions(truths, models[missed].predict(others), cost)
    print("\nThe higher the cost of a missed detection, the more units are inspected.")
    _print_unlike(models[MISSED[0]], others[0])
    _save_and_diagnose(models[MISSED[0]], out / "simulated.emacm", others[::6], truths[::6])
    _draw(models, recordings, states, out / "simulated.png")


def _print_unlike(model: Pipeline, recording: Recording) -> None:
    """Print decisions on a recording with wrong inputs, and what is unlike the training."""
    print("\nThe first of these recordings with wrong inputs, which no training recording has:")
    current, sound = (recording.signals[name] for name in _CHANNELS)
    for name, channels, rpm in (
        ("gain of 1000", (1000 * current, 1000 * sound), 1.0),
        ("channels swapped", (sound, current), 1.0),
        ("speed in rpm", (current, sound), 60 / (2 * np.pi)),
    ):
        signals = dict(zip(_CHANNELS, channels, strict=True))
        rates = {channel: recording.fs[channel] for channel in _CHANNELS}
        angle, shaft_fs = rpm * recording.angle, recording.shaft_fs
        changed = Recording(signals, rates, angle=angle, shaft_fs=shaft_fs)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # the same statements
            print(f"{name}: decision {str(model.predict([changed])[0])!r}")
        print(*(f"    {each.text}" for each in outside_training(model, [changed])[0]), sep="\n")


def cost_matrix(classes: ArrayLike, missed: float) -> pd.DataFrame:
    """Return costs relative to a false alarm; rows are decisions, columns are true states.

    Examples
    --------
    >>> print(cost_matrix(["healthy", "worn"], 10))
             healthy  worn
    healthy      0.0  10.0
    worn         1.0   0.0
    inspect      0.5   0.5
    unknown      1.0   1.0
    """
    states = {name: [name] for name in np.asarray(classes).tolist()}
    others = {INSPECT: INSPECTION, UNKNOWN: 1.0}  # unknown: taken out of service in vain
    return family_costs(states, other_decisions=others, healthy=HEALTHY, missed_cost=missed)


def priors(classes: ArrayLike) -> dict[str, float]:
    """Return the prior probability of each class: faults are rare, and equally frequent."""
    names = np.asarray(classes).tolist()
    fault = (1 - P_HEALTHY) / (len(names) - 1)
    return dict.fromkeys(names, fault) | {HEALTHY: P_HEALTHY}


def print_decisions(truths: Labels, decisions: Labels, cost: pd.DataFrame) -> None:
    """Print the confusion table, the three rates, and the mean cost beside its yardsticks.

    A healthy unit whose state is called unknown is inspected, and counts as such.
    """
    table = pd.crosstab(pd.Series(decisions), pd.Series(truths))
    table = table.reindex(index=cost.index, columns=cost.columns, fill_value=0)
    faults = table.columns.drop(HEALTHY)
    print(
        f"\nCosts: missed detection {cost.loc[HEALTHY, faults[0]]:g}, "
        f"false alarm {cost.loc[faults[0], HEALTHY]:g}, inspection {INSPECTION:g}; "
        f"probability of {HEALTHY}: {P_HEALTHY:g}"
    )
    named = table.set_axis([f"decision: {name}" for name in table.index])
    print(named.add_prefix("true: ").to_string())
    of_healthy, of_faulty = table[HEALTHY], table[faults].sum(axis=1)
    for name, made, counts in (
        ("false alarm", faults, of_healthy),
        ("inspection", [INSPECT, UNKNOWN], of_healthy),
        ("missed detection", [HEALTHY], of_faulty),
    ):
        count, total = counts[made].sum(), counts.sum()
        print(f"{name} rate: {100 * count / total:.0f} % ({count} of {total} recordings)")
    shares = priors(table.columns)
    paid = (cost * table / table.sum()).sum() @ pd.Series(shares)[cost.columns]
    rule = scoring_rule(np.unique(truths), healthy=HEALTHY, cost=cost, priors=shares)
    constant = rule.constant_costs(truths.tolist())["realised_cost"]
    texts = [f"{name} {value:.3f}" for name, value in constant.items()]
    print(f"cost of a recording in service: {paid:.3f}; {', '.join(texts)}")
    if paid >= constant.iloc[0]:
        print(
            f"This model is worse than {constant.index[0]}: small faults look healthy to it. At "
            "this cost, inspect every unit, or record a signal that shows them."
        )


def _search(
    pipeline: Pipeline,
    recordings: list[Recording],
    labels: Labels,
    units: NDArray[Any],
    *,
    n_jobs: int | None,
) -> Pipeline:
    """Return the pipeline of least expected cost, fitted; spectra are estimated only once."""
    grid: dict[str, Sequence[float]] = {
        "orderresampler__theta_s": [2 * np.pi / 64, 2 * np.pi / 128],
        "orderpsd__revolutions": [4, 8],
        "bintransformer__bin_size": [0.5, 1.0, 2.0],
    }
    print(f"search: {len(ParameterGrid(grid)) * 4} fits", file=sys.stderr, flush=True)
    with (
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder,
        joblib.parallel_config("threading"),  # an interruption ends threads
    ):
        cached = clone(pipeline).set_params(orderpsd__memory=folder)
        scoring = {"scoring": neg_expected_cost, "error_score": "raise"}
        search = GridSearchCV(cached, grid, cv=GroupKFold(4), n_jobs=n_jobs, **scoring)
        left_out = {"bintransformer__groups": units, "costsensitivegaussianbayes__groups": units}
        search.fit(recordings, labels, groups=units, **left_out)
    print(f"\nGridSearchCV, split by unit, best of {len(search.cv_results_['params'])} settings:")
    print(f"{search.best_params_}; mean cost of the folds left out: {0 - search.best_score_:.3f}")
    return search.best_estimator_.set_params(orderpsd__memory=None)


def _save_and_diagnose(
    model: Pipeline, file: Path, unseen: list[Recording], truths: Labels
) -> None:
    """Save and load a model, and print its decisions with probabilities and expected costs."""
    save_model(model, file, note="demonstration on simulated actuators", healthy=HEALTHY)
    print(f"\nModel saved as {file}, loaded again, and applied to recordings of the test set:")
    table = score(load_model(file), unseen).assign(true=truths).round(3)
    shown = table.filter(regex=r"true|decision|expected_cost|typicality|P\(")
    print(shown.to_string(index=False))


def _draw(
    models: Mapping[float, Pipeline], recordings: list[Recording], labels: Labels, file: Path
) -> None:
    """Draw the order spectra by state, and the decision regions under each cost matrix."""
    figure, (spectra, regions) = offscreen_panels(2, 2, height=7.4)
    model = models[MISSED[0]]
    psd = model[:2].transform(recordings)
    (screw,), (ring,) = FAULT_ORDERS["screw"], FAULT_ORDERS["inner ring"]
    top = model[2].max_order
    marks = {  # Eq. (2.4): in the current, a fault modulates the supply at order 6
        "current_a": {"screw-6": screw - 6, "6+BPFI": 6 + ring, "6+screw": 6 + screw},
        "accelerometer": fault_orders({"screw": screw, "BPFI": ring}, harmonics=3, max_order=top),
    }
    for ax, (channel, unit) in zip(spectra, _CHANNELS.items(), strict=True):
        style = {"unit": unit, "max_order": top, "fault_orders": marks[channel]}
        OrderSpectrumDisplay.from_table(psd, channel, labels=labels, ax=ax, **style)
    names = ("principal component 1", "principal component 2")
    plane = model[:-1].transform(recordings)
    for ax, (missed, priced) in zip(regions, models.items(), strict=True):
        DecisionRegionsDisplay.from_estimator(priced[-1], plane, labels, names=names, ax=ax)
        ax.set_title(f"a missed detection costs {missed:g}", fontsize=10)
    figure.savefig(file, dpi=150)
    print(f"\nOrder spectra and decision regions: {file}")
