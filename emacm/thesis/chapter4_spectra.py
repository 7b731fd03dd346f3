"""Order spectra of the laboratory campaign of chapter 4: each recording simulated once."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from numpy.typing import NDArray

from emacm.orders.order_psd import OrderPSD
from emacm.recordings.recording import Recording
from emacm.resampling.order_resampler import OrderResampler
from emacm.simulation.campaign import LaboratoryRecordings, laboratory_recordings, thesis_benches
from emacm.simulation.faults import POLE_PAIRS

SIGNALS = {  # channel: what the thesis calls it
    "lvdt": "LVDT",
    "velocity": "Motor Velocity",
    "current_a": "Current",
    "accelerometer": "Y Accelerometer",
}
UNITS = {"lvdt": "in", "velocity": "rad/s", "current_a": "A", "accelerometer": "g"}
REVOLUTIONS = 8  # of a segment; the thesis gives no L. Condition 1 makes 14 in 10 s of travel.
MIN_SPEED = 1.0  # rad/s; below it the noise of the resolver cuts strokes
_COMMAND = (0.0, 1.0)  # orders of the commanded motion, slower than a revolution
_FUNDAMENTAL = (POLE_PAIRS - 0.4, POLE_PAIRS + 0.4)  # chapter 3: 5.6 to 6.4


@dataclass(frozen=True)
class Reading:
    """One way to read what chapter 4 says, and leaves open, of its feature extraction.

    Parameters
    ----------
    note : str
        What it means, in words.
    theta_s : float
        Angle between samples [rad].
    direction : {"travel", "strokes"}
        How reversals are met, as for `OrderResampler`.
    antialias : bool
        False: linear interpolation, Eq. (2.13).
    filtered : bool
        Whether a stop band takes out what the command itself makes: the fundamental of the current
        as in chapter 3, and of the other signals what is slower than a revolution (assumed).
    """

    note: str
    theta_s: float = 0.01 * np.pi
    direction: str = "travel"
    antialias: bool = False
    filtered: bool = True

    @property
    def max_order(self) -> float:
        """Highest order: π/theta_s."""
        return float(round(np.pi / self.theta_s, 9))

    def stop_bands(self, channel: str) -> tuple[tuple[float, float], ...]:
        """Return what the ideal band-stop filter takes out of a channel [orders]."""
        if not self.filtered:
            return ()
        return (_FUNDAMENTAL if channel.startswith("current") else _COMMAND,)

    @property
    def resampler(self) -> OrderResampler:
        """From time to shaft angle."""
        return OrderResampler(
            self.theta_s,
            interpolation="linear",
            antialias=self.antialias,
            direction=self.direction,
            min_speed=MIN_SPEED,
            channels=list(SIGNALS),
        )

    def spectra(self, recording: Recording) -> dict[str, pd.DataFrame]:
        """Return the order spectra of a recording by channel, of one row each [unit²/order]."""
        psd = OrderPSD(REVOLUTIONS, short="pad").set_output(transform="pandas")
        table = psd.fit_transform(self.resampler.fit_transform([recording]))
        n_orders = len(psd.orders_)
        starts = {name: number * n_orders for number, name in enumerate(SIGNALS)}
        return {name: table.iloc[:, start : start + n_orders] for name, start in starts.items()}


READINGS = {
    "thesis": Reading("linear interpolation over the travel, 100 orders, filtered"),
    "no filter": Reading("as above, without stop bands", filtered=False),
    "50 orders": Reading("θ_s = 0.02π as Table 4.4 prints it", theta_s=0.02 * np.pi),
    "band-limited": Reading("no order from above 100 folds in", antialias=True),
    "strokes": Reading("each stroke by itself", direction="strokes"),
}


@dataclass(frozen=True)
class Campaign:
    """What is known of a pair of units after all their runs.

    Attributes
    ----------
    frame : DataFrame
        A row a recording: "unit", "condition", "run", "label", "severity", "health" ("healthy" or
        "degraded") and "training" (whether it is one of the first half of the runs).
    spectra : dict of str to dict of str to DataFrame of shape (n_recordings, n_orders)
        Order spectra by reading and channel [unit²/order].
    kept : dict of int to Recording
        The first run of each unit in each condition, by row, if it was to be kept.
    """

    frame: pd.DataFrame
    spectra: dict[str, dict[str, pd.DataFrame]]
    kept: dict[int, Recording]

    def chosen(self, conditions: Collection[int], *, training: bool) -> NDArray[np.bool_]:
        """Tell which recordings are of these conditions, and for training or for test."""
        mask = self.frame["condition"].isin(conditions) & (self.frame["training"] == training)
        return mask.to_numpy()


def run_campaign(
    seed: int,
    *,
    n_runs: int = 20,
    readings: Sequence[str] = ("thesis",),
    keep: bool = False,
    n_jobs: int | None = None,
    report: Callable[[str], None] | None = None,
    **constants: Any,
) -> Campaign:
    """Run the two units of the thesis through all conditions; every recording is made once.

    Parameters
    ----------
    seed : int
        Of the units and their runs.
    n_runs : int
        Runs of each unit in each condition; the first half is for training.
    readings : sequence of str
        Keys of `READINGS`.
    keep : bool
        Whether to keep the first runs themselves with their commands, to be drawn.
    n_jobs : int, optional
        Processes; a recording is read, brought to spectra and forgotten in each.
    report : callable, optional
        Is given a line now and then.
    **constants
        Of the benches, as for `LaboratoryBench`.

    Returns
    -------
    Campaign

    Examples
    --------
    >>> campaign = run_campaign(0, n_runs=2, duration=0.1)
    >>> campaign.frame["health"].value_counts().to_dict()
    {'healthy': 10, 'degraded': 10}
    >>> campaign.spectra["thesis"]["lvdt"].shape
    (20, 801)
    """
    benches = thesis_benches(seed=seed, commands=keep, **constants)
    recordings = laboratory_recordings(benches, n_runs=n_runs)
    frame = recordings.frame
    frame["health"] = np.where(frame["label"] == "healthy", "healthy", "degraded")
    frame["training"] = frame["run"] <= n_runs // 2
    tables, kept = estimate(
        recordings, readings, f"units of seed {seed}", keep=keep, n_jobs=n_jobs, report=report
    )
    return Campaign(frame, tables, kept)


def estimate(
    recordings: LaboratoryRecordings,
    readings: Sequence[str],
    called: str,
    *,
    keep: bool = False,
    n_jobs: int | None = None,
    report: Callable[[str], None] | None = None,
) -> tuple[dict[str, dict[str, pd.DataFrame]], dict[int, Recording]]:
    """Bring recordings to spectra, each made, read and forgotten.

    Parameters
    ----------
    recordings : LaboratoryRecordings
        Which.
    readings : sequence of str
        Keys of `READINGS`.
    called : str
        What they are, for `report`.
    keep : bool
        Whether to keep the first runs themselves.
    n_jobs, report
        As for `run_campaign`.

    Returns
    -------
    spectra, kept
        As in `Campaign`.
    """
    runs = recordings.frame["run"].tolist()
    tasks = (
        delayed(_spectra)(recordings[i : i + 1], readings, keep and run == 1)
        for i, run in enumerate(runs)
    )
    rows: list[dict[str, dict[str, pd.DataFrame]]] = []
    kept: dict[int, Recording] = {}
    for number, (spectra, recording) in enumerate(
        Parallel(n_jobs=n_jobs, return_as="generator")(tasks)
    ):
        rows.append(spectra)
        if recording is not None:
            kept[number] = recording
        if report is not None and (number + 1) % 50 == 0:
            report(f"chapter 4, {called}: {number + 1} of {len(runs)} recordings")
    tables = {
        reading: {
            channel: pd.concat([row[reading][channel] for row in rows], ignore_index=True)
            for channel in SIGNALS
        }
        for reading in readings
    }
    return tables, kept


def _spectra(
    one: LaboratoryRecordings, readings: Sequence[str], keep: bool
) -> tuple[dict[str, dict[str, pd.DataFrame]], Recording | None]:
    """Simulate one recording; return its spectra by reading, and itself if it is to be kept."""
    recording = one[0]
    made: dict[Any, dict[str, pd.DataFrame]] = {}  # readings may differ in the filter alone
    spectra = {}
    for name in readings:
        reading = READINGS[name]
        settings = (reading.theta_s, reading.direction, reading.antialias)
        if settings not in made:
            made[settings] = reading.spectra(recording)
        spectra[name] = made[settings]
    return spectra, recording if keep else None
