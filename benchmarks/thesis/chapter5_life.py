"""Remaining life of units that wear out on the bench."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from numpy.typing import NDArray

from chapter4_spectra import MIN_SPEED
from emacm.life.prognostic_metrics import coverage_by_unit
from emacm.life.remaining_life import RemainingLife
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_psd import OrderPSD
from emacm.resampling.order_resampler import OrderResampler
from emacm.simulation.fleet import run_to_failure_fleet

COVERAGE = 0.9
FRACTIONS = (0.25, 0.5, 0.75, 0.9)  # of the life, at which the remaining life is estimated
_BASELINE = 3  # first readings of a unit
ONSET, CONSECUTIVE = 10.0, 2  # dB and readings: the onset of damage; assumed
_FLEETS = {"training": 0, "tested": 500}  # first numbers of the units
OPTIONS: dict[str, Any] = {"fault": "screw", "interval": 20.0, "duration": 3.0}


def life_table(
    n_units: tuple[int, int],
    *,
    n_jobs: int | None = None,
    report: Callable[[str], None] | None = None,
) -> pd.DataFrame:
    """Estimate the remaining life of units that were not in training.

    Units wear out by the law of `run_to_failure_fleet`. The health index is the largest rise of
    the accelerometer over bins of one order, relative to the first readings of the same unit.

    Parameters
    ----------
    n_units : (int, int)
        Training units and tested units. At least 9 training units must have two readings after the
        onset of damage; 15 are enough.
    n_jobs : int, optional
        Number of processes.
    report : callable, optional
        Receives a line of progress.

    Returns
    -------
    DataFrame
        One row per fraction of the life: median absolute error of the remaining life [h] with the
        health index, and by age alone; "covered [%]", the tested units whose remaining life is in
        the interval of 90 %, and in the row "all readings" its mean over units.
    """
    tasks = [
        delayed(_readings)(first + number)
        for (first, count) in zip(_FLEETS.values(), n_units, strict=True)
        for number in range(count)
    ]
    table = pd.concat(Parallel(n_jobs=n_jobs)(tasks), ignore_index=True)
    if report is not None:
        report(f"chapter 5: {len(table)} readings of {sum(n_units)} units that wear out")
    known, new = (table[(table["unit"] >= 500) == late] for late in (False, True))
    columns = ["age", "index"]
    model = RemainingLife("weibull", coverage=COVERAGE, onset=ONSET, consecutive=CONSECUTIVE).fit(
        known[columns], known["left"], groups=known["unit"]
    )
    interval = model.predict_interval(new[columns], groups=new["unit"])
    lower, upper = interval["lower"].to_numpy(), interval["upper"].to_numpy()
    by_age = known.groupby("unit")["life"].first().median() - new["age"]
    new = new.assign(
        error=np.abs(interval["median"] - new["left"]),
        error_by_age=np.abs(np.maximum(by_age, 0.0) - new["left"]),
        covered=(lower <= new["left"]) & (new["left"] <= upper),
    )
    rows = {f"{fraction:.0%} of the life": _at(new, fraction) for fraction in FRACTIONS}
    rows["all readings"] = new
    result = pd.DataFrame(
        {
            "median error, health index [h]": {k: v["error"].median() for k, v in rows.items()},
            "median error, age alone [h]": {k: v["error_by_age"].median() for k, v in rows.items()},
            "covered [%]": {k: 100 * v["covered"].mean() for k, v in rows.items()},
        }
    )
    total = coverage_by_unit(new["left"], lower, upper, new["unit"]).loc["all"]
    result.loc["all readings", "covered [%]"] = 100 * total["coverage"]
    return result.rename_axis(f"{n_units[1]} units, median life {_median_life(new):.0f} h")


def _median_life(table: pd.DataFrame) -> float:
    return float(table.groupby("unit")["life"].first().median())


def _at(table: pd.DataFrame, fraction: float) -> pd.DataFrame:
    """Return the last reading of each unit before a fraction of its life."""
    early = table[table["age"] <= fraction * table["life"]]
    return early.groupby("unit").tail(1)


def _readings(unit: int) -> pd.DataFrame:
    """Return age, health index and remaining life at the readings of one unit."""
    recordings = run_to_failure_fleet(1, first_unit=unit, **OPTIONS)
    resampler = OrderResampler(np.pi / 32, channels=["accelerometer"], min_speed=MIN_SPEED)
    psd = OrderPSD(4, max_order=24)
    bins = BinTransformer(1.0, max_order=24, stop_bands=((0, 2.5),))
    power = bins.fit_transform(psd.fit_transform(resampler.fit_transform(recordings)))
    level: NDArray[np.floating] = 10 * np.log10(np.asarray(power))
    rise = (level - np.median(level[:_BASELINE], axis=0)).max(axis=1)
    meta = pd.DataFrame([recording.meta for recording in recordings])
    return pd.DataFrame(
        {
            "unit": unit,
            "age": meta["age"],
            "index": rise,
            "left": meta["remaining_life"],
            "life": meta["life"],
        }
    )
