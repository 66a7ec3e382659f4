"""``aerodb flight``: ingest logs, list, show, compare and retract flights."""

from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from aerodb.errors import AeroError, InputError
from aerodb.flows.cli.comparing import compare
from aerodb.flows.cli.consistency import say_consistency
from aerodb.flows.cli.findings import (
    say_damage,
    say_delays,
    say_repeats,
    say_rolls,
    say_segments,
    say_suspicions,
    segments_words,
)
from aerodb.flows.cli.groups import Commands
from aerodb.flows.cli.ingested import say_ingested
from aerodb.flows.cli.known_names import LOGS
from aerodb.flows.cli.output import Session, visible
from aerodb.flows.cli.references import Direct, MappingFile, OfFlight, Verbose
from aerodb.flows.cli.vehicles import say_placeholders
from aerodb.remarks import NEVER_AIRBORNE, WIDE_LIMITS
from aerodb.support import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aerodb.storage.catalogue import FlightRow, Impact, LogRow
    from aerodb.tasks.workspace_access import WorkspaceAccess

app = typer.Typer(name="flight", cls=Commands, no_args_is_help=True, help="Flights: ingested logs.")


@app.command()
def ingest(
    context: typer.Context,
    log: Annotated[list[str], typer.Argument(help=f"One or more logs: {LOGS}.")],
    vehicle: Annotated[
        str | None, typer.Option(help="The vehicle that flew; optional if there is only one.")
    ] = None,
    mapping: MappingFile = None,
    name: Annotated[str | None, typer.Option(help="A name for the flight (one log only).")] = None,
    strict: Annotated[
        bool, typer.Option(help="Quarantine a damaged log instead of using its intact part.")
    ] = False,
    direct: Direct = False,
    accept_placeholders: Annotated[
        bool,
        typer.Option(
            "--accept-placeholders", help="Ingest although the vehicle has values of a template."
        ),
    ] = False,
    verbose: Verbose = False,
) -> None:
    """Ingest logs: store, reconstruct, compute coefficients, compare with the released database.

    Example: aerodb flight ingest *.ulg --vehicle my-glider
    """
    from aerodb.tasks.workers import start_workers

    # They get ready while this process imports the science.
    start_workers({Path(name).suffix.lower() for name in log})
    from aerodb.flows.flight import flight_flow
    from aerodb.tasks.references import vehicle_of
    from aerodb.vehicle import parse_vehicle, placeholders

    session: Session = context.obj
    if name is not None and len(log) > 1:
        raise InputError(
            "one name for several logs", "--name", "ingest them one by one, or without --name"
        )
    catalogue = session.catalogue(create=vehicle is not None)
    vehicle = vehicle_of(catalogue, vehicle)
    row = catalogue.vehicle(vehicle)
    left = placeholders(parse_vehicle(row.text, row.name))
    if left and not accept_placeholders:
        raise InputError(
            f"it still has placeholders of the template: {'; '.join(left)}",
            f"vehicle {vehicle}",
            "fill them in and add the file again, or take them as they are:"
            " --accept-placeholders; every coefficient depends on them",
        )
    say_placeholders(session, left, f"vehicle {vehicle}")
    parameters = {
        "logs": log,
        "vehicle": vehicle,
        "mapping": mapping,
        "name": name,
        "strict": strict,
    }
    outcomes = session.run(flight_flow, parameters, direct)
    say_ingested(session, outcomes, vehicle, verbose)
    session.answer(outcomes)
    if any(outcome["status"] == "refused" for outcome in outcomes):
        raise typer.Exit(3)


app.command()(compare)


@app.command("list")
def list_flights(
    context: typer.Context,
    vehicle: Annotated[str | None, typer.Option(help="Only of this vehicle.")] = None,
) -> None:
    """List flights.

    Example: aerodb flight list --vehicle my-glider
    """
    from aerodb.tasks.view import flights_document

    session: Session = context.obj
    catalogue = session.catalogue()
    rows = catalogue.flights(vehicle)
    documents = flights_document(catalogue, rows)
    then = f"show {rows[-1].id[:12]}" if rows else "ingest LOG --vehicle NAME"
    verdicts = Counter(row.verdict for row in rows)
    counts = ", ".join(f"{verdicts[name]} {name}" for name in sorted(verdicts))
    said = f"{counted(len(rows), 'flight')}: {counts or 'none yet'}"
    session.headlines(said, (), f"aerodb flight {then}")
    session.say()
    session.table(
        ["flight", "id", "vehicle", "start", "duration [s]", "verdict", ""],
        [
            [
                r.name or document["file"],
                r.id[:12],
                r.vehicle,
                _when(r)[:16],  # to the minute
                f"{r.duration:.1f}",
                f"{r.verdict}, {_WIDE}" if _is_wide(r) else r.verdict,
                _standing(document),
            ]
            for r, document in zip(rows, documents, strict=True)
        ],
        numbers=(4,),
    )
    for verdict, meaning in _MEANINGS.items():
        if any(row.verdict == verdict for row in rows):
            session.say(f"{verdict}: {meaning}")
    if any(_is_wide(row) for row in rows):
        session.say(f"{_WIDE}: [accuracy] of the vehicle allows far more than usual")
    session.answer(documents)


#: What a verdict means for who reads a list.
_MEANINGS: Final = {
    "limited": "it is used, with reservations",
    "rejected": "it is kept, and nothing in the air is learnt from it",
}


#: Mark of a verdict whose limits are not the product's.
_WIDE: Final = "wide limits"


def _is_wide(row: "FlightRow") -> bool:
    """Return whether a verdict was given by limits that are said with it."""
    return any(remark.kind == WIDE_LIMITS for remark in row.remarks)


def _standing(document: dict[str, Any]) -> str:
    """Return why a flight does not count: it was retracted, or it repeats another; else empty."""
    return "retracted" if document["retracted"] else "" if document["counts"] else "repeats another"


@app.command()
def show(
    context: typer.Context,
    flight: str,
    vehicle: OfFlight = None,
    verbose: Verbose = False,
) -> None:
    """Show a flight: its verdict, what is suspected, its consistency, and the versions based on it.

    -v also prints its segments, delays, corrections and stored results.

    Example: aerodb flight show 1a2b3c -v
    """
    from aerodb.tasks.view import flight_details, record_of, step_words
    from aerodb.tasks.workspace_access import WorkspaceAccess

    session: Session = context.obj
    catalogue = session.catalogue()
    row = catalogue.flight(flight, vehicle)
    log, impact = catalogue.log(row.log_sha256), catalogue.impact(row.id)
    document = flight_details(WorkspaceAccess(session.workspace(), catalogue), row)
    session.headlines(
        f"{row.vehicle}: {called(row, log)} is {_judged(document)} ({_when(row)},"
        f" {row.duration:.1f} s at {1 / row.step:.4g} Hz)",
        [
            ("because", _reasons(session, document)),
            ("used by", ", ".join(_uses(impact)) or "no version yet"),
        ],
        _after_show(WorkspaceAccess(session.workspace(), catalogue), row),
    )
    session.say()
    session.say(
        f"flight {row.id[:12]}, mapping {row.mapping}; log {visible(log.name) if log else '?'}"
        f" ({row.log_sha256[:12]}), {log.status if log else 'unknown'}"
    )
    say_damage(session, log.damage if log else (), "  damage")
    say_repeats(session, document["repeats"])
    say_suspicions(session, document["suspicions"])
    zero = 0.0
    if verbose or document["rolls"]:
        with suppress(AeroError):  # a lost file: times of the log's clock
            zero = record_of(WorkspaceAccess(session.workspace(), catalogue), row).start
            session.say(f"time zero: first sample, at {zero:.3f} s on the log's clock")
    if verbose:
        say_segments(session, document["segments"], zero)
        say_delays(session, document["delays"])
    elif flown := segments_words(document["segments"]):
        session.say(f"flown: {flown}")
    say_rolls(session, document["rolls"], zero)
    if document["consistency"] is not None:
        say_consistency(session, document["consistency"], verbose=verbose)
    if verbose:
        results = [
            [step_words(r["step"]), r["key"][:12], r["created_utc"][:16].replace("T", " ")]
            for r in document["results"]
        ]
        session.table(["step", "key", "made"], results)
    else:
        session.say("details: -v")
    session.answer(document)


def _after_show(access: "WorkspaceAccess", row: "FlightRow") -> str:
    """Return the next command of a flight; empty for a roll whose brakes are not known."""
    from aerodb.tasks.view import roll_command

    imported = f"aerodb database import FILE --vehicle {row.vehicle}"
    if not access.catalogue.versions(row.vehicle, 1):
        return imported
    if NEVER_AIRBORNE in (remark.kind for remark in row.remarks):
        return roll_command(access, row)
    if access.named(row.vehicle, "released"):
        return f"aerodb flight compare {row.id[:12]} released"
    return roll_command(access, row) or imported


def called(row: "FlightRow", log: "LogRow | None") -> str:
    """Return the flight's name, or the file of its log."""
    return visible(row.name or (Path(log.name).name if log else "") or row.id[:12])


def _judged(document: dict[str, Any]) -> str:
    """Return the verdict on a flight with its meaning, or why it does not count."""
    if document["retracted"]:
        return "retracted"
    if any(entry["counts"] for entry in document["repeats"]):
        return "a repeat of another, and does not count"
    meaning = _MEANINGS.get(document["verdict"], "")
    return f"{document['verdict']}: {meaning}" if meaning else document["verdict"]


def _reasons(session: Session, document: dict[str, Any]) -> str:
    """Return the first reason of the verdict in a line, and how many more there are."""
    from aerodb.report import reasons_in_units

    retracted = document["retracted"]
    said = reasons_in_units(document, session.units)
    reasons = [retracted] if retracted else said
    reasons = reasons or [entry["sentence"] for entry in document["suspicions"]]
    if not reasons:
        return ""
    more = f" (and {len(reasons) - 1} more below)" if len(reasons) > 1 else ""
    return f"{session.fitting(reasons[0], 13 + len(more))}{more}"


def _uses(impact: "Sequence[Impact]") -> list[str]:
    return [f"{use.version.label} ({use.role.replace('_', ' ')})" for use in impact]


@app.command()
def retract(
    context: typer.Context,
    flight: str,
    reason: Annotated[str, typer.Option(help="Why it must not be used.")],
    vehicle: OfFlight = None,
) -> None:
    """Withdraw a flight; every version based on it becomes stale. Nothing is deleted.

    Example: aerodb flight retract 1a2b3c --reason "pitot cover left on"
    """
    from aerodb.tasks.actors import require_role, user
    from aerodb.tasks.view import rebuilds

    session: Session = context.obj
    catalogue = session.catalogue()
    require_role(session.workspace(), catalogue, "ingest", "retracting a flight")
    row = catalogue.retract_flight(catalogue.flight(flight, vehicle).id, reason, user=user())
    stale = catalogue.impact(row.id)
    again = rebuilds(catalogue, stale)
    names = {
        name: id
        for name, id in catalogue.names(row.vehicle).items()
        if id in {use.version.id for use in stale}
    }
    name = called(row, catalogue.log(row.log_sha256))
    loop = f"aerodb close-loop --vehicle {row.vehicle}"
    commands = [entry["command"] or f"{loop} (in place of {entry['label']})" for entry in again]
    session.headlines(
        f"{row.vehicle}: {name} retracted: {row.retract_reason}",
        [
            ("stale", ", ".join(use.version.label for use in stale) or "no version"),
            ("names", ", ".join(names) and f"{', '.join(names)}: they point at a stale version"),
        ],
        (again[0]["command"] or loop) if again else f"aerodb flight list --vehicle {row.vehicle}",
    )
    if len(again) > 1:
        session.say("to rebuild them, in this order (NEW-v0002 is the version rebuilt from v0002):")
        for command in commands:
            session.say(f"  {command}")
    stale_ids = [use.version.id for use in stale]
    session.answer(
        {
            "flight": row.id,
            "reason": row.retract_reason,
            "user": row.retracted_by,
            "stale": stale_ids,
            "names": names,
            "rebuild": again,
        }
    )


def _when(row: "FlightRow") -> str:
    return f"{row.start_utc:%Y-%m-%d %H:%M:%S}" if row.start_utc else "start unknown"
