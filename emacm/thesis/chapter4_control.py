"""A control for chapter 4: the same units, with equal electrical noise in their cables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from emacm.simulation.bench import LaboratoryBench
from emacm.simulation.campaign import laboratory_recordings, thesis_benches
from emacm.thesis.chapter4_exposure import CALLED
from emacm.thesis.chapter4_spectra import SIGNALS, Campaign, estimate

CONTROLLED = ("lvdt", "velocity")  # the channels whose cables pick up the motor


def equally_noisy(
    healthy: LaboratoryBench, degraded: LaboratoryBench
) -> tuple[LaboratoryBench, LaboratoryBench]:
    """Give the cables of the degraded unit the noise that those of the healthy one have.

    Cables differ by what a bench is told and by what its unit was drawn with; both are made
    equal. Motor current, to which the noise is in proportion, stays each unit's own.

    Parameters
    ----------
    healthy, degraded : LaboratoryBench
        Two units.

    Returns
    -------
    healthy, degraded : LaboratoryBench
        The healthy one as it was.

    Examples
    --------
    >>> pair = equally_noisy(*thesis_benches())
    >>> one, other = (b.electrical_noise * b.built.electrical_noise for b in pair)
    >>> round(other / one, 12)
    1.0
    """
    level = healthy.electrical_noise * healthy.built.electrical_noise
    return healthy, replace(degraded, electrical_noise=level / degraded.built.electrical_noise)


def control_campaign(
    campaign: Campaign,
    seed: int,
    *,
    readings: Sequence[str],
    n_jobs: int | None = None,
    report: Callable[[str], None] | None = None,
    **constants: Any,
) -> Campaign:
    """Run the degraded unit of a campaign again, as noisy in its cables as the healthy one.

    All else is equal to the last random number: motion, friction, defect, other channels. The
    healthy unit is not run again, for nothing changes for it.

    Parameters
    ----------
    campaign : Campaign
        Of `run_campaign`.
    seed : int
        Of its units.
    readings : sequence of str
        Keys of `READINGS` that the campaign has too.
    n_jobs, report
        As for `run_campaign`.
    **constants
        Of the benches, as in the campaign.

    Returns
    -------
    Campaign
        Without kept recordings.

    Raises
    ------
    ValueError
        If the campaign does not list its healthy unit first.
    """
    healthy = (campaign.frame["health"] == "healthy").to_numpy()
    if np.any(np.diff(healthy.astype(int)) > 0):
        raise ValueError("campaign must list the healthy unit first, as run_campaign does.")
    _, degraded = equally_noisy(*thesis_benches(seed=seed, **constants))
    n_runs = int(campaign.frame["run"].max())
    recordings = laboratory_recordings([degraded], n_runs=n_runs)
    again, _ = estimate(recordings, readings, "control", n_jobs=n_jobs, report=report)
    spectra = {
        reading: {
            channel: pd.concat([table[healthy], again[reading][channel]], ignore_index=True)
            for channel, table in campaign.spectra[reading].items()
        }
        for reading in readings
    }
    return Campaign(campaign.frame, spectra, {})


def control_table(usual: pd.DataFrame, control: pd.DataFrame) -> pd.DataFrame:
    """Set decisions beside those with equal noise in the cables.

    Parameters
    ----------
    usual, control : DataFrame
        Of `shares_table`, of the readings "thesis" and "strokes", for the campaign and its
        control.

    Returns
    -------
    DataFrame
        For LVDT and velocity, indexed by signal and conditions: "correct" and "12 and 36" over
        the travel and stroke by stroke, usual and "equal" [per cent].
    """
    columns = {}
    for reading, called in CALLED.items():
        for name, group in (("correct", "correct"), ("12 and 36", "electrical noise")):
            for table, kind in ((usual, ""), (control, ", equal noise")):
                own = table[table["reading"] == reading].set_index(["signal", "conditions"])
                columns[f"{name}, {called}{kind} [%]"] = own[f"{group} [%]"]
    return pd.DataFrame(columns).loc[[SIGNALS[channel] for channel in CONTROLLED]]


def control_remark(table: pd.DataFrame, carried_by_shaft: Mapping[str, float]) -> str:
    """Say what is left of LVDT and velocity when their cables are equally noisy.

    Parameters
    ----------
    table : DataFrame
        Of `control_table`.
    carried_by_shaft : mapping of str to float
        By signal, what once to three times the shaft then carries stroke by stroke [per cent].

    Returns
    -------
    str
    """
    said = []
    for channel in CONTROLLED:
        signal = SIGNALS[channel]
        rows = table.loc[signal]
        each = rows.drop("all")
        for called in CALLED.values():
            pair = (f"correct, {called} [%]", f"correct, {called}, equal noise [%]")
            means = " to ".join(f"{each[name].mean():.0f}" for name in pair)
            single = " to ".join(f"{rows[name]['all']:.0f}" for name in pair)
            noise = " to ".join(
                f"{each[f'12 and 36, {called}{kind} [%]'].mean():.0f}"
                for kind in ("", ", equal noise")
            )
            where = "over the travel" if called == "travel" else "stroke by stroke"
            said.append(
                f"{signal} {where} from {means} % correct (orders 12 and 36 from {noise} %), by a "
                f"single classifier from {single} %"
            )
    shaft = " and ".join(f"{signal} {share:.0f} %" for signal, share in carried_by_shaft.items())
    return (
        "Control: the first pair of units once more, with equal noise in the cables of both (all "
        "else equal to the last random number). Means over conditions go, with 50 % being chance: "
        f"{'; '.join(said)}. What falls towards chance had rested on the cable, and so had the "
        "thesis'. What stays is none of the cable: over the travel velocity decides by the turns "
        "of the motion, and stroke by stroke much of what then tells the units apart lies at one "
        f"to three per revolution ({shaft}, mean over conditions): there stand each unit's own "
        "alignment and what a dry bearing adds to it, and one unit of a kind does not tell the "
        "two apart."
    )
