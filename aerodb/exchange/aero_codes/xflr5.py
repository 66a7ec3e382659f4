"""XFLR5: polars of a plane, as text or CSV.

- Totals count: ``CD`` (or ``TCd``) is viscous and induced drag together. Files of early releases
  call moments ``GCm GRm GYm`` or ``Cm Rm Ym``.
- The file states neither reference area, lengths nor the moment point: all are asked.
- Lift and drag lie in the plane of symmetry, ``CY`` is the body's. Where sideslip varies, the signs
  of the rolling and the yawing moment are asked.
- A point that did not converge is absent: gaps in alpha stay gaps.
- A polar has no damping and no controls; deflections that it was run with are in its curves.
"""

import re
from collections.abc import Sequence
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.aero_codes.answers import Answers
from aerodb.exchange.aero_codes.lines import lines_of
from aerodb.exchange.aero_codes.points import database_of_points, in_wind_axes
from aerodb.tables import AeroDatabase

#: Axis -> names of its column, by release.
_COLUMNS: Final = {
    "C_lift": ("CL",),
    "C_drag": ("CD", "TCd"),
    "CY": ("CY",),
    "Cl": ("Cl", "Rm", "GRm"),
    "Cm": ("Cm", "GCm"),
    "Cn": ("Cn", "Ym", "GYm"),
}
_SPLIT: Final = re.compile(r"[\s,;]+")


def is_xflr5(text: str) -> bool:
    """Return whether a text is a polar of XFLR5 (or flow5) of a plane."""
    return any(_is_header(_cells(line)) for line in text[:5000].splitlines())


def _cells(text: str) -> list[str]:
    return [cell for cell in _SPLIT.split(text.strip()) if cell]


def _is_header(cells: Sequence[str]) -> bool:
    return {"alpha", "CL", "QInf", "XCP"} <= set(cells)


def import_xflr5(files: Sequence[tuple[str, bytes]], name: str, answers: Answers) -> AeroDatabase:
    """Return the database of polars (name, content) as one. Raises InputError with file and line
    for what is damaged, and OpenQuestionsError for what they leave open."""
    header: list[str] = []
    rows: list[dict[str, float]] = []
    for line in lines_of(files):
        cells = _cells(line.text)
        if _is_header(cells):
            header = cells
        elif header and cells and cells[0].lstrip("+-")[:1].isdigit():
            rows.append(line.values(header))
        elif header and cells and not cells[0].strip("_"):
            continue
        elif header and cells and rows and rows[-1].keys() == set(header):
            header = []  # the text of the next file
    if not rows:
        raise InputError("no points below the header", files[0][0], "export the polar again")
    if any(row.keys() != rows[0].keys() for row in rows):
        raise InputError("polars of different releases", files[0][0], "export them from one")
    column = {n: np.array([row[n] for row in rows]) for n in rows[0]}
    found = {
        axis: column[own]
        for axis, names in _COLUMNS.items()
        if (own := next((n for n in names if n in column), "")) != ""
    }
    lacking = [axis for axis in ("C_drag", "Cm") if axis not in found]
    if lacking:
        raise InputError(f"no column of {lacking[0]}", files[0][0], "export the whole polar")
    alpha = np.deg2rad(column["alpha"])
    beta = np.deg2rad(column.get("Beta", np.zeros(len(rows))))
    for axis in ("Cl", "Cn"):
        if axis in found and np.any(found[axis] != 0.0):
            sign = answers.choice(
                f"{axis}_sign",
                {"alike": "right wing down, or nose right", "opposite": ""},
                f"which sense of {axis} is positive in the file?",
            )
            found[axis] = found[axis] * (1.0 if sign == "alike" else -1.0)
    reference = answers.reference()
    answers.close()
    return database_of_points(
        files[0][0],
        name,
        {"alpha": alpha, "beta": beta},
        in_wind_axes(found, beta),
        reference,
        f"XFLR5, polar of {len(rows)} points",
        ["viscous and induced drag; curves are with the deflections that the plane has"],
    )
