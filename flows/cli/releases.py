"""``aerodb version gate``, ``promote``, ``rollback`` and ``export``: release versions, and hand
them out."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from aerodb.flows.cli.output import Session
from aerodb.flows.cli.references import AsOf, Vehicle, Verbose
from aerodb.flows.cli.updates import say_derivatives

Reason = Annotated[str, typer.Option(help="Reason; it is stored with the move.")]
Name = Annotated[
    str, typer.Option("--name", help="The name to move; only `released` requires the gate.")
]


Accept = Annotated[
    list[str] | None,
    typer.Option(
        help="What the gate refuses and a person accepts, such as Cm_delta_elevator; say in"
        " --reason why it is right. Repeat for several."
    ),
]
#: Check of the gate -> what makes a version that passes it: more flights, or (empty) the command
#: that made it once more.
_REMEDY: Final = {
    "parent": "",
    "not stale": "",
    "held-out error": "flight ingest LOG",
    "left-out error": "flight ingest LOG",
}
#: Columns left of what a headline says.
_MARGIN = 12


def gate(
    context: typer.Context,
    version: str,
    vehicle: Vehicle = None,
    accept: Accept = None,
    verbose: Verbose = False,
) -> None:
    """Ask the gate whether a version could be released now; nothing is moved. Exits with 1 if not.

    Example: aerodb version gate candidate
    """
    from aerodb.flows.release import gate_flow
    from aerodb.report import version_lines
    from aerodb.tasks.references import version_of

    session: Session = context.obj
    catalogue = session.catalogue()
    row = version_of(catalogue, version, vehicle)
    document = session.run(gate_flow, {"version": row.id, "accept": accept or []}, direct=True)
    report = catalogue.version_documents(row.id).report
    told = dict(version_lines(report, row.label, session.units))
    made = f"update --like {row.label}" if "library" not in report else "close-loop"
    _say_gate(session, document, told.get("proved", ()), made, verbose)
    session.answer(document)
    if not document["passed"]:
        raise typer.Exit(1)


def _say_gate(
    session: Session, document: dict[str, Any], proved: Sequence[str], made: str, verbose: bool
) -> None:
    """Print what the gate would say: verdict, changes, proof, checks with their numbers and
    limits.

    proved : the proof in words. made : the command that made the version.
    """
    from aerodb.report import count_passed, derivative_words, gate_rows, in_words

    now, rows = document["released"], gate_rows(document["checks"])
    told = derivative_words(document["derivatives"])
    changes = "; ".join(told) if verbose else _fitting(told, session.people.width - _MARGIN)
    open_points = [in_words(note) for note in document["notes"]]
    which = f"{document['vehicle']}: {document['label']}"
    if now is not None and now["version"] == document["version"]:
        session.headlines(
            f"{which} is released, since {now['since'][:10]} by {now['user']}",
            [("changes", changes)],
            f"aerodb version show {document['label']} --vehicle {document['vehicle']}",
        )
        return
    today = f"today {now['label']}, since {now['since'][:10]}" if now else "today none"
    also = len(open_points) - 1
    more = f" (and {also} more point{'s' * (also > 1)}: -v)" if also > 0 else ""
    session.headlines(
        f"{which} {'can be released' if document['passed'] else 'would be refused'} ({today})",
        [
            ("changes", changes),
            *(("proved", text) for text in proved),
            ("gate", count_passed(document["checks"])),
        ],
        _after_the_gate(document, made),
        [("open", _fitted(session, open_points, more))],
    )
    session.say()
    first = max(len(row.label) for row in rows)
    second = max(len(row.found) for row in rows)
    for row in rows:
        head = f"  {'pass' if row.passed else 'FAIL'}  {row.label:<{first}}  "
        session.say(f"{head}{row.found:<{second}}  {row.limit}".rstrip())
        shown = row.reasons if verbose else row.reasons[:1]
        for reason in shown:
            session.say(f"        {reason if verbose else session.fitting(reason, 8)}")
    for note in open_points if verbose else ():
        session.say(note)


def _fitted(session: Session, points: Sequence[str], more: str) -> str:
    """Return the first open point in a line, and how many more there are."""
    return session.fitting(points[0], _MARGIN + len(more)) + more if points else ""


def _fitting(changes: Sequence[str], room: int) -> str:
    """Return as many changes as fit a line of `room` characters, at least one, and how many more
    there are.

    >>> _fitting(["CX -16 %", "CZ +9 %", "Cm with q +3 %"], 30)
    'CX -16 %; CZ +9 %; 1 more: -v'
    >>> _fitting(["CX -16 %", "CZ +9 %", "Cm +3 %"], 10)
    'CX -16 %; 2 more: -v'
    """
    for count in range(len(changes), 0, -1):
        left = len(changes) - count
        line = "; ".join(changes[:count]) + (f"; {left} more: -v" if left else "")
        if count == 1 or len(line) <= room:
            return line
    return ""


def _after_the_gate(document: dict[str, Any], made: str) -> str:
    """Return the next command: to release it, to accept what a person may, or what mends the first
    check that fails and has a remedy, else to read all reasons. made : the command that made it."""
    vehicle = f"--vehicle {document['vehicle']}"
    version = f"{document['label']} {vehicle}"
    if document["acceptable"] is None:
        failed = [check["label"] for check in document["checks"] if not check["passed"]]
        remedies = [
            f"aerodb {_REMEDY[label] or made} {vehicle}" for label in failed if label in _REMEDY
        ]
        return remedies[0] if remedies else f"aerodb version gate {version} -v"
    names = dict.fromkeys((*document["accepted"], *document["acceptable"]))
    accept = "".join(f" --accept {name}" for name in names)
    return f'aerodb version promote {version}{accept} --reason "..."'


def promote(
    context: typer.Context,
    version: str,
    reason: Reason,
    name: Name = "released",
    vehicle: Vehicle = None,
    accept: Accept = None,
) -> None:
    """Point a name at a version; `released` moves only through the gate.

    Example: aerodb version promote candidate --reason "lift slope validated on two flights"
    """
    from aerodb.flows.release import promote_flow
    from aerodb.tasks.references import version_of

    session: Session = context.obj
    row = version_of(session.catalogue(), version, vehicle)
    document = session.run(
        promote_flow,
        {"version": row.id, "name": name, "reason": reason, "accept": accept or []},
        direct=True,
    )
    if document["moved"]:
        then = f"aerodb version export {row.label} --vehicle {row.vehicle} --format FORMAT"
        _say_move(session, document, f"{then} --output FILE")
        say_derivatives(session, document["derivatives"])
    else:
        session.say(f"{name} already points to {row.label}")
    session.answer(document)


def rollback(
    context: typer.Context, reason: Reason, name: Name = "released", vehicle: Vehicle = None
) -> None:
    """Undo the last move of a name by a new event; nothing is deleted.

    Example: aerodb version rollback --vehicle my-glider --reason "simulator diverges above 10 deg"
    """
    from aerodb.flows.release import roll_back_flow
    from aerodb.tasks.references import vehicle_of

    session: Session = context.obj
    parameters = {
        "vehicle": vehicle_of(session.catalogue(), vehicle),
        "name": name,
        "reason": reason,
    }
    document = session.run(roll_back_flow, parameters, direct=True)
    if document["moved"]:
        then = f"aerodb version history --vehicle {document['vehicle']}"
        _say_move(session, document, then)
    else:
        session.say(
            f"{name} was rolled back for this reason already; give another reason to go back"
            " further"
        )
    for why in document["stale"]:
        session.say(f"stale: {why}")
    session.answer(document)


def export(
    context: typer.Context,
    version: str,
    format: Annotated[
        str,
        typer.Option(
            help="daveml, jsbsim, propeller (of JSBSim, for rotors), gazebo, sitl, csv (one table;"
            " FILE.zip: many), mat or netcdf."
        ),
    ],
    output: Annotated[
        Path | None, typer.Option(help="The file to write; with --into, beside the aircraft.")
    ] = None,
    into: Annotated[
        Path | None,
        typer.Option(help="A JSBSim aircraft file: replace its aerodynamics, keep the rest."),
    ] = None,
    vehicle: Vehicle = None,
    as_of: AsOf = None,
) -> None:
    """Export a version to a simulator; the file is kept only if its check cases pass when read
    back.

    Example: aerodb version export released --format jsbsim --output my-glider.xml
    """
    from aerodb.tasks.references import version_of
    from aerodb.tasks.steps import export_version

    session: Session = context.obj
    workspace = session.workspace()
    catalogue = session.catalogue()
    row = version_of(catalogue, version, vehicle, as_of)
    document = export_version(workspace, catalogue, row, format, output, into)
    notes = _mass_and_merge(session, document) if format == "jsbsim" else []
    notes += [("note", note) for note in document["notes"]]
    largest = document["differences"]
    if largest and not document["notes"]:
        said = ", ".join(f"{axis} {value:.2g}" for axis, value in largest.items())
        notes.append(("lost", f"over -4 to 8 deg, sideslip to 3 deg, this form is off by {said}"))
    session.headlines(
        f"wrote {document['file']}: {row.label} of {row.vehicle} as {format}",
        [("proved", document["checked"]), *notes],
    )
    session.answer(document)


def _mass_and_merge(session: Session, document: dict[str, Any]) -> list[tuple[str, str]]:
    """What a JSBSim file holds beside the aerodynamics: labels and texts."""
    mass, into = document["mass"], document["into"]
    if into is None and mass is None:
        return [
            ("WARNING", "its mass is a placeholder: the vehicle's is logged, no flight is stored")
        ]
    if into is None:
        told = session.units.shown(mass["mass"], "kg")
        return [("mass", f"{told}, CG and inertia: {mass['source']}")]
    notes = [("kept", f"all but the aerodynamics is that of {into['file']}, mass and CG included")]
    if (into["moved"] or 0.0) > 1e-3:
        moved = session.units.shown(into["moved"], "m", 3)
        notes.append(
            (
                "WARNING",
                f"its moment reference AERORP moved by {moved}; its origin must be the datum of"
                " the vehicle file",
            )
        )
    if into["lost"]:
        notes.append(
            (
                "WARNING",
                f"other parts of it read {', '.join(into['lost'])}, which only the former"
                " aerodynamics defined",
            )
        )
    return notes


def _say_move(session: Session, document: dict[str, Any], then: str) -> None:
    event, checks = document["event"], document.get("checks")
    session.headlines(
        f"{document['name']} of {document['vehicle']} now points to {document['label']}"
        f" ({event['user']}: {event['reason']})",
        [("gate", f"all {len(checks)} checks pass" if checks else "")],
        then,
        [("open" if k == 0 else "", note) for k, note in enumerate(document.get("notes", ()))],
    )
