"""Decisions and named rings on the pages of a simulated fleet of pumps."""

import numpy as np
import pytest

from emacm import Bearing, CostSensitiveGaussianBayes, Recording, bearing_recipe
from emacm.reports.maintenance import read_settings
from emacm.reports.pages import page_of

PARTS = Bearing(9, 7.94, 39.04)  # 6205
RINGS = {"outer": "outer ring", "inner": "inner ring"}


def pump(state, seed, fs=10_000, n=40_000):
    """Return a pump whose impulses excite a resonance at 2.9 kHz; the units differ in gain."""
    rng, time = np.random.default_rng(seed), np.arange(n) / fs
    ripple = np.sin(2 * np.pi * 0.4 * time + rng.uniform(0, 6))
    velocity = 2 * np.pi * (rng.uniform(16, 24) + ripple)
    angle = np.cumsum(velocity) / fs
    signal = rng.normal(size=n) + 1.5 * np.sin(angle) + 0.7 * np.sin(2 * angle + 1)
    order = {"outer": 3.5848, "inner": 5.4152}.get(state)
    if order is not None:
        passed = order * (1 - rng.uniform(0.003, 0.012)) * angle / (2 * np.pi)
        passed += 0.1 * np.cumsum(rng.normal(size=n)) / np.sqrt(fs)
        hits = np.diff(np.floor(passed), prepend=0) > 0
        loads = hits * (1 + 0.8 * np.cos(angle) * (state == "inner"))
        decay = np.exp(-np.arange(80) / 14) * np.sin(2 * np.pi * 2900 / fs * np.arange(80))
        signal += 6 * np.convolve(loads, decay)[:n]
    gain = 1 + 0.2 * (seed % 3)
    return Recording({"vibration": gain * signal}, fs, velocity=velocity, units={"vibration": "g"})


def against(page, truth):
    """Return wrong decisions, wrong rings that are named, and the own ring if called normal."""
    rows = [text for row in page.findings.rows for text in (row.component, row.orders)]
    named = " ".join([*page.sentences[1:], *rows])
    normal = " ".join(page.normal)
    names = {"outer": ("outer ring", "BPFO"), "inner": ("inner ring", "BPFI")}
    wrong = [n for state, both in names.items() if state != truth for n in both if n in named]
    if page.decision != truth:
        wrong.append(f"decided {page.decision}")
    if truth in RINGS:
        wrong += [f"{RINGS[truth]} is normal"] * (RINGS[truth] in normal)
        wrong += [f"{RINGS[truth]} is not named"] * (RINGS[truth] not in named)
    return wrong


@pytest.fixture(scope="module")
def pages():
    """Return eight pages with their truths; the model is of other pumps."""
    states = ["healthy", "outer", "inner"] * 8
    bayes = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto")
    X = [pump(state, seed) for seed, state in enumerate(states)]
    model = bearing_recipe(PARTS, classifier=bayes).fit(X, states)
    settings = read_settings(model, parts=PARTS)
    truths = ["healthy"] * 4 + ["outer", "inner"] * 2
    new = [(truth, pump(truth, 100 + k)) for k, truth in enumerate(truths)]
    return [(truth, page_of(settings, lambda run=run: run, "run")) for truth, run in new]


@pytest.mark.slow
def test_no_page_of_a_fleet_names_another_ring_or_calls_its_own_normal(pages):
    assert len(pages) == 8
    assert [(truth, against(page, truth)) for truth, page in pages if against(page, truth)] == []
