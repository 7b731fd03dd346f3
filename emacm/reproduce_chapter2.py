"""Chapter 2 of the thesis: resampling, order spectra, principal components, Bayes' rule."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats
from sklearn.decomposition import PCA

from emacm._drawing import COLOURS, legend_beside, line_style, offscreen_panels
from emacm.diagnosis import CostSensitiveGaussianBayes
from emacm.displays import (
    DecisionRegionsDisplay,
    FeatureDensityDisplay,
    OrderSpectrumDisplay,
    RecordingDisplay,
)
from emacm.findings import Chapter
from emacm.order_psd import OrderPSD
from emacm.order_resampler import OrderResampler
from emacm.printed_equations import printed_angle, printed_resampling
from emacm.recordings import Recording
from emacm.shaft import angle_from_velocity
from emacm.spectrum import order_psd

TURN = 2 * np.pi
_FS = 1000.0  # Hz, of the ramp; assumed
_SAMPLES_PER_REV = 60
_LINES_2_7 = 256  # samples of the transform of Fig. 2.7

_HEALTHY = ([1, 10, 5, 4], [0.01, 0.01, 0.01, 0.01])  # Eq. (2.33): means and variances
_DEFECTIVE = ([1, 10, 6, 4], [0.01, 0.04, 0.01, 0.01])  # Eq. (2.34)
_EIGENVALUES = (0.261, 0.024, 0.010, 0.009)
_SHARES = (85.7, 7.9, 3.4, 3.1)  # %
_EIGENVECTORS = np.array([
    [-0.001, -0.053, 0.596, -0.801],
    [0.007, -0.997, -0.074, 0.010],
    [-0.999, -0.006, -0.009, -0.005],
    [-0.010, -0.054, 0.799, 0.599],
])  # fmt: skip  # Table 2.1: a row a component of y, a column an eigenvector

_PRINTED_ERRORS = {"0-1": (12, 11), "Eq. (2.48)": (2, 36)}  # of 1000: as w1, as w2
_COSTS: dict[str, Any] = {
    "0-1": None,
    "Eq. (2.48)": {("w1", "w2"): 10.0},
    "Eq. (2.48), as the words have it": {("w2", "w1"): 10.0},
}
_SAMPLING = "median and range of {n} draws of the stated distributions, rounded as printed"


def chapter2(
    *,
    quick: bool = False,
    n_jobs: int | None = None,
    report: Callable[[str], None] | None = None,
) -> Chapter:
    """Reproduce chapter 2 of the thesis [1]_.

    Parameters
    ----------
    quick : bool
        Whether to draw random numbers for 20 sets in place of 200.
    n_jobs : int, optional
        Has no say: all is done in a few seconds.
    report : callable, optional
        Is told in a line what is being done.

    Returns
    -------
    Chapter
        Figures 2.3 to 2.7 and 2.10 to 2.14, Table 2.1 and what else is comparable.

    References
    ----------
    .. [1] Chirico, chapter 2.

    Examples
    --------
    >>> chapter = chapter2(quick=True)  # doctest: +SKIP
    >>> chapter.tables["Table 2.1"]  # doctest: +SKIP
    """
    tell = report or (lambda line: None)
    n_draws = 20 if quick else 200
    chapter = Chapter(2, "Feature extraction and classification, by example")
    tell("chapter 2: a ramp in time, in angle, in hertz and in orders")
    _resampling(chapter)
    _sine(chapter)
    _smearing(chapter)
    tell(f"chapter 2: {n_draws} draws of Table 2.1")
    _principal_components(chapter, n_draws)
    tell(f"chapter 2: {n_draws} draws of two classes, decided under three cost matrices")
    _decisions(chapter, n_draws)
    _contradictions(chapter)
    return chapter


# Figs. 2.3, 2.4, 2.6 and 2.7: sin(6 theta) on a ramp of 100t rad/s, 0.5 s


def _ramp() -> Recording:
    time = np.arange(int(_FS / 2) + 1) / _FS
    # Eqs. (2.5) and (2.11).
    return Recording({"x1": np.sin(300 * time**2)}, _FS, velocity=100 * time)


def _ramp_over_angle() -> list[Any]:
    thesis = OrderResampler(TURN / _SAMPLES_PER_REV, interpolation="linear", antialias=False)
    return thesis.fit_transform([_ramp()])


def _resampling(chapter: Chapter) -> None:
    ramp, (turned,) = _ramp(), _ramp_over_angle()
    angle = angle_from_velocity(ramp.velocity, _FS)
    figure, axes = offscreen_panels(3, size=(7.2, 5.6))
    axes = axes[:, 0]
    RecordingDisplay.from_recording(ramp, units={"x1": "1"}, ax=axes[:2])
    axes[2].plot(angle, ramp.signals["x1"], color=COLOURS[0], linewidth=0.8)
    _label(axes[2], "cumulative motor angle [rad]", "x1 [1]")
    chapter.draw(
        "Fig. 2.3", figure, "sin(6θ) on a ramp of 100t rad/s: not periodic in time, but in angle."
    )
    (stroke,) = turned.strokes
    figure, axes = offscreen_panels(size=(7.2, 3.4))
    ax = axes[0, 0]
    fine = np.linspace(0, angle[-1], 2000)
    ax.plot(fine, np.sin(6 * fine), color="0.7", linewidth=0.8, label="sin 6θ")
    ax.plot(
        stroke.angles, stroke.signals[0], "o", markersize=3, color=COLOURS[1], label="resampled"
    )
    legend_beside(ax)
    _label(ax, "cumulative motor angle [rad]", "x1 [1]")
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
        slack=0.1,
    )


def _sine(chapter: Chapter) -> None:
    fs, frequency, length = 640, 40, 32
    signal = np.sin(TURN * frequency * np.arange(length) / fs)
    box = {"n_per_segment": length, "window": "boxcar"}
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
    figure, axes = offscreen_panels(2, 2, size=(9.6, 5.2))
    fine = np.linspace(0, (length - 1) / fs, 1000)
    axes[0, 0].plot(fine, np.sin(TURN * frequency * fine), color=COLOURS[0], linewidth=0.9)
    _label(axes[0, 0], "time [s]", "x2(t) [1]")
    axes[0, 1].stem(np.arange(length), signal, basefmt="0.5")
    _label(axes[0, 1], "sample n", "x2(n) [1]")
    axes[1, 0].stem(hertz, density, basefmt="0.5")
    _label(axes[1, 0], "frequency [Hz]", "PSD [1/Hz]")
    axes[1, 1].stem(cycles, power, basefmt="0.5")
    _label(axes[1, 1], "frequency [cycles per sample]", "power [1]")
    chapter.draw(
        "Fig. 2.5",
        figure,
        "A sine of 40 Hz, at 640 Hz and by sample, with its density and its power; L = 32, "
        "rectangular window.",
    )


def _smearing(chapter: Chapter) -> None:
    ramp, turned = _ramp(), _ramp_over_angle()
    signal = ramp.signals["x1"]
    hertz, density = order_psd(
        signal, _FS, n_per_segment=len(signal), window="boxcar", detrend=None
    )
    psd = OrderPSD(n_per_segment=_LINES_2_7, window="boxcar", detrend=None, short="pad")
    (spectrum,) = np.asarray(psd.fit_transform(turned))
    orders, step = psd.orders_, psd.order_step_
    _draw_smearing(chapter, (hertz, density), (orders, spectrum))
    (stroke,) = turned[0].strokes
    chapter.compare(
        "Fig. 2.7, highest order", 30, round(orders[-1], 12), "half of 60 samples per revolution"
    )
    chapter.compare(
        "Fig. 2.7, order of the peak",
        6,
        orders[spectrum.argmax()],
        "highest line of 256 samples; the range is half a step either way",
        slack=step / 2,
    )
    chapter.compare(
        "Fig. 2.7, order step",
        0.1172,
        round(step, 4),
        "The thesis divides the highest order, 30, by L = 256; the step is the 60 samples per "
        "revolution over L. Its own Eqs. (2.14) and (2.22) say so, and so does Fig. 2.5.",
    )
    below = hertz[np.searchsorted(density.cumsum() / density.sum(), 0.99)]
    end = 6 * ramp.velocity[-1] / TURN
    chapter.remarks.append(
        f"Fig. 2.6 is described as smeared from 0 to about 100 Hz. The frequency of the ramp "
        f"rises to {end:.1f} Hz; {0.99:.0%} of the power lies below {below:.0f} Hz. The narrowest "
        f"band that holds half of the power is {_half_width(hertz, density):.0f} Hz wide, that is "
        f"{_half_width(hertz, density) / end:.0%} of the way; in orders it is "
        f"{_half_width(orders, spectrum):.2f} orders wide. How far a smear reaches to the eye is no "
        f"number that can be compared."
    )
    chapter.remarks.append(
        f"The ramp of 0.5 s holds {stroke.revolutions:.2f} revolutions, {stroke.n_angles} samples at "
        f"60 per revolution. A transform of 256 samples, as the thesis has it, means zeros "
        f"added: lines lie {step:.3f} orders apart, but two revolutions resolve half an order. "
        f"The sampling rate in time is not given; {_FS:g} Hz was assumed."
    )


def _draw_smearing(
    chapter: Chapter,
    over_hertz: tuple[NDArray[np.floating], NDArray[np.floating]],
    over_orders: tuple[NDArray[np.floating], NDArray[np.floating]],
) -> None:
    ramp, (turned,) = _ramp(), _ramp_over_angle()
    (stroke,) = turned.strokes
    figure, axes = offscreen_panels(2, size=(7.2, 4.6))
    time = np.arange(len(ramp.signals["x1"])) / _FS
    axes[0, 0].plot(time, ramp.signals["x1"], color=COLOURS[0], linewidth=0.8)
    _label(axes[0, 0], "time [s]", "x1 [1]")
    axes[1, 0].plot(*over_hertz, color=COLOURS[0], linewidth=1.2)
    axes[1, 0].set(xlim=(0, 150), ylim=(0, None))
    _label(axes[1, 0], "frequency [Hz]", "PSD of x1 [1/Hz]")
    chapter.draw("Fig. 2.6", figure, "Over time the ramp smears: its power is spread over 50 Hz.")
    figure, axes = offscreen_panels(2, size=(7.2, 4.6))
    axes[0, 0].plot(
        stroke.angles, stroke.signals[0], ".-", color=COLOURS[0], linewidth=0.6, markersize=3
    )
    _label(axes[0, 0], "cumulative motor angle [rad]", "x1 [1]")
    display = OrderSpectrumDisplay(
        over_orders[0], {"resampled": over_orders[1]}, channel="x1", unit="1", scale="linear"
    ).plot(ax=axes[1, 0])
    display.ax_.get_legend().remove()
    display.ax_.set_ylabel("PSD of x1 [1/order]")
    chapter.draw("Fig. 2.7", figure, "Over the shaft angle it is one narrow peak, at order 6.")


def _half_width(axis: NDArray[np.floating], psd: NDArray[np.floating]) -> float:
    """Return the width of the fewest lines that hold half of the power."""
    share = np.sort(psd)[::-1].cumsum() / psd.sum()
    return float((np.searchsorted(share, 0.5) + 1) * axis[1])


# Table 2.1: 500 draws of Eq. (2.33) and 500 of Eq. (2.34)


def _draw_of_table_2_1(seed: int) -> tuple[NDArray[np.floating], NDArray[np.str_]]:
    rng = np.random.default_rng([21, seed])
    parts = [rng.normal(mean, np.sqrt(var), (500, 4)) for mean, var in (_HEALTHY, _DEFECTIVE)]
    return np.vstack(parts), np.repeat(["healthy", "defective"], 500)


def _principal_components(chapter: Chapter, n_draws: int) -> None:
    fits = [PCA().fit(_draw_of_table_2_1(seed)[0]) for seed in range(n_draws)]
    eigenvalues = np.array([fit.explained_variance_ for fit in fits])
    shares = 100 * np.array([fit.explained_variance_ratio_ for fit in fits])
    weights = np.abs([fit.components_ for fit in fits])
    note = _SAMPLING.format(n=n_draws)
    for i, (eigenvalue, share) in enumerate(zip(_EIGENVALUES, _SHARES, strict=True)):
        chapter.compare(
            f"Table 2.1, eigenvalue {i + 1}", eigenvalue, eigenvalues[:, i].round(3), note
        )
        chapter.compare(f"Table 2.1, contribution {i + 1} [%]", share, shares[:, i].round(1), note)
    for i in range(4):
        for j in range(4):
            if i < 2 or j in (1, 2):
                chapter.compare(
                    f"Table 2.1, e{i + 1}, y{j + 1}, magnitude",
                    abs(float(_EIGENVECTORS[j, i])),
                    weights[:, i, j].round(3),
                    f"{note}; the sign of an eigenvector is free",
                )
    plane = np.hypot(weights[:, 2:, 0], weights[:, 2:, 3])
    chapter.remarks.append(
        "y1 and y4 have the same variance in both classes, so e3 and e4 may lie anywhere in their "
        "plane: 0.596 and 0.799 of e3, -0.801 and 0.599 of e4 are one draw's turn, and cannot "
        f"be compared. Their lengths in that plane can: published "
        f"{np.hypot(0.596, 0.799):.3f} and {np.hypot(0.801, 0.599):.3f}, ours "
        f"{np.median(plane[:, 0]):.3f} and {np.median(plane[:, 1]):.3f}."
    )
    chapter.tables["Table 2.1"] = _table_2_1(fits[0])
    _draw_components(chapter, fits[0])


def _table_2_1(fit: PCA) -> pd.DataFrame:
    """Lay out one draw as the thesis does, beside the published one."""
    ours = np.vstack([
        fit.explained_variance_, 100 * fit.explained_variance_ratio_, fit.components_.T
    ])  # fmt: skip
    published = np.vstack([_EIGENVALUES, _SHARES, _EIGENVECTORS])
    # Signs are free: those of the largest entries follow the published ones.
    turn = np.sign(np.sum(ours[2:] * published[2:], axis=0))
    ours[2:] *= turn
    names = [f"e{i + 1}" for i in range(4)]
    index = pd.Index(["eigenvalue", "contribution [%]", "y1", "y2", "y3", "y4"], name="quantity")
    tables = {
        "published": pd.DataFrame(published, index, names),
        "ours, one draw": pd.DataFrame(ours.round(4), index, names),
    }
    return pd.concat(tables, axis=1)


def _draw_components(chapter: Chapter, fit: PCA) -> None:
    figure, axes = offscreen_panels(2, 2, size=(9.6, 5.6))
    for k, ax in enumerate(axes.flat):
        values = np.concatenate([
            mean[k] + 4.5 * np.sqrt(var[k]) * np.linspace(-1, 1, 101)
            for mean, var in (_HEALTHY, _DEFECTIVE)
        ])  # fmt: skip
        grid = np.linspace(values.min(), values.max(), 400)
        for number, (name, (mean, var)) in enumerate(
            {"healthy": _HEALTHY, "defective": _DEFECTIVE}.items()
        ):
            density = stats.norm.pdf(grid, mean[k], np.sqrt(var[k]))
            style = line_style(number) | {
                "linewidth": 3 - 1.7 * number,
                "alpha": 1 - 0.5 * (not number),
            }
            ax.plot(grid, density, label=name, **style)
        ax.set_ylim(bottom=0)
        _label(ax, f"y{k + 1}", f"density of y{k + 1}")
    legend_beside(axes[0, 1])
    chapter.draw(
        "Fig. 2.10", figure, "Densities of Eqs. (2.33) and (2.34): the classes part in y3 alone."
    )
    values, labels = _draw_of_table_2_1(0)
    plane = fit.transform(values)[:, :2]
    model = CostSensitiveGaussianBayes().fit(plane, labels)
    figure, axes = offscreen_panels(size=(7.2, 4.4))
    FeatureDensityDisplay.from_estimator(
        model,
        plane,
        labels,
        names=("principal component 1", "principal component 2"),
        ax=axes[0, 0],
    )
    chapter.draw(
        "Fig. 2.11",
        figure,
        "One draw of Table 2.1 in the plane of its first two components, with ellipses that "
        "hold 50 and 90 % of each class: the first alone tells them apart.",
    )


# Section 2.2.1: 1000 of each of two classes


def _separation() -> float:
    """Return how far apart two classes of unit variance lie that are as often confused."""
    return float(2 * stats.norm.isf(sum(_PRINTED_ERRORS["0-1"]) / 2000))


def _two_classes(seed: int) -> tuple[NDArray[np.floating], NDArray[np.str_]]:
    rng = np.random.default_rng([22, seed])
    points = rng.standard_normal((2000, 2))
    points[1000:] += _separation() / np.sqrt(2)
    return points, np.repeat(["w1", "w2"], 1000)


def _errors(cost: Any, seed: int) -> tuple[int, int]:
    """Count what was wrongly decided as w1, and as w2."""
    points, labels = _two_classes(seed)
    decided = CostSensitiveGaussianBayes(cost, priors="uniform").fit(points, labels).predict(points)
    wrong = decided != labels
    return int(np.sum(wrong & (decided == "w1"))), int(np.sum(wrong & (decided == "w2")))


def _decisions(chapter: Chapter, n_draws: int) -> None:
    counts = {
        name: np.array([_errors(cost, seed) for seed in range(n_draws)])
        for name, cost in _COSTS.items()
    }
    chapter.tables["Figs. 2.13 and 2.14, errors of 1000"] = _error_table(counts)
    note = (
        "two Gaussian classes of equal covariance, as far apart as the errors of Fig. 2.13 say; "
        f"range of {n_draws} draws"
    )
    for column, decided in enumerate(("w1", "w2")):
        chapter.compare(
            f"Fig. 2.14, errors of 1000 decided as {decided}",
            _PRINTED_ERRORS["Eq. (2.48)"][column],
            counts["Eq. (2.48)"][:, column],
            note,
        )
    chapter.remarks.append(
        f"The parameters of Figs. 2.12 to 2.14 are not published. Two Gaussian classes of equal "
        f"covariance need only one, the distance of their means: {_separation():.2f} standard "
        f"deviations give the 12 and 11 errors of Fig. 2.13, which therefore are no finding. "
        f"Those of Fig. 2.14, 2 and 36, follow without another assumption about the classes."
    )
    points, labels = _two_classes(0)
    names = ("z1 [1]", "z2 [1]")
    figure, axes = offscreen_panels(size=(6.6, 4.6))
    model = CostSensitiveGaussianBayes(priors="uniform").fit(points, labels)
    FeatureDensityDisplay.from_estimator(
        model, points, labels, shares=(), names=names, ax=axes[0, 0]
    )
    chapter.draw("Fig. 2.12", figure, "1000 of each of two classes that overlap.")
    for name, cost, words in (
        ("Fig. 2.13", None, "under the 0-1 cost"),
        ("Fig. 2.14", _COSTS["Eq. (2.48)"], "when deciding w1 wrongly costs 10"),
    ):
        figure, axes = offscreen_panels(size=(6.6, 4.6))
        model = CostSensitiveGaussianBayes(cost, priors="uniform").fit(points, labels)
        DecisionRegionsDisplay.from_estimator(model, points, labels, names=names, ax=axes[0, 0])
        as_w1, as_w2 = _errors(cost, 0)
        caption = f"Decisions {words}: {as_w1} wrongly decided as w1, {as_w2} as w2, of 1000 each."
        chapter.draw(name, figure, caption)


def _error_table(counts: dict[str, NDArray[np.int_]]) -> pd.DataFrame:
    rows = {}
    for name, values in counts.items():
        for column, decided in enumerate(("w1", "w2")):
            published = _PRINTED_ERRORS.get(name.split(",")[0], (np.nan, np.nan))[column]
            ours = values[:, column]
            rows[name, f"decided as {decided}"] = (
                published,
                np.median(ours),
                ours.min(),
                ours.max(),
            )
    table = pd.DataFrame.from_dict(
        rows, orient="index", columns=["published", "ours", "low", "high"]
    )
    table.index = pd.MultiIndex.from_tuples(table.index, names=["cost", "error"])
    return table


# Where the chapter contradicts itself


def _contradictions(chapter: Chapter) -> None:
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
    swinging = np.resize([1.0, -1.0], 64)  # all power at half the sampling rate
    _, power = order_psd(swinging, 1, n_per_segment=64, window="boxcar", scaling="spectrum")
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
        "sampling rate, which has no twin. The table sets both readings side by side.",
        "Eq. (2.1) is called the frequency of the inner race. With a minus it is that of the outer "
        "race (BPFO); the inner race has a plus (BPFI), and emacm.Bearing reads it so.",
        "Section 2.2.1 says in words that deciding w2 when w1 is true costs 10. By Eq. (2.39) rows "
        "of Eq. (2.48) are decisions, so it is deciding w1 when w2 is true, a missed detection; "
        "only so do errors as w1 fall from 12 to 2. The table of errors holds both.",
    ]


def _label(ax: Any, x: str, y: str) -> None:
    ax.set_xlabel(x)
    ax.set_ylabel(y)
