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
from aerodb.report.error_table import best_and_worse, by_parts, error_rows, shown_axes, written_on
from aerodb.report.former_documents import remarks_of
from aerodb.report.glossary import effect_words, listed, parameter_name
from aerodb.report.levels import followed
from aerodb.report.next_command import next_steps
from aerodb.report.numbers import change, for_people, number
from aerodb.report.terms import as_constant, term_name
from aerodb.support import counted, half_interval
from aerodb.tracing import ADDED
from aerodb.units import UnitSystem

#: Rates whose derivatives are of another unit than the parameters of effects.
RATES: Final = ("p", "q", "r")
#: Most changes and suspicions that are named, and reasons of the gate.
_MOST: Final = 3


@dataclass(frozen=True)
class Decision:
    """Five lines to decide on, and what stands below them.

    verdict : one sentence. lines : label with its texts, one below the other: ``found`` (or
    ``strongest``), ``proved``, ``gate`` and ``next``, then ``also``, ``wrong``, ``FILE``,
    ``measure``, ``why``, ``stops`` and ``left``; those that do not apply are absent.
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
    flights = sum(len(document["flights"][role]) for role in ("identified", "held_out"))
    named = _changes(document, units, rest) if made else _suspicions(document, units, rest)
    lines = [
        ("found" if made else "strongest", named[:1]),
        ("proved", [_proof(document)] if made else []),
        ("gate", [_gate(document)] if made else []),
        *(
            (label, [text])
            for label, text in (next_steps(document, given, units) if loop or made else ())
        ),
        ("also", named[1:]),
        ("wrong", _sensors(document, units) if made and loop else []),
        ("why", _why(document, rest) if made else []),
        ("stops", _stops(document, units, rest)),
        ("left", [_left(document)]),
    ]
    return Decision(
        f"{document['vehicle']}: {_verdict(document)} ({counted(flights, 'flight')})",
        tuple((label, tuple(texts)) for label, texts in lines if any(texts)),
    )


def _verdict(document: Mapping[str, Any]) -> str:
    refused = _refusals(document)
    if document["candidate"]:
        ready = "; the gate refuses it" if refused else "; the gate passes it"
        if document.get("gate") is None and not refused:
            ready = ""  # nobody asked
        if "library" not in document:
            if parameters := document.get("parameters", ()):
                count = counted(len(parameters), "parameter")
                return f"{document['label']} has {count} from flight{ready}"
            axes = listed([entry["axis"] for entry in document["increments"]])
            return f"{document['label']} has increments on {axes}{ready}"
        sure = sum(finding["verdict"] in ADDED for finding in _added(document))
        count = counted(len(document["added"]), "change" if sure else "unconfirmed change")
        if 0 < sure < len(document["added"]):
            count += f", {sure} confirmed"
        return f"{document['label']} has {count}{ready}"
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
    clauses = [counted(others, "suspicion")] if others else []
    if sensors:
        clauses.insert(0, counted(len(sensors), "error") + " of sensors")
    if proved:
        idle = all(each["hypothesis"] in document.get("without_gain", ()) for each in proved)
        why = ", as other flights gain nothing from it" if idle else ""
        clauses.insert(0, f"{len(proved)} confirmed{why}")
        return f"nothing was added; {'; '.join(clauses)}"
    if not others:
        return "the database stays; the errors found are in the sensors"
    return f"nothing is proved yet; {'; '.join(clauses)}"


def _changes(document: Mapping[str, Any], units: UnitSystem | None, rest: str) -> list[str]:
    """What was added, with its size, that on the axis of the proof first; the declared terms that
    are known best, of an update."""
    gained = best_and_worse(document)
    proved = gained[0]["axis"] if gained else ""
    if "library" not in document:
        if parameters := document.get("parameters", ()):
            shown = [_from_to(each, units) for each in parameters[:_MOST]]
            return [*shown, *_more(len(parameters), rest)]
        terms = sorted(
            (
                (entry["axis"] != proved, -abs(term["value"]) / term["standard_error"], entry, term)
                for entry in document["increments"]
                for term in entry["terms"]
                if term["standard_error"] > 0.0
            ),
            key=lambda each: each[:2],
        )
        shown = [
            f"{entry['axis']} {'' if as_constant(term['term']) else 'with '}"
            f"{term_name(term['term'])} {number(term['value'])} +-"
            f" {number(half_interval(term['standard_error']), 2)}"
            for *_, entry, term in terms[:_MOST]
        ]
        return [*shown, *_more(len(terms), rest)]
    added = _added(document)
    own = [entry for entry in added if entry["verdict"] in ADDED]
    asked = [entry for entry in added if entry["hypothesis"] in document.get("asked_for", ())]
    named = sorted(own or asked or added, key=lambda entry: proved not in written_on(entry))
    slopes = {
        f"{d['axis']}_{d['variable']}": d
        for d in document.get("derivatives", ())
        if d["variable"] not in RATES  # those are of the rate, the parameter of its hat rate
    }
    corrected = {p["name"]: p for p in document.get("parameters", ())}
    shown = [
        _from_to(corrected[entry["parameter"]], units, entry["verdict"].replace("_", " "))
        if entry["parameter"] in corrected
        else sized_finding(entry, units, slopes.get(entry["parameter"]))
        for entry in named[:_MOST]
    ]
    return [*shown, *_more(len(document["added"]) - len(shown) + _MOST, rest)]


def _added(document: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The findings of a closed loop that its version has."""
    return [entry for entry in document["findings"] if entry["hypothesis"] in document["added"]]


def _more(n: int, rest: str) -> list[str]:
    return [f"{n - _MOST} more: {rest}"] if n > _MOST else []


def _from_to(parameter: Mapping[str, Any], units: UnitSystem | None, verdict: str = "") -> str:
    """Name of a parameter, value before and after +- half of its 95 % interval; in brackets the
    change in per cent and the verdict."""
    before, after, error = (parameter[key] for key in ("before", "after", "standard_error"))
    factor, unit = for_people(parameter["unit"], units)
    known = "" if error is None else f" +- {number(factor * half_interval(error), 2)}"
    unit = "" if unit == "-" else f" {unit}"
    share = f"{100.0 * (after / before - 1.0):+.0f} %" if before else ""
    notes = ", ".join(filter(None, (share, verdict)))
    size = f"{change(factor * before, factor * after)}{known}{unit}"
    return f"parameter {parameter['name']}: {size}" + (f" ({notes})" if notes else "")


def sized_finding(
    finding: Mapping[str, Any], units: UnitSystem | None, slope: Mapping[str, Any] | None = None
) -> str:
    """A finding with its verdict, its size +- half of its 95 % interval, and what it makes of a
    derivative."""
    words, verdict = effect_words(finding), finding["verdict"].replace("_", " ")
    if finding["ci95"] is None:  # what no effect fits has no size
        return f"{words} ({verdict})"
    factor, unit = for_people(finding["unit"], units)
    low, high = finding["ci95"]
    unit = "" if unit in ("-", "1") else f" {unit}"
    error = number(0.5 * factor * (high - low), 2)
    if slope is not None:
        moved = change(slope["before"], slope["after"])
        return f"{words} {moved} +- {error}{unit} ({verdict})"
    named = parameter_name(finding["parameter"])
    size = f"{named} {number(factor * finding['value'])} +- {error}{unit}"
    return f"{words}: {size} ({verdict})"


def _suspicions(document: Mapping[str, Any], units: UnitSystem | None, rest: str) -> list[str]:
    """What was found and not added: levels that follow a condition, then what is written on the
    axis that is worst beside its noise floor."""
    worst = [row["axis"] for row in _far_rows(document)[:1]]
    findings = sorted(document["findings"], key=lambda each: not {*worst} & {*written_on(each)})
    levels = [text for each in document.get("levels", ()) if (text := followed(each, units))]
    named = [*levels, *(sized_finding(each, units) for each in findings)]
    return [*named[:_MOST], *_more(len(named), rest)]


def _sensors(document: Mapping[str, Any], units: UnitSystem | None) -> list[str]:
    """Sensors and vehicle data that were found to be wrong beside what was added."""
    found = [each for each in document["findings"] if each["verdict"] == "sensor"]
    return [
        f"{sized_finding(each, units)}; correct it; its part is left out of the errors"
        for each in found
    ]


def _proof(document: Mapping[str, Any]) -> str:
    """The error of the axis that gained most, before and after, and the axes that became worse."""
    gained = best_and_worse(document)
    if gained is None:
        return "no axis could be compared"
    best, worse = gained
    held = len(document["flights"]["held_out"])
    where = (
        f"on {counted(held, 'flight')} not used"
        if held
        else "on parts not used"
        if by_parts(document)
        else "by other flights"
        if document["validation"]["kind"] == "cross-validated"
        else "weak, on the flights used"
    )
    fell = "" if best["after"] < best["before"] else "no error falls; "
    error = f"{fell}error of {best['label']} {change(best['before'], best['after'])}"
    if worse:
        error += f"; worse: {listed(worse)}"
    elif best["of_flown"] is not None:
        share = 100.0 * best["of_flown"]
        before = number(share * best["before"] / best["after"], 2) if best["after"] else "-"
        error += f" ({before} -> {number(share, 2)} %)"
    return f"{where}: {error}"


def _stops(document: Mapping[str, Any], units: UnitSystem | None, rest: str) -> list[str]:
    """Where rolls on the ground stand still: by both databases and in flight; those that were held
    out first."""
    known = [each for each in document.get("rolls", ()) if each["stopped"] and each["before"]]
    told, (factor, unit) = [], for_people("m", units)
    for each in sorted(known, key=lambda each: not each["held_out"]):
        named = (("before", "before"), ("after", "after"), ("in flight", "stopped"))
        stops = [(word, each[key]) for word, key in named if each[key]]
        told.append(
            ", ".join(
                f"{word} {factor * at['distance']:.1f} {unit} in {at['time']:.2f} s"
                for word, at in stops
            )
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
    if gate is None:
        return "it will refuse; the reasons are below" if refused else ""
    checks = gate["checks"]
    failed = [check["label"] for check in checks if check["reasons"]]
    if failed:
        return f"refuses, by {listed(failed)} ({len(failed)} of {len(checks)} checks)"
    return f"all {len(checks)} checks pass" if checks else "it is released"


def _why(document: Mapping[str, Any], rest: str) -> list[str]:
    """Why the gate refuses, the first reasons, and how many more."""
    refused = [each.rstrip(".") for each in _refusals(document)]
    return [*refused[:_MOST], *_more(len(refused), rest)]


def _left(document: Mapping[str, Any]) -> str:
    """The axis that is worst beside its noise floor, in per cent of what was flown, and how many
    causes stay open."""
    rows = _far_rows(document)
    clauses = [_at_floor(document)]
    if rows:
        worst = rows[0]
        share = f"{_share(worst['of_flown'])} of what was flown"
        clauses = [f"{worst['label']} {share}, {number(worst['times_floor'], 2)} noise floors"]
        if len(rows) > 1:
            clauses[0] += f"; {len(rows) - 1} more ax{'is' if len(rows) == 2 else 'es'}"
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
