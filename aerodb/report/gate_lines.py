"""What to decide a release on, in rows and words: what changes, proof, gate, responses, what is
open. The terminal, the console and the report of a version show the same.

Everything is taken from documents: of `aerodb.tasks.steps.judge_version`, of the version's report,
and of `aerodb.tasks.steps.summarise_responses`.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from aerodb.report.decision import decision
from aerodb.report.glossary import listed
from aerodb.report.terms import term_unit
from aerodb.support import counted
from aerodb.units import UnitSystem

#: Label of a check -> its numbers in words, and their unit: those that measures do not say.
_SAID: Final[Mapping[str, tuple[str, str]]] = {
    "derivatives": ("{} changes by", "%"),
    "repeatability": ("error of {} grows by", ""),
}
#: Most changes and open points that a line names.
_MOST: Final = 4


@dataclass(frozen=True)
class GateRow:
    """One check of the gate: what it found and the limit, as text; empty where it has no number.

    label : its name in one or two words; name : in full. reasons : why it failed, in sentences.
    """

    label: str
    name: str
    passed: bool
    found: str
    limit: str
    reasons: tuple[str, ...]


def gate_rows(checks: Iterable[Mapping[str, Any]]) -> list[GateRow]:
    """Return a row per check of the gate's document, in its order; of several numbers that are held
    to a limit, a row has the one that is nearest to it."""
    rows = []
    for check in checks:
        told = check.get("not_judged")
        found, limit = (told, "") if told else _measured(check["label"], check["measures"])
        rows.append(
            GateRow(
                check["label"],
                check["name"],
                check["passed"],
                found,
                limit,
                tuple(check["reasons"]),
            )
        )
    return rows


def count_passed(checks: Sequence[Mapping[str, Any]]) -> str:
    """Return how many checks of the gate pass, and the names of those that fail.

    >>> count_passed([{"label": "parent", "passed": True}, {"label": "signs", "passed": False}])
    '1 of 2 checks pass; fails signs'
    """
    failed = [check["label"] for check in checks if not check["passed"]]
    count = f"{len(checks) - len(failed)} of {counted(len(checks), 'check')}"
    return f"{count} pass" + (f"; fails {listed(failed)}" if failed else "")


def derivative_words(derivatives: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return each change of a derivative in words, with its unit and the change in per cent.

    derivatives : of the gate's document or of a version's report, per SI unit of the variable.

    >>> derivative_words([{"axis": "CZ", "variable": "alpha", "before": -2.24, "after": -2.48}])
    ['slope of CZ with alpha -2.24 -> -2.48 1/rad (+11 %)']
    """
    changes = []
    for each in derivatives:
        before, after, unit = each["before"], each["after"], term_unit(each["variable"])
        part = f" ({100.0 * (after / before - 1.0):+.0f} %)" if before else ""
        changes.append(
            f"slope of {each['axis']} with {each['variable']}"
            f" {before:.3g} -> {after:.3g} {unit}{part}"
        )
    return changes


def release_lines(
    gate: Mapping[str, Any] | None,
    report: Mapping[str, Any],
    responses: Mapping[str, Any] | None,
    trim: Sequence[str] = (),
) -> list[tuple[str, list[str]]]:
    """Return label and texts of what to decide a release on; labels without a text are absent.

    gate : of `judge_version`; None for a name that it does not guard. report : of the version (that
    of an import has no ``axes``). responses : of `summarise_responses`; None where nobody has flown
    the version. trim : what changes in trim and modes, in words.
    """
    told = {}
    if "axes" in report and gate is not None:
        told = dict(decision({**report, "label": gate["label"]}, rest="below").lines)
    changes = derivative_words(report.get("derivatives") or ())
    checks = [] if gate is None else gate["checks"]
    found = [*told.get("found", ()), *told.get("also", ())]
    lines = [
        ("changes", _first(changes, "smaller")),
        ("found", [] if changes else found),
        ("trim", [*trim]),
        ("proved", [*told.get("proved", ())]),
        ("gate", [count_passed(checks)] if checks else []),
        ("refused", _first([each for check in checks for each in check["reasons"]], "more")),
        ("responses", [_within(responses)] if responses else []),
        ("open", [*told.get("left", ()), *_first([] if gate is None else gate["notes"], "more")]),
    ]
    return [(label, texts) for label, texts in lines if texts]


def version_lines(
    report: Mapping[str, Any], label: str, units: UnitSystem | None = None, rest: str = "below"
) -> list[tuple[str, Sequence[str]]]:
    """Return label and texts of what a version is, without asking the gate: what was found, proof,
    and what is left; none for an import, whose report has no ``axes``.

    report : of the version; label : its name; rest : where the rest is told. Errors are rms of
    dimensionless coefficients.
    """
    if "axes" not in report:
        return []
    told = dict(decision({**report, "label": label}, units, rest).lines)
    return [(name, told[name]) for name in ("found", "proved", "also", "left") if name in told]


def _first(texts: Sequence[str], rest: str) -> list[str]:
    """Return the first texts, and how many more there are."""
    over = len(texts) - _MOST
    return [*texts[:_MOST], *([f"{over} {rest}"] if over > 0 else [])]


def count_within(responses: Mapping[str, Any], baseline: str = "baseline") -> str:
    """Return how many checks of responses are within tolerance, and how many of the baseline of
    this label.

    >>> count_within({"checks": [{"passed": 2, "manoeuvres": 3, "before": None}]})
    '2 of 3'
    """
    checks = responses["checks"]
    before = [check["before"] for check in checks if check["before"]]
    return _sum(checks) + (f" ({baseline}: {_sum(before)})" if before else "")


def _within(responses: Mapping[str, Any]) -> str:
    """Return how many checks of responses are within tolerance, those of the baseline beside them,
    how many manoeuvres were flown with the feedback closed, and the open-loop result."""
    words = (
        f"{count_within(responses)} within tolerance; feedback closed in"
        f" {responses['stabilised']} of {responses['manoeuvres']} manoeuvres"
    )
    alone = responses.get("feedback")
    return f"{words} (open loop: {alone['passed']} of {alone['checks']})" if alone else words


def _sum(checks: Iterable[Mapping[str, Any]]) -> str:
    held = list(checks)
    return f"{sum(c['passed'] for c in held)} of {sum(c['manoeuvres'] for c in held)}"


def _measured(label: str, measures: Sequence[Mapping[str, Any]]) -> tuple[str, str]:
    """Return what the check of this label found, and its limit: of several measures that are held
    to a limit, the one that is nearest to it."""
    plain = [each for each in measures if each["limit"] is None and each["before"] is None]
    held = [each for each in measures if each["limit"] is not None]
    words = [_found(label, each) for each in plain]
    if not held:
        return ", ".join(words), ""
    worst = min(held, key=_room)
    words.append(_found(label, worst))
    if worst["before"] is not None and worst["limit"] == worst["before"]:
        return ", ".join(words), "must fall"
    if not worst["limit"]:
        return ", ".join(words), "none"
    return ", ".join(words), f"{worst['bound']} {_shown(label, worst['limit'])}"


def _found(label: str, measure: Mapping[str, Any]) -> str:
    """Return a measure of the check of this label in words: counts stand before what they count.

    >>> _found("content", {"of": "unusual properties", "value": 0, "before": None, "unit": ""})
    '0 unusual properties'
    >>> _found("derivatives", {"of": "CZ_alpha", "value": 0.107, "before": None, "unit": ""})
    'CZ_alpha changes by 10.7 %'
    """
    of, value = measure["of"], measure["value"]
    if isinstance(value, int):
        return f"{value} {of}"
    shown = f"{_shown(label, value)} {measure['unit']}".rstrip()
    if measure["before"] is not None:
        shown = f"{_shown(label, measure['before'])} -> {shown}"
    return f"{_SAID.get(label, ('{}', ''))[0].format(of)} {shown}"


def _shown(label: str, value: float) -> str:
    """Return a number of the check of this label with the unit that the check gives it."""
    if _SAID.get(label, ("", ""))[1] == "%":
        return f"{100.0 * value:.3g} %"
    return f"{value:.3g}"


def _room(measure: Mapping[str, Any]) -> float:
    """Return how far a measure is from its limit, as a part of it; negative beyond it."""
    from aerodb.increments import AT_LEAST  # slow to import

    over = measure["value"] - measure["limit"]
    side = -1.0 if measure["bound"] != AT_LEAST else 1.0
    return side * float(over) / (abs(measure["limit"]) or 1.0)
