"""``aerodb web``: serve the console until stopped."""

from typing import Annotated

import typer

from aerodb.errors import StoreError
from aerodb.flows.cli.output import Session


def web(
    context: typer.Context,
    host: Annotated[
        str,
        typer.Option(
            help="Address to listen on; if others can reach it, $AERODB_TOKEN or a user is required"
            " (aerodb user add)."
        ),
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port to listen on; 0 takes a free one.")
    ] = 8050,
    known_as: Annotated[
        list[str] | None,
        typer.Option(help="Additional host name that the console accepts."),
    ] = None,
) -> None:
    """Serve the console until stopped: flights, versions, lineage, findings and status, with a JSON
    API.

    Example: aerodb web --port 8050
    """
    from aerodb.flows.web.guard import guard_of
    from aerodb.flows.web.server import listening, serve_console

    session: Session = context.obj
    root = session.workspace().root
    has_users = bool(session.catalogue().users())
    guard = guard_of(host, port, known_as or (), has_users=has_users)
    try:
        with listening(host, port) as socket:
            shown = f"[{host}]" if ":" in host else host
            session.say(
                f"the console of {root} is at http://{shown}:{socket.getsockname()[1]}/; stop it"
                " with Ctrl-C"
            )
            if guard.is_made:
                session.say(
                    "enter any user name and, as password, this token; it ends with the console:"
                )
                session.say(guard.token)
                session.say("for tokens that last: aerodb user add NAME --role release")
            serve_console(root, guard, socket)
    except OSError as error:
        if isinstance(error, StoreError):
            raise
        what, where = (
            f"cannot listen there: {error.strerror or error}",
            f"aerodb web --host {host} --port {port}",
        )
        raise StoreError(what, where, "choose another port: --port 0 takes a free one") from error
