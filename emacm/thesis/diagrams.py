"""Diagrams of the thesis: Figs. 2.1, 2.2, 2.8, 2.9 and 4.1 to 4.4."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from emacm.displays._drawing import COLOURS, PLAIN, label_axes, legend_above, offscreen_panels
from emacm.orders.bin_transformer import BinTransformer
from emacm.thesis.findings import Chapter

_BOX = {"boxstyle": "square,pad=0.5", "facecolor": "white", "edgecolor": "black", "linewidth": 0.8}
_QUANTITIES = ("r", "ω(z)", "x(t)", "z")  # without a frame
Places = Mapping[str, tuple[float, float]]
Arrows = Sequence[tuple[str, str, str]]

_ARCHITECTURE: tuple[Places, Arrows] = (
    {
        "r": (0.0, 0),
        "actuator and\nenvironment": (1.1, 0),
        "feature\nextraction": (2.6, 0),
        "classifier": (4.0, 0),
        "ω(z)": (5.2, 0),
    },
    (
        ("r", "actuator and\nenvironment", ""),
        ("actuator and\nenvironment", "feature\nextraction", "x"),
        ("feature\nextraction", "classifier", "z"),
        ("classifier", "ω(z)", ""),
    ),
)
_EXTRACTION: tuple[Places, Arrows] = (
    {
        "x(t)": (0.0, 0),
        "resampling\nfrom time to\nshaft angle": (1.4, 0),
        "power\nspectral\ndensity": (3.1, 0),
        "filter": (4.4, 0),
        "binning": (5.6, 0),
        "feature space\ntransformation": (5.6, -0.8),
        "z": (7.0, -0.8),
        "training\nset": (1.9, -0.8),
        "principal\ncomponents": (3.6, -0.8),
    },
    (
        ("x(t)", "resampling\nfrom time to\nshaft angle", ""),
        ("resampling\nfrom time to\nshaft angle", "power\nspectral\ndensity", "x(θ)"),
        ("power\nspectral\ndensity", "filter", ""),
        ("filter", "binning", ""),
        ("binning", "feature space\ntransformation", "y"),
        ("feature space\ntransformation", "z", ""),
        ("training\nset", "principal\ncomponents", "Y"),
        ("principal\ncomponents", "feature space\ntransformation", "W"),
    ),
)
_ACTUATOR: tuple[Places, Arrows] = (
    {
        "resolver": (0, 0),
        "motor:\nstator, rotor\n(12 poles)": (1.3, 0),
        "bearing": (2.5, 0),
        "ball screw": (3.6, 0),
        "nut": (4.6, 0),
        "piston rod": (5.7, 0),
        "housing": (2.5, -0.8),
    },
    (
        ("resolver", "motor:\nstator, rotor\n(12 poles)", ""),
        ("motor:\nstator, rotor\n(12 poles)", "bearing", ""),
        ("bearing", "ball screw", ""),
        ("ball screw", "nut", ""),
        ("nut", "piston rod", ""),
        ("bearing", "housing", ""),
    ),
)
_FIXTURE: tuple[Places, Arrows] = (
    {
        "actuator\nunder test": (0, 0),
        "clevis": (1.4, 0),
        "load cell": (2.6, 0),
        "hydraulic\nload actuator": (4.0, 0),
        "servovalve": (5.5, 0),
        "LVDT": (1.4, -0.8),
        "accelerometer": (0, -0.8),
    },
    (
        ("actuator\nunder test", "clevis", "rod"),
        ("load cell", "clevis", ""),
        ("hydraulic\nload actuator", "load cell", "force"),
        ("servovalve", "hydraulic\nload actuator", "oil"),
        ("clevis", "LVDT", ""),
        ("actuator\nunder test", "accelerometer", ""),
    ),
)
_SIGNALS: tuple[Places, Arrows] = (
    {
        "position\ncontroller": (0, 0),
        "motor\ncontroller": (1.8, 0),
        "actuator": (3.6, 0),
        "load\nactuator": (5.2, 0),
        "load\ncontroller": (5.2, -0.9),
        "conditioning,\n15 kHz": (3.6, -0.9),
        "acquisition,\n48 kHz": (1.8, -0.9),
    },
    (
        ("position\ncontroller", "motor\ncontroller", "velocity"),
        ("motor\ncontroller", "actuator", "voltages"),
        ("load\nactuator", "actuator", "force"),
        ("load\ncontroller", "load\nactuator", ""),
        ("actuator", "conditioning,\n15 kHz", "signals"),
        ("conditioning,\n15 kHz", "acquisition,\n48 kHz", ""),
        ("acquisition,\n48 kHz", "position\ncontroller", "LVDT"),
    ),
)
_CHANNELS = ("phase current A", "vibration of the bearing", "motor velocity", "position (LVDT)")


def draw_chapter2_diagrams(chapter: Chapter) -> None:
    """Draw Figs. 2.1, 2.2, 2.8 and 2.9."""
    _diagram(chapter, "Fig. 2.1", *_ARCHITECTURE, "Architecture of fault detection.")
    _diagram(chapter, "Fig. 2.2", *_EXTRACTION, "Feature extraction from power spectral densities.")
    _draw_binning(chapter)
    _draw_transformation(chapter)


def draw_chapter4_diagrams(chapter: Chapter) -> None:
    """Draw Figs. 4.1 to 4.4, as modelled by the simulated bench."""
    _diagram(chapter, "Fig. 4.1", *_ACTUATOR, "Parts of the actuator, as modelled.")
    _diagram(chapter, "Fig. 4.2", *_FIXTURE, "Test fixture, as modelled.")
    _diagram(
        chapter,
        "Fig. 4.3",
        *_SIGNALS,
        "Signals of the laboratory: phase current, velocity, LVDT, load cell and accelerometer.",
    )
    places: dict[str, tuple[float, float]] = {}
    arrows = []
    for row, channel in enumerate(_CHANNELS):
        # Names of boxes are unique: the row is counted in trailing spaces, which are not seen.
        names = [channel, "feature extraction" + " " * row, "classifier" + " " * row]
        names.append("healthy or degraded" + " " * row)
        places |= {name: (x, -0.55 * row) for name, x in zip(names, (0, 2, 3.7, 5.5), strict=True)}
        arrows += [(a, b, "") for a, b in itertools.pairwise(names)]
    _diagram(
        chapter, "Fig. 4.4", places, arrows, "Fault detection of chapter 4: each signal separately."
    )


def _diagram(chapter: Chapter, name: str, places: Places, arrows: Arrows, caption: str) -> None:
    """Draw named boxes, and arrows between them with their quantities."""
    x, y = np.array(list(places.values()), dtype=float).T
    figure, axes = offscreen_panels(height=1.2 + 1.6 * np.ptp(y))
    ax = axes[0, 0]
    ax.set_axis_off()
    ax.set(xlim=(x.min() - 0.8, x.max() + 0.8), ylim=(y.min() - 0.5, y.max() + 0.5))
    texts = {
        box: ax.text(
            *place, box.strip(" "), ha="center", va="center", fontsize=8,
            bbox=_BOX | {"edgecolor": "none" if box in _QUANTITIES else "black"},
        )
        for box, place in places.items()
    }  # fmt: skip
    for start, end, quantity in arrows:
        a, b = places[start], places[end]
        ax.annotate(
            "", b, a, zorder=0,
            arrowprops={
                "arrowstyle": "-|>", "color": "black", "linewidth": 0.8,
                "patchA": texts[start].get_bbox_patch(), "patchB": texts[end].get_bbox_patch(),
            },
        )  # fmt: skip
        level = a[1] == b[1]
        ax.annotate(
            quantity,
            ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2),
            (0, 4) if level else (6, 0),
            textcoords="offset points",
            ha="center" if level else "left",
            fontsize=8,
            fontstyle="italic",
        )
    chapter.draw(name, figure, caption)


def _draw_binning(chapter: Chapter) -> None:
    """Draw an order spectrum, its bins of one order, and their powers by the trapezoidal rule."""
    orders = np.arange(0, 6.01, 0.25)
    peaks = ((1.0, 2.4, 0.35), (0.6, 4.6, 0.3))  # height, order, width
    psd = np.full_like(orders, 0.2)
    psd += sum(height * np.exp(-(((orders - o) / w) ** 2)) for height, o, w in peaks)
    edges = np.arange(7.0)
    power = BinTransformer(1.0, max_order=6, order_step=0.25).fit_transform(psd[np.newaxis])[0]
    figure, axes = offscreen_panels(2, height=4.2)
    top, bottom = axes[:, 0]
    for number, (low, high) in enumerate(itertools.pairwise(edges)):
        inside = (orders >= low) & (orders <= high)
        top.fill_between(
            orders[inside], psd[inside], color=COLOURS[number % 2], alpha=0.25, linewidth=0
        )
    top.plot(orders, psd, ".-", color=PLAIN, linewidth=0.9, label="lines of the spectrum")
    bottom.bar(edges[:-1], power, width=1, align="edge", color="0.85", edgecolor="black")
    for ax, text in ((top, "PSD [1/order]"), (bottom, "power in the bin [1]")):
        ax.set(xlim=(0, 6), ylim=(0, None))
        label_axes(ax, "order", text)
    legend_above(top)
    caption = "Binning: the area below the spectrum in each bin, by the trapezoidal rule."
    chapter.draw("Fig. 2.8", figure, caption)


def _draw_transformation(chapter: Chapter) -> None:
    """Draw z = W y as rectangles of their shapes."""
    from matplotlib.patches import Rectangle

    figure, axes = offscreen_panels(height=2.6)
    ax: Any = axes[0, 0]
    ax.set_axis_off()
    ax.set(xlim=(0, 10), ylim=(-0.4, 4.6), aspect="equal")
    for left, width, height, text in (
        (0.5, 0.5, 1.0, "z\nD x 1"),
        (2.3, 4.0, 1.0, "W\nD x N"),
        (7.3, 0.5, 4.0, "y\nN x 1"),
    ):
        low = 2 - height / 2
        ax.add_patch(Rectangle((left, low), width, height, facecolor="0.92", edgecolor="black"))
        ax.text(left + width / 2, low - 0.1, text, ha="center", va="top", fontsize=8)
    ax.text(1.65, 2, "=", ha="center", va="center")
    caption = "Feature space transformation, Eq. (2.26): N bins become D features."
    chapter.draw("Fig. 2.9", figure, caption)
