"""Channels that are constant, clipped or interrupted are recognised, and others are not."""

import numpy as np
import pytest

from emacm.findings.quality import check_channel

TIMES = np.arange(50_000) / 10_000
RNG = np.random.default_rng(3)
NOISE = RNG.standard_normal(len(TIMES))
TONE = 3.0 * np.sin(2 * np.pi * 33.3 * TIMES) + 0.4


def defect(values, turning=((0.0, 1.0),)):
    found = check_channel(np.asarray(values, float), "current", turning).defect
    return "" if found is None else found.kind


def test_the_level_is_the_root_mean_square_about_the_mean():
    assert check_channel(TONE, "current").level == pytest.approx(3 / np.sqrt(2), rel=1e-3)
    long = np.tile(TONE, 40)  # of which blocks are read
    assert check_channel(long, "current").level == pytest.approx(3 / np.sqrt(2), rel=0.02)


GOOD = {
    "a tone": TONE,
    "noise": NOISE,
    "a tone of 12 bits": np.round(TONE * 500) / 500,
    "a slow tone of 12 bits": np.round(500 * np.sin(2 * np.pi * 0.5 * TIMES)) / 500,
    "a slow tone of 4 bits": np.round(8 * np.sin(2 * np.pi * 3 * TIMES)),
    "noise of 3 bits": np.round(NOISE),
    "a position that rests at both ends": np.round(
        500 * np.tanh(3 * np.sin(2 * np.pi * 0.7 * TIMES))
    ),
    "a switch": (np.sin(2 * np.pi * 3 * TIMES) > 0.3).astype(float),
    "three voltages": np.round(1.4 * np.sin(2 * np.pi * 30 * TIMES)),
    "a staircase": np.repeat(NOISE[::50], 50),
    "a ramp": TIMES,
    "a ramp with a plateau": np.clip(TIMES, 1.0, 3.0) + 0.1 * np.minimum(TIMES, 1.0),
    "a switch that is closed once": np.where((TIMES > 2) & (TIMES < 3), 0.0, TIMES * 1000 // 7 % 2),
    "noise of 3 bits that comes to rest": np.round(2 * NOISE * np.abs(TIMES - 2.5).clip(0, 1)),
    "rectified noise": np.abs(np.round(100 * NOISE)),
    "pulses of one sample": np.where(np.arange(len(TIMES)) % 7, 5.0, 0.0),
}


@pytest.mark.parametrize("values", GOOD.values(), ids=GOOD)
def test_a_good_channel_has_no_defect(values):
    assert defect(values) == ""


BAD = {
    "a constant": (np.full(700, 2.5), "constant"),
    "a constant, long": (np.full(200_000, 2.5), "constant"),
    "a tone, clipped below": (np.maximum(TONE, -1.0), "clipped"),
    "noise, clipped": (np.clip(NOISE, -0.8, 0.8), "clipped"),
    "a tone of 12 bits, clipped": (np.clip(np.round(TONE * 500) / 500, -2, 2), "clipped"),
    "noise with drop-outs": (np.where((2 * TIMES) % 1 < 0.2, 0.0, NOISE), "drop-outs"),
    "a tone with drop-outs": (np.where((2.3 * TIMES) % 1 < 0.1, 0.0, TONE), "drop-outs"),
    "noise with one gap": (np.where(abs(TIMES - 2) < 0.1, 0.0, NOISE), "drop-outs"),
    "noise that ends": (np.where(TIMES > 4.9, 0.3, NOISE), "drop-outs"),
    "noise of 6 bits with one gap": (
        np.where(abs(TIMES - 2) < 0.1, 0.0, np.round(8 * NOISE)),
        "drop-outs",
    ),
    "a fast tone with one gap": (
        np.where(abs(TIMES - 2) < 0.1, 0.0, np.sin(2 * np.pi * 333.3 * TIMES)),
        "drop-outs",
    ),
    "a tone that sticks": (np.where((2.3 * TIMES) % 1 < 0.1, 1.7, TONE), "drop-outs"),
}


@pytest.mark.parametrize(("values", "expected"), BAD.values(), ids=BAD)
def test_a_defect_is_recognised(values, expected):
    assert defect(values) == expected


def test_a_single_gap_is_a_defect_only_while_the_shaft_turns():
    gap = np.where(abs(TIMES - 2) < 0.1, 0.0, NOISE)
    assert defect(gap, turning=()) == ""
    assert defect(gap, turning=[(0.0, 0.37), (0.43, 1.0)]) == ""  # from 1.9 to 2.1 s of 5 s
    assert defect(gap, turning=[(0.0, 0.3), (0.35, 1.0)]) == "drop-outs"
    strokes = [(0.0, 0.39), (0.39, 0.41), (0.41, 1.0)]  # it lasts over several of them
    assert defect(gap, turning=strokes) == "drop-outs"


@pytest.mark.parametrize("start", range(1000, 1020))
def test_a_gap_may_begin_and_end_near_zero(start):
    values = np.round(15 * NOISE[:20_000])  # of steps that are coarse enough to come to rest
    values[start : start + 900] = 0.0
    assert defect(values) == "drop-outs"


def test_a_gap_may_end_while_the_shaft_is_at_rest():
    strokes = [(0.0, 0.3), (0.5, 1.0)]
    is_turning = (TIMES < 1.5) | (TIMES > 2.5)
    coarse = np.round(15 * NOISE * is_turning) + np.round(NOISE)
    for gap in ((TIMES > 1.0) & (TIMES < 2.0), (TIMES > 2.0) & (TIMES < 3.0)):
        assert defect(np.where(gap, 0.0, coarse), strokes) == "drop-outs"
    swelling = np.round(15 * NOISE * np.clip(np.abs(TIMES - 2.0) - 0.5, 0, None))
    assert defect(swelling, strokes) == ""  # it is 0 at rest, and when the shaft turns slowly


def test_a_gap_longer_than_the_blocks_of_a_long_channel_is_recognised():
    long = np.tile(NOISE, 20)
    long[400_000:500_000] = 0.0
    assert defect(long) == "drop-outs"
    assert "in 9.4 % of the time it is constant" in check_channel(long, "x", [(0, 1)]).defect.text
    assert defect(long, turning=[(0.0, 0.45), (0.45, 1.0)]) == "drop-outs"


def test_a_channel_that_wakes_between_the_sampled_blocks_is_not_constant():
    values = np.zeros(1_000_000)
    values[5_000] = 1.0  # blocks are 31,000 samples apart
    assert defect(values) == ""
