"""``aerodb store``: move files between the workspace's folder and its object store."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from aerodb.flows.cli.groups import Commands
from aerodb.flows.cli.output import Session

if TYPE_CHECKING:
    from aerodb.storage.files import TransferReport

app = typer.Typer(
    name="store",
    cls=Commands,
    no_args_is_help=True,
    help="The object store, and the folder that is its cache.",
)


@app.command()
def push(context: typer.Context) -> None:
    """Upload files that the object store lacks: after setting one up, or after objects were lost.

    Example: aerodb store push
    """
    # Imported here, and below, because a query must not wait for it.
    from aerodb.storage import files

    session: Session = context.obj
    workspace = session.workspace()
    with session.waiting("putting"), session.catalogue() as catalogue:
        moved = files.push(workspace, catalogue)
    _answer(
        session,
        moved,
        "put",
        "not uploaded: it is missing or damaged here (see aerodb verify)",
    )


@app.command()
def pull(context: typer.Context) -> None:
    """Download files that the folder lacks: before removing the object store from the settings.

    Example: aerodb store pull
    """
    from aerodb.storage import files

    session: Session = context.obj
    workspace = session.workspace()
    with session.waiting("fetching"), session.catalogue() as catalogue:
        moved = files.pull(workspace, catalogue)
    _answer(
        session,
        moved,
        "fetched",
        "not fetched: it is missing or damaged there (see aerodb verify --fetch)",
    )


@app.command()
def trim(
    context: typer.Context,
    size: Annotated[
        int | None,
        typer.Option(min=0, help="Bytes to keep; default: [store] cache of the settings."),
    ] = None,
) -> None:
    """Remove the least recently used files from the folder, if the object store has them.

    Example: aerodb store trim --size 50000000000
    """
    from aerodb.storage import files

    session: Session = context.obj
    workspace = session.workspace()
    with session.waiting("making room"), session.catalogue() as catalogue:
        moved = files.trim(workspace, catalogue, size)
    _answer(
        session,
        moved,
        "removed from the cache",
        "kept here: it is in use, or not in the object store",
    )


def _answer(session: Session, moved: "TransferReport", done: str, not_done: str) -> None:
    for path in moved.left:
        session.say(f"{path}: {not_done}")
    session.say(f"{moved.files} files {done}, {moved.bytes / 1e6:.1f} MB")
    session.answer(asdict(moved))
    if moved.left:
        raise typer.Exit(1)
