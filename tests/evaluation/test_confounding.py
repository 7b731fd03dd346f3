"""What recordings cannot tell apart is said in words."""

from emacm.evaluation.confounding import confounding, single_label_units, single_unit_labels


def test_labels_recorded_on_one_unit_each_are_named():
    said = confounding(["new", "worn", "new", "worn"], ["A", "B", "A", "B"], "assembly")
    assert said[0].startswith(
        "Label and assembly are confounded: 'new' in 'A' alone, 'worn' in 'B' alone."
    )
    assert "no split of these recordings can show which" in said[0]
    assert said[1].startswith("Each assembly has one label: 'A' was only ever 'new'")


def test_several_units_of_each_label_leave_one_remark():
    (said,) = confounding(["new", "worn"] * 2, ["A", "B", "C", "D"], "unit")
    assert said.startswith("Each unit has one label: 'A' was only ever 'new'")
    assert said.count("was only ever") == 3
    assert "and 1 more" in said


def test_units_that_were_new_and_worn_leave_nothing_to_say():
    assert confounding(["new", "worn", "new", "worn"], ["A", "A", "B", "B"], "unit") == []


def test_one_label_alone_on_its_unit_is_enough():
    labels, units = ["new", "worn", "new", "worn", "spalled"], ["A", "A", "B", "B", "B"]
    (said,) = confounding(labels, units, "unit")
    assert "'spalled' in 'B' alone" in said
    assert single_unit_labels(labels, units) == {"spalled": "B"}
    assert single_label_units(labels, units) == {}
