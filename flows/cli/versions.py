"""``aerodb version``: list, show and evaluate versions; answers without the orchestrator."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodb.flows.cli.groups import Commands
from aerodb.flows.cli.output import Session
from aerodb.flows.cli.references import AsOf, Vehicle, Verbose
from aerodb.nomenclature import channel
from aerodb.support import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aerodb.storage.catalogue import Catalogue, NameEvent, NoteKind, NoteRow
    from aerodb.tables import AeroDatabase, Term

app = typer.Typer(
    name="version",
    cls=Commands,
    no_args_is_help=True,
    help="Database versions: list, evaluate, compare, release.",
)

#: Terms that are listed without -v: what a screen shows below the headline.
_LISTED = 12

Limit = Annotated[int, typer.Option(min=1, help="Number of entries, newest last.")]
OneName = Annotated[str | None, typer.Option("--name", help="Moves of this name only.")]
All = Annotated[bool, typer.Option("--all", help="All entries.")]


@app.command("list")
def list_versions(
    context: typer.Context,
    vehicle: Vehicle = None,
    limit: Limit = 50,
    everything: All = False,
    search: Annotated[
        str | None,
        typer.Option(
            help="Only versions with these words: names, tags, comments, findings, dates."
        ),
    ] = None,
) -> None:
    """List versions, oldest first: the newest 50, more with --limit or --all.

    Example: aerodb version list --vehicle my-glider --search "flight-tested"
    """
    from aerodb.tasks.references import vehicle_of
    from aerodb.tasks.view import (
        findings_words,
        flights_words,
        held_out_words,
        matching,
        versions_document,
        waiting,
    )

    session: Session = context.obj
    catalogue = session.catalogue()
    owner = vehicle_of(catalogue, vehicle)
    rows = catalogue.versions(owner, None if everything or search else limit)
    documents = versions_document(catalogue, owner, rows)
    if search:
        documents = matching(documents, search)[None if everything else -limit :]
    shown = {document["version"] for document in documents}
    parents = catalogue.versions_by_id(
        {row.parent for row in rows if row.parent and row.id in shown} - {row.id for row in rows}
    )
    labels = {row.id: row.label for row in (*rows, *parents.values())}
    candidate = next(iter(waiting(catalogue, owner)), None)
    if candidate is not None:
        said = f"{candidate.label} waits for your decision"
        then = f"aerodb version gate {candidate.label} --vehicle {owner}"
    elif documents:
        said = "nothing waits for a decision"
        then = f"aerodb version show {documents[-1]['label']} --vehicle {owner}"
    else:
        said, then = "no version yet", f"aerodb database import FILE --vehicle {owner}"
    session.headlines(f"{owner}: {said}", (), then)
    session.say()
    session.table(
        [
            "version",
            "id",
            "parent",
            "made",
            "names",
            "held-out error",
            "flights",
            "findings",
            "notes",
        ],
        [
            [
                each["label"],
                each["version"][:12],
                labels.get(each["parent"] or "", ""),
                f"{each['created_utc'][:16].replace('T', ' ')}",
                ", ".join(each["names"]),
                held_out_words(each["held_out"]),
                flights_words(each["flights"]),
                findings_words(each),
                _notes_words(each),
            ]
            for each in documents
        ],
        spare=(2, 1, 8, 7),
    )
    if any(each["held_out"]["after"] is not None for each in documents):
        session.say("held-out error: rms before and after on flights that did not identify it")
    earlier = 0 if search else catalogue.count_versions(owner) - len(rows)
    if earlier:
        session.say(f"{earlier} earlier entries: --limit N or --all")
    session.answer(documents)


def _notes_words(document: dict[str, Any]) -> str:
    comments = document["comments"]
    last = comments[-1]["text"].splitlines()[0] if comments else ""
    last = last if len(last) <= 40 else f"{last[:39]}…"
    count = f" ({len(comments)} comments)" if len(comments) > 1 else ""
    return "; ".join(
        [*(f"#{tag}" for tag in document["tags"]), *([f"{last}{count}"] if last else [])]
    )


@app.command()
def tag(
    context: typer.Context,
    version: str,
    tags: Annotated[
        list[str], typer.Argument(metavar="TAG...", help="Tags, such as flight-tested.")
    ],
    remove: Annotated[bool, typer.Option("--remove", help="Take the tags away.")] = False,
    vehicle: Vehicle = None,
) -> None:
    """Tag a version, or take tags away; each is an event that stays in the history.

    Example: aerodb version tag v0003 flight-tested
    """
    _note(context, version, vehicle, [("untag" if remove else "tag", each) for each in tags])


@app.command()
def comment(
    context: typer.Context,
    version: str,
    text: Annotated[str, typer.Argument(help="What to note about it.")],
    vehicle: Vehicle = None,
) -> None:
    """Comment on a version; the comment stays in the history, with its author.

    Example: aerodb version comment v0003 "roll damping agrees with the tunnel"
    """
    _note(context, version, vehicle, [("comment", text)])


def _note(
    context: typer.Context,
    version: str,
    vehicle: str | None,
    notes: "list[tuple[NoteKind, str]]",
) -> None:
    from aerodb.tasks.references import version_of
    from aerodb.tasks.steps import note_version
    from aerodb.tasks.workspace_access import WorkspaceAccess

    session: Session = context.obj
    access = WorkspaceAccess(session.workspace(), session.catalogue())
    row = version_of(access.catalogue, version, vehicle)
    document: dict[str, Any] = {}
    for kind, text in notes:
        document = note_version(access, row, kind, text)
    session.say(
        f"{row.label} of {row.vehicle}: tags {', '.join(document['tags']) or 'none'};"
        f" {counted(len(document['comments']), 'comment')}"
    )
    session.answer(document)


@app.command()
def show(
    context: typer.Context,
    version: str,
    vehicle: Vehicle = None,
    as_of: AsOf = None,
    consolidated: Annotated[
        bool, typer.Option("--consolidated", help="With increments folded into tables.")
    ] = False,
    verbose: Verbose = False,
) -> None:
    """Show a version: terms, tables, increments, and the report it was made with. -v lists every
    term of a long database.

    Example: aerodb version show released --consolidated
    """
    from aerodb.report import beyond_words, increment_terms, parameter_row, version_lines
    from aerodb.tables import LOAD_AXES
    from aerodb.tasks.references import version_of
    from aerodb.tasks.view import database_of, version_details, waiting

    session: Session = context.obj
    catalogue = session.catalogue()
    row = version_of(catalogue, version, vehicle, as_of)
    database = database_of(catalogue, row)
    document = version_details(catalogue, row)
    names = [name for name, id in catalogue.names(row.vehicle).items() if id == row.id]
    waits = row.id in {each.id for each in waiting(catalogue, row.vehicle)}
    told = [
        (label, "; ".join(texts).replace("\u2212", "-"))
        for label, texts in version_lines(document["report"], row.label, session.units)
    ]
    session.headlines(
        f"{row.vehicle}: {row.label} {_standing(names, waits, document['stale'])}",
        told[:2],
        f"aerodb version {'gate' if waits else 'lineage'} {row.label} --vehicle {row.vehicle}",
        told[2:],
    )
    session.say()
    session.say(
        f"{database.name} ({row.id[:12]}), made {row.created_utc:%Y-%m-%d %H:%M} UTC:"
        f" {counted(len(database.terms), 'term')}, {counted(len(database.tables), 'table')},"
        f" {counted(len(database.increments), 'increment')} from flights"
    )
    for reason in document["stale"]:
        session.say(f"stale: {reason}")
    if document["tags"]:
        session.say(f"tags: {', '.join(document['tags'])}")
    for each in document["comments"]:
        session.say(f"{each['at_utc'][:10]} {each['user']}: {each['text']}")
    if checks := document["report"].get("file_checks"):
        session.say(("" if checks["passed"] else "WARNING: ") + checks["sentence"])
    database, folds = _consolidated(session, database) if consolidated else (database, {})
    made = {name: [t for t in database.terms if t.part == name] for name in database.parts}
    own = [term for term in database.terms if not term.part]
    if len(own) > _LISTED and not verbose:
        session.table(["axis", "terms", "depend on"], _by_axis(own), (1,))
        session.say("each term: -v")
    elif own or not database.parts:
        session.table(
            ["axis", "term", "expression"], [[t.axis, t.name, str(t.expression)] for t in own]
        )
    if database.parts:
        session.table(
            ["part", "kind", "loads", "description"],
            [
                [
                    name,
                    entry["kind"],
                    " ".join(a for a in LOAD_AXES if any(a == t.axis for t in made[name])),
                    str(entry.get("description", "")),
                ]
                for name, entry in database.parts.items()
            ],
        )
    if database.parameters:
        session.table(
            ["parameter", "value", "+-", "unit", "bounds", "flights"],
            [parameter_row(name, database.variables[name]) for name in database.parameters],
            (1, 2, 5),
        )
    rows = [
        [each.axis, name, f"{value:.5g}", f"{error:.2g}", unit, str(len(each.flights))]
        for each in database.increments
        for name, unit, value, error in increment_terms(each)
    ]
    if rows:
        session.say()
        columns = ["axis", "increment", "value", "standard error", "unit", "flights"]
        session.table(columns, rows, (2, 3, 5))
    for sentence in beyond_words(database.increments, units=session.units):
        session.say(sentence)
    session.answer({**document, **folds})


def _by_axis(terms: "Sequence[Term]") -> list[list[str]]:
    """Return axis, number of terms and what they depend on, a row per axis."""
    rows = []
    for axis in dict.fromkeys(term.axis for term in terms):
        of_axis = [term.expression for term in terms if term.axis == axis]
        names = dict.fromkeys(name for e in of_axis for name in sorted(e.names))
        rows.append([axis, str(len(of_axis)), " ".join(names)])
    return rows


def _standing(names: "Sequence[str]", waits: bool, stale: "Sequence[str]") -> str:
    """Return whether a version waits for a decision, is stale, or has names."""
    if stale:
        return "is stale: it should be made once more"
    if waits:
        return "waits for your decision"
    return f"is {' and '.join(sorted(names))}" if names else "has no name"


@app.command()
def history(
    context: typer.Context,
    vehicle: Vehicle = None,
    limit: Limit = 50,
    everything: All = False,
    name: OneName = None,
) -> None:
    """Show releases, rollbacks, tags and comments: when, what, by whom, why. The newest 50; more
    with --limit or --all.

    Example: aerodb version history --name released
    """
    from aerodb.tasks.references import vehicle_of
    from aerodb.tasks.view import history_document, waiting

    session: Session = context.obj
    catalogue = session.catalogue()
    owner = vehicle_of(catalogue, vehicle)
    events = catalogue.name_history(owner, name, None if everything else limit)
    document = history_document(events, [] if name else _notes_since(catalogue, owner, events))
    versions = catalogue.versions_by_id(
        {id for each in document for id in (each["to"], each["from"]) if id}
    )
    labels = {id: row.label for id, row in versions.items()}
    candidate = next(iter(waiting(catalogue, owner)), None)
    said, last = _released(document, labels), document[-1] if document else None
    session.headlines(
        f"{owner}: {said}",
        [
            (
                "last",
                f"{last['name'] or last['note']} {labels[last['to']]}, {last['at_utc'][:10]},"
                f" {last['user']}: {last['reason']}"
                if last
                else "",
            )
        ],
        f"aerodb version gate {candidate.label} --vehicle {owner}"
        if candidate is not None
        else f"aerodb version list --vehicle {owner}",
    )
    session.say()
    session.table(
        ["when", "name", "to", "from", "by", "why"],
        [
            [
                f"{each['at_utc'][:16].replace('T', ' ')}",
                each["name"] or f"({each['note']})",
                labels[each["to"]],
                labels.get(each["from"] or "", ""),
                each["user"],
                each["reason"],
            ]
            for each in document
        ],
    )
    session.answer(document)


def _released(events: "Sequence[dict[str, Any]]", labels: dict[str, str]) -> str:
    """Return where the names that moved point now, and since when; `events` oldest first."""
    moves = {each["name"]: each for each in events if each["name"]}
    said = [
        f"{name} is {labels[each['to']]}, since {each['at_utc'][:10]}"
        for name, each in sorted(moves.items(), reverse=True)
    ]
    return "; ".join(said) or "no name was given to a version yet"


def _notes_since(
    catalogue: "Catalogue", vehicle: str, events: "Sequence[NameEvent]"
) -> "list[NoteRow]":
    """Notes on a vehicle's versions that are not older than the first of these moves."""
    notes = catalogue.notes_of([row.id for row in catalogue.versions(vehicle)])
    first = events[0].at_utc if events else None
    return [
        note for each in notes.values() for note in each if first is None or note.at_utc >= first
    ]


@app.command()
def evaluate(
    context: typer.Context,
    version: str,
    at: Annotated[
        list[str],
        typer.Option(
            help="Point: NAME=VALUE,... with units or in SI; the rest are 0, in free air."
        ),
    ],
    vehicle: Vehicle = None,
    as_of: AsOf = None,
) -> None:
    """Evaluate a version at a point: value, standard error if known, and coverage by flights and
    tables.

    Example: aerodb version evaluate released --at alpha=5deg,V=70,mach=0.2
    """
    from aerodb.report import beyond_words
    from aerodb.tasks.references import version_of
    from aerodb.tasks.view import TAKEN, database_of, evaluate_at

    session: Session = context.obj
    catalogue = session.catalogue()
    row = version_of(catalogue, version, vehicle, as_of)
    point = ",".join(at)
    document = evaluate_at(catalogue, row, point)
    errors = document["standard_errors"]
    shown = {
        axis: "not known" if error is None else f"{error:.2g}" for axis, error in errors.items()
    }
    rows = [
        [axis, f"{value:.6g}", shown[axis], document["places"][axis]]
        for axis, value in document["coefficients"].items()
    ]
    outside = document["outside_envelope"]
    where: dict[str, list[str]] = {place: [] for place in document["places"].values()}
    for axis, place in document["places"].items():
        where[place].append(axis)
    coefficients = document["coefficients"].items()
    session.headlines(
        f"{row.vehicle}: {row.label} at {point}:"
        f" {', '.join(f'{axis} {value:.3g}' for axis, value in coefficients)}",
        [
            ("known", "; ".join(f"{place}: {' '.join(axes)}" for place, axes in where.items())),
            ("outside", f"what was flown: {', '.join(outside)}" if outside else ""),
        ],
        f"aerodb version lineage {row.label} --vehicle {row.vehicle} --at {point}",
    )
    session.say()
    head = ["axis", f"{row.label} at {point}", "standard error", "place"]
    if document["extrapolated"] is not None:
        head.append("slopes extrapolated")
        rows = [[*each, f"{document['extrapolated'][each[0]]:.6g}"] for each in rows]
    session.table(head, rows, numbers=(1, 2, 4))
    increments = database_of(catalogue, row).increments if outside else ()
    for sentence in beyond_words(increments, outside, session.units):
        session.say(sentence)
    if document["taken_as_zero"]:
        session.say(f"taken as zero: {', '.join(document['taken_as_zero'])}")
    for name, value in document["taken_as"].items():
        told = session.units.shown(value, channel(name).unit)
        session.say(f"{name.replace('_', ' ')} taken as {told}, {TAKEN[name]}")
    if document["outside_tables"]:
        session.say(f"outside tables: {', '.join(document['outside_of'])} (edge values held)")
    session.answer(document)


def _consolidated(
    session: Session, database: "AeroDatabase"
) -> tuple["AeroDatabase", dict[str, Any]]:
    """Return the database with increments folded into its tables, and print and document each
    fold."""
    from aerodb.exchange import to_document
    from aerodb.tables import consolidate, plan_consolidation

    folds = [
        {
            "increment": fold.increment,
            "axis": database.increments[fold.increment].axis,
            "regressor": str(database.increments[fold.increment].regressors[fold.regressor]),
            "table": fold.table or None,
            "reason": fold.reason,
        }
        for fold in plan_consolidation(database)
    ]
    rows = [
        [
            str(f["axis"]),
            str(f["regressor"]),
            str(f["table"] or f"not in a table: {f['reason']}"),
        ]
        for f in folds
    ]
    session.table(["axis", "regressor", "folded into"], rows)
    folded = consolidate(database)
    return folded, {"folds": folds, "consolidated": to_document(folded)}
