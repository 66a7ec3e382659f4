"""How often a permitted envelope contains an unsafe condition: campaigns of envelope expansion in
the simulator, over many planted aircraft.

``python -m tests.campaigns.expansion --kind smooth --seeds 0 20`` appends one line of JSON per
campaign to a file; ``--report`` prints the rates that the file holds.

Each campaign flies a card of standard manoeuvres with sensor noise at every permitted point,
estimates all declared derivatives and their change with alpha from all records so far by output
error, and takes the next point from `expand_envelope`. What it knows beforehand is a rule, the
same for every aircraft: each derivative may change by its own size in `RANGE` of alpha, one sigma.
The planted aircraft are drawn without its knowledge: `smooth` ones change as the rule says,
`sudden` ones are linear to an angle of attack of their own, beyond which they change twice as fast.
"""

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import beta as beta_distribution

from aerodb.errors import InputError
from aerodb.estimation import Parameters, output_error
from aerodb.identification import flight_dynamics
from aerodb.simulation import (
    Condition,
    Expansion,
    FlightModel,
    FlightStretch,
    Margins,
    Trim,
    expand_envelope,
    flight_model,
    simulate,
    trim,
)
from aerodb.simulation.planning.envelope_expansion import POINTS
from tests.support.flying_increments import ALTITUDE, BODY, NOISE, TRUTH, light_aircraft, steps

START, TARGET, STEP = 42.0, 30.0, 2.0
LIMITS = dict.fromkeys(("delta_elevator", "delta_aileron", "delta_rudder"), (-0.35, 0.35))
MARGINS = Margins(sigmas=2.0, control=0.1, growth_rate=0.3)
#: Alpha over which a derivative may change by its own size, one sigma [rad].
RANGE = 0.2
#: Errors of the handbook's derivatives, one sigma, as a share.
HANDBOOK = 0.1
#: Derivatives of the aircraft at the start, constants included.
LINEAR = {**TRUTH, "CZ": {"1": 0.0, **TRUTH["CZ"]}, "Cm": {"1": 0.0, **TRUTH["Cm"]}}
_SAMPLE, _SECONDS = 0.04, 14.0
_NOTHING = 1e-12


@dataclass(frozen=True)
class Campaign:
    """What one campaign did.

    kind, seed : of the planted aircraft. flown : airspeeds [m/s]. limit : farthest airspeed to which
    the aircraft keeps its margins. unsafe : whether a condition of the
    permitted envelope does not. reached : whether the target was permitted. ended : what ended it.
    """

    kind: str
    seed: int
    flown: list[float]
    limit: float
    unsafe: bool
    reached: bool
    ended: str


def _growth(alpha: float) -> dict[str, dict[str, float]]:
    """Axis -> term that grows from an angle of attack on -> standard deviation beforehand."""
    return {
        axis: {f"({term})*(alpha - {alpha!r})" if term != "alpha"
               else f"(alpha - {alpha!r})*(alpha - {alpha!r})": abs(value) / RANGE
               for term, value in own.items() if value}
        for axis, own in LINEAR.items()
    }  # fmt: skip


def start_alpha() -> float:
    """Angle of attack of the trim at which every campaign starts."""
    return trim(light_aircraft(LINEAR), Condition(START, ALTITUDE), BODY, limits=LIMITS).channels[
        "alpha"
    ]


def planted(kind: str, rng: np.random.Generator) -> FlightModel:
    """An aircraft like the known one at the start."""
    alpha = start_alpha()
    if kind == "smooth":
        drawn = {
            axis: {term: float(rng.normal(0.0, sigma)) for term, sigma in own.items()}
            for axis, own in _growth(alpha).items()
        }
    else:
        edge = alpha + float(rng.uniform(0.0, 0.1))
        drawn = {
            axis: {f"({term})*max(alpha - {edge!r}, 0)":
                   float(rng.normal(0.0, 2.0 * abs(value) / RANGE))
                   for term, value in own.items() if value}
            for axis, own in LINEAR.items()
        }  # fmt: skip
        for own in drawn.values():  # the slope itself bends: what was reached stays
            for term in [t for t in own if t.startswith("(alpha)*")]:
                own[f"max(alpha - {edge!r}, 0)*max(alpha - {edge!r}, 0)"] = own.pop(term)
    return light_aircraft({axis: {**own, **drawn[axis]} for axis, own in LINEAR.items()})


def expansion_of(truth: FlightModel, end: float, start: float = START) -> Expansion | None:
    """How far the aircraft keeps its margins from one airspeed to another; None where not even at
    the first."""
    exact = replace(MARGINS, sigmas=0.0)
    try:
        return expand_envelope(
            truth.database, Condition(start, ALTITUDE), BODY, "V", start, end, start - end, exact,
            limits=LIMITS,
        )  # fmt: skip
    except InputError:
        return None


def fly_campaign(kind: str, seed: int, step: float = STEP) -> Campaign:
    """Fly a campaign with the aircraft of this kind and seed; seeds whose aircraft is unsafe at the
    start already are drawn again. step : largest one of the airspeed [m/s]."""
    rng = np.random.default_rng([seed, len(kind)])
    truth, exact = planted(kind, rng), None
    while (exact := expansion_of(truth, TARGET)) is None:
        truth = planted(kind, rng)
    known, prior = _handbook(rng)
    flown, records = [START], dict[str, FlightStretch]()
    value, reached, ended = START, False, ""
    while not reached:
        stretch = _flight(known, truth, value, rng)
        if stretch is None:
            ended = "the aircraft departs"
            break
        records[f"flight {len(records) + 1}"] = stretch
        known = _estimated(known, prior, records)
        try:
            found = expand_envelope(
                known.database, Condition(value, ALTITUDE), BODY, "V", value, TARGET, step,
                MARGINS, limits=LIMITS,
            )  # fmt: skip
        except InputError as error:
            ended = error.what
            break
        if found.value == value:
            ended = "; ".join(found.stopped_by)
            break
        value, reached = found.value, found.reached
        flown.append(value)
    limit = exact.value
    if not exact.reached:  # between two points of the line
        finer = expansion_of(truth, limit - (START - TARGET) / (POINTS - 1), limit)
        limit = limit if finer is None else finer.value
    permitted = expansion_of(truth, value) if value < START else exact
    safe = permitted is not None and (permitted.reached or value == START)
    return Campaign(kind, seed, flown, limit, not safe, reached, ended)


def _handbook(rng: np.random.Generator) -> tuple[FlightModel, Mapping[str, float]]:
    """The model before any flight, and what is known of its growth: name -> standard deviation."""
    growth = _growth(start_alpha())
    terms = {
        axis: {term: value * (1.0 + HANDBOOK * rng.standard_normal()) or _NOTHING
               for term, value in own.items()} | dict.fromkeys(growth[axis], _NOTHING)
        for axis, own in LINEAR.items()
    }  # fmt: skip
    prior = {
        f"estimate_{axis}_{k}_{len(LINEAR[axis]) + j}": sigma
        for k, (axis, own) in enumerate(growth.items())
        for j, sigma in enumerate(own.values())
    }
    return light_aircraft(terms), prior


def _card(time, trimmed: Trim) -> dict[str, np.ndarray]:
    """Inputs added to the trim: 3-2-1-1 on the elevator, doublets on aileron and rudder, as large
    as the elevator's margin leaves."""
    elevator = trimmed.series["delta_elevator"]
    room = float(np.clip(min(0.35 - elevator, elevator + 0.35), 0.0, 0.04))
    return {
        "delta_elevator": steps(time, 1.0, [0.9, 0.6, 0.3, 0.3], room),
        "delta_aileron": steps(time, 5.0, [0.5, 0.5], 0.05),
        "delta_rudder": steps(time, 8.0, [0.8, 0.8], 0.05),
    }


def _flight(
    known: FlightModel, truth: FlightModel, value: float, rng: np.random.Generator
) -> FlightStretch | None:
    """A noisy record of the card from the truth's trim; None where it cannot be flown."""
    condition = Condition(value, ALTITUDE)
    time = np.arange(round(_SECONDS / _SAMPLE) + 1) * _SAMPLE
    try:
        steady = trim(truth, condition, BODY, limits=LIMITS)
    except InputError:
        return None
    series = {name: np.full(len(time), number) for name, number in steady.series.items()}
    for name, added in _card(time, steady).items():
        series[name] = series[name] + added
    run = simulate(truth, time, steady.start, series)
    if not all(np.isfinite(run.channels[name]).all() for name in NOISE):
        return None
    record = {
        name: run.channels[name][:, 0] + rng.normal(0.0, sigma, len(time))
        for name, sigma in NOISE.items()
    }
    start = {name: number for name, number in steady.start.items() if np.ndim(number) == 0}
    start |= {name: float(record[name][0]) for name in start if name in record}
    return FlightStretch(time, start, series, record, (), {})


def _estimated(
    known: FlightModel, prior: Mapping[str, float], records: Mapping[str, FlightStretch]
) -> FlightModel:
    """The known model with all its derivatives and their covariance from all records."""
    names = tuple(known.parameters)
    dynamics, histories = flight_dynamics(known, records, names)
    items = tuple(
        replace(item, prior=0.0, prior_error=prior[item.name]) if item.name in prior else item
        for item in dynamics.parameters.items
    )
    fit = output_error(replace(dynamics, parameters=Parameters(items)), histories)
    increments = []
    for k, each in enumerate(known.database.increments):
        own = [f"estimate_{each.axis}_{k}_{j}" for j in range(len(each.regressors))]
        inside = [fit.names.index(name) for name in own]
        values = [fit[name].value for name in own]
        if not np.isfinite(values).all():
            return known  # the search did not end: nothing new is known
        increments.append(
            replace(
                each, estimates=np.array(values), covariance=fit.covariance[np.ix_(inside, inside)]
            )
        )
    return flight_model(replace(known.database, increments=tuple(increments)))


def rates(campaigns: Sequence[Campaign]) -> str:
    """What some campaigns of one kind came to, in a sentence."""
    n, unsafe = len(campaigns), sum(each.unsafe for each in campaigns)
    low = beta_distribution.ppf(0.025, unsafe, n - unsafe + 1) if unsafe else 0.0
    high = beta_distribution.ppf(0.975, unsafe + 1, n - unsafe) if unsafe < n else 1.0
    used = [
        (START - each.flown[-1]) / (START - each.limit) for each in campaigns if each.limit < START
    ]
    points = sum(len(each.flown) - 1 for each in campaigns)
    return (
        f"{unsafe} of {n} permitted envelopes hold an unsafe condition ({unsafe / n:.1%}, 95 %"
        f" {low:.1%} to {high:.1%}); {points} points permitted; {sum(e.reached for e in campaigns)}"
        f" reached the target; {np.median(used) if used else 0.0:.0%} of the safe range was"
        " permitted (median)"
    )


def main() -> None:
    """Fly campaigns, or report those of a file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kind", choices=("smooth", "sudden"), default="smooth")
    parser.add_argument("--seeds", nargs=2, type=int, default=(0, 5))
    parser.add_argument("--to", type=Path, default=Path("expansion.jsonl"))
    parser.add_argument("--report", action="store_true")
    given = parser.parse_args()
    if not given.report:
        for seed in range(*given.seeds):
            line = json.dumps(asdict(fly_campaign(given.kind, seed)))
            with given.to.open("a") as file:
                file.write(line + "\n")
            print(line, flush=True)
        return
    held = [Campaign(**json.loads(line)) for line in given.to.read_text().splitlines()]
    for kind in ("smooth", "sudden"):
        chosen = [each for each in held if each.kind == kind]
        if chosen:
            print(f"{kind}: {rates(chosen)}")


if __name__ == "__main__":
    main()
