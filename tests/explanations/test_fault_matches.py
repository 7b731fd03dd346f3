"""Predicted fault orders are assigned to the bins of an explanation."""

import numpy as np
import pandas as pd
import pytest

from emacm import Bearing, Gear, Motor, fault_orders, match_fault_orders


def explained(lows, shares, width=1.0):
    names = [f"v@{low}-{low + width}" for low in lows]
    highs = np.asarray(lows) + width
    return pd.DataFrame({"column": names, "low": lows, "high": highs, "share": shares})


def test_a_fault_order_is_matched_within_its_slip():
    table = explained([6.0, 6.2, 6.4], [0.5, 0.3, 0.2], width=0.1)
    exact = match_fault_orders(table, {"BPFI": 6.05}, slip=0.0)
    assert exact["fault"].tolist() == ["BPFI", "none", "none"]
    assert exact["fault_order"].tolist()[0] == 6.05
    assert exact.attrs["predicted_share"] == 0.5
    assert exact.attrs["predicted_bins"] == pytest.approx(1 / 3)
    slipping = match_fault_orders(table, {"BPFI": 6.05}, slip=0.03)
    assert slipping["fault"].tolist() == ["BPFI", "BPFI", "none"]
    wide = match_fault_orders(table, {"BPFI": 6.05}, slip=0.0, min_width=0.8)
    assert wide["fault"].tolist() == ["BPFI"] * 3


def test_the_nearest_of_several_orders_in_a_bin_is_named_and_all_are_counted():
    table = explained([6.0, 12.0], [0.6, 0.4])
    orders = fault_orders({"supply": 6.0, "BPFI": 6.4}, harmonics=2)
    matched = match_fault_orders(table, orders, slip=0.0)
    assert matched["fault"].tolist() == ["BPFI", "2xBPFI"]
    assert matched["n_faults"].tolist() == [2, 2]


def test_orders_bound_to_the_shaft_are_not_given_slip():
    table = explained([35.5], [1.0], width=0.3)
    assert match_fault_orders(table, fault_orders(Motor(36)))["fault"].tolist() == ["none"]
    assert match_fault_orders(table, {"supply": 36.0})["fault"].tolist() == ["supply"]


def test_an_invalid_explanation_or_order_is_refused():
    table = explained([6.0], [1.0])
    with pytest.raises(ValueError, match="'share' is missing"):
        match_fault_orders(table.drop(columns="share"), {"BPFI": 6.1})
    with pytest.raises(ValueError, match="slip"):
        match_fault_orders(table, {"BPFI": 6.1}, slip=1.0)


def test_bins_of_harmonics_and_sidebands_belong_to_their_part():
    table = explained([4.4, 14.3, 17.0], [0.5, 0.3, 0.2], width=0.1)
    orders = fault_orders(Bearing(9, 7.94, 39.04), Gear(18, 67), harmonics=4, sidebands=1)
    matched = match_fault_orders(table, orders, slip=0.005)
    assert matched["fault"].tolist() == ["BPFI-shaft", "4xBPFO", "mesh-pinion"]
