"""Fault orders, compared with published cases and with rolling solved numerically."""

from fractions import Fraction
from math import atan, cos, pi, sin

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure

from emacm import BallScrew, Bearing, BinTransformer, Gear, Motor, fault_orders, order_bands
from emacm.displays import OrderSpectrumDisplay
from emacm.orders.columns import OrderTable, order_columns

# Published orders of real bearings: balls, ball and pitch diameter; BPFO, BPFI, rolling element
# (twice the spin), cage. The first two: Case Western Reserve University's bearing data centre
# (SKF 6205 and 6203, inches); the third: MB ER-16K of the Curtin University data (mm), with the
# spin itself published.
PUBLISHED = {
    "6205": ((9, 0.3126, 1.537), (3.5848, 5.4152, 4.7135, 0.39828)),
    "6203": ((8, 0.2656, 1.122), (3.0530, 4.9469, 3.9874, 0.3817)),
    "ER-16K": ((9, 7.9375, 38.50), (3.572, 5.428, 2 * 2.32, 0.3969)),
}


def orders(*parts, **options):
    return fault_orders(*parts, **options)["order"].to_dict()


@pytest.mark.parametrize("name", PUBLISHED)
def test_bearing_orders_agree_with_published_values(name):
    geometry, published = PUBLISHED[name]
    found = orders(Bearing(*geometry))
    assert np.allclose([found[k] for k in ("BPFO", "BPFI", "2xBSF", "FTF")], published, rtol=1e-3)


def rolling(inner_radius, outer_radius, ball_radius, inner_speed, outer_speed):
    """Solve for cage and ball speed by equal velocities at both contacts of a planar bearing."""
    centre = (inner_radius + outer_radius) / 2
    equations = [[centre, -ball_radius], [centre, ball_radius]]
    return np.linalg.solve(equations, [inner_speed * inner_radius, outer_speed * outer_radius])


@given(
    ball=st.floats(0.05, 0.4),
    n_balls=st.integers(2, 7),
    ratio=st.floats(0.1, 5),
    rotating=st.sampled_from(["inner", "outer"]),
)
def test_a_bearing_rolls_without_slip_with_either_ring_rotating(ball, n_balls, ratio, rotating):
    speeds = np.array([ratio, 0.0] if rotating == "inner" else [0.0, ratio])
    radii = np.array([0.5 - ball / 2, 0.5 + ball / 2])
    cage, spin = rolling(*radii, ball / 2, *speeds)
    found = orders(Bearing(n_balls, ball, 1.0, ratio=ratio, rotating=rotating, few_balls=True))
    assert found["FTF"] == pytest.approx(cage)
    assert found["BSF"] == pytest.approx(abs(spin - cage))
    passes = n_balls * np.abs(speeds - cage)
    assert [found["BPFI"], found["BPFO"]] == pytest.approx(list(passes))


def test_a_rotating_ring_is_modulated_by_the_shaft_and_a_stationary_one_is_not():
    inner = orders(Bearing(9, 7.94, 39.04, ratio=0.5), sidebands=2)
    bpfi = inner["BPFI"]
    assert inner["BPFI-2xshaft"] == pytest.approx(bpfi - 1)
    assert inner["BPFI+shaft"] == pytest.approx(bpfi + 0.5)
    assert inner["BSF+FTF"] == pytest.approx(inner["BSF"] + inner["FTF"])
    assert not [name for name in inner if name.startswith("BPFO") and name != "BPFO"]
    outer = orders(Bearing(9, 7.94, 39.04, rotating="outer"), sidebands=1)
    assert "BPFO+shaft" in outer
    assert "BPFI+shaft" not in outer


@pytest.mark.parametrize(("poles", "slots", "periods"), [(8, 9, 72), (10, 12, 60), (12, 36, 36)])
def test_cogging_repeats_with_every_alignment_of_slots_and_poles(poles, slots, periods):
    assert orders(Motor(poles // 2, slots))["cogging"] == periods
    # Count the positions of the rotor in which some magnet faces some slot.
    magnets = [Fraction(i, poles) for i in range(poles)]
    facing = {(magnet - Fraction(j, slots)) % 1 for magnet in magnets for j in range(slots)}
    assert len(facing) == periods


@given(teeth=st.integers(2, 40), mating=st.integers(2, 40))
def test_the_same_two_teeth_meet_at_the_hunting_order(teeth, mating):
    meshes = np.arange(1, teeth * mating + 1)
    again = meshes[(meshes % teeth == 0) & (meshes % mating == 0)][0]
    assert orders(Gear(teeth, mating))["hunting"] == pytest.approx(teeth / again)


def test_parts_may_be_given_as_one_list():
    parts = [Gear(20, 80), {"imbalance": 1.0}]
    assert orders(parts) == orders(*parts)


def test_a_second_pair_of_gears_is_driven_by_the_first():
    first = Gear(20, 60)
    found = orders(first, Gear(15, 45, ratio=first.output_ratio, name="second"))
    assert found["second mesh"] == pytest.approx(15 / 3)
    assert found["second wheel"] == pytest.approx(1 / 9)


def test_gears_modulate_the_mesh_by_their_turns():
    found = orders(Gear(20, 50), sidebands=1)
    sides = [found[f"mesh{side}"] for side in ("-pinion", "+pinion", "-wheel", "+wheel")]
    assert sides == pytest.approx([19, 21, 19.6, 20.4])


def helical_rolling(ball, lead, contact_angle):
    """Roll a ball between a nut at rest and a screw, in three dimensions; ball circle diameter 1.

    Returns turns of the ball's centre, of the ball relative to its path, per turn of the screw.
    """
    radius, rise, slope = 0.5, lead / (2 * pi), atan(lead / pi)
    along = np.array([0, cos(slope), sin(slope)])  # radial, tangential, axial
    outward = np.array([cos(contact_angle), 0, 0])
    contact = ball / 2 * (outward + sin(contact_angle) * np.array([0, -sin(slope), cos(slope)]))
    at_screw = np.array([radius, 0, 0]) - contact
    screw = np.cross([0, 0, 2 * pi], at_screw) + [0, 0, 2 * pi * rise]
    # Ball: centre v along the path, turning w about the axis across path and contact.
    axis = np.cross(contact, along) / np.linalg.norm(contact)
    at_nut_turning, at_screw_turning = (np.cross(axis, c) @ along for c in (contact, -contact))
    v, _ = np.linalg.solve([[1, at_nut_turning], [1, at_screw_turning]], [0, screw @ along])
    orbit = v * along[1] / radius / (2 * pi)
    # Seen along with the ball, the nut runs back along its path, and that turns the ball.
    turn = 2 * pi * orbit
    nut = -(np.cross([0, 0, turn], [radius, 0, 0] + contact) + [0, 0, turn * rise])
    return orbit, abs(nut @ along / (ball / 2)) / (2 * pi)


@settings(max_examples=40)
@given(ball=st.floats(0.05, 0.3), lead=st.floats(0.02, 1.5), angle=st.floats(0, 1.2))
def test_the_balls_of_a_screw_roll_without_slip(ball, lead, angle):
    orbit, spin = helical_rolling(ball, lead, angle)
    found = orders(BallScrew(9, ball, 1.0, lead, angle, few_balls=True))
    assert found["orbit"] == pytest.approx(orbit)
    assert found["nut race"] == pytest.approx(9 * orbit)
    assert found["thread"] == pytest.approx(9 * (1 - orbit))
    assert found["spin"] == pytest.approx(spin)


def test_the_race_of_the_rotating_part_of_a_screw_is_modulated_and_the_other_is_not():
    geometry = (17, 3.175, 20, 5)
    screw = orders(BallScrew(*geometry, ratio=0.4), sidebands=1)
    assert screw["thread-screw"] == pytest.approx(screw["thread"] - 0.4)
    assert screw["thread+screw"] == pytest.approx(screw["thread"] + 0.4)
    assert not [name for name in screw if name.startswith(("nut race-", "nut race+"))]
    nut = orders(BallScrew(*geometry, ratio=0.4, rotating="nut"), sidebands=2)
    assert nut["nut race-2xnut"] == pytest.approx(nut["nut race"] - 0.8)
    assert nut["nut race+nut"] == pytest.approx(nut["nut race"] + 0.4)
    assert nut["spin+orbit"] == pytest.approx(nut["spin"] + nut["orbit"])
    assert not [name for name in nut if name.startswith(("thread-", "thread+"))]


def test_every_line_names_its_component_and_its_part():
    parts = (Bearing(9, 7.94, 39.04, name="rear"), Motor(4, 9), Gear(8, 42))
    parts += (BallScrew(17, 3.175, 20, 5), {"belt": 0.7})
    table = fault_orders(*parts)
    kinds = {"rear BPFO": "outer ring", "rear 2xBSF": "ball", "wheel": "wheel", "nut race": "nut"}
    assert table["kind"][list(kinds)].to_dict() == kinds
    owners = ["rear"] * 5 + ["Motor"] * 3 + ["Gear"] * 5 + ["BallScrew"] * 6 + ["given"]
    assert table["part"].tolist() == owners
    assert table.columns.tolist() == ["order", "part", "kind", "harmonic", "sideband", "slips"]


def test_lines_in_the_current_lie_beside_the_supply_and_the_supply_itself_is_kept():
    table = fault_orders(Motor(5), {"belt": 0.7}, harmonics=2, sidebands=1, signal="current")
    assert table["order"].round(9).to_dict() == {
        "supply+shaft": 6,
        "supply-shaft": 4,
        "supply+2xshaft": 7,
        "supply-2xshaft": 3,
        "supply": 5,
        "2xsupply": 10,
        "supply+belt": 5.7,
        "supply-belt": 4.3,
        "supply+2xbelt": 6.4,
        "supply-2xbelt": 3.6,
    }


def test_orders_above_the_highest_are_left_out_and_none_is_zero_or_less():
    table = fault_orders(Gear(5, 7), Motor(2), harmonics=3, sidebands=8, max_order=9.5)
    assert table["order"].between(0, 9.5, inclusive="neither").all()
    assert table["order"].max() > 9


def test_bands_define_bins_and_orders_are_marked_in_the_figure():
    table = fault_orders(Bearing(9, 7.94, 39.04), max_order=6)
    bands = order_bands(table, slip=0.01)
    psd = OrderTable(np.ones((2, 65)), order_columns(["vibration"], np.arange(65) / 8))
    bins = BinTransformer(edges=bands).set_output(transform="pandas").fit_transform(psd)
    assert list(bins.columns) == [
        f"vibration@{name}" for name in ["FTF", "BSF", "BPFO", "2xBSF", "BPFI"]
    ]
    assert np.allclose(bins["vibration@BPFI"], 0.02 * table["order"]["BPFI"])
    ax = Figure().subplots()
    marks = table["order"].to_dict()
    OrderSpectrumDisplay.from_table(psd, "vibration", fault_orders=marks, ax=ax)
    assert sorted(text.get_text() for text in ax.texts) == sorted(table.index)


def test_a_band_is_as_wide_as_the_slip_and_not_narrower_than_the_minimum():
    bands = order_bands({"low": 0.1, "high": 20.0}, slip=0.02, min_width=0.25)
    assert bands["high"] == (19.6, 20.4)
    assert bands["low"] == (0.0, 0.225)


def test_only_rolling_elements_slip():
    table = fault_orders(Bearing(9, 7.94, 39.04), Gear(20, 50))
    bands = order_bands(table, slip=0.02, min_width=0.02, on_overlap="keep")
    assert bands["mesh"] == (19.99, 20.01)
    low, high = bands["BPFO"]
    assert (high - low) / table["order"]["BPFO"] == pytest.approx(0.04)


def test_bands_that_overlap_are_refused_or_kept():
    near = {"supply": 6.0, "BPFI": 6.123, "2xBPFI": 12.246}
    with pytest.raises(ValueError, match=r"'supply' \(5.88, 6.12\) and 'BPFI' .* overlap"):
        order_bands(near)
    assert list(order_bands(near, on_overlap="keep")) == list(near)
    touching = order_bands({"high": 3.0, "low": 2.0}, slip=0, min_width=1.0)
    assert touching == {"low": (1.5, 2.5), "high": (2.5, 3.5)}


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda: Bearing(9, 40.0, 8.0), ValueError, "pitch_diameter must be a number above 40"),
        (lambda: Bearing(20, 8.0, 39.0), ValueError, "20 balls of diameter 8 do not fit"),
        (lambda: Bearing(9, 8.0, 39.0, 15), ValueError, "in degrees, write 0.261799"),
        (lambda: Bearing(9, 8.0, 39.0, name="a@b"), TypeError, "a string without '@'"),
        (lambda: BallScrew(30, 3.0, 20.0, 5.0), ValueError, "30 balls of diameter 3 do not fit"),
        (lambda: fault_orders(harmonics=3), TypeError, "a list of at least one part; got"),
        (lambda: fault_orders(Motor(3), {}), TypeError, "part 1: orders must .* least one order"),
        (lambda: fault_orders(6.1, Motor(3)), TypeError, "part 0 must be a Bearing, BallScrew"),
        (lambda: fault_orders({"BPFI": -1.0}), ValueError, "the order of 'BPFI' must be a number"),
        (lambda: fault_orders({"BPFI": 6.1}, signal="current"), ValueError, "exactly one Motor"),
        (lambda: fault_orders(Gear(9, 20), Gear(9, 30)), ValueError, "two lines .* 'mesh'"),
        (lambda: order_bands(fault_orders(Motor(6))), ValueError, "no width, .* min_width"),
        (lambda: order_bands([6.1]), TypeError, "a table from fault_orders or a mapping"),
        (lambda: order_bands(pd.DataFrame({"order": [1]})), ValueError, "it has no 'slips'"),
        (lambda: order_bands({1: 2.0, "1": 3.0}), ValueError, "two lines have the name '1'"),
    ],
)
def test_an_invalid_part_or_order_is_refused(make, error, words):
    with pytest.raises(error, match=words):
        make()
