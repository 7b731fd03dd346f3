"""The pictures of chapter 4: Figs. 4.5 to 4.72, and what carries the decisions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from sklearn.decomposition import PCA

from emacm.displays._drawing import COLOURS
from emacm.displays.bins import OrderBinsDisplay
from emacm.displays.components import ExplainedVarianceDisplay
from emacm.displays.contributions import ContributionsDisplay
from emacm.displays.outcomes import OutcomesDisplay
from emacm.displays.recording import RecordingDisplay
from emacm.displays.regions import DecisionRegionsDisplay
from emacm.displays.spectrum import OrderSpectrumDisplay
from emacm.recordings.recording import Recording
from emacm.simulation.faults import FAULT_ORDERS
from emacm.thesis.chapter4_spectra import SIGNALS, UNITS, Campaign
from emacm.thesis.chapter4_study import SCHEMES, Model, explained_shares
from emacm.thesis.chapter4_tables import Study
from emacm.thesis.findings import Chapter

_FIRST, _PER_CONDITION = 5, 12  # Fig. 4.5 is the first of condition 1, which has 12 figures
_SHOWN = 4.0  # s of a recording
_COMMAND_RATE = 1000.0  # Hz, at which commands and what follows them are drawn
_FOLLOWED = (
    ("position [in]", "position_command", "lvdt"),
    ("load [lbf]", "load_command", "load_cell"),
)
_EXPLAINED = {"thesis": "over the travel", "strokes": "stroke by stroke"}
_RING = FAULT_ORDERS["inner ring"][0]
# Few marks, so that they can be read: what 4.5 names, and what the accelerometer decides on.
MARKED = {"12": 12.0, "36": 36.0} | {f"{k} x 6.123": k * _RING for k in (1, 4, 7, 10, 13)}
_TITLES = {
    "per condition": "a classifier for each condition",
    "single": "one classifier for all conditions",
}


def draw_condition(
    chapter: Chapter,
    campaign: Campaign,
    studies: Mapping[str, Study],
    condition: int,
) -> None:
    """Draw all pictures of one condition.

    Parameters
    ----------
    chapter : Chapter
        Where they are kept.
    campaign : Campaign
        Spectra, and the first runs themselves.
    studies : mapping of str to Study
        Classifiers and their explanations, by reading; "thesis" and "strokes" are drawn.
    condition : int
        Which condition.
    """
    start = _FIRST + _PER_CONDITION * (condition - 1)
    models = studies["thesis"].models
    _draw_commands(chapter, campaign, condition, start)
    _draw_signals(chapter, campaign, condition, start + 2)
    frame = campaign.frame
    rows = ((frame["condition"] == condition) & (frame["run"] == 1)).to_numpy()
    _draw_spectra(chapter, campaign, rows, f"Condition {condition}", start + 4)
    own = [m for m in models if m.conditions == (condition,)]
    _draw_bins(chapter, campaign, rows, own, f"Condition {condition}", start + 6)
    for scheme, first in zip(SCHEMES, (start + 8, start + 10), strict=True):
        chosen = [m for m in models if m.scheme == scheme and condition in m.conditions]
        _draw_features(chapter, campaign, chosen, condition, first)
    _draw_models(chapter, campaign, own, f"condition {condition}")
    for reading in _EXPLAINED:
        _draw_carriers(chapter, studies[reading], (condition,), f"condition {condition}")


def draw_summary(
    chapter: Chapter,
    campaign: Campaign,
    studies: Mapping[str, Study],
    decisions: pd.DataFrame,
) -> None:
    """Draw what concerns all conditions: outcomes, and the single classifier.

    Parameters
    ----------
    chapter : Chapter
        Where they are kept.
    campaign : Campaign
        Spectra of the first pair of units.
    studies : mapping of str to Study
        As for `draw_condition`.
    decisions : DataFrame
        Of `decide`, of all seeds.
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
        display = OutcomesDisplay(counts).plot()
        _keep(
            chapter,
            name,
            display.figure_,
            f"Outcomes by signal and condition, {_TITLES[scheme]}: test runs of all seeds.",
        )
    single = [model for model in studies["thesis"].models if model.scheme == "single"]
    _draw_models(chapter, campaign, single, "all conditions")
    for reading in _EXPLAINED:
        _draw_carriers(chapter, studies[reading], single[0].conditions, "all conditions")


def _first_runs(campaign: Campaign, condition: int) -> dict[str, Recording]:
    """Return run 1 of both units."""
    frame = campaign.frame
    rows = np.flatnonzero((frame["condition"] == condition) & (frame["run"] == 1))
    return {frame["health"][row]: campaign.kept[int(row)] for row in rows}


def _draw_commands(chapter: Chapter, campaign: Campaign, condition: int, first: int) -> None:
    """Draw position and load as they were asked for, and as LVDT and load cell tell them."""
    for number, (health, recording) in enumerate(_first_runs(campaign, condition).items(), first):
        figure, axes = _panels(2, 1, (8.4, 4.4))
        stop = min(_SHOWN, recording.duration)
        for ax, (quantity, command, feedback) in zip(axes.flat, _FOLLOWED, strict=True):
            rate = recording.fs[feedback]
            thin = round(rate / _COMMAND_RATE)
            asked, told = (
                recording.signals[name][: round(stop * rate) : thin] for name in (command, feedback)
            )
            times = np.arange(len(asked)) * thin / rate
            ax.plot(times, told, color=COLOURS[0], linewidth=0.9, label="feedback")
            ax.plot(times, asked, color="black", linewidth=0.9, linestyle="--", label="command")
            ax.set_ylabel(quantity)
            ax.set_xlim(0, stop)
        axes[0, 0].legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2, frameon=False)
        axes[1, 0].set_xlabel("time [s]")
        caption = (
            f"Condition {condition}, {health} command signals of run 1: position and load, command "
            "(dashed) and feedback (LVDT, load cell). The load's command follows the rod where it "
            "has a spring."
        )
        _keep(chapter, f"Fig. 4.{number}", figure, caption)


def _draw_signals(chapter: Chapter, campaign: Campaign, condition: int, first: int) -> None:
    for number, (health, recording) in enumerate(_first_runs(campaign, condition).items(), first):
        stop = min(_SHOWN, recording.duration)
        display = RecordingDisplay.from_recording(
            recording, channels=list(SIGNALS), units=UNITS, between=(0, stop)
        )
        caption = f"Condition {condition}, {health} EMA data of run 1: the first {stop:g} s."
        _keep(chapter, f"Fig. 4.{number}", display.figure_, caption)


def _draw_spectra(chapter: Chapter, campaign: Campaign, rows: Any, title: str, first: int) -> None:
    table = pd.concat(list(campaign.spectra["thesis"].values()), axis=1)[rows]
    display = OrderSpectrumDisplay.from_table(
        table, labels=campaign.frame["health"][rows], unit=UNITS, fault_orders=MARKED
    )
    caption = (
        f"{title}, resampled PSD of run 1 of both units, before the filter. Marked are orders "
        "12 and 36 of section 4.5, and multiples of the inner ring's order."
    )
    _keep(chapter, _range(first), display.figure_, caption)


def _draw_bins(
    chapter: Chapter, campaign: Campaign, rows: Any, own: list[Model], title: str, first: int
) -> None:
    tables = []
    for model in own:
        binning = model.pipeline[0]
        values = binning.transform(campaign.spectra["thesis"][model.channel][rows])
        tables.append(pd.DataFrame(values, columns=binning.get_feature_names_out()))
    display = OrderBinsDisplay.from_table(
        pd.concat(tables, axis=1),
        labels=campaign.frame["health"][rows],
        unit=UNITS,
        fault_orders=MARKED,
    )
    caption = f"{title}, binned PSD of run 1 of both units, behind the filter."
    _keep(chapter, _range(first), display.figure_, caption)


def _draw_features(
    chapter: Chapter, campaign: Campaign, models: list[Model], condition: int, first: int
) -> None:
    figure, axes = _panels(4, 2, (8.4, 11.0))
    for row, model in enumerate(models):
        for column, training in enumerate((True, False)):
            rows = campaign.chosen([condition], training=training)
            spectra = campaign.spectra["thesis"][model.channel][rows]
            ax = axes[row, column]
            unit = f"{UNITS[model.channel]}²" if "/" not in UNITS[model.channel] else "(rad/s)²"
            DecisionRegionsDisplay.from_estimator(
                model.pipeline[-1],
                model.pipeline[:-1].transform(spectra),
                campaign.frame["health"][rows],
                names=(f"feature 1 [{unit}]", f"feature 2 [{unit}]"),
                n_grid=120,
                ax=ax,
            )
            title = f"{SIGNALS[model.channel]}, {'training' if training else 'test'}"
            ax.set_title(title, loc="right")  # on the left stands the power of ten
            ax.locator_params(nbins=4)
            ax.ticklabel_format(scilimits=(-2, 3), useOffset=False)
            if (row, column) != (0, 1):
                ax.get_legend().remove()
    caption = f"Condition {condition}, feature plane and decisions, {_TITLES[models[0].scheme]}."
    _keep(chapter, _range(first), figure, caption)


def _draw_models(chapter: Chapter, campaign: Campaign, models: list[Model], where: str) -> None:
    """Draw how many components a signal would need."""
    figure, axes = _panels(2, 2, (8.4, 6.0))
    for ax, model in zip(axes.flat, models, strict=True):
        rows = campaign.chosen(model.conditions, training=True)
        bins = model.pipeline[0].transform(campaign.spectra["thesis"][model.channel][rows])
        ExplainedVarianceDisplay.from_estimator(PCA().fit(bins), n_shown=8, ax=ax)
        ax.set_title(SIGNALS[model.channel])
        if ax is not axes[0, 1]:
            ax.get_legend().remove()
    caption = f"Share of the variance that principal components hold, {where}; two are used."
    _keep(chapter, f"Explained variance, {where}", figure, caption)


def _draw_carriers(
    chapter: Chapter, studied: Study, conditions: tuple[int, ...], where: str
) -> None:
    """Draw what carries the decisions, and say it in numbers."""
    pairs = zip(studied.models, studied.explanations, strict=True)
    chosen = [(m.channel, table) for m, table in pairs if m.conditions == conditions]
    tables = []
    for _, explanation in chosen:
        bins = explanation.attrs["bins"]
        tables.append(bins.assign(contribution=100 * bins["share"]))
    display = ContributionsDisplay.from_table(
        pd.concat(tables), fault_orders=MARKED, decision="the truth", unit="% of its signal"
    )
    display.ax_[0].get_legend().remove()  # shares have no sign
    for ax in display.ax_:
        ax.set_ylim(bottom=0)
    said = ", ".join(
        f"{SIGNALS[channel]} {shares['electrical noise']:.0f} and {shares['inner ring']:.0f} %"
        for channel, shares in ((channel, explained_shares(table)) for channel, table in chosen)
    )
    how = _EXPLAINED[studied.reading]
    scheme = "single" if len(conditions) > 1 else "per condition"
    caption = (
        f"Share of the decisions on the test runs that each bin carries {how}, {where} "
        f"({_TITLES[scheme]}). Lines of 12 and 36, and of the inner ring, have: {said}."
    )
    name = f"What carries the decisions, {where}"
    if studied.reading != "thesis":
        name += f", {how}"
    _keep(chapter, name, display.figure_, caption)


def _panels(n_rows: int, n_columns: int, size: tuple[float, float]) -> tuple[Any, Any]:
    from matplotlib import pyplot

    return pyplot.subplots(n_rows, n_columns, figsize=size, layout="constrained", squeeze=False)


def _keep(chapter: Chapter, name: str, figure: Any, caption: str) -> None:
    """Keep a picture, which pyplot need not remember."""
    from matplotlib import pyplot

    figure.set_dpi(100)
    pyplot.close(figure)
    chapter.draw(name, figure, caption)


def _range(first: int) -> str:
    return f"Figs. 4.{first} and 4.{first + 1}"
