"""Only lines that rose are raised, by their own rise, and belong to the part that has them."""

import numpy as np
import pandas as pd
import pytest

from emacm import Bearing, Gear, OrderPSD, OrderResampler, Recording
from emacm.machine.raised_lines import (
    LineSpectrum,
    PartLines,
    raised_lines,
    rise_above_bins,
    rise_above_spectra,
)

GEAR = Gear(18, 67)  # hunting tooth at order 0.0149, wheel at 0.2687
BEARING = Bearing(9, 7.94, 39.04)
RISES = {1: 4.5, 2: 20.8, 3: 0.0}  # dB


def turning(lines, seed, noise=0.02):
    """Return 200 revolutions with lines: a mapping of orders to amplitudes."""
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * 200 * np.arange(20_000) / 20_000
    wave = noise * rng.normal(size=len(angle))
    for order, amplitude in lines.items():
        wave += amplitude * np.sin(order * angle + rng.uniform(0, 6))
    return Recording({"vib": wave}, 1000, velocity=20 * np.pi)


def spectra(recordings):
    psd = OrderPSD(25, max_order=24)
    table = psd.fit_transform(OrderResampler(2 * np.pi / 64).fit_transform(recordings))
    orders = [float(name.partition("@")[2]) for name in psd.get_feature_names_out()]
    return np.array(orders), np.asarray(table)


def binned(orders, psd, healthy, width):
    """Return bins of adjacent edges, as a model knows them, of a recording and of its healthy."""
    low = np.arange(0, 23.5, width)
    inside = (low[:, np.newaxis] <= orders) & (orders < low[:, np.newaxis] + width)
    level = 10 * np.log10(inside @ psd)
    levels = 10 * np.log10(healthy @ inside.T)
    bins = {"low": low, "high": low + width, "level": level, "reference_level": levels.mean(axis=0)}
    return pd.DataFrame(bins).assign(limit=np.maximum(3.0, 4 * levels.std(axis=0)))


def raised(healthy_lines, lines, parts, width=None):
    """Return the raised lines, by fault and harmonic, above eight healthy recordings."""
    runs = [turning(healthy_lines, seed) for seed in range(8)]
    orders, psd = spectra([*runs, turning(lines, 99)])
    spectrum, healthy = LineSpectrum(orders, psd[-1]), psd[:-1]
    if width is None:
        rise, limit = rise_above_spectra(spectrum, healthy)
    else:
        rise, limit = rise_above_bins(spectrum, binned(orders, psd[-1], healthy, width))
    found = raised_lines(spectrum, rise, limit, PartLines(spectrum, parts))
    return {(line.fault, line.line): line for line in found}


PINION = {1.0: 0.1, 2.0: 0.1, 3.0: 0.1, 18.0: 0.3}
WORN = {order: size * 10 ** (RISES.get(order, 0.0) / 20) for order, size in PINION.items()}


def test_each_line_has_its_own_rise_above_healthy_spectra():
    found = raised(PINION, WORN, GEAR)
    assert list(found) == [("pinion", "1x"), ("pinion", "2x")]
    for number, line in enumerate(found.values(), 1):
        assert line.order == pytest.approx(number)
        assert line.rise == pytest.approx(RISES[number], abs=0.1)


@pytest.mark.parametrize("width", [0.5, 1.0, 2.0, 3.0])
def test_above_bins_no_line_is_raised_by_the_rise_of_another_one(width):
    found = raised(PINION, WORN, GEAR, width)
    assert ("pinion", "2x") in found
    assert ("pinion", "3x") not in found
    for (_, line), own in found.items():
        assert 3 <= own.rise <= RISES[int(line[0])] + 0.1  # that over a bin is the least one
    assert found["pinion", "2x"].rise > RISES[2] - 6  # up to four healthy lines in its bins


def test_noise_that_fills_a_bin_raises_no_line():
    runs = [turning(PINION, seed) for seed in range(8)]
    orders, psd = spectra([*runs, turning(PINION, 99, noise=0.4)])
    spectrum = LineSpectrum(orders, psd[-1])
    rise, limit = rise_above_bins(spectrum, binned(orders, psd[-1], psd[:-1], 1.0))
    assert raised_lines(spectrum, rise, limit, PartLines(spectrum, GEAR)) == []


def test_lines_that_the_spectrum_does_not_resolve_belong_to_no_part():
    orders, (psd,) = spectra([turning({0.0149 * k: 0.1 for k in range(1, 60)}, 0)])
    coarse = PartLines(LineSpectrum(orders, psd), GEAR)
    assert [fault.name for fault in coarse.resolved] == ["mesh", "pinion", "wheel"]
    every = coarse.owners(np.arange(0.02, 20, 0.01))
    assert {fault for fault, _ in every} <= {"mesh", "pinion", "wheel", ""}
    # From 10 revolutions, the sidebands of the wheel are 2.7 lines of the axis from the mesh.
    step = orders[1] * 25 / 10
    with_mesh = LineSpectrum(step * np.arange(300), np.where(np.arange(300) == 180, 1e3, 1.0))
    owners = PartLines(with_mesh, GEAR).owners(np.array([18.0, 18.2687, 19.0]))
    assert owners == [("mesh", "1x"), ("", ""), ("mesh", "1x+pinion")]


SHAFT = {1.0: 0.1}
RING = {k * 3.57: 0.1 for k in (1, 2, 3, 4)}  # slips by 0.4 %
INNER = {k * 5.43 + n: 0.1 for k in (1, 2, 3) for n in (-1, 0, 1)}


@pytest.mark.parametrize("width", [None, 0.5])
def test_harmonics_and_sidebands_belong_to_their_part(width):
    found = raised(SHAFT, SHAFT | RING, BEARING, width)
    assert [*found] == [("BPFO", f"{k}x") for k in (1, 2, 3, 4)]
    found = raised(SHAFT, SHAFT | INNER, BEARING, width)
    assert set(found) == {("BPFI", f"{k}x{s}") for k in (1, 2, 3) for s in ("-shaft", "", "+shaft")}
    mesh = {18.0: 0.3, 17.0: 0.002, 19.0: 0.002}
    found = raised(mesh, mesh | {17.0: 0.05, 19.0: 0.05}, GEAR, width)
    assert [*found] == [("mesh", "1x-pinion"), ("mesh", "1x+pinion")]


def test_a_line_of_no_part_has_no_owner():
    (line,) = raised(SHAFT, SHAFT | {4.2: 0.1}, [BEARING, GEAR]).values()
    assert line.order == pytest.approx(4.2, abs=0.04)
    assert line.fault == ""
    assert [*raised(SHAFT, SHAFT | {3.57: 0.1}, BEARING)] == [("BPFO", "1x")]
    assert [*raised(SHAFT, SHAFT | {4 * 3.57: 0.1}, BEARING)] == [("", "")]  # a coincidence


@pytest.mark.parametrize("order", [3.53, 3.555, 3.5848, 3.62, 3.64])
def test_high_harmonics_belong_to_their_part_at_any_slip(order):
    harmonics = order * np.arange(1, 6)
    axis, (psd,) = spectra([turning(dict.fromkeys(harmonics, 0.1), 1)])
    parts = PartLines(LineSpectrum(axis, psd), BEARING)
    places = np.rint(harmonics / axis[1]) * axis[1]
    assert parts.owners(places) == [("BPFO", f"{k}x") for k in range(1, 6)]


@pytest.mark.parametrize("order", [3.57, 5.40])
def test_lines_with_random_slip_belong_to_their_part(order):
    rng = np.random.default_rng(0)
    turns = 200 * np.arange(40_000) / 40_000
    phase = order * turns + 0.002 * np.cumsum(rng.normal(size=len(turns)))
    wave = sum(np.sin(2 * np.pi * k * phase) for k in range(1, 5)) + rng.normal(size=len(turns))
    axis, psd = spectra([Recording({"vib": wave}, 1000, velocity=10 * np.pi)])
    spectrum = LineSpectrum(axis, psd[0])
    rise = np.where(spectrum.heights > 12, 20.0, 0.0)  # dB
    found = raised_lines(spectrum, rise, np.full(len(axis), 3.0), PartLines(spectrum, BEARING))
    name = {3.57: "BPFO", 5.40: "BPFI"}[order]
    assert [(line.fault, line.line) for line in found] == [(name, f"{k}x") for k in (1, 2, 3, 4)]
