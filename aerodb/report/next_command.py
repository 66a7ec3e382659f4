"""What to do after an update or a closed loop: ask the gate, measure, accept, or fly.

Commands repeat the options that the loop was asked with, so that they differ in one thing only.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from aerodb.report.glossary import advice_words, effect_words, listed
from aerodb.report.labels import for_people
from aerodb.report.levels import to_declare
from aerodb.report.numbers import number
from aerodb.units import UnitSystem

#: Most measurements that a sentence names, and effects that are accepted one by one.
_MOST: Final = 3
#: Options of `close-loop` that `update` has too.
_OF_UPDATES: Final = ("--baseline", "--flights", "--hold-out", "--select")
#: Errors of what the vehicle file states, or a channel of the log in its place.
_STATED: Final = frozenset(
    {"cg_offset", "mass_error", "inertia_error", "thrust_line_offset"}
    | {"surface_scale", "surface_bias"}
)
#: Verdict of a finding -> the option of `close-loop` that adds it all the same.
OPTIONS: Final = {
    "suspected": "--accept-suspected",
    "alias_group": "--accept-lumped",
}


def to_try(document: Mapping[str, Any]) -> list[str]:
    """Options that add what is only suspected, or one of several that these flights cannot tell
    apart; not what another shape fits better, or what was tried and is worth nothing."""
    barred = {*document["added"], *document.get("without_gain", ())}  # not in older documents
    return [
        f"{OPTIONS[finding['verdict']]} {finding['hypothesis']}"
        for finding in document["findings"]
        if finding["verdict"] in OPTIONS
        and not finding.get("shape")
        and finding["hypothesis"] not in barred
    ]


def measurements(document: Mapping[str, Any]) -> dict[str, str]:
    """Parameter of a sensor -> how well it has to be measured outside flight to tell a finding from
    it, with the unit; empty where no accuracy decides."""
    return {
        each["parameter"]: "" if each["sigma"] is None else _accuracy(each["sigma"], each["unit"])
        for finding in document["findings"]
        for each in finding.get("wanted", ())
    }


def again(document: Mapping[str, Any], given: Sequence[str], more: Sequence[str]) -> str:
    """Return the command that closes the loop once more: with the options that were `given`, and
    `more`."""
    once = [option for option in more if option not in given]
    return " ".join(["aerodb close-loop --vehicle", document["vehicle"], *given, *once])


def measuring(document: Mapping[str, Any], given: Sequence[str] = ()) -> str:
    """Return the command that closes the loop with every measurement that it asks for; empty where
    it asks for none."""
    words = [f"--measured {name}=SIGMA" for name in measurements(document)]
    return again(document, given, words) if words else ""


def accepting(document: Mapping[str, Any], given: Sequence[str] = ()) -> str:
    """Return the command that adds what is only suspected and was not asked for; empty where
    nothing is."""
    from aerodb.loop import ALL  # slow to import

    options = [
        option
        for option in to_try(document)
        if {option, f"{option.split()[0]} {ALL}"}.isdisjoint(given)
    ]
    if len(options) > _MOST:
        options = [f"{option} {ALL}" for option in dict.fromkeys(o.split()[0] for o in options)]
    return again(document, given, options) if options else ""


def next_steps(
    document: Mapping[str, Any], given: Sequence[str] = (), units: UnitSystem | None = None
) -> list[tuple[str, str]]:
    """Return what to do next: ``next``, the gate of a candidate, else a command or what to fly;
    then ``FILE``, what the file of the command holds, or ``measure``, what its SIGMA are of.
    Empty where nothing is known.

    given : options that the loop was asked with.
    """
    if document["candidate"]:
        command = f"aerodb version gate {document['label']} --vehicle {document['vehicle']}"
        return [("next", command)]
    if model := to_declare(document.get("levels", ())):
        shared = [option for option in given if option.split()[0] in _OF_UPDATES]
        words = ["aerodb update --vehicle", document["vehicle"], *shared, "--model FILE"]
        return [("next", " ".join(words)), ("FILE", model)]
    if corrected := _corrected(document, units):
        return [("next", "aerodb vehicle add FILE"), ("FILE", corrected)]
    wanted = measurements(document)
    if wanted and (not to_try(document) or document["findings"][0].get("wanted")):
        sizes = [f"{name} to {size}" if size else name for name, size in wanted.items()]
        more = len(sizes) - _MOST
        named = [*sizes[:_MOST], *([f"{more} more"] if more > 0 else [])]
        return [
            ("next", measuring(document, given)),
            ("measure", f"{listed(named)}, not in flight"),
        ]
    if command := accepting(document, given):
        return [("next", command)]
    return [("next", advice_words(advice)) for advice in document["next_flight"][:1]]


def _corrected(document: Mapping[str, Any], units: UnitSystem | None) -> str:
    """What the vehicle file has to say instead, of what was found to be stated wrong; empty where
    the first finding is another. Each error is what is stated less what is true."""
    found = [
        each
        for each in document["findings"]
        if each["verdict"] == "sensor" and each["effect"] in _STATED
    ]
    if not found or found[0] is not document["findings"][0]:
        return ""
    sizes = []
    for each in found[:_MOST]:
        factor, unit = for_people(each["unit"], units)
        size = factor * abs(each["value"])
        shown = f"{number(100.0 * size)} %" if unit in ("-", "1") else f"{number(size)} {unit}"
        side = "lower" if each["value"] > 0.0 else "higher"
        sizes.append(f"{effect_words(each)} {shown} {side}")
    return "; ".join(["what it states, or a channel of the log in its place, corrected", *sizes])


def _accuracy(sigma: float, unit: str) -> str:
    """A number with two digits and its unit, a share in per cent."""
    return f"{100.0 * sigma:.2g} %" if unit == "1" else f"{sigma:.2g} {unit}"
