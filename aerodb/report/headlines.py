"""The result of an update or a closed loop in one sentence, and the table of errors per axis."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from aerodb.increments import UNCHANGED
from aerodb.nomenclature import AXES, FORCE_AXES, ROLL_OUTPUTS
from aerodb.report.former_documents import former_within_flights
from aerodb.report.glossary import advice_words, effect_words, listed, the
from aerodb.report.numbers import for_people, number
from aerodb.tables import WIND_AXES
from aerodb.tracing import ADDED
from aerodb.units import UnitSystem

#: Axes in the usual order, and what rolls on the ground have in their place.
_ORDER: Final = (*AXES, *WIND_AXES, *ROLL_OUTPUTS)
_WHOLE: Final = {
    "held-out": "on {n} held-out flight{s}",
    "cross-validated": "with each flight predicted from the others",
    "not validated": "on the identification flights themselves, without validation",
}

#: The side force along the body and the wind axes, either way: close to the same.
_SAME: Final = (("CY", "C_side"), ("C_side", "CY"))
#: Part of the hypotheses above which nothing is said to be found, as nothing could have been.
_OPEN_SHARE: Final = 0.5
#: Verdict -> why a hypothesis stays open, in a sentence.
_WHY_OPEN: Final = {
    "not_testable": "too few flights show them",
    "not_excited": "no flight moves what they depend on",
    "not_separable": "these flights move together what they depend on",
}
#: Most findings that a sentence names.
_MOST_NAMED: Final = 3


def headline(document: Mapping[str, Any]) -> str:
    """Sum up the document of an update or a closed loop (docs/reference/contract.md, section JSON)
    in one sentence; raises KeyError for any other document."""
    if "library" not in document:
        if parameters := document.get("parameters", ()):
            names = listed([entry["name"] for entry in parameters])
            return f"The parameters {names} were estimated: {_worth(document)}."
        changed = changed_axes(document)
        axes = listed([axis for axis in (*AXES, *WIND_AXES) if axis in changed])
        return f"The declared increments on {axes} were estimated: {_worth(document)}."
    added = [
        finding for finding in document["findings"] if finding["hypothesis"] in document["added"]
    ]
    if added:
        asked_for = document.get("asked_for", document["added"])  # not in older documents
        lacked = _lacked(added, asked_for)
        return f"{lacked}; with {'it' if len(added) == 1 else 'them'}, {_worth(document)}."
    if document["findings"]:
        effects = _named(document["findings"])
        if all(entry["verdict"] == "sensor" for entry in document["findings"]):
            return (
                "Nothing was added to the database: the errors found are in the sensors,"
                f" {effects}."
            )
        proved = sum(entry["verdict"] in ADDED for entry in document["findings"])
        because = (
            f"although {proved} {'is' if proved == 1 else 'are'} confirmed"
            if proved
            else "because no single effect is confirmed"
        )
        return f"Nothing was added to the database, {because}; found: {effects}."
    count = len(document["not_found"])
    undecided = [entry for entry in document["not_found"] if entry["verdict"] != "not_detected"]
    if len(undecided) > _OPEN_SHARE * count:
        most = Counter(entry["verdict"] for entry in undecided).most_common(1)[0][0]
        fly = advice_words(document["next_flight"][0]) if document["next_flight"] else ""
        return (
            f"These flights cannot decide what the database lacks: {len(undecided)} of {count}"
            f" hypotheses stay open, most because {_WHY_OPEN[most]}."
            + (f" Next flight: {fly}." if fly else "")
        )
    return (
        f"Nothing was found that the database lacks: {count} hypotheses were tested, and the"
        " sizes that these flights exclude are listed below."
    )


def excluded_sizes(entry: Mapping[str, Any], units: UnitSystem | None = None) -> dict[str, Any]:
    """Return what a hypothesis that was not found may still be, in display units: ``upper_bound``
    and ``minimum_detectable``, each None where it lies beyond every believable size and so says
    nothing, ``believable`` (None in older documents, of which undecided hypotheses have no bound)
    and ``unit``."""
    factor, unit = for_people(entry["unit"], units)
    believable = entry.get("believable")
    if believable is not None:
        most = max(map(abs, believable))
    else:
        most = math.inf if entry["verdict"] == "not_detected" else 0.0
    sizes = {key: entry[key] for key in ("upper_bound", "minimum_detectable")}
    return {
        **{
            key: factor * size if size is not None and size <= most else None
            for key, size in sizes.items()
        },
        "believable": [factor * end for end in believable] if believable else None,
        "unit": unit,
    }


def changed_axes(document: Mapping[str, Any]) -> set[str]:
    """Return the axes that an update or a closed loop changes: those of its increments; where it
    corrects parameters, those on which the error (dimensionless) is another."""
    changed = {entry["axis"] for entry in document["increments"]}
    if document.get("parameters"):
        changed |= {
            axis
            for axis, error in document["axes"].items()
            if axis in (*AXES, *ROLL_OUTPUTS) and error["rms_before"] != error["rms_after"]
        }
    return changed


def shown_axes(document: Mapping[str, Any]) -> list[str]:
    """Return the axes in which a document is told: forces along the body axes or along the wind
    axes, as its hypotheses and increments are written, and the moments. The other forces are the
    same ones once more."""
    changed = changed_axes(document)
    asked = [
        *changed,
        *(
            axis
            for entry in (*document["findings"], *document["not_found"])
            for axis in written_on(entry)
        ),
    ]
    along_wind = sum(axis in WIND_AXES for axis in asked) > sum(
        axis in FORCE_AXES for axis in asked
    )
    other = {*FORCE_AXES} if along_wind else {*WIND_AXES}
    other |= {own for own, same in _SAME if same in changed and own not in changed}
    return [
        axis
        for axis in _ORDER
        if axis in document["axes"] and (axis in changed or axis not in other)
    ]


def _named(findings: Sequence[Mapping[str, Any]]) -> str:
    """The names of findings with their verdicts, the first `_MOST_NAMED` of them."""
    names = [
        f"{the(effect_words(entry))} ({entry['verdict'].replace('_', ' ')})" for entry in findings
    ]
    more = len(names) - _MOST_NAMED
    return listed([*names[:_MOST_NAMED], f"{more} more"] if more > 1 else names)


def _lacked(added: Sequence[Mapping[str, Any]], asked_for: Sequence[str]) -> str:
    """Clause about the added effects; an unconfirmed one, added on request, is no stated fact, nor
    is what had to come with it."""
    proved = [finding for finding in added if finding["verdict"] in ADDED]
    others = [finding for finding in added if finding not in proved]
    requested = [finding for finding in others if finding["hypothesis"] in asked_for]
    companions = [finding for finding in others if finding not in requested]
    clauses = []
    if proved:
        clauses.append(f"The database lacked {_effects(proved)}")
    if requested:
        verdicts = listed(
            list(dict.fromkeys(finding["verdict"].replace("_", " ") for finding in requested))
        )
        words = _effects(requested)
        one = len(requested) == 1
        note = f"only {verdicts}, added because you asked for {'it' if one else 'them'}"
        clauses.append(
            f"{words} {'is' if one else 'are'} {note}"
            if proved
            else f"The database may lack {words}: {note}"
        )
    if companions and not (proved or requested):
        axes = listed(list(dict.fromkeys(axis for each in companions for axis in written_on(each))))
        clauses.append(f"The error of {axes} was corrected as a whole, by {_effects(companions)}")
    elif companions:
        clauses.append(
            f"{_effects(companions)} came along, beside which"
            f" {'it was' if len(requested) == 1 else 'they were'} estimated"
        )
    return "; ".join(clauses)


def written_on(finding: Mapping[str, Any]) -> list[str]:
    """The axes that a hypothesis names."""
    axes: str = finding["hypothesis"].partition("@")[2].partition(":")[0]
    return axes.split("+")


def _effects(findings: Sequence[Mapping[str, Any]]) -> str:
    names = [the(effect_words(finding)) for finding in findings]
    more = len(names) - _MOST_NAMED
    return listed([*names[:_MOST_NAMED], f"{more} more effects"] if more > 1 else names)


def best_and_worse(document: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]] | None:
    """Return the row (`error_rows`, dimensionless) of the changed axis that gained most, and the
    changed axes whose error grew; None where no changed axis could be compared."""
    touched = changed_axes(document)
    rows = [
        row
        for row in error_rows(document)
        if row["axis"] in touched and row["before"] and row["after"] is not None
    ]
    if not rows:
        return None
    best = min(rows, key=lambda row: row["after"] / row["before"])
    worse = [
        row["axis"]
        for row in rows
        if row["after"] > (1 + UNCHANGED) * row["before"] and row is not best
    ]
    return best, worse


def _worth(document: Mapping[str, Any]) -> str:
    """Clause about the axis whose error changed most, and about axes that became worse."""
    gained = best_and_worse(document)
    if gained is None:
        return "no axis could be compared"
    best, worse = gained
    change = 1 - best["after"] / best["before"]
    verb = "falls" if change > 0 else "rises"
    comma = "" if document["flights"]["held_out"] else ","
    sentence = (
        f"{on_which(document)}{comma} the error of {best['axis']} {verb} from"
        f" {number(best['before'])} to {number(best['after'])} rms ({100 * abs(change):.0f} %"
        f" {'less' if change > 0 else 'more'})"
    )
    return f"{sentence}, but that of {listed(worse)} rises" if worse else sentence


def on_which(document: Mapping[str, Any]) -> str:
    """Return a phrase on which flights the errors were computed (docs/reference/conventions.md,
    section Hold-out)."""
    if by_parts(document):
        return "with the first and last parts of the flights predicted from the rest"
    n = len(document["flights"]["held_out"])
    return _WHOLE[document["validation"]["kind"]].format(n=n, s="" if n == 1 else "s")


def by_parts(document: Mapping[str, Any]) -> bool:
    """Return whether validation was within flights: parts of them predicted from the rest."""
    stated = document["validation"].get("within_flights")
    return former_within_flights(document) if stated is None else bool(stated)


def error_rows(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return rows of the error table in the usual axis order, errors dimensionless, of rolls on the
    ground in display units.

    Each row has the axis, its ``label`` with the unit, the error before and after (held-out where
    there is one), the error on the identification flights, without constants, the noise floor, the
    error in parts of what the axis varied in flight, the outcome and Theil's fit.
    """
    rows = []
    for axis in sorted(document["axes"], key=_ORDER.index):
        entry = document["axes"][axis]
        held = "held_out_" if entry["held_out_rms_after"] is not None else ""
        factor, unit = for_people(entry["unit"]) if "unit" in entry else (1.0, "")
        entry = {
            key: value * factor if _is_error(key, value) else value for key, value in entry.items()
        }
        after, floor = entry[f"{held}rms_after"], entry["noise_floor"]
        explained = entry["explained"]
        rows.append(
            {
                "axis": axis,
                "label": f"{axis} [{unit}]" if unit else axis,
                "before": entry[f"{held}rms_before"],
                "after": after,
                "used_before": entry["rms_before"],
                "used_after": entry["rms_after"],
                "shape_before": entry["held_out_without_constant_before"],
                "shape_after": entry["held_out_without_constant_after"],
                "floor": floor,
                "times_floor": after / floor if after is not None and floor else None,
                "of_flown": float(np.sqrt(1.0 - explained)) if explained <= 1.0 else None,
                "fit": entry["theil"]["fit_percent"] if entry["theil"] else None,
                "outcome": entry["outcome"],
            }
        )
    return rows


def _is_error(key: str, value: Any) -> bool:
    """Whether an entry of an axis is an error in its unit."""
    return isinstance(value, float) and key != "explained"
