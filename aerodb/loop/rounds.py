"""Rounds of the closed loop: trace, add what is found, and trace again with the candidate.

docs/method/tracing.md, section 13.
"""

from collections.abc import Collection, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from typing import Final

from aerodb.coefficients import Comparison
from aerodb.effects import SURFACE_MOTION
from aerodb.increments import worse_axes
from aerodb.loop.accept import Accept
from aerodb.loop.adding import added_to, bearable, separates
from aerodb.loop.axis_models import AxisModel, axis_models
from aerodb.loop.constant_lift import (
    CONSTANT,
    Written,
    as_constant_lift,
    entering_first,
    level_again,
)
from aerodb.loop.downgraded import only_what_was_frozen, only_with_gain
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.frozen_library import Library
from aerodb.loop.manoeuvre_units import by_manoeuvres, with_few_flight_findings
from aerodb.loop.moving_air import beside_rotating_air
from aerodb.loop.refit import axes_of_misfit_shapes
from aerodb.loop.remarks import on_linear_terms, on_shapes, on_stall, on_withheld, on_without_gain
from aerodb.loop.sensor_share import beside_sensors, compared_with, found_sensors
from aerodb.loop.shapes import checked_shapes
from aerodb.loop.stall import EFFECT
from aerodb.loop.stall_hysteresis import one_stall
from aerodb.loop.turned_slopes import about_flown_mean, about_zero_lift
from aerodb.tables import AeroDatabase
from aerodb.tracing import (
    FewFlightFindings,
    Finding,
    Traced,
    accompanying_linear_terms,
    downgraded_on_axes,
    trace,
)

#: Rounds end after so many whatever they still find; those beside found sensors count anew.
MOST_ROUNDS = 4
#: Before the first round.
_NOTHING: Final = Traced((), (), (), (), ())
#: Axes on which a stall acts.
_PITCH = frozenset({"CX", "CZ", "Cm"})


@dataclass(frozen=True)
class LoopResult:
    """The result of a loop.

    The candidate, all findings and those that were added, the last round's tracing, and remarks.
    by_manoeuvre : whether manoeuvres were the units, so that heads and tails of flights validate.
    without_gain : ids that stayed out because their addition lowered no error of other flights, or
    by less than stayed without a name.
    """

    baseline: AeroDatabase
    candidate: AeroDatabase
    findings: tuple[Finding, ...]
    added: tuple[Finding, ...]
    traced: Traced
    rounds: int
    remarks: tuple[str, ...] = ()
    by_manoeuvre: bool = False
    without_gain: frozenset[str] = frozenset()
    axis_models: tuple[AxisModel, ...] = ()

    @property
    def separates(self) -> bool:
        """Return whether a stall with separating flow was added."""
        return any(separates(finding) for finding in self.added)


def run_loop(
    source: FlightSource,
    flights: Sequence[str],
    baseline: AeroDatabase,
    library: Library,
    accept: Accept,
    without_gain: frozenset[str] = frozenset(),
    modelled: Collection[str] | None = None,
) -> LoopResult:
    """Run the loop on the flights (ids) that identify.

    Each round traces with the present candidate and admits confirmed findings, and those that
    `accept` names; as many of them are added as make no axis worse. without_gain : hypotheses whose
    addition has been tried, and lowered no error of flights that did not identify; they stay out,
    suspected at most. modelled : terms (ids) of increment models, as more flights have decided;
    None: decided here. Raises InputError where `accept` names what the library does not have.
    """
    accept.check(library)
    known_before = source.looked_before(flights, library)
    given = _Given(source, tuple(flights), baseline, library, accept, without_gain, known_before)
    end = _turned(given, _with_withheld(given, _with_axis_models(given, _rounds(given), modelled)))
    stalled = any(separates(finding) for finding in end.added)
    return LoopResult(
        baseline,
        end.database,
        only_with_gain(end.findings.values(), (), end.withheld),
        end.added,
        end.traced,
        end.rounds,
        (
            *library.remarks,
            *end.remarks,
            *(on_stall(end.database) if stalled else ()),
            *on_shapes(end.database),
            *on_withheld(end.withheld),
            *on_without_gain(without_gain),
            *on_linear_terms(end.linear_beside),
        ),
        end.by_manoeuvre and not stalled,  # the validation of a stall leaves whole flights out
        without_gain,
        end.axis_models,
    )


@dataclass(frozen=True)
class _Given:
    """What a loop is given: the arguments of `run_loop`, and the ids that earlier libraries had."""

    source: FlightSource
    flights: tuple[str, ...]
    baseline: AeroDatabase
    library: Library
    accept: Accept
    without_gain: frozenset[str]
    known_before: frozenset[str] | None


@dataclass(frozen=True)
class _State:
    """State of a loop after some rounds.

    database : with all that was added. findings : hypothesis -> finding of the round that added it,
    otherwise of the first round that had it. withheld : ids that make an axis worse without others
    that were not admitted. linear_beside : ids of linear terms that were added with what was
    estimated together with them. ended : whether the last round found nothing new. remarks : of the
    last round, and on increment models.
    """

    database: AeroDatabase
    traced: Traced = _NOTHING
    findings: Mapping[str, Finding] = field(default_factory=dict)
    added: tuple[Finding, ...] = ()
    withheld: frozenset[str] = frozenset()
    linear_beside: tuple[str, ...] = ()
    by_manoeuvre: bool = False
    rounds: int = 0
    ended: bool = False
    remarks: tuple[str, ...] = ()
    axis_models: tuple[AxisModel, ...] = ()


def _rounds(given: _Given) -> _State:
    """Trace and add until a round finds nothing new, or MOST_ROUNDS are over; then once more
    without what sensors that were found to be wrong leave, which hides other effects."""
    state = _until_nothing_new(given, _State(given.baseline))
    wrong = found_sensors(state.traced.findings)
    if not wrong or state.by_manoeuvre or state.database.states:
        return state
    beside = beside_sensors(given.source, given.flights, state.database, given.library, wrong)
    more = _until_nothing_new(replace(given, source=beside), replace(state, rounds=0, ended=False))
    if len(more.added) == len(state.added):
        return state
    sensors = {f.hypothesis: f for f in state.traced.findings if f.hypothesis in wrong}
    findings = {**more.findings, **sensors}
    return replace(more, findings=findings, rounds=state.rounds + more.rounds)


def _until_nothing_new(given: _Given, state: _State) -> _State:
    while state.rounds < MOST_ROUNDS and not state.ended:
        state = _next_round(given, state)
    return state


def _next_round(given: _Given, state: _State) -> _State:
    """The state after one more round."""
    source, flights, database, library = given.source, given.flights, state.database, given.library
    traced, remarks = _traced(source, flights, database, library, state.added, given.known_before)
    suspected = by_manoeuvres(source, traced, library, database)
    if suspected:
        traced = with_few_flight_findings(traced, suspected)
    else:
        shaped = checked_shapes(source, flights, database, library, traced.findings)
        # What leans on another term's shape still does when that term has been added.
        leaning = {id: f for id, f in state.findings.items() if f.shape and "of" in f.shape}
        shaped = tuple(leaning.get(finding.hypothesis, finding) for finding in shaped)
        traced = replace(traced, findings=shaped)
    traced = replace(traced, findings=only_with_gain(traced.findings, given.without_gain))
    earlier = state.findings
    have = {finding.hypothesis for finding in state.added} | state.withheld | given.without_gain
    if database.states:
        have |= {h.id for h in library.hypotheses if h.effect == EFFECT}
    new = one_stall(
        [f for f in traced.findings if given.accept.admits(f) and f.hypothesis not in have]
    )
    state = replace(
        state,
        traced=traced,
        findings={
            **state.findings,
            **{
                f.hypothesis: f
                for f in traced.findings
                if f.hypothesis not in state.findings or f in new
            },
        },
        by_manoeuvre=state.by_manoeuvre or bool(suspected),
        rounds=state.rounds + 1,
        ended=not new,
        remarks=remarks,
    )
    if not new:
        return state
    new, beside = _with_linear_terms(new, suspected, have)
    sensors = found_sensors(traced.findings)
    written = _as_lift(given, new, sensors)
    if written:
        # It comes first, as it was seen beside the baseline: the next rounds find what remains.
        database, before, beside = given.baseline, earlier.get(CONSTANT), []
        new = [entering_first(f, before) for f in new if f.hypothesis in written]
        state = _State(
            database,
            findings={f.hypothesis: f for f in new},
            by_manoeuvre=state.by_manoeuvre,
            rounds=1,
            remarks=remarks,
        )
    candidate, kept = bearable(source, database, library, new, flights, sensors, written)
    state = replace(
        state,
        database=candidate,
        added=(*state.added, *kept),
        withheld=state.withheld | {f.hypothesis for f in new if f not in kept},
        linear_beside=(*state.linear_beside, *beside),
    )
    return _levelled(given, state, sensors, kept)


def _levelled(
    given: _Given, state: _State, sensors: Mapping[str, float], new: Sequence[Finding]
) -> _State:
    """The state with a constant of CZ that an earlier round added estimated again, beside what this
    round has added on the lift."""
    constant = next((f for f in state.added if f.hypothesis == CONSTANT and f not in new), None)
    if constant is None or not any("CZ" in finding.axis for finding in new):
        return state
    database, changed = level_again(
        given.source,
        given.flights,
        state.database,
        given.library,
        sensors,
        constant,
        len(given.baseline.increments),
    )
    findings = {**state.findings, CONSTANT: changed}
    others = tuple(f for f in state.added if f is not constant)
    if changed.verdict != constant.verdict:
        withheld = state.withheld | {CONSTANT}
        return replace(state, database=database, findings=findings, added=others, withheld=withheld)
    return replace(state, database=database, findings=findings, added=(changed, *others))


def _as_lift(given: _Given, findings: Sequence[Finding], sensors: Mapping[str, float]) -> Written:
    """How a constant of CZ among the findings is written: see `as_constant_lift`."""
    source, flights = given.source, given.flights

    def with_one(finding: Finding, written: Written) -> dict[str, Comparison]:
        candidate = added_to(
            source, given.baseline, given.library, [finding], flights, sensors, written, refit=False
        )
        return compared_with(source, flights, candidate)

    return as_constant_lift(findings, given.library, with_one)


def _with_axis_models(given: _Given, state: _State, modelled: Collection[str] | None) -> _State:
    """The state with increment models in place of single effects, on axes where many act at once;
    a stall has a fit of its own.

    modelled : as for `run_loop`.
    """
    if state.database.states:
        return state
    library, known_before = given.library, given.known_before
    every = frozenset(hypothesis.id for hypothesis in library.hypotheses)
    sensors = found_sensors(state.findings.values())
    models, not_added = axis_models(
        given.source,
        given.flights,
        given.baseline,
        state.database,
        library,
        state.added,
        given.without_gain,
        every - (every if known_before is None else known_before),
        modelled,
        sensors,
        [id for id, finding in state.findings.items() if finding.effect in SURFACE_MOTION],
    )
    state = replace(state, remarks=(*state.remarks, *not_added))
    if models is None:
        return state
    apart = models.apart(library)
    added = tuple(f for f in state.added if f.hypothesis in apart)
    stays = {
        id: finding
        for id, finding in state.findings.items()
        if finding in added or (id in apart and id in models.standing)
    }
    named = [*models.traced.findings, *added]
    shaped = checked_shapes(given.source, given.flights, given.baseline, library, named)
    members = {f.hypothesis: f for f in shaped[: len(models.traced.findings)]}
    models = replace(models, traced=replace(models.traced, findings=tuple(members.values())))
    return replace(
        state,
        database=about_zero_lift(
            given.source, given.flights, given.baseline, models.candidate, library, sensors
        ),
        traced=models.traced,
        findings=stays | members,
        added=(*added, *members.values()),
        withheld=state.withheld & apart,
        by_manoeuvre=False,
        remarks=(*state.remarks, *(model.remark for model in models.models)),
        axis_models=models.models,
    )


def _with_withheld(given: _Given, state: _State) -> _State:
    """The state with those confirmed terms that were withheld and make no axis worse where their
    slopes are about the flown mean, one after the other; none beside increment models or a stall,
    which estimate anew what is on their axes."""
    if state.axis_models or state.database.states:
        return state
    for id in sorted(state.withheld):
        finding = state.findings.get(id)
        if finding is None or finding.verdict != "confirmed":
            continue
        source, flights, database = given.source, given.flights, state.database
        sensors = found_sensors(state.findings.values())
        candidate = added_to(source, database, given.library, [finding], flights, sensors)
        before = compared_with(source, flights, database)
        worse = worse_axes(before, compared_with(source, flights, candidate))
        turned = about_flown_mean(source, flights, database, candidate, worse)
        if not worse_axes(before, compared_with(source, flights, turned)):
            state = replace(
                state,
                database=turned,
                added=(*state.added, finding),
                withheld=state.withheld - {id},
            )
    return state


def _turned(given: _Given, state: _State) -> _State:
    """The state with its slopes over alpha about the point that leaves the smallest constant beside
    the sensors that later rounds have found, where no axis is worse than with the baseline."""
    source, flights, library = given.source, given.flights, given.library
    sensors = found_sensors(state.findings.values())
    if not sensors or not state.added:
        return state
    turned = about_zero_lift(source, flights, given.baseline, state.database, library, sensors)
    if turned is state.database:
        return state
    beside = beside_sensors(source, flights, given.baseline, library, sensors)
    worse = worse_axes(*(compared_with(beside, flights, db) for db in (given.baseline, turned)))
    return state if worse else replace(state, database=turned)


def _traced(
    source: FlightSource,
    flights: Sequence[str],
    database: AeroDatabase,
    library: Library,
    added: Sequence[Finding],
    known_before: frozenset[str] | None,
) -> tuple[Traced, tuple[str, ...]]:
    """Trace whole flights with a database; and what a reader must know of the result."""
    normal_equations = source.normal_equations(flights, database, library)
    earlier = {finding.hypothesis: finding.value for finding in added}
    traced = trace(normal_equations, library.hypotheses, library.settings, earlier)
    traced = beside_rotating_air(source, traced, database, library, earlier)
    traced, remarks = only_what_was_frozen(traced, known_before)
    return (
        replace(
            traced, findings=downgraded_on_axes(traced.findings, axes_of_misfit_shapes(database))
        ),
        remarks,
    )


def _with_linear_terms(
    new: Sequence[Finding], suspected: Sequence[FewFlightFindings], have: Set[str]
) -> tuple[list[Finding], list[str]]:
    """The admitted findings with the linear terms together with which manoeuvres estimated them,
    and their ids.

    have : ids that the database has already, or must not get.
    """
    new, beside = list(new), list[str]()
    for part in suspected:
        # A stall brings the corrections of its attached flow along: see `added_stall`.
        linear_terms = accompanying_linear_terms(
            part.joint, [f for f in new if f in part.findings and f.effect != EFFECT]
        )
        stalled = _PITCH if any(finding.effect == EFFECT for finding in new) else frozenset[str]()
        barred = have | {finding.hypothesis for finding in new}
        more = [
            each
            for each in linear_terms
            if each.hypothesis not in barred and not stalled & set(each.axis)
        ]
        beside += [each.hypothesis for each in more]
        new += more
    return new, beside
