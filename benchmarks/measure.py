"""What the benchmarks share: timing in turns, the machine they ran on, writing results."""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import scipy
import sklearn

import emacm


def medians(
    variants: Mapping[str, Callable[[], object]],
    repeats: int,
    *,
    clock: Callable = time.perf_counter,
    warm_up: bool = True,
) -> dict[str, float]:
    """Return the median seconds of each variant, in turns, by default after one to warm up."""
    spent: dict[str, list[float]] = {name: [] for name in variants}
    for turn in range(repeats + warm_up):
        for name, run in variants.items():
            start = clock()
            run()
            if turn >= warm_up:
                spent[name].append(clock() - start)
    return {name: statistics.median(values) for name, values in spent.items()}


def machine() -> dict[str, str]:
    """Say what it was measured on."""
    threads = os.environ.get("OPENBLAS_NUM_THREADS", "all")
    return {
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "threads of the linear algebra": threads,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "scikit-learn": sklearn.__version__,
        "numba": _version("numba"),
        "emacm": emacm.__version__,
    }


def header() -> str:
    """Return the machine and the versions on one line."""
    return ", ".join(f"{name} {value}" for name, value in machine().items())


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return rows as text, a column for each of their keys."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    cells = [columns] + [[_cell(row.get(column)) for column in columns] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = [
        "  ".join(
            cell.ljust(width) if k == 0 else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(line, widths, strict=True))
        )
        for line in cells
    ]
    return "\n".join(line.rstrip() for line in lines)


def json_option(parser: argparse.ArgumentParser) -> None:
    """Add the option by which a benchmark writes its figures."""
    parser.add_argument(
        "--json",
        type=Path,
        nargs="?",
        const=Path(__file__).parent / "results" / f"{Path(sys.argv[0]).stem}.json",
        help="write the figures to this file, by default to results/; not with --quick",
    )


def write_json(options: argparse.Namespace, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows, and what they were measured on, if asked for and all was measured."""
    if options.json is None or options.quick:
        return
    when = datetime.now(UTC).date().isoformat()
    found = {"arguments": sys.argv[1:], "date": when, "machine": machine()}
    lines = ",\n  ".join(json.dumps(row, default=_number) for row in rows)
    text = f'{json.dumps(found, indent=1)[:-2]},\n "rows": [\n  {lines}\n ]\n}}\n'
    options.json.parent.mkdir(exist_ok=True)
    options.json.write_text(text, encoding="utf-8")


def _number(value: Any) -> Any:
    """Return the Python number of one of NumPy."""
    return value.item()


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _version(package: str) -> str:
    if find_spec(package) is None:
        return "none"
    return __import__(package).__version__


def _processor() -> str:
    """Return the name of the processor, as Linux has it where it does."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
