"""Encounters that a lattice of 200 strips flies: the wake from the air at the nose, and from the reaction of 20 strips."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.coefficients import compare, total_coefficients
from aerodb.exchange import read_native
from aerodb.flight import Flight
from aerodb.identification import METHODS, IdentificationFlight, fits_of, identify_wake
from aerodb.increments import parse_model_file
from aerodb.nomenclature import AXES
from aerodb.tables import AeroDatabase, with_parameters
from aerodb.vehicle import parse_vehicle
from tests.support import two_hundred_strips as lattice

G, RC, B = 200.0, 1.5, 17.0
NOSE = np.array([4.0, 0.0, 0.0])
VEHICLE = parse_vehicle(
    f"""name = "strips"
[reference]
area = 18.0
chord = 1.5
span = 12.0
[points]
moment_reference = [0.0, 0.0, 0.0]
[mass]
source = "constant"
mass = {lattice.MASS}
cg = [0.0, 0.0, 0.0]
Ixx = {lattice.INERTIA[0]}
Iyy = {lattice.INERTIA[1]}
Izz = {lattice.INERTIA[2]}
Ixz = 0.0
[thrust]
source = "none"
"""
)
#: The aircraft as a few lines of a build-up: 20 strips on wing and on tail, of rough slopes.
STRIPS = """name = "strips"
[reference]
area = 18.0
chord = 1.5
span = 12.0
moment_reference = [0.0, 0.0, 0.0]
[parameters]
wing_slope = { value = 4.5, bounds = [2.0, 8.0] }
wing_drag = { value = 0.3, bounds = [0.0, 3.0] }
tail_slope = { value = 4.0, bounds = [1.0, 8.0] }
fin_slope = { value = 2.0, bounds = [0.5, 6.0] }
wash = { value = 0.2, bounds = [0.0, 1.0] }
[parts.wing]
kind = "surface"
root = [-0.05, 0.0, 0.0]
tip = [-0.05, 6.0, -0.42]
root_chord = 1.5
strips = 10
incidence = "2 deg"
mirror = true
lift = "wing_slope*sqrt(1 - station^2)*alpha"
drag = "wing_drag*alpha^2"
[parts.tail]
kind = "surface"
root = [-5.05, 0.0, -0.6]
tip = [-5.05, 1.9, -0.6]
root_chord = 0.9
strips = 10
mirror = true
lift = "tail_slope*sqrt(1 - station^2)*alpha"
downwash = "wash*(alpha + 0.035)"
[parts.fin]
kind = "section"
position = [-5.05, 0.0, -0.7]
area = 1.4
dihedral = "90 deg"
lift = "fin_slope*alpha"
"""
WAKE = """
[parts.wake]
kind = "wake"
circulation = "vortex_strength"
core_radius = "vortex_core"
spacing = "vortex_spacing"
right = "vortex_right"
below = "vortex_below"
point = [0.0, 0.0, 0.0]
heading = 0.0
core = "{core}"
"""
UNKNOWN = ("vortex_strength", "vortex_core", "vortex_spacing", "vortex_right", "vortex_below")
SHAPES = ("wing_slope", "wing_drag", "tail_slope", "fin_slope", "wash")


def _given(
    flown: dict[str, np.ndarray], air: np.ndarray, database: AeroDatabase, name: str
) -> IdentificationFlight:
    """A flight with the loads of the lattice as coefficients, with noise of 1 %; air (3, n) is that at the centre of
    gravity in body axes, which V, alpha and beta hold."""
    u, v, w = flown["velocity"] - air
    speed = np.sqrt(u * u + v * v + w * w)
    qbar = 0.5 * lattice.RHO * speed**2
    (p, q, r), (phi, theta, psi), (north, east, down) = (
        flown[k] for k in ("rates", "attitude", "place")
    )
    zero = 0.0 * speed
    flight = Flight(
        id=name,
        vehicle="strips",
        time=flown["time"],
        channels={
            "V": speed, "alpha": np.arctan2(w, u), "beta": np.arcsin(v / speed), "p": p, "q": q, "r": r, "qbar": qbar,
            "rho": zero + lattice.RHO, "phi": phi, "theta": theta, "psi": psi, "north": north, "east": east,
            "altitude": -down, "ax": zero, "ay": zero, "az": zero, "pdot": zero, "qdot": zero, "rdot": zero,
        },
    )  # fmt: skip
    made = total_coefficients(flight, VEHICLE, angular_acceleration="logged")
    rng = np.random.default_rng(len(speed))
    values = {}
    for k, axis in enumerate(AXES):
        load = flown["force" if k < 3 else "moment"][k % 3]
        of = load / (qbar * 18.0 * (1.0, 1.0, 1.0, 12.0, 1.5, 12.0)[k])
        values[axis] = of + 0.01 * of.std() * rng.standard_normal(len(of))
    coefficients = replace(made, values=values)
    return IdentificationFlight(
        flight, compare(flight, coefficients, database, VEHICLE.reference), coefficients, VEHICLE, ()
    )  # fmt: skip


@pytest.fixture(scope="module")
def strips() -> AeroDatabase:
    """20 strips with the slopes that they show in still air."""
    time = np.arange(600) / 25.0
    phases = np.random.default_rng(3).uniform(0.0, 2.0 * np.pi, (6, 3))
    moved = np.array([
        sum(np.sin(2.0 * np.pi * f * time + phase) for f, phase in zip((0.13, 0.31, 0.57), row, strict=True))
        for row in phases
    ])  # fmt: skip
    alpha, beta = 0.02 + 0.02 * moved[0], 0.03 * moved[1]
    velocity = lattice.SPEED * np.stack(
        [np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)]
    )
    rates, still = 0.15 * moved[3:], np.zeros((3, len(time)))
    found = [
        lattice.loads(v, w, lambda arm: 0.0 * arm) for v, w in zip(velocity.T, rates.T, strict=True)
    ]
    force, moment = (np.array([each[k] for each in found]).T for k in (0, 1))
    flown = {
        "time": time, "velocity": velocity, "rates": rates, "attitude": still, "place": still, "force": force,
        "moment": moment,
    }  # fmt: skip
    database = read_native(STRIPS, "strips")
    model = parse_model_file(f"parameters = {list(SHAPES)}")
    (fit,) = fits_of(
        METHODS["regression"], [_given(flown, still, database, "still")], model, database
    )
    return with_parameters(database, {name: fit[name].value for name in SHAPES})


@pytest.mark.parametrize("case", lattice.AEROSANDBOX)
def test_the_lattice_has_the_loads_of_aerosandbox(case: tuple) -> None:
    velocity, rates, slope, expected = case
    found = lattice.loads(
        np.array(velocity),
        np.array(rates),
        lambda arm: slope * arm[:, 1:2] * np.array([0.0, 0.0, 1.0]),
    )
    assert np.concatenate(found)[[2, 3]] == pytest.approx(np.array(expected)[[2, 3]], rel=0.01)
    assert np.concatenate(found)[[4]] == pytest.approx([expected[4]], rel=0.08)


@pytest.mark.parametrize("core", ["lamb_oseen", "burnham_hallock"])
def test_circulation_and_core_from_the_air_and_from_the_reaction(
    core: str, strips: AeroDatabase
) -> None:
    """Across at 60 deg. From the air at the nose within 10 %, and its law is named. From what the aircraft does, by
    regression of the parameters of the part that the wake is, both within 10 %."""
    air = lattice.wake(G, RC, B, core)
    flown = lattice.through(air, np.deg2rad(60.0), 3.0, 0.6)
    turns = [lattice.to_earth(*attitude) for attitude in flown["attitude"].T]
    nose = np.array(
        [place + turn @ NOSE for place, turn in zip(flown["place"].T, turns, strict=True)]
    )
    noise = 0.05 * np.random.default_rng(5).standard_normal(nose.shape)
    path = nose.T * np.array([[1.0], [1.0], [-1.0]])
    found = identify_wake((air(nose) + noise).T, path, heading=0.0)
    assert found.found
    assert found.core == core
    assert found.pair.circulation == pytest.approx(G, rel=0.1)
    assert found.pair.core_radius == pytest.approx(RC, rel=0.1)
    here = np.array(
        [turn.T @ each for turn, each in zip(turns, air(flown["place"].T), strict=True)]
    ).T
    right, below = found.pair.across(np.zeros((3, 1)))
    begin = {
        "vortex_strength": 0.8 * found.pair.circulation, "vortex_core": 1.3 * found.pair.core_radius,
        "vortex_spacing": found.pair.spacing, "vortex_right": -float(right[0]), "vortex_below": -float(below[0]),
    }  # fmt: skip
    limits = ((20.0, 900.0), (0.1, 6.0), (5.0, 60.0), (-20.0, 20.0), (-20.0, 20.0))
    given = [
        f"{name} = {{ value = {begin[name]}, bounds = {list(limit)} }}"
        for name, limit in zip(UNKNOWN, limits, strict=True)
    ]
    values = [f"{name} = {{ value = {value} }}" for name, value in strips.parameters.items()]
    head, _, tail = STRIPS.partition("[parameters]\n")
    text = (
        head
        + "[parameters]\n"
        + "\n".join([*values, *given])
        + "\n"
        + tail[tail.index("[parts.wing]") :]
    )
    database = read_native(text + WAKE.format(core=core), "strips in a wake")
    model = parse_model_file(f"parameters = {list(UNKNOWN)}")
    (fit,) = fits_of(METHODS["regression"], [_given(flown, here, database, "met")], model, database)
    assert fit["vortex_strength"].value == pytest.approx(G, rel=0.1)
    assert fit["vortex_core"].value == pytest.approx(RC, rel=0.1)
