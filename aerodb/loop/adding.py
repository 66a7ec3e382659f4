"""Add findings to a database as increments, as far as no axis becomes worse; fit them once more.

docs/method/tracing.md, section 13.
"""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from aerodb.effects import FlightView, add_effects, envelopes_of
from aerodb.increments import Update, keep_slope_signs, worse_axes
from aerodb.loop.constant_lift import Written
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.frozen_library import Library
from aerodb.loop.refit import refit_of, refit_terms
from aerodb.loop.sensor_share import beside_sensors, compared_with
from aerodb.loop.stall import EFFECT, added_stall
from aerodb.loop.stall_hysteresis import (
    added_lift_hysteresis,
    is_lift_hysteresis,
    with_unused_states,
)
from aerodb.loop.turned_slopes import about_zero_lift
from aerodb.tables import AeroDatabase
from aerodb.tracing import Finding, joint_covariance


def separates(finding: Finding) -> bool:
    """Return whether it is a stall with separating flow, which is added with its own fit on all
    axes."""
    return finding.effect == EFFECT and not is_lift_hysteresis(finding.hypothesis)


def bearable(
    source: FlightSource,
    database: AeroDatabase,
    library: Library,
    new: Sequence[Finding],
    flights: Sequence[str],
    sensors: Mapping[str, float],
    written: Written,
) -> tuple[AeroDatabase, list[Finding]]:
    """Return the candidate with as many of the new findings as make no axis worse, and these
    findings.

    First without the constants of the axes concerned, then without what is written on one axis
    after the other: a lift, a drag and a side force all reach CX, and only one of them need do harm
    there. Estimated together with terms that may not enter, a term can be right and still do harm.
    An axis is worse where it is so with and without what the sensors found to be wrong leave: the
    constant of a centre of gravity can hide that of what is added.
    """
    before, added_on = compared_with(source, flights, database), _written_on(library)
    beside = beside_sensors(source, flights, database, library, sensors)

    def tried(kept: list[Finding]) -> tuple[frozenset[str], AeroDatabase, list[Finding]]:
        if not kept:
            return frozenset(), database, kept
        candidate = added_to(source, database, library, kept, flights, sensors, written)
        worse = worse_axes(before, compared_with(source, flights, candidate))
        if worse and beside is not source:
            worse &= worse_axes(
                *(compared_with(beside, flights, each) for each in (database, candidate))
            )
        return worse, candidate, kept

    worse, candidate, kept = tried(list(new))
    if worse:
        lasting = [f for f in kept if f.effect != "zero_offset" or not worse & set(f.axis)]
        if len(lasting) < len(kept):
            worse, candidate, kept = tried(lasting)
    while worse:
        harmful = dict.fromkeys(added_on(f) for f in kept if worse & set(f.axis))
        worse, candidate, kept = min(
            (tried([f for f in kept if added_on(f) != axes]) for axes in harmful),
            key=lambda each: (len(each[0]), -len(each[2])),
        )
    return candidate, kept


def _written_on(library: Library) -> Callable[[Finding], tuple[str, ...]]:
    """The axes that a finding is written on; of a stall, those that it acts on."""
    axes = {hypothesis.id: tuple(hypothesis.written_on) for hypothesis in library.hypotheses}
    return lambda finding: axes.get(finding.hypothesis, tuple(finding.axis))


def added_to(
    source: FlightSource,
    database: AeroDatabase,
    library: Library,
    new: Sequence[Finding],
    flights: Sequence[str],
    sensors: Mapping[str, float],
    written: Written = MappingProxyType({}),
    refit: bool = True,
) -> AeroDatabase:
    """Return the database with the findings as increments inside the envelope of the flights that
    have their channels.

    sensors : found to be wrong beside them, id -> error, SI. written : what is written otherwise
    than in the library. refit : whether gains and shapes are fitted once more. Raises InputError
    where a flight lacks what is needed.
    """
    if any(separates(finding) for finding in new):
        database = added_stall(source, database, tuple(library.stall))
        new = [finding for finding in new if not separates(finding)]
        if not new:
            return database
    known = {hypothesis.id: hypothesis for hypothesis in library.hypotheses}
    if any(is_lift_hysteresis(finding.hypothesis) for finding in new):
        stalled = [flight for flight in flights if flight in library.lift_hysteresis]
        database, hysteresis = added_lift_hysteresis(source, database, stalled)
        known[hysteresis.id] = hysteresis
    templates = [known[finding.hypothesis] for finding in new]
    accepted = [written.get(each.id, each) for each in templates]

    def view_beside_database(id: str) -> FlightView:
        return with_unused_states(source.view(id, database))

    views = [
        view
        for view in map(view_beside_database, flights)
        if all(view.has(hypothesis.needs) for hypothesis in accepted)
    ]
    values = np.array([finding.value for finding in new])
    covariance = joint_covariance(new, library.settings.prior_dof)
    note = "traced: " + ", ".join(f"{f.hypothesis} ({f.verdict.replace('_', ' ')})" for f in new)
    candidate = add_effects(
        database,
        accepted,
        values,
        covariance,
        envelopes_of(accepted, views, database),
        tuple(flights),
        note,
    )
    by_flights = all(
        finding.verdict != "suspected" for finding in new
    )  # a suspicion holds beside what may not enter
    shaped = all(each.increment for each in accepted)  # a parameter's shape is its database's
    finer = (
        refit_terms(source, candidate, library, templates, [view.flight for view in views])
        if refit and by_flights and shaped
        else None
    )
    if finer is not None:
        values, covariance = finer.beside(values, covariance)
        terms = [written.get(each.id, each) for each in finer.terms]
        envelopes = envelopes_of(terms, views, database)
        candidate = add_effects(
            database,
            terms,
            values,
            covariance,
            envelopes,
            tuple(flights),
            note,
            refit_of(finer),
        )
    candidate = about_zero_lift(source, flights, database, candidate, library, sensors)
    return keep_slope_signs(Update(candidate, (), tuple(flights)), database).candidate
