"""The pictures of chapter 4: Figs. 4.7 to 4.72, and what carries the decisions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from sklearn.decomposition import PCA

from emacm.bench_faults import FAULT_ORDERS
from emacm.bin_displays import OrderBinsDisplay
from emacm.chapter4_spectra import SIGNALS, UNITS, Campaign
from emacm.chapter4_study import SCHEMES, Model
from emacm.component_displays import ExplainedVarianceDisplay
from emacm.contribution_displays import ContributionsDisplay
from emacm.decision_displays import DecisionRegionsDisplay
from emacm.findings import Chapter
from emacm.outcome_displays import OutcomesDisplay
from emacm.signal_displays import RecordingDisplay
from emacm.spectrum_displays import OrderSpectrumDisplay

_FIRST, _PER_CONDITION = 5, 12  # Fig. 4.5 is the first of condition 1, which has 12 figures
_SHOWN = 4.0  # s of a recording
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
    models: list[Model],
    explanations: list[pd.DataFrame],
    condition: int,
) -> None:
    """Draw all pictures of one condition.

    Parameters
    ----------
    chapter : Chapter
        Where they are kept.
    campaign : Campaign
        Spectra, and the first runs themselves.
    models : list of Model
        Trained classifiers.
    explanations : list of DataFrame
        Of each, by `explain`.
    condition : int
        Which condition.
    """
    start = _FIRST + _PER_CONDITION * (condition - 1)
    _draw_signals(chapter, campaign, condition, start + 2)
    frame = campaign.frame
    rows = ((frame["condition"] == condition) & (frame["run"] == 1)).to_numpy()
    _draw_spectra(chapter, campaign, rows, f"Condition {condition}", start + 4)
    own = [m for m in models if m.conditions == (condition,)]
    _draw_bins(chapter, campaign, rows, own, f"Condition {condition}", start + 6)
    for scheme, first in zip(SCHEMES, (start + 8, start + 10), strict=True):
        chosen = [m for m in models if m.scheme == scheme and condition in m.conditions]
        _draw_features(chapter, campaign, chosen, condition, first)
    pairs = [p for p in zip(models, explanations, strict=True) if p[0] in own]
    _draw_models(chapter, campaign, pairs, f"condition {condition}")


def draw_summary(
    chapter: Chapter,
    campaign: Campaign,
    models: list[Model],
    explanations: list[pd.DataFrame],
    decisions: pd.DataFrame,
) -> None:
    """Draw what concerns all conditions: outcomes, and the single classifier.

    Parameters
    ----------
    chapter : Chapter
        Where they are kept.
    campaign : Campaign
        Spectra of the first pair of units.
    models : list of Model
        Trained classifiers.
    explanations : list of DataFrame
        Of each.
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
    pairs = zip(models, explanations, strict=True)
    single = [pair for pair in pairs if pair[0].scheme == "single"]
    _draw_models(chapter, campaign, single, "all conditions")


def _draw_signals(chapter: Chapter, campaign: Campaign, condition: int, first: int) -> None:
    for health, number in (("healthy", first), ("degraded", first + 1)):
        frame = campaign.frame
        wanted = (frame["condition"] == condition) & (frame["health"] == health)
        recording = campaign.kept[int(np.flatnonzero(wanted & (frame["run"] == 1))[0])]
        stop = min(_SHOWN, recording.duration)
        display = RecordingDisplay.from_recording(recording, units=UNITS, between=(0, stop))
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


def _draw_models(
    chapter: Chapter,
    campaign: Campaign,
    pairs: list[tuple[Model, pd.DataFrame]],
    where: str,
) -> None:
    """Draw how many components a signal would need, and what carries its decisions."""
    figure, axes = _panels(2, 2, (8.4, 6.0))
    for ax, (model, _) in zip(axes.flat, pairs, strict=True):
        rows = campaign.chosen(model.conditions, training=True)
        bins = model.pipeline[0].transform(campaign.spectra["thesis"][model.channel][rows])
        ExplainedVarianceDisplay.from_estimator(PCA().fit(bins), n_shown=8, ax=ax)
        ax.set_title(SIGNALS[model.channel])
        if ax is not axes[0, 1]:
            ax.get_legend().remove()
    caption = f"Share of the variance that principal components hold, {where}; two are used."
    _keep(chapter, f"Explained variance, {where}", figure, caption)
    tables = []
    for _, explanation in pairs:
        bins = explanation.attrs["bins"]
        tables.append(bins.assign(contribution=100 * bins["share"]))
    display = ContributionsDisplay.from_table(
        pd.concat(tables), fault_orders=MARKED, decision="the truth", unit="% of its signal"
    )
    display.ax_[0].get_legend().remove()  # shares have no sign
    for ax in display.ax_:
        ax.set_ylim(bottom=0)
    caption = (
        f"Share of the decisions on the test runs that each bin carries, {where} "
        f"({_TITLES[pairs[0][0].scheme]})."
    )
    _keep(chapter, f"What carries the decisions, {where}", display.figure_, caption)


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
