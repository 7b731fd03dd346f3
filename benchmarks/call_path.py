"""How many modules one recording passes through, and how often its strokes are found.

Traces `OrderPSD.transform` and the `transform` of all steps of `actuator_recipe` before the
classifier for one recording, by `sys.setprofile`, after one call that fills what is remembered
between calls (filters, windows). Compiled loops are not traced. Prints, for the functions of
emacm:

- modules: number of different modules that are entered,
- changes of module: calls whose caller (the next function of emacm on the stack) is in another
  module, and the returns from them,
- depth: largest number of nested calls,
- strokes: how often the strokes of the recording are found in its velocity,
- resamplings: how often signals of one sampling rate are resampled along one stroke.

With `--calls` also the modules in the order in which they are entered. When all modules were in one
folder, `OrderPSD.transform` entered 19 of them, with 584 changes and a depth of 22.

Run from the repository:

    python benchmarks/call_path.py [--quick] [--json FILE] [--calls]
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from measure import header, table, write_json

from emacm import OrderPSD, OrderResampler, Recording, actuator_recipe

FINDING = {("emacm.shaft.strokes", "strokes_of")}
RESAMPLING = {
    ("emacm.resampling.spreading", "outputs"),
    ("emacm.resampling.angle_recording", "interpolated"),
}


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
    deepest : list of str
        These calls.
    calls : Counter of (module, function)
        Calls of each function; a generator counts once.
    """

    def __init__(self, function: Callable[[], Any]) -> None:
        self.modules: list[str] = []
        self.changes: Counter[tuple[str, str]] = Counter()
        self.depth = 0
        self.deepest: list[str] = []
        self.calls: Counter[tuple[str, str]] = Counter()
        self._stack: list[tuple[Any, str]] = []
        self._started: set[int] = set()
        self._frames: list[Any] = []  # kept alive, so that no two frames have one id
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
        if len(self._stack) > self.depth:
            self.depth = len(self._stack)
            self.deepest = [f"{m}.{f.f_code.co_name}" for f, m in self._stack]
        if id(frame) not in self._started:
            self._started.add(id(frame))
            self._frames.append(frame)
            self.calls[module, frame.f_code.co_name] += 1

    def row(self) -> list[int]:
        """Return the numbers of the table."""
        found, resampled = (sum(self.calls[name] for name in s) for s in (FINDING, RESAMPLING))
        return [
            len(self.modules), 2 * self.changes.total(), self.depth, found, resampled
        ]  # fmt: skip


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
    parser.add_argument("--quick", action="store_true", help="no difference: it takes seconds")
    parser.add_argument("--json", type=Path, help="file for the figures")
    parser.add_argument("--calls", action="store_true", help="list changes of module and calls")
    options = parser.parse_args()
    runs = [recording(seed) for seed in range(6)]
    resampler = OrderResampler(2 * np.pi / 32).fit(runs)
    spectra = OrderPSD(4, max_order=10).fit(resampler.transform(runs))
    features = actuator_recipe(max_order=6)[:-1].fit(runs, list("ababab"))
    fresh = [recording(seed) for seed in (7, 8, 9, 10)]
    spectra.transform(resampler.transform(fresh[:1]))
    features.transform(fresh[1:2])
    over_angle = resampler.transform(fresh[2:3])
    traces = {
        "OrderPSD.transform": Trace(lambda: spectra.transform(over_angle)),
        "actuator_recipe": Trace(lambda: features.transform(fresh[3:4])),
    }
    columns = ["modules", "changes of module", "depth", "strokes", "resamplings"]
    rows = [{"through": n} | dict(zip(columns, t.row(), strict=True)) for n, t in traces.items()]
    print(header())
    print(table(rows))
    if options.calls:
        for name, trace in traces.items():
            print(f"\n{name}", "modules:", *trace.modules, sep="\n    ")
            print("deepest:", *trace.deepest, sep="\n    ")
            for (caller, callee), count in trace.changes.most_common():
                print(f"{count:5d} {caller} -> {callee}")
            for (module, function), count in trace.calls.most_common(40):
                print(f"{count:5d} {module}.{function}")
    write_json(options.json, rows)


if __name__ == "__main__":
    main()
