"""What a log that is not stored contains and can be used for, with and without its plots; no
vehicle is needed."""

import math
import tempfile
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from aerodb.conditioning import STATES
from aerodb.errors import InputError
from aerodb.logs import (
    Formula,
    FoundRotors,
    airspeed_remedy,
    channels_found,
    choose_mapping,
    consequence_of_zeros,
    consequences_of_missing,
    describe,
    empty_channels,
    hover_sentence,
    hover_times,
    learnt_of,
    not_possible,
    parse_formula,
    read_autopilot,
    sensor_choices,
    wingless_sentence,
    with_mapped_clock,
    with_named_clock,
    zero_channels,
)
from aerodb.logs import Mapping as LogMapping
from aerodb.nomenclature import is_surface
from aerodb.recording import Recording
from aerodb.storage.mappings import builtin_mappings, load_mapping
from aerodb.storage.workspace_settings import load_settings
from aerodb.support import counted
from aerodb.tasks.steps import SERVOS, PlottedLog, Wanted, look_over, plot_log
from aerodb.tasks.view.flight_documents import damage_document
from aerodb.tasks.workers import FINDINGS, Parsed, parsed_log, start_workers
from aerodb.units import UnitSystem

if TYPE_CHECKING:
    from aerodb.report import LogStory

#: Largest number of suspicions, and of kinds of manoeuvres, that are named in words.
_FEW: Final = 2
#: What is said of a log of an aircraft with wings that only hovers.
_HOVERS: Final = "it only hovers: rotors are learnt, wing and control surfaces are not"
_KINDS: Final = 6
#: Most samples of a line of a plot.
_POINTS: Final = 1000


@dataclass(frozen=True, eq=False)
class InspectedLog:
    """A log that is only looked at: `recording` on the clock of its mapping, and the document of
    ``aerodb log inspect``; `plotted` where plots were asked for."""

    recording: Recording
    document: dict[str, Any]
    plotted: PlottedLog | None = None


@contextmanager
def inspected_log(
    log: Path,
    workspace: Path,
    mapping: str | None = None,
    panels: Sequence[Sequence[str]] | None = None,
    formulas: Sequence[Formula] = (),
) -> Iterator[InspectedLog]:
    """Parse a log under the limits of a workspace, and look at it; nothing is stored.

    Parameters
    ----------
    workspace : folder; without settings in it, the default limits hold.
    mapping : name or file; None: chosen by content.
    panels : names of the signals of each panel (`aerodb.logs.Signals`); empty: what the log offers;
        None: no plots. Times [s] count from the first sample.

    Raises InputError for a log that cannot be read, UnknownNameError for a name that it lacks.
    """
    if not log.is_file():
        raise InputError("no such file", str(log), "check the path")
    start_workers([log.suffix.lower()], FINDINGS)
    limits = load_settings(workspace).limits
    with (
        tempfile.TemporaryDirectory(prefix="aerodb-") as folder,
        parsed_log(log, Path(folder) / "topics", limits) as parsed,
    ):
        wanted = None
        if panels is not None:
            from aerodb.tasks.view.channels import FIRST, PANELS  # it waits for the store

            asked = tuple(map(tuple, panels))
            # accelerometers where the mapping cannot move them to the CG
            first = (*FIRST, "ax_imu", "ay_imu", "az_imu")
            wanted = Wanted(asked, tuple(formulas), first, PANELS, _POINTS)
        yield _looked_into(parsed, mapping, str(workspace), wanted)


def _looked_into(
    parsed: Parsed, mapping: str | None, workspace: str, wanted: Wanted | None
) -> InspectedLog:
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
        recording = with_named_clock(recording)
    plotted = None
    if wanted is not None:
        plotted = plot_log(parsed.folder, recording.source, chosen, workspace, wanted)
    if chosen is None:
        summary: dict[str, Any] = {
            "mapping": None,
            **{name: [] for name in ("channels", "missing", "zero", "empty", "sensors")},
            "rotors": None,
            "prevents": [refusal],
            "usable": False,
            "because": [refusal],
        }
    else:
        found = plotted.found if plotted else None
        if found is None:
            found = look_over(parsed.folder, recording.source, chosen, workspace)
        summary = _summary(recording, chosen, found)
    counted = {
        name
        for name, topic in recording.topics.items()
        if recording.format == "tabular" and topic is parsed.recording.topics[name]
    }
    return InspectedLog(recording, {**_contents(recording, counted), **summary}, plotted)


def _summary(recording: Recording, chosen: LogMapping, findings: dict[str, Any]) -> dict[str, Any]:
    """Return what a mapping finds in a recording, what that allows, and whether it can be used."""
    present, missing = channels_found(recording, chosen)
    zero, empty = zero_channels(recording, chosen), empty_channels(recording, chosen)
    autopilot = read_autopilot(recording)
    wingless = [] if autopilot.described else [wingless_sentence(autopilot)]
    expected = [name for name, each in findings["outlook"].items() if each["expected"]]
    outputs = [len(recording.topics[name].fields) for name in SERVOS if name in recording.topics]
    servos = max(outputs, default=0)
    lacking = [
        name
        for name in (*missing, *empty, *(zero if chosen.zero_is_missing else ()))
        if name not in findings["computed"]
        and name not in expected
        and not ((servos or autopilot.rotors.logged) and is_surface(name))
    ]
    absent = [name for name in missing if name not in findings["computed"]]
    grounded = bool(findings["segments"]) and not _flown(findings["segments"])
    unusable = [
        *(wingless or ([findings["unusable"]] if findings["unusable"] else [])),
        *([_never_flown(findings["segments"])] if grounded else []),
    ]
    remarks = [
        *consequence_of_zeros(zero, chosen.zero_is_missing),
        *(f"{name} is mapped to a field without any number: it is not used" for name in empty),
    ]
    return {
        "mapping": chosen.name,
        "channels": present,
        "airframe": autopilot.kind or None,
        "rotors": _rotors(autopilot.rotors),
        "hover": _HOVERS
        if autopilot.has_wing and autopilot.rotors.logged
        else hover_sentence(autopilot.kind, hover_times(recording)),
        "sensors": list(sensor_choices(recording, chosen)),
        "missing": missing,
        "zero": list(zero),
        "empty": list(empty),
        "prevents": [
            *wingless,
            *consequences_of_missing(absent),
            *airspeed_remedy(absent),
            *remarks,
        ],
        **findings,
        "not_possible": [
            {"what": short, "because": sentence} for short, sentence in not_possible(lacking)
        ],
        "remarks": remarks,
        "servo_outputs": servos,
        "usable": not unusable,
        "because": [*unusable, *([] if wingless else airspeed_remedy(absent))],
    }


def _rotors(found: FoundRotors) -> dict[str, Any] | None:
    """Return what a log tells of its rotors, and what can be learnt from it; None without any."""
    if not found.rotors:
        return None
    return {
        "rotors": [
            {
                "name": each.name,
                "position": list(each.position),
                "turns": each.turns,
                "topic": each.topic,
                "field": each.field,
                "usual": each.usual if each.topic else None,
                "fastest": each.fastest or None,
            }
            for each in found.rotors
        ],
        "placed": found.placed,
        "frame": found.frame,
        "beyond": [each.reached for each in found.beyond],
        **dict(zip(("learnt", "not_learnt"), learnt_of(found), strict=True)),
    }


def _never_flown(segments: Sequence[Mapping[str, Any]]) -> str:
    hovers = any(each["kind"] == "hover" for each in segments)
    return f"the aircraft {'only hovered' if hovers else 'was never airborne'} in it"


@dataclass(frozen=True)
class LogsPage:
    """A page of logs: its HTML, the document of each log, and the names in each panel."""

    html: str
    documents: tuple[dict[str, Any], ...]
    panels: tuple[tuple[str, ...], ...]
    contents: str


def logs_page(
    logs: Sequence[Path],
    workspace: Path,
    mapping: str | None = None,
    signals: Sequence[str] = (),
    formulas: Sequence[str] = (),
    names: Sequence[str] = (),
    units: UnitSystem | None = None,
) -> LogsPage:
    """Return the page of logs, without a vehicle (`aerodb.report.log_report`); nothing is stored.

    Parameters
    ----------
    workspace, mapping : as in `inspected_log`.
    signals : a panel each; signals of one panel with commas between them. Where none is named: what
        the first log offers, and each formula.
    formulas : as `aerodb.logs.parse_formula` takes them; times are in [s].
    names : of the logs on the page; empty: those of the files. units : of the plots.

    Raises InputError for a log that cannot be read, and UnknownNameError for a name that one lacks.
    """
    # An inspection draws nothing and must not wait for matplotlib.
    from aerodb.report import MOST_LOGS, log_report

    if len(logs) > MOST_LOGS:
        raise InputError(f"{len(logs)} logs", "log show", f"give at most {MOST_LOGS} at once")
    parsed = [parse_formula(text) for text in formulas]
    panels = [[name.strip() for name in signal.split(",") if name.strip()] for signal in signals]
    if not panels:
        panels = [[each.name] for each in parsed]
    stories, documents = [], []
    for log, name in zip(logs, names or [log.name for log in logs], strict=True):
        with inspected_log(log, workspace, mapping, panels, parsed) as looked:
            plotted = looked.plotted
            assert plotted is not None
            panels = panels or [[each.name for each in panel] for panel in plotted.panels]
            stories.append(_story(name, looked, plotted))
            documents.append(looked.document)
    said = stories[0].said
    counts = (
        (len(panels), "plot"),
        (sum(story.track is not None for story in stories), "track"),
        (len(said["parameters"]), "parameter"),
        (len(said["messages"]), "message"),
    )
    contents = ", ".join(counted(n, what) for n, what in counts if n)
    return LogsPage(
        log_report(stories, units),
        tuple(documents),
        tuple(map(tuple, panels)),
        contents or "no plot",
    )


def _story(name: str, looked: InspectedLog, plotted: PlottedLog) -> "LogStory":
    from aerodb.report import LogStory
    from aerodb.tasks.view.log_documents import recording_document

    document = looked.document
    mapped = document["mapping"] is not None
    return LogStory(
        name,
        inspection_verdict(document),
        [] if document["usable"] else document["because"],
        inspection_lines(document) if mapped else [],
        plotted.panels,
        plotted.track,
        recording_document(looked.recording),
        plotted.start,
        looked.recording.start_utc,
        mapped or document["format"] != "tabular",
    )


def inspection_verdict(document: Mapping[str, Any]) -> str:
    """Return whether a log can be used, with format, aircraft, length [s] and rate [Hz]: from the
    document of ``aerodb log inspect``."""
    verdict = "USABLE" if document["usable"] else "NOT USABLE"
    return verdict if document["mapping"] is None else f"{verdict} ({_kind(document)})"


def inspection_lines(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return what a log measures and what follows for a flight, as label and text; empty where
    there is nothing to say. document : of ``aerodb log inspect``, with a mapping."""
    surfaces = [name for name in document["channels"] if is_surface(name)]
    unused = {*surfaces, *document["zero"], *document["empty"]}
    winged = document["rotors"] is None
    moved = [name for name in surfaces if name not in (*document["zero"], *document["empty"])]
    return [
        ("reconstructed", "; ".join(_angles(document["outlook"]))),
        ("not possible", "; ".join(dict.fromkeys(e["what"] for e in document["not_possible"]))),
        ("measured", " ".join(n for n in document["channels"] if n not in unused)),
        ("computed", " ".join(document["computed"])),
        ("all zero", " ".join(document["zero"])),
        ("no number", " ".join(document["empty"])),
        *_told_by_rotors(document["rotors"]),
        ("surfaces", _surfaces(moved, document["servo_outputs"]) if winged else ""),
        ("hover", document["hover"]),
        ("manoeuvres", _manoeuvres(document["segments"])),
        ("suspicions", "; ".join(each["sentence"] for each in document["suspicions"][:_FEW])),
        ("not read", "; ".join(document["not_read"])),
        ("read as", "; ".join([*document["read_as"], *document["sensors"]])),
        ("damage", _counted(Counter(e["kind"].replace("_", " ") for e in document["damage"]))),
    ]


def _told_by_rotors(rotors: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    if rotors is None:
        return []
    told = [each for each in rotors["rotors"] if each["topic"]]
    places = "by parameters" if rotors["placed"] else f"of a {rotors['frame']}, not stated"
    words = [f"{len(rotors['rotors'])}, places {places}"]
    words += [f"told by {told[0]['topic']}, usually {told[0]['usual']:.2f}"] if told else []
    return [
        ("rotors", "; ".join(words)),
        ("out of range", "; ".join(rotors["beyond"])),
        ("learnt", "; ".join(rotors["learnt"])),
        ("not told apart", "; ".join(rotors["not_learnt"])),
    ]


def _kind(document: Mapping[str, Any]) -> str:
    """Return format, aircraft, length, rate and whether it flew, in words."""
    words = [document["format"]]
    words += [document["airframe"]] if document["airframe"] else []
    if document["rate"]:
        words += [f"{document['duration']:.1f} s", f"{document['rate']:.4g} Hz"]
        flown = _flown(document["segments"])
        whole = flown >= 0.99 * document["duration"]
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


def _contents(recording: Recording, counted: Collection[str]) -> dict[str, Any]:
    """Return the topics and the damage of a recording as a document.

    counted : topics without a time, which have neither rate nor ends.
    """
    stated = recording.metadata
    skipped, remarks = stated.get("skipped", ""), stated.get("remarks", "")
    topics = [
        {
            "topic": topic.name,
            "rate": None if topic.name in counted else topic.rate,
            "samples": topic.samples,
            "start": None if topic.name in counted else topic.start,
            "end": None if topic.name in counted else topic.end,
            "gaps": 0 if topic.name in counted else len(topic.gaps),
            "longest_gap": 0.0 if topic.name in counted else topic.longest_gap,
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
        "not_read": [f"{skipped} (no numbers)"] if skipped else [],
        "read_as": [str(remarks)] if remarks else [],
        "damage": [damage_document(entry) for entry in recording.damage],
    }
