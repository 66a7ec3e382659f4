"""Campaigns of flights that differ in their conditions: airspeed, angle of attack and flaps.

A bank of flights is flown once, exactly by a database. A campaign draws some of them, adds an
effect to what was measured, gives each flight's sensors errors, adds the coloured residual of
`tracing_flights`, and asks what changes between the flights.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from aerodb.coefficients.comparison import compare
from aerodb.coefficients.total import total_coefficients
from aerodb.effects.flight_view import view_of
from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.library import hypotheses_for
from aerodb.flight import Flight
from aerodb.loop.between_flights import conditions_of
from aerodb.support.arrays import Array
from aerodb.tables.database import AeroDatabase
from aerodb.tracing.decision.between_flights import FlightDependence, dependences_on_conditions
from aerodb.tracing.decision.findings import Traced
from aerodb.tracing.decision.verdicts import trace
from aerodb.tracing.evidence.flight_evidence import evidence_of
from aerodb.tracing.evidence.normal_equations import normal_equations_of
from aerodb.tracing.evidence.shape_misfit import with_shape_terms
from aerodb.tracing.settings import TracingSettings
from aerodb.vehicle import Vehicle
from tests.support import effect_flights
from tests.support.tracing_flights import FLOOR, coloured

SETTINGS = TracingSettings(bandwidth=1.5)
#: Flights of the bank.
BANK = 30


@lru_cache(maxsize=1)
def vehicle() -> Vehicle:
    return effect_flights.vehicle()


@lru_cache(maxsize=1)
def database() -> AeroDatabase:
    return effect_flights.database()


@lru_cache(maxsize=1)
def library() -> tuple[Hypothesis, ...]:
    return hypotheses_for(database(), vehicle(), effect_flights.channel_names())


def _prescribed(seed: int) -> dict[str, Callable[[Array], Array]]:
    """As `effect_flights.prescribed`, at an airspeed, an angle of attack and a flap setting of its
    own."""
    rng = np.random.default_rng([seed, 77])
    faster, steeper, flap = rng.uniform(-16.0, 22.0), rng.uniform(-0.05, 0.05), rng.uniform(0, 0.35)
    waves = effect_flights.prescribed(seed)
    speed, alpha = waves["V"], waves["alpha"]
    return {
        **waves,
        "V": lambda t: speed(t) + faster,
        "alpha": lambda t: alpha(t) + steeper,
        "delta_flap": lambda t: flap + 0.0 * t,
    }


@lru_cache(maxsize=1)
def flown() -> tuple[Flight, ...]:
    """The bank, as perfect instruments at the CG show it."""
    return tuple(
        effect_flights.flown_together(range(300, 300 + BANK), database(), vehicle(), _prescribed)
    )


#: Axis -> what is added there (n,), from the true flight.
Planted = Callable[[Flight], Mapping[str, Array]]


def in_floors(planted: Planted, floors: float) -> Planted:
    """The effect at a size of which the rms over all flights, about each flight's mean, is `floors`
    noise floors on its strongest axis."""
    sizes = [
        {axis: float(np.std(values)) / FLOOR[axis] for axis, values in planted(f).items()}
        for f in flown()
    ]
    rms = max(float(np.sqrt(np.mean([s[axis] ** 2 for s in sizes]))) for axis in sizes[0])
    return lambda flight: {axis: floors / rms * values for axis, values in planted(flight).items()}


@dataclass(frozen=True)
class Errors:
    """Errors of a flight's sensors and vehicle data, in sigmas of the library's priors.

    of : sensor hypothesis id -> sigmas.
    """

    of: Mapping[str, float]

    @classmethod
    def drawn(cls, generator: np.random.Generator) -> "Errors":
        sensors = [h.id for h in library() if h.kind == "sensor"]
        return cls(
            dict(zip(sensors, generator.standard_normal(len(sensors)).tolist(), strict=True))
        )

    def __getitem__(self, id: str) -> float:
        prior = next(h.prior_sigma for h in library() if h.id == id)
        return self.of.get(id, 0.0) * (prior or 0.0)

    def read(self, flight: Flight) -> Flight:
        """What the instruments show."""
        channels = dict(flight.channels)
        for name in ("alpha", "beta"):
            channels[name] = channels[name] * (1.0 + self[f"{name}_scale@all"])
            channels[name] = channels[name] + self[f"{name}_bias@all"]
        channels["qbar"] = (
            channels["qbar"] * (1.0 + self["qbar_scale@all"]) + self["qbar_offset@all"]
        )
        for axis, rate in zip("xyz", "pqr", strict=True):
            channels[f"a{axis}"] = channels[f"a{axis}"] + self[f"accelerometer_bias@all:{axis}"]
            scale = 1.0 + self[f"gyro_scale@all:{rate}"]
            channels[rate] = channels[rate] * scale + self[f"gyro_bias@all:{rate}"]
            channels[f"{rate}dot"] = channels[f"{rate}dot"] * scale
        for name in [n for n in channels if n.startswith("delta_")]:
            id = f"surface_scale@all:{name.removeprefix('delta_')}"
            if any(h.id == id for h in library()):
                channels[name] = channels[name] * (1.0 + self[id])
        return Flight(flight.id, flight.vehicle, flight.time, channels)

    def assumed(self) -> Vehicle:
        """The vehicle as the analyst has it."""
        mass = vehicle().mass
        cg = np.asarray(mass.cg, dtype=np.float64) + np.array(
            [self[f"cg_offset@all:{axis}"] for axis in "xyz"]
        )
        changed = mass.model_copy(
            update={
                "mass": float(np.asarray(mass.mass)) * (1.0 + self["mass_error@all"]),
                "cg": tuple(cg.tolist()),
                **{
                    f"I{k}": float(np.asarray(getattr(mass, f"I{k}")))
                    * (1.0 + self[f"inertia_error@all:I{k}"])
                    for k in ("xx", "yy", "zz")
                },
            }
        )
        return vehicle().model_copy(update={"mass": changed})


RIGHT = Errors({})


@dataclass(frozen=True)
class Campaign:
    """What tracing and the comparison of flights say of one campaign."""

    traced: Traced
    between: tuple[FlightDependence, ...]


def campaign(
    count: int,
    generator: np.random.Generator,
    planted: Planted | None = None,
    errors: Sequence[Errors] | None = None,
) -> Campaign:
    """`count` flights of the bank with a fresh residual each. errors : of each flight's sensors."""
    chosen = generator.choice(len(flown()), count, replace=False)
    equations, views = [], []
    for position, number in enumerate(chosen.tolist()):
        flight = flown()[number]
        wrong = errors[position] if errors else RIGHT
        read, assumed = wrong.read(flight), wrong.assumed()
        made = total_coefficients(read, assumed, angular_acceleration="logged")
        values = dict(made.values)
        for axis, effect in (planted(flight) if planted else {}).items():
            values[axis] = values[axis] + effect * flight["qbar"] / read["qbar"]
        n = len(flight.time)
        for axis, size in FLOOR.items():
            values[axis] = values[axis] + size * (
                coloured(generator, n, step=flight.step) + generator.standard_normal()
            )
        comparison = compare(read, replace(made, values=values), database(), assumed.reference)
        view = view_of(read, comparison, database(), assumed)
        evidence = evidence_of(view, library())
        equations.append(normal_equations_of(with_shape_terms(evidence, read, library()), SETTINGS))
        views.append(view)
    traced = trace(equations, library(), SETTINGS)
    between = dependences_on_conditions(
        equations, library(), SETTINGS, traced, conditions_of(views)
    )
    return Campaign(traced, between)
