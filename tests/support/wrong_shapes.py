"""Effects of shapes that no template of the library has, in flights of a closed loop in memory.

Each family adds to what was measured an effect of a shape of its own, at a size in noise floors; the
loop runs as it ships, without a store. What is asked of it: whether it confirms something else than
what is there, whether its band holds the effect point by point, and what error it leaves on flights
that it did not see.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from scipy.signal import lfilter

from aerodb.coefficients import Coefficients, total_coefficients
from aerodb.flight import Flight
from aerodb.loop import (
    Accept,
    Library,
    LoopResult,
    dependences_between_flights,
    freeze_library,
    run_loop,
    unexplained_residuals,
    with_model_error,
)
from aerodb.support.arrays import Array
from aerodb.tables.database import AeroDatabase
from aerodb.tables.reference import transfer_moments
from aerodb.tracing import UnexplainedResidual
from aerodb.tracing.evidence.low_pass import band_limited
from aerodb.vehicle import Vehicle
from tests.support import effect_flights
from tests.support.flights_in_memory import FlightsInMemory
from tests.support.tracing_flights import FLOOR, coloured
from tests.support.varied_flights import _prescribed

#: Flights of the bank; those that identify, and those that the loop does not see.
BANK, IDENTIFY, VALIDATE = 16, 8, 4
SECONDS = 40.0
#: Size of an effect: rms about each flight's mean, in noise floors of its strongest axis.
FLOORS = 5.0
DEGREE = np.pi / 180.0


@lru_cache(maxsize=1)
def database() -> AeroDatabase:
    return effect_flights.database()


@lru_cache(maxsize=1)
def vehicle() -> Vehicle:
    return effect_flights.vehicle()


def _flown_as_one_does(seed: int) -> dict[str, Callable[[Array], Array]]:
    """Surfaces that answer the motion, as a controller's and a pilot's do: strake and rudder answer
    sideslip, the elevator angle of attack; each moves on its own as well."""
    waves = _prescribed(seed)
    beta, alpha = waves["beta"], waves["alpha"]
    strake, rudder, elevator = (waves[f"delta_{n}"] for n in ("strake", "rudder", "elevator"))
    rng = np.random.default_rng([seed, 78])
    height, phase = rng.uniform(1.0, 6.0), rng.uniform(0.0, 6.0)
    middle = float(np.mean(alpha(rng.uniform(0.0, 16.0, 200))))
    return {
        **waves,
        "height_above_ground": lambda t: 7.0 + height * np.sin(0.2 * t + phase),
        "delta_landing_gear": lambda t: np.clip((t - 4.0 * phase) / 3.0, 0.0, 1.0),
        "delta_strake": lambda t: 1.2 * beta(t) + strake(t),
        "delta_rudder": lambda t: rudder(t) - 0.6 * beta(t),
        "delta_elevator": lambda t: elevator(t) - 0.4 * (alpha(t) - middle),
    }


@lru_cache(maxsize=1)
def flown() -> tuple[Flight, ...]:
    """The bank, as perfect instruments at the CG show it."""
    seeds = range(700, 700 + BANK)
    return tuple(
        effect_flights.flown_together(seeds, database(), vehicle(), _flown_as_one_does, SECONDS)
    )


#: Axis -> what is added there (n,), from the true flight.
Planted = Callable[[Flight], Mapping[str, Array]]


@dataclass(frozen=True)
class Family:
    """A wrong shape. acts_on : axes; variables : what it depends on (channels); sensors : sensor
    hypotheses (effects) that say the same; also : effects of the library that say the same of it."""

    name: str
    planted: Planted
    acts_on: frozenset[str]
    variables: frozenset[str]
    sensors: frozenset[str] = frozenset()

    def allows(self, axes: Sequence[str], drivers: Sequence[str]) -> bool:
        """Whether a claim on these axes that depends on these channels is about this effect."""
        rates = {"p_hat": "p", "q_hat": "q", "r_hat": "r", "alphadot_hat": "alphadot"}
        named = {rates.get(name, name) for name in drivers}
        return set(axes) <= self.acts_on and bool(named) and named <= self.variables


def _backlash(values: Array, width: float) -> Array:
    """What moves behind a play of `width` on either side."""
    found, now = np.empty_like(values), values[0]
    for k, value in enumerate(values):
        now = min(max(now, value - width), value + width)
        found[k] = now
    return found


def _lagged(values: Array, time: float, step: float) -> Array:
    keep = np.exp(-step / time)
    start = values[0]
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values - start) + start)


def _carried(flight: Flight, arm: Array) -> dict[str, Array]:
    """Moment coefficients of the database's own normal and side force at an arm (n,) [m] ahead."""
    made = database().predict(flight.channels).coefficients
    return {
        "Cm": arm * made["CZ"] / effect_flights.CHORD,
        "Cn": -arm * made["CY"] / effect_flights.SPAN,
    }


def _moments_of_thrust(flight: Flight) -> dict[str, Array]:
    loads = flight["thrust"] / (flight["qbar"] * effect_flights.AREA)
    return {"Cm": loads * (flight["thrust"] / 2000.0)}


def _one(axis: str, value: Callable[[Flight], Array]) -> Planted:
    return lambda flight: {axis: value(flight)}


def _named(*names: str) -> frozenset[str]:
    return frozenset(names)


FAMILIES: tuple[Family, ...] = (
    Family(
        "dead zone of the elevator",
        _one("Cm", lambda f: np.clip(f["delta_elevator"] + 0.03, -0.025, 0.025)),
        _named("Cm"),
        _named("delta_elevator"),
        _named("surface_scale", "surface_asymmetry"),
    ),
    Family(
        "saturation of the aileron",
        _one("Cl", lambda f: np.clip(f["delta_aileron"], -0.03, 0.03) - f["delta_aileron"]),
        _named("Cl"),
        _named("delta_aileron"),
        _named("surface_scale", "surface_asymmetry"),
    ),
    Family(
        "kink of lift over alpha",
        _one("CZ", lambda f: np.maximum(f["alpha"] - 0.09, 0.0)),
        _named("CZ"),
        _named("alpha"),
    ),
    Family(
        "yaw with the size of the rudder",
        _one("Cn", lambda f: np.abs(f["delta_rudder"])),
        _named("Cn"),
        _named("delta_rudder"),
    ),
    Family(
        "cubic dihedral",
        _one("Cl", lambda f: f["beta"] ** 3),
        _named("Cl"),
        _named("beta", "alpha"),
    ),
    Family(
        "Mach kink of the lift slope",
        _one("CZ", lambda f: -f["alpha"] * np.maximum(f["mach"] - 0.19, 0.0)),
        _named("CZ"),
        _named("alpha", "mach", "qbar"),
    ),
    Family(
        "one-sided spoiler",
        _one("Cl", lambda f: np.maximum(f["delta_strake"], 0.0)),
        _named("Cl"),
        _named("delta_strake"),
        _named("surface_scale"),
    ),
    Family(
        "backlash of the elevator",
        _one(
            "Cm",
            lambda f: -1.1 * (_backlash(f["delta_elevator"], 0.012) - f["delta_elevator"]),
        ),
        _named("Cm"),
        _named("delta_elevator"),
        _named("surface_scale", "surface_asymmetry"),
    ),
    Family(
        "lag of lift",
        _one("CZ", lambda f: -5.0 * (_lagged(f["alpha"], 0.12, f.step) - f["alpha"])),
        _named("CZ"),
        _named("alpha", "alphadot", "q"),
        _named("alpha_delay"),
    ),
    Family(
        "CG moving with fuel",
        lambda f: _carried(f, 0.08 * (f.time - f.time[0]) / (f.time[-1] - f.time[0]) - 0.04),
        _named("Cm", "Cn"),
        _named("time"),
        _named("cg_offset"),
    ),
    Family(
        "thrust line that bends with thrust",
        _moments_of_thrust,
        _named("Cm"),
        _named("thrust", "qbar"),
        _named("thrust_scale", "cg_offset"),
    ),
    Family(
        "roll damping that changes with alpha",
        _one("Cl", lambda f: f["p"] / f["V"] * (f["alpha"] - 0.07)),
        _named("Cl"),
        _named("p", "V", "alpha"),
    ),
)
#: A shape of the library and nothing at all, to compare with.
PLAIN: tuple[Family, ...] = (
    Family(
        "an aileron that is too strong",
        _one("Cl", lambda f: f["delta_aileron"]),
        _named("Cl"),
        _named("delta_aileron"),
        _named("surface_scale", "surface_asymmetry"),
    ),
    Family(
        "pitch damping",
        _one("Cm", lambda f: f["q"] / f["V"]),
        _named("Cm"),
        _named("q"),
    ),
    Family("nothing", _one("Cm", lambda f: 0.0 * f["q"]), _named("Cm"), _named()),
)


@lru_cache(maxsize=32)
def _unit(family: str) -> float:
    """Factor at which the rms of the effect is one noise floor on its strongest axis."""
    planted = next(f.planted for f in (*FAMILIES, *PLAIN) if f.name == family)
    made = [planted(flight) for flight in flown()]
    rms = max(
        float(np.sqrt(np.mean([np.var(each[axis]) for each in made]))) / FLOOR[axis]
        for axis in made[0]
    )
    return 1.0 / rms if rms > 0.0 else 0.0


@dataclass(frozen=True)
class Outcome:
    """One closed loop. wrong : confirmed findings about something else, by id; named : those about
    the planted effect; claims : all findings with verdict; unnamed : axis -> variables. covered :
    part of the samples of flights unseen where the 95 % band of what was added holds the effect;
    nan where nothing was added on its axes. before, after : rms error on flights unseen in floors,
    worst of the axes it acts on. between : what is said to differ between flights."""

    wrong: tuple[str, ...]
    named: tuple[str, ...]
    claims: tuple[tuple[str, str], ...]
    unnamed: Mapping[str, tuple[str, ...]]
    covered: float
    before: float
    after: float
    right_variables: bool
    between: tuple[tuple[str, str], ...] = ()
    between_right: bool = False

    @property
    def said(self) -> bool:
        """Whether little is left, or what is left is said of the right axis and variable."""
        return self.after <= 1.2 or self.right_variables or self.between_right


def closed_loop(family: Family, seed: int, floors: float = FLOORS) -> Outcome:
    """Fly, close the loop, and judge it on flights that it did not see."""
    generator = np.random.default_rng([seed, 31])
    chosen = generator.choice(BANK, IDENTIFY + VALIDATE, replace=False).tolist()
    flights, effects, noises = {}, {}, {}
    for number in chosen:
        flight = flown()[number]
        n = len(flight.time)
        made = total_coefficients(flight, vehicle(), angular_acceleration="logged")
        size = floors * _unit(family.name)
        effect = {axis: size * value for axis, value in family.planted(flight).items()}
        noise = {
            axis: floor * coloured(generator, n, step=flight.step) for axis, floor in FLOOR.items()
        }
        # planted in the database's coefficients; what was measured refers to a point of its own
        planted = {axis: effect.get(axis, np.zeros(n)) for axis in made.values}
        planted = transfer_moments(
            planted,
            np.asarray(database().reference.moment_reference),
            made.moment_reference,
            database().reference,
        )
        values = {axis: given + noise[axis] + planted[axis] for axis, given in made.values.items()}
        flights[flight.id] = (flight, replace(made, values=values))
        effects[flight.id], noises[flight.id] = effect, noise
    source = FlightsInMemory(vehicle(), flights)
    identified, unseen = tuple(flights)[:IDENTIFY], tuple(flights)[IDENTIFY:]
    library = freeze_library(source, identified, database())
    loop = run_loop(source, identified, database(), library, Accept())
    left = unexplained_residuals(source, identified, loop.candidate, library)
    candidate = with_model_error(source, identified, loop, library)
    loop = replace(loop, candidate=candidate)
    outcome = _judged(family, library, loop, left, flights, effects, noises, unseen)
    between = dependences_between_flights(source, identified, library, loop)
    return replace(
        outcome,
        between=tuple((claim.hypothesis.id, claim.condition) for claim in between),
        between_right=any(
            family.allows(claim.hypothesis.axes, (*claim.hypothesis.drivers, claim.condition))
            for claim in between
        ),
    )


def _judged(
    family: Family,
    library: Library,
    loop: LoopResult,
    left: Sequence[UnexplainedResidual],
    flights: Mapping[str, tuple[Flight, Coefficients]],
    effects: Mapping[str, Mapping[str, Array]],
    noises: Mapping[str, Mapping[str, Array]],
    unseen: Sequence[str],
) -> Outcome:
    known = {h.id: h for h in library.hypotheses}
    said = {f.hypothesis: f for f in (*loop.findings, *loop.traced.findings)}
    right, wrong = list[str](), list[str]()
    for finding in said.values():
        hypothesis = known[finding.hypothesis]
        if finding.verdict == "sensor" and finding.effect not in family.sensors:
            wrong.append(finding.hypothesis)
        if finding.verdict == "confirmed":
            fits = family.allows(finding.axis, hypothesis.drivers)
            (right if fits else wrong).append(finding.hypothesis)
    unnamed = {entry.axis: entry.variables for entry in left if entry.found}
    covered, before, after = _on_unseen(family, loop, flights, effects, noises, unseen, library)
    rates = {"p_hat": "p", "q_hat": "q", "r_hat": "r", "alphadot_hat": "alphadot"}
    good = any(
        axis in family.acts_on
        and {rates.get(v.removesuffix("_rate"), v.removesuffix("_rate")) for v in variables}
        & family.variables
        for axis, variables in unnamed.items()
    )
    return Outcome(
        tuple(wrong),
        tuple(right),
        tuple((f.hypothesis, f.verdict) for f in said.values()),
        unnamed,
        covered,
        before,
        after,
        good,
    )


def _on_unseen(
    family: Family,
    loop: LoopResult,
    flights: Mapping[str, tuple[Flight, Coefficients]],
    effects: Mapping[str, Mapping[str, Array]],
    noises: Mapping[str, Mapping[str, Array]],
    unseen: Sequence[str],
    library: Library,
) -> tuple[float, float, float]:
    """Coverage of the band, and errors in the band of tracing about each flight's mean, in parts of
    those of the noise."""
    covered: list[float] = []
    parts: dict[str, list[tuple[float, float, float]]] = {axis: [] for axis in family.acts_on}
    for id in unseen:
        flight, _ = flights[id]
        every = np.ones(len(flight.time), dtype=bool)
        base = database().predict(flight.channels).coefficients
        now = loop.candidate.predict(flight.channels).coefficients
        for axis in family.acts_on:
            added = now[axis] - base[axis]
            effect = effects[id].get(axis, np.zeros(len(added)))
            noise = noises[id][axis]
            limited = band_limited(
                [effect, added, noise], every, flight.step, library.settings.bandwidth
            )
            apart = limited - limited.mean(axis=0)
            parts[axis].append(
                (
                    float(np.mean((apart[:, 0] + apart[:, 2]) ** 2)),
                    float(np.mean((apart[:, 0] - apart[:, 1] + apart[:, 2]) ** 2)),
                    float(np.mean(apart[:, 2] ** 2)),
                )
            )
            error = _sigma(loop, axis, flight)
            if error is not None and np.any(effect):
                miss = (added - added.mean()) - (effect - effect.mean())
                covered.append(float(np.mean(np.abs(miss) <= 1.96 * error)))
    before, after = (
        max(
            float(np.sqrt(np.mean([p[k] for p in of]) / np.mean([p[2] for p in of])))
            for of in parts.values()
        )
        for k in (0, 1)
    )
    return float(np.mean(covered)) if covered else float("nan"), before, after


def _sigma(loop: LoopResult, axis: str, flight: Flight) -> Array | None:
    """Standard error (n,) of what the loop added on an axis, about its mean over the flight, and of
    the shape; None where nothing was added."""
    channels = loop.candidate.resolved(loop.candidate.needs, flight.channels)
    square = np.zeros(len(flight.time))
    found = False
    for increment in loop.candidate.increments:
        if increment.axis == axis:
            found = True
            held, weights = increment.columns(channels)
            columns = held * weights
            of_shape = np.array([not each.names for each in increment.regressors])
            of_shape &= increment.estimates == 0.0
            columns = columns - np.where(of_shape, 0.0, columns.mean(axis=0))
            square += np.einsum("nk,kl,nl->n", columns, increment.covariance, columns)
    return np.sqrt(square) if found else None


@dataclass
class Table:
    """Outcomes of the families, as one row each."""

    rows: dict[str, list[Outcome]] = field(default_factory=dict)

    def add(self, family: Family, outcome: Outcome) -> None:
        self.rows.setdefault(family.name, []).append(outcome)

    def wrong(self) -> float:
        """Part of the loops with a wrong `confirmed` or a wrong `sensor`."""
        every = [o for outcomes in self.rows.values() for o in outcomes]
        return float(np.mean([bool(o.wrong) for o in every]))

    def coverage(self) -> float:
        """Mean pointwise coverage where something was added."""
        every = [o.covered for outcomes in self.rows.values() for o in outcomes]
        return float(np.nanmean(every)) if np.isfinite(every).any() else float("nan")

    def said(self) -> float:
        """Part of the loops with an error within 1.2 floors, or an `unnamed` with a right variable
        on a right axis."""
        every = [o for outcomes in self.rows.values() for o in outcomes]
        return float(np.mean([o.said for o in every]))

    def text(self) -> str:
        lines = []
        for name, outcomes in self.rows.items():
            wrong = Counter(id for o in outcomes for id in o.wrong)
            cover = [o.covered for o in outcomes if np.isfinite(o.covered)]
            lines.append(
                f"{name:38s} n {len(outcomes):2d}  wrong {sum(bool(o.wrong) for o in outcomes):2d}"
                f"  right {sum(bool(o.named) for o in outcomes):2d}"
                f"  coverage {np.mean(cover) if cover else float('nan'):.2f}"
                f"  before {np.mean([o.before for o in outcomes]):.2f}"
                f"  after {np.mean([o.after for o in outcomes]):.2f}"
                f"  said {sum(o.said for o in outcomes):2d}"
                f"  {dict(wrong) or ''}"
            )
        return "\n".join(lines)
