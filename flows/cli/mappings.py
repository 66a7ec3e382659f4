"""``aerodb mapping``: which field of a log is which channel."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.groups import Commands
from aerodb.flows.cli.output import Session
from aerodb.support import counted

app = typer.Typer(
    name="mapping", cls=Commands, no_args_is_help=True, help="Which field of a log is what."
)


@app.command()
def init(
    context: typer.Context,
    log: Annotated[Path, typer.Argument(help="CSV, MAT, Parquet, ASCII, MCAP or ULog.")],
    output: Annotated[
        Path | None, typer.Option(help="The file to write.", show_default="<log>.mapping.toml")
    ] = None,
) -> None:
    """Write a commented mapping with guesses and open questions for a log of any format.

    Example: aerodb mapping init flight.csv
    """
    from aerodb.tasks.view import drafted_mapping

    session: Session = context.obj
    if not log.is_file():
        raise InputError("no such file", str(log), "check the path")
    path = output or Path(f"{log.stem}.mapping.toml")
    if path.exists():
        raise InputError("the file exists already", str(path), "move it away, or use --output")
    with drafted_mapping(log, session.root) as (draft, recording):
        skipped, remarks = (recording.metadata.get(key, "") for key in ("skipped", "remarks"))
    path.write_text(draft.text, encoding="utf-8")
    rows = [
        [g.channel, f"{g.topic}.{g.field}", g.unit, f"{g.scale:g}", g.confidence, g.reason]
        for g in draft.guesses
    ]
    if draft.clock is not None:
        clock = draft.clock
        place = f"{clock.topic}.{clock.field}"
        rows.insert(0, ["time", place, clock.unit, "1", clock.confidence, clock.reason])
    open_points = len(draft.questions)
    found = f"{counted(len(rows), 'channel')} found"
    asked = f"; {counted(open_points, 'question')} to answer" if open_points else ""
    session.headlines(
        f"{log.name}: {found if rows else 'no field has the name of a channel'}{asked}",
        [
            ("first", session.fitting(draft.questions[0], 9) if open_points else ""),
            ("wrote", f"{path}, to be checked"),
        ],
        f"aerodb log inspect {shlex.quote(str(log))} --mapping {shlex.quote(str(path))}",
    )
    session.say()
    if rows:
        session.table(["channel", "field", "unit", "scale", "sure", "why"], rows)
    else:
        session.say("the file lists all fields")
    for note in [
        *draft.notes,
        *([f"not read: {skipped} (no numbers)"] if skipped else []),
        *([str(remarks)] if remarks else []),
    ]:
        session.say(f"note: {note}")
    for question in draft.questions:
        session.say(f"question: {question}")
    session.answer(
        {
            "file": str(path),
            "guesses": [
                {
                    "channel": g.channel,
                    "topic": g.topic,
                    "field": g.field,
                    "unit": g.unit,
                    "scale": g.scale,
                    "reason": g.reason,
                    "confidence": g.confidence,
                }
                for g in draft.guesses
            ],
            "questions": list(draft.questions),
            "notes": list(draft.notes),
            "clock": None
            if draft.clock is None
            else {
                "topic": draft.clock.topic,
                "field": draft.clock.field,
                "unit": draft.clock.unit,
                "reason": draft.clock.reason,
                "confidence": draft.clock.confidence,
            },
        }
    )
