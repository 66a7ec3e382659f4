"""Campaigns of envelope expansion in the simulator: the truth flies, and only its noisy records are
seen by what decides on the next point."""

from dataclasses import replace

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation import output_error
from aerodb.identification import (
    Expansion,
    Growth,
    Margins,
    design_manoeuvre,
    expand_envelope,
    flight_dynamics,
)
from aerodb.simulation import Condition, Stretch, flight_model, simulate, trim
from tests.support.flying_increments import ALTITUDE, BODY, NOISE, TRUTH, light_aircraft

START, TARGET, STEP = 42.0, 30.0, 4.0
LIMITS = dict.fromkeys(("delta_elevator", "delta_aileron", "delta_rudder"), (-0.35, 0.35))
MARGINS = Margins(sigmas=2.0, control=0.1, growth_rate=0.3)
#: What a designer would expect of the derivatives beyond what was flown, per rad.
GROWTH = (Growth("Cm", "delta_elevator", 3.0), Growth("Cm", "alpha", 4.0))
_SECONDS = 8.0


def true_violations(truth, value) -> bool:
    """Whether the truth leaves its margins at an airspeed, known without error."""
    exact = replace(MARGINS, sigmas=0.0)
    try:
        expand_envelope(
            light_aircraft(**truth).database, Condition(value, ALTITUDE), BODY, "V", value, value - 1e-6,
            1e-6, exact, limits=LIMITS,
        )  # fmt: skip
    except InputError:
        return True
    return False


def campaign(truth, seed) -> tuple[list[float], Expansion]:
    """Airspeeds flown, and the last expansion; `truth`: terms of the flown aircraft that replace
    those of the known one."""
    rng = np.random.default_rng(seed)
    known = light_aircraft({**TRUTH, "Cm": {"1": 1e-12, **TRUTH["Cm"]}})
    flown: list[float] = []
    value = START
    while True:
        flown.append(value)
        known = _estimated(known, _flight(known, truth, value, rng))
        found = expand_envelope(
            known.database, Condition(value, ALTITUDE), BODY, "V", value, TARGET, STEP, MARGINS,
            GROWTH, limits=LIMITS,
        )  # fmt: skip
        if found.reached or found.value == value:
            return flown, found
        value = found.value


def _names(model):
    return [name for name in model.parameters if name.startswith("estimate_Cm")]


def _flight(known, truth, value, rng):
    """A noisy record of the manoeuvre that the known model designs, flown by the truth."""
    condition = Condition(value, ALTITUDE)
    trimmed = trim(known, condition, BODY, limits=LIMITS)
    designed = design_manoeuvre(
        trimmed,
        {name: name for name in _names(known)},
        LIMITS,
        {"alpha": (trimmed.channels["alpha"] - 0.03, trimmed.channels["alpha"] + 0.03)},
        duration=_SECONDS,
        moved=("pitch",),
    )
    time = np.arange(round(_SECONDS / 0.04) + 1) * 0.04
    actual = light_aircraft(**truth)
    steady = trim(actual, condition, BODY, limits=LIMITS)
    series = {name: np.full(len(time), number) for name, number in steady.series.items()}
    for name, added in designed.manoeuvre.series(time).items():
        series[name] = series[name] + added
    run = simulate(actual, time, steady.start, series)
    record = {
        name: run.channels[name][:, 0] + rng.normal(0.0, sigma, len(time))
        for name, sigma in NOISE.items()
    }
    start = {name: number for name, number in trimmed.start.items() if np.ndim(number) == 0}
    start |= {name: float(record[name][0]) for name in start if name in record}
    return Stretch(time, start, series, record, (), {})


def _estimated(known, stretch):
    """The known model with the pitching moment of the last record and its covariance."""
    names = _names(known)
    dynamics, records = flight_dynamics(known, {"flight": stretch}, tuple(names))
    fit = output_error(dynamics, records)
    inside = [fit.names.index(name) for name in names]
    covariance = fit.covariance[np.ix_(inside, inside)]
    scale = np.sqrt(np.diag(covariance))
    errors = np.array([fit[name].standard_error for name in names])
    covariance = covariance / np.outer(scale, scale) * np.outer(errors, errors)
    increments = tuple(
        replace(
            each, estimates=np.array([fit[name].value for name in names]), covariance=covariance
        )
        if each.axis == "Cm"
        else each
        for each in known.database.increments
    )
    return flight_model(replace(known.database, increments=increments))
