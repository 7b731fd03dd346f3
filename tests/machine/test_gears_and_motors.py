"""Planetary stages and induction motors, compared with kinematics solved as equations."""

from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emacm import InductionMotor, Motor, PlanetaryGear, fault_orders

MEMBERS = ("sun", "planet", "ring", "carrier")


def orders(*parts, **options):
    return fault_orders(*parts, **options)["order"].to_dict()


def solved_speeds(sun, planet, ring, fixed, driven_by, ratio):
    """Equal velocities where sun and planet, and planet and ring, touch; radii as the teeth."""
    arm = sun + planet
    equations = np.array(
        [
            [sun, planet, 0, -arm],  # sun's rim = planet's inner point
            [0, planet, -ring, arm],  # planet's outer point = ring's rim
            np.eye(4)[MEMBERS.index(fixed)],
            np.eye(4)[MEMBERS.index(driven_by)],
        ]
    )
    return np.linalg.solve(equations, [0, 0, 0, ratio])


@given(
    sun=st.integers(11, 60),
    planet=st.integers(9, 60),
    members=st.permutations(["sun", "ring", "carrier"]),
    ratio=st.floats(0.05, 20),
)
def test_a_planetary_stage_rolls_without_slip_whichever_member_is_fixed(
    sun, planet, members, ratio
):
    fixed, driven_by, output = members
    ring = sun + 2 * planet
    stage = PlanetaryGear(sun, ring, 3, fixed=fixed, driven_by=driven_by, ratio=ratio)
    expected = solved_speeds(sun, planet, ring, fixed, driven_by, ratio)
    assert list(stage.speeds) == list(MEMBERS)
    np.testing.assert_allclose(list(stage.speeds.values()), expected, atol=1e-9 * ratio)
    assert stage.output_ratio == pytest.approx(abs(expected[MEMBERS.index(output)]))
    by_sun = sun * abs(expected[0] - expected[3])
    by_ring = ring * abs(expected[2] - expected[3])
    found = orders(stage)
    assert [found["mesh"]] * 2 == pytest.approx([by_sun, by_ring])
    assert fixed not in found  # a member at rest has no order


def test_local_faults_of_a_planetary_stage_strike_as_often_as_marked_teeth_meet():
    # Turn the carrier of a stage with a fixed ring for one revolution, in small steps, and count.
    sun, planet, ring, n_planets = 20, 16, 52, 4
    carrier = np.linspace(0, 2 * pi, 200_001)
    places = carrier[:, np.newaxis] + 2 * pi * np.arange(n_planets) / n_planets
    sun_angle = carrier * (1 + ring / sun)

    def meetings(marked):
        """Count how often planets pass a marked tooth at this angle."""
        turns = (places - marked[:, np.newaxis]) / (2 * pi) + 1e-6
        return np.abs(np.diff(np.floor(turns), axis=0)).sum()

    found = orders(PlanetaryGear(sun, ring, n_planets, driven_by="carrier"))
    assert meetings(sun_angle) == pytest.approx(found["sun fault"], abs=1)
    assert meetings(np.zeros_like(carrier)) == pytest.approx(found["ring fault"], abs=1)
    assert found["planet fault"] == pytest.approx(ring / planet)


def test_the_mesh_of_a_planetary_stage_is_modulated_by_the_passing_planets():
    found = orders(PlanetaryGear(28, 100, 4), sidebands=1)
    carrier = 28 / 128
    assert found["mesh"] == pytest.approx(100 * carrier)
    assert found["mesh-planet pass"] == pytest.approx(96 * carrier)
    assert found["mesh+carrier"] == pytest.approx(101 * carrier)
    assert found["mesh-sun"] == pytest.approx(100 * carrier - 1)
    star = orders(PlanetaryGear(28, 100, 4, fixed="carrier"), sidebands=1)  # no planet passes
    assert not [name for name in star if "planet pass" in name or "carrier" in name]


def test_an_odd_difference_of_teeth_needs_the_teeth_of_the_planets():
    with pytest.raises(ValueError, match=r"leave 10.5 for a planet.* Give planet_teeth"):
        PlanetaryGear(30, 51, 3)
    assert orders(PlanetaryGear(30, 51, 3, 10))["mesh"] == pytest.approx(30 * 51 / 81)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: PlanetaryGear(30, 30, 3), "ring_teeth must be a whole number of at least 34"),
        (lambda: PlanetaryGear(30, 90, 3, 60), "planet_teeth .* at most 31, got 60"),
        (lambda: PlanetaryGear(30, 90, 3, driven_by="ring"), "must differ, got 'ring' for both"),
        (lambda: InductionMotor(2, 4.0), "slip must be a number above 0 and at most 0.5"),
    ],
)
def test_an_invalid_stage_or_motor_is_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_broken_bars_stand_at_multiples_of_twice_the_slip_beside_the_supply():
    turns, mains = 1470 / 60, 50.0  # per s
    found = orders(InductionMotor(2, 0.02), harmonics=3, signal="current")
    for k in (1, 2, 3):
        name = "pole pass" if k == 1 else f"{k}xpole pass"
        for sign, factor in (("+", 1 + 2 * k * 0.02), ("-", 1 - 2 * k * 0.02)):
            hertz = found[f"supply{sign}{name}"] * turns
            assert hertz == pytest.approx(factor * mains)


def test_rotor_slot_harmonics_agree_with_the_published_formula():
    # Nandi, Toliyat and Li: f_supply ((R ± n_d) (1 - s) / p ± 1), n_d = 1 if dynamic.
    pole_pairs, slip, bars, mains = 3, 0.035, 44, 50.0
    motor = InductionMotor(pole_pairs, slip, bars)
    shaft = mains * (1 - slip) / pole_pairs
    found = orders(motor, sidebands=1, signal="current")
    assert shaft * found["supply"] == pytest.approx(mains)
    for name, n_d in (("bar pass", 0), ("(bar pass+shaft)", 1), ("(bar pass-shaft)", -1)):
        for sign in (1, -1):
            published = mains * ((bars + n_d) * (1 - slip) / pole_pairs + sign)
            line = f"supply{'+' if sign > 0 else '-'}{name}"
            assert shaft * found[line] == pytest.approx(published)


def test_a_line_at_the_supply_has_no_difference_of_order_0():
    found = orders({"belt": 6.0, "fan": 2.0}, Motor(6), signal="current")
    assert found["supply+belt"] == 12
    assert "supply-belt" not in found
    assert found["supply-fan"] == 4


def test_a_stage_whose_sun_is_fixed_is_driven_by_the_carrier():
    stage = PlanetaryGear(30, 90, 2, fixed="sun", ratio=0.25)
    assert stage.speeds["carrier"] == 0.25
    assert stage.output_ratio == pytest.approx(0.25 * (1 + 30 / 90))
    (mesh, *_) = stage.lines()
    assert mesh.sidebands == (
        ("ring", pytest.approx(1 / 3)),
        ("carrier", 0.25),
        ("planet pass", 0.5),  # of two planets
    )
