"""``aerodb log``: what a log contains, and what it can be used for."""

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.findings import say_damage, say_segments, say_suspicions
from aerodb.flows.cli.groups import Commands
from aerodb.flows.cli.output import Session, visible
from aerodb.flows.cli.references import MappingFile

if TYPE_CHECKING:
    from aerodb.logs import TopicSummary
    from aerodb.recording import Recording
    from aerodb.tasks.workers import Parsed

app = typer.Typer(name="log", cls=Commands, no_args_is_help=True, help="Raw logs.")


@app.command()
def inspect(
    context: typer.Context,
    log: Annotated[Path, typer.Argument(help="ULog, MCAP, MAT, CSV, ASCII or Parquet.")],
    mapping: MappingFile = None,
) -> None:
    """Show contents, damage, mapped and missing channels and likely faults of a log; stores
    nothing.

    Example: aerodb log inspect flight.ulg
    """
    # Imported here, and below, because a query must not wait for the science to import.
    from aerodb.storage.workspace_settings import load_settings
    from aerodb.tasks.workers import parsed_log, start_workers

    session: Session = context.obj
    if not log.is_file():
        raise InputError("no such file", str(log), "check the path")
    start_workers([log.suffix.lower()])
    limits = load_settings(session.root).limits
    with (
        tempfile.TemporaryDirectory() as folder,
        parsed_log(log, Path(folder) / "topics", limits) as parsed,
    ):
        _look_into(session, parsed, mapping)


def _look_into(session: Session, parsed: "Parsed", mapping: str | None) -> None:
    from aerodb.logs import (
        airspeed_remedy,
        channels_found,
        choose_mapping,
        consequence_of_zeros,
        consequences_of_missing,
        empty_channels,
        read_autopilot,
        wingless_sentence,
        with_mapped_clock,
        zero_channels,
    )
    from aerodb.storage.mappings import builtin_mappings, load_mapping
    from aerodb.tasks.steps import look_over

    recording, chosen, refusal = parsed.recording, None, ""
    try:
        chosen = (
            load_mapping(mapping)
            if mapping
            else choose_mapping(recording, builtin_mappings().values())
        )
        recording = with_mapped_clock(recording, chosen)
    except InputError as error:
        refusal = str(error)
    document = _contents(session, recording)
    if chosen is None:
        session.say(f"mapping: {refusal}")
        session.answer(
            {
                **document,
                "mapping": None,
                "channels": [],
                "missing": [],
                "zero": [],
                "empty": [],
                "prevents": [refusal],
            }
        )
        return
    present, missing = channels_found(recording, chosen)
    zero, empty = zero_channels(recording, chosen), empty_channels(recording, chosen)
    autopilot = read_autopilot(recording)
    wingless = [] if autopilot.has_wing else [wingless_sentence(autopilot.kind)]
    sentences = [
        *wingless,
        *consequences_of_missing(missing),
        *airspeed_remedy(missing),
        *consequence_of_zeros(zero, chosen.zero_is_missing),
        *(f"{name} is mapped to a field without any number: it is not used" for name in empty),
    ]
    session.say(f"mapping {chosen.name}: {', '.join(present)}")
    session.say(f"not in the log: {', '.join(missing) or 'none of the mapped channels'}")
    for sentence in sentences:
        session.say(f"  {sentence}")
    findings = look_over(parsed.folder, recording.source, chosen, str(session.root))
    if findings["refused"]:
        session.say(f"no flight: {findings['refused']}")
    say_segments(session, findings["segments"])
    say_suspicions(session, findings["suspicions"])
    summary = {
        "channels": present,
        "airframe": autopilot.kind or None,
        "missing": missing,
        "zero": list(zero),
        "empty": list(empty),
        "prevents": sentences,
        **findings,
    }
    session.answer({**document, "mapping": chosen.name, **summary})


def _contents(session: Session, recording: "Recording") -> dict[str, Any]:
    """Print the topics and the damage of a recording, and return them as a document."""
    from aerodb.logs import describe
    from aerodb.tasks.view import damage_document

    summary = describe(recording)
    session.say(
        f"{visible(recording.source)}: {recording.format}, {recording.size / 1e6:.1f} MB, sha256"
        f" {recording.sha256[:12]}"
    )
    session.table(
        ["topic", "rate [Hz]", "samples", "from [s]", "to [s]", "gaps", "longest [s]", "fields"],
        [
            [
                t.name,
                f"{t.rate:.4g}",
                str(t.samples),
                f"{t.start:.2f}",
                f"{t.end:.2f}",
                *_gaps(t),
                str(len(t.fields)),
            ]
            for t in summary.topics
        ],
        numbers=(1, 2, 3, 4, 5, 6, 7),
    )
    say_damage(session, recording.damage, "damage")
    topics = [
        {
            "topic": topic.name,
            "rate": topic.rate,
            "samples": topic.samples,
            "start": topic.start,
            "end": topic.end,
            "gaps": len(topic.gaps),
            "longest_gap": topic.longest_gap,
            "fields": list(topic.fields),
        }
        for topic in summary.topics
    ]
    return {
        "source": recording.source,
        "format": recording.format,
        "sha256": recording.sha256,
        "size": recording.size,
        "start_utc": recording.start_utc.isoformat() if recording.start_utc else None,
        "topics": topics,
        "damage": [damage_document(entry) for entry in recording.damage],
    }


def _gaps(topic: "TopicSummary") -> tuple[str, str]:
    return str(len(topic.gaps)), f"{topic.longest_gap:.3g}"
