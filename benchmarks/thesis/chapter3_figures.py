"""Pictures of chapter 3 of the thesis: signals, spectra, components, decisions."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.decomposition import PCA
from sklearn.pipeline import Pipeline

from chapter3_readings import FS, N_RUNS, N_TIMES, STOP_BAND, TURN, thesis_pipeline
from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.displays import (
    DecisionRegionsDisplay,
    FeatureDensityDisplay,
    OrderBinsDisplay,
    OrderSpectrumDisplay,
    RecordingDisplay,
)
from emacm.displays.drawing import (
    COLOURS,
    PLAIN,
    label_axes,
    legend_above,
    line_style,
    offscreen_panels,
    state_numbers,
)
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.recording import Recording
from emacm.simulation.chapter3 import CHAPTER3_ORDERS, chapter3_recording, chapter3_recordings
from findings import Chapter

_COMPONENTS = ("principal component 1 [A²]", "principal component 2 [A²]")


def draw_signals(chapter: Chapter) -> None:
    """Draw the components of the current of each class, Figs. 3.1 to 3.3."""
    healthy = chapter3_recording("healthy", sigma=0)
    for number, label in enumerate(CHAPTER3_ORDERS, start=1):
        clean = chapter3_recording(label, sigma=0)
        whole = chapter3_recording(label)
        parts = {
            "x_f": healthy.signals["current"],
            "x_d": clean.signals["current"] - healthy.signals["current"],
            "x_n": whole.signals["current"] - clean.signals["current"],
            "x": whole.signals["current"],
        }
        figure, axes = offscreen_panels(5, height=7.4)
        RecordingDisplay.from_recording(
            Recording(parts, FS, velocity=whole.velocity),
            units=dict.fromkeys(parts, "A"),
            between=(0, 1),
            ax=axes[:, 0],
        )
        caption = f"{label}: fundamental, defect, noise, their sum, and the motor speed; Eq. (3.3)."
        chapter.draw(f"Fig. 3.{number}", figure, caption[0].upper() + caption[1:])


def draw_features(chapter: Chapter) -> None:
    """Draw spectra, bins, components, classes and decisions, Figs. 3.4 to 3.10."""
    recordings, labels = chapter3_recordings(N_RUNS)
    chain = thesis_pipeline().set_output(transform="pandas")
    bins = chain.fit_transform(recordings)
    _draw_spectra(chapter, chain, recordings[::N_RUNS], labels[::N_RUNS])
    pca = PCA().fit(bins)
    figure, axes = offscreen_panels(height=3.8)
    ax, shares = axes[0, 0], 100 * pca.explained_variance_ratio_[:20]
    ax.bar(range(1, 21), shares, color=PLAIN, label="each component")
    ax.plot(range(1, 21), shares.cumsum(), "s--", color=COLOURS[1], label="cumulative sum")
    label_axes(ax, "principal component", "share of the variance [%]")
    ax.set_xticks(range(1, 21))
    legend_above(ax)
    share = pca.explained_variance_ratio_[:2].sum()
    caption = f"Explained variance, and cumulative sum: two have {share:.0%} (published 72 %)."
    chapter.draw("Fig. 3.6", figure, caption)
    figure, axes = offscreen_panels(2, height=5.0)
    for number, ax in enumerate(axes[:, 0]):
        ax.stairs(pca.components_[number], color=PLAIN, fill=True)  # bins are one order wide
        label_axes(ax, "order [cycles per revolution]", f"weight in component {number + 1}")
    chapter.draw(
        "Fig. 3.7",
        figure,
        "Weights of the bins in the first two components: the bins of the defects dominate "
        "(published: bin 11 leads the first with 0.72, bin 4 the second with 0.77).",
    )
    plane = pca.transform(bins)[:, :2]
    model = CostSensitiveGaussianBayes(priors="uniform").fit(plane, labels)
    for name, shares, caption in (
        ("Fig. 3.8", (), "The 120 runs in the plane of the first two components."),
        ("Fig. 3.9", (0.5, 0.9), "Gaussian densities of the classes, Eqs. (2.44) to (2.46)."),
    ):
        figure, axes = offscreen_panels(height=4.6)
        FeatureDensityDisplay.from_estimator(
            model, plane, labels, shares=shares, names=_COMPONENTS, ax=axes[0, 0]
        )
        chapter.draw(name, figure, caption)
    figure, axes = offscreen_panels(height=4.6)
    DecisionRegionsDisplay.from_estimator(model, plane, labels, names=_COMPONENTS, ax=axes[0, 0])
    n_correct = np.sum(model.predict(plane) == labels)
    caption = f"Decisions under the 0-1 cost: {n_correct} of 120 are correct (published 119)."
    chapter.draw("Fig. 3.10", figure, caption)


def _draw_spectra(
    chapter: Chapter, chain: Pipeline, recordings: list[Recording], labels: NDArray[Any]
) -> None:
    """Draw one run of each class: in hertz, in orders, filtered, in bins."""
    rows = np.array([recording.signals["current"] for recording in recordings])
    hertz = OrderPSD(n_per_segment=N_TIMES, theta_s=TURN / FS)
    spectra = np.asarray(hertz.fit_transform(rows))
    psd = chain[:2].transform(recordings)
    figure, axes = offscreen_panels(2, height=6.0)
    by_label = dict(zip(labels, spectra, strict=True))
    for label, number in state_numbers(by_label, "healthy").items():
        spectrum = by_label[label]
        drawn = (hertz.orders_ > 0) & (hertz.orders_ <= 250)
        level = 10 * np.log10(spectrum[drawn])
        axes[0, 0].plot(hertz.orders_[drawn], level, label=label, linewidth=1, **line_style(number))
    axes[0, 0].set(xlabel="frequency [Hz]", ylabel="PSD of current\n[dB re 1 A²/Hz]", xlim=(0, 250))
    legend_above(axes[0, 0])
    options: dict[str, Any] = {"labels": labels, "unit": "A", "max_order": 15}
    OrderSpectrumDisplay.from_table(psd, "current", ax=axes[1, 0], **options)
    chapter.draw(
        "Fig. 3.4",
        figure,
        "One run of each class before resampling (top: the defects are not visible) and after "
        "(bottom: lines at orders 3.125 and 10.5; published 3.1 and 10.5).",
    )
    figure, axes = offscreen_panels(2, height=6.0)
    orders = chain[1].orders_
    kept = psd * ~((orders > STOP_BAND[0]) & (orders < STOP_BAND[1]))
    OrderSpectrumDisplay.from_table(kept, "current", ax=axes[0, 0], **options)
    OrderBinsDisplay.from_estimator(
        chain, recordings, "current", labels=labels, unit="A", ax=axes[1, 0]
    )
    chapter.draw("Fig. 3.5", figure, "The same runs without orders 5.6 to 6.4, and in 50 bins.")
