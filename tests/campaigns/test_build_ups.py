"""Rates of an aircraft of parts: intervals of its parameters, and false claims beside a right build-up."""

import numpy as np
import pytest

from tests.campaigns.build_ups import CORRECTED, covered, drawn, in_memory, report, written
from tests.support.parts import TEXT, aircraft


def test_each_seed_draws_other_wrong_values_within_bounds() -> None:
    assert drawn(1) != drawn(2)
    for seed in range(20):
        wrong = aircraft(drawn(seed))  # refuses a value outside its bounds
        assert {n for n in wrong.parameters if wrong.parameters[n] != aircraft().parameters[n]} == {
            *CORRECTED
        }
    assert written({}) == TEXT
    assert "tail_slope = { value = 4.25," in written({"tail_slope": 4.25})


def test_an_interval_that_misses_and_a_false_claim_are_counted() -> None:
    inside, outside = ([0.19, 0.1, 1.0], [-0.21, 0.1, 1.0])
    line = {
        "parameters": {"one": inside, "two": outside},
        "findings": [["confirmed", "parameter@all:one"]], "cpu": [1.0, 2.0, 3.0],
    }  # fmt: skip
    assert covered(line) == {"one": True, "two": False}
    told = report([line, {**line, "findings": [["suspected", "parameter@all:two"]]}])
    assert "2/  4  (50.0 %)" in told
    assert "1 of 2 runs confirm something" in told


@pytest.mark.campaign
def test_intervals_hold_the_truth_and_a_right_build_up_is_left_alone() -> None:
    """Ten seeds of three flights: 13 of them had 73 of 78 intervals right, and no claim."""
    lines = [in_memory(seed, 3) for seed in range(1, 11)]
    assert np.mean([hit for line in lines for hit in covered(line).values()]) >= 0.85
    assert not [f for line in lines for f in line["findings"] if f[0] == "confirmed"]
