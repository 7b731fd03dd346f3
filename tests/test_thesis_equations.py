"""Published figures of the thesis: Fig. 2.7 and chapter 3; all others are in `tests/thesis`."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.decomposition import PCA
from sklearn.pipeline import make_pipeline

from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    OrderPSD,
    OrderResampler,
    Recording,
)
from emacm.simulation import chapter3_recordings

TURN = 2 * np.pi

# Fig. 2.7: sin(6 theta) on a ramp of 100t rad/s, 0.5 s


@pytest.fixture(scope="module")
def ramp():
    fs = 1000
    time = np.arange(fs // 2 + 1) / fs
    # Eqs. (2.5), (2.11).
    return Recording({"x1": np.sin(300 * time**2)}, fs, velocity=100 * time)


@pytest.fixture(scope="module")
def resampled_ramp(ramp):
    thesis = OrderResampler(TURN / 60, interpolation="linear", antialias=False)
    return thesis.fit_transform([ramp])


def width_of_half_the_power(axis, psd):
    """Width of the narrowest band around the highest line that holds half the power."""
    share = np.sort(psd)[::-1].cumsum() / psd.sum()
    return (np.searchsorted(share, 0.5) + 1) * axis[1]


def test_the_ramp_of_figure_2_7_holds_two_revolutions(resampled_ramp):
    (stroke,) = resampled_ramp[0].strokes
    assert stroke.revolutions == pytest.approx(1.99, abs=0.005)
    assert stroke.n_angles == 120  # 119.4 intervals of 1/60 revolution


def test_figure_2_7_the_ramp_is_one_narrow_peak_at_order_6(resampled_ramp):
    psd = OrderPSD(n_per_segment=256, window="boxcar", short="pad")
    (spectrum,) = psd.fit_transform(resampled_ramp)
    assert psd.orders_[-1] == pytest.approx(30)
    assert psd.order_step_ == pytest.approx(60 / 256)
    assert psd.orders_[spectrum.argmax()] == pytest.approx(6, abs=psd.order_step_ / 2)
    assert width_of_half_the_power(psd.orders_, spectrum) < 0.5
    # Two revolutions resolve half an order.
    assert spectrum[np.abs(psd.orders_ - 6) < 0.5].sum() > 0.85 * spectrum.sum()
    assert spectrum.sum() * psd.order_step_ == pytest.approx(0.5, rel=0.02)


# Chapter 3: three classes of 40 runs at 2 kHz


@pytest.fixture(scope="module")
def chapter_3():
    """Two sets of 120 runs with noise of standard deviation 0.25: one to learn, one to judge."""
    (known, y), (unknown, _) = (chapter3_recordings(seed=seed) for seed in (3, 4))
    return known, unknown, y


CHAINS = {
    "as published": (
        OrderResampler(TURN / 1000, interpolation="linear", antialias=False),
        OrderPSD(n_per_segment=2**14, max_order=51),
    ),
    "band-limited, coarse": (OrderResampler(), OrderPSD(16, max_order=51)),
}


@pytest.fixture(scope="module", params=CHAINS)
def bins_of_chapter_3(request, chapter_3):
    """Bins of the runs to learn from and of those to judge, as DataFrames."""
    resampler, psd = CHAINS[request.param]
    chain = make_pipeline(resampler, psd, BinTransformer(1, stop_bands=((5.6, 6.4),)))
    chain.set_output(transform="pandas")
    known, unknown, y = chapter_3
    trained = chain.fit_transform(known)
    return trained, chain.transform(unknown), y


def test_chapter_3_has_50_bins(bins_of_chapter_3):
    known, _, _ = bins_of_chapter_3
    assert known.columns.tolist() == [f"current@{k}-{k + 1}" for k in range(50)]


def test_chapter_3_the_two_defects_lead_the_first_two_components(bins_of_chapter_3):
    # The class means lie at (0, 0), (p, 0) and (0, p) of bins 4 and 11, so the components are
    # their difference and their sum, each with loadings near 0.71. Published: bin 11 leads the
    # first by 0.72 and bin 4 the second by 0.77. Which leads which is left to the noise.
    known, _, _ = bins_of_chapter_3
    pca = PCA(2).fit(known)
    loadings = np.abs(pca.components_)
    for loading in loadings:
        largest = known.columns[np.argsort(loading)[-2:]]
        assert set(largest) == {"current@3-4", "current@10-11"}
        assert np.sort(loading)[-2] > 0.5
        assert np.sort(loading)[-3] < 0.3
    # Published: 72 %.
    assert 0.6 < pca.explained_variance_ratio_.sum() < 0.85


def test_chapter_3_the_classes_are_told_apart(bins_of_chapter_3):
    known, unknown, y = bins_of_chapter_3
    model = make_pipeline(PCA(2), CostSensitiveGaussianBayes(priors="uniform")).fit(known, y)
    # Published: 119 of 120, on the runs it was trained on.
    assert model.score(known, y) >= 0.98
    assert model.score(unknown, y) >= 0.98
