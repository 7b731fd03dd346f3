"""Recordings of many units with ten faults, and their features: the data of chapter 5."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from laboratory import FAULTS, LaboratoryBench
from numpy.typing import NDArray

from chapter4_spectra import MIN_SPEED, PAIRS, SIGNALS
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_cross_spectrum import OrderCrossSpectrum
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.recording import Recording
from emacm.resampling.order_resampler import OrderResampler
from findings import Report, silent

CONDITION = 4  # strokes past the jam, under a load that changes its sign: every fault has an effect
MAX_ORDER = 48
PHASES = ("current_a", "current_b", "current_c")
_REVOLUTIONS = 8  # the cage turns 0.39 times per revolution
_OPTIONS: dict[str, Any] = {"fs": 12_000.0, "cutoff": 5000.0, "phases": "abc"}
_TESTED, _CALIBRATION = 1000, 2000  # first numbers of the units


class Extent5(NamedTuple):
    """Amount of computation.

    Attributes
    ----------
    n_training, n_calibration : int
        Healthy units from which mean and scatter, and the threshold, are estimated.
    n_tested : int
        Units that are recorded healthy and with each fault.
    n_runs : int
        Runs of a healthy unit.
    severities : tuple of float
        Severities of each fault.
    trend_units : int
        Units whose fault grows.
    trend_faults : tuple of str
        Faults that grow.
    trend_runs : (int, int)
        Healthy runs of the baseline, and runs during which the fault grows.
    pairs : tuple of (str, str)
        Faults of severity 0.7 that some units have together.
    duration : float
        Length of a recording [s].
    """

    n_training: int
    n_calibration: int
    n_tested: int
    n_runs: int
    severities: tuple[float, ...]
    trend_units: int
    trend_faults: tuple[str, ...]
    trend_runs: tuple[int, int]
    pairs: tuple[tuple[str, str], ...] = ()
    duration: float = 3.0


FULL = Extent5(
    30,
    50,
    8,
    3,
    (0.05, 0.1, 0.2, 0.4, 0.7, 1.0),
    6,
    ("inner ring", "screw", "jam"),
    (20, 20),
    (("inner ring", "screw"), ("backlash", "lubrication"), ("ball", "phase imbalance")),
)
QUICK = Extent5(8, 8, 3, 2, (0.1, 1.0), 2, ("jam",), (8, 4), (("inner ring", "screw"),), 2.0)
VARIED = Extent5(20, 40, 4, 1, (1.0,), 0, (), (0, 0))
VARIED_QUICK = Extent5(4, 4, 1, 1, (1.0,), 0, (), (0, 0), duration=1.5)


class Features(NamedTuple):
    """Features of a set of recordings.

    Attributes
    ----------
    frame : DataFrame
        One row per recording: "role" ("training", "calibration", "tested" or "trend"), "unit",
        "run", "label" and "severity".
    spectra : dict of str to DataFrame
        log10 of the power in bins of one order, by channel.
    fine : dict of str to DataFrame
        The same in bins of a quarter of an order, and by "three phases" the `unbalance`.
    cross : DataFrame
        Coherence and frequency response of `PAIRS` in bins of four orders; missing in rows of
        other roles than "tested".
    """

    frame: pd.DataFrame
    spectra: dict[str, pd.DataFrame]
    fine: dict[str, pd.DataFrame]
    cross: pd.DataFrame

    def rows(self, mask: NDArray[np.bool_] | pd.Series) -> Features:
        """Return the rows of a mask."""
        kept = np.flatnonzero(mask)

        def chosen(table: pd.DataFrame) -> pd.DataFrame:
            return table.iloc[kept].reset_index(drop=True)

        return Features(
            chosen(self.frame),
            {name: chosen(table) for name, table in self.spectra.items()},
            {name: chosen(table) for name, table in self.fine.items()},
            chosen(self.cross),
        )

    def joint(self) -> pd.DataFrame:
        """Return the spectra of all signals in one table."""
        return pd.concat(self.spectra.values(), axis=1)


def severity_of_run(run: int, n_runs: int) -> float:
    """Return the severity of a growing fault: from 0.02 to 1 in equal ratios (assumed).

    Examples
    --------
    >>> [round(severity_of_run(run, 3), 3) for run in (1, 2, 3)]
    [0.02, 0.141, 1.0]
    """
    return float(0.02 ** (1 - (run - 1) / (n_runs - 1)))


def planned_runs(extent: Extent5, **spreads: float) -> list[tuple[str, LaboratoryBench, int]]:
    """Return role, bench and run of each recording; `spreads` are parameters of the bench."""
    options = _OPTIONS | {"duration": extent.duration} | spreads
    runs: list[tuple[str, LaboratoryBench, int]] = []
    groups = (
        ("training", 0, extent.n_training),
        ("calibration", _CALIBRATION, extent.n_calibration),
        ("tested", _TESTED, extent.n_tested),
    )
    for role, first, number in groups:
        for unit in range(first, first + number):
            bench = LaboratoryBench(unit=unit, **options)
            runs += [(role, bench, 1 + 4 * number) for number in range(extent.n_runs)]
    for unit in range(_TESTED, _TESTED + extent.n_tested):
        for place, fault in enumerate(FAULTS):
            for number, severity in enumerate(extent.severities):
                # Spread over the same runs as the healthy ones: as warm, whatever the severity.
                run = 2 + (3 * number + 5 * place) % 11
                bench = LaboratoryBench(unit=unit, faults={fault: severity}, **options)
                runs.append(("tested", bench, run))
    for unit in range(_CALIBRATION, _CALIBRATION + extent.n_tested):
        for pair in extent.pairs:
            bench = LaboratoryBench(unit=unit, faults=dict.fromkeys(pair, 0.7), **options)
            runs.append(("pairs", bench, 6))
    n_healthy, n_growing = extent.trend_runs
    for unit in range(_TESTED, _TESTED + extent.trend_units):
        healthy = LaboratoryBench(unit=unit, **options)
        # After the baseline, as many further runs without a fault: their alarms are false.
        runs += [("trend", healthy, 101 + run) for run in range(n_healthy + n_growing)]
        for fault in extent.trend_faults:
            for run in range(1, n_growing + 1):
                faults = {fault: severity_of_run(run, n_growing)}
                bench = LaboratoryBench(unit=unit, faults=faults, **options)
                runs.append(("trend", bench, 100 + n_healthy + run))
    return runs


def unbalance(recording: Recording) -> float:
    """Return the unbalance of three currents that sum to zero: negative over positive sequence.

    From their root mean squares, as IEC 61000-4-30, section 5.7, for three voltages.

    Examples
    --------
    >>> turns = np.linspace(0, 20 * np.pi, 2000, endpoint=False)
    >>> currents = {
    ...     name: np.cos(turns - k * 2 * np.pi / 3) + 0.05 * np.cos(turns + k * 2 * np.pi / 3)
    ...     for k, name in enumerate(PHASES)
    ... }
    >>> round(unbalance(Recording(currents, 1000, velocity=1.0)), 4)
    0.05
    """
    squares = np.array([np.mean(recording.signals[name] ** 2) for name in PHASES])
    root = np.sqrt(np.maximum(3 - 6 * np.sum(squares**2) / np.sum(squares) ** 2, 0))
    return float(np.sqrt((1 - root) / (1 + root)))


def compute_features(
    extent: Extent5,
    *,
    condition: int = CONDITION,
    n_jobs: int | None = None,
    report: Report = silent,
    **spreads: float,
) -> Features:
    """Simulate all recordings, twenty at a time, and return their features.

    Parameters
    ----------
    extent : Extent5
        Amount of computation.
    condition : int
        Condition of Table 4.3.
    n_jobs : int, optional
        Number of processes.
    report : callable, optional
        Receives lines of progress.
    **spreads : float
        `unit_spread` and `run_spread` of the bench.

    Returns
    -------
    Features
    """
    runs = planned_runs(extent, **spreads)
    pieces = [runs[start : start + 20] for start in range(0, len(runs), 20)]
    tables: list[tuple[pd.DataFrame, ...]] = []
    n_done = 0
    tasks = (delayed(_features_of)(piece, condition) for piece in pieces)
    for piece, made in zip(
        pieces, Parallel(n_jobs=n_jobs, return_as="generator")(tasks), strict=True
    ):
        tables.append(made)
        n_done += len(piece)
        if n_done % 100 == 0 or n_done == len(runs):
            report(f"chapter 5: {n_done} of {len(runs)} recordings")
    auto, narrow, phases, cross = (
        pd.concat(parts, ignore_index=True) for parts in zip(*tables, strict=True)
    )
    spectra, fine = (
        {name: table.filter(regex=f"^{name}@") for name in SIGNALS} for table in (auto, narrow)
    )
    fine["three phases"] = phases
    rows = [(role, b.unit, run, b.label, b.severity) for role, b, run in runs]
    frame = pd.DataFrame(rows, columns=["role", "unit", "run", "label", "severity"])
    return Features(frame, spectra, fine, cross)


def _features_of(
    runs: Sequence[tuple[str, LaboratoryBench, int]], condition: int
) -> tuple[pd.DataFrame, ...]:
    # In the order in which the pairs name the channels, so that all spectra share the signals.
    channels = list(dict.fromkeys(name for pair in PAIRS for name in pair))
    resampler = OrderResampler(np.pi / 64, channels=channels, min_speed=MIN_SPEED)
    # A jam may leave strokes shorter than a segment.
    psd = OrderPSD(_REVOLUTIONS, max_order=MAX_ORDER, short="pad").set_output(transform="pandas")
    coarse, narrow = (
        BinTransformer(width, max_order=MAX_ORDER).set_output(transform="pandas")
        for width in (1.0, 0.25)
    )
    cross = OrderCrossSpectrum(
        _REVOLUTIONS,
        pairs=PAIRS,
        kind=("coherence", "response"),
        form="log",
        bin_size=4,
        short="pad",
        max_order=MAX_ORDER,
    ).set_output(transform="pandas")
    made = [bench.record(condition, run) for _, bench, run in runs]
    recordings = resampler.fit_transform(made)
    spectra = psd.fit_transform(recordings)
    auto, fine = (np.log10(bins.fit_transform(spectra)) for bins in (coarse, narrow))
    phases = pd.DataFrame({"unbalance": [unbalance(recording) for recording in made]})
    tested = [place for place, (role, *_) in enumerate(runs) if role == "tested"]
    crosses = pd.DataFrame(index=range(len(runs)))
    if tested:
        found = cross.fit_transform([recordings[place] for place in tested])
        crosses = found.set_axis(tested).reindex(crosses.index)
    return auto, fine, phases, crosses
