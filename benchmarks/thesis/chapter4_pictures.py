"""Pictures of chapter 4: Figs. 4.7 to 4.72, and the orders that determine the decisions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from laboratory import FAULT_ORDERS
from scipy.ndimage import uniform_filter1d

from chapter4_spectra import REVOLUTIONS, SIGNALS, UNITS, Campaign
from chapter4_study import SCHEMES, Model, Study
from emacm.displays.drawing import offscreen_panels
from emacm.displays.evaluation import OutcomesDisplay
from emacm.displays.planes import DecisionRegionsDisplay
from emacm.displays.power import OrderBinsDisplay, OrderSpectrumDisplay
from emacm.displays.recording import RecordingDisplay
from emacm.recordings.recording import Recording
from findings import Chapter

_FIRST, _PER_CONDITION = 5, 12  # Fig. 4.5 is the first of condition 1, which has 12 figures
_SHOWN = 4.0  # s of a recording
_FOLDED = 10.0  # ratio of powers, from which on a line is marked as folded
_RING = FAULT_ORDERS["inner ring"][0]
# A few marks that remain readable: the orders of section 4.5, and multiples of the inner ring.
MARKED = {"12": 12.0, "36": 36.0} | {f"{k}xBPFI": k * _RING for k in (1, 4, 7, 10)}
_TITLES = {
    "per condition": "one classifier per condition",
    "single": "one classifier for all conditions",
}


def first_figure(condition: int) -> int:
    """Return the number of the first figure of a condition, as 5 of Fig. 4.5."""
    return _FIRST + _PER_CONDITION * (condition - 1)


def draw_condition(chapter: Chapter, campaign: Campaign, study: Study, condition: int) -> None:
    """Draw all pictures of one condition.

    Parameters
    ----------
    chapter : Chapter
        Receives the pictures.
    campaign : Campaign
        Spectra and the first runs.
    study : Study
        Classifiers and their explanations.
    condition : int
        Number of the condition.
    """
    start = first_figure(condition)
    _draw_signals(chapter, campaign, condition, start + 2)
    frame = campaign.frame
    rows = ((frame["condition"] == condition) & (frame["run"] == 1)).to_numpy()
    own = [model for model in study.models if model.conditions == (condition,)]
    _draw_spectra(chapter, campaign, rows, f"Condition {condition}", start + 4)
    _draw_bins(chapter, own, rows, f"Condition {condition}", start + 6)
    for scheme, first in zip(SCHEMES, (start + 8, start + 10), strict=True):
        chosen = [m for m in study.models if m.scheme == scheme and condition in m.conditions]
        _draw_features(chapter, chosen, condition, first)


def draw_summary(chapter: Chapter, decisions: pd.DataFrame, published: pd.Series) -> None:
    """Draw the outcomes of all conditions.

    Parameters
    ----------
    chapter : Chapter
        Receives the pictures.
    decisions : DataFrame
        Result of `decide`, of all pairs.
    published : Series
        Correct decisions [%] of Tables 4.5 and 4.6, by scheme and channel.
    """
    for scheme, name in zip(SCHEMES, ("Figs. 4.65-4.68", "Figs. 4.69-4.72"), strict=True):
        chosen = decisions[decisions["scheme"] == scheme]
        named = chosen.assign(
            channel=chosen["channel"].map(SIGNALS),
            condition=[f"condition {number}" for number in chosen["condition"]],
        )
        counts = pd.crosstab([named["channel"], named["condition"]], named["outcome"])
        counts.columns.name = None
        counts = counts.reindex(list(SIGNALS.values()), level=0)
        shares = ", ".join(f"{SIGNALS[c]} {share:g}" for c, share in published[scheme].items())
        chapter.draw(
            name,
            OutcomesDisplay(counts).plot().figure_,
            f"Outcomes by signal and condition, {_TITLES[scheme]}: test runs of all pairs of "
            f"units. Published, correct in all conditions ({SCHEMES[scheme]}) [%]: {shares}.",
        )


def _first_runs(campaign: Campaign, condition: int) -> dict[str, Recording]:
    """Return run 1 of both units by health."""
    frame = campaign.frame
    rows = np.flatnonzero((frame["condition"] == condition) & (frame["run"] == 1))
    return {frame["health"][row]: campaign.kept[int(row)] for row in rows}


def _draw_signals(chapter: Chapter, campaign: Campaign, condition: int, first: int) -> None:
    for number, (health, recording) in enumerate(_first_runs(campaign, condition).items(), first):
        stop = min(_SHOWN, recording.duration)
        display = RecordingDisplay.from_recording(
            recording, channels=list(SIGNALS), units=UNITS, between=(0, stop)
        )
        caption = f"Condition {condition}, {health} EMA data of run 1: the first {stop:g} s."
        chapter.draw(f"Fig. 4.{number}", display.figure_, caption)


def _draw_spectra(chapter: Chapter, campaign: Campaign, rows: Any, title: str, first: int) -> None:
    """Draw the spectra of both units, and where those of the degraded one are folded."""
    read, limited = (
        pd.concat([campaign.spectra[reading][name] for name in SIGNALS], axis=1)[rows]
        for reading in ("thesis", "band-limited")
    )
    health = campaign.frame["health"][rows]
    degraded = (health == "degraded").to_numpy()
    display = OrderSpectrumDisplay.from_table(
        pd.concat([read, limited[degraded]]),
        labels=[*health, *health[degraded] + ", band-limited"],
        unit=UNITS,
        fault_orders=MARKED,
        slip=0,
    )
    smooth = {  # over one order
        label: uniform_filter1d(spectra, REVOLUTIONS) for label, spectra in display.spectra.items()
    }
    folded = smooth["degraded"] > _FOLDED * smooth["degraded, band-limited"]
    for panel, where in zip(display.ax_, folded, strict=True):
        grey = {"color": "0.88", "linewidth": 0, "zorder": 0}
        above = panel.get_xaxis_transform()
        panel.fill_between(display.orders, 0, 1, where=where, transform=above, **grey)
    caption = (
        f"{title}, order PSD of run 1 of both units, before the filter. Marked are orders "
        "12 and 36 of section 4.5, and multiples of the order of the inner ring. Grey: at least "
        "90 % of the power of the degraded unit is folded from above order 100, as the "
        "band-limited spectrum shows."
    )
    chapter.draw(_range(first), display.figure_, caption)


def _draw_bins(chapter: Chapter, models: list[Model], rows: Any, title: str, first: int) -> None:
    display = OrderBinsDisplay.from_table(
        pd.concat([model.signal.bins[rows] for model in models], axis=1),
        labels=models[0].signal.frame["health"][rows],
        unit=UNITS,
        fault_orders=MARKED,
        slip=0,
    )
    caption = (
        f"{title}, binned PSD of run 1 of both units, after the filter; folded lines of the "
        "figure before are in these bins."
    )
    chapter.draw(_range(first), display.figure_, caption)


def _draw_features(chapter: Chapter, models: list[Model], condition: int, first: int) -> None:
    figure, axes = offscreen_panels(4, 2, height=11.0)
    for row, model in enumerate(models):
        for column, training in enumerate((True, False)):
            signal, ax = model.signal, axes[row, column]
            rows = signal.rows([condition], training=training)
            unit = UNITS[signal.channel]
            unit = f"({unit})²" if "/" in unit else f"{unit}²"
            DecisionRegionsDisplay.from_estimator(
                model.pipeline[-1],
                model.pipeline[:-1].transform(signal.bins[rows]),
                signal.frame["health"][rows],
                names=(f"feature 1 [{unit}]", f"feature 2 [{unit}]"),
                n_grid=120,
                ax=ax,
            )
            title = f"{SIGNALS[signal.channel]}, {'training' if training else 'test'}"
            ax.set_title(title, loc="right", fontsize=9)  # the power of ten is on the left
            ax.locator_params(nbins=4)
            ax.ticklabel_format(scilimits=(-2, 3), useOffset=False)
            if (row, column) != (0, 1):
                ax.get_legend().remove()
    caption = f"Condition {condition}, feature plane and decisions, {_TITLES[models[0].scheme]}."
    chapter.draw(_range(first), figure, caption)


def _range(first: int) -> str:
    return f"Figs. 4.{first} and 4.{first + 1}"
