"""A simulated pump whose bearing wears out, measured into a CSV file that grows.

    python wearing_pump.py live.csv [--seconds 150] [--factor 5]

Columns are those of `emacm example`: time, vibration and speed, 4,000 rows per second of the pump.
The defect of the outer ring begins after a third of the time, and grows exponentially from a
twentieth of its final size, which is that of the recordings of `emacm example`.
"""

import argparse
import time

import numpy as np
import pandas as pd

from emacm.simulation.example_files import simulate_pump


def wearing_pump(seconds: float, seed: int = 0) -> pd.DataFrame:
    """Return the table of a pump that wears out: time [s], vibration [g] and speed [rpm]."""
    # The same random numbers: what differs are the impacts of the defect.
    healthy, worn = (
        simulate_pump(state, np.random.default_rng(seed), duration=seconds)
        for state in ("healthy", "outer")
    )
    share = healthy["time [s]"] / seconds
    size = np.where(share < 1 / 3, 0.0, 20.0 ** np.minimum(2 * (share - 1 / 3) - 1, 0))
    vibration, with_impacts = (table["vibration [g]"] for table in (healthy, worn))
    return healthy.assign(
        **{"vibration [g]": (vibration + size * (with_impacts - vibration)).round(4)}
    )


def write_growing(table: pd.DataFrame, path: str, factor: float, block: float = 0.5) -> None:
    """Write a table in blocks of some seconds of its time, which passes faster by a factor."""
    started = time.monotonic()
    table.head(0).to_csv(path, index=False)
    for _, rows in table.groupby((table["time [s]"] / block).astype(int)):
        due = started + rows["time [s]"].iloc[-1] / factor
        time.sleep(max(0.0, due - time.monotonic()))
        rows.to_csv(path, mode="a", header=False, index=False)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("path", metavar="FILE")
    parser.add_argument("--seconds", type=float, default=150.0, help="life of the pump [s]")
    parser.add_argument("--factor", type=float, default=5.0, help="how much faster it is written")
    options = parser.parse_args()
    write_growing(wearing_pump(options.seconds), options.path, options.factor)
