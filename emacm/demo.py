"""Demonstration: from recordings to a saved model, its decisions and their cost."""

from __future__ import annotations

import copy
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.decomposition import PCA
from sklearn.model_selection import GridSearchCV, GroupKFold, ParameterGrid
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.families import family_costs
from emacm.decisions.metrics import expected_cost, neg_expected_cost
from emacm.displays import DecisionRegionsDisplay, OrderSpectrumDisplay
from emacm.displays.drawing import offscreen_panels
from emacm.machine.fault_orders import fault_orders
from emacm.models.model_files import load_model, save_model
from emacm.models.scoring import score
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.recording import Recording
from emacm.resampling.order_resampler import OrderResampler
from emacm.simulation import simulate_fleet

CHANNELS = {"current_a": "A", "accelerometer": "g"}
STATES = ("healthy", "inner ring", "screw")


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
    recordings, states, units = simulate_fleet(8, 4, severity=(0.1, 0.5), seed=1)
    model = _search(recordings, states, units, n_jobs)

    others, truths, _ = simulate_fleet(8, 3, severity=(0.1, 0.5), seed=1, first_unit=8)
    print("\nTest: 24 further actuators, 3 runs each. Rows are decisions, columns true states.")
    models = {}
    for missed in (4.0, 20.0):  # costs are applied in `predict`
        cost = cost_matrix(missed)
        models[missed] = copy.deepcopy(model).set_params(costsensitivegaussianbayes__cost=cost)
        print_decisions(truths, models[missed].predict(others), cost)
    print("\nThe higher the cost of a missed detection, the more units are inspected.")

    cheaper, file = models[4.0], out / "simulated.emacm"
    save_model(cheaper, file, note="demonstration on simulated actuators", healthy="healthy")
    print(f"\nModel saved as {file}, loaded again, and applied to recordings of the test set:")
    table = score(load_model(file), others[::6]).assign(true=truths[::6]).round(3)
    print(table.filter(regex=r"true|decision|expected_cost|typicality|P\(").to_string(index=False))
    _draw(models, recordings, states, out / "simulated.png")


def cost_matrix(missed: float) -> pd.DataFrame:
    """Return costs relative to a false alarm; rows are decisions, columns are true states.

    Examples
    --------
    >>> print(cost_matrix(10))
                healthy  inner ring  screw
    healthy         0.0        10.0   10.0
    inner ring      1.0         0.0    1.0
    screw           1.0         1.0    0.0
    inspect         0.5         0.5    0.5
    unknown         0.5         0.5    0.5
    """
    states = {name: [name] for name in STATES}
    others = {"inspect": 0.5, "unknown": 0.5}  # what is unknown has to be looked at, too
    return family_costs(states, other_decisions=others, healthy="healthy", missed_cost=missed)


def priors() -> dict[str, float]:
    """Return the probability of each state in service: nine of ten units are healthy."""
    return {"healthy": 0.9, "inner ring": 0.05, "screw": 0.05}


def print_decisions(
    truths: NDArray[np.str_], decisions: NDArray[np.str_], cost: pd.DataFrame
) -> None:
    """Print the table of decisions, and the mean cost beside that of the same decision for all."""
    table = pd.crosstab(decisions, truths).reindex(cost.index, columns=cost.columns, fill_value=0)
    print(f"\nA missed detection costs {cost.loc['healthy', 'screw']:g}:\n{table.to_string()}")
    weights = pd.Series(truths).map(priors()) / pd.Series(truths).map(table.sum())
    everywhere = {f"always {name!r}": np.full_like(truths, name) for name in ("healthy", "inspect")}
    for name, made in ({"these": decisions} | everywhere).items():
        print(f"{name}: {expected_cost(truths, made, cost=cost, sample_weight=weights):.3f}")


def _search(
    recordings: list[Recording], states: NDArray[Any], units: NDArray[Any], n_jobs: int | None
) -> Pipeline:
    """Return the pipeline of least expected cost, fitted; spectra are estimated only once."""
    grid = {
        "orderresampler__theta_s": [2 * np.pi / 64, 2 * np.pi / 128],
        "orderpsd__revolutions": [4, 8],
        "bintransformer__bin_size": [0.5, 1.0, 2.0],
    }
    print(f"search: {len(ParameterGrid(grid)) * 4} fits", file=sys.stderr, flush=True)
    with (
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder,
        joblib.parallel_config("threading"),  # an interruption ends threads
    ):
        pipeline = make_pipeline(
            OrderResampler(channels=[*CHANNELS], min_speed=1.0),
            OrderPSD(max_order=24, memory=folder),
            # Unbalance, supply and cogging are not faults, but have most of the variance.
            BinTransformer(max_order=24, stop_bands=((0, 2.5), (5.5, 6.5), (11.5, 12.5))),
            FunctionTransformer(np.log10, feature_names_out="one-to-one"),
            PCA(2),
            CostSensitiveGaussianBayes(
                cost_matrix(4.0),
                priors=priors(),
                shrinkage="oas",
                unknown="unknown",
                temperature="groups",
            ),
        )
        scoring = {"scoring": neg_expected_cost, "error_score": "raise"}
        search = GridSearchCV(pipeline, grid, cv=GroupKFold(4), n_jobs=n_jobs, **scoring)
        left_out = {"bintransformer__groups": units, "costsensitivegaussianbayes__groups": units}
        search.fit(recordings, states, groups=units, **left_out)
    print(f"\nGridSearchCV, split by unit, best of {len(search.cv_results_['params'])} settings:")
    print(f"{search.best_params_}; mean cost of the folds left out: {0 - search.best_score_:.3f}")
    return search.best_estimator_.set_params(orderpsd__memory=None)


def _draw(
    models: Mapping[float, Pipeline], recordings: list[Recording], states: NDArray[Any], file: Path
) -> None:
    """Draw the order spectra by state, and the decision regions under each cost matrix."""
    figure, (spectra, regions) = offscreen_panels(2, 2, height=7.4)
    model = models[4.0]
    psd = model[:2].transform(recordings)
    known = {name: o for r in recordings for name, (o,) in r.meta["orders"].items()}
    screw, ring = known["screw"], known["inner ring"]
    marks = {  # Eq. (2.4): in the current, a fault modulates the supply at order 6
        "current_a": {"screw-6": screw - 6, "6+BPFI": 6 + ring, "6+screw": 6 + screw},
        "accelerometer": fault_orders({"screw": screw, "BPFI": ring}, harmonics=3, max_order=24),
    }
    for ax, (channel, unit) in zip(spectra, CHANNELS.items(), strict=True):
        style = {"unit": unit, "max_order": 24, "fault_orders": marks[channel]}
        OrderSpectrumDisplay.from_table(psd, channel, labels=states, ax=ax, **style)
    names = ("principal component 1", "principal component 2")
    plane = model[:-1].transform(recordings)
    for ax, (missed, priced) in zip(regions, models.items(), strict=True):
        DecisionRegionsDisplay.from_estimator(priced[-1], plane, states, names=names, ax=ax)
        ax.set_title(f"a missed detection costs {missed:g}", fontsize=10)
    figure.savefig(file, dpi=150)
    print(f"\nOrder spectra and decision regions: {file}")
