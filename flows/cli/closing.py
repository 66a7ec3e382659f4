"""``aerodb close-loop``: trace residuals to missing effects, add these, report the error."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.output import Session
from aerodb.flows.cli.references import (
    Beside,
    Direct,
    Flights,
    HoldOut,
    Select,
    Vehicle,
    Verbose,
    beside_of,
    held_out,
)
from aerodb.flows.cli.updates import (
    chosen_flights,
    say_axes,
    say_decision,
    say_derivatives,
    say_flights,
)
from aerodb.flows.cli.vehicles import read_text

#: Largest number of hypotheses not found that is printed; `--json` lists them all.
_LISTED = 12


def close_loop(
    context: typer.Context,
    vehicle: Vehicle = None,
    baseline: Annotated[str, typer.Option(help="Version to trace against.")] = "released",
    beside: Beside = None,
    flights: Flights = None,
    hold_out: HoldOut = None,
    accept_lumped: Annotated[
        list[str] | None,
        typer.Option(help="Effect to add though it cannot be told from others; it is marked."),
    ] = None,
    accept_suspected: Annotated[
        list[str] | None,
        typer.Option(
            help="Suspected effect to add anyway, by its name, its id (alpha_slope@CZ) or `all`; it"
            " is marked."
        ),
    ] = None,
    accept_ambiguous: Annotated[
        list[str] | None,
        typer.Option(
            help="Effect that a sensor error explains as well, to add anyway; it is marked."
        ),
    ] = None,
    measured: Annotated[
        list[str] | None,
        typer.Option(
            help="What was measured outside flight, with one sigma: `cg_x=3 mm, weighed`,"
            " `delta_elevator_scale=.005, rig`; as [measured] in the vehicle file."
        ),
    ] = None,
    effects: Annotated[
        Path | None, typer.Option(help="File (TOML) of effects of your own.")
    ] = None,
    library: Annotated[
        str, typer.Option(help="Required hash of the list of effects; refused if it differs.")
    ] = "",
    select: Select = None,
    on_ground: Annotated[
        bool,
        typer.Option(
            "--on-ground",
            help="Trace rolls on the ground: friction, brakes and side force of the legs. So it is"
            " where no flight was ever airborne.",
        ),
    ] = False,
    direct: Direct = False,
    verbose: Verbose = False,
) -> None:
    """Trace residuals to effects that the database lacks, add those confirmed, and report the
    error.

    The error is given before and after, on flights that were not used.

    Example: aerodb close-loop --vehicle my-glider
    """
    from aerodb.conditioning import checked_conditions
    from aerodb.flows.close_loop import close_loop_flow
    from aerodb.tasks.references import vehicle_of
    from aerodb.tasks.steps import loop_options

    session: Session = context.obj
    catalogue = session.catalogue()
    vehicle = vehicle_of(catalogue, vehicle)
    row = catalogue.version(vehicle, baseline)
    chosen = chosen_flights(catalogue, vehicle, flights)
    twice = next((id for id in chosen if chosen.count(id) > 1), None)
    if twice is not None:
        raise InputError(
            "the same flight twice",
            f"--flights {twice[:12]}",
            "name each flight once",
        )
    parameters = {
        "vehicle": vehicle,
        "baseline": row.id,
        "flights": chosen,
        "hold_out": held_out(catalogue, vehicle, hold_out),
        "accept_lumped": accept_lumped,
        "accept_suspected": accept_suspected,
        "accept_ambiguous": accept_ambiguous,
        "measured": measured,
        "effects": read_text(effects) if effects else "",
        "library": library,
        **({"select": list(checked_conditions(select))} if select else {}),
        **({"on_ground": True} if on_ground else {}),
        **beside_of(catalogue, vehicle, beside),
    }
    document = session.run(close_loop_flow, parameters, direct)
    for entry in document["not_added"]:
        session.say(f"not added although you asked for it: {entry['asked']}; {entry['because']}")
    say_loop(session, document, verbose, loop_options(catalogue, parameters))
    session.answer(document)
    if document["not_added"]:
        raise typer.Exit(1)


def say_loop(
    session: Session, document: dict[str, Any], verbose: bool, given: Sequence[str] = ()
) -> None:
    """Print a closed loop: five lines to decide on and the error per axis; with `verbose` also
    findings with reasons, all errors, open questions, next flight. given : options that it was
    asked with, which the commands that are printed repeat."""
    from aerodb.report import (
        advice_words,
        channel_words,
        finding_sentence,
        hypothesis_words,
        in_words,
        meaning,
        rejected,
        sized_finding,
    )

    say_decision(session, document, given)
    if not verbose:
        return
    session.say()
    if document["candidate"]:
        session.say(
            f"candidate {document['label']} ({document['candidate'][:12]}) on baseline"
            f" {document['baseline'][:12]}"
        )
    else:
        session.say(f"nothing was added to baseline {document['baseline'][:12]}")
    say_flights(session, document)
    session.say(
        f"list of effects {document['library']['sha256'][:12]}, fixed before the residuals were"
        " looked at"
    )
    labels = session.catalogue().flight_labels(document["flights"]["identified"])
    for number, finding in enumerate(document["findings"], 1):
        session.say()
        mark = ", added" if finding["hypothesis"] in document["added"] else ""
        sized = sized_finding(finding, session.units)
        session.say(f"{number}. {sized}{mark}: {finding['hypothesis']}")
        session.say(f"   {finding_sentence(finding, labels)}.")
        if mark and finding["verdict"] != "confirmed":
            session.say(f"   {meaning(finding, document)}.")
        rivals = finding["explanation_set"][1:]
        if rivals:
            session.say(f"   explains it as well: {', '.join(map(hypothesis_words, rivals))}")
        for rival, reason in list(rejected(finding).items())[:3]:
            session.say(f"   not the {hypothesis_words(rival)}: {in_words(reason)}")
    for entry in document.get("between_flights", []):
        session.say()
        words = hypothesis_words(entry["hypothesis"])
        session.say(f"differs between flights: {words} over {channel_words(entry['condition'])}")
        session.say(f"   {in_words(entry['because'])}.")
    session.say()
    say_axes(session, document)
    say_derivatives(session, document.get("derivatives", []))
    _say_not_found(session, document["not_found"])
    _say_suspected(session, document, given)
    _say_wanted(session, document, given)
    for sentence in document["next_flight"]:
        session.say(f"next flight: {advice_words(sentence)}")
    for sentence in document["remarks"]:
        session.say(f"- {in_words(sentence)}")


def _say_suspected(session: Session, document: dict[str, Any], given: Sequence[str]) -> None:
    """Print the command that adds what is only suspected, and shows what it is worth."""
    from aerodb.report import accepting

    if command := accepting(document, given):
        session.say()
        session.say(
            f"to add what is not confirmed, and see its error on flights left out: {command}"
        )


def _say_wanted(session: Session, document: dict[str, Any], given: Sequence[str]) -> None:
    """Print the command that runs again with the measurements which tell findings from sensors."""
    from aerodb.report import hypothesis_words, listed, measurements, measuring

    open_ones = [finding for finding in document["findings"] if finding.get("wanted")]
    if not open_ones:
        return
    wanted = measurements(document)
    session.say()
    for finding in open_ones:
        names = [each["parameter"] for each in finding["wanted"]]
        sizes = [f"{name} to {wanted[name]}" if wanted[name] else name for name in names]
        session.say(
            f"to tell the {hypothesis_words(finding['hypothesis'])} from sensors, measure"
            f" outside flight: {listed(sizes)}"
        )
    session.say(f"then: {measuring(document, given)}")


def _say_not_found(session: Session, entries: list[dict[str, Any]]) -> None:
    """Print hypotheses that were not found, each with its bound; undecidable ones first."""
    from aerodb.report import excluded_sizes, hypothesis_words

    if not entries:
        return
    open_ones = [entry for entry in entries if entry["verdict"] != "not_detected"]
    closed = [entry for entry in entries if entry["verdict"] == "not_detected"]
    session.say()
    session.say(
        f"tested and not found: {len(closed)} hypotheses; not decidable with these flights:"
        f" {len(open_ones)}"
    )
    session.table(
        ["effect", "verdict", "upper bound", "minimum detectable", "unit"],
        [
            [
                hypothesis_words(e["hypothesis"]),
                e["verdict"].replace("_", " "),
                *(_size(of) for of in (limits["upper_bound"], limits["minimum_detectable"])),
                limits["unit"],
            ]
            for e in [*open_ones, *closed][:_LISTED]
            for limits in [excluded_sizes(e, session.units)]
        ],
        numbers=(2, 3),
    )
    if len(entries) > _LISTED:
        session.say(f"({len(entries) - _LISTED} more: --json)")


def _size(value: float | None) -> str:
    return "none" if value is None else f"{value:.3g}"
