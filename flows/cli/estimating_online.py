"""``aerodb estimate-online``: declared increments while the log is being written."""

from pathlib import Path
from typing import Annotated, Any

import typer

from aerodb.errors import InputError, nearest
from aerodb.flows.cli.output import Session, plus_minus
from aerodb.flows.cli.references import Vehicle
from aerodb.flows.cli.vehicles import read_text


def estimate_online(
    context: typer.Context,
    model: Annotated[Path, typer.Option(help="Model file (TOML): the declared increments.")],
    vehicle: Vehicle = None,
    log: Annotated[
        str, typer.Option(help="ULog as it arrives: a pipe or a growing file; - is standard input.")
    ] = "-",
    method: Annotated[
        str, typer.Option(help="recursive, normalised-recursive or fourier-regression.")
    ] = "recursive",
    baseline: Annotated[
        str, typer.Option(help="Version to build on; `none`: whole derivatives.")
    ] = "none",
    mapping: Annotated[
        str | None, typer.Option(help="Mapping by name or file; default: the one that fits.")
    ] = None,
    forgetting: Annotated[
        float, typer.Option(help="Weight of a sample relative to the next one, such as 0.999.")
    ] = 1.0,
    highest: Annotated[
        float | None, typer.Option(help="Highest frequency [Hz] of fourier-regression.")
    ] = None,
    since: Annotated[
        float | None, typer.Option("--from", help="Time [s] on the log's clock to begin at.")
    ] = None,
    every: Annotated[float, typer.Option(help="Time [s] of the log between printed lines.")] = 5.0,
    idle: Annotated[
        float, typer.Option(help="Time [s] without growth after which a file is complete.")
    ] = 5.0,
) -> None:
    """Estimate declared increments while the log arrives, and print them as they converge. Nothing
    is stored.

    Example: aerodb estimate-online --vehicle my-glider --model increments.toml --log fifo
    """
    from aerodb.identification import ONLINE_METHODS, OnlineSettings
    from aerodb.increments import parse_model_file
    from aerodb.tasks.references import vehicle_of
    from aerodb.tasks.view import online_estimates

    session: Session = context.obj
    catalogue = session.catalogue()
    name = vehicle_of(catalogue, vehicle)
    text = read_text(model)
    parse_model_file(text, str(model))
    chosen = next((known for known in ONLINE_METHODS if known == method), None)
    if chosen is None:
        raise InputError(
            f"no method '{method}' runs on line", remedy=nearest(method, ONLINE_METHODS)
        )
    documents = online_estimates(
        log,
        workspace=str(session.root),
        vehicle=name,
        model=text,
        version=None if baseline == "none" else catalogue.version(name, baseline).id,
        mapping=mapping,
        settings=OnlineSettings(
            chosen, forgetting, highest, float("-inf") if since is None else since
        ),
        every=every,
        idle=idle,
    )
    document: dict[str, Any] | None = None
    try:
        for document in documents:
            _say_line(session, document)
    except KeyboardInterrupt:
        session.say("stopped")
    if document is not None:
        _say_table(session, document)
        session.answer(document)


def _say_line(session: Session, document: dict[str, Any]) -> None:
    told = [
        f"{row['parameter']} {plus_minus(row['value'], row['standard_error'])}"
        if row["value"] is not None
        else f"{row['parameter']} {row['standing']}"
        for row in document["parameters"]
    ]
    session.say(f"{document['time']:.1f} s: {', '.join(told)}")


def _say_table(session: Session, document: dict[str, Any]) -> None:
    session.say()
    session.table(
        ["parameter", "estimate", "standard error", "standing", ""],
        [
            [
                row["parameter"],
                "-" if row["value"] is None else f"{row['value']:.6g}",
                "-" if row["standard_error"] is None else f"{row['standard_error']:.2g}",
                row["standing"],
                row["reason"],
            ]
            for row in document["parameters"]
        ],
        (1, 2),
    )
    session.say(f"{document['method']}, {document['samples']} samples")
    for note in document["notes"]:
        session.say(f"- {note}")
    if document["lost"]:
        session.say(f"- {document['lost']} bytes of the log belong to no record")
