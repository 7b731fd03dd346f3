"""Displays of fault lines and of the kurtogram: what is drawn is what was measured."""

import numpy as np
import pytest

from emacm import Bearing, Recording, find_faults, kurtogram
from emacm.displays import FaultLinesDisplay, KurtogramDisplay

FS = 9_000
BEARING = Bearing(8, 6.746, 28.499)
ORDERS = np.arange(0, 501) / 25


def struck(order=3.05, rate=31.0, seconds=4):
    rng = np.random.default_rng(0)
    n_times = seconds * FS
    instants = np.cumsum(1 + 0.005 * rng.standard_normal(1000)) / (order * rate)  # with slip
    hits = np.bincount((instants * FS).astype(int), minlength=n_times)[:n_times]
    ring = np.exp(-np.arange(90) / 12) * np.sin(2 * np.pi * 0.31 * np.arange(90))
    signal = np.convolve(hits, ring)[:n_times] + 0.3 * rng.standard_normal(n_times)
    return Recording({"foot": signal, "casing": signal[::-1]}, FS, velocity=2 * np.pi * rate)


@pytest.mark.slow
def test_the_frame_holds_the_lines_that_find_faults_tells():
    run = struck()
    display = FaultLinesDisplay.from_recording(run, BEARING)
    row = find_faults([run], BEARING, channels=["foot"]).iloc[0]
    assert row["named"] == "BPFO"
    heights = display.frame().loc["BPFO", "height"]
    listed = [f"{height:.0f}" for height in heights]
    assert f"{listed[0]}, {listed[1]} and {listed[2]} dB" in row["explanation"]
    assert display.frame().loc[("BPFO", 2), "found"] == pytest.approx(6.1, abs=0.05)


def test_symbols_stand_on_the_spectrum_and_ranges_at_the_predicted_orders():
    psd = np.ones(len(ORDERS))
    psd[[75, 150, 225]] = 100.0
    display = FaultLinesDisplay(ORDERS, psd, {"BPFO": 3.02}, faults=["BPFO"], channel="foot").plot()
    spectrum, background, symbols = display.ax_.lines[:3]
    assert symbols.get_xdata() == pytest.approx([3, 6, 9])
    assert symbols.get_ydata() == pytest.approx([20, 20, 20])
    assert background.get_ydata() == pytest.approx(np.zeros(len(spectrum.get_xdata())))
    assert {text.get_text() for text in display.ax_.texts} == {"BPFO", "2xBPFO", "3xBPFO"}
    assert "of foot" in display.ax_.get_ylabel()
    legend = [text.get_text() for text in display.ax_.get_legend().get_texts()]
    assert legend == ["order spectrum", "local background", "BPFO: 20 20 20 dB"]


def test_the_outline_is_the_band_of_the_largest_kurtosis():
    signal = struck().signals["foot"]
    found = kurtogram(signal, FS)
    display = KurtogramDisplay.from_signal(signal, FS, channel="foot")
    (outline,) = display.ax_.lines
    assert (min(outline.get_xdata()), max(outline.get_xdata())) == found.band
    best = display.frame().iloc[display.frame()["kurtosis"].argmax()]
    assert best["centre"] == pytest.approx(np.mean(found.band))
    assert display.ax_.get_xlim() == (0, FS / 2)
    assert "of foot" in display.colorbar_.ax.get_ylabel()
