"""Validation within flights: constant parts, which each flight has one of its own of beside the
other terms, are estimated from what these leave."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.loop import freeze_library
from aerodb.loop.within_flight import estimated_without
from tests.aerodb.loop.test_axis_models import database, flights
from tests.support.flights_in_memory import FlightsInMemory

#: Added to Cm of all flights, and to the part of one that is left out.
CONSTANT, ELSEWHERE = 0.01, 0.5


@pytest.mark.parametrize("beside", [[], ["pitch_damping@Cm"]])
def test_a_constant_part_is_that_of_the_samples_that_stay(beside: list[str]) -> None:
    flown = flights(range(60, 62))
    first = next(iter(flown.flown))
    head = np.zeros(len(flown.flight(first).time), dtype=bool)
    head[: len(head) // 3] = True
    moved = {
        id: (
            flight,
            replace(
                made,
                values={
                    **made.values,
                    "Cm": made.values["Cm"] + CONSTANT + (ELSEWHERE * head if id == first else 0.0),
                },
            ),
        )
        for id, (flight, made) in flown.flown.items()
    }
    source, complete = FlightsInMemory(flown.vehicle, moved), database(1.0)
    library = freeze_library(source, tuple(moved), complete)
    names = [*beside, "zero_offset@Cm"]
    found = estimated_without(source, library, complete, names, tuple(moved), {first: head})
    level = next(each for each in found.increments if str(each.regressors[0]) == "1")
    assert level.estimates[0] == pytest.approx(CONSTANT, rel=0.05)
