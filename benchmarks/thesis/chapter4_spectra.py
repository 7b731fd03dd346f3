"""Order spectra and bins of the laboratory campaign of chapter 4."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from laboratory import CONDITIONS, LaboratoryBench
from laboratory.faults import POLE_PAIRS
from numpy.typing import NDArray

from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_cross_spectrum import OrderCrossSpectrum
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.recording import Recording
from emacm.resampling.order_resampler import OrderResampler
from findings import Report, silent

SIGNALS = {  # channel: name in the thesis
    "lvdt": "LVDT",
    "velocity": "Motor Velocity",
    "current_a": "Current",
    "accelerometer": "Y Accelerometer",
}
CROSS = "cross spectra"
PAIRS = (  # of the cross spectra
    ("current_a", "velocity"),
    ("current_a", "accelerometer"),
    ("velocity", "lvdt"),
    ("velocity", "accelerometer"),
)
UNITS = {"lvdt": "in", "velocity": "rad/s", "current_a": "A", "accelerometer": "g"}
REVOLUTIONS = 8  # of a segment; not in the thesis. Condition 1 makes 14 revolutions in 10 s.
MIN_SPEED = 1.0  # rad/s; below it, noise of the resolver divides strokes
_COMMAND = (0.0, 1.0)  # orders of the commanded motion, below one per revolution
_FUNDAMENTAL = (POLE_PAIRS - 0.4, POLE_PAIRS + 0.4)  # chapter 3: 5.6 to 6.4


@dataclass(frozen=True)
class Reading:
    """One interpretation of the feature extraction of chapter 4.

    Parameters
    ----------
    note : str
        Description.
    theta_s : float
        Angle between samples [rad].
    direction : {"travel", "strokes"}
        Treatment of reversals, as in `OrderResampler`.
    antialias : bool
        False: linear interpolation, Eq. (2.13).
    detrend : {None, "constant"}
        As in `OrderPSD`; Eqs. (2.14) to (2.16) do not remove the mean.
    filtered : bool
        Whether a stop band removes the effect of the command: the fundamental of the current as
        in chapter 3, and orders below 1 of the other signals (assumed).
    """

    note: str
    theta_s: float = 0.01 * np.pi
    direction: str = "travel"
    antialias: bool = False
    detrend: str | None = None
    filtered: bool = True

    @property
    def max_order(self) -> float:
        """Highest order: π/theta_s."""
        return float(round(np.pi / self.theta_s, 9))

    @property
    def resampler(self) -> OrderResampler:
        """Resampler from time to shaft angle."""
        return OrderResampler(
            self.theta_s,
            interpolation="linear",
            antialias=self.antialias,
            direction=self.direction,
            min_speed=MIN_SPEED,
            channels=list(SIGNALS),
        )

    def binning(self, channel: str) -> BinTransformer:
        """Return bins of one order with the ideal band-stop filter of a channel."""
        stop_band = _FUNDAMENTAL if channel.startswith("current") else _COMMAND
        stop_bands = (stop_band,) if self.filtered else ()
        return BinTransformer(1.0, max_order=self.max_order, stop_bands=stop_bands)

    def spectra(self, recording: Recording) -> dict[str, pd.DataFrame]:
        """Return the order spectra of a recording by channel, of one row each [unit²/order].

        Also, as `CROSS`, the logarithm of the frequency responses of `PAIRS` in bins of 4 orders.
        """
        psd = OrderPSD(REVOLUTIONS, short="pad", detrend=self.detrend).set_output(
            transform="pandas"
        )
        turned = self.resampler.fit_transform([recording])
        table = psd.fit_transform(turned)
        n_orders = len(psd.orders_)
        starts = {name: number * n_orders for number, name in enumerate(SIGNALS)}
        cross = OrderCrossSpectrum(
            REVOLUTIONS, pairs=PAIRS, kind="response", form="log", bin_size=4, short="pad"
        ).set_output(transform="pandas")
        return {
            **{name: table.iloc[:, start : start + n_orders] for name, start in starts.items()},
            CROSS: cross.fit_transform(turned),
        }


READINGS = {
    "thesis": Reading("linear interpolation over the travel, 100 orders, filtered"),
    "no filter": Reading("as above, without stop bands", filtered=False),
    "50 orders": Reading("θ_s = 0.02π as printed in Table 4.4", theta_s=0.02 * np.pi),
    "mean removed": Reading("the mean of each segment removed", detrend="constant"),
    "band-limited": Reading("no aliasing from orders above 100", antialias=True),
    "strokes": Reading("each stroke resampled separately", direction="strokes"),
}


@dataclass(frozen=True)
class Signal:
    """Spectra and bins of one channel under one reading.

    Attributes
    ----------
    reading, channel : str
        Keys of `READINGS` and `SIGNALS`.
    frame : DataFrame
        One row per recording, as in `Campaign`.
    spectra : DataFrame of shape (n_recordings, n_orders)
        Order spectra [unit²/order].
    binning : BinTransformer
        Fitted to the spectra.
    bins : DataFrame of shape (n_recordings, n_bins)
        Power in bins of one order [unit²].
    """

    reading: str
    channel: str
    frame: pd.DataFrame
    spectra: pd.DataFrame
    binning: BinTransformer
    bins: pd.DataFrame

    def rows(self, conditions: Collection[int], *, training: bool) -> NDArray[np.bool_]:
        """Return a mask of the training or test recordings of these conditions."""
        mask = self.frame["condition"].isin(conditions) & (self.frame["training"] == training)
        return mask.to_numpy()


@dataclass(frozen=True)
class Campaign:
    """All runs of some units.

    Attributes
    ----------
    frame : DataFrame
        One row per recording: "bench" (position in `run_campaign`), "unit", "condition", "run",
        "label", "severity", "health" (the class that a study learns: "healthy" for the first bench,
        "degraded" for the others) and "training" (True in the first half of the runs).
    spectra : dict of str to dict of str to DataFrame of shape (n_recordings, n_orders)
        Order spectra by reading and channel [unit²/order], and `CROSS` spectra.
    kept : dict of int to Recording
        First run of each unit in each condition, by row, if requested.
    """

    frame: pd.DataFrame
    spectra: dict[str, dict[str, pd.DataFrame]]
    kept: dict[int, Recording]

    def signal(self, reading: str, channel: str) -> Signal:
        """Return the spectra and bins of one channel under one reading."""
        spectra = self.spectra[reading][channel]
        binning = READINGS[reading].binning(channel).set_output(transform="pandas")
        bins = binning.fit_transform(spectra)
        return Signal(reading, channel, self.frame, spectra, binning, bins)


def pair(healthy: tuple[Campaign, int], degraded: tuple[Campaign, int]) -> Campaign:
    """Return the runs of two benches, of which the second has the class "degraded".

    Parameters
    ----------
    healthy, degraded : (Campaign, int)
        A campaign, and the position of the bench in it.

    Returns
    -------
    Campaign
        With the readings that both campaigns have.
    """
    parts = [
        (campaign, np.flatnonzero(campaign.frame["bench"] == bench))
        for campaign, bench in (healthy, degraded)
    ]
    frame = pd.concat([campaign.frame.loc[rows] for campaign, rows in parts], ignore_index=True)
    frame["health"] = np.repeat(["healthy", "degraded"], [len(rows) for _, rows in parts])
    spectra = {
        reading: {
            channel: pd.concat(
                [campaign.spectra[reading][channel].loc[rows] for campaign, rows in parts],
                ignore_index=True,
            )
            for channel in (*SIGNALS, CROSS)
        }
        for reading in parts[0][0].spectra
        if reading in parts[1][0].spectra
    }
    recordings = [campaign.kept.get(int(row)) for campaign, rows in parts for row in rows]
    kept = {row: recording for row, recording in enumerate(recordings) if recording is not None}
    return Campaign(frame, spectra, kept)


def run_campaign(
    benches: Sequence[LaboratoryBench],
    *,
    conditions: Sequence[int] = tuple(CONDITIONS),
    n_runs: int = 20,
    readings: Sequence[str] = ("thesis",),
    keep: bool = False,
    n_jobs: int | None = None,
    report: Report = silent,
) -> Campaign:
    """Simulate the units, each recording once, and estimate order spectra.

    Parameters
    ----------
    benches : sequence of LaboratoryBench
        Units, the healthy one first, such as `thesis_benches`.
    conditions : sequence of int
        Rows of Table 4.3.
    n_runs : int
        Runs of each unit in each condition; the first half is for training.
    readings : sequence of str
        Keys of `READINGS`.
    keep : bool
        Whether to keep the first run of each unit in each condition.
    n_jobs : int, optional
        Number of processes. No process holds more than one recording.
    report : callable, optional
        Receives lines of progress.

    Returns
    -------
    Campaign

    Examples
    --------
    >>> from laboratory import thesis_benches
    >>> campaign = run_campaign(thesis_benches(duration=0.1), n_runs=2)
    >>> campaign.frame["health"].value_counts().to_dict()
    {'healthy': 10, 'degraded': 10}
    >>> campaign.signal("thesis", "lvdt").spectra.shape
    (20, 801)
    """
    runs = [
        (bench, number, run)
        for bench in benches
        for number in conditions
        for run in range(1, n_runs + 1)
    ]
    n_each = len(runs) // len(benches)
    columns = ["unit", "condition", "run", "label", "severity"]
    metas = [bench.meta(number, run) for bench, number, run in runs]
    frame = pd.DataFrame(metas, columns=columns)
    frame["bench"] = np.repeat(np.arange(len(benches)), n_each)
    frame["health"] = np.where(frame["bench"] == 0, "healthy", "degraded")
    frame["training"] = frame["run"] <= n_runs // 2
    tasks = (
        delayed(_spectra)(bench, number, run, readings, keep and run == 1)
        for bench, number, run in runs
    )
    rows: list[dict[str, dict[str, pd.DataFrame]]] = []
    kept: dict[int, Recording] = {}
    for spectra, recording in Parallel(n_jobs=n_jobs, return_as="generator")(tasks):
        if recording is not None:
            kept[len(rows)] = recording
        rows.append(spectra)
        if len(rows) % 10 == 0 or len(rows) == len(frame):
            report(f"chapter 4: {len(rows)} of {len(frame)} recordings")
    tables = {
        reading: {
            channel: pd.concat([row[reading][channel] for row in rows], ignore_index=True)
            for channel in (*SIGNALS, CROSS)
        }
        for reading in readings
    }
    return Campaign(frame, tables, kept)


def _spectra(
    bench: LaboratoryBench, condition: int, run: int, readings: Sequence[str], keep: bool
) -> tuple[dict[str, dict[str, pd.DataFrame]], Recording | None]:
    """Simulate one recording; return its spectra by reading, and the recording if it is kept."""
    recording = bench.record(condition, run)
    made: dict[Any, dict[str, pd.DataFrame]] = {}  # some readings differ only in the filter
    spectra = {}
    for name in readings:
        reading = READINGS[name]
        settings = (reading.theta_s, reading.direction, reading.antialias, reading.detrend)
        if settings not in made:
            made[settings] = reading.spectra(recording)
        spectra[name] = made[settings]
    return spectra, recording if keep else None
