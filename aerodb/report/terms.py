"""Names and units of the terms of increments, which documents write as expressions."""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from aerodb.errors import AeroError
from aerodb.nomenclature import AXES, CHANNELS, channel, is_surface
from aerodb.report.glossary import effect_words, listed
from aerodb.report.numbers import for_people
from aerodb.support import TWO_SIDED
from aerodb.tables import WIND_AXES, AeroDatabase, Increment, new_increments, parse

#: Longest expression that is shown as it is; a longer one is named by its variables.
_LONGEST: Final = 40
#: Most terms whose correlations are shown as a matrix; of more, the large ones are listed.
_MATRIX: Final = 9
_LARGE: Final = 0.5
#: A correlation that is shown as zero.
_NONE: Final = 0.005
_CONSTANT: Final = "constant"
_MODEL_ERROR: Final = "model error"
_AT: Final = re.compile(r"(?P<term>.+?)(?: over (?P<over>\w+))? at (?P<value>-?[\d.e+-]+)")
_ABOVE: Final = re.compile(r"max\((?P<name>\w+) - (?P<value>[\d.e+-]+), 0\)")
#: A channel on one side of zero, or its size.
_ONE_SIDED: Final = re.compile(r"(?:min|max)\((\w+),0\)|abs\((\w+)\)")
_FACTOR: Final = re.compile(r"(?P<name>[A-Za-z_]\w*)(?:\^(?P<power>\d+))?")


def term_name(text: str) -> str:
    """Return the name of a term: short expressions as they are, long ones by their variables,
    values at knots with their unit.

    >>> term_name("alpha*q_hat"), term_name("1"), term_name("alpha at 0.0873")
    ('alpha*q_hat', 'constant', 'alpha at 5 deg')
    >>> term_name("clip(alpha - 0.1, 0, 0.05)*20*clip(delta_flap - 0.2, 0, 0.1)*10")
    'piecewise linear in alpha and delta_flap'
    >>> term_name("max(alpha - 0.175, 0)")
    'alpha above 10 deg'
    """
    hinge = _ABOVE.fullmatch(text)
    if hinge is not None:
        return f"{hinge['name']} above {_value_at(hinge['name'], float(hinge['value']))}"
    knot = _AT.fullmatch(text)
    if knot is not None:
        variable = knot["over"] or knot["term"]
        along = f" at {variable}" if knot["over"] else " at"
        return f"{term_name(knot['term'])}{along} {_value_at(variable, float(knot['value']))}"
    if len(text) <= _LONGEST and "clip(" not in text:
        return _CONSTANT if text == "1" else text
    try:
        names = sorted(parse(text).names)
    except AeroError:
        return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
    kind = "piecewise linear in" if "clip(" in text else "function of"
    return f"{kind} {listed(names)}" if names else text


def as_constant(text: str) -> float | None:
    """Return by what a term that is a number alone makes a constant: one, or minus one where it is
    counted the other way; None for a term that depends on something.

    >>> as_constant("-1"), as_constant("1"), as_constant("alpha")
    (-1.0, 1.0, None)
    """
    try:
        return float(text)
    except ValueError:
        return None


def increment_terms(increment: Increment) -> list[tuple[str, str, float, float]]:
    """Return the terms of an increment as people write them: name, unit (`term_unit`), estimate and
    standard error (SI).

    A number alone is the constant that it makes; one that is exactly zero carries the error of the
    model (`aerodb.loop.with_model_error`).
    """
    rows = []
    errors = np.sqrt(np.diag(increment.covariance)).tolist()
    columns = zip(map(str, increment.regressors), increment.estimates.tolist(), errors, strict=True)
    for text, value, error in columns:
        factor = as_constant(text)
        if factor is None:
            rows.append((term_name(text), term_unit(text), value, error))
        else:
            name = _CONSTANT if value else _MODEL_ERROR
            rows.append((name, "-", factor * value + 0.0, abs(factor) * error))
    return rows


def _value_at(variable: str, value: float) -> str:
    """Return a value of a variable with its unit, angles in degrees."""
    if is_surface(variable) or variable in ("alpha", "beta"):
        return f"{math.degrees(value):.3g} deg"
    return f"{value:.3g}"


def term_unit(text: str) -> str:
    """Return the unit of a term's parameter, for a coefficient without dimension; a question mark
    where the expression is no product of powers of channels.

    >>> [term_unit(text) for text in ("1", "alpha", "q_hat", "alpha^2", "alpha*delta_flap")]
    ['-', '1/rad', '-', '1/rad²', '1/rad²']
    >>> term_unit("alpha at 0.0873"), term_unit("V"), term_unit("exp(alpha)"), term_unit("1 - mach")
    ('-', '1/(m/s)', '?', '-')
    >>> term_unit("max(alpha - 0.175, 0)"), term_unit("alpha*min(beta, 0)"), term_unit("abs(beta)")
    ('1/rad', '1/rad²', '1/rad')
    """
    hinge = _ABOVE.fullmatch(text)
    if hinge is not None:
        return term_unit(hinge["name"])
    knot = _AT.fullmatch(text)
    if knot is not None:
        return term_unit(knot["term"]) if knot["over"] else "-"
    powers: dict[str, int] = {}
    for part in text.replace(" ", "").split("*"):
        found = _FACTOR.fullmatch(_ONE_SIDED.sub(r"\1\2", part))
        if found is None:
            try:
                float(part)
            except ValueError:
                return "-" if _without_dimension(text) else "?"
            continue
        try:
            unit = channel(found["name"]).unit
        except AeroError:
            return "?"
        if unit not in ("", "1"):
            powers[unit] = powers.get(unit, 0) + int(found["power"] or 1)
    if not powers:
        return "-"
    raised = "".join(
        f" {f'({unit})' if '/' in unit else unit}{'' if n == 1 else '²³⁴⁵⁶⁷⁸⁹'[n - 2]}"
        for unit, n in powers.items()
    ).strip()
    return f"1/({raised})" if len(powers) > 1 else f"1/{raised}"


def derivative_unit(parameter: str) -> str | None:
    """Return the unit of a parameter named for an axis and a term, per radian (`term_unit`); None
    for another one.

    >>> [derivative_unit(name) for name in ("CZ_alpha", "CX_0", "C_lift_q_hat", "Lp")]
    ['1/rad', '-', '-', None]
    """
    for axis in (*AXES, *WIND_AXES):
        if parameter.startswith(f"{axis}_"):
            unit = term_unit(parameter.removeprefix(f"{axis}_"))
            return "-" if unit == "?" else unit
    return None


def sensor_error_unit(parameter: str) -> str:
    """The SI unit of an estimated sensor error.

    >>> [sensor_error_unit(name) for name in ("ax_bias", "alpha_scale", "V_delay", "wind_north")]
    ['m/s^2', '1', 's', 'm/s']
    """
    subject, _, kind = parameter.rpartition("_")
    if kind in ("scale", "delay"):
        return "1" if kind == "scale" else "s"
    name = subject if kind == "bias" else parameter
    if name in CHANNELS:
        return CHANNELS[name].unit
    return "m" if name.startswith("air_data_") else "SI"


def _without_dimension(text: str) -> bool:
    """Return whether all channels of an expression have no dimension."""
    try:
        return all(channel(name).unit in ("", "1") for name in parse(text).names)
    except AeroError:
        return False


def correlation_rows(names: Sequence[str], matrix: Sequence[Sequence[float]]) -> dict[str, Any]:
    """Correlations of the estimates of an axis: the lower triangle as rows, or for many terms the
    pairs above `_LARGE`, largest first. Empty for a single term.

    matrix : (k, k).
    """
    if len(names) < 2:
        return {}
    values = np.asarray(matrix, dtype=np.float64)
    if np.all(np.abs(values - np.diag(np.diag(values))) < _NONE):
        return {"independent": True}
    if len(names) <= _MATRIX:
        rows = [(name, values[k, : k + 1].tolist()) for k, name in enumerate(names)]
        return {"independent": False, "rows": rows}
    pairs = [
        (names[i], names[j], float(values[i, j]))
        for i in range(len(names))
        for j in range(i)
        if abs(values[i, j]) >= _LARGE
    ]
    return {
        "independent": False,
        "rows": None,
        "pairs": sorted(pairs, key=lambda pair: -abs(pair[2])),
        "above": _LARGE,
    }


def estimates_of(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the estimated increments of an update's document, one entry per axis, with names,
    units and correlations. See docs/reference/contract.md, section JSON."""
    return [
        {
            **entry,
            "rows": [
                {**term, "name": term_name(term["term"]), "unit": term_unit(term["term"])}
                for term in entry["terms"]
            ],
            "correlations": correlation_rows(
                [term_name(term["term"]) for term in entry["terms"]], entry["correlation"]
            ),
        }
        for entry in document["increments"]
    ]


def estimates_added(
    document: Mapping[str, Any], baseline: AeroDatabase, candidate: AeroDatabase
) -> list[dict[str, Any]]:
    """Return what entered the database in a closed loop: the estimates as they are in the
    candidate, in SI units, with their correlations, one entry per increment with its correlation
    matrix."""
    known = {
        finding["value"]: finding
        for finding in document["findings"]
        if finding["hypothesis"] in document["added"]
    }
    entries = []
    for increment in new_increments(baseline, candidate):
        error = np.sqrt(np.diag(increment.covariance))
        rows: list[dict[str, Any]] = []
        for estimate, (name, unit, value, sigma) in zip(
            increment.estimates.tolist(), increment_terms(increment), strict=True
        ):
            finding = known.get(estimate)
            said = estimate if finding else value  # a finding has the sign of its own name
            rows.append(
                {
                    "name": effect_words(finding) if finding else name,
                    "unit": for_people(finding["unit"])[1] if finding else unit,
                    "value": said,
                    "standard_error": sigma,
                    "ci95": [said + side * TWO_SIDED * sigma for side in (-1.0, 1.0)],
                }
            )
        scale = np.where(error > 0.0, error, 1.0)
        entries.append(
            {
                "axis": increment.axis,
                "rows": rows,
                "correlations": correlation_rows(
                    [row["name"] for row in rows], increment.covariance / np.outer(scale, scale)
                ),
            }
        )
    return entries
