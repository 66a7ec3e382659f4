"""Add the reconstruction's state noise to a flight once more, for SIMEX.

Turbulence also rolls the air. Nothing on board measures this, since it comes from how the vertical
gust differs along the span, and the aircraft follows it; so to the aerodynamics the roll rate of
the gyro has an error, although the gyro has none. Its power follows from that of the vertical
gusts along the path (`rolling_air`). docs/method/tracing.md, section 17.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from aerodb.coefficients import Comparison, compare, total_coefficients
from aerodb.consistency import StateNoise
from aerodb.flight import Flight
from aerodb.physics import (
    HIGH_ALTITUDE_LENGTH,
    PITCH_LAG,
    YAW_LAG,
    gust_density,
    roll_density,
    rotation_gain,
)
from aerodb.support import Array
from aerodb.tables import AeroDatabase
from aerodb.tracing.evidence.low_pass import band_limited
from aerodb.vehicle import Vehicle


def noisy_copies(
    flight: Flight,
    noise: StateNoise,
    database: AeroDatabase,
    vehicle: Vehicle,
    copies: int,
    near: Comparison | None = None,
    rolling_gusts: bool = True,
) -> list[tuple[Flight, Comparison]]:
    """Return `copies` of a reconstructed flight, each with one more realisation of its state noise.

    Each copy comes with its comparison with the database. near : the flight's comparison where its
    channels no longer give it exactly (`thinned`): what the noise changes is added to it.
    rolling_gusts : whether the roll of the air is part of it.

    With the state noise doubled, the bias of estimates doubles (Cook & Stefanski, JASA 89, 1994).
    The noise runs through the whole chain, coefficients and prediction alike, and the roll of the
    air (`rolling_air`) through the prediction alone; draws are seeded by the flight, so that they
    are the same on every machine. Channels are (n,), SI units.
    """
    seed = int.from_bytes(flight.id.encode()[:8].ljust(8, b"0"), "big")
    clean = (
        None
        if near is None
        else compare(flight, total_coefficients(flight, vehicle), database, vehicle.reference)
    )
    rolling = rolling_air(noise, flight, vehicle.reference.span) if rolling_gusts else None
    noisy = []
    for number in range(copies):
        drawn = noise.draw(
            np.random.default_rng([seed, number // 2]), len(flight.time), flight.step
        )
        sign = -1.0 if number % 2 else 1.0
        # The intercepts take what is constant; a mean of matrices with other means would not.
        centred = {name: sign * (error - error.mean()) for name, error in drawn.items()}
        copy = flight.with_channels(_added(flight, centred, vehicle))
        measured = total_coefficients(copy, vehicle)
        if "p" in flight and rolling is not None:
            rolled = rolling.draw(
                np.random.default_rng([seed, number // 2, 1]), len(flight.time), flight.step
            )["p"]
            copy = copy.with_channels({"p": copy["p"] + sign * (rolled - rolled.mean())})
        beside = compare(copy, measured, database, vehicle.reference)
        noisy.append(
            (copy, beside if near is None or clean is None else _on_top(near, beside, clean))
        )
    return noisy


def rolling_air(noise: StateNoise, flight: Flight, span: float) -> StateNoise | None:
    """Spectrum of the rate [rad/s] at which gusts roll the air about an aircraft, as channel p.

    Dryden's gusts w give alpha = w/V the spectrum `aerodb.physics.gust_density` over ``V^2``, and
    the roll rate of the air over the span `roll_density`, each in proportion to the square of their
    intensity. So the gusts that alpha shows give its spectrum, whatever their intensity. What
    counts of alpha is its difference from the path in steady wind beyond the error of its sensor;
    without a vane, the gusts that the smoother allows for.

    span : m. None where the flight has no alpha or airspeed, or the air did not move.
    """
    speed = float(np.nanmedian(flight["V"])) if "V" in flight else 0.0
    if "alpha" not in noise.density or not speed > 0.0:
        return None
    alpha = _gusts(noise, "alpha")
    edges = np.asarray(noise.edges)
    omega = 2.0 * np.pi * np.sqrt(edges[1:] * edges[:-1])
    length = HIGH_ALTITUDE_LENGTH
    square = alpha * speed**2 / gust_density("dryden", "w", omega, speed, length)
    return _of_rates(noise, {"p": square * roll_density(omega, speed, length, span)})


def rotating_air(noise: StateNoise, flight: Flight, span: float) -> StateNoise | None:
    """Spectrum of the rates p, q, r [rad/s] at which gusts turn the air about an aircraft.

    p is that of `rolling_air`. q and r are how the gusts change along the path: `rotation_gain`
    times the spectrum of the gusts in alpha and in beta. span : m. None where the flight has no
    airspeed, or the air did not move.
    """
    rolling = rolling_air(noise, flight, span)
    speed = float(np.nanmedian(flight["V"])) if "V" in flight else 0.0
    edges = np.asarray(noise.edges)
    omega = 2.0 * np.pi * np.sqrt(edges[1:] * edges[:-1])
    density = {} if rolling is None else {"p": np.asarray(rolling.density["p"])}
    for rate, angle, lag in (("q", "alpha", PITCH_LAG), ("r", "beta", YAW_LAG)):
        if angle in noise.density and speed > 0.0:
            density[rate] = _gusts(noise, angle) * rotation_gain(omega, speed, span, lag)
    return _of_rates(noise, density)


def _of_rates(noise: StateNoise, density: Mapping[str, Array]) -> StateNoise | None:
    """The noise with these rates [(rad/s)^2/Hz] only, without a constant part; None where all are
    zero."""
    if not any(each.any() for each in density.values()):
        return None
    return replace(
        noise,
        offset=dict.fromkeys(density, 0.0),
        density={rate: tuple(each.tolist()) for rate, each in density.items()},
        pressure_slope=0.0,
        unsteady={},
    )


def _gusts(noise: StateNoise, angle: str) -> Array:
    """Density of the gusts in a flow angle: its difference from the path in steady wind beyond the
    error of its sensor; without a vane, what the smoother allows for."""
    density = np.asarray(noise.density[angle])
    if angle not in noise.unsteady:
        return density
    return np.maximum(np.asarray(noise.unsteady[angle]) - density, 0.0)


def roll_rates(
    noise: StateNoise, flight: Flight, span: float, bandwidth: float
) -> tuple[float, float]:
    """Return how fast the air rolls about an aircraft, and how fast the aircraft itself, rad/s.

    Standard deviations up to the `bandwidth` [Hz]. noise : with the error that the flow angles may
    have (`with_air_data_noise`), so that what a sensor does is no motion of the air; span : m. The
    first is zero where the air did not move, both are where the flight has no roll rate.
    """
    if "p" not in flight:
        return 0.0, 0.0
    own = band_limited([flight["p"]], np.isfinite(flight["p"]), flight.step, bandwidth).std()
    rolling = rolling_air(noise, flight, span)
    return 0.0 if rolling is None else rolling.rms("p", rolling.edges[0], bandwidth), float(own)


def _on_top(near: Comparison, beside: Comparison, clean: Comparison) -> Comparison:
    """The comparison `near` plus the difference of `beside` from `clean`."""

    def moved(
        base: Mapping[str, Array], to: Mapping[str, Array], start: Mapping[str, Array]
    ) -> dict[str, Array]:
        return {axis: base[axis] + (to[axis] - start[axis]) for axis in near.usable}

    measured = moved(near.measured, beside.measured, clean.measured)
    return replace(
        near, measured=measured, predicted=moved(near.predicted, beside.predicted, clean.predicted)
    )


def _added(flight: Flight, drawn: dict[str, Array], vehicle: Vehicle) -> dict[str, Array]:
    """The channels with their errors, and combined deflections with those of their surfaces; rates
    of the flow angles are left to be derived from the angles.
    """
    errors = dict(drawn)
    for name, each in vehicle.combinations.items():
        right, left = (drawn.get(f"delta_{side}", 0.0) for side in (each.right, each.left))
        if np.ndim(right) or np.ndim(left):
            sign = -1.0 if each.kind == "asymmetric" else 1.0
            errors.setdefault(f"delta_{name}", np.asarray(0.5 * (right + sign * left)))
    return {name: flight[name] + error for name, error in errors.items() if name in flight}
