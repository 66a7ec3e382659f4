"""Trims, modes and sweeps of a version with its vehicle's masses, surfaces and thrust."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.simulation import (
    Condition,
    Growth,
    LinearModel,
    Margins,
    Trim,
    expand_envelope,
    flown_of,
    held_sweep,
    linear_model,
    modes,
    sweep,
    trim,
)
from aerodb.storage.catalogue import Catalogue, VersionRow
from aerodb.tables import AeroDatabase, height_outside_ground_effect
from aerodb.tasks.references import value_of
from aerodb.tasks.view.evaluation import database_of
from aerodb.tasks.view.mode_documents import modes_part
from aerodb.units import shown_units
from aerodb.vehicle import parse_vehicle

#: Largest number of points of a sweep.
MOST_SWEEP_POINTS: Final = 501


@dataclass(frozen=True)
class StatedCondition:
    """A condition as a user states it.

    Parameters
    ----------
    condition : see `aerodb.simulation.Condition`; a vehicle without thrust glides.
    given : ``NAME=VALUE`` each, with units or in SI: surfaces that are held, free inputs, mass
        properties that replace the vehicle's.
    controls : ``pitch=delta_elevator``, ``roll=delta_left-delta_right``; those not named are found.
    fuel : fuel mass [kg], for a vehicle with a table of it.
    thrust : input of the version that holds the airspeed, such as an engine's throttle; None: the
        thrust of the vehicle file.
    """

    condition: Condition
    given: Sequence[str] = ()
    controls: Sequence[str] = ()
    fuel: float | None = None
    thrust: str | None = None


class _Flown:
    """A version ready to be trimmed."""

    def __init__(
        self,
        catalogue: Catalogue,
        row: VersionRow,
        flight: StatedCondition,
        database: AeroDatabase | None = None,
    ) -> None:
        vehicle = parse_vehicle(catalogue.vehicle(row.vehicle).text, f"vehicle {row.vehicle}")
        stated = dict(_pair(text, "--set") for text in flight.given)
        given = {name: value_of(name, text) for name, text in stated.items()}
        self.database = database_of(catalogue, row) if database is None else database
        flown = flown_of(vehicle, self.database, fuel=flight.fuel, given=given)
        self.build, self.model = flown.build, flown.model
        self.inputs = {**flown.masses, **given}
        known = "ground_altitude" in given or flight.condition.ground
        self.ground = None if known else self._lower_ground(flight.condition)
        if self.ground is not None:
            self.inputs["ground_altitude"] = self.ground
        self.condition = flight.condition
        self.options: dict[str, Any] = {
            "thrust": flight.thrust or flown.thrust,
            "limits": flown.limits,
            "controls": dict(_control(text) for text in flight.controls),
        }

    def _lower_ground(self, condition: Condition) -> float | None:
        """Return how far below sea level [m] the ground is taken to lie, so that the flight is
        outside ground effect; None where sea level is far enough below."""
        height = height_outside_ground_effect(self.database)
        return (
            None if height is None or condition.altitude >= height else condition.altitude - height
        )

    def trim(self) -> Trim:
        found = trim(self.model, self.condition, self.inputs, **self.options)
        if self.ground is None:
            return found
        below = shown_units().shown(self.condition.altitude - self.ground, "m", 4)
        note = (
            f"ground taken {below} below, outside ground effect; --set ground_altitude=0 puts it"
            " at sea level"
        )
        return replace(found, notes=(*found.notes, note))


def glides(catalogue: Catalogue, row: VersionRow) -> bool:
    """Return whether the version's vehicle has no thrust: `thrust.source` of its file.
    UnknownNameError for an unknown vehicle."""
    text = catalogue.vehicle(row.vehicle).text
    return parse_vehicle(text, f"vehicle {row.vehicle}").thrust.source == "none"


def trim_of(
    catalogue: Catalogue,
    row: VersionRow,
    flight: StatedCondition,
    database: AeroDatabase | None = None,
) -> Trim:
    """Trim a version, or a `database` made of it; a vehicle without thrust glides. Raises
    NoTrimError where there is none."""
    return _Flown(catalogue, row, flight, database).trim()


def trim_document(
    catalogue: Catalogue,
    row: VersionRow,
    flight: StatedCondition,
    database: AeroDatabase | None = None,
) -> dict[str, Any]:
    """Trim a version, or a `database` made of it.

    Returns a document: version, channels and inputs (name -> value [SI]), standard_errors (of
    both; None if the version has no estimates), controls and notes. Raises NoTrimError where there
    is none.
    """
    return {"version": row.id, **_trim_part(_Flown(catalogue, row, flight, database).trim())}


def modes_document(
    catalogue: Catalogue, row: VersionRow, flight: StatedCondition
) -> dict[str, Any]:
    """The document of `trim_document` with the modes and the linear model.

    modes : name, real and imaginary part [1/s], figures, standard_errors, participation, note.
    linear : states, inputs, outputs, units, A, B, C, D, and the standard errors of A and B.
    """
    found = _Flown(catalogue, row, flight).trim()
    linear = linear_model(found)
    return {
        "version": row.id,
        **_trim_part(found),
        "modes": modes_part(modes(linear)),
        "linear": _linear_part(linear),
    }


def sweep_document(
    catalogue: Catalogue,
    row: VersionRow,
    flight: StatedCondition,
    variable: str,
    reach: tuple[float, float],
    steps: int,
    held: bool = False,
) -> dict[str, Any]:
    """Trims and modes of a version along one variable; `held`: coefficients, the rest as trimmed.

    reach : from and to [SI]. Returns a document: version, variable, points (value, and the fields
    of `modes_document` without the linear model, or reason where there is no trim). `held`: the
    fields of `trim_document`, and points (value, coefficients, and standard_errors or None) with
    outside_of (names of tables).
    """
    if not 2 <= steps <= MOST_SWEEP_POINTS:
        raise InputError(f"{steps} steps", "--steps", f"from 2 to {MOST_SWEEP_POINTS}")
    if not all(map(math.isfinite, reach)) or reach[0] == reach[1]:
        raise InputError(
            f"from {reach[0]:g} to {reach[1]:g} is no range", "--from, --to", "give two numbers"
        )
    flown = _Flown(catalogue, row, flight)
    line = np.linspace(*reach, steps)
    if held:
        found = flown.trim()
        along = held_sweep(found, variable, line.tolist())
        known = bool(found.standard_errors)
        return {
            "version": row.id,
            "variable": variable,
            **_trim_part(found),
            "points": [
                {
                    "value": value,
                    "coefficients": {a: float(c[k]) for a, c in along.coefficients.items()},
                    "standard_errors": {a: float(e[k]) for a, e in along.standard_errors.items()}
                    if known
                    else None,
                }
                for k, value in enumerate(line.tolist())
            ],
            "outside_of": list(along.left),
        }
    points = sweep(
        flown.model, flown.condition, flown.inputs, variable, line.tolist(), **flown.options
    )
    return {
        "version": row.id,
        "variable": variable,
        "points": [
            {"value": point.value, "reason": point.reason}
            if point.trim is None
            else {
                "value": point.value,
                **_trim_part(point.trim),
                "modes": modes_part(point.modes),
            }
            for point in points
        ],
    }


def expansion_document(
    catalogue: Catalogue,
    row: VersionRow,
    flight: StatedCondition,
    variable: str,
    reach: tuple[float, float],
    largest_step: float,
    margins: Margins,
    growth: Sequence[Growth],
    database: AeroDatabase | None = None,
) -> dict[str, Any]:
    """The next permitted point of a version along one variable, from the edge of what has been
    flown towards a target (`reach`) [SI].

    database : in place of the version's own.

    Returns a document: version, variable, value, reached, stopped_by, points (value, violations).
    """
    flown = _Flown(catalogue, row, flight, database)
    found = expand_envelope(
        flown.database, flown.condition, flown.inputs, variable, *reach, largest_step, margins,
        growth, build=flown.build, **flown.options,
    )  # fmt: skip
    return {
        "version": row.id,
        "variable": variable,
        "value": found.value,
        "reached": found.reached,
        "stopped_by": list(found.stopped_by),
        "points": [
            {"value": point.value, "violations": list(point.violations)} for point in found.points
        ],
    }


def _pair(text: str, option: str) -> tuple[str, str]:
    name, sign, value = (part.strip() for part in text.partition("="))
    if not sign or not name or not value:
        raise InputError(f"'{text}' is not NAME=VALUE", option, "for example delta_flap=10deg")
    return name, value


def _control(text: str) -> tuple[str, dict[str, float]]:
    """``roll=delta_left-delta_right`` to the axis and the gains of its inputs."""
    axis, formula = _pair(text, "--control")
    gains: dict[str, float] = {}
    for part in formula.replace("-", "+-").split("+"):
        name = part.strip()
        if name:
            gains[name.lstrip("- ")] = -1.0 if name.startswith("-") else 1.0
    return axis, gains


def sweep_value(text: str, variable: str) -> float:
    """Return the value of a variable of a sweep, with a unit or in SI units ([rad], [m/s], [m]);
    InputError for an unknown unit."""
    units = {"climb": "theta", "bank": "phi", "turn_rate": "r"}
    return value_of(units.get(variable, variable), text)


def _trim_part(found: Trim) -> dict[str, Any]:
    return {
        "channels": dict(found.channels),
        "inputs": dict(found.deflections),
        "standard_errors": dict(found.standard_errors) or None,
        "controls": list(found.problem.controls),
        "notes": list(found.notes),
    }


def _linear_part(linear: LinearModel) -> dict[str, Any]:
    a, b = linear.standard_errors()
    return {
        "states": linear.states,
        "inputs": linear.inputs,
        "outputs": linear.outputs,
        "units": dict(linear.units),
        "A": linear.A.tolist(),
        "B": linear.B.tolist(),
        "C": linear.C.tolist(),
        "D": linear.D.tolist(),
        "A_standard_errors": a.tolist(),
        "B_standard_errors": b.tolist(),
    }
