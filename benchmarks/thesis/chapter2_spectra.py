"""Chapter 2 of the thesis, first half: resampling and order spectra, Figs. 2.3 to 2.7."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.displays import RecordingDisplay
from emacm.displays.drawing import COLOURS, PLAIN, label_axes, legend_above, offscreen_panels
from emacm.orders.order_psd import OrderPSD
from emacm.orders.welch import order_psd
from emacm.recordings.recording import Recording
from emacm.resampling.order_resampler import OrderResampler
from emacm.shaft.angle import angle_from_velocity
from findings import Chapter
from printed_equations import printed_angle, printed_resampling

TURN = 2 * np.pi
_FS = 1000.0  # Hz, of the ramp; assumed
_SAMPLES_PER_REV = 60
_LINES_2_7 = 256  # samples of the transform of Fig. 2.7


# Figs. 2.3, 2.4, 2.6 and 2.7: sin(6 theta) on a ramp of 100t rad/s, 0.5 s


def _ramp() -> Recording:
    time = np.arange(int(_FS / 2) + 1) / _FS
    # Eqs. (2.5) and (2.11).
    return Recording({"x1": np.sin(300 * time**2)}, _FS, velocity=100 * time)


def _ramp_over_angle() -> list[Any]:
    thesis = OrderResampler(TURN / _SAMPLES_PER_REV, interpolation="linear", antialias=False)
    return thesis.fit_transform([_ramp()])


def compare_resampling(chapter: Chapter) -> None:
    """Compare the speed ramp over time and over the angle, Figs. 2.3 and 2.4."""
    ramp, (turned,) = _ramp(), _ramp_over_angle()
    angle = angle_from_velocity(ramp.velocity, _FS)
    figure, axes = offscreen_panels(3, height=5.6)
    axes = axes[:, 0]
    RecordingDisplay.from_recording(ramp, units={"x1": "1"}, ax=axes[:2])
    axes[2].plot(angle, ramp.signals["x1"], color=PLAIN, linewidth=0.8)
    label_axes(axes[2], "cumulative motor angle [rad]", "x1 [1]")
    chapter.draw(
        "Fig. 2.3", figure, "sin(6θ) at a speed of 100t rad/s: periodic in angle, not in time."
    )
    (stroke,) = turned.strokes
    figure, axes = offscreen_panels(height=3.4)
    ax = axes[0, 0]
    fine = np.linspace(0, angle[-1], 2000)
    ax.plot(fine, np.sin(6 * fine), color="0.7", linewidth=0.8, label="sin 6θ")
    ax.plot(
        stroke.angles, stroke.signals[0], "o", markersize=3, color=COLOURS[1], label="resampled"
    )
    legend_above(ax)
    label_axes(ax, "cumulative motor angle [rad]", "x1 [1]")
    chapter.draw(
        "Fig. 2.4", figure, "The ramp at 60 samples per revolution, by Eq. (2.13) from x(k-1)."
    )
    signal = stroke.signals[0]
    rising = np.flatnonzero((signal[:-1] <= 0) & (signal[1:] > 0))
    chapter.compare(
        "Fig. 2.4, samples per period",
        10,
        np.diff(rising).mean(),
        "mean distance of upward zero crossings of the resampled signal",
        tolerance=0.1,
    )


def compare_sine(chapter: Chapter) -> None:
    """Compare the power and the density of a sine, Fig. 2.5."""
    fs, frequency, length = 640, 40, 32
    signal = np.sin(TURN * frequency * np.arange(length) / fs)
    box: dict[str, Any] = {"n_per_segment": length, "window": "boxcar"}
    cycles, power = order_psd(signal, 1, scaling="spectrum", **box)  # cycles per sample
    hertz, density = order_psd(signal, fs, **box)
    note = "computed, rounded to 12 digits; nothing is random"
    for where, published, ours in (
        ("power", 0.5, power.max()),
        ("frequency of the power [cycles per sample]", 0.0625, cycles[power.argmax()]),
        ("density [1/Hz]", 0.025, density.max()),
        ("frequency of the density [Hz]", 40, hertz[density.argmax()]),
    ):
        chapter.compare(f"Fig. 2.5, {where}", published, round(ours, 12), note)
    figure, axes = offscreen_panels(2, 2, height=5.2)
    fine = np.linspace(0, (length - 1) / fs, 1000)
    axes[0, 0].plot(fine, np.sin(TURN * frequency * fine), color=PLAIN, linewidth=0.9)
    label_axes(axes[0, 0], "time [s]", "x2(t) [1]")
    axes[0, 1].stem(np.arange(length), signal, basefmt="0.5")
    label_axes(axes[0, 1], "sample n", "x2(n) [1]")
    axes[1, 0].stem(hertz, density, basefmt="0.5")
    label_axes(axes[1, 0], "frequency [Hz]", "PSD [1/Hz]")
    axes[1, 1].stem(cycles, power, basefmt="0.5")
    label_axes(axes[1, 1], "frequency [cycles per sample]", "power [1]")
    chapter.draw(
        "Fig. 2.5",
        figure,
        "A sine of 40 Hz sampled at 640 Hz, its density and its power spectrum; L = 32, "
        "rectangular window. Published: 0.025 at 40 Hz, and 0.5 at 0.0625, as here.",
    )


def compare_smearing(chapter: Chapter) -> None:
    """Compare the spectra of the ramp in hertz and in orders, Figs. 2.6 and 2.7."""
    ramp, turned = _ramp(), _ramp_over_angle()
    signal = ramp.signals["x1"]
    hertz, density = order_psd(
        signal, _FS, n_per_segment=len(signal), window="boxcar", detrend=None
    )
    psd = OrderPSD(n_per_segment=_LINES_2_7, window="boxcar", detrend=None, short="pad")
    (spectrum,) = np.asarray(psd.fit_transform(turned))
    orders, step = psd.orders_, psd.order_step_
    _draw_smearing(chapter, (hertz, density), (orders, spectrum))
    below = hertz[np.searchsorted(density.cumsum() / density.sum(), 0.99)]
    end = 6 * ramp.velocity[-1] / TURN
    smeared = (
        'frequency below which 99 % of the power lies. The published value is read from "about '
        f'100 Hz"; by Eq. (2.11) the frequency of the ramp ends at {end:.1f} Hz.'
    )
    divided = (
        "The thesis divides the highest order, 30, by L = 256; by its Eqs. (2.14) and (2.22) and "
        "Fig. 2.5 the step is 60 samples per revolution divided by L."
    )
    name = "Fig. 2.6, highest frequency of the smeared spectrum [Hz]"
    chapter.compare(name, 100, round(below, 3), smeared)
    chapter.compare("Fig. 2.7, highest order", 30, orders[-1], "half of 60 samples per revolution")
    peak = "highest line of 256 samples; the range is half a step on either side"
    at = orders[spectrum.argmax()]
    chapter.compare("Fig. 2.7, order of the peak", 6, at, peak, tolerance=step / 2)
    chapter.compare("Fig. 2.7, order step", 0.1172, round(step, 4), divided)
    half, narrow = _half_width(hertz, density), _half_width(orders, spectrum)
    chapter.remarks.append(
        f"Smearing: the fewest lines that contain half of the power cover {half:.0f} Hz in Fig. "
        f"2.6, {half / end:.0%} of the range of the ramp, and {narrow:.2f} orders in Fig. 2.7."
    )
    (stroke,) = turned[0].strokes
    chapter.remarks.append(
        f"The ramp of 0.5 s contains {stroke.revolutions:.2f} revolutions, {stroke.n_angles} "
        "samples at 60 per revolution. A transform of 256 samples, as in the thesis, requires "
        f"zero padding: the distance of lines is {step:.3f} orders, but the resolution of two "
        f"revolutions is half an order. The sampling rate in time is not given; {_FS:g} Hz is "
        "assumed."
    )


def _draw_smearing(
    chapter: Chapter,
    over_hertz: tuple[NDArray[np.floating], NDArray[np.floating]],
    over_orders: tuple[NDArray[np.floating], NDArray[np.floating]],
) -> None:
    ramp, (turned,) = _ramp(), _ramp_over_angle()
    (stroke,) = turned.strokes
    figure, axes = offscreen_panels(2, height=4.6)
    time = np.arange(len(ramp.signals["x1"])) / _FS
    axes[0, 0].plot(time, ramp.signals["x1"], color=PLAIN, linewidth=0.8)
    label_axes(axes[0, 0], "time [s]", "x1 [1]")
    axes[1, 0].plot(*over_hertz, color=PLAIN, linewidth=1.2)
    axes[1, 0].set(xlim=(0, 150), ylim=(0, None))
    label_axes(axes[1, 0], "frequency [Hz]", "PSD of x1 [1/Hz]")
    chapter.draw(
        "Fig. 2.6", figure, "In frequency the ramp is smeared over 50 Hz (published: 100)."
    )
    figure, axes = offscreen_panels(2, height=4.6)
    axes[0, 0].plot(
        stroke.angles, stroke.signals[0], ".-", color=PLAIN, linewidth=0.6, markersize=3
    )
    label_axes(axes[0, 0], "cumulative motor angle [rad]", "x1 [1]")
    axes[1, 0].plot(*over_orders, color=PLAIN, linewidth=1.2)
    axes[1, 0].set(xlim=(0, over_orders[0][-1]), ylim=(0, None))
    label_axes(axes[1, 0], "order [cycles per revolution]", "PSD of x1 [1/order]")
    chapter.draw("Fig. 2.7", figure, "In orders it is one narrow peak at order 6, as published.")


def _half_width(axis: NDArray[np.floating], psd: NDArray[np.floating]) -> float:
    """Return the width of the fewest lines that contain half of the power."""
    share = np.sort(psd)[::-1].cumsum() / psd.sum()
    return float((np.searchsorted(share, 0.5) + 1) * axis[1])


# Equations with misprints


def compare_equations(chapter: Chapter) -> None:
    """Compare equations as printed with their corrected form."""
    ramp, (turned,) = _ramp(), _ramp_over_angle()
    angle = angle_from_velocity(ramp.velocity, _FS)
    resampled = {
        "emacm": turned.strokes[0].signals[0],
        "printed": printed_resampling(ramp.signals["x1"], angle, TURN / _SAMPLES_PER_REV),
    }
    errors = {
        name: float(np.max(np.abs(values - np.sin(6 * TURN / _SAMPLES_PER_REV * np.arange(120)))))
        for name, values in resampled.items()
    }
    alternating = np.resize([1.0, -1.0], 64)  # all power at half the sampling rate
    _, power = order_psd(alternating, 1, n_per_segment=64, window="boxcar", scaling="spectrum")
    rows = [
        ("Eq. (2.9)", "angle of the ramp after 0.5 s [rad]", 12.5, angle[-1],
         printed_angle(ramp.velocity, _FS)[-1]),
        ("Eq. (2.13)", "largest error of the resampled ramp", 0.0, errors["emacm"],
         errors["printed"]),
        ("Eq. (2.20)", "power of 1, -1, 1, -1, ...", 1.0, power.sum(), power.sum() + power[-1]),
        ("Fig. 2.7", "order step of 256 samples, 60 per revolution", 60 / 256, 60 / 256, 30 / 256),
    ]  # fmt: skip
    table = pd.DataFrame(rows, columns=["equation", "quantity", "true", "emacm", "as printed"])
    chapter.tables["Equations as printed"] = table.set_index(["equation", "quantity"])
    chapter.remarks += [
        "Eq. (2.9) lacks parentheses around the two speeds; Eq. (2.13) starts from x(k) but "
        "measures the angle from the sample before; Eq. (2.20) doubles the line at half the "
        "sampling rate, which occurs only once. The table contains both forms.",
        "Eq. (2.1) is called the frequency of the inner race. With a minus it is that of the outer "
        "race (BPFO); that of the inner race (BPFI) has a plus, as in emacm.Bearing.",
        "Section 2.2.1 states in words that deciding w2 when w1 is true costs 10. By Eq. (2.39) "
        "rows of Eq. (2.48) are decisions, so this is the cost of deciding w1 when w2 is true, a "
        "missed detection; only then do wrong decisions for w1 fall from 12 to 2. The table of "
        "errors contains both.",
    ]
