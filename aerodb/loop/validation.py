"""Validation of a loop: error before and after on flights, or parts of flights, that did not
identify."""

from aerodb.coefficients import Comparison
from aerodb.increments import (
    AxisValidation,
    HoldOut,
    validate_by_leaving_one_out,
    validate_on_held_out,
)
from aerodb.loop.flights import FlightSource
from aerodb.loop.library import Library
from aerodb.loop.rounds import Accept, LoopResult, run_loop
from aerodb.loop.stall import added_stall
from aerodb.loop.within_flight import validated_within_flights


def validate_loop(
    source: FlightSource, hold_out: HoldOut, library: Library, loop: LoopResult, accept: Accept
) -> tuple[AxisValidation, ...]:
    """Return the error before and after on the flights held out, or by leaving out one flight at a
    time.

    A flight left out takes no part in a loop of its own. A stall is fitted to the other flights
    that stall; where manoeuvres were the units, heads and tails of flights are predicted from
    everything else.
    """
    flights = (*hold_out.identified, *hold_out.held_out)
    before = {flight: source.comparison(flight, loop.baseline)[1] for flight in flights}
    after = {flight: source.comparison(flight, loop.candidate)[1] for flight in flights}
    if hold_out.kind != "cross-validated":
        return validate_on_held_out(before, after, hold_out)
    if loop.separates:

        def from_others(left_out: str) -> Comparison:
            others = tuple(flight for flight in library.stall if flight != left_out)
            return source.comparison(left_out, added_stall(source, loop.baseline, others))[1]

        return validate_by_leaving_one_out(before, after, from_others)
    if loop.by_manoeuvre:
        return validated_within_flights(source, library, loop, before, after)

    def without(left_out: str) -> Comparison:
        others = tuple(flight for flight in hold_out.identified if flight != left_out)
        again = run_loop(source, others, loop.baseline, library, accept)
        return source.comparison(left_out, again.candidate)[1]

    return validate_by_leaving_one_out(before, after, without)
