"""Validation of a loop: error before and after on flights, or parts of flights, that did not
identify."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.increments import (
    UNCHANGED,
    AxisValidation,
    HoldOut,
    validate_by_leaving_one_out,
    validate_on_held_out,
)
from aerodb.loop.accept import Accept
from aerodb.loop.flight_source import FlightSource, on_each
from aerodb.loop.frozen_library import Library
from aerodb.loop.rounds import LoopResult, run_loop
from aerodb.loop.sensor_share import beside_sensors, compared_with, found_sensors
from aerodb.loop.stall import added_stall
from aerodb.loop.within_flight import estimated_without, validated_within_flights
from aerodb.tables import AeroDatabase
from aerodb.tracing import UnexplainedResidual

Proof = TypeVar("Proof", bound=tuple[Any, ...])


def validate_loop(
    source: FlightSource,
    hold_out: HoldOut,
    library: Library,
    loop: LoopResult,
    accept: Accept,
    predictors: dict[str, AeroDatabase] | None = None,
) -> tuple[AxisValidation, ...]:
    """Return the error before and after on the flights held out, or by leaving out one flight at a
    time.

    A flight left out takes no part in a loop of its own; which terms increment models have is known
    there, their values are not. Where the others are too few for an error rate, and can confirm
    nothing, what was added is known as well, and its values are theirs. A stall is fitted to the
    other flights that stall; where manoeuvres were the units, heads and tails of flights are
    predicted from everything else. Neither error holds what sensors that the loop found to be wrong
    leave: it is no error of a database. predictors : is given, per flight (its id) that was
    predicted as a whole, the database that predicted it.
    """
    predictors = {} if predictors is None else predictors
    flights = (*hold_out.identified, *hold_out.held_out)
    sensors = found_sensors(loop.findings)
    beside = beside_sensors(source, flights, loop.baseline, library, sensors)
    before, after = (
        compared_with(beside, flights, each) for each in (loop.baseline, loop.candidate)
    )
    if hold_out.kind != "cross-validated":
        predictors.update(dict.fromkeys(hold_out.held_out, loop.candidate))
        floors = source.noise_floors(hold_out.held_out or flights, loop.candidate)
        return validate_on_held_out(before, after, hold_out, floors)
    floors = source.noise_floors(flights, loop.candidate)
    if loop.separates:

        def from_others(left_out: str) -> Comparison:
            others = tuple(flight for flight in library.stall if flight != left_out)
            predictors[left_out] = added_stall(source, loop.baseline, others)
            return beside.comparison(left_out, predictors[left_out])

        return validate_by_leaving_one_out(before, after, from_others, floors)
    if loop.by_manoeuvre:
        return validated_within_flights(beside, library, loop, before, after, floors)

    def without(left_out: str) -> AeroDatabase:
        others = tuple(flight for flight in hold_out.identified if flight != left_out)
        if len(others) < library.settings.fewest and not loop.axis_models:
            names = [finding.hypothesis for finding in loop.added]
            return estimated_without(beside, library, loop.baseline, names, others, {})
        return run_loop(
            source,
            others,
            loop.baseline,
            library,
            accept,
            loop.without_gain,
            [term for model in loop.axis_models for term in model.terms],
        ).candidate

    predictors.update(zip(before, on_each(source, tuple(before), without), strict=True))
    return validate_by_leaving_one_out(
        before, after, lambda id: beside.comparison(id, predictors[id]), floors
    )


def until_all_gain(
    run: Callable[[frozenset[str]], LoopResult],
    prove: Callable[[LoopResult], Proof],
    unexplained: Callable[[LoopResult], Sequence[UnexplainedResidual]],
) -> tuple[LoopResult, Proof, Sequence[UnexplainedResidual]]:
    """Return the first loop all of whose additions gain, its proof, and what it leaves unexplained.

    run : of the ids that stay out. prove : of a loop; a tuple that begins with the validation of
    its axes, in dimensionless rms errors. A loop with additions that gain nothing (`without_gain`),
    or less than stayed without a name (`beside_larger_unnamed`), is run again without these.
    """
    loop = run(frozenset())
    while True:
        proof, left = prove(loop), unexplained(loop)
        idle = without_gain(loop, proof[0]) or beside_larger_unnamed(loop, proof[0], left)
        if not idle:
            return loop, proof, left
        loop = run(loop.without_gain | idle)


def without_gain(loop: LoopResult, proof: Sequence[AxisValidation]) -> frozenset[str]:
    """Return the confirmed findings that were added and lower the error of no axis materially.

    Errors are those on flights that did not identify, rms, as they are or about each flight's mean.
    A finding gains with any of its axes, an axis by more than the fraction `increments.UNCHANGED`
    of either; one whose axes nothing validates is not judged.
    """
    ratios = {
        entry.axis: min(after / before for before, after in _errors(entry) if before > 0.0)
        for entry in proof
        if any(before > 0.0 for before, _ in _errors(entry))
    }
    judged = {
        finding.hypothesis: [ratios[axis] for axis in finding.axis if axis in ratios]
        for finding in loop.added
        if finding.verdict == "confirmed"
    }
    return frozenset(id for id, falls in judged.items() if falls and min(falls) > 1.0 - UNCHANGED)


def _errors(entry: AxisValidation) -> list[tuple[float, float]]:
    """Errors before and after on flights that did not identify: as they are, and about each
    flight's mean, which other errors of an axis' level do not touch."""
    pairs = (
        (entry.held_out_rms_before, entry.held_out_rms_after),
        (entry.held_out_shape_before, entry.held_out_shape_after),
    )
    return [(before, after) for before, after in pairs if before is not None and after is not None]


def beside_larger_unnamed(
    loop: LoopResult, proof: Sequence[AxisValidation], left: Sequence[UnexplainedResidual]
) -> frozenset[str]:
    """Return the confirmed findings that were added although an unexplained residual that is left
    is larger than what they explain.

    A finding explains, on each axis, the fall of the mean square error of flights that did not
    identify, as it is or about each flight's mean; what is unexplained, the mean square that is
    predictable and has no name. One that is the smaller of the two on every axis on which it gains
    has the wrong name or the wrong shape.
    """
    unnamed = {
        each.axis: float(np.mean(np.multiply(each.skills, each.power)))
        for each in left
        if each.found
    }
    fall = {
        entry.axis: max(before**2 - after**2 for before, after in _errors(entry))
        for entry in proof
        if _errors(entry)
    }
    smaller = set()
    for finding in loop.added:
        gains = {axis: fall[axis] for axis in finding.axis if fall.get(axis, 0.0) > 0.0}
        below = [gain < unnamed.get(axis, 0.0) for axis, gain in gains.items()]
        if finding.verdict == "confirmed" and below and all(below):
            smaller.add(finding.hypothesis)
    return frozenset(smaller)
