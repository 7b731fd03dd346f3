"""Facts about prognostic metrics: known answers."""

import numpy as np
import pytest

from emacm.monitoring import coverage_by_unit, phm2012_lives, phm2012_score


def test_the_challenge_score_is_one_half_for_5_percent_late_and_20_percent_early():
    assert phm2012_score([1000.0], [1000.0]) == 1
    assert phm2012_score([1000.0], [1050.0]) == pytest.approx(0.5)
    assert phm2012_score([1000.0], [800.0]) == pytest.approx(0.5)
    assert phm2012_score([1000.0, 300.0], [1100.0, 180.0]) == pytest.approx(0.25)


def test_the_two_lives_of_bearing_1_4_give_different_scores():
    official, files = phm2012_lives(), phm2012_lives("files")
    assert official["Bearing1_4"] == 339
    assert files["Bearing1_4"] == 2890
    assert official.drop("Bearing1_4").equals(files.drop("Bearing1_4"))
    assert phm2012_score(official, files) == pytest.approx(10 / 11, abs=1e-6)


def test_coverage_counts_units_and_not_readings():
    groups = np.repeat(["B", "A", "C"], [8, 1, 1])
    table = coverage_by_unit(np.zeros(10), np.r_[np.full(8, -1.0), 1, -1], np.full(10, 2), groups)
    assert table.loc["all", "coverage"] == pytest.approx(2 / 3)
    assert table.loc["B", "n_readings"] == 8
    # Clopper and Pearson for 2 of 3.
    np.testing.assert_allclose(table.loc["all", ["low", "high"]], [0.0943, 0.9916], atol=1e-4)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: phm2012_score([1.0, 0.0], [1.0, 1.0]), "true must be positive, got 0"),
        (lambda: phm2012_score([1.0], [1.0, 2.0]), "of the same length"),
        (
            lambda: coverage_by_unit([1.0, 1], [0.0, 3], [1.0, 2], "AB"),
            "above upper in row 1: 3 and 2",
        ),
    ],
)
def test_invalid_values_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
