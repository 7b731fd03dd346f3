"""Time of decisions and risks, and what a product of posteriors costs for correlated channels.

One table for each covariance: "full" is compared with QuadraticDiscriminantAnalysis, "tied" with
LinearDiscriminantAnalysis, "diag" with GaussianNB: `predict` with `predict`, and `risk`, which also
applies the costs, with `predict_proba`. Prints medians of interleaved repeats, their ratios, and
the largest difference of posteriors for covariances with the same divisor. The last table compares
`PosteriorProduct` with one classifier of both channels. Run from the repository:

    OPENBLAS_NUM_THREADS=1 python benchmarks/classifier.py [--quick] [--json [FILE]]
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from measure import header, json_option, medians, write_json
from numpy.typing import NDArray
from sklearn.base import BaseEstimator
from sklearn.compose import make_column_transformer
from sklearn.discriminant_analysis import (
    LinearDiscriminantAnalysis,
    QuadraticDiscriminantAnalysis,
)
from sklearn.naive_bayes import GaussianNB
from sklearn.pipeline import make_pipeline

from emacm import CostSensitiveGaussianBayes, PosteriorProduct, neg_expected_cost

FEATURES, CLASSES = (2, 5, 10, 20, 50), (2, 5, 10, 20)
FIGURES = ("predict", "risk")


def recordings(
    rng: np.random.Generator, n_features: int, n_classes: int, n: int
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Overlapping classes, each with a covariance of its own."""
    y = np.arange(n) % n_classes
    mixing = rng.normal(size=(n_classes, n_features, n_features)) * 0.3 / np.sqrt(n_features)
    mixing += np.eye(n_features)
    centres = rng.normal(size=(n_classes, n_features)) * 2 / np.sqrt(n_features)
    X = rng.normal(size=(n, n_features))
    for k in range(n_classes):
        X[y == k] = X[y == k] @ mixing[k] + centres[k]
    return X, y


def quadratic(ours: CostSensitiveGaussianBayes, X: NDArray, y: NDArray) -> Any:
    """Return that of scikit-learn, whose divisor is N since 1.8, N - 1 before."""
    theirs = QuadraticDiscriminantAnalysis(store_covariance=True).fit(X, y)
    for k, covariance in enumerate(theirs.covariance_):
        theirs.scalings_[k] = theirs.scalings_[k] * (
            np.trace(ours.covariances_[k]) / np.trace(covariance)
        )
    return theirs


class Given(BaseEstimator):
    """Covariance estimator that returns a given matrix."""

    def __init__(self, covariance: NDArray):
        self.covariance = covariance

    def fit(self, X: NDArray) -> Given:
        """Set the covariance."""
        self.covariance_ = self.covariance
        return self


def linear(ours: CostSensitiveGaussianBayes, X: NDArray, y: NDArray) -> Any:
    """Return that of scikit-learn with our covariance; its divisor depends on the solver."""
    given = Given(ours.covariances_)
    return LinearDiscriminantAnalysis(solver="lsqr", covariance_estimator=given).fit(X, y)


def naive(ours: CostSensitiveGaussianBayes, X: NDArray, y: NDArray) -> Any:
    """Return that of scikit-learn, which divides by N."""
    theirs = GaussianNB(var_smoothing=0).fit(X, y)
    theirs.var_ *= (theirs.class_count_ / (theirs.class_count_ - 1))[:, np.newaxis]
    return theirs


KINDS = {"full": quadratic, "tied": linear, "diag": naive}


def compare(covariance: str, n_features: int, n_classes: int, n: int, repeats: int) -> dict:
    """Figures of one line."""
    rng = np.random.default_rng([n_features, n_classes])
    n_fit = 40 * n_features * n_classes
    X, y = recordings(rng, n_features, n_classes, n + n_fit)
    fitted = X[:n_fit], y[:n_fit]
    X = X[n_fit:].copy()
    ours = CostSensitiveGaussianBayes(covariance=covariance).fit(*fitted)
    theirs = KINDS[covariance](ours, *fitted)
    spent = medians(
        {
            "their predict": lambda: theirs.predict(X),
            "predict": lambda: ours.predict(X),
            "their posterior": lambda: theirs.predict_proba(X),
            "risk": lambda: ours.risk(X),
        },
        repeats,
    )
    row = {"covariance": covariance, "against": type(theirs).__name__}
    row |= {"features": n_features, "classes": n_classes, "recordings": n}
    row |= {f"{name} [ms]": 1e3 * seconds for name, seconds in spent.items()}
    row["predict ratio"] = spent["their predict"] / spent["predict"]
    row["risk ratio"] = spent["their posterior"] / spent["risk"]
    row["difference"] = float(np.abs(theirs.predict_proba(X) - ours.predict_proba(X)).max())
    return row


def correlated(n: int) -> list[dict]:
    """Return expected and paid costs of two channels that are correlated within each class.

    Their means differ by 1.5 standard deviations between two classes of equal frequency; a missed
    detection costs 20, a false alarm 1.
    """
    rows = []
    for correlation in (0.0, 0.5, 0.9):
        rng, covariance = np.random.default_rng(0), [[1, correlation], [correlation, 1]]
        y = np.tile(["healthy", "worn"], n)
        X = rng.multivariate_normal([0, 0], covariance, 2 * n) + 1.5 * (y == "worn")[:, np.newaxis]
        one = CostSensitiveGaussianBayes(covariance="tied")
        channels = [make_column_transformer(("passthrough", [column])) for column in (0, 1)]
        members = [(f"channel {k}", make_pipeline(own, one)) for k, own in enumerate(channels)]
        for model in (PosteriorProduct(members), one):
            model.set_params(cost={("healthy", "worn"): 20}).fit(X[:n], y[:n])
            rows.append(
                {
                    "model": type(model).__name__,
                    "correlation": correlation,
                    "expected cost": model.risk(X[n:]).min(axis=1).mean(),
                    "paid cost": -neg_expected_cost(model, X[n:], y[n:]),
                }
            )
    return rows


def main() -> None:
    """Measure, print the tables and write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few recordings, two repeats")
    json_option(parser)
    options = parser.parse_args()
    n, repeats = (5_000, 2) if options.quick else (100_000, 9)
    features, classes = ((2, 20), (2, 5)) if options.quick else (FEATURES, CLASSES)

    print(header())
    print(f"{n} recordings; medians of {repeats}, in ms; ratio: their time by ours")
    rows = []
    for covariance in KINDS:
        table = []
        for n_features in features:
            for n_classes in classes:
                row = compare(covariance, n_features, n_classes, n, repeats)
                if not table:
                    print_head(row)
                table.append(row)
                print_line(row)
        for figure in FIGURES:
            ratios = [row[f"{figure} ratio"] for row in table]
            print(f"{figure}: ratio {min(ratios):.2f} minimum, {np.median(ratios):.2f} median")
        rows += table
    found = correlated(n)
    print("\nmean cost of decisions by two correlated channels")
    for row in found:
        print("{model:28}{correlation:5.1f}{expected cost:10.3f}{paid cost:10.3f}".format(**row))
    write_json(options, rows + found)


def print_head(row: dict) -> None:
    """Two lines above a table."""
    print(f"\n{row['covariance']!r} against {row['against']}")
    print(
        f"{'features':>8}{'classes':>8}{'predict':>12}{'ours':>8}{'ratio':>7}"
        f"{'predict_proba':>16}{'our risk':>10}{'ratio':>7}{'posteriors differ by':>23}"
    )


def print_line(row: dict) -> None:
    """One line of a table."""
    print(
        f"{row['features']:8}{row['classes']:8}"
        f"{row['their predict [ms]']:12.1f}{row['predict [ms]']:8.1f}{row['predict ratio']:7.2f}"
        f"{row['their posterior [ms]']:16.1f}{row['risk [ms]']:10.1f}{row['risk ratio']:7.2f}"
        f"{row['difference']:23.1e}",
        flush=True,
    )


if __name__ == "__main__":
    main()
