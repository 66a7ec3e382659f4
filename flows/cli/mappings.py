"""``aerodb mapping``: which field of a log is which channel."""

import re
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.groups import Commands
from aerodb.flows.cli.output import Session

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
    from aerodb.logs import choose_mapping, draft_mapping
    from aerodb.storage.mappings import builtin_mappings
    from aerodb.storage.workspace_settings import load_settings
    from aerodb.tasks.workers import parsed_log

    session: Session = context.obj
    if not log.is_file():
        raise InputError("no such file", str(log), "check the path")
    path = output or Path(f"{log.stem}.mapping.toml")
    if path.exists():
        raise InputError("the file exists already", str(path), "move it away, or use --output")
    name = re.sub(r"[^a-z0-9_-]", "-", log.stem.lower())[:60].lstrip("-_") or "log"
    limits = load_settings(session.root).limits
    with (
        tempfile.TemporaryDirectory() as folder,
        parsed_log(log, Path(folder) / "topics", limits) as parsed,
    ):
        recording = parsed.recording
        try:
            known = choose_mapping(recording, builtin_mappings().values())
        except InputError:  # none fits, or several do
            known = None
        draft = draft_mapping(recording, name, known)
    path.write_text(draft.text, encoding="utf-8")
    rows = [
        [g.channel, f"{g.topic}.{g.field}", g.unit, f"{g.scale:g}", g.confidence, g.reason]
        for g in draft.guesses
    ]
    if draft.clock is not None:
        clock = draft.clock
        place = f"{clock.topic}.{clock.field}"
        rows.insert(0, ["time", place, clock.unit, "1", clock.confidence, clock.reason])
    session.table(["channel", "field", "unit", "scale", "sure", "why"], rows)
    if not rows:
        session.say("no field has the name of a channel: the file lists all of them")
    skipped, remarks = (recording.metadata.get(key, "") for key in ("skipped", "remarks"))
    for note in [
        *draft.notes,
        *([f"not read: {skipped} (no numbers)"] if skipped else []),
        *([str(remarks)] if remarks else []),
    ]:
        session.say(f"note: {note}")
    for question in draft.questions:
        session.say(f"question: {question}")
    session.say(f"wrote {path}; check it, then: aerodb log inspect {log} --mapping {path}")
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
