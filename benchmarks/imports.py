"""How long an import takes beyond scikit-learn's own.

Each runs in an interpreter of its own, in turns. Run from the repository:

    python benchmarks/imports.py [--quick] [--json [FILE]]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Callable

from measure import header, json_option, medians, table, write_json

PIPELINE = "from sklearn.pipeline import make_pipeline"
CORE = "from emacm import BinTransformer, CostSensitiveGaussianBayes, OrderPSD, OrderResampler"
STATEMENTS = ("import sklearn", PIPELINE, "import emacm", CORE, "from emacm import *")
OPTIONAL = ("numba", "matplotlib", "polars", "tqdm")


def interpreter(code: str) -> Callable[[], str]:
    """Return a function that runs code in a new interpreter, and returns what it prints."""

    def run() -> str:
        command = [sys.executable, "-W", "error", "-c", code]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    return run


def main() -> None:
    """Measure, print the table and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="once")
    json_option(parser)
    options = parser.parse_args()
    starts = {code: interpreter(code) for code in STATEMENTS}
    spent = medians(starts, 1 if options.quick else 15, warm_up=not options.quick)
    base = spent["import sklearn"]
    rows = [{"statement": c, "s": t, "beyond sklearn [s]": t - base} for c, t in spent.items()]
    print(header())
    print(table(rows))
    code = f"import sys; from emacm import *; print(*sorted(set({OPTIONAL}) & set(sys.modules)))"
    print("optional packages imported with all of emacm:", interpreter(code)().strip() or "none")
    write_json(options, rows)


if __name__ == "__main__":
    main()
