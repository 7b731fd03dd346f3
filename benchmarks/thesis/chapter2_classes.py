"""Chapter 2 of the thesis, second half: components and decisions, Figs. 2.10 to 2.14."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats
from sklearn.decomposition import PCA

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.displays import DecisionRegionsDisplay, FeatureDensityDisplay
from emacm.displays.drawing import label_axes, legend_above, line_style, offscreen_panels
from findings import Chapter

_HEALTHY = ([1, 10, 5, 4], [0.01, 0.01, 0.01, 0.01])  # Eq. (2.33): means and variances
_DEFECTIVE = ([1, 10, 6, 4], [0.01, 0.04, 0.01, 0.01])  # Eq. (2.34)
_EIGENVALUES = (0.261, 0.024, 0.010, 0.009)
_SHARES = (85.7, 7.9, 3.4, 3.1)  # %
_EIGENVECTORS = np.array([
    [-0.001, -0.053, 0.596, -0.801],
    [0.007, -0.997, -0.074, 0.010],
    [-0.999, -0.006, -0.009, -0.005],
    [-0.010, -0.054, 0.799, 0.599],
])  # fmt: skip  # Table 2.1: one row per component of y, one column per eigenvector

_LEADING = ((0, 2), (1, 1))  # eigenvector, component: the entries that are not zero by design

_PRINTED_ERRORS = {"0-1": (12, 11), "Eq. (2.48)": (2, 36)}  # of 1000: decided as w1, as w2
_COSTS: dict[str, Any] = {
    "0-1": None,
    "Eq. (2.48)": {("w1", "w2"): 10.0},
    "Eq. (2.48), as described in words": {("w2", "w1"): 10.0},
}
_SAMPLING = "median and range of {n} draws of the stated distributions, rounded as printed"


# Table 2.1: 500 draws of Eq. (2.33) and 500 of Eq. (2.34)


def _draw_of_table_2_1(seed: int) -> tuple[NDArray[np.floating], NDArray[np.str_]]:
    rng = np.random.default_rng([21, seed])
    parts = [rng.normal(mean, np.sqrt(var), (500, 4)) for mean, var in (_HEALTHY, _DEFECTIVE)]
    return np.vstack(parts), np.repeat(["healthy", "defective"], 500)


def compare_components(chapter: Chapter, n_draws: int) -> None:
    """Compare Table 2.1 and draw Figs. 2.10 and 2.11, from `n_draws` draws."""
    fits = [PCA().fit(_draw_of_table_2_1(seed)[0]) for seed in range(n_draws)]
    eigenvalues = np.array([fit.explained_variance_ for fit in fits])
    shares = 100 * np.array([fit.explained_variance_ratio_ for fit in fits])
    weights = np.abs([fit.components_ for fit in fits])
    note = _SAMPLING.format(n=n_draws)
    for i, (eigenvalue, share) in enumerate(zip(_EIGENVALUES, _SHARES, strict=True)):
        for name, published, values in (
            (f"eigenvalue {i + 1}", eigenvalue, eigenvalues[:, i].round(3)),
            (f"contribution {i + 1} [%]", share, shares[:, i].round(1)),
        ):
            chapter.compare(f"Table 2.1, {name}", published, values, note)
    for i, j in _LEADING:
        name = f"Table 2.1, e{i + 1}, y{j + 1}, magnitude"
        published = abs(float(_EIGENVECTORS[j, i]))
        chapter.compare(name, published, weights[:, i, j].round(3), note)
    plane = np.hypot(weights[:, 2:, 0], weights[:, 2:, 3])
    chapter.remarks.append(
        "y1 and y4 have the same variance in both classes, so the direction of e3 and e4 in their "
        "plane is random: 0.596 and 0.799 of e3, -0.801 and 0.599 of e4 cannot be compared. Their "
        f"lengths in that plane can: published "
        f"{np.hypot(0.596, 0.799):.3f} and {np.hypot(0.801, 0.599):.3f}, ours "
        f"{np.median(plane[:, 0]):.3f} and {np.median(plane[:, 1]):.3f}."
    )
    chapter.tables["Table 2.1"] = _table_2_1(fits[0])
    _draw_components(chapter, fits[0])


def _table_2_1(fit: PCA) -> pd.DataFrame:
    """Return one draw in the form of the published table, and the published one."""
    ours = np.vstack([
        fit.explained_variance_, 100 * fit.explained_variance_ratio_, fit.components_.T
    ])  # fmt: skip
    published = np.vstack([_EIGENVALUES, _SHARES, _EIGENVECTORS])
    # Signs of eigenvectors are arbitrary: those of the largest entries follow the published ones.
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
    figure, axes = offscreen_panels(2, 2, height=5.6)
    classes = {"healthy": _HEALTHY, "defective": _DEFECTIVE}
    for k, ax in enumerate(axes.flat):
        for number, (name, (means, variances)) in enumerate(classes.items()):
            law = stats.norm(means[k], np.sqrt(variances[k]))
            values = np.linspace(*law.interval(1 - 1e-5), 300)
            style = line_style(number) | {"linewidth": 3 - 1.7 * number}
            ax.plot(values, law.pdf(values), label=name, **style)
        ax.set_ylim(bottom=0)
        label_axes(ax, f"y{k + 1}", f"density of y{k + 1}")
    legend_above(axes[0, 1])
    chapter.draw(
        "Fig. 2.10",
        figure,
        "Densities of Eqs. (2.33) and (2.34): the classes differ in y3, and in the scatter of y2.",
    )
    values, labels = _draw_of_table_2_1(0)
    plane = fit.transform(values)[:, :2]
    model = CostSensitiveGaussianBayes().fit(plane, labels)
    figure, axes = offscreen_panels(height=4.4)
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
        "contain 50 and 90 % of each class: the first component, with "
        f"{fit.explained_variance_ratio_[0]:.1%} of the variance (published {_SHARES[0]} %), "
        "separates them.",
    )


# Section 2.2.1: 1000 of each of two classes


def separation() -> float:
    """Return the distance of two classes of unit variance with the error rate of Fig. 2.13."""
    return float(2 * stats.norm.isf(sum(_PRINTED_ERRORS["0-1"]) / 2000))


def _two_classes(seed: int) -> tuple[NDArray[np.floating], NDArray[np.str_]]:
    rng = np.random.default_rng([22, seed])
    points = rng.standard_normal((2000, 2))
    points[1000:] += separation() / np.sqrt(2)
    return points, np.repeat(["w1", "w2"], 1000)


def _errors(cost: Any, seed: int) -> tuple[int, int]:
    """Count the wrong decisions for w1 and for w2."""
    points, labels = _two_classes(seed)
    decided = CostSensitiveGaussianBayes(cost, priors="uniform").fit(points, labels).predict(points)
    wrong = decided != labels
    return int(np.sum(wrong & (decided == "w1"))), int(np.sum(wrong & (decided == "w2")))


def compare_decisions(chapter: Chapter, n_draws: int) -> None:
    """Compare the errors of Figs. 2.12 to 2.14, from `n_draws` draws."""
    counts = {
        name: np.array([_errors(cost, seed) for seed in range(n_draws)])
        for name, cost in _COSTS.items()
    }
    chapter.tables["Figs. 2.13 and 2.14, errors of 1000"] = _error_table(counts)
    note = (
        "two Gaussian classes of equal covariance, with the distance that follows from Fig. 2.13; "
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
        "The parameters of Figs. 2.12 to 2.14 are not published. Two Gaussian classes of equal "
        f"covariance have one parameter, the distance of their means: {separation():.2f} standard "
        "deviations were chosen to give the 12 and 11 errors of Fig. 2.13, which are therefore "
        "not a finding. The errors of Fig. 2.14, 2 and 36, need no further assumption."
    )
    points, labels = _two_classes(0)
    names = ("z1 [1]", "z2 [1]")
    figure, axes = offscreen_panels(height=4.6)
    model = CostSensitiveGaussianBayes(priors="uniform").fit(points, labels)
    FeatureDensityDisplay.from_estimator(
        model, points, labels, shares=(), names=names, ax=axes[0, 0]
    )
    chapter.draw("Fig. 2.12", figure, "1000 draws of each of two overlapping classes.")
    for name, cost, words in (
        ("Fig. 2.13", None, "under the 0-1 cost"),
        ("Fig. 2.14", _COSTS["Eq. (2.48)"], "if a wrong decision for w1 costs 10"),
    ):
        figure, axes = offscreen_panels(height=4.6)
        model = CostSensitiveGaussianBayes(cost, priors="uniform").fit(points, labels)
        DecisionRegionsDisplay.from_estimator(model, points, labels, names=names, ax=axes[0, 0])
        as_w1, as_w2 = _errors(cost, 0)
        printed = " and ".join(map(str, _PRINTED_ERRORS["0-1" if cost is None else "Eq. (2.48)"]))
        caption = (
            f"Decisions {words}: {as_w1} wrongly decided as w1, {as_w2} as w2, of 1000 each "
            f"(published {printed})."
        )
        chapter.draw(name, figure, caption)


def _error_table(counts: dict[str, NDArray[np.int_]]) -> pd.DataFrame:
    rows = {}
    for name, values in counts.items():
        printed = _PRINTED_ERRORS.get(name.split(",")[0], (np.nan, np.nan))
        for column, decided in enumerate(("w1", "w2")):
            ours = np.quantile(values[:, column], (0.5, 0, 1))
            rows[name, f"decided as {decided}"] = (printed[column], *ours)
    table = pd.DataFrame.from_dict(
        rows, orient="index", columns=["published", "ours", "low", "high"]
    )
    table.index = pd.MultiIndex.from_tuples(table.index, names=["cost", "error"])
    return table
