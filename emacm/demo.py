"""Demonstration: from recordings to a saved model, its decisions and their cost."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.decomposition import PCA
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.families import family_costs
from emacm.decisions.metrics import expected_cost, neg_expected_cost
from emacm.displays import DecisionRegionsDisplay, OrderSpectrumDisplay
from emacm.displays.drawing import offscreen_panels
from emacm.displays.recording import draw_spectra_in_hertz
from emacm.models.model_files import load_model, save_model
from emacm.models.scoring import score
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.recording import Recording
from emacm.resampling.order_resampler import OrderResampler
from emacm.simulation import simulate_fleet

CHANNELS = {"current_a": "A", "accelerometer": "g"}
STATES = ("healthy", "inner ring", "screw")
PRIORS = {"healthy": 0.9, "inner ring": 0.05, "screw": 0.05}  # in service


def simulated_demo(out: Path) -> None:
    """Run the demonstration on simulated recordings of healthy actuators and two faults.

    Parameters
    ----------
    out : Path
        Folder for the model and the picture.
    """
    print("24 simulated actuators: 8 healthy, 8 with a spalled ball screw, 8 with a spall of the")
    print("bearing's inner ring (severity 0.1 to 0.5); 4 runs of 6 s, speed varies and reverses.")
    recordings, states, units = simulate_fleet(8, 4, severity=(0.1, 0.5), seed=1)
    model = _search(recordings, states, units)

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
    draw_picture(models, others, truths, out / "simulated.png")


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


def print_decisions(
    truths: NDArray[np.str_], decisions: NDArray[np.str_], cost: pd.DataFrame
) -> None:
    """Print the table of decisions, and the mean cost beside that of the same decision for all."""
    table = pd.crosstab(decisions, truths).reindex(cost.index, columns=cost.columns, fill_value=0)
    print(f"\nA missed detection costs {cost.loc['healthy', 'screw']:g}:\n{table.to_string()}")
    weights = pd.Series(truths).map(PRIORS) / pd.Series(truths).map(table.sum())
    everywhere = {f"always {name!r}": np.full_like(truths, name) for name in ("healthy", "inspect")}
    for name, made in ({"these": decisions} | everywhere).items():
        print(f"{name}: {expected_cost(truths, made, cost=cost, sample_weight=weights):.3f}")


def _search(recordings: list[Recording], states: NDArray[Any], units: NDArray[Any]) -> Pipeline:
    """Return the pipeline of least expected cost, fitted; spectra are estimated only once."""
    grid = {
        "orderresampler__theta_s": [2 * np.pi / 64, 2 * np.pi / 128],
        "orderpsd__revolutions": [4, 8],
        "bintransformer__bin_size": [0.5, 1.0, 2.0],
    }
    with joblib.parallel_config("threading"):  # an interruption ends threads
        pipeline = make_pipeline(
            OrderResampler(channels=[*CHANNELS], min_speed=1.0),
            OrderPSD(max_order=24),
            # Unbalance, supply and cogging are not faults, but have most of the variance.
            BinTransformer(max_order=24, stop_bands=((0, 2.5), (5.5, 6.5), (11.5, 12.5))),
            FunctionTransformer(np.log10, feature_names_out="one-to-one"),
            PCA(2),
            CostSensitiveGaussianBayes(
                cost_matrix(4.0),
                priors=PRIORS,
                shrinkage="oas",
                unknown="unknown",
                temperature="groups",
            ),
        )
        options = {"scoring": neg_expected_cost, "error_score": "raise", "n_jobs": 2, "verbose": 1}
        search = GridSearchCV(pipeline, grid, cv=GroupKFold(4), **options)
        left_out = {"bintransformer__groups": units, "costsensitivegaussianbayes__groups": units}
        search.fit(recordings, states, groups=units, **left_out)
    print(f"\nGridSearchCV, split by unit, best of {len(search.cv_results_['params'])} settings:")
    print(f"{search.best_params_}; mean cost of the folds left out: {0 - search.best_score_:.3f}")
    return search.best_estimator_


def draw_picture(
    models: Mapping[float, Pipeline], recordings: list[Recording], states: NDArray[Any], file: Path
) -> None:
    """Draw one spectrum over frequency and over orders, and the decisions under both costs."""
    figure, (spectra, regions) = offscreen_panels(2, 2, height=6.2)
    _draw_spectra(spectra, max(recordings, key=lambda r: r.meta["severity"]))
    names = ("principal component 1", "principal component 2")
    plane = np.asarray(models[4.0][:-1].transform(recordings))
    first, second = (model[-1].predict(plane) for model in models.values())
    changed = plane[first != second]
    low, high = plane.min(axis=0) - 0.5, plane.max(axis=0) + 0.5
    entries: dict[str, Any] = {}
    for ax, (missed, model) in zip(regions, models.items(), strict=True):
        entries |= DecisionRegionsDisplay.from_estimator(
            model[-1], plane, states, names=names, ax=ax
        ).entries_
        ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        ring = ax.scatter(*changed.T, s=90, facecolors="none", edgecolors="black", linewidths=1.4)
        ax.set_title(f"a missed detection costs {missed:g}", fontsize=10)
        ax.get_legend().remove()
    entries["another decision at the other cost"] = (ring,)
    place = {"loc": "outside lower center", "ncols": 3, "fontsize": 8, "frameon": False}
    figure.legend([*entries.values()], [*entries], title="area: decision, marker: truth", **place)
    figure.savefig(file, dpi=150)
    print(f"\nSpectra and decision regions: {file}")


def _draw_spectra(axes: NDArray[np.object_], recording: Recording) -> None:
    """Draw the power spectral density of one current over frequency, and over orders."""
    state, ((fault, *_),) = recording.meta["label"], recording.meta["orders"].values()
    draw_spectra_in_hertz({"": recording}, "current_a", 24, axes[0])
    axes[0].set_ylabel("PSD of current_a\n[dB re 1 A²/Hz]")
    turned = OrderResampler(channels=["current_a"], min_speed=1.0).fit_transform([recording])
    table = OrderPSD(16, max_order=24).fit_transform(turned)
    # Eq. (2.4): in the current, a fault modulates the supply at order 6.
    marks = {f"{state}-6": fault - 6, f"6+{state}": 6 + fault}
    style = {"unit": "A", "fault_orders": marks, "ax": axes[1]}
    OrderSpectrumDisplay.from_table(table, "current_a", **style)
    axes[1].get_legend().remove()
    axes[0].set_title("one recording in Hz: smeared", fontsize=10, pad=20)
    axes[1].set_title("the same over orders: sharp", fontsize=10, pad=20)
