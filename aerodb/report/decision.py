"""The result of an update or a closed loop in five lines: verdict, change, proof, gate, next
command.

What stands on top of every command and page. Everything is taken from the document
(docs/reference/contract.md, section JSON); nothing is computed from sentences.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from aerodb.increments import NEAR_FLOOR
from aerodb.remarks import REFUSED
from aerodb.report.former_documents import remarks_of
from aerodb.report.glossary import effect_words, listed
from aerodb.report.headlines import best_and_worse, by_parts, error_rows, shown_axes
from aerodb.report.levels import followed
from aerodb.report.next_command import next_step
from aerodb.report.numbers import for_people, number
from aerodb.report.terms import as_constant, term_name
from aerodb.tracing import ADDED
from aerodb.units import UnitSystem

#: Rates whose derivatives are of another unit than the parameters of effects.
RATES: Final = ("p", "q", "r")
#: Most changes, suspicions and axes that a line names.
_MOST: Final = 3


@dataclass(frozen=True)
class Decision:
    """Five lines to decide on.

    verdict : one sentence. lines : label (``found``, ``strongest``, ``proved``, ``stops``,
    ``gate``, ``left``, ``next``) with its texts, one below the other; those that do not apply are
    absent.
    """

    verdict: str
    lines: tuple[tuple[str, tuple[str, ...]], ...]


def decision(
    document: Mapping[str, Any],
    units: UnitSystem | None = None,
    rest: str = "-v",
    given: Sequence[str] = (),
) -> Decision:
    """Return what to decide on, from the document of an update or a closed loop.

    rest : where the rest is told. given : options that the loop was asked with. Errors are rms of
    dimensionless coefficients; shares are of what an axis varied in flight.
    Raises KeyError for any other document.
    """
    loop = "library" in document
    made = bool(document["candidate"])
    lines = [
        (
            "found" if made else "strongest",
            _changes(document, units, rest) if made else _suspicions(document, units, rest),
        ),
        ("proved", [_proof(document)] if made else []),
        ("stops", _stops(document, rest)),
        ("gate", [_gate(document)] if made else []),
        ("left", [_left(document, rest)]),
        ("next", [next_step(document, given)] if loop or made else []),
    ]
    return Decision(
        f"{document['vehicle']}: {_verdict(document)} ({_flights(document)})",
        tuple((label, tuple(texts)) for label, texts in lines if any(texts)),
    )


def _verdict(document: Mapping[str, Any]) -> str:
    refused = _refusals(document)
    if document["candidate"]:
        ready = "it waits for the gate" if document.get("gate") is None else "the gate passes it"
        if refused:
            ready = "the gate will refuse it as it is"
        if "library" not in document:
            if parameters := document.get("parameters", ()):
                count = _count(len(parameters), "parameter")
                return f"{document['label']} has {count} as these flights have them; {ready}"
            axes = listed([entry["axis"] for entry in document["increments"]])
            return f"{document['label']} has the declared increments on {axes}; {ready}"
        return f"{document['label']} has {_count(len(document['added']), 'change')}; {ready}"
    follows = [each for each in document.get("levels", ()) if followed(each)]
    if follows and not any(each["verdict"] != "sensor" for each in document["findings"]):
        axes = listed([each["axis"] for each in follows])
        return f"what the database lacks on {axes} differs from flight to flight; it is not added"
    if document["findings"]:
        return _nothing_added(document)
    tested = document["not_found"]
    open_ones = sum(entry["verdict"] != "not_detected" for entry in tested)
    if 2 * open_ones > len(tested):
        return f"these flights cannot decide; {open_ones} of {len(tested)} causes stay open"
    if _far_rows(document):
        return f"no cause was found for the error that is left; {len(tested)} were tested"
    return f"nothing is missing that these flights could show; {len(tested)} causes were tested"


def _nothing_added(document: Mapping[str, Any]) -> str:
    """The verdict where something was found and nothing was added: what is proved all the same, and
    how much is not."""
    findings = document["findings"]
    proved = [entry for entry in findings if entry["verdict"] in ADDED]
    sensors = [entry for entry in findings if entry["verdict"] == "sensor"]
    others = len(findings) - len(proved) - len(sensors)
    clauses = [_count(others, "suspicion")] if others else []
    if sensors:
        clauses.insert(0, _count(len(sensors), "error") + " of sensors")
    if proved:
        idle = all(each["hypothesis"] in document.get("without_gain", ()) for each in proved)
        why = ", as other flights gain nothing from it" if idle else ""
        clauses.insert(0, f"{len(proved)} confirmed{why}")
        return f"nothing was added; {'; '.join(clauses)}"
    if not others:
        return "the database stays; the errors found are in the sensors"
    return f"nothing is proved yet; {'; '.join(clauses)}"


def _flights(document: Mapping[str, Any]) -> str:
    used, held = (len(document["flights"][name]) for name in ("identified", "held_out"))
    every = _count(used + held, "flight")
    if held:
        return f"{every}: {used} to find, {held} to check"
    if by_parts(document):
        return f"{every}, parts predicted from the rest"
    if document["validation"]["kind"] == "cross-validated":
        return f"{every}, each predicted from the others"
    return f"{every}, none to check"


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"


def _changes(document: Mapping[str, Any], units: UnitSystem | None, rest: str) -> list[str]:
    """What was added, with its size; the declared terms that are known best, of an update."""
    if "library" not in document:
        if parameters := document.get("parameters", ()):
            shown = [f"parameter {_from_to(each)}" for each in parameters[:_MOST]]
            return [*shown, *_more(len(parameters), rest)]
        terms = sorted(
            (
                (abs(term["value"]) / term["standard_error"], entry["axis"], term)
                for entry in document["increments"]
                for term in entry["terms"]
                if term["standard_error"] > 0.0
            ),
            key=lambda each: -each[0],
        )
        shown = [
            f"{axis} {'' if as_constant(term['term']) else 'with '}{term_name(term['term'])}"
            f" {number(term['value'])} +- {number(2.0 * term['standard_error'], 2)}"
            for _, axis, term in terms[:_MOST]
        ]
        return [*shown, *_more(len(terms), rest)]
    added = [entry for entry in document["findings"] if entry["hypothesis"] in document["added"]]
    own = [entry for entry in added if entry["verdict"] in ADDED]
    asked = [entry for entry in added if entry["hypothesis"] in document.get("asked_for", ())]
    named = own or asked or added
    slopes = {
        f"{d['axis']}_{d['variable']}": d
        for d in document.get("derivatives", ())
        if d["variable"] not in RATES  # those are of the rate, the parameter of its hat rate
    }
    corrected = {p["name"]: p for p in document.get("parameters", ())}
    shown = [
        _corrected(entry, corrected[entry["parameter"]])
        if entry["parameter"] in corrected
        else _sized(entry, units, slopes.get(entry["parameter"]))
        for entry in named[:_MOST]
    ]
    return [*shown, *_more(len(document["added"]) - len(shown) + _MOST, rest)]


def _more(n: int, rest: str) -> list[str]:
    return [f"{n - _MOST} more: {rest}"] if n > _MOST else []


def _corrected(finding: Mapping[str, Any], parameter: Mapping[str, Any]) -> str:
    """A parameter of the database with its verdict, and what `_from_to` says of it."""
    verdict = finding["verdict"].replace("_", " ")
    return f"parameter {_from_to(parameter, f' ({verdict})')}"


def _from_to(parameter: Mapping[str, Any], verdict: str = "") -> str:
    """Name, value before and after with twice its standard error, and the change in per cent."""
    before, after, error = (parameter[key] for key in ("before", "after", "standard_error"))
    known = "" if error is None else f" +- {number(2.0 * error, 2)}"
    unit = "" if parameter["unit"] == "1" else f" {parameter['unit']}"
    share = f" ({100.0 * (after / before - 1.0):+.0f} %)" if before else ""
    return f"{parameter['name']}{verdict}: {number(before)} -> {number(after)}{known}{unit}{share}"


def _sized(
    finding: Mapping[str, Any], units: UnitSystem | None, slope: Mapping[str, Any] | None = None
) -> str:
    """A finding with its verdict, its size +- half of its 95 % interval, and what it makes of a
    derivative."""
    name = f"{effect_words(finding)} ({finding['verdict'].replace('_', ' ')})"
    if finding["ci95"] is None:  # what no effect fits has no size
        return name
    factor, unit = for_people(finding["unit"], units)
    low, high = finding["ci95"]
    unit = "" if unit == "-" else f" {unit}"
    size = (
        f"{finding['parameter']} {number(factor * finding['value'])} +-"
        f" {number(0.5 * factor * (high - low), 2)}{unit}"
    )
    if slope is not None:
        size += f", from {number(slope['before'])} to {number(slope['after'])}"
    return f"{name}: {size}"


def _suspicions(document: Mapping[str, Any], units: UnitSystem | None, rest: str) -> list[str]:
    findings = document["findings"]
    levels = [text for each in document.get("levels", ()) if (text := followed(each, units))]
    named = [*levels, *(_sized(each, units) for each in findings)]
    return [*named[:_MOST], *_more(len(named), rest)]


def _proof(document: Mapping[str, Any]) -> str:
    """The error of the axis that gained most, before and after, and the axes that became worse."""
    gained = best_and_worse(document)
    if gained is None:
        return "no axis could be compared"
    best, worse = gained
    held = len(document["flights"]["held_out"])
    where = (
        f"on {_count(held, 'flight')} not used"
        if held
        else "with parts of flights predicted from the rest"
        if by_parts(document)
        else "with each flight predicted from the others"
        if document["validation"]["kind"] == "cross-validated"
        else "on the flights that identified, which proves little"
    )
    fell = "" if best["after"] < best["before"] else "no error falls; "
    error = f"{fell}error of {best['label']} {number(best['before'])} -> {number(best['after'])}"
    if best["of_flown"] is not None:
        before = best["of_flown"] * best["before"] / best["after"] if best["after"] else None
        error += f" ({_share(before)} -> {_share(best['of_flown'])} of what was flown)"
    return f"{where}: {error}" + (f"; worse: {listed(worse)}" if worse else "")


def _stops(document: Mapping[str, Any], rest: str) -> list[str]:
    """Where rolls on the ground stand still: by both databases and in flight; those that were held
    out first."""
    known = [each for each in document.get("rolls", ()) if each["stopped"] and each["before"]]
    told = []
    for each in sorted(known, key=lambda each: not each["held_out"]):
        named = (("before", "before"), ("after", "after"), ("in flight", "stopped"))
        stops = [(word, each[key]) for word, key in named if each[key]]
        told.append(
            ", ".join(f"{word} {at['distance']:.1f} m in {at['time']:.2f} s" for word, at in stops)
        )
    return [*told[:_MOST], *_more(len(told), rest)]


def _share(share: float | None) -> str:
    return "-" if share is None else f"{number(100 * share, 2)} %"


def _refusals(document: Mapping[str, Any]) -> list[str]:
    """Why the gate refuses it, in sentences; as far as the document knows, where nobody asked."""
    if (gate := document.get("gate")) is not None:
        return [reason for check in gate["checks"] for reason in check["reasons"]]
    return [sentence for kind, sentence in remarks_of(document) if kind == REFUSED]


def _gate(document: Mapping[str, Any]) -> str:
    refused = _refusals(document)
    gate = document.get("gate")
    if gate is None and not refused:
        return "not asked yet"
    if gate is not None and not refused:
        return f"all {len(gate['checks'])} checks pass" if gate["checks"] else "it is released"
    more = f"; {len(refused) - 1} more" if len(refused) > 1 else ""
    return f"{'' if gate is None else 'refuses: '}{refused[0].rstrip('.')}{more}"


def _left(document: Mapping[str, Any], rest: str) -> str:
    """The axes that are worst beside their noise floor, in per cent of what was flown, and how many
    causes stay open."""
    rows = _far_rows(document)
    axes = [
        f"{row['label']} {_share(row['of_flown'])} of what was flown,"
        f" {number(row['times_floor'], 2)} noise floors"
        for row in rows[:_MOST]
    ]
    clauses = ["; ".join([*axes, *_more(len(rows), rest)])] if axes else [_at_floor(document)]
    tested = document["not_found"] if "library" in document else ()
    undecided = sum(entry["verdict"] != "not_detected" for entry in tested)
    if undecided:
        every = len(tested) + len(document["findings"])
        clauses.append(f"{undecided} of {every} causes not decided")
    return "; ".join(clauses)


def _far_rows(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Rows of the error table (`error_rows`) that are told and above their noise floor, the worst
    first."""
    shown = shown_axes(document)
    rows = [
        row
        for row in error_rows(document)
        if row["axis"] in shown and row["times_floor"] and row["times_floor"] > NEAR_FLOOR
    ]
    return sorted(rows, key=lambda row: -float(row["times_floor"]))


def _at_floor(document: Mapping[str, Any]) -> str:
    """That every axis is at its noise floor, or which have none."""
    shown = shown_axes(document)
    without = [
        row["axis"]
        for row in error_rows(document)
        if row["axis"] in shown and row["times_floor"] is None
    ]
    if not without:
        return "every axis at its noise floor"
    return f"no noise floor is known of {listed(without)}"
