"""The qualification table of a version: each check of each manoeuvre as a test of a standard, as an
annex to a qualification test guide (QTG), with what the standard asks for and no flight covers.

Everything is taken from the document of `aerodb.tasks.steps.summarise_responses`. Quantities are in
the units in which the standards state tolerances: kt, ft, deg and g; masses are in kg.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from aerodb.exchange import csv_text
from aerodb.nomenclature import channel
from aerodb.report.numbers import display_unit
from aerodb.units import UnitSystem, conversion

#: Units of the standards' tolerances, but for accelerations.
_TRADE: Final = UnitSystem("aero")
#: Unit of the figures of an oscillation, by what a band is `of`.
_FIGURES: Final = {"period": "s", "half_time": "s", "damping": ""}
#: What a check without a paragraph says in its place.
UNCHECKED: Final = "no paragraph"
#: What a paragraph says of itself that nobody compared with the text.
NOT_COMPARED: Final = "not compared with the text"

#: Most rows of a page's table.
MOST_ROWS: Final = 100

_CASE: Final = (
    "test", "title", "condition asked for", "not judged", "compared with the text", "check",
    "flight", "manoeuvre",
    "from [s]", "to [s]", "true airspeed [kt]", "altitude [ft]", "mass [kg]", "configuration",
    "tolerance", "time inside required [%]",
)  # fmt: skip
_OUTCOME: Final = (
    "largest deviation", "time inside [%]", "result", "largest correction by feedback [deg]",
    "open loop: largest deviation", "open loop: time inside [%]", "open loop: result",
)  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """How a version did in a case, as text: largest deviation, share of time inside [%], result;
    alone is the outcome without the feedback, if it was closed."""

    deviation: str
    inside: str
    result: str
    alone: "Outcome | None"


@dataclass(frozen=True)
class QualificationRow:
    """A case of the table, as text.

    test : number of the paragraph, or `UNCHECKED`. before : of the baseline; None without one.
    """

    test: str
    check: str
    case: str
    condition: str
    configuration: str
    tolerance: str
    after: Outcome
    before: Outcome | None


def qualification_rows(summary: Mapping[str, Any]) -> list[QualificationRow]:
    """Return a row per case of the summary, in the order of the tests; none where a summary has no
    cases."""
    return [
        QualificationRow(
            case["test"] or UNCHECKED,
            case["check"],
            f"{case['name']}, {case['since']:.1f} to {case['until']:.1f} s",
            _condition(case["condition"]),
            _configuration(case["condition"], whole=False),
            _tolerance(case["bands"]),
            _outcome(case),
            _outcome(case["before"]) if case["before"] else None,
        )
        for case in _in_order(summary)
    ]


@dataclass(frozen=True)
class QualificationTable:
    """What a page shows of the table: rows, how many more there are, and sentences on feedback,
    tests that are not covered, in words and by number alone, and the standard."""

    rows: Sequence[QualificationRow]
    left_out: int
    feedback: Sequence[str]
    uncovered: str
    uncovered_numbers: str
    standard: Sequence[str]


def qualification_table(
    summary: Mapping[str, Any] | None, most: int = MOST_ROWS
) -> QualificationTable | None:
    """Return the table of a page with at most `most` rows; None where a summary has no cases, as
    those of earlier releases."""
    rows = qualification_rows(summary) if summary else []
    if not rows or summary is None:
        return None
    return QualificationTable(
        rows[:most],
        max(0, len(rows) - most),
        feedback_words(summary),
        uncovered_words(summary),
        uncovered_numbers(summary),
        standard_words(summary),
    )


def qualification_csv(summary: Mapping[str, Any], version: str, baseline: str) -> str:
    """Return the table as CSV text: a row per case, with the columns of both versions side by side,
    then a row per test that no case covers.

    version, baseline : labels; baseline is empty without one. Units are in the header.
    """
    standard = summary.get("standard") or {"source": "", "unchecked": [], "tests": []}
    tests = {test["number"]: test for test in standard["tests"]}
    versions = [version, *([baseline] if baseline else [])]
    header = [*_CASE, *(f"{label}: {column}" for label in versions for column in _OUTCOME)]
    rows: list[list[object]] = []
    for case in _in_order(summary):
        test = tests.get(case["test"], {})
        where = case["condition"] or {"V": None, "altitude": None, "mass": None}
        required = case["required"]
        rows.append(
            [
                case["test"] or UNCHECKED,
                *(test.get(key, "") for key in ("title", "condition", "not_judged")),
                _compared(test) if test else "",
                case["check"],
                case["name"],
                case["kind"],
                f"{case['since']:.2f}",
                f"{case['until']:.2f}",
                _plain(where["V"], _TRADE.scale("m/s")[0]),
                _plain(where["altitude"], _TRADE.scale("m")[0]),
                _plain(where["mass"], 1.0),
                _configuration(case["condition"]),
                _tolerance(case["bands"]),
                "" if required is None else f"{100.0 * required:.0f}",
                *_outcome_cells(case),
                *(_outcome_cells(case["before"]) if baseline else ()),
            ]
        )
    for test in summary.get("not_covered", ()):
        cells = [test["number"], test["title"], test["condition"], "", _compared(test)]
        rows.append(_padded(cells, ["not covered"] * len(versions)))
    for each in summary["not_flown"]:
        cells = ["", each["reason"], "", "", "", "", each["name"], "", f"{each['since']:.2f}"]
        rows.append(_padded([*cells, f"{each['until']:.2f}"], ["not flown"] * len(versions)))
    for told in (*feedback_words(summary), *standard_words(summary)):
        rows.append(_padded(["note", told], [""] * len(versions)))
    return csv_text(header, rows)


def _padded(cells: Sequence[str], results: Iterable[str]) -> list[object]:
    """A row of the table with these first cells, and a result per version."""
    row = [*cells, *[""] * (len(_CASE) - len(cells))]
    for result in results:
        row += [result if column == "result" else "" for column in _OUTCOME]
    return [*row]


def standard_words(summary: Mapping[str, Any]) -> list[str]:
    """Return in sentences which text the numbers of the tests are of, what of each was compared
    with it, with which standards nothing was, and which part of a tolerance nobody judged."""
    standard = summary.get("standard")
    if not standard or not standard["source"]:
        return []
    words = [f"Numbers of tests: {standard['source']}."]
    compared: dict[str, list[str]] = {}
    for test in standard["tests"]:
        compared.setdefault(_compared(test), []).append(test["number"])
    for what in sorted(compared, key=lambda what: (what == NOT_COMPARED, -len(what))):
        numbers = _ranges(compared[what])
        words.append(
            f"Not compared with that text: {numbers}."
            if what == NOT_COMPARED
            else f"Compared with that text, {what}: {numbers}."
        )
    words += [f"Nothing was compared with {each}." for each in standard["unchecked"]]
    used = {case["test"] for case in summary["cases"]}
    words += [
        f"Not judged in {test['number']}: {test['not_judged']}."
        for test in standard["tests"]
        if test["not_judged"] and test["number"] in used
    ]
    return words


def _compared(test: Mapping[str, Any]) -> str:
    """What of a paragraph was compared with the standard's text."""
    return test.get("compared") or NOT_COMPARED


def uncovered_words(summary: Mapping[str, Any]) -> str:
    """Return which tests of the standard no flight covers; empty where it covers all.

    >>> uncovered_words({"not_covered": [{"number": "2.c.9", "title": "phugoid dynamics"}]})
    'not covered: 2.c.9 phugoid dynamics'
    """
    left = summary.get("not_covered") or ()
    named = "; ".join(f"{test['number']} {test['title']}" for test in left)
    return f"not covered: {named}" if named else ""


def uncovered_numbers(summary: Mapping[str, Any]) -> str:
    """Return the numbers of the tests that no flight covers, in short; empty where it covers
    all."""
    return _ranges([test["number"] for test in summary.get("not_covered") or ()])


def _ranges(numbers: Sequence[str]) -> str:
    """Return numbers of tests in short, those that follow one another as a range.

    >>> _ranges(["2.c.1", "2.c.2", "2.c.3", "2.d.1", "2.d.3", "2.d.4"])
    '2.c.1-3, 2.d.1, 2.d.3-4'
    """
    runs: list[list[str]] = []
    for number in numbers:
        head, _, last = number.rpartition(".")
        before = f"{head}.{int(last) - 1}" if last.isdecimal() else ""
        if runs and runs[-1][-1] == before:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(
        run[0] if len(run) == 1 else f"{run[0]}-{run[-1].rpartition('.')[2]}" for run in runs
    )


def feedback_words(summary: Mapping[str, Any]) -> list[str]:
    """Return in sentences how often feedback was closed and by how much it corrected, and the
    open-loop result; none where it was not."""
    told = zip(("Feedback was", "Open loop,"), feedback_lines(summary), strict=False)
    return [f"{begin} {text}." for begin, text in told]


def feedback_lines(summary: Mapping[str, Any], units: UnitSystem = _TRADE) -> list[str]:
    """Return how often feedback was closed and by how much it corrected, and the open-loop result;
    none where it was not."""
    known = summary.get("feedback")
    if not known:
        return []
    flown, correction = (summary["stabilised"], summary["manoeuvres"]), known["correction"]
    alone = f"{known['passed']} of {known['checks']} checks are within tolerance"
    if known["doubling_time"] is not None:
        alone += f": the fastest motion doubles in {known['doubling_time']:.2f} s"
    return [closed_words(*flown, "manoeuvres", correction, units), alone]


def closed_words(closed: int, flown: int, what: str, correction: float, units: UnitSystem) -> str:
    """Return in how many of what was flown feedback was closed, and by how much [rad] it moved a
    control."""
    moved = units.shown(correction, "rad", 2)
    return f"closed in {closed} of {flown} {what}; it moved a control by up to {moved}"


def _in_order(summary: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Cases in the order of the standard's tests, check by check; those without a paragraph are
    last."""
    standard = summary.get("standard")
    numbers = [test["number"] for test in standard["tests"]] if standard else []
    place = {number: k for k, number in enumerate(numbers)}
    cases = summary.get("cases", ())
    checks = list(dict.fromkeys(case["check"] for case in cases))
    return sorted(
        cases,
        key=lambda case: (place.get(case["test"], len(place)), checks.index(case["check"])),
    )


def _outcome(found: Mapping[str, Any]) -> Outcome:
    alone = found.get("open_loop")
    return Outcome(
        _deviation(found["bands"]),
        f"{100.0 * found['share']:.0f}",
        "pass" if found["passed"] else "FAIL",
        _outcome(alone) if alone else None,
    )


def _outcome_cells(found: Mapping[str, Any] | None) -> list[str]:
    if found is None:
        return [""] * len(_OUTCOME)
    told, moved = _outcome(found), found.get("correction")
    shown = (told, told.alone)
    cells = [[each.deviation, each.inside, each.result] if each else [""] * 3 for each in shown]
    return [*cells[0], _plain(moved, _TRADE.scale("rad")[0], 3), *cells[1]]


def _plain(value: float | None, factor: float, digits: int = 1) -> str:
    return "" if value is None else f"{factor * value:.{digits}f}"


def _condition(at: Mapping[str, Any] | None) -> str:
    if at is None:
        return ""
    told = [(at["V"], "m/s"), (at["altitude"], "m"), (at["mass"], "kg")]
    return ", ".join(_TRADE.shown(value, unit) for value, unit in told if value is not None)


def _configuration(at: Mapping[str, Any] | None, whole: bool = True) -> str:
    """Positions of flaps, gear and brakes in words; without `whole` those that are not zero."""
    told = []
    for name, value in (at["configuration"] if at else {}).items():
        factor, unit = display_unit(name, _TRADE)
        words = name.removeprefix("delta_").replace("_", " ")
        position = round(factor * value, 1) + 0.0
        if whole or position:
            told.append(f"{words} {position:g}{f' {unit}' if unit else ''}")
    return ", ".join(told)


def _band_scale(band: Mapping[str, Any]) -> tuple[float, str, str]:
    """Factor, unit and words of a band: accelerations are in g, as the standards have them."""
    if band["of"]:
        return 1.0, _FIGURES[band["of"]], f"{band['of'].replace('_', ' ')} of {band['channel']}"
    unit = channel(band["channel"]).unit
    if unit == "m/s^2":
        return 1.0 / conversion("g", unit)[0], "g", band["channel"]
    factor, shown = _TRADE.scale(unit)
    return factor, shown, band["channel"]


def _tolerance(bands: Iterable[Mapping[str, Any]] | None) -> str:
    told = []
    for band in bands or ():
        factor, unit, words = _band_scale(band)
        if band["limit"] is not None:
            told.append(f"{words} ±{factor * band['limit']:.3g} {unit}".rstrip())
    return " or ".join(told)


def _deviation(bands: Sequence[Mapping[str, Any]] | None) -> str:
    told = []
    for band in bands or ():
        factor, unit, words = _band_scale(band)
        if band["deviation"] is None:
            told.append(f"{words} {'without a value' if band['of'] else 'ended early'}")
        else:
            away = factor * band["deviation"]
            told.append(f"{words} {away:{'.0f' if away >= 10.0 else '.2g'}} {unit}".rstrip())
    return ", ".join(told)
