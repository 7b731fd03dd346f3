"""Diagnosis of a real actuator, compared with methods that a user could choose instead.

The recordings are those of `emacm.datasets.load_cranfield`: 13 states of a ball screw, three
loads. The methods are `actuator_recipe` without and with the absolute phase of the 1x component,
the chain of the thesis (spectra, bins, PCA, a Gaussian for each class), shrinkage LDA on the raw
current, and MiniRocket and MultiRocket with a ridge classifier (package aeon, the extra `bench`).

Tasks: all 13 states; four families; normal and the worst state of each fault; the family of a
state that is absent from training ("unseen state": mean over its three families). Schemes: one
model per load; one model for all loads, without the load as input; load left out, with healthy
recordings of that load in training. All methods are trained on the 13 states (in one model: on
pairs of state and load), which is better for each of them; families are the sums of their states.

Without options each run is left out in turn. With `--train-runs 4` the models are trained on runs
1 to 4 and tested on the later ones. With --test they are trained on all of --train, and sequences
of the test file that are copies of a training sequence are left out. Confidence
intervals (95 %) are bootstrapped over runs, or over repetitions (`group`) if there are fewer
than five runs.

Each state is one assembly on this rig, so no figure here separates a fault from an assembly, and
those "with phase" hold for the same assemblies only. Without phase, no feature depends on the
shaft angle of the 1x component, as the control at the end shows (`actuator_control`). The phase
of 1x in reverse strokes relative to forward ones is used, and may be assembly-specific too.

The other methods have no unknown state, so the one of `actuator_recipe` is switched off here:
`unknown.py` measures it.

    python benchmarks/real_actuator.py [--train FILE] [--test FILE | --train-runs 4] [--json [FILE]]
        [--quick]
"""

from __future__ import annotations

import argparse
import os
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from actuator_control import cut_alike, cut_at_random
from actuator_methods import METHODS, TRIED, Fold, Recipe, missing_methods, separations
from measure import header, json_option, write_json
from numpy.typing import NDArray
from scipy.spatial.distance import cdist
from threadpoolctl import threadpool_limits

from emacm.datasets import load_cranfield
from emacm.evaluation.bootstrap import GroupBootstrap, Tally

HEALTHY = "normal"
WORST = (HEALTHY, "lackLubrication2", "backlash2", "spalling8")
PLAN = {
    "13 states": ("per load", "one model"),
    "families": ("per load", "one model", "load left out"),
    "worst four": ("per load", "one model", "load left out"),
    "unseen state": ("per load", "one model"),
}
REMARKS = """
Each state is one assembly: no figure separates a fault from an assembly. "emacm with phase" uses
the phase of the 1x component against the screw: for the same assemblies only. "emacm" does not,
but uses the phase of 1x in reverse strokes relative to forward ones."""
COPY = 1e-5  # A, as in load_cranfield
FEW_RUNS = 5


class Recordings(NamedTuple):
    """Recordings, with the state, load, run and repetition of each."""

    X: list[Any]
    state: NDArray[np.str_]
    load: NDArray[Any]
    run: NDArray[Any]
    group: NDArray[Any]

    def take(self, chosen: NDArray[Any]) -> Recordings:
        """Return some of them."""
        rows = np.flatnonzero(chosen)
        return Recordings([self.X[i] for i in rows], *(column[rows] for column in self[1:]))


class Case(NamedTuple):
    """Training and test recordings of one fit."""

    train: NDArray[np.bool_]
    test: NDArray[np.bool_]
    labels: NDArray[Any]
    answers: dict[str, str]  # {label: label that it is scored as}
    load: Any  # the load, if the model is of one load


def family(state: str) -> str:
    """Return the fault without its severity."""
    return state.rstrip("0123456789")


def cases(task: str, scheme: str, known: Recordings, fold: Fold) -> Iterator[Case]:
    """Yield the fits of a task under a scheme."""
    train, test = fold.train, fold.test
    if task == "worst four":
        train, test = (which & np.isin(known.state, WORST) for which in (train, test))
    left_out = sorted({*known.state} - {HEALTHY}) if task == "unseen state" else [None]
    for state in left_out:
        taught, asked = train & (known.state != state), test
        if state is not None:
            asked = test & (known.state == state)
        for load in np.unique(known.load) if scheme != "one model" else [None]:
            here = known.load == load if load is not None else np.ones(len(train), dtype=bool)
            labels, source = known.state, taught & here
            if scheme == "load left out":
                source = taught & (~here | (known.state == HEALTHY))
            if scheme == "one model":
                labels = np.array([f"{s} at {x}" for s, x in zip(*known[1:3], strict=True)])
            if not (asked & here).any():
                continue
            told = family if task in ("families", "unseen state") else str
            answers = {
                str(label): told(str(label).partition(" at ")[0])
                for label in np.unique(labels[source])
            }
            of_load = load if scheme == "per load" else None
            yield Case(source, asked & here, labels, answers, of_load)


def decide(method: Any, task: str, scheme: str, known: Recordings, fold: Fold) -> NDArray:
    """Return a decision for each recording, "" for those that are not tested."""
    decided = np.full(len(known.X), "", dtype="U40")
    for case in cases(task, scheme, known, fold):
        table = method.table(known, fold, case.load)
        labels = case.labels[case.train]
        model = method.classifier(case.answers).fit(table[case.train], labels)
        found = model.predict(table[case.test])
        decided[case.test] = [case.answers.get(label, label) for label in map(str, found)]
    return decided


def decide_all(
    method: Any, plan: list[tuple[str, str]], known: Recordings, folds: list[Fold]
) -> dict[tuple[str, str], NDArray]:
    """Return the decisions on each task under each scheme, from all folds."""
    decided = {asked: np.full(len(known.X), "", dtype="U40") for asked in plan}
    for fold in folds:
        for asked in plan:
            found = decide(method, *asked, known, fold)
            decided[asked][fold.test] = found[fold.test]
        method.forget(fold)
    return decided


def row(task: str, known: Recordings, decided: NDArray) -> dict[str, float]:
    """Return balanced accuracy and its interval."""
    told = family if task in ("families", "unseen state") else str
    truth = np.array([told(state) for state in known.state])
    right = (truth == decided).astype(float)
    names, cells = np.unique(truth, return_inverse=True)
    if task == "unseen state":  # each of a family's states counts alike
        names, cells = np.unique(known.state, return_inverse=True)
    cells = np.where(decided == "", -1, cells)
    groups = known.run if len(np.unique(known.run[decided != ""])) >= FEW_RUNS else known.group
    if task == "unseen state":
        right *= _weights(names, cells)
    value, low, high = GroupBootstrap().figures({"rate": Tally(right, cells)}, groups).values()
    return {"balanced_accuracy": value, "low": max(low, 0.0), "high": min(high, 1.0)}


def _weights(names: NDArray[Any], cells: NDArray[np.intp]) -> NDArray[np.float64]:
    """Weigh states so that their mean is that over families."""
    states = [str(names[k]) for k in np.unique(cells[cells >= 0])]
    families = [family(state) for state in states]
    shares = {s: 1 / families.count(family(s)) / len(set(families)) * len(states) for s in states}
    return np.array([shares.get(str(names[k]), 0.0) if k >= 0 else 0.0 for k in cells])


def read(path: Path) -> Recordings:
    """Read a file, and print the warnings of the loader."""
    with warnings.catch_warnings(record=True) as remarks:
        warnings.simplefilter("always")
        X, states, frame = load_cranfield(path)
    for remark in remarks:
        print(f"{path.name}: {remark.message}")
    return Recordings(X, states, *(frame[name].to_numpy() for name in ("load", "run", "group")))


def joined(train: Recordings, test: Recordings) -> tuple[Recordings, list[Fold]]:
    """Join two files, without copies, and hold out the second."""
    currents = [np.stack([x.signals["current"] for x in part.X]) for part in (test, train)]
    new = cdist(*currents, "chebyshev").min(axis=1) > COPY
    if not new.all():
        print(f"{np.sum(~new)} test sequences are copies of training sequences and were left out.")
    test = test.take(new)
    # A later file may number runs and repetitions from 1 again.
    run, group = (column.astype(int) + 100_000 for column in (test.run, test.group))
    apart = test._replace(run=run, group=group)
    both = Recordings(
        train.X + apart.X,
        *(np.concatenate(pair) for pair in zip(train[1:], apart[1:], strict=True)),
    )
    held_out = np.arange(len(both.X)) >= len(train.X)
    return both, [Fold(~held_out, held_out, "later runs")]


def folds_by_run(known: Recordings) -> list[Fold]:
    """Leave out each run in turn."""
    return [Fold(known.run != run, known.run == run, f"run {run}") for run in np.unique(known.run)]


def chosen_file(options: argparse.Namespace) -> Path:
    """Return the given file, or the one below EMACM_DATA, or exit."""
    folder = os.environ.get("EMACM_DATA")
    files = sorted(Path(folder).glob("cranfield_ema/cranfield*.npz")) if folder else []
    if options.train is None and not files:
        print("no recordings: give --train FILE, or set EMACM_DATA to the folder that has them")
        raise SystemExit(0 if options.quick else 2)
    return options.train or files[0]


def compare(known: Recordings, folds: list[Fold], quick: bool) -> list[dict]:
    """Measure every method on every task."""
    rows = []
    for name, method in METHODS.items():
        start = time.perf_counter()
        plan = [
            (task, scheme)
            for task, schemes in PLAN.items()
            for scheme in (schemes[-1:] if quick else schemes)
        ]
        rows += [
            {"task": task, "scheme": scheme, "method": name} | row(task, known, found)
            for (task, scheme), found in decide_all(method, plan, known, folds).items()
        ]
        print(f"{name}: {time.perf_counter() - start:.0f} s", flush=True)
    return rows


def control(known: Recordings, folds: list[Fold], draws: int) -> pd.DataFrame:
    """Measure whether the recipe depends on the shaft angle of the 1x component."""
    cuts = {"alike": cut_alike(known.X)}
    cuts |= {f"at random, draw {k}": cut_at_random(known.X, k) for k in range(1, draws + 1)}
    asked = "13 states", "per load"
    table: dict[str, dict[str, float]] = {}
    for cut, recordings in cuts.items():
        moved = known._replace(X=recordings)
        table[cut] = {}
        for name, phase in (("emacm", False), ("emacm with phase", True)):
            decided = decide_all(Recipe(phase=phase), [asked], moved, folds)[asked]
            table[cut][name] = row(asked[0], known, decided)["balanced_accuracy"]
    return pd.DataFrame(table)


def print_table(rows: list[dict]) -> None:
    """Print one row for each task and scheme, one column for each method."""
    frame = pd.DataFrame(rows)
    frame["cell"] = [f"{r['balanced_accuracy']:.3f} ({r['low']:.2f}-{r['high']:.2f})" for r in rows]
    table = frame.pivot_table(
        index=["task", "scheme"], columns="method", values="cell", aggfunc="first", sort=False
    )
    with pd.option_context("display.width", 200, "display.max_columns", None):
        print(f"\nbalanced accuracy (95 %)\n{table.fillna('').to_string()}")


def main() -> None:
    """Measure, print the table and the relevant features, and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--train", type=Path, help="file; default: the one below EMACM_DATA")
    parser.add_argument("--test", type=Path, help="file of later runs; default: each run in turn")
    parser.add_argument("--train-runs", type=int, help="train on so many runs, test on the others")
    json_option(parser)
    parser.add_argument("--quick", action="store_true", help="few states, loads, runs, schemes")
    options = parser.parse_args()
    file = chosen_file(options)
    print(header())
    known = read(file)
    if options.quick:
        known = few(known)
    if options.test:
        later = read(options.test)
        known, folds = joined(known, few(later) if options.quick else later)
    elif options.train_runs:
        early = known.run <= options.train_runs
        folds = [Fold(early, ~early, f"runs after {options.train_runs}")]
    else:
        folds = folds_by_run(known)
    print(f"{len(known.X)} recordings; held out: {', '.join(fold.name for fold in folds)}")
    print(f"variants tried until the recipe was fixed: {TRIED}")
    for name in missing_methods():
        print(f"{name} left out: aeon is not installed (pip install 'emacm[bench]')")
    with threadpool_limits(1):  # many small problems, for which threads are slower
        rows = compare(known, folds, options.quick)
        print_table(rows)
        found = control(known, folds, 1 if options.quick else 3).round(3)
    print(
        f"\ncontrol: 13 states per load, with the ends of all strokes cut off\n{found.to_string()}"
    )
    kinds, orders = separations(known, folds[0])
    print("\nfeatures that separate the states (emacm, per load): shares of squared distances")
    print(
        f"{kinds.round(3).to_string()}\n\nspectral features by order\n{orders.round(3).to_string()}"
    )
    print(REMARKS)
    write_json(options, rows)


def few(known: Recordings, n_runs: int = 2) -> Recordings:
    """Return two sequences of seven states, two loads and some runs each."""
    frame = pd.DataFrame({name: getattr(known, name) for name in ("state", "load", "run")})
    first = {"load": np.unique(known.load)[:2], "run": np.unique(known.run)[:n_runs]}
    kept = frame[[*first]].isin(first).all(axis=1) & (frame.groupby([*frame]).cumcount() < 2)
    return known.take(kept & ~frame["state"].str.fullmatch("spalling[1-6]"))


if __name__ == "__main__":
    main()
