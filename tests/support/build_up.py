"""A build-up of wing, tail and fin with shared parameters, and flights of it in memory."""

import json
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from aerodb.exchange.native import read_native, to_document
from aerodb.tables import AeroDatabase, parse, with_parameters
from tests.support import effect_flights
from tests.support.flights_in_memory import FlightsInMemory, noisy_flights

TEXT = (
    effect_flights.HEADER_ONLY
    + """\
[parameters]
wing_CLa = { value = 4.4, unit = "1/rad", bounds = [2.0, 7.0], description = "lift slope of the wing" }
tail_CLa = { value = 3.6, unit = "1/rad", bounds = [1.0, 7.0], description = "lift slope of the tail" }
tail_tau = { value = 0.5, bounds = [0.1, 0.9], description = "effectiveness of the elevator" }
fin_CLa = { value = 2.8, unit = "1/rad", bounds = [0.5, 6.0], description = "lift slope of the fin" }
body_CD = { value = 0.03, bounds = [0.005, 0.2], description = "drag of the body" }
[variables]
wing_lift = { expression = "wing_CLa*(alpha + 0.04)" }
tail_alpha = { expression = "0.65*alpha + 6*q/V + tail_tau*delta_elevator" }
tail_lift = { expression = "0.2*tail_CLa*tail_alpha" }
fin_side = { expression = "-0.15*fin_CLa*(beta - 6.5*r/V - 0.5*delta_rudder)" }
[[terms]]
name = "lift"
axis = "CZ"
expression = "-wing_lift - tail_lift"
[[terms]]
name = "drag"
axis = "CX"
expression = "-body_CD + (wing_lift - 0.08*wing_lift)*alpha"
[[terms]]
name = "pitch"
axis = "Cm"
expression = "0.15*wing_lift - 3.2*tail_lift"
[[terms]]
name = "side"
axis = "CY"
expression = "fin_side"
[[terms]]
name = "yaw"
axis = "Cn"
expression = "-0.55*fin_side"
[derivatives.Cl]
beta = -0.1
p_hat = -0.48
r_hat = 0.1
delta_aileron = -0.16
"""
)


def build_up(values: Mapping[str, float] | None = None) -> AeroDatabase:
    """The build-up, with other values of some parameters."""
    return with_parameters(read_native(TEXT), values or {})


def in_newtons(database: AeroDatabase) -> AeroDatabase:
    """The same database with every term of forces, and of pitch and yaw, as a load."""
    loads = {
        "CX": ("FX", "qbar*S_ref"),
        "CY": ("FY", "qbar*S_ref"),
        "CZ": ("FZ", "qbar*S_ref"),
        "Cm": ("MY", "qbar*S_ref*c_ref"),
        "Cn": ("MZ", "qbar*S_ref*b_ref"),
    }
    terms = [
        replace(
            term,
            axis=loads[term.axis][0],
            expression=parse(f"({term.expression})*{loads[term.axis][1]}"),
        )
        if term.axis in loads
        else term
        for term in database.terms
    ]
    return replace(database, terms=tuple(terms))


def flights(seeds: range, truth: AeroDatabase, noise: float = 1.0) -> FlightsInMemory:
    """Flights of the aircraft `truth`; coloured noise on all coefficients."""
    return noisy_flights(seeds, truth, np.random.default_rng(seeds.start), noise)


#: Parameter -> the T-38's value in JSBSim's file, terms that use it, and the number there.
T38: Mapping[str, tuple[float, tuple[str, ...], str]] = {
    "lift_scale": (1.0, ("CLalpha",), ""),
    "Cm_alpha": (-0.3, ("Cmalpha",), "-0.3"),
    "elevator_power": (-0.195, ("Cmde",), "-0.195"),
    "pitch_damping": (-18.0, ("Cmq",), "-18"),
    "aileron_power": (0.0193, ("CldaL", "CldaR"), "0.0193"),
    "roll_damping": (-0.4, ("Clp",), "-0.4"),
    "side_slope": (-1.0, ("CYb",), "-1"),
    "weathercock": (0.1, ("Cnb",), "0.1"),
    "rudder_power": (-0.007, ("Cndr",), "-0.007"),
}


def with_named_numbers(database: AeroDatabase, values: Mapping[str, float]) -> str:
    """A database file of the T-38 as imported, with `T38` as parameters, some of other `values`."""
    document = to_document(database)
    lines = [f"name = {json.dumps(document['name'])}", "[reference]"]
    lines += [f"{name} = {json.dumps(value)}" for name, value in document["reference"].items()]
    lines += ["[parameters]"]
    lines += [
        f"{name} = {{ value = {values.get(name, own)!r} }}" for name, (own, _, _) in T38.items()
    ]
    for name, variable in document["variables"].items():
        lines += [f"[variables.{name}]", f"expression = {json.dumps(variable['expression'])}"]
    for name, table in document["tables"].items():
        lines += [f"[tables.{name}]"]
        lines += [f"{key} = {json.dumps(value)}" for key, value in table.items() if key != "extent"]
    for term in document["terms"]:
        text = term["expression"]
        for parameter, (_, used, number) in T38.items():
            if term["name"] in used:
                text = text.replace(number, parameter) if number else f"{parameter}*({text})"
        lines += ["[[terms]]", *(f"{key} = {json.dumps(term[key])}" for key in ("name", "axis"))]
        lines += [f"expression = {json.dumps(text)}"]
    return "\n".join(lines) + "\n"
