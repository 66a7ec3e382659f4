"""XFLR5: the derivatives that a stability analysis prints to its log.

- Forces and moments are along stability axes at the trimmed angle of attack: X forward, Z down, L
  about X, N about Z; rates without dimension. They are turned to body axes.
- ``CLde`` is the **rolling** moment by a control, ``CZde`` the lift of it.
- Derivatives by controls are per unit of the control set; its unit and sense are asked.
- The log states neither the angle, lift and drag of trim nor reference lengths: they are asked. The
  pitching moment of trim is zero.

Layout: XFLR5 and flow5, log of a stability analysis (T7 polar).
"""

import re
from collections.abc import Sequence
from typing import Final

from aerodb.errors import InputError
from aerodb.exchange.aero_codes.answers import Answers
from aerodb.exchange.aero_codes.controls import DEGREE, control_name, kind_of
from aerodb.exchange.aero_codes.lines import lines_of
from aerodb.exchange.aero_codes.runs import Run, database_of_runs, of_body_forces, on_body_axes
from aerodb.tables import AeroDatabase, Variable, number

_PAIR: Final = re.compile(r"\b(C[xyzlmn][abpqr]|C[XYZLMN]de)\s*=\s*(\S+)", re.IGNORECASE)
_AXES: Final = {"x": "CX", "y": "CY", "z": "CZ", "l": "Cl", "m": "Cm", "n": "Cn"}
_BY: Final = {"a": "alpha", "b": "beta", "p": "p_hat", "q": "q_hat", "r": "r_hat"}
#: Names of what must be there: of lift, pitch, side force, roll and yaw.
_NEEDED: Final = ("cza", "cma", "cyb", "clb", "cnb")


def is_stability(text: str) -> bool:
    """Return whether a text has the derivatives of a stability analysis of XFLR5."""
    found = {name.lower() for name, _ in _PAIR.findall(text)}
    return {"cxa", "cza", "cyb"} <= found and re.search(r"\bXw\s*=", text) is not None


def import_stability(
    files: Sequence[tuple[str, bytes]], name: str, answers: Answers
) -> AeroDatabase:
    """Return the database of one stability analysis (name, content). Raises InputError with file
    and line for what is damaged, and OpenQuestionsError for what it leaves open."""
    where = files[0][0]
    slopes: dict[str, dict[str, float]] = {axis: {} for axis in _AXES.values()}
    controls: dict[str, str] = {}
    above = ""
    for line in lines_of(files):
        for key, text in _PAIR.findall(line.text):
            axis, by = _AXES[key[1].lower()], key[2:].lower()
            if by == "de" and not above:
                line.refuse("derivatives by a control without its name above")
            own = control_name(above) if by == "de" else _BY[by]
            if by == "de":
                controls[own] = above
            if own in slopes[axis]:
                line.refuse(f"{key} stands twice", "give one analysis")
            slopes[axis][own] = line.value(text, key)
        if line.text.strip() and "=" not in line.text:
            above = line.text.strip()
    known = {f"{axis.lower()}{by}" for axis, each in slopes.items() for by in each}
    lacking = [n for n in _NEEDED if f"{n[:2]}{_BY[n[2]]}" not in known]
    if lacking:
        raise InputError(f"no {', '.join(lacking)}", where, "give the log of the analysis whole")
    alpha = answers.number("alpha_trim", "rad", "at which angle of attack is the trim [rad]?")
    lift = answers.number("C_lift", "1", "which lift coefficient has the trim?")
    drag = answers.number("C_drag", "1", "which drag coefficient has the trim?")
    variables = {own: _control(answers, own, written) for own, written in controls.items()}
    reference = answers.reference()
    answers.notes.append("derivatives along stability axes, turned; Cm of the trim is 0")
    answers.close()
    totals = {"CX": -drag, "CZ": -lift, "CY": 0.0, "Cl": 0.0, "Cm": 0.0, "Cn": 0.0}
    made, turned = of_body_forces(totals, slopes, 0.0)  # the axes of the file are those of trim
    run = on_body_axes(Run(where, 0.0, made, turned, {"alpha": alpha}))
    source = "XFLR5, stability analysis"
    return database_of_runs([run], name, reference, variables, source, answers.notes)


def _control(answers: Answers, own: str, written: str) -> Variable:
    described = f"XFLR5 control {written}"
    if answers.is_given(own):
        return Variable(answers.expression(own), "1", described)
    channel = f"delta_{kind_of(written) or own}"
    answers.ask(
        own,
        f"control {written}: which deflection is it, per degree or rad, and with which sign?",
        [
            (f"{DEGREE!r}*{channel}", "per degree"),
            (f"-{DEGREE!r}*{channel}", "per degree, the other way"),
            (channel, "per rad"),
            (f"-{channel}", "per rad, the other way"),
        ],
    )
    return Variable(number(0.0), "1", described)
