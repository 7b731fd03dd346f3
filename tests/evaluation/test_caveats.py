"""Labels that are confounded with units are named, and limits of the figures of merit."""

import re

import numpy as np
import pandas as pd
import pytest

from emacm.evaluation.caveats import (
    confounding_caveats,
    novelty_caveats,
    scheme_caveats,
    single_unit_labels,
)
from emacm.evaluation.schemes import RANDOM, Scheme
from emacm.evaluation.scoring import scoring_rule
from emacm.recordings.meta import Grouping


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
    (caveat,) = confounding_caveats(["new", "worn", "new"], ["A", "B", "C"], "unit")[1:]
    assert "'B' only 'worn', 'C' only 'new'. With the same" in caveat


def test_units_that_were_new_and_worn_leave_no_caveat():
    assert confounding_caveats(["new", "worn", "new", "worn"], ["A", "A", "B", "B"], "unit") == []


def test_one_label_on_a_single_unit_is_enough():
    labels, units = ["new", "worn", "new", "worn", "spalled"], ["A", "A", "B", "B", "B"]
    (caveat,) = confounding_caveats(labels, units, "unit")
    assert "'spalled' only in 'B'." in caveat
    assert single_unit_labels(labels, units) == {"spalled": "B"}
    assert single_unit_labels(units, labels) == {}


QUIET = {
    "balanced_accuracy": 0.7,
    "balanced_accuracy_low": 0.6,
    "balanced_accuracy_high": 0.8,
    "accuracy": 0.75,
    "realised_cost_low": 0.3,
    "predicted_cost_high": 0.3,
    "groups": 10,
    "resampled": "run",
}
RULE = scoring_rule(np.array(["new", "worn"]))
UNIT = Grouping("unit", np.arange(4))


def caveats_of(random=None, rule=RULE, **changes):
    """Return the caveats of a split by run with few changes, beside a random split."""
    above = {"balanced_accuracy": random or 0.8, "balanced_accuracy_high": 0.95}
    rows = {RANDOM: QUIET | above, "by run": QUIET | changes}
    schemes = [Scheme(name, [], UNIT) for name in rows]
    return scheme_caveats(schemes, pd.DataFrame.from_dict(rows, orient="index"), rule)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"random": 0.81}, "The random split is optimistic: .* interval of 'by run'\\."),
        ({"realised_cost_low": 0.31}, "The realised cost of 'by run' is above the cost"),
        ({"resampled": "recording"}, "intervals of 'by run' are from a bootstrap over single"),
        ({"groups": 9}, "fewer than 10 groups are approximate: 'by run'"),
        ({"accuracy": 0}, "All decisions are correct, or all are wrong, in 'by run'"),
        ({"accuracy": 1}, "All decisions are correct, or all are wrong, in 'by run'"),
        ({"groups": 20, "balanced_accuracy_low": np.nan}, "no confidence interval in 'by run'"),
    ],
)
def test_each_caveat_has_its_limit(changes, words):
    assert caveats_of() == []
    (caveat,) = caveats_of(**changes)
    assert re.search(words, caveat)


def test_without_a_random_split_none_is_optimistic():
    table = pd.DataFrame([QUIET], ["by run"])
    assert scheme_caveats([Scheme("by run", [], UNIT)], table, RULE) == []


def test_few_recordings_without_groups_are_one_caveat_and_one_group_needs_no_interval():
    (caveat,) = caveats_of(groups=3, resampled="recording")
    assert "bootstrap over single recordings" in caveat
    (caveat,) = caveats_of(groups=1, balanced_accuracy_low=np.nan)
    assert "fewer than 10 groups" in caveat
    first, second = caveats_of(groups=2, balanced_accuracy_low=np.nan)
    assert "fewer than 10 groups" in first
    assert "Balanced accuracy has no confidence interval in 'by run'" in second


def test_without_probabilities_no_cost_is_realised_above_the_predicted_one():
    without = {key: value for key, value in QUIET.items() if "_cost_" not in key}
    table = pd.DataFrame([without], ["by run"])
    assert scheme_caveats([Scheme("by run", [], UNIT)], table, RULE) == []


def test_caveats_are_in_the_order_of_their_seriousness():
    schemes = [Scheme(RANDOM, [], UNIT), Scheme("by run", [], UNIT, "There is one run.")]
    table = pd.DataFrame([QUIET | {"accuracy": 1}, {}], [RANDOM, "by run"])
    families = scoring_rule(np.array(["dry", "new"]), families={"dry": "worn", "new": "new"})
    found = scheme_caveats(schemes, table, families, ["Further."])
    assert found[0] == "'by run' cannot be scored. There is one run."
    assert found[1].startswith("All decisions are correct")
    assert found[2:] == ["Further.", "Scored by families: 'worn', 'new'."]
    alone = scheme_caveats(schemes[:1], table, RULE)
    assert [text.split()[0] for text in alone] == ["Only", "All"]


def test_families_that_are_not_left_out_are_named_and_none_is_a_caveat():
    table = pd.DataFrame({"auroc": [1.0]}, ["worn"])
    assert novelty_caveats(table, {}) == []
    assert novelty_caveats(table, {"dry": "Too few."}) == [
        "'dry' could not be left out of training. Too few."
    ]
    assert len(novelty_caveats(table[:0], {"dry": "Too few."})) == 1
    (none,) = novelty_caveats(table[:0], {})
    assert none.startswith("No family of faults was left out as unknown")
