"""Facts about isolated jumps of a shaft: what is one, and what is a motion a shaft can make."""

import numpy as np
import pytest

from emacm.shaft.motion import BLOCK, DifferentiatedVelocity, largest_jump

FS = 1000.0


def steady(n_times=5000, speed=31.0, seed=2):
    rng = np.random.default_rng(seed)
    return speed * (1 + 0.1 * rng.normal(size=n_times))


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("place", [1, 37, 4998])
def test_a_spike_is_found_where_it_is(place, sign):
    speed = steady()
    speed[place] = sign * 9000.0
    jump = largest_jump(speed, FS)
    assert jump.sample == place
    assert jump.angle == pytest.approx(9.0, abs=0.08)


def test_the_slip_of_an_angle_is_found_with_its_size():
    angle = np.cumsum(steady()) / FS
    angle[3210:] -= 7.5
    jump = largest_jump(DifferentiatedVelocity(angle, FS), FS)
    assert jump.sample in (3209, 3210)
    assert jump.angle == pytest.approx(7.5, rel=0.02)


def test_of_several_jumps_the_largest_is_returned():
    speed = steady()
    speed[[400, 900, 1300]] = 3000.0, -8000.0, 5000.0
    assert largest_jump(speed, FS).sample == 900


@pytest.mark.parametrize("place", [BLOCK - 1, BLOCK, BLOCK + 5, 2 * BLOCK + 11])
def test_a_jump_in_a_long_recording_is_found_at_the_seams_of_blocks(place):
    speed = steady(2 * BLOCK + 40)
    speed[place] = 2e4
    assert largest_jump(speed, FS).sample == place


MOTIONS = {
    "steady": steady(),
    "standstill": np.zeros(400),
    "a start within one sample": np.repeat([0.0, 50.0], 300),
    "a stop within one sample": np.repeat([50.0, 0.0], 300),
    "to and fro": 40 * np.sin(np.arange(5000) / 90),
    "to and fro without ramps": 40 * np.sign(np.sin(np.arange(5000) / 90)),
    "steps of a stepping motor": np.where(np.arange(5000) % 25 == 7, 31.4, 0.0),
    "counts of a coarse encoder at low speed": np.where(np.arange(5000) % 61 == 7, 105.0, 0.0),
    "a start in the last samples": np.repeat([0.0, 50.0], [500, 2]),
    "a stop in the first sample": np.repeat([50.0, 0.0], [1, 500]),
    "a short stroke after a long rest": np.r_[np.zeros(900), 60 * np.hanning(60), np.zeros(900)],
    "noise at rest and a slow motion": np.r_[1e-9 * steady(800), 0.2 * np.hanning(400)],
}


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("sign", [1, -1])
def test_motions_that_shafts_make_have_no_jump(motion, sign):
    assert largest_jump(sign * MOTIONS[motion], FS) is None


@pytest.mark.parametrize(("distance", "found"), [(1, True), (2, False), (12, False), (13, True)])
def test_speed_near_by_makes_a_high_speed_plausible(distance, found):
    speed = np.full(1000, 1.0)
    speed[500] = 300.0
    speed[500 + distance] = 60.0
    assert (largest_jump(speed, FS) is not None) == found
