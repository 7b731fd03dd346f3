"""The dependence of features on columns is determined by experiment."""

import numpy as np
from sklearn.decomposition import PCA
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.feature_selection import SelectKBest
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from emacm.explanations.feature_traces import trace_features


def test_a_trace_multiplies_out_all_linear_steps():
    rng = np.random.default_rng(5)
    X, y = rng.lognormal(size=(45, 8)), np.repeat(["worn", "new", "dry"], 15)
    scaler = StandardScaler().fit(X)
    pca = PCA(3).fit(scaler.transform(X))
    lda = LinearDiscriminantAnalysis().fit(pca.transform(scaler.transform(X)), y)
    trace = trace_features([("s", scaler), ("p", pca), ("l", lda)], X)
    assert [name for name, _ in trace.linear] == ["p", "l"]
    assert np.allclose(trace.matrix, (lda.scalings_.T @ pca.components_)[:2])


def test_a_step_that_mixes_columns_slightly_is_not_element_wise():
    mixing = np.eye(3)
    mixing[0, 2] = 1e-5
    step = FunctionTransformer(lambda values: values @ mixing)
    trace = trace_features([("mix", step)], np.array([[1.0, 2.0, 3.0]]))
    assert [name for name, _ in trace.linear] == ["mix"]
    assert np.allclose(trace.matrix, mixing.T, rtol=1e-6, atol=1e-12)


def test_hundreds_of_columns_are_traced():
    X = np.random.default_rng(0).uniform(1, 2, size=(700, 600))
    selector = SelectKBest(k=500).fit(X, np.arange(700) % 2)
    chosen = np.flatnonzero(selector.get_support())
    reversal = FunctionTransformer(lambda values: np.log(values)[:, ::-1])
    pca = PCA(2).fit(np.log(X[:, chosen])[:, ::-1])
    trace = trace_features([("k", selector), ("r", reversal), ("p", pca)], X)
    assert np.array_equal(trace.sources, chosen[::-1])
    assert np.allclose(trace.matrix, pca.components_)
