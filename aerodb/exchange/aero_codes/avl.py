"""AVL (Athena Vortex Lattice): stability derivatives, ``.st``, and body-axis derivatives, ``.sb``.

A file holds one run, or several where AVL appended them; several files are read together.

- Derivatives by alpha and beta are per rad, by rates per ``pb/2V``, ``qc/2V``, ``rb/2V``. Those by
  controls (``CLd1``) are **per degree** of the control at a gain of one.
- In ``.st``, rolling and yawing moments (``Cl'``, ``Cn'``) and rates (``p'``, ``r'``) are about
  **stability axes**; they are turned to body axes at the run's own angle of attack. In ``.sb`` all
  are about body axes, and motion is along them (u, v, w).
- ``Xref`` is aft and ``Zref`` up in AVL's geometry: the point is (-Xref, Yref, -Zref) here, from an
  origin that is taken as the vehicle's datum.
- Lengths have the unit of the geometry file, which the output does not name.
- The drag is that of the run, and lift squared over ``pi A e`` with the run's ``e`` about it.
  Without profile drag (``CDvis = 0``) only the induced drag is there.

The layout is AVL's own (M. Drela, H. Youngren: AVL 3.30 user primer, and the output of its ST, SB).
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from aerodb.errors import InputError
from aerodb.exchange.aero_codes.answers import Answers, length_unit
from aerodb.exchange.aero_codes.controls import DEGREE, control_name, control_variable
from aerodb.exchange.aero_codes.lines import Line, lines_of
from aerodb.exchange.aero_codes.runs import Run, database_of_runs, of_body_forces, on_body_axes
from aerodb.support import counted
from aerodb.tables import AeroDatabase

MARK: Final = "Vortex Lattice Output"
_PAIR: Final = re.compile(r"([A-Za-z][\w'/]*)\s*=\s*(\S+)")
_CONTROL: Final = re.compile(r"(\S+)\s+(d\d+)\b")
_DERIVATIVE: Final = re.compile(r"(CL|CD|CX|CY|CZ|Cl|Cm|Cn)(a|b|p|q|r|u|v|w|d\d+)")
_TOTALS: Final = {
    "CLtot": "C_lift",
    "CDtot": "C_drag",
    "CXtot": "CX",
    "CYtot": "CY",
    "CZtot": "CZ",
    "Cltot": "Cl",
    "Cmtot": "Cm",
    "Cntot": "Cn",
}
_AXES: Final = {"CL": "C_lift", "CD": "C_drag"}
_BY: Final = {"a": "alpha", "b": "beta", "p": "p_hat", "q": "q_hat", "r": "r_hat"}
_GEOMETRY: Final = ("Sref", "Cref", "Bref", "Xref", "Yref", "Zref")
_NEEDED: Final = (*_GEOMETRY, "Alpha", "Beta", "Mach", *_TOTALS)
#: Lines whose equal signs belong to no quantity of a run.
_RATIO: Final = "Clb Cnr / Clr Cnb"


@dataclass
class _Block:
    """What one run of a file states: numbers by name, controls by their letter, and its line."""

    line: Line
    numbers: dict[str, float] = field(default_factory=dict)
    letters: dict[str, str] = field(default_factory=dict)
    deflections: dict[str, float] = field(default_factory=dict)
    body: bool = False


def is_avl(text: str) -> bool:
    """Return whether a text begins as AVL's total forces do."""
    return MARK in text[:2000]


def import_avl(files: Sequence[tuple[str, bytes]], name: str, answers: Answers) -> AeroDatabase:
    """Return the database of AVL's output files (name, content) as one.

    Raises InputError with file and line for what is damaged, has other reference lengths or another
    axis orientation than the standard one, and OpenQuestionsError for what the files leave open.
    """
    blocks = _blocks(files)
    first = blocks[0]
    for block in blocks:
        _check(block, first)
    numbers = first.numbers
    scale = length_unit(answers, numbers["Sref"], numbers["Cref"], numbers["Bref"])
    x, y, z = (scale * numbers[n] + 0.0 for n in ("Xref", "Yref", "Zref"))
    reference = answers.reference(
        numbers["Sref"] * scale**2,
        numbers["Cref"] * scale,
        numbers["Bref"] * scale,
        (-x + 0.0, y, -z + 0.0),
    )
    runs = [_run(block) for block in blocks]
    names = {control_name(n): n for block in blocks for n in block.letters.values()}
    fixed = {n for block in blocks for n, x in block.deflections.items() if x and not block.letters}
    if fixed:
        answers.notes.append(
            f"no derivatives by controls: the curves are with {', '.join(sorted(fixed))} as set"
        )
    controls = {
        own: control_variable(
            answers,
            written,
            [{axis: by.get(own, 0.0) for axis, by in run.slopes.items()} for run in runs],
            DEGREE,
            "deg",
            "AVL",
        )
        for own, written in names.items()
    }
    if all(block.numbers.get("CDvis", 1.0) == 0.0 for block in blocks):
        answers.notes.append(
            "the drag is the induced one alone (CDvis is 0): profile drag is missing"
        )
    at = ", ".join(f"{c + 0.0:g}" for c in reference.moment_reference)
    answers.notes.append(
        f"moments are about ({at}) m, body axes, from the vehicle's datum, for which AVL's"
        " origin is taken"
    )
    if len({block.body for block in blocks}) > 1:
        raise InputError(
            "derivatives on stability and on body axes", first.line.where, "give one kind"
        )
    answers.close()
    kind = "body axes" if first.body else "stability axes"
    source = f"AVL, {counted(len(runs), 'run')}, derivatives on {kind}"
    return database_of_runs(runs, name, reference, controls, source, answers.notes)


def _blocks(files: Sequence[tuple[str, bytes]]) -> list[_Block]:
    blocks: list[_Block] = []
    for line in lines_of(files):
        if MARK in line.text:
            blocks.append(_Block(line))
        elif not blocks or blocks[-1].line.file != line.file:
            if line.text.strip(" -"):
                continue
        elif "Geometric axis orientation" in line.text:
            line.refuse(
                "coefficients in AVL's geometric axes (x aft, z up)",
                "choose the standard axes (X fwd, Z down) in AVL's options, and write it again",
            )
        elif "Geometry-axis derivatives" in line.text:
            blocks[-1].body = True
        elif not line.text.strip().startswith(_RATIO):
            _take(blocks[-1], line)
    if not blocks:
        raise InputError(f"no '{MARK}'", files[0][0], "give the output of ST or SB in OPER")
    return blocks


def _take(block: _Block, line: Line) -> None:
    pairs = _PAIR.findall(line.text)
    if not pairs:
        block.letters.update({letter: name for name, letter in _CONTROL.findall(line.text)})
    single = len(pairs) == 1 and line.text.lstrip().startswith(pairs[0][0])
    for name, text in pairs:
        known = name in _NEEDED or _DERIVATIVE.fullmatch(name) or name in _OTHERS
        if name in _OTHERS and text.lower().lstrip("+-") in ("nan", "infinity"):
            continue  # the span efficiency of a run without lift
        value = line.value(text, name)
        if single and not known and not block.letters:
            block.deflections[name] = value
        elif block.numbers.setdefault(name, value) != value:
            line.refuse(f"{name} stands twice, with {block.numbers[name]:g} and {value:g}")


#: Further quantities that AVL prints one to a line.
_OTHERS: Final = ("CLff", "CYff", "CDff", "CDvis", "CDind", "e", "Xnp")


def _check(block: _Block, first: _Block) -> None:
    lacking = [name for name in _NEEDED if name not in block.numbers]
    if lacking:
        block.line.refuse(
            f"the run that begins here has no {', '.join(lacking[:4])}: it is cut off"
        )
    for name in _GEOMETRY:
        if block.numbers[name] != first.numbers[name]:
            block.line.refuse(
                f"{name} is {block.numbers[name]:g}, in {first.line.where} {first.numbers[name]:g}",
                "runs of one database have one reference",
            )
    for name in ("Sref", "Cref", "Bref"):
        if not block.numbers[name] > 0.0:
            block.line.refuse(f"{name} is {block.numbers[name]:g}", "it must be positive")
    if not abs(block.numbers["Alpha"]) < 90.0 or not abs(block.numbers["Beta"]) < 90.0:
        block.line.refuse("the angle of attack or sideslip is not below 90 deg")
    if block.letters and len(block.letters) != len(block.deflections):
        block.line.refuse(
            f"{len(block.deflections)} controls are set, {len(block.letters)} have derivatives"
        )


def _run(block: _Block) -> Run:
    numbers = block.numbers
    alpha = math.radians(numbers["Alpha"])
    owner = {letter: control_name(name) for letter, name in block.letters.items()}
    totals = {axis: numbers[name] for name, axis in _TOTALS.items()}
    slopes: dict[str, dict[str, float]] = {}
    for name, value in numbers.items():
        match = _DERIVATIVE.fullmatch(name)
        by = match and (_BY.get(match[2]) or owner.get(match[2]) or match[2])
        if match and by and not (match[2].startswith("d") and match[2] not in owner):
            slopes.setdefault(_AXES.get(match[1], match[1]), {})[by] = value
    for name, letter in ((n, n[4:]) for n in numbers if n.startswith("CDffd")):
        if letter in owner:
            slopes.setdefault("C_drag", {})[owner[letter]] = numbers[name]
    state = {
        "alpha": alpha,
        "beta": math.radians(numbers["Beta"]),
        "p_hat": numbers.get("pb/2V", 0.0),
        "q_hat": numbers.get("qc/2V", 0.0),
        "r_hat": numbers.get("rb/2V", 0.0),
        **{control_name(name): value for name, value in block.deflections.items()},
    }
    induced = _induced(numbers)
    if block.body:
        totals, slopes = _of_velocities(totals, slopes, alpha)
        return Run(block.line.where, numbers["Mach"], totals, slopes, state, induced)
    for axis in ("CX", "CZ"):
        totals.pop(axis)
        slopes.pop(axis, None)
    ca, sa = math.cos(alpha), math.sin(alpha)
    p, r = state["p_hat"], state["r_hat"]
    stability = {**state, "p_hat": p * ca + r * sa, "r_hat": r * ca - p * sa}
    roll, yaw = totals["Cl"], totals["Cn"]  # printed about body axes, as the derivatives are not
    totals["Cl"], totals["Cn"] = roll * ca + yaw * sa, yaw * ca - roll * sa
    return on_body_axes(Run(block.line.where, numbers["Mach"], totals, slopes, stability, induced))


def _induced(numbers: Mapping[str, float]) -> float | None:
    """Factor of lift squared in the drag: 1/(pi A e), where the run states a sound e."""
    e, span, area = numbers.get("e", 0.0), numbers["Bref"], numbers["Sref"]
    return area / (math.pi * span**2 * e) if 0.1 < e < 10.0 else None


def _of_velocities(
    totals: dict[str, float], slopes: dict[str, dict[str, float]], alpha: float
) -> tuple[dict[str, float], dict[str, dict[str, float]]]:
    """Totals and slopes of a run about body axes: u, v, w become alpha and beta, CX and CZ lift and
    drag."""
    ca, sa = math.cos(alpha), math.sin(alpha)
    made: dict[str, dict[str, float]] = {}
    for axis, by in slopes.items():
        if axis in ("C_lift", "C_drag"):
            continue
        own = {n: value for n, value in by.items() if n not in ("u", "v", "w")}
        own["alpha"] = ca * by.get("w", 0.0) - sa * by.get("u", 0.0)
        own["beta"] = by.get("v", 0.0)
        made[axis] = own
    plain = {axis: value for axis, value in totals.items() if axis not in ("C_lift", "C_drag")}
    turned, by_motion = of_body_forces(plain, made, alpha)
    by_motion["C_drag"].update(slopes.get("C_drag", {}))
    return turned, by_motion
