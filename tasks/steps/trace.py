"""Tracing as steps: the frozen library of a campaign, and the stored cross-products of each
flight."""

from aerodb.loop import Library
from aerodb.loop import freeze_library as frozen_library
from aerodb.tables import AeroDatabase
from aerodb.tasks.loop_flights import flights_of
from aerodb.tasks.steps.update import Plan
from aerodb.tasks.workspace_access import access_workspace
from aerodb.tracing import NormalEquations


def freeze_library(
    plan: Plan, *, workspace: str, run: str, effects: str = "", expected: str = ""
) -> Library:
    """The library for the plan's baseline, vehicle and flights' channels; `effects` is the text of
    a file of user templates.

    Only channels' names and flight conditions are looked at. Raises InputError when its hash is not
    the `expected` one.
    """
    source, baseline = (
        flights_of(workspace, plan.vehicle, run),
        access_workspace(workspace).database(plan.baseline),
    )
    return frozen_library(source, plan.hold_out.identified, baseline, effects, expected)


def trace_flight(
    flight: str, *, workspace: str, run: str, library: Library, database: AeroDatabase
) -> NormalEquations:
    """The normal equations of a flight (its id) beside a database; read back when it is stored, else made and
    stored."""
    vehicle = access_workspace(workspace).catalogue.flight(flight).vehicle
    return flights_of(workspace, vehicle, run).normal_equations(flight, database, library)
