"""Posteriors, costs and decisions, section 2.2.1 of the thesis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import multivariate_normal
from sklearn.decomposition import PCA
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.pipeline import make_pipeline

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.metrics import expected_cost
from emacm.decisions.posterior_product import PosteriorProduct
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_psd import OrderPSD
from emacm.resampling.order_resampler import OrderResampler
from emacm.simulation.chapter3 import chapter3_recordings

Table = tuple[NDArray[np.float64], NDArray[np.str_]]


def covariances() -> dict[str, float]:
    """Compare variances with those by hand."""
    X, y = [[1.0], [2.0], [4.0], [0.0], [1.0]], ["a", "a", "a", "b", "b"]
    tied = CostSensitiveGaussianBayes(covariance="tied").fit(X, y).covariances_
    full = CostSensitiveGaussianBayes().fit(X, y).covariances_
    return {"full": full[0, 0, 0], "tied": tied[0, 0]}


def posteriors() -> dict[str, float]:
    """Compare posteriors with formulas and other packages, Eqs. (2.41), (2.42)."""
    equal = _pairs(0, 1, 2, 1)
    # At 0.75 the densities are phi(0.75) and phi(0.75) / 2.
    unequal = CostSensitiveGaussianBayes(priors=[0.7, 0.3]).fit(*_pairs(0, 1, 2.25, 2))
    product = PosteriorProduct([(name, CostSensitiveGaussianBayes()) for name in ("one", "two")])
    models = {
        "equal": CostSensitiveGaussianBayes().fit(*equal),
        "temperature": CostSensitiveGaussianBayes(temperature=2.0).fit(*equal),
        "product": product.fit(*equal),
    }
    found = {name: model.predict_proba([[0.0]])[0, 0] for name, model in models.items()}
    found["unequal"] = unequal.predict_proba([[0.75]])[0, 0]
    X, y = np.random.default_rng(5).standard_normal((2000, 2)), np.repeat(["a", "b"], 1000)
    X[y == "b", 0] += 1.0
    # LDA divides the covariance by N, not by N - K.
    tied = CostSensitiveGaussianBayes(covariance="tied", temperature=1998 / 2000).fit(X, y)
    of_lda = LinearDiscriminantAnalysis(solver="lsqr").fit(X, y).predict_proba(X)
    moments = [(X[y == name].mean(axis=0), np.cov(X[y == name].T)) for name in "ab"]
    densities = np.stack([multivariate_normal(*of_class).pdf(X) for of_class in moments], axis=1)
    of_scipy = densities / densities.sum(axis=1, keepdims=True)
    full = CostSensitiveGaussianBayes().fit(X, y).predict_proba(X)
    found["scikit-learn"] = np.abs(tied.predict_proba(X) - of_lda).max()
    return found | {"scipy": np.abs(full - of_scipy).max()}


def least_risk() -> dict[str, float]:
    """Compare decisions of least conditional risk with formulas, Eq. (2.43)."""
    cost, axis = np.array([[0.0, 10.0], [1.0, 0.0]]), np.linspace(-1, 3, 4001)[:, np.newaxis]
    model = CostSensitiveGaussianBayes(cost).fit(*_pairs(0, 1, 2, 1))
    limit = 1 - np.log(10) / 2  # 10 P(b|x) = P(a|x): 2 (x - 1) = -ln 10
    risks = model.risk([[limit]])[0]
    sides = model.predict([[limit - 1e-6], [limit + 1e-6]]) == ["a", "b"]
    inspect = {("inspect", "a"): 0.3, ("inspect", "b"): 0.3}
    later = CostSensitiveGaussianBayes(inspect).fit(*_pairs(0, 1, 2, 1))
    inspected = np.ptp(axis[later.predict(axis) == "inspect"])
    difference = np.abs(later.set_params(cost=cost).risk(axis) - model.risk(axis)).max()
    mean = expected_cost(list("aabb"), list("abbb"), cost=cost, labels=["a", "b"])
    found = {"tie": risks[0] - risks[1], "sides": sides.sum(), "inspect": inspected}
    return found | {"refit": difference, "mean": mean}


def chapter_3() -> dict[str, float]:
    """Decide on three classes of 40 runs in bins of order 1, chapter 3 of the thesis."""
    recordings, y = chapter3_recordings(40)
    bins = BinTransformer(1, stop_bands=((5.6, 6.4),))
    spectra = make_pipeline(OrderResampler(), OrderPSD(16, max_order=51), bins)
    X = np.asarray(spectra.fit_transform(recordings))
    model = make_pipeline(PCA(2), CostSensitiveGaussianBayes(priors="uniform"))
    return {"bins": X.shape[1], "right": model.fit(X, y).score(X, y) * len(y)}


def _pairs(*moments: float) -> Table:
    """Return two recordings of each of two classes, with these means and standard deviations."""
    mean_a, spread_a, mean_b, spread_b = moments
    ends = np.array([[-1.0], [1.0]]) / np.sqrt(2)
    return np.vstack([mean_a + spread_a * ends, mean_b + spread_b * ends]), np.array(list("aabb"))
