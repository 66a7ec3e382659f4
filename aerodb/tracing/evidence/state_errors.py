"""Add the reconstruction's state noise to a flight once more, for SIMEX.

Turbulence also rolls the air. Nothing on board measures this, since it comes from how the vertical
gust differs along the span, and the aircraft follows it; so to the aerodynamics the roll rate of
the gyro has an error, although the gyro has none. Its power follows from that of the vertical
gusts along the path (`rolling_air`). docs/method/tracing.md, section 17.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.coefficients import Comparison, compare, total_coefficients
from aerodb.consistency import StateNoise
from aerodb.flight import Flight
from aerodb.support import Array
from aerodb.tables import AeroDatabase
from aerodb.tracing.evidence.low_pass import band_limited
from aerodb.vehicle import Vehicle

#: Length L of vertical gusts above 2000 ft [m] (MIL-F-8785C, 1980, 3.7.2.1).
_LENGTH: Final = 533.4
#: One sigma of the air's roll rate in ``sigma_w / sqrt(L b)`` (Yeager, NASA CR-1998-206937, table
#: 1).
_SIZE: Final = 1.9
#: Bandwidth of the air's roll rate in ``V / sqrt(L b)`` (the same table).
_BANDWIDTH: Final = 2.6


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

    For Dryden gusts w of scale L, alpha = w/V has the one-sided spectrum ``(2 L s^2 / V^3) (1 + 3
    x^2) / (1 + x^2)^2`` with ``x = omega L / V`` (MIL-F-8785C, 3.7.1.3); the roll rate of the air
    over the span b is a first-order process with ``1.9 s / sqrt(L b)`` and the time constant
    ``sqrt(L b) / 2.6 V`` (Yeager 1998). So the gusts that alpha shows give its spectrum, whatever
    their intensity s. What counts of alpha is its difference from the path in steady wind beyond
    the error of its sensor; without a vane, the gusts that the smoother allows for.

    span : m. None where the flight has no alpha or airspeed, or the air did not move.
    """
    speed = float(np.nanmedian(flight["V"])) if "V" in flight else 0.0
    if "alpha" not in noise.density or not speed > 0.0:
        return None
    alpha = _gusts(noise, "alpha")
    edges = np.asarray(noise.edges)
    omega = 2.0 * np.pi * np.sqrt(edges[1:] * edges[:-1])
    x = np.square(omega * _LENGTH / speed)
    intensity = alpha * (1.0 + x) ** 2 / (1.0 + 3.0 * x) * speed**3 / (2.0 * _LENGTH)
    size, time = _SIZE**2 / (_LENGTH * span), np.sqrt(_LENGTH * span) / (_BANDWIDTH * speed)
    density = intensity * size * 4.0 * time / (1.0 + (omega * time) ** 2)
    return _of_rates(noise, {"p": density})


def rotating_air(noise: StateNoise, flight: Flight, span: float) -> StateNoise | None:
    """Spectrum of the rates p, q, r [rad/s] at which gusts turn the air about an aircraft.

    p is that of `rolling_air`. q and r are how the gusts change along the path: ``omega^2 / (1 +
    (4 b omega / pi V)^2)`` times the spectrum of the gusts in alpha, and with 3 in place of 4 of
    those in beta (MIL-F-8785C, 3.7.5). span : m. None where the flight has no airspeed, or the air
    did not move.
    """
    rolling = rolling_air(noise, flight, span)
    speed = float(np.nanmedian(flight["V"])) if "V" in flight else 0.0
    edges = np.asarray(noise.edges)
    omega = 2.0 * np.pi * np.sqrt(edges[1:] * edges[:-1])
    density = {} if rolling is None else {"p": np.asarray(rolling.density["p"])}
    for rate, angle, width in (("q", "alpha", 4.0), ("r", "beta", 3.0)):
        if angle in noise.density and speed > 0.0:
            filtered = omega**2 / (1.0 + (width * span * omega / (np.pi * speed)) ** 2)
            density[rate] = _gusts(noise, angle) * filtered
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
