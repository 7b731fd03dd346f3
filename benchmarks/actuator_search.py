"""Settings of the recipe for the real actuator, selected within training runs only.

The settings in `real_actuator.py` were selected with knowledge of all runs, which is optimistic.
Here a nested search selects revolutions, highest order and lowest speed for each held-out run,
and for the last three, by leaving out each of the other runs in turn; the held-out runs
score the selected settings only. 13 states, one classifier per load, without and with phase.

    python benchmarks/actuator_search.py [--train FILE] [--json [FILE]] [--quick]
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from actuator_methods import Fold, Recipe
from measure import header, json_option, write_json
from real_actuator import Recordings, chosen_file, decide_all, few, folds_by_run, read, row
from sklearn.model_selection import ParameterGrid
from threadpoolctl import threadpool_limits

ASKED = "13 states", "per load"
GRID = {"revolutions": (3, 4, 6), "max_order": (2.0, 2.5), "min_speed": (2.0, 3.0)}
QUICK = {"revolutions": (3, 4)}
N_LATER = 3


def inner_folds(known: Recordings, outer: Fold) -> list[Fold]:
    """Leave out each training run in turn."""
    runs = np.unique(known.run[outer.train])
    return [
        Fold(outer.train & (known.run != run), outer.train & (known.run == run), f"inner {run}")
        for run in runs
    ]


def score(method: Recipe, known: Recordings, folds: list[Fold]) -> float:
    """Return the balanced accuracy over all recordings held out by the folds."""
    decided = decide_all(method, [ASKED], known, folds)[ASKED]
    return row(ASKED[0], known, decided)["balanced_accuracy"]


def searched(
    methods: list[Recipe], settings: list[dict], known: Recordings, outer: list[Fold]
) -> Iterator[dict[str, Any]]:
    """Yield for each outer fold the selected settings and the decisions on it."""
    for fold in outer:
        inner = inner_folds(known, fold)
        scores = [score(method, known, inner) for method in methods]
        best = int(np.argmax(scores))
        decided = decide_all(methods[best], [ASKED], known, [fold])[ASKED]
        yield settings[best] | {"inside": scores[best], "fold": fold, "decided": decided}


def compare(known: Recordings, grid: dict, phase: bool) -> list[dict]:
    """Search by run and for the last runs, and score the published settings as well."""
    settings = list(ParameterGrid(grid))
    methods = [Recipe(phase=phase, **setting) for setting in settings]
    published = Recipe(phase=phase)
    plans = {"each run in turn": folds_by_run(known)}
    runs = np.unique(known.run)
    if len(runs) > 2 * N_LATER:
        later = np.isin(known.run, runs[-N_LATER:])
        plans[f"last {N_LATER} runs"] = [Fold(~later, later, "later runs")]
    rows = []
    for plan, outer in plans.items():
        decided = np.full(len(known.X), "", dtype="U40")
        for chosen in searched(methods, settings, known, outer):
            fold = chosen.pop("fold")
            decided[fold.test] = chosen.pop("decided")[fold.test]
            print(f"phase {phase}, {fold.name} held out: {chosen}", flush=True)
        rows.append(
            {
                "held out": plan,
                "phase": phase,
                "selected inside training": row(ASKED[0], known, decided)["balanced_accuracy"],
                "published settings": score(published, known, outer),
            }
        )
    return rows


def main() -> None:
    """Search, print the table and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--train", type=Path, help="file; default: the one below EMACM_DATA")
    json_option(parser)
    parser.add_argument("--quick", action="store_true", help="few recordings and settings")
    options = parser.parse_args()
    file = chosen_file(options)
    print(header())
    known = few(read(file), n_runs=3) if options.quick else read(file)
    grid = QUICK if options.quick else GRID
    print(f"{len(known.X)} recordings, {len(ParameterGrid(grid))} settings of {[*grid]}")
    with threadpool_limits(1):
        phases = (False,) if options.quick else (False, True)
        rows = [each for phase in phases for each in compare(known, grid, phase)]
    print(f"\nbalanced accuracy\n{pd.DataFrame(rows).round(3).to_string(index=False)}")
    write_json(options, rows)


if __name__ == "__main__":
    main()
