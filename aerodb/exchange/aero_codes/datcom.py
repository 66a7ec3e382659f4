"""Digital Datcom: the printed output, ``for006.dat`` or ``.out``.

- Derivatives are **per degree** unless the case says ``DERIV RAD``, those by rates too. The
  headings of the tables say which.
- CD, CL and CM are about stability axes. The file does not say which axes its lateral derivatives
  (CYB, CNB, CLB, CLP, ...) are about: this is asked.
- Blank cells of CYB, CNB, CLQ and CMQ repeat the value of the first angle; ``NDM`` means that
  Datcom has no method, and is no zero.
- XCG is aft and ZCG up, in the unit of the case (``DIM FT``, ``M``, ...), which the headings say.
- Of several configurations in a file (wing alone, ..., whole aircraft) the last one counts.
- Increments of flaps and controls are not read: the answer says that they are missing.

Layout: USAF Stability and Control Datcom, volume I, user's manual (AFFDL-TR-79-3032, 1979).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from aerodb.errors import InputError
from aerodb.exchange.aero_codes.answers import LENGTHS, Answers
from aerodb.exchange.aero_codes.controls import DEGREE
from aerodb.exchange.aero_codes.lines import Line, lines_of
from aerodb.exchange.aero_codes.runs import Run, database_of_runs, on_body_axes
from aerodb.tables import AeroDatabase

_TITLE: Final = "VERSION OF DATCOM"
#: Heading of a table -> names of its columns, with where each begins and ends.
_STATIC: Final = {
    "ALPHA": (1, 8),
    "CD": (8, 17),
    "CL": (17, 26),
    "CM": (26, 36),
    "CLA": (62, 75),
    "CMA": (75, 88),
    "CYB": (88, 101),
    "CNB": (101, 114),
    "CLB": (114, 140),
}
_DYNAMIC: Final = {
    "ALPHA": (1, 11),
    "CLQ": (11, 23),
    "CMQ": (23, 36),
    "CLAD": (36, 50),
    "CMAD": (50, 63),
    "CLP": (63, 76),
    "CYP": (76, 89),
    "CNP": (89, 102),
    "CNR": (102, 115),
    "CLR": (115, 140),
}
_TOTALS: Final = {"CD": "C_drag", "CL": "C_lift", "CM": "Cm"}
#: Column -> axis and regressor.
_SLOPES: Final = {
    "CLA": ("C_lift", "alpha"),
    "CMA": ("Cm", "alpha"),
    "CYB": ("CY", "beta"),
    "CNB": ("Cn", "beta"),
    "CLB": ("Cl", "beta"),
    "CLQ": ("C_lift", "q_hat"),
    "CMQ": ("Cm", "q_hat"),
    "CLAD": ("C_lift", "alphadot_hat"),
    "CMAD": ("Cm", "alphadot_hat"),
    "CLP": ("Cl", "p_hat"),
    "CYP": ("CY", "p_hat"),
    "CNP": ("Cn", "p_hat"),
    "CNR": ("Cn", "r_hat"),
    "CLR": ("Cl", "r_hat"),
}
_UNITS: Final = {"FT": "ft", "M": "m", "IN": "inch", "CM": "cm"}


@dataclass
class _Section:
    """A page of the output: its configuration, conditions, and rows by their tables."""

    line: Line
    lines: list[Line] = field(default_factory=list)
    conditions: list[float] = field(default_factory=list)
    unit: str = ""
    per: str = ""
    static: list[dict[str, float]] = field(default_factory=list)
    dynamic: list[dict[str, float]] = field(default_factory=list)
    missing: set[str] = field(default_factory=set)

    @property
    def title(self) -> str:
        """The configuration: the line below that of the page's kind."""
        below = [line.text.strip() for line in self.lines[1:3]]
        return below[0] if below else ""


def is_datcom(text: str) -> bool:
    """Return whether a text is printed by Digital Datcom."""
    return _TITLE in text


def import_datcom(files: Sequence[tuple[str, bytes]], name: str, answers: Answers) -> AeroDatabase:
    """Return the database of the last configuration in Datcom's output (name, content). Raises
    InputError with file and line, and OpenQuestionsError for what the output leaves open."""
    pages = _sections(files)
    static = [page for page in pages if page.static]
    if not static:
        raise InputError("no table of ALPHA, CD, CL and CM", files[0][0], "give for006.dat whole")
    title = static[-1].title
    static = [page for page in static if page.title == title]
    dynamic = {_key(page): page for page in pages if page.dynamic and page.title == title}
    first = static[0]
    if any(page.conditions[-5:] != first.conditions[-5:] for page in static):
        first.line.refuse("cases with different reference dimensions", "import each case alone")
    unit = answers.choice(
        "length_unit",
        dict.fromkeys(LENGTHS, ""),
        "the headings do not say the unit of length: which one?",
        _UNITS.get(first.unit, ""),
    )
    per = answers.choice(
        "derivatives_per",
        {"deg": "unless the case says DERIV RAD", "rad": "with DERIV RAD"},
        "the headings do not say what derivatives are per: which angle?",
        first.per,
    )
    about = answers.choice(
        "lateral_axes",
        {"stability": "", "body": ""},
        "which axes are the lateral derivatives (CYB, CNB, CLB, ...) about?",
    )
    scale = LENGTHS[unit]
    area, chord, span, x, z = first.conditions[-5:]
    reference = answers.reference(
        area * scale**2, chord * scale, span * scale, (-x * scale + 0.0, 0.0, -z * scale + 0.0)
    )
    factor = DEGREE if per == "deg" else 1.0
    runs = [run for page in static for run in _runs(page, dynamic.get(_key(page)), factor, about)]
    missing = sorted(set().union(*(page.missing for page in (*static, *dynamic.values()))))
    answers.notes.append(f"configuration: {title.lower()}; derivatives per {per}")
    if missing:
        answers.notes.append(f"Datcom has no method (NDM) for {', '.join(missing)}: left out")
    if not dynamic:
        answers.notes.append("no dynamic derivatives (the case lacks DAMP)")
    answers.notes.append("increments of flaps and controls are not read")
    answers.close()
    return database_of_runs(runs, name, reference, {}, f"Digital Datcom, {title}", answers.notes)


def _key(page: _Section) -> tuple[float, ...]:
    return tuple(page.conditions[:1])


def _sections(files: Sequence[tuple[str, bytes]]) -> list[_Section]:
    pages: list[_Section] = []
    columns: Mapping[str, tuple[int, int]] | None = None
    rows: list[dict[str, float]] = []
    before: Line | None = None
    units: Line | None = None
    for line in lines_of(files):
        words = line.text.split()
        if _TITLE in line.text:
            pages.append(_Section(line))
            columns = units = None
        elif pages and words:
            page = pages[-1]
            page.lines.append(line)
            if "PER DEGREE" in line.text or "PER RADIAN" in line.text:
                page.per = "deg" if "PER DEGREE" in line.text else "rad"
            if words[:2] == ["MACH", "ALTITUDE"]:
                units, page.conditions = line, []
            elif units is not None and words[0].startswith("0") and not page.conditions:
                page.conditions = _conditions(line)
                page.unit = before.text.split()[-1] if before else ""
            elif words[:4] == ["0", "ALPHA", "CD", "CL"]:
                columns, rows = _STATIC, page.static
            elif words[:3] == ["0", "ALPHA", "CLQ"]:
                columns, rows = _DYNAMIC, page.dynamic
            elif words == ["0"]:
                pass
            elif columns and line.text.startswith(" ") and _is_number(words[0]):
                rows.append(_row(line, columns, rows, page.missing))
            elif columns:
                columns = None
            before = line
    for page in pages:
        if page.static and len(page.conditions) < 6:
            page.line.refuse("no line of MACH, ALTITUDE and reference dimensions")
    return pages


def _is_number(text: str) -> bool:
    return text.lstrip("+-").replace(".", "", 1).isdigit()


def _conditions(line: Line) -> list[float]:
    """Mach number and the numbers behind it; the last five are area, chord, span and the centre."""
    words = line.text.split()
    words = words[1:] if words[0] == "0" else [words[0][1:], *words[1:]]
    numbers = [line.value(word, "a flight condition") for word in words]
    if len(numbers) < 6:
        line.refuse(f"{len(numbers)} numbers of flight condition and reference dimensions")
    return numbers


def _row(
    line: Line,
    columns: Mapping[str, tuple[int, int]],
    above: Sequence[dict[str, float]],
    missing: set[str],
) -> dict[str, float]:
    """The numbers of a line; blank cells have the value of the first line."""
    row: dict[str, float] = {}
    for name, (begin, end) in columns.items():
        cell = line.text[begin:end].strip()
        if cell.startswith("NDM"):
            missing.add(name)
        elif cell:
            row[name] = line.value(cell, name)
        elif above and name in above[0]:
            row[name] = above[0][name]
    return row


def _runs(page: _Section, dynamic: _Section | None, factor: float, about: str) -> list[Run]:
    by_alpha = {row["ALPHA"]: row for row in dynamic.dynamic} if dynamic else {}
    left = page.missing | (dynamic.missing if dynamic else set())
    runs = []
    for row in page.static:
        near = min(by_alpha, key=lambda x: abs(x - row["ALPHA"]), default=None)
        # The static table prints one digit of the angle, the dynamic one two.
        damped = by_alpha[near] if near is not None and abs(near - row["ALPHA"]) < 0.06 else {}
        known = {**damped, **row}
        lacking = [n for n in _TOTALS if n not in known]
        if lacking:
            page.line.refuse(f"no {lacking[0]} at {row['ALPHA']:g} deg")
        totals = {axis: known[n] for n, axis in _TOTALS.items()}
        totals |= dict.fromkeys(("CY", "Cl", "Cn"), 0.0)
        slopes: dict[str, dict[str, float]] = {}
        for column, (axis, by) in _SLOPES.items():
            if column in known and column not in left:
                slopes.setdefault(axis, {})[by] = known[column] * factor
        state = {"alpha": math.radians(row["ALPHA"])}
        run = Run(page.line.where, page.conditions[0], totals, slopes, state)
        runs.append(on_body_axes(run) if about == "stability" else run)
    return runs
