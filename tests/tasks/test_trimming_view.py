"""What a vehicle file gives to a trim: masses over fuel, thrust lines, limits of combinations."""

import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.exchange import to_document
from aerodb.simulation import Condition, NoTrimError
from aerodb.tables import AeroDatabase, ReferenceGeometry, Term, parse
from aerodb.tasks.view import StatedCondition, glides, sweep_value, trim_document

VEHICLE = """\
name = "twin"
[reference]
area = 16
chord = 1.5
span = 11
[points]
moment_reference = [0, 0, 0]
[mass]
source = "fuel_table"
fuel_mass = [0, 200]
mass = [1000, 1200]
cg = [[0, 0, 0], [-0.1, 0, 0]]
Ixx = [1300, 1500]
Iyy = [1900, 1900]
Izz = [2900, 3000]
Ixz = [60, 60]
[surfaces.elevon_right]
limits = ["-20 deg", "10 deg"]
[surfaces.elevon_left]
limits = ["-20 deg", "10 deg"]
[surfaces.rudder]
limits = ["-20 deg", "20 deg"]
[combinations.elevator]
kind = "symmetric"
right = "elevon_right"
left = "elevon_left"
[combinations.aileron]
kind = "asymmetric"
right = "elevon_right"
left = "elevon_left"
[thrust]
source = "channel"
[thrust.engines.left]
point = [0.5, -2, -0.3]
[thrust.engines.right]
point = [0.5, 2, -0.3]
"""
TERMS = {
    "C_lift": "0.25 + 4.8*alpha",
    "C_drag": "0.03 + 0.05*(0.25 + 4.8*alpha)*(0.25 + 4.8*alpha)",
    "C_side": "-0.35*beta + 0.15*delta_rudder",
    "Cm": "0.02 - 0.9*alpha - 1.2*delta_elevator",
    "Cl": "-0.09*beta - 0.48*p_hat - 0.18*delta_aileron",
    "Cn": "0.065*beta - 0.1*r_hat - 0.07*delta_rudder",
}
ROW: Any = SimpleNamespace(id="v", vehicle="twin")
FLIGHT = StatedCondition(Condition(60.0, 1000.0), fuel=100.0)


def catalogue(vehicle: str = VEHICLE) -> Any:
    database = AeroDatabase(
        name="twin",
        reference=ReferenceGeometry(16.0, 1.5, 11.0, (0.0, 0.0, 0.0)),
        terms=tuple(Term(f"{axis}_all", axis, parse(text)) for axis, text in TERMS.items()),
    )
    content = json.dumps(to_document(database))
    return SimpleNamespace(
        vehicle=lambda _: SimpleNamespace(text=vehicle),
        version_documents=lambda _: SimpleNamespace(content=content),
    )


def test_fuel_gives_the_masses_and_the_engines_their_moment() -> None:
    found = trim_document(catalogue(), ROW, FLIGHT)
    channels, inputs = found["channels"], found["inputs"]
    assert not glides(catalogue(), ROW)
    # 1100 kg, CG 0.05 m behind the reference; thrust 0.3 m above it.
    force = channels["qbar"] * 16.0
    lift_z = force * channels["CZ"]
    assert -lift_z == pytest.approx(1100.0 * 9.80665 * np.cos(channels["theta"]), rel=1e-6)
    moment = force * 1.5 * channels["Cm"] - 0.05 * lift_z - 0.3 * inputs["thrust"]
    assert moment == pytest.approx(0.0, abs=1e-2)
    assert found["standard_errors"] is None


def test_combinations_are_limited_by_their_surfaces() -> None:
    """-20 to 10 deg on both sides: the elevator has the same, the aileron +- 15 deg."""
    slow = StatedCondition(Condition(33.0, 1000.0), fuel=100.0)
    with pytest.raises(NoTrimError, match=r"delta_elevator is at its lower limit, -20 deg"):
        trim_document(catalogue(VEHICLE.replace("[-0.1, 0, 0]", "[1.5, 0, 0]")), ROW, slow)
    slipping = StatedCondition(Condition(60.0, 1000.0, beta=-0.6), fuel=100.0)
    with pytest.raises(
        NoTrimError, match=r"delta_(aileron|rudder) is at its .* limit, -?(15|20) deg"
    ):
        trim_document(catalogue(), ROW, slipping)


@pytest.mark.parametrize("fuel", [None, 300.0])
def test_a_table_of_masses_needs_the_fuel(fuel: float | None) -> None:
    with pytest.raises(InputError, match="--fuel, from 0 to 200 kg"):
        trim_document(catalogue(), ROW, StatedCondition(Condition(60.0, 1000.0), fuel=fuel))


def test_logged_masses_are_asked_for() -> None:
    start, end = VEHICLE.index("source"), VEHICLE.index("[surfaces")
    logged = VEHICLE[:start] + 'source = "channels"\n' + VEHICLE[end:]
    with pytest.raises(InputError, match="--set mass=VALUE"):
        trim_document(catalogue(logged), ROW, FLIGHT)
    stated = ("mass=1100 kg", "cg_x=-5 cm", "cg_y=0", "cg_z=0", "Ixx=1400", "Iyy=1900", "Izz=2950",
              "Ixz=60")  # fmt: skip
    found = trim_document(catalogue(logged), ROW, StatedCondition(FLIGHT.condition, stated))
    same = trim_document(catalogue(), ROW, FLIGHT)
    assert found["channels"] == pytest.approx(same["channels"], abs=1e-9)


def test_controls_are_named_with_signs() -> None:
    """An interconnected rudder: the same surfaces, stated as other controls."""
    condition = Condition(60.0, 1000.0, beta=0.05)
    interconnected = ("roll=-delta_aileron + delta_rudder", "yaw=delta_rudder")
    found = trim_document(catalogue(), ROW, StatedCondition(condition, (), interconnected, 100.0))
    same = trim_document(catalogue(), ROW, StatedCondition(condition, fuel=100.0))
    assert "-delta_aileron + delta_rudder" in found["controls"]
    assert found["inputs"] == pytest.approx(same["inputs"], rel=1e-6, abs=1e-8)


def test_values_of_a_sweep_have_units() -> None:
    assert sweep_value("3 deg", "climb") == pytest.approx(np.deg2rad(3.0))
    assert sweep_value("36 km/h", "V") == pytest.approx(10.0)
    assert sweep_value("1.5", "load_factor") == 1.5
