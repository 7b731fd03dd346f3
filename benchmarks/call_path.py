"""How many modules one call passes through: a measure of how far its code is spread.

Traces the following by `sys.setprofile`, after one call that fills what is remembered between calls
(filters, windows), and prints the number of different modules of emacm that are entered beside
the number that is allowed. Compiled loops are not traced.

- `OrderResampler.transform` and `OrderPSD.transform` of one recording,
- all steps of `actuator_recipe` before its classifier, for one recording,
- `fit` of that classifier, with an unknown state,
- `score` of one recording, by the four estimators of the thesis and by that recipe,
- `emacm score` of a folder with two files of the example pump.

The columns beside it are the changes of module (calls whose caller, the next function of emacm on
the stack, is in another module, and the returns from them), the largest number of nested calls, and
the climbs: pairs of modules of which the first one calls the second one, although it stands in
a room above it that does not know it (callbacks, and methods that a subclass overrides). With
`--calls` also the modules in the order in which they are entered.

Run from the repository:

    python benchmarks/call_path.py [--quick] [--json [FILE]] [--calls]
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from measure import header, json_option, table, write_json
from sklearn.base import clone
from sklearn.pipeline import make_pipeline

from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    OrderPSD,
    OrderResampler,
    Recording,
    actuator_recipe,
    score,
)
from emacm.__main__ import main as command

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from test_structure import ORDER, place


class Trace:
    """Calls of functions of emacm while a function runs.

    Attributes
    ----------
    modules : list of str
        Modules that were entered, in this order.
    changes : Counter of (caller, callee)
        Calls from one module into another.
    depth : int
        Largest number of nested calls.
    """

    def __init__(self, function: Callable[[], Any]) -> None:
        self.modules: list[str] = []
        self.changes: Counter[tuple[str, str]] = Counter()
        self.depth = 0
        self._stack: list[tuple[Any, str]] = []
        sys.setprofile(self._note)
        try:
            function()
        finally:
            sys.setprofile(None)

    def _note(self, frame: Any, event: str, _: Any) -> None:
        module = frame.f_globals.get("__name__", "")
        if not module.startswith("emacm."):
            return
        if event == "return" and self._stack and self._stack[-1][0] is frame:
            self._stack.pop()
        if event != "call":
            return
        if module not in self.modules:
            self.modules.append(module)
        if self._stack and self._stack[-1][1] != module:
            self.changes[self._stack[-1][1], module] += 1
        self._stack.append((frame, module))
        self.depth = max(self.depth, len(self._stack))

    def climbs(self) -> list[tuple[str, str]]:
        """Return the pairs of modules that the order of the rooms does not show."""
        return [
            (caller, callee)
            for caller, callee in self.changes
            if ORDER.index(place(callee)) > ORDER.index(place(caller))
        ]


def scored_files() -> Trace:
    """Trace ``emacm score`` of two files, the second time that it runs."""
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        os.chdir(folder)
        try:
            command(["example", "."])
            names = ["--meta", "{unit}_{state}_{run:d}"]
            command(["inspect", "bench/A_healthy_01.csv", "--draft", "layout.toml", *names])
            learn = ["--labels", "state", "--groups", "unit", "--out", "model.skops"]
            command(["train", "layout.toml", "bench", *learn])
            Path("few").mkdir()
            for file in sorted(Path("new").iterdir())[:2]:
                shutil.copy(file, "few")
            decide = ["score", "model.skops", "few", "--layout", "layout.toml"]
            command(decide)
            return Trace(lambda: command(decide))
        finally:
            os.chdir(here)


def recording(seed: int) -> Recording:
    """Four strokes to and fro, of 6.5, 6.5, 6.5 and 2 revolutions; two channels of one rate."""
    rng = np.random.default_rng(seed)
    fs, speeds = 600, []
    for sign, revolutions in ((1, 6.5), (-1, 6.5), (1, 6.5), (-1, 2.0)):
        peak = np.pi / 2 * revolutions * 2 * np.pi / 2.0
        speeds += [sign * peak * np.sin(np.pi * np.arange(1200) / 1200), np.zeros(90)]
    velocity = np.concatenate(speeds)
    angle = np.cumsum(velocity) / fs
    torque = np.sin(2 * angle) + 0.1 * rng.normal(size=len(angle))
    current = 3 * torque + 0.2 * rng.normal(size=len(angle))
    signals = {"torque": torque, "current": current}
    return Recording(signals, fs, velocity=velocity, meta={"load": 20})


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="and what happens only once")
    json_option(parser)
    parser.add_argument("--calls", action="store_true", help="list changes of module and calls")
    options = parser.parse_args()
    runs, labels, units = [recording(seed) for seed in range(12)], list("ab" * 6), [0, 0, 1, 1] * 3
    fresh = [recording(seed) for seed in (20, 21)]
    resampler = OrderResampler(2 * np.pi / 32).fit(runs)
    spectra = OrderPSD(4, max_order=10).fit(resampler.transform(runs))
    model = actuator_recipe(max_order=6).fit(runs, labels, costsensitivegaussianbayes__groups=units)
    chain = make_pipeline(
        resampler,
        spectra,
        BinTransformer(max_order=6),
        CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto", unknown="unknown"),
    ).fit(runs, labels, costsensitivegaussianbayes__groups=units)
    table_of_features = model[:-1].transform(runs)

    def traced(recording: Recording) -> dict[str, tuple[Trace, int | None]]:
        made = Trace(lambda: resampler.transform([recording]))
        over_angle = resampler.transform([recording])
        return {
            "OrderResampler.transform": (made, 8),
            "OrderPSD.transform": (Trace(lambda: spectra.transform(over_angle)), 12),
            "actuator_recipe[:-1].transform": (
                Trace(lambda: model[:-1].transform([recording])),
                None,
            ),
            "fit of its classifier": (
                Trace(lambda: clone(model[-1]).fit(table_of_features, labels, groups=units)),
                12,
            ),
            "score, thesis": (Trace(lambda: score(chain, [recording])), 18),
            "score, actuator_recipe": (Trace(lambda: score(model, [recording])), None),
        }

    if not options.quick:  # the first time, more is imported and remembered
        traced(fresh[0])
    traces = traced(fresh[1]) | {"emacm score": (scored_files(), None)}
    rows = [
        {
            "call": name,
            "modules": len(trace.modules),
            "at most": limit,
            "changes of module": 2 * trace.changes.total(),
            "depth": trace.depth,
            "climbs": len(trace.climbs()),
        }
        for name, (trace, limit) in traces.items()
    ]
    print(header())
    print(table(rows))
    if options.calls:
        for name, (trace, _) in traces.items():
            print(f"\n{name}", "modules:", *trace.modules, sep="\n    ")
            for (caller, callee), count in trace.changes.most_common():
                print(f"{count:5d} {caller} -> {callee}")
    write_json(options, rows)


if __name__ == "__main__":
    main()
