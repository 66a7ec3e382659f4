"""The result of an update or a closed loop in one sentence, and the table of errors per axis."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from aerodb.increments import UNCHANGED
from aerodb.nomenclature import AXES
from aerodb.report.document import WITHIN_FLIGHTS
from aerodb.tables import WIND_AXES
from aerodb.tracing import ADDED

_WHOLE: Final = {
    "held-out": "on {n} held-out flight{s}",
    "cross-validated": "with each flight predicted from the others",
    "not validated": "on the identification flights themselves, without validation",
}


def headline(document: Mapping[str, Any]) -> str:
    """Sum up the document of an update or a closed loop in one sentence."""
    if "library" not in document:
        axes = ", ".join(entry["axis"] for entry in document["increments"])
        return f"The declared increments on {axes} were estimated: {_worth(document)}."
    added = [
        finding for finding in document["findings"] if finding["hypothesis"] in document["added"]
    ]
    if added:
        asked_for = document.get("asked_for", document["added"])  # not in older documents
        lacked = _lacked(added, asked_for)
        return f"{lacked}; with {'it' if len(added) == 1 else 'them'}, {_worth(document)}."
    if document["findings"]:
        effects = listed(
            [
                f"{effect_words(entry)} ({entry['verdict'].replace('_', ' ')})"
                for entry in document["findings"]
            ]
        )
        if all(entry["verdict"] == "sensor" for entry in document["findings"]):
            return (
                "Nothing was added to the database: the errors found are in the sensors,"
                f" {effects}."
            )
        return (
            "Nothing was added to the database, because no single effect is confirmed; found:"
            f" {effects}."
        )
    count = len(document["not_found"])
    return (
        f"Nothing was found that the database lacks: {count} hypotheses were tested, and the"
        " sizes that these flights exclude are listed below."
    )


def _lacked(added: Sequence[Mapping[str, Any]], asked_for: Sequence[str]) -> str:
    """Clause about the added effects; an unconfirmed one, added on request, is no stated fact, nor
    is what had to come with it."""
    proved = [finding for finding in added if finding["verdict"] in ADDED]
    others = [finding for finding in added if finding not in proved]
    requested = [finding for finding in others if finding["hypothesis"] in asked_for]
    companions = [finding for finding in others if finding not in requested]
    clauses = []
    if proved:
        gloss = f" ({added[0]['because'].partition(':')[0]})" if len(added) == 1 else ""
        clauses.append(
            f"The database lacked {listed([effect_words(finding) for finding in proved])}{gloss}"
        )
    if requested:
        verdicts = listed(
            list(dict.fromkeys(finding["verdict"].replace("_", " ") for finding in requested))
        )
        words = listed([effect_words(finding) for finding in requested])
        one = len(requested) == 1
        note = f"only {verdicts}, added because you asked for {'it' if one else 'them'}"
        clauses.append(
            f"{words} {'is' if one else 'are'} {note}"
            if proved
            else f"The database may lack {words}: {note}"
        )
    if companions:
        clauses.append(
            f"{listed([effect_words(finding) for finding in companions])} came along, beside which"
            f" {'it was' if len(requested) == 1 else 'they were'} estimated"
        )
    return "; ".join(clauses)


def effect_words(finding: Mapping[str, Any]) -> str:
    """Describe a finding's effect, subject and axes in words."""
    axes = "all axes" if len(finding["axis"]) == len(AXES) else ", ".join(finding["axis"])
    subject = f" of {finding['subject'].replace('_', ' ')}" if finding["subject"] else ""
    return f"{finding['effect'].replace('_', ' ')}{subject} on {axes}"


def listed(entries: Sequence[str]) -> str:
    """Join entries to a list in a sentence.

    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    return entries[0] if len(entries) == 1 else f"{', '.join(entries[:-1])} and {entries[-1]}"


def _worth(document: Mapping[str, Any]) -> str:
    """Clause about the axis whose error changed most, and about axes that became worse."""
    touched = {entry["axis"] for entry in document["increments"]}
    rows = [
        row
        for row in error_rows(document)
        if row["axis"] in touched and row["before"] and row["after"] is not None
    ]
    if not rows:
        return "no axis could be compared"
    best = min(rows, key=lambda row: row["after"] / row["before"])
    change = 1 - best["after"] / best["before"]
    verb = "falls" if change > 0 else "rises"
    comma = "" if document["flights"]["held_out"] else ","
    sentence = (
        f"{on_which(document)}{comma} the error of {best['axis']} {verb} from {best['before']:.3g}"
        f" to {best['after']:.3g} rms ({100 * abs(change):.0f} %"
        f" {'less' if change > 0 else 'more'})"
    )
    worse = [
        row["axis"]
        for row in rows
        if row["after"] > (1 + UNCHANGED) * row["before"] and row is not best
    ]
    return f"{sentence}, but that of {listed(worse)} rises" if worse else sentence


def on_which(document: Mapping[str, Any]) -> str:
    """Phrase that says on which flights the errors were computed."""
    if by_parts(document):
        return "with the first and last parts of the flights predicted from the rest"
    n = len(document["flights"]["held_out"])
    return _WHOLE[document["validation"]["kind"]].format(n=n, s="" if n == 1 else "s")


def by_parts(document: Mapping[str, Any]) -> bool:
    """Whether validation was within flights: parts of them predicted from the rest.

    Documents stored before the key existed say so only in a remark.
    """
    validation = document["validation"]
    if "within_flights" in validation:
        return bool(validation["within_flights"])
    said_in_remarks = any(WITHIN_FLIGHTS in remark for remark in document["remarks"])
    return said_in_remarks and validation["kind"] == "cross-validated"


def error_rows(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Rows of the error table in the usual axis order.

    Each row has the error before and after (held-out where there is one), the error on the
    identification flights, without constants, the noise floor, the outcome and Theil's fit.
    """
    rows = []
    for axis in sorted(document["axes"], key=[*AXES, *WIND_AXES].index):
        entry = document["axes"][axis]
        held = "held_out_" if entry["held_out_rms_after"] is not None else ""
        after, floor = entry[f"{held}rms_after"], entry["noise_floor"]
        rows.append(
            {
                "axis": axis,
                "before": entry[f"{held}rms_before"],
                "after": after,
                "used_before": entry["rms_before"],
                "used_after": entry["rms_after"],
                "shape_before": entry["held_out_without_constant_before"],
                "shape_after": entry["held_out_without_constant_after"],
                "floor": floor,
                "times_floor": after / floor if after is not None and floor else None,
                "fit": entry["theil"]["fit_percent"] if entry["theil"] else None,
                "outcome": entry["outcome"],
            }
        )
    return rows
