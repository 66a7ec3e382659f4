"""The closed loop: trace, add what is proved, trace again on the candidate until nothing more is found, and prove it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.effects import FlightView, add_effects, envelopes_of, view_of
from aerodb.errors import InputError
from aerodb.increments import AxisProof, Update, keep_slope_signs, prove, prove_by_leaving_one_out, worse_axes
from aerodb.support import in_threads
from aerodb.tables import HAT_RATES, STATE_CHANNEL, AeroDatabase
from aerodb.tasks.manoeuvres import by_manoeuvres, with_suspicion
from aerodb.tasks.parts import prove_by_parts
from aerodb.tasks.shape import fitted_again, remarks_on_shapes, said_of, wrong_shapes
from aerodb.tasks.stall import EFFECT, added_stall
from aerodb.tasks.stall_loops import added_loop, is_loop, one_stall, with_unused_states
from aerodb.tasks.steps.compare import beside, compared, load_comparison
from aerodb.tasks.steps.trace import Library, looked_before, only_what_was_frozen, thinned_beside, trace_flight
from aerodb.tasks.steps.update import Plan
from aerodb.tasks.workspace_access import Stores, stores
from aerodb.tracing import (
    ADDED,
    Finding,
    Left,
    Remainder,
    Traced,
    beside_wrong_shapes,
    evidence_of,
    joint_covariance,
    linear_companions,
    remainders,
    trace,
)

#: The loop ends after this many rounds whatever it still finds.
MOST_ROUNDS = 4
#: Axes on which a stall acts.
_PITCH = frozenset({"CX", "CZ", "Cm"})


@dataclass(frozen=True)
class Accept:
    """Effects (names or hypotheses' ids) that the user lets in although they are aliased (`lumped`) or only `suspected`."""

    lumped: tuple[str, ...] = ()
    suspected: tuple[str, ...] = ()

    def admits(self, finding: Finding) -> bool:
        """Whether a finding enters the database."""
        wanted = {"alias_group": self.lumped, "suspected": self.suspected}.get(finding.verdict, ())
        return finding.verdict in ADDED or finding.hypothesis in wanted or finding.effect in wanted


@dataclass(frozen=True)
class Loop:
    """Where a loop ended: the candidate, all findings and those that were added, the last round's tracing, and remarks."""

    baseline: AeroDatabase
    candidate: AeroDatabase
    findings: tuple[Finding, ...]
    added: tuple[Finding, ...]
    traced: Traced
    rounds: int
    remarks: tuple[str, ...] = ()
    by_manoeuvre: bool = False


def run_loop(plan: Plan, library: Library, *, workspace: str, run: str, accept: Accept) -> Loop:
    """The loop on the plan's identification flights."""
    opened = stores(workspace)
    _check(accept, library)
    return _loop(opened, plan, library, plan.hold_out.identified, accept, run)


def prove_loop(plan: Plan, library: Library, loop: Loop, *, workspace: str, run: str, accept: Accept) -> tuple[AxisProof, ...]:
    """Error before and after on flights that did not identify; below five flights each is predicted from the others."""
    opened = stores(workspace)
    before = {flight: load_comparison(opened, flight, plan.baseline, run)[1] for flight in plan.flights}
    after = {flight: compared(opened, flight, loop.candidate, run) for flight in plan.flights}
    if plan.hold_out.kind != "cross-validated":
        return prove(before, after, plan.hold_out)
    if any(_separates(finding) for finding in loop.added):

        def from_others(left_out: str) -> Comparison:
            others = tuple(flight for flight in library.stall if flight != left_out)
            return compared(opened, left_out, added_stall(opened, loop.baseline, others, run), run)

        return prove_by_leaving_one_out(before, after, from_others)
    if loop.by_manoeuvre:
        return prove_by_parts(opened, library, loop, before, after, run)

    def without(left_out: str) -> Comparison:
        others = tuple(flight for flight in plan.hold_out.identified if flight != left_out)
        again = _loop(opened, plan, library, others, accept, run)
        return compared(opened, left_out, again.candidate, run)

    return prove_by_leaving_one_out(before, after, without)


def what_is_left(plan: Plan, library: Library, loop: Loop, *, workspace: str, run: str) -> tuple[Remainder, ...]:
    """What the identification flights still have in common beside the candidate; empty below the fewest flights."""
    opened = stores(workspace)
    flights = plan.hold_out.identified
    if len(flights) < library.settings.fewest:
        return ()
    sensors = [hypothesis for hypothesis in library.hypotheses if hypothesis.kind == "sensor"]

    def left(id: str) -> Left:
        flight, comparison = thinned_beside(opened, id, loop.candidate, library, run)
        vehicle, _ = opened.vehicle(plan.vehicle)
        view = view_of(flight, comparison, loop.candidate, vehicle)
        names = {*loop.candidate.flight_inputs, *HAT_RATES}
        variables = {name: view.channels[name] for name in sorted(names) if view.has([name])}
        return Left(evidence_of(flight, comparison, loop.candidate, vehicle, sensors, view=view), variables)

    return remainders(in_threads(left, flights), library.settings)


def _check(accept: Accept, library: Library) -> None:
    known = {name for hypothesis in library.hypotheses for name in (hypothesis.effect, hypothesis.id)}
    for name in (*accept.lumped, *accept.suspected):
        if name not in known:
            raise InputError(f"no effect '{name}' in the library", "close-loop", "see the effects that a first run lists")


def _loop(opened: Stores, plan: Plan, library: Library, flights: Sequence[str], accept: Accept, run: str) -> Loop:
    baseline = database = opened.database(plan.baseline)
    findings: dict[str, Finding] = {}
    added: list[Finding] = []
    by_manoeuvre, said_beside, withheld = False, list[str](), set[str]()
    where = {"workspace": str(opened.workspace.root), "run": run}
    known_before = looked_before(opened, tuple(flights), library)
    rounds = 0
    for rounds in range(1, MOST_ROUNDS + 1):  # noqa: B007 - where it ended is part of the answer
        grams = in_threads(partial(trace_flight, **where, library=library, database=database), flights)
        earlier = {finding.hypothesis: finding.value for finding in added}
        traced, remarks = only_what_was_frozen(trace(grams, library.hypotheses, library.settings, earlier), known_before)
        traced = replace(traced, findings=beside_wrong_shapes(traced.findings, wrong_shapes(database)))
        said = by_manoeuvres(opened, traced, library, database, run)
        if said:
            traced, by_manoeuvre = with_suspicion(traced, said), True
        have = {finding.hypothesis for finding in added} | withheld
        have |= {h.id for h in library.hypotheses if h.effect == EFFECT} if database.states else set()
        new = one_stall([f for f in traced.findings if accept.admits(f) and f.hypothesis not in have])
        findings |= {f.hypothesis: f for f in traced.findings if f.hypothesis not in findings or f in new}
        if not new:
            break
        for part in said:
            # A stall brings the corrections of its attached flow along: see `added_stall`.
            companions = linear_companions(part.joint, [f for f in new if f in part.findings and f.effect != EFFECT])
            stalled = _PITCH if any(finding.effect == EFFECT for finding in new) else frozenset[str]()
            barred = have | {finding.hypothesis for finding in new}
            beside = [each for each in companions if each.hypothesis not in barred and not stalled & set(each.axis)]
            said_beside += [each.hypothesis for each in beside]
            new += beside
        candidate, kept = _bearable(opened, database, library, new, flights, run)
        withheld |= {finding.hypothesis for finding in new if finding not in kept}
        added += kept
        database = candidate
    if any(_separates(finding) for finding in added):
        by_manoeuvre = False  # the proof leaves whole flights out
        remarks += (f"The stall was added with the shape and the gains on which its flights agree: {_stall_gains(database)}.",)
    remarks += remarks_on_shapes(database)
    if withheld:
        why = "they were estimated beside others that were not admitted, and alone would make their axis worse"
        remarks += (f"Not added although found: {', '.join(sorted(withheld))}; {why}.",)
    if said_beside:
        remarks += (
            f"With what was accepted, the linear terms beside which it was estimated were added: {', '.join(said_beside)}.",
        )
    remarks = (*library.remarks, *remarks)
    return Loop(baseline, database, tuple(findings.values()), tuple(added), traced, rounds, remarks, by_manoeuvre)


def _separates(finding: Finding) -> bool:
    """Whether it is a stall whose flow separates: it is added with its own fit on all axes."""
    return finding.effect == EFFECT and not is_loop(finding.hypothesis)


def _stall_gains(database: AeroDatabase) -> str:
    law = next(state.law for state in database.states if state.name == STATE_CHANNEL)
    gains = [
        (inc.axis, inc.estimates[-1])
        for inc in database.increments
        if inc.regressors and STATE_CHANNEL in inc.regressors[-1].names
    ]
    return f"{law}, " + ", ".join(f"{axis} {value:.3g}" for axis, value in gains)


def _bearable(
    opened: Stores, database: AeroDatabase, library: Library, new: Sequence[Finding], flights: Sequence[str], run: str
) -> tuple[AeroDatabase, list[Finding]]:
    """The candidate with as many of the new findings as make no axis worse, and these: first without the constants of the axes
    concerned, then without anything on them. Estimated beside terms that may not enter, a term can be right and yet do harm."""
    kept = list(new)
    candidate = _added(opened, database, library, kept, flights, run)
    for only_constants in (True, False):
        worse = _worse(opened, flights, database, candidate, run)
        if not worse:
            break
        kept = [f for f in kept if not worse & set(f.axis) or (only_constants and f.effect != "zero_offset")]
        candidate = _added(opened, database, library, kept, flights, run) if kept else database
    return candidate, kept


def _worse(opened: Stores, flights: Sequence[str], database: AeroDatabase, candidate: AeroDatabase, run: str) -> frozenset[str]:
    def all_beside(model: AeroDatabase) -> dict[str, Comparison]:
        return dict(zip(flights, in_threads(lambda id: compared(opened, id, model, run), flights), strict=True))

    return worse_axes(all_beside(database), all_beside(candidate))


def _added(
    opened: Stores, database: AeroDatabase, library: Library, new: Sequence[Finding], flights: Sequence[str], run: str
) -> AeroDatabase:
    """The database with the findings as increments inside the envelope of the flights that voted for them."""
    if any(_separates(finding) for finding in new):
        database = added_stall(opened, database, tuple(library.stall), run)
        new = [finding for finding in new if not _separates(finding)]
        if not new:
            return database
    known = {hypothesis.id: hypothesis for hypothesis in library.hypotheses}
    if any(is_loop(finding.hypothesis) for finding in new):
        stalled = [flight for flight in flights if flight in library.loops]
        database, closed_loop = added_loop(opened, database, stalled, run)
        known[closed_loop.id] = closed_loop
    accepted = [known[finding.hypothesis] for finding in new]

    def seen(id: str) -> FlightView:
        flight, comparison, _ = beside(opened, id, database, run)
        return with_unused_states(view_of(flight, comparison, database, opened.vehicle(flight.vehicle)[0]))

    views = [view for view in in_threads(seen, flights) if all(view.has(hypothesis.needs) for hypothesis in accepted)]
    values = np.array([finding.value for finding in new])
    covariance = joint_covariance(new, library.settings.prior_dof)
    marked = ", ".join(f"{f.hypothesis} ({f.verdict.replace('_', ' ')})" for f in new)
    envelopes = envelopes_of(accepted, views, database)
    candidate = add_effects(database, accepted, values, covariance, envelopes, tuple(flights), f"traced: {marked}")
    by_flights = all(finding.verdict != "suspected" for finding in new)  # a suspicion holds beside what may not enter
    finer = fitted_again(opened, candidate, library, accepted, [view.flight for view in views], run) if by_flights else None
    if finer is not None:
        values, covariance = finer.beside(values, covariance)
        envelopes, note = envelopes_of(finer.terms, views, database), f"traced: {marked}{said_of(finer)}"
        candidate = add_effects(database, finer.terms, values, covariance, envelopes, tuple(flights), note)
    return keep_slope_signs(Update(candidate, (), tuple(flights)), database).candidate
