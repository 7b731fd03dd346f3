"""Files of a simulated pump, with which every example of README runs."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import scipy  # scipy.io is imported when it is used

from emacm.machine.fault_orders import fault_orders
from emacm.machine.rolling import bearing_of
from emacm.simulation.impacts import Array, ball_passage, ringing

BEARING = bearing_of("6205")


def simulate_pump(
    state: str,
    rng: np.random.Generator,
    *,
    fs: float = 4000.0,
    duration: float = 3.0,
    constant: float | None = None,
) -> pd.DataFrame:
    """Return a recording of a pump on a 6205 bearing as a table; all its sizes are assumed.

    Parameters
    ----------
    state : {"healthy", "outer", "inner"}
        Healthy, or a defect of the outer or inner ring of its bearing.
    rng : Generator
        Random numbers.
    fs : float
        Sampling rate [Hz].
    duration : float
        Duration [s].
    constant : float, optional
        Constant speed [rpm].

    Returns
    -------
    DataFrame
        Columns "time [s]", "vibration [g]" and "speed [rpm]".

    Examples
    --------
    >>> simulate_pump("outer", np.random.default_rng(0), fs=1000, duration=2).shape
    (2000, 3)
    """
    times = np.arange(round(duration * fs)) / fs
    speed = rng.uniform(1000, 1400) + 60 * np.sin(0.8 * np.pi * times)
    speed = speed if constant is None else np.full(len(times), constant)
    angle = np.cumsum(speed) * (np.pi / 30 / fs)
    # In zones A and B of ISO 20816-3 (group 2, rigid): 1.5 mm/s from 10 to 1000 Hz.
    vibration = 0.1 * rng.standard_normal(len(times)) + rng.uniform(0.01, 0.02) * np.sin(angle)
    if state != "healthy":
        vibration += _vibration_of_defect(state, angle, fs, rng)
    columns = {"time [s]": times.round(6), "vibration [g]": vibration.round(5)}
    return pd.DataFrame(columns | {"speed [rpm]": speed.round(1)})


def _vibration_of_defect(state: str, angle: Array, fs: float, rng: np.random.Generator) -> Array:
    """Return what the rolling elements excite that pass a defect."""
    kind, turns = {"outer": ("BPFO", 0.0), "inner": ("BPFI", 1.0)}[state]
    order = float(fault_orders(BEARING)["order"][kind])
    passage = ball_passage(order, angle, rng, turns_with=turns)
    size = np.exp(0.2 * rng.standard_normal())  # of this recording
    # The housing rings with 9 times the noise of 0.1 g; a slow part of 0.25 g decays in 3 ms.
    response = 0.9 * ringing(fs, 1300, 0.06, 0.02)
    response += 0.25 * np.exp(-np.arange(len(response)) / (0.003 * fs))
    return np.convolve(size * passage.force, response)[: len(angle)]


def write_example(folder: Path) -> list[Path]:
    """Write the files that README's examples read.

    Parameters
    ----------
    folder : Path
        A folder; it must be empty or not exist.

    Returns
    -------
    list of Path
        What was written: ``run.csv``, ``bearing.mat`` (a defect of the inner ring), ``parts.toml``
        (the bearing), ``live.csv`` (a minute), and the folders ``bench`` (four units of each state,
        three runs each), ``healthy`` (20 runs of each of two units) and ``new`` (later runs of
        these two, without a state in their names; the last of M has a defect of the outer ring,
        that of N of the inner one).

    Raises
    ------
    FileExistsError
        If the folder has files.
    """
    if folder.is_dir() and any(folder.iterdir()):
        raise FileExistsError(f"the folder {str(folder)!r} has files. Name an empty one.")
    for name in ("bench", "healthy", "new"):
        (folder / name).mkdir(parents=True)
    for seed, (path, state) in enumerate(_runs(folder)):
        simulate_pump(state, np.random.default_rng(seed)).to_csv(path, index=False)
    rng = np.random.default_rng(2027)
    simulate_pump("healthy", rng).to_csv(folder / "run.csv", index=False)
    simulate_pump("inner", rng, duration=61).to_csv(folder / "live.csv", index=False)
    steady = partial(simulate_pump, rng=rng, fs=12_000, duration=4, constant=1797)
    ends = {"X105_DE_time": "inner", "X105_FE_time": "healthy"}
    signals = {name: steady(state)[["vibration [g]"]].to_numpy() for name, state in ends.items()}
    scipy.io.savemat(folder / "bearing.mat", signals)
    parts = ("n_balls", "ball_diameter", "pitch_diameter")
    lines = [f"{name} = {getattr(BEARING, name)}\n" for name in parts]
    (folder / "parts.toml").write_text("[[Bearing]]\n" + "".join(lines), encoding="utf-8")
    return sorted(folder.iterdir())


def _runs(folder: Path) -> Iterator[tuple[Path, str]]:
    """Yield the files of the folders, and their states."""
    for number, unit in enumerate("ABCDEFGHIJKL"):
        state = ("healthy", "outer", "inner")[number % 3]
        for run in (1, 2, 3):
            yield folder / "bench" / f"{unit}_{state}_{run:02d}.csv", state
    for unit, fault in (("M", "outer"), ("N", "inner")):
        for run in range(1, 24):
            state = fault if run == 23 else "healthy"
            name = f"healthy/{unit}_healthy_{run:02d}.csv" if run <= 20 else f"new/{unit}_{run}.csv"
            yield folder / name, state
