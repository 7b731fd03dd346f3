"""Labels that are confounded with units are named."""

from emacm.evaluation.caveats import confounding_caveats, single_unit_labels


def test_labels_recorded_on_one_unit_each_are_named():
    caveats = confounding_caveats(["worn", "new"] * 2, ["B", "A"] * 2, "assembly")
    assert caveats[0].startswith(
        "Label and assembly are confounded: 'worn' only in 'B', 'new' only in 'A'."
    )
    assert "no split of these recordings" in caveats[0]
    assert caveats[1].startswith("Each assembly has one label: 'B' only 'worn', 'A' only 'new'.")
    assert len(caveats) == 2


def test_several_units_of_each_label_leave_one_caveat():
    (caveat,) = confounding_caveats(["new", "worn"] * 2, ["A", "B", "C", "D"], "unit")
    assert caveat.startswith("Each unit has one label: 'A' only 'new', 'B' only 'worn'")
    assert "'C' only 'new' and 1 more." in caveat
    assert "'D'" not in caveat


def test_units_that_were_new_and_worn_leave_no_caveat():
    assert confounding_caveats(["new", "worn", "new", "worn"], ["A", "A", "B", "B"], "unit") == []


def test_one_label_on_a_single_unit_is_enough():
    labels, units = ["new", "worn", "new", "worn", "spalled"], ["A", "A", "B", "B", "B"]
    (caveat,) = confounding_caveats(labels, units, "unit")
    assert "'spalled' only in 'B'." in caveat
    assert single_unit_labels(labels, units) == {"spalled": "B"}
    assert single_unit_labels(units, labels) == {}
