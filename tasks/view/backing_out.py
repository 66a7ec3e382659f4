"""Parameters of a version from the derivatives of a linear model."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.identification import (
    BackedOut,
    DerivativeFile,
    LinearisedFlight,
    back_out,
    matrix_derivatives,
    of_motion,
)
from aerodb.simulation import linear_model
from aerodb.storage.catalogue import Catalogue, VersionRow
from aerodb.support import Array
from aerodb.tables import AeroDatabase
from aerodb.tasks.view.evaluation import database_of
from aerodb.tasks.view.trimming import StatedCondition, trim_of

#: Mass properties of the file that the version's flight takes over.
_MASSES: Final = ("mass", "Ixx", "Iyy", "Izz", "Ixz")
#: Largest difference of the airspeeds of the file and of the version's flight, as a share.
_SAME_SPEED: Final = 0.02


def back_out_document(
    catalogue: Catalogue,
    row: VersionRow,
    flight: StatedCondition,
    file: DerivativeFile,
    names: Sequence[str],
) -> dict[str, Any]:
    """Move parameters of a version until its linear model about a trim meets the derivatives of a
    file, whose mass and moments of inertia the trim has.

    Returns a document: version, parameters (name, start, value, standard_error, unit, at_bound),
    covariance (k, k), derivatives (name, given, standard_error, before, after), converged. SI.

    Raises InputError for a file that states coefficients, other axes or another airspeed, and for
    derivatives that the linear model has not.
    """
    _check(file, flight)
    stated = {text.partition("=")[0].strip() for text in flight.given}
    masses = tuple(f"{name}={file.flight[name]!r}" for name in _MASSES if name not in stated)
    flight = replace(flight, given=(*flight.given, *masses))
    database, given = database_of(catalogue, row), file.stated
    angles = any(name[1:] in ("V", "alpha", "beta") for name in given.names)

    def derivatives_of(moved: AeroDatabase) -> Array:
        found = trim_of(catalogue, row, flight, moved)
        linear = of_motion(linear_model(found, "angles" if angles else "velocities"))
        place = LinearisedFlight(
            **{
                **file.flight,
                "alpha": found.channels["alpha"],
                "theta": found.channels["theta"],
                "V": found.channels["V"],
            }
        )
        own = matrix_derivatives(linear.A, linear.B, linear.states, linear.inputs, place)
        for name in given.names:
            if name not in own:
                raise InputError(
                    f"the version's linear model has no {name}", "derivatives", nearest(name, own)
                )
        return np.array([own[name] for name in given.names])

    return {
        "version": row.id,
        **_document(back_out(given, database, names, derivatives_of), database),
    }


def _check(file: DerivativeFile, flight: StatedCondition) -> None:
    if any(name.startswith("C") for name in file.derivatives) or not file.derivatives:
        raise InputError(
            "it states no dimensional derivatives", "derivatives", "write Mq = [value, error]"
        )
    if file.axes != "body" or not file.primed:
        raise InputError(
            "its derivatives are not those of p' = Lp p + ... in body axes",
            "derivatives",
            "convert them: aerodb derivatives FILE, twice",
        )
    if file.errors:
        raise InputError(
            f"errors of {', '.join(file.errors)} are not counted here",
            "[errors]",
            "leave them out: the trim takes mass and inertia as known",
        )
    speed = flight.condition.V
    if abs(file.flight["V"] - speed) > _SAME_SPEED * speed:
        raise InputError(
            f"the derivatives are of {file.flight['V']:.4g} m/s, the flight has {speed:.4g} m/s",
            "--speed",
            "state the speed of the derivatives",
        )


def _document(found: BackedOut, database: AeroDatabase) -> dict[str, Any]:
    return {
        "parameters": [
            {
                "name": name,
                "start": float(found.start[k]),
                "value": float(found.values[k]),
                "standard_error": float(found.standard_errors[k]),
                "unit": database.variables[name].unit,
                "at_bound": name in found.at_bound,
            }
            for k, name in enumerate(found.names)
        ],
        "covariance": found.covariance.tolist(),
        "derivatives": [
            {
                "name": name,
                "given": float(found.given.values[k]),
                "standard_error": float(found.given.standard_errors[k]),
                "before": float(found.before[k]),
                "after": float(found.after[k]),
            }
            for k, name in enumerate(found.given.names)
        ],
        "converged": found.converged,
    }
