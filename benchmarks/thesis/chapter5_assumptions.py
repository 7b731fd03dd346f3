"""Which conclusions of chapters 4 and 5 survive another spread of units and of runs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from laboratory import thesis_benches

from chapter4 import control_studies, correct_shares
from chapter4_spectra import SIGNALS, run_campaign
from chapter5_data import CONDITION, VARIED, VARIED_QUICK, Features, compute_features
from chapter5_detection import (
    ALL,
    PHASED,
    detection_table,
    detectors,
    flagged_recordings,
    severity_of_detection,
)

AS_ASSUMED, TWICE, OTHER = "as assumed", "twice the spread of units", "condition 3"
_SPREADS = {
    AS_ASSUMED: {},
    "half the spread of units": {"unit_spread": 0.5},
    TWICE: {"unit_spread": 2.0},
    "half the spread of runs": {"run_spread": 0.5},
    "twice the spread of runs": {"run_spread": 2.0},
}


def varied_table(*, quick: bool, n_jobs: int | None) -> pd.DataFrame:
    """Apply chapters 4 and 5 under other assumptions, in one condition.

    Returns
    -------
    DataFrame
        One row per assumption: for each design of chapter 4 the correct decisions of each signal
        [%], medians over pairs, as text; for each signal of chapter 5 the number of faults that
        most units show at severity 1, and the faults that none shows.
    """
    extent, rows = VARIED_QUICK if quick else VARIED, {}
    for name, spreads in _SPREADS.items():
        if quick and name not in (AS_ASSUMED, TWICE):
            continue
        features = compute_features(extent, n_jobs=n_jobs, **spreads)
        rows[name] = _correct(quick=quick, n_jobs=n_jobs, **spreads) | _shown(features)
    rows[OTHER] = _shown(compute_features(extent, condition=3, n_jobs=n_jobs))
    return pd.DataFrame(rows).T.fillna("").rename_axis(f"assumption ({extent.n_tested} units)")


def _correct(*, quick: bool, n_jobs: int | None, **spreads: float) -> dict[str, str]:
    campaigns = []
    n_pairs, n_runs, duration = (2, 6, 0.6) if quick else (3, 10, 2.0)
    for seed in range(n_pairs):
        healthy, degraded = thesis_benches(seed=seed, duration=duration, **spreads)
        benches = (healthy, replace(healthy, faults=degraded.faults))
        campaigns.append(
            run_campaign(benches, conditions=(CONDITION,), n_runs=n_runs, n_jobs=n_jobs)
        )
    found = {}
    for design, studies in control_studies(campaigns).items():
        correct = correct_shares(studies, fusion=False)["per condition"]
        medians = correct.groupby(level="channel").median()
        found[f"{design}: correct [%]"] = " / ".join(f"{medians[name]:.0f}" for name in SIGNALS)
    return found


def _shown(features: Features) -> dict[str, Any]:
    tested = flagged_recordings(features, detectors(features))
    severity = detection_table(severity_of_detection(tested))["severity"].unstack("signal")
    seen = np.isfinite(severity)
    counts = seen[[*SIGNALS.values(), PHASED, ALL]].sum().to_dict()
    return counts | {"shown by no signal": ", ".join(seen.index[~seen.any(axis=1)]) or "none"}
