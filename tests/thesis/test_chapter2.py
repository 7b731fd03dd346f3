"""What chapter 2 of the thesis says comes out again, but for the order step of Fig. 2.7."""

import pytest

pytestmark = pytest.mark.slow  # the whole chapter is computed and drawn


@pytest.fixture(scope="module")
def chapter(quick_chapter):
    return quick_chapter(2)[0]


@pytest.fixture(scope="module")
def findings(chapter):
    return {finding.where: finding for finding in chapter.findings}


def test_all_agrees_but_the_order_step_and_the_width_of_the_smeared_spectrum(findings):
    assert len(findings) == 21
    assert [where for where, f in findings.items() if not f.agrees_by_range] == [
        "Fig. 2.6, highest frequency of the smeared spectrum [Hz]",
        "Fig. 2.7, order step",
    ]
    # The frequency of the ramp ends at 6 x 50 rad/s = 47.7 Hz.
    assert 47.7 < findings["Fig. 2.6, highest frequency of the smeared spectrum [Hz]"].ours < 55
    assert findings["Fig. 2.7, order step"].ours == pytest.approx(60 / 256, abs=5e-5)


def test_each_figure_is_drawn_or_named_as_not_drawn(chapter, figures_of):
    drawn, omitted = figures_of(chapter)
    assert drawn | omitted == set(range(1, 15))
    assert not drawn & omitted


def test_definitions_are_not_counted_with_what_is_random(chapter):
    assert "12 of 12 random figures are found again, and 7 of 9 that follow" in chapter.opening


def test_table_2_1_has_every_cell_that_is_not_left_to_chance(findings):
    cells = [where for where in findings if where.startswith("Table 2.1")]
    assert len(cells) == 4 + 4 + 2
    assert findings["Table 2.1, e1, y3, magnitude"].low > 0.99
    assert findings["Table 2.1, e2, y2, magnitude"].low > 0.98


def test_read_as_its_words_say_the_cost_of_eq_2_48_swaps_the_errors(chapter):
    errors = chapter.tables["Figs. 2.13 and 2.14, errors of 1000"]["ours"]
    equation, words = errors["Eq. (2.48)"], errors["Eq. (2.48), as described in words"]
    assert equation["decided as w1"] < 10 < 25 < equation["decided as w2"]
    assert words["decided as w2"] < 10 < 25 < words["decided as w1"]


def test_equations_as_printed_err_and_as_read_do_not(chapter):
    table = chapter.tables["Equations as printed"].droplevel("quantity")
    error = (table["emacm"] - table["true"]).abs()
    printed = (table["as printed"] - table["true"]).abs()
    assert error["Eq. (2.9)"] < 1e-9 < 40 < printed["Eq. (2.9)"]
    assert error["Eq. (2.13)"] < 0.02 < 0.2 < printed["Eq. (2.13)"]
    assert error["Eq. (2.20)"] < 1e-12 < 0.9 < printed["Eq. (2.20)"]
    assert table.loc["Fig. 2.7", "as printed"] == pytest.approx(0.1172, abs=5e-5)
