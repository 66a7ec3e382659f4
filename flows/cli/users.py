"""``aerodb user``: who may read, ingest and release, in the console and on the command line."""

from typing import Annotated

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.groups import Commands
from aerodb.flows.cli.output import Session

app = typer.Typer(
    name="user",
    cls=Commands,
    no_args_is_help=True,
    help="Users of the workspace, their roles and tokens.",
)
Role = Annotated[str, typer.Option(help="read, ingest (and read) or release (and both).")]


@app.command()
def add(context: typer.Context, name: str, role: Role) -> None:
    """Add a user, or change a role; shows a token that is stored as a hash only. A user who has the
    role already keeps the token.

    Example: aerodb user add anna --role release
    """
    session: Session = context.obj
    known = {row.name: row.role for row in session.catalogue().users()}
    if known.get(name) == role:
        raise InputError(
            f"the user has the role {role} already, and a token",
            f"user {name}",
            f"aerodb user token {name} gives a new one; the one before then no longer counts",
        )
    _give_token(session, name, role)
    if name in known:
        session.say("the token before no longer counts")


@app.command()
def token(context: typer.Context, name: str) -> None:
    """Give a user a new token; the one before no longer counts.

    Example: aerodb user token anna
    """
    session: Session = context.obj
    _give_token(session, name, session.catalogue().user(name).role)


@app.command("list")
def list_users(context: typer.Context) -> None:
    """List the users and their roles.

    Example: aerodb user list
    """
    session: Session = context.obj
    rows = session.catalogue().users()
    if not rows:
        session.headlines(
            "no users: whoever has an account on this machine may do everything",
            [("console", "its token, which `aerodb web` prints, may do everything too")],
            "aerodb user add NAME --role release",
        )
        session.answer([])
        return
    session.table(
        ("user", "role", "since", "added by"),
        [(row.name, row.role, f"{row.since_utc:%Y-%m-%d %H:%M}", row.by) for row in rows],
    )
    session.answer(
        [
            {
                "user": row.name,
                "role": row.role,
                "since_utc": row.since_utc.isoformat(),
                "by": row.by,
            }
            for row in rows
        ]
    )


@app.command()
def remove(context: typer.Context, name: str) -> None:
    """Remove a user; the token no longer counts.

    Example: aerodb user remove anna
    """
    from aerodb.tasks.actors import require_role, user

    session: Session = context.obj
    catalogue = session.catalogue()
    require_role(session.workspace(), catalogue, "release", "removing users")
    catalogue.remove_user(name, by=user())
    session.say(f"user {name} was removed")
    session.answer({"user": name, "removed": True})


def _give_token(session: Session, name: str, role: str) -> None:
    from aerodb.tasks.actors import hash_of_token, new_token, require_role, user

    catalogue = session.catalogue()
    require_role(session.workspace(), catalogue, "release", "managing users")
    text = new_token()
    row = catalogue.add_user(name, role, hash_of_token(text), by=user())  # type: ignore[arg-type]
    session.say(f"user {row.name} has the role {row.role}; the token, shown only now:")
    session.say(text)
    session.say("in a browser it is the password; for programs: Authorization: Bearer TOKEN")
    session.answer({"user": row.name, "role": row.role, "token": text})
