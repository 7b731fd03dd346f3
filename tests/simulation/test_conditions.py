"""Tables 4.2 and 4.3 of the thesis, and what follows from them."""

import numpy as np
import pytest

from emacm.simulation.conditions import (
    CONDITIONS,
    TRANSDUCERS,
    load_error,
    load_force,
    position_command,
)

TIMES = np.arange(480_000) / 48_000


def peak_speed(number):
    return np.abs(np.diff(position_command(CONDITIONS[number], TIMES))).max() * 48_000


def test_the_peak_speeds_asked_for_are_those_of_table_4_3():
    # Four amplitudes a period for a triangle, 2 pi for a sine.
    expected = {1: 0.44, 2: 3.6, 3: 17.5, 4: 9.7, 5: 2.5}
    assert {n: peak_speed(n) for n in CONDITIONS} == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("number", CONDITIONS)
def test_the_command_swings_around_its_bias_within_the_lvdt(number):
    row = CONDITIONS[number]
    command = position_command(row, TIMES)
    assert (command.max() + command.min()) / 2 == pytest.approx(row.bias, abs=1e-3)
    assert np.ptp(command) / 2 == pytest.approx(abs(row.amplitude), rel=1e-3)
    assert np.abs(command).max() < TRANSDUCERS["lvdt"].peak


@pytest.mark.parametrize("number", CONDITIONS)
def test_the_command_starts_at_its_bias_in_the_direction_of_its_amplitude(number):
    row = CONDITIONS[number]
    first, second = position_command(row, TIMES[:2])
    assert first == row.bias
    assert np.sign(second - first) == np.sign(row.amplitude)


def test_a_period_after_phase_2_pi_the_command_is_the_same():
    row = CONDITIONS[3]
    turned = position_command(row, TIMES, 2 * np.pi)
    assert np.abs(turned - position_command(row, TIMES)).max() < 1e-8


def test_a_triangle_has_one_speed():
    speed = np.abs(np.diff(position_command(CONDITIONS[5], TIMES)))
    assert np.median(speed) == pytest.approx(speed.max(), rel=1e-6)


def test_the_load_is_a_spring_and_a_bias():
    force = load_force(CONDITIONS[4], np.array([0.0, 1.0, 2.0]))
    assert force.tolist() == [-1867.0, -3077.0, -4287.0]


@pytest.mark.parametrize("number", CONDITIONS)
def test_no_load_passes_what_the_load_cell_may_measure(number):
    # Table 4.2: 5500 lbf.
    row = CONDITIONS[number]
    assert np.abs(load_force(row, position_command(row, TIMES))).max() < 5500


def test_a_share_of_the_load_scales_it():
    position = np.linspace(-2, 2, 5)
    whole, half = (load_force(CONDITIONS[5], position, share) for share in (1.0, 0.5))
    assert np.array_equal(half, whole / 2)


@pytest.mark.parametrize("name", TRANSDUCERS)
def test_full_scale_fits_a_converter_of_10_volts(name):
    assert TRANSDUCERS[name].peak / TRANSDUCERS[name].scale <= 10


def test_the_load_wanders_by_3_pounds_below_10_hertz():
    error = load_error(4_800_000, 48_000, np.random.default_rng(0))
    # 100 s of a process that forgets in 16 ms hold some 3000 independent values.
    assert error.std() == pytest.approx(3, rel=0.08)
    power = np.abs(np.fft.rfft(error)) ** 2
    hertz = np.fft.rfftfreq(len(error), 1 / 48_000)
    # First order: half of the power lies below the corner.
    assert power[hertz < 10].sum() / power[1:].sum() == pytest.approx(0.5, abs=0.08)
