"""Explained variance and loadings are those of the principal component analysis."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from sklearn.decomposition import PCA
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from emacm import BinTransformer
from emacm.displays import ExplainedVarianceDisplay, LoadingsDisplay


def axes(n_panels=1):
    return Figure(figsize=(7, 6)).subplots(n_panels, squeeze=False)[:, 0]


def spectra():
    rng = np.random.default_rng(0)
    names = [f"{channel}@{k}" for channel in ("a", "b") for k in range(5)]
    return pd.DataFrame(rng.uniform(1, 2, (30, 10)), columns=names)


def fitted(logarithm):
    return make_pipeline(BinTransformer(max_order=4), logarithm, StandardScaler(), PCA(3)).fit(
        spectra()
    )


@pytest.fixture
def pipeline():
    return fitted(FunctionTransformer(np.log10, feature_names_out="one-to-one"))


def test_the_shares_are_those_of_the_analysis_in_per_cent(pipeline):
    (ax,) = axes()
    display = ExplainedVarianceDisplay.from_estimator(pipeline, ax=ax)
    shares = pipeline[-1].explained_variance_ratio_
    assert np.allclose([bar.get_height() for bar in ax.patches], 100 * shares)
    assert np.allclose(ax.lines[0].get_ydata(), 100 * np.cumsum(shares))
    assert np.allclose(display.frame()["share"], shares)
    assert ax.get_ylabel() == "share of the variance [%]"


def test_the_loadings_are_steps_by_channel_with_the_names_of_the_bins(pipeline):
    panels = axes(2)
    display = LoadingsDisplay.from_estimator(pipeline, ax=panels)
    weights = pipeline[-1].components_
    frame = display.frame()
    assert frame.index.tolist()[:2] == [("a", "0-1"), ("a", "1-2")]
    assert np.allclose(frame.to_numpy().T, weights[:2])
    of_b = panels[1].lines[-1]
    assert of_b.get_label() == "b"
    assert np.allclose(of_b.get_ydata()[::2], weights[1, 4:])
    assert "component 2 (" in panels[1].get_ylabel().replace("\u00a0", " ")
    assert panels[1].get_xlabel() == "order [cycles per revolution]"


def test_missing_column_names_are_an_error_with_a_remedy():
    with pytest.raises(AttributeError, match="get_feature_names_out"):
        LoadingsDisplay.from_estimator(fitted(FunctionTransformer(np.log10)))
    with pytest.raises(ValueError, match="DataFrame"):
        LoadingsDisplay.from_estimator(PCA(1).fit(np.eye(3)), n_components=1)
