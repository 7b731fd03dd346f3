"""Bearings by their designation, and angles in degrees in files."""

from math import radians

import pytest

from emacm import Bearing
from emacm.machine.rolling import bearing_of, designation_in, published_bearings
from emacm.reports.inputs import read_parts


@pytest.mark.parametrize(
    ("text", "designation"),
    [
        ("6205", "6205"),
        ("SKF 6205-2RS C3", "6205"),
        ("FAG 6308-C-2Z/C3", "6308"),
        ("62052RS1", "6205"),
        ("nsk 6208ddu", "6208"),
        ("uc 204", "UC204"),
        ("ZA2115", "ZA-2115"),
        ("6082RS", "608"),
        ("16004", None),  # thin section
        ("63004", None),  # wide
        ("7205 B", None),  # a contact angle that no source here states
        ("7314 BEP", "7314B"),
        ("7314 C", None),
        ("SKF NU205 ECP", "NU205"),
        ("nu 206-e-xl-tvp2", "NU206"),
        ("FAG NU2205-E", "NU2205"),
        ("NU 207", None),
        ("FAG 22205-E1-K-C3", "22205"),
        ("SKF 2303 E-2RS1TN9", "2303"),
        ("SKF 23032 CC/W33", None),  # a spherical roller bearing of series 230
        ("NTN 204", None),  # not N204 with a maker NT
        ("62O5", None),
    ],
)
def test_maker_suffix_and_blanks_are_no_part_of_a_designation(text, designation):
    assert designation_in(text) == designation


def test_each_published_bearing_has_a_source_and_a_geometry_that_fits():
    table = published_bearings()
    assert table.index.is_unique
    assert table["source"].str.len().min() > 8
    for name in table.index:
        assert 0.38 > bearing_of(name).ball_diameter / bearing_of(name).pitch_diameter > 0.1


def test_makers_differ_by_less_than_the_slip_where_the_number_of_balls_is_the_same():
    orders = {name: bearing_of(name).lines()[0].order for name in ("6203", "6204", "UC204")}
    assert orders["6203"] == pytest.approx(3.053, abs=0.001)  # Timken, size 203K
    assert orders["UC204"] == pytest.approx(orders["6204"], rel=0.001)
    assert bearing_of("6205").lines()[0].order == pytest.approx(3.574, rel=0.004)  # Timken, 205K


def test_an_unknown_designation_lists_the_known_ones_and_the_unit_of_the_angle():
    with pytest.raises(ValueError, match=r"one of 1205, 22205, .*contact angle in degrees.*'7205'"):
        bearing_of("7205")


def test_parts_in_files_have_designations_and_angles_in_degrees(tmp_path):
    path = tmp_path / "parts.toml"
    path.write_text(
        '[[Bearing]]\ndesignation = "SKF 6205-2RS"\nratio = 0.5\nname = "rear"\n'
        "[[Bearing]]\nn_balls = 16\nball_diameter = 8.4\npitch_diameter = 71.5\n"
        "contact_angle_deg = 15\n"
    )
    first, second = read_parts(path)
    assert first == Bearing(9, 7.94, 39.04, ratio=0.5, name="rear")
    assert second == Bearing(16, 8.4, 71.5, radians(15))
    for text, message in (
        ("contact_angle_deg = 95", "contact_angle_deg must be"),
        ("contact_angle = 0.2", "'contact_angle' is not known; possible are .*contact_angle_deg"),
    ):
        path.write_text(f'[[Bearing]]\ndesignation = "6205"\n{text}\n')
        with pytest.raises(ValueError, match=message):
            read_parts(path)


@pytest.mark.parametrize(
    ("designation", "published"),
    [
        ("22205", (6.1852, 8.8148, 2.7015, 0.4123)),  # FAG 22205E1KC3
        ("2303", (3.4222, 5.5778, 1.8561, 0.3802)),  # FAG 2303-TVH
        ("NU205", (5.2325, 7.7675)),
        ("NU206", (5.24, 7.76, 2.49)),  # Schaeffler NU206-E-XL-TVP2
        ("ER-12K", (3.048, 4.95, 1.992)),
    ],
)
def test_the_orders_that_a_source_states_follow_from_the_geometry(designation, published):
    orders = [line.order for line in bearing_of(designation).lines()]
    assert orders[: len(published)] == pytest.approx(published, rel=0.002)


NSK = """6007 14.8 10300, 6008 15.3 11500, 6009 15.3 15200, 6010 15.6 16600, 6215 14.7 49500,
6216 14.6 53000, 6217 14.5 62000, 6218 14.5 71500, 6219 14.4 82000, 6220 14.4 93000,
6300 11.2 3450, 6301 11.1 4200, 6302 12.3 5450, 6306 13.3 15000, 6313 13.2 60000"""


def test_number_and_size_of_the_balls_follow_from_the_load_ratings_of_the_catalogue():
    ratings = {name: (f0, c0r) for name, f0, c0r in map(str.split, NSK.split(","))}
    table = published_bearings()
    assert set(ratings) == set(table.index[table["source"].str.contains("by the load ratings")])
    for name, (f0, c0r) in ratings.items():  # C0r = f0 n BD^2, ISO 76
        balls = bearing_of(name)
        product = balls.n_balls * balls.ball_diameter**2
        assert product == pytest.approx(float(c0r) / float(f0), rel=0.01)
