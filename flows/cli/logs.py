"""``aerodb log``: what a log contains, and what it can be used for."""

import math
import shlex
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.findings import say_damage, say_segments, say_suspicions
from aerodb.flows.cli.groups import Commands
from aerodb.flows.cli.output import Session, visible
from aerodb.flows.cli.references import MappingFile, Verbose
from aerodb.nomenclature import is_surface

if TYPE_CHECKING:
    from aerodb.logs import Mapping as LogMapping
    from aerodb.recording import Recording
    from aerodb.tasks.workers import Parsed

app = typer.Typer(name="log", cls=Commands, no_args_is_help=True, help="Raw logs.")

#: Topics of a PX4 log with what its servos are told.
_SERVOS: Final = ("actuator_servos", "actuator_outputs")
#: Largest number of suspicions, and of kinds of manoeuvres, that are printed without -v.
_FEW: Final = 2
_KINDS: Final = 6


@app.command()
def inspect(
    context: typer.Context,
    log: Annotated[Path, typer.Argument(help="ULog, MCAP, MAT, CSV, ASCII or Parquet.")],
    mapping: MappingFile = None,
    verbose: Verbose = False,
) -> None:
    """Show whether a log can be used, and for what; stores nothing.

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
        _look_into(session, parsed, mapping, verbose)


def _look_into(session: Session, parsed: "Parsed", mapping: str | None, verbose: bool) -> None:
    from aerodb.logs import choose_mapping, with_mapped_clock
    from aerodb.storage.mappings import builtin_mappings, load_mapping

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
    document = _contents(recording)
    if chosen is None:
        summary: dict[str, Any] = {
            "mapping": None,
            **{name: [] for name in ("channels", "missing", "zero", "empty")},
            "prevents": [refusal],
            "usable": False,
            "because": [refusal],
        }
        session.headlines(
            f"{visible(Path(recording.source).name)}: NOT USABLE",
            [("because", "; ".join(refusal.splitlines()))],
            f"aerodb mapping init {_quoted(recording.source)}",
        )
    else:
        summary = _channels(session, parsed, recording, chosen)
        _say_summary(session, document, summary, mapping)
    if verbose:
        _say_details(session, recording, document, summary)
    else:
        session.say("  topics, rates and segments: -v")
    session.answer({**document, **summary})


def _channels(
    session: Session, parsed: "Parsed", recording: "Recording", chosen: "LogMapping"
) -> dict[str, Any]:
    """Return what a mapping finds in a recording, what that allows, and whether it can be used."""
    from aerodb.logs import (
        airspeed_remedy,
        channels_found,
        consequence_of_zeros,
        consequences_of_missing,
        empty_channels,
        not_possible,
        read_autopilot,
        wingless_sentence,
        zero_channels,
    )
    from aerodb.tasks.steps import look_over

    present, missing = channels_found(recording, chosen)
    zero, empty = zero_channels(recording, chosen), empty_channels(recording, chosen)
    autopilot = read_autopilot(recording)
    wingless = [] if autopilot.has_wing else [wingless_sentence(autopilot.kind)]
    findings = look_over(parsed.folder, recording.source, chosen, str(session.root))
    expected = [name for name, each in findings["outlook"].items() if each["expected"]]
    outputs = [len(recording.topics[name].fields) for name in _SERVOS if name in recording.topics]
    servos = max(outputs, default=0)
    lacking = [
        name
        for name in (*missing, *empty, *(zero if chosen.zero_is_missing else ()))
        if name not in findings["computed"]
        and name not in expected
        and not (servos and is_surface(name))
    ]
    grounded = bool(findings["segments"]) and not _flown(findings["segments"])
    unusable = [
        *(wingless or ([findings["unusable"]] if findings["unusable"] else [])),
        *(["the aircraft was never airborne in it"] if grounded else []),
    ]
    remarks = [
        *consequence_of_zeros(zero, chosen.zero_is_missing),
        *(f"{name} is mapped to a field without any number: it is not used" for name in empty),
    ]
    return {
        "mapping": chosen.name,
        "channels": present,
        "airframe": autopilot.kind or None,
        "missing": missing,
        "zero": list(zero),
        "empty": list(empty),
        "prevents": [
            *wingless,
            *consequences_of_missing(missing),
            *airspeed_remedy(missing),
            *remarks,
        ],
        **findings,
        "not_possible": [
            {"what": short, "because": sentence} for short, sentence in not_possible(lacking)
        ],
        "remarks": remarks,
        "servo_outputs": servos,
        "usable": not unusable,
        "because": [*unusable, *([] if wingless else airspeed_remedy(missing))],
    }


def _say_summary(
    session: Session,
    document: Mapping[str, Any],
    summary: Mapping[str, Any],
    mapping: str | None,
) -> None:
    """Print whether a log can be used, what it measures, and what follows for a flight."""
    name, usable = visible(Path(document["source"]).name), summary["usable"]
    named = f"--mapping {_quoted(mapping)} " if mapping else ""
    surfaces = [name for name in summary["channels"] if is_surface(name)]
    unused = {*surfaces, *summary["zero"], *summary["empty"]}
    moved = [name for name in surfaces if name not in (*summary["zero"], *summary["empty"])]
    session.headlines(
        f"{name}: {'USABLE' if usable else 'NOT USABLE'} ({_kind(document, summary)})",
        [("because", "; ".join(summary["because"]) if not usable else "")],
        f"aerodb flight ingest {_quoted(document['source'])} {named}--vehicle NAME"
        if usable
        else "",
        [
            ("measured", " ".join(n for n in summary["channels"] if n not in unused)),
            ("computed", " ".join(summary["computed"])),
            ("reconstructed", "; ".join(_angles(summary["outlook"]))),
            ("not possible", "; ".join(dict.fromkeys(e["what"] for e in summary["not_possible"]))),
            ("all zero", " ".join(summary["zero"])),
            ("no number", " ".join(summary["empty"])),
            ("surfaces", _surfaces(moved, summary["servo_outputs"])),
            ("manoeuvres", _manoeuvres(summary["segments"])),
            ("suspicions", "; ".join(each["sentence"] for each in summary["suspicions"][:_FEW])),
            ("damage", _counted(Counter(e["kind"].replace("_", " ") for e in document["damage"]))),
        ],
    )


def _quoted(name: str) -> str:
    """Return the name of a file as a shell takes it."""
    return shlex.quote(visible(name))


def _kind(document: Mapping[str, Any], summary: Mapping[str, Any]) -> str:
    """Return format, aircraft, length, rate and whether it flew, in words."""
    words = [document["format"]]
    words += [summary["airframe"]] if summary["airframe"] else []
    if summary["rate"]:
        words += [f"{summary['duration']:.1f} s", f"{summary['rate']:.4g} Hz"]
        flown = _flown(summary["segments"])
        whole = flown >= 0.99 * summary["duration"]
        words.append(f"airborne {'throughout' if whole else f'{flown:.1f} s'}")
    return ", ".join(words)


def _angles(outlook: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return what reconstruction can give of the flow angles that no vane measures."""
    words = []
    for name, each in outlook.items():
        if each["lacking"]:
            words.append(f"not {name}: {', '.join(each['lacking'])} missing")
        elif "turn" in each:
            enough = "enough" if each["expected"] else "not enough"
            words.append(
                f"{name if each['expected'] else f'not {name}'} (no vane; the track turns by"
                f" {math.degrees(each['turn']):.0f} deg, {math.degrees(each['turn_needed']):.0f}"
                f" are needed: {enough})"
            )
        else:
            words.append(f"{name} (no vane)")
    return words


def _flown(segments: Sequence[Mapping[str, Any]]) -> float:
    """Return how long the aircraft was airborne [s]."""
    return math.fsum(s["end"] - s["start"] for s in segments if s["kind"] == "airborne")


def _surfaces(moved: Sequence[str], servos: int) -> str:
    words = [name.removeprefix("delta_").replace("_", " ") for name in moved]
    if servos:
        words.append(
            f"{servos} servo outputs (which is which: aerodb vehicle init NAME --from LOG)"
        )
    return ", ".join(words) or "none recorded"


def _manoeuvres(segments: Sequence[Mapping[str, Any]]) -> str:
    """Return how many manoeuvres of each kind were found."""
    from aerodb.conditioning import STATES

    return _counted(
        Counter(
            each["kind"].replace("_", " ")
            + each["channel"].replace("delta_", " of ", 1).replace("_", " ")
            for each in segments
            if each["kind"] not in STATES
        )
    )


def _counted(counts: Counter[str]) -> str:
    """Return what was counted, the most frequent first.

    >>> _counted(Counter(["pull up", "doublet of rudder", "pull up"]))
    'pull up (2), doublet of rudder'
    """
    words = [f"{name} ({n})" if n > 1 else name for name, n in counts.most_common(_KINDS)]
    words += [f"{len(counts) - _KINDS} more kinds"] if len(counts) > _KINDS else []
    return ", ".join(words) or "none"


def _say_details(
    session: Session,
    recording: "Recording",
    document: Mapping[str, Any],
    summary: Mapping[str, Any],
) -> None:
    """Print topics and rates, damage, what absent channels prevent, segments and suspicions."""
    session.say()
    session.say(
        f"{visible(document['source'])}: {document['format']}, {document['size'] / 1e6:.1f} MB,"
        f" sha256 {document['sha256'][:12]}"
    )
    session.table(
        ["topic", "rate [Hz]", "samples", "from [s]", "to [s]", "gaps", "longest [s]", "fields"],
        [
            [
                t["topic"],
                f"{t['rate']:.4g}",
                str(t["samples"]),
                f"{t['start']:.2f}",
                f"{t['end']:.2f}",
                str(t["gaps"]),
                f"{t['longest_gap']:.3g}",
                str(len(t["fields"])),
            ]
            for t in document["topics"]
        ],
        numbers=(1, 2, 3, 4, 5, 6, 7),
    )
    say_damage(session, recording.damage, "damage")
    if summary["mapping"] is None:
        return
    session.say(f"mapping {summary['mapping']}: {', '.join(summary['channels'])}")
    missing = ", ".join(summary["missing"]) or "none of the mapped channels"
    session.say(f"not in the log: {missing}")
    for sentence in (*(e["because"] for e in summary["not_possible"]), *summary["remarks"]):
        session.say(f"  {sentence}")
    if summary["refused"]:
        session.say(f"no flight: {summary['refused']}")
    say_segments(session, summary["segments"])
    say_suspicions(session, summary["suspicions"])


def _contents(recording: "Recording") -> dict[str, Any]:
    """Return the topics and the damage of a recording as a document."""
    from aerodb.logs import describe
    from aerodb.tasks.view import damage_document

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
        for topic in describe(recording).topics
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
