"""Print conditioning findings of a flight: likely faults, repeats, segments, delays."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from aerodb.flows.cli.output import Session, plus_minus

if TYPE_CHECKING:
    from aerodb.recording import Damage

#: Largest number of damaged parts printed; `--json` lists them all.
_PLACES = 10
#: Largest number of segments printed; `--json` lists them all.
_LISTED = 60


def say_suspicions(
    session: Session, suspicions: Sequence[Mapping[str, Any]], indent: str = ""
) -> None:
    """Print one line per likely fault."""
    for entry in suspicions:
        session.say(f"{indent}suspicion: {entry['sentence']}")


def say_repeats(session: Session, repeats: Sequence[Mapping[str, Any]], indent: str = "") -> None:
    """Print which flights this one repeats, in which intervals, and the consequence."""
    for entry in repeats:
        for s in entry["stretches"]:
            place = (
                f"{s['start']:.6g} to {s['end']:.6g} s match its {s['original_start']:.6g} to"
                f" {s['original_end']:.6g} s"
            )
            session.say(
                f"{indent}repeats flight {entry['label']}: {place} (difference"
                f" {100 * s['difference']:.2g} % of the motion)"
            )
    if any(entry["counts"] for entry in repeats):
        remedy = "to use it instead, retract the other"
        session.say(f"{indent}a repeated flight: stored, but left out of updates ({remedy})")


def say_segments(
    session: Session, segments: Sequence[Mapping[str, Any]], zero: float = 0.0
) -> None:
    """Print a table of the flight's segments, with times from `zero` [s] of the log's clock."""
    rows = [
        [
            f"{s['start'] - zero:.2f}",
            f"{s['end'] - zero:.2f}",
            s["kind"].replace("_", " "),
            s["reason"],
        ]
        for s in segments[:_LISTED]
    ]
    if rows:
        session.table(["from [s]", "to [s]", "segment", "why"], rows, numbers=(0, 1))
    if len(segments) > _LISTED:
        session.say(f"and {len(segments) - _LISTED} more segments (--json lists them)")


def segments_words(segments: Sequence[Mapping[str, Any]]) -> str:
    """Return how many segments of each kind a flight has, in the order in which they begin.

    >>> segments_words([{"kind": "pull_up"}, {"kind": "low_g"}, {"kind": "pull_up"}])
    'pull up 2 times, low g'
    """
    counts = Counter(segment["kind"].replace("_", " ") for segment in segments)
    return ", ".join(f"{kind} {n} times" if n > 1 else kind for kind, n in counts.items())


def say_rolls(session: Session, rolls: Sequence[Mapping[str, Any]], zero: float) -> None:
    """Print where rolls on the ground stand still, and how each phase of them slows down, with
    times from `zero` [s] of the log's clock."""
    for roll in rolls:
        seen = f"{roll['time']:.1f} s and {roll['distance']:.0f} m"
        ends = f"stands still after {seen}" if roll["stands"] else f"still rolls after {seen}"
        session.say(f"roll at {roll['start'] - zero:.1f} s: {ends}")
        for each in roll["phases"]:
            session.say(
                f"  {each['start'] - zero:.1f} to {each['end'] - zero:.1f} s, {each['fast']:.1f} to"
                f" {each['slow']:.1f} m/s: slows down by"
                f" {plus_minus(each['effective'], each['standard_error'], 3)} g"
            )
    if rolls:
        session.say("  that is rolling friction, brakes, drag and slope together, less thrust")


def say_delays(session: Session, delays: Sequence[Mapping[str, Any]]) -> None:
    """Print the delay of each channel, as far as the kinematics determine it."""
    known = [d for d in delays if d["observable"]]
    for d in known:
        session.say(
            f"{d['channel']} is {plus_minus(d['seconds'], d['standard_error'], 3, 1000.0)} ms late"
            " according to the kinematics"
        )


def say_damage(session: Session, damage: Sequence["Damage"], heading: str) -> None:
    """Print one line per damaged part of a log."""
    for entry in damage[:_PLACES]:
        session.say(f"{heading}: {_damage_text(entry)}")
    if len(damage) > _PLACES:
        session.say(f"{heading}: and {len(damage) - _PLACES} more places (--json lists them)")


def _damage_text(entry: "Damage") -> str:
    where = f" in {entry.topic}" if entry.topic else ""
    when = f" from {entry.start:.3f} s" if entry.start is not None else ""
    until = f" to {entry.end:.3f} s" if entry.end is not None else ""
    return f"{entry.kind.replace('_', ' ')}{where}{when}{until}: {entry.what}"
