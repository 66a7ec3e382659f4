"""``aerodb version``: list, show and evaluate versions; answers without the orchestrator."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodb.flows.cli.groups import Commands
from aerodb.flows.cli.output import Session
from aerodb.flows.cli.references import AsOf, Vehicle

if TYPE_CHECKING:
    from aerodb.tables import AeroDatabase

app = typer.Typer(
    name="version",
    cls=Commands,
    no_args_is_help=True,
    help="Database versions: list, evaluate, compare, release.",
)

Limit = Annotated[int, typer.Option(min=1, help="Number of entries, newest last.")]
OneName = Annotated[str | None, typer.Option("--name", help="Moves of this name only.")]
All = Annotated[bool, typer.Option("--all", help="All entries.")]


@app.command("list")
def list_versions(
    context: typer.Context, vehicle: Vehicle = None, limit: Limit = 50, everything: All = False
) -> None:
    """List versions, oldest first: the newest 50, more with --limit or --all.

    Example: aerodb version list --vehicle my-glider
    """
    from aerodb.tasks.references import vehicle_of
    from aerodb.tasks.view import versions_document

    session: Session = context.obj
    catalogue = session.catalogue()
    owner = vehicle_of(catalogue, vehicle)
    rows = catalogue.versions(owner, None if everything else limit)
    documents = versions_document(catalogue, owner, rows)
    parents = catalogue.versions_by_id(
        {row.parent for row in rows if row.parent} - {row.id for row in rows}
    )
    labels = {row.id: row.label for row in (*rows, *parents.values())}
    session.table(
        ["version", "id", "parent", "made", "names"],
        [
            [
                r.label,
                r.id[:12],
                labels.get(r.parent or "", ""),
                f"{r.created_utc:%Y-%m-%d %H:%M}",
                ", ".join(document["names"]),
            ]
            for r, document in zip(rows, documents, strict=True)
        ],
    )
    earlier = catalogue.count_versions(owner) - len(rows)
    if earlier:
        session.say(f"{earlier} earlier entries: --limit N or --all")
    session.answer(documents)


@app.command()
def show(
    context: typer.Context,
    version: str,
    vehicle: Vehicle = None,
    as_of: AsOf = None,
    consolidated: Annotated[
        bool, typer.Option("--consolidated", help="With increments folded into tables.")
    ] = False,
) -> None:
    """Show a version: terms, tables, increments, and the report it was made with.

    Example: aerodb version show released --consolidated
    """
    import numpy as np

    from aerodb.tasks.references import version_of
    from aerodb.tasks.view import database_of, version_details

    session: Session = context.obj
    catalogue = session.catalogue()
    row = version_of(catalogue, version, vehicle, as_of)
    database = database_of(catalogue, row)
    document = version_details(catalogue, row)
    session.say(
        f"{row.label} ({row.id[:12]}) of {row.vehicle}, made {row.created_utc:%Y-%m-%d %H:%M} UTC:"
        f" {database.name}"
    )
    session.say(
        f"{len(database.terms)} terms, {len(database.tables)} tables, {len(database.increments)}"
        " increments from flights"
    )
    for reason in document["stale"]:
        session.say(f"stale: {reason}")
    if checks := document["report"].get("file_checks"):
        session.say(("" if checks["passed"] else "WARNING: ") + checks["sentence"])
    database, folds = _consolidated(session, database) if consolidated else (database, {})
    session.table(
        ["axis", "term", "expression"],
        [[t.axis, t.name, str(t.expression)] for t in database.terms],
    )
    for increment in database.increments:
        session.say(f"increment on {increment.axis}, from {len(increment.flights)} flights:")
        errors = np.sqrt(np.diag(increment.covariance))
        rows = zip(increment.regressors, increment.estimates, errors, strict=True)
        session.table(
            ["regressor", "value", "standard error"],
            [[str(r), f"{v:.5g}", f"{e:.2g}"] for r, v, e in rows],
            (1, 2),
        )
    session.answer({**document, **folds})


@app.command()
def history(
    context: typer.Context,
    vehicle: Vehicle = None,
    limit: Limit = 50,
    everything: All = False,
    name: OneName = None,
) -> None:
    """Show the moves of names: when, what, by whom, why. The newest 50; more with --limit or --all.

    Example: aerodb version history --name released
    """
    from aerodb.tasks.references import vehicle_of
    from aerodb.tasks.view import history_document

    session: Session = context.obj
    catalogue = session.catalogue()
    owner = vehicle_of(catalogue, vehicle)
    events = catalogue.name_history(owner, name, None if everything else limit)
    versions = catalogue.versions_by_id(
        {id for e in events for id in (e.version, e.previous) if id}
    )
    labels = {id: row.label for id, row in versions.items()}
    session.table(
        ["when", "name", "to", "from", "by", "why"],
        [
            [
                f"{e.at_utc:%Y-%m-%d %H:%M}",
                e.name,
                labels[e.version],
                labels.get(e.previous or "", ""),
                e.user,
                e.reason,
            ]
            for e in events
        ],
    )
    session.answer(history_document(events))


@app.command()
def evaluate(
    context: typer.Context,
    version: str,
    at: Annotated[
        str, typer.Option(help="Point: NAME=VALUE,... with units or in SI; the rest are 0.")
    ],
    vehicle: Vehicle = None,
    as_of: AsOf = None,
) -> None:
    """Evaluate a version at a point: value, standard error if known, and coverage by flights and
    tables.

    Example: aerodb version evaluate released --at alpha=5deg,V=70,mach=0.2
    """
    from aerodb.tasks.references import version_of
    from aerodb.tasks.view import evaluate_at

    session: Session = context.obj
    catalogue = session.catalogue()
    row = version_of(catalogue, version, vehicle, as_of)
    document = evaluate_at(catalogue, row, at)
    errors = document["standard_errors"]
    shown = {
        axis: "not known" if error is None else f"{error:.2g}" for axis, error in errors.items()
    }
    rows = [
        [axis, f"{value:.6g}", shown[axis], document["places"][axis]]
        for axis, value in document["coefficients"].items()
    ]
    head = ["axis", f"{row.label} at {at}", "standard error", "place"]
    if document["extrapolated"] is not None:
        head.append("slopes extrapolated")
        rows = [[*each, f"{document['extrapolated'][each[0]]:.6g}"] for each in rows]
    session.table(head, rows, numbers=(1, 2, 4))
    if document["outside_envelope"]:
        session.say(
            f"outside the flown envelope: {', '.join(document['outside_envelope'])}. The version"
            " holds and fades what flights added; slopes extrapolated are beside it for comparison"
        )
    if document["taken_as_zero"]:
        session.say(f"taken as zero: {', '.join(document['taken_as_zero'])}")
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
