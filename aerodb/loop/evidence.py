"""The evidence of a flight compared with a database.

Residual and columns, copies with more state noise, shape-misfit terms, instruments.
"""

from dataclasses import replace

import numpy as np

from aerodb.effects import hypotheses_for_flight, view_of
from aerodb.loop.flights import FlightSource
from aerodb.loop.library import Library
from aerodb.tables import AeroDatabase
from aerodb.tracing import (
    LONG,
    Evidence,
    bounded_noise,
    evidence_of,
    noisy_copies,
    thinned,
    with_air_data_noise,
    with_commanded_rates,
    with_instruments,
    with_shape_terms,
    without_nuisances,
)


def evidence_beside(
    flights: FlightSource,
    flight: str,
    database: AeroDatabase,
    library: Library,
    *,
    rotating_air: bool = True,
) -> Evidence:
    """Return the evidence of a flight (its id) compared with a database.

    With its copies of more state noise, shape-misfit terms, and instruments from its commands.
    rotating_air : whether the air's rotation is a nuisance, and its roll a part of the state noise;
    a manoeuvre is too short to tell it from the aircraft's own.
    """
    vehicle = flights.vehicle
    whole, beside_whole = flights.comparison(flight, database)
    channels, comparison = thinned(whole, beside_whole, library.settings.bandwidth)
    reconstruction = flights.reconstruction(flight)
    noise = reconstruction.noise
    view = view_of(channels, comparison, database, vehicle)
    if "alpha" in reconstruction.angles:
        view = replace(
            view, air_data_arm=np.zeros_like(view.cg)
        )  # the angles are those at the CG, from the motion there
        noise = None if noise is None else bounded_noise(noise, view, comparison, library.settings)
    elif noise is not None:
        noise = with_air_data_noise(noise, view, comparison, library.settings)
    copies, near = library.settings.noisy_copies, None
    if whole.duration >= LONG:
        copies, near = min(copies, 1), comparison
    noisy = (
        []
        if noise is None
        else noisy_copies(channels, noise, database, vehicle, copies, near, rotating_air)
    )
    hypotheses = hypotheses_for_flight(library.hypotheses, reconstruction.angles)
    evidence = evidence_of(channels, comparison, database, vehicle, hypotheses, noisy, view)
    evidence = with_shape_terms(evidence, channels, library.hypotheses)
    commanded = with_commanded_rates(channels, library.settings.bandwidth)
    if commanded is not None:
        evidence_commanded = evidence_of(commanded, comparison, database, vehicle, hypotheses)
        evidence = with_instruments(
            evidence, with_shape_terms(evidence_commanded, commanded, library.hypotheses)
        )
    return evidence if rotating_air else without_nuisances(evidence)
