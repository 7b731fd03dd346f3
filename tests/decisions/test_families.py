"""A decision for the family of a sub-state is right."""

import pandas as pd
import pytest

from emacm.decisions.families import as_families, families_of_cost, family_mapping

STATES = ["normal", "worn1", "worn2"]


def test_both_ways_of_stating_families_are_the_same():
    by_class = family_mapping({"normal": "normal", "worn1": "worn", "worn2": "worn"}, STATES)
    assert by_class == family_mapping({"normal": ["normal"], "worn": ("worn1", "worn2")}, STATES)
    assert by_class == family_mapping(pd.Series(by_class), STATES)


def test_a_family_and_another_decision_stay_what_they_are():
    family_of = {"worn1": "worn", "worn2": "worn"}
    assert as_families(["worn", "worn1", "inspect"], family_of) == ["worn", "worn", "inspect"]


def test_a_class_without_a_family_is_named():
    with pytest.raises(ValueError, match=r"a family for every class; missing: \['worn2'\]"):
        family_mapping({"normal": ["normal"], "worn": ["worn1"]}, STATES)


def test_a_class_has_one_family():
    with pytest.raises(ValueError, match="'worn1' into 'normal' and into 'worn'"):
        family_mapping({"normal": ["normal", "worn1"], "worn": ["worn1", "worn2"]}, STATES)


def test_a_family_called_like_a_class_of_another_is_ambiguous():
    with pytest.raises(ValueError, match="a family 'b' and a class 'b' that belongs to 'c'"):
        family_mapping({"a": "b", "b": "c"}, ["a", "b"])


def test_families_are_a_mapping():
    with pytest.raises(TypeError, match="families must map each class to its family"):
        family_mapping(["worn"], STATES)


def test_without_a_cost_or_with_one_of_classes_each_is_its_own():
    same = {state: state for state in STATES}
    assert families_of_cost(None, STATES) == same
    inspect = {("inspect", state): 0.0 for state in STATES}  # free, and yet no class
    assert families_of_cost(inspect, STATES) == same


def test_the_decision_that_costs_nothing_is_right():
    cost = pd.DataFrame([[0, 9, 9], [1, 0, 0]], index=["fly", "ground"], columns=STATES)
    assert families_of_cost(cost, STATES) == {"normal": "fly", "worn1": "ground", "worn2": "ground"}


@pytest.mark.parametrize(("price", "number"), [(0.5, 0), (0.0, 2)])
def test_a_cost_that_does_not_tell_what_is_right_is_refused(price, number):
    cost = pd.DataFrame([[0, 9, price], [1, 0, price]], index=["fly", "ground"], columns=STATES)
    with pytest.raises(ValueError, match=f"{number} of them cost 0 when 'worn2' is true.*families"):
        families_of_cost(cost, STATES)
