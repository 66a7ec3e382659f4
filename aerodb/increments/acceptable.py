"""Checks of the promotion gate whose reasons a person may accept, each under a name."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any, Final

from aerodb.increments.gate import GateCheck, Measure

#: Under what name a person accepts flights that contradict their vehicle.
CONTRADICTIONS: Final = "contradictions"
#: Under what name a person accepts all errors of sensors that explain what changes.
SENSORS: Final = "sensors"
#: At most so many flights are listed individually.
_LISTED: Final = 4


def _check(name: str, label: str, of: str, found: Mapping[str, str], condition: str) -> GateCheck:
    """The check of what nobody accepted: found, name to accept it under -> sentence."""
    return GateCheck(
        name,
        tuple(
            f"{sentence} (if {condition}: --accept {id}, and the --reason)"
            for id, sentence in found.items()
        ),
        label,
        (Measure(of, len(found), 0),),
        tuple(found),
    )


def judge_rivals(rivals: Sequence[Mapping[str, Any]], accepted: Collection[str]) -> GateCheck:
    """Return the gate's check of the errors of sensors that explain what an update changes.

    rivals : ``rivals`` of its report (docs/reference/contract.md). accepted : their ids that a
    person accepts, with a reason; `SENSORS` means all of them. What is left refuses the release.
    """
    left = {
        rival["hypothesis"]: (
            f"{rival['hypothesis']} explains what changes on {', '.join(rival['shares'])} as well"
            " as declared increments do"
        )
        for rival in rivals
        if not {rival["hypothesis"], SENSORS} & set(accepted)
    }
    return _check(
        "no error of a sensor explains what changes",
        "sensors",
        "sensor errors that explain a change",
        left,
        "the log and the vehicle file are right",
    )


def judge_aliases(report: Mapping[str, Any], accepted: Collection[str]) -> GateCheck:
    """Return the gate's check of estimates that the flights cannot tell apart: their sum is known,
    and each of them may be anything.

    report : of the version (docs/reference/contract.md). accepted : ``alias@AXIS`` of the axes
    where a person accepts that, with a reason.
    """
    left: dict[str, list[str]] = {}
    for entry in report.get("increments", ()):
        for group in entry.get("aliases", ()):
            left.setdefault(entry["axis"], []).append(" and ".join(group))
    return _check(
        "no estimates that cannot be told apart",
        "aliases",
        "axes with inseparable estimates",
        {
            f"alias@{axis}": (
                f"{axis}: {'; '.join(groups)} moved together, and these flights tell only what they"
                " do together"
            )
            for axis, groups in left.items()
            if f"alias@{axis}" not in accepted
        },
        "that is enough",
    )


def open_shapes(report: Mapping[str, Any]) -> dict[str, str]:
    """Return id -> why a version must not be released with it: an addition whose own function
    other functions of the flights' variables beat, or what has no name on an axis of an addition.

    report : of the version (docs/reference/contract.md).
    """
    findings, added = report.get("findings", ()), set(report.get("added", ()))
    entered = [each for each in findings if each["hypothesis"] in added]
    said = {
        each["hypothesis"]: (
            f"{each['hypothesis']} has another shape: an effect of"
            f" {', '.join(each['shape']['variables'])} on {each['shape']['axis']} predicts left-out"
            " flights better"
        )
        for each in entered
        if each.get("shape") and each["verdict"] != "confirmed"
    }
    for each in findings:
        beside = [own["hypothesis"] for own in entered if set(own["axis"]) & set(each["axis"])]
        if each["verdict"] == "unnamed" and beside:
            said[each["hypothesis"]] = (
                f"an effect on {', '.join(each['axis'])} has no name, and {', '.join(beside)} may"
                " stand in for it"
            )
    return said


def judge_shapes(report: Mapping[str, Any], accepted: Collection[str]) -> GateCheck:
    """Return the gate's check of shapes (`open_shapes`).

    accepted : ids that a person accepts, with a reason.
    """
    return _check(
        "what was added has its shape, and nothing on its axis is without a name",
        "shapes",
        "effects of another or unknown shape",
        {id: said for id, said in open_shapes(report).items() if id not in accepted},
        "it is right",
    )


def judge_contradictions(found: Sequence[str], accepted: Collection[str]) -> GateCheck:
    """Return the gate's check of flights that contradict their vehicle or the released version.

    found : sentences about flights that identified the version. accepted : what a person accepts,
    with a reason; `CONTRADICTIONS` means all of them. Sentences that remain refuse the release.
    """
    name = "no flight contradicts its vehicle or the released version"
    is_accepted = CONTRADICTIONS in accepted
    more = f"; and {len(found) - _LISTED} more" if len(found) > _LISTED else ""
    reasons = (
        f"{'; '.join(found[:_LISTED])}{more} (if the flights are right: --accept {CONTRADICTIONS},"
        " and the --reason)",
    )
    refuses = bool(found) and not is_accepted
    return GateCheck(
        name,
        reasons if refuses else (),
        "contradictions",
        (Measure("contradictions by flights", len(found), None if found and is_accepted else 0),),
        (CONTRADICTIONS,) if refuses else (),
    )
