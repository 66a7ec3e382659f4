"""OpenVSP VSPAERO: stability derivatives, ``.stab``, and sweeps, ``.polar``.

- Forces ``CFx CFy CFz`` and moments ``CMx CMy CMz`` are on the geometry's axes (x aft, y right, z
  up): CX = -CFx, CY = CFy, CZ = -CFz, Cl = -CMx, Cm = CMy, Cn = -CMz, as ``CMl CMm CMn`` are.
- Derivatives are per rad and per rate without dimension; those by control groups (``ConGrp_1``) are
  **per rad**, too, and the groups' names stand in the rows of cases, in the same order.
- ``CD`` of ``.stab`` is the induced drag; the parasite drag (``CDo``) is in the ``.polar`` alone.
- ``Xcg_`` is aft, ``Zcg_`` up. Lengths have the unit of the model, which the file does not name.
- A ``.polar`` has lift, drag and side force along wind axes; totals count, not ``CLi`` or ``CDo``.

The layouts are those of VSPAERO's own writers (OpenVSP, NASA Open Source Agreement).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.aero_codes.answers import Answers, length_unit
from aerodb.exchange.aero_codes.controls import control_name, control_variable
from aerodb.exchange.aero_codes.lines import Line, lines_of
from aerodb.exchange.aero_codes.points import database_of_points
from aerodb.exchange.aero_codes.runs import Run, database_of_runs, of_body_forces
from aerodb.support import counted
from aerodb.tables import AeroDatabase

_REFERENCE: Final = ("Sref_", "Cref_", "Bref_", "Xcg_", "Ycg_", "Zcg_")
_NEEDED: Final = (*_REFERENCE, "Mach_", "AoA_", "Beta_")
_CASES: Final = ("Base_Aero", "Alpha", "Beta", "Roll__Rate", "Pitch_Rate", "Yaw___Rate", "Mach")
_BY: Final = {"Alpha": "alpha", "Beta": "beta", "p": "p_hat", "q": "q_hat", "r": "r_hat"}
#: Row of derivatives -> axis, and its sign here.
_ROWS: Final = {
    "CFx": ("CX", -1.0),
    "CFy": ("CY", 1.0),
    "CFz": ("CZ", -1.0),
    "CMx": ("Cl", -1.0),
    "CMy": ("Cm", 1.0),
    "CMz": ("Cn", -1.0),
}
#: Axis -> columns of a polar that hold it, the first that is there counts, and its sign here.
_POLAR: Final = {
    "C_lift": (("CLtot", "CL"), 1.0),
    "C_drag": (("CDtot", "CD"), 1.0),
    "C_side": (("CStot", "CS"), 1.0),
    "Cl": (("CMxtot", "CMx"), -1.0),
    "Cm": (("CMytot", "CMy"), 1.0),
    "Cn": (("CMztot", "CMz"), -1.0),
}


@dataclass
class _Case:
    line: Line
    numbers: dict[str, float] = field(default_factory=dict)
    groups: list[str] = field(default_factory=list)
    columns: list[str] = field(default_factory=list)
    rows: dict[str, list[float]] = field(default_factory=dict)


def is_stab(text: str) -> bool:
    """Return whether a text is a ``.stab`` of VSPAERO."""
    return "Sref_" in text and "Base_Aero" in text


def is_polar(text: str) -> bool:
    """Return whether a text is a ``.polar`` of VSPAERO."""
    header = next((line.split() for line in text.splitlines() if line.strip()), [])
    return {"Beta", "Mach", "AoA", "L/D"} <= set(header)


def import_stab(files: Sequence[tuple[str, bytes]], name: str, answers: Answers) -> AeroDatabase:
    """Return the database of ``.stab`` files (name, content). Raises InputError with file and line
    for what is damaged, and OpenQuestionsError for what they leave open."""
    cases = _cases(files)
    first = cases[0].numbers
    for case in cases:
        for key in _REFERENCE:
            if case.numbers[key] != first[key]:
                case.line.refuse(f"{key} is {case.numbers[key]:g}, in the first {first[key]:g}")
    for key in ("Sref_", "Cref_", "Bref_"):
        if not first[key] > 0.0:
            cases[0].line.refuse(f"{key} is {first[key]:g}", "it must be positive")
    scale = length_unit(answers, first["Sref_"], first["Cref_"], first["Bref_"])
    x, y, z = (scale * first[key] for key in ("Xcg_", "Ycg_", "Zcg_"))
    reference = answers.reference(
        first["Sref_"] * scale**2,
        first["Cref_"] * scale,
        first["Bref_"] * scale,
        (-x + 0.0, y + 0.0, -z + 0.0),
    )
    runs = [_run(case) for case in cases]
    names = dict.fromkeys(group for case in cases for group in case.groups)
    controls = {
        control_name(group): control_variable(
            answers,
            group,
            [{a: by.get(control_name(group), 0.0) for a, by in run.slopes.items()} for run in runs],
            1.0,
            "rad",
            "VSPAERO",
        )
        for group in names
    }
    answers.notes.append("the drag is the induced one alone: the parasite drag is in the .polar")
    answers.close()
    count = counted(len(runs), "run")
    return database_of_runs(
        runs, name, reference, controls, f"VSPAERO, stability, {count}", answers.notes
    )


def _cases(files: Sequence[tuple[str, bytes]]) -> list[_Case]:
    cases: list[_Case] = []
    for line in lines_of(files):
        words = line.text.split()
        if not words or words[0][0] in "#*":
            continue
        if words[0] == "Sref_" or not cases:
            cases.append(_Case(line))
        case = cases[-1]
        if words[0] in _NEEDED and len(words) > 1:
            case.numbers[words[0]] = line.value(words[1], words[0])
        elif words[0] == "Coef":
            case.columns = words[1:]
        elif words[0] in _ROWS and case.columns:
            case.rows[words[0]] = _row(line, case.columns)
        elif not case.columns and len(words) > 13 and words[0] not in (*_CASES, "Case"):
            case.groups.append(" ".join(words[: len(words) - 14]))
    for case in cases:
        lacking = [key for key in _NEEDED if key not in case.numbers]
        lacking += [row for row in _ROWS if row not in case.rows]
        if lacking:
            case.line.refuse(f"the case that begins here has no {', '.join(lacking[:4])}")
        if case.groups and len(case.groups) != len(_group_columns(case)):
            case.line.refuse(
                f"{len(case.groups)} rows of control groups, {len(_group_columns(case))} columns"
            )
    return cases


def _row(line: Line, columns: Sequence[str]) -> list[float]:
    cells = line.text.split()[1:]
    if len(cells) != len(columns):
        line.refuse(f"{len(cells)} values below {len(columns)} columns")
    return [line.value(cell, column) for cell, column in zip(cells, columns, strict=True)]


def _group_columns(case: _Case) -> list[str]:
    return [column for column in case.columns if column.startswith("ConGrp")]


def _run(case: _Case) -> Run:
    if case.columns[:1] != ["Total"]:
        case.line.refuse("the derivatives have no column 'Total'")
    owner = dict(zip(_group_columns(case), map(control_name, case.groups), strict=False))
    totals, slopes = {}, {}
    for row, (axis, sign) in _ROWS.items():
        values = dict(zip(case.columns, case.rows[row], strict=True))
        totals[axis] = sign * values["Total"]
        slopes[axis] = {
            (_BY.get(column) or owner[column]): sign * value
            for column, value in values.items()
            if column in _BY or column in owner
        }
    alpha = math.radians(case.numbers["AoA_"])
    made, turned = of_body_forces(totals, slopes, alpha)
    state = {"alpha": alpha, "beta": math.radians(case.numbers["Beta_"])}
    return Run(case.line.where, case.numbers["Mach_"], made, turned, state)


def import_polar(files: Sequence[tuple[str, bytes]], name: str, answers: Answers) -> AeroDatabase:
    """Return the database of ``.polar`` files (name, content). Raises InputError with file and line
    for what is damaged, and OpenQuestionsError for what they leave open."""
    header: list[str] = []
    rows: list[dict[str, float]] = []
    for line in lines_of(files):
        words = line.text.split()
        if not words or words[0][0] == "#":
            continue
        if {"AoA", "Mach"} <= set(words):
            header = words
        else:
            rows.append(line.values(header))
    if not rows:
        raise InputError("no points below the header", files[0][0], "run the sweep again")
    lacking = [c[0] for c, _ in _POLAR.values() if not any(n in rows[0] for n in c)]
    if lacking or any(row.keys() != rows[0].keys() for row in rows):
        raise InputError(
            f"no column {lacking[0]}" if lacking else "files with different columns",
            files[0][0],
            "give polars of one release of VSPAERO",
        )
    column = {n: np.array([row[n] for row in rows]) for n in rows[0]}
    coefficients = {
        axis: sign * column[next(n for n in names if n in column)]
        for axis, (names, sign) in _POLAR.items()
    }
    conditions = {
        "alpha": np.deg2rad(column["AoA"]),
        "beta": np.deg2rad(column["Beta"]),
        "mach": column["Mach"],
    }
    reference = answers.reference()
    answers.notes.append(
        "lift, drag and side force along wind axes; CMx and CMz turned to Cl and Cn"
    )
    answers.close()
    return database_of_points(
        files[0][0],
        name,
        conditions,
        coefficients,
        reference,
        f"VSPAERO, sweep of {len(rows)} points",
        answers.notes,
    )
