"""Sweeps of CFD or of a tunnel, as CSV, text, MAT or Excel; what is open is asked in one round.

Nobody's table says its axes, signs and units. What only one meaning fits is taken and told: angles
beyond 1.6 are degrees, a column ``alpha`` is the angle of attack. All else is a question whose
answers are proposed: what a column is (``CMx=-Cl``), forces along which axes, moments about which,
reference lengths and the moment point.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.aero_codes.answers import Answers
from aerodb.exchange.aero_codes.controls import DEGREE, control_name, kind_of
from aerodb.exchange.aero_codes.points import about_body_axes, database_of_points, in_wind_axes
from aerodb.exchange.aero_codes.sweep_tables import read_table
from aerodb.support import Array
from aerodb.tables import AeroDatabase, Expression, Name, Negation, Variable, parse
from aerodb.units import conversion

#: Normalised name of a column -> what it can only mean.
_CERTAIN: Final = {
    **dict.fromkeys(("alpha", "aoa", "angleofattack", "alphadeg", "alpharad"), "alpha"),
    **dict.fromkeys(("beta", "aos", "sideslip", "angleofsideslip", "betadeg", "betarad"), "beta"),
    **dict.fromkeys(("mach", "machnumber", "ma"), "mach"),
    **dict.fromkeys(("clift", "lift", "liftcoefficient"), "C_lift"),
    **dict.fromkeys(("cd", "cdrag", "drag", "cdtot", "dragcoefficient"), "C_drag"),
    **dict.fromkeys(("cm", "cpitch", "cmpitch", "cmtot"), "Cm"),
}
#: Names as they are written -> the same, where case tells lift from roll.
_EXACT: Final = {"CL": "C_lift", "CLtot": "C_lift", "Cm": "Cm", "CD": "C_drag"}
#: Normalised name -> answers that are proposed for it, the likeliest first.
_LIKELY: Final = {
    "cl": ("C_lift", "Cl"),
    "cs": ("C_side", "CY", "-C_side", "-CY"),
    "csf": ("C_side", "CY", "-C_side", "-CY"),
    "cside": ("C_side", "CY", "-C_side", "-CY"),
    "cy": ("CY", "C_side", "-CY"),
    "cx": ("CX", "-CX"),
    "cfx": ("-CX", "CX"),
    "cfy": ("CY", "-CY"),
    "cz": ("CZ", "-CZ"),
    "cfz": ("-CZ", "CZ"),
    "cn": ("Cn", "-Cn", "-CZ"),
    "ca": ("-CX", "C_lift"),
    "cw": ("C_drag",),
    "cll": ("Cl", "-Cl"),
    "croll": ("Cl", "-Cl"),
    "cmroll": ("Cl", "-Cl"),
    "cmx": ("-Cl", "Cl"),
    "cmy": ("Cm", "-Cm"),
    "cmz": ("-Cn", "Cn"),
    "cyaw": ("Cn", "-Cn"),
    "cmyaw": ("Cn", "-Cn"),
    "cln": ("Cn", "-Cn"),
}
#: Unit in the header of a coefficient -> its size: a count of drag is 1e-4.
_SHARES: Final = {
    **dict.fromkeys(("count", "counts", "cts", "dc", "drag counts"), 1e-4),
    **dict.fromkeys(("%", "percent"), 1e-2),
}
_ROLES: Final = (
    "alpha",
    "beta",
    "mach",
    "C_lift",
    "C_drag",
    "C_side",
    "CX",
    "CY",
    "CZ",
    "Cl",
    "Cm",
    "Cn",
)
_CONDITIONS: Final = ("alpha", "beta", "mach")
_SKIP: Final = "skip"
#: Angle [rad] beyond which a number is in degrees (docs/reference/contract.md).
_LARGEST: Final = 1.6


def import_sweep(files: Sequence[tuple[str, bytes]], name: str, answers: Answers) -> AeroDatabase:
    """Return the database of one table of points (name, content), or of several with the same
    columns. Raises InputError for what is no such table, and OpenQuestionsError for what is open.
    """
    tables = [read_table(where, data) for where, data in files]
    first = tables[0]
    for table in tables[1:]:
        if table.columns.keys() != first.columns.keys():
            raise InputError(
                f"other columns than {first.where}",
                table.where,
                "give tables with the same columns",
            )
    columns = {n: np.concatenate([table.columns[n] for table in tables]) for n in first.columns}
    found, controls = _meanings(answers, columns, first.units)
    if "alpha" not in found:
        raise InputError(
            "no column is the angle of attack",
            first.where,
            "name it: --bind COLUMN=alpha; a run at one angle is no sweep",
        )
    reference = answers.reference(
        first.lengths.get("S_ref"), first.lengths.get("c_ref"), first.lengths.get("b_ref")
    )
    size = len(next(iter(columns.values())))
    alpha, beta = found["alpha"], found.get("beta", np.zeros(size))
    coefficients = {n: x for n, x in found.items() if n not in _CONDITIONS}
    coefficients = _turned(answers, coefficients, alpha, beta)
    answers.close()
    conditions: dict[str, Array] = {n: x for n, x in found.items() if n in _CONDITIONS}
    return database_of_points(
        first.where,
        name,
        {**conditions, **{n: columns[column] for n, (column, _) in controls.items()}},
        coefficients,
        reference,
        f"sweep of {size} points, {', '.join(first.columns)}",
        answers.notes,
        {n: variable for n, (_, variable) in controls.items()},
    )


def _meanings(
    answers: Answers, columns: Mapping[str, Array], units: Mapping[str, str]
) -> tuple[dict[str, Array], dict[str, tuple[str, Variable]]]:
    """What each column is, in SI, and the controls: name -> column and variable."""
    found: dict[str, Array] = {}
    controls: dict[str, tuple[str, Variable]] = {}
    of: dict[str, str] = {}
    for column, values in columns.items():
        own = control_name(column)
        role = (
            answers.expression(own) if answers.is_given(own) else _certain(column, found, answers)
        )
        if role is None:
            _ask(answers, column, values)
            continue
        if isinstance(role, Name) and role.name == _SKIP:
            continue
        sign, plain = (-1.0, role.operand) if isinstance(role, Negation) else (1.0, role)
        if isinstance(plain, Name) and plain.name in _ROLES:
            if plain.name in found:
                raise InputError(
                    f"two columns are {plain.name}", answers.where, f"--bind {own}=skip"
                )
            scale = sign if plain.name in _CONDITIONS else sign * _scale(answers, column, units)
            found[plain.name], of[plain.name] = scale * values, column
        elif role.names:
            controls[f"{own}_column"] = column, Variable(role, "", f"column {column}")
        else:
            raise InputError(f"'{role}' is neither of {', '.join(_ROLES)}, skip nor a channel", own)
    angles = [n for n in ("alpha", "beta") if n in found]
    largest = max((float(np.max(np.abs(found[n]))) for n in angles), default=0.0)
    written = next((units[of[n]].lower() for n in angles if of[n] in units), "")
    factor = _radians(answers, largest, written) if angles else 1.0
    found |= {n: found[n] * factor for n in angles}
    return found, controls


def _scale(answers: Answers, column: str, units: Mapping[str, str]) -> float:
    """Factor from the unit in the header of a coefficient to 1. Raises InputError for a force or a
    moment."""
    unit = units.get(column, "").lower()
    if any(_is_of(units.get(column, ""), dimension) for dimension in ("N", "N*m")):
        raise InputError(
            f"column {column} is in {unit}, a force or a moment",
            answers.where,
            "give coefficients: over dynamic pressure, area and length",
        )
    scale = _SHARES.get(unit, 1.0)
    if scale != 1.0:
        answers.notes.append(f"{column} is in {unit}: times {scale:g}")
    return scale


def _is_of(unit: str, dimension: str) -> bool:
    try:
        conversion(unit, dimension)
    except InputError:
        return False
    return bool(unit)


def _certain(column: str, found: Mapping[str, Array], answers: Answers) -> Expression | None:
    plain = re.sub(r"[^a-z0-9]", "", column.lower())
    role = _EXACT.get(column) or _CERTAIN.get(plain, "")
    if not role or role in found:
        return None
    answers.notes.append(f"{column} is {role}")
    return parse(role)


def _ask(answers: Answers, column: str, values: Array) -> None:
    own = control_name(column)
    plain = re.sub(r"[^a-z0-9]", "", column.lower())
    kind = kind_of(re.sub(r"^(delta|d)_?", "", column.lower())) or kind_of(column)
    proposals = [(text, "") for text in _LIKELY.get(plain, ())]
    if kind:
        proposals += [
            (f"{DEGREE!r}*delta_{kind}", "in degrees, positive trailing edge down, or left"),
            (f"-{DEGREE!r}*delta_{kind}", "in degrees, positive the other way"),
        ]
    varies = len(values) and np.ptp(values) > 0.0
    about = "" if varies else f", {values[0]:g} throughout"
    answers.ask(
        own,
        f"column {column}{about}: what is it, and with which sign?",
        [*proposals, (_SKIP, "to leave it out")] if proposals else [(_SKIP, "to leave it out")],
    )


def _radians(answers: Answers, largest: float, written: str) -> float:
    """Factor from the unit of the angles to rad. written : unit in the header, or ''."""
    unit = next((u for u in ("deg", "rad") if written.startswith(u)), "")
    if not unit and largest > _LARGEST:
        unit = "deg"
        answers.notes.append("angles are in degrees: one is above 1.6")
    chosen = answers.choice(
        "angle_unit", {"deg": "", "rad": ""}, "which unit do the angles have?", unit
    )
    return float(np.deg2rad(1.0)) if chosen == "deg" else 1.0


def _turned(
    answers: Answers, coefficients: dict[str, Array], alpha: Array, beta: Array
) -> dict[str, Array]:
    """Coefficients along the axes of a database, after asking for those of the file."""
    made = dict(coefficients)
    for axes in ("force_axes", "moment_axes"):
        answers.is_given(axes)  # an answer to what turns out not to be open is no mistake
    if "C_drag" in made and "CY" in made:
        made = in_wind_axes({"C_lift": np.zeros(len(alpha)), **made}, beta)
    elif "C_drag" in made and np.any(beta != 0.0) and "CX" not in made:
        axes = answers.choice(
            "force_axes",
            {
                "wind": "drag along the airflow, side force normal to it",
                "stability": "drag in the plane of symmetry, side force along the body's y",
            },
            "along which axes are drag and side force?",
        )
        if axes == "stability":
            side = made.pop("C_side", np.zeros(len(beta)))
            made = in_wind_axes({"C_lift": np.zeros(len(alpha)), **made, "CY": side}, beta)
    turning = any(np.any(made.get(n, np.zeros(1)) != 0.0) for n in ("Cl", "Cn"))
    if turning or {"Cl", "Cn"} & answers.proposed:
        axes = answers.choice(
            "moment_axes",
            {"body": "", "stability": "x along the airflow in the plane of symmetry"},
            "about which axes are the rolling and the yawing moment?",
        )
        if axes == "stability":
            made = about_body_axes(made, alpha)
    return made
