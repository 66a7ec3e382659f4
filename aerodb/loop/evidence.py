"""The evidence of a flight compared with a database.

Residual and columns, copies with more state noise, shape-misfit terms, instruments.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.consistency import StateNoise
from aerodb.effects import FlightView, hypotheses_for_flight, view_of
from aerodb.flight import Flight
from aerodb.loop.flight_source import FlightSource, ReconstructionErrors, on_each
from aerodb.loop.frozen_library import Library
from aerodb.tables import AeroDatabase
from aerodb.tracing import (
    LONG,
    Evidence,
    FlightNormalEquations,
    TracingSettings,
    bounded_noise,
    evidence_of,
    noisy_copies,
    normal_equations_of,
    with_air_data_noise,
    with_commanded_rates,
    with_deflection_noise,
    with_instruments,
    with_shape_terms,
)


def noise_within_limits(
    reconstruction: ReconstructionErrors,
    view: FlightView,
    settings: TracingSettings,
) -> StateNoise | None:
    """Return the state noise of a flight, as large as its own residuals allow; None where nothing
    was reconstructed. Densities are per band, in [rad²/Hz] for angles; limits: `bounded_noise`,
    `with_air_data_noise`.
    """
    if reconstruction.noise is None:
        return None
    bound = bounded_noise if "alpha" in reconstruction.angles else with_air_data_noise
    return bound(reconstruction.noise, view, settings)


def copies_with_noise(
    view: FlightView,
    whole: Flight,
    reconstruction: ReconstructionErrors,
    settings: TracingSettings,
    rotating_air: bool = False,
) -> list[tuple[Flight, Comparison]]:
    """Return copies of a flight with its state noise once more, each with its comparison.

    The noise is as large as the flight's own residuals allow, and has that of the deflections as
    the vehicle file states it. view : at the rate for tracing; whole : the flight as it was
    recorded; rotating_air : whether gusts roll the air in them. One copy of a long flight, none
    where nothing was reconstructed or stated. Source: docs/method/tracing.md, section 17.
    """
    noise = with_deflection_noise(
        noise_within_limits(reconstruction, view, settings),
        view.vehicle,
        view.recorded.channels,
        whole.step,
    )
    if noise is None:
        return []
    copies, near = settings.noisy_copies, None
    if whole.duration >= LONG:
        copies, near = min(copies, 1), view.comparison
    return noisy_copies(
        view.recorded, noise, view.database, view.vehicle, copies, near, rotating_air
    )


def evidence_beside(
    flights: FlightSource,
    flight: str,
    database: AeroDatabase,
    library: Library,
    *,
    rotating_air: bool = False,
) -> Evidence:
    """Return the evidence of a flight (its id) compared with a database: residual and columns (n,),
    dimensionless and per SI unit of each parameter.

    With its copies of more state noise, shape-misfit terms, and instruments from its commands.
    rotating_air : whether the air's rotation is a nuisance, and its roll a part of the state noise.
    The search does without both; findings of rates are tested once more with them. Raises
    InputError where the flight lacks what is needed.
    """
    view = flights.view(flight, database, library.settings.bandwidth)
    reconstruction = flights.reconstruction(flight)
    channels = view.recorded
    if "alpha" in reconstruction.angles:
        view = replace(
            view, air_data_arm=np.zeros_like(view.cg)
        )  # the angles are those at the CG, from the motion there
    noisy = copies_with_noise(
        view,
        flights.flight(flight),
        reconstruction,
        library.settings,
        rotating_air,
    )
    hypotheses = hypotheses_for_flight(library.hypotheses, reconstruction.angles)
    evidence = evidence_of(view, hypotheses, noisy, rotating_air)
    evidence = with_shape_terms(evidence, channels, library.hypotheses)
    commanded = with_commanded_rates(channels, library.settings.bandwidth)
    if commanded is not None:
        flown_as_commanded = view_of(commanded, view.comparison, database, view.vehicle)
        evidence_commanded = evidence_of(flown_as_commanded, hypotheses, rotating_air=rotating_air)
        evidence = with_instruments(
            evidence, with_shape_terms(evidence_commanded, commanded, library.hypotheses)
        )
    return evidence


def normal_equations_beside(
    source: FlightSource,
    flights: Sequence[str],
    database: AeroDatabase,
    library: Library,
    *,
    rotating_air: bool = False,
) -> list[FlightNormalEquations]:
    """Return the normal equations of the evidence of flights (their ids) compared with a database;
    matrices (k, k), whitened. As `evidence_beside`."""

    def of(flight: str) -> FlightNormalEquations:
        evidence = evidence_beside(source, flight, database, library, rotating_air=rotating_air)
        return normal_equations_of(evidence, library.settings)

    return on_each(source, flights, of)
