"""What an update or a closed loop came to, in one sentence, and the errors per axis that it rests
on."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from aerodb.increments import UNCHANGED
from aerodb.nomenclature import AXES
from aerodb.tables import WIND_AXES
from aerodb.tracing import ADDED

_WHOLE: Final = {
    "held-out": "on {n} held-out flight{s}",
    "cross-validated": "with each flight predicted from the others",
    "not validated": "on the flights that identified, which proves nothing",
}


def headline(document: Mapping[str, Any]) -> str:
    """The outcome of an update or a closed loop in one sentence."""
    if "library" not in document:
        axes = ", ".join(entry["axis"] for entry in document["increments"])
        return f"The declared increments on {axes} were estimated: {_worth(document)}."
    added = [
        finding for finding in document["findings"] if finding["hypothesis"] in document["added"]
    ]
    if added:
        return f"{_lacked(added)}; with {'it' if len(added) == 1 else 'them'}, {_worth(document)}."
    if document["findings"]:
        found = listed(
            [
                f"{effect_words(entry)} ({entry['verdict'].replace('_', ' ')})"
                for entry in document["findings"]
            ]
        )
        if all(entry["verdict"] == "sensor" for entry in document["findings"]):
            return (
                "Nothing was added to the database: what these flights show belongs to their"
                f" sensors, {found}."
            )
        return (
            "Nothing was added to the database, because no single effect is proved; found:"
            f" {found}."
        )
    count = len(document["not_found"])
    return (
        f"Nothing was found that the database lacks, in {count} hypotheses; what size that excludes"
        " is listed below."
    )


def _lacked(added: Sequence[Mapping[str, Any]]) -> str:
    """What the database lacked; what entered without proof, because somebody asked for it, is never
    told as a fact."""
    proved = [finding for finding in added if finding["verdict"] in ADDED]
    asked = [finding for finding in added if finding not in proved]
    said = []
    if proved:
        gloss = f" ({added[0]['because'].partition(':')[0]})" if len(added) == 1 else ""
        said.append(
            f"The database lacked {listed([effect_words(finding) for finding in proved])}{gloss}"
        )
    if asked:
        verdicts = listed(
            list(dict.fromkeys(finding["verdict"].replace("_", " ") for finding in asked))
        )
        words = listed([effect_words(finding) for finding in asked])
        one = len(asked) == 1
        note = f"only {verdicts}, added because you asked for {'it' if one else 'them'}"
        said.append(
            f"{words} {'is' if one else 'are'} {note}"
            if proved
            else f"The database may lack {words}: {note}"
        )
    return "; ".join(said)


def effect_words(finding: Mapping[str, Any]) -> str:
    """A finding's effect, what it is of and its axes, as words."""
    axes = "all axes" if len(finding["axis"]) == len(AXES) else ", ".join(finding["axis"])
    subject = f" of {finding['subject'].replace('_', ' ')}" if finding["subject"] else ""
    return f"{finding['effect'].replace('_', ' ')}{subject} on {axes}"


def listed(entries: Sequence[str]) -> str:
    """Entries as a list in a sentence.

    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    return entries[0] if len(entries) == 1 else f"{', '.join(entries[:-1])} and {entries[-1]}"


def _worth(document: Mapping[str, Any]) -> str:
    """What the axis whose error changed most gained, and which axes became worse."""
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
    said = (
        f"{on_which(document)}{comma} the error of {best['axis']} {verb} from {best['before']:.3g}"
        f" to {best['after']:.3g} rms ({100 * abs(change):.0f} %"
        f" {'less' if change > 0 else 'more'})"
    )
    worse = [
        row["axis"]
        for row in rows
        if row["after"] > (1 + UNCHANGED) * row["before"] and row is not best
    ]
    return f"{said}, but that of {listed(worse)} rises" if worse else said


def on_which(document: Mapping[str, Any]) -> str:
    """What the errors were taken on."""
    if by_parts(document):
        return "with heads and tails of the flights predicted from the rest"
    n = len(document["flights"]["held_out"])
    return _WHOLE[document["validation"]["kind"]].format(n=n, s="" if n == 1 else "s")


def by_parts(document: Mapping[str, Any]) -> bool:
    """Whether flights were so few that parts of them were predicted from the rest."""
    inside = any("cross-validated within flights" in remark for remark in document["remarks"])
    return inside and document["validation"]["kind"] == "cross-validated"


def error_rows(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Per axis, in the usual order: error before and after where it proves most, noise floor,
    outcome, Theil's measure of fit."""
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
