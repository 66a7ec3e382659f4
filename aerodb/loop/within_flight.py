"""Validation within flights, where there are too few to leave one out.

A part of a flight is predicted from everything else.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aerodb.coefficients import Comparison
from aerodb.effects import Hypothesis, add_effects, envelopes_of, view_of
from aerodb.increments import (
    AxisValidation,
    Floors,
    Update,
    keep_slope_signs,
    validate_by_leaving_one_out,
)
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.frozen_library import Library
from aerodb.loop.manoeuvre_units import manoeuvre_spans
from aerodb.loop.rounds import LoopResult
from aerodb.tables import AeroDatabase
from aerodb.tracing import LINEAR, evidence_of, joint_bands, joint_fit

Mask = NDArray[np.bool_]


def parts_of(time: NDArray[np.float64], spans: tuple[tuple[float, float], ...]) -> dict[str, Mask]:
    """Return a flight's head, to the middle of its first manoeuvre, and tail, from the middle of
    its last.

    So what is left out is flown once more in what remains. time (n,) [s]; spans from its first
    sample. Without a manoeuvre: halves.
    """
    since = time - time[0]
    middles = [0.5 * (start + end) for start, end in spans] or [0.5 * float(since[-1])]
    return {"head": since <= middles[0], "tail": since > middles[-1]}


def validated_within_flights(
    source: FlightSource,
    library: Library,
    loop: LoopResult,
    before: Mapping[str, Comparison],
    after: Mapping[str, Comparison],
    floors: Floors,
) -> tuple[AxisValidation, ...]:
    """Return the rms error (dimensionless) before and after on heads and tails of flights.

    Each is predicted with the values that everything else gives the terms added. Which terms is not
    chosen again: two or three manoeuvres cannot do without one of them. before, after, floors : of
    whole flights, by their ids. Raises InputError where a flight lacks what is needed.
    """
    masks = {
        f"{flight}@{name}": (flight, mask)
        for flight, comparison in before.items()
        for name, mask in parts_of(comparison.time, manoeuvre_spans(source, flight)).items()
    }
    names = [finding.hypothesis for finding in loop.added]

    def without(part: str) -> Comparison:
        flight, mask = masks[part]
        candidate = estimated_without(
            source, library, loop.baseline, names, tuple(before), {flight: mask}
        )
        return _only(source.comparison(flight, candidate), mask)

    return validate_by_leaving_one_out(
        {part: _only(before[flight], mask) for part, (flight, mask) in masks.items()},
        {part: _only(after[flight], mask) for part, (flight, mask) in masks.items()},
        without,
        {part: floors[flight] for part, (flight, _) in masks.items()},
    )


def _only(comparison: Comparison, mask: Mask) -> Comparison:
    return replace(
        comparison, usable={axis: good & mask for axis, good in comparison.usable.items()}
    )


def estimated_without(
    source: FlightSource,
    library: Library,
    baseline: AeroDatabase,
    names: Sequence[str],
    flights: tuple[str, ...],
    masks: Mapping[str, Mask],
) -> AeroDatabase:
    """Return the baseline with the named hypotheses, estimated together with the linear set without
    masked samples; masks (n,), values in the unit of each hypothesis.

    There each flight has a constant of its own on each axis: constant parts are then the mean of
    what the other terms leave. Raises InputError where a flight lacks what is needed.
    """
    if not names:
        return baseline
    evidence, views = [], []
    for flight in flights:
        comparison = source.comparison(flight, baseline)
        if flight in masks:
            comparison = _only(comparison, ~masks[flight])
        if any(good.any() for good in comparison.usable.values()):
            view = view_of(source.flight(flight), comparison, baseline, source.vehicle)
            evidence.append(evidence_of(view, library.hypotheses))
            views.append(view)
    bands, settings = joint_bands(evidence, library.hypotheses, library.settings)
    linear = [i for i, h in enumerate(library.hypotheses) if h.effect in LINEAR]
    terms = list(
        dict.fromkeys([*linear, *(i for i, h in enumerate(library.hypotheses) if h.id in names)])
    )
    constants = [i for i in terms if library.hypotheses[i].effect == "zero_offset"]
    joint = joint_fit(bands, [i for i in terms if i not in constants], library.hypotheses, settings)
    own = [i for i in terms if library.hypotheses[i].id in names and i not in constants]
    able = [view for view in views if all(view.has(library.hypotheses[i].needs) for i in own)]

    def added(
        database: AeroDatabase, terms: Sequence[int], values: Sequence[float]
    ) -> AeroDatabase:
        if not terms:
            return database
        effects, none = [library.hypotheses[i] for i in terms], np.zeros((len(terms), len(terms)))
        envelopes = envelopes_of(effects, able, baseline)
        return add_effects(database, effects, np.array(values), none, envelopes, flights)

    candidate = added(baseline, own, [joint.value(i) for i in own])
    levels = [_level(source, library.hypotheses[i], candidate, flights, masks) for i in constants]
    candidate = added(candidate, constants, levels)
    return keep_slope_signs(Update(candidate, (), flights), baseline).candidate


def _level(
    source: FlightSource,
    constant: Hypothesis,
    database: AeroDatabase,
    flights: Sequence[str],
    masks: Mapping[str, Mask],
) -> float:
    """The mean residual on the axis of a constant part, without masked samples."""
    (axis,) = constant.written_on
    left = []
    for flight in flights:
        compared = source.comparison(flight, database)
        if axis not in compared.usable:
            continue
        good = compared.usable[axis] & ~masks.get(flight, np.zeros(len(compared.time), dtype=bool))
        left.append(compared.residual(axis)[good])
    samples = np.concatenate([np.zeros(0), *left])
    return float(samples.mean()) if len(samples) else 0.0
