"""Freeze the library of a campaign before any residual is read: expand it for its flights and hash
it.

Where flights stall, the stall shape of each flight is fitted to the other flights: the family of
shapes is hashed, its numbers are not.
"""

from collections.abc import Sequence

from aerodb.effects import (
    hypotheses_for,
    library_sha256,
    parse_effects,
    registered_templates,
    with_reconstructed_angles,
    within_reconstruction_accuracy,
)
from aerodb.errors import InputError
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.frozen_library import Library
from aerodb.loop.stall import cross_fitted_laws, of_family, stalled_flights, with_laws
from aerodb.loop.stall_hysteresis import (
    cross_fitted_lift_hysteresis,
    lift_hysteresis_of_family,
    with_lift_hysteresis,
)
from aerodb.tables import AeroDatabase, Law, Relay
from aerodb.tracing import TracingSettings, tracing_bandwidth
from aerodb.vehicle import with_measured


def freeze_library(
    flights: FlightSource,
    identified: Sequence[str],
    database: AeroDatabase,
    effects: str = "",
    expected: str = "",
    measured: Sequence[str] = (),
) -> Library:
    """Return the library for a baseline and the channels of the flights (ids) that identify.

    effects : text of a file of user templates. measured : what was measured outside flight, in
    addition to the vehicle file, as `aerodb.vehicle.with_measured` reads it. Only channels' names
    and flight conditions are read. Raises InputError when its hash is not the `expected` one.
    """
    vehicle = with_measured(flights.vehicle, measured) if measured else flights.vehicle
    flown = [flights.flight(id) for id in identified]
    channels = set[str]().union(*(flight.channels for flight in flown))
    user = (*registered_templates(), *(parse_effects(effects) if effects else ()))
    reconstructions = [flights.reconstruction(id) for id in identified]
    angle_sets = [each.angles for each in reconstructions]
    reconstructed = frozenset({"alpha", "beta"}).intersection(*angle_sets)
    hypotheses = hypotheses_for(database, vehicle, channels, user=user)
    hypotheses = with_reconstructed_angles(
        hypotheses, {"alpha", "beta"} - reconstructed, frozenset[str]().union(*angle_sets)
    )
    stalled = stalled_flights(flights, identified)
    if stalled:
        hypotheses = (*of_family(hypotheses), lift_hysteresis_of_family(database, vehicle))
    settings = TracingSettings(bandwidth=tracing_bandwidth(database, vehicle, flown))
    sha256 = library_sha256(hypotheses, settings=None)
    if expected and not sha256.startswith(expected):
        found = f"{sha256[:12]}, not {expected[:12]}"
        what = f"the list of effects is {found}: it changed since it was fixed"
        remedy = "trace with the list that was fixed, or leave --library out and say why it changed"
        raise InputError(what, "close-loop", remedy)
    laws: dict[str, Law] = {}
    lift_hysteresis: dict[str, Relay] = {}
    if stalled:
        laws, lift_hysteresis = (
            cross_fitted_laws(flights, stalled, database),
            cross_fitted_lift_hysteresis(flights, stalled, database),
        )
        hypotheses = with_lift_hysteresis(
            with_laws(hypotheses, laws, database, vehicle), lift_hysteresis, database, vehicle
        )
    hypotheses = within_reconstruction_accuracy(
        hypotheses,
        [each.known for each in reconstructions],
        independent=not any(each.calibrated for each in reconstructions),
    )
    return Library(hypotheses, settings, sha256, laws, lift_hysteresis, reconstructed)
