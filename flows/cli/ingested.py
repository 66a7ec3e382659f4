"""Print what became of logs: the verdict on the batch, one line per flight, and the details of
each."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import typer

from aerodb.flows.cli.consistency import say_consistency
from aerodb.flows.cli.findings import say_damage, say_repeats, say_suspicions
from aerodb.flows.cli.output import Session, complaint, percent, visible
from aerodb.nomenclature import in_order
from aerodb.remarks import NEVER_AIRBORNE, WIDE_LIMITS, from_document

if TYPE_CHECKING:
    from aerodb.units import UnitSystem

#: A residual below so many times the sensor noise is mostly noise of the sensors.
_ABOVE_NOISE: Final = math.sqrt(2.0)
#: Longest name of a file that keeps its line.
_NAME: Final = 30


def say_ingested(
    session: Session, outcomes: Sequence[Mapping[str, Any]], vehicle: str, verbose: bool
) -> None:
    """Print what became of logs, what the flights say of the database, and what to do next.

    outcomes : documents of `aerodb.flows.flight.flight_flow`. verbose : also print per flight its
    channels, corrections and notes. Refusals go to standard error.
    """
    taken = [each for each in outcomes if each["flight"] is not None]
    for each in outcomes:
        if each["flight"] is None:
            typer.echo(complaint(each["what"], each["where"], each["remedy"]), err=True)
    if not taken:
        return
    session.headlines(
        _verdict(outcomes, taken, vehicle),
        [("largest", _largest(taken)), ("uneven", _uneven_words(taken))],
        _next_of_rolls(session, taken) or _next(taken, vehicle),
    )
    session.say()
    say_flights(session, taken)
    if not verbose:
        doubtful = next((each for each in taken if _why(each)), taken[0])
        session.say(
            session.fitting(f"details: -v, or aerodb flight show {doubtful['flight'][:12]}")
        )
    for each in taken:
        if verbose:
            _say_details(session, each)
        for sentence in (each["consistency"] or {}).get("drift", []):
            typer.echo(visible(sentence), err=True)


def _verdict(
    outcomes: Sequence[Mapping[str, Any]], taken: Sequence[Mapping[str, Any]], vehicle: str
) -> str:
    """Return how many logs are stored, and the verdicts on their flights."""
    counts = Counter(judged(each) for each in taken)
    if len(outcomes) == 1:
        stored = "known before" if taken[0]["status"] == "duplicate" else "stored"
        return f"{vehicle}: 1 log {stored}: {judged(taken[0])}"
    words = [f"{counts[name]} {name}" for name in sorted(counts)]
    known = sum(each["status"] == "duplicate" and judged(each) != "repeated" for each in taken)
    words += [f"{known} of them known before"] if known else []
    refused = len(outcomes) - len(taken)
    return (
        f"{vehicle}: {len(taken)} of {len(outcomes)} logs stored: {', '.join(words)};"
        f" {refused} refused"
    )


def judged(outcome: Mapping[str, Any]) -> str:
    """Return the verdict on a flight; one that repeats another does not count, whatever it is."""
    if any(entry["counts"] for entry in outcome["repeats"]):
        return "repeated"
    return outcome["consistency"]["verdict"] if outcome["consistency"] else "unchecked"


def _axes(outcome: Mapping[str, Any]) -> Mapping[str, Mapping[str, Any]]:
    """Return axis -> what is left of it beside the released database; empty without comparison."""
    return (outcome["comparison"] or {}).get("axes", {})


def erring_axes(taken: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Return axis -> rms of flight - database over all flights, as a part of what they flew of it;
    only axes whose error is more than noise of the sensors.

    taken : documents with the ``comparison`` of a flight, or None.
    """
    compared = [axes for each in taken if (axes := _axes(each))]
    found = {}
    for axis in in_order(axis for axes in compared for axis in axes):
        entries = [axes[axis] for axes in compared if axis in axes]
        flown = math.fsum(entry["samples"] * entry["variation"] ** 2 for entry in entries)
        left = math.fsum(entry["samples"] * entry["rms_residual"] ** 2 for entry in entries)
        noise = math.fsum(entry["samples"] * entry["noise_floor"] ** 2 for entry in entries)
        if flown > 0.0 and left > _ABOVE_NOISE**2 * noise:
            found[axis] = math.sqrt(left / flown)
    return found


def _largest(taken: Sequence[Mapping[str, Any]]) -> str:
    """Return the largest of `erring_axes` in words, and whether its mean has one sign; empty
    without comparison."""
    compared = [axes for each in taken if (axes := _axes(each))]
    if not compared:
        return ""
    found = erring_axes(taken)
    if not found:
        return "no axis errs by more than the noise of the sensors"
    axis = max(found, key=lambda name: found[name])
    means = [axes[axis]["mean_residual"] for axes in compared if axis in axes]
    said = f"{axis}, {percent(found[axis])} of what was flown"
    if len(means) == 1:
        return f"{said}; mean {means[0]:.2g}"
    one = "" if min(means) < 0.0 < max(means) else ", of one sign"
    return f"{said}; means {min(means):.2g} to {max(means):.2g}{one}"


def _uneven(taken: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return which errors of sensors only some flights correct, of those that no calibration
    corrects."""
    documents = [each["consistency"] for each in taken]
    alone = [each for each in documents if each and each["checked"] and not each["calibration"]]
    applied = [
        {entry["parameter"] for entry in each["estimates"] if entry["applied"]} for each in alone
    ]
    counts = Counter(name for names in applied for name in names)
    return sorted(name for name, count in counts.items() if count < len(alone))


def _uneven_words(taken: Sequence[Mapping[str, Any]]) -> str:
    names = _uneven(taken)
    more = f" and {len(names) - 2} more" if len(names) > 2 else ""
    return f"{', '.join(names[:2])}{more} corrected in some flights only" if names else ""


def _next_of_rolls(session: Session, taken: Sequence[Mapping[str, Any]]) -> str:
    """Return the next command of flights that were never airborne, or that nothing was compared
    with, of a vehicle with a version; empty for others."""
    remarks = [(each["consistency"] or {}).get("verdict_remarks", []) for each in taken]
    rolled = all(NEVER_AIRBORNE in (entry["kind"] for entry in each) for each in remarks)
    if not rolled and any(_axes(each) for each in taken):
        return ""
    from aerodb.tasks.view import roll_command
    from aerodb.tasks.workspace_access import WorkspaceAccess

    catalogue = session.catalogue()
    row = catalogue.flight(taken[0]["flight"])
    if not catalogue.versions(row.vehicle, 1):
        return ""
    access = WorkspaceAccess(session.workspace(), catalogue)
    return roll_command(access, row) or (f"aerodb flight show {row.id[:12]}" if rolled else "")


def _next(taken: Sequence[Mapping[str, Any]], vehicle: str) -> str:
    """Return the next command."""
    if _uneven(taken):
        return f'aerodb recalibrate --vehicle {vehicle} --reason "flown together"'
    known = [each for each in taken if each["coefficients"]["key"] is not None]
    if known and all(each["comparison"] is None for each in taken):
        return f"aerodb database import FILE --vehicle {vehicle}"
    if not any(_axes(each) for each in taken):
        return f"aerodb flight show {taken[0]['flight'][:12]}"
    return f"aerodb close-loop --vehicle {vehicle}"


def say_flights(session: Session, taken: Sequence[Mapping[str, Any]]) -> None:
    """Print a line per flight, and below one that is not good its first reason.

    taken : documents of `aerodb.flows.flight.flight_flow` that have a flight.
    """
    shown = in_order(axis for each in taken for axis in _axes(each))
    names = [_short(visible(Path(each["log"]).name)) for each in taken]
    wide = max(len("file"), *map(len, names))
    if shown:
        session.say("flight - database, per cent of what was flown:")
    widths = [max(7, len(axis) + 2) for axis in shown]
    heads = "".join(f"{axis:>{width}}" for axis, width in zip(shown, widths, strict=True))
    session.say(f"{'file':<{wide}}  {'verdict':<9}{heads}")
    for name, each in zip(names, taken, strict=True):
        shares = (percent(_axes(each).get(axis, {}).get("of_flown")) for axis in shown)
        cells = "".join(f"{share:>{width}}" for share, width in zip(shares, widths, strict=True))
        session.say(f"{name:<{wide}}  {judged(each):<9}{cells}".rstrip())
        if why := _why(each, session.units):
            more = f" (and {len(why) - 1} more: -v)" if len(why) > 1 else ""
            session.say(f"  {session.fitting(why[0], 2 + len(more))}{more}")


def _short(name: str) -> str:
    """Return a name of a file that fits its column.

    >>> _short("totter_f1_017_data.mat")
    'totter_f1_017_data.mat'
    >>> len(_short(31 * "a"))
    30
    """
    return name if len(name) <= _NAME else f"{name[: _NAME - 11]}...{name[-8:]}"


def _why(outcome: Mapping[str, Any], units: "UnitSystem | None" = None) -> list[str]:
    """Return why a flight is not simply good: the reasons of its verdict, what it repeats, what
    could not be computed, what is suspected and what is damaged."""
    from aerodb.report import reasons_in_units

    why = [
        f"repeats flight {entry['label']}: left out of updates"
        for entry in outcome["repeats"]
        if entry["counts"]
    ]
    checked = outcome["consistency"] or {"verdict": "unchecked", "reasons": []}
    remarks = [from_document(each) for each in checked.get("verdict_remarks", [])]
    why += [each.sentence for each in remarks if each.kind == WIDE_LIMITS]
    if checked["verdict"] != "good":
        why += reasons_in_units(checked, units)
    for step in ("coefficients", "comparison"):
        result = outcome[step]
        if result is not None and result["key"] is None:
            why.append(f"no {step}: {result['reason']}")
    suspected = [*outcome["suspicions"], *(outcome["comparison"] or {}).get("suspicions", [])]
    why += [f"suspicion: {entry['sentence']}" for entry in suspected]
    if outcome["damage"]:
        why.append(f"the log is damaged in {len(outcome['damage'])} places; the rest is used")
    return list(dict.fromkeys(why))


def _say_details(session: Session, outcome: Mapping[str, Any]) -> None:
    from aerodb.recording import Damage

    session.say()
    session.say(
        f"{visible(outcome['log'])}: {outcome['status']} as flight {outcome['flight'][:12]}"
    )
    say_damage(session, [Damage(**entry) for entry in outcome["damage"]], "  damage")
    say_repeats(session, outcome["repeats"], "  ")
    say_suspicions(session, outcome["suspicions"], "  ")
    if outcome["consistency"] is not None:
        say_consistency(session, outcome["consistency"], "  ")
    for step in ("coefficients", "comparison"):
        result = outcome[step]
        if result is not None and result["key"] is None:
            session.say(f"  no {step}: {result['reason']}")
    comparison = outcome["comparison"]
    if comparison is not None and comparison["key"] is not None:
        say_comparison(session, comparison)
        say_suspicions(session, comparison["suspicions"], "  ")


def say_comparison(session: Session, comparison: Mapping[str, Any]) -> None:
    """Print what each axis has left beside a database, whether that is noise, and the notes of the
    comparison.

    comparison : document of `aerodb.tasks.steps.compare.compare_with_version`.
    """
    erring = erring_axes([{"comparison": comparison}])
    rows = [
        [
            axis,
            f"{v['rms_measured']:.4g}",
            f"{v['rms_residual']:.4g}",
            percent(v["of_flown"]),
            f"{v['noise_floor']:.2g}",
            "" if axis in erring else "noise",
            str(v["samples"]),
        ]
        for axis, v in comparison["axes"].items()
    ]
    session.table(
        ["axis", "flight rms", "flight - database rms", "of flown", "sensor noise", "", "samples"],
        rows,
        numbers=(1, 2, 3, 4, 6),
    )
    for note in comparison["notes"]:
        session.say(f"  note: {note}")
