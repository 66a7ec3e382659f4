"""``aerodb log``: what a log contains, and what it can be used for."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodb.flows.cli.findings import say_damage, say_segments, say_suspicions
from aerodb.flows.cli.groups import Commands
from aerodb.flows.cli.known_names import LOGS
from aerodb.flows.cli.output import Session, visible
from aerodb.flows.cli.references import MappingFile, Verbose

if TYPE_CHECKING:
    from aerodb.recording import Recording

#: Most logs that are named below the page.
_MOST_LINES = 2

app = typer.Typer(name="log", cls=Commands, no_args_is_help=True, help="Raw logs.")

Log = Annotated[Path, typer.Argument(help=f"{LOGS}.")]


@app.command()
def inspect(
    context: typer.Context,
    log: Log,
    mapping: MappingFile = None,
    verbose: Verbose = False,
) -> None:
    """Show whether a log can be used, and for what; stores nothing.

    Example: aerodb log inspect flight.ulg
    """
    # Imported here, and below, because a query must not wait for the science to import; the
    # process that reads the log starts in the meantime.
    from aerodb.tasks.workers import FINDINGS, start_workers

    start_workers([log.suffix.lower()], FINDINGS)
    from aerodb.tasks.view import inspected_log, inspection_lines, inspection_verdict

    session: Session = context.obj
    with inspected_log(log, session.root, mapping) as looked:
        document = looked.document
        verdict = f"{visible(log.name)}: {inspection_verdict(document)}"
        if document["mapping"] is None:
            why = "; ".join("\n".join(document["because"]).splitlines())
            short = "no mapping says which of its columns is what"
            then = f"aerodb mapping init {_quoted(log)}"
            more = [*_first_look(document), ("reason", why)]
            session.headlines(verdict, [("because", short)], then, more)
        else:
            session.headlines(
                verdict,
                [("because", "; ".join(document["because"]) if not document["usable"] else "")],
                _to_ingest(log, mapping)
                if document["usable"]
                else f"aerodb log show {_quoted(log)}",
                inspection_lines(document),
            )
        if verbose:
            _say_details(session, looked.recording, document)
        else:
            session.say(f"  topics, rates and segments: -v; plots: aerodb log show {_quoted(log)}")
        session.answer(document)


@app.command()
def show(
    context: typer.Context,
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="One log, or several.")],
    signal: Annotated[
        list[str] | None,
        typer.Option(
            help="A panel: a channel, TOPIC:FIELD or a formula's name; several with commas. "
            "Default: what the log offers."
        ),
    ] = None,
    formula: Annotated[
        list[str] | None,
        typer.Option(help='A signal of your own: "gamma [rad] = theta - alpha".'),
    ] = None,
    output: Annotated[
        Path | None, typer.Option(help="The page to write.", show_default="LOG-log.html")
    ] = None,
    mapping: MappingFile = None,
) -> None:
    """Plot logs on one page, without a vehicle: signals, track, parameters, messages.

    Example: aerodb log show flight.ulg --signal alpha,theta
    """
    from aerodb.tasks.workers import FINDINGS, start_workers

    start_workers([log.suffix.lower() for log in logs], FINDINGS)
    from aerodb.storage.workspace import Workspace, write_for_user
    from aerodb.tasks.view import inspection_lines, inspection_verdict, logs_page

    session: Session = context.obj
    target = output or Path(f"{logs[0].stem}-log.html")
    page = logs_page(logs, session.root, mapping, signal or (), formula or (), units=session.units)
    data = page.html.encode("utf-8", "replace")
    inside = Workspace.open(session.root, create=False) if session.root.is_dir() else None
    written = write_for_user(inside, target, data)
    lines = [
        (visible(log.name), session.fitting(inspection_verdict(document), len(log.name) + 6))
        for log, document in zip(logs, page.documents, strict=True)
    ]
    more = len(lines) - _MOST_LINES
    if more > 0:
        lines = [*lines[:_MOST_LINES], ("and", f"{more} more logs")]
    learnt = page.documents[0]
    if len(logs) == 1 and learnt["mapping"] is not None:
        said = dict(inspection_lines(learnt))
        lines.append(("manoeuvres", session.fitting(said["manoeuvres"], 16)))
    usable = all(document["usable"] for document in page.documents)
    session.headlines(
        f"{written} ({len(data) / 1e3:.0f} kB): {page.contents}",
        lines,
        _to_ingest(logs[0], mapping) if usable else f"aerodb log inspect {_quoted(logs[0])}",
    )
    session.answer(
        {
            "file": str(written),
            "size": len(data),
            "panels": [list(panel) for panel in page.panels],
            "logs": list(page.documents),
        }
    )


def _first_look(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return what a log without a mapping is: columns, rate where it has a time, what is not
    read."""
    largest = max(document["topics"], key=lambda topic: topic["samples"], default=None)
    lines = []
    if largest is not None:
        rate = "no time is known" if largest["rate"] is None else f"{largest['rate']:.4g} Hz"
        columns, names = f"{len(largest['fields'])} columns", ", ".join(largest["fields"][:8])
        lines.append(("table", f"{largest['samples']} samples of {columns}, {rate}: {names}"))
    for label, key in (("not read", "not_read"), ("read as", "read_as")):
        lines += [(label, "; ".join(document[key]))] if document[key] else []
    return lines


def _to_ingest(log: Path, mapping: str | None) -> str:
    named = f"--mapping {_quoted(mapping)} " if mapping else ""
    return f"aerodb flight ingest {_quoted(log)} {named}--vehicle NAME"


def _number(value: float | None, form: str) -> str:
    """Return a number; a dash for none."""
    return "-" if value is None else f"{value:{form}}"


def _quoted(name: str | Path) -> str:
    """Return the name of a file as a shell takes it."""
    return shlex.quote(visible(str(name)))


def _begins(start: str | None) -> str:
    """When a log begins, of its UTC in ISO form."""
    return f"begins {start[:19].replace('T', ' ')} UTC" if start else "start unknown"


def _say_details(
    session: Session,
    recording: "Recording",
    document: Mapping[str, Any],
) -> None:
    """Print topics and rates, damage, what absent channels prevent, segments and suspicions."""
    session.say()
    session.say(
        f"{visible(document['source'])}: {document['format']}, {document['size'] / 1e6:.1f} MB,"
        f" sha256 {document['sha256'][:12]}, {_begins(document['start_utc'])}"
    )
    session.table(
        ["topic", "rate [Hz]", "samples", "from [s]", "to [s]", "gaps", "longest [s]", "fields"],
        [
            [
                t["topic"],
                _number(t["rate"], ".4g"),
                str(t["samples"]),
                _number(t["start"], ".2f"),
                _number(t["end"], ".2f"),
                str(t["gaps"]),
                f"{t['longest_gap']:.3g}",
                str(len(t["fields"])),
            ]
            for t in document["topics"]
        ],
        numbers=(1, 2, 3, 4, 5, 6, 7),
        spare=(6,),
    )
    say_damage(session, recording.damage, "damage")
    if document["mapping"] is None:
        return
    session.say(f"mapping {document['mapping']}: {', '.join(document['channels'])}")
    missing = ", ".join(document["missing"]) or "none of the mapped channels"
    session.say(f"not in the log: {missing}")
    for sentence in (*(e["because"] for e in document["not_possible"]), *document["remarks"]):
        session.say(f"  {sentence}")
    if document["refused"]:
        session.say(f"no flight: {document['refused']}")
    say_segments(session, document["segments"])
    say_suspicions(session, document["suspicions"])
