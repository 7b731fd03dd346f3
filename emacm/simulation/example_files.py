"""Files of a simulated pump, with which every example of README runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import scipy  # scipy.io is imported when it is used

from emacm.machine.fault_orders import fault_orders
from emacm.machine.rolling import Bearing
from emacm.simulation.faults import Fault, ball_passage
from emacm.simulation.waves import Array


@dataclass(frozen=True)
class PumpSettings:
    """A pump on a 6205 bearing; all but its geometry is assumed.

    Attributes
    ----------
    n_balls, ball_diameter, pitch_diameter : float
        Geometry of the bearing [mm].
    speeds : tuple of float
        Range of the mean speed of a recording [rpm].
    ripple : float
        Amplitude of the ripple of the speed, of 0.4 Hz [rpm].
    resonance, damping : float
        Frequency [Hz] and damping ratio of the housing, which impacts excite.
    impact : float
        Mean amplitude of the ringing after an impact, relative to the noise of 1 g.
    static : float
        Mean amplitude of the slow part of an impact, which decays in 3 ms.
    scatter : float
        Standard deviation of the logarithm of both from recording to recording.
    """

    n_balls: int = 9
    ball_diameter: float = 7.94
    pitch_diameter: float = 39.04
    speeds: tuple[float, float] = (1000.0, 1400.0)
    ripple: float = 60.0
    resonance: float = 1300.0
    damping: float = 0.06
    impact: float = 9.0
    static: float = 2.5
    scatter: float = 0.2


PUMP = PumpSettings()


def simulate_pump(
    state: str,
    rng: np.random.Generator,
    *,
    fs: float = 4000.0,
    duration: float = 3.0,
    constant: float | None = None,
) -> pd.DataFrame:
    """Return a recording of a pump as a table.

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
    speed = rng.uniform(*PUMP.speeds) + PUMP.ripple * np.sin(0.8 * np.pi * times)
    speed = speed if constant is None else np.full(len(times), constant)
    angle = np.cumsum(speed) * (np.pi / 30 / fs)
    vibration = rng.standard_normal(len(times)) + rng.uniform(1, 2) * np.sin(angle)
    if state != "healthy":
        vibration += _impacts(state, angle, fs, rng)
    columns = {"time [s]": times.round(6), "vibration [g]": vibration.round(4)}
    return pd.DataFrame(columns | {"speed [rpm]": speed.round(1)})


def _impacts(state: str, angle: Array, fs: float, rng: np.random.Generator) -> Array:
    """Return what the rolling elements excite that pass a defect."""
    bearing = Bearing(PUMP.n_balls, PUMP.ball_diameter, PUMP.pitch_diameter)
    kind, turns = {"outer": ("BPFO", 0.0), "inner": ("BPFI", 1.0)}[state]
    order = float(fault_orders(bearing)["order"][kind])
    passage = ball_passage(Fault(orders=(order,), rolls=True, turns_with=turns), angle, rng)
    struck = np.zeros(len(angle))
    size = np.exp(PUMP.scatter * rng.standard_normal())
    struck[passage.impacts] = size * passage.sizes * passage.weight[passage.impacts]
    after = np.arange(round(0.02 * fs)) / fs
    ringing = np.exp(-2 * np.pi * PUMP.damping * PUMP.resonance * after)
    answer = PUMP.impact * ringing * np.sin(2 * np.pi * PUMP.resonance * after)
    answer += PUMP.static * np.exp(-after / 0.003)
    return np.convolve(struck, answer)[: len(angle)]


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
        these two, of which the last ones have a fault).

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
    ends = [steady(state)["vibration [g]"] for state in ("inner", "healthy")]
    signals = [end.to_numpy()[:, np.newaxis] for end in ends]
    names = ("X105_DE_time", "X105_FE_time")
    scipy.io.savemat(folder / "bearing.mat", dict(zip(names, signals, strict=True)))
    parts = ("n_balls", "ball_diameter", "pitch_diameter")
    lines = [f"{name} = {getattr(PUMP, name)}\n" for name in parts]
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
            place = folder / ("healthy" if run <= 20 else "new")
            yield place / f"{unit}_{state}_{run:02d}.csv", state
