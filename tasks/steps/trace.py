"""Tracing: the frozen library of a campaign, and the stored normal equations of each flight."""

from collections.abc import Sequence

from aerodb.increments import Update
from aerodb.loop import Library, SensorRival, sensor_rivals
from aerodb.loop import freeze_library as frozen_library
from aerodb.tables import AeroDatabase
from aerodb.tasks.steps.loop_flights import flights_of
from aerodb.tasks.steps.update import UpdatePlan
from aerodb.tasks.workspace_access import access_workspace
from aerodb.tracing import FlightNormalEquations


def freeze_library(
    plan: UpdatePlan,
    *,
    workspace: str,
    run: str,
    effects: str = "",
    expected: str = "",
    measured: Sequence[str] = (),
) -> Library:
    """Return the library for the plan's baseline, vehicle and the flights' channels.

    effects : text of a file of user templates. measured : as in `aerodb.loop.freeze_library`. Only
    names of channels and flight conditions are
    read, no residual. Raises InputError if the library's hash is not the `expected` one.
    """
    source, baseline = (
        flights_of(workspace, plan.vehicle, run, plan.select),
        access_workspace(workspace).database(plan.baseline),
    )
    return frozen_library(source, plan.hold_out.identified, baseline, effects, expected, measured)


def find_sensor_rivals(
    plan: UpdatePlan, library: Library, update: Update, *, workspace: str, run: str
) -> tuple[SensorRival, ...]:
    """Return the errors of sensors that explain what a declared update changes
    (`aerodb.loop.sensor_rivals`), in SI units. Raises InputError where a flight lacks what is
    needed."""
    source = flights_of(workspace, plan.vehicle, run, plan.select)
    baseline = access_workspace(workspace).database(plan.baseline)
    return sensor_rivals(source, plan.hold_out.identified, baseline, update.candidate, library)


def trace_flight(
    flight: str,
    *,
    workspace: str,
    run: str,
    library: Library,
    database: AeroDatabase,
    select: Sequence[str] = (),
) -> FlightNormalEquations:
    """Return the normal equations of a flight (its id) compared with a database; stored if new.

    select : conditions of the samples that count.

    Reads coefficients and vehicle. Matrices (k, k). Raises UnknownNameError for an unknown id.
    """
    vehicle = access_workspace(workspace).catalogue.flight(flight).vehicle
    return flights_of(workspace, vehicle, run, select).normal_equations(
        [flight], database, library
    )[0]
