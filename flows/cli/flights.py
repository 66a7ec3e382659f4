"""``aerodb flight``: ingest logs, list, show, compare and retract flights."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.consistency import say_consistency
from aerodb.flows.cli.findings import (
    say_damage,
    say_delays,
    say_repeats,
    say_segments,
    say_suspicions,
)
from aerodb.flows.cli.groups import Commands
from aerodb.flows.cli.output import Session, complaint, visible
from aerodb.flows.cli.references import Direct, MappingFile, OfFlight
from aerodb.flows.cli.vehicles import say_placeholders

if TYPE_CHECKING:
    from aerodb.storage.catalogue import FlightRow

app = typer.Typer(name="flight", cls=Commands, no_args_is_help=True, help="Flights: ingested logs.")


@app.command()
def ingest(
    context: typer.Context,
    log: Annotated[list[str], typer.Argument(help="One or more logs.")],
    vehicle: Annotated[str, typer.Option(help="The vehicle that flew.")],
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
) -> None:
    """Ingest logs: store, reconstruct, compute coefficients, compare with the released database.

    Example: aerodb flight ingest *.ulg --vehicle my-glider
    """
    from aerodb.tasks.workers import start_workers

    # They get ready while this process imports the science.
    start_workers({Path(name).suffix.lower() for name in log})
    from aerodb.flows.flight import flight_flow
    from aerodb.vehicle import parse_vehicle, placeholders

    session: Session = context.obj
    if name is not None and len(log) > 1:
        raise InputError(
            "one name for several logs", "--name", "ingest them one by one, or without --name"
        )
    row = session.catalogue(create=True).vehicle(vehicle)
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
    for outcome in outcomes:
        _report(session, outcome)
    if len(outcomes) > 1:
        _summarise(session, outcomes, vehicle)
    session.answer(outcomes)
    if any(outcome["status"] == "refused" for outcome in outcomes):
        raise typer.Exit(3)


def _report(session: Session, outcome: dict[str, Any]) -> None:
    from aerodb.recording import Damage

    if outcome["status"] == "refused":
        typer.echo(complaint(outcome["what"], outcome["where"], outcome["remedy"]), err=True)
        return
    session.say(
        f"{visible(outcome['log'])}: {outcome['status']} as flight {outcome['flight'][:12]}"
    )
    say_damage(session, [Damage(**entry) for entry in outcome["damage"]], "  damage")
    say_repeats(session, outcome["repeats"], "  ")
    say_suspicions(session, outcome["suspicions"], "  ")
    say_consistency(session, outcome["consistency"], "  ")
    for step in ("coefficients", "comparison"):
        result = outcome[step]
        if result is not None and result["key"] is None:
            session.say(f"  no {step}: {result['reason']}")
    comparison = outcome["comparison"]
    if comparison is not None and comparison["key"] is not None:
        _say_comparison(session, comparison)
        say_suspicions(session, comparison["suspicions"], "  ")


def _say_comparison(session: Session, comparison: dict[str, Any]) -> None:
    rows = [
        [
            axis,
            f"{v['rms_measured']:.4g}",
            f"{v['rms_residual']:.4g}",
            f"{v['noise_floor']:.2g}",
            str(v["samples"]),
        ]
        for axis, v in comparison["axes"].items()
    ]
    session.table(
        ["axis", "flight rms", "flight - database rms", "noise floor", "samples"],
        rows,
        numbers=(1, 2, 3, 4),
    )
    for note in comparison["notes"]:
        session.say(f"  note: {note}")


def _summarise(session: Session, outcomes: Sequence[dict[str, Any]], vehicle: str) -> None:
    """Say what became of a batch of logs, in five lines, and what to do next."""
    taken = [each for each in outcomes if each["status"] != "refused"]
    verdicts = Counter(
        each["consistency"]["verdict"] for each in taken if each["consistency"] is not None
    )
    compared = [each for each in taken if (each["comparison"] or {}).get("key") is not None]
    refused = [Path(each["log"]).name for each in outcomes if each["status"] == "refused"]
    suspected = sum(1 for each in taken if each["suspicions"])
    judged = ", ".join(f"{count} {verdict}" for verdict, count in sorted(verdicts.items()))
    session.say()
    session.say(f"{len(outcomes)} logs: {len(taken)} taken, {len(refused)} refused")
    session.say(f"consistency: {judged or 'not checked'}")
    session.say(f"compared with the released version: {len(compared)} of {len(taken)}")
    session.say(
        f"with suspicions: {suspected}, with damage: {sum(bool(e['damage']) for e in taken)}"
    )
    session.say(
        f"refused: {visible(', '.join(refused[:5])) or 'none'}{', ...' * (len(refused) > 5)}"
    )
    _propose_calibration(session, [each["consistency"] for each in taken], vehicle)


def _propose_calibration(
    session: Session, documents: Sequence[Mapping[str, Any] | None], vehicle: str
) -> None:
    """Propose to calibrate flights together that correct different sensors, each by itself."""
    alone = [each for each in documents if each and each["checked"] and not each["calibration"]]
    applied = [
        {entry["parameter"] for entry in each["estimates"] if entry["applied"]} for each in alone
    ]
    counts = Counter(name for names in applied for name in names)
    uneven = sorted(name for name, count in counts.items() if count < len(alone))
    if uneven:
        session.say(
            f"corrected in some of these flights only: {', '.join(uneven)}. Sensors of one"
            " installation have one error; estimate together what the flights share:"
        )
        session.say(f'aerodb recalibrate --vehicle {vehicle} --reason "flown together"')


@app.command()
def compare(
    context: typer.Context,
    flight: str,
    version: Annotated[str, typer.Argument(help="Any version of the flight's vehicle.")],
    vehicle: OfFlight = None,
) -> None:
    """Compare a stored flight with any version: rms of the flight and of what is left, per axis.

    Example: aerodb flight compare 1a2b3c v0002
    """
    from aerodb.flows.flight import compare_flow

    session: Session = context.obj
    catalogue = session.catalogue()
    row = catalogue.flight(flight, vehicle)
    other = catalogue.version(row.vehicle, version)
    parameters = {"flight": row.id, "version": other.id}
    document = session.run(compare_flow, parameters, direct=True)
    session.say(f"flight {row.label} beside {other.label} of {row.vehicle}")
    if document["key"] is None:
        session.say(f"no comparison: {document['reason']}")
    else:
        _say_comparison(session, document)
        say_suspicions(session, document["suspicions"])
    session.answer({**document, "version": other.id, "label": other.label})
    if document["key"] is None:
        raise typer.Exit(3)


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
    file_of = catalogue.log_names(row.log_sha256 for row in rows)
    session.table(
        ["flight", "id", "vehicle", "start", "duration [s]", "verdict", ""],
        [
            [
                r.name or Path(file_of.get(r.log_sha256, "")).name,
                r.id[:12],
                r.vehicle,
                _when(r),
                f"{r.duration:.1f}",
                r.verdict,
                _standing(document),
            ]
            for r, document in zip(rows, documents, strict=True)
        ],
        numbers=(4,),
    )
    session.answer(documents)


def _standing(document: dict[str, Any]) -> str:
    """Return why a flight does not count: it was retracted, or it repeats another; else empty."""
    return "retracted" if document["retracted"] else "" if document["counts"] else "repeats another"


@app.command()
def show(
    context: typer.Context,
    flight: str,
    vehicle: OfFlight = None,
) -> None:
    """Show a flight: its log, its findings, its results, and the versions based on it.

    Example: aerodb flight show 1a2b3c
    """
    from aerodb.tasks.view import flight_details
    from aerodb.tasks.workspace_access import WorkspaceAccess

    session: Session = context.obj
    catalogue = session.catalogue()
    row = catalogue.flight(flight, vehicle)
    log, impact = catalogue.log(row.log_sha256), catalogue.impact(row.id)
    document = flight_details(WorkspaceAccess(session.workspace(), catalogue), row)
    session.say(
        f"flight {row.label} of {row.vehicle}: {_when(row)}, {row.duration:.1f} s at"
        f" {1 / row.step:.4g} Hz, mapping {row.mapping}"
    )
    session.say(
        f"log {visible(log.name) if log else '?'} ({row.log_sha256[:12]}),"
        f" {log.status if log else 'unknown'}"
    )
    say_damage(session, log.damage if log else (), "  damage")
    say_repeats(session, document["repeats"])
    say_suspicions(session, document["suspicions"])
    say_segments(session, document["segments"])
    say_delays(session, document["delays"])
    if document["consistency"] is not None:
        say_consistency(session, document["consistency"])
    results = [
        [r["step"], r["key"][:12], r["created_utc"][:16].replace("T", " ")]
        for r in document["results"]
    ]
    session.table(["step", "key", "made"], results)
    for use in impact:
        session.say(f"{use.version.label} is based on it: {use.role.replace('_', ' ')}")
    session.answer(document)


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
    session.say(f"flight {row.label} retracted: {row.retract_reason}")
    session.say(f"stale now: {', '.join(use.version.label for use in stale) or 'no version'}")
    if again:
        session.say("to rebuild them, in this order (NEW-v0002 is the version rebuilt from v0002):")
    for entry in again:
        session.say(f"  {entry['command'] or entry['label'] + ' was not made by an update'}")
    names = {
        name: id
        for name, id in catalogue.names(row.vehicle).items()
        if id in {use.version.id for use in stale}
    }
    for name in names:
        session.say(f"'{name}' points at a stale version")
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
